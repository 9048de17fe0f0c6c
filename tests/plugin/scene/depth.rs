//! Tests occlusion: meshes, panes, gizmos and props in front of, behind and inside a prop.

use bevy::{
    prelude::*,
    render::{render_resource::TextureFormat, renderer::RenderAdapter},
};
use glam::{DVec2, DVec3};

use crate::stage::{
    pixels::encoded,
    sides::{
        BACKGROUND, BLUE, GREEN, Layer, RED, SOLID, Side, Sides, color, cube, density, in_cube, seen, shape, within,
    },
};

/// Whether a place is in the left half of the middle of the stage.
fn in_left(place: DVec2) -> bool {
    within(place, (-1.0, -1.0), (0.0, 1.0))
}

/// Whether a place is in the upper half of the middle of the stage.
fn in_top(place: DVec2) -> bool {
    within(place, (-1.0, 0.0), (1.0, 1.0))
}

fn spawn_left(stage: &mut Sides, z: f32, color: DVec3, alpha: f32) -> Entity {
    stage.spawn_rectangle((-1.0, -1.0), (0.0, 1.0), z, color, alpha)
}

fn spawn_top(stage: &mut Sides, z: f32, color: DVec3, alpha: f32) -> Entity {
    stage.spawn_rectangle((-1.0, 0.0), (1.0, 1.0), z, color, alpha)
}

/// Returns the sample counts that the adapter supports for all textures that a camera draws to.
fn sample_counts(stage: &Sides) -> Vec<Msaa> {
    let any = stage.device().features().contains(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES);
    let adapter = stage.render_world().resource::<RenderAdapter>();
    let formats = [TextureFormat::Rgba8UnormSrgb, TextureFormat::Rgba16Float, TextureFormat::Depth32Float];
    let all = [Msaa::Off, Msaa::Sample2, Msaa::Sample4, Msaa::Sample8];
    let supported = |msaa: &Msaa| match msaa {
        Msaa::Off | Msaa::Sample4 => true,
        _ => {
            any && formats
                .iter()
                .all(|f| adapter.get_texture_format_features(*f).flags.sample_count_supported(msaa.samples()))
        }
    };
    all.into_iter().filter(supported).collect()
}

/// Runs `check` with every sample count, with and without HDR.
pub fn in_every_mode(stage: &mut Sides, mut check: impl FnMut(&mut Sides, &str)) {
    for msaa in sample_counts(stage) {
        for hdr in [false, true] {
            stage.set_mode(msaa, hdr);
            check(stage, &format!("{msaa:?}, HDR {hdr}"));
        }
    }
}

#[test]
fn props_alone() {
    Sides::new().run(&[
        a_light_brighter_than_white_shines_through_fog,
        props_are_composited_over_each_other,
        a_prop_inside_the_bounds_of_another_is_occluded_by_leaves_only,
        props_are_sorted_along_the_view,
    ]);
}

#[test]
fn props_and_meshes() {
    Sides::with_meshes().run(&[
        fog_is_drawn_between_meshes,
        fog_ends_at_a_mesh_inside_it,
        panes_blend_over_a_solid_prop_and_are_occluded_by_it,
        props_and_meshes_occlude_each_other_in_any_range_of_depths,
        gizmos_are_drawn_over_a_prop_and_occluded_behind_it,
    ]);
}

/// Fog that transmits 6/10 of the light, between two opaque rectangles: over the background, over one rectangle and
/// behind the other. Then the rectangles are swapped.
fn fog_is_drawn_between_meshes(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.4), GREEN), ());
    let left = spawn_left(stage, 1.0, RED, 1.0);
    let top = spawn_top(stage, -1.0, BLUE, 1.0);
    stage.wait();
    in_every_mode(stage, |stage, mode| {
        for z in [1.0, -1.0] {
            stage.world().get_mut::<Transform>(left).unwrap().translation.z = z;
            stage.world().get_mut::<Transform>(top).unwrap().translation.z = -z;
            stage.check(format!("{mode}, red at {z}"), |side, place| {
                let mut layers = Vec::new();
                layers.extend(in_left(place).then_some((f64::from(z), RED, 1.0)));
                layers.extend(in_top(place).then_some((f64::from(-z), BLUE, 1.0)));
                layers.extend(in_cube(place).then_some((0.0, GREEN, 0.4)));
                seen(side, &layers)
            });
        }
    });
}

