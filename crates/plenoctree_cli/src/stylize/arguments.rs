//! The arguments of `stylize`.

use std::path::{Path, PathBuf};

use clap::Args;
use plenoctree::{
    LABEL_OPACITY,
    palette::{LabelSpace, Palette},
    reference::Posterization,
};

use crate::{
    extraction::{ExtractionArguments, Sampling},
    field::FieldArguments,
    files, hex,
    preset::Preset,
    renderer::{PosterizeSettings, Renderer},
    result::Result,
    size::parse_size,
};

use super::{
    look::NamedLook,
    output,
    pixel::{self, PixelWish},
    recolor::{self, Recoloring},
};

/// Render views of a field, extract its palette, and posterize and recolor the views.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; by default the included toadstool.
    pub field: Option<PathBuf>,
    /// How to read the field.
    #[command(flatten)]
    pub reading: FieldArguments,
    /// The folder for the images, the palette and report.json.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// A transforms.json file (NeRF, nerfstudio) in the field's coordinates, to use instead of a turntable.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// The number of views; by default 8 on a turntable, or all of --cameras.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    /// Size of the images in pixels, each side 1 to 16384; by default 800x800, or the size in --cameras.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// A palette.json file to use instead of extracting a palette.
    #[arg(long, conflicts_with_all = ["method", "colors", "tolerance", "sampling", "sample_fraction", "histograms"])]
    pub palette: Option<PathBuf>,
    /// The look. It sets --method and --softness unless they are given, and the filter, smooth edges and ink.
    #[arg(long, value_enum, default_value_t)]
    pub look: NamedLook,
    /// The arguments for extraction.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
    /// The sampler of the field's radiance; by default the GPU, or the CPU if there is no GPU or no support for it.
    #[arg(long, value_enum)]
    pub sampling: Option<Sampling>,
    /// The number of steps from one palette color to another, 1 to 8; by default 3. Palettes of tones have no blends.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=8))]
    blend_steps: Option<u32>,
    /// The distance over which labels blend, in encoded sRGB, or in tone space for palettes of tones, 0 to 10; 0 is a
    /// hard border. By default that of --look.
    #[arg(long, value_parser = |text: &str| parse_number(text, 10.0))]
    softness: Option<f32>,
    /// The opacity below which pixels are drawn as trained.
    #[arg(long, default_value_t = LABEL_OPACITY as f32, value_parser = |text: &str| parse_number(text, 1.0))]
    min_opacity: f32,
    /// With --look paper, smooth silhouettes and, if --softness is 0, borders between labels. The other looks are
    /// always smooth. Requires --renderer gpu.
    #[arg(long)]
    smooth_edges: bool,
    /// Show another color in place of a palette color, given by its index, or of a ramp, given by its name or as
    /// ramp:INDEX; can be repeated.
    #[arg(long, value_name = "INDEX|RAMP=#RRGGBB", value_parser = recolor::parse)]
    recolor: Vec<Recoloring>,
    /// Give the pixel X,Y of the first view this color, and recolor the ramp of its palette color with it; can be
    /// repeated. Pixels count from 0 at the top left.
    #[arg(long, value_name = "X,Y=#RRGGBB", value_parser = pixel::parse)]
    pub pixel: Vec<PixelWish>,
    /// The background color.
    #[arg(long, value_name = "#RRGGBB", default_value = "#ffffff", value_parser = hex::parse)]
    pub background: [u8; 3],
    /// The quality preset of the GPU renderer; does not affect extraction.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Preset,
    /// The renderer.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: Renderer,
    /// Print only warnings and errors.
    #[arg(long)]
    pub quiet: bool,
}

impl Arguments {
    /// Returns the maximum number of views to render.
    pub fn frames(&self) -> Option<usize> {
        self.frames.map(|frames| frames as usize)
    }

    /// Returns the settings of posterization with a palette.
    pub fn posterize(&self, palette: &Palette) -> PosterizeSettings {
        let look = self.look.posterization();
        let blend_steps = match palette.label_space() {
            LabelSpace::Encoded => self.blend_steps.unwrap_or(look.blend_steps),
            // Tones do not blend, whatever the argument says.
            LabelSpace::Tones => 1,
        };
        let is_smooth = self.renderer != Renderer::Reference && self.look != NamedLook::Paper;
        let softness = self.softness.map_or(look.softness, f64::from);
        let posterization = Posterization { blend_steps, softness, min_opacity: self.min_opacity.into(), ..look };
        PosterizeSettings {
            posterization,
            smooth_edges: self.smooth_edges || is_smooth,
            ink: self.look == NamedLook::Comic,
        }
    }

    /// Checks what the parser cannot: settings that the reference does not have, and whether the histograms can be
    /// written. Creates the folder.
    pub fn check(&self, field: &Path) -> Result {
        if self.renderer == Renderer::Reference {
            let ignored = [
                (self.smooth_edges, "--smooth-edges"),
                (self.look == NamedLook::Comic, "--look comic"),
                (self.quality != Preset::Exact, "--quality"),
            ];
            if let Some((_, name)) = ignored.into_iter().find(|(given, _)| *given) {
                return Err(format!("{name} needs --renderer gpu").into());
            }
        }
        self.extraction.settings()?;
        let histograms = self.extraction.histograms.as_deref();
        let inputs: Vec<&Path> = [field].into_iter().chain(self.cameras.as_deref()).collect();
        files::check_inputs(&inputs)?;
        files::create_folder(&self.out)?;
        files::check_folder(&self.out, &inputs, output::writes)?;
        // The palette is not written if it is there already.
        let palette: Vec<&Path> = self.palette.as_deref().into_iter().collect();
        files::check_folder(&self.out, &palette, |name| name != output::PALETTE && output::writes(name))?;
        let outputs = output::single(&self.out, self.palette.as_deref());
        let outputs: Vec<&Path> = outputs.iter().map(PathBuf::as_path).chain(histograms).collect();
        files::check_outputs(&outputs, &inputs)
    }

    /// Returns the shown colors with the recolorings from the command line, or `None` if nothing is recolored, neither
    /// in the file of the palette nor by palette color, ramp or pixel.
    pub fn recolored(&self, palette: &Palette) -> Result<Option<Vec<[f64; 3]>>, String> {
        if self.recolor.is_empty() && self.pixel.is_empty() && palette.shown.is_empty() {
            return Ok(None);
        }
        recolor::apply(&self.recolor, palette).map(Some)
    }
}

fn parse_number(text: &str, most: f32) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|number| (0.0..=most).contains(number))
        .ok_or_else(|| format!("expected a number from 0 to {most}"))
}
