//! PlenOctree files: every variant can be read, damaged ones say what is wrong, and written ones are restored.

mod damaged;
mod npz;

use std::io::Cursor;

use glam::{DVec3, UVec3};
use half::f16;
use npz::{Arrays, CELLS, NODES, c, example, fortran, npy};
use plenoctree::{
    Activation, Basis, Cell, DensityLoss, Frame, LoadSettings, PackSettings, Packed, PlenOctree, ReadError, ReadFault,
    UpAxis, WriteError, palette::Palette, sampling::Progress,
};
use zip::CompressionMethod;

fn read_with(bytes: &[u8], settings: &LoadSettings) -> Result<PlenOctree, ReadError> {
    PlenOctree::read_from(Cursor::new(bytes), "test.npz", settings)
}

fn read(bytes: &[u8]) -> Result<PlenOctree, ReadError> {
    read_with(bytes, &LoadSettings::default())
}

fn written(field: &PlenOctree) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    field.write_to(&mut bytes).unwrap();
    bytes.into_inner()
}

fn assert_same(field: &PlenOctree, other: &PlenOctree, what: &str) {
    assert_eq!(field.frame(), other.frame(), "{what}");
    assert_eq!(field.basis(), other.basis(), "{what}");
    assert_eq!(field.activation(), other.activation(), "{what}");
    assert_eq!(field.up(), other.up(), "{what}");
    assert_eq!(field.nodes(), other.nodes(), "{what}");
    assert_eq!(field.densities(), other.densities(), "{what}");
    assert_eq!(field.coefficients(), other.coefficients(), "{what}");
}

/// Leaves of the example in depth-first order: corner and width in finest cells, and the cell of the file.
fn expected_leaves(node: usize, corner: UVec3, size: u32, threshold: f64) -> Vec<(UVec3, u32, usize)> {
    let (child, sigma) = (npz::child(), npz::sigma());
    (0..8)
        .flat_map(|part| {
            let cell = 8 * node + part;
            let corner = corner + size * UVec3::new(part as u32 >> 2, part as u32 >> 1 & 1, part as u32 & 1);
            if child[cell] != 0.0 {
                expected_leaves((node as f64 + child[cell]) as usize, corner, size / 2, threshold)
            } else if sigma[cell] >= threshold && sigma[cell] > 0.0 {
                vec![(corner, size, cell)]
            } else {
                Vec::new()
            }
        })
        .collect()
}

fn assert_is_example(field: &PlenOctree, threshold: f64) {
    let expected = expected_leaves(0, UVec3::ZERO, 4, threshold);
    assert_eq!(field.depth(), 3);
    assert_eq!(field.nodes().len(), NODES - 1);
    assert_eq!(field.leaves(), expected.len());
    let count = field.basis().coefficients();
    for ((place, leaf), (corner, size, cell)) in field.leaf_cells().enumerate().zip(expected) {
        assert_eq!((leaf.leaf as usize, leaf.corner, leaf.size), (place, corner, size));
        assert_eq!(f64::from(field.densities()[place]), npz::sigma()[cell]);
        let found: Vec<f64> = field.coefficients()[place * count..][..count].iter().map(|k| k.to_f64()).collect();
        let coefficients: Vec<f64> = (0..count).map(|k| npz::coefficient(cell, k)).collect();
        assert_eq!(found, coefficients, "cell {cell}");
    }
}

#[test]
fn leaves_are_where_and_what_the_file_says() {
    for basis in Basis::ALL {
        let field = read(&example(basis).stored()).unwrap();
        assert_eq!(field.basis(), basis);
        assert_eq!(field.activation(), basis.default_activation());
        assert_eq!(field.up(), UpAxis::Z);
        let frame = Frame { offset: DVec3::new(0.5, 0.375, 0.0), scale: DVec3::new(0.5, 0.25, 0.125) };
        assert_eq!(field.frame(), frame);
        assert_is_example(&field, 0.01);
    }
}

#[test]
fn settings_say_what_the_file_does_not() {
    let file = example(Basis::Sh4).stored();
    for density_threshold in [-1.0, 0.0, 0.01, 50.0] {
        let settings =
            LoadSettings { activation: Some(Activation::ShiftedRelu), up: Some(UpAxis::Y), density_threshold };
        let field = read_with(&file, &settings).unwrap();
        assert_eq!((field.activation(), field.up()), (Activation::ShiftedRelu, UpAxis::Y));
        assert_is_example(&field, density_threshold.into());
    }
    let rgba = LoadSettings { activation: Some(Activation::Sigmoid), ..Default::default() };
    assert_eq!(read_with(&example(Basis::Rgba).stored(), &rgba).unwrap().activation(), Activation::Sigmoid);
}

