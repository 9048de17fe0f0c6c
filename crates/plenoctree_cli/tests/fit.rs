//! `plenoctree fit`.

mod common;

use std::{fs, path::Path, process::Command};

use common::{ball, fail, folder, run, succeed, text};
use glam::DVec3;
use plenoctree::{LoadSettings, PlenOctree, camera::PinholeCamera, palette::Palette, reference::render};
use serde_json::{Value, json};

/// Writes pictures of the ball from around it, with opacity, and `transforms.json`.
fn photograph(folder: &Path) {
    let field = PlenOctree::read(ball(folder), &LoadSettings::default()).unwrap();
    let mut frames = Vec::new();
    for index in 0..16 {
        let (turn, lift) = (2.4 * f64::from(index), 0.9 * (1.7 * f64::from(index)).sin());
        let outward = DVec3::new(lift.cos() * turn.sin(), lift.cos() * turn.cos(), lift.sin());
        let camera = PinholeCamera::new(32, 32, 0.6, glam::DMat4::IDENTITY);
        let camera = camera.looking_at(4.0 * outward, DVec3::ZERO, DVec3::Z);
        let rendering = render(&field, &camera);
        let image = image::RgbaImage::from_fn(32, 32, |x, y| {
            let pixel = (y * 32 + x) as usize;
            let opacity = rendering.opacity[pixel];
            let color = rendering.color[pixel] / opacity.max(1e-6);
            image::Rgba([color.x, color.y, color.z, opacity].map(|value| (255.0 * value).round() as u8))
        });
        image.save(folder.join(format!("{index}.png"))).unwrap();
        let (m, p) = (camera.rotation, camera.position);
        let row = |i: usize| [m.x_axis[i], m.y_axis[i], m.z_axis[i], p[i]];
        let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
        frames.push(json!({"file_path": index.to_string(), "transform_matrix": matrix}));
    }
    let json = json!({"camera_angle_x": 0.6, "frames": frames});
    fs::write(folder.join("transforms.json"), json.to_string()).unwrap();
}

#[test]
fn a_field_is_fitted_with_palette_previews_and_report() {
    let folder = folder("fit_command");
    photograph(&folder);
    let out = folder.join("out/prop.npz");
    let printed = succeed(&[
        "fit",
        text(&folder),
        "--out",
        text(&out),
        "--depth",
        "6",
        "--sh",
        "1",
        "--effort",
        "0.1",
        "--holdout",
        "5",
        "--threads",
        "2",
    ]);
    assert!(printed.contains("dB") && printed.contains("prop.npz"), "{printed}");
    let field = PlenOctree::read(&out, &LoadSettings::default()).unwrap();
    let report: Value = serde_json::from_slice(&fs::read(folder.join("out/report.json")).unwrap()).unwrap();
    assert_eq!([&report["leaves"], &report["written"]["leaves"]], [field.leaves(); 2]);
    assert_eq!([&report["written"]["packed"], &report["written"]["packed_psnr_db"]], [&json!(false), &Value::Null]);
    assert_eq!(report["held_out"]["views"].as_array().unwrap().len(), 4);
    let psnr = report["held_out"]["psnr_db"].as_f64().unwrap();
    assert!(psnr > 15.0 && psnr < 60.0, "{psnr}");
    Palette::read(folder.join("out/prop.palette.json")).unwrap();
    let preview = image::open(folder.join("out/prop.views/5.png")).unwrap();
    assert_eq!((preview.width(), preview.height()), (64, 32));
    let mut names: Vec<_> = fs::read_dir(folder.join("out")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["prop.npz", "prop.palette.json", "prop.views", "report.json"]);
}

/// A fit can be packed at once, without the pictures that are not there. Resuming it with less effort does not replace a
/// better result, whether or not views were held out.
#[test]
fn fits_are_packed_and_kept() {
    let folder = folder("fit_packed");
    photograph(&folder);
    fs::remove_file(folder.join("7.png")).unwrap();
    fs::remove_file(folder.join("9.png")).unwrap();
    let out = folder.join("prop.plenoctree");
    let shared = ["fit", text(&folder), "--out", text(&out), "--depth", "6", "--sh", "1", "--threads", "2"];
    let run = |more: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_plenoctree")).args(shared).args(more).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let fit = |more: &[&str]| {
        let (code, warnings) = run(more);
        assert_eq!(code, Some(0), "{warnings}");
        warnings
    };
    let warnings = fit(&["--effort", "0.1"]);
    assert_eq!(warnings.matches("warning").count(), 1, "{warnings}");
    assert!(warnings.contains("2 of 16 pictures do not exist") && warnings.contains("such as"), "{warnings}");
    let packed = fs::read(&out).unwrap();
    let field = PlenOctree::read(&out, &LoadSettings::default()).unwrap();
    assert!(field.codebook().is_some());
    let report: Value = serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    assert_eq!([&report["written"]["leaves"], &report["written"]["packed"]], [&json!(field.leaves()), &json!(true)]);
    let psnr = report["written"]["packed_psnr_db"].as_f64().unwrap();
    assert!((25.0..80.0).contains(&psnr), "{psnr}");
    let warnings = fit(&["--effort", "0.01", "--resume"]);
    assert!(warnings.contains("kept as it is: the earlier result has"), "{warnings}");
    assert_eq!(fs::read(&out).unwrap(), packed);
    fit(&["--effort", "0.01"]);
    assert_ne!(fs::read(&out).unwrap(), packed);

    fit(&["--effort", "0.1", "--all"]);
    let packed = fs::read(&out).unwrap();
    let warnings = fit(&["--effort", "0.01", "--all", "--resume"]);
    assert!(warnings.contains("on the views, and this one"), "{warnings}");
    // Where there is no telling which one is better, the earlier result stays.
    let refused = |more: &[&str], reason: &str| {
        let (code, message) = run(&[&["--effort", "0.01", "--resume"], more].concat());
        assert_eq!(code, Some(2));
        assert!(message.contains(reason) && message.contains("leave --resume out"), "{message}");
    };
    refused(&[], "was fitted to other views");
    refused(&["--holdout", "4"], "was fitted to other views");
    // These make the pictures easier to match, or harder.
    for other in [["--downscale", "2"], ["--background", "#808080"], ["--masks", text(&folder)]] {
        refused(&[&["--all"], &other[..]].concat(), "was not compared with pictures of the same size");
    }
    // The report is that of another field in the folder.
    let report = fs::read_to_string(folder.join("report.json")).unwrap();
    fs::write(folder.join("report.json"), report.replace("prop.plenoctree", "other.plenoctree")).unwrap();
    refused(&["--all"], "is not the field that report.json is about");
    assert_eq!(fs::read(&out).unwrap(), packed);
}

