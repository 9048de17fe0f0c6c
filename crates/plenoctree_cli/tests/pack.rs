//! `plenoctree pack`.

mod common;

use std::process::Output;

use common::{ball, fail, folder, run, succeed, text};
use plenoctree::{
    BakeSettings, Basis, LoadSettings, PlenOctree, bake,
    sampling::{Progress, SamplingSettings, sample},
};

#[test]
fn a_field_is_packed_and_measured() {
    let folder = folder("pack");
    let source = ball(&folder);
    let printed = succeed(&["pack", text(&source), "--size", "40x40", "--views", "2", "--hidden", "0"]);
    assert!(!printed.contains("HEAD") && printed.contains("dB from the field in 2 views"), "{printed}");
    assert!(printed.contains("0 of ") && printed.contains("leaves dropped") && printed.contains("ball.plenoctree"));
    let read = |name: &str| PlenOctree::read(folder.join(name), &LoadSettings::default()).unwrap();
    let packed = read("ball.plenoctree");
    assert_eq!((packed.nodes(), packed.codebook().is_some()), (read("ball.npz").nodes(), true));
    assert!(succeed(&["info", text(&folder.join("ball.plenoctree"))]).contains("packed"));

    let quantized = folder.join("quantized.npz");
    let out = text(&folder).to_string() + "/again.plenoctree";
    let printed = succeed(&["pack", text(&source), "--exact", "--views", "0", "--verbose", "--out", &out]);
    assert!(printed.contains("sections, in bytes: HEAD "), "{printed}");
    succeed(&["pack", text(&source), "--npz", "--out", text(&quantized), "--views", "0", "--hidden", "0"]);
    assert_eq!(read("quantized.npz").coefficients(), packed.coefficients());
}

/// What `.npz` files do not record is said, with the flags that read it again. Files that grow are not called smaller.
#[test]
fn what_npz_files_lose_is_said() {
    let folder = folder("pack_npz_reading");
    let (source, out) = (ball(&folder), folder.join("quantized.npz"));
    let pack = |options: &[&str]| {
        let all = ["pack", text(&source), "--exact", "--views", "0", "--npz", "--out", text(&out)];
        let Output { stdout, stderr, .. } = run(&[&all[..], options].concat());
        [stdout, stderr].map(|text| String::from_utf8(text).unwrap())
    };
    let [printed, warnings] = pack(&[]);
    assert!(printed.contains(" times larger") && !printed.contains("smaller"), "{printed}");
    assert_eq!(warnings, "");
    let [_, warnings] = pack(&["--activation", "shifted-relu", "--up", "y"]);
    let flags = "read it with --activation shifted-relu --up y";
    assert!(warnings.contains("quantized.npz: ") && warnings.contains(flags), "{warnings}");
}

