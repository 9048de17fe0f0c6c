//! Leaves of different sizes.

use glam::DVec3;
use plenoctree::{BakeSettings, Basis, PlenOctree, bake, camera::PinholeCamera};
use plenoctree_fit::FitSettings;

use super::{fit_folder, scene};

/// A finely striped ball, with negative x, and a plain one.
fn balls() -> PlenOctree {
    let middle = |at: DVec3| at + DVec3::X * if at.x < 0.0 { 0.5 } else { -0.5 };
    let settings = BakeSettings { depth: 7, basis: Basis::Rgba, directions: 8, ..BakeSettings::default() };
    let color = |at: DVec3| match at.x < 0.0 {
        true => DVec3::splat(0.2) + 0.6 * (8.0 * at).floor().element_sum().rem_euclid(2.0),
        false => DVec3::new(0.8, 0.5, 0.2),
    };
    bake(&settings, |at| if middle(at).length() < 0.45 { 60.0 } else { 0.0 }, |at| move |_| color(at)).unwrap()
}

/// Leaves are small where pictures show detail, and there need to be fewer of them than if all were.
#[test]
fn leaves_are_small_where_the_detail_is() {
    let folder = scene::folder("leaves");
    let cameras: Vec<PinholeCamera> = scene::cameras(40).iter().map(|camera| camera.resized(80, 80)).collect();
    scene::write_pictures_of(&balls(), &folder, &cameras, None, |_| 1.0);
    scene::write_transforms(&folder, &cameras);
    let fitted = |leaves: usize| {
        let settings = FitSettings { leaves, effort: 0.06, basis: Basis::Sh1, ..FitSettings::default() };
        let fitted = fit_folder(&folder, &settings);
        (fitted.report.held_out.unwrap().psnr_db, fitted.field)
    };
    let (psnr_of_all, all) = fitted(usize::MAX);
    let most = all.leaves() / 2;
    let (psnr, field) = fitted(most);
    assert!(field.leaves() <= most, "{} of {most}", field.leaves());
    assert!(psnr > psnr_of_all - 0.2, "{psnr} dB, with small leaves everywhere {psnr_of_all} dB");
    let mean_size = |striped: bool| {
        let middle = f64::from(1 << field.depth()) / 2.0;
        let on_side = field.leaf_cells().filter(|cell| (f64::from(cell.corner.x) < middle) == striped);
        let sizes: Vec<f64> = on_side.map(|cell| cell.size.into()).collect();
        sizes.iter().sum::<f64>() / sizes.len() as f64
    };
    assert_eq!(field.depth(), 7);
    assert!(mean_size(true) + 0.3 < mean_size(false), "{} {}", mean_size(true), mean_size(false));
}
