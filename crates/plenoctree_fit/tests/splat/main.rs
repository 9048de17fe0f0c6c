//! Captures: every format gives the same Gaussians, and damaged files give errors.

mod damage;
mod formats;
mod voxels;

use std::{fs, io, path::Path};

use formats::{GltfFormat, PlyFormat, glb, gltf, packed_ply, ply, sog, sog_bundle, splat, spz, zip};
use glam::{DAffine3, DMat3, DQuat, DVec3, Quat, Vec3};
use plenoctree_fit::splat::{Axis, Gaussian, SplatError, SplatSettings, Splats, SpzAxes};
use proptest::prelude::*;
use serde_json::json;

fn read(bytes: &[u8]) -> Result<Splats, SplatError> {
    read_as(bytes, "capture")
}

fn read_as(bytes: &[u8], name: &str) -> Result<Splats, SplatError> {
    let none = &mut |_: &str| Err(io::ErrorKind::NotFound.into());
    Splats::from_bytes(bytes, name, &SplatSettings::default(), none)
}

/// Random Gaussians, with numbers that all formats can store.
fn splats() -> impl Strategy<Value = Splats> {
    let vector = |low: f32, high: f32| prop::array::uniform3(low..high).prop_map(Vec3::from_array);
    let shape = (vector(-3.0, 3.0), vector(-6.0, -0.1), prop::array::uniform4(-1.0f32..1.0), 0.02f32..0.98);
    let one = (shape, prop::collection::vec(vector(-0.6, 0.6), 16));
    (0u32..4, prop::collection::vec(one, 1..100)).prop_map(|(degree, all)| {
        let mut splats = Splats::new(degree);
        for ((position, scale, rotation, opacity), color) in all {
            let rotation = Quat::from_array(rotation);
            let rotation = if rotation.length() > 0.1 { rotation.normalize() } else { Quat::IDENTITY };
            let scale = Vec3::from_array(scale.to_array().map(f32::exp));
            splats.push(Gaussian { position, scale, rotation, opacity }, &color[..(degree as usize + 1).pow(2)]);
        }
        splats
    })
}

/// The tolerances of numbers.
#[derive(Clone, Copy)]
struct Tolerance {
    position: f32,
    /// Of the logarithm.
    scale: f32,
    /// In radians.
    rotation: f32,
    opacity: f32,
    color: f32,
    harmonics: f32,
}

const FLOAT: Tolerance =
    Tolerance { position: 1e-5, scale: 1e-4, rotation: 2e-3, opacity: 1e-5, color: 1e-5, harmonics: 1e-5 };
const SPZ: Tolerance =
    Tolerance { position: 1.3e-4, scale: 0.032, rotation: 6e-3, opacity: 2e-3, color: 0.0132, harmonics: 7e-3 };
const SOG: Tolerance =
    Tolerance { position: 3e-4, scale: 0.013, rotation: 2.5e-2, opacity: 1.1e-2, color: 4e-3, harmonics: 4e-3 };
const PACKED_PLY: Tolerance =
    Tolerance { position: 3.5e-3, scale: 3.5e-3, rotation: 4e-3, opacity: 2.1e-3, color: 7.2e-3, harmonics: 0.0162 };
const SPLAT: Tolerance =
    Tolerance { position: 1e-6, scale: 1e-5, rotation: 3e-2, opacity: 2.1e-3, color: 7.2e-3, harmonics: 0.0 };

fn check(found: &Splats, expected: &Splats, tolerance: Tolerance) {
    assert_eq!((found.len(), found.degree(), found.dropped()), (expected.len(), expected.degree(), 0));
    for (index, (a, b)) in found.gaussians().iter().zip(expected.gaussians()).enumerate() {
        assert!((a.position - b.position).abs().max_element() < tolerance.position, "{index}: {a:?} {b:?}");
        for axis in 0..3 {
            assert!((a.scale[axis].ln() - b.scale[axis].ln()).abs() < tolerance.scale, "{index}: {a:?} {b:?}");
        }
        assert!(
            a.rotation.is_normalized() && a.rotation.angle_between(b.rotation) < tolerance.rotation,
            "{index}: {a:?} {b:?}"
        );
        assert!((a.opacity - b.opacity).abs() < tolerance.opacity, "{index}: {a:?} {b:?}");
        for (k, (a, b)) in found.coefficients(index).iter().zip(expected.coefficients(index)).enumerate() {
            let most = if k == 0 { tolerance.color } else { tolerance.harmonics };
            assert!((a - b).abs().max_element() < most, "{index}, {k}: {a} {b}");
        }
    }
}

