//! `look`: measures the look of a cartoon, and draws sheets on which each ramp is recolored in turn.

mod arguments;
mod mask;
mod measures;

pub use arguments::Arguments;

use std::path::{Path, PathBuf};

use image::{GenericImage, Rgb, RgbImage, imageops};
use plenoctree::{
    PlenOctree,
    camera::PinholeCamera,
    palette::{ColorCount, ExtractionSettings, LabelSpace, Palette, RampAdjustment},
    reference::Posterization,
};
use plenoctree_cli::{
    console, extraction, field, files, hex,
    preset::Preset,
    progress,
    renderer::{Look, PosterizeSettings, Render, Renderer, Scene, toon},
    result::Result,
    turntable,
};

use mask::mask;
use measures::{Measures, between, chroma, hue_of};

/// The included props.
const PROPS: [&str; 5] = ["toadstool", "drum", "robot", "chest", "gumballs"];
/// What ramps become, unless their hue is like it, and what they become then.
const NEW: [Rgb<u8>; 2] = [Rgb([32, 80, 208]), Rgb([208, 48, 32])];
/// The angle within which hues are alike, in degrees.
const ALIKE: f64 = 60.0;

/// Measures all fields, prints a table, and writes the sheets.
pub fn run(arguments: &Arguments) -> Result {
    let included = || PROPS.map(|name| field::or_default(None).with_file_name(name).with_extension("plenoctree"));
    let fields = if arguments.fields.is_empty() { included().to_vec() } else { arguments.fields.clone() };
    if let Some(folder) = &arguments.sheets {
        files::create_folder(folder)?;
    }
    console::say!(
        "| field | tones | ramps | flat | tinted grays | 1000 x chroma | RMSE, of 255 | leaks |\n|---|---|---|---|---|---|---|---|"
    );
    for path in &fields {
        let row = measure(path, arguments).map_err(|error| format!("{}: {error}", path.display()))?;
        console::say!("{row}");
    }
    Ok(())
}

/// Measures a field and returns its row of the table.
fn measure(path: &Path, arguments: &Arguments) -> Result<String> {
    let field = field::load(path, arguments.quiet)?;
    let palette = palette(path, &field, arguments)?;
    let cameras = turntable::full_turn(&field, arguments.size, arguments.views as usize).ok_or("the field is empty")?;
    let scene = Scene { field, quality: Preset::Exact, background: [255; 3] };
    let mut pictures = Pictures {
        renderer: arguments.renderer.start(scene, &cameras)?,
        palette: &palette,
        smooth: arguments.renderer == Renderer::Gpu,
    };
    let (main, hues) = main_ramp(&palette).ok_or("the palette has no ramps")?;
    let bar = progress::bar("rendering", cameras.len() as u64, arguments.quiet);
    let mut all = Vec::new();
    for camera in &cameras {
        let original = pictures.original(camera)?;
        let posterized = pictures.posterized(camera, &palette.colors)?;
        let recolored = pictures.posterized(camera, &with_ramp(&palette, main, hues[1])?)?;
        all.push(Measures::of(&original, [&posterized, &recolored], &mask(&original), hues));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if let Some(folder) = &arguments.sheets {
        files::write_image(&folder.join(&name).with_extension("png"), &pictures.sheet(&cameras[0])?)?;
    }
    let Measures { flat, tinted, chroma, rmse, leaks } = Measures::mean(&all);
    let (tones, ramps) = (palette.colors.len(), palette.ramps.len());
    let [flat, tinted, leaks] = [flat, tinted, leaks].map(|share| 100.0 * share);
    let (chroma, rmse) = (1000.0 * chroma, 255.0 * rmse);
    Ok(format!("| {name} | {tones} | {ramps} | {flat:.0}% | {tinted:.1}% | {chroma:.1} | {rmse:.1} | {leaks:.1}% |"))
}

/// Returns the palette that the plugin would use: the one next to the field, or else that which it extracts.
fn palette(path: &Path, field: &PlenOctree, arguments: &Arguments) -> Result<Palette> {
    let file: PathBuf = path.with_extension("palette.json");
    if file.exists() && !arguments.extract && arguments.colors.is_none() {
        return Ok(Palette::read(file)?);
    }
    let colors = arguments.colors.map_or(ColorCount::Usual, |count| ColorCount::Fixed(count as usize));
    let settings = ExtractionSettings { colors, ..ExtractionSettings::default() };
    Ok(extraction::cpu::extract(field, &settings, arguments.quiet)?.extraction.palette)
}

/// Returns the ramp with most color, and its mean color before and after it is recolored.
fn main_ramp(palette: &Palette) -> Option<(usize, [Rgb<u8>; 2])> {
    let strength = |ramp: usize| -> f64 {
        let color = |tone: usize| Rgb(hex::quantize(palette.colors[tone]));
        let tones = palette.ramps[ramp].tones.iter();
        tones.map(|&tone| palette.weights[tone] * chroma(color(tone)).length()).sum()
    };
    let main = (0..palette.ramps.len()).max_by(|&a, &b| strength(a).total_cmp(&strength(b)))?;
    let old = Rgb(hex::quantize(palette.ramp_color(main)?));
    Some((main, [old, new_color(old)]))
}

fn new_color(old: Rgb<u8>) -> Rgb<u8> {
    NEW[usize::from(between(hue_of(old), hue_of(NEW[0])) < ALIKE)]
}

/// Returns the shown colors of a palette with a ramp moved to a color.
fn with_ramp(palette: &Palette, ramp: usize, Rgb(color): Rgb<u8>) -> Result<Vec<[f64; 3]>> {
    let mut shown = palette.colors.clone();
    palette.show_ramp(ramp, &RampAdjustment::to_color(hex::unit(color)), |tone, color| shown[tone] = color)?;
    Ok(shown)
}

/// Draws views of a field with a palette.
struct Pictures<'a> {
    renderer: Box<dyn Render>,
    palette: &'a Palette,
    smooth: bool,
}

