//! Tests that fields arrive in slices, that they are not drawn before all of their data has arrived, and that earlier
//! fields stay until then.

use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

use bevy::{
    camera::RenderTarget,
    prelude::*,
    render::{
        RenderApp,
        gpu_readback::{Readback, ReadbackComplete},
        render_asset::RenderAssets,
    },
};
use bevy_plenoctree::{
    Activation, FieldFailed, FieldReady, GpuField, PlenOctree, PlenOctreePlugin, Prop, PropError, PropProgress,
    PropState, UpAxis, UploadBudget,
    headless::{Headless, exact_camera},
    props_ready,
};
use glam::{DVec3, UVec3};
use half::f16;
use plenoctree::{Basis, Cell, Frame};

const SIZE: u32 = 64;
/// The size of a slice.
const SLICE: f32 = (1 << 20) as f32;

/// Adds the nodes under a cell at `corner` that a sphere of this radius meets, and returns the index of the first one.
fn grow(nodes: &mut Vec<[Cell; 8]>, leaves: &mut u32, radius: f64, middle: f64, corner: UVec3, size: u32) -> u32 {
    let (node, half) = (nodes.len(), size / 2);
    nodes.push([Cell::EMPTY; 8]);
    for index in 0..8 {
        let corner = corner + half * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
        let center = corner.as_dvec3() + 0.5 * f64::from(half) - middle;
        let slack = if half == 1 { 0.0 } else { 0.87 * f64::from(half) };
        if (center.length() - radius).abs() <= 0.75 + slack {
            nodes[node][index as usize] = if half == 1 {
                *leaves += 1;
                Cell::leaf(*leaves - 1)
            } else {
                Cell::node(grow(nodes, leaves, radius, middle, corner, half))
            };
        }
    }
    node as u32
}

/// A hollow ball of radius 1 around `center`, of SH9 and depth 8.
fn ball(radius: f64, center: DVec3, color: [f64; 3]) -> PlenOctree {
    let (mut nodes, mut leaves) = (Vec::new(), 0);
    grow(&mut nodes, &mut leaves, radius, 128.0, UVec3::ZERO, 256);
    let mut leaf = [f16::ZERO; 27];
    for (channel, color) in color.into_iter().enumerate() {
        leaf[9 * channel] = f16::from_f64((color - 0.5) / 0.28);
    }
    let half = DVec3::splat(128.0 / radius);
    let (frame, leaves) = (Frame::spanning(center - half, center + half), leaves as usize);
    let coefficients = leaf.repeat(leaves);
    PlenOctree::new(frame, Basis::Sh9, Activation::ShiftedRelu, UpAxis::Y, nodes, vec![1e4; leaves], coefficients)
        .unwrap()
}

#[derive(Resource, Default)]
struct Heard {
    ready: usize,
    failed: Vec<FieldFailed>,
}

fn hear(mut heard: ResMut<Heard>, mut ready: MessageReader<FieldReady>, mut failed: MessageReader<FieldFailed>) {
    heard.ready += ready.read().count();
    heard.failed.extend(failed.read().cloned());
}

