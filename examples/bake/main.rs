//! Bakes the project's own props: procedural scenes made into fields like trained ones.
//!
//! ```sh
//! cargo run --release --example bake -- [--out DIR] [--depth LEVELS] [NAME...]
//! ```

mod drum;
mod gumballs;
mod noise;
mod prop;
mod robot;
mod sdf;
mod shade;
mod toadstool;

use std::{error::Error, fs, path::PathBuf, time::Instant};

use bevy_plenoctree::field::{BakeError, PlenOctree};
use clap::Parser;

use self::{drum::Drum, gumballs::Gumballs, prop::bake_prop, robot::Robot, toadstool::Toadstool};

/// Bakes props into .npz files.
#[derive(Parser)]
struct Options {
    /// Folder for the files.
    #[arg(long, default_value = "assets")]
    out: PathBuf,
    /// Levels of the fields; each prop's own if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10))]
    depth: Option<u32>,
    /// Props to bake; all if none is named.
    names: Vec<String>,
}

/// Bakes at a depth, or at the prop's own.
type Bake = fn(Option<u32>) -> Result<PlenOctree, BakeError>;

const PROPS: [(&str, Bake); 4] = [
    ("toadstool", |depth| bake_prop(&Toadstool::new(), depth)),
    ("drum", |depth| bake_prop(&Drum, depth)),
    ("gumballs", |depth| bake_prop(&Gumballs::new(), depth)),
    ("robot", |depth| bake_prop(&Robot, depth)),
];

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    if let Some(name) = options.names.iter().find(|name| PROPS.iter().all(|(known, _)| known != name)) {
        return Err(format!("no prop is called {name}; there are {}", PROPS.map(|(name, _)| name).join(", ")).into());
    }
    fs::create_dir_all(&options.out)?;
    for (name, bake) in PROPS {
        if !options.names.is_empty() && options.names.iter().all(|wanted| wanted != name) {
            continue;
        }
        let start = Instant::now();
        let field = bake(options.depth)?;
        let path = options.out.join(name).with_extension("npz");
        field.write(&path)?;
        let size = fs::metadata(&path)?.len() as f64 / 1e6;
        println!("{}: {} leaves, {size:.2} MB, {:.1} s", path.display(), field.leaves(), start.elapsed().as_secs_f64());
    }
    Ok(())
}
