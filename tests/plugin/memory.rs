//! Tests what happens when memory is full, when the driver rejects a field, and when the device is lost.

use std::time::{Duration, Instant};

use bevy::{camera::Viewport, prelude::*, render::render_asset::RenderAssets};
use bevy_plenoctree::{
    Activation, DeviceRecoveryPlugin, FieldFailed, FieldPalette, FieldReady, GpuField, PaletteExtraction,
    PaletteSampler, Palettes, PlenOctree, Posterize, Prop, PropError, PropQuality, PropState, SampleOrigin, UpAxis,
    ViewFailed, headless::HeadlessError,
};
use glam::DVec3;
use half::f16;
use plenoctree::{Basis, Cell, Frame};

use super::stage::{PATIENCE, Stage, hear, pixels::at};
#[cfg(target_os = "linux")]
use super::stage::{SKIPPED, skip, tell, wait_for};

const SIZE: u32 = 32;

/// Returns a field whose only leaves are the eight cells of this depth at the lower corner of (-1, -1, -1) to (1, 1,
/// 1), scaled so that they fill the cube from 0 to 1.
fn corner(depth: u32, color: [f32; 3]) -> PlenOctree {
    corner_of_density(1e4, depth, color)
}

fn corner_of_density(density: f32, depth: u32, color: [f32; 3]) -> PlenOctree {
    let mut nodes: Vec<_> = (1..depth)
        .map(|next| std::array::from_fn(|cell| if cell == 0 { Cell::node(next) } else { Cell::EMPTY }))
        .collect();
    nodes.push(std::array::from_fn(|cell| Cell::leaf(cell as u32)));
    let frame = Frame::spanning(DVec3::ZERO, DVec3::splat(f64::from(1u32 << (depth - 1))));
    let coefficients = color.map(f16::from_f32).repeat(8);
    PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, nodes, vec![density; 8], coefficients).unwrap()
}

/// Creates an app with two props side by side, seen along -z.
fn app(limits: wgpu::Limits, configure: impl FnOnce(&mut App), fields: [PlenOctree; 2]) -> Stage {
    let mut stage = Stage::limited(SIZE, limits, |app| {
        hear::<FieldReady>(app);
        hear::<FieldFailed>(app);
        hear::<ViewFailed>(app);
        hear::<AppExit>(app);
        configure(app);
    });
    stage.set(Transform::from_xyz(0.0, 0.5, 4.0));
    for (field, x) in fields.iter().zip([-1.1, 0.1]) {
        stage.spawn_prop(field, Transform::from_xyz(x, 0.0, 0.0));
    }
    stage
}

/// Returns the colors of the two props.
fn colors(stage: &mut Stage) -> [[u8; 3]; 2] {
    let frame = stage.capture();
    [SIZE / 3, 2 * SIZE / 3].map(|x| at(&frame, x, SIZE / 2))
}

fn state(stage: &Stage, prop: usize) -> &PropState {
    stage.get(stage.props[prop])
}

fn field(stage: &Stage, prop: usize) -> AssetId<PlenOctree> {
    stage.get::<Prop>(stage.props[prop]).0.id()
}

/// If the driver rejects the table of a field, as it does when out of memory, only that field is missing. The limit is
/// below that of any real device, so that nothing checks it before wgpu.
#[test]
fn a_field_that_the_driver_rejects_is_skipped() {
    let limits = wgpu::Limits { max_texture_array_layers: 32, ..default() };
    // Tables have two levels less than the tree.
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let mut stage = app(limits, |_| (), [corner(5, red), corner(8, blue)]);
    stage.headless.wait_until_ready(PATIENCE).unwrap_err();
    assert_eq!(colors(&mut stage), [[255, 0, 0], [0; 3]]);
    assert_eq!(state(&stage, 0), &PropState::Ready);
    let PropState::Failed(PropError::TooLarge(error)) = state(&stage, 1) else { panic!() };
    assert_eq!((error.what, error.limit), ("textures", None));
    assert!(stage.heard::<AppExit>().is_empty(), "the app quits");
    let failed = FieldFailed { field: field(&stage, 1), error: error.clone(), only_level: false };
    assert_eq!(stage.heard::<FieldFailed>(), [failed]);
}