/// An app whose frames are all read back, without waiting for anything.
struct Stage {
    headless: Headless,
    frames: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Stage {
    fn new(limits: wgpu::Limits) -> Self {
        let mut headless = Headless::with_limits(UVec2::splat(SIZE), limits, |app| {
            app.add_plugins(PlenOctreePlugin).init_resource::<Heard>().add_systems(Last, hear);
        })
        .unwrap();
        // One slice per frame.
        headless.app.insert_resource(UploadBudget(Some(Duration::ZERO)));
        let target = headless.target();
        let RenderTarget::Image(image) = &target else { unreachable!() };
        let (readback, frames) = (Readback::texture(image.handle.clone()), Arc::<Mutex<Vec<Vec<u8>>>>::default());
        let store = frames.clone();
        let world = headless.app.world_mut();
        world.spawn((exact_camera(Color::BLACK), target, Transform::from_xyz(0.0, 0.0, 4.0)));
        world
            .spawn(readback)
            .observe(move |frame: On<ReadbackComplete>| store.lock().unwrap().push(frame.data.clone()));
        // Compiles the pipelines of a view without props.
        (0..4).for_each(|_| headless.update());
        Self { headless, frames }
    }

    fn update(&mut self) {
        self.headless.update();
    }

    /// Returns the frames since the last call, without repetitions.
    fn seen(&mut self) -> Vec<Vec<u8>> {
        // Frames are read back a little later.
        (0..8).for_each(|_| self.headless.update());
        let mut frames = std::mem::take(&mut *self.frames.lock().unwrap());
        frames.dedup();
        frames
    }

    /// Updates until the prop is no longer waiting, and returns the fraction that had arrived after each frame.
    fn arrive(&mut self, prop: Entity) -> Vec<f32> {
        let mut shares = Vec::new();
        for _ in 0..2000 {
            self.update();
            let world = self.headless.app.world();
            let (state, progress) = (world.get::<PropState>(prop).unwrap(), world.get::<PropProgress>(prop).unwrap());
            assert_eq!(progress.read, 1.0);
            shares.push(progress.uploaded);
            if shares.len() > 3 && !state.is_waiting() {
                return shares;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("the field does not arrive: {shares:?}");
    }

    fn state(&self, prop: Entity) -> &PropState {
        self.headless.app.world().get(prop).unwrap()
    }

    fn on_gpu(&self, field: &Handle<PlenOctree>) -> Option<u64> {
        let fields = self.headless.app.sub_app(RenderApp).world().resource::<RenderAssets<GpuField>>();
        fields.get(field).map(GpuField::bytes)
    }
}

/// Asserts that a field of this many bytes arrived in slices, with no more than one of them per frame.
#[track_caller]
fn assert_slices(shares: &[f32], bytes: u64) {
    let step = 1.01 * SLICE / bytes as f32;
    let rises: Vec<_> = shares.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(rises.iter().all(|rise| *rise <= step), "{step}: {shares:?}");
    assert!(rises.iter().filter(|rise| **rise > 0.0).count() as f32 >= 0.9 / step, "{step}: {shares:?}");
}

#[test]
fn fields_arrive_in_slices_and_are_drawn_when_they_are_whole() {
    // Textures hold at most four mebibytes.
    let mut stage = Stage::new(wgpu::Limits { max_texture_dimension_2d: 512, ..default() });
    let empty = stage.seen().pop().unwrap();
    let world = stage.headless.app.world_mut();
    let red = world.resource_mut::<Assets<PlenOctree>>().add(ball(58.0, DVec3::ZERO, [0.8, 0.2, 0.1]));
    let prop = world.spawn(Prop(red.clone())).id();
    let shares = stage.arrive(prop);
    let bytes = stage.on_gpu(&red).unwrap();
    assert!(bytes > 7 << 20, "{bytes}");
    assert_slices(&shares, bytes);
    let seen = stage.seen();
    let whole = stage.headless.capture().unwrap().into_raw();
    assert!(whole != empty);
    assert!(seen == [empty.clone(), whole.clone()], "{} different frames", seen.len());
    assert_eq!(stage.headless.app.world().resource::<Heard>().ready, 1);

    // Reloaded, elsewhere and in another color: the earlier version is drawn in its place until the new one has
    // arrived.
    let moved = ball(58.0, DVec3::new(0.9, 0.4, 0.0), [0.1, 0.3, 0.9]);
    *stage.headless.app.world_mut().resource_mut::<Assets<PlenOctree>>().get_mut(&red).unwrap() = moved;
    (0..3).for_each(|_| stage.update());
    assert_eq!(stage.on_gpu(&red), Some(bytes), "the earlier version");
    assert_eq!(stage.state(prop), &PropState::Uploading);
    assert_slices(&stage.arrive(prop), bytes);
    let seen = stage.seen();
    let reloaded = stage.headless.capture().unwrap().into_raw();
    assert!(reloaded != whole && reloaded != empty);
    assert!(seen == [whole, reloaded.clone()], "{} different frames", seen.len());
    assert_eq!(stage.on_gpu(&red), Some(bytes), "the earlier version is still there");

    // Reloaded with a field that the device cannot hold: the earlier version stays.
    let large = ball(110.0, DVec3::ZERO, [0.2, 0.9, 0.2]);
    *stage.headless.app.world_mut().resource_mut::<Assets<PlenOctree>>().get_mut(&red).unwrap() = large;
    stage.update();
    stage.arrive(prop);
    assert!(matches!(stage.state(prop), PropState::Failed(PropError::TooLarge(_))), "{:?}", stage.state(prop));
    assert!(stage.seen() == [reloaded.clone()]);
    let heard = stage.headless.app.world().resource::<Heard>();
    assert_eq!(heard.ready, 2);
    let failed: Vec<_> = heard.failed.iter().map(|failed| (failed.field, failed.only_level)).collect();
    assert_eq!(failed, [(red.id(), false)]);

    // Another field: the prop keeps the one that it shows.
    let world = stage.headless.app.world_mut();
    let green = world.resource_mut::<Assets<PlenOctree>>().add(ball(58.0, DVec3::ZERO, [0.1, 0.8, 0.3]));
    world.get_mut::<Prop>(prop).unwrap().0 = green.clone();
    stage.update();
    assert!(!stage.headless.app.world_mut().run_system_cached(props_ready).unwrap());
    stage.arrive(prop);
    let seen = stage.seen();
    let swapped = stage.headless.capture().unwrap().into_raw();
    assert!(swapped != reloaded && seen == [reloaded, swapped.clone()], "{} different frames", seen.len());

    // Without its prop, nothing remains.
    let (red_id, green_id) = (red.id(), green.id());
    drop((red, green));
    stage.headless.app.world_mut().despawn(prop);
    let seen = stage.seen();
    assert!(seen.iter().all(|frame| [&swapped, &empty].contains(&frame)) && seen.last() == Some(&empty));
    let fields = stage.headless.app.sub_app(RenderApp).world().resource::<RenderAssets<GpuField>>();
    assert!(fields.get(red_id).is_none() && fields.get(green_id).is_none());
}
