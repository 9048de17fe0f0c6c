//! A scene whose frames can be worked out by hand.

use std::time::Duration;

use bevy::{camera::ScalingMode, prelude::*};
use bevy_plenoctree::{
    FieldPalette, Palette, Palettes, PlenOctree, PlenOctreePlugin, Prop,
    headless::{Headless, LitMeshPlugins, exact_camera},
};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{BakeSettings, Basis, bake};

/// The width and height of a frame, in pixels.
pub const SIZE: u32 = 48;
/// The color that the field emits, the first of its palette.
pub const COLOR: Color = Color::srgb(0.6, 0.3, 0.8);
/// The source colors of the palette.
pub const PALETTE: [Color; 3] = [COLOR, Color::srgb(0.1, 0.15, 0.1), Color::srgb(0.9, 0.85, 0.3)];
/// The shown colors of the palette.
pub const SHOWN: [Color; 3] =
    [Color::srgb(0.1, 0.55, 0.85), Color::srgb(0.98, 0.97, 0.9), Color::srgb(0.75, 0.15, 0.2)];

/// A density that lets no light through.
pub const SOLID: f64 = 1e4;

/// Bakes the cube from -0.5 to 0.5, in [`COLOR`].
pub fn cube(density: f64) -> PlenOctree {
    let settings = BakeSettings { depth: 3, basis: Basis::Rgba, ..default() };
    let [r, g, b] = Srgba::from(COLOR).to_f32_array_no_alpha().map(f64::from);
    bake(&settings, |at| if at.abs().max_element() < 0.5 { density } else { 0.0 }, |_| move |_| DVec3::new(r, g, b))
        .unwrap()
}

pub struct Scene {
    pub headless: Headless,
    pub field: Handle<PlenOctree>,
    pub prop: Entity,
    pub camera: Entity,
}

impl Scene {
    /// Creates a scene with a cube of this density at the origin, seen from z = 3 over black.
    pub fn new(density: f64) -> Self {
        Self::with(density, |_| {})
    }

    /// Creates the same scene in an app to which `configure` adds plugins. It may add `PlenOctreePlugin` itself.
    pub fn with(density: f64, configure: impl FnOnce(&mut App)) -> Self {
        let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
            app.add_plugins(LitMeshPlugins);
            configure(app);
            if !app.is_plugin_added::<PlenOctreePlugin>() {
                app.add_plugins(PlenOctreePlugin);
            }
        })
        .unwrap();
        let target = headless.target();
        let world = headless.app.world_mut();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(cube(density));
        world.resource_mut::<Palettes>().insert(&field, palette());
        let prop = world.spawn(Prop(field.clone())).id();
        let camera = world.spawn((exact_camera(Color::BLACK), target, Transform::from_xyz(0.0, 0.0, 3.0))).id();
        headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        Self { headless, field, prop, camera }
    }

    pub fn world(&mut self) -> &mut World {
        self.headless.app.world_mut()
    }

    /// Inserts components into the camera.
    pub fn set(&mut self, settings: impl Bundle) {
        let camera = self.camera;
        self.world().entity_mut(camera).insert(settings);
    }

    /// Inserts components into the camera if `given`, and removes them otherwise.
    pub fn set_if<T: Bundle>(&mut self, given: bool, settings: T) {
        let camera = self.camera;
        let mut camera = self.headless.app.world_mut().entity_mut(camera);
        if given {
            camera.insert(settings)
        } else {
            camera.remove::<T>()
        };
    }

    pub fn set_background(&mut self, color: Color) {
        let camera = self.camera;
        self.world().get_mut::<Camera>(camera).unwrap().clear_color = color.into();
    }

    pub fn capture(&mut self) -> RgbaImage {
        self.headless.capture().unwrap()
    }

    /// Spawns an unlit square that faces the camera. It is opaque if its color is.
    pub fn spawn_square(&mut self, center: Vec3, size: f32, color: Color) -> Entity {
        let material = StandardMaterial {
            base_color: color,
            unlit: true,
            alpha_mode: if color.is_fully_opaque() { AlphaMode::Opaque } else { AlphaMode::Blend },
            ..default()
        };
        self.spawn_material(center, size, material)
    }

    pub fn spawn_material(&mut self, center: Vec3, size: f32, material: StandardMaterial) -> Entity {
        let world = self.headless.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(size, size));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_translation(center))).id()
    }
}

/// [`PALETTE`], shown as [`SHOWN`].
pub fn palette() -> FieldPalette {
    let colors = PALETTE.map(|color| Srgba::from(color).to_f32_array_no_alpha().map(f64::from));
    let mut palette = FieldPalette::new(Palette::new(colors.to_vec()).unwrap());
    SHOWN.into_iter().enumerate().for_each(|(index, color)| _ = palette.set(index, color));
    palette
}

/// Returns a projection that shows a square of two units around the camera's axis.
pub fn orthographic() -> Projection {
    let scaling_mode = ScalingMode::Fixed { width: 2.0, height: 2.0 };
    Projection::Orthographic(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() })
}

/// Returns the color of a prop of this opacity over a background, if the camera multiplies the prop's light by
/// `exposure`.
pub fn over(opacity: f32, prop: Color, background: Color, exposure: f32) -> Color {
    let encoded = Srgba::from(background.to_linear() * (1.0 / exposure)).to_vec3();
    let mixed = Srgba::from(prop).to_vec3() * opacity + encoded * (1.0 - opacity);
    (Color::srgb(mixed.x, mixed.y, mixed.z).to_linear() * exposure).into()
}

pub fn bytes(color: Color) -> [u8; 3] {
    Srgba::from(color).to_u8_array_no_alpha()
}

pub fn at(frame: &RgbaImage, x: u32, y: u32) -> [u8; 3] {
    let [r, g, b, _] = frame.get_pixel(x, y).0;
    [r, g, b]
}

pub fn middle(frame: &RgbaImage) -> [u8; 3] {
    at(frame, frame.width() / 2, frame.height() / 2)
}

pub fn is_near(found: [u8; 3], expected: Color, tolerance: u8) -> bool {
    let expected = bytes(expected);
    (0..3).all(|c| found[c].abs_diff(expected[c]) <= tolerance)
}

#[track_caller]
pub fn assert_near(found: [u8; 3], expected: Color, tolerance: u8, what: &str) {
    assert!(is_near(found, expected, tolerance), "{what}: {found:?}, expected {:?}", bytes(expected));
}
