//! `plenoctree bake`.

mod common;

use common::{fail, folder, succeed, text};
use plenoctree::{LoadSettings, PlenOctree};

#[test]
fn a_prop_is_baked() {
    let folder = folder("bake_robot");
    let printed = succeed(&["bake", "robot", "--depth", "4", "--out", text(&folder)]);
    let field = PlenOctree::read(folder.join("robot.npz"), &LoadSettings::default()).unwrap();
    assert_eq!(field.depth(), 4);
    assert!(printed.contains("robot.npz") && printed.contains(&format!("{} leaves", field.leaves())), "{printed}");
    assert!(!folder.join("drum.npz").exists());
}

#[test]
fn errors_name_unknown_props() {
    assert!(fail(&["bake", "no_prop"]).contains("no_prop"));
}
