//! Fields that tests bake, build or read.

use bevy::prelude::*;
use bevy_plenoctree::{Activation, FieldPalette, LoadSettings, Palette, PlenOctree, UpAxis};
use glam::DVec3;
use half::f16;
use plenoctree::{BakeSettings, Basis, Cell, Frame, bake};

/// A density that lets no light through.
pub const SOLID: f64 = 1e4;

/// Returns the density that has this opacity over a path of length 1.
pub fn density(opacity: f64) -> f64 {
    -(1.0 - opacity).ln()
}

/// Bakes a field from -1 to 1, with `2^depth` cells per side, whose color depends on the place alone.
pub fn colored(depth: u32, density: impl Fn(DVec3) -> f64 + Sync, color: impl Fn(DVec3) -> DVec3 + Sync) -> PlenOctree {
    // Colors are the same in all directions.
    let settings =
        BakeSettings { depth, basis: Basis::Rgba, up: UpAxis::Y, min_density: 0.0, directions: 1, ..default() };
    bake(&settings, density, |at| {
        let color = color(at);
        move |_| color
    })
    .unwrap()
}

/// Bakes a field of one color with a `density` wherever `inside` returns true, in cells of 1/8 from -1 to 1.
pub fn shape(density: f64, color: DVec3, inside: impl Fn(DVec3) -> bool + Sync) -> PlenOctree {
    colored(4, |at| if inside(at) { density } else { 0.0 }, |_| color)
}

/// Bakes the cube from -1/2 to 1/2.
pub fn cube(density: f64, color: DVec3) -> PlenOctree {
    shape(density, color, |at| at.abs().max_element() < 0.5)
}

/// Reads one of the included props.
pub fn included(name: &str) -> PlenOctree {
    let path = format!("{}/assets/{name}.plenoctree", env!("CARGO_MANIFEST_DIR"));
    PlenOctree::read(path, &LoadSettings::default()).unwrap()
}

/// Reads the palette of an included prop that has one.
pub fn included_palette(name: &str) -> FieldPalette {
    let path = format!("{}/assets/{name}.palette.json", env!("CARGO_MANIFEST_DIR"));
    FieldPalette::new(Palette::read(path).unwrap())
}

/// Returns a field in [-1, 1]^3 whose leaves have these densities and coefficients.
pub fn field(basis: Basis, nodes: Vec<[Cell; 8]>, density: Vec<f32>, coefficients: Vec<f16>) -> PlenOctree {
    let frame = Frame::spanning(DVec3::NEG_ONE, DVec3::ONE);
    PlenOctree::new(frame, basis, basis.default_activation(), UpAxis::Y, nodes, density, coefficients).unwrap()
}

/// Returns a cube of eight leaves in [-1, 1]^3.
pub fn eight(basis: Basis, density: f32, leaf: &[f16]) -> PlenOctree {
    let node = std::array::from_fn(|cell| Cell::leaf(cell as u32));
    field(basis, vec![node], vec![density; 8], leaf.repeat(8))
}

/// Returns the same field with another activation.
pub fn activated(field: &PlenOctree, activation: Activation) -> PlenOctree {
    let (nodes, density) = (field.nodes().to_vec(), field.densities().to_vec());
    let coefficients = field.coefficients().to_vec();
    PlenOctree::new(field.frame(), field.basis(), activation, field.up(), nodes, density, coefficients).unwrap()
}

/// A thin, hollow sphere in an octree, whose leaves are finest cells.
pub struct Shell {
    pub nodes: Vec<[Cell; 8]>,
    /// The centers of the leaves, from -1 to 1.
    pub leaves: Vec<DVec3>,
}

impl Shell {
    /// Creates a shell with a radius and a thickness in finest cells.
    pub fn new(depth: u32, radius: f64, thickness: f64) -> Self {
        let mut shell = Self { nodes: vec![], leaves: vec![] };
        shell.grow(radius, 0.5 * thickness, f64::from(1u32 << (depth - 1)), UVec3::ZERO, 1 << depth);
        shell
    }

    /// Adds the nodes under a cell at `corner` that the shell meets, and returns the index of the first one.
    fn grow(&mut self, radius: f64, near: f64, middle: f64, corner: UVec3, size: u32) -> u32 {
        let (node, half) = (self.nodes.len(), size / 2);
        self.nodes.push([Cell::EMPTY; 8]);
        for index in 0..8 {
            let corner = corner + half * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
            let center = corner.as_dvec3() + 0.5 * f64::from(half) - middle;
            let slack = if half == 1 { 0.0 } else { 0.87 * f64::from(half) };
            if (center.length() - radius).abs() <= near + slack {
                self.nodes[node][index as usize] = if half == 1 {
                    self.leaves.push(center / middle);
                    Cell::leaf(self.leaves.len() as u32 - 1)
                } else {
                    Cell::node(self.grow(radius, near, middle, corner, half))
                };
            }
        }
        node as u32
    }
}
