//! Tests the shadows that props cast on a lit floor: every pixel is compared with a float64 ray from the floor to the
//! light.

use bevy::{
    camera::visibility::RenderLayers,
    light::{
        CascadeShadowConfigBuilder, DirectionalLightShadowMap, GlobalAmbientLight, NotShadowCaster,
        PointLightShadowMap, ShadowFilteringMethod,
    },
    prelude::*,
};
use bevy_plenoctree::{FieldPalette, Palette, Palettes, PlenOctree, Posterize, Prop, PropQuality, SolidOpacity};
use glam::{DVec2, DVec3};
use image::RgbaImage;

use super::stage::{
    Stage,
    fields::{colored, included},
    pixels::{differing, linear, places},
    skip,
};

pub const PIXELS: u32 = 192;
const FLOOR: f64 = -1.0;
pub const EYE: Vec3 = Vec3::new(0.0, 3.5, 5.5);
const FOV: f32 = 0.9;
/// The layer of props that the camera does not see.
const UNSEEN: usize = 1;

/// A light, by where it comes from.
#[derive(Clone, Copy, Debug)]
pub enum Light {
    /// From a direction.
    Sun(Vec3),
    /// From a point, in all directions.
    Lamp(Vec3),
    /// From a point, in the direction of the origin.
    Spot(Vec3),
}

impl Light {
    pub const ALL: [Self; 3] = [
        Self::Sun(Vec3::new(0.45, 1.0, 0.3)),
        Self::Lamp(Vec3::new(1.4, 3.0, 0.6)),
        Self::Spot(Vec3::new(-1.2, 3.4, 1.0)),
    ];

    /// Returns the direction from a point to the light, and the distance.
    pub fn from(self, point: DVec3) -> (DVec3, f64) {
        match self {
            Self::Sun(direction) => (direction.as_dvec3().normalize(), f64::INFINITY),
            Self::Lamp(place) | Self::Spot(place) => {
                let to = place.as_dvec3() - point;
                (to.normalize(), to.length())
            }
        }
    }
}