/// From the axes of `.ply` files to those of SPZ, and to those of glTF.
fn turned(splats: &Splats, axes: [f64; 3]) -> Splats {
    splats.transformed(DAffine3::from_scale(DVec3::from_array(axes)))
}

const TO_SPZ: [f64; 3] = [1.0, -1.0, -1.0];
const TO_GLTF: [f64; 3] = [-1.0, -1.0, 1.0];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The same capture through each reader is the same, within what each format can store.
    #[test]
    fn every_format_gives_the_same_gaussians(splats in splats()) {
        for format in [PlyFormat::Ascii, PlyFormat::Little, PlyFormat::Big, PlyFormat::Strange] {
            check(&read(&ply(&splats, format)).unwrap(), &splats, FLOAT);
        }
        for has_color_range in [false, true] {
            check(&read(&packed_ply(&splats, has_color_range)).unwrap(), &splats, PACKED_PLY);
        }
        let mut flat = Splats::new(0);
        for (index, gaussian) in splats.gaussians().iter().enumerate() {
            flat.push(*gaussian, &splats.coefficients(index)[..1]);
        }
        check(&read_as(&splat(&splats), "capture.splat").unwrap(), &flat, SPLAT);
        for version in [2, 3, 4] {
            let tolerance = if version == 2 { Tolerance { rotation: 0.25, ..SPZ } } else { SPZ };
            check(&read(&spz(&turned(&splats, TO_SPZ), version, None)).unwrap(), &splats, tolerance);
            // Right, down and front; left, up and front; right, front and up.
            check(&read(&spz(&splats, version, Some(6))).unwrap(), &splats, tolerance);
            check(&read(&spz(&turned(&splats, TO_GLTF), version, Some(7))).unwrap(), &splats, tolerance);
            let up = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
            check(&read(&spz(&splats.transformed(up), version, Some(12))).unwrap(), &splats, tolerance);
        }
        let settings = SplatSettings { spz_axes: SpzAxes::RightDownFront };
        let none = &mut |_: &str| Err(io::ErrorKind::NotFound.into());
        check(&Splats::from_bytes(&spz(&splats, 4, None), "capture", &settings, none).unwrap(), &splats, SPZ);
        for version in [1, 2] {
            check(&read(&sog_bundle(&splats, version)).unwrap(), &splats, SOG);
        }
        for format in [GltfFormat::Floats, GltfFormat::Integers, GltfFormat::Spz] {
            let (document, buffer) = gltf(&turned(&splats, TO_GLTF), format, json!([{"mesh": 0}]));
            let tolerance = match format {
                GltfFormat::Floats => FLOAT,
                GltfFormat::Integers => Tolerance { scale: 4e-3, opacity: 2e-3, ..FLOAT },
                GltfFormat::Spz => SPZ,
            };
            check(&read(&glb(&document, &buffer)).unwrap(), &splats, tolerance);
        }
    }

    /// Transforms of nodes, one below the other, move, turn and scale the Gaussians, also by axis.
    #[test]
    fn nodes_transform_their_gaussians(
        splats in splats(),
        turn in prop::array::uniform4(-1.0f64..1.0),
        shift in prop::array::uniform3(-2.0f64..2.0),
        scale in prop::array::uniform3(0.2f64..3.0),
    ) {
        let turn = DQuat::from_array(turn);
        prop_assume!(turn.length() > 0.1);
        let turn = turn.normalize();
        let (document, buffer) = gltf(&turned(&splats, TO_GLTF), GltfFormat::Floats, json!([
            {"children": [1], "rotation": turn.to_array(), "translation": shift},
            {"mesh": 0, "matrix": [scale[0], 0.0, 0.0, 0.0, 0.0, scale[1], 0.0, 0.0, 0.0, 0.0, scale[2], 0.0, 0.0, 0.0, 0.0, 1.0]},
        ]));
        let found = read(&glb(&document, &buffer)).unwrap();
        let axes = DMat3::from_diagonal(DVec3::from_array(TO_GLTF));
        let linear = axes * DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::from_array(scale)) * axes;
        for (index, (a, b)) in found.gaussians().iter().zip(splats.gaussians()).enumerate() {
            let at = linear * b.position.as_dvec3() + axes * DVec3::from_array(shift);
            prop_assert!((a.position.as_dvec3() - at).abs().max_element() < 1e-4);
            let covariance = |gaussian: &Gaussian, linear: DMat3| {
                let axes = DMat3::from_quat(gaussian.rotation.as_dquat().normalize());
                let shape = linear * axes * DMat3::from_diagonal(gaussian.scale.as_dvec3());
                shape * shape.transpose()
            };
            let (found_shape, expected) = (covariance(a, DMat3::IDENTITY), covariance(b, linear));
            let size = expected.to_cols_array().iter().fold(0.0f64, |size, x| size.max(x.abs()));
            let difference = (found_shape - expected).to_cols_array();
            prop_assert!(difference.iter().all(|x| x.abs() < 1e-4 * size), "{index}: {found_shape} {expected}");
            // Seen along the turned direction, the color is the same.
            let look = DVec3::new(0.48, -0.6, 0.64);
            let turned = axes * (turn * (axes * look));
            prop_assert!((found.color(index, turned) - splats.color(index, look)).abs().max_element() < 1e-4);
        }
    }
}

