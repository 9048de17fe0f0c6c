//! `plenoctree evidence` with the reference, which needs no GPU.

mod common;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use common::{ball, fail, folder, succeed, text};
use glam::DVec3;
use image::Rgb;
use plenoctree::{
    BakeSettings, Basis, LoadSettings, PlenOctree, bake,
    camera::read_transforms,
    palette::{ColorCount, ColorErrors, ExtractionSettings, Palette, PaletteMethod, extract},
    reference::{self, Posterization},
    sampling::{Progress, SamplingSettings, sample},
};

const SIZE: &str = "48x40";

/// Writes the report of a field to a folder and returns the folder.
fn report(field: &Path, out: &str, more: &[&str]) -> PathBuf {
    let out = field.with_file_name(out);
    let arguments = ["evidence", text(field), "--out", text(&out), "--size", SIZE, "--views", "1", "--frames", "4"];
    let printed = succeed(&[&arguments[..], &["--renderer", "reference"], more].concat());
    assert!(printed.contains("report.html"), "{printed}");
    out
}

/// Writes a single camera and returns the file.
fn cameras(folder: &Path) -> PathBuf {
    let file = folder.join("transforms.json");
    let pose = "[[1, 0, 0, 0.3], [0, 0, -1, -4], [0, 1, 0, 0.2], [0, 0, 0, 1]]";
    fs::write(&file, format!(r#"{{"camera_angle_x": 0.6, "frames": [{{"transform_matrix": {pose}}}]}}"#)).unwrap();
    file
}

/// Reads the rows of a table by the names of its columns. No text of these tables holds a comma inside quotes.
fn rows(out: &Path, name: &str) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(out.join(format!("csv/{name}.csv"))).unwrap();
    let mut lines = text.lines();
    let head: Vec<_> = lines.next().unwrap().split(',').map(String::from).collect();
    lines.map(|line| head.iter().cloned().zip(line.split(',').map(String::from)).collect()).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

fn load(field: &Path) -> PlenOctree {
    PlenOctree::read(field, &LoadSettings::default()).unwrap()
}

/// Every file that the pages name exists, and the pages show all figures of the paper that compare something.
#[test]
fn the_pages_show_what_exists() {
    let field = ball(&folder("evidence_pages"));
    let out = report(&field, "out", &[]);
    let html = fs::read_to_string(out.join("report.html")).unwrap();
    let markdown = fs::read_to_string(out.join("report.md")).unwrap();
    let in_html =
        html.split(['"']).filter(|part| part.ends_with(".png") || part.ends_with(".svg") || part.ends_with(".csv"));
    let in_html: Vec<_> = in_html.collect();
    assert!(in_html.len() > 60, "{in_html:?}");
    for file in &in_html {
        assert!(out.join(file).is_file(), "{file}");
        assert!(markdown.contains(&format!("]({file})")), "{file}");
    }
    for figure in ["Figure 3", "Figure 4", "Figure 5", "Figure 6", "Figure 7", "Figure 8", "Figure 9", "Figure 10"] {
        assert!(html.contains(&format!("<h2>{figure}:")) && markdown.contains(&format!("## {figure}:")), "{figure}");
    }
    assert!(html.contains("<h2>Figure 11:") && html.contains("<h2>Table 1:"));
    for picture in fs::read_dir(out.join("pictures")).unwrap() {
        image::open(picture.unwrap().path()).unwrap();
    }
}

/// The figures are those of the library: palettes, errors of the field, and pictures and their errors.
#[test]
fn figures_agree_with_the_library() {
    let folder = folder("evidence_figures");
    let (path, transforms) = (ball(&folder), cameras(&folder));
    let out = report(&path, "out", &["--cameras", text(&transforms)]);
    let field = load(&path);
    let histograms = sample(&field, &SamplingSettings::default(), &Progress::default()).unwrap();
    let camera = read_transforms(&transforms, Some((48, 40))).unwrap()[0];
    let rendering = reference::render(&field, &camera);

    for method in PaletteMethod::ALL {
        let settings = ExtractionSettings { method, colors: ColorCount::Fixed(6), ..Default::default() };
        let palette = extract(&field, &settings, &Progress::default()).unwrap().palette;
        let of_method = |rows: Vec<BTreeMap<String, String>>| -> Vec<_> {
            rows.into_iter().filter(|row| row["palette"] == method.name()).collect()
        };
        let listed = of_method(rows(&out, "palettes"));
        let colors: Vec<_> = listed.iter().map(|row| ["r", "g", "b"].map(|channel| number(row, channel))).collect();
        assert_eq!(colors, palette.colors);
        assert_eq!(listed.iter().map(|row| number(row, "weight")).collect::<Vec<_>>(), palette.weights);
        let saved = Palette::read(out.join(format!("palettes/{}.palette.json", method.name()))).unwrap();
        assert_eq!(saved, palette);

        let errors = ColorErrors::of_labels(&histograms, &palette, 3);
        let row = &of_method(rows(&out, "overview"))[0];
        assert_eq!(number(row, "field_rmse"), 255.0 * errors.rmse);
        assert_eq!(number(row, "field_hue_errors_percent"), 100.0 * errors.hue);

        let source: Vec<DVec3> = palette.colors.iter().map(|&color| color.into()).collect();
        let shown = reference::posterize(&rendering, DVec3::ONE, &source, &source, &Posterization::default());
        let quantize = |color: &DVec3| color.to_array().map(|channel| (255.0 * channel.clamp(0.0, 1.0)).round() as u8);
        let picture = image::open(out.join(format!("pictures/view_0_{}.png", method.name()))).unwrap().into_rgb8();
        assert!(picture.pixels().zip(&shown).all(|(Rgb(found), color)| *found == quantize(color)));

        let original = image::open(out.join("pictures/view_0.png")).unwrap().into_rgb8();
        let (mut squares, mut weights) = (0.0, 0.0);
        for ((a, b), opacity) in original.pixels().zip(picture.pixels()).zip(&rendering.opacity) {
            let opacity = (255.0 * opacity).round();
            if opacity >= 80.0 {
                let square = |c: usize| (f64::from(a[c]) - f64::from(b[c])).powi(2);
                squares += opacity * (square(0) + square(1) + square(2)) / 3.0;
                weights += opacity;
            }
        }
        let row = &of_method(rows(&out, "views"))[0];
        let rmse = f64::sqrt(squares / weights);
        assert!((number(row, "rmse") - rmse).abs() < 1e-9, "{row:?}, expected {rmse}");
        assert!((number(row, "psnr_db") - 20.0 * (255.0 / rmse).log10()).abs() < 1e-9, "{row:?}");
    }
}

/// Means, worst differences and spikes are those of the listed frames.
#[test]
fn summaries_agree_with_the_frames() {
    let field = ball(&folder("evidence_frames"));
    let out = report(&field, "out", &[]);
    let frames = rows(&out, "figure_07_frames");
    assert_eq!(frames.len(), 3);
    let summary = rows(&out, "figure_07");
    let columns = ["plain", "hull", "hull_recolored", "fitted", "fitted_recolored", "per_frame", "per_frame_recolored"];
    assert_eq!(summary.len(), columns.len());
    for (column, row) in columns.iter().zip(&summary) {
        assert_eq!(row["frames"], *column);
        let differences: Vec<f64> = frames.iter().map(|frame| number(frame, column)).collect();
        let (sum, worst) = differences.iter().fold((0.0, 0.0f64), |(sum, worst), d| (sum + d, worst.max(*d)));
        // The frames have six digits.
        assert!(
            (number(row, "mean") - sum / 3.0).abs() < 1e-6 && (number(row, "worst") - worst).abs() < 1e-6,
            "{row:?}"
        );
    }
}

/// Only times differ between two runs.
#[test]
fn reports_are_the_same_every_time() {
    let field = ball(&folder("evidence_twice"));
    let [first, second] = ["first", "second"].map(|out| report(&field, out, &[]));
    for folder in ["csv", "palettes", "pictures", "plots"] {
        for entry in fs::read_dir(first.join(folder)).unwrap() {
            let name = entry.unwrap().file_name();
            if name != "table_1.csv" {
                let [a, b] = [&first, &second].map(|out| fs::read(out.join(folder).join(&name)).unwrap());
                assert!(a == b, "{folder}/{name:?}");
            }
        }
    }
}

/// Fields of one color, and black ones, have reports too.
#[test]
fn fields_of_one_color_have_reports() {
    let folder = folder("evidence_one_color");
    for (name, color) in [("gray", DVec3::splat(0.5)), ("black", DVec3::ZERO)] {
        let settings = BakeSettings { depth: 3, basis: Basis::Rgba, directions: 8, ..Default::default() };
        let density = |at: DVec3| if at.length() < 0.8 { 50.0 } else { 0.0 };
        let path = folder.join(format!("{name}.npz"));
        bake(&settings, density, |_| move |_| color).unwrap().write(&path).unwrap();
        let out = report(&path, name, &[]);
        assert!(rows(&out, "palettes").iter().filter(|row| row["palette"] == "hull").count() == 1);
    }
}

#[test]
fn bad_input_is_rejected() {
    let folder = folder("evidence_bad");
    let field = ball(&folder);
    let out = folder.join("out");
    let with = |more: &[&str]| fail(&[&["evidence", text(&field), "--out", text(&out)][..], more].concat());
    assert!(with(&["--cameras", "missing.json"]).contains("missing.json"));
    for wrong in [["--frames", "1"], ["--views", "0"], ["--size", "0x1"], ["--colors", "33"]] {
        with(&wrong);
    }
    let missing = folder.join("missing.npz");
    assert!(fail(&["evidence", text(&missing), "--out", text(&out)]).contains("missing.npz"));
    fs::write(folder.join("file"), "").unwrap();
    let inside = folder.join("file/out");
    assert!(fail(&["evidence", text(&field), "--out", text(&inside)]).contains("file"));
}
