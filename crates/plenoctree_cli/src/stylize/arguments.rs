//! The arguments of `stylize`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use plenoctree::palette::Palette;

use super::renderer::Look;
use crate::{
    extraction::{ExtractionArguments, Sampling},
    hex,
    preset::Preset,
    size::parse_size,
};

/// Renders a field, extracts its palette, and posterizes and recolors the views.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz file; the toadstool of the repository by default.
    pub field: Option<PathBuf>,
    /// Where the images, the palette and report.json go.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// A transforms.json (NeRF, nerfstudio) in the field's frame, instead of a turntable.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// How many views; 8 on a turntable, or all of the cameras, by default.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    /// Size of the images in pixels, each side 1 to 16384; 800x800, or what the cameras say, by default.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// A palette.json to use instead of extracting one.
    #[arg(long, conflicts_with_all = ["colors", "sampling", "sample_fraction", "histograms"])]
    pub palette: Option<PathBuf>,
    /// How the palette is extracted.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
    /// What samples the field's radiance; the GPU if there is one and this build can use it, else the CPU, by default.
    #[arg(long, value_enum)]
    pub sampling: Option<Sampling>,
    /// Steps from one palette color to another.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=8))]
    blend_steps: u32,
    /// Distance in encoded RGB over which labels blend; 0 is a hard edge.
    #[arg(long, default_value_t = 0.2, value_parser = parse_softness)]
    softness: f32,
    /// Opacity under which a pixel is shown as rendered.
    #[arg(long, default_value_t = 80.0 / 255.0, value_parser = parse_share)]
    min_opacity: f32,
    /// Shows a palette color as another; can be given several times.
    #[arg(long, value_name = "INDEX=#RRGGBB", value_parser = parse_recolor)]
    recolor: Vec<(usize, [u8; 3])>,
    /// The color behind the field.
    #[arg(long, value_name = "#RRGGBB", default_value = "#ffffff", value_parser = hex::parse)]
    pub background: [u8; 3],
    /// How exactly the GPU draws; the palette's sampling has settings of its own.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Preset,
    /// What renders.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: Renderer,
    /// Prints nothing but errors.
    #[arg(long)]
    pub quiet: bool,
}

/// What makes the images.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Renderer {
    /// The plugin's passes, on whatever adapter wgpu finds.
    #[cfg(feature = "bevy")]
    #[default]
    Gpu,
    /// The float64 reference, on the CPU.
    #[cfg_attr(not(feature = "bevy"), default)]
    Reference,
}

impl Arguments {
    /// The most views to render.
    pub fn frames(&self) -> Option<usize> {
        self.frames.map(|frames| frames as usize)
    }

    /// The posterized look.
    pub fn look(&self) -> Look {
        Look { blend_steps: self.blend_steps, softness: self.softness, min_opacity: self.min_opacity }
    }

    /// The palette's colors with the changes that the command line asks for; `None` if it asks for none.
    pub fn recolored(&self, palette: &Palette) -> Result<Option<Vec<[f64; 3]>>, String> {
        if self.recolor.is_empty() {
            return Ok(None);
        }
        let mut colors = palette.colors.clone();
        for (index, color) in &self.recolor {
            let count = colors.len();
            let slot = colors
                .get_mut(*index)
                .ok_or_else(|| format!("--recolor {index}: the palette has {count} colors, 0 to {}", count - 1))?;
            *slot = color.map(|c| f64::from(c) / 255.0);
        }
        Ok(Some(colors))
    }
}

fn parse_recolor(text: &str) -> Result<(usize, [u8; 3]), String> {
    let (index, color) = text.split_once('=').ok_or("expected INDEX=#RRGGBB")?;
    Ok((index.parse().map_err(|_| "expected a palette index before the =")?, hex::parse(color)?))
}

fn parse_number(text: &str, most: f32) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|number| (0.0..=most).contains(number))
        .ok_or_else(|| format!("expected a number from 0 to {most}"))
}

fn parse_softness(text: &str) -> Result<f32, String> {
    parse_number(text, 10.0)
}

fn parse_share(text: &str) -> Result<f32, String> {
    parse_number(text, 1.0)
}
