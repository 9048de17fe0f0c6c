//! Damaged files: cut off, with flipped bits, and with headers that claim too much.

use glam::{DVec3, Vec3};
use plenoctree_fit::splat::{Gaussian, SplatSettings, Splats};
use serde_json::json;

use crate::{
    TO_GLTF, TO_SPZ,
    formats::{GltfFormat, PlyFormat, glb, gltf, gzip, packed_ply, ply, sog, sog_bundle, spz, zip},
    read, read_as, small, turned,
};

/// A small file of every kind, with whether its checksums or framing find every cut.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    let splats = small(1);
    let of_gltf = |format| {
        let (document, buffer) = gltf(&turned(&splats, TO_GLTF), format, json!([{"mesh": 0}]));
        glb(&document, &buffer)
    };
    vec![
        ("ply", ply(&splats, PlyFormat::Little)),
        ("strange ply", ply(&splats, PlyFormat::Strange)),
        ("ascii ply", ply(&splats, PlyFormat::Ascii)),
        ("packed ply", packed_ply(&splats, true)),
        ("spz 2", spz(&turned(&splats, TO_SPZ), 2, None)),
        ("spz 3", spz(&turned(&splats, TO_SPZ), 3, Some(4))),
        ("spz 4", spz(&turned(&splats, TO_SPZ), 4, Some(4))),
        ("sog", sog_bundle(&splats, 2)),
        ("sog 1", sog_bundle(&splats, 1)),
        ("glb", of_gltf(GltfFormat::Floats)),
        ("glb of integers", of_gltf(GltfFormat::Integers)),
        ("glb of spz", of_gltf(GltfFormat::Spz)),
    ]
}

/// Reads a damaged file: it is a valid capture, or an error of one line that names the file.
fn check(bytes: &[u8], what: &str) -> Option<Splats> {
    match read(bytes) {
        Ok(splats) => {
            assert!(!splats.is_empty(), "{what}");
            for (index, gaussian) in splats.gaussians().iter().enumerate() {
                assert!(gaussian.position.is_finite() && gaussian.scale.is_finite(), "{what}: {gaussian:?}");
                assert!(gaussian.rotation.is_normalized(), "{what}: {gaussian:?}");
                assert!((0.0..=1.0).contains(&gaussian.opacity), "{what}: {gaussian:?}");
                assert!(splats.color(index, DVec3::X).is_finite(), "{what}: {gaussian:?}");
            }
            Some(splats)
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("capture: ") && message.contains("expected"), "{what}: {message}");
            assert!(message.len() < 1000 && !message.contains(char::is_control), "{what}: {message}");
            None
        }
    }
}

/// Every file that is cut off is an error, except for what comes after the last number.
#[test]
fn files_that_are_cut_off_are_errors() {
    for (name, bytes) in files() {
        assert!(check(&bytes, name).is_some(), "{name}");
        for length in 0..bytes.len() {
            let found = check(&bytes[..length], &format!("{name} of {length} bytes"));
            // ASCII numbers can lack digits, and gzip and PLY have something after the last Gaussian.
            let behind = if name.contains("ply") { 20 } else { 64 };
            assert!(found.is_none() || length + behind >= bytes.len(), "{name}: {length} of {} bytes", bytes.len());
        }
    }
}

/// No flipped bit, and no byte that is replaced, makes a reader panic or allocate much.
#[test]
fn files_with_flipped_bits_are_valid_or_errors() {
    for (name, bytes) in files() {
        for place in 0..bytes.len() {
            for flip in [1, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[place] ^= flip;
                check(&damaged, &format!("{name}, byte {place} flipped by {flip:02x}"));
            }
        }
    }
}

