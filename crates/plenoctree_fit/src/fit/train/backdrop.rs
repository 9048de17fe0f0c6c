//! The backdrop: what is behind the field.

use glam::{DVec3, Vec3};

/// Texels along each side of a learned backdrop. With more, only a view or two see most of them.
const SIDE: usize = 20;
/// Decay of the mean square of its gradient.
const DECAY: f32 = 0.9;

/// The color behind the field, by direction.
#[derive(Clone, Debug)]
pub enum Backdrop {
    /// A random color behind every ray, for pictures that know their opacity.
    Random,
    /// A known color.
    Color(Vec3),
    /// Learned colors, on an octahedral map.
    Learned(Box<Map>),
}

/// Colors by direction.
#[derive(Clone, Debug)]
pub struct Map {
    texels: Vec<Vec3>,
    squares: Vec<Vec3>,
}

/// The four texels around a direction, and their weights.
#[derive(Clone, Copy, Debug)]
pub struct Lookup {
    texels: [u32; 4],
    weights: [f32; 4],
}

impl Backdrop {
    /// Creates a backdrop to learn, which starts with one color.
    pub fn learned(color: Vec3) -> Self {
        let (texels, squares) = (vec![color; SIDE * SIDE], vec![Vec3::ZERO; SIDE * SIDE]);
        Self::Learned(Box::new(Map { texels, squares }))
    }

    /// Returns the learned colors.
    pub fn texels(&self) -> Vec<Vec3> {
        match self {
            Self::Learned(map) => map.texels.clone(),
            _ => Vec::new(),
        }
    }

    /// Returns the backdrop with these learned colors, as many as it has.
    pub fn with_texels(mut self, texels: Vec<Vec3>) -> Self {
        if let Self::Learned(map) = &mut self {
            map.texels = texels;
        }
        self
    }

    /// Returns the color behind the field in `direction`. `random` is the color of a random backdrop.
    pub fn color(&self, direction: DVec3, random: Vec3) -> Vec3 {
        match self {
            Self::Random => random,
            Self::Color(color) => *color,
            Self::Learned(map) => map.color(&Lookup::new(direction)),
        }
    }
}

impl Map {
    pub fn color(&self, lookup: &Lookup) -> Vec3 {
        (lookup.texels.iter().zip(lookup.weights)).map(|(&texel, weight)| weight * self.texels[texel as usize]).sum()
    }

    /// Moves the colors against the gradient, at this `rate`.
    pub fn update(&mut self, gradients: impl Iterator<Item = (Lookup, Vec3)>, rate: f32) {
        let mut sums = vec![Vec3::ZERO; self.texels.len()];
        for (lookup, gradient) in gradients {
            for (texel, weight) in lookup.texels.into_iter().zip(lookup.weights) {
                sums[texel as usize] += weight * gradient;
            }
        }
        for ((texel, square), sum) in self.texels.iter_mut().zip(&mut self.squares).zip(sums) {
            if sum != Vec3::ZERO {
                *square = if *square == Vec3::ZERO { sum * sum } else { DECAY * *square + (1.0 - DECAY) * sum * sum };
                let root = square.to_array().map(|square| square.sqrt() + 1e-8);
                *texel = (*texel - rate * sum / Vec3::from_array(root)).clamp(Vec3::ZERO, Vec3::ONE);
            }
        }
    }
}

impl Lookup {
    pub fn new(direction: DVec3) -> Self {
        let folded = direction / direction.abs().element_sum();
        let (mut x, mut y) = (folded.x, folded.y);
        if folded.z < 0.0 {
            (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
        }
        let place = |at: f64| ((0.5 * at + 0.5) * SIDE as f64 - 0.5).clamp(0.0, SIDE as f64 - 1.0);
        let (x, y) = (place(x), place(y));
        let (left, top) = ((x as usize).min(SIDE - 2), (y as usize).min(SIDE - 2));
        let (right, bottom) = ((x - left as f64) as f32, (y - top as f64) as f32);
        let first = (top * SIDE + left) as u32;
        Self {
            texels: [first, first + 1, first + SIDE as u32, first + SIDE as u32 + 1],
            weights: [(1.0 - right) * (1.0 - bottom), right * (1.0 - bottom), (1.0 - right) * bottom, right * bottom],
        }
    }
}
