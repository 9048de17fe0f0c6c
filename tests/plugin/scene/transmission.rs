//! Tests props together with glass that refracts, and their place among the passes of others.

use bevy::{
    core_pipeline::{
        Core3d, Core3dSystems,
        core_3d::{main_opaque_pass_3d, main_transparent_pass_3d},
    },
    ecs::{schedule::ScheduleConfigs, system::ScheduleSystem},
    pbr::{ScreenSpaceTransmission, main_transmissive_pass_3d},
    prelude::*,
    render::{
        RenderApp,
        render_resource::{LoadOp, RenderPassDescriptor},
        renderer::{RenderContext, ViewQuery},
        view::ViewTarget,
    },
};
use bevy_plenoctree::{PlenOctreeRenderSystems, headless::LitMeshPlugins};
use glam::{DVec2, DVec3};

use crate::stage::{
    pixels::encoded,
    sides::{BACKGROUND, GREEN, PIXELS, RED, SOLID, Side, Sides, color, cube, density, in_cube},
};

/// Spawns a pane of glass that faces both sides. Its color tints what is seen through it.
fn spawn_glass(stage: &mut Sides, z: f32, tint: Color, thickness: f32) -> Entity {
    let glass = StandardMaterial {
        base_color: tint,
        specular_transmission: 1.0,
        perceptual_roughness: 0.0,
        reflectance: 0.0,
        thickness,
        ior: 1.5,
        cull_mode: None,
        ..default()
    };
    stage.spawn_mesh(Rectangle::new(1.5, 1.5), glass, Transform::from_xyz(0.0, 0.0, z))
}

/// Returns what is seen through glass of this tint.
fn tinted(tint: Color, behind: DVec3) -> DVec3 {
    let (tint, behind) = (tint.to_linear(), color(behind).to_linear());
    encoded(LinearRgba::rgb(tint.red * behind.red, tint.green * behind.green, tint.blue * behind.blue))
}

/// Props are seen through glass in front of them, and hide glass behind them.
#[test]
fn props_are_seen_through_glass() {
    let tint = Color::srgb(1.0, 0.8, 0.6);
    let in_glass = |place: DVec2| place.abs().max_element() < 0.75;
    let mut stage = Sides::with_meshes();
    spawn_glass(&mut stage, 1.0, tint, 0.0);
    for opacity in [0.4, 1.0] {
        stage.clear();
        stage.spawn_prop(&cube(if opacity < 1.0 { density(opacity) } else { SOLID }, GREEN), ());
        stage.wait();
        for (msaa, hdr) in [(Msaa::Off, false), (Msaa::Off, true), (Msaa::Sample4, false), (Msaa::Sample4, true)] {
            stage.set_mode(msaa, hdr);
            stage.check(format!("opacity {opacity}, {msaa:?}, HDR {hdr}"), |side, place| {
                let behind = if in_cube(place) { BACKGROUND.lerp(GREEN, opacity) } else { BACKGROUND };
                // From behind, glass is farther away than the prop. It is hidden where that is solid.
                let is_hidden = side == Side::Behind && in_cube(place);
                match (in_glass(place), is_hidden) {
                    (false, _) => Some(behind),
                    (true, true) if opacity == 1.0 => Some(GREEN),
                    (true, true) => None,
                    (true, false) => Some(tinted(tint, behind)),
                }
            });
        }
    }
}

/// Glass that is turned and thick shows props in another place.
#[test]
fn thick_glass_refracts_props() {
    let mut stage = Sides::with_meshes();
    stage.spawn_prop(&cube(SOLID, RED), ());
    let glass = spawn_glass(&mut stage, 1.5, Color::WHITE, 1.5);
    stage.world().get_mut::<Transform>(glass).unwrap().rotation = Quat::from_rotation_y(0.8);
    let steps = |stage: &mut Sides, steps| {
        stage.set(ScreenSpaceTransmission { steps, ..default() });
        let frame = stage.capture();
        let row = (0..PIXELS).filter(|x| {
            let [red, green, ..] = frame.get_pixel(*x, PIXELS / 2).0;
            red / 2 > green
        });
        row.collect::<Vec<_>>()
    };
    stage.wait();
    let seen = steps(&mut stage, 1);
    let middle = (f64::from(seen[0]) + f64::from(*seen.last().unwrap())) / 2.0;
    assert!(seen.len() >= 3, "{seen:?}");
    assert!((middle - f64::from(PIXELS - 1) / 2.0).abs() > 1.0, "{seen:?} is where it would be without refraction");
    // Without copies of the scene, glass shows nothing behind it.
    assert!(steps(&mut stage, 0).len() < seen.len());
}

/// Returns a system that fills the whole view with a color.
fn paint(color: wgpu::Color) -> impl Fn(ViewQuery<&ViewTarget>, RenderContext) {
    move |view, mut ctx| {
        let mut attachment = view.into_inner().get_color_attachment();
        attachment.ops.load = LoadOp::Clear(color);
        ctx.begin_tracked_render_pass(RenderPassDescriptor { color_attachments: &[Some(attachment)], ..default() });
    }
}

/// Fog is in front of what is drawn like Bevy's sky, and behind what is drawn like Bevy's transmissive objects,
/// whichever plugin is added first.
#[test]
fn props_are_drawn_after_the_sky_and_before_other_main_passes() {
    #[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
    struct BeforeProps;
    let between =
        |system: ScheduleConfigs<ScheduleSystem>| system.after(main_opaque_pass_3d).before(main_transparent_pass_3d);
    for (what, in_main_pass, follows_glass, is_ordered, is_over_paint) in [
        ("sky", false, false, false, true),
        ("main pass", true, false, false, false),
        ("behind the main pass's own", false, true, false, false),
        ("ordered", true, false, true, true),
    ] {
        let mut stage = Sides::with(|app| {
            let mut painting = between(paint(wgpu::Color::BLUE).into_configs());
            if in_main_pass {
                painting = painting.in_set(Core3dSystems::MainPass);
            }
            if follows_glass {
                app.add_plugins(LitMeshPlugins);
                painting = painting.after(main_transmissive_pass_3d);
            }
            // An order that somebody asks for takes precedence.
            if is_ordered {
                painting = painting.in_set(BeforeProps);
            }
            let render_app = app.sub_app_mut(RenderApp);
            render_app.configure_sets(Core3d, BeforeProps.before(PlenOctreeRenderSystems::Layer));
            render_app.add_systems(Core3d, painting);
        });
        stage.spawn_prop(&cube(density(0.4), GREEN), ());
        stage.wait();
        stage.check(
            what,
            |_, place| {
                if in_cube(place) && is_over_paint { DVec3::Z.lerp(GREEN, 0.4) } else { DVec3::Z }
            },
        );
    }
}
