//! Draws a field in frames that follow one another.

use std::time::Duration;

use bevy::prelude::*;
use bevy_plenoctree::{
    BorderSmoothing, EdgeSmoothing, FieldPalette, Ink, Palettes, PlenOctreePlugin, Posterize, Prop,
    headless::{Headless, exact_camera, pinhole_view},
};
use image::RgbaImage;
use plenoctree::{PlenOctree, UpAxis, camera::PinholeCamera, palette::Palette};
use plenoctree_cli::result::Result;

use super::arguments::Arguments;

/// What is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The codes of labels.
    Labels,
    /// The labels, with smooth borders and edges.
    Shown,
    /// The same, with ink.
    Inked,
}

/// A field alone, and its camera.
pub struct Stage {
    headless: Headless,
    up: UpAxis,
    field: Handle<PlenOctree>,
    prop: Entity,
    camera: Entity,
    ink: f32,
}

impl Stage {
    pub fn new(field: &PlenOctree, palette: &Palette, arguments: &Arguments) -> Result<Self> {
        let up = field.up();
        let mut headless = Headless::new(arguments.size.into(), |app| {
            app.add_plugins(PlenOctreePlugin);
        })?;
        let target = headless.target();
        let world = headless.app.world_mut();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
        world.resource_mut::<Palettes>().insert(&field, FieldPalette::new(palette.clone()));
        let prop = world.spawn((Prop(field.clone()), Posterize::toon())).id();
        let camera = world.spawn((exact_camera(Color::WHITE), target)).id();
        if arguments.msaa {
            world.entity_mut(camera).insert(Msaa::Sample4);
        }
        headless.wait_until_ready(Duration::from_secs(600))?;
        Ok(Self { headless, up, field, prop, camera, ink: arguments.ink })
    }

    pub fn set(&mut self, steadiness: f32, kind: Kind) {
        let world = self.headless.app.world_mut();
        let mut prop = world.entity_mut(self.prop);
        let mut posterize = Posterize { steadiness, ..Posterize::toon() };
        prop.remove::<Ink>();
        match kind {
            Kind::Labels => (posterize.edges, posterize.borders) = (EdgeSmoothing::Off, BorderSmoothing::Off),
            Kind::Shown => {}
            Kind::Inked => {
                prop.insert(Ink { width: self.ink, ..default() });
            }
        }
        prop.insert(posterize);
        if let Some(palette) = world.resource_mut::<Palettes>().get_mut(&self.field) {
            palette.reset();
            if kind == Kind::Labels {
                let codes: Vec<_> = (0..palette.source().len()).map(code).collect();
                palette.show(codes);
            }
        }
    }

    /// Captures the next frame.
    pub fn capture(&mut self, camera: &PinholeCamera) -> Result<RgbaImage> {
        let view = pinhole_view(camera, self.up);
        self.headless.app.world_mut().entity_mut(self.camera).insert(view);
        Ok(self.headless.capture()?)
    }
}

/// The difference between the codes of two labels, of 255.
const STEP: u8 = 4;

/// Returns a color that tells a label from all others.
fn code(label: usize) -> Color {
    Color::srgb_u8(2 + STEP * label as u8, 10, 250)
}

/// Returns the label whose code a pixel shows.
pub fn label_of(pixel: &image::Rgba<u8>, labels: usize) -> Option<usize> {
    let [red, green, blue, _] = pixel.0;
    let label = usize::from(red / STEP);
    let is_code = green.abs_diff(10) <= 1 && blue.abs_diff(250) <= 1 && red % STEP != 0 && label < labels;
    is_code.then_some(label)
}
