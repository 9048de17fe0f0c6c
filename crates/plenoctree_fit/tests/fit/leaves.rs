//! Leaves of different sizes.

use glam::{DVec3, UVec3};
use plenoctree::{BakeSettings, Basis, PlenOctree, bake, camera::PinholeCamera};
use plenoctree_fit::FitSettings;

use super::{fit_folder, scene};

/// The x coordinate between the balls.
const BETWEEN: f64 = -0.3;

/// A small ball of fine tiles, and a large plain one.
fn balls() -> PlenOctree {
    let settings = BakeSettings { depth: 7, basis: Basis::Rgba, directions: 8, ..BakeSettings::default() };
    let inside = |at: DVec3| at.distance(-0.65 * DVec3::X) < 0.3 || at.distance(0.35 * DVec3::X) < 0.55;
    let color = |at: DVec3| match at.x < BETWEEN {
        true => DVec3::splat(0.2) + 0.6 * (8.0 * at).floor().element_sum().rem_euclid(2.0),
        false => DVec3::new(0.8, 0.5, 0.2),
    };
    bake(&settings, |at| if inside(at) { 60.0 } else { 0.0 }, |at| move |_| color(at)).unwrap()
}

/// Leaves are small where pictures show detail, and there need to be fewer of them than if all were.
#[test]
fn leaves_are_small_where_the_detail_is() {
    let folder = scene::folder("leaves");
    let cameras: Vec<PinholeCamera> = scene::cameras(24).iter().map(|camera| camera.resized(80, 80)).collect();
    scene::write_pictures_of(&balls(), &folder, &cameras);
    scene::write_transforms(&folder, &cameras);
    let fitted = |leaves: usize| {
        let settings = FitSettings { leaves, effort: 0.025, basis: Basis::Sh1, ..FitSettings::default() };
        let fitted = fit_folder(&folder, &settings);
        (fitted.report.held_out.unwrap().psnr_db, fitted.field)
    };
    let (psnr_of_all, all) = fitted(usize::MAX);
    let most = all.leaves() * 2 / 5;
    let (psnr, field) = fitted(most);
    assert!(field.leaves() <= most, "{} of {most}", field.leaves());
    assert!(psnr > psnr_of_all - 0.5, "{psnr} dB, with small leaves everywhere {psnr_of_all} dB");
    let mean_size = |tiled: bool| {
        let finest = f64::from(1 << field.depth());
        let is_tiled = |corner: UVec3| field.frame().to_world(corner.as_dvec3() / finest).x < BETWEEN;
        let cells = field.leaf_cells().filter(|cell| is_tiled(cell.corner) == tiled);
        let sizes: Vec<f64> = cells.map(|cell| cell.size.into()).collect();
        sizes.iter().sum::<f64>() / sizes.len() as f64
    };
    assert_eq!(field.depth(), 7);
    assert!(mean_size(true) + 0.1 < mean_size(false), "{} {}", mean_size(true), mean_size(false));
}