/// A mesh inside fog is behind a quarter of it from one side, and behind three quarters from the other.
fn fog_ends_at_a_mesh_inside_it(stage: &mut Sides) {
    stage.spawn_prop(&cube(2.0, GREEN), ());
    spawn_left(stage, 0.25, RED, 1.0);
    stage.wait();
    in_every_mode(stage, |stage, mode| {
        stage.check(mode, |side, place| {
            let path: f64 = match (in_left(place), side) {
                (false, _) => 1.0,
                (true, Side::Front) => 0.25,
                (true, Side::Behind) => 0.75,
            };
            let behind = if in_left(place) { RED } else { BACKGROUND };
            let opacity = if in_cube(place) { 1.0 - (-2.0 * path).exp() } else { 0.0 };
            behind.lerp(GREEN, opacity)
        });
    });
}

/// Light four times as bright as white is 1.8248 when encoded; 45/100 of that passes through the fog.
fn a_light_brighter_than_white_shines_through_fog(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.55), GREEN), ());
    stage.set_mode(Msaa::Off, true);
    for camera in stage.cameras {
        stage.world().get_mut::<Camera>(camera).unwrap().clear_color = Color::linear_rgb(4.0, 4.0, 4.0).into();
    }
    stage.wait();
    stage.check("bright", |_, place| {
        let through = DVec3::splat(0.45 * 1.8248) + 0.55 * GREEN;
        if in_cube(place) { through.min(DVec3::ONE) } else { DVec3::ONE }
    });
}

/// Returns the encoded color of a pane with an opacity of 1/2 over another color, blended as Bevy does.
pub fn through_pane(pane: DVec3, behind: DVec3) -> DVec3 {
    encoded(color(pane).to_linear() * 0.5 + color(behind).to_linear() * 0.5)
}

fn panes_blend_over_a_solid_prop_and_are_occluded_by_it(stage: &mut Sides) {
    stage.spawn_prop(&cube(SOLID, GREEN), ());
    spawn_left(stage, 1.0, RED, 0.5);
    spawn_top(stage, -1.0, BLUE, 0.5);
    stage.wait();
    in_every_mode(stage, |stage, mode| {
        stage.check(mode, |side, place| {
            let left = (in_left(place), RED);
            let top = (in_top(place), BLUE);
            let (near, far) = if side == Side::Front { (left, top) } else { (top, left) };
            let mut color = if far.0 { through_pane(far.1, BACKGROUND) } else { BACKGROUND };
            if in_cube(place) {
                color = GREEN;
            }
            if near.0 { through_pane(near.1, color) } else { color }
        });
    });
}

/// A camera may write only a part of the depths, so that another camera draws over what it draws.
fn props_and_meshes_occlude_each_other_in_any_range_of_depths(stage: &mut Sides) {
    stage.spawn_prop(&cube(SOLID, GREEN), ());
    spawn_left(stage, 1.0, RED, 1.0);
    spawn_top(stage, -1.0, BLUE, 0.5);
    stage.wait();
    for range in [0.0..0.4, 0.5..1.0, 0.3..0.6] {
        for camera in stage.cameras {
            let mut camera = stage.world().get_mut::<Camera>(camera).unwrap();
            camera.viewport.as_mut().unwrap().depth = range.clone();
        }
        in_every_mode(stage, |stage, mode| {
            stage.check(format!("{range:?}, {mode}"), |side, place| {
                let over = |color: &mut DVec3, is_there: bool, layer| *color = if is_there { layer } else { *color };
                let mut color = BACKGROUND;
                if side == Side::Front {
                    let pane = through_pane(BLUE, color);
                    over(&mut color, in_top(place), pane);
                    over(&mut color, in_cube(place), GREEN);
                    over(&mut color, in_left(place), RED);
                } else {
                    over(&mut color, in_left(place), RED);
                    over(&mut color, in_cube(place), GREEN);
                    let pane = through_pane(BLUE, color);
                    over(&mut color, in_top(place), pane);
                }
                color
            });
        });
    }
}

