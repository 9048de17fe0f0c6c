//! Tests ray casts and pointers: what they hit, where, and in which region.

use std::sync::{LazyLock, Mutex};

use bevy::{
    camera::visibility::RenderLayers,
    ecs::system::RunSystemOnce,
    math::Affine3A,
    picking::{DefaultPickingPlugins, backend::PointerHits, pointer::PointerId},
    prelude::*,
};
use bevy_plenoctree::{
    BilateralFilter, EdgeSmoothing, FieldPalette, Palettes, PlenOctree, Posterize, Prop, PropHit, PropPickingPlugin,
    PropRayCast, UpAxis,
    headless::{Headless, HeadlessError},
};
use glam::{DAffine3, DVec3};
use plenoctree::{BakeSettings, Basis, bake};
use proptest::prelude::*;

use super::stage::{
    Stage,
    fields::colored,
    pixels::{color, is_off, places},
};

const RADIUS: f64 = 0.8;
/// The width of the balls' cells.
const CELL: f64 = 2.0 / 64.0;

/// A ball whose density is 1 inside.
static BALL: LazyLock<PlenOctree> = LazyLock::new(|| {
    let settings =
        BakeSettings { depth: 6, basis: Basis::Rgba, density_samples: 4, directions: 1, ..Default::default() };
    let radiance = |at: DVec3| move |_: DVec3| 0.5 + 0.4 * (4.0 * at).map(f64::sin);
    bake(&settings, |at| if at.length() < RADIUS { 1.0 } else { 0.0 }, radiance).unwrap()
});

/// Returns a ball, made once for each density and axis.
fn ball(density: f64, up: UpAxis) -> PlenOctree {
    static BALLS: Mutex<Vec<(f64, UpAxis, PlenOctree)>> = Mutex::new(vec![]);
    let mut balls = BALLS.lock().unwrap();
    if let Some((.., ball)) = balls.iter().find(|ball| (ball.0, ball.1) == (density, up)) {
        return ball.clone();
    }
    let (nodes, coefficients) = (BALL.nodes().to_vec(), BALL.coefficients().to_vec());
    let densities = BALL.densities().iter().map(|share| (density * f64::from(*share)) as f32).collect();
    let ball = PlenOctree::new(BALL.frame(), BALL.basis(), BALL.activation(), up, nodes, densities, coefficients);
    let ball = ball.unwrap();
    balls.push((density, up, ball.clone()));
    ball
}

/// Returns a world that supports ray casts and nothing else.
fn world() -> World {
    let mut world = World::new();
    world.init_resource::<Assets<PlenOctree>>();
    world.init_resource::<Palettes>();
    world
}

fn spawn(world: &mut World, field: &PlenOctree, transform: impl Into<GlobalTransform>) -> Entity {
    let field = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
    world.spawn((Prop(field), transform.into(), InheritedVisibility::VISIBLE)).id()
}

fn cast(world: &mut World, ray: Ray3d) -> Option<PropHit> {
    world.run_system_once(move |props: PropRayCast| props.cast_ray(ray)).unwrap()
}

fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(range).prop_map(DVec3::from)
}

fn direction() -> impl Strategy<Value = DVec3> {
    vector(-1.0..1.0).prop_filter_map("short", |v| (v.length() > 0.2).then(|| v.normalize()))
}

