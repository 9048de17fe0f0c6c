//! `plenoctree palette`.

mod common;

use std::{fs, io::Write, path::Path, process::Output};

use common::{ball, fail, folder, run, succeed, text};
use npyz::WriterBuilder;
use plenoctree::{
    LoadSettings, PlenOctree,
    palette::{ColorCount, ExtractionSettings, Palette, PaletteMethod, extract},
    sampling::Progress,
};

/// The palette is saved next to the field, equals the one that the library extracts, and is printed and drawn by ramp.
#[test]
fn the_palette_equals_that_of_the_library() {
    let folder = folder("palette_default");
    let (field, image) = (ball(&folder), folder.join("p.png"));
    let printed = succeed(&["palette", text(&field), "--image", text(&image)]);
    let found = Palette::read(field.with_file_name("ball.palette.json")).unwrap();
    assert!(printed.contains("ball.palette.json"), "{printed}");
    assert_eq!(printed.matches('#').count(), found.colors.len());

    let read = PlenOctree::read(&field, &LoadSettings::default()).unwrap();
    let settings = ExtractionSettings::default();
    let expected = extract(&read, &settings, &Progress::default()).unwrap();
    assert_eq!(found, expected.palette);
    let rmse = format!("a channel of the field is off by {:.2} of 255", 255.0 * expected.report.errors.rmse);
    assert!(printed.contains(&rmse), "{printed}");
    assert!(!found.ramps.is_empty());
    for (index, ramp) in found.ramps.iter().enumerate() {
        assert!(printed.contains(&format!("ramp {index}: {}, ", ramp.name)), "{printed}");
    }
    let longest = found.ramps.iter().map(|ramp| ramp.tones.len() as u32).max().unwrap();
    assert_eq!(image::image_dimensions(&image).unwrap(), (160 * longest, 192 * found.ramps.len() as u32));
}

/// With `--quiet`, the same palette is saved, and nothing is printed.
#[test]
fn quiet_prints_nothing() {
    let folder = folder("palette_quiet");
    let (field, out) = (ball(&folder), folder.join("quiet.json"));
    let Output { status, stdout, stderr } = run(&["palette", text(&field), "--quiet", "--out", text(&out)]);
    assert!(status.success() && stdout.is_empty() && stderr.is_empty(), "{stdout:?} {stderr:?}");
    succeed(&["palette", text(&field)]);
    assert_eq!(Palette::read(&out).unwrap(), Palette::read(field.with_file_name("ball.palette.json")).unwrap());
}

/// Their folders are created.
#[test]
fn all_requested_files_are_written() {
    let folder = folder("palette_files");
    let field = ball(&folder);
    let [out, image, histograms] = ["p.json", "images/p.png", "new/folder/h.npz"].map(|name| folder.join(name));
    let sampling = ["--sampling", "reference", "--method", "fitted", "--colors", "8"];
    let files = ["--out", text(&out), "--image", text(&image), "--histograms", text(&histograms)];
    succeed(&[&["palette", text(&field)][..], &sampling, &files].concat());
    assert!(!field.with_file_name("ball.palette.json").exists());

    let palette = Palette::read(&out).unwrap();
    assert_eq!(image::image_dimensions(&image).unwrap(), (160 * palette.colors.len() as u32, 160));
    let mut archive = zip::ZipArchive::new(fs::File::open(&histograms).unwrap()).unwrap();
    for (name, bins) in [("fine.npy", 32), ("coarse.npy", 8)] {
        assert_eq!(npyz::NpyFile::new(archive.by_name(name).unwrap()).unwrap().shape(), [bins; 3]);
    }
}

/// Fields that were trained as Plenoxels have other colors.
#[test]
fn colors_depend_on_the_activation() {
    let field = ball(&folder("palette_activation"));
    let brightest = |options: &[&str]| {
        succeed(&[&["palette", text(&field)], options].concat());
        let palette = Palette::read(field.with_file_name("ball.palette.json")).unwrap();
        palette.colors.iter().flatten().copied().fold(0.0, f64::max)
    };
    assert!(brightest(&[]) < 0.95 && brightest(&["--activation", "shifted-relu"]) > 0.95);
}

