//! The scene, and the images to compare.

use std::time::Duration;

use bevy::{
    prelude::*,
    render::{RenderApp, renderer::RenderDevice},
};
use bevy_plenoctree::{
    FieldPalette, GpuField, Palettes, PlenOctreePlugin, Posterize, Prop,
    headless::{Headless, exact_camera, pinhole_view},
};
use image::{DynamicImage, RgbImage, RgbaImage};
use plenoctree::{
    PlenOctree, UpAxis,
    camera::PinholeCamera,
    palette::{Palette, simplify_hull},
};

use super::series::Frame;
use crate::Result;

/// How long to wait until the field is on the GPU.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(120);
/// The number of degrees by which recoloring rotates hues. 120 would only permute the channels, and change no
/// difference.
const HUE_TURN: f32 = 180.0;

/// A field alone in front of a white background, and its camera.
pub struct Stage {
    headless: Headless,
    posterize: Posterize,
    up: UpAxis,
    /// The field's palette.
    palette: Palette,
    field: Handle<PlenOctree>,
    prop: Entity,
    camera: Entity,
}

impl Stage {
    /// Starts an app and uploads the field.
    pub fn new(field: PlenOctree, palette: Palette, size: (u32, u32)) -> Result<Self> {
        let mut headless = Headless::new(size.into(), |app| {
            app.add_plugins(PlenOctreePlugin);
        })?;
        let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
        GpuField::check(&field, &device.limits())?;

        let target = headless.target();
        let world = headless.app.world_mut();
        let up = field.up();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(field);
        let prop = world.spawn(Prop(field.clone())).id();
        let camera = world
            // White but transparent, so that the alpha of a frame as trained is the field's opacity.
            .spawn((exact_camera(Color::srgba(1.0, 1.0, 1.0, 0.0)), target))
            .id();
        headless.wait_until_ready(UPLOAD_TIMEOUT)?;
        Ok(Self { headless, posterize: Posterize::default(), up, palette, field, prop, camera })
    }

    /// Captures one view in all the versions to compare.
    pub fn capture(&mut self, camera: &PinholeCamera) -> Result<Frame> {
        let world = self.headless.app.world_mut();
        world.entity_mut(self.camera).insert(pinhole_view(camera, self.up));
        world.entity_mut(self.prop).remove::<Posterize>();
        let plain = self.headless.capture()?;
        let colors = self.object_colors(&plain);
        if colors.is_empty() {
            return Err("no pixel is opaque enough to be posterized".into());
        }
        let palette_of_frame = simplify_hull(&colors, self.palette.colors.len())?;

        self.headless.app.world_mut().entity_mut(self.prop).insert(self.posterize);
        let [field, field_recolored] = self.posterized(self.palette.clone())?;
        let [per_frame, per_frame_recolored] = self.posterized(palette_of_frame)?;
        let plain = DynamicImage::from(plain).into_rgb8();
        Ok(Frame { images: [plain, field, per_frame, field_recolored, per_frame_recolored] })
    }

    /// Returns the colors of the pixels that are posterized, in encoded sRGB from 0 to 1.
    fn object_colors(&self, plain: &RgbaImage) -> Vec<[f64; 3]> {
        let share = |channel: u8| f64::from(channel) / 255.0;
        let pixels = plain.pixels().filter(|pixel| share(pixel[3]) >= f64::from(self.posterize.min_opacity));
        pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]].map(share)).collect()
    }

    /// Captures the view posterized with a palette, and then recolored.
    fn posterized(&mut self, palette: Palette) -> Result<[RgbImage; 2]> {
        let mut palette = FieldPalette::new(palette);
        let unchanged = self.capture_with(palette.clone())?;
        for color in palette.shown_mut() {
            *color = Hsva::from(*color).rotate_hue(HUE_TURN).into();
        }
        Ok([unchanged, self.capture_with(palette)?])
    }

    fn capture_with(&mut self, palette: FieldPalette) -> Result<RgbImage> {
        self.headless.app.world_mut().resource_mut::<Palettes>().insert(&self.field, palette);
        Ok(DynamicImage::from(self.headless.capture()?).into_rgb8())
    }
}
