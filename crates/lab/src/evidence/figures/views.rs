//! Figure 8: palettes from views.

use image::{RgbImage, RgbaImage, imageops};
use plenoctree_cli::result::Result;

use super::{
    super::{data::Evidence, methods::Method},
    rows::opaque,
};
use crate::report::{Picture, Section};

/// The height of the example views, in pixels.
const HEIGHT: u32 = 96;

/// Compares palettes from one and from seven views with the field's.
pub fn section(evidence: &Evidence, examples: &[RgbaImage]) -> Result<Section> {
    let mut section = Section::new("Figure 8: palettes from views");
    section.text(
        "Chao et al. 2021 cluster the pixels of one view, or of seven, with k-means (K = 40, from k-means++ centers \
         with a fixed seed), and simplify the hull of the clusters, as in appendix B of the paper. The one view is the \
         example in which the prop covers the most pixels. The pictures show a view that is not among the examples; the \
         table, all such views.",
    );
    let file = evidence.folder.picture("examples", &strip(examples))?;
    let (title, note) = ("the seven example views".into(), String::new());
    section.pictures(vec![Picture { file, title, note, palette: None }]);
    let methods = [Method::OneView, Method::SevenViews, Method::Hull, Method::Fitted];
    section.pictures(evidence.first_view(&methods)?);
    evidence.claim(
        &mut section,
        "The field's palette posterizes better than one from one view.",
        [Method::Hull, Method::OneView],
    );
    evidence.claim(
        &mut section,
        "The field's palette posterizes better than one from seven views.",
        [Method::Hull, Method::SevenViews],
    );
    section.table(&evidence.folder, "figure_08", evidence.means(&methods))?;
    Ok(section)
}

/// Returns small pictures side by side.
fn strip(images: &[RgbaImage]) -> RgbImage {
    let small = |image: &RgbaImage| {
        let width = (f64::from(HEIGHT * image.width()) / f64::from(image.height())).round().max(1.0) as u32;
        imageops::resize(&opaque(image), width, HEIGHT, imageops::FilterType::Triangle)
    };
    let images: Vec<RgbImage> = images.iter().map(small).collect();
    let mut strip = RgbImage::from_pixel(images.iter().map(RgbImage::width).sum(), HEIGHT, image::Rgb([255; 3]));
    let mut left = 0;
    for image in &images {
        imageops::replace(&mut strip, image, left, 0);
        left += i64::from(image.width());
    }
    strip
}
