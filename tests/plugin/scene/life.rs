//! Tests props that are spawned, changed and despawned while the app runs.

use std::{sync::mpsc, thread, time::Duration};

use bevy::{
    camera::RenderTarget,
    prelude::*,
    render::{
        error_handler::{RenderErrorHandler, RenderErrorPolicy},
        render_asset::RenderAssets,
        render_resource::TextureFormat,
    },
};
use bevy_plenoctree::{FieldPalette, GpuField, Palettes, PlenOctree, Posterize, Prop, headless::exact_camera};
use glam::{DVec2, DVec3};

use crate::stage::{
    Stage,
    sides::{BLUE, GREEN, RED, SOLID, Sides, color, cube, density, flat, in_cube, seen, shape, within},
    skip,
};

/// Every change to a prop is visible in the same frame.
#[test]
fn a_prop_changes_while_the_app_runs() {
    let fog = cube(density(0.4), GREEN);
    // A shallower tree, in another place.
    let block = shape(SOLID, BLUE, |at| at.x > 0.0);
    let mut stage = Sides::new();
    let check = |stage: &mut Sides, what, shown: Option<(DVec3, f64, bool)>| {
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

    let prop = stage.spawn_prop(&fog, ());
    check(&mut stage, "spawned", a_fog);
    stage.insert(prop, Visibility::Hidden);
    check(&mut stage, "hidden", None);
    stage.insert(prop, Visibility::Visible);
    check(&mut stage, "shown", a_fog);

    let other: Handle<PlenOctree> = stage.add(block.clone());
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
    stage.insert(prop, Prop(other));
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
    fn by(stage: &Stage) -> Self {
        stage.device().poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let report = stage.device().wgpu_device().generate_allocator_report();
        Self {
            fields: uploaded_fields(stage),
            entities: [stage.headless.app.world(), stage.render_world()]
                .map(|world| world.entities().count_spawned() as usize),
            gpu: report.map(|report| (report.allocations.len(), report.total_allocated_bytes)),
        }
    }
}

fn uploaded_fields(stage: &Stage) -> usize {
    stage.render_world().resource::<RenderAssets<GpuField>>().iter().count()
}

/// Spawns and despawns a prop hundreds of times, each time with a new field, a new palette, and a camera that draws it
/// to a new image.
#[test]
fn hundreds_of_props_leave_nothing_behind() {
    let field = cube(SOLID, RED);
    let mut stage = Stage::new(16);
    stage.close();
    let mut after_rounds = |rounds| {
        for _ in 0..rounds {
            let world = stage.world();
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
            stage.update(1);
            assert_eq!(uploaded_fields(&stage), 1);
            for entity in spawned {
                stage.world().despawn(entity);
            }
        }
        // Recently used resources are kept for a few frames.
        stage.update(10);
        Held::by(&stage)
    };
    let (first, last) = (after_rounds(20), after_rounds(200));
    assert_eq!((first.fields, last.fields), (0, 0));
    assert_eq!(last.entities, first.entities);
    let (Some(first), Some(last)) = (first.gpu, last.gpu) else { return skip("reports of the GPU's memory") };
    assert_eq!(last.0, first.0, "allocations");
    // Allocations are aligned, so the gaps between them vary, but by less than three bytes per round.
    assert!(last.1 < first.1 + 1000, "{} bytes grew to {}", first.1, last.1);
}

/// Two cameras, one of them multisampled, see a posterized prop next to one that is drawn as trained. They see the same
/// after the device is lost and replaced.
#[test]
fn a_new_device_shows_what_the_lost_one_did() {
    let mut stage = Sides::new();
    let field: Handle<PlenOctree> = stage.add(cube(SOLID, RED));
    stage.world().resource_mut::<Palettes>().insert(&field, FieldPalette::from_colors([color(BLUE)]).unwrap());
    stage.spawn((Prop(field), Posterize::default(), Transform::from_xyz(0.5, 0.0, 0.0)));
    stage.spawn_prop(&cube(density(0.4), GREEN), Transform::from_xyz(-0.75, 0.0, 0.0));
    stage.set(Msaa::Sample4);
    stage.wait();
    let check = |stage: &mut Sides, what| {
        stage.check(what, |side, place| {
            let mut layers = Vec::new();
            layers.extend(in_cube(place - DVec2::new(0.5, 0.0)).then_some((0.0, BLUE, 1.0)));
            layers.extend(in_cube(place + DVec2::new(0.75, 0.0)).then_some((0.0, GREEN, 0.4)));
            seen(side, &layers)
        });
    };
    check(&mut stage, "before");
    stage.world().insert_resource(RenderErrorHandler(|_, _, _| RenderErrorPolicy::Recover(default())));
    stage.device().wgpu_device().destroy();
    // The new device is created while the app runs.
    for _ in 0..100 {
        stage.update(1);
        thread::sleep(Duration::from_millis(10));
    }
    stage.wait();
    check(&mut stage, "after");
}

/// Threads that send fields catch their own errors while Bevy compiles shaders and catches its own. Without the feature
/// `std` of wgpu, whichever ends first ends the app.
#[test]
fn threads_catch_errors_apart() {
    let stage = Sides::new();
    let device = stage.device().wgpu_device();
    let errors = device.push_error_scope(wgpu::ErrorFilter::Validation);
    thread::scope(|scope| {
        let (watches, begins) = mpsc::channel();
        let (stops, ends) = mpsc::channel::<()>();
        scope.spawn(move || {
            let _errors = device.push_error_scope(wgpu::ErrorFilter::Validation);
            watches.send(()).unwrap();
            _ = ends.recv();
        });
        begins.recv().unwrap();
        drop(errors);
        drop(stops);
    });
}
