//! The arguments of `render`.

use std::path::PathBuf;

use clap::Args;

use crate::{capture::CaptureArguments, field::FieldArguments, hex, size::parse_size};

/// Render views of a capture or of a field.
#[derive(Args)]
pub struct Arguments {
    /// A capture of Gaussian splats (.ply, .spz, .sog, meta.json, .splat, .glb or .gltf), or a field (.npz or
    /// .plenoctree).
    pub input: PathBuf,
    /// The cameras: a transforms.json file, in the coordinates of the capture.
    #[arg(long, value_name = "FILE")]
    pub cameras: PathBuf,
    /// The size of the images; by default, that of the cameras.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// The background color. By default, the images are transparent.
    #[arg(long, value_name = "#RRGGBB", value_parser = hex::parse)]
    pub background: Option<[u8; 3]>,
    /// The folder to write 000.png and so on to.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// Print only warnings and errors.
    #[arg(long)]
    pub quiet: bool,
    /// How to read the capture.
    #[command(flatten)]
    pub capture: CaptureArguments,
    /// How to read the field.
    #[command(flatten)]
    pub field: FieldArguments,
}
