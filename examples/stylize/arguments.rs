//! The command line.

use std::path::PathBuf;

use bevy_plenoctree::{ExtractionSettings, Palette, Posterize};
use clap::{Parser, ValueEnum};

use crate::{quality::Level, size::parse_size};

/// Renders a PlenOctree, extracts its palette, and posterizes and recolors the views.
#[derive(Parser)]
pub struct Arguments {
    /// The field, an .npz file; one of our own props if none is given.
    pub field: Option<PathBuf>,
    /// Where the pictures go.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// A transforms.json (NeRF, nerfstudio) in the field's frame, instead of a turntable.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Views: 8 of a turntable, or all of the cameras, by default.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    /// Size of the pictures in pixels, each side 1 to 16384; 800x800, or what the cameras say, by default.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// A palette.json to use instead of extracting one.
    #[arg(long)]
    pub palette: Option<PathBuf>,
    /// Colors that the palette is simplified to.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=64), conflicts_with = "palette")]
    colors: u32,
    /// What samples the field's radiance; the GPU, or the CPU where graphics are in software, by default.
    #[arg(long, value_enum, conflicts_with = "palette")]
    pub sampling: Option<Sampling>,
    /// The share of the leaves that is sampled, above 0 to 1.
    #[arg(long, default_value_t = 1.0, value_parser = parse_fraction, conflicts_with = "palette")]
    sample_fraction: f64,
    /// Where to write the histograms, as an .npz of `fine` and `coarse`.
    #[arg(long, value_name = "FILE.npz", conflicts_with = "palette")]
    pub histograms: Option<PathBuf>,
    /// Steps from one palette color to another.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=8))]
    blend_steps: u32,
    /// Distance in encoded RGB over which labels blend; 0 is a hard edge.
    #[arg(long, default_value_t = 0.2, value_parser = parse_softness)]
    softness: f32,
    /// Opacity under which a pixel is shown as rendered.
    #[arg(long, default_value_t = 80.0 / 255.0, value_parser = parse_share)]
    min_opacity: f32,
    /// Shows a palette color as another; may be given several times.
    #[arg(long, value_name = "INDEX=#RRGGBB", value_parser = parse_recolor)]
    recolor: Vec<(usize, [u8; 3])>,
    /// The color behind the field.
    #[arg(long, value_name = "#RRGGBB", default_value = "#ffffff", value_parser = parse_color)]
    background: [u8; 3],
    /// How exactly the GPU draws; the palette's sampling has settings of its own.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Level,
    /// What renders.
    #[arg(long, value_enum, default_value_t = Renderer::Gpu)]
    pub renderer: Renderer,
    /// Prints nothing but errors.
    #[arg(long)]
    pub quiet: bool,
}

/// Which of the crate's renderers makes the pictures.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Renderer {
    /// The plugin's passes, on whatever adapter wgpu finds.
    Gpu,
    /// The float64 reference, on the CPU.
    Reference,
}

/// What samples radiance for the palette.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Sampling {
    /// Compute shaders in the render world.
    Gpu,
    /// All cores.
    Cpu,
    /// The float64 reference, on one core.
    Reference,
}

impl Arguments {
    pub fn frames(&self) -> Option<usize> {
        self.frames.map(|frames| frames as usize)
    }

    pub fn look(&self) -> Posterize {
        Posterize {
            blend_steps: self.blend_steps,
            softness: self.softness,
            min_opacity: self.min_opacity,
            ..Posterize::default()
        }
    }

    pub fn extraction(&self) -> ExtractionSettings {
        ExtractionSettings {
            colors: self.colors as usize,
            sample_fraction: self.sample_fraction,
            ..ExtractionSettings::default()
        }
    }

    /// The color behind the field, encoded sRGB.
    pub fn background(&self) -> [u8; 3] {
        self.background
    }

    /// The palette's colors with those changed that the command line says; `None` if it says none.
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

fn parse_color(text: &str) -> Result<[u8; 3], String> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    if digits.len() != 6 || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return Err("expected #RRGGBB".into());
    }
    let value = u32::from_str_radix(digits, 16).map_err(|error| error.to_string())?;
    Ok([(value >> 16) as u8, (value >> 8) as u8, value as u8])
}

fn parse_recolor(text: &str) -> Result<(usize, [u8; 3]), String> {
    let (index, color) = text.split_once('=').ok_or("expected INDEX=#RRGGBB")?;
    Ok((index.parse().map_err(|_| "expected a palette index before the =")?, parse_color(color)?))
}

fn parse_number(text: &str, most: f32) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|number| (0.0..=most).contains(number))
        .ok_or_else(|| format!("expected a number from 0 to {most}"))
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|fraction| *fraction > 0.0 && *fraction <= 1.0)
        .ok_or_else(|| "expected a number above 0 to 1".into())
}

fn parse_softness(text: &str) -> Result<f32, String> {
    parse_number(text, 10.0)
}

fn parse_share(text: &str) -> Result<f32, String> {
    parse_number(text, 1.0)
}
