//! `bake`: bakes the included props from procedural scenes, to fields that look trained, and packs them.

mod arguments;
mod drum;
mod gumballs;
mod noise;
mod prop;
mod robot;
mod sdf;
mod shade;
mod toadstool;
mod visits;

pub use arguments::Arguments;

use std::{fs, time::Instant};

use indicatif::ProgressBar;
use plenoctree::{BakeError, PlenOctree};

use self::{drum::Drum, gumballs::Gumballs, prop::bake_prop, robot::Robot, toadstool::Toadstool};
use crate::{
    console, files,
    pack::{Quality, pack_unchanged},
    progress,
    result::Result,
};

/// How the props are packed.
const QUALITY: Quality = Quality::Fine;

/// Bakes a prop at the given depth, or at its own, and shows the progress.
type Bake = fn(Option<u32>, &ProgressBar) -> Result<PlenOctree, BakeError>;

/// All props by name.
const PROPS: [(&str, Bake); 4] = [
    ("toadstool", |depth, bar| bake_prop(&Toadstool::new(), depth, bar)),
    ("drum", |depth, bar| bake_prop(&Drum, depth, bar)),
    ("gumballs", |depth, bar| bake_prop(&Gumballs::new(), depth, bar)),
    ("robot", |depth, bar| bake_prop(&Robot, depth, bar)),
];

/// Bakes the named props, or all of them.
pub fn run(arguments: &Arguments) -> Result {
    if let Some(name) = arguments.names.iter().find(|name| PROPS.iter().all(|(known, _)| known != name)) {
        let known = PROPS.map(|(name, _)| name).join(", ");
        return Err(format!("no prop is named {name}, expected one of {known}").into());
    }
    files::create_folder(&arguments.out)?;
    for (name, bake) in PROPS {
        if !arguments.names.is_empty() && arguments.names.iter().all(|requested| requested != name) {
            continue;
        }
        let start = Instant::now();
        let extension = if arguments.npz { "npz" } else { "plenoctree" };
        let path = arguments.out.join(name).with_extension(extension);
        let named = |error: &dyn std::error::Error| format!("{}: {error}", path.display());
        let bar = progress::bar(name, 0, false);
        let field = bake(arguments.depth, &bar).map_err(|error| named(&error))?;
        bar.finish_and_clear();
        let leaves = if arguments.npz {
            field.write(&path).map_err(|error| named(&error))?;
            field.leaves()
        } else {
            let packed = pack_unchanged(&field, &QUALITY.settings()).map_err(|error| named(&*error))?;
            packed.write(&path).map_err(|error| named(&error))?;
            packed.field().leaves()
        };
        let size = fs::metadata(&path).map_err(|error| named(&error))?.len() as f64 / 1e6;
        console::say!("{}: {leaves} leaves, {size:.2} MB, {:.1} s", path.display(), start.elapsed().as_secs_f64());
    }
    Ok(())
}
