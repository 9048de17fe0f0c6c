//! Tests random scenes against rays that are cast through the boxes of their props: opaque cubes in, before and behind
//! cubes of fog, turned, stretched, mirrored and sheared, seen by two cameras with viewports and layers of their own.

use std::collections::HashMap;

use bevy::{
    camera::{Hdr, Viewport, visibility::RenderLayers},
    ecs::system::RunSystemOnce,
    prelude::*,
};
use bevy_plenoctree::{PlenOctree, Prop, SolidOpacity, headless::exact_camera};
use glam::{DAffine3, DVec3};
use proptest::{prelude::*, strategy::ValueTree, test_runner::TestRunner};

use crate::stage::{
    Stage,
    pixels::is_off,
    sides::{BACKGROUND, BLUE, GREEN, RED, SOLID, color, cube, density, flat},
};

/// The layer that only the second camera sees.
const HIDDEN: usize = 3;

/// A cube of one color. Without an opacity, it lets no light through.
#[derive(Clone, Debug)]
struct Cube {
    /// The largest opacity of a ray through it.
    fog: Option<f64>,
    is_solid: bool,
    color: DVec3,
    place: Transform,
    parent: Option<Transform>,
    is_hidden: bool,
}

impl Cube {
    fn density(&self) -> f64 {
        // The longest path is the diagonal.
        self.fog.map_or(SOLID, |opacity| density(opacity) / 3f64.sqrt())
    }
}

fn cubes() -> impl Strategy<Value = Vec<Cube>> {
    let vector = |low: f32, high: f32| prop::array::uniform3(low..high).prop_map(Vec3::from);
    let mirrored = prop::array::uniform3(prop::bool::weighted(0.2))
        .prop_map(|axes| Vec3::from(axes.map(|mirrors| if mirrors { -1.0 } else { 1.0 })));
    let opacity = prop::sample::select(vec![0.02, 0.047, 0.055, 0.11, 0.26, 0.44]);
    let fog = prop_oneof![
        3 => Just((None, true)),
        // Less than half: never solid anyway.
        2 => opacity.prop_map(|opacity| (Some(opacity), true)),
        1 => Just((Some(0.97), false)),
    ];
    let place = (vector(-0.9, 0.9), vector(0.0, 6.0), vector(0.0, 1.0), mirrored);
    let cube = (fog, prop::sample::select(vec![RED, GREEN, BLUE]), place, any::<bool>(), prop::bool::weighted(0.25));
    let cube = cube.prop_map(|((fog, is_solid), color, (at, turn, size, mirrored), is_sheared, is_hidden)| {
        let size = if fog.is_some() { 0.9 + 1.3 * size } else { 0.3 + 0.7 * size };
        let turn = Quat::from_euler(EulerRot::YXZ, turn.x, turn.y, turn.z);
        let place = Transform::from_translation(at).with_rotation(turn).with_scale(size * mirrored);
        let parent = Transform::from_scale(Vec3::new(1.3, 0.7, -0.9)).with_rotation(Quat::from_rotation_z(0.4));
        Cube { fog, is_solid, color, place, parent: is_sheared.then_some(parent), is_hidden }
    });
    prop::collection::vec(cube, 2..8)
}

/// A cube as a camera sees it.
struct Seen<'a> {
    cube: &'a Cube,
    cube_from_world: DAffine3,
    /// The distance of its center along the view direction.
    distance: f64,
}

impl Seen<'_> {
    /// Returns where the ray enters the cube and leaves it, and the length of the way between in the cube's own units,
    /// per unit along the ray.
    fn span(&self, ray: Ray3d) -> Option<(f64, f64, f64)> {
        let origin = self.cube_from_world.transform_point3(ray.origin.as_dvec3());
        let direction = self.cube_from_world.transform_vector3(ray.direction.as_dvec3());
        let (a, b) = ((-0.5 - origin) / direction, (0.5 - origin) / direction);
        let (start, end) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        (start < end).then_some((start, end, direction.length()))
    }
}

/// Returns the color along a ray, and which cubes it shows. `cubes` are sorted, farthest first.
fn cast(cubes: &[Seen], ray: Ray3d) -> (DVec3, Vec<usize>) {
    let spans: Vec<_> = cubes.iter().map(|seen| seen.span(ray)).collect();
    let opaque = (0..cubes.len()).filter(|index| cubes[*index].cube.fog.is_none());
    let hits = opaque.filter_map(|index| Some((spans[index]?.0, index)));
    let (end, hit) = hits.min_by(|a, b| a.0.total_cmp(&b.0)).map_or((f64::INFINITY, None), |(at, hit)| (at, Some(hit)));
    let (mut color, mut shown) = (hit.map_or(BACKGROUND, |hit| cubes[hit].cube.color), Vec::from_iter(hit));
    for (index, Seen { cube, .. }) in cubes.iter().enumerate().filter(|(_, seen)| seen.cube.fog.is_some()) {
        if let Some((start, leaves, length)) = spans[index].filter(|(start, ..)| *start < end) {
            color = color.lerp(cube.color, 1.0 - (-cube.density() * (leaves.min(end) - start) * length).exp());
            shown.push(index);
        }
    }
    (color, shown)
}

struct Scene {
    stage: Stage,
    cameras: [Entity; 2],
    fields: HashMap<String, Handle<PlenOctree>>,
}

