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

#[test]
fn errors_name_unknown_props() {
    assert!(fail(&["bake", "no_prop"]).contains("no_prop"));
}