/// Creates a scene with a floor and without lights. Shadow maps are `map` texels wide.
pub fn scene(map: usize) -> Stage {
    let mut stage = Stage::with_meshes(PIXELS);
    stage.world().insert_resource(GlobalAmbientLight::NONE);
    stage.world().insert_resource(DirectionalLightShadowMap { size: map });
    stage.world().insert_resource(PointLightShadowMap { size: map });
    let matte = StandardMaterial { perceptual_roughness: 1.0, reflectance: 0.0, ..default() };
    let place = Transform::from_xyz(0.0, FLOOR as f32, 0.0);
    let floor = stage.spawn_mesh(Plane3d::default().mesh().size(40.0, 40.0), matte, place);
    stage.insert(floor, NotShadowCaster);
    stage.set((
        ShadowFilteringMethod::Hardware2x2,
        Projection::from(PerspectiveProjection { fov: FOV, ..default() }),
        Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    stage
}

pub fn spawn_light(scene: &mut Stage, light: Light) -> Entity {
    let layers = RenderLayers::from_layers(&[0, UNSEEN]);
    let world = scene.world();
    let spawned = match light {
        Light::Sun(direction) => world.spawn((
            DirectionalLight {
                illuminance: 2000.0,
                shadow_maps_enabled: true,
                shadow_depth_bias: 0.0,
                shadow_normal_bias: 0.0,
                ..default()
            },
            Transform::default().looking_to(-direction, Vec3::Y),
            // The floor reaches into all four of them.
            CascadeShadowConfigBuilder { first_cascade_far_bound: 6.0, maximum_distance: 12.0, ..default() }.build(),
        )),
        Light::Lamp(place) => world.spawn((
            PointLight {
                intensity: 3e5,
                shadow_maps_enabled: true,
                shadow_depth_bias: 0.0,
                shadow_normal_bias: 0.0,
                ..default()
            },
            Transform::from_translation(place),
        )),
        Light::Spot(place) => world.spawn((
            SpotLight {
                intensity: 3e5,
                outer_angle: 0.8,
                shadow_maps_enabled: true,
                shadow_depth_bias: 0.0,
                shadow_normal_bias: 0.0,
                ..default()
            },
            Transform::from_translation(place).looking_at(Vec3::ZERO, Vec3::X),
        )),
    };
    let light = spawned.id();
    // Captures wait for levels, so most tests do without.
    world.entity_mut(light).insert((layers, PropQuality::EXACT));
    light
}

/// Spawns a prop that the camera does not see.
pub fn spawn_unseen(scene: &mut Stage, field: &Handle<PlenOctree>, place: Transform) -> Entity {
    scene.spawn((Prop(field.clone()), place, RenderLayers::layer(UNSEEN)))
}

/// Returns the sizes of the tiles that maps keep, in bytes, or `None` if the backend does not report them.
fn tiles(scene: &Stage) -> Option<Vec<u64>> {
    scene.device().poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let report = scene.device().wgpu_device().generate_allocator_report()?;
    let tiles = report.allocations.iter().filter(|allocation| allocation.name == "plenoctree_shadow_tile");
    Some(tiles.map(|allocation| allocation.size).collect())
}

/// Runs frames until all that rests is kept, and the GPU has given up what is not.
fn rest(scene: &mut Stage) {
    scene.update(4);
}

/// Returns the direction from [`EYE`] to a point of the frame, in pixels.
pub fn direction_at(at: DVec2) -> DVec3 {
    let view = Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y);
    let ndc = at / f64::from(PIXELS) * 2.0 - 1.0;
    let tangent = f64::from(0.5 * FOV).tan();
    view.rotation.as_dquat() * DVec3::new(ndc.x * tangent, -ndc.y * tangent, -1.0)
}

/// Returns the point of the floor in the middle of a pixel, if it shows the floor.
fn floor_at(x: u32, y: u32) -> Option<DVec3> {
    let direction = direction_at(DVec2::new(x.into(), y.into()) + 0.5);
    let distance = (FLOOR - f64::from(EYE.y)) / direction.y;
    (distance > 0.0).then(|| EYE.as_dvec3() + distance * direction)
}

/// Returns whether a prop keeps the light from a point of the scene.
pub fn is_blocked(field: &PlenOctree, prop: &Transform, light: Light, point: DVec3) -> bool {
    let (toward, distance) = light.from(point);
    hit(field, prop, point, toward).is_some_and(|hit| hit < distance)
}

/// Returns the distance at which a ray hits a prop. Its direction has the length 1.
pub fn hit(field: &PlenOctree, prop: &Transform, from: DVec3, direction: DVec3) -> Option<f64> {
    // Most rays are far from most props.
    let (center, reach) = (prop.translation.as_dvec3(), 3f64.sqrt() * f64::from(prop.scale.max_element()));
    if (center - from).cross(direction).length_squared() > reach * reach {
        return None;
    }
    let affine = prop.compute_affine().as_daffine3();
    let to_field = field.up().to_y_up().transpose();
    let inverse = affine.inverse();
    let (origin, direction) = (inverse.transform_point3(from), inverse.transform_vector3(direction));
    let scale = direction.length();
    Some(field.cast_ray(to_field * origin, to_field * direction / scale)?.distance / scale)
}

/// Compares where a frame is darker than one without the prop with where it should be. Returns the intersection over
/// the union, and the number of pixels that should be in shadow.
fn compare(lit: &RgbaImage, shadowed: &RgbaImage, blocked: impl Fn(DVec3) -> bool) -> (f64, u32) {
    let (mut both, mut either, mut expected) = (0, 0, 0);
    for (x, y, before) in lit.enumerate_pixels() {
        // The light of a spot ends somewhere.
        let Some(point) = floor_at(x, y).filter(|_| before[0] > 30) else {
            continue;
        };
        let (dark, blocked) = (linear(shadowed.get_pixel(x, y)).x < 0.5 * linear(before).x, blocked(point));
        both += u32::from(dark && blocked);
        either += u32::from(dark || blocked);
        expected += u32::from(blocked);
    }
    (f64::from(both) / f64::from(either.max(1)), expected)
}

/// Bakes a field of cells of 1/32 from -1 to 1.
pub fn shape(density: impl Fn(DVec3) -> f64 + Sync) -> PlenOctree {
    colored(6, density, |_| DVec3::splat(0.5))
}

#[test]
fn shadows_are_where_no_light_arrives() {
    let mut scene = scene(1024);
    // Fog, which is solid only along rays through its middle.
    let ball = shape(|at| if at.length() < 0.9 { 0.6 } else { 0.0 });
    let cuboid = shape(|at| if at.abs().cmplt(DVec3::new(0.9, 0.3, 0.6)).all() { 1e4 } else { 0.0 });
    let turned = Transform::from_rotation(Quat::from_euler(EulerRot::YXZ, 0.6, 0.5, 0.2)).with_scale(Vec3::splat(0.8));
    let above = |transform: Transform, height: f32| {
        let Light::Sun(direction) = Light::ALL[0] else { unreachable!("it is a sun") };
        transform.with_translation(height * direction)
    };
    let cases = [
        ("a ball", &ball, turned),
        ("a cuboid", &cuboid, turned),
        ("a toadstool", &included("toadstool"), Transform::from_rotation(Quat::from_rotation_y(0.5))),
        // Behind the near planes of all cascades.
        ("a cuboid far above", &cuboid, above(turned, 40.0)),
    ];
    let mut props = Vec::new();
    for (_, field, transform) in &cases {
        let field = scene.add((*field).clone());
        let prop = spawn_unseen(&mut scene, &field, *transform);
        scene.insert(prop, Visibility::Hidden);
        props.push(prop);
    }
    scene.wait();
    for light in Light::ALL {
        let entity = spawn_light(&mut scene, light);
        let lit = scene.capture();
        for ((what, field, transform), prop) in cases.iter().zip(&props) {
            if transform.translation.y > 10.0 && !matches!(light, Light::Sun(_)) {
                continue;
            }
            scene.insert(*prop, Visibility::Visible);
            let shadowed = scene.capture();
            scene.insert(*prop, Visibility::Hidden);
            let (iou, pixels) = compare(&lit, &shadowed, |point| is_blocked(field, transform, light, point));
            assert!(pixels > 200, "{what}, {light:?}: only {pixels} pixels should be in shadow");
            assert!(iou >= 0.98, "{what}, {light:?}: intersection over union {iou:.4}");
        }
        scene.world().despawn(entity);
    }
}

/// Without a light that casts shadows on a prop's behalf, there is no pipeline, and every byte is the same.
#[test]
fn what_casts_no_shadow_changes_nothing() {
    let mut scene = scene(1024);
    let cube = shape(|at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 });
    let field = scene.add(cube.clone());
    let prop = spawn_unseen(&mut scene, &field, default());
    scene.wait();
    scene.insert(prop, Visibility::Hidden);
    let sun = spawn_light(&mut scene, Light::ALL[0]);
    let lit = scene.capture();
    scene.insert(prop, Visibility::Visible);
    type Change = fn(&mut World, Entity, Entity);
    let shadow_maps = |world: &mut World, sun: Entity, enabled: bool| {
        world.get_mut::<DirectionalLight>(sun).unwrap().shadow_maps_enabled = enabled;
    };
    let both: fn() -> RenderLayers = || RenderLayers::from_layers(&[0, UNSEEN]);
    let changes: [(&str, Change, Change); 3] = [
        (
            "it is no caster",
            |world, _, prop| {
                world.entity_mut(prop).insert(NotShadowCaster);
            },
            |world, _, prop| {
                world.entity_mut(prop).remove::<NotShadowCaster>();
            },
        ),
        (
            "it is never solid",
            |world, _, prop| {
                world.entity_mut(prop).insert(SolidOpacity::Never);
            },
            |world, _, prop| {
                world.entity_mut(prop).insert(SolidOpacity::default());
            },
        ),
        (
            "the light does not see its layer",
            |world, sun, _| {
                world.entity_mut(sun).insert(RenderLayers::layer(0));
            },
            |_, _, _| (),
        ),
    ];
    for (what, change, undo) in changes {
        change(scene.world(), sun, prop);
        assert_eq!(scene.capture(), lit, "{what}");
        assert!(!scene.has_pipeline("plenoctree_shadow"), "{what}");
        undo(scene.world(), sun, prop);
    }
    shadow_maps(scene.world(), sun, false);
    scene.capture();
    assert!(!scene.has_pipeline("plenoctree_shadow"), "shadow maps are off");
    shadow_maps(scene.world(), sun, true);
    scene.insert(sun, both());
    assert_ne!(scene.capture(), lit);
    assert!(scene.has_pipeline("plenoctree_shadow"));
    // The shadow of a level of detail, whose cells are as large as texels, is the same.
    scene.world().entity_mut(sun).remove::<PropQuality>();
    let coarse = scene.capture();
    let (iou, _) = compare(&lit, &coarse, |point| is_blocked(&cube, &default(), Light::ALL[0], point));
    assert!(iou >= 0.98, "{iou}");
}

