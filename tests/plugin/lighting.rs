//! Tests the shadows that fall on props: half of a cube's face is in the shadow of a mesh that the camera does not see.

use bevy::{
    camera::visibility::RenderLayers,
    light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, GlobalAmbientLight, ShadowFilteringMethod},
    prelude::*,
    render::{
        RenderApp,
        render_resource::{PipelineCache, PipelineDescriptor},
    },
};
use bevy_plenoctree::{FieldPalette, Palettes, Posterize, PropLighting, PropStage};
use glam::{DVec2, DVec3};

use super::scene::stage::{BACKGROUND, BLUE, GREEN, RED, SOLID, Side, Stage, color, cube, in_cube};

/// The direction from the scene to the light.
const TOWARD: DVec3 = DVec3::new(0.6, 0.25, 1.0);
/// The x of the right side of the mesh that casts the shadow, and its z.
const BLOCKER: (f64, f64) = (1.75, 3.0);
/// Where the point light and the spot light are.
const LAMP: DVec3 = DVec3::new(4.0, 0.5, 7.0);
/// The layer of objects that only lights see.
const UNSEEN: usize = 1;

/// Returns the color with its linear light multiplied by factors.
fn dimmed(encoded: DVec3, factors: DVec3) -> DVec3 {
    let light = color(encoded).to_linear();
    let [r, g, b] = factors.as_vec3().to_array();
    let seen = Srgba::from(LinearRgba::rgb(light.red * r, light.green * g, light.blue * b));
    DVec3::new(seen.red.into(), seen.green.into(), seen.blue.into())
}

fn spawn_sun(stage: &mut Stage, light: Color, casts: bool) -> Entity {
    let sun = DirectionalLight { color: light, illuminance: 1000.0, shadow_maps_enabled: casts, ..default() };
    let place = Transform::default().looking_to(-TOWARD.as_vec3(), Vec3::Y);
    let cascades = CascadeShadowConfigBuilder { first_cascade_far_bound: 6.0, maximum_distance: 20.0, ..default() };
    stage.world().spawn((sun, place, cascades.build(), RenderLayers::from_layers(&[0, UNSEEN]))).id()
}

/// Spawns a light at [`LAMP`].
fn spawn_lamp(stage: &mut Stage, is_spot: bool) -> Entity {
    let place = Transform::from_translation(LAMP.as_vec3()).looking_at(Vec3::ZERO, Vec3::Y);
    let layers = RenderLayers::from_layers(&[0, UNSEEN]);
    let lamp = PointLight { intensity: 1e5, shadow_maps_enabled: true, ..default() };
    let spot = SpotLight { intensity: 1e5, shadow_maps_enabled: true, outer_angle: 0.5, ..default() };
    let mut spawned = stage.world().spawn((place, layers));
    if is_spot { spawned.insert(spot).id() } else { spawned.insert(lamp).id() }
}

/// Returns the x of the edge of the shadow on the side of the cube that a camera sees: of the sun, or of a light at a
/// point. The light passes through the cube: only objects outside the cube's box cast shadows on it.
fn edge(side: Side, lamp: Option<DVec3>) -> f64 {
    let surface = 0.5 * side.sign();
    match lamp {
        None => BLOCKER.0 - (BLOCKER.1 - surface) * TOWARD.x / TOWARD.z,
        Some(at) => at.x + (BLOCKER.0 - at.x) * (at.z - surface) / (at.z - BLOCKER.1),
    }
}

/// Expects `lit` and `shaded` on the two parts of the cube's sides, everywhere but within a pixel of the edge.
fn check(stage: &mut Stage, what: &str, lit: DVec3, shaded: DVec3) {
    check_lamp(stage, what, None, lit, shaded);
}

fn check_lamp(stage: &mut Stage, what: &str, lamp: Option<DVec3>, lit: DVec3, shaded: DVec3) {
    stage.check(what, |side, place: DVec2| {
        let off = place.x - edge(side, lamp);
        let on_cube = if off < 0.0 { shaded } else { lit };
        let is_clear = off.abs() > 1.0 / 8.0 || !in_cube(place);
        is_clear.then_some(if in_cube(place) { on_cube } else { BACKGROUND })
    });
}

fn has_pipeline(stage: &Stage) -> bool {
    let cache = stage.headless.app.sub_app(RenderApp).world().resource::<PipelineCache>();
    cache.pipelines().any(|pipeline| match &pipeline.descriptor {
        PipelineDescriptor::RenderPipelineDescriptor(descriptor) => {
            descriptor.label.as_deref() == Some("plenoctree_lighting")
        }
        PipelineDescriptor::ComputePipelineDescriptor(_) => false,
    })
}

