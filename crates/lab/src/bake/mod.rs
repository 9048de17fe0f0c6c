//! `bake`: bakes the included props from procedural scenes, to fields that look trained, and packs them; or takes
//! pictures of them, to fit fields to.

mod arguments;
mod chest;
mod drum;
mod gumballs;
mod noise;
mod photograph;
mod prop;
mod robot;
mod sdf;
mod shade;
mod toadstool;
mod visits;

pub use arguments::Arguments;

use std::{fs, path::Path, time::Instant};

use indicatif::ProgressBar;
use plenoctree::{BakeError, PlenOctree};
use plenoctree_cli::{
    console, files,
    pack::{Quality, pack_unchanged},
    progress,
    result::Result,
};

use self::{
    chest::Chest,
    drum::Drum,
    gumballs::Gumballs,
    photograph::photograph,
    prop::{Prop, bake_prop},
    robot::Robot,
    toadstool::Toadstool,
};

/// How the props are packed.
const QUALITY: Quality = Quality::Fine;

/// All props by name, and whether the included one is baked. The others are fitted to their pictures.
const PROPS: [(&str, bool, fn() -> Box<dyn Scene>); 5] = [
    ("toadstool", true, || Box::new(Toadstool::new())),
    ("drum", true, || Box::new(Drum)),
    ("gumballs", true, || Box::new(Gumballs::new())),
    ("robot", true, || Box::new(Robot)),
    ("chest", false, || Box::new(Chest::new())),
];

/// Bakes the named props, or all of them; or takes pictures.
pub fn run(arguments: &Arguments) -> Result {
    if let Some(name) = arguments.names.iter().find(|name| PROPS.iter().all(|(known, ..)| known != name)) {
        let known = PROPS.map(|(name, ..)| name).join(", ");
        return Err(format!("no prop is named {name}, expected one of {known}").into());
    }
    let named = |name| arguments.names.iter().any(|named| named == name);
    let into_assets = arguments.out.is_none() && arguments.pictures.is_none();
    if let Some((name, ..)) = PROPS.into_iter().find(|&(name, baked, _)| !baked && into_assets && named(name)) {
        let message =
            format!("assets/{name}.plenoctree is fitted to pictures, not baked: expected --pictures or --out");
        return Err(message.into());
    }
    let folder = arguments.folder();
    files::create_folder(folder)?;
    for (name, baked, scene) in PROPS {
        let requested = if arguments.names.is_empty() { baked } else { named(name) };
        if !requested {
            continue;
        }
        let scene = scene();
        let bar = progress::bar(name, 0, false);
        match arguments.pictures {
            Some(count) => scene.photograph(&folder.join(name), count, arguments.size, &bar)?,
            None => write(name, &*scene, arguments, &bar)?,
        }
    }
    Ok(())
}

/// Bakes a prop, and packs it.
fn write(name: &str, scene: &dyn Scene, arguments: &Arguments, bar: &ProgressBar) -> Result {
    let start = Instant::now();
    let extension = if arguments.npz { "npz" } else { "plenoctree" };
    let path = arguments.folder().join(name).with_extension(extension);
    let named = |error: &dyn std::error::Error| format!("{}: {error}", path.display());
    let field = scene.bake(arguments.depth, bar).map_err(|error| named(&error))?;
    bar.finish_and_clear();
    let leaves = if arguments.npz {
        field.write(&path).map_err(|error| named(&error))?;
        field.leaves()
    } else {
        let packed = pack_unchanged(&field, &QUALITY.settings()).map_err(|error| named(&error))?;
        packed.write(&path).map_err(|error| named(&error))?;
        packed.field().leaves()
    };
    let size = fs::metadata(&path).map_err(|error| named(&error))?.len() as f64 / 1e6;
    console::say!("{}: {leaves} leaves, {size:.2} MB, {:.1} s", path.display(), start.elapsed().as_secs_f64());
    Ok(())
}

/// A prop of any kind.
trait Scene {
    /// Bakes the prop at the given depth, or at its own, and shows the progress.
    fn bake(&self, depth: Option<u32>, bar: &ProgressBar) -> Result<PlenOctree, BakeError>;

    /// Takes pictures of the prop.
    fn photograph(&self, folder: &Path, count: u32, size: u32, bar: &ProgressBar) -> Result;
}

impl<T: Prop> Scene for T {
    fn bake(&self, depth: Option<u32>, bar: &ProgressBar) -> Result<PlenOctree, BakeError> {
        bake_prop(self, depth, bar)
    }

    fn photograph(&self, folder: &Path, count: u32, size: u32, bar: &ProgressBar) -> Result {
        photograph(self, folder, count, size, bar)
    }
}
