//! The cameras and their views.

use bevy::{
    camera::{CameraOutputMode, visibility::RenderLayers},
    core_pipeline::tonemapping::Tonemapping,
    prelude::*,
    render::render_resource::BlendState,
};
use bevy_egui::PrimaryEguiContext;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_plenoctree::{PlenOctree, Prop, PropQuality};

use crate::{action::Action, loader::Loader};

/// The initial yaw of the camera, in radians.
const YAW: f32 = 0.6;
/// The initial pitch of the camera, in radians.
const PITCH: f32 = 0.45;

/// The quality at which the field is drawn.
#[derive(Resource)]
pub struct CameraQuality(pub PropQuality);

/// Spawns a camera for the field and, on top of it, one for the UI.
pub fn spawn_cameras(mut commands: Commands, quality: Res<CameraQuality>) {
    commands.insert_resource(ClearColor(Color::WHITE));
    commands.spawn((
        Camera3d::default(),
        quality.0,
        Tonemapping::None,
        Msaa::Off,
        PanOrbitCamera { yaw: Some(YAW), pitch: Some(PITCH), ..default() },
    ));
    commands.spawn((
        PrimaryEguiContext,
        Camera2d,
        Msaa::Off,
        // This camera draws only the UI.
        RenderLayers::none(),
        Camera {
            order: 1,
            clear_color: ClearColorConfig::Custom(Color::NONE),
            output_mode: CameraOutputMode::Write {
                blend_state: Some(BlendState::ALPHA_BLENDING),
                clear_color: ClearColorConfig::None,
            },
            ..default()
        },
    ));
}

/// Moves the camera to see the whole field, when another field is shown and when the user requests it.
pub fn frame_view(
    mut actions: MessageReader<Action>,
    mut waiting: Local<bool>,
    mut framed: Local<Option<AssetId<PlenOctree>>>,
    loader: Res<Loader>,
    prop: Option<Single<&Prop>>,
    camera: Option<Single<(&Camera, &mut PanOrbitCamera, &mut Projection)>>,
) {
    *waiting |= actions.read().any(|action| *action == Action::FrameView);
    let (Some(prop), Some(camera), Some(extent)) = (prop, camera, loader.extent()) else {
        return;
    };
    if *framed != Some(prop.0.id()) {
        *framed = Some(prop.0.id());
        *waiting = true;
    }
    let (camera, mut orbit, mut projection) = camera.into_inner();
    let (Some(size), Projection::Perspective(perspective), true) =
        (camera.logical_viewport_size(), &mut *projection, *waiting)
    else {
        return;
    };
    *waiting = false;

    let radius = extent.half_size.length().max(f32::MIN_POSITIVE);
    let distance = distance(extent.half_size, perspective.fov, size);
    perspective.near = 1e-3 * radius;
    perspective.far = 200.0 * radius;
    orbit.focus = extent.center;
    orbit.target_focus = orbit.focus;
    orbit.radius = Some(distance);
    orbit.target_radius = distance;
    orbit.zoom_lower_limit = 0.01 * radius;
    orbit.zoom_upper_limit = Some(100.0 * radius);
    (orbit.yaw, orbit.pitch) = (Some(YAW), Some(PITCH));
    (orbit.target_yaw, orbit.target_pitch) = (YAW, PITCH);
    orbit.force_update = true;
}

/// Returns the distance from the center of a box at which a camera with a viewport of `size` sees all of it, and a
/// little more.
fn distance(half_size: Vec3, fov: f32, size: Vec2) -> f32 {
    let half_height = 0.95 * (0.5 * fov).tan();
    let half_width = half_height * size.x / size.y;
    let to_view = (Quat::from_rotation_y(YAW) * Quat::from_rotation_x(-PITCH)).inverse();
    let signs = [-1.0, 1.0];
    let corners = signs.iter().flat_map(|x| signs.iter().flat_map(move |y| signs.map(|z| Vec3::new(*x, *y, z))));
    corners
        .map(|corner| to_view * (corner * half_size))
        .map(|corner| corner.z + (corner.x.abs() / half_width).max(corner.y.abs() / half_height))
        .fold(0.0, f32::max)
}