/// A field that the app removes leaves the GPU although there are handles, and can come back.
#[test]
fn fields_that_are_removed_leave_the_gpu() {
    let fields = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].map(|color| corner(4, color));
    let mut stage = app(default(), |_| (), fields.clone());
    stage.wait();
    let id = field(&stage, 1);
    let is_on_gpu = |stage: &Stage| stage.render_world().resource::<RenderAssets<GpuField>>().get(id).is_some();
    assert!(is_on_gpu(&stage));
    stage.world().resource_mut::<Assets<PlenOctree>>().remove(id);
    stage.update(1);
    assert!(!is_on_gpu(&stage));
    assert_eq!(colors(&mut stage), [[255, 0, 0], [0; 3]]);
    let [_, blue] = fields;
    stage.world().resource_mut::<Assets<PlenOctree>>().insert(id, blue).unwrap();
    stage.update(2);
    stage.wait();
    assert_eq!(colors(&mut stage), [[255, 0, 0], [0, 0, 255]]);
}

/// Returns a field of SH25 that fills the cube from 0 to 1 with two million leaves of one color, 335 MB on the GPU.
#[cfg(target_os = "linux")]
fn large(color: [f32; 3]) -> PlenOctree {
    const DEPTH: u32 = 7;
    // In the order of depth, so that the children of a node follow each other.
    let first = |level: u32| ((1 << (3 * level)) - 1) / 7;
    let nodes = (0..DEPTH).flat_map(|level| (0..1 << (3 * level)).map(move |node| (level, node)));
    let nodes = nodes.map(|(level, node): (u32, u32)| {
        std::array::from_fn(|cell| match 8 * node + cell as u32 {
            leaf if level + 1 == DEPTH => Cell::leaf(leaf),
            child => Cell::node(first(level + 1) + child),
        })
    });
    let leaves = 1 << (3 * DEPTH);
    let mut leaf = [f16::ZERO; 75];
    // The constant function is 0.2821.
    (0..3).for_each(|channel| leaf[25 * channel] = f16::from_f32((color[channel] - 0.5) / 0.2821));
    let (frame, densities) = (Frame::spanning(DVec3::ZERO, DVec3::ONE), vec![1e4; leaves]);
    let coefficients = leaf.repeat(leaves);
    let activation = Activation::ShiftedRelu;
    PlenOctree::new(frame, Basis::Sh25, activation, UpAxis::Y, nodes.collect(), densities, coefficients).unwrap()
}

/// Sets how much more memory this process may have, on the CPU and in a driver that runs there.
#[cfg(target_os = "linux")]
fn limit_memory(more: Option<u64>) {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let size =
        status.lines().find_map(|line| line.strip_prefix("VmSize:")?.strip_suffix("kB")?.trim().parse::<u64>().ok());
    let maximum = getrlimit(Resource::As).maximum;
    let current = more.map_or(maximum, |more| Some(1024 * size.unwrap() + more));
    setrlimit(Resource::As, Rlimit { current, maximum }).unwrap();
}

/// Runs a test in a process of its own, whose memory can be limited. Returns whether it passed, or false in that
/// process.
#[cfg(target_os = "linux")]
fn passes_in_child(test: &str) -> bool {
    const CHILD: &str = "PLENOCTREE_TEST_FULL_MEMORY";
    if std::env::var_os(CHILD).is_some() {
        return false;
    }
    let mut child = std::process::Command::new(std::env::current_exe().unwrap());
    let output = child.args(["--exact", test, "--nocapture"]).env(CHILD, "1").output().unwrap();
    let [out, error] = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success() && out.contains("1 passed"), "{}: {out}\n{error}", output.status);
    error.lines().filter(|line| line.starts_with(SKIPPED)).for_each(tell);
    true
}

/// If the driver has no memory for a field, only its props are missing, and it is drawn once there is memory again.
#[cfg(target_os = "linux")]
#[test]
fn a_field_is_skipped_when_memory_is_full() {
    if passes_in_child("memory::a_field_is_skipped_when_memory_is_full") {
        return;
    }
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let mut stage = app(default(), |_| (), [corner(5, red), corner(4, blue)]);
    stage.wait();
    if !stage.is_on_cpu() {
        return skip("a GPU whose memory is that of this process");
    }
    let green = large([0.0, 1.0, 0.0]);
    limit_memory(Some(240 << 20));
    let (field, bad) = (stage.add(green), stage.props[1]);
    stage.insert(bad, Prop(field.clone()));
    stage.headless.wait_until_ready(PATIENCE).unwrap_err();
    for _ in 0..3 {
        // The earlier field is still drawn.
        assert_eq!(colors(&mut stage), [[255, 0, 0], [0, 0, 255]]);
    }
    assert_eq!(state(&stage, 0), &PropState::Ready);
    let PropState::Failed(PropError::TooLarge(error)) = state(&stage, 1) else { panic!() };
    assert!(error.what == "textures" && error.limit.is_none() && error.bytes > 300 << 20, "{error}");
    let failed = FieldFailed { field: field.id(), error: error.clone(), only_level: false };
    // Other attempts fail silently.
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(5) {
        stage.update(1);
        assert!(matches!(state(&stage, 1), PropState::Failed(PropError::TooLarge(_))), "{:?}", state(&stage, 1));
    }
    assert_eq!(stage.heard::<FieldFailed>(), [failed]);
    assert!(stage.heard::<AppExit>().is_empty(), "the app quits");

    limit_memory(None);
    wait_for("the field", || {
        stage.update(1);
        state(&stage, 1).is_ready()
    });
    assert_eq!(stage.heard::<FieldReady>().iter().filter(|ready| ready.field == field.id()).count(), 1);
    assert_eq!(colors(&mut stage), [[255, 0, 0], [0, 255, 0]]);
}

