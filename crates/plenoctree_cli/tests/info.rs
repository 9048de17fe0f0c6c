//! `plenoctree info`.

mod common;

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

use common::{ball, fail, folder, succeed, text};
use plenoctree::{LoadSettings, PlenOctree, palette::Palette};
use serde_json::{Value, json};

#[test]
fn a_field_is_described() {
    let field = ball(&folder("info_field"));
    let printed = succeed(&["info", text(&field)]);
    let read = PlenOctree::read(&field, &LoadSettings::default()).unwrap();
    for expected in ["ball.npz", "RGBA", &read.leaves().to_string(), &read.nodes().len().to_string(), "median 50.0000"]
    {
        assert!(printed.contains(expected), "{expected} in {printed}");
    }

    let json: Value = serde_json::from_str(&succeed(&["info", "--json", text(&field)])).unwrap();
    assert_eq!(json["basis"], "RGBA");
    assert_eq!(json["leaves"], read.leaves());
    assert_eq!(json["nodes"], read.nodes().len());
    assert_eq!(json["depth"], 4);
    assert_eq!(json["file_bytes"], fs::metadata(&field).unwrap().len());
    assert_eq!(json["density"]["max"], 50.0);
    assert_eq!(json["bounds"]["max"][0].as_f64(), read.bounds().map(|(_, high)| high.x));
    assert_eq!(json["gpu_bytes"].is_u64(), cfg!(feature = "bevy"));
}

/// What a packed field records, which other files do not.
#[test]
fn records_are_described() {
    let folder = folder("info_records");
    let field = ball(&folder);
    let json = |path: &Path| -> Value {
        let json: Value = serde_json::from_str(&succeed(&["info", "--json", text(path)])).unwrap();
        json!([json["activation"], json["up"], json["records_histograms"]])
    };
    assert_eq!(json(&field), json!(["Identity", "z", false]));
    let options = ["--exact", "--views", "0", "--record-histograms", "--activation", "shifted-relu", "--up", "y"];
    succeed(&[&["pack", text(&field)], &options[..]].concat());
    let packed = folder.join("ball.plenoctree");
    assert_eq!(json(&packed), json!(["ShiftedRelu", "y", true]));
    let printed = succeed(&["info", text(&packed)]);
    for expected in ["activation    ShiftedRelu", "up axis       y", "histograms    recorded"] {
        assert!(printed.contains(expected), "{printed}");
    }
}

#[test]
fn a_palette_is_described() {
    let path = folder("info_palette").join("two.palette.json");
    let mut palette = Palette::new(vec![[0.0, 0.5, 1.0], [1.0; 3]]).unwrap();
    palette.weights = vec![0.75, 0.25];
    palette.write(&path).unwrap();
    let printed = succeed(&["info", text(&path)]);
    assert!(printed.contains("#0080ff   75.0%") && printed.contains("#ffffff   25.0%"), "{printed}");

    let json: Value = serde_json::from_str(&succeed(&["info", text(&path), "--json"])).unwrap();
    assert_eq!(json["colors"][0]["hex"], "#0080ff");
    assert_eq!(json["colors"][1]["weight"], 0.25);
}

#[test]
fn errors_name_bad_files() {
    let folder = folder("info_bad");
    for (name, content) in [("no_field.npz", "no archive"), ("no_palette.json", "{}")] {
        let path = folder.join(name);
        fs::write(&path, content).unwrap();
        assert!(fail(&["info", text(&path)]).contains(name));
    }
    assert!(fail(&["info", text(&folder.join("missing.npz"))]).contains("missing.npz"));
}

/// Whoever reads the output may read only the start of it, as `head` does. A full disk is an error.
#[test]
fn output_that_nobody_reads_is_no_failure() {
    let field = ball(&folder("info_closed"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_plenoctree"));
    command.args(["info", text(&field)]).stderr(Stdio::piped());
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    if let Ok(full) = fs::File::options().write(true).open("/dev/full") {
        let output = command.stdout(full).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.starts_with("error: standard output: ") && message.lines().count() == 1, "{message}");
    }
}
