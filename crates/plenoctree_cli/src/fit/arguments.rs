//! The arguments of `fit`.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use clap::Args;
use glam::DVec3;
use plenoctree::Basis;
use plenoctree_fit::{FitSettings, InputFolders};

use crate::{boxes::parse_box, extraction::ExtractionArguments, hex, number::parse_positive};

/// Fit a field to photographs or to a glTF model, and extract its palette.
#[derive(Args)]
pub struct Arguments {
    /// A transforms.json file, a folder with one, a folder with a COLMAP model, or a .gltf or .glb file.
    pub input: PathBuf,
    /// The field to write; packed if the name ends in .plenoctree. Its palette, previews and report.json are written
    /// next to it.
    #[arg(long, value_name = "PROP")]
    pub out: PathBuf,
    /// The time for training, in minutes. If it is short, the finest cells are left out. By default, --effort decides.
    #[arg(long, value_parser = parse_positive)]
    minutes: Option<f64>,
    /// The amount of training, as a multiple of the default.
    #[arg(long, default_value_t = 1.0, value_parser = parse_positive, conflicts_with = "minutes")]
    effort: f64,
    /// Hold out one of every N views, to measure the result.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..))]
    holdout: u32,
    /// Fit to all views; hold out none.
    #[arg(long, conflicts_with = "holdout")]
    all: bool,
    /// Other views to measure the result on, as an input like INPUT. No views of INPUT are held out then.
    #[arg(long, value_name = "INPUT", conflicts_with = "holdout")]
    pub test: Option<PathBuf>,
    /// Average every N x N pixels, 1 to 64.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    downscale: u32,
    /// The most leaves of the field, 32768 to 20000000. They are small where that improves pictures most.
    #[arg(long, value_name = "N", default_value_t = 1_000_000,
        value_parser = clap::value_parser!(u32).range(32_768..=20_000_000))]
    leaves: u32,
    /// The most levels of cells: the finest are 2^-DEPTH of the field's cube wide. By default, as many as make them
    /// about half a pixel wide, 7 to 9. 6 to 10.
    #[arg(long, value_parser = clap::value_parser!(u32).range(6..=10))]
    depth: Option<u32>,
    /// The number of spherical harmonics per channel: 1, 4, 9 or 16.
    #[arg(long, default_value = "9", value_parser = parse_basis)]
    sh: Basis,
    /// For glTF models: the number of pictures to render, 8 to 10000; by default 120.
    #[cfg(feature = "gltf")]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=10_000))]
    pub views: Option<u32>,
    /// For glTF models: the width and height of the pictures, in pixels, 16 to 4096; by default 400.
    #[cfg(feature = "gltf")]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub size: Option<u32>,
    /// The box to fit, in the frame of the cameras: x,y,z of its lowest and of its highest corner.
    #[arg(long = "box", value_name = "X,Y,Z,X,Y,Z", value_parser = parse_box, allow_hyphen_values = true)]
    bounds: Option<(DVec3, DVec3)>,
    /// The box to cut the field to after it is fitted.
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = parse_box, allow_hyphen_values = true)]
    crop: Option<(DVec3, DVec3)>,
    /// Keep only the largest connected part.
    #[arg(long)]
    keep_largest: bool,
    /// Turn the field upright, using the direction that the cameras agree is up, and place it on the origin.
    #[arg(long)]
    stand: bool,
    /// Resume an earlier fit to the same file that was stopped. A better result that is there already is kept.
    #[arg(long)]
    resume: bool,
    /// The color behind the object; by default, it is learned from opaque pictures.
    #[arg(long, value_name = "#RRGGBB", value_parser = hex::parse)]
    pub background: Option<[u8; 3]>,
    /// The folder of the pictures of INPUT, if it is not the usual one.
    #[arg(long, value_name = "FOLDER")]
    pub pictures: Option<PathBuf>,
    /// A folder of masks, as name.jpg.png, name.png or name.jpg for name.jpg. White shows the object.
    #[arg(long, value_name = "FOLDER")]
    pub masks: Option<PathBuf>,
    /// The seed of the random numbers.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The number of threads; by default, one for each core.
    #[arg(long, default_value_t = 0, hide_default_value = true, value_parser = clap::value_parser!(u32).range(0..=1024))]
    pub threads: u32,
    /// The arguments for extraction.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
}

impl Arguments {
    /// Returns the settings from the command line.
    pub fn settings(&self) -> FitSettings {
        FitSettings {
            leaves: self.leaves as usize,
            depth: self.depth,
            basis: self.sh,
            downscale: self.downscale,
            bounds: self.bounds,
            background: self.background.map(|color| DVec3::from_array(hex::unit(color))),
            hold_out: (!self.all).then_some(self.holdout),
            effort: self.effort,
            time: self.minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes)),
            seed: self.seed,
            keep_largest: self.keep_largest,
            crop: self.crop,
            stand: self.stand,
            checkpoint: Some(self.out.with_added_extension("checkpoint")),
            resume: self.resume,
            ..FitSettings::default()
        }
    }

    /// Returns the inputs that must exist.
    pub fn inputs(&self) -> Vec<&Path> {
        [&self.input].into_iter().chain(&self.test).chain(&self.masks).map(PathBuf::as_path).collect()
    }

    /// Returns the folders of the input.
    pub fn folders(&self) -> InputFolders {
        InputFolders { pictures: self.pictures.clone(), masks: self.masks.clone(), ignored: Vec::new() }
    }
}

fn parse_basis(text: &str) -> Result<Basis, String> {
    let basis = text.parse().ok().and_then(Basis::from_functions).filter(|basis| *basis != Basis::Sh25);
    basis.ok_or_else(|| "expected 1, 4, 9 or 16".into())
}