/// If the driver has no memory for the textures of a view, only its props are missing, and they are drawn once there is
/// memory again.
#[cfg(target_os = "linux")]
#[test]
fn a_view_draws_no_props_when_memory_is_full() {
    if passes_in_child("memory::a_view_draws_no_props_when_memory_is_full") {
        return;
    }
    const LARGE: UVec2 = UVec2::splat(2048);
    let mut stage = app(default(), |_| (), [corner(5, [1.0, 0.0, 0.0]), corner(4, [0.0, 0.0, 1.0])]);
    stage.headless.resize(LARGE);
    let palette = FieldPalette::from_colors([Color::WHITE]).unwrap();
    for index in [0, 1] {
        let (prop, field) = (stage.props[index], field(&stage, index));
        stage.world().resource_mut::<Palettes>().insert(field, palette.clone());
        stage.insert(prop, Posterize::default());
    }
    // The props fill the view.
    stage.set(Transform::from_xyz(0.0, 0.5, 1.5));
    let view = |stage: &mut Stage, size: UVec2| {
        stage.camera_mut().viewport = Some(Viewport { physical_size: size, ..default() });
    };
    // Prepares all but the textures of the large view.
    view(&mut stage, UVec2::splat(SIZE));
    stage.wait();
    stage.capture();
    if !stage.is_on_cpu() {
        return skip("a GPU whose memory is that of this process");
    }
    // Memory ends at the first texture, and at later ones.
    for (failures, megabytes) in [32, 120, 200].into_iter().enumerate() {
        limit_memory(Some(megabytes << 20));
        view(&mut stage, LARGE);
        stage.update(5);
        let frame = stage.headless.capture().map(|_| ());
        assert!(matches!(frame, Err(HeadlessError::View(_))), "{megabytes} MB: {frame:?}");
        let failed = stage.heard::<ViewFailed>();
        assert_eq!(failed.len(), failures + 1, "{megabytes} MB");
        assert_eq!(failed[failures].error.size, LARGE);
        assert!(stage.heard::<AppExit>().is_empty(), "the app quits");
        limit_memory(None);
        // A view of another size tries at once.
        view(&mut stage, UVec2::splat(SIZE));
        stage.update(1);
        assert_eq!(stage.capture().get_pixel(SIZE / 3, SIZE / 2).0, [255; 4]);
    }
    limit_memory(Some(160 << 20));
    view(&mut stage, LARGE);
    stage.update(1);
    stage.headless.capture().unwrap_err();
    limit_memory(None);
    std::thread::sleep(Duration::from_secs(2));
    stage.update(1);
    assert_eq!(stage.capture().get_pixel(LARGE.x / 3, LARGE.y / 2).0, [255; 4]);
}

/// A device that binds smaller buffers than a view needs draws no props there.
#[test]
fn a_view_draws_no_props_if_the_device_cannot_bind_its_buffers() {
    const LARGE: UVec2 = UVec2::splat(640);
    let limits = wgpu::Limits { max_storage_buffer_binding_size: 1 << 20, ..default() };
    let fields = [corner(2, [1.0; 3]), corner(2, [0.5; 3])];
    let mut stage = app(limits, |_| (), fields);
    let palette = FieldPalette::from_colors([Color::BLACK, Color::WHITE]).unwrap();
    for index in [0, 1] {
        let (prop, field) = (stage.props[index], field(&stage, index));
        stage.world().resource_mut::<Palettes>().insert(field, palette.clone());
        stage.insert(prop, Posterize::paper());
    }
    stage.set(Transform::from_xyz(0.0, 0.5, 1.5));
    stage.wait();
    assert_eq!(colors(&mut stage)[0], [255; 3]);
    stage.headless.resize(LARGE);
    stage.update(3);
    let frame = stage.headless.capture().map(|_| ());
    assert!(matches!(frame, Err(HeadlessError::View(_))), "{frame:?}");
    assert_eq!(stage.heard::<ViewFailed>().len(), 1);
    stage.headless.resize(UVec2::splat(SIZE));
    assert_eq!(colors(&mut stage)[0], [255; 3]);
    assert!(stage.heard::<AppExit>().is_empty(), "the app quits");
}

