//! `stylize`: renders views of a field as trained, posterized and recolored, and saves them with the palette.

mod arguments;
mod look;
mod output;
mod pixel;
mod recolor;
mod report;

pub use arguments::Arguments;

use std::path::PathBuf;

use glam::DVec3;
use image::DynamicImage;
use plenoctree::{
    PlenOctree,
    camera::PinholeCamera,
    palette::{Palette, PaletteLabel},
    reference::{Posterization, shown_opacity},
};

use crate::{
    console, extraction, field, files, hex,
    number::counted,
    progress,
    renderer::{Look, PosterizeSettings, Scene},
    result::Result,
    transforms, turntable,
};

/// Renders the views and writes them, the palette and the report.
pub fn run(arguments: &Arguments) -> Result {
    let path = &field::or_default(arguments.field.as_deref());
    arguments.check(path)?;
    let cameras = arguments.cameras.as_ref().map(|path| transforms::read(path, arguments.size)).transpose()?;
    if let Some(transforms) = &cameras {
        let pictures: Vec<_> = transforms.pictures.iter().map(PathBuf::as_path).collect();
        files::check_folder(&arguments.out, &pictures, output::writes)?;
    }
    let given = arguments.palette.as_ref().map(Palette::read).transpose()?;
    let field = arguments.reading.load(path, arguments.quiet)?;

    let mut cameras = match cameras {
        Some(transforms) => transforms.cameras,
        None => turntable(&field, arguments).map_err(|error| format!("{}: {error}", path.display()))?,
    };
    if let Some(frames) = arguments.frames() {
        cameras.truncate(frames);
    }

    let (palette, extracted) = match given {
        Some(palette) => (palette, None),
        None => {
            let beside = path.with_extension("palette.json");
            if beside.exists() && !arguments.quiet {
                console::complain!("{}: not used; to use it, pass it to --palette", beside.display());
            }
            let extraction = arguments.extraction.by_default(arguments.look.method());
            let extracted = extraction::extract(&field, path, &extraction, arguments.sampling, arguments.quiet)?;
            (extracted.extraction.palette.clone(), Some(extracted))
        }
    };
    let settings = arguments.posterize(&palette);
    let Posterization { blend_steps, min_opacity, .. } = settings.posterization;
    check_labels(&palette, blend_steps).map_err(|error| match &arguments.palette {
        Some(file) => format!("palette {}: {error}", file.display()),
        None => error,
    })?;
    let mut recolored = arguments.recolored(&palette)?;

    let scene = Scene { field: field.clone(), quality: arguments.quality, background: arguments.background };
    let mut renderer =
        arguments.renderer.start(scene, &cameras).map_err(|error| format!("{}: {error}", path.display()))?;
    let look = |shown| Look { palette: &palette, shown, settings };

    if let (Some(shown), Some(camera), false) = (&mut recolored, cameras.first(), arguments.pixel.is_empty()) {
        let posterization = Posterization { softness: 0.0, ..settings.posterization };
        let hard = PosterizeSettings { posterization, smooth_edges: false, ink: false };
        let look = Look { palette: &palette, shown: &palette.colors, settings: hard };
        let opacity = renderer.original(camera)?;
        let (labeled, _) = renderer.posterized(camera, &look)?;
        let unit = |color: [u8; 3]| DVec3::from(hex::unit(color));
        let label_at = |x, y| {
            let [.., opacity] = hex::unit(opacity.get_pixel(x, y).0);
            let shown = shown_opacity(palette.label_space(), opacity);
            // Without the background, which shows through glass and haze.
            let own = (unit(labeled.get_pixel(x, y).0) - (1.0 - shown) * unit(arguments.background)) / shown;
            (opacity >= min_opacity && shown > 0.0).then_some(own)
        };
        pixel::apply(&arguments.pixel, &palette, blend_steps, labeled.dimensions(), label_at, shown)?;
    }

    output::write_palette(&palette, arguments.palette.as_deref(), &arguments.out)?;
    let bar = progress::bar("rendering", cameras.len() as u64, arguments.quiet);
    let mut times = Vec::new();
    for (index, camera) in cameras.iter().enumerate() {
        let original = DynamicImage::from(renderer.original(camera)?).into_rgb8();
        let (posterized, milliseconds) = renderer.posterized(camera, &look(&palette.colors))?;
        let mut images = vec![("original", original), ("posterized", posterized)];
        if let Some(colors) = &recolored {
            images.push(("recolored", renderer.posterized(camera, &look(colors))?.0));
        }
        let files = output::write_frame(&images, index, &arguments.out)?;
        times.push((files, milliseconds));
        bar.inc(1);
    }
    bar.finish_and_clear();

    report::write(&arguments.out, &field, &renderer.adapter(), extracted.as_ref(), &palette, &times)?;
    files::warn_of_earlier_images(&arguments.out, times.iter().flat_map(|(files, _)| files), output::is_of_frame);
    if !arguments.quiet {
        let views = counted(cameras.len(), "view", "views");
        console::say!("{views} of {} saved to {}", path.display(), arguments.out.display());
    }
    Ok(())
}

/// Returns an error if there are more labels than the renderers allow.
fn check_labels(palette: &Palette, blend_steps: u32) -> Result<(), String> {
    let colors = palette.colors.len();
    let (labels, most) = (PaletteLabel::count(colors, blend_steps), PaletteLabel::MAX_LABELS);
    if labels <= most {
        return Ok(());
    }
    let steps = PaletteLabel::most_blend_steps(colors);
    // Palettes by hand may be meant as tones.
    let by_hand = palette.method.is_none();
    let hint = if by_hand { "; if its colors are not to blend, add \"method\": \"tones\" to the file" } else { "" };
    Err(format!(
        "found {colors} colors with {blend_steps} blend steps, which make {labels} labels, expected at most {most}: use \
         --blend-steps {steps}{hint}"
    ))
}

/// Returns the views to render if no cameras are given.
fn turntable(field: &PlenOctree, arguments: &Arguments) -> Result<Vec<PinholeCamera>> {
    let (size, frames) = (arguments.size.unwrap_or((800, 800)), arguments.frames().unwrap_or(8));
    turntable::full_turn(field, size, frames).ok_or_else(|| "nothing is visible in the field".into())
}