/// Generates placements that rotate, scale unevenly and shear, mirrored or not, near the origin or far away from it.
fn placement() -> impl Strategy<Value = Affine3A> {
    (direction(), 0.0..6.0f64, vector(0.4..2.5), vector(-0.4..0.4), any::<bool>(), vector(-50.0..50.0)).prop_map(
        |(axis, angle, scale, shear, mirrored, position)| {
            let mut matrix = glam::DMat3::from_axis_angle(axis, angle) * glam::DMat3::from_diagonal(scale);
            matrix *= glam::DMat3::from_cols(
                if mirrored { DVec3::NEG_X } else { DVec3::X },
                DVec3::new(shear.x, 1.0, 0.0),
                DVec3::new(shear.y, shear.z, 1.0),
            );
            Affine3A::from_mat3_translation(matrix.as_mat3(), position.as_vec3())
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Wherever the ball is, rays hit it at the analytic point: at the surface of a dense ball, and in fog at the depth
    /// that half of the light reaches. The normal is that of the concentric sphere through that point.
    #[test]
    fn rays_hit_a_ball_at_the_analytic_point(
        dense in any::<bool>(),
        up in prop_oneof![Just(UpAxis::Y), Just(UpAxis::Z)],
        placement in placement(),
        from in direction(),
        aim in vector(-0.35..0.35),
    ) {
        let density = if dense { 1e3 } else { 3.0 };
        let mut world = world();
        let entity = spawn(&mut world, &ball(density, up), GlobalTransform::from(placement));
        let world_from_field = placement.as_daffine3() * DAffine3::from_mat3(up.to_y_up());
        let field_from_world = world_from_field.inverse();

        // The ray in the scene, and where it meets the sphere in the field.
        let origin = world_from_field.transform_point3(4.0 * from).as_vec3();
        let target = world_from_field.transform_point3(aim).as_vec3();
        let ray = Ray3d::new(origin, Dir3::new(target - origin).unwrap());
        let start = field_from_world.transform_point3(ray.origin.as_dvec3());
        let step = field_from_world.transform_vector3(ray.direction.as_dvec3());
        let way = step.normalize();
        let middle = -start.dot(way);
        let enters = middle - (RADIUS * RADIUS - (start + middle * way).length_squared()).sqrt();
        let length = enters + std::f64::consts::LN_2 / density;

        let hit = cast(&mut world, ray).unwrap();
        prop_assert_eq!(hit.entity, entity);
        let off = (f64::from(hit.distance) * step.length() - length).abs();
        // The surface is as coarse as the cells: a cell that the ball meets anywhere may be hit at its near corner. The
        // points at which it was baked are at least an eighth of a cell from there along each axis.
        let most = 0.875 * 3f64.sqrt() * CELL / -(start + enters * way).normalize().dot(way);
        prop_assert!(off < most, "distance off by {} cells of {}", off / CELL, most / CELL);
        let along = ray.origin + hit.distance * ray.direction;
        prop_assert!((along - hit.point).length() < 1e-4 * (1.0 + hit.point.length()));

        // Two vectors that span the plane of the normal in the scene span it in the field too.
        let inward = |v: Vec3| field_from_world.transform_vector3(v.as_dvec3());
        let (a, b) = hit.normal.any_orthonormal_pair();
        let across = inward(a).cross(inward(b));
        let normal = across * across.dot(inward(*hit.normal)).signum();
        let radial = field_from_world.transform_point3(hit.point.as_dvec3());
        let angle = normal.angle_between(radial).to_degrees();
        prop_assert!(angle < 6.0, "normal off by {angle} degrees");
    }
}

#[test]
fn the_color_of_a_hit_is_the_color_along_the_ray() {
    let field = ball(2.0, UpAxis::Y);
    let (origin, direction) = (DVec3::new(0.2, 0.1, 3.0), DVec3::NEG_Z);
    let (color, opacity) = field.render_ray(origin, direction);
    let hit = field.cast_ray(origin, direction).unwrap();
    assert!((hit.color * hit.opacity - color).length() < 1e-12 && (hit.opacity - opacity).abs() < 1e-12);
    assert!(hit.opacity > 0.9 && hit.opacity < 1.0);
}

#[test]
fn thin_fog_is_not_hit() {
    // A ray through its center loses just under, and just over, half of its light.
    let through = std::f64::consts::LN_2 / (2.0 * RADIUS);
    for (density, hit) in [(0.97 * through, false), (1.03 * through, true)] {
        let field = ball(density, UpAxis::Y);
        assert_eq!(field.cast_ray(DVec3::new(0.01, 0.01, 3.0), DVec3::NEG_Z).is_some(), hit);
    }
}

#[test]
fn in_uniform_fog_the_normal_points_back() {
    let fog = colored(5, |_| 20.0, |_| DVec3::splat(0.5));
    let direction = DVec3::new(1.0, 2.0, -2.0) / 3.0;
    let hit = fog.cast_ray(DVec3::ZERO, direction).unwrap();
    assert!((hit.distance - std::f64::consts::LN_2 / 20.0).abs() < 1e-6);
    assert_eq!(hit.normal, -direction);
}

#[test]
fn the_nearest_visible_prop_is_hit() {
    let mut world = world();
    let field = ball(1e3, UpAxis::Z);
    let far = spawn(&mut world, &field, Transform::from_xyz(0.0, 0.0, -5.0));
    let near = spawn(&mut world, &field, Transform::from_xyz(0.0, 0.0, 5.0));
    let ray = Ray3d::new(Vec3::new(0.1, 0.0, 20.0), Dir3::NEG_Z);
    assert_eq!(cast(&mut world, ray).unwrap().entity, near);
    world.entity_mut(near).insert(InheritedVisibility::HIDDEN);
    assert_eq!(cast(&mut world, ray).unwrap().entity, far);
    // Hidden props are hit only on request, nearest first.
    let all = world.run_system_once(move |props: PropRayCast| props.cast_ray_among(ray, [far, near])).unwrap();
    assert_eq!(all.iter().map(|hit| hit.entity).collect::<Vec<_>>(), [near, far]);
    // Nothing is visible of a flattened prop.
    world.entity_mut(far).insert(GlobalTransform::from(Transform::from_scale(Vec3::new(1.0, 0.0, 1.0))));
    assert_eq!(cast(&mut world, ray), None);
}

const SIZE: UVec2 = UVec2::new(96, 64);

/// A scene with pointers, and a camera at z = 6 that faces -z.
#[derive(Deref, DerefMut)]
struct Scene {
    #[deref]
    stage: Stage,
    field: Handle<PlenOctree>,
}

impl Scene {
    fn new() -> Self {
        let mut stage = Stage::with(SIZE, |app| {
            app.add_plugins((DefaultPickingPlugins, PropPickingPlugin)).init_resource::<Seen>();
        });
        stage.set_background(Color::WHITE);
        stage.set(Transform::from_xyz(0.0, 0.0, 6.0));
        let field = stage.add(ball(1e3, UpAxis::Y));
        Self { stage, field }
    }

    fn spawn_watched(&mut self, z: f32, with: impl Bundle) -> Entity {
        let prop = (Prop(self.field.clone()), Transform::from_xyz(0.0, 0.0, z), with);
        self.world().spawn(prop).observe(see::<Over>).observe(see::<Click>).id()
    }

    /// Returns what observers of props receive while the mouse does something.
    fn seen(&mut self, act: impl FnOnce(&mut Headless) -> Result<(), HeadlessError>) -> Vec<(&'static str, Entity)> {
        self.world().resource_mut::<Seen>().0.clear();
        act(&mut self.stage.headless).unwrap();
        self.world().resource::<Seen>().0.iter().map(|(name, entity, _)| (*name, *entity)).collect()
    }
}

#[derive(Resource, Default)]
struct Seen(Vec<(&'static str, Entity, PropHit)>);

trait Named {
    const NAME: &'static str;
    fn hit(&self) -> &bevy::picking::backend::HitData;
}

impl Named for Over {
    const NAME: &'static str = "over";
    fn hit(&self) -> &bevy::picking::backend::HitData {
        &self.hit
    }
}

impl Named for Click {
    const NAME: &'static str = "click";
    fn hit(&self) -> &bevy::picking::backend::HitData {
        &self.hit
    }
}

fn see<E: Named + Clone + Reflect + std::fmt::Debug>(event: On<Pointer<E>>, mut seen: ResMut<Seen>) {
    let data = event.event().event.hit();
    let hit = *data.extra_as::<PropHit>().unwrap();
    assert_eq!((data.position, data.normal, data.depth), (Some(hit.point), Some(*hit.normal), hit.distance));
    seen.0.push((E::NAME, event.entity, hit));
}

#[test]
fn pointers_reach_observers() {
    let mut scene = Scene::new();
    let far = scene.spawn_watched(-3.0, ());
    let near = scene.spawn_watched(0.0, ());
    scene.update(3);
    let (middle, beside) = (0.5 * SIZE.as_vec2(), Vec2::splat(2.0));
    assert_eq!(scene.seen(|headless| headless.click(middle)), [("over", near), ("click", near)]);
    let hit = scene.world().resource::<Seen>().0[0].2;
    assert!((hit.point - Vec3::new(0.0, 0.0, RADIUS as f32)).length() < CELL as f32, "{hit:?}");
    assert!(hit.normal.z > 0.99, "{hit:?}");
    // There is nothing next to the ball.
    assert!(scene.seen(|headless| headless.click(beside)).is_empty());
    // A prop that is ignored, on another layer or hidden lets the pointer through to what is behind it.
    for disable in [
        |near: &mut EntityWorldMut| _ = near.insert(Pickable::IGNORE),
        |near: &mut EntityWorldMut| _ = near.remove::<Pickable>().insert(RenderLayers::layer(1)),
        |near: &mut EntityWorldMut| _ = near.remove::<RenderLayers>().insert(Visibility::Hidden),
    ] {
        scene.headless.pointer_to(beside).unwrap();
        disable(&mut scene.world().entity_mut(near));
        scene.update(1);
        assert_eq!(scene.seen(|headless| headless.pointer_to(middle)), [("over", far)]);
    }
}

/// Rays hit the field that is drawn: the previous one of a prop, until the next one can be drawn.
#[test]
fn rays_hit_what_is_drawn() {
    let mut scene = Scene::new();
    let prop = scene.spawn_watched(0.0, Posterize::default());
    let field = scene.field.clone();
    let palette = FieldPalette::from_colors([Color::WHITE, Color::BLACK]).unwrap();
    scene.world().resource_mut::<Palettes>().insert(&field, palette);
    scene.wait();
    let ray = Ray3d::new(Vec3::new(0.0, 0.0, 6.0), Dir3::NEG_Z);
    assert!(cast(scene.world(), ray).unwrap().label.is_some());
    let next = scene.resource::<Assets<PlenOctree>>().reserve_handle();
    scene.insert(prop, Prop(next));
    scene.update(2);
    let hit = cast(scene.world(), ray).unwrap();
    // The palette of the next field has other labels.
    assert_eq!((hit.entity, hit.label), (prop, None));
}

#[test]
fn without_picking_plugins_clicks_are_errors_with_words() {
    let mut stage = Stage::with(SIZE, |app| _ = app.add_plugins(PropPickingPlugin));
    stage.update(1);
    let error = stage.headless.click(Vec2::ONE).unwrap_err();
    assert_eq!(error.to_string(), "there are no pointers; add Bevy's `DefaultPickingPlugins`");
}

/// Hits of a camera that draws later are above those of others.
#[test]
fn hits_have_the_order_of_their_cameras() {
    let mut scene = Scene::new();
    let prop = scene.spawn_watched(0.0, ());
    scene.camera_mut().order = 7;
    scene.update(3);
    scene.headless.pointer_to(0.5 * SIZE.as_vec2()).unwrap();
    let hits = scene.world().resource_mut::<Messages<PointerHits>>().drain().collect::<Vec<_>>();
    let of_prop = hits.iter().find(|hits| hits.picks.iter().any(|(entity, _)| *entity == prop)).unwrap();
    assert_eq!((of_prop.order, of_prop.pointer), (7.0, PointerId::Mouse));
}

/// Every pixel shows the label that a ray through it finds. The bilateral filter does not affect rays, but moves some
/// borders in the frame.
#[test]
fn labels_of_rays_match_the_frame() {
    let source = [[0.8, 0.2, 0.3], [0.2, 0.7, 0.4], [0.3, 0.3, 0.9], [0.9, 0.9, 0.7]];
    // No two labels are shown in the same color.
    let shown = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.1], [0.0, 0.2, 1.0], [0.9, 0.8, 0.0]].map(DVec3::from);
    let mut scene = Scene::new();
    let colors = source.map(|[r, g, b]: [f32; 3]| Color::srgb(r, g, b));
    let mut palette = FieldPalette::from_colors(colors).unwrap();
    for (index, color) in shown.iter().enumerate() {
        palette.set(index, self::color(*color));
    }
    let field = scene.field.clone();
    scene.world().resource_mut::<Palettes>().insert(&field, palette);
    let prop = scene.spawn_watched(0.0, ());
    for (filtered, least) in [(false, 0.995), (true, 0.8)] {
        let filter = if filtered { default() } else { BilateralFilter { iterations: 0, ..default() } };
        scene.insert(prop, Posterize { softness: 0.0, filter, edges: EdgeSmoothing::Off, ..Posterize::paper() });
        scene.wait();
        let frame = scene.capture();

        let camera = scene.camera;
        let labels = move |props: PropRayCast, cameras: Query<(&Camera, &GlobalTransform)>| {
            let (camera, transform) = cameras.get(camera).unwrap();
            let of_pixel = |(x, y): (u32, u32)| {
                let ray = camera.viewport_to_world(transform, UVec2::new(x, y).as_vec2() + 0.5).unwrap();
                props.cast_ray(ray).map(|hit| ((x, y), hit))
            };
            places(SIZE.x, SIZE.y).filter_map(of_pixel).collect::<Vec<_>>()
        };
        let hits = scene.world().run_system_once(labels).unwrap();
        assert!(hits.len() > 250);
        let mut different = std::collections::HashSet::new();
        let right = hits.iter().filter(|((x, y), hit)| {
            assert_eq!(hit.entity, prop);
            let label = hit.label.unwrap();
            different.insert(label.index);
            let expected = label.share * shown[label.first] + (1.0 - label.share) * shown[label.second];
            !is_off(frame.get_pixel(*x, *y), expected, 2.0)
        });
        let share = right.count() as f64 / hits.len() as f64;
        assert!(share >= least, "{share} with {different:?}, filtered: {filtered}");
        assert!(different.len() > 6, "{different:?}");
    }
}

#[test]
fn props_that_are_not_posterized_have_no_labels() {
    let mut world = world();
    let entity = spawn(&mut world, &ball(1.2, UpAxis::Y), GlobalTransform::IDENTITY);
    let field = world.get::<Prop>(entity).unwrap().0.id();
    let ray = Ray3d::new(Vec3::new(0.0, 0.0, 3.0), Dir3::NEG_Z);
    let label = |world: &mut World| cast(world, ray).unwrap().label;
    assert_eq!(label(&mut world), None, "without Posterize");
    world.entity_mut(entity).insert(Posterize::default());
    assert_eq!(label(&mut world), None, "without a palette");
    let palette = FieldPalette::from_colors([Color::WHITE, Color::BLACK]).unwrap();
    world.resource_mut::<Palettes>().insert(field, palette);
    assert!(label(&mut world).is_some());
    world.entity_mut(entity).insert(Posterize { min_opacity: 0.95, ..default() });
    assert_eq!(label(&mut world), None, "too thin to be posterized");
    // Settings are clamped as in frames.
    for blend_steps in [0, u32::MAX] {
        world.entity_mut(entity).insert(Posterize { min_opacity: f32::NAN, blend_steps, ..default() });
        assert!(label(&mut world).is_some(), "{blend_steps} steps");
    }
}