/// Headers that claim more than there can be are errors.
#[test]
fn headers_that_claim_too_much_are_errors() {
    let splats = small(0);
    let fails = |bytes: &[u8], part: &str| {
        let message = read(bytes).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    };
    let ply_of = |count: &str| {
        let bytes = ply(&splats, PlyFormat::Little);
        let text = b"element vertex 5";
        let at = bytes.windows(text.len()).position(|window| window == text).unwrap();
        [&bytes[..at], format!("element vertex {count}").as_bytes(), &bytes[at + text.len()..]].concat()
    };
    fails(&ply_of("6"), "vertex: found 281 bytes, expected 336 bytes: the file is truncated");
    fails(&ply_of("18446744073709551615"), "expected 18446744073709551615 bytes");
    fails(&ply_of("99999999999999999999"), "expected a number of elements");

    // Zeros deflate well: a small file unpacks to a lot.
    let header = |version: u32, count: u32| {
        let rest = [version, count].into_iter().flat_map(u32::to_le_bytes).chain([0, 12, 0, 0]);
        b"NGSP".iter().copied().chain(rest).collect::<Vec<u8>>()
    };
    fails(&gzip(&[header(2, u32::MAX), vec![0; 1 << 24]].concat()), "expected at most");
    fails(
        &gzip(&[header(3, 1 << 20), vec![0; 1 << 20]].concat()),
        "positions: found 1048576 bytes, expected 9437184 bytes",
    );
    let mut streams = spz(&splats, 4, None);
    streams[8..12].copy_from_slice(&(1u32 << 20).to_le_bytes());
    fails(&streams, "stream 0: found 45 bytes, expected 9437184 bytes");

    let (mut document, buffer) = gltf(&splats, GltfFormat::Floats, json!([{"mesh": 0}]));
    document["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    fails(&glb(&document, &buffer), "extensionsRequired: found EXT_meshopt_compression");
    document["extensionsRequired"] = json!(["KHR_materials_unlit"]);
    document["accessors"][0]["count"] = json!(u64::MAX);
    fails(&glb(&document, &buffer), "POSITION: found 60 bytes with a stride of 12");
    let (document, buffer) = gltf(&splats, GltfFormat::Floats, json!([{"mesh": 0, "children": [0]}]));
    fails(&glb(&document, &buffer), "reached twice");
}

/// The checksum of a gzip stream counts, also if nothing else is wrong.
#[test]
fn wrong_checksums_are_errors() {
    for version in [2, 3] {
        let bytes = spz(&small(1), version, None);
        for place in bytes.len() - 8..bytes.len() - 4 {
            let mut damaged = bytes.clone();
            damaged[place] ^= 1;
            let message = read(&damaged).unwrap_err().to_string();
            assert!(message.contains("gzip stream"), "{message}");
        }
    }
}

/// A small file cannot ask for much: many nodes with damaged Gaussians, or many buffers that are one large file.
#[test]
fn work_and_memory_are_bounded() {
    let mut splats = Splats::new(0);
    for index in 0..4096 {
        let position = Vec3::new(index as f32, 0.0, 0.0);
        splats.push(Gaussian { position, ..small(0).gaussians()[0] }, &[Vec3::ONE]);
    }
    let nodes: Vec<_> = (1..=300).collect();
    let nodes = std::iter::once(json!({"children": nodes})).chain((0..300).map(|_| json!({"mesh": 0}))).collect();
    let (mut document, mut buffer) = gltf(&splats, GltfFormat::Floats, nodes);
    buffer[..4096 * 12].chunks_exact_mut(4).for_each(|number| number.copy_from_slice(&f32::NAN.to_le_bytes()));
    let message = read(&glb(&document, &buffer)).unwrap_err().to_string();
    assert!(message.contains("nodes: found 10") && message.contains("at most"), "{message}");

    document["buffers"] = (0..20).map(|_| json!({"uri": "large.bin", "byteLength": 1})).collect();
    let mut read = 0;
    let beside = &mut |_: &str| {
        read += 1;
        Ok(vec![0; 1 << 28])
    };
    let message = Splats::from_bytes(document.to_string().as_bytes(), "capture", &SplatSettings::default(), beside)
        .unwrap_err()
        .to_string();
    assert!(message.contains("buffers: found") && message.contains("at most 2 GiB in all"), "{message}");
    assert_eq!(read, 9);
}

/// Archives of several captures are named, unless one of them is in the first folder. So are formats that only others
/// read.
#[test]
fn other_formats_are_named() {
    let moved = |folder: &str| {
        let files = sog(&small(1), 2);
        files.into_iter().map(|(name, content)| (format!("{folder}{name}"), content)).collect::<Vec<_>>()
    };
    assert_eq!(read(&zip(&moved("one/"))).unwrap().len(), 5);
    let several = [moved("one/"), moved("two/")].concat();
    assert!(read(&zip(&several)).unwrap_err().to_string().contains("a streamed SOG"));
    assert_eq!(read(&zip(&[several, moved("")].concat())).unwrap().len(), 5);
    let streamed = [("lod-meta.json".to_string(), b"{}".to_vec())];
    assert!(read(&zip(&streamed)).unwrap_err().to_string().contains("a streamed SOG"));
    let others = [("notes.txt".to_string(), b"none".to_vec())];
    assert!(read(&zip(&others)).unwrap_err().to_string().contains("no meta.json"));
    assert!(read(&gzip(&ply(&small(0), PlyFormat::Little))).unwrap_err().to_string().contains("gunzip"));
    let message = read_as(&[0; 64], "capture.KSPLAT").unwrap_err().to_string();
    assert!(message.contains("a .ksplat file") && message.contains("splat-transform"), "{message}");
    let message = read_as(&[1; 63], "capture.splat").unwrap_err().to_string();
    assert!(message.contains("a .splat file of 63 bytes"), "{message}");
    // Numbers, not a byte order mark.
    assert!(read_as(&[&b"\xef\xbb\xbf"[..], &[0x3c; 61]].concat(), "capture.splat").is_ok());
}

/// Files that are not captures, or not supported ones, are named.
#[test]
fn other_files_are_named() {
    for (bytes, part) in [
        (&b""[..], "an empty file"),
        (b"solid stl", "[73, 6f, 6c, 69]"),
        (b"{\"a\": 1}", "neither `means` nor `asset`"),
        (b"{\"asset\": {}}", "none with Gaussians"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty uint packed_position\nend_header\n1\n",
            "no element `chunk`",
        ),
        (b"{\"lodLevels\": 3, \"filenames\": []}", "a streamed SOG"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "no property"),
        (b"ply\nformat ascii 1.0\nend_header\n", "no element `vertex`"),
        (b"ply\nformat middle_endian 1.0\nend_header\n", "`format middle_endian 1.0`"),
    ] {
        let message = read(bytes).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
}