/// A capture of a few Gaussians.
pub fn small(degree: u32) -> Splats {
    let mut splats = Splats::new(degree);
    for index in 0..5 {
        let at = |step: f32| (step * index as f32 + 0.3).sin();
        let gaussian = Gaussian {
            position: Vec3::new(at(0.7), at(1.3), at(2.9)),
            scale: Vec3::new(0.02, 0.05, 0.1 + 0.05 * at(1.1)),
            rotation: Quat::from_xyzw(at(0.4), at(1.9), at(0.8), 1.0).normalize(),
            opacity: 0.5 + 0.4 * at(2.3),
        };
        let color: Vec<Vec3> =
            (0..16).map(|k| 0.5 * Vec3::new(at(0.2 * k as f32), at(0.3), at(0.5 + k as f32))).collect();
        splats.push(gaussian, &color[..(degree as usize + 1).pow(2)]);
    }
    splats
}

/// Folders of SOG, and glTF files with buffers next to them, are read from their folder, and nothing else is.
#[test]
fn files_next_to_captures_are_read() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("splat-beside");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let splats = small(2);
    for (name, content) in sog(&splats, 2) {
        fs::write(folder.join(name), content).unwrap();
    }
    let settings = SplatSettings::default();
    check(&Splats::read(&folder, &settings).unwrap(), &splats, SOG);
    check(&Splats::read(folder.join("meta.json"), &settings).unwrap(), &splats, SOG);
    fs::remove_file(folder.join("quats.webp")).unwrap();
    let message = Splats::read(&folder, &settings).unwrap_err().to_string();
    assert!(message.contains("meta.json") && message.contains("quats.webp"), "{message}");

    let (mut document, buffer) = gltf(&turned(&splats, TO_GLTF), GltfFormat::Floats, json!([{"mesh": 0}]));
    fs::write(folder.join("the numbers.bin"), &buffer).unwrap();
    document["buffers"][0]["uri"] = json!("the%20numbers.bin");
    fs::write(folder.join("capture.gltf"), document.to_string()).unwrap();
    check(&Splats::read(folder.join("capture.gltf"), &settings).unwrap(), &splats, FLOAT);
    document["buffers"][0]["uri"] = json!("../capture.bin");
    fs::write(folder.join("capture.gltf"), document.to_string()).unwrap();
    let message = Splats::read(folder.join("capture.gltf"), &settings).unwrap_err().to_string();
    assert!(message.contains("../capture.bin") && message.contains("same folder"), "{message}");
    let text: String = buffer.chunks(3).map(base64).collect();
    document["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{text}"));
    check(&read(document.to_string().as_bytes()).unwrap(), &splats, FLOAT);
}

fn base64(bytes: &[u8]) -> String {
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bits = (0..3).fold(0u32, |bits, index| bits << 8 | u32::from(*bytes.get(index).unwrap_or(&0)));
    let letter = |index: usize| {
        if index <= bytes.len() { letters[(bits >> (18 - 6 * index)) as usize & 63] as char } else { '=' }
    };
    (0..4).map(letter).collect()
}