/// If a buffer for sampling on the GPU does not fit, the CPU samples the field, and the app goes on.
#[test]
fn the_cpu_samples_fields_whose_histograms_the_driver_rejects() {
    // 64 bins per channel, of 8 bytes each, take more.
    let limits = wgpu::Limits { max_buffer_size: 1 << 21, max_storage_buffer_binding_size: 1 << 21, ..default() };
    let configure = |app: &mut App| {
        let mut extraction = PaletteExtraction::default();
        extraction.sampler = PaletteSampler::Gpu;
        extraction.settings.sampling.fine_bins = 64;
        app.insert_resource(extraction);
    };
    // The middle of the leaves is visible.
    let fields = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].map(|color| corner_of_density(1.0, 4, color));
    let mut stage = app(limits, configure, fields);
    for prop in stage.props.clone() {
        stage.insert(prop, Posterize::default());
    }
    stage.wait();
    for index in [0, 1] {
        let extraction = stage.resource::<PaletteExtraction>();
        assert_eq!(extraction.sampled(field(&stage, index)).unwrap().origin, SampleOrigin::Cpu);
    }
    assert!(stage.heard::<AppExit>().is_empty(), "the app quits");
}

/// A level that the driver rejects is replaced by the field itself, or by the previous level.
#[test]
fn a_level_that_the_driver_rejects_is_skipped() {
    let limits = wgpu::Limits { max_texture_array_layers: 32, ..default() };
    // A tree of depth 9 has a table of 32 cells per side, one of depth 8 has 64: tables skip levels in pairs.
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let mut stage = app(limits, |_| (), [corner(9, red), corner(9, blue)]);
    stage.wait();
    // Cells are about 5 pixels wide.
    stage.set(PropQuality { cell_size: 15.0, ..default() });
    for _ in 0..20 {
        assert_eq!(colors(&mut stage), [[255, 0, 0], [0, 0, 255]]);
    }
    let failed = stage.heard::<FieldFailed>().iter();
    let mut failed: Vec<_> = failed.map(|failed| (failed.field, failed.only_level)).collect();
    failed.sort_by_key(|(field, _)| *field);
    let mut expected = [0, 1].map(|index| (field(&stage, index), true));
    expected.sort_by_key(|(field, _)| *field);
    assert_eq!(failed, expected);
    assert!(stage.heard::<AppExit>().is_empty());
    assert!([0, 1].iter().all(|index| state(&stage, *index) == &PropState::Ready));
}

/// One line makes an app survive the loss of its device.
#[test]
fn an_app_survives_the_loss_of_its_device() {
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let limits = wgpu::Limits { max_texture_dimension_2d: 4096, ..default() };
    let recover = |app: &mut App| _ = app.add_plugins(DeviceRecoveryPlugin);
    let mut stage = app(limits, recover, [corner(4, red), corner(5, blue)]);
    stage.wait();
    let before = colors(&mut stage);
    assert_eq!(before, [[255, 0, 0], [0, 0, 255]]);
    for uploads in [4, 6] {
        stage.device().wgpu_device().destroy();
        stage.update(50);
        assert_eq!(stage.heard::<FieldReady>().len(), uploads, "fields reached the new device");
        assert_eq!(stage.device().limits().max_texture_dimension_2d, 4096, "the app's own settings");
        stage.wait();
        assert_eq!(colors(&mut stage), before);
    }
    assert!(stage.heard::<AppExit>().is_empty());
}

/// Fields that arrive while there is no device reach the next one.
#[test]
fn fields_that_arrive_without_a_device_are_drawn() {
    let recover = |app: &mut App| _ = app.add_plugins(DeviceRecoveryPlugin);
    let mut stage =
        app(wgpu::Limits::default(), recover, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].map(|color| corner(4, color)));
    stage.wait();
    stage.device().wgpu_device().destroy();
    for depth in 2..8 {
        stage.spawn_prop(&corner(depth, [0.0, 1.0, 0.0]), Transform::from_xyz(0.0, 5.0, 0.0));
        stage.update(1);
    }
    stage.update(50);
    let states: Vec<_> = (0..stage.props.len()).map(|prop| state(&stage, prop)).collect();
    assert!(states.iter().all(|state| state.is_ready()), "{states:?}");
}
