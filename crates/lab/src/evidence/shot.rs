//! A view, as trained and posterized with every palette.

use image::{RgbImage, RgbaImage};
use plenoctree::{
    camera::PinholeCamera,
    palette::{ColorErrors, Palette},
};
use plenoctree_cli::{
    renderer::{Look, PosterizeSettings, Render},
    result::Result,
};

use super::{
    measures,
    methods::{Method, Methods},
};

/// A view that shows results.
pub struct Shot {
    /// The camera.
    pub camera: PinholeCamera,
    /// The view as trained; alpha is the opacity.
    pub original: RgbaImage,
    /// The view posterized, in the order of [`Method::ALL`].
    posterized: Vec<Posterized>,
}

/// A posterized view.
pub struct Posterized {
    /// The picture.
    pub image: RgbImage,
    /// How far it is from the original. `None` if it is posterized nowhere.
    pub errors: Option<ColorErrors>,
}

impl Shot {
    /// Renders a view.
    pub fn render(renderer: &mut dyn Render, camera: &PinholeCamera, methods: &Methods) -> Result<Self> {
        let original = renderer.original(camera)?;
        let posterized = Method::ALL.into_iter().map(|method| {
            let palette = methods.palette(method);
            posterize(renderer, camera, &original, palette, PosterizeSettings::default())
        });
        let posterized = posterized.collect::<Result<_>>()?;
        Ok(Self { camera: *camera, original, posterized })
    }

    /// Returns the view posterized with the palette of a method.
    pub fn posterized(&self, method: Method) -> &Posterized {
        &self.posterized[method as usize]
    }
}

/// Renders a view posterized, and compares it with its original.
pub fn posterize(
    renderer: &mut dyn Render,
    camera: &PinholeCamera,
    original: &RgbaImage,
    palette: &Palette,
    settings: PosterizeSettings,
) -> Result<Posterized> {
    let image = renderer.posterized(camera, &Look { palette, shown: &palette.colors, settings })?.0;
    Ok(Posterized { errors: measures::of_picture(original, &image), image })
}
