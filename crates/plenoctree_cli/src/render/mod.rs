//! `render`: renders views of a capture or a field, without posterization.

mod arguments;

pub use arguments::Arguments;

use std::path::PathBuf;

use glam::DVec4;
use image::{Rgba, RgbaImage};
use plenoctree::{PlenOctree, camera::PinholeCamera, reference::render};
use plenoctree_fit::{
    Transforms,
    splat::{Splats, render_splats},
};

use crate::{capture, console, files, hex, number::counted, progress, result::Result, transforms};

/// The scene to render.
enum Scene {
    Capture(Splats),
    Field(PlenOctree),
}

impl Scene {
    /// Returns premultiplied colors with opacities, in encoded sRGB.
    fn pixels(&self, camera: &PinholeCamera) -> Vec<DVec4> {
        match self {
            Self::Capture(splats) => {
                render_splats(splats, camera).pixels.into_iter().map(|pixel| pixel.as_dvec4()).collect()
            }
            Self::Field(field) => {
                let rendering = render(field, camera);
                rendering.color.iter().zip(rendering.opacity).map(|(color, opacity)| color.extend(opacity)).collect()
            }
        }
    }
}

/// Returns the name of the image of a view.
fn file_name(index: usize) -> String {
    format!("{index:03}.png")
}

/// Renders a view for each camera.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.input;
    let is_view = |name: &str| {
        let index = name.strip_suffix(".png").and_then(|digits| digits.parse().ok());
        index.is_some_and(|index| file_name(index) == name)
    };
    let Transforms { cameras, pictures, .. } = transforms::read(&arguments.cameras, arguments.size)?;
    let inputs = [path, &arguments.cameras].into_iter().chain(&pictures);
    files::check_folder(&arguments.out, &inputs.map(PathBuf::as_path).collect::<Vec<_>>(), is_view)?;
    let extension = path.extension().unwrap_or_default();
    let scene = if PlenOctree::EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known)) {
        if arguments.capture.are_given() {
            return Err(format!("{}: --spz-axes and --antialiased are for captures", path.display()).into());
        }
        let field = arguments.field.load(path, arguments.quiet)?;
        if field.leaves() == 0 {
            return Err(format!("{}: nothing is visible in the field", path.display()).into());
        }
        Scene::Field(field)
    } else if arguments.field.are_given() {
        return Err(format!("{}: --activation and --up are for fields, .npz or .plenoctree", path.display()).into());
    } else {
        Scene::Capture(capture::load(path, arguments.capture, arguments.quiet)?)
    };
    files::create_folder(&arguments.out)?;
    let bar = progress::bar("rendering", cameras.len() as u64, arguments.quiet);
    let names: Vec<String> = (0..cameras.len()).map(file_name).collect();
    for (camera, name) in cameras.iter().zip(&names) {
        let pixels = scene.pixels(camera);
        let file = arguments.out.join(name);
        let pixel = |x: u32, y: u32| pixels[(y * camera.width + x) as usize];
        match arguments.background {
            Some(background) => {
                let background = glam::DVec3::from_array(hex::unit(background));
                files::write_image(
                    &file,
                    &image::RgbImage::from_fn(camera.width, camera.height, |x, y| {
                        let pixel = pixel(x, y);
                        image::Rgb(hex::quantize((pixel.truncate() + (1.0 - pixel.w) * background).to_array()))
                    }),
                )?;
            }
            None => {
                let image = RgbaImage::from_fn(camera.width, camera.height, |x, y| {
                    let pixel = pixel(x, y);
                    let [r, g, b] = hex::quantize((pixel.truncate() / pixel.w.max(1e-6)).to_array());
                    Rgba([r, g, b, (255.0 * pixel.w).round() as u8])
                });
                files::write_image(&file, &image)?;
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    files::warn_of_earlier_images(&arguments.out, &names, is_view);
    if !arguments.quiet {
        let views = counted(cameras.len(), "view", "views");
        console::say!("{views} of {} saved to {}", path.display(), arguments.out.display());
    }
    Ok(())
}
