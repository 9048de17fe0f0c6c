//! Runs the demo, on a device with no more than browsers grant.

use std::process::Command;

/// It computes the palette of the toadstool, and draws all of its images, smaller than by default.
#[test]
fn the_demo_is_within_the_default_limits_of_webgpu() {
    let folder = tempfile::tempdir().unwrap();
    let demo = Command::new(env!("CARGO_BIN_EXE_headless"))
        .args([concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/toadstool.plenoctree"), "160"])
        .current_dir(&folder)
        .env("WGPU_SETTINGS_PRIO", "webgpu")
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&demo.stdout);
    assert!(demo.status.success(), "{printed}{}", String::from_utf8_lossy(&demo.stderr));
    assert!(printed.contains("radiance samples") && printed.contains("colors in"), "{printed}");
    let names = ["overview", "turntable", "frame_007.original", "frame_007.posterized", "frame_007.recolored"];
    let images = names
        .map(|name| image::open(folder.path().join("out").join(name).with_added_extension("png")).unwrap().into_rgb8());
    assert!(images.iter().all(|image| image.pixels().any(|pixel| pixel != image.get_pixel(0, 0))));
    let [_, _, original, posterized, recolored] = images;
    assert!(original != posterized && posterized != recolored);
}
