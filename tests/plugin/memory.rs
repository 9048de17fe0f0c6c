//! Tests what happens when memory is full, when the driver rejects a field, and when the device is lost.

use std::time::Duration;

use bevy::{
    camera::Viewport,
    prelude::*,
    render::{RenderApp, renderer::RenderDevice},
};
use bevy_plenoctree::{
    Activation, DeviceRecoveryPlugin, FieldFailed, FieldPalette, FieldReady, PaletteExtraction, PaletteSampler,
    Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropError, PropQuality, PropState, SampleOrigin, UpAxis,
    ViewFailed,
    headless::{Headless, HeadlessError, exact_camera},
};
use glam::DVec3;
use half::f16;
use plenoctree::{Basis, Cell, Frame};

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

#[derive(Resource, Default)]
struct Heard {
    ready: usize,
    failed: Vec<FieldFailed>,
    failed_views: Vec<ViewFailed>,
    exits: usize,
}

fn hear(
    mut heard: ResMut<Heard>,
    mut ready: MessageReader<FieldReady>,
    mut failed: MessageReader<FieldFailed>,
    mut failed_views: MessageReader<ViewFailed>,
    mut exits: MessageReader<AppExit>,
) {
    heard.ready += ready.read().count();
    heard.failed.extend(failed.read().cloned());
    heard.failed_views.extend(failed_views.read().cloned());
    heard.exits += exits.read().count();
}

