//! A stage with one prop and one camera, for small frames.

use bevy::prelude::*;
use bevy_plenoctree::{FieldPalette, Palette, PlenOctree, UpAxis};
use glam::{DMat4, DVec3};
use half::f16;
use image::{Rgba, RgbaImage};
use plenoctree::{Basis, Cell, camera::PinholeCamera, reference};

use crate::stage::{
    Stage,
    fields::field,
    pixels::{self, is_off, of_prop, root_mean_square, steps},
};

pub const SIZE: u32 = 33;

/// A prop over black.
#[derive(Deref, DerefMut)]
pub struct Alone(Stage);

impl Alone {
    pub fn new(field: &PlenOctree) -> Self {
        let mut stage = Stage::of(SIZE, field);
        stage.paint(FieldPalette::new(Palette::new(vec![[0.5; 3]]).unwrap()));
        Self(stage)
    }

    pub fn with_palette(field: &PlenOctree, palette: Palette) -> Self {
        let mut stage = Self::new(field);
        stage.paint(FieldPalette::new(palette));
        stage
    }

    pub fn see(&mut self, camera: &PinholeCamera) -> RgbaImage {
        self.capture_from(camera, UpAxis::Y)
    }

    /// Returns the color in the middle of the frame.
    pub fn middle(&mut self, camera: &PinholeCamera) -> [u8; 3] {
        let frame = self.see(camera);
        assert_eq!(frame.get_pixel(SIZE / 2, SIZE / 2)[3], 255, "the alpha of an opaque view");
        pixels::middle(&frame)
    }

    /// Asserts that the frame matches the float64 reference, over black.
    pub fn check(&mut self, field: &PlenOctree, camera: &PinholeCamera, what: &str) {
        // Rounding to 8 bits alone makes a difference of 0.29.
        let difference = self.difference(field, camera);
        assert!(difference < 0.6, "{what}: {difference}");
    }

    /// Shows a field, which must match the float64 reference.
    pub fn check_field(&mut self, field: &PlenOctree, camera: &PinholeCamera, what: &str) {
        self.show(field);
        self.check(field, camera, what);
    }

    /// Returns the root mean square difference of the prop from the float64 reference, over black, in 8-bit steps, without
    /// the pixels whose rays graze a cell and that show what they would on one side or the other: rounding decides whether
    /// they hit it, in rays and where GPUs round the corners of its box to 1/256 of a pixel.
    pub fn difference(&mut self, field: &PlenOctree, camera: &PinholeCamera) -> f64 {
        const NUDGES: [(f64, f64); 4] = [(5e-3, 0.0), (-5e-3, 0.0), (0.0, 5e-3), (0.0, -5e-3)];
        let (frame, expected) = (self.see(camera), reference::render(field, camera));
        let grazes = |(x, y): (u32, u32), pixel: &Rgba<u8>, color: DVec3| {
            let sides = NUDGES.map(|(right, down)| {
                let (origin, direction) = camera.ray(f64::from(x) + 0.5 + right, f64::from(y) + 0.5 + down);
                field.render_ray(origin, direction).0
            });
            let low = sides.into_iter().fold(color, DVec3::min);
            let high = sides.into_iter().fold(color, DVec3::max);
            !is_off(pixel, (steps(pixel) / 255.0).clamp(low, high), 2.0)
        };
        let pixels = of_prop(&frame, &expected, DVec3::ZERO);
        let certain = pixels.filter(|(at, pixel, color)| !is_off(pixel, *color, 2.0) || !grazes(*at, pixel, *color));
        root_mean_square(certain.map(|(_, pixel, color)| (pixel, color)))
    }
}

/// Returns a camera at `position` that looks at `target`.
pub fn looking(position: DVec3, target: DVec3) -> PinholeCamera {
    let up = if (target - position).normalize().y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    PinholeCamera::new(SIZE, SIZE, 0.8, DMat4::IDENTITY).looking_at(position, target, up)
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
