//! `lab coherence` with the reference, which needs no GPU.

#[path = "../../plenoctree_cli/tests/common/mod.rs"]
mod common;

use std::fs;

use common::{ball, fail, folder, succeed, text};

#[test]
fn every_pair_of_frames_is_compared() {
    let folder = folder("coherence");
    let (field, out) = (ball(&folder), folder.join("out"));
    let arguments = ["coherence", text(&field), "--out", text(&out), "--size", "32x32", "--frames", "4"];
    let printed = succeed(&[&arguments[..], &["--renderer", "reference"]].concat());
    let csv = fs::read_to_string(out.join("coherence.csv")).unwrap();
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines[0], ["frame", "plain", "field", "field_recolored", "per_frame", "per_frame_recolored"]);
    assert_eq!(lines[1..].iter().map(|line| line[0]).collect::<Vec<_>>(), ["1", "2", "3"]);
    for value in lines[1..].iter().flat_map(|line| &line[1..]) {
        let difference: f64 = value.parse().unwrap();
        assert!(difference > 0.0 && difference < 1.0, "{csv}");
    }
    let svg = fs::read_to_string(out.join("coherence.svg")).unwrap();
    for name in &lines[0][1..] {
        assert!(printed.contains(name), "{printed}");
    }
    assert_eq!(svg.matches("<polyline").count(), 10);
    fail(&["coherence", text(&field), "--frames", "1"]);
}