/// A field without leaves is an error. One that is too faint for a palette is measured without labels.
#[test]
fn faint_fields_are_not_packed_silently() {
    let folder = folder("pack_faint");
    let bake = |name: &str, density: f64, half: f64| {
        let (min, max) = (glam::DVec3::splat(-half), glam::DVec3::splat(half));
        let settings = BakeSettings {
            depth: 2,
            min,
            max,
            min_density: 0.0,
            basis: Basis::Rgba,
            directions: 8,
            ..Default::default()
        };
        let path = folder.join(name);
        bake(&settings, |_| density, |_| |_| glam::DVec3::ONE).unwrap().write(&path).unwrap();
        path
    };
    let new = folder.join("new/folder/empty.plenoctree");
    let message = fail(&["pack", text(&bake("empty.npz", 1e-3, 1.0)), "--out", text(&new)]);
    assert!(message.contains("empty.npz: no leaf has a density of 0.01"), "{message}");
    assert!(!folder.join("new").exists(), "a folder is left without anything in it");
    let solid = bake("solid.npz", 1e5, 1.0);
    let Output { stdout, stderr, status } = run(&["pack", text(&solid), "--exact", "--size", "20x20"]);
    let [printed, warnings] = [stdout, stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(status.success() && printed.contains("dB from the field in 4 views"), "{printed}{warnings}");
    assert!(warnings.is_empty() || warnings.contains("solid.npz: measured without labels"), "{warnings}");
}

/// Histograms are recorded before the field is simplified, if they are asked for.
#[test]
fn histograms_are_recorded_on_request() {
    let folder = folder("pack_record");
    let source = ball(&folder);
    let field = PlenOctree::read(&source, &LoadSettings::default()).unwrap();
    let settings = SamplingSettings::default();
    let expected = sample(&field, &settings, &Progress::default()).unwrap();
    let packed = |flags: &[&str]| {
        let out = folder.join("ball.plenoctree");
        succeed(&[&["pack", text(&source), "--views", "0", "--out", text(&out)], flags].concat());
        PlenOctree::read(&out, &LoadSettings { density_threshold: 0.0, ..Default::default() }).unwrap()
    };
    assert_eq!(packed(&[]).histograms(&settings), None);
    assert_eq!(packed(&["--record-histograms"]).histograms(&settings).unwrap().fine(), expected.fine());
}

#[test]
fn what_cannot_be_packed_is_an_error() {
    let folder = folder("pack_errors");
    let source = ball(&folder);
    assert!(fail(&["pack", text(&folder.join("none.npz"))]).contains("none.npz"));
    assert!(fail(&["pack", text(&source), "--rows", "0"]).contains("found rows = 0"));
    assert!(fail(&["pack", text(&source), "--hidden", "1.1"]).contains("found hidden = 1.1, expected 0 to 1"));
    let before = std::fs::read(&source).unwrap();
    let message = fail(&["pack", text(&source), "--npz", "--out", text(&source)]);
    assert!(message.contains("ball.npz: would overwrite its input; choose another --out"), "{message}");
    assert_eq!(std::fs::read(&source).unwrap(), before);
    let quantized = folder.join("quantized.npz");
    let message = fail(&["pack", text(&source), "--npz", "--out", text(&quantized), "--verbose"]);
    assert!(message.contains("cannot be used with"), "{message}");
    let notes = folder.join("notes.txt");
    std::fs::write(&notes, "notes").unwrap();
    let message = fail(&["pack", text(&source), "--out", text(&notes)]);
    assert!(message.contains("expected a file that ends in .plenoctree"), "{message}");
    assert_eq!(std::fs::read(&notes).unwrap(), b"notes");
    let haze = folder.join("haze.npz");
    let (min, max) = (glam::DVec3::splat(-0.1), glam::DVec3::splat(0.1));
    let settings = BakeSettings { depth: 2, min, max, basis: Basis::Rgba, directions: 8, ..Default::default() };
    bake(&settings, |_| 0.02, |_| |_| glam::DVec3::ONE).unwrap().write(&haze).unwrap();
    let message = fail(&["pack", text(&haze), "--exact", "--views", "0"]);
    assert!(message.contains("haze.npz: no leaf adds an opacity of 0.004"), "{message}");
    let packed = folder.join("ball.plenoctree");
    succeed(&["pack", text(&source), "--views", "0"]);
    // Packing again would replace it.
    assert!(fail(&["pack", text(&packed)]).contains("ball.plenoctree: would overwrite its input"));
    assert!(fail(&["pack", text(&source), text(&packed)]).contains("ball.plenoctree: would overwrite its input"));
    assert!(fail(&["pack", text(&source), text(&source), "--out", text(&packed)]).contains("several fields"));
    std::fs::write(folder.join("bad.plenoctree"), b"\x89PLO\r\n\x1a\n").unwrap();
    let message = fail(&["info", text(&folder.join("bad.plenoctree"))]);
    assert!(message.contains("bad.plenoctree: header: found 8 bytes"), "{message}");
}
