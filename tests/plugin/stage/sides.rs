//! A stage that is seen from both sides, for tests that know the color of every pixel.

use std::fmt::Display;

use bevy::{
    camera::{Hdr, ScalingMode, Viewport},
    prelude::*,
};
use bevy_plenoctree::{
    Prop,
    headless::{LitMeshPlugins, exact_camera},
};
use glam::{DVec2, DVec3};

use super::{Stage, pixels::steps, unlit};
pub use super::{
    fields::{SOLID, cube, density, shape},
    pixels::color,
};

/// The width and height of a viewport in pixels. It shows x and y from -2 to 2, with eight pixels per unit.
pub const PIXELS: u32 = 32;
/// The background color, in encoded sRGB.
pub const BACKGROUND: DVec3 = DVec3::new(0.8, 0.7, 0.6);

pub const RED: DVec3 = DVec3::new(0.8, 0.1, 0.2);
pub const BLUE: DVec3 = DVec3::new(0.1, 0.3, 0.9);
pub const GREEN: DVec3 = DVec3::new(0.2, 0.6, 0.1);

/// The side from which a camera sees the stage. Both cameras face along z and draw to viewports of one target, which
/// have the same size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// From positive z: x grows to the right.
    Front,
    /// From negative z: x grows to the left.
    Behind,
}

impl Side {
    const BOTH: [Self; 2] = [Self::Front, Self::Behind];

    /// Returns 1 if a greater z is nearer, and -1 if it is farther away.
    pub fn sign(self) -> f64 {
        match self {
            Self::Front => 1.0,
            Self::Behind => -1.0,
        }
    }

    fn corner(self) -> UVec2 {
        match self {
            Self::Front => UVec2::ZERO,
            Self::Behind => UVec2::new(PIXELS + 8, 8),
        }
    }

    fn camera(self) -> Transform {
        Transform::from_xyz(0.0, 0.0, 5.0 * self.sign() as f32).looking_at(Vec3::ZERO, Vec3::Y)
    }
}

/// A layer that covers a pixel: its z, its encoded color and its opacity.
pub type Layer = (f64, DVec3, f64);

/// Composites the layers of a pixel over the background, in encoded sRGB as for props.
pub fn seen(side: Side, layers: &[Layer]) -> DVec3 {
    let mut layers = layers.to_vec();
    layers.sort_by(|a, b| (side.sign() * a.0).total_cmp(&(side.sign() * b.0)));
    layers.iter().fold(BACKGROUND, |below, (_, color, opacity)| below.lerp(*color, *opacity))
}

pub fn within(place: DVec2, low: (f64, f64), high: (f64, f64)) -> bool {
    place.cmpgt(low.into()).all() && place.cmplt(high.into()).all()
}

/// Whether [`cube`] covers a place.
pub fn in_cube(place: DVec2) -> bool {
    within(place, (-0.5, -0.5), (0.5, 0.5))
}

/// Returns the orthographic projection of the stage's cameras.
pub fn flat() -> Projection {
    let scaling_mode = ScalingMode::Fixed { width: 4.0, height: 4.0 };
    Projection::Orthographic(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() })
}

/// A stage with two cameras.
#[derive(Deref, DerefMut)]
pub struct Sides {
    #[deref]
    pub stage: Stage,
    pub cameras: [Entity; 2],
}

impl Sides {
    /// Creates a stage for props alone.
    pub fn new() -> Self {
        Self::with(|_| ())
    }

    /// Creates a stage for props, meshes and gizmos.
    pub fn with_meshes() -> Self {
        Self::with(|app| _ = app.add_plugins(LitMeshPlugins))
    }

    pub fn with(configure: impl FnOnce(&mut App)) -> Self {
        let stage = Stage::with(Side::Behind.corner() + PIXELS, configure);
        let mut sides = Self { cameras: [stage.camera; 2], stage };
        sides.reset();
        sides
    }

    /// Despawns what is on the stage, and replaces the cameras.
    pub fn reset(&mut self) {
        self.props.clear();
        let world = self.world();
        type Spawned = Or<(With<Camera>, With<Prop>, With<Mesh3d>, With<Gizmo>, With<DirectionalLight>)>;
        let mut all = world.query_filtered::<Entity, Spawned>();
        for entity in all.iter(world).collect::<Vec<_>>() {
            world.despawn(entity);
        }
        self.cameras = Side::BOTH.map(|side| {
            let target = self.headless.target();
            let camera = self.spawn((exact_camera(color(BACKGROUND)), target, flat(), side.camera()));
            let mut settings = self.world().get_mut::<Camera>(camera).unwrap();
            settings.order = side as isize;
            settings.viewport =
                Some(Viewport { physical_position: side.corner(), physical_size: UVec2::splat(PIXELS), ..default() });
            camera
        });
        self.stage.camera = self.cameras[0];
    }

    /// Runs tests one after another, because starting an app takes longer than most of them.
    pub fn run(mut self, tests: &[fn(&mut Self)]) {
        for test in tests {
            self.reset();
            test(&mut self);
        }
    }

    /// Inserts components into both cameras.
    pub fn set_both(&mut self, components: impl Bundle + Clone) {
        for camera in self.cameras {
            self.insert(camera, components.clone());
        }
    }

    /// Removes components from both cameras.
    pub fn unset_both<T: Bundle>(&mut self) {
        for camera in self.cameras {
            self.world().entity_mut(camera).remove::<T>();
        }
    }

    /// Sets how both cameras draw.
    pub fn set_mode(&mut self, msaa: Msaa, hdr: bool) {
        self.set_both(msaa);
        if hdr { self.set_both(Hdr) } else { self.unset_both::<Hdr>() }
    }

    /// Spawns an unlit, double-sided rectangle. An `alpha` below 1 makes it a pane of glass.
    pub fn spawn_rectangle(&mut self, low: (f32, f32), high: (f32, f32), z: f32, encoded: DVec3, alpha: f32) -> Entity {
        let (low, high) = (Vec2::from(low), Vec2::from(high));
        let place = Transform::from_translation((0.5 * (low + high)).extend(z));
        self.spawn_mesh(Rectangle::from_size(high - low), unlit(color(encoded).with_alpha(alpha)), place)
    }

    /// Captures a frame and asserts that every pixel of both viewports is within 2/255 of the expected color, if there
    /// is one for its place.
    #[track_caller]
    pub fn check<E: Into<Option<DVec3>>>(&mut self, what: impl Display, expected: impl Fn(Side, DVec2) -> E) {
        let frame = self.capture();
        for side in Side::BOTH {
            let mut wrong = Vec::new();
            for (x, y) in (0..PIXELS).flat_map(|y| (0..PIXELS).map(move |x| (x, y))) {
                let place = (DVec2::new(x.into(), y.into()) + 0.5) / 8.0 - 2.0;
                let place = DVec2::new(side.sign() * place.x, -place.y);
                let corner = side.corner();
                let pixel = steps(frame.get_pixel(corner.x + x, corner.y + y));
                if let Some(expected) = expected(side, place).into().map(|color| 255.0 * color)
                    && (pixel - expected).abs().max_element() > 2.0
                {
                    wrong.push(format!("{pixel} at {place}, expected {expected:.1}"));
                }
            }
            let some = wrong.iter().step_by(wrong.len() / 8 + 1).cloned().collect::<Vec<_>>().join("\n");
            assert!(wrong.is_empty(), "{what}, {side:?}: {} pixels are wrong:\n{some}", wrong.len());
        }
    }
}
