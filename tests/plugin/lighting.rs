//! Tests the shadows that fall on props: of a mesh that the camera does not see, on half of a cube's face, and of
//! props, against float64 rays.

use bevy::{
    camera::visibility::RenderLayers,
    light::{
        CascadeShadowConfigBuilder, DirectionalLightShadowMap, GlobalAmbientLight, ShadowFilteringMethod,
        cluster::{GlobalClusterGpuSettings, GlobalClusterSettings},
    },
    prelude::*,
};
use bevy_plenoctree::{FieldPalette, PlenOctree, Posterize, PosterizeView, Prop, PropLighting, PropPlacement};
use glam::{DVec2, DVec3};
use image::RgbaImage;

use super::{
    shadows::{EYE, Light, PIXELS, direction_at, hit, is_blocked, scene, shape, spawn_light, spawn_unseen},
    stage::{
        fields::included,
        pixels::{differing, encoded, linear, places},
        sides::{BACKGROUND, BLUE, GREEN, RED, SOLID, Side, Sides, color, cube, in_cube},
        wait_for,
    },
};

/// The direction from the scene to the light.
const TOWARD: DVec3 = DVec3::new(0.6, 0.25, 1.0);
/// The x of the right side of the mesh that casts the shadow, and its z.
const BLOCKER: (f64, f64) = (1.75, 3.0);
/// Where the point light and the spot light are.
const LAMP: DVec3 = DVec3::new(4.0, 0.5, 7.0);
/// The layer of objects that only lights see.
const UNSEEN: usize = 1;

/// Returns the color with its linear light multiplied by factors.
fn dimmed(full: DVec3, factors: DVec3) -> DVec3 {
    let light = color(full).to_linear();
    let [r, g, b] = factors.as_vec3().to_array();
    encoded(LinearRgba::rgb(light.red * r, light.green * g, light.blue * b))
}

fn spawn_sun(stage: &mut Sides, light: Color, casts: bool) -> Entity {
    let sun = DirectionalLight { color: light, illuminance: 1000.0, shadow_maps_enabled: casts, ..default() };
    let place = Transform::default().looking_to(-TOWARD.as_vec3(), Vec3::Y);
    let cascades = CascadeShadowConfigBuilder { first_cascade_far_bound: 6.0, maximum_distance: 20.0, ..default() };
    stage.world().spawn((sun, place, cascades.build(), RenderLayers::from_layers(&[0, UNSEEN]))).id()
}

