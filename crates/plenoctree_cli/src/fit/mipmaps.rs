//! Mipmaps for the textures of a model, which glTF files do not contain. Without them, a texture that is finer than the
//! pixels looks different from every camera, and such noise ends up in the field.

use bevy::{
    image::{ImageFilterMode, ImageSampler, ImageSamplerDescriptor},
    prelude::*,
    render::render_resource::{TextureDimension, TextureFormat, TextureUsages},
};

/// Adds the mipmaps of every texture with four channels of 8 bits that has none, before the texture is first drawn.
/// Others remain as they are.
pub fn add_to_textures(mut images: ResMut<Assets<Image>>) {
    let handles: Vec<_> = images.iter().filter(|(_, image)| lacks_mipmaps(image)).map(|(id, _)| id).collect();
    for handle in handles {
        if let Some(mut image) = images.get_mut(handle) {
            add(&mut image);
        }
    }
}

fn lacks_mipmaps(image: &Image) -> bool {
    let descriptor = &image.texture_descriptor;
    let pixels = image.width() as usize * image.height() as usize;
    descriptor.mip_level_count == 1
        && descriptor.dimension == TextureDimension::D2
        && descriptor.size.depth_or_array_layers == 1
        // It may not be rendered to if it has several levels.
        && !descriptor.usage.contains(TextureUsages::RENDER_ATTACHMENT)
        && pixels > 1
        && matches!(descriptor.format, TextureFormat::Rgba8UnormSrgb | TextureFormat::Rgba8Unorm)
        && image.data.as_ref().is_some_and(|data| data.len() == 4 * pixels)
}

fn add(image: &mut Image) {
    let is_srgb = image.texture_descriptor.format == TextureFormat::Rgba8UnormSrgb;
    let linear: [f32; 256] = std::array::from_fn(|byte| {
        let byte = byte as u8;
        if is_srgb { Color::srgb_u8(byte, 0, 0).to_linear().red } else { f32::from(byte) / 255.0 }
    });
    let encode = |value: f32| {
        let value = if is_srgb { Srgba::from(LinearRgba::rgb(value, 0.0, 0.0)).red } else { value };
        (value * 255.0).round() as u8
    };
    // Finer than the steps of 8 bits even where sRGB is steepest.
    const STEPS: usize = 1 << 14;
    let encoded: Vec<u8> = (0..=STEPS).map(|step| encode(step as f32 / STEPS as f32)).collect();

    let (mut width, mut height) = (image.width() as usize, image.height() as usize);
    let Some(data) = &mut image.data else { return };
    let mut start = 0;
    let mut levels = 1;
    while width > 1 || height > 1 {
        let (half_width, half_height) = ((width / 2).max(1), (height / 2).max(1));
        for y in 0..half_height {
            for x in 0..half_width {
                let texels = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, down)| {
                    let (x, y) = ((2 * x + right).min(width - 1), (2 * y + down).min(height - 1));
                    start + 4 * (y * width + x)
                });
                for channel in 0..3 {
                    let light: f32 = texels.iter().map(|texel| linear[usize::from(data[texel + channel])]).sum();
                    let step = (0.25 * light * STEPS as f32).round() as usize;
                    data.push(encoded[step.min(STEPS)]);
                }
                let opacity: u32 = texels.iter().map(|texel| u32::from(data[texel + 3])).sum();
                data.push(((opacity + 2) / 4) as u8);
            }
        }
        start += 4 * width * height;
        (width, height) = (half_width, half_height);
        levels += 1;
    }
    image.texture_descriptor.mip_level_count = levels;

    let mut sampler = match &image.sampler {
        ImageSampler::Descriptor(sampler) => sampler.clone(),
        ImageSampler::Default => ImageSamplerDescriptor::linear(),
    };
    sampler.mipmap_filter = ImageFilterMode::Linear;
    sampler.min_filter = ImageFilterMode::Linear;
    // Surfaces at an angle would be blurred otherwise. Requires that all filters are linear.
    if sampler.mag_filter == ImageFilterMode::Linear {
        sampler.anisotropy_clamp = 8;
    }
    image.sampler = ImageSampler::Descriptor(sampler);
}

#[cfg(test)]
mod tests {
    use bevy::{asset::RenderAssetUsages, render::render_resource::Extent3d};

    use super::*;

    fn image(width: u32, height: u32, format: TextureFormat, data: Vec<u8>) -> Image {
        let size = Extent3d { width, height, depth_or_array_layers: 1 };
        Image::new(size, TextureDimension::D2, data, format, RenderAssetUsages::all())
    }

    /// A checkerboard becomes the color that it has from afar, in light, down to one texel.
    #[test]
    fn levels_average_light() {
        let board = |format| {
            let texels = (0..4 * 8).flat_map(|at| if (at + at / 8) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
            let mut image = image(8, 4, format, texels.collect());
            add(&mut image);
            image
        };
        for (format, gray) in [(TextureFormat::Rgba8UnormSrgb, 188), (TextureFormat::Rgba8Unorm, 128)] {
            let image = board(format);
            assert_eq!(image.texture_descriptor.mip_level_count, 4);
            let data = image.data.unwrap();
            // 8 x 4, 4 x 2, 2 x 1 and 1 x 1 texels.
            assert_eq!(data.len(), 4 * (32 + 8 + 2 + 1));
            for texel in data[4 * 32..].chunks(4) {
                assert_eq!(texel, [gray, gray, gray, 255]);
            }
        }
    }

    /// Odd sizes lose a row or a column, as they do on the GPU, and what has levels keeps them.
    #[test]
    fn every_size_has_the_levels_that_the_gpu_expects() {
        for (width, height, texels) in [(5, 3, 15 + 2 + 1), (1, 7, 7 + 3 + 1), (1, 1, 1)] {
            let pixels = (width * height) as usize;
            let mut images = Assets::<Image>::default();
            let id = images.add(image(width, height, TextureFormat::Rgba8UnormSrgb, vec![77; 4 * pixels]));
            let mut world = World::new();
            world.insert_resource(images);
            for _ in 0..2 {
                world.run_system_cached(add_to_textures).unwrap();
                let data = world.resource::<Assets<Image>>().get(&id).unwrap().data.as_ref().unwrap();
                assert_eq!(data.len(), 4 * texels);
                assert!(data.iter().all(|byte| *byte == 77));
            }
        }
    }
}
