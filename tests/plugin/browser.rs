//! Draws everything on a device with WebGPU's default limits, as browsers grant them. `scripts/examples` runs the
//! examples with arguments on such a device.

#[path = "../../examples/custom_stage.rs"]
#[allow(dead_code, reason = "only its scene is drawn")]
mod custom_stage;
#[path = "../../examples/minimal.rs"]
#[allow(dead_code, reason = "only its scene is drawn")]
mod minimal;
#[path = "../../examples/posterize.rs"]
#[allow(dead_code, reason = "only its scene is drawn")]
mod posterize;
#[path = "../../examples/recolor.rs"]
#[allow(dead_code, reason = "only its scene is drawn")]
mod recolor;

use bevy::{
    camera::Hdr,
    core_pipeline::prepass::{DepthPrepass, MotionVectorPrepass},
    ecs::{schedule::IntoScheduleConfigs, system::ScheduleSystem},
    light::{DirectionalLightShadowMap, PointLightShadowMap},
    prelude::*,
};
use bevy_plenoctree::{
    FieldPalette, LabelStages, PaletteExtraction, PaletteSampler, Palettes, PlenOctreePlugin, Posterize, PosterizeView,
    PropLighting, PropPlacement, PropQuality, SolidOpacity,
    headless::{Headless, LitMeshPlugins},
};

use super::stage::{
    PATIENCE, Stage,
    sides::{BLUE, GREEN, PIXELS, RED, SOLID, cube, density, flat},
};

/// Lights of every kind, with shadows. Their maps are small, because Bevy clears them in every frame.
fn spawn_lights(world: &mut World) {
    world.insert_resource(DirectionalLightShadowMap { size: 256 });
    world.insert_resource(PointLightShadowMap { size: 256 });
    let at = Transform::from_xyz(1.0, 2.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
    world.spawn((DirectionalLight { shadow_maps_enabled: true, ..default() }, at));
    world.spawn((PointLight { shadow_maps_enabled: true, ..default() }, at));
    world.spawn((SpotLight { shadow_maps_enabled: true, ..default() }, at));
}

#[test]
fn everything_is_within_the_default_limits_of_webgpu() {
    let limits = wgpu::Limits::default();
    let mut stage = Stage::limited(PIXELS, limits.clone(), |app| _ = app.add_plugins(LitMeshPlugins));
    // Sampling in compute shaders, even if they are emulated.
    stage.world().resource_mut::<PaletteExtraction>().sampler = PaletteSampler::Gpu;
    let lighting = PropLighting { brightness: 1.0, ..default() };
    stage.spawn_prop(&cube(SOLID, GREEN), (Posterize::comic(), lighting));
    stage.spawn_prop(&cube(SOLID, RED), (Posterize::soft(), lighting, Transform::from_xyz(0.3, 0.2, 0.1)));
    let above = Transform::from_xyz(0.0, 0.3, 0.6);
    stage.spawn_prop(&cube(density(0.4), BLUE), (SolidOpacity::Never, lighting, above));
    spawn_lights(stage.world());
    let color = Color::srgba(0.5, 0.6, 0.7, 0.5);
    let material = StandardMaterial { base_color: color, alpha_mode: AlphaMode::Multiply, ..default() };
    stage.spawn_mesh(Rectangle::new(1.0, 1.0), material, Transform::from_xyz(0.0, 0.0, 2.0));
    stage.set((flat(), Transform::from_xyz(0.0, 0.0, 5.0)));
    let granted = stage.device().limits();
    // wgpu does not restrict these, which are of no use without features that browsers do not have.
    let expected = wgpu::Limits {
        max_binding_array_sampler_elements_per_shader_stage: granted
            .max_binding_array_sampler_elements_per_shader_stage,
        max_acceleration_structures_per_shader_stage: granted.max_acceleration_structures_per_shader_stage,
        ..limits
    };
    assert_eq!(granted, expected);
    assert_eq!(stage.device().features(), wgpu::Features::empty());

    let (idle, view) = (stage.idle_stage(), PosterizeView(stage.field()));
    for (msaa, quality) in [(Msaa::Off, PropQuality::EXACT), (Msaa::Sample4, PropQuality::FAST)] {
        for place in [PropPlacement::Scene, PropPlacement::Display] {
            stage.unset::<(LabelStages, PosterizeView, Posterize)>();
            for extras in ["fog and stages", "view"] {
                stage.set((msaa, quality, place, DepthPrepass, MotionVectorPrepass, Hdr));
                match extras {
                    "view" => stage.set((view.clone(), Posterize::default())),
                    _ => stage.set((DistanceFog::default(), idle.clone())),
                }
                stage.wait();
                // An error stops rendering, and is reported a frame later.
                for _ in 0..2 {
                    stage.headless.capture().unwrap_or_else(|error| panic!("{msaa:?}, {place:?}, {extras}: {error}"));
                }
            }
        }
    }
}

/// Draws the scene of an example, which shows the toadstool. Returns the palette, which is extracted unless given.
fn draw<M>(
    name: &str,
    setup: impl IntoScheduleConfigs<ScheduleSystem, M>,
    palette: Option<FieldPalette>,
) -> Option<FieldPalette> {
    let mut headless = Headless::with_limits(UVec2::splat(PIXELS), wgpu::Limits::default(), |app| {
        app.add_plugins((LitMeshPlugins, PlenOctreePlugin)).add_systems(Startup, setup);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    world.resource_mut::<PaletteExtraction>().settings.sampling.sample_fraction = Some(0.03);
    let field = world.resource::<AssetServer>().load("toadstool.plenoctree");
    if let Some(palette) = palette {
        world.resource_mut::<Palettes>().insert(&field, palette);
    }
    headless.app.add_observer(move |camera: On<Add, Camera>, mut commands: Commands| {
        commands.entity(camera.entity).insert(target.clone());
    });
    headless.wait_until_ready(PATIENCE).unwrap_or_else(|error| panic!("{name}: {error}"));
    let frame = headless.capture().unwrap_or_else(|error| panic!("{name}: {error}"));
    assert!(frame.pixels().any(|pixel| pixel != frame.get_pixel(0, 0)), "{name} shows nothing");
    headless.app.world().resource::<Palettes>().get(&field).cloned()
}

#[test]
fn examples_without_arguments_are_within_these_limits() {
    let palette = draw("minimal", minimal::setup, None);
    draw("custom_stage", custom_stage::setup, palette.clone());
    draw("posterize", posterize::setup, palette.clone());
    draw("recolor", recolor::setup, palette);
}
