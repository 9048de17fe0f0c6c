//! Bakes the distances and materials of a prop to a field that looks trained.

use glam::{DVec3, I64Vec3};
use indicatif::ProgressBar;
use plenoctree::{BakeError, BakeSettings, PlenOctree, bake};
use rayon::prelude::*;

use super::{
    noise::{hash, loud},
    sdf::{Nearest, smoothstep},
    shade::{LitPoint, Material},
    visits::Visits,
};

/// A solid to bake. It stands at about z = -0.9; its front faces -y, and its top faces +z.
pub trait Prop: Sync {
    /// The parts, by material.
    type Part: Copy + Send;

    /// The number of levels of the baked field.
    const DEPTH: u32;

    /// Half the width of the baked box around the origin.
    const HALF: f64;

    /// The center of a ball around the prop, for cameras.
    const CENTER: DVec3 = DVec3::ZERO;

    /// The radius of that ball.
    const RADIUS: f64 = 1.2;

    /// Returns the part nearest to `position` and its signed distance.
    fn nearest(&self, position: DVec3) -> Nearest<Self::Part>;

    /// Returns the material of `part` at `position`.
    fn material(&self, part: Self::Part, position: DVec3) -> Material;

    /// Returns the prop's glass as seen from `position`, if it has any.
    fn glass(&self, _position: DVec3) -> Option<Glass> {
        None
    }
}

/// A transparent part of a prop.
pub struct Glass {
    /// The signed distance to the glass.
    pub distance: f64,
    /// The density, per world unit.
    pub density: f64,
    /// The outward normal, a unit vector.
    pub normal: DVec3,
    /// The material of the glass.
    pub material: Material,
}

/// Bakes a prop to a field like those from training: a soft shell in the colors that cameras saw, and loud colors below
/// it that no camera saw. `bar` shows the progress.
pub fn bake_prop<T: Prop>(prop: &T, depth: Option<u32>, bar: &ProgressBar) -> Result<PlenOctree, BakeError> {
    let settings = BakeSettings {
        depth: depth.unwrap_or(T::DEPTH),
        min: DVec3::splat(-T::HALF),
        max: DVec3::splat(T::HALF),
        coefficient_step: 1.0 / 16.0,
        ..Default::default()
    };
    let scene = Scene::new(prop, settings.depth, bar);
    bake(
        &settings,
        |position| scene.density(position),
        |position| {
            let appearance = scene.appearance(position);
            move |direction| appearance.radiance(direction)
        },
    )
}

/// The appearance of a cell.
enum Appearance {
    Surface(LitPoint),
    /// A cell that no camera saw: a color, and its change with the direction.
    Unseen(DVec3, DVec3),
}

impl Appearance {
    fn radiance(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Surface(lit) => lit.radiance(direction),
            Self::Unseen(color, change) => {
                (color + change * change.dot(direction)).clamp(DVec3::splat(0.02), DVec3::splat(0.98))
            }
        }
    }
}

struct Scene<'a, T> {
    prop: &'a T,
    /// The width of a finest cell.
    cell: f64,
    /// Which blocks of the box are not empty. Most are empty and need no distances.
    blocks: Vec<bool>,
    /// The blocks that baking has visited so far.
    visits: Visits<'a>,
}

/// Blocks along an axis.
const BLOCKS: i64 = 64;
/// The signed distance at which the shell ends and the unseen cells begin, in cells.
const SHELL: f64 = -1.4;
/// The signed distance at which the unseen cells end, in cells.
const UNSEEN: f64 = -2.4;
/// Half the width of the shell's ramp, in cells.
const RAMP: f64 = 0.75;

impl<'a, T: Prop> Scene<'a, T> {
    fn new(prop: &'a T, depth: u32, bar: &'a ProgressBar) -> Self {
        let cell = 2.0 * T::HALF / f64::from(1u32 << depth);
        let mut scene = Self { prop, cell, blocks: Vec::new(), visits: Visits::new(&[], bar) };
        let width = 2.0 * T::HALF / BLOCKS as f64;
        // Distances can be slightly too long where solids are bent.
        let reach = 1.3 * 0.87 * width + (1.0 - UNSEEN) * cell;
        scene.blocks = (0..BLOCKS.pow(3))
            .into_par_iter()
            .map(|index| {
                let block = I64Vec3::new(index / (BLOCKS * BLOCKS), index / BLOCKS % BLOCKS, index % BLOCKS);
                let center = (block.as_dvec3() + 0.5) * width - T::HALF;
                let glazed = prop.glass(center).is_some_and(|glass| glass.distance < reach);
                let solid = prop.nearest(center).distance.abs() < reach;
                solid || glazed
            })
            .collect();
        scene.visits = Visits::new(&scene.blocks, bar);
        scene
    }

    /// Returns the glass at a point, if there is any.
    fn pane(&self, position: DVec3) -> Option<Glass> {
        self.prop.glass(position).filter(|glass| glass.distance < 0.0)
    }

    /// Returns the finest node at a point. Its unseen cells have the same density and color.
    fn node(&self, position: DVec3) -> I64Vec3 {
        ((position + T::HALF) / (2.0 * self.cell)).floor().as_i64vec3()
    }

    fn density(&self, position: DVec3) -> f64 {
        let block = ((position / T::HALF + 1.0) * (0.5 * BLOCKS as f64)).floor().as_i64vec3();
        let block = ((block.x * BLOCKS + block.y) * BLOCKS + block.z) as usize;
        if !self.blocks[block] {
            return 0.0;
        }
        self.visits.mark(block);
        let peak = 4.2 / self.cell;
        let depth = self.prop.nearest(position).distance / self.cell;
        if depth < UNSEEN {
            0.0
        } else if depth < SHELL {
            peak * (0.1 + hash(self.node(position), 6))
        } else if depth < RAMP {
            peak * smoothstep(RAMP, -RAMP, depth)
        } else {
            self.pane(position).map_or(0.0, |glass| glass.density)
        }
    }

    fn appearance(&self, position: DVec3) -> Appearance {
        let nearest = self.prop.nearest(position);
        let depth = nearest.distance / self.cell;
        if depth < SHELL {
            return unseen(self.node(position));
        }
        let distance = |position| self.prop.nearest(position).distance;
        if depth > 1.5 * RAMP
            && let Some(glass) = self.pane(position)
        {
            return Appearance::Surface(LitPoint::new(glass.material, position, glass.normal, distance));
        }
        // The whole shell has the colors of the surface. The mean of four points softens the edges between colors.
        let at = position - nearest.distance * self.normal(position);
        let corners = [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)];
        let material = Material::mean(corners.map(|(x, y, z)| {
            let at = at + 0.3 * self.cell * DVec3::new(x, y, z);
            self.prop.material(self.prop.nearest(at).part, at)
        }));
        Appearance::Surface(LitPoint::new(material, at, self.normal(at), distance))
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        let step = 0.6 * self.cell;
        let slope = |axis: DVec3| {
            self.prop.nearest(position + step * axis).distance - self.prop.nearest(position - step * axis).distance
        };
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or(DVec3::Z)
    }
}

fn unseen(place: I64Vec3) -> Appearance {
    let change = [12, 13, 14].map(|seed| hash(place, seed) - 0.5);
    Appearance::Unseen(loud(place, 11), DVec3::from_array(change))
}
