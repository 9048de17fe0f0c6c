//! `lab evidence` with the reference, which needs no GPU.

#[path = "../../plenoctree_cli/tests/common/mod.rs"]
mod common;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use common::{ball, fail, folder, succeed, text};
use glam::DVec3;
use image::Rgb;
use plenoctree::{
    BakeSettings, Basis, LoadSettings, PlenOctree, bake,
    palette::{ColorCount, ColorErrors, ExtractionSettings, Palette, PaletteMethod, extract},
    reference::{self, Posterization},
    sampling::{Progress, SamplingSettings, sample},
};
use plenoctree_fit::read_transforms;

const SIZE: &str = "48x40";

/// Writes the report of a field to a folder and returns the folder.
fn report(field: &Path, out: &str, more: &[&str]) -> PathBuf {
    let out = field.with_file_name(out);
    let arguments = ["evidence", text(field), "--out", text(&out), "--size", SIZE, "--views", "2", "--frames", "4"];
    let printed = succeed(&[&arguments[..], &["--renderer", "reference"], more].concat());
    assert!(printed.contains("report.html"), "{printed}");
    out
}

/// The report of the ball.
static BALL: LazyLock<PathBuf> = LazyLock::new(|| report(&ball(&folder("evidence_ball")), "out", &[]));

/// The report of the rainbow.
static RAINBOW: LazyLock<PathBuf> = LazyLock::new(|| report(&rainbow(&folder("evidence_rainbow")), "out", &[]));

/// Writes a single camera and returns the file.
fn cameras(folder: &Path) -> PathBuf {
    let file = folder.join("transforms.json");
    let pose = "[[1, 0, 0, 0.3], [0, 0, -1, -4], [0, 1, 0, 0.2], [0, 0, 0, 1]]";
    fs::write(&file, format!(r#"{{"camera_angle_x": 0.6, "frames": [{{"transform_matrix": {pose}}}]}}"#)).unwrap();
    file
}

/// Writes a ball of smoothly changing colors, some of them inside the hull of the others, and returns its path.
fn rainbow(folder: &Path) -> PathBuf {
    let settings = BakeSettings { depth: 4, basis: Basis::Rgba, directions: 8, ..Default::default() };
    let density = |at: DVec3| if at.length() < 0.8 { 50.0 } else { 0.0 };
    let color = |at: DVec3| 0.5 + 0.4 * (3.0 * at + DVec3::new(0.0, 2.0, 4.0)).map(f64::sin);
    let field = bake(&settings, density, |at| move |_| color(at)).unwrap();
    let path = folder.join("rainbow.npz");
    field.write(&path).unwrap();
    path
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
    let out = &*BALL;
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
    for folder in ["pictures", "plots"] {
        for file in fs::read_dir(out.join(folder)).unwrap() {
            let file = file.unwrap();
            assert!(in_html.contains(&&*format!("{folder}/{}", text(Path::new(&file.file_name())))), "{file:?}");
            assert!(folder == "plots" || image::open(file.path()).is_ok(), "{file:?}");
        }
    }
}

/// Below every posterized picture, also below every part of one, stand its figures, and files list all of them.
#[test]
fn every_figure_below_a_picture_is_listed() {
    let out = &*RAINBOW;
    let mut listed = BTreeSet::new();
    for file in fs::read_dir(out.join("csv")).unwrap() {
        let name = file.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned();
        for row in rows(out, &name) {
            for part in ["", "part_"] {
                let columns =
                    ["psnr_db", "rmse", "hue_errors_percent"].map(|column| row.get(&format!("{part}{column}")));
                if let [Some(psnr), Some(rmse), Some(hue)] = columns.map(|cell| cell.and_then(|cell| cell.parse().ok()))
                {
                    let (psnr, rmse, hue): (f64, f64, f64) = (psnr, rmse, hue);
                    let psnr = if psnr.is_finite() { format!("{psnr:.1} dB") } else { "no difference".into() };
                    listed.insert(format!("{psnr}, RMSE {rmse:.1}, hue errors {hue:.1}%"));
                }
            }
        }
    }
    let markdown = fs::read_to_string(out.join("report.md")).unwrap();
    let lines: Vec<Vec<&str>> = markdown.lines().map(|line| line.split(" | ").collect()).collect();
    // The titles, a line, the pictures, and what stands below them.
    let below = lines.windows(4).filter(|lines| lines[2][0].contains("](pictures/"));
    let below = below.flat_map(|lines| lines[0].iter().zip(&lines[3]));
    let mut found = 0;
    for (title, note) in below.map(|(title, note)| (title.trim_matches(['|', ' ']), note.trim_matches(['|', ' ']))) {
        let without = ["as trained", "recolored", "radiance", "visibility", "example views"];
        if !without.iter().any(|word| title.contains(word)) {
            assert!(listed.contains(note), "{title}: {note:?}");
            found += 1;
        }
    }
    assert!(found > 30, "{found}");
}

/// The figures of the part where the hull fails are those of its view, and its error falls.
#[test]
fn parts_are_of_the_view_whose_error_falls_most() {
    let out = &*RAINBOW;
    let listed = rows(out, "figure_11");
    let pairs: Vec<_> = listed.chunks(2).collect();
    let falls = |pair: &[BTreeMap<String, String>], column: &str| number(&pair[0], column) - number(&pair[1], column);
    let most = pairs.iter().max_by(|a, b| falls(a, "rmse").total_cmp(&falls(b, "rmse"))).unwrap();
    assert!(falls(most, "part_rmse") > falls(most, "rmse").max(0.0), "{most:?}");
    assert_eq!(listed.iter().filter(|row| !row["part_rmse"].is_empty()).count(), 2);
    let markdown = fs::read_to_string(out.join("report.md")).unwrap();
    let (_, section) = markdown.split_once("## Figure 11").unwrap();
    assert!(section.contains(&format!("| view {} |", most[0]["view"])), "{section}");
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

    for method in [PaletteMethod::Hull, PaletteMethod::Fitted] {
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
        let shown = reference::posterize(&rendering, DVec3::ONE, &palette, &source, &Posterization::default());
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
    let frames = rows(&BALL, "figure_07_frames");
    assert_eq!(frames.len(), 3);
    let summary = rows(&BALL, "figure_07");
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
    let (first, second) = (&*BALL, report(&BALL.with_file_name("ball.npz"), "again", &[]));
    for folder in ["csv", "palettes", "pictures", "plots"] {
        for entry in fs::read_dir(first.join(folder)).unwrap() {
            let name = entry.unwrap().file_name();
            if name != "table_1.csv" {
                let [a, b] = [first, &second].map(|out| fs::read(out.join(folder).join(&name)).unwrap());
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