/// What maps keep of casters that rest is what rays find, bit for bit, wherever the camera goes; it is given back.
#[test]
fn kept_shadows_are_those_of_new_rays() {
    const MAP: usize = 256;
    let mut scene = scene(MAP);
    let cuboid = shape(|at| if at.abs().cmplt(DVec3::new(0.9, 0.3, 0.6)).all() { 1e4 } else { 0.0 });
    let (toadstool, cuboid) = (scene.add(included("toadstool")), scene.add(cuboid));
    let prop = spawn_unseen(&mut scene, &toadstool, Transform::from_xyz(0.2, 0.0, 0.1));
    // Larger than the maps of the nearer cascades.
    let large = Transform::from_xyz(2.0, 1.0, -9.0).with_scale(Vec3::splat(8.0));
    spawn_unseen(&mut scene, &cuboid, large);
    scene.wait();
    let [sun, lamp, _] = Light::ALL.map(|light| spawn_light(&mut scene, light));
    let camera = scene.camera;
    scene.capture();
    rest(&mut scene);
    let Some(kept) = tiles(&scene) else { return skip("reports of the GPU's memory") };
    // Four cascades, the faces of the lamp below it, and the spot.
    assert!(kept.len() > 2 * 6, "{kept:?}");
    let size = (MAP * MAP * size_of::<f32>()) as u64;
    assert!(kept.iter().sum::<u64>() <= (4 + 6 + 1) * size, "{kept:?}");

    for step in [Vec3::new(0.3, 0.0, 0.0), Vec3::new(-0.7, 0.4, 0.5), Vec3::new(0.011, -0.2, 0.003)] {
        let mut place = *scene.world().get::<Transform>(camera).unwrap();
        place.translation += step;
        place.rotate_local_y(0.1 * step.z);
        scene.insert(camera, place);
        let seen = scene.capture();
        let tiles = tiles(&scene).unwrap();
        assert!(
            tiles.len() + 4 >= kept.len(),
            "the camera moves, and {} of {} tiles are left",
            tiles.len(),
            kept.len()
        );
        // Those of the cascades are there, too: the other lights have at most one per map and prop.
        assert!(tiles.len() > 2 * (3 + 1), "{tiles:?}");
        scene.insert(prop, Visibility::Hidden);
        assert_ne!(scene.capture(), seen);
        scene.insert(prop, Visibility::Visible);
        let marched = scene.capture();
        assert_eq!(differing(&marched, &seen, 0), 0, "{step}: so many pixels differ");
        rest(&mut scene);
    }

    let mut count = |what, change: &dyn Fn(&mut World)| {
        let before = tiles(&scene).unwrap().len();
        change(scene.world());
        rest(&mut scene);
        let after = tiles(&scene).unwrap().len();
        assert!(after < before, "{what}: {after} of {before} tiles are left");
        after
    };
    count("no sun", &|world| _ = world.despawn(sun));
    count("no prop", &|world| _ = world.despawn(prop));
    count("no lamp", &|world| world.get_mut::<PointLight>(lamp).unwrap().shadow_maps_enabled = false);
    let left = count("no casters", &|world| {
        world.query_filtered::<Entity, With<Prop>>().iter(world).collect::<Vec<_>>().into_iter().for_each(|entity| {
            world.entity_mut(entity).insert(NotShadowCaster);
        });
    });
    assert_eq!(left, 0);
}