#[test]
fn a_threshold_must_be_a_number() {
    let settings = LoadSettings { density_threshold: f32::NAN, ..Default::default() };
    let error = read_with(&example(Basis::Sh4).stored(), &settings).unwrap_err();
    assert_eq!(error.to_string(), "test.npz: found density_threshold = NaN, expected a number");
    assert!(matches!(error.fault, ReadFault::Setting(_)));
    let all = LoadSettings { density_threshold: f32::NEG_INFINITY, ..Default::default() };
    assert_is_example(&read_with(&example(Basis::Sh4).stored(), &all).unwrap(), 0.0);
}

#[test]
fn every_layout_gives_the_same_field() {
    let basis = Basis::Sh9;
    let plain = read(&example(basis).stored()).unwrap();
    let deflated = read(&example(basis).zip(CompressionMethod::Deflated)).unwrap();
    assert_same(&plain, &deflated, "deflated");

    let mut variants = vec![
        ("no data_format", example(basis).without("data_format")),
        ("other arrays", example(basis).with("extra_data", npy(c("<f4"), &[0], &[])).with("n_free", vec![1, 2, 3])),
        ("a row for data_dim", example(basis).with("data_dim", npy(c("|u1"), &[1], &[28.0]))),
    ];
    for descr in ["<U3", ">U3", "<U9", "|S3", "|S7"] {
        variants.push((descr, example(basis).with("data_format", npz::text(descr, "SH9"))));
    }
    for descr in ["|i1", "<i2", ">i4", "<i8", ">i8"] {
        let child = npy(c(descr), &[NODES, 2, 2, 2], &npz::child());
        variants.push((descr, example(basis).with("child", child)));
        let child = npy(fortran(descr), &[NODES, 2, 2, 2], &npz::child());
        variants.push((descr, example(basis).with("child", child)));
    }
    let (shape, data) = (npz::data_shape(basis), npz::data(basis));
    for descr in ["<f2", ">f2", "<f4", ">f4", "<f8", ">f8"] {
        variants.push((descr, example(basis).with("data", npy(c(descr), &shape, &data))));
        variants.push((descr, example(basis).with("data", npy(fortran(descr), &shape, &data))));
        let offset = npy(c(descr), &[3], &[0.5, 0.375, 0.0]);
        variants.push((descr, example(basis).with("offset", offset)));
    }
    for (version, text) in [
        (2, "{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }"),
        (3, "{\"shape\": (3L,), \"fortran_order\": True, \"descr\": \"<f4\"}"),
        (1, " { 'fortran_order':False,'shape':( 3 ),'descr':'=f4' } \n\n"),
    ] {
        let numbers: Vec<u8> = [0.5f32, 0.25, 0.125].into_iter().flat_map(f32::to_le_bytes).collect();
        variants.push((text, example(basis).with("invradius3", npz::npy_with_header(version, text, &numbers))));
    }
    for (what, arrays) in variants {
        assert_same(&plain, &read(&arrays.stored()).unwrap(), what);
    }
}

#[test]
fn older_files_have_one_scale() {
    for radius in [npy(c("<f8"), &[], &[0.4]), npy(c("<f8"), &[1], &[0.4])] {
        let file = example(Basis::Sh1).without("invradius3").with("invradius", radius).stored();
        assert_eq!(read(&file).unwrap().frame().scale, DVec3::splat(0.4));
    }
}

#[test]
fn data_format_may_only_be_missing_where_it_does_not_matter() {
    let rgba = read(&example(Basis::Sh1).without("data_format").stored()).unwrap();
    assert_eq!(rgba.basis(), Basis::Rgba, "four values without a format are a color");
    for basis in [Basis::Sh4, Basis::Sh16, Basis::Sh25] {
        assert_eq!(read(&example(basis).without("data_format").stored()).unwrap().basis(), basis);
    }
}

