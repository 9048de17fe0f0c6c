//! The arguments of `convert`.

use std::path::PathBuf;

use clap::Args;
use glam::DVec3;
use plenoctree_fit::splat::Axis;

use crate::{
    boxes::parse_box,
    capture::CaptureArguments,
    extraction::ExtractionArguments,
    names::one_of,
    number::{parse_distance, parse_positive},
};

/// Convert a capture of Gaussian splats to a field, and extract its palette.
#[derive(Args)]
pub struct Arguments {
    /// A capture: .ply, .spz, .sog, the meta.json of SOG or its folder, .splat, .glb or .gltf.
    pub capture: PathBuf,
    /// The field to write; packed if the name ends in .plenoctree. Its palette, views and report.json are written next
    /// to it.
    #[arg(long, value_name = "PROP")]
    pub out: PathBuf,
    /// The number of levels of cells: the finest are 2^-DEPTH of the field's cube wide. By default, as many as make
    /// cells about a pixel wide at the distance --near. 6 to 10.
    #[arg(long, value_parser = clap::value_parser!(u32).range(6..=10))]
    pub depth: Option<u32>,
    /// The most leaves, 32768 to 20000000. They are small where the capture shows detail, and there are fewer if more
    /// would hardly show.
    #[arg(long, value_name = "N", default_value_t = 3_000_000,
        value_parser = clap::value_parser!(u32).range(32_768..=20_000_000))]
    pub leaves: u32,
    /// Instead of a number of leaves: as many as it takes, up to 8000000, to look this much like the capture, in decibels
    /// of PSNR: the mean over pictures from the distance --near, over white, before refining.
    #[arg(long, value_name = "DB", value_parser = parse_positive, conflicts_with = "leaves")]
    pub quality: Option<f64>,
    /// The distance from the middle of the box from which the field must look right, in the capture's units. By
    /// default, it is half the longest side of the box: up close.
    #[arg(long, value_name = "DISTANCE", value_parser = parse_distance)]
    pub near: Option<f64>,
    /// The box to convert, in the coordinates of the capture: x,y,z of its lowest and of its highest corner. By
    /// default, it contains most Gaussians.
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = parse_box, allow_hyphen_values = true)]
    pub crop: Option<(DVec3, DVec3)>,
    /// Keep only the largest connected part, without floaters and backgrounds.
    #[arg(long)]
    pub keep_largest: bool,
    /// Only add up the Gaussians in the cells; do not refine the field with pictures of the capture.
    #[arg(long)]
    pub no_refine: bool,
    /// The longest time for refining, in minutes, without what comes before and after it. It ends earlier when it would
    /// gain less than 0.02 dB in a tenth of this time. By default, --effort limits it.
    #[arg(long, value_parser = parse_positive, conflicts_with = "no_refine")]
    pub minutes: Option<f64>,
    /// The most refining, as a multiple of the default. It ends earlier when it would gain less than 0.02 dB in a tenth
    /// of that.
    #[arg(long, default_value_t = 1.0, value_parser = parse_positive, conflicts_with = "no_refine")]
    pub effort: f64,
    /// The width and height of the capture's pictures, in pixels, 16 to 2048.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u32).range(16..=2048))]
    pub picture_size: u32,
    /// Turn the field upright, so that z is up, and place it on the origin. Otherwise, it keeps the coordinates of the
    /// capture.
    #[arg(long)]
    pub stand: bool,
    /// With --stand, the direction that is up in the capture. By default, what the file says, or else -y, as in the
    /// .ply files of most trainers.
    #[arg(long, value_parser = one_of(Axis::ALL, Axis::name), allow_hyphen_values = true, requires = "stand")]
    pub up: Option<Axis>,
    /// The seed of the random numbers.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// The number of threads; by default, one for each core.
    #[arg(long, default_value_t = 0, hide_default_value = true, value_parser = clap::value_parser!(u32).range(0..=1024))]
    pub threads: u32,
    /// How to read the capture.
    #[command(flatten)]
    pub reading: CaptureArguments,
    /// The arguments for extraction.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
}
