//! `lab bake`.

#[path = "../../plenoctree_cli/tests/common/mod.rs"]
mod common;

use common::{fail, folder, succeed, text};
use glam::DVec3;
use plenoctree::{LoadSettings, PlenOctree, reference::render};
use plenoctree_fit::read_transforms;

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

/// Pictures of a prop show what renderings of its field show, from the same cameras, and nothing is in the air.
#[test]
fn pictures_show_the_prop_where_its_field_is() {
    let folder = folder("bake_pictures");
    let views = folder.join("robot");
    succeed(&["bake", "robot", "--pictures", "5", "--size", "96", "--out", text(&folder)]);
    succeed(&["bake", "robot", "--depth", "7", "--npz", "--out", text(&folder)]);
    let field = PlenOctree::read(folder.join("robot.npz"), &LoadSettings::default()).unwrap();
    let cameras = read_transforms(views.join("transforms.json"), Some((96, 96))).unwrap();
    assert_eq!(cameras.len(), 5);
    for (index, camera) in cameras.iter().enumerate() {
        let taken = image::open(views.join(format!("view_{index:03}.png"))).unwrap().into_rgba8();
        let drawn = render(&field, camera);
        let (mut seen, mut different, mut difference) = (0.0, 0.0, 0.0);
        for (pixel, (color, opacity)) in taken.pixels().zip(drawn.color.iter().zip(&drawn.opacity)) {
            let [r, g, b, taken_opacity] = pixel.0.map(|byte| f64::from(byte) / 255.0);
            seen += taken_opacity;
            different += (taken_opacity - opacity).abs();
            if taken_opacity.min(*opacity) > 0.99 {
                difference += (DVec3::new(r, g, b) - color).abs().element_sum() / 3.0;
            }
        }
        for (pixel, &opacity) in drawn.opacity.iter().enumerate().filter(|(_, opacity)| **opacity > 0.0) {
            let (x, y) = (pixel % 96, pixel / 96);
            let near = |at: usize| at.saturating_sub(3) as u32..=(at as u32 + 3).min(95);
            let is_near = near(y).any(|y| near(x).any(|x| taken.get_pixel(x, y)[3] > 0));
            assert!(is_near, "there is {opacity} at {x}, {y}, where the picture shows nothing");
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
