//! `plenoctree render` and `plenoctree convert`.

mod common;

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Command, Stdio},
};

use common::{ball, fail, folder, run, succeed, text};
use plenoctree::{LoadSettings, PlenOctree, palette::Palette};
use serde_json::{Value, json};

/// Writes a cube of red and blue Gaussians as ASCII, above the origin: -y is up.
fn capture(folder: &Path) -> String {
    let mut rows = String::new();
    let steps = || (-6..=6).map(|step| f64::from(step) / 6.0);
    for (x, y, z) in
        steps().flat_map(|x| steps().map(move |y| (x, y))).flat_map(|(x, y)| steps().map(move |z| (x, y, z)))
    {
        if f64::max(x.abs(), f64::max(y.abs(), z.abs())) > 0.99 {
            let red = if y < 0.0 { 1.4 } else { -1.4 };
            rows += &format!("{x} {} {z} {red} -1.4 {} 3.0 -2.6 -2.6 -2.6 1 0 0 0\n", y - 3.0, -red);
        }
    }
    write_capture(folder, &rows)
}

/// Writes a capture with these Gaussians, one a line.
fn write_capture(folder: &Path, rows: &str) -> String {
    let count = rows.lines().count();
    let properties = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = properties.split(' ').map(|name| format!("property float {name}\n")).collect();
    let path = folder.join("cube.ply");
    fs::write(&path, format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}")).unwrap();
    path.to_str().unwrap().into()
}

fn cameras(folder: &Path) -> String {
    // At z = 8, looking along -z at the middle of the cube. Up is y.
    let matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -3.0], [0.0, 0.0, 1.0, 8.0], [0.0, 0.0, 0.0, 1.0]];
    let path = folder.join("cameras.json");
    let json = json!({"camera_angle_x": 0.6, "w": 40, "h": 30, "frames": [{"transform_matrix": matrix}]});
    fs::write(&path, json.to_string()).unwrap();
    path.to_str().unwrap().into()
}