/// Spawns a light at [`LAMP`].
fn spawn_lamp(stage: &mut Sides, is_spot: bool) -> Entity {
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
fn check(stage: &mut Sides, what: &str, lit: DVec3, shaded: DVec3) {
    check_lamp(stage, what, None, lit, shaded);
}

fn check_lamp(stage: &mut Sides, what: &str, lamp: Option<DVec3>, lit: DVec3, shaded: DVec3) {
    stage.check(what, |side, place: DVec2| {
        let off = place.x - edge(side, lamp);
        let on_cube = if off < 0.0 { shaded } else { lit };
        let is_clear = off.abs() > 1.0 / 8.0 || !in_cube(place);
        is_clear.then_some(if in_cube(place) { on_cube } else { BACKGROUND })
    });
}

#[test]
fn shadows_of_meshes_fall_on_props() {
    let mut stage = Sides::with_meshes();
    stage.world().insert_resource(GlobalAmbientLight::NONE);
    stage.world().insert_resource(DirectionalLightShadowMap { size: 1024 });
    stage.set_both(ShadowFilteringMethod::Hardware2x2);
    let field = cube(SOLID, GREEN);
    stage.spawn_prop(&field, ());
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
    assert!(!stage.has_pipeline("plenoctree_lighting"));

    // As trained.
    stage.dress(PropLighting { shadows: 0.5, ..default() });
    check(&mut stage, "as trained", GREEN, dimmed(GREEN, DVec3::splat(0.5)));
    assert!(stage.has_pipeline("plenoctree_lighting"));
    stage.dress(PropLighting { shadows: 0.0, ..default() });
    check(&mut stage, "no shadows", GREEN, GREEN);
    stage.set_both(PropPlacement::Display);
    stage.dress(PropLighting { shadows: 0.5, ..default() });
    check(&mut stage, "after tonemapping", GREEN, GREEN);
    stage.set_both(PropPlacement::Scene);

    // Posterized: the darker label of the same hue, although another color is nearer to the color in half of the light.
    let (dark, olive) = (0.45 * GREEN, DVec3::new(0.3, 0.4, 0.08));
    let set_palette = |stage: &mut Sides, colors: &[DVec3]| {
        let palette = FieldPalette::from_colors(colors.iter().map(|encoded| color(*encoded))).unwrap();
        stage.paint(palette);
    };
    let posterize = Posterize { blend_steps: 1, softness: 0.0, ..default() };
    set_palette(&mut stage, &[GREEN, dark, olive]);
    stage.dress(posterize);
    stage.wait();
    check(&mut stage, "down the palette", GREEN, dark);
    // Recolored, the edge stays where it is.
    stage.palette().set(0, color(BLUE));
    stage.palette().set(1, color(0.5 * BLUE));
    check(&mut stage, "recolored", BLUE, 0.5 * BLUE);
    // Without a darker label of its hue, the shown color gets darker.
    set_palette(&mut stage, &[GREEN, olive]);
    stage.palette().set(0, color(BLUE));
    check(&mut stage, "no darker label", BLUE, dimmed(BLUE, DVec3::splat(0.5)));

    // As trained, in a view that is posterized with the same palette.
    set_palette(&mut stage, &[GREEN, dark, olive]);
    stage.undress::<Posterize>();
    let view = stage.field();
    stage.set_both((PosterizeView(view.clone()), posterize));
    stage.check("a posterized view", |side, place| {
        let off = place.x - edge(side, None);
        // The filter of the view reads beyond the cube.
        let is_clear = off.abs() > 1.0 / 8.0 && in_cube(place);
        is_clear.then_some(if off < 0.0 { dark } else { GREEN })
    });
    stage.unset_both::<(PosterizeView, Posterize)>();
    stage.dress(posterize);

    // Half of the light is missing: nothing in one step, and a half step of two.
    set_palette(&mut stage, &[GREEN, DVec3::splat(0.35)]);
    let other = spawn_sun(&mut stage, Color::WHITE, false);
    stage.world().get_mut::<DirectionalLight>(other).unwrap().illuminance = 1500.0;
    stage.dress(PropLighting { shadows: 0.5, bands: 1, ..default() });
    check(&mut stage, "less than half a band", GREEN, GREEN);
    stage.dress(PropLighting { shadows: 0.5, bands: 2, ..default() });
    check(&mut stage, "one of two bands", GREEN, dimmed(GREEN, DVec3::splat(0.75)));

    // The lights' color: all of it, and half.
    stage.world().despawn(other);
    stage.world().get_mut::<DirectionalLight>(sun).unwrap().color = Color::linear_rgb(1.0, 0.5, 0.25);
    let warm = DVec3::new(1.0, 0.5, 0.25);
    for tint in [1.0, 0.5] {
        stage.dress(PropLighting { shadows: 0.0, tint, ..default() });
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
        stage.dress((PropLighting { shadows: 0.5, ..default() }, posterize));
        check_lamp(&mut stage, what, Some(LAMP), GREEN, dark);
        stage.undress::<Posterize>();
        check_lamp(&mut stage, &format!("{what}, as trained"), Some(LAMP), GREEN, dimmed(GREEN, DVec3::splat(0.5)));
        stage.world().despawn(lamp);
    }

    // Without a light that casts shadows, and without lights, nothing changes.
    let sun = spawn_sun(&mut stage, Color::WHITE, false);
    assert_eq!(stage.capture(), unlit, "a light without shadows");
    stage.world().despawn(sun);
    assert_eq!(stage.capture(), unlit, "no light");
    stage.dress(posterize);
    let dark = stage.capture();
    stage.undress::<PropLighting>();
    assert_eq!(stage.capture(), dark, "posterized, no light");
    stage.undress::<Posterize>();
    assert_eq!(stage.capture(), unlit);
}

/// The linear light of the gray of [`shape`].
fn gray() -> f64 {
    Color::srgb(0.5, 0.5, 0.5).to_linear().red.into()
}

/// Returns the linear light of a pixel, the mean of its channels.
fn light_at(frame: &RgbaImage, x: u32, y: u32) -> f64 {
    f64::from(linear(frame.get_pixel(x, y)).element_sum()) / 3.0
}

/// Compares where a prop got darker with where float64 rays from what the camera sees of it say so. `is_dark` gets
/// points of its surface. Returns the intersection over the union, and the number of pixels that should be dark.
fn compare(
    field: &PlenOctree,
    place: &Transform,
    [before, after]: [&RgbaImage; 2],
    is_dark: impl Fn(DVec3) -> bool,
) -> (f64, u32) {
    let (mut both, mut either, mut expected) = (0, 0, 0);
    for (x, y) in places(PIXELS, PIXELS) {
        let direction = direction_at(DVec2::new(x.into(), y.into()) + 0.5).normalize();
        let Some(distance) = hit(field, place, EYE.as_dvec3(), direction) else { continue };
        let dark = is_dark(EYE.as_dvec3() + distance * direction);
        let found = light_at(after, x, y) < 0.75 * light_at(before, x, y);
        both += u32::from(dark && found);
        either += u32::from(dark || found);
        expected += u32::from(dark);
    }
    (f64::from(both) / f64::from(either.max(1)), expected)
}

/// With a `self_shadow_distance`, parts that are farther away toward the light cast shadows.
#[test]
fn props_shade_themselves_from_a_distance_on() {
    let mut scene = scene(1024);
    let field = included("toadstool");
    let place = Transform::from_rotation(Quat::from_rotation_y(0.5));
    let asset = scene.add(field.clone());
    let prop = scene.world().spawn((Prop(asset), place)).id();
    scene.wait();
    let unlit = scene.capture();
    for light in Light::ALL {
        let lit = spawn_light(&mut scene, light);
        scene.insert(prop, PropLighting::default());
        assert_eq!(shades(&scene.capture(), &unlit), 0, "{light:?}: it shades itself");
        for distance in [0.15, 0.4] {
            let lighting = PropLighting { self_shadow_distance: distance as f32, ..default() };
            scene.insert(prop, lighting);
            let (iou, pixels) = compare(&field, &place, [&unlit, &scene.capture()], |point| {
                let (toward, _) = light.from(point);
                is_blocked(&field, &place, light, point + distance * toward)
            });
            assert!(pixels > 300, "{light:?}: only {pixels} pixels should be in shadow");
            assert!(iou >= 0.95, "{light:?} from {distance}: intersection over union {iou:.4}");
        }
        scene.world().despawn(lit);
    }
}

/// Returns how many pixels are darker than before.
fn shades(after: &RgbaImage, before: &RgbaImage) -> usize {
    places(PIXELS, PIXELS).filter(|(x, y)| light_at(after, *x, *y) < 0.9 * light_at(before, *x, *y)).count()
}

/// A box in the scene, from its center and half of its size.
#[derive(Clone, Copy)]
struct Cuboid(DVec3, f64);

impl Cuboid {
    /// Returns the distance at which a ray from outside hits it, and the axis of the side.
    fn hit(self, from: DVec3, direction: DVec3) -> Option<(f64, usize)> {
        let at = |side: f64| (self.0 + side * self.1 - from) / direction;
        let (enter, exit) = (at(-1.0).min(at(1.0)), at(-1.0).max(at(1.0)));
        let first = enter.max_element();
        let axis = (0..3).find(|axis| enter[*axis] == first)?;
        (first > 0.0 && first < exit.min_element()).then_some((first, axis))
    }
}

/// Returns how much of a light from [`spawn_light`] arrives at a point if nothing blocks it.
fn arriving(light: Light, point: DVec3) -> f64 {
    let (toward, distance) = light.from(point);
    if let Light::Sun(_) = light {
        return 2000.0;
    }
    // Bevy's falloff, within the default range of 20 units.
    let fade = 1.0 - (distance / 20.0).powi(4);
    let lamp = 3e5 / (4.0 * std::f64::consts::PI) * fade * fade / (distance * distance);
    let Light::Spot(place) = light else { return lamp };
    let (inner, outer) = (1.0, 0.8f64.cos());
    let cone = ((toward.dot(place.as_dvec3().normalize()) - outer) / (inner - outer)).clamp(0.0, 1.0);
    lamp * cone * cone
}

/// Many props shade each other in many lights at once. A lamp inside a prop lights that prop alone.
#[test]
fn crowds_shade_each_other_and_lamps_light_what_holds_them() {
    let mut scene = scene(1024);
    let field = shape(|at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 });
    let shell = shape(|at| if (0.6..0.9).contains(&at.length()) { 1e4 } else { 0.0 });
    let crowd: Vec<Cuboid> = (0..64)
        .map(|index| {
            let (x, z) = (f64::from(index % 8) - 3.5, f64::from(index / 8) - 3.5);
            Cuboid(DVec3::new(0.6 * x, 0.3 * f64::from(index % 3) - 0.6, 0.6 * z), 0.175)
        })
        .collect();
    let [field, shell] = [&field, &shell].map(|field| scene.add(field.clone()));
    let lighting = PropLighting { shadows: 0.5, ..default() };
    for Cuboid(center, half) in &crowd {
        let place = Transform::from_translation(center.as_vec3()).with_scale(Vec3::splat(2.0 * *half as f32));
        scene.world().spawn((Prop(field.clone()), lighting, place));
    }
    scene.wait();
    let lights = [Light::ALL[0], Light::ALL[1], Light::ALL[2], Light::Lamp(Vec3::new(-2.0, 2.5, -1.0))];
    let spawned = lights.map(|light| spawn_light(&mut scene, light));
    let frame = scene.capture();
    // What the ray in the middle of a pixel sees: a cube, its side, and which lights others keep from it.
    let look = |at: (i32, i32)| {
        let direction = direction_at(DVec2::new(at.0.into(), at.1.into()) + 0.5).normalize();
        let hits = crowd.iter().enumerate().filter_map(|(own, cube)| Some((own, cube.hit(EYE.as_dvec3(), direction)?)));
        let (own, (distance, axis)) = hits.min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        let point = EYE.as_dvec3() + distance * direction;
        let blocked = lights.map(|light| {
            let (toward, far) = light.from(point);
            let mut others = crowd.iter().enumerate().filter(|(other, _)| *other != own);
            others.any(|(_, cube)| cube.hit(point, toward).is_some_and(|(hit, _)| hit < far))
        });
        Some((own, axis, blocked, point))
    };
    // Also of the pixels around the frame.
    let size = PIXELS as i32 + 2;
    let all: Vec<_> = (0..size * size).map(|index| look((index % size - 1, index / size - 1))).collect();
    let seen =
        |x: u32, y: u32, right: i32, down: i32| &all[((y as i32 + down + 1) * size + x as i32 + right + 1) as usize];
    let (mut checked, mut wrong, mut mixed) = (0, 0, 0);
    for (x, y) in places(PIXELS, PIXELS) {
        let Some((own, axis, blocked, point)) = *seen(x, y, 0, 0) else { continue };
        // Shadows end softly, over a texel.
        let is_clear = [(-1, -1), (1, -1), (-1, 1), (1, 1)].into_iter().all(|(right, down)| {
            seen(x, y, right, down).is_some_and(|there| (there.0, there.1, there.2) == (own, axis, blocked))
        });
        if !is_clear {
            continue;
        }
        let light = lights.map(|light| arriving(light, point));
        let missing: f64 =
            light.iter().zip(&blocked).filter(|(_, is_blocked)| **is_blocked).map(|(light, _)| light).sum();
        let share = missing / light.iter().sum::<f64>();
        checked += 1;
        mixed += usize::from((0.1..0.9).contains(&share));
        wrong += usize::from((light_at(&frame, x, y) / gray() - (1.0 - 0.5 * share)).abs() > 0.02);
    }
    assert!(checked > 2000 && mixed > 150, "{checked} pixels, {mixed} of them get some lights");
    assert!(50 * wrong < checked, "{wrong} of {checked} pixels are wrong");

    // Games let the GPU find the lights of each part of a view, which takes a few frames.
    let on_gpu = GlobalClusterGpuSettings { initial_z_slice_list_capacity: 1024, initial_index_list_capacity: 65536 };
    scene.world().resource_mut::<GlobalClusterSettings>().gpu_clustering = Some(on_gpu);
    wait_for("all lights", || differing(&scene.capture(), &frame, 1) == 0);
    scene.world().resource_mut::<GlobalClusterSettings>().gpu_clustering = None;

    for light in spawned {
        scene.world().despawn(light);
    }
    let lamp = Vec3::new(0.2, 0.9, 0.0);
    let place = Transform::from_translation(lamp).with_scale(Vec3::splat(0.5));
    scene.world().spawn((Prop(shell), lighting, place));
    scene.wait();
    spawn_light(&mut scene, Light::Lamp(lamp));
    let frame = scene.capture();
    let (mut bright, mut dark) = (0, 0);
    for (x, y) in places(PIXELS, PIXELS) {
        let at = DVec2::new(x.into(), y.into()) + 0.5;
        let direction = direction_at(at).normalize();
        let to_lamp = lamp.as_dvec3() - EYE.as_dvec3();
        let passes = (to_lamp - to_lamp.dot(direction) * direction).length();
        if passes < 0.4 {
            bright += 1;
            assert!((light_at(&frame, x, y) / gray() - 1.0).abs() < 0.02, "({x}, {y}) of the shell");
        } else if passes > 0.5
            && [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)]
                .iter()
                .all(|(right, down)| seen(x, y, *right, *down).is_some())
        {
            dark += 1;
            assert!((light_at(&frame, x, y) / gray() - 0.5).abs() < 0.02, "({x}, {y}) of a cube");
        }
    }
    assert!(bright > 200 && dark > 1000, "{bright} and {dark} pixels");
}