/// A quantized file of the example: function b of cell n is row `rows - 1 - n` of a codebook of its own.
fn quantized(basis: Basis, retained: usize, rows: usize, layout: npz::Layout, map: npz::Layout) -> Arrays {
    let functions = basis.functions();
    let coded = functions - retained;
    let value = |function: usize, cell: usize, channel| npz::coefficient(cell, channel * functions + function);
    let row = |cell: usize| rows - 1 - cell;
    let colors: Vec<f64> = (retained..functions)
        .flat_map(|b| (0..rows).map(move |at| (b, rows - 1 - at)))
        .flat_map(|(b, cell)| (0..3).map(move |ch| if cell < CELLS { value(b, cell, ch) } else { f64::NAN }))
        .collect();
    let quant_map: Vec<f64> = (0..coded).flat_map(|_| (0..CELLS).map(|cell| row(cell) as f64)).collect();
    let mut arrays = example(basis)
        .without("data")
        .with("sigma", npy(layout, &[NODES, 2, 2, 2], &npz::sigma()))
        .with("quant_colors", npy(layout, &[coded, rows, 3], &colors))
        .with("quant_map", npy(map, &[coded, NODES, 2, 2, 2], &quant_map));
    if retained > 0 {
        let numbers: Vec<f64> = (0..retained)
            .flat_map(|b| (0..CELLS).flat_map(move |cell| (0..3).map(move |ch| value(b, cell, ch))))
            .collect();
        arrays = arrays.with("data_retained", npy(layout, &[retained, NODES, 2, 2, 2, 3], &numbers));
    }
    arrays
}

#[test]
fn quantized_files_expand_to_the_same_field() {
    for (basis, retained) in
        [(Basis::Sh9, 0), (Basis::Sh9, 4), (Basis::Sh9, 9), (Basis::Sh25, 1), (Basis::Sh1, 0), (Basis::Rgba, 0)]
    {
        let plain = read(&example(basis).stored()).unwrap();
        for (layout, map) in [
            (c("<f2"), c("<u2")),
            (c(">f4"), c(">i4")),
            (fortran("<f2"), fortran("<u2")),
            (fortran(">f8"), fortran("|u1")),
        ] {
            for rows in [CELLS, 100] {
                let file = quantized(basis, retained, rows, layout, map).stored();
                assert_same(&plain, &read(&file).unwrap(), &format!("{basis:?}, {retained} retained"));
            }
        }
    }
}

#[test]
fn written_files_come_back_as_they_were() {
    for basis in Basis::ALL {
        let field = read(&example(basis).stored()).unwrap();
        let bytes = written(&field);
        assert_same(&field, &read(&bytes).unwrap(), basis.name());
        assert_eq!(bytes, written(&field), "the file depends on the field alone");
    }
}

#[test]
fn files_on_disk_come_back_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let field = read(&example(Basis::Sh4).stored()).unwrap();
    field.write(&path).unwrap();
    assert_same(&field, &PlenOctree::read(&path, &LoadSettings::default()).unwrap(), "on disk");
    std::fs::remove_file(&path).unwrap();
    let error = PlenOctree::read(&path, &LoadSettings::default()).unwrap_err();
    assert!(matches!(error.fault, ReadFault::Io(_)) && error.to_string().contains(".npz: "), "{error}");
}

fn one_leaf(density: f32, frame: Frame) -> PlenOctree {
    let mut root = [Cell::EMPTY; 8];
    root[5] = Cell::leaf(0);
    let coefficients = vec![f16::from_f32(0.25); 3];
    PlenOctree::new(frame, Basis::Sh1, Activation::Sigmoid, UpAxis::Z, vec![root], vec![density], coefficients).unwrap()
}

#[test]
fn written_densities_are_the_nearest_that_the_format_holds() {
    let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
    for (density, expected) in
        [(1e9, 65504.0), (65504.0, 65504.0), (0.1, 0.099975586), (1e-30, f16::MIN_POSITIVE_SUBNORMAL.to_f32())]
    {
        let settings = LoadSettings { density_threshold: 0.0, ..Default::default() };
        let field = read_with(&written(&one_leaf(density, frame)), &settings).unwrap();
        assert_eq!(field.densities().to_vec(), [expected]);
    }
}

/// Densities that files change are reported where that shows: with the same optical depths, in units that are far too
/// large, or far too small.
#[test]
fn densities_that_files_change_are_reported() {
    let losses = |density: f32, width: f64| {
        let field = one_leaf(density, Frame::spanning(DVec3::ZERO, DVec3::splat(width)));
        field.density_losses().collect::<Vec<_>>()
    };
    assert!(matches!(losses(1e6, 1e-5)[..], [DensityLoss::CutOff { .. }]));
    assert!(matches!(losses(1e-6, 1e7)[..], [DensityLoss::Rounded { .. }]));
    assert!([1.0, 1e6, 1e-6].iter().all(|density| losses(*density, 10.0).is_empty()));
}