/// Many props cast shadows in many lights at once. A lamp inside a prop lights nothing outside.
#[test]
fn crowds_and_lamps_inside_props_cast_shadows() {
    let mut scene = scene(1024);
    let cube = shape(|at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 });
    let shell = shape(|at| if (0.6..0.9).contains(&at.length()) { 1e4 } else { 0.0 });
    let place = |index: u32| {
        let (x, z) = ((index % 8) as f32 - 3.5, (index / 8) as f32 - 3.5);
        Transform::from_xyz(0.6 * x, 0.3 * (index % 3) as f32 - 0.6, 0.6 * z).with_scale(Vec3::splat(0.35))
    };
    let crowd: Vec<Transform> = (0..64).map(place).collect();
    let [cube_asset, shell_asset] = [&cube, &shell].map(|field| scene.add(field.clone()));
    let cubes: Vec<Entity> = crowd.iter().map(|transform| spawn_unseen(&mut scene, &cube_asset, *transform)).collect();
    let lamp = Light::Lamp(Vec3::new(0.2, 0.9, 0.0));
    let Light::Lamp(center) = lamp else { unreachable!("it is a lamp") };
    let around =
        spawn_unseen(&mut scene, &shell_asset, Transform::from_translation(center).with_scale(Vec3::splat(0.5)));
    scene.wait();
    let show = |scene: &mut Stage, props: &[Entity], visibility: Visibility| {
        props.iter().for_each(|prop| scene.insert(*prop, visibility));
    };
    show(&mut scene, &cubes, Visibility::Hidden);
    show(&mut scene, &[around], Visibility::Hidden);

    let entity = spawn_light(&mut scene, lamp);
    let lit = scene.capture();
    show(&mut scene, &[around], Visibility::Visible);
    let (iou, pixels) = compare(&lit, &scene.capture(), |_| true);
    show(&mut scene, &[around], Visibility::Hidden);
    scene.world().despawn(entity);
    assert!(pixels > 5000 && iou >= 0.999, "inside a shell: {iou:.4} of {pixels} pixels");

    let lights = [Light::ALL[0], Light::ALL[1], Light::ALL[2], Light::Lamp(Vec3::new(-2.0, 2.5, -1.0))];
    lights.iter().for_each(|light| _ = spawn_light(&mut scene, *light));
    let lit = scene.capture();
    show(&mut scene, &cubes, Visibility::Visible);
    let dark = scene.capture();
    let blocked: Vec<_> = places(PIXELS, PIXELS)
        .map(|(x, y)| {
            let is_dark = |point: DVec3, light: &Light| crowd.iter().any(|at| is_blocked(&cube, at, *light, point));
            floor_at(x, y).map(|point| lights.iter().filter(|light| is_dark(point, light)).count())
        })
        .collect();
    // Floor that no light reaches is dark, and floor that all reach is as bright as before. Shadows end softly, over a
    // texel.
    let around = |x: u32, y: u32, count: usize| {
        let near = |at: u32| at.saturating_sub(1)..=(at + 1).min(PIXELS - 1);
        near(y).all(|y| near(x).all(|x| blocked[(y * PIXELS + x) as usize] == Some(count)))
    };
    let (mut unlit, mut bright, mut untouched, mut dimmed) = (0, 0, 0, 0);
    for (x, y, pixel) in dark.enumerate_pixels() {
        if around(x, y, lights.len()) {
            unlit += 1;
            bright += u32::from(pixel[0] > 40);
        } else if around(x, y, 0) {
            untouched += 1;
            dimmed += u32::from(lit.get_pixel(x, y)[0].abs_diff(pixel[0]) > 6);
        }
    }
    assert!(unlit > 200 && untouched > 5000, "{unlit} {untouched}");
    assert!(20 * bright < unlit, "{bright} of {unlit} pixels without light are bright");
    assert!(50 * dimmed < untouched, "{dimmed} of {untouched} pixels in full light are dimmed");
}

