//! Packed fields: small, like the field that was packed, and read again as they were written. Damaged ones say what is
//! wrong.

mod sections;

use std::{collections::HashMap, io::Cursor, sync::LazyLock};

use glam::{DVec2, DVec3};
use half::f16;
use plenoctree::{
    Activation, BakeSettings, Basis, Cell, LoadSettings, PackSettings, Packed, PlenOctree, ReadError, ReadFault,
    UpAxis, bake,
    camera::PinholeCamera,
    palette::{ColorCount, Extraction, ExtractionSettings, PaletteMethod, extract},
    reference::render,
    sampling::{Progress, SamplingSettings, sample},
};
use proptest::prelude::*;
use sections::Sections;

fn read(bytes: &[u8]) -> Result<PlenOctree, ReadError> {
    let settings = LoadSettings { density_threshold: 0.0, ..Default::default() };
    PlenOctree::read_from(Cursor::new(bytes), "test.plenoctree", &settings)
}

/// A solid ball with a soft shell. Its colors vary from place to place, and with the direction of view.
fn ball(depth: u32, basis: Basis) -> PlenOctree {
    let settings = BakeSettings { depth, basis, up: UpAxis::Y, directions: 64, ..Default::default() };
    let density = |at: DVec3| ((0.85 - at.length()) * 400.0).clamp(0.0, 60.0);
    let radiance = |at: DVec3| {
        let normal = at.normalize_or(DVec3::Z);
        let base = 0.5 + 0.3 * DVec3::new((5.0 * at.x).sin(), (4.0 * at.y).sin(), (6.0 * at.z).cos());
        move |direction: DVec3| base + 0.2 * normal.dot(-direction).max(0.0).powi(2)
    };
    bake(&settings, density, radiance).unwrap()
}

fn pack(field: &PlenOctree, settings: &PackSettings) -> Packed {
    Packed::new(field, settings, &Progress::default()).unwrap()
}

/// Small packed fields, one of each basis.
static EXAMPLES: LazyLock<HashMap<Basis, Vec<u8>>> = LazyLock::new(|| {
    let settings = PackSettings { rows: 16, record_histograms: true, ..Default::default() };
    Basis::ALL.into_iter().map(|basis| (basis, pack(&ball(3, basis), &settings).bytes().to_vec())).collect()
});

/// Returns one of these, as sections.
fn example(basis: Basis) -> Sections {
    Sections::parse(&EXAMPLES[&basis])
}

fn assert_same(field: &PlenOctree, other: &PlenOctree) {
    assert_eq!((field.frame(), field.basis(), field.activation()), (other.frame(), other.basis(), other.activation()));
    assert_eq!((field.up(), field.nodes()), (other.up(), other.nodes()));
    assert_eq!(field.densities(), other.densities());
    assert_eq!(field.coefficients(), other.coefficients());
}

/// The PSNR of all channels in views from around, over black.
fn psnr(field: &PlenOctree, other: &PlenOctree) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for (azimuth, elevation) in [(0.3, 0.4), (2.5, -0.3), (4.4, 1.0)] {
        let camera = PinholeCamera::around(field, 48, 48, azimuth, elevation).unwrap();
        let [a, b] = [field, other].map(|field| render(field, &camera).color);
        squares += a.iter().zip(&b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>();
        count += 3.0 * a.len() as f64;
    }
    -10.0 * f64::log10(squares / count)
}

#[test]
fn packed_fields_come_back() {
    for basis in Basis::ALL {
        let field = ball(4, basis);
        let packed = pack(&field, &PackSettings { record_histograms: true, ..Default::default() });
        let again = read(packed.bytes()).unwrap();
        assert_same(packed.field(), &again);
        assert_eq!(again.codebook(), packed.field().codebook());
        assert!(again.codebook().is_some());
        let settings = SamplingSettings::default();
        let recorded = again.histograms(&settings).unwrap();
        let sampled = sample(&field, &settings, &Progress::default()).unwrap();
        assert_eq!((recorded.fine(), recorded.samples()), (sampled.fine(), sampled.samples()));
        for (found, expected) in recorded.coarse().iter().zip(sampled.coarse()) {
            // The sum of the fine bins.
            assert!((found - expected).abs() <= 1e-13 * expected);
        }
        assert_eq!(pack(&field, &PackSettings::default()).field().histograms(&settings), None);
        // What a field records stays when it is packed again.
        assert_eq!(pack(&again, &PackSettings::default()).field().histograms(&settings), Some(recorded));
        assert_eq!((again.basis(), again.up(), again.frame()), (basis, UpAxis::Y, field.frame()));
        assert_eq!(again.leaves(), packed.field().leaves());
        // Packed again, with every number already a multiple of its step.
        assert!(psnr(&again, pack(&again, &PackSettings::FINE).field()) > 40.0);
    }
}