/// A wall of fog is in shadow where it is solid, and keeps its light where it is not.
#[test]
fn fog_is_in_shadow_where_it_is_solid() {
    let mut scene = scene(1024);
    let wall =
        |density: f64| shape(move |at| if at.abs().cmplt(DVec3::new(0.95, 0.95, 0.5)).all() { density } else { 0.0 });
    let (haze, fog, bar) = (wall(0.4), wall(4.0), shape(|at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 }));
    let (place, light) = (Transform::from_xyz(0.0, 0.0, -0.5), Light::Sun(Vec3::new(0.3, 0.5, 1.0)));
    let before = Transform::from_xyz(0.45, 0.75, 1.0).with_scale(Vec3::new(0.8, 0.6, 0.3));
    let [haze_asset, fog_asset, bar_asset] = [&haze, &fog, &bar].map(|field| scene.add(field.clone()));
    let prop = scene.world().spawn((Prop(haze_asset), place)).id();
    spawn_unseen(&mut scene, &bar_asset, before);
    scene.wait();
    spawn_light(&mut scene, light);
    // The floor is in the shadow in every frame.
    let unlit = scene.capture();
    scene.insert(prop, PropLighting::default());
    assert_eq!(scene.capture(), unlit, "haze");
    scene.world().entity_mut(prop).insert(Prop(fog_asset)).remove::<PropLighting>();
    scene.wait();
    let unlit = scene.capture();
    scene.insert(prop, PropLighting::default());
    let lit = scene.capture();
    let (iou, pixels) = compare(&fog, &place, [&unlit, &lit], |point| is_blocked(&bar, &before, light, point));
    assert!(pixels > 300, "only {pixels} pixels of the fog should be in shadow");
    assert!(iou >= 0.98, "intersection over union {iou:.4}");
}
