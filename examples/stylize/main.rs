//! The main job: pictures of a field as rendered, posterized and recolored, and the palette that made them.
//!
//! ```sh
//! cargo run --release --example stylize -- field.npz --cameras transforms.json --recolor '1=#2060ff'
//! ```

mod arguments;
mod extraction;
mod output;
#[path = "../common/quality.rs"]
mod quality;
mod renderers;
mod report;
#[path = "../common/size.rs"]
mod size;
#[path = "../common/text.rs"]
mod text;

use std::{path::PathBuf, process::ExitCode, time::Duration};

use bevy_plenoctree::{
    Palette, PlenOctree,
    camera::{PinholeCamera, read_transforms},
    field::LoadSettings,
};
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};

use arguments::{Arguments, Renderer};
use renderers::{FrameTimes, GpuRenderer, Job, ReferenceRenderer, Render};

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

fn run(arguments: &Arguments) -> Result<()> {
    let path = arguments.field.clone().unwrap_or_else(default_prop);
    let cameras = arguments.cameras.as_ref().map(|path| read_transforms(path, arguments.size)).transpose()?;
    let given = arguments.palette.as_ref().map(Palette::read).transpose()?;

    let spinner = bar(arguments, 0, "loading");
    spinner.enable_steady_tick(Duration::from_millis(100));
    let field = PlenOctree::read(&path, &LoadSettings::default())?;
    spinner.finish_and_clear();

    let mut cameras = match cameras {
        Some(cameras) => cameras,
        None => turntable(&field, arguments.size.unwrap_or((800, 800)), arguments.frames().unwrap_or(8))
            .map_err(|error| format!("{}: {error}", path.display()))?,
    };
    if let Some(frames) = arguments.frames() {
        cameras.truncate(frames);
    }

    let (palette, extracted) = match given {
        Some(palette) => (palette, None),
        None => {
            let progress = bar(arguments, 100, "extracting");
            let extracted = extraction::extract(&field, arguments, &progress)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            progress.finish_and_clear();
            if let Some(path) = &arguments.histograms {
                extraction::write_histograms(&extracted.histograms, arguments, path)?;
            }
            (extracted.extraction.palette.clone(), Some(extracted))
        }
    };
    let recolored = arguments.recolored(&palette)?;

    std::fs::create_dir_all(&arguments.out)
        .map_err(|error| format!("{}: cannot be created: {error}", arguments.out.display()))?;
    output::write_palette(&palette, &arguments.out)?;

    let job = Job {
        field: field.clone(),
        palette: palette.clone(),
        recolored,
        look: arguments.look(),
        quality: arguments.quality.preset(),
        background: arguments.background(),
    };
    let size = cameras.iter().fold((1, 1), |size, camera| (size.0.max(camera.width), size.1.max(camera.height)));
    let mut renderer: Box<dyn Render> = match arguments.renderer {
        Renderer::Gpu => Box::new(GpuRenderer::new(job, size).map_err(|error| format!("{}: {error}", path.display()))?),
        Renderer::Reference => Box::new(ReferenceRenderer::new(job)),
    };

    let progress = bar(arguments, cameras.len() as u64, "rendering");
    let mut times = Vec::new();
    for (index, camera) in cameras.iter().enumerate() {
        let (pictures, milliseconds) = renderer.render(camera)?;
        let files = output::write_frame(&pictures, index, &arguments.out)?;
        times.push((files, milliseconds));
        progress.inc(1);
    }
    progress.finish_and_clear();

    report::write(&arguments.out, &field, &renderer.adapter(), extracted.as_ref(), &palette, &times)?;
    if !arguments.quiet {
        println!("{} views of {} in {}", cameras.len(), path.display(), arguments.out.display());
    }
    Ok(())
}

/// The prop of our own that is shown when no field is named.
fn default_prop() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.npz")
}

fn bar(arguments: &Arguments, length: u64, message: &'static str) -> ProgressBar {
    if arguments.quiet {
        return ProgressBar::hidden();
    }
    let template = if length == 0 { "{spinner} {msg}" } else { "{msg:12} [{bar:40}] {pos}/{len} {eta}" };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style).with_message(message)
}

/// Views from all around and a little above, that show the whole field.
fn turntable(field: &PlenOctree, (width, height): (u32, u32), frames: usize) -> Result<Vec<PinholeCamera>> {
    let elevation = 20.0_f64.to_radians();
    let azimuth = |frame| 25.0_f64.to_radians() + std::f64::consts::TAU * frame as f64 / frames as f64;
    (0..frames)
        .map(|frame| PinholeCamera::around(field, width, height, azimuth(frame), elevation))
        .collect::<Option<_>>()
        .ok_or_else(|| "nothing is visible in the field".into())
}
