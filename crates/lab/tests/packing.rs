//! `lab packing`.

#[path = "../../plenoctree_cli/tests/common/mod.rs"]
mod common;

use std::fs;

use common::{ball, fail, folder, succeed, text};

#[test]
fn every_quality_is_packed_and_measured() {
    let folder = folder("packing");
    let (field, out) = (ball(&folder), folder.join("out"));
    let arguments = ["packing", text(&field), "--out", text(&out), "--size", "40x40", "--views"];
    let printed = succeed(&[&arguments[..], &["2"]].concat());
    let table = fs::read_to_string(out.join("packing.md")).unwrap();
    assert!(printed.contains(&table), "{printed}");
    let rows: Vec<Vec<&str>> = table.lines().skip(2).map(|line| line.split(" | ").collect()).collect();
    assert_eq!(rows.iter().map(|row| row[1]).collect::<Vec<_>>(), ["small", "balanced", "fine"]);
    let number =
        |row: usize, column: usize| rows[row][column].trim_end_matches([' ', '|', '%']).parse::<f64>().unwrap();
    let psnr = [0, 1, 2].map(|row| number(row, 7));
    assert!(psnr[0] > 30.0 && psnr[0] < psnr[2] && number(2, 9) < 0.5, "{table}");
    assert!(out.join("psnr.svg").exists() && out.join("labels.svg").exists());
    assert!(fail(&[&arguments[..], &["0"]].concat()).contains("expected --views 1 or more"));
}
