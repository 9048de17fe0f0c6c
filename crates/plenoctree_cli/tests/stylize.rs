//! `plenoctree stylize` with the reference, which needs no GPU.

mod common;

use std::{fs, path::Path, process::Output};

use common::{ball, fail, folder, run, succeed, text};
use glam::DVec3;
use image::RgbImage;
use plenoctree::{BakeSettings, Basis, bake, palette::Palette};
use serde_json::Value;

/// Returns the arguments that render two views of 32 x 32 pixels to a folder.
fn arguments<'a>(field: &'a Path, out: &'a Path) -> Vec<&'a str> {
    let arguments = ["stylize", text(field), "--out", text(out), "--renderer", "reference", "--size", "32x32"];
    [&arguments[..], &["--frames", "2"]].concat()
}

#[test]
fn the_documented_files_are_written() {
    let folder = folder("stylize_files");
    let (field, out) = (ball(&folder), folder.join("out"));
    let extraction = ["--sampling", "cpu", "--colors", "4", "--recolor", "1=#2060ff"];
    let printed = succeed(&[&arguments(&field, &out)[..], &extraction].concat());
    assert!(printed.starts_with("2 views of "), "{printed}");

    let mut files: Vec<_> =
        fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    let frames = ["frame_000", "frame_001"];
    let kinds = ["original", "posterized", "recolored"];
    let mut expected: Vec<_> =
        frames.iter().flat_map(|frame| kinds.map(|kind| format!("{frame}.{kind}.png"))).collect();
    expected.extend(["palette.json", "palette.png", "report.json"].map(String::from));
    assert_eq!(files, expected);
    for file in &files[..6] {
        assert_eq!(image::image_dimensions(out.join(file)).unwrap(), (32, 32));
    }

    let report: Value = serde_json::from_str(&fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(report["palette"]["sampling_on"], "cpu");
    assert_eq!(report["frames"][1]["files"][2], "frame_001.recolored.png");
    for frame in 0..2 {
        assert!(report["frames"][frame]["milliseconds"]["total"].as_f64().unwrap() > 0.0);
    }
}

/// What other commands and earlier runs left in the folder is not lost, and told apart.
#[test]
fn earlier_files_are_kept() {
    let folder = folder("stylize_earlier");
    let (field, out) = (ball(&folder), folder.join("out"));
    let report = r#"{"views": [], "psnr_db": 31.2}"#;
    fs::create_dir_all(&out).unwrap();
    fs::write(out.join("report.json"), report).unwrap();
    let warnings = |frames: &str| {
        let options = ["--sampling", "cpu", "--colors", "4", "--quiet", "--frames", frames];
        let output = run(&[&arguments(&field, &out)[..8], &options].concat());
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let of_both = warnings("2");
    assert!(of_both.contains("the report before is now") && !of_both.contains("images"), "{of_both}");
    assert_eq!(fs::read_to_string(out.join("report.json.old")).unwrap(), report);
    let of_one = warnings("1");
    assert!(of_one.contains("also holds 2 images from an earlier run, such as frame_001.original.png"), "{of_one}");
    assert!(!out.join("report.json.old2").exists() && out.join("frame_001.original.png").exists());
}

/// Ramps are recolored by name or index, and palettes of tones are not blended: every pixel has a palette color.
#[test]
fn ramps_are_recolored() {
    let folder = folder("stylize_ramps");
    let (field, palette) = (ball(&folder), folder.join("palette.json"));
    let ramps = r#"[{"name": "cap", "tones": [0, 1]}]"#;
    let colors = "[[0.4, 0.1, 0.1], [0.8, 0.2, 0.2], [0.2, 0.6, 0.2]]";
    fs::write(&palette, format!(r#"{{"colors": {colors}, "ramps": {ramps}, "method": "tones"}}"#)).unwrap();
    let recolored = |ramp: &str| {
        let (out, recolor) = (folder.join("out"), format!("{ramp}=#3060d0"));
        let options = ["--palette", text(&palette), "--softness", "0", "--recolor", &recolor];
        succeed(&[&arguments(&field, &out)[..], &options].concat());
        ["posterized", "recolored"]
            .map(|kind| image::open(out.join(format!("frame_000.{kind}.png"))).unwrap().into_rgb8())
    };
    let [posterized, by_name] = recolored("cap");
    let allowed = [[102, 26, 26], [204, 51, 51], [51, 153, 51], [255, 255, 255]];
    let near = |a: &[u8; 3], b: &[u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1);
    let flat = posterized.pixels().filter(|pixel| allowed.iter().any(|color| near(color, &pixel.0))).count();
    assert!(flat * 10 > 9 * posterized.pixels().len(), "{flat}");
    let red = |image: &RgbImage| image.pixels().filter(|pixel| pixel[0] > pixel[1].max(pixel[2])).count();
    assert!(red(&posterized) > 100 && 10 * red(&by_name) < red(&posterized), "{} {}", red(&posterized), red(&by_name));
    assert_eq!(recolored("ramp:0")[1], by_name);

    // A pixel gets its color exactly, and so do all others of its tone.
    let (x, y, tone) = posterized.enumerate_pixels().find(|(_, _, pixel)| near(&pixel.0, &allowed[1])).unwrap();
    let (out, wish) = (folder.join("out"), format!("{x},{y}=#3060d0"));
    let options = ["--palette", text(&palette), "--softness", "0", "--pixel", &wish];
    succeed(&[&arguments(&field, &out)[..], &options].concat());
    let by_pixel = image::open(out.join("frame_000.recolored.png")).unwrap().into_rgb8();
    let pixels = posterized.pixels().zip(by_pixel.pixels());
    assert!(pixels.filter(|(before, _)| *before == tone).all(|(_, after)| after.0 == [0x30, 0x60, 0xd0]));
}

/// A pixel of haze belongs to the ramp of the haze, whatever shows through. With the background, its color is nearer to
/// another ramp.
#[test]
fn pixels_of_haze_move_its_ramp() {
    let folder = folder("stylize_haze");
    let (field, palette) = (folder.join("haze.npz"), folder.join("palette.json"));
    let settings = BakeSettings { depth: 1, basis: Basis::Rgba, directions: 8, ..Default::default() };
    bake(&settings, |_| 0.4, |_| |_| DVec3::new(0.2, 0.6, 0.2)).unwrap().write(&field).unwrap();
    let colors = "[[0.2, 0.6, 0.2], [0.51, 0.37, 0.12], [0.12, 0.37, 0.51]]";
    let ramps = ["haze", "brown", "slate"].iter().enumerate();
    let ramps: Vec<_> = ramps.map(|(tone, name)| format!(r#"{{"name": "{name}", "tones": [{tone}]}}"#)).collect();
    let ramps = ramps.join(", ");
    fs::write(&palette, format!(r#"{{"colors": {colors}, "ramps": [{ramps}], "method": "tones"}}"#)).unwrap();
    for (background, other) in [("#ff0000", [130, 94, 31]), ("#0000ff", [31, 94, 130])] {
        let recolored = |option: &str, wish: &str| {
            let out = folder.join("out");
            let options = ["--palette", text(&palette), "--background", background, option, wish];
            succeed(&[&arguments(&field, &out)[..], &options].concat());
            ["posterized", "recolored"]
                .map(|kind| image::open(out.join(format!("frame_000.{kind}.png"))).unwrap().into_rgb8())
        };
        let [posterized, by_ramp] = recolored("--recolor", "haze=#c040a0");
        let seen = posterized.get_pixel(16, 16).0;
        let distance = |color: [u8; 3]| color.iter().zip(seen).map(|(a, b)| u32::from(a.abs_diff(b))).sum::<u32>();
        assert!(2 * distance(other) < distance([51, 153, 51]), "{seen:?} over {background}");
        assert!(by_ramp.get_pixel(16, 16).0 != seen);
        assert_eq!(recolored("--pixel", "16,16=#c040a0"), [posterized, by_ramp]);
    }
}

/// A given palette is used unchanged, and `--quiet` prints nothing.
#[test]
fn a_palette_can_be_given() {
    let folder = folder("stylize_palette");
    let (field, out) = (ball(&folder), folder.join("out"));
    let palette = folder.join("palette.json");
    fs::write(&palette, r#"{"colors": [[1, 0, 0], [0, 0, 1]]}"#).unwrap();
    let printed = succeed(&[&arguments(&field, &out)[..], &["--palette", text(&palette), "--quiet"]].concat());
    assert_eq!(printed, "");
    let report: Value = serde_json::from_str(&fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    assert!(report["palette"]["sampling_on"].is_null());
    assert_eq!(report["palette"]["colors"], 2);
}

/// Nothing that is read is overwritten, and a failure leaves earlier results as they were.
#[test]
fn nothing_is_overwritten() {
    let folder = folder("stylize_overwrite");
    let (field, out) = (ball(&folder), folder.join("out"));
    let shared = arguments(&field, &out);
    let succeed = |more: &[&str]| succeed(&[&shared[..], more].concat());
    let fail = |more: &[&str]| fail(&[&shared[..], more].concat());
    succeed(&["--sampling", "cpu", "--colors", "4"]);
    let palette = out.join("palette.json");
    let before = fs::read_to_string(&palette).unwrap();
    fail(&["--sampling", "cpu", "--colors", "5", "--pixel", "0,0=#ff0000"]);
    assert_eq!(fs::read_to_string(&palette).unwrap(), before);

    let mut edited = Palette::read(&palette).unwrap();
    edited.rename_ramp(0, "mine").unwrap();
    edited.write(&palette).unwrap();
    succeed(&["--sampling", "cpu", "--colors", "4"]);
    assert_eq!(fs::read_to_string(&palette).unwrap(), before);
    assert_eq!(Palette::read(out.join("palette.json.old")).unwrap(), edited);

    let with_author = before.replacen('{', r#"{ "author": "me","#, 1);
    fs::write(&palette, &with_author).unwrap();
    succeed(&["--palette", text(&palette)]);
    assert_eq!(fs::read_to_string(&palette).unwrap(), with_author);

    let (cameras, frame) = (out.join("report.json"), out.join("frame_000.original.png"));
    for (option, path, reason) in [
        ("--cameras", &cameras, "would be overwritten; choose another --out"),
        ("--histograms", &frame, "the name of the histograms must end in .npz"),
    ] {
        let before = fs::read(path).unwrap();
        let message = fail(&["--sampling", "cpu", option, text(path)]);
        assert!(message.contains(reason), "{message}");
        assert_eq!(fs::read(path).unwrap(), before);
    }

    // A picture that the file of the cameras names.
    let cameras = folder.join("cameras.json");
    let matrix = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]";
    let frames = format!(r#"[{{ "file_path": "out/frame_000.original.png", "transform_matrix": {matrix} }}]"#);
    fs::write(&cameras, format!(r#"{{ "camera_angle_x": 0.8, "frames": {frames} }}"#)).unwrap();
    let before = fs::read(&frame).unwrap();
    let message = fail(&["--sampling", "cpu", "--background", "ff0000", "--cameras", text(&cameras)]);
    assert!(message.contains("frame_000.original.png: would be overwritten"), "{message}");
    assert_eq!(fs::read(&frame).unwrap(), before);

    // What cannot be written is found before anything is drawn.
    fs::remove_file(out.join("report.json")).unwrap();
    fs::create_dir(out.join("report.json")).unwrap();
    let message = fail(&["--sampling", "cpu", "--background", "ff0000"]);
    assert!(message.contains("report.json: is a folder"), "{message}");
    assert_eq!(fs::read(&frame).unwrap(), before);
}

/// Wherever a field is, the GPU shows it as the reference does.
#[cfg(feature = "bevy")]
#[test]
fn far_fields_are_where_they_are() {
    let folder = folder("stylize_far");
    let center = DVec3::new(1e6, -3e7, 2e5);
    let (min, max) = (center - DVec3::ONE, center + DVec3::ONE);
    let settings = BakeSettings { depth: 4, min, max, basis: Basis::Rgba, directions: 8, ..Default::default() };
    let density = |at: DVec3| if (at - center).length() < 0.8 { 50.0 } else { 0.0 };
    let color = |at: DVec3| DVec3::select(at.cmpgt(center), DVec3::splat(0.9), DVec3::splat(0.1));
    let field = folder.join("far.npz");
    bake(&settings, density, |at| move |_| color(at)).unwrap().write(&field).unwrap();
    let image = |renderer: &str| {
        let out = folder.join(renderer);
        let shared = ["stylize", text(&field), "--frames", "1", "--size", "48x48", "--sampling", "cpu", "--quiet"];
        let both = [&shared[..], &["--renderer", renderer, "--out", text(&out)]].concat();
        let Output { stderr, status, .. } = run(&both);
        let errors = String::from_utf8(stderr).unwrap();
        // No test of the program needs a GPU.
        if !status.success() && errors.contains("no usable graphics adapter") {
            return None;
        }
        assert!(status.success(), "{errors}");
        Some(image::open(out.join("frame_000.original.png")).unwrap().into_rgb8())
    };
    let (Some(gpu), Some(reference)) = (image("gpu"), image("reference")) else {
        return println!("skipped: needs a graphics adapter");
    };
    assert!(reference.pixels().any(|pixel| pixel.0[0] < 100));
    let most = gpu.iter().zip(reference.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(most <= 2, "{most} of 255");
}

#[test]
fn bad_input_is_rejected() {
    let folder = folder("stylize_bad");
    let (field, out) = (ball(&folder), folder.join("out"));
    let with = |more: &[&str]| fail(&[&arguments(&field, &out)[..], more].concat());
    assert!(with(&["--palette", "missing.json"]).contains("missing.json"));
    assert!(with(&["--cameras", "missing.json"]).contains("missing.json"));
    assert!(with(&["--sampling", "cpu", "--recolor", "99=#000000"]).contains("--recolor 99"));
    let without_ramps = ["--sampling", "cpu", "--method", "fitted", "--recolor", "cap=#000000"];
    assert!(with(&without_ramps).contains("the palette has no ramps"));
    assert!(with(&["--palette", "palette.json", "--colors", "4"]).contains("cannot be used with"));
    assert!(with(&["--smooth-edges"]).contains("--smooth-edges needs --renderer gpu"));
    assert!(with(&["--quality", "fast"]).contains("--quality needs --renderer gpu"));
    // A folder that cannot be created is found before the palette is extracted.
    let histograms = folder.join("histograms.npz");
    let message = fail(&[&arguments(&field, &field)[..], &["--histograms", text(&histograms)]].concat());
    assert!(message.contains("ball.npz: cannot be created") && !histograms.exists(), "{message}");
    let palette = folder.join("many.json");
    fs::write(&palette, format!(r#"{{"colors": {:?}}}"#, vec![[0.5; 3]; 64])).unwrap();
    let message = "64 colors with 3 blend steps, which make 4096 labels, expected at most 1024: use --blend-steps 1";
    let printed = with(&["--palette", text(&palette)]);
    assert!(printed.contains(message) && printed.contains("many.json"), "{printed}");
    assert!(printed.contains("add \"method\": \"tones\" to the file"), "{printed}");
    fs::write(&palette, format!(r#"{{"colors": {:?}, "method": "hull"}}"#, vec![[0.5; 3]; 64])).unwrap();
    let printed = with(&["--palette", text(&palette)]);
    assert!(printed.contains(message) && !printed.contains("tones"), "{printed}");
    for wrong in [["--size", "0x1"], ["--background", "red"], ["--softness", "-1"], ["--frames", "0"]] {
        fail(&["stylize", text(&field), wrong[0], wrong[1]]);
    }
    assert!(fail(&arguments(&folder.join("missing.npz"), &out)).contains("missing.npz"));
}

/// The GPU can be selected only in builds that support it.
#[test]
fn builds_without_bevy_have_no_gpu() {
    let Output { stdout, .. } = run(&["stylize", "--help"]);
    assert_eq!(String::from_utf8(stdout).unwrap().contains("- gpu:"), cfg!(feature = "bevy"));
}