/// Spawns a line that is half a unit thick.
fn spawn_line(stage: &mut Sides, z: f32, encoded: DVec3, vertical: bool) {
    let along = if vertical { Vec3::Y } else { Vec3::X };
    let mut gizmo = GizmoAsset::default();
    gizmo.line(-1.5 * along + z * Vec3::Z, 1.5 * along + z * Vec3::Z, color(encoded));
    let handle = stage.add(gizmo);
    stage.spawn(Gizmo { handle, line_config: GizmoLineConfig { width: 4.0, ..default() }, ..default() });
}

fn gizmos_are_drawn_over_a_prop_and_occluded_behind_it(stage: &mut Sides) {
    stage.spawn_prop(&cube(SOLID, GREEN), ());
    spawn_line(stage, 1.0, RED, false);
    spawn_line(stage, -1.0, BLUE, true);
    stage.wait();
    in_every_mode(stage, |stage, mode| {
        stage.check(mode, |side, place| {
            let mut layers = Vec::new();
            layers.extend(in_cube(place).then_some((0.0, GREEN, 1.0)));
            layers.extend(within(place, (-1.5, -0.25), (1.5, 0.25)).then_some((1.0, RED, 1.0)));
            layers.extend(within(place, (-0.25, -1.5), (0.25, 1.5)).then_some((-1.0, BLUE, 1.0)));
            seen(side, &layers)
        });
    });
}

/// Pairs of props that are fog or solid, one in front of the other. The cameras see them in both orders.
fn props_are_composited_over_each_other(stage: &mut Sides) {
    for (red, blue) in [(0.4, 0.3), (0.4, 1.0), (1.0, 1.0)] {
        stage.clear();
        let density = |opacity| if opacity < 1.0 { density(opacity) } else { SOLID };
        stage.spawn_prop(&cube(density(red), RED), Transform::from_xyz(-0.25, 0.0, 0.75));
        stage.spawn_prop(&cube(density(blue), BLUE), Transform::from_xyz(0.25, 0.25, -0.75));
        stage.wait();
        stage.check(format!("{red} and {blue}"), |side, place| {
            let layers: [Option<Layer>; 2] = [
                in_cube(place + DVec2::new(0.25, 0.0)).then_some((0.75, RED, red)),
                in_cube(place - DVec2::new(0.25, 0.25)).then_some((-0.75, BLUE, blue)),
            ];
            seen(side, &layers.into_iter().flatten().collect::<Vec<_>>())
        });
    }
}

/// The large prop is a wall at the back of its bounding box, which a speck in a corner makes as deep as the stage. The
/// small prop is inside that box: in front of the wall from one side, and behind it from the other. Its center,
/// however, is farther away than the large prop's in the first case, and nearer in the second.
fn a_prop_inside_the_bounds_of_another_is_occluded_by_leaves_only(stage: &mut Sides) {
    let wall = shape(SOLID, BLUE, |at| at.z < -0.75 || at.min_element() > 0.875);
    stage.spawn_prop(&wall, ());
    stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.0, 0.0, -0.375).with_scale(Vec3::splat(0.5)));
    stage.wait();
    in_every_mode(stage, |stage, mode| {
        stage.check(mode, |side, place| {
            let mut layers = Vec::new();
            layers.extend(within(place, (-1.0, -1.0), (1.0, 1.0)).then_some((-0.875, BLUE, 1.0)));
            layers.extend(within(place, (-0.25, -0.25), (0.25, 0.25)).then_some((-0.375, RED, 1.0)));
            seen(side, &layers)
        });
    });
}

/// Fog so wide that its center is farther from the camera than the center of the fog behind it.
fn props_are_sorted_along_the_view(stage: &mut Sides) {
    stage.spawn_prop(
        &cube(density(0.4), RED),
        Transform::from_xyz(1.75, 0.0, 0.75).with_scale(Vec3::new(4.5, 1.0, 1.0)),
    );
    stage.spawn_prop(&cube(density(0.3), BLUE), Transform::from_xyz(0.0, 0.0, -0.25));
    stage.wait();
    stage.set(Transform::from_xyz(0.0, 0.0, 1.5));
    stage.check("order", |side, place| {
        let mut layers = Vec::new();
        layers.extend(within(place, (-0.5, -0.5), (4.0, 0.5)).then_some((0.75, RED, 0.4)));
        layers.extend(in_cube(place).then_some((-0.25, BLUE, 0.3)));
        seen(side, &layers)
    });
}
