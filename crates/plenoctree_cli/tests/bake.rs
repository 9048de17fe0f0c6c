//! `plenoctree bake`.

mod common;

use common::{fail, folder, succeed, text};
use plenoctree::{LoadSettings, PlenOctree};

#[test]
fn a_prop_is_baked() {
    let folder = folder("bake_robot");
    let printed = succeed(&["bake", "robot", "--depth", "4", "--out", text(&folder)]);
    let read = |name: &str| PlenOctree::read(folder.join(name), &LoadSettings::default()).unwrap();
    let packed = read("robot.plenoctree");
    assert_eq!((packed.depth(), packed.codebook().is_some()), (4, true));
    assert!(printed.contains(&format!("robot.plenoctree: {} leaves", packed.leaves())), "{printed}");
    assert!(!folder.join("drum.plenoctree").exists() && !folder.join("robot.npz").exists());

    let printed = succeed(&["bake", "robot", "--depth", "4", "--out", text(&folder), "--npz"]);
    let field = read("robot.npz");
    assert!(field.codebook().is_none() && packed.leaves() <= field.leaves());
    assert!(printed.contains(&format!("robot.npz: {} leaves", field.leaves())), "{printed}");
}

/// Pictures of a prop show what renderings of its field show, from the same cameras.
#[test]
fn pictures_show_the_prop_where_its_field_is() {
    let folder = folder("bake_pictures");
    let [out, views, drawn] = [folder.clone(), folder.join("robot"), folder.join("drawn")];
    succeed(&["bake", "robot", "--pictures", "5", "--size", "96", "--out", text(&out)]);
    succeed(&["bake", "robot", "--depth", "7", "--npz", "--out", text(&out)]);
    let (field, cameras) = (folder.join("robot.npz"), views.join("transforms.json"));
    succeed(&["render", text(&field), "--cameras", text(&cameras), "--size", "96x96", "--out", text(&drawn)]);
    for index in 0..5 {
        let taken = image::open(views.join(format!("view_{index:03}.png"))).unwrap().into_rgba8();
        let drawn = image::open(drawn.join(format!("{index:03}.png"))).unwrap().into_rgba8();
        let (mut seen, mut different, mut difference) = (0.0, 0.0, 0.0);
        for (a, b) in taken.pixels().zip(drawn.pixels()) {
            let opacity = |pixel: &image::Rgba<u8>| f64::from(pixel[3]) / 255.0;
            seen += opacity(a);
            different += (opacity(a) - opacity(b)).abs();
            if opacity(a).min(opacity(b)) > 0.99 {
                difference +=
                    (0..3).map(|channel| f64::from(a[channel].abs_diff(b[channel])) / 255.0 / 3.0).sum::<f64>();
            }
        }
        assert!(seen > 1000.0, "view {index}: {seen} pixels");
        assert!(different < 0.15 * seen, "view {index}: opacity differs in {different} of {seen} pixels");
        assert!(difference < 0.2 * seen, "view {index}: colors differ by {}", difference / seen);
    }
}

#[test]
fn errors_name_unknown_props() {
    assert!(fail(&["bake", "no_prop"]).contains("no_prop"));
}

/// The included chest is fitted: baking must not replace it unasked.
#[test]
fn a_fitted_prop_is_not_baked_into_the_assets() {
    assert!(fail(&["bake", "robot", "chest"]).contains("assets/chest.plenoctree"));
    assert!(fail(&["bake", "robot", "--size", "96"]).contains("--pictures"));
}
