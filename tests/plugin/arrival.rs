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
        gpu_readback::{Readback, ReadbackComplete},
        render_asset::RenderAssets,
    },
};
use bevy_plenoctree::{
    Activation, FieldFailed, FieldReady, GpuField, PlenOctree, Prop, PropError, PropProgress, PropState, UpAxis,
    UploadBudget, props_ready,
};
use glam::DVec3;
use half::f16;
use plenoctree::{Basis, Frame};

use super::stage::{Stage, fields::Shell, hear, wait_for};

const SIZE: u32 = 64;
/// The size of a slice.
const SLICE: f32 = (1 << 20) as f32;

/// A hollow ball of radius 1 around `center`, of SH9 and depth 8.
fn ball(radius: f64, center: DVec3, color: [f64; 3]) -> PlenOctree {
    let Shell { nodes, leaves } = Shell::new(8, radius, 1.5);
    let mut leaf = [f16::ZERO; 27];
    for (channel, color) in color.into_iter().enumerate() {
        leaf[9 * channel] = f16::from_f64((color - 0.5) / 0.28);
    }
    let half = DVec3::splat(128.0 / radius);
    let (frame, leaves) = (Frame::spanning(center - half, center + half), leaves.len());
    let coefficients = leaf.repeat(leaves);
    PlenOctree::new(frame, Basis::Sh9, Activation::ShiftedRelu, UpAxis::Y, nodes, vec![1e4; leaves], coefficients)
        .unwrap()
}

/// An app whose frames are all read back, without waiting for anything.
struct Arrival {
    stage: Stage,
    frames: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Arrival {
    fn new(limits: wgpu::Limits) -> Self {
        let mut stage = Stage::limited(SIZE, limits, |app| {
            hear::<FieldReady>(app);
            hear::<FieldFailed>(app);
        });
        // One slice per frame.
        stage.world().insert_resource(UploadBudget(Some(Duration::ZERO)));
        stage.set(Transform::from_xyz(0.0, 0.0, 4.0));
        let RenderTarget::Image(image) = stage.headless.target() else { unreachable!() };
        let (readback, frames) = (Readback::texture(image.handle), Arc::<Mutex<Vec<Vec<u8>>>>::default());
        let store = frames.clone();
        stage
            .world()
            .spawn(readback)
            .observe(move |frame: On<ReadbackComplete>| store.lock().unwrap().push(frame.data.clone()));
        // Compiles the pipelines of a view without props, however long that takes.
        stage.capture();
        Self { stage, frames }
    }

    /// Returns the frames since the last call, without repetitions.
    fn seen(&mut self) -> Vec<Vec<u8>> {
        // Frames are read back a little later.
        for _ in 0..8 {
            self.stage.update(1);
            self.stage.device().poll(wgpu::PollType::wait_indefinitely()).unwrap();
        }
        let mut frames = std::mem::take(&mut *self.frames.lock().unwrap());
        frames.dedup();
        frames
    }

    /// Updates until the prop is no longer waiting, and returns the fraction that had arrived after each frame.
    fn arrive(&mut self, prop: Entity) -> Vec<f32> {
        let mut shares = Vec::new();
        wait_for("the field", || {
            self.stage.update(1);
            let progress = self.stage.get::<PropProgress>(prop);
            assert_eq!(progress.read, 1.0);
            shares.push(progress.uploaded);
            shares.len() > 3 && !self.state(prop).is_waiting()
        });
        shares
    }

    fn state(&self, prop: Entity) -> &PropState {
        self.stage.get(prop)
    }

    fn on_gpu(&self, field: &Handle<PlenOctree>) -> Option<u64> {
        let fields = self.stage.render_world().resource::<RenderAssets<GpuField>>();
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
    let mut arrival = Arrival::new(wgpu::Limits { max_texture_dimension_2d: 512, ..default() });
    let empty = arrival.seen().pop().unwrap();
    let world = arrival.stage.world();
    let red = world.resource_mut::<Assets<PlenOctree>>().add(ball(58.0, DVec3::ZERO, [0.8, 0.2, 0.1]));
    let prop = world.spawn(Prop(red.clone())).id();
    let shares = arrival.arrive(prop);
    let bytes = arrival.on_gpu(&red).unwrap();
    assert!(bytes > 7 << 20, "{bytes}");
    assert_slices(&shares, bytes);
    let seen = arrival.seen();
    let whole = arrival.stage.capture().into_raw();
    assert!(whole != empty);
    assert!(seen == [empty.clone(), whole.clone()], "{} different frames", seen.len());
    assert_eq!(arrival.stage.heard::<FieldReady>().len(), 1);

    // Reloaded, elsewhere and in another color: the earlier version is drawn in its place until the new one has
    // arrived.
    let moved = ball(58.0, DVec3::new(0.9, 0.4, 0.0), [0.1, 0.3, 0.9]);
    *arrival.stage.world().resource_mut::<Assets<PlenOctree>>().get_mut(&red).unwrap() = moved;
    arrival.stage.update(3);
    assert_eq!(arrival.on_gpu(&red), Some(bytes), "the earlier version");
    assert_eq!(arrival.state(prop), &PropState::Uploading);
    assert_slices(&arrival.arrive(prop), bytes);
    let seen = arrival.seen();
    let reloaded = arrival.stage.capture().into_raw();
    assert!(reloaded != whole && reloaded != empty);
    assert!(seen == [whole, reloaded.clone()], "{} different frames", seen.len());
    assert_eq!(arrival.on_gpu(&red), Some(bytes), "the earlier version is still there");

    // Reloaded with a field that the device cannot hold: the earlier version stays.
    let large = ball(110.0, DVec3::ZERO, [0.2, 0.9, 0.2]);
    *arrival.stage.world().resource_mut::<Assets<PlenOctree>>().get_mut(&red).unwrap() = large;
    arrival.stage.update(1);
    arrival.arrive(prop);
    assert!(matches!(arrival.state(prop), PropState::Failed(PropError::TooLarge(_))), "{:?}", arrival.state(prop));
    assert!(arrival.seen() == [reloaded.clone()]);
    assert_eq!(arrival.stage.heard::<FieldReady>().len(), 2);
    let failed = arrival.stage.heard::<FieldFailed>().iter();
    let failed: Vec<_> = failed.map(|failed| (failed.field, failed.only_level)).collect();
    assert_eq!(failed, [(red.id(), false)]);

    // Another field: the prop keeps the one that it shows.
    let world = arrival.stage.world();
    let green = world.resource_mut::<Assets<PlenOctree>>().add(ball(58.0, DVec3::ZERO, [0.1, 0.8, 0.3]));
    world.get_mut::<Prop>(prop).unwrap().0 = green.clone();
    arrival.stage.update(1);
    assert!(!arrival.stage.world().run_system_cached(props_ready).unwrap());
    arrival.arrive(prop);
    let seen = arrival.seen();
    let swapped = arrival.stage.capture().into_raw();
    assert!(swapped != reloaded && seen == [reloaded, swapped.clone()], "{} different frames", seen.len());

    // Without its prop, nothing remains.
    let (red_id, green_id) = (red.id(), green.id());
    drop((red, green));
    arrival.stage.world().despawn(prop);
    let seen = arrival.seen();
    assert!(seen.iter().all(|frame| [&swapped, &empty].contains(&frame)) && seen.last() == Some(&empty));
    let fields = arrival.stage.render_world().resource::<RenderAssets<GpuField>>();
    assert!(fields.get(red_id).is_none() && fields.get(green_id).is_none());
}