/// An error leaves existing files unchanged.
#[test]
fn errors_name_the_file_and_replace_nothing() {
    let folder = folder("fit_errors");
    photograph(&folder);
    let out = folder.join("prop.npz");
    fs::write(&out, "precious").unwrap();
    let other = folder.join("other.obj");
    assert!(fail(&["fit", text(&folder), "--out", text(&other)]).contains("must end in .npz or .plenoctree"));
    let transforms = folder.join("transforms.json");
    let good = fs::read_to_string(&transforms).unwrap();
    fs::write(&transforms, good.replacen("[[", "[[7,", 1)).unwrap();
    let message = fail(&["fit", text(&folder), "--out", text(&out)]);
    assert!(message.contains("transforms.json") && message.contains("frames[0].transform_matrix"), "{message}");
    assert_eq!(fs::read(&out).unwrap(), b"precious");
    // What cannot be replaced is found before the work.
    fs::create_dir(folder.join("report.json")).unwrap();
    let message = fail(&["fit", text(&folder), "--out", text(&out)]);
    assert!(message.contains("report.json") && message.contains("folder"), "{message}");
    fs::remove_dir(folder.join("report.json")).unwrap();
    // Other pictures of the same names are not those of the test.
    let others = folder.join("others");
    fs::create_dir(&others).unwrap();
    fs::write(others.join("transforms.json"), &good).unwrap();
    fs::write(&transforms, &good).unwrap();
    let message = fail(&[
        "fit",
        text(&transforms),
        "--pictures",
        text(&folder),
        "--test",
        text(&others),
        "--out",
        text(&out),
        "--effort",
        "0.01",
    ]);
    assert!(message.contains("others/transforms.json: frames[0].file_path: found no file"), "{message}");
    // Nor are the masks of others.
    let (masks, names) = (folder.join("masks"), fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()));
    let pictures: Vec<_> = names.filter(|name| text(Path::new(name)).ends_with(".png")).collect();
    fs::create_dir(&masks).unwrap();
    for name in &pictures {
        fs::copy(folder.join(name), others.join(name)).unwrap();
        image::GrayImage::from_pixel(32, 32, image::Luma([255])).save(masks.join(name)).unwrap();
    }
    let masked = folder.join("masked.npz");
    let of_test = ["--test", text(&others), "--masks", text(&masks)];
    let output = run(&[&["fit", text(&folder), "--out", text(&masked), "--effort", "0.01"], &of_test[..]].concat());
    assert!(output.status.success(), "{output:?}");
    let warnings = String::from_utf8(output.stderr).unwrap();
    assert!(warnings.contains("is the mask of") && warnings.contains("without --masks"), "{warnings}");
    // Options for something else are not ignored.
    let model = folder.join("model.gltf");
    if cfg!(feature = "gltf") {
        let message = fail(&["fit", text(&folder), "--out", text(&out), "--views", "9"]);
        assert!(message.contains("--views and --size are for glTF models"), "{message}");
        fs::write(&model, "{}").unwrap();
        let message = fail(&["fit", text(&model), "--out", text(&out), "--pictures", text(&folder)]);
        assert!(message.contains("model.gltf: --pictures is for photographs"), "{message}");
    }
    fs::write(&model, r#"{"extensionsUsed": ["KHR_gaussian_splatting"]}"#).unwrap();
    let message = fail(&["fit", text(&model), "--out", text(&out)]);
    assert!(message.contains("model.gltf: found a capture of Gaussian splats; use `plenoctree convert`"), "{message}");
    // Nor is what is read replaced.
    let message = fail(&["fit", text(&folder), "--out", text(&out), "--histograms", text(&transforms)]);
    assert!(message.contains("transforms.json: the name of the histograms must end in .npz"), "{message}");
    assert_eq!(fs::read_to_string(&transforms).unwrap(), good);
    let message = fail(&["fit", text(&folder.join("nothing")), "--out", text(&out)]);
    assert!(message.contains("nothing"), "{message}");
    let mut one: Value = serde_json::from_str(&good).unwrap();
    one["frames"].as_array_mut().unwrap().truncate(1);
    fs::write(&transforms, one.to_string()).unwrap();
    let message = fail(&["fit", text(&folder), "--out", text(&out)]);
    assert!(message.contains(text(&folder)) && message.contains("found 0 to fit to and 1 held out"), "{message}");
    assert_eq!(fs::read(&out).unwrap(), b"precious");
}
