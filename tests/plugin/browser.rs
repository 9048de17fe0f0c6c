//! Draws everything on a device with WebGPU's default limits, as browsers grant them. `scripts/examples` runs the examples
//! on such a device.

use std::time::Duration;

use bevy::{
    camera::Hdr,
    core_pipeline::prepass::{DepthPrepass, MotionVectorPrepass},
    prelude::*,
    render::{RenderApp, renderer::RenderDevice},
};
use bevy_plenoctree::{
    PaletteExtraction, PaletteSampler, PlenOctree, PlenOctreePlugin, Posterize, PosterizeView, Prop, PropLighting,
    PropQuality, PropStage, SolidOpacity,
    headless::{Headless, LitMeshPlugins, exact_camera},
};

use super::{
    idle_stage::idle_stage,
    scene::stage::{BLUE, GREEN, PIXELS, RED, SOLID, cube, density, flat},
};

/// Lights of every kind, with shadows.
fn spawn_lights(world: &mut World) {
    let at = Transform::from_xyz(1.0, 2.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
    world.spawn((DirectionalLight { shadow_maps_enabled: true, ..default() }, at));
    world.spawn((PointLight { shadow_maps_enabled: true, ..default() }, at));
    world.spawn((SpotLight { shadow_maps_enabled: true, ..default() }, at));
}

#[test]
fn everything_is_within_the_default_limits_of_webgpu() {
    let limits = wgpu::Limits::default();
    let mut headless = Headless::with_limits(UVec2::splat(PIXELS), limits.clone(), |app| {
        app.add_plugins((LitMeshPlugins, PlenOctreePlugin));
    })
    .unwrap();
    // Sampling in compute shaders, even if they are emulated.
    headless.app.world_mut().resource_mut::<PaletteExtraction>().sampler = PaletteSampler::Gpu;
    let target = headless.target();
    let world = headless.app.world_mut();
    let mut fields = world.resource_mut::<Assets<PlenOctree>>();
    let [green, red, haze] =
        [(SOLID, GREEN), (SOLID, RED), (density(0.4), BLUE)].map(|(density, color)| fields.add(cube(density, color)));
    let lighting = PropLighting { brightness: 1.0, ..default() };
    world.spawn((Prop(green.clone()), Posterize::comic(), lighting));
    world.spawn((Prop(red), Posterize::soft(), lighting, Transform::from_xyz(0.3, 0.2, 0.1)));
    world.spawn((Prop(haze), SolidOpacity::Never, lighting, Transform::from_xyz(0.0, 0.3, 0.6)));
    spawn_lights(world);
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(1.0, 1.0));
    let color = Color::srgba(0.5, 0.6, 0.7, 0.5);
    let material = StandardMaterial { base_color: color, alpha_mode: AlphaMode::Multiply, ..default() };
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(0.0, 0.0, 2.0)));
    let camera = world.spawn((exact_camera(Color::BLACK), target, flat(), Transform::from_xyz(0.0, 0.0, 5.0))).id();
    let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
    let granted = device.limits();
    // wgpu does not restrict this one, which is of no use without a feature that browsers do not have.
    let max_binding_array_sampler_elements_per_shader_stage =
        granted.max_binding_array_sampler_elements_per_shader_stage;
    assert_eq!(granted, wgpu::Limits { max_binding_array_sampler_elements_per_shader_stage, ..limits });

    let idle = idle_stage(headless.app.world_mut());
    for (msaa, quality) in [(Msaa::Off, PropQuality::EXACT), (Msaa::Sample4, PropQuality::FAST)] {
        for place in [PropStage::Scene, PropStage::Display] {
            for extras in ["none", "fog", "stages", "view"] {
                let mut camera = headless.app.world_mut().entity_mut(camera);
                camera.insert((msaa, quality, place, DepthPrepass, MotionVectorPrepass, Hdr));
                match extras {
                    "fog" => drop(camera.insert(DistanceFog::default())),
                    "stages" => drop(camera.insert(idle.clone())),
                    "view" => drop(camera.insert((PosterizeView(green.clone()), Posterize::default()))),
                    _ => drop(camera.remove::<(DistanceFog, bevy_plenoctree::LabelStages, PosterizeView, Posterize)>()),
                }
                headless.wait_until_ready(Duration::from_secs(120)).unwrap();
                // An error stops rendering, and is reported a frame later.
                for _ in 0..2 {
                    headless.capture().unwrap_or_else(|error| panic!("{msaa:?}, {place:?}, {extras}: {error}"));
                }
            }
        }
    }
}
