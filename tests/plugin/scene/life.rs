//! Tests props that are spawned, changed and despawned while the app runs.

use std::time::Duration;

use bevy::{
    camera::RenderTarget,
    prelude::*,
    render::{
        RenderApp,
        error_handler::{RenderErrorHandler, RenderErrorPolicy},
        render_asset::RenderAssets,
        render_resource::TextureFormat,
        renderer::RenderDevice,
    },
};
use bevy_plenoctree::{
    FieldPalette, GpuField, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop,
    headless::{Headless, exact_camera},
};
use glam::{DVec2, DVec3};

use super::stage::{BLUE, GREEN, RED, SOLID, Stage, color, cube, density, flat, in_cube, seen, shape, within};

/// Every change to a prop is visible in the same frame.
#[test]
fn a_prop_changes_while_the_app_runs() {
    let fog = cube(density(0.4), GREEN);
    // A shallower tree, in another place.
    let block = shape(SOLID, BLUE, |at| at.x > 0.0);
    let mut stage = Stage::new();
    let check = |stage: &mut Stage, what, shown: Option<(DVec3, f64, bool)>| {
        stage.check(what, |side, place| {
            let layer = shown.filter(|(_, _, right)| match right {
                true => within(place, (0.0, -1.0), (1.0, 1.0)),
                false => in_cube(place),
            });
            seen(side, &layer.map(|(color, opacity, _)| (0.0, color, opacity)).into_iter().collect::<Vec<_>>())
        });
    };
    let (a_fog, a_block) = (Some((GREEN, 0.4, false)), Some((BLUE, 1.0, true)));
    stage.wait();
    check(&mut stage, "nothing", None);

    let prop = stage.spawn_prop(&fog, default());
    check(&mut stage, "spawned", a_fog);
    stage.world().entity_mut(prop).insert(Visibility::Hidden);
    check(&mut stage, "hidden", None);
    stage.world().entity_mut(prop).insert(Visibility::Visible);
    check(&mut stage, "shown", a_fog);

    let other = stage.add(&block);
    stage.world().get_mut::<Prop>(prop).unwrap().0 = other.clone();
    check(&mut stage, "another field", a_block);
    *stage.world().resource_mut::<Assets<PlenOctree>>().get_mut(&other).unwrap() = fog.clone();
    check(&mut stage, "the field reloaded", a_fog);
    *stage.world().resource_mut::<Assets<PlenOctree>>().get_mut(&other).unwrap() = block;
    check(&mut stage, "the field reloaded again", a_block);
    *stage.world().resource_mut::<Assets<PlenOctree>>().get_mut(&other).unwrap() = shape(1.0, RED, |_| false);
    check(&mut stage, "the field became empty", None);
    stage.world().resource_mut::<Assets<PlenOctree>>().insert(other.id(), fog).unwrap();
    check(&mut stage, "the field is back", a_fog);

    stage.world().entity_mut(prop).remove::<Prop>();
    check(&mut stage, "the prop removed", None);
    stage.world().entity_mut(prop).insert(Prop(other));
    check(&mut stage, "the prop inserted again", a_fog);
    stage.world().despawn(prop);
    check(&mut stage, "despawned", None);
}

/// The memory of an app, on the CPU and the GPU.
#[derive(Debug)]
struct Held {
    fields: usize,
    entities: [usize; 2],
    /// The number of the device's allocations and their bytes, if the backend reports them.
    gpu: Option<(usize, u64)>,
}

impl Held {
    fn by(headless: &Headless) -> Self {
        let render = headless.app.sub_app(RenderApp).world();
        let device = render.resource::<RenderDevice>();
        device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let report = device.wgpu_device().generate_allocator_report();
        Self {
            fields: uploaded_fields(headless),
            entities: [headless.app.world(), render].map(|world| world.entities().count_spawned() as usize),
            gpu: report.map(|report| (report.allocations.len(), report.total_allocated_bytes)),
        }
    }
}

fn uploaded_fields(headless: &Headless) -> usize {
    headless.app.sub_app(RenderApp).world().resource::<RenderAssets<GpuField>>().iter().count()
}

/// Spawns and despawns a prop a thousand times, each time with a new field, a new palette, and a camera that draws it
/// to a new image.
#[test]
fn a_thousand_props_leave_nothing_behind() {
    let field = cube(SOLID, RED);
    let mut headless = Headless::new(UVec2::splat(16), |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let mut after_rounds = |rounds| {
        for _ in 0..rounds {
            let world = headless.app.world_mut();
            let field = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
            let palette = FieldPalette::from_colors([color(RED), color(BLUE)]).unwrap();
            world.resource_mut::<Palettes>().insert(&field, palette);
            let image = Image::new_target_texture(16, 16, TextureFormat::Rgba8UnormSrgb, None);
            let image = world.resource_mut::<Assets<Image>>().add(image);
            let target = RenderTarget::Image(image.into());
            let view = (flat(), Transform::from_xyz(0.0, 0.0, 5.0));
            let spawned = [
                world.spawn((Prop(field), Posterize::default())).id(),
                world.spawn((exact_camera(Color::WHITE), target, view)).id(),
            ];
            headless.update();
            assert_eq!(uploaded_fields(&headless), 1);
            for entity in spawned {
                headless.app.world_mut().despawn(entity);
            }
        }
        // Recently used resources are kept for a few frames.
        for _ in 0..10 {
            headless.update();
        }
        Held::by(&headless)
    };
    let rounds = 1000;
    let (first, last) = (after_rounds(20), after_rounds(rounds));
    assert_eq!((first.fields, last.fields), (0, 0));
    assert_eq!(last.entities, first.entities);
    if let (Some(first), Some(last)) = (first.gpu, last.gpu) {
        assert_eq!(last.0, first.0, "allocations");
        // Allocations are aligned, so the gaps between them vary, but by less than a byte per round.
        assert!(last.1 < first.1 + rounds, "{} bytes grew to {}", first.1, last.1);
    }
}

/// Two cameras, one of them multisampled, see a posterized prop next to one that is drawn as trained. They see the same
/// after the device is lost and replaced.
#[test]
fn a_new_device_shows_what_the_lost_one_did() {
    let mut stage = Stage::new();
    let field = stage.add(&cube(SOLID, RED));
    stage.world().resource_mut::<Palettes>().insert(&field, FieldPalette::from_colors([color(BLUE)]).unwrap());
    stage.world().spawn((Prop(field), Posterize::default(), Transform::from_xyz(0.5, 0.0, 0.0)));
    stage.spawn_prop(&cube(density(0.4), GREEN), Transform::from_xyz(-0.75, 0.0, 0.0));
    let [front, _] = stage.cameras;
    stage.world().entity_mut(front).insert(Msaa::Sample4);
    stage.wait();
    let check = |stage: &mut Stage, what| {
        stage.check(what, |side, place| {
            let mut layers = Vec::new();
            layers.extend(in_cube(place - DVec2::new(0.5, 0.0)).then_some((0.0, BLUE, 1.0)));
            layers.extend(in_cube(place + DVec2::new(0.75, 0.0)).then_some((0.0, GREEN, 0.4)));
            seen(side, &layers)
        });
    };
    check(&mut stage, "before");
    stage.world().insert_resource(RenderErrorHandler(|_, _, _| RenderErrorPolicy::Recover(default())));
    stage.headless.app.sub_app(RenderApp).world().resource::<RenderDevice>().wgpu_device().destroy();
    // The new device is created while the app runs.
    for _ in 0..100 {
        stage.headless.update();
        std::thread::sleep(Duration::from_millis(10));
    }
    stage.wait();
    check(&mut stage, "after");
}
