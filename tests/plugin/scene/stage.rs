//! A stage that is seen from both sides, for tests that know the color of every pixel.

use std::{fmt::Display, time::Duration};

use bevy::{
    camera::{ScalingMode, Viewport},
    prelude::*,
};
use bevy_plenoctree::{
    PlenOctree, PlenOctreePlugin, Prop, UpAxis,
    headless::{Headless, LitMeshPlugins, exact_camera},
};
use glam::{DVec2, DVec3};
use image::RgbaImage;
use plenoctree::{BakeSettings, Basis, bake};

/// The width and height of a viewport in pixels. It shows x and y from -2 to 2, with eight pixels per unit.
pub const PIXELS: u32 = 32;
/// The background color, in encoded sRGB.
pub const BACKGROUND: DVec3 = DVec3::new(0.8, 0.7, 0.6);
/// A density that lets no light through.
pub const SOLID: f64 = 1e4;

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

pub fn color(encoded: DVec3) -> Color {
    let [red, green, blue] = encoded.as_vec3().to_array();
    Color::srgb(red, green, blue)
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

/// Bakes a field of one color with a `density` wherever `inside` returns true, in cells of 1/8 from -1 to 1.
pub fn shape(density: f64, color: DVec3, inside: impl Fn(DVec3) -> bool + Sync) -> PlenOctree {
    let settings = BakeSettings { depth: 4, basis: Basis::Rgba, up: UpAxis::Y, ..default() };
    bake(&settings, |at| if inside(at) { density } else { 0.0 }, |_| move |_| color).unwrap()
}

/// Bakes the cube from -1/2 to 1/2.
pub fn cube(density: f64, color: DVec3) -> PlenOctree {
    shape(density, color, |at| at.abs().max_element() < 0.5)
}

/// Returns the density that has this opacity over a path of length 1.
pub fn density(opacity: f64) -> f64 {
    -(1.0 - opacity).ln()
}

/// An app with a stage and its two cameras.
pub struct Stage {
    pub headless: Headless,
    pub cameras: [Entity; 2],
}

impl Stage {
    /// Creates a stage for props alone.
    pub fn new() -> Self {
        Self::with(|_| ())
    }

    /// Creates a stage for props, meshes and gizmos.
    pub fn with_meshes() -> Self {
        Self::with(|app| {
            app.add_plugins(LitMeshPlugins);
        })
    }

    pub fn with(configure: impl FnOnce(&mut App)) -> Self {
        let size = Side::Behind.corner() + PIXELS;
        let mut headless = Headless::new(size, |app| {
            configure(app);
            app.add_plugins(PlenOctreePlugin);
        })
        .unwrap();
        let target = headless.target();
        let cameras = Side::BOTH.map(|side| {
            let camera = (exact_camera(color(BACKGROUND)), target.clone(), flat(), side.camera());
            let entity = headless.app.world_mut().spawn(camera).id();
            let mut camera = headless.app.world_mut().get_mut::<Camera>(entity).unwrap();
            camera.order = side as isize;
            camera.viewport =
                Some(Viewport { physical_position: side.corner(), physical_size: UVec2::splat(PIXELS), ..default() });
            entity
        });
        Self { headless, cameras }
    }

    pub fn world(&mut self) -> &mut World {
        self.headless.app.world_mut()
    }

    pub fn add(&mut self, field: &PlenOctree) -> Handle<PlenOctree> {
        self.world().resource_mut::<Assets<PlenOctree>>().add(field.clone())
    }

    pub fn spawn_prop(&mut self, field: &PlenOctree, transform: Transform) -> Entity {
        let field = self.add(field);
        self.world().spawn((Prop(field), transform)).id()
    }

    /// Spawns an unlit, double-sided rectangle. An `alpha` below 1 makes it a pane of glass.
    pub fn spawn_rectangle(&mut self, low: (f32, f32), high: (f32, f32), z: f32, encoded: DVec3, alpha: f32) -> Entity {
        let (low, high) = (Vec2::from(low), Vec2::from(high));
        let world = self.world();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::from_size(high - low));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
            base_color: color(encoded).with_alpha(alpha),
            unlit: true,
            cull_mode: None,
            alpha_mode: if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            ..default()
        });
        let transform = Transform::from_translation((0.5 * (low + high)).extend(z));
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), transform)).id()
    }

    pub fn wait(&mut self) {
        self.headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    }

    pub fn capture(&mut self) -> RgbaImage {
        self.headless.capture().unwrap()
    }

    /// Captures a frame and asserts that every pixel of both viewports is within 2/255 of the expected color, if there
    /// is one for its place.
    pub fn check<E: Into<Option<DVec3>>>(&mut self, what: impl Display, expected: impl Fn(Side, DVec2) -> E) {
        let frame = self.capture();
        for side in Side::BOTH {
            let mut wrong = Vec::new();
            for (x, y) in (0..PIXELS).flat_map(|y| (0..PIXELS).map(move |x| (x, y))) {
                let place = (DVec2::new(x.into(), y.into()) + 0.5) / 8.0 - 2.0;
                let place = DVec2::new(side.sign() * place.x, -place.y);
                let corner = side.corner();
                let pixel = frame.get_pixel(corner.x + x, corner.y + y);
                let pixel = DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into());
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
