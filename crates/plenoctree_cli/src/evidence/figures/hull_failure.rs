//! Figure 11: where the hull fails.

use super::{
    super::{
        crop::Crop,
        data::Evidence,
        methods::Method,
        report::Cell,
        report::{Picture, Section, Table},
        shot::posterize,
    },
    rows::{COLUMNS, cells, note, opaque},
};
use crate::{renderer::PosterizeSettings, result::Result};

/// Shows the view whose error falls most from the hull's palette to the fitted one, of all views of the report.
pub fn section(evidence: &mut Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 11: where the hull fails");
    section.text(
        "Colors inside the convex hull have no palette color of their own. This is the view whose error falls most \
         from the hull's palette to the fitted one, of all views in this report, and below it the part of the view \
         where the error falls most.",
    );
    evidence.claim(
        &mut section,
        "An optimized palette does better than the hull (left to future work).",
        [Method::Fitted, Method::Hull],
    );
    let cameras = [&evidence.views.shown[..], &evidence.views.examples].concat();
    let mut most: Option<(f64, [_; 3])> = None;
    let mut rows = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        let original = evidence.renderer.original(camera)?;
        let mut find = |method| {
            let palette = evidence.methods.palette(method);
            posterize(&mut *evidence.renderer, camera, &original, palette, PosterizeSettings::default())
        };
        let (hull, fitted) = (find(Method::Hull)?, find(Method::Fitted)?);
        for (method, posterized) in [(Method::Hull, &hull), (Method::Fitted, &fitted)] {
            let mut row = vec![Cell::Number(view as f64, 0), Cell::text(method.name())];
            row.extend(cells(posterized.errors));
            rows.push(row);
        }
        let (Some(before), Some(after)) = (hull.errors, fitted.errors) else { continue };
        let fall = before.rmse - after.rmse;
        if most.as_ref().is_none_or(|(most, _)| fall > *most) {
            let pictures = [
                (opaque(&original), "as trained", String::new(), None),
                (hull.image, "hull", note(hull.errors), Some(Method::Hull)),
                (fitted.image, "fitted", note(fitted.errors), Some(Method::Fitted)),
            ];
            most = Some((fall, pictures));
        }
    }
    if let Some((_, pictures)) = most {
        let [(original, ..), (hull, ..), (fitted, ..)] = &pictures;
        let off = |a: &image::RgbImage, x, y| {
            let (a, b) = (a.get_pixel(x, y), original.get_pixel(x, y));
            a.0.iter().zip(b.0).map(|(a, b)| f64::from(a.abs_diff(b)).powi(2)).sum::<f64>()
        };
        let crop = Crop::of_most(original.dimensions(), |x, y| off(hull, x, y) - off(fitted, x, y));
        let (mut wholes, mut parts) = (Vec::new(), Vec::new());
        for (image, title, note, method) in pictures {
            let name = format!("hull_failure_{}", method.map_or("original", Method::name));
            let palette = method.map(|method| evidence.drawings[method as usize].clone());
            let file = evidence.folder.picture(&name, &image)?;
            wholes.push(Picture { file, title: title.into(), note, palette });
            let file = evidence.folder.picture(&format!("{name}_part"), &crop.enlarged(&image))?;
            parts.push(Picture { file, title: format!("{title}, a part"), note: String::new(), palette: None });
        }
        section.pictures(wholes);
        section.pictures(parts);
    }
    let mut head = vec![("view", "view"), ("palette", "palette")];
    head.extend(COLUMNS);
    section.table(&evidence.folder, "figure_11", Table { head, rows })?;
    Ok(section)
}