impl Pictures<'_> {
    fn original(&mut self, camera: &PinholeCamera) -> Result<RgbImage> {
        let picture = self.renderer.original(camera)?;
        Ok(RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
            let [r, g, b, _] = picture.get_pixel(x, y).0;
            Rgb([r, g, b])
        }))
    }

    fn posterized(&mut self, camera: &PinholeCamera, shown: &[[f64; 3]]) -> Result<RgbImage> {
        let steps = match self.palette.label_space() {
            LabelSpace::Tones => 1,
            LabelSpace::Encoded => toon().blend_steps,
        };
        let posterization = Posterization { blend_steps: steps, ..toon() };
        let settings = PosterizeSettings { posterization, smooth_edges: self.smooth, ink: false };
        Ok(self.renderer.posterized(camera, &Look { palette: self.palette, shown, settings })?.0)
    }

    /// Returns a view as trained, posterized, and with each ramp recolored in turn, at half the size, row by row.
    fn sheet(&mut self, camera: &PinholeCamera) -> Result<RgbImage> {
        let mut pictures = vec![self.original(camera)?, self.posterized(camera, &self.palette.colors)?];
        for ramp in 0..self.palette.ramps.len() {
            let old = self.palette.ramp_color(ramp).map(|color| Rgb(hex::quantize(color))).unwrap_or(NEW[1]);
            let shown = with_ramp(self.palette, ramp, new_color(old))?;
            pictures.push(self.posterized(camera, &shown)?);
        }
        let (width, height) = (camera.width.div_ceil(2), camera.height.div_ceil(2));
        let columns = 4.min(pictures.len() as u32);
        let mut sheet = RgbImage::new(columns * width, (pictures.len() as u32).div_ceil(columns) * height);
        for (index, picture) in (0u32..).zip(&pictures) {
            let small = imageops::thumbnail(picture, width, height);
            sheet.copy_from(&small, index % columns * width, index / columns * height)?;
        }
        Ok(sheet)
    }
}
