//! Damaged files: each is an error that says what is wrong.

use std::io::{self, Read, Seek, SeekFrom};

use plenoctree::{InvalidField, MAX_DEPTH};
use proptest::prelude::*;

use super::*;

/// Child offsets of a chain in which every node holds the next.
fn chain(nodes: usize) -> Vec<f64> {
    (0..8 * nodes).map(|cell| f64::from(cell % 8 == 0 && cell / 8 + 1 < nodes)).collect()
}

fn with_nodes(child: &[f64]) -> Arrays {
    let nodes = child.len() / 8;
    example(Basis::Sh1)
        .with("child", npy(c("<i4"), &[nodes, 2, 2, 2], child))
        .with("data", npy(c("<f2"), &[nodes, 2, 2, 2, 4], &vec![1.0; child.len() * 4]))
}

#[test]
fn trees_may_be_as_deep_as_fields_and_no_deeper() {
    let depth = MAX_DEPTH as usize;
    assert_eq!(read(&with_nodes(&chain(depth)).stored()).unwrap().depth(), MAX_DEPTH);
    let error = read(&with_nodes(&chain(depth + 1)).stored()).unwrap_err();
    assert!(matches!(error.fault, ReadFault::Tree(InvalidField::TooDeep)), "{error}");
}

#[test]
fn damaged_trees_are_rejected() {
    let tree = |edges: &[(usize, f64)]| {
        let mut child = vec![0.0; 24];
        edges.iter().for_each(|&(cell, offset)| child[cell] = offset);
        read(&with_nodes(&child).stored()).unwrap_err().fault
    };
    use InvalidField::{Dangling, Shared};
    use ReadFault::Tree;
    assert!(matches!(tree(&[(2, 3.0)]), Tree(Dangling { node: 0 })), "beyond the end");
    assert!(matches!(tree(&[(2, 1.0), (8, -2.0)]), Tree(Dangling { node: 1 })), "before the start");
    assert!(matches!(tree(&[(2, 2147483647.0)]), Tree(Dangling { node: 0 })), "far beyond the end");
    assert!(matches!(tree(&[(2, 1.0), (8, -1.0)]), Tree(Shared { node: 0 })), "a cycle through the root");
    assert!(matches!(tree(&[(2, 1.0), (8, 1.0), (16, -1.0)]), Tree(Shared { node: 1 })), "a cycle below it");
    assert!(matches!(tree(&[(2, 1.0), (3, 1.0)]), Tree(Shared { node: 1 })), "a shared node");
    let beyond = npy(c("<i8"), &[1, 2, 2, 2], &[1e15, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let data = npy(c("<f2"), &[1, 2, 2, 2, 4], &[0.0; 32]);
    let file = example(Basis::Sh1).with("child", beyond).with("data", data).stored();
    assert!(matches!(read(&file).unwrap_err().fault, Tree(Dangling { node: 0 })), "beyond 32 bits");
}

#[test]
fn every_missing_array_is_named() {
    for key in ["data_dim", "child", "invradius3", "offset", "data"] {
        let error = read(&example(Basis::Sh9).without(key).stored()).unwrap_err();
        assert!(matches!(error.fault, ReadFault::Missing { key: found, .. } if found == key), "{error}");
    }
    for key in ["sigma", "quant_colors", "quant_map"] {
        let error = read(&quantized(Basis::Sh9, 2, CELLS, c("<f2"), c("<u2")).without(key).stored()).unwrap_err();
        assert!(matches!(error.fault, ReadFault::Missing { key: found, .. } if found == key), "{error}");
    }
}

/// Asserts that `arrays` are rejected with exactly this message, on one line, after the file's name.
fn assert_rejected(arrays: &Arrays, kind: fn(&ReadFault) -> bool, message: &str) {
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let error = read(&arrays.zip(method)).unwrap_err();
        assert_eq!(error.to_string(), format!("test.npz: {message}"));
        assert!(kind(&error.fault), "{:?}", error.fault);
    }
}

#[test]
fn shapes_that_disagree_are_rejected() {
    let shape = |fault: &ReadFault| matches!(fault, ReadFault::Shape { .. });
    let file = || example(Basis::Sh9);
    let zeros = |layout, shape: &[usize]| npy(layout, shape, &vec![0.0; shape.iter().product()]);
    for (key, layout, found, message) in [
        ("data", c("<f2"), vec![6, 2, 2, 2, 27], "expected [6, 2, 2, 2, 28]"),
        ("data", fortran("<f2"), vec![5, 2, 2, 2, 28], "expected [6, 2, 2, 2, 28]"),
        ("data", c("<f2"), vec![48, 28], "expected [6, 2, 2, 2, 28]"),
        ("child", c("<i4"), vec![6, 3, 3, 3], "expected [n, 2, 2, 2] with n from 1 to 268435455"),
        ("child", c("<i4"), vec![0, 2, 2, 2], "expected [n, 2, 2, 2] with n from 1 to 268435455"),
        ("child", c("<i4"), vec![48], "expected [n, 2, 2, 2] with n from 1 to 268435455"),
        ("offset", c("<f4"), vec![4], "expected [3]"),
        ("offset", c("<f4"), vec![], "expected [3]"),
        ("invradius3", c("<f4"), vec![3, 1], "expected [3]"),
        ("data_dim", c("<i4"), vec![2], "expected []"),
    ] {
        let arrays = file().with(key, zeros(layout, &found));
        assert_rejected(&arrays, shape, &format!("{key}: found shape {found:?}, {message}"));
    }
    let file = || quantized(Basis::Sh9, 4, CELLS, c("<f2"), c("<u2"));
    for (key, layout, found, message) in [
        ("sigma", c("<f2"), vec![5, 2, 2, 2], "expected [6, 2, 2, 2]"),
        ("quant_map", c("<u2"), vec![4, 6, 2, 2, 2], "expected [5, 6, 2, 2, 2]"),
        ("quant_colors", c("<f2"), vec![6, 48, 3], "expected [5, rows, 3]"),
        ("quant_colors", c("<f2"), vec![5, 0, 3], "expected [5, rows, 3]"),
        ("data_retained", c("<f2"), vec![4, 5, 2, 2, 2, 3], "expected [Br, 6, 2, 2, 2, 3] with Br at most 9"),
        ("data_retained", c("<f2"), vec![10, 6, 2, 2, 2, 3], "expected [Br, 6, 2, 2, 2, 3] with Br at most 9"),
    ] {
        let arrays = file().with(key, zeros(layout, &found));
        assert_rejected(&arrays, shape, &format!("{key}: found shape {found:?}, {message}"));
    }
}

#[test]
fn dtypes_that_lose_meaning_are_rejected() {
    let dtype = |fault: &ReadFault| matches!(fault, ReadFault::Dtype { .. });
    let with = |key: &str, descr, shape: &[usize], size: usize| {
        let content = vec![0; shape.iter().product::<usize>() * size];
        example(Basis::Sh9).with(key, npz::npy_with_header(1, &npz::header(c(descr), shape), &content))
    };
    let data = npz::data_shape(Basis::Sh9);
    for (key, descr, shape, size, expected) in [
        ("child", "<f4", vec![6, 2, 2, 2], 4, "an integer"),
        ("child", "|O", vec![6, 2, 2, 2], 8, "an integer"),
        ("data", "<i2", data.clone(), 2, "<f2, <f4 or <f8"),
        ("data", "<f16", data.clone(), 16, "<f2, <f4 or <f8"),
        ("data", "|O", data.clone(), 8, "<f2, <f4 or <f8"),
        ("data_dim", "<c8", vec![], 8, "an integer"),
        ("data_format", "|O", vec![], 40, "a short string"),
        ("data_format", "<U400", vec![], 1600, "a short string"),
        ("offset", "|b1", vec![3], 1, "<f2, <f4 or <f8"),
    ] {
        let message = format!("{key}: found dtype {descr}, expected {expected}");
        assert_rejected(&with(key, descr, &shape, size), dtype, &message);
    }
    let header = "{'descr': [('a', '<f4', (2,)), ('b\n', '<f4')], 'fortran_order': False, 'shape': (3,), }";
    let record = example(Basis::Sh9).with("offset", npz::npy_with_header(1, header, &[0; 36]));
    let message = r"offset: found dtype [(\'a\', \'<f4\', (2,)), (\'b\n\', \'<f4\')], expected <f2, <f4 or <f8";
    assert_rejected(&record, dtype, message);
}

#[test]
fn values_out_of_range_are_rejected() {
    let value = |fault: &ReadFault| matches!(fault, ReadFault::Value { .. });
    let scalar = |key, number| example(Basis::Sh9).with(key, npy(c("<i8"), &[], &[number]));
    for (dim, found) in [(27.0, "27"), (4.0, "4"), (-28.0, "-28"), (1e18, "1000000000000000000"), (0.0, "0")] {
        assert_rejected(&scalar("data_dim", dim), value, &format!("data_dim: found {found}, expected 28 for SH9"));
        if dim != 4.0 {
            let message = format!("data_dim: found {found}, expected 4, 13, 28, 49 or 76");
            assert_rejected(&scalar("data_dim", dim).without("data_format"), value, &message);
        }
    }
    for format in ["SH7", "", "rgba", "SH9\n"] {
        let file = example(Basis::Sh9).with("data_format", npz::text("<U5", format));
        let message =
            format!("data_format: found {}, expected RGBA, SH1, SH4, SH9, SH16 or SH25", format.escape_debug());
        assert_rejected(&file, value, &message);
    }
    for (scale, found) in [
        ([0.5, 0.0, 0.5], "[0.5, 0.0, 0.5]"),
        ([0.5, 0.5, -1.0], "[0.5, 0.5, -1.0]"),
        ([f64::NAN, 0.5, 0.5], "[NaN, 0.5, 0.5]"),
        ([f64::INFINITY, 0.5, 0.5], "[inf, 0.5, 0.5]"),
    ] {
        let file = example(Basis::Sh9).with("invradius3", npy(c("<f4"), &[3], &scale));
        assert_rejected(&file, value, &format!("invradius3: found {found}, expected finite positive numbers"));
    }
    let file = example(Basis::Sh9).with("offset", npy(c("<f4"), &[3], &[0.5, f64::NAN, 0.5]));
    assert_rejected(&file, value, "offset: found [0.5, NaN, 0.5], expected finite numbers");
    // Numbers beyond single precision could be neither written nor drawn.
    for (key, numbers, found) in [
        ("invradius3", [0.5, 1e39, 0.5], "[0.5, 1e39, 0.5], expected a scale and a cube within the range of float32"),
        ("invradius3", [0.5, 1e-39, 0.5], "[0.5, 1e-39, 0.5], expected a scale and a cube within the range of float32"),
        ("offset", [0.5, 0.5, -1e39], "[0.5, 0.5, -1e39], expected numbers within the range of float32"),
    ] {
        let file = example(Basis::Sh9).with(key, npy(c("<f8"), &[3], &numbers));
        assert_rejected(&file, value, &format!("{key}: found {found}"));
    }
}

#[test]
fn gaussians_are_rejected_by_name() {
    for format in ["SG25", "ASG8"] {
        let file = example(Basis::Sh9).with("data_format", npz::text("<U4", format));
        let message = format!(
            "data_format: found {format}, expected RGBA, SH1, SH4, SH9, SH16 or SH25: spherical and anisotropic \
             Gaussians are not supported"
        );
        assert_rejected(&file, |fault| matches!(fault, ReadFault::Gaussians { .. }), &message);
    }
}

#[test]
fn unusable_numbers_are_rejected_in_leaves_that_count() {
    let value = |fault: &ReadFault| matches!(fault, ReadFault::Value { .. });
    let (shape, width) = (npz::data_shape(Basis::Sh9), 28);
    let leaf = 8 + 1; // node 1, cell 1
    assert!(npz::child()[leaf] == 0.0 && npz::sigma()[leaf] > 0.01);
    for (place, descr, number, found, expected) in [
        (27, "<f2", f64::NAN, "NaN", "a density within the range of float32"),
        (27, "<f4", f64::NEG_INFINITY, "-inf", "a density within the range of float32"),
        (27, "<f8", 1e39, "1000000000000000000000000000000000000000", "a density within the range of float32"),
        (26, "<f2", f64::NAN, "NaN", "a coefficient from -65504 to 65504"),
        (0, "<f2", f64::INFINITY, "inf", "a coefficient from -65504 to 65504"),
        (13, "<f4", 65505.0, "65505", "a coefficient from -65504 to 65504"),
        (13, "<f8", -1e5, "-100000", "a coefficient from -65504 to 65504"),
    ] {
        let mut data = npz::data(Basis::Sh9);
        data[leaf * width + place] = number;
        for layout in [c(descr), fortran(descr)] {
            let file = example(Basis::Sh9).with("data", npy(layout, &shape, &data));
            let message = format!("data: found {found} at node 1, cell 1, expected {expected}");
            assert_rejected(&file, value, &message);
        }
    }
    // svox rounds what half floats cannot hold to infinity.
    let mut data = npz::data(Basis::Sh9);
    data[leaf * width + 27] = f64::INFINITY;
    for descr in ["<f2", "<f4", "<f8"] {
        for layout in [c(descr), fortran(descr)] {
            let field = read(&example(Basis::Sh9).with("data", npy(layout, &shape, &data)).stored()).unwrap();
            assert_eq!(field.densities().iter().copied().fold(0.0, f32::max), 65504.0);
        }
    }
    let empty = 1;
    assert_eq!(npz::sigma()[empty], 0.75);
    let mut data = npz::data(Basis::Sh9);
    data[empty * width + 27] = -1.0;
    data[empty * width] = f64::NAN;
    let file = example(Basis::Sh9).with("data", npy(c("<f2"), &shape, &data));
    assert!(read(&file.stored()).is_ok(), "coefficients of empty leaves do not matter");

    let mut map = vec![0.0; 9 * CELLS];
    map[2 * CELLS + leaf] = 48.0;
    let file = || quantized(Basis::Sh9, 0, CELLS, c("<f2"), c("<u2"));
    let message = "quant_map: found 48 at node 1, cell 1, expected a row of quant_colors, 0 to 47";
    let map_shape = [9, NODES, 2, 2, 2];
    let flat = npy(c("<f2"), &[9, 48, 3], &vec![1.0; 9 * 48 * 3]);
    let bad = file().with("quant_colors", flat).with("quant_map", npy(c("<u2"), &map_shape, &map));
    assert_rejected(&bad, value, message);
    let colors = npy(c("<f4"), &[9, 1, 3], &[1e6; 27]);
    let bad = file().with("quant_colors", colors).with("quant_map", npy(c("<u2"), &map_shape, &[0.0; 9 * CELLS]));
    let message = "quant_colors: found NaN in row 0 of function 0, expected a coefficient from -65504 to 65504";
    assert_rejected(&bad, value, message);
}

#[test]
fn headers_that_lie_are_rejected() {
    let with = |key: &str, npy| example(Basis::Sh9).with(key, npy);
    let member = |fault: &ReadFault| matches!(fault, ReadFault::Member { .. });
    let broken = |version, header: &str| with("child", npz::npy_with_header(version, header, &[0; 64]));
    let unparsed = "child: found a malformed npy header, expected a complete npy array";
    for header in [
        "",
        "{}",
        "{'descr': '<i4', 'fortran_order': False, }",
        "{'descr': '<i4', 'fortran_order': 1, 'shape': (6, 2, 2, 2), }",
        "{'descr': '<i4', 'fortran_order': False, 'shape': (-6, 2, 2, 2), }",
        "{'descr': '<i4', 'fortran_order': False, 'shape': (99999999999999999999999, 2, 2, 2), }",
        "{'descr': '<i99999999999999999999999', 'fortran_order': False, 'shape': (6, 2, 2, 2), }",
        "{'descr': '', 'fortran_order': False, 'shape': (6, 2, 2, 2), }",
        &format!("{{'descr': '<i4', 'fortran_order': False, 'shape': ({}), }}", "1, ".repeat(65)),
        &"{'descr': ".repeat(5000),
        &format!("{{'descr': {}", "[".repeat(60000)),
    ] {
        assert_rejected(&broken(1, header), member, unparsed);
    }
    assert_rejected(&broken(9, "{}"), member, "child: found npy version 9, expected a complete npy array");
    assert_rejected(&with("child", vec![]), member, "child: found an unexpected end, expected a complete npy array");
    assert_rejected(&with("child", vec![7; 99]), member, "child: found no npy header, expected a complete npy array");
    let mut absurd = npz::npy_with_header(2, "{}", &[]);
    absurd[8..12].fill(0xff);
    let message = "child: found an npy header of 4294967295 bytes, expected a complete npy array";
    assert_rejected(&with("child", absurd), member, message);

    let shape = |fault: &ReadFault| matches!(fault, ReadFault::Shape { .. });
    for nodes in [7usize, 1 << 27, 1 << 61] {
        let npy = npz::npy_with_header(1, &npz::header(c("<i4"), &[nodes, 2, 2, 2]), &[0; 6 * 32]);
        let size = npy.len();
        let message = format!("child: found shape [{nodes}, 2, 2, 2], expected a shape that fits in {size} bytes");
        assert_rejected(&with("child", npy), shape, &message);
    }
}

/// Asserts how the example is rejected after `change` to its bytes.
fn assert_changed_rejected(what: &str, change: impl Fn(&mut Vec<u8>), message: &str) {
    let mut bytes = example(Basis::Sh9).zip(CompressionMethod::Deflated);
    change(&mut bytes);
    let error = read(&bytes).unwrap_err().to_string();
    assert!(error.starts_with("test.npz: ") && error.contains(message), "{what}: {error}");
    assert!(!error.contains('\n'));
}

#[test]
fn files_that_are_not_archives_are_rejected() {
    assert_changed_rejected("nothing", Vec::clear, "found an empty file, expected an npz archive or a packed field");
    let text = |bytes: &mut Vec<u8>| *bytes = b"{\"not\": \"a zip\"}".repeat(9000);
    assert_changed_rejected(
        "text",
        text,
        "found no zip directory at the end, expected an npz archive or a packed field",
    );
    assert_changed_rejected("half", |bytes| bytes.truncate(bytes.len() / 2), "at the end (the file is truncated)");
    assert_changed_rejected(
        "a byte short",
        |bytes| bytes.truncate(bytes.len() - 1),
        "found no zip directory at the end",
    );
    let comment = |bytes: &mut Vec<u8>| *bytes.last_mut().unwrap() = 1;
    assert_changed_rejected("a comment that is not there", comment, "a truncated zip directory");
    let many = |bytes: &mut Vec<u8>| {
        let end = bytes.len() - 22;
        bytes[end + 8..end + 12].fill(0xff);
    };
    assert_changed_rejected("many members", many, "found a zip directory with 65535 members");
    // A zip64 directory that claims to be where the file has other content.
    let zip64 = |bytes: &mut Vec<u8>| {
        let end = bytes.split_off(bytes.len() - 22);
        bytes.extend(b"PK\x06\x07\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0");
        bytes.extend(end);
    };
    assert_changed_rejected("zip64", zip64, "found a misplaced zip64 directory");
    let zip64 = |bytes: &mut Vec<u8>| {
        let end = bytes.split_off(bytes.len() - 22);
        let place = (bytes.len() as u64).to_le_bytes();
        bytes.extend(b"PK\x06\x06\x2c\0\0\0\0\0\0\0");
        bytes.extend([0; 12]);
        bytes.extend([0xff; 32]);
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend(place);
        bytes.extend([1, 0, 0, 0]);
        bytes.extend(end);
    };
    assert_changed_rejected("zip64 members", zip64, "found a zip directory with 18446744073709551615 members");
}

#[test]
fn members_that_promise_too_much_are_rejected() {
    let entry = |bytes: &mut Vec<u8>, key, at: usize, value: &[u8]| {
        let place = npz::directory_entry(bytes, key) + at;
        bytes[place..place + value.len()].copy_from_slice(value);
    };
    let expected = "expected a plausible compression ratio";
    for key in ["child", "data", "offset", "data_format"] {
        let huge = |bytes: &mut Vec<u8>| entry(bytes, key, 24, &0xfff0_0000u32.to_le_bytes());
        assert_changed_rejected("a huge array", huge, &format!("{key}: found 4293918720 bytes compressed to "));
        assert_changed_rejected("a huge array", huge, expected);
        let both = |bytes: &mut Vec<u8>| entry(bytes, key, 20, &[0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x7f]);
        assert_changed_rejected("more than the file", both, &format!("{key}: found 2147483647 bytes in a file of "));
    }
    let locked = |bytes: &mut Vec<u8>| entry(bytes, "child", 8, &[1]);
    assert_changed_rejected(
        "encrypted",
        locked,
        "child: found an encrypted member, expected a stored or deflated array",
    );
    // An AES record, without the flag that goes with it.
    let aes = |bytes: &mut Vec<u8>| entry(bytes, "child", 46 + "child.npy".len(), &[0x01, 0x99]);
    assert_changed_rejected("AES", aes, "child: found an encrypted member, expected a stored or deflated array");
    for (method, name) in [(12, "Bzip2"), (93, "Zstd"), (14, "")] {
        let packed = |bytes: &mut Vec<u8>| entry(bytes, "child", 10, &[method, 0]);
        assert_changed_rejected("another compression", packed, name);
        assert_changed_rejected("another compression", packed, "expected a stored or deflated array");
    }
    let moved = |bytes: &mut Vec<u8>| entry(bytes, "child", 42, &[0xf0, 0xff, 0xff, 0xff]);
    assert_changed_rejected("a member outside the file", moved, "child: found an unexpected end");
    let checksum = |bytes: &mut Vec<u8>| entry(bytes, "child", 16, &[1, 2, 3, 4]);
    assert_changed_rejected(
        "another checksum",
        checksum,
        "child: found a wrong checksum, expected a complete npy array",
    );
}

/// A file that counts the bytes that are read from it.
struct Counted<'a> {
    file: Cursor<&'a [u8]>,
    bytes: usize,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        self.bytes += read;
        Ok(read)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Content beyond the size that a member claims is not read, no matter how much it inflates to.
#[test]
fn members_are_inflated_to_their_claimed_size_only() {
    let header = npz::header(c("<f4"), &[3]);
    let content = [0.5f32, 0.375, 0.0].into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let honest = npz::npy_with_header(1, &header, &content);
    let claimed = honest.len() as u32;
    for (extra, what) in [(1usize, "a byte"), (1 << 28, "a quarter of a gigabyte")] {
        let mut arrays = example(Basis::Sh1).with("offset", honest.clone());
        arrays.0.last_mut().unwrap().1.resize(claimed as usize + extra, 0);
        let mut bytes = arrays.zip(CompressionMethod::Deflated);
        drop(arrays);
        let entry = npz::directory_entry(&bytes, "offset");
        bytes[entry + 24..entry + 28].copy_from_slice(&claimed.to_le_bytes());
        let mut file = Counted { file: Cursor::new(&bytes[..]), bytes: 0 };
        let error = PlenOctree::read_from(&mut file, "test.npz", &LoadSettings::default()).unwrap_err();
        let message = format!(
            "test.npz: offset: found more than the {claimed} bytes that it claims, expected a complete npy array"
        );
        assert_eq!(error.to_string(), message, "{what}");
        // The directory, and one buffer of the member: not the 260 KB to which a quarter of a gigabyte deflates.
        assert!(file.bytes < 1 << 17, "{what} took {} bytes of the file", file.bytes);
    }
    let mut bytes = example(Basis::Sh1).zip(CompressionMethod::Deflated);
    let entry = npz::directory_entry(&bytes, "offset");
    bytes[entry + 24] += 1;
    assert!(read(&bytes).unwrap_err().to_string().contains("offset: found an unexpected end"));
}

#[test]
fn overlapping_members_are_rejected() {
    let overlap = |key: &'static str, other: &'static str| {
        move |bytes: &mut Vec<u8>| {
            let place = npz::directory_entry(bytes, other) + 42;
            let start: [u8; 4] = bytes[place..place + 4].try_into().unwrap();
            let place = npz::directory_entry(bytes, key) + 42;
            bytes[place..place + 4].copy_from_slice(&start);
        }
    };
    let message = "expected an npz archive or a packed field";
    assert_changed_rejected("the same bytes", overlap("offset", "invradius3"), message);
    assert_changed_rejected("the same bytes", overlap("offset", "invradius3"), "found the overlapping members ");
    // A member that reaches into the next one: from the first header on, to a byte beyond the second.
    let longer = |bytes: &mut Vec<u8>| {
        let place = npz::directory_entry(bytes, "invradius3") + 20;
        let packed = u32::from_le_bytes(bytes[place..place + 4].try_into().unwrap());
        bytes[place..place + 4].copy_from_slice(&(packed + 1).to_le_bytes());
    };
    assert_changed_rejected("a byte", longer, "found the overlapping members invradius3.npy and offset.npy, expected");
}

/// Adds the child offsets of a tree in which all cells are divided, `levels` deep, in depth-first order.
fn divide(levels: u32, child: &mut Vec<f64>) {
    let node = child.len() / 8;
    child.extend([0.0; 8]);
    for cell in 0..if levels > 1 { 8 } else { 0 } {
        child[8 * node + cell] = (child.len() / 8 - node) as f64;
        divide(levels - 1, child);
    }
}

/// A file of less than a megabyte does not become a field of more than a gigabyte, but one as large as an even field
/// may be.
#[test]
fn fields_that_are_far_larger_than_their_files_are_rejected() {
    let coded = |levels: u32| {
        let mut child = vec![0.0; 8];
        for cell in 0..4 {
            child[cell] = (child.len() / 8) as f64;
            divide(levels, &mut child);
        }
        let nodes = child.len() / 8;
        let content = f16::ONE.to_le_bytes().repeat(8 * nodes);
        let sigma = npz::npy_with_header(1, &npz::header(c("<f2"), &[nodes, 2, 2, 2]), &content);
        let tree = example(Basis::Sh25).with("child", npy(c("<i4"), &[nodes, 2, 2, 2], &child));
        let file = tree.without("data").with("sigma", sigma).zip(CompressionMethod::Deflated);
        assert!(file.len() < 1 << 20);
        read(&file).unwrap_err()
    };
    let error = coded(7);
    assert!(matches!(error.fault, ReadFault::Member { key: "quant_map", .. }), "{error}");
    assert!(error.to_string().contains("expected a plausible compression ratio"), "{error}");
    let error = coded(6);
    assert!(matches!(error.fault, ReadFault::Missing { key: "quant_colors", .. }), "{error}");
}

/// The same leaves with another basis of as many coefficients.
fn with_basis(field: &PlenOctree, basis: Basis) -> PlenOctree {
    let (nodes, densities) = (field.nodes().to_vec(), field.densities().to_vec());
    let (activation, coefficients) = (basis.default_activation(), field.coefficients().to_vec());
    PlenOctree::new(field.frame(), basis, activation, field.up(), nodes, densities, coefficients).unwrap()
}

proptest! {
    #[test]
    fn changed_bytes_give_a_field_or_an_error(
        basis in prop::sample::select(vec![Basis::Rgba, Basis::Sh1, Basis::Sh4]),
        packed in any::<bool>(),
        coded in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0u8..8), 0..6),
        end in any::<prop::sample::Index>(),
        cut in prop::bool::weighted(0.2),
    ) {
        let arrays = if coded { quantized(basis, 0, CELLS, c("<f2"), c("<u2")) } else { example(basis) };
        let method = if packed { CompressionMethod::Deflated } else { CompressionMethod::Stored };
        let mut bytes = arrays.zip(method);
        let unchanged = read(&bytes).unwrap();
        for (at, bit) in changes {
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        match read(&bytes) {
            // Checksums reveal every change of the content, so only names, times and the like can change. Of these,
            // only the name of `data_format` matters: without it, four values are a color.
            Ok(field) if basis == Basis::Sh1 && field.basis() == Basis::Rgba => {
                assert_same(&with_basis(&unchanged, Basis::Rgba), &field, "without data_format");
            }
            Ok(field) => assert_same(&unchanged, &field, "changed"),
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }

    #[test]
    fn changed_arrays_give_a_field_or_an_error(
        key in prop::sample::select(vec!["data_dim", "child", "invradius3", "offset", "data", "data_format"]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut arrays = example(Basis::Sh1);
        if let Some((_, npy)) = arrays.0.iter_mut().find(|(other, _)| other == key) {
            for (at, byte) in changes {
                let at = at.index(npy.len());
                npy[at] = byte;
            }
        }
        // The checksums match the changed arrays, so this tests the reading of arrays.
        match read(&arrays.stored()) {
            Ok(field) => {
                let leaves: Vec<u32> = field.leaf_cells().map(|cell| cell.leaf).collect();
                prop_assert!(leaves.into_iter().eq(0..field.leaves() as u32));
                let least = LoadSettings::default().density_threshold_in(field.frame());
                prop_assert!(field.densities().iter().all(|density| *density >= least && density.is_finite()));
                prop_assert!(field.coefficients().iter().all(|k| k.is_finite()));
                assert_same(&field, &read(&written(&field)).unwrap(), "written");
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }
}
