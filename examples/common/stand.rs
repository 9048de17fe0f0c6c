//! Places props on the ground and gives them shadows. Props cast no shadows themselves, so simple meshes that only
//! lights see cast them instead, and a soft dark spot lies under each prop.

use std::collections::HashMap;

use bevy::{
    asset::RenderAssetUsages,
    camera::visibility::RenderLayers,
    image::{Image, ImageSampler},
    light::{NotShadowCaster, NotShadowReceiver},
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};

pub fn plugin(app: &mut App) {
    app.init_resource::<Shadows>().add_observer(add_shadow).add_observer(show_casters);
}

/// The height of the origin of the included props above the ground.
const GROUND: f32 = 0.93;

/// Returns the transform of a prop that stands on the ground at `at`. A `turn` of 0 faces +z.
pub fn standing(at: Vec3, scale: f32, turn: f32) -> Transform {
    Transform::from_translation(at + GROUND * scale * Vec3::Y)
        .with_rotation(Quat::from_rotation_y(turn))
        .with_scale(Vec3::splat(scale))
}

/// Gives an entity with one of the included props a shadow.
#[derive(Component, Clone, Copy)]
pub struct Footprint(&'static str);

impl Footprint {
    /// The footprint of the prop in `file`.
    pub fn of(file: &'static str) -> Self {
        Self(file)
    }

    /// Half the size of the ground that the prop covers, along x and z.
    fn half_size(self) -> Vec2 {
        match self.0 {
            "toadstool.npz" => Vec2::splat(0.9),
            "drum.npz" => Vec2::splat(0.96),
            "gumballs.npz" => Vec2::splat(0.7),
            _ => Vec2::new(0.48, 0.34),
        }
    }

    /// The meshes that cast the prop's shadow, which roughly match its shape, each with the height of its center.
    fn casters(self) -> Vec<(Mesh, f32)> {
        match self.0 {
            "toadstool.npz" => vec![
                (Cylinder::new(0.85, 0.14).into(), -0.86),
                (Cylinder::new(0.42, 1.0).into(), -0.3),
                (Mesh::from(Sphere::new(0.85)).scaled_by(Vec3::new(1.0, 0.6, 1.0)), 0.3),
            ],
            "drum.npz" => vec![(Cylinder::new(0.1, 0.8).into(), -0.5), (Cylinder::new(0.7, 0.62).into(), 0.12)],
            "gumballs.npz" => vec![
                (ConicalFrustum { radius_top: 0.42, radius_bottom: 0.64, height: 0.85 }.into(), -0.5),
                (Sphere::new(0.6).into(), 0.28),
                (Sphere::new(0.22).into(), 0.85),
            ],
            _ => vec![
                (Cuboid::new(0.56, 0.56, 0.36).into(), -0.63),
                (Cuboid::new(0.72, 0.56, 0.42).into(), -0.08),
                (Cuboid::new(1.2, 0.16, 0.16).into(), 0.0),
                (Cuboid::new(0.56, 0.48, 0.42).into(), 0.48),
                (Cylinder::new(0.05, 0.3).into(), 0.85),
            ],
        }
    }
}

/// The render layer of the meshes that cast shadows. No camera sees it.
const UNSEEN: usize = 1;

/// Makes every light see the meshes that cast shadows.
fn show_casters(added: On<Add, (DirectionalLight, PointLight)>, mut commands: Commands) {
    commands.entity(added.entity).insert(RenderLayers::from_layers(&[0, UNSEEN]));
}

/// The size of the dark spot, relative to the footprint.
const REACH: f32 = 1.3;
/// The opacity of the spot at its center.
const DARKNESS: f32 = 0.55;
/// The width and height of the spot's texture, in pixels.
const PIXELS: u32 = 64;

/// The assets that shadows share. Copies of a prop have the same casters.
#[derive(Resource)]
struct Shadows {
    casters: HashMap<&'static str, Vec<(Handle<Mesh>, f32)>>,
    plain: Handle<StandardMaterial>,
    plane: Handle<Mesh>,
    spot: Handle<StandardMaterial>,
}

impl FromWorld for Shadows {
    fn from_world(world: &mut World) -> Self {
        let image = world.resource_mut::<Assets<Image>>().add(soft_disc());
        let spot = StandardMaterial {
            base_color: Color::BLACK,
            base_color_texture: Some(image),
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..default()
        };
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let (plain, spot) = (materials.add(StandardMaterial::default()), materials.add(spot));
        let plane = world.resource_mut::<Assets<Mesh>>().add(Plane3d::new(Vec3::Y, Vec2::ONE));
        Self { casters: HashMap::new(), plain, plane, spot }
    }
}

/// Returns a white disc that is most opaque at its center and fades out toward its edge.
fn soft_disc() -> Image {
    let size = Extent3d { width: PIXELS, height: PIXELS, ..default() };
    let across = |pixel: u32| 2.0 * (pixel as f32 + 0.5) / PIXELS as f32 - 1.0;
    let alpha = |x: u32, y: u32| DARKNESS * (1.0 - Vec2::new(across(x), across(y)).length()).max(0.0).sqrt();
    let pixels = (0..PIXELS * PIXELS).flat_map(|i| [255, 255, 255, (255.0 * alpha(i % PIXELS, i / PIXELS)) as u8]);
    let (data, format) = (pixels.collect(), TextureFormat::Rgba8UnormSrgb);
    let mut image = Image::new(size, TextureDimension::D2, data, format, RenderAssetUsages::RENDER_WORLD);
    image.sampler = ImageSampler::linear();
    image
}

fn add_shadow(
    added: On<Add, Footprint>,
    props: Query<&Footprint>,
    mut shadows: ResMut<Shadows>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut commands: Commands,
) {
    let Ok(footprint) = props.get(added.entity) else {
        return;
    };
    let Shadows { casters, plain, plane, spot } = &mut *shadows;
    let casters = casters
        .entry(footprint.0)
        .or_insert_with(|| footprint.casters().into_iter().map(|(mesh, height)| (meshes.add(mesh), height)).collect());
    let size = REACH * footprint.half_size();
    commands.entity(added.entity).with_children(|prop| {
        prop.spawn((
            Mesh3d(plane.clone()),
            MeshMaterial3d(spot.clone()),
            Transform::from_xyz(0.0, 0.01 - GROUND, 0.0).with_scale(Vec3::new(size.x, 1.0, size.y)),
            NotShadowCaster,
            NotShadowReceiver,
        ));
        for (mesh, height) in casters {
            prop.spawn((
                Mesh3d(mesh.clone()),
                MeshMaterial3d(plain.clone()),
                Transform::from_xyz(0.0, *height, 0.0),
                RenderLayers::layer(UNSEEN),
            ));
        }
    });
}