/// Palettes may go to a pipe, of which nothing is kept.
#[cfg(unix)]
#[test]
fn palettes_are_written_to_pipes() {
    let folder = folder("palette_pipe");
    let (field, pipe) = (ball(&folder), folder.join("pipe.json"));
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || fs::read(pipe).unwrap()
    });
    succeed(&["palette", text(&field), "--out", text(&pipe)]);
    let written = Palette::from_json(&reader.join().unwrap(), &pipe).unwrap();
    succeed(&["palette", text(&field)]);
    assert_eq!(written, Palette::read(field.with_file_name("ball.palette.json")).unwrap());
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 3);
}

/// Histograms that were saved give the palette of the field, by either method and with any number of colors.
#[test]
fn saved_histograms_give_the_same_palette() {
    let folder = folder("palette_histograms");
    let field = ball(&folder);
    let histograms = folder.join("h.npz");
    succeed(&["palette", text(&field), "--histograms", text(&histograms)]);
    let read = PlenOctree::read(&field, &LoadSettings::default()).unwrap();
    for (name, method) in [("hull", PaletteMethod::Hull), ("fitted", PaletteMethod::Fitted)] {
        for (count, colors) in [("4", ColorCount::Fixed(4)), ("auto", ColorCount::Auto { tolerance: 0.1 })] {
            let tolerance: &[&str] = if count == "auto" { &["--tolerance", "0.1"] } else { &[] };
            let arguments = ["palette", "--from-histograms", text(&histograms), "--method", name, "--colors", count];
            succeed(&[&arguments[..], tolerance].concat());
            let found = Palette::read(folder.join("h.palette.json")).unwrap();
            let settings = ExtractionSettings { method, colors, ..Default::default() };
            assert_eq!(found, extract(&read, &settings, &Progress::default()).unwrap().palette);
            assert_eq!(found.method, Some(method));
        }
    }
}

/// Writes arrays whose elements are all equal.
fn write_histograms(path: &Path, arrays: &[(&str, &[u64], f64)]) {
    let mut archive = zip::ZipWriter::new(fs::File::create(path).unwrap());
    for (name, shape, weight) in arrays {
        archive.start_file(format!("{name}.npy"), zip::write::FileOptions::default()).unwrap();
        let array = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut archive).begin_nd();
        let mut array = array.unwrap();
        array.extend(vec![*weight; shape.iter().product::<u64>() as usize]).unwrap();
        array.finish().unwrap();
    }
    archive.finish().unwrap();
}

/// More colors than palettes have: the program says that they are not met.
#[test]
fn unmet_tolerances_are_reported() {
    let path = folder("palette_tolerance").join("h.npz");
    write_histograms(&path, &[("fine", &[4, 4, 4], 1.0), ("coarse", &[2, 2, 2], 1.0)]);
    let said = |tolerance: &str| {
        let from = ["palette", "--from-histograms", text(&path)];
        let Output { stderr, status, .. } = run(&[&from[..], &["--colors", "auto", "--tolerance", tolerance]].concat());
        assert!(status.success());
        String::from_utf8(stderr).unwrap()
    };
    assert_eq!(said("0.9"), "");
    let warning = said("0.001");
    assert!(
        warning.contains("h.npz: the error of 40 colors is 0.") && warning.contains("--tolerance 0.001"),
        "{warning}"
    );
}