#[test]
fn what_a_file_records_can_be_overridden() {
    let packed = pack(&ball(3, Basis::Sh4), &PackSettings::default());
    let load = |settings: &LoadSettings| {
        PlenOctree::read_from(Cursor::new(packed.bytes()), "test.plenoctree", settings).unwrap()
    };
    let settings =
        LoadSettings { activation: Some(Activation::ShiftedRelu), up: Some(UpAxis::Z), density_threshold: 50.0 };
    let field = load(&settings);
    assert_eq!((field.activation(), field.up()), (Activation::ShiftedRelu, UpAxis::Z));
    let dense = packed.field().densities().iter().filter(|density| **density >= 50.0);
    assert!(field.densities().iter().eq(dense) && field.leaves() > 0);
}

/// With recorded histograms, the hull and the fitted palette of the packed field are those of the field, also if it is
/// packed again, and although its leaves would give others. Tones look at the field itself. Read with other
/// settings, it is not the field in the file any more.
#[test]
fn palettes_stay() {
    // Four colors, which one palette suits best.
    let settings = BakeSettings { depth: 5, basis: Basis::Sh4, up: UpAxis::Y, directions: 64, ..Default::default() };
    let color = |at: DVec3| {
        let base = match (at.x > 0.0, at.y > 0.0) {
            (false, false) => DVec3::new(0.85, 0.1, 0.1),
            (false, true) => DVec3::new(0.1, 0.6, 0.2),
            (true, false) => DVec3::new(0.15, 0.2, 0.9),
            (true, true) => DVec3::new(0.9, 0.8, 0.3),
        };
        let shade = 0.05 * (3.0 * at.z).sin();
        move |direction: DVec3| base + shade + 0.03 * direction.x
    };
    let field = bake(&settings, |at| if at.length() < 0.85 { 60.0 } else { 0.0 }, color).unwrap();
    let palette =
        |field: &PlenOctree, settings: &ExtractionSettings| extract(field, settings, &Progress::default()).unwrap();
    // Colors of nearly equal weight may change places.
    let difference = |a: &Extraction, b: &Extraction| {
        let to = |a: &[f64; 3]| {
            let b = b.palette.colors.iter();
            let channels = b.map(|b| (DVec3::from(*a) - DVec3::from(*b)).abs().max_element());
            channels.fold(f64::INFINITY, f64::min)
        };
        a.palette.colors.iter().map(to).fold(0.0, f64::max)
    };
    let rough =
        PackSettings { tolerance: 1.0, rows: 1, color_step: 0.2, record_histograms: true, ..PackSettings::SMALL };
    let once = read(pack(&field, &rough).bytes()).unwrap();
    let twice = read(pack(&once, &rough).bytes()).unwrap();
    let fitted =
        ExtractionSettings { method: PaletteMethod::Fitted, colors: ColorCount::Fixed(4), ..Default::default() };
    let hull = ExtractionSettings { method: PaletteMethod::Hull, ..Default::default() };
    for packed in [&once, &twice] {
        let difference = difference(&palette(packed, &fitted), &palette(&field, &fitted));
        assert!(difference < 1e-9, "{difference}");
        let [found, expected] = [packed, &field].map(|field| palette(field, &hull).report.errors.rmse);
        assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
    }
    let sampling = SamplingSettings { stop_transmittance: 0.011, ..Default::default() };
    let sampled =
        difference(&palette(&once, &ExtractionSettings { sampling, ..fitted.clone() }), &palette(&field, &fitted));
    assert!(sampled > 0.01, "{sampled}");
    let settings = SamplingSettings::default();
    let turned = LoadSettings { up: Some(UpAxis::Z), density_threshold: 0.0, ..Default::default() };
    let bytes = pack(&field, &rough).bytes().to_vec();
    let read_with = |settings: &LoadSettings| PlenOctree::read_from(Cursor::new(&bytes), "test", settings).unwrap();
    assert!(read_with(&LoadSettings::default()).histograms(&settings).is_some());
    assert!(read_with(&turned).histograms(&settings).is_none());
    assert!(once.thinned(30.0).histograms(&settings).is_none());
}

