//! How shaders load words from textures.

use bevy::{
    prelude::*,
    render::{
        render_resource::{
            BindGroupLayoutEntryBuilder, StorageTextureAccess, TextureFormat, TextureSampleType, TextureUsages,
            binding_types::{texture_2d, texture_2d_array, texture_storage_2d, texture_storage_2d_array},
        },
        renderer::{RenderAdapterInfo, RenderDevice},
    },
    shader::ShaderDefVal,
};
use wgpu::{Backend, DeviceType};

/// The largest number of storage textures in the layouts of a pipeline.
const MOST_STORED: u32 = 5;

/// Whether textures of words are storage textures, which shaders only read, or sampled ones.
///
/// Both kinds of loads return the same words. From a sampled texture, Mesa's software rasterizer computes for every
/// lane where its mip level begins, even if there is only one level: three times as many instructions as a load from a
/// storage texture. Graphics cards are made to load from sampled textures.
#[derive(Resource, Clone, Copy)]
pub(crate) struct WordTextures {
    is_stored: bool,
}

pub(super) fn init(mut commands: Commands, adapter: Res<RenderAdapterInfo>, device: Res<RenderDevice>) {
    // Other backends may lack loads of several words from storage textures. Devices with the default limits of WebGPU
    // have too few of them.
    let is_emulated = adapter.device_type == DeviceType::Cpu && adapter.backend == Backend::Vulkan;
    let is_enough = device.limits().max_storage_textures_per_shader_stage >= MOST_STORED;
    commands.insert_resource(WordTextures { is_stored: is_emulated && is_enough });
}

impl WordTextures {
    /// Returns the entry of a layout for a texture.
    pub fn entry(self, format: TextureFormat) -> BindGroupLayoutEntryBuilder {
        if self.is_stored {
            texture_storage_2d(format, StorageTextureAccess::ReadOnly)
        } else {
            texture_2d(TextureSampleType::Uint)
        }
    }

    /// Returns the entry of a layout for a texture with layers.
    pub fn entry_with_layers(self, format: TextureFormat) -> BindGroupLayoutEntryBuilder {
        if self.is_stored {
            texture_storage_2d_array(format, StorageTextureAccess::ReadOnly)
        } else {
            texture_2d_array(TextureSampleType::Uint)
        }
    }

    pub fn usage(self) -> TextureUsages {
        if self.is_stored { TextureUsages::STORAGE_BINDING } else { TextureUsages::TEXTURE_BINDING }
    }

    pub fn definitions(self) -> Vec<ShaderDefVal> {
        if self.is_stored { vec!["STORED".into()] } else { vec![] }
    }
}

#[cfg(all(test, feature = "headless"))]
mod tests {
    use std::time::Duration;

    use bevy::render::{RenderApp, RenderStartup};
    use glam::DVec3;
    use half::f16;
    use image::RgbaImage;
    use plenoctree::{
        Activation, Basis, Cell, Frame, LoadSettings, PlenOctree, UpAxis, camera::PinholeCamera, palette::Palette,
    };

    use super::*;
    use crate::{
        FieldPalette, Palettes, PlenOctreePlugin, Posterize, Prop,
        gpu::{layout, records::Records},
        headless::{Headless, exact_camera, pinhole_view},
    };

    /// Draws props of a field, each a little to the side of the one before it.
    fn draw(field: &PlenOctree, props: u8, msaa: Msaa, is_stored: bool) -> RgbaImage {
        let choose = move |mut textures: ResMut<WordTextures>| textures.is_stored = is_stored;
        let mut headless = Headless::new(UVec2::splat(64), |app| {
            app.add_plugins(PlenOctreePlugin);
            app.sub_app_mut(RenderApp).add_systems(RenderStartup, choose.after(init).before(layout::init));
        })
        .unwrap();
        let camera = PinholeCamera::around(field, 64, 64, 0.5, 0.4).unwrap();
        let palette = Palette::new(vec![[0.8, 0.1, 0.1], [0.9, 0.85, 0.7], [0.2, 0.3, 0.1]]).unwrap();
        let (target, up) = (headless.target(), field.up());
        let world = headless.app.world_mut();
        let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
        world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette));
        for prop in 0..props {
            let aside = Transform::from_xyz(0.2 * f32::from(prop), 0.0, 0.0);
            world.spawn((Prop(handle.clone()), Posterize::default(), aside));
        }
        world.spawn((exact_camera(Color::WHITE), target, pinhole_view(&camera, up))).insert(msaa);
        headless.wait_until_ready(Duration::from_secs(600)).unwrap();
        headless.capture().unwrap()
    }

    /// Returns a field that has leaves at every level, too deep for all of them to be below the table alone.
    fn deep() -> PlenOctree {
        let (mut nodes, mut leaves) = (vec![[Cell::EMPTY; 8]], 0);
        let mut open = vec![(0, 1)];
        while let Some((node, level)) = open.pop() {
            for index in 0..8 {
                if (index + level) % 3 == 0 && level < 10 && nodes.len() < 5000 {
                    nodes[node][index] = Cell::node(nodes.len() as u32);
                    open.push((nodes.len(), level + 1));
                    nodes.push([Cell::EMPTY; 8]);
                } else if index % 2 == 0 {
                    nodes[node][index] = Cell::leaf(leaves);
                    leaves += 1;
                }
            }
        }
        let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
        let coefficients = (0..3 * leaves).map(|index| f16::from_f32((index * 7 % 10) as f32 / 10.0)).collect();
        let density = (0..leaves).map(|leaf| [3.0, 300.0][leaf as usize % 2]).collect();
        PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, nodes, density, coefficients).unwrap()
    }

    /// Graphics cards draw the same picture as software rasterizers: from packed fields and from others, and with the
    /// passes that only march.
    #[test]
    fn stored_words_are_the_same_as_sampled_ones() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/toadstool.plenoctree");
        let packed = PlenOctree::read(file, &LoadSettings::default()).unwrap();
        let plain = PlenOctree::new(
            packed.frame(),
            packed.basis(),
            packed.activation(),
            packed.up(),
            packed.nodes().to_vec(),
            packed.densities().to_vec(),
            packed.coefficients().into_owned(),
        )
        .unwrap();
        let deep = deep();
        assert!(Records::child_count(&deep, 0) > 1000);
        for (field, props, msaa) in [(packed, 1, Msaa::Off), (plain, 1, Msaa::Off), (deep, 2, Msaa::Sample4)] {
            let drawn = draw(&field, props, msaa, true);
            assert!(drawn.pixels().filter(|pixel| pixel.0 != [255; 4]).count() > 1000);
            assert!(drawn == draw(&field, props, msaa, false));
        }
    }
}
