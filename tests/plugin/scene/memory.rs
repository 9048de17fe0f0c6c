//! Tests that views give back the GPU memory of passes when there is nothing left to draw.

use std::time::Duration;

use bevy::{camera::visibility::RenderLayers, prelude::*};
use bevy_plenoctree::{FieldPalette, LabelStages, Posterize, PosterizeView, Prop, PropQuality};

use crate::stage::{
    Stage,
    sides::{RED, SOLID, color, cube},
    skip,
};

const SIZE: u32 = 512;
/// The size of one texture with a byte per pixel.
const BYTE: u64 = (SIZE * SIZE) as u64;

/// Runs frames for half a second, and returns the bytes that are allocated on the GPU, if the backend reports them.
fn allocated(stage: &mut Stage) -> Option<u64> {
    for _ in 0..10 {
        stage.update(1);
        std::thread::sleep(Duration::from_millis(50));
    }
    stage.device().poll(wgpu::PollType::wait_indefinitely()).unwrap();
    Some(stage.device().wgpu_device().generate_allocator_report()?.total_allocated_bytes)
}

/// A prop that fills the view.
fn filled() -> Stage {
    let mut stage = Stage::new(SIZE);
    stage.set(Transform::from_xyz(0.0, 0.0, 0.8));
    stage.spawn_prop(&cube(SOLID, RED), ());
    stage.paint(FieldPalette::from_colors([color(RED)]).unwrap());
    stage.wait();
    stage
}

#[test]
fn memory_goes_with_the_last_prop_in_view() {
    let mut stage = filled();
    // Keeps the field itself on the GPU.
    stage.dress((Posterize::default(), Visibility::Hidden));
    stage.wait();
    let Some(least) = allocated(&mut stage) else { return skip("reports of the GPU's memory") };

    type Change = fn(&mut Stage);
    let mut check = |what, show: Change, hide: Change, bytes: u64| {
        show(&mut stage);
        let drawn = allocated(&mut stage).unwrap();
        assert!(drawn >= least + bytes * BYTE, "{what}: only {} bytes more", drawn - least);
        hide(&mut stage);
        let left = allocated(&mut stage).unwrap();
        assert!(left < least + BYTE, "{what}: {} of {} bytes are left", left - least, drawn - least);
    };
    let show: Change = |stage| stage.dress(Visibility::Visible);
    let hide: Change = |stage| stage.dress(Visibility::Hidden);
    // Color, owner and depth, and two textures of the filter.
    check("hidden", show, hide, 48);
    check("on another layer", show, |stage| stage.dress((RenderLayers::layer(1), Visibility::Hidden)), 48);
    check(
        "out of view",
        |stage| stage.dress((RenderLayers::layer(0), Visibility::Visible)),
        |stage| stage.dress(Transform::from_xyz(100.0, 0.0, 0.0)),
        48,
    );
    check(
        "the camera is not active",
        |stage| stage.dress(Transform::default()),
        |stage| stage.camera_mut().is_active = false,
        48,
    );
    check(
        "with stages",
        |stage| {
            stage.camera_mut().is_active = true;
            let idle = stage.idle_stage();
            stage.set(idle);
        },
        |stage| {
            stage.unset::<LabelStages>();
            stage.dress(Visibility::Hidden);
        },
        48 + 24,
    );
    let view: Change = |stage| stage.set(PosterizeView(stage.field()));
    check("a posterized view", view, |stage| stage.unset::<PosterizeView>(), 48);
    check(
        "props that overlap, with fewer rays",
        |stage| {
            let child = (Prop(stage.field()), Transform::from_xyz(0.1, 0.0, 0.5), ChildOf(stage.prop()));
            stage.spawn(child);
            stage.dress(Visibility::Visible);
            stage.set(PropQuality { ray_tolerance: 0.1, ..PropQuality::EXACT });
        },
        // The child is hidden as well.
        hide,
        48 + 26 + 20,
    );
    check("despawned", show, |stage| stage.clear(), 48 + 18);
}

/// What one view of a prop costs is given back when another camera still sees it.
#[test]
fn overlaps_and_batches_are_paid_for_while_they_last() {
    let mut stage = filled();
    let other = stage.spawn((Prop(stage.field()), Transform::from_xyz(2.0, 0.0, -2.0)));
    stage.wait();
    let Some(least) = allocated(&mut stage) else { return skip("reports of the GPU's memory") };
    let mut check = |what, expected: f64, x: f32, quality: PropQuality| {
        stage.world().get_mut::<Transform>(other).unwrap().translation.x = x;
        stage.set(quality);
        let bytes = allocated(&mut stage).unwrap().saturating_sub(least) as f64 / BYTE as f64;
        assert!((bytes - expected).abs() < 0.4, "{what}: {bytes} more bytes per pixel, expected {expected}");
    };
    let exact = PropQuality::EXACT;
    // Props and their depths, for two rounds.
    check("overlapping", 16.0, 0.25, exact);
    check("side by side", 0.0, 2.0, exact);
    // Owners, a layer and a quarter, and what is known of gaps.
    check("fewer rays", 24.3, 2.0, PropQuality { ray_tolerance: 0.1, ..exact });
    check("all rays again", 0.0, 2.0, exact);
}
