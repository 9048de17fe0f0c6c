//! Draws one prop with the plugin, at any quality.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_plenoctree::{
    FieldPalette, Palettes, PlenOctreePlugin, Posterize, Prop,
    headless::{Headless, exact_camera, pinhole_view},
};
use image::RgbaImage;
use plenoctree::{PlenOctree, camera::PinholeCamera, palette::Palette};
use plenoctree_cli::result::Result;

use super::variants::Variant;

/// How long to wait until the field is on the GPU.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(600);

/// What changes from one frame to the next.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The camera moves imperceptibly.
    Camera,
    /// A palette color.
    Palette,
    /// Nothing.
    Nothing,
}

/// A field alone in front of a white background, and its camera.
pub struct Stage {
    headless: Headless,
    field: PlenOctree,
    prop: Entity,
    camera: Entity,
    /// Whether views are seen from a little farther to the right.
    is_right: bool,
    /// The last shade of the palette's first color.
    shade: f32,
    handle: Handle<PlenOctree>,
}

impl Stage {
    /// Starts an app and uploads the field.
    pub fn new(field: &PlenOctree, palette: &Palette, size: (u32, u32)) -> Result<Self> {
        let mut headless = Headless::new(size.into(), |app| {
            app.add_plugins(PlenOctreePlugin);
        })?;
        let target = headless.target();
        let world = headless.app.world_mut();
        let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
        world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette.clone()));
        let prop = world.spawn(Prop(handle.clone())).id();
        let camera = world.spawn((exact_camera(Color::WHITE), target)).id();
        headless.wait_until_ready(UPLOAD_TIMEOUT)?;
        Ok(Self { headless, field: field.clone(), prop, camera, is_right: false, shade: 0.0, handle })
    }

    /// Draws at a variant's quality from now on. The first frame makes the level that it requires.
    pub fn set(&mut self, variant: &Variant, posterize: Option<Posterize>) {
        let world = self.headless.app.world_mut();
        world.entity_mut(self.camera).insert(variant.quality);
        let mut prop = world.entity_mut(self.prop);
        prop.remove::<Posterize>();
        if let Some(posterize) = posterize {
            prop.insert(posterize);
        }
    }

    /// Captures a view.
    pub fn capture(&mut self, camera: &PinholeCamera) -> Result<RgbaImage> {
        let view = pinhole_view(camera, self.field.up());
        self.headless.app.world_mut().entity_mut(self.camera).insert(view);
        Ok(self.headless.capture()?)
    }

    /// Returns the seconds until a view's frame is in memory. `change` is what differs from the frame before.
    pub fn time(&mut self, camera: &PinholeCamera, change: Change) -> Result<f64> {
        match change {
            Change::Camera => self.is_right = !self.is_right,
            Change::Palette => {
                self.shade = (self.shade + 0.1) % 1.0;
                let mut palettes = self.headless.app.world_mut().resource_mut::<Palettes>();
                if let Some(palette) = palettes.get_mut(&self.handle) {
                    palette.set(0, Color::srgb(self.shade, 0.5, 0.5));
                }
            }
            Change::Nothing => {}
        }
        let aside = if self.is_right { 1e-4 } else { 0.0 };
        let camera = PinholeCamera { position: camera.position + aside * camera.rotation.x_axis, ..*camera };
        let start = Instant::now();
        self.capture(&camera)?;
        Ok(start.elapsed().as_secs_f64())
    }
}