/// Gaussians with damaged numbers are left out and counted. If all are damaged, that is an error.
#[test]
fn damaged_gaussians_are_left_out() {
    let splats = small(1);
    let mut bytes = ply(&splats, PlyFormat::Little);
    let row = bytes.len() - 1 - 5 * 4 * 23;
    for (index, damage) in [f32::NAN, f32::INFINITY, 1e30].into_iter().enumerate() {
        bytes[row + index * 92..][..4].copy_from_slice(&damage.to_le_bytes());
    }
    // No rotation at all is none, not damage.
    bytes[row + 3 * 92 + 76..][..16].fill(0);
    let found = read(&bytes).unwrap();
    assert_eq!((found.len(), found.dropped()), (2, 3));
    assert_eq!(found.gaussians()[0].rotation, Quat::IDENTITY);
    assert!((found.gaussians()[0].position - splats.gaussians()[3].position).length() < 1e-6);
    for index in 3..5 {
        bytes[row + index * 92..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    }
    let message = read(&bytes).unwrap_err().to_string();
    assert!(message.contains("found 5, all with damaged numbers"), "{message}");
}

/// Degrees in which every coefficient is 0 are dropped.
#[test]
fn empty_degrees_are_dropped() {
    let mut wide = Splats::new(3);
    let narrow = small(1);
    for (index, gaussian) in narrow.gaussians().iter().enumerate() {
        wide.push(*gaussian, narrow.coefficients(index));
    }
    assert_eq!((wide.degree(), read(&ply(&wide, PlyFormat::Little)).unwrap().degree()), (3, 1));
    check(&read(&ply(&wide, PlyFormat::Little)).unwrap(), &narrow, FLOAT);
}

/// Only SPZ files may lack their axes.
#[test]
fn assumed_axes_are_known() {
    let mut splats = Splats::new(0);
    let gaussian = Gaussian { position: Vec3::ONE, scale: Vec3::splat(0.1), rotation: Quat::IDENTITY, opacity: 0.5 };
    splats.push(gaussian, &[Vec3::ZERO]);
    for (bytes, expected) in [
        (spz(&splats, 3, None), true),
        (spz(&splats, 4, None), true),
        (spz(&splats, 4, Some(6)), false),
        (ply(&splats, PlyFormat::Little), false),
    ] {
        let known = SplatSettings { spz_axes: SpzAxes::RightUpBack };
        let none = &mut |_: &str| Err(io::ErrorKind::NotFound.into());
        assert_eq!(read(&bytes).unwrap().assumes_axes(), expected);
        assert!(!Splats::from_bytes(&bytes, "capture", &known, none).unwrap().assumes_axes());
    }
}

/// Comments of PLY files, a flag of SPZ and keys of SOG say that a capture was trained with antialiasing.
#[test]
fn antialiased_captures_are_known() {
    let splats = small(1);
    let commented = |comments: &str| {
        let text = String::from_utf8_lossy(&ply(&splats, PlyFormat::Ascii)).replace("comment by hand\n", comments);
        read(text.as_bytes()).unwrap()
    };
    for (comments, expected) in [
        ("", false),
        ("comment SplatRenderMode: mip\n", true),
        ("comment Exported from Brush\ncomment SplatRenderMode: default\n", false),
        ("comment antialiased 1\n", true),
        ("comment antialiased 0\n", false),
        ("comment postshot.anti_aliasing=1\n", true),
    ] {
        assert_eq!(commented(comments).antialiased(), expected, "{comments}");
    }
    let mut bytes = spz(&turned(&splats, TO_SPZ), 4, Some(4));
    assert!(!read(&bytes).unwrap().antialiased());
    bytes[14] |= 1;
    let flagged = read(&bytes).unwrap();
    assert!(flagged.antialiased());
    assert!(turned(&flagged, TO_GLTF).antialiased() && flagged.filtered(|_| true).antialiased());
    let mut files = sog(&splats, 2);
    assert!(!read(&zip(&files)).unwrap().antialiased());
    for (key, value, expected) in [
        ("model", json!("antialiased"), true),
        ("model", json!("2dgs"), false),
        ("antialias", json!(true), true),
        ("antialias", json!(false), false),
        ("antialias", json!(null), false),
    ] {
        let mut meta: serde_json::Value = serde_json::from_slice(&files[0].1).unwrap();
        meta[key] = value;
        files[0].1 = meta.to_string().into_bytes();
        assert_eq!(read(&zip(&files)).unwrap().antialiased(), expected);
    }
}

/// Raw files of Mip-Splatting keep the width of their 3D filter apart. It widens Gaussians, whose opacity falls as their
/// volume grows, and the capture is antialiased.
#[test]
fn filters_of_mip_splatting_are_applied() {
    let splats = small(0);
    let widths = [0.0, 0.02, 0.3, 5.0, 0.001];
    let text = String::from_utf8(ply(&splats, PlyFormat::Ascii)).unwrap();
    let (header, rows) = text.split_once("end_header\n").unwrap();
    let place = header.find("property float rot_0").unwrap();
    let column = header[header.find("element vertex").unwrap()..place].matches("property").count();
    let header = format!("{}property float filter_3D\n{}", &header[..place], &header[place..]);
    let rows: Vec<String> = (rows.lines().enumerate())
        .map(|(row, line)| {
            let mut words: Vec<String> = line.split_whitespace().map(String::from).collect();
            if let Some(width) = widths.get(row) {
                words.insert(column, width.to_string());
            }
            words.join(" ")
        })
        .collect();
    let found = read(format!("{header}end_header\n{}\n", rows.join("\n")).as_bytes()).unwrap();
    assert!(found.antialiased() && found.len() == 5);
    for ((found, raw), width) in found.gaussians().iter().zip(splats.gaussians()).zip(widths) {
        let square = |scale: Vec3| (scale * scale).as_dvec3();
        let expected = square(raw.scale) + f64::from(width as f32).powi(2);
        assert!((square(found.scale) / expected - 1.0).abs().max_element() < 1e-4, "{found:?}");
        let ratio = (square(raw.scale) / expected).element_product().sqrt();
        assert!((f64::from(found.opacity) / (f64::from(raw.opacity) * ratio) - 1.0).abs() < 1e-4, "{found:?}");
    }
}

/// Comments of PLY files say which direction is up.
#[test]
fn the_direction_that_is_up_is_known() {
    for (comment, expected) in [
        ("by hand", None),
        ("Vertical Axis: z", Some(Axis::Z)),
        ("Vertical axis: y", Some(Axis::NegativeY)),
        ("Vertical axis: 0.1 -0.9 0.2", Some(Axis::NegativeY)),
        ("Vertical axis: 0.02 -0.1 -0.99", Some(Axis::NegativeZ)),
        ("Vertical axis: 0 0 0", None),
        ("Vertical axis: 1 NaN 0", None),
        ("Vertical axis: north", None),
    ] {
        let text = String::from_utf8_lossy(&ply(&small(0), PlyFormat::Ascii)).replace("by hand", comment);
        assert_eq!(read(text.as_bytes()).unwrap().up(), expected, "{comment}");
    }
}

/// Scales in drafts of the glTF extension are logarithms, of which any are negative.
#[test]
fn scales_of_drafts_are_logarithms() {
    let splats = small(1);
    let (document, mut buffer) = gltf(&turned(&splats, TO_GLTF), GltfFormat::Floats, json!([{"mesh": 0}]));
    let scale = &document["meshes"][0]["primitives"][0]["attributes"]["KHR_gaussian_splatting:SCALE"];
    let view = &document["bufferViews"][scale.as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    for number in buffer[start..][..5 * 12].chunks_exact_mut(4) {
        let scale = f32::from_le_bytes([number[0], number[1], number[2], number[3]]);
        number.copy_from_slice(&scale.ln().to_le_bytes());
    }
    check(&read(&glb(&document, &buffer)).unwrap(), &splats, FLOAT);
}

/// JSON may start with a byte order mark.
#[test]
fn byte_order_marks_are_skipped() {
    let splats = small(1);
    let marked = |content: &[u8]| [b"\xef\xbb\xbf", content].concat();
    let mut files = sog(&splats, 2);
    files[0].1 = marked(&files[0].1);
    check(&read(&zip(&files)).unwrap(), &splats, SOG);
    let beside = &mut |name: &str| {
        let file = files.iter().find(|file| file.0 == name);
        file.map(|file| file.1.clone()).ok_or(io::ErrorKind::NotFound.into())
    };
    check(&Splats::from_bytes(&files[0].1, "meta.json", &SplatSettings::default(), beside).unwrap(), &splats, SOG);
    let (mut document, buffer) = gltf(&turned(&splats, TO_GLTF), GltfFormat::Floats, json!([{"mesh": 0}]));
    let text: String = buffer.chunks(3).map(base64).collect();
    document["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{text}"));
    check(&read(&marked(document.to_string().as_bytes())).unwrap(), &splats, FLOAT);
}
