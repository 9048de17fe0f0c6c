//! Extracts the palette of a field, and draws the field without a window: as trained, posterized, and recolored.
//!
//! ```sh
//! cargo run --release -p headless
//! cargo run --release -p headless -- field.npz
//! cargo run --release -p headless -- field.npz 400  # views that are 400 pixels wide and high
//! ```

mod animation;
mod cameras;
mod colors;
mod overview;
mod palette;

use std::{
    fs,
    num::NonZero,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use bevy::{prelude::*, render::renderer::RenderAdapterInfo};
use bevy_plenoctree::{
    LoadSettings, UpAxis,
    headless::{Headless, exact_camera, pinhole_view},
    prelude::*,
};
use image::RgbaImage;
use plenoctree::camera::PinholeCamera;

use cameras::Frame;

type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// The number of views from all around.
const VIEWS: u32 = 8;
/// The default width and height of a view, in pixels.
const SIZE: u32 = 800;
/// The number of frames of the animation, which are half as wide and high as the views.
const FRAMES: u32 = 40;
/// How far the overview turns the hue of a ramp, in degrees. Red becomes blue.
const TURN: f32 = 235.0;

fn main() -> ExitCode {
    let included = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/toadstool.plenoctree");
    let mut arguments = std::env::args_os().skip(1);
    let file = arguments.next().map_or_else(included, PathBuf::from);
    let size = arguments.next().map_or(Ok(SIZE), |size| {
        let pixels: Option<NonZero<u32>> = size.to_str().and_then(|size| size.parse().ok());
        pixels.map(NonZero::get).ok_or_else(|| format!("size: found {size:?}, expected a number of pixels").into())
    });
    match size.and_then(|size| run(&file, size, Path::new("out"))) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(file: &Path, size: u32, out: &Path) -> Result {
    let start = Instant::now();
    let field = PlenOctree::read(file, &LoadSettings::default())?;
    let half = size.div_ceil(2);
    let [mut views, mut frames] =
        [(VIEWS, size), (FRAMES, half)].map(|views| cameras::around(&field, views).unwrap_or_default());
    if views.is_empty() {
        return Err(format!("{}: nothing to see: the field has no dense leaf", file.display()).into());
    }
    let up = field.up();
    let (name, leaves) = (file.file_name().unwrap_or_default().display(), field.leaves());
    println!("Loaded {name}: {leaves} leaves in {:.2} s", start.elapsed().as_secs_f64());
    fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;

    let mut headless = Headless::new(UVec2::splat(size), |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;
    let target = headless.target();
    let world = headless.app.world_mut();
    println!("Drawing with {}", world.resource::<RenderAdapterInfo>().name);
    // Its palette is extracted, because no file was loaded next to which there could be one.
    let field = world.resource_mut::<Assets<PlenOctree>>().add(field);
    let prop = world.spawn((Prop(field.clone()), Posterize::default())).id();
    let camera = world.spawn((exact_camera(Color::WHITE), target)).id();
    let palette = palette::extract(&mut headless, &field)?;

    let start = Instant::now();
    // A first look finds out how close the cameras can be.
    let frame = Frame::of(&capture(&mut headless, camera, &look(&views, up), |_, _| ())?);
    views.iter_mut().chain(&mut frames).for_each(|camera| *camera = frame.zoom(camera));
    let turn = |headless: &mut Headless, name: &str| -> Result<Vec<RgbaImage>> {
        let captured = capture(headless, camera, &look(&views, up), |_, _| ())?;
        for (index, image) in captured.iter().enumerate() {
            save(image, &out.join(format!("frame_{index:03}.{name}.png")))?;
        }
        Ok(captured)
    };
    let posterized = turn(&mut headless, "posterized")?;
    let ramp = colors::turn_hue(&mut headless, &field, TURN);
    let recolored = turn(&mut headless, "recolored")?;
    let shown = headless.app.world().resource::<Palettes>().get(&field).map(|palette| palette.shown().to_vec());
    headless.app.world_mut().entity_mut(prop).remove::<Posterize>();
    let original = turn(&mut headless, "original")?;
    let (ramp, seconds) = (ramp.as_deref().unwrap_or("nothing"), start.elapsed().as_secs_f64());
    println!("Drew {VIEWS} views posterized, with {ramp} recolored, and as trained in {seconds:.2} s");

    let start = Instant::now();
    headless.app.world_mut().entity_mut(prop).insert(Posterize::default());
    headless.resize(UVec2::splat(half));
    let turned = capture(&mut headless, camera, &look(&frames, up), |headless, turn| {
        colors::turn_hue(headless, &field, 360.0 * turn);
    })?;
    let turntable = out.join("turntable.png");
    animation::write(&turntable, &turned).map_err(|error| format!("{}: {error}", turntable.display()))?;
    println!("Drew an animation of {FRAMES} frames in {:.2} s", start.elapsed().as_secs_f64());

    let heroes = [&original[0], &posterized[0], &recolored[0]];
    let strip: Vec<_> = turned.iter().step_by((FRAMES / VIEWS) as usize).collect();
    let overview = overview::draw(&heroes, &strip, &palette, shown.as_deref().unwrap_or(&[]));
    save(&overview, &out.join("overview.png"))
}

/// Returns the components of cameras around a field.
fn look(cameras: &[PinholeCamera], up: UpAxis) -> Vec<(Projection, Transform)> {
    cameras.iter().map(|camera| pinhole_view(camera, up)).collect()
}

/// Captures a frame from each camera. Calls `prepare` before it, with how far the camera has turned: from 0 to 1.
fn capture(
    headless: &mut Headless,
    camera: Entity,
    views: &[(Projection, Transform)],
    mut prepare: impl FnMut(&mut Headless, f32),
) -> Result<Vec<RgbaImage>> {
    let mut captured = Vec::new();
    for (index, view) in views.iter().enumerate() {
        headless.app.world_mut().entity_mut(camera).insert(view.clone());
        prepare(headless, index as f32 / views.len() as f32);
        captured.push(headless.capture()?);
    }
    Ok(captured)
}

fn save(image: &RgbaImage, file: &Path) -> Result {
    image.save(file).map_err(|error| format!("{}: {error}", file.display()).into())
}
