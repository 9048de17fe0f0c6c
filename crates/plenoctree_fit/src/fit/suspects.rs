//! Finds the views that contradict the others.

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::{
    error::FitError,
    measure::decibels,
    report::SuspiciousView,
    train::{Model, TrainView, backdrop::Backdrop, batch::render_ray, gallery::Gallery},
};

/// About how many pixels of a view are compared.
const PIXELS: f64 = 3000.0;
/// Opacity below which nothing is seen.
const CLEAR: f32 = 0.01;
/// How far below the median a view must be: five times the error.
const FAR: f64 = 7.0;
/// The same, as a multiple of the median deviation from it.
const UNUSUAL: f64 = 8.0;
/// Both for photographs without opacity, which have large errors everywhere, so that wrong poses add less to them.
const OPAQUE: (f64, f64) = (4.0, 4.0);

/// Returns the median PSNR of the views, if any sees the model, and those whose error is far above it, or that do not
/// see the model at all. `numbers` are the numbers of the gallery's views in the input.
///
/// # Errors
///
/// Returns an error if a picture cannot be read.
pub fn suspicious(
    model: &Model,
    gallery: &mut Gallery,
    numbers: &[usize],
) -> Result<(Option<f64>, Vec<SuspiciousView>), FitError> {
    let mut psnrs = Vec::new();
    gallery.each(|view| psnrs.push(psnr(model, view)))?;
    let mut sorted: Vec<f64> = psnrs.iter().flatten().copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(&median) = sorted.get(sorted.len() / 2) else { return Ok((None, Vec::new())) };
    let mut deviations: Vec<f64> = sorted.iter().map(|psnr| (psnr - median).abs()).collect();
    deviations.sort_unstable_by(f64::total_cmp);
    let (far, unusual) = if matches!(model.backdrop, Backdrop::Random) { (FAR, UNUSUAL) } else { OPAQUE };
    let limit = median - f64::max(far, unusual * deviations[deviations.len() / 2]);
    let wrong = psnrs.into_iter().enumerate().filter(|(_, psnr)| psnr.is_none_or(|psnr| psnr < limit));
    let wrong = wrong.map(|(index, psnr_db)| SuspiciousView {
        number: numbers[index],
        name: gallery.views()[index].name.clone(),
        psnr_db,
    });
    Ok((Some(median), wrong.collect()))
}

/// Returns the PSNR in the pixels in which the picture or the model shows something, or `None` if no ray meets the
/// model.
fn psnr(model: &Model, view: &TrainView) -> Option<f64> {
    let camera = &view.camera;
    let gain = model.gains[view.number];
    let stride = (f64::from(camera.width) * f64::from(camera.height) / PIXELS).sqrt().ceil().max(1.0) as u32;
    let row = |y: u32| {
        let (mut squared, mut count, mut sees) = (0.0, 0.0, false);
        for x in (stride / 2..camera.width).step_by(stride as usize).filter(|x| camera.knows(*x, y)) {
            let direction = camera.direction(DVec2::new(x.into(), y.into()) + 0.5);
            let (seen, transmittance) = render_ray(&model.grid, camera.position, direction);
            let [r, g, b, a] = view.picture.pixel(x, y);
            let visible = transmittance < 1.0 - CLEAR;
            sees |= visible;
            let (error, channels) = if matches!(model.backdrop, Backdrop::Random) {
                if !visible && a < CLEAR {
                    continue;
                }
                let opacity = 1.0 - transmittance - a;
                ((seen - Vec3::new(r, g, b)).length_squared() + opacity * opacity, 4.0)
            } else {
                if !visible {
                    continue;
                }
                let behind = model.backdrop.color(direction, Vec3::ONE);
                ((gain * (seen + transmittance * behind) - Vec3::new(r, g, b)).length_squared(), 3.0)
            };
            squared += f64::from(error);
            count += channels;
        }
        (squared, count, sees)
    };
    let rows: Vec<u32> = (stride / 2..camera.height).step_by(stride as usize).collect();
    let sums: Vec<(f64, f64, bool)> = rows.into_par_iter().map(row).collect();
    let (squared, count, sees) =
        sums.into_iter().fold((0.0, 0.0, false), |sum, row| (sum.0 + row.0, sum.1 + row.1, sum.2 || row.2));
    sees.then(|| decibels(squared / count))
}
