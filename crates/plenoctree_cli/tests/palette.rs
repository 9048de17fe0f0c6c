//! `plenoctree palette`.

mod common;

use std::fs;

use common::{ball, fail, folder, succeed, text};
use plenoctree::{
    LoadSettings, PlenOctree,
    palette::{ExtractionSettings, Palette, extract},
    sampling::Progress,
};

/// The palette is saved next to the field and equals the one that the library extracts.
#[test]
fn the_palette_equals_that_of_the_library() {
    let field = ball(&folder("palette_default"));
    let printed = succeed(&["palette", text(&field)]);
    let found = Palette::read(field.with_file_name("ball.palette.json")).unwrap();
    assert!(printed.contains("ball.palette.json"), "{printed}");
    assert_eq!(printed.matches('#').count(), found.colors.len());

    let read = PlenOctree::read(&field, &LoadSettings::default()).unwrap();
    let settings = ExtractionSettings::default();
    assert_eq!(found, extract(&read, &settings, &Progress::default()).unwrap().palette);
}

#[test]
fn all_requested_files_are_written() {
    let folder = folder("palette_files");
    let field = ball(&folder);
    let [out, image, histograms] = ["p.json", "p.png", "h.npz"].map(|name| folder.join(name));
    let sampling = ["--sampling", "reference", "--colors", "8"];
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
