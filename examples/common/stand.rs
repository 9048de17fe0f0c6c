//! Props on the ground: where they stand, and a soft dark spot beneath each, since a prop casts no shadow.

use bevy::{
    asset::RenderAssetUsages,
    image::{Image, ImageSampler},
    light::{NotShadowCaster, NotShadowReceiver},
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};

pub fn plugin(app: &mut App) {
    app.init_resource::<Spot>().add_observer(add_spot);
}

/// How far below their origin our props stand.
const GROUND: f32 = 0.93;

/// Where a prop stands on the ground, how large it is, and which way it looks: 0 is towards +z.
pub fn standing(at: Vec3, scale: f32, turn: f32) -> Transform {
    Transform::from_translation(at + GROUND * scale * Vec3::Y)
        .with_rotation(Quat::from_rotation_y(turn))
        .with_scale(Vec3::splat(scale))
}

/// Half of what a prop covers of the ground along its x and z axes; a dark spot is put there.
#[derive(Component, Clone, Copy)]
pub struct Footprint(Vec2);

impl Footprint {
    /// That of one of our props.
    pub fn of(file: &str) -> Self {
        Self(match file {
            "toadstool.npz" => Vec2::new(0.9, 0.9),
            "drum.npz" => Vec2::new(0.96, 0.96),
            "gumballs.npz" => Vec2::new(0.7, 0.7),
            "robot.npz" => Vec2::new(0.46, 0.32),
            _ => Vec2::ONE,
        })
    }
}

/// How far the spot reaches beyond the footprint.
const REACH: f32 = 1.45;
/// How dark it is in its middle, and its pixels a side.
const DARKNESS: f32 = 0.6;
const PIXELS: u32 = 64;

#[derive(Resource)]
struct Spot {
    mesh: Handle<Mesh>,
    material: Handle<StandardMaterial>,
}

impl FromWorld for Spot {
    fn from_world(world: &mut World) -> Self {
        let image = world.resource_mut::<Assets<Image>>().add(soft_disc());
        let material = StandardMaterial {
            base_color: Color::BLACK,
            base_color_texture: Some(image),
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..default()
        };
        Self {
            mesh: world.resource_mut::<Assets<Mesh>>().add(Plane3d::new(Vec3::Y, Vec2::ONE)),
            material: world.resource_mut::<Assets<StandardMaterial>>().add(material),
        }
    }
}

/// White, opaque in the middle, and gone at the edge.
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

fn add_spot(added: On<Add, Footprint>, footprints: Query<&Footprint>, spot: Res<Spot>, mut commands: Commands) {
    let Ok(Footprint(half_size)) = footprints.get(added.entity) else {
        return;
    };
    let size = REACH * *half_size;
    commands.entity(added.entity).with_child((
        Mesh3d(spot.mesh.clone()),
        MeshMaterial3d(spot.material.clone()),
        Transform::from_xyz(0.0, 0.01 - GROUND, 0.0).with_scale(Vec3::new(size.x, 1.0, size.y)),
        NotShadowCaster,
        NotShadowReceiver,
    ));
}