/// Finer settings give larger files and better pictures, and all are far smaller than `.npz` files.
#[test]
fn quality_buys_accuracy_with_bytes() {
    let field = ball(5, Basis::Sh9);
    let mut plain = Cursor::new(Vec::new());
    field.write_to(&mut plain).unwrap();
    let mut last = (0, 0.0);
    for (settings, least, ratio) in
        [(PackSettings::SMALL, 30.0, 20), (PackSettings::BALANCED, 38.0, 12), (PackSettings::FINE, 43.0, 6)]
    {
        let packed = pack(&field, &settings);
        let now = (packed.bytes().len(), psnr(&field, packed.field()));
        assert!(now > last && now.1 > last.1 && now.1 > least, "{now:?} after {last:?}");
        assert!(now.0 * ratio < plain.get_ref().len(), "{now:?} of {}", plain.get_ref().len());
        last = now;
    }
}

/// Colors and coefficients that the finest steps cannot reach get larger steps: they are not clipped.
#[test]
fn finer_steps_are_never_worse() {
    for basis in [Basis::Rgba, Basis::Sh9] {
        let field = ball(5, basis);
        let mut last = 0.0;
        for step in [8e-3, 1e-3, 1e-4] {
            let settings = PackSettings { color_step: step, table_step: step, tolerance: 0.0, ..PackSettings::FINE };
            let now = psnr(&field, pack(&field, &settings).field());
            assert!(now > f64::max(last - 0.1, 43.0), "{basis:?}, {step}: {now} after {last} dB");
            last = now;
        }
    }
    let settings = BakeSettings { depth: 3, basis: Basis::Rgba, min_density: 0.0, ..Default::default() };
    let bright = bake(&settings, |_| 9.0, |_| |_| DVec3::new(15.0, 14.0, 13.0)).unwrap();
    let packed = pack(&bright, &PackSettings { color_step: 1e-4, ..PackSettings::FINE });
    let color = packed.field().render_ray(DVec3::new(0.1, 0.1, -2.0), DVec3::Z).0;
    assert!((color - DVec3::new(15.0, 14.0, 13.0)).abs().max_element() < 0.1, "{color}");
}

/// Returns a field with a root whose cells are empty but for these leaves, and a leaf in the corner that is `depth`
/// levels deep. Leaves are the index of a root's cell, a density, and a color before the activation.
fn coarse(depth: u32, activation: Activation, leaves: &[(usize, f32, [f32; 3])], speck: f32) -> PlenOctree {
    let mut nodes = vec![[Cell::EMPTY; 8]; depth as usize];
    let (mut densities, mut coefficients) = (Vec::new(), Vec::new());
    let mut leaf = |density: f32, color: [f32; 3]| {
        densities.push(density);
        coefficients.extend(color.map(|channel| f16::from_f32(channel / 0.282_094_8)));
        Cell::leaf(densities.len() as u32 - 1)
    };
    for (cell, density, color) in leaves {
        nodes[0][*cell] = leaf(*density, *color);
    }
    for level in 1..nodes.len() {
        nodes[level - 1][7] = Cell::node(level as u32);
    }
    let last = nodes.len() - 1;
    nodes[last][7] = leaf(speck, [0.0; 3]);
    let frame = plenoctree::Frame { offset: DVec3::splat(0.5), scale: DVec3::splat(0.5) };
    PlenOctree::new(frame, Basis::Sh1, activation, UpAxis::Z, nodes, densities, coefficients).unwrap()
}