/// In boxes of more than 10 units, the density threshold counts per tenth of the box: what is faint is kept in any unit,
/// and a little larger box never changes much.
#[test]
fn faint_leaves_are_kept_in_small_units() {
    for (width, density, leaves) in [
        (1.0, 0.009, 0),
        (2.0, 0.009, 0),
        (2.0, 0.011, 1),
        (10.0, 0.0099, 0),
        (10.2, 0.0099, 1),
        (99.0, 0.00102, 1),
        (99.0, 0.001, 0),
        (101.0, 0.001, 1),
        (101.0, 0.00098, 0),
        (2000.0, 0.009, 1),
        (2000.0, 5.1e-5, 1),
        (2000.0, 4.9e-5, 0),
    ] {
        let field = one_leaf(density, Frame::spanning(DVec3::ZERO, DVec3::splat(width)));
        assert_eq!(read(&written(&field)).unwrap().leaves(), leaves, "{density} in {width}");
    }
}

#[test]
fn frames_beyond_the_format_are_not_written() {
    // A frame of the second scale has a cube that float32 does not reach.
    for scale in [1e200, 1e-39] {
        let frame = Frame { offset: DVec3::ZERO, scale: DVec3::new(1.0, 1.0, scale) };
        let error = one_leaf(1.0, frame).write_to(Cursor::new(Vec::new())).unwrap_err();
        assert!(matches!(error, WriteError::Frame(ReadFault::Value { key: "invradius3", .. })), "{error}");
    }
    let frame = Frame { offset: DVec3::splat(-1e200), scale: DVec3::ONE };
    let error = one_leaf(1.0, frame).write_to(Cursor::new(Vec::new())).unwrap_err();
    assert!(matches!(error, WriteError::Frame(ReadFault::Value { key: "offset", .. })), "{error}");
}

/// Far from the origin, where float32 moves fields by many cells, fields stay where they are, unless a tool that knows only
/// float32 has moved them since.
#[test]
fn fields_far_from_the_origin_stay_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    for far in [1e7, -3e9] {
        let low = DVec3::new(far, 0.3, -far);
        let field = one_leaf(1.0, Frame::spanning(low, low + 2.24));
        assert_eq!(read(&written(&field)).unwrap().frame(), field.frame(), "{far}");
        let settings = PackSettings { hidden: 0.0, ..Default::default() };
        Packed::new(&field, &settings, &Progress::default()).unwrap().write_npz(&path).unwrap();
        let packed = PlenOctree::read(&path, &LoadSettings::default()).unwrap();
        assert_eq!(packed.frame(), field.frame(), "{far}, packed");
    }
    let near = written(&one_leaf(1.0, Frame::spanning(DVec3::splat(-0.9), DVec3::splat(1.3))));
    assert!(!String::from_utf8_lossy(&near).contains("frame_float64"), "others do not need it");
    let exact = npy(c("<f8"), &[2, 3], &[0.5, 0.375 + 1e-12, 0.0, 0.5, 0.25, 0.125 - 1e-12]);
    let file = example(Basis::Sh1).with("frame_float64", exact);
    assert_eq!(read(&file.stored()).unwrap().frame().offset.y, 0.375 + 1e-12);
    let moved = file.with("offset", npy(c("<f4"), &[3], &[0.5, 0.25, 0.0]));
    assert_eq!(read(&moved.stored()).unwrap().frame().offset.y, 0.25);
}

/// A field of one color, whose tree is full. At the deepest level, only the first `cells` of each node are leaves.
fn even(depth: u32, cells: usize) -> PlenOctree {
    let last = 1 << (3 * (depth - 1));
    let above = (last - 1) / 7;
    let divided = |node: usize| std::array::from_fn(|cell| Cell::node((8 * node + 1 + cell) as u32));
    let leaf = |node: usize, cell| if cell < cells { Cell::leaf((node * cells + cell) as u32) } else { Cell::EMPTY };
    let nodes = (0..above).map(divided).chain((0..last).map(|node| std::array::from_fn(|cell| leaf(node, cell))));
    let (nodes, leaves) = (nodes.collect(), last * cells);
    let (frame, basis) = (Frame::spanning(DVec3::ZERO, DVec3::ONE), Basis::Sh25);
    let coefficients = vec![f16::ONE; leaves * basis.coefficients()];
    PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, vec![50.0; leaves], coefficients).unwrap()
}