/// Creates an app with two props side by side, seen along -z.
fn app(limits: wgpu::Limits, configure: impl FnOnce(&mut App), fields: [PlenOctree; 2]) -> (Headless, [Entity; 2]) {
    let mut headless = Headless::with_limits(UVec2::splat(SIZE), limits, |app| {
        app.add_plugins(PlenOctreePlugin).init_resource::<Heard>().add_systems(Last, hear);
        configure(app);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    world.spawn((exact_camera(Color::BLACK), target, Transform::from_xyz(0.0, 0.5, 4.0)));
    let mut fields = fields.into_iter();
    let props = [-1.1, 0.1].map(|x| {
        let field = world.resource_mut::<Assets<PlenOctree>>().add(fields.next().unwrap());
        world.spawn((Prop(field), Transform::from_xyz(x, 0.0, 0.0))).id()
    });
    (headless, props)
}

/// Returns the colors of the two props.
fn colors(headless: &mut Headless) -> [[u8; 3]; 2] {
    let frame = headless.capture().unwrap();
    [SIZE / 3, 2 * SIZE / 3].map(|x| {
        let [r, g, b, _] = frame.get_pixel(x, SIZE / 2).0;
        [r, g, b]
    })
}

/// If the driver rejects the table of a field, as it does when out of memory, only that field is missing. The limit is
/// below that of any real device, so that nothing checks it before wgpu.
#[test]
fn a_field_that_the_driver_rejects_is_skipped() {
    let limits = wgpu::Limits { max_texture_array_layers: 32, ..default() };
    // Tables have two levels less than the tree.
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let (mut headless, [good, bad]) = app(limits, |_| (), [corner(5, red), corner(8, blue)]);
    headless.wait_until_ready(Duration::from_secs(60)).unwrap_err();
    assert_eq!(colors(&mut headless), [[255, 0, 0], [0; 3]]);
    let world = headless.app.world();
    assert_eq!(world.get::<PropState>(good), Some(&PropState::Ready));
    let Some(PropState::Failed(PropError::TooLarge(error))) = world.get::<PropState>(bad) else { panic!() };
    assert_eq!((error.what, error.limit), ("textures", None));
    let heard = world.resource::<Heard>();
    assert_eq!(heard.exits, 0, "the app quits");
    let field = world.get::<Prop>(bad).unwrap().0.id();
    assert_eq!(heard.failed, [FieldFailed { field, error: error.clone(), only_level: false }]);
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
    true
}

/// Returns whether the memory of the GPU is that of this process.
#[cfg(target_os = "linux")]
fn has_software_driver(headless: &Headless) -> bool {
    let render = headless.app.sub_app(RenderApp).world();
    render.resource::<bevy::render::renderer::RenderAdapterInfo>().device_type == wgpu::DeviceType::Cpu
}

/// If the driver has no memory for a field, only its props are missing, and it is drawn once there is memory again.
#[cfg(target_os = "linux")]
#[test]
fn a_field_is_skipped_when_memory_is_full() {
    if passes_in_child("memory::a_field_is_skipped_when_memory_is_full") {
        return;
    }
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let (mut headless, [good, bad]) = app(default(), |_| (), [corner(5, red), corner(4, blue)]);
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    if !has_software_driver(&headless) {
        return;
    }
    let green = large([0.0, 1.0, 0.0]);
    limit_memory(Some(240 << 20));
    let field = headless.app.world_mut().resource_mut::<Assets<PlenOctree>>().add(green.clone());
    headless.app.world_mut().get_mut::<Prop>(bad).unwrap().0 = field.clone();
    headless.wait_until_ready(Duration::from_secs(120)).unwrap_err();
    for _ in 0..3 {
        // The earlier field is still drawn.
        assert_eq!(colors(&mut headless), [[255, 0, 0], [0, 0, 255]]);
    }
    let world = headless.app.world();
    assert_eq!(world.get::<PropState>(good), Some(&PropState::Ready));
    let Some(PropState::Failed(PropError::TooLarge(error))) = world.get::<PropState>(bad) else { panic!() };
    assert!(error.what == "textures" && error.limit.is_none() && error.bytes > 300 << 20, "{error}");
    let heard = world.resource::<Heard>();
    assert_eq!(heard.failed, [FieldFailed { field: field.id(), error: error.clone(), only_level: false }]);
    assert_eq!(heard.exits, 0, "the app quits");

    limit_memory(None);
    *headless.app.world_mut().resource_mut::<Assets<PlenOctree>>().get_mut(&field).unwrap() = green;
    // Changes are announced at the end of a frame.
    (0..2).for_each(|_| headless.update());
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    assert_eq!(colors(&mut headless), [[255, 0, 0], [0, 255, 0]]);
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
    let (mut headless, _) = app(default(), |_| (), [corner(5, [1.0, 0.0, 0.0]), corner(4, [0.0, 0.0, 1.0])]);
    headless.resize(LARGE);
    let world = headless.app.world_mut();
    let palette = FieldPalette::from_colors([Color::WHITE]).unwrap();
    let props: Vec<_> =
        world.query::<(Entity, &Prop)>().iter(world).map(|(prop, field)| (prop, field.0.clone())).collect();
    for (prop, field) in props {
        world.resource_mut::<Palettes>().insert(&field, palette.clone());
        world.entity_mut(prop).insert(Posterize::default());
    }
    // The props fill the view.
    let mut cameras = world.query_filtered::<&mut Transform, With<Camera>>();
    cameras.single_mut(world).unwrap().translation.z = 1.5;
    let view = |headless: &mut Headless, size: UVec2| {
        let world = headless.app.world_mut();
        let mut camera = world.query::<&mut Camera>().single_mut(world).unwrap();
        camera.viewport = Some(Viewport { physical_size: size, ..default() });
    };
    // Prepares all but the textures of the large view.
    view(&mut headless, UVec2::splat(SIZE));
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    headless.capture().unwrap();
    if !has_software_driver(&headless) {
        return;
    }
    // Memory ends at the first texture, and at later ones.
    for (failures, megabytes) in [32, 120, 200].into_iter().enumerate() {
        limit_memory(Some(megabytes << 20));
        view(&mut headless, LARGE);
        for _ in 0..5 {
            headless.update();
        }
        let frame = headless.capture().map(|_| ());
        assert!(matches!(frame, Err(HeadlessError::View(_))), "{megabytes} MB: {frame:?}");
        let heard = headless.app.world().resource::<Heard>();
        assert_eq!(heard.failed_views.len(), failures + 1, "{megabytes} MB");
        assert_eq!(heard.failed_views[failures].error.size, LARGE);
        assert_eq!(heard.exits, 0, "the app quits");
        limit_memory(None);
        // A view of another size tries at once.
        view(&mut headless, UVec2::splat(SIZE));
        headless.update();
        assert_eq!(headless.capture().unwrap().get_pixel(SIZE / 3, SIZE / 2).0, [255; 4]);
    }
    limit_memory(Some(160 << 20));
    view(&mut headless, LARGE);
    headless.update();
    headless.capture().unwrap_err();
    limit_memory(None);
    std::thread::sleep(Duration::from_secs(2));
    headless.update();
    assert_eq!(headless.capture().unwrap().get_pixel(LARGE.x / 3, LARGE.y / 2).0, [255; 4]);
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
    let (mut headless, props) = app(limits, configure, fields);
    for prop in props {
        headless.app.world_mut().entity_mut(prop).insert(Posterize::default());
    }
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    let world = headless.app.world();
    for prop in props {
        let field = &world.get::<Prop>(prop).unwrap().0;
        assert_eq!(world.resource::<PaletteExtraction>().sampled(field).unwrap().origin, SampleOrigin::Cpu);
    }
    assert_eq!(world.resource::<Heard>().exits, 0, "the app quits");
}

/// A level that the driver rejects is replaced by the field itself, or by the previous level.
#[test]
fn a_level_that_the_driver_rejects_is_skipped() {
    let limits = wgpu::Limits { max_texture_array_layers: 32, ..default() };
    // A tree of depth 9 has a table of 32 cells per side, one of depth 8 has 64: tables skip levels in pairs.
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let (mut headless, props) = app(limits, |_| (), [corner(9, red), corner(9, blue)]);
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    let world = headless.app.world_mut();
    let camera = world.query_filtered::<Entity, With<Camera3d>>().single(world).unwrap();
    // Cells are about 5 pixels wide.
    world.entity_mut(camera).insert(PropQuality { cell_size: 15.0, ..default() });
    for _ in 0..20 {
        assert_eq!(colors(&mut headless), [[255, 0, 0], [0, 0, 255]]);
    }
    let world = headless.app.world();
    let mut failed: Vec<_> = world.resource::<Heard>().failed.iter().map(|f| (f.field, f.only_level)).collect();
    failed.sort_by_key(|(field, _)| *field);
    let mut expected = props.map(|prop| (world.get::<Prop>(prop).unwrap().0.id(), true));
    expected.sort_by_key(|(field, _)| *field);
    assert_eq!(failed, expected);
    assert_eq!(world.resource::<Heard>().exits, 0);
    assert!(props.iter().all(|prop| world.get::<PropState>(*prop) == Some(&PropState::Ready)));
}

/// One line makes an app survive the loss of its device.
#[test]
fn an_app_survives_the_loss_of_its_device() {
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let limits = wgpu::Limits { max_texture_dimension_2d: 4096, ..default() };
    let recover = |app: &mut App| _ = app.add_plugins(DeviceRecoveryPlugin);
    let (mut headless, _) = app(limits, recover, [corner(4, red), corner(5, blue)]);
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    let before = colors(&mut headless);
    assert_eq!(before, [[255, 0, 0], [0, 0, 255]]);
    let device = |headless: &Headless| headless.app.sub_app(RenderApp).world().resource::<RenderDevice>().clone();
    for uploads in [4, 6] {
        device(&headless).wgpu_device().destroy();
        for _ in 0..50 {
            headless.update();
        }
        assert_eq!(headless.app.world().resource::<Heard>().ready, uploads, "fields reached the new device");
        assert_eq!(device(&headless).limits().max_texture_dimension_2d, 4096, "the app's own settings");
        headless.wait_until_ready(Duration::from_secs(60)).unwrap();
        assert_eq!(colors(&mut headless), before);
    }
    assert_eq!(headless.app.world().resource::<Heard>().exits, 0);
}