/// Colors of saturated leaves stay, also next to others whose colors matter more.
#[test]
fn saturated_colors_are_kept() {
    let colors = |black: f64, white: f64, activation: Activation| {
        let settings = BakeSettings { depth: 5, basis: Basis::Sh1, directions: 8, ..Default::default() };
        // Found again by their radiance, as bakes only write what a sigmoid reaches.
        let level = |at: DVec3| match at.x < 0.0 {
            true => 0.4 + 0.05 * f64::from((at.y * 16.0).floor() as i32 % 3),
            false if (at.y * 8.0).floor() as i32 % 2 == 0 => 0.8,
            false => 0.2,
        };
        let plate = |at: DVec3| if at.z.abs() < 0.06 { 2000.0 } else { 0.0 };
        let baked = bake(&settings, plate, |at| move |_| DVec3::splat(level(at))).unwrap();
        let to = |k: &f16| {
            let sum = f64::from(k.to_f32()) * 0.282_094_8;
            let radiance = baked.activation().apply(sum);
            let sum = if radiance > 0.7 {
                white
            } else if radiance < 0.3 {
                black
            } else {
                sum
            };
            f16::from_f64(sum / 0.282_094_8)
        };
        let coefficients = baked.coefficients().iter().map(to).collect();
        let (nodes, densities) = (baked.nodes().to_vec(), baked.densities().to_vec());
        PlenOctree::new(baked.frame(), Basis::Sh1, activation, UpAxis::Z, nodes, densities, coefficients).unwrap()
    };
    for field in [colors(-7.0, 7.0, Activation::Sigmoid), colors(-0.9, 0.5, Activation::ShiftedRelu)] {
        let packed = pack(&field, &PackSettings::default());
        let psnr = psnr(&field, packed.field());
        assert!(psnr > 40.0, "{:?}: {psnr}", field.activation());
    }
}