impl Scene {
    fn new() -> Self {
        let mut stage = Stage::with(UVec2::new(98, 64), |_| ());
        let views = [
            (UVec2::new(3, 5), UVec2::new(50, 41), Transform::from_xyz(1.1, 1.4, 3.4), Projection::default(), vec![0]),
            (UVec2::new(57, 2), UVec2::new(37, 61), Transform::from_xyz(-0.7, 0.5, -5.0), flat(), vec![0, HIDDEN]),
        ];
        let second = (exact_camera(Color::BLACK), stage.headless.target());
        let cameras = [stage.camera, stage.spawn(second)];
        for (entity, (physical_position, physical_size, place, projection, layers)) in cameras.into_iter().zip(views) {
            let view = (place.looking_at(Vec3::ZERO, Vec3::Y), projection, RenderLayers::from_layers(&layers));
            stage.insert(entity, view);
            let mut camera = stage.world().get_mut::<Camera>(entity).unwrap();
            (camera.order, camera.clear_color) = (physical_position.x as isize, color(BACKGROUND).into());
            camera.viewport = Some(Viewport { physical_position, physical_size, ..default() });
        }
        Self { stage, cameras, fields: HashMap::new() }
    }

    fn spawn(&mut self, shape: &Cube) -> Entity {
        let world = self.stage.world();
        let field = self
            .fields
            .entry(format!("{:?} {}", shape.fog, shape.color))
            .or_insert_with(|| world.resource_mut::<Assets<PlenOctree>>().add(cube(shape.density(), shape.color)));
        let layers = RenderLayers::layer(if shape.is_hidden { HIDDEN } else { 0 });
        let entity = world.spawn((Prop(field.clone()), shape.place, layers)).id();
        if !shape.is_solid {
            world.entity_mut(entity).insert(SolidOpacity::Never);
        }
        if let Some(parent) = shape.parent {
            let parent = world.spawn((parent, Visibility::default())).id();
            world.entity_mut(entity).insert(ChildOf(parent));
        }
        entity
    }

    /// Compares every pixel whose corners show the same cubes as its middle, and returns how many show any.
    fn check(&mut self, cubes: &[Cube], props: &[Entity], what: &str) -> usize {
        let frame = self.stage.capture();
        let mut shown = 0;
        for camera in self.cameras {
            let rays = move |cameras: Query<(&Camera, &GlobalTransform)>| {
                let (camera, place) = cameras.get(camera).unwrap();
                let Viewport { physical_position: low, physical_size: size, .. } = camera.viewport.clone().unwrap();
                let pixels = (0..size.y).flat_map(|y| (0..size.x).map(move |x| low + UVec2::new(x, y)));
                let ray = |at: Vec2| camera.viewport_to_world(place, at).unwrap();
                let around = [(0.5, 0.5), (-0.2, -0.2), (1.2, -0.2), (-0.2, 1.2), (1.2, 1.2)].map(Vec2::from);
                let rays = pixels.map(|pixel| (pixel, around.map(|by| ray(pixel.as_vec2() + by))));
                (rays.collect::<Vec<_>>(), *place)
            };
            let (rays, place) = self.stage.world().run_system_once(rays).unwrap();
            let world = self.stage.headless.app.world();
            let layers = world.get::<RenderLayers>(camera).unwrap();
            let mut seen: Vec<_> = (cubes.iter().zip(props))
                .filter(|(_, prop)| world.get::<RenderLayers>(**prop).unwrap().intersects(layers))
                .map(|(cube, prop)| {
                    let world_from_cube = world.get::<GlobalTransform>(*prop).unwrap().affine().as_daffine3();
                    let center = world_from_cube.translation - place.translation().as_dvec3();
                    let distance = center.dot(place.forward().as_dvec3());
                    Seen { cube, cube_from_world: world_from_cube.inverse(), distance }
                })
                .collect();
            seen.sort_by(|a, b| b.distance.total_cmp(&a.distance));
            for (pixel, rays) in rays {
                let [(expected, shows), corners @ ..] = rays.map(|ray| cast(&seen, ray));
                if corners.iter().all(|(_, others)| *others == shows) {
                    let (found, steps) = (frame.get_pixel(pixel.x, pixel.y), 255.0 * expected);
                    let is_right = !is_off(found, expected, 3.0);
                    assert!(is_right, "{found:?} at {pixel}, expected {steps:.0} of {shows:?} in {what}");
                    shown += usize::from(!shows.is_empty());
                }
            }
        }
        shown
    }
}

#[test]
fn random_scenes_look_as_rays_say() {
    const SCENES: usize = 12;
    let (mut scene, mut random, mut shown) = (Scene::new(), TestRunner::deterministic(), 0);
    let modes = [(Msaa::Off, false), (Msaa::Sample4, true), (Msaa::Sample4, false), (Msaa::Off, true)];
    for (msaa, hdr) in modes.into_iter().cycle().take(SCENES) {
        let cubes = cubes().new_tree(&mut random).unwrap().current();
        let props: Vec<_> = cubes.iter().map(|cube| scene.spawn(cube)).collect();
        for camera in scene.cameras {
            let mut camera = scene.stage.world().entity_mut(camera);
            camera.remove::<Hdr>().insert(msaa);
            if hdr {
                camera.insert(Hdr);
            }
        }
        scene.stage.wait();
        shown += scene.check(&cubes, &props, &format!("{msaa:?}, HDR {hdr}, {cubes:#?}"));
        for prop in props {
            scene.stage.world().despawn(prop);
        }
    }
    assert!(shown > 800 * SCENES, "{shown} pixels");
}