/// A prop that waits for its pipelines casts no shadow yet.
#[test]
fn shadows_wait_for_their_props() {
    let mut scene = scene(512);
    spawn_light(&mut scene, Light::ALL[0]);
    let field = colored(4, |at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 }, |_| DVec3::new(0.1, 0.8, 0.1));
    scene.spawn_prop(&field, Transform::from_xyz(-1.2, 0.0, 0.0));
    scene.wait();
    let before = scene.capture();
    // Posterized, it is drawn by other pipelines.
    let palette = FieldPalette::new(Palette::new(vec![[0.1, 0.8, 0.1]]).unwrap());
    let prop = scene.spawn_prop(&field, (Posterize::paper(), Transform::from_xyz(1.2, 0.0, 0.0)));
    let handle = scene.get::<Prop>(prop).0.clone();
    scene.world().resource_mut::<Palettes>().insert(&handle, palette);
    let green = |frame: &RgbaImage| frame.pixels().filter(|pixel| pixel[1] > pixel[0] + 40).count();
    let of_one = green(&before);
    let shows_both = |frame: &RgbaImage| green(frame) > of_one + 1000;
    let darker =
        |frame: &RgbaImage| frame.pixels().zip(before.pixels()).filter(|(now, then)| now[0] + 20 < then[0]).count();
    let frames = scene.frames_until("the second prop", shows_both);
    for frame in &frames {
        let darker = darker(frame);
        assert!(darker == 0 || shows_both(frame), "{darker} pixels are in the shadow of a prop that is not drawn");
    }
    assert!(darker(frames.last().unwrap()) > 300);
}