/// What is only seen from inside keeps its colors if all leaves are to be kept.
#[test]
fn rooms_keep_their_colors() {
    let settings = BakeSettings { depth: 5, basis: Basis::Sh4, directions: 64, ..Default::default() };
    let wall = |at: DVec3| at.abs().max_element();
    let radiance = |at: DVec3| {
        let is_odd = (at * 4.0).floor().element_sum() as i32 % 2 != 0;
        let inside = if is_odd { DVec3::new(0.85, 0.15, 0.15) } else { DVec3::new(0.15, 0.15, 0.85) };
        let base = if wall(at) > 0.87 { DVec3::splat(0.5) } else { inside };
        move |direction: DVec3| base + 0.1 * direction.x
    };
    let field = bake(&settings, |at| if wall(at) > 0.75 { 2000.0 } else { 0.0 }, radiance).unwrap();
    let packed = pack(&field, &PackSettings { hidden: 0.0, ..Default::default() });
    let squares = [DVec3::X, DVec3::NEG_Y, DVec3::new(0.5, 0.4, 0.2), DVec3::new(-0.3, 0.2, -0.9)].map(|along| {
        let camera = PinholeCamera::new(32, 32, 1.2, glam::DMat4::IDENTITY).looking_at(DVec3::ZERO, along, DVec3::Z);
        let [a, b] = [&field, packed.field()].map(|field| render(field, &camera).color);
        a.iter().zip(&b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>()
    });
    let psnr = -10.0 * f64::log10(squares.iter().sum::<f64>() / (4.0 * 3.0 * 32.0 * 32.0));
    assert!(psnr > 35.0, "{psnr}");
}

/// Large faint leaves keep their opacity beside a small one that is as dense as can be.
#[test]
fn large_leaves_keep_their_opacity() {
    let densities = [0.15, 0.3, 0.5, 0.7, 1.0, 1.5];
    let leaves: Vec<_> = densities.into_iter().zip(0..).map(|(density, cell)| (cell, density, [0.5; 3])).collect();
    let field = coarse(9, Activation::Sigmoid, &leaves, 20000.0);
    for settings in [PackSettings::BALANCED, PackSettings::FINE] {
        let packed = pack(&field, &settings);
        for (found, expected) in packed.field().densities().iter().zip(densities) {
            let [found, expected] = [found, &expected].map(|density| 1.0 - (-density).exp());
            assert!((found - expected).abs() < 0.01, "{found}, not {expected}");
        }
    }
}

/// Cameras frame a large leaf, not the many small ones beside it.
#[test]
fn cameras_frame_large_leaves() {
    let settings = BakeSettings { depth: 5, basis: Basis::Rgba, directions: 8, ..Default::default() };
    let speck = |at: DVec3| if at.min_element() > 0.5 { 50.0 } else { 0.0 };
    let speck = bake(&settings, speck, |_| |_| DVec3::ONE).unwrap();
    let mut nodes = speck.nodes().to_vec();
    let mut densities = speck.densities().to_vec();
    nodes[0][0] = Cell::leaf(densities.len() as u32);
    densities.push(50.0);
    let coefficients = vec![f16::ONE; 3 * densities.len()];
    let field =
        PlenOctree::new(speck.frame(), Basis::Rgba, Activation::Identity, UpAxis::Z, nodes, densities, coefficients);
    let (low, high) = field.unwrap().dense_bounds().unwrap();
    assert_eq!((low, high), (DVec3::NEG_ONE, DVec3::ONE));
}

/// The inside of a ball is dropped, except if all leaves are to be kept.
#[test]
fn only_what_is_seen_is_kept() {
    let field = ball(5, Basis::Rgba);
    let packed = pack(&field, &PackSettings::default());
    let (kept, all) = (packed.field().leaves(), field.leaves());
    assert!(all - kept > all / 4, "{kept} of {all}");
    let opaque = |at: f64| packed.field().render_ray(DVec3::new(at, 0.1, -2.0), DVec3::Z).1;
    assert!((0..9).all(|place| opaque(0.1 * f64::from(place) - 0.4) > 0.99));
    assert_eq!(pack(&field, &PackSettings { hidden: 0.0, ..Default::default() }).field().leaves(), all);
}

/// Of a fog, a wisp of smoke above a solid, and a veil in front of it, no leaf is opaque, but all of them are kept. A
/// haze that nobody sees is an error, not an empty field.
#[test]
fn fogs_and_wisps_are_kept() {
    let settings = BakeSettings { depth: 6, basis: Basis::Rgba, min_density: 0.0, directions: 8, ..Default::default() };
    let bake = |density: &(dyn Fn(DVec3) -> f64 + Sync)| bake(&settings, density, |_| |_| DVec3::ONE).unwrap();
    let solid = |at: DVec3| if at.length() < 0.3 { 1000.0 } else { 0.0 };
    let fog = bake(&|at| if at.length() < 0.9 { 0.05 } else { 0.0 });
    let wisp = bake(&|at| {
        if DVec2::new(at.x, at.y).length() < 0.45 && at.z > 0.4 { 0.1 } else { solid(at) }
    });
    let veil = bake(&|at| if at.length() < 0.9 { 0.05 + solid(at) } else { 0.0 });
    for (name, field, origin) in [
        ("fog", &fog, DVec3::new(0.1, 0.05, 2.0)),
        ("wisp", &wisp, DVec3::new(0.03, 2.0, 0.6)),
        ("veil", &veil, DVec3::new(0.6, 0.05, 2.0)),
    ] {
        let direction = if name == "wisp" { DVec3::NEG_Y } else { DVec3::NEG_Z };
        let packed = pack(field, &PackSettings::default());
        let [before, after] = [field, packed.field()].map(|field| field.render_ray(origin, direction).1);
        assert!(before - after < 0.02, "{name}: {before} and {after}");
    }
    // What no ray reaches is dropped all the same.
    assert!(pack(&veil, &PackSettings::BALANCED).field().leaves() < veil.leaves() - 500);
    let haze = bake(&|_| 1e-3);
    let error = Packed::new(&haze, &PackSettings::default(), &Progress::default()).unwrap_err();
    assert!(error.to_string().contains("nothing is left to pack"), "{error}");
    assert!(Packed::new(&haze, &PackSettings { hidden: 1e-6, ..Default::default() }, &Progress::default()).is_ok());
}

/// The floors of cups, one and a half and two and a half times as deep as wide, in any direction, are seen from outside
/// and kept.
#[test]
fn floors_of_holes_are_kept() {
    for (axis, up) in [(0, UpAxis::Z), (1, UpAxis::Y), (2, UpAxis::Z), (2, UpAxis::Y)] {
        for depth in [0.9, 1.5] {
            let floor = 0.9 - depth;
            let settings = BakeSettings { depth: 6, basis: Basis::Rgba, up, directions: 8, ..Default::default() };
            let place = |at: DVec3| (at[axis], DVec2::new(at[(axis + 1) % 3], at[(axis + 2) % 3]).length());
            let density = |at: DVec3| {
                let (height, radius) = place(at);
                let solid = radius < 0.6 && (-0.9..0.9).contains(&height) && (radius > 0.3 || height < floor);
                if solid { 1000.0 } else { 0.0 }
            };
            let radiance = |at: DVec3| {
                let is_floor = place(at).0 > floor - 0.1 && place(at).1 < 0.3;
                move |_| if is_floor { DVec3::X } else { DVec3::Z }
            };
            let packed = pack(&bake(&settings, density, radiance).unwrap(), &PackSettings::default());
            for (across, down) in [(0.01, 0.01), (0.2, 0.02), (-0.02, -0.23), (-0.15, 0.15)] {
                let (mut origin, mut direction) = (DVec3::ZERO, DVec3::ZERO);
                (origin[axis], origin[(axis + 1) % 3], origin[(axis + 2) % 3]) = (2.0, across, down);
                direction[axis] = -1.0;
                let color = packed.field().render_ray(origin, direction).0;
                assert!((color - DVec3::X).abs().max_element() < 0.05, "{axis} {up:?} {depth}: {color} at {origin}");
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let field = ball(4, Basis::Sh4);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| pack(&field, &PackSettings::default())).bytes().to_vec()
    };
    assert_eq!(on(1), on(3));
}

/// Empty fields, very small and very large ones, and one that is larger than float32 can say.
#[test]
fn unusual_fields_are_packed() {
    let empty = ball(3, Basis::Sh9).thinned(f32::INFINITY);
    let packed = pack(&empty, &PackSettings::default());
    assert_same(&empty, &read(packed.bytes()).unwrap());
    for half in [1e-3, 1e3] {
        let (min, max) = (DVec3::splat(-half), DVec3::splat(half));
        let settings = BakeSettings { depth: 3, min, max, basis: Basis::Sh4, min_density: 0.0, ..Default::default() };
        let field = bake(&settings, |at| (20.0 * at.x / half).max(0.0) / half, |_| |_| DVec3::splat(0.3)).unwrap();
        let packed = pack(&field, &PackSettings::FINE);
        assert!(psnr(&field, packed.field()) > 30.0, "{half}");
        assert_same(packed.field(), &read(packed.bytes()).unwrap());
    }
    let huge = ball(3, Basis::Rgba);
    let frame = plenoctree::Frame { scale: DVec3::splat(1e-300), ..huge.frame() };
    let (nodes, densities) = (huge.nodes().to_vec(), huge.densities().to_vec());
    let (activation, coefficients) = (huge.activation(), huge.coefficients().to_vec());
    let huge = PlenOctree::new(frame, huge.basis(), activation, huge.up(), nodes, densities, coefficients).unwrap();
    let error = Packed::new(&huge, &PackSettings::default(), &Progress::default()).unwrap_err();
    assert!(error.to_string().contains("a frame within the range of float32"), "{error}");
}

#[test]
fn settings_out_of_range_are_rejected() {
    let default = PackSettings::default;
    for (settings, name) in [
        (PackSettings { hidden: f32::NAN, ..default() }, "hidden"),
        (PackSettings { below: 1.5, ..default() }, "below"),
        (PackSettings { rows: 0, ..default() }, "rows"),
        (PackSettings { rows: 65537, ..default() }, "rows"),
        (PackSettings { density_levels: 1, ..default() }, "density_levels"),
        (PackSettings { density_levels: 255, ..default() }, "density_levels"),
        (PackSettings { color_step: 0.0, ..default() }, "color_step"),
        (PackSettings { table_step: 2.0, ..default() }, "table_step"),
        (PackSettings { tolerance: -1.0, ..default() }, "tolerance"),
    ] {
        let error = Packed::new(&ball(2, Basis::Rgba), &settings, &Progress::default()).unwrap_err();
        assert!(error.to_string().starts_with(&format!("found {name} = ")), "{error}");
    }
    let progress = Progress::default();
    progress.cancel();
    assert!(Packed::new(&ball(2, Basis::Sh4), &default(), &progress).is_err());
}

/// The published layout gives the packed field, exactly if it has few colors.
#[test]
fn quantized_archives_hold_the_same_field() {
    for basis in [Basis::Rgba, Basis::Sh1, Basis::Sh9] {
        let packed = pack(&ball(4, basis), &PackSettings::default());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        packed.write_npz(&path).unwrap();
        let settings = LoadSettings { density_threshold: 0.0, up: Some(UpAxis::Y), ..Default::default() };
        let again = PlenOctree::read(&path, &settings).unwrap();
        assert!(again.codebook().is_none());
        assert_same(packed.field(), &again);
    }
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = example(Basis::Sh4).bytes();
    for length in 0..bytes.len() {
        let error = read(&bytes[..length]).unwrap_err();
        assert!(error.to_string().starts_with("test.plenoctree: "), "{error}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(read(&longer).unwrap_err().to_string().contains("something follows the field"));
    let (short, whole) = (bytes.len() - 1, bytes.len());
    let message = format!("header: found {short} bytes, expected {whole}: the file is truncated");
    assert!(read(&bytes[..short]).unwrap_err().to_string().contains(&message));
}

/// Asserts how the example is rejected after `change` to its sections.
fn assert_rejected(basis: Basis, change: impl Fn(&mut Sections), message: &str) {
    let mut sections = example(basis);
    read(&sections.bytes()).unwrap();
    change(&mut sections);
    let error = read(&sections.bytes()).unwrap_err();
    assert!(matches!(error.fault, ReadFault::Packed { .. } | ReadFault::Value { .. }), "{error}");
    assert!(error.to_string().contains(message), "{error}, not {message}");
}

#[test]
fn errors_name_the_section() {
    let head = |at: usize, bytes: &'static [u8]| {
        move |sections: &mut Sections| sections.get("HEAD")[at..at + bytes.len()].copy_from_slice(bytes)
    };
    for (at, bytes, message) in [
        (0, &[6][..], "HEAD: found basis 6, expected 0 to 5"),
        (1, &[3], "HEAD: found activation 3"),
        (2, &[2], "HEAD: found up axis 2"),
        (3, &[0], "HEAD: found depth 0, expected 1 to 20"),
        (3, &[21], "HEAD: found depth 21"),
        (4, &[0; 4], "HEAD: found 0 nodes"),
        (8, &[0xff; 4], "HEAD: found 4294967295 leaves"),
        (12, &[0; 4], "HEAD: found 0 densities"),
        (12, &[255, 0, 0, 0], "HEAD: found 255 densities, expected 1 to 254"),
        (16, &[1, 0, 1, 0], "HEAD: found 65537 rows"),
        (24, &[0; 4], "HEAD: found 0 rows"),
        (28, &[0xff; 4], "HEAD: found 4294967295 rows before the first new one"),
        (32, &[0; 4], "HEAD: found a step of 0"),
        (40, &[0xff; 8], "HEAD: found [NaN"),
        (64, &[0; 8], "HEAD: found [0.0"),
    ] {
        assert_rejected(Basis::Sh4, head(at, bytes), message);
    }
    assert_rejected(Basis::Sh4, |sections| sections.version = 1, "header: found version 1, expected version 2");
    assert_rejected(Basis::Sh4, |sections| sections.remove("LEVL"), "LEVL: found no section, expected one");
    assert_rejected(Basis::Sh4, |sections| sections.repeat("ROWS"), "ROWS: found several sections");
    assert_rejected(
        Basis::Sh4,
        |sections| sections.get("DENS").fill(0xff),
        "DENS: found NaN, expected a positive number",
    );
    let bins = |change: &dyn Fn(&mut Vec<u8>), message: &str| {
        assert_rejected(Basis::Sh4, |sections| change(sections.get("BINS")), &format!("BINS: {message}"));
    };
    let set = |at: usize, bytes: &'static [u8]| {
        move |content: &mut Vec<u8>| content[at..at + bytes.len()].copy_from_slice(bytes)
    };
    bins(&set(0, &[2]), "found observers 2, expected 0 or 1");
    bins(&set(1, &[0]), "found directions 0");
    bins(&set(3, &[65]), "found fine_bins 65");
    bins(&set(4, &[0xff; 8]), "found stop_transmittance NaN");
    bins(&|content| content.truncate(9), "found 9 bytes, expected at least 20");
    bins(&|content| _ = content.pop(), "found damaged content");
    bins(&|content| content[20..20 + 4096].fill(0), "found damaged content");
    bins(&|content| content[20] |= 1, "found damaged content");
    let weights = 20 + 4096;
    bins(&set(weights, &[0xff; 8]), "found a weight of NaN");
    bins(&|content| content[weights + 7] |= 0x80, "found a weight of");
    assert_rejected(Basis::Sh4, |sections| sections.repeat("BINS"), "BINS: found several sections");
    for name in ["LEVL", "BASE", "BOOK", "ROWS"] {
        let message = format!("{name}: found damaged content");
        // Too short for what it says, too long, and a wrong sum of frequencies.
        assert_rejected(Basis::Sh4, |sections| _ = sections.get(name).pop(), &message);
        assert_rejected(Basis::Sh4, |sections| sections.get(name).push(0), &message);
        assert_rejected(Basis::Sh4, |sections| sections.get(name)[4] ^= 1, &message);
    }
    // Fewer densities and rows than leaves name.
    assert_rejected(Basis::Sh4, |sections| sections.get("HEAD")[12] -= 1, "DENS: found");
    assert_rejected(Basis::Sh4, |sections| sections.get("HEAD")[16] -= 1, "BOOK: found");
    assert_rejected(Basis::Sh4, |sections| _ = sections.get("TREE").pop(), "TREE: found more or fewer cells");
    assert_rejected(Basis::Sh4, |sections| sections.get("TREE")[1] = 0xff, "TREE: found");
    assert_rejected(Basis::Sh4, |sections| sections.damaged = Some("BASE"), "BASE: found a damaged deflate stream");
}

/// Sections that readers do not know are ignored, so that later files can say more.
#[test]
fn unknown_sections_are_ignored() {
    let mut sections = example(Basis::Sh4);
    let expected = read(&sections.bytes()).unwrap();
    sections.add("NOTE", b"made for a test".to_vec());
    sections.remove("BINS");
    assert_same(&expected, &read(&sections.bytes()).unwrap());
}

/// Sizes that so small a file cannot have are errors.
#[test]
fn implausible_sizes_are_rejected() {
    let claim = |nodes: u32, leaves: u32| {
        move |sections: &mut Sections| {
            sections.get("HEAD")[4..8].copy_from_slice(&nodes.to_le_bytes());
            sections.get("HEAD")[8..12].copy_from_slice(&leaves.to_le_bytes());
        }
    };
    assert_rejected(Basis::Sh4, claim(1 << 27, 1 << 29), "expected a plausible size");
    // A section that deflates to a thousandth.
    let zeros = |sections: &mut Sections| {
        claim(1 << 25, 1 << 25)(sections);
        *sections.get("TREE") = vec![0; 1 << 25];
    };
    assert_rejected(Basis::Sh4, zeros, "expected a plausible size");
    // An even fog, eight levels deep, has so many leaves and nodes, in a file as small.
    assert_rejected(Basis::Sh4, claim(((1 << 24) - 1) / 7, 1 << 24), "TREE: found");
    // Sections that are plausible alone, but have more than the leaves can take.
    for name in ["LEVL", "BASE", "BOOK", "ROWS", "BINS"] {
        let long = |sections: &mut Sections| *sections.get(name) = vec![0; 4 << 20];
        assert_rejected(Basis::Sh4, long, &format!("{name}: found 4194304 bytes of content, expected at most"));
    }
    let raw = |sections: &mut Sections| sections.claimed = Some(("BASE", u64::MAX));
    assert_rejected(Basis::Sh4, raw, "BASE: found 18446744073709551615 bytes of content, expected at most");
}

proptest! {
    #[test]
    fn changed_bytes_give_the_same_field_or_an_error(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0u8..8), 1..4),
    ) {
        let mut bytes = example(Basis::Sh4).bytes();
        let unchanged = read(&bytes).unwrap();
        for (at, bit) in changes {
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        match read(&bytes) {
            Ok(field) => assert_same(&unchanged, &field),
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }

    /// With checksums that are those of the changed content, it is the content that is checked.
    #[test]
    fn changed_sections_give_a_field_or_an_error(
        basis in prop::sample::select(vec![Basis::Rgba, Basis::Sh4]),
        name in prop::sample::select(vec!["HEAD", "TREE", "DENS", "LEVL", "BASE", "BOOK", "ROWS", "BINS"]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut sections = example(basis);
        let content = sections.get(name);
        for (at, byte) in changes {
            if !content.is_empty() {
                let at = at.index(content.len());
                content[at] = byte;
            }
        }
        match read(&sections.bytes()) {
            Ok(field) => {
                let leaves: Vec<u32> = field.leaf_cells().map(|cell| cell.leaf).collect();
                prop_assert!(leaves.into_iter().eq(0..field.leaves() as u32));
                prop_assert!(field.densities().iter().all(|density| *density > 0.0 && density.is_finite()));
                prop_assert!(field.coefficients().iter().all(|k| k.is_finite()));
                prop_assert_eq!(field.coefficients().len(), field.leaves() * field.basis().coefficients());
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }
}