#[test]
fn bad_histograms_are_rejected() {
    let folder = folder("palette_bad_histograms");
    let field = ball(&folder);
    let path = folder.join("h.npz");
    let reject = |arrays: &[(&str, &[u64], f64)], message: &str| {
        write_histograms(&path, arrays);
        let found = fail(&["palette", "--from-histograms", text(&path)]);
        assert!(found.contains("h.npz") && found.contains(message), "{found}");
    };
    reject(&[("fine", &[4, 4, 4], 1.0)], "coarse");
    reject(&[("fine", &[4, 4], 1.0), ("coarse", &[2, 2, 2], 1.0)], "[4, 4]");
    reject(&[("fine", &[2, 4, 4], 1.0), ("coarse", &[2, 2, 2], 1.0)], "[2, 4, 4]");
    reject(&[("fine", &[4, 4, 4], f64::NAN), ("coarse", &[2, 2, 2], 1.0)], "bin 0");
    reject(&[("fine", &[4, 4, 4], -1.0), ("coarse", &[2, 2, 2], 1.0)], "bin 0");
    reject(&[("fine", &[4, 4, 4], 0.0), ("coarse", &[2, 2, 2], 0.0)], "nothing of the field is visible");
    let reject = |bytes: &[u8], message: &str| {
        fs::write(&path, bytes).unwrap();
        let found = fail(&["palette", "--from-histograms", text(&path)]);
        assert!(found.contains("h.npz") && found.contains(message), "{found}");
    };
    reject(b"no archive", "found no zip directory at the end, expected an npz archive");
    // A header of 4 GB, and a zip64 directory somewhere.
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    archive.start_file("fine.npy", zip::write::FileOptions::default()).unwrap();
    archive.write_all(b"\x93NUMPY\x02\x00\xf0\xff\xff\xff{").unwrap();
    reject(&archive.finish().unwrap().into_inner(), "fine: found an npy header of 4294967280 bytes");
    let end = [&b"PK\x06\x07\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0PK\x05\x06\0\0\0\0"[..], &[255; 12], &[0; 2]].concat();
    reject(&[vec![0; 1 << 22], end].concat(), "found a misplaced zip64 directory");
    fail(&["palette", "--from-histograms", text(&path), text(&field)]);
    fail(&["palette"]);
    fail(&["palette", text(&field), "--colors", "few"]);
    fail(&["palette", text(&field), "--tolerance", "0"]);
    fail(&["palette", text(&field), "--method", "guess"]);
}

#[test]
fn bad_input_is_rejected() {
    let folder = folder("palette_bad");
    assert!(fail(&["palette", text(&folder.join("missing.npz"))]).contains("missing.npz"));
    let broken = folder.join("broken.npz");
    fs::write(&broken, "no archive").unwrap();
    assert!(fail(&["palette", text(&broken)]).contains("broken.npz"));

    let field = ball(&folder);
    fail(&["palette", text(&field), "--colors", "0"]);
    fail(&["palette", text(&field), "--sample-fraction", "2"]);
    let message = fail(&["palette", text(&field), "--sampling", "reference", "--sample-fraction", "0.5"]);
    assert!(message.contains("ball.npz"), "{message}");
}

/// Nothing overwrites the field, or one output another, and wrong options are found before anything is written.
#[test]
fn outputs_replace_no_input() {
    let folder = folder("palette_outputs");
    let field = ball(&folder);
    let before = fs::read(&field).unwrap();
    let out = folder.join("p.json");
    let link = folder.join("other/../ball.npz");
    fs::create_dir(folder.join("other")).unwrap();
    for (arguments, named) in [
        (["--out", text(&link)], "ball.npz"),
        (["--histograms", text(&field)], "ball.npz"),
        (["--out", text(&folder)], "palette_outputs"),
        (["--out", text(&folder.join("ball.npz/p.json"))], "ball.npz: cannot be created"),
        (["--image", text(&folder.join("p.gif"))], "p.gif"),
    ] {
        let message = fail(&["palette", text(&field), arguments[0], arguments[1]]);
        assert!(message.contains(named), "{message}");
    }
    fail(&["palette", text(&field), "--out", text(&out), "--histograms", text(&out)]);
    let message = fail(&["palette", text(&field), "--colors", "4", "--tolerance", "0.1"]);
    assert!(message.contains("--colors 4"), "{message}");
    assert_eq!(fs::read(&field).unwrap(), before);
    let mut names: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["ball.npz", "other"]);
}