#[test]
fn captures_and_fields_are_rendered() {
    let folder = folder("render");
    let (capture, cameras) = (capture(&folder), cameras(&folder));
    let out = folder.join("out");
    succeed(&["render", &capture, "--cameras", &cameras, "--out", text(&out)]);
    let image = image::open(out.join("000.png")).unwrap().into_rgba8();
    assert_eq!(image.dimensions(), (40, 30));
    assert_eq!(image.get_pixel(0, 0)[3], 0);
    // The lower half, of lower y, is red, and the upper half is blue.
    let ([r, _, b, a], [upper_r, _, upper_b, _]) = (image.get_pixel(20, 20).0, image.get_pixel(20, 9).0);
    assert!(r > 200 && b < 60 && a > 250, "{r} {b} {a}");
    assert!(upper_b > 200 && upper_r < 60, "{upper_r} {upper_b}");
    // Opacities fall where Gaussians grow.
    succeed(&["render", &capture, "--cameras", &cameras, "--out", text(&out), "--antialiased"]);
    let opacity = |image: &image::RgbaImage| image.pixels().map(|pixel| u64::from(pixel[3])).sum::<u64>();
    assert!(opacity(&image::open(out.join("000.png")).unwrap().into_rgba8()) < opacity(&image));
    let arguments =
        ["render", &capture, "--cameras", &cameras, "--size", "20x20", "--background", "#00ff00", "--quiet"];
    assert_eq!(succeed(&[&arguments[..], &["--out", text(&out)]].concat()), "");
    let image = image::open(out.join("000.png")).unwrap();
    assert_eq!((image.width(), image.color()), (20, image::ColorType::Rgb8));
    assert_eq!(image.into_rgb8().get_pixel(0, 0).0, [0, 255, 0]);
    // Views of an earlier, longer run are told apart.
    fs::copy(out.join("000.png"), out.join("001.png")).unwrap();
    let output = run(&[&arguments[..], &["--out", text(&out)]].concat());
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("also holds 1 image from an earlier run, such as 001.png"), "{message}");
    fs::remove_file(out.join("001.png")).unwrap();
    let field = ball(&folder);
    let front = folder.join("front.json");
    fs::write(&front, fs::read_to_string(&cameras).unwrap().replace("-3.0", "0.0")).unwrap();
    let red = |options: &[&str]| {
        succeed(&[&["render", text(&field), "--cameras", text(&front), "--out", text(&out)], options].concat());
        let image = image::open(out.join("000.png")).unwrap().into_rgba8();
        image.pixels().map(|pixel| pixel[0]).max().unwrap()
    };
    assert_eq!([red(&[]), red(&["--activation", "shifted-relu"])], [229, 255]);
    let message = fail(&["render", &capture, "--cameras", &cameras, "--out", text(&out), "--up", "y"]);
    assert!(message.contains("cube.ply: --activation and --up are for fields"), "{message}");
    for option in [&["--spz-axes", "rub"][..], &["--antialiased"]] {
        let message = fail(&[&["render", text(&field), "--cameras", &cameras, "--out", text(&out)], option].concat());
        assert!(message.contains("ball.npz: --spz-axes and --antialiased are for captures"), "{message}");
    }

    // Nothing that is read is overwritten.
    fs::copy(&capture, out.join("000.png")).unwrap();
    let message = fail(&["render", text(&out.join("000.png")), "--cameras", &cameras, "--out", text(&out)]);
    assert!(message.contains("000.png: would be overwritten; choose another --out"), "{message}");
    // Nor is what the cameras belong to.
    let mut listed: serde_json::Value = serde_json::from_slice(&fs::read(&cameras).unwrap()).unwrap();
    for (key, name) in [
        ("file_path", "000.png"),
        ("file_path", "./000"),
        ("file_path", "/home/me/photographs/000.png"),
        ("file_path", ".\\000.png"),
        ("file", "000.png"),
        ("mask_path", "000.png"),
    ] {
        listed["frames"][0].as_object_mut().unwrap().retain(|key, _| key != "file_path" && key != "file");
        listed["frames"][0][key] = name.into();
        fs::write(out.join("transforms.json"), format!("\u{feff}{listed}")).unwrap();
        let cameras = out.join("transforms.json");
        let message = fail(&["render", text(&field), "--cameras", text(&cameras), "--out", text(&out)]);
        assert!(message.contains("000.png: would be overwritten; choose another --out"), "{message}");
    }

    // Lenses that distort are not silently replaced by others.
    let warning = |own: &str| {
        let json = fs::read_to_string(&cameras).unwrap().replacen('{', &format!("{{{own}"), 1);
        fs::write(out.join("lenses.json"), json).unwrap();
        let output = run(&["render", text(&field), "--cameras", text(&out.join("lenses.json")), "--out", text(&out)]);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    assert_eq!(warning("").matches("warning").count(), 0);
    assert!(warning(r#""k1": 0.1,"#).contains("lenses.json: lenses distort"));
    let empty = folder.join("empty.npz");
    PlenOctree::read(&field, &LoadSettings { density_threshold: 1e9, ..Default::default() })
        .unwrap()
        .write(&empty)
        .unwrap();
    let message = fail(&["render", text(&empty), "--cameras", &cameras, "--out", text(&out)]);
    assert!(message.contains("empty.npz: nothing is visible in the field"), "{message}");

    let bytes = fs::read(&capture).unwrap();
    fs::write(&capture, &bytes[..bytes.len() / 2]).unwrap();
    let message = fail(&["render", &capture, "--cameras", &cameras, "--out", text(&out)]);
    assert!(message.contains("cube.ply: vertex: found the end of the file"), "{message}");
}

#[test]
fn captures_become_props_that_stand() {
    let folder = folder("convert");
    let capture = capture(&folder);
    let out = folder.join("out/prop.npz");
    let shared =
        ["convert", &capture, "--out", text(&out), "--depth", "6", "--picture-size", "48", "--sample-fraction", "0.2"];
    let read = || PlenOctree::read(&out, &LoadSettings::default()).unwrap();
    let report = || -> Value { serde_json::from_slice(&fs::read(folder.join("out/report.json")).unwrap()).unwrap() };
    let psnr = |part: &str, background: &str| report()[part]["psnr_db"][background].as_f64().unwrap();

    let printed = succeed(&[&shared[..], &["--no-refine", "--crop", "-2,-5,-2,2,-3,2"]].concat());
    assert!(printed.contains("voxelized") && !printed.contains("refined"), "{printed}");
    let (low, high) = read().bounds().unwrap();
    assert!((-4.4..-3.9).contains(&low.y) && (-3.2..-2.8).contains(&high.y), "{low} {high}");
    assert!(report()["refined"].is_null() && psnr("voxelized", "black") > 15.0);
    let near = |background: &str| report()["voxelized"]["near_psnr_db"][background].as_f64().unwrap();
    succeed(&[&shared[..], &["--no-refine", "--leaves", "32768", "--near", "5"]].concat());
    assert!(read().leaves() <= 32_768 && near("white") > 15.0, "{}", report());
    let (leaves, best) = (read().leaves(), near("white"));
    succeed(&[&shared[..], &["--no-refine", "--quality", &format!("{}", best - 3.0), "--near", "5"]].concat());
    assert!(read().leaves() < leaves && near("white") >= best - 3.0, "{}", report());

    let refining = ["--stand", "--keep-largest", "--near", "5", "--effort", "0.05", "--threads", "2"];
    succeed(&[&shared[..], &refining].concat());
    let (low, high) = read().dense_bounds().unwrap();
    assert!(
        low.z.abs() < 1e-3 && (low + high).truncate().length() < 0.05 && (2.0..2.6).contains(&high.z),
        "{low} {high}"
    );
    // What was at low y is up.
    let (color, opacity) = read().render_ray(glam::DVec3::new(9.0, 0.0, 1.8), glam::DVec3::NEG_X);
    assert!(color.x > 0.7 && color.z < 0.4 && opacity > 0.9, "{color} {opacity}");
    assert!(report()["refined"]["between_psnr_db"]["white"].as_f64().unwrap() > 15.0, "{}", report());
    for background in ["white", "black"] {
        assert!(psnr("refined", background) > psnr("voxelized", background) + 1.0, "{}", report());
    }
    Palette::read(folder.join("out/prop.palette.json")).unwrap();
    assert_eq!(fs::read_dir(folder.join("out/prop.views")).unwrap().count(), 8);

    let packed = folder.join("out/prop.plenoctree");
    // What is in the folder of previews stays, unless it is a preview.
    fs::write(folder.join("out/prop.views/mine.txt"), "mine").unwrap();
    let inside = folder.join("out/prop.views/cube.ply");
    fs::copy(&capture, &inside).unwrap();
    let message = fail(&[&["convert", text(&inside)], &shared[2..], &["--no-refine"]].concat());
    assert!(message.contains("cube.ply: is in ") && message.contains("choose another --out"), "{message}");
    let palette = folder.join("out/prop.palette.json");
    let mut edited = Palette::read(&palette).unwrap();
    edited.rename_ramp(0, "mine").unwrap();
    edited.write(&palette).unwrap();
    succeed(&[&shared[..], &["--no-refine"]].concat());
    let kept = fs::read_dir(folder.join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_string_lossy().contains("palette.json.old") && Palette::read(path).unwrap() == edited);
    assert_eq!(kept.count(), 1);
    assert!(inside.exists() && folder.join("out/prop.views/mine.txt").exists());

    let packing = [&["convert", &capture, "--out", text(&packed)], &shared[4..], &["--no-refine"]].concat();
    succeed(&packing);
    assert!(PlenOctree::read(&packed, &LoadSettings::default()).unwrap().codebook().is_some());

    // The file may say which direction is up.
    let content = fs::read_to_string(&capture).unwrap();
    fs::write(&capture, content.replacen("ascii 1.0\n", "ascii 1.0\ncomment Vertical Axis: z\n", 1)).unwrap();
    let standing = [&shared[..], &["--no-refine", "--stand"]].concat();
    let printed = succeed(&standing);
    let up = || -> Vec<f64> { serde_json::from_value(report()["from_capture"][2].clone()).unwrap() };
    assert!(printed.contains("z is up, as the file says") && up()[..3] == [0.0, 0.0, 1.0], "{printed} {:?}", up());
    let printed = succeed(&[&standing[..], &["--up", "-y"]].concat());
    assert!(!printed.contains("is up") && up()[1] < -0.999, "{printed} {:?}", up());

    let message = fail(&["convert", &cameras(&folder), "--out", text(&out)]);
    assert!(message.contains("cameras.json: JSON: found neither `means` nor `asset`"), "{message}");
    let message = fail(&[&shared[..], &["--crop", "7,7,7,8,8,8"]].concat());
    assert!(
        message.contains("cube.ply: nothing is left of the capture: found no visible Gaussian in the box"),
        "{message}"
    );
}

/// Refining does not make the field worse from nearby, and reports what each round gained there.
#[test]
fn refined_fields_are_no_worse_from_nearby() {
    let folder = folder("distances");
    let capture = capture(&folder);
    let out = folder.join("prop.npz");
    let shared = ["--depth", "6", "--picture-size", "64", "--sample-fraction", "0.2", "--effort", "0.05"];
    let output = run(&[&["convert", &capture, "--out", text(&out)], &shared[..]].concat());
    let [printed, warnings] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success() && printed.contains("gained over white") && printed.contains(" kept"), "{printed}");
    let report: Value = serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    let psnr = |part: &str| report[part]["near_psnr_db"]["white"].as_f64().unwrap();
    assert!(psnr("refined") >= psnr("voxelized") - 0.1, "{report}");
    let (refined, rounds) = (&report["refined"], report["refined"]["rounds"].as_array().unwrap());
    let gain = rounds[0]["psnr_db"].as_f64().unwrap() - refined["before_psnr_db"].as_f64().unwrap();
    assert!((gain - rounds[0]["gain_db"].as_f64().unwrap()).abs() < 1e-9, "{report}");
    let kept = refined["kept"].as_u64().unwrap();
    assert!(kept <= rounds.len() as u64, "{report}");
    assert_eq!(warnings.contains("the field is as voxelized"), kept == 0, "{warnings}{report}");
    let leaves = PlenOctree::read(&out, &LoadSettings::default()).unwrap().leaves();
    assert_eq!(refined["leaves"], leaves);
}

/// A field that hardly looks like its capture is written with a warning that says what to do. Of Gaussians at one
/// place, pictures show the first in the file, and the field the mean.
#[test]
fn useless_fields_are_written_with_a_warning() {
    let folder = folder("useless");
    let out = folder.join("prop.npz");
    let warning = |capture: &str| {
        let shared = ["--out", text(&out), "--no-refine", "--picture-size", "64", "--depth", "6"];
        let output = run(&[&["convert", capture], &shared[..]].concat());
        assert!(output.status.success() && out.exists(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let point = |red: f64| format!("0 0 0 {red} -1.4 {} 3.0 -2.6 -2.6 -2.6 1 0 0 0\n", -red);
    let useless = warning(&write_capture(&folder, &(point(1.4) + &point(-1.4).repeat(300))));
    assert!(useless.contains("hardly looks like the capture") && useless.contains("--crop"), "{useless}");
    // Pictures would take minutes.
    let piled = warning(&write_capture(&folder, &point(1.4).repeat(30_000)));
    assert!(piled.contains("one of every"), "{piled}");
    // Of two cubes that are small and far apart, cells are too large to show more than a speck.
    let cubes = fs::read_to_string(capture(&folder)).unwrap();
    let rows = cubes.split_once("end_header\n").unwrap().1.lines();
    let far = rows.flat_map(|row| {
        let (x, rest) = row.split_once(' ').unwrap();
        let x: f64 = x.parse().unwrap();
        [-500.0, 500.0].map(|shift| format!("{} {rest}\n", x + shift))
    });
    let far = far.collect::<String>();
    let specks = warning(&write_capture(&folder, &far));
    assert!(specks.contains("hardly looks like the capture") && specks.contains("--crop"), "{specks}");
    let report: Value = serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    assert!(number(&report["voxelized"]["psnr_db"]["white"]) > 20.0, "{report}");
    assert!(number(&report["voxelized"]["shown"]["share"]) < 0.02, "{report}");
    let useful = warning(&capture(&folder));
    assert!(!useful.contains("hardly looks") && !useful.contains("origin"), "{useful}");
    // Of a cube as small as this, cells are as small as of any other.
    let tiny = cubes.split_once("end_header\n").unwrap().1.lines().map(|row| {
        let numbers: Vec<f64> = row.split(' ').map(|number| number.parse().unwrap()).collect();
        let scaled = numbers.iter().enumerate().map(|(column, number)| match column {
            0..3 => number * 1e-8,
            7..10 => number + f64::ln(1e-8),
            _ => *number,
        });
        scaled.map(|number| number.to_string()).collect::<Vec<_>>().join(" ") + "\n"
    });
    let useful = warning(&write_capture(&folder, &tiny.collect::<String>()));
    assert!(!useful.contains("hardly looks"), "{useful}");
    // Positions of this cube are rounded to multiples of eight.
    let far = cubes
        .split_once("end_header\n")
        .unwrap()
        .1
        .lines()
        .map(|row| format!("1e8{}\n", &row[row.find(' ').unwrap()..]));
    let lost = warning(&write_capture(&folder, &far.collect::<String>()));
    assert!(lost.contains("so far from the origin"), "{lost}");
}

/// Ctrl-C before refining keeps the voxelized field, and before that ends the program with an error.
#[cfg(unix)]
#[test]
fn interrupted_conversions_keep_what_is_there() {
    let folder = folder("interrupted");
    let capture = capture(&folder);
    let out = folder.join("prop.npz");
    // `until` is the beginning of the line after which the program is interrupted.
    let convert = |depth: &str, size: &str, until: &str| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_plenoctree"))
            .args(["convert", &capture, "--out", text(&out), "--depth", depth, "--picture-size", size])
            .args(["--sample-fraction", "0.2"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(program.stdout.take().unwrap()).lines().map(Result::unwrap);
        assert!(lines.by_ref().any(|line| line.starts_with(until)));
        let sent = Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap();
        assert!(sent.success());
        lines.for_each(drop);
        let mut message = String::new();
        program.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        (program.wait().unwrap().code(), message)
    };

    // This many cells take seconds.
    let (code, message) = convert("10", "16", &capture);
    assert_eq!(code, Some(130), "{message}");
    assert!(message.starts_with("error: stopped by Ctrl-C"), "{message}");
    assert!(!out.exists());

    // And so do pictures of this size.
    let (code, message) = convert("6", "300", "voxelized");
    assert_eq!(code, Some(0), "{message}");
    assert!(message.contains("the field is as voxelized"), "{message}");
    let report: Value = serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    assert!(report["refined"].is_null() && report["stopped"] == true, "{report}");
    let field = PlenOctree::read(&out, &LoadSettings::default()).unwrap();
    assert_eq!(report["voxelized"]["leaves"], field.leaves());
    Palette::read(folder.join("prop.palette.json")).unwrap();
}

/// `--threads` applies to all of the conversion, not only to refining.
#[cfg(target_os = "linux")]
#[test]
fn as_many_threads_convert_as_requested() {
    let folder = folder("threads");
    let capture = capture(&folder);
    let mut program = Command::new(env!("CARGO_BIN_EXE_plenoctree"))
        .args(["convert", &capture, "--out", text(&folder.join("prop.npz")), "--depth", "6", "--picture-size", "64"])
        .args(["--no-refine", "--threads", "200"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(program.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.by_ref().any(|line| line.starts_with("voxelized")));
    let threads = fs::read_dir(format!("/proc/{}/task", program.id())).unwrap().count();
    lines.for_each(drop);
    assert!(program.wait().unwrap().success());
    assert!(threads >= 200, "{threads}");
}