/// A field that is far larger than its file, because all of it is the same, is read.
#[test]
fn even_fields_come_back() {
    let field = even(6, 8);
    let file = written(&field);
    assert!(50 * file.len() < 2 * field.coefficients().len());
    assert_eq!(read(&file).unwrap().coefficients(), field.coefficients());
}

/// A field that cannot be written leaves the old file unchanged, and no other file.
#[test]
fn a_failed_write_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let field = read(&example(Basis::Sh4).stored()).unwrap();
    field.write(&path).unwrap();
    let frame = Frame { offset: DVec3::ZERO, scale: DVec3::new(1.0, 1.0, 1e200) };
    assert!(matches!(one_leaf(1.0, frame).write(&path), Err(WriteError::Frame(_))));
    assert_same(&field, &PlenOctree::read(&path, &LoadSettings::default()).unwrap(), "after the failure");
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
}

/// Whoever has opened an old file still reads all of it: a new one takes its place, and its own bytes stay.
#[test]
fn files_are_replaced_and_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let fields = [0.5, 0.25].map(|density| one_leaf(density, Frame::spanning(DVec3::ZERO, DVec3::ONE)));
    let packed =
        fields.each_ref().map(|field| Packed::new(field, &PackSettings::default(), &Progress::default()).unwrap());
    let palettes = [0.5, 0.25].map(|color| Palette::new(vec![[color; 3]]).unwrap());
    let (path, old) = (folder.path().join("file"), folder.path().join("old"));
    let write: [(&str, &dyn Fn(usize)); 4] = [
        ("a field", &|index| fields[index].write(&path).unwrap()),
        ("a packed field", &|index| packed[index].write(&path).unwrap()),
        ("a packed field for others", &|index| packed[index].write_npz(&path).unwrap()),
        ("a palette", &|index| palettes[index].write(&path).unwrap()),
    ];
    for (what, write) in write {
        write(0);
        let before = std::fs::read(&path).unwrap();
        std::fs::hard_link(&path, &old).unwrap();
        write(1);
        assert!(std::fs::read(&old).unwrap() == before, "{what}: the old file has changed");
        assert!(std::fs::read(&path).unwrap() != before, "{what}: the new file is the old one");
        std::fs::remove_file(&old).unwrap();
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "{what}");
    }
}

/// The numbers of an array of an archive.
fn numbers<T: npyz::Deserialize>(archive: &mut zip::ZipArchive<Cursor<Vec<u8>>>, key: &str) -> Vec<T> {
    npyz::NpyFile::new(archive.by_name(&format!("{key}.npy")).unwrap()).unwrap().into_vec().unwrap()
}

#[test]
fn svox_finds_its_bookkeeping() {
    let field = read(&example(Basis::Sh1).stored()).unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(written(&field))).unwrap();
    let mut offsets = |key: &str| numbers::<i32>(&mut archive, key);
    let (child, parents) = (offsets("child"), offsets("parent_depth"));
    for (cell, &offset) in child.iter().enumerate().filter(|(_, offset)| **offset != 0) {
        let node = (cell / 8) as i32;
        let [parent, depth] = [0, 1].map(|at| parents[2 * (node + offset) as usize + at]);
        assert_eq!((parent, depth), (cell as i32, parents[2 * node as usize + 1] + 1));
    }
    assert_eq!(parents[..2], [0, 0]);
    let mut scalar = |key: &str| numbers::<i64>(&mut archive, key);
    assert_eq!(scalar("n_internal"), [NODES as i64 - 1]);
    assert_eq!(scalar("n_free"), [0]);
    assert_eq!(scalar("depth_limit"), [10]);
}

/// Frames that `new` would refuse are not made by moving a field.
#[test]
fn fields_are_only_moved_to_valid_places() {
    let field = read(&example(Basis::Sh4).stored()).unwrap();
    let moved = field.clone().shifted(DVec3::new(1.0, -2.0, 0.5)).unwrap();
    let (low, high) = field.bounds().unwrap();
    let shift = moved.bounds().unwrap().0 - low;
    assert!((shift - DVec3::new(1.0, -2.0, 0.5)).length() < 1e-9 * (high - low).length());
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = field.clone().shifted(DVec3::splat(wrong)).unwrap_err();
        assert_eq!(error.to_string(), "the offset must be finite");
    }
}
