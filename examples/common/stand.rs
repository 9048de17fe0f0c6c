//! Places props on the ground, with a soft dark spot under each of them, where little of the room's light reaches.

use bevy::{
    asset::RenderAssetUsages,
    image::{Image, ImageSampler},
    light::{NotShadowCaster, NotShadowReceiver},
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};

pub fn plugin(app: &mut App) {
    app.init_resource::<Spots>().add_observer(add_spot);
}

/// The height of the origin of the included props above the ground.
const GROUND: f32 = 0.93;

/// Returns the transform of a prop that stands on the ground at `at`. A `turn` of 0 faces +z.
pub fn standing(at: Vec3, scale: f32, turn: f32) -> Transform {
    Transform::from_translation(at + GROUND * scale * Vec3::Y)
        .with_rotation(Quat::from_rotation_y(turn))
        .with_scale(Vec3::splat(scale))
}

/// Gives an entity with one of the included props a dark spot.
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
            "toadstool.plenoctree" => Vec2::splat(0.9),
            "chest.plenoctree" => Vec2::splat(0.93),
            "drum.plenoctree" => Vec2::splat(0.96),
            "gumballs.plenoctree" => Vec2::splat(0.7),
            _ => Vec2::new(0.48, 0.34),
        }
    }
}

/// The size of the dark spot, relative to the footprint.
const REACH: f32 = 1.3;
/// The opacity of the spot at its center.
const DARKNESS: f32 = 0.55;
/// The width and height of the spot's texture, in pixels.
const PIXELS: u32 = 64;

/// The assets that spots share.
#[derive(Resource)]
struct Spots {
    plane: Handle<Mesh>,
    material: Handle<StandardMaterial>,
}

impl FromWorld for Spots {
    fn from_world(world: &mut World) -> Self {
        let image = world.resource_mut::<Assets<Image>>().add(soft_disc());
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
            base_color: Color::BLACK,
            base_color_texture: Some(image),
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..default()
        });
        let plane = world.resource_mut::<Assets<Mesh>>().add(Plane3d::new(Vec3::Y, Vec2::ONE));
        Self { plane, material }
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

fn add_spot(added: On<Add, Footprint>, props: Query<&Footprint>, spots: Res<Spots>, mut commands: Commands) {
    let Ok(footprint) = props.get(added.entity) else {
        return;
    };
    let size = REACH * footprint.half_size();
    commands.entity(added.entity).with_child((
        Mesh3d(spots.plane.clone()),
        MeshMaterial3d(spots.material.clone()),
        Transform::from_xyz(0.0, 0.01 - GROUND, 0.0).with_scale(Vec3::new(size.x, 1.0, size.y)),
        NotShadowCaster,
        NotShadowReceiver,
    ));
}
