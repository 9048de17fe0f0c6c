//! A stage with one prop and one camera, for small frames.

use std::time::Duration;

use bevy::prelude::*;
use bevy_plenoctree::{
    Activation, FieldPalette, Palette, Palettes, PlenOctree, PlenOctreePlugin, Prop, UpAxis,
    headless::{Headless, exact_camera, pinhole_view},
};
use glam::{DMat4, DVec3};
use half::f16;
use image::RgbaImage;
use plenoctree::{Basis, Cell, Frame, camera::PinholeCamera, reference};

pub const SIZE: u32 = 33;

pub struct Stage {
    pub headless: Headless,
    pub camera: Entity,
    pub prop: Entity,
    pub field: Handle<PlenOctree>,
}

impl Stage {
    pub fn new(field: &PlenOctree) -> Self {
        Self::with_palette(field, Palette::new(vec![[0.5; 3]]).unwrap())
    }

    pub fn with_palette(field: &PlenOctree, palette: Palette) -> Self {
        let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
            app.add_plugins(PlenOctreePlugin);
        })
        .unwrap();
        let target = headless.target();
        let world = headless.app.world_mut();
        let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
        world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette));
        let prop = world.spawn(Prop(handle.clone())).id();
        let camera = world.spawn((exact_camera(Color::BLACK), target)).id();
        headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        Self { headless, camera, prop, field: handle }
    }

    pub fn capture(&mut self, camera: &PinholeCamera) -> RgbaImage {
        let view = pinhole_view(camera, UpAxis::Y);
        self.headless.app.world_mut().entity_mut(self.camera).insert(view);
        self.headless.capture().unwrap()
    }

    /// Asserts that the frame matches the float64 reference, over black.
    pub fn check(&mut self, field: &PlenOctree, camera: &PinholeCamera, what: &str) {
        // Rounding to 8 bits alone makes a difference of 0.29.
        let difference = self.difference(field, camera);
        assert!(difference < 0.6, "{what}: {difference}");
    }

    /// Returns the root mean square difference from the float64 reference, over black, in 8-bit steps.
    pub fn difference(&mut self, field: &PlenOctree, camera: &PinholeCamera) -> f64 {
        difference(&self.capture(camera), &reference::render(field, camera).over(DVec3::ZERO))
    }
}

/// Returns the root mean square difference of a frame from the expected colors, in 8-bit steps.
pub fn difference(frame: &RgbaImage, expected: &[DVec3]) -> f64 {
    let squares = frame.pixels().zip(expected).map(|(pixel, color)| {
        let seen = DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into());
        (seen - 255.0 * color.clamp(DVec3::ZERO, DVec3::ONE)).length_squared() / 3.0
    });
    (squares.sum::<f64>() / expected.len() as f64).sqrt()
}

/// Returns a camera at `position` that looks at `target`.
pub fn looking(position: DVec3, target: DVec3) -> PinholeCamera {
    let up = if (target - position).normalize().y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    PinholeCamera::new(SIZE, SIZE, 0.8, DMat4::IDENTITY).looking_at(position, target, up)
}

/// Returns a field in [-1, 1]^3 whose leaves have these densities and coefficients.
pub fn field(basis: Basis, nodes: Vec<[Cell; 8]>, density: Vec<f32>, coefficients: Vec<f16>) -> PlenOctree {
    let frame = Frame::spanning(DVec3::NEG_ONE, DVec3::ONE);
    PlenOctree::new(frame, basis, basis.default_activation(), UpAxis::Y, nodes, density, coefficients).unwrap()
}

/// Returns a field of one color with a chain of nodes toward the cell of index `corner`. The cell at `depth` has the
/// density `last`, and the cells next to the chain have the density `beside`.
pub fn chain(depth: u32, corner: usize, beside: Option<f32>, last: f32) -> PlenOctree {
    let (mut nodes, mut density) = (Vec::new(), Vec::new());
    let leaf = |value: f32, density: &mut Vec<f32>| {
        density.push(value);
        Cell::leaf(density.len() as u32 - 1)
    };
    for level in 1..=depth {
        nodes.push(std::array::from_fn(|cell| match (cell == corner, beside) {
            (true, _) if level == depth => leaf(last, &mut density),
            (true, _) => Cell::node(level),
            (false, Some(value)) => leaf(value, &mut density),
            (false, None) => Cell::EMPTY,
        }));
    }
    let coefficients = [0.25, 0.5, 1.0].map(f16::from_f32).repeat(density.len());
    field(Basis::Rgba, nodes, density, coefficients)
}

/// Returns the same field with another activation.
pub fn activated(field: &PlenOctree, activation: Activation) -> PlenOctree {
    let (nodes, density) = (field.nodes().to_vec(), field.densities().to_vec());
    let coefficients = field.coefficients().to_vec();
    PlenOctree::new(field.frame(), field.basis(), activation, field.up(), nodes, density, coefficients).unwrap()
}

/// Whether two colors are equal to within one 8-bit step.
pub fn is_near(seen: [u8; 4], expected: [u8; 4]) -> bool {
    seen.iter().zip(expected).all(|(seen, expected)| seen.abs_diff(expected) <= 1)
}