#[test]
fn shadows_of_meshes_fall_on_props() {
    let mut stage = Stage::with_meshes();
    stage.world().insert_resource(GlobalAmbientLight::NONE);
    stage.world().insert_resource(DirectionalLightShadowMap { size: 1024 });
    for camera in stage.cameras {
        stage.world().entity_mut(camera).insert(ShadowFilteringMethod::Hardware2x2);
    }
    let field = cube(SOLID, GREEN);
    let prop = stage.spawn_prop(&field, default());
    let sun = spawn_sun(&mut stage, Color::WHITE, true);
    // Mesa's software rasterizer loses texels of shadow maps along edges that triangles share. The second rectangle,
    // which is within the shadow of the first one, has them elsewhere.
    for (low, high, off) in [((-8.0, -8.0), (BLOCKER.0 as f32, 8.0), 0.0), ((-9.0, -5.0), (1.4, 8.0), 0.2)] {
        let blocker = stage.spawn_rectangle(low, high, BLOCKER.1 as f32 + off, RED, 1.0);
        stage.world().entity_mut(blocker).insert(RenderLayers::layer(UNSEEN));
    }
    stage.wait();
    let unlit = stage.capture();
    check(&mut stage, "no lighting", GREEN, GREEN);
    assert!(!has_pipeline(&stage));

    // As trained.
    stage.world().entity_mut(prop).insert(PropLighting { shadows: 0.5, ..default() });
    check(&mut stage, "as trained", GREEN, dimmed(GREEN, DVec3::splat(0.5)));
    assert!(has_pipeline(&stage));
    stage.world().entity_mut(prop).insert(PropLighting { shadows: 0.0, ..default() });
    check(&mut stage, "no shadows", GREEN, GREEN);
    for camera in stage.cameras {
        stage.world().entity_mut(camera).insert(PropStage::Display);
    }
    stage.world().entity_mut(prop).insert(PropLighting { shadows: 0.5, ..default() });
    check(&mut stage, "after tonemapping", GREEN, GREEN);
    for camera in stage.cameras {
        stage.world().entity_mut(camera).insert(PropStage::Scene);
    }

    // Posterized: the darker label of the same hue, although another color is nearer to the color in half of the light.
    let (dark, olive) = (0.45 * GREEN, DVec3::new(0.3, 0.4, 0.08));
    let handle = stage.world().query::<&bevy_plenoctree::Prop>().single(stage.world()).unwrap().0.clone();
    let set_palette = |stage: &mut Stage, colors: &[DVec3]| {
        let palette = FieldPalette::from_colors(colors.iter().map(|encoded| color(*encoded))).unwrap();
        stage.world().resource_mut::<Palettes>().insert(&handle, palette);
    };
    let posterize = Posterize { blend_steps: 1, softness: 0.0, ..default() };
    set_palette(&mut stage, &[GREEN, dark, olive]);
    stage.world().entity_mut(prop).insert(posterize);
    stage.wait();
    check(&mut stage, "down the palette", GREEN, dark);
    // Recolored, the edge stays where it is.
    stage.world().resource_mut::<Palettes>().get_mut(&handle).unwrap().set(0, color(BLUE));
    stage.world().resource_mut::<Palettes>().get_mut(&handle).unwrap().set(1, color(0.5 * BLUE));
    check(&mut stage, "recolored", BLUE, 0.5 * BLUE);
    // Without a darker label of its hue, the shown color gets darker.
    set_palette(&mut stage, &[GREEN, olive]);
    stage.world().resource_mut::<Palettes>().get_mut(&handle).unwrap().set(0, color(BLUE));
    check(&mut stage, "no darker label", BLUE, dimmed(BLUE, DVec3::splat(0.5)));

    // Half of the light is missing: nothing in one step, and a half step of two.
    set_palette(&mut stage, &[GREEN, DVec3::splat(0.35)]);
    let other = spawn_sun(&mut stage, Color::WHITE, false);
    stage.world().get_mut::<DirectionalLight>(other).unwrap().illuminance = 1500.0;
    stage.world().entity_mut(prop).insert(PropLighting { shadows: 0.5, bands: 1, ..default() });
    check(&mut stage, "less than half a band", GREEN, GREEN);
    stage.world().entity_mut(prop).insert(PropLighting { shadows: 0.5, bands: 2, ..default() });
    check(&mut stage, "one of two bands", GREEN, dimmed(GREEN, DVec3::splat(0.75)));

    // The lights' color: all of it, and half.
    stage.world().despawn(other);
    stage.world().get_mut::<DirectionalLight>(sun).unwrap().color = Color::linear_rgb(1.0, 0.5, 0.25);
    let warm = DVec3::new(1.0, 0.5, 0.25);
    for tint in [1.0, 0.5] {
        stage.world().entity_mut(prop).insert(PropLighting { shadows: 0.0, tint, bands: 1 });
        let factors = DVec3::ONE.lerp(warm, f64::from(tint));
        stage.check(format!("tint {tint}"), |side, place| {
            (in_cube(place) && place.x > edge(side, None) + 0.125).then_some(dimmed(GREEN, factors))
        });
    }

    // Lights that are somewhere.
    stage.world().despawn(sun);
    set_palette(&mut stage, &[GREEN, dark]);
    for is_spot in [false, true] {
        let lamp = spawn_lamp(&mut stage, is_spot);
        let what = if is_spot { "spot light" } else { "point light" };
        stage.world().entity_mut(prop).insert((PropLighting { shadows: 0.5, ..default() }, posterize));
        check_lamp(&mut stage, what, Some(LAMP), GREEN, dark);
        stage.world().entity_mut(prop).remove::<Posterize>();
        check_lamp(&mut stage, &format!("{what}, as trained"), Some(LAMP), GREEN, dimmed(GREEN, DVec3::splat(0.5)));
        stage.world().despawn(lamp);
    }

    // Without a light that casts shadows, and without lights, nothing changes.
    let sun = spawn_sun(&mut stage, Color::WHITE, false);
    assert_eq!(stage.capture(), unlit, "a light without shadows");
    stage.world().despawn(sun);
    assert_eq!(stage.capture(), unlit, "no light");
    stage.world().entity_mut(prop).insert(posterize);
    let dark = stage.capture();
    stage.world().entity_mut(prop).remove::<PropLighting>();
    assert_eq!(stage.capture(), dark, "posterized, no light");
    stage.world().entity_mut(prop).remove::<Posterize>();
    assert_eq!(stage.capture(), unlit);
}