/// What was edited by hand is kept, however often the palette is extracted anew.
#[test]
fn former_palettes_are_kept() {
    let folder = folder("palette_former");
    let field = ball(&folder);
    let [file, old, older] =
        ["ball.palette.json", "ball.palette.json.old2", "ball.palette.json.old"].map(|name| folder.join(name));
    succeed(&["palette", text(&field)]);
    succeed(&["palette", text(&field)]);
    assert!(!older.exists(), "nothing was lost");
    let mut edited = Palette::read(&file).unwrap();
    edited.rename_ramp(0, "shell").unwrap();
    edited.write(&file).unwrap();
    for _ in 0..2 {
        for colors in ["auto", "3"] {
            succeed(&["palette", text(&field), "--colors", colors]);
        }
    }
    assert_eq!(Palette::read(&older).unwrap(), edited);
    assert!(old.exists() && Palette::read(&file).unwrap().colors.len() == 3);
}

/// Ramps are listed, and changed ones are saved: to the same file, of which a copy is kept, or to another.
#[test]
fn ramps_are_edited() {
    let folder = folder("palette_ramps");
    let field = ball(&folder);
    succeed(&["palette", text(&field)]);
    let [file, other] = ["ball.palette.json", "edited/other.json"].map(|name| folder.join(name));
    let before = Palette::read(&file).unwrap();
    let listed = succeed(&["ramps", text(&file)]);
    assert!(listed.contains(&format!("ramp 0: {}, ", before.ramps[0].name)), "{listed}");
    assert_eq!(Palette::read(&file).unwrap(), before);

    let edit = format!("shell={}", before.ramps[0].name);
    let message = fail(&["ramps", text(&file), &edit, "--out", text(&folder.join("field.npz"))]);
    assert!(message.contains("must end in .json"), "{message}");
    let printed = succeed(&["ramps", text(&file), &edit, "rest=1,2", "--out", text(&other)]);
    assert!(printed.contains("ramp 0: shell, ") && printed.contains(": rest, "), "{printed}");
    assert_eq!(Palette::read(&file).unwrap(), before);
    let mut expected = before.clone();
    expected.rename_ramp(0, "shell").unwrap();
    expected.gather_tones(&[1, 2], "rest").unwrap();
    assert_eq!(Palette::read(&other).unwrap(), expected);
    succeed(&["ramps", text(&file), &edit, "rest=1,2"]);
    assert_eq!(Palette::read(&file).unwrap(), expected);
    assert_eq!(Palette::read(folder.join("ball.palette.json.old")).unwrap(), before);

    let image = |path: &Path| fail(&["ramps", text(&file), "--image", text(path)]);
    assert!(image(&file).contains("must end in .png"));
    let png = folder.join("palette.png");
    fs::copy(&file, &png).unwrap();
    let message = fail(&["ramps", text(&png), "--image", text(&png)]);
    assert!(message.contains("would overwrite its input"), "{message}");
    assert_eq!(Palette::read(&png).unwrap(), expected);

    let error = fail(&["ramps", text(&file), "a=b"]);
    assert!(error.contains("ball.palette.json: a: found no ramp b, expected one of shell"), "{error}");
    assert_eq!(Palette::read(&file).unwrap(), expected);

    // What cannot be replaced is found before a copy is made.
    let mut permissions = fs::metadata(&file).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&file, permissions).unwrap();
    let error = fail(&["ramps", text(&file), "body=shell"]);
    assert!(error.contains("ball.palette.json: cannot be written") && !error.contains("replaced"), "{error}");
    assert!(!folder.join("ball.palette.json.old2").exists());
}
