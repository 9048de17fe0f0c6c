//! Single steps of extraction, which can also be applied to other colors, such as the pixels of an image.

use glam::DVec3;

use super::{
    colors::{InvalidPalette, Palette},
    extract,
    kmeans::{Clusters, cluster},
    order::order,
    settings::ExtractionSettings,
    simplify::simplify,
};
use crate::sampling::{Histograms, Progress};

/// Returns the palette of given colors (encoded sRGB): the corners of their convex hull, simplified to at most
/// `max_colors`. This is section 3 of the method, steps 8 and 9, without the other steps.
///
/// Applied to the pixels of an image, this is the method of Tan et al. (2016), which the paper compares itself to. A
/// cloud of colors that has a volume always keeps at least four corners. The palette is clamped to the RGB cube. Its
/// weights are the shares of the given colors that are nearest to each palette color, heaviest first.
///
/// # Errors
///
/// Returns an error if there are no colors, if one is not finite in float32, or if the hull keeps more than
/// [`Palette::MAX_COLORS`] corners.
pub fn simplify_hull(colors: &[[f64; 3]], max_colors: usize) -> Result<Palette, InvalidPalette> {
    if colors.is_empty() {
        return Err(InvalidPalette::new("no colors".into(), "at least one"));
    }
    InvalidPalette::check_colors("color", colors)?;
    let mut outer = colors.to_vec();
    (0..3).for_each(|axis| keep_ends(&mut outer, axis));
    let points: Vec<DVec3> = outer.into_iter().map(DVec3::from).collect();
    let simplified = simplify(&points, max_colors, &Progress::default());
    let corners = simplified.corners(max_colors).iter();
    let corners = corners.map(|corner| corner.clamp(DVec3::ZERO, DVec3::ONE).into()).collect();

    let share = 1.0 / colors.len() as f64;
    let palette = order(corners, &Clusters { centers: colors.to_vec(), weights: vec![share; colors.len()] });
    palette.validate()?;
    Ok(palette)
}

/// Returns the initial centers of k-means for a field: section 3 of the method, step 6. Empty if there is no weight.
pub fn initial_centers(histograms: &Histograms, settings: &ExtractionSettings) -> Vec<[f64; 3]> {
    extract::initial_centers(&histograms.coarse, settings.coarse_threshold)
}

/// Returns the centers of the clusters that weighted k-means finds from the given initial centers: section 3 of the
/// method, step 7, without the other steps. All colors are encoded sRGB.
///
/// Colors without weight are left out. Uses the iterations and the tolerance of `settings`.
///
/// # Errors
///
/// Returns an error if there are no initial centers or no colors with weight, if there is not one weight per color, if
/// a color is not finite in float32, or if a weight is negative or not finite.
pub fn k_means(
    colors: &[[f64; 3]],
    weights: &[f64],
    centers: &[[f64; 3]],
    settings: &ExtractionSettings,
) -> Result<Vec<[f64; 3]>, InvalidPalette> {
    InvalidPalette::check_weights(weights, colors.len())?;
    InvalidPalette::check_colors("color", colors)?;
    InvalidPalette::check_colors("initial center", centers)?;
    let (points, weights): (Vec<_>, Vec<_>) = colors.iter().zip(weights).filter(|(_, weight)| **weight > 0.0).unzip();
    if points.is_empty() || centers.is_empty() {
        return Err(InvalidPalette::new("no colors with weight, or no initial centers".into(), "at least one of both"));
    }
    let (centers, progress) = (centers.to_vec(), Progress::default());
    let clusters = cluster(&points, &weights, centers, settings.max_iterations, settings.tolerance, &progress);
    // Nothing else can cancel it.
    Ok(clusters.map_or_else(|_| Vec::new(), |clusters| clusters.centers))
}

/// Keeps only the two ends of the colors on each line along an axis, since the others cannot be corners. Of the colors
/// of an 8-bit image, which are on a lattice, only the surface remains.
fn keep_ends(colors: &mut Vec<[f64; 3]>, axis: usize) {
    // Adding 0 makes -0 the same as 0, also to `total_cmp`.
    let line = |color: &[f64; 3]| [color[(axis + 1) % 3] + 0.0, color[(axis + 2) % 3] + 0.0];
    colors.sort_unstable_by(|a, b| {
        let ([a0, a1], [b0, b1]) = (line(a), line(b));
        a0.total_cmp(&b0).then(a1.total_cmp(&b1)).then(a[axis].total_cmp(&b[axis]))
    });
    let ends = |line: &[[f64; 3]]| [line[0], line[line.len() - 1]];
    *colors = colors.chunk_by(|a, b| line(a) == line(b)).flat_map(ends).collect();
    colors.dedup();
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::palette::{ColorCount, PaletteMethod};

    fn image() -> impl Strategy<Value = Vec<[f64; 3]>> {
        // Some are 0, and some -0.
        let channel = |x: i8| if x < 0 { -0.0 } else { f64::from(x) / 7.0 };
        let pixel = prop::array::uniform3(-1..8i8).prop_map(move |p| p.map(channel));
        prop::collection::vec(pixel, 1..200)
    }

    proptest! {
        /// Colors that cannot be corners do not matter, and any image has a palette.
        #[test]
        fn only_the_surface_matters(colors in image(), max_colors in 4usize..10) {
            let palette = simplify_hull(&colors, max_colors).unwrap();
            prop_assert!((palette.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(palette.weights.is_sorted_by(|a, b| a >= b));
            prop_assert!(palette.colors.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)));

            let mut outer = colors.clone();
            (0..3).for_each(|axis| keep_ends(&mut outer, axis));
            let points = |colors: &[[f64; 3]]| colors.iter().map(|&color| color.into()).collect::<Vec<DVec3>>();
            let corners = |colors: &[[f64; 3]]| {
                let simplified = simplify(&points(colors), usize::MAX, &Progress::default());
                let mut corners: Vec<DVec3> = simplified.corners(usize::MAX).iter().map(|c| c + DVec3::ZERO).collect();
                corners.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
                corners
            };
            let (all, outer) = (corners(&colors), corners(&outer));
            prop_assert_eq!(all.len(), outer.len());
            prop_assert!(all.iter().zip(&outer).all(|(a, b)| a.distance(*b) < 1e-9));
        }
    }

    /// The palette of an image whose colors fill the cube is the cube's corners.
    #[test]
    fn a_full_cube_has_its_corners() {
        let colors: Vec<[f64; 3]> =
            (0..4096).map(|i| [i / 256, i / 16 % 16, i % 16].map(|x| f64::from(x) / 15.0)).collect();
        let palette = simplify_hull(&colors, 8).unwrap();
        assert_eq!(palette.colors.len(), 8);
        assert!(palette.colors.iter().flatten().all(|&channel| channel == 0.0 || channel == 1.0));
        assert!(palette.weights.iter().all(|weight| (weight - 0.125).abs() < 1e-12));
    }

    #[test]
    fn invalid_colors_are_errors() {
        assert_eq!(simplify_hull(&[], 6).unwrap_err().to_string(), "found no colors, expected at least one");
        let error = simplify_hull(&[[0.0; 3], [0.5, f64::INFINITY, 0.0]], 6).unwrap_err();
        assert!(error.to_string().contains(" as color 1, expected finite numbers"), "{error}");
    }

    /// The steps, one after another, give the palette of an extraction.
    #[test]
    fn the_steps_make_an_extraction() {
        let (mut fine, mut coarse) = (vec![0.0; 32usize.pow(3)], vec![0.0; 8usize.pow(3)]);
        let mut state = 1u64;
        for _ in 0..400 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let [r, g, b] = [58, 53, 48].map(|shift| (state >> shift) as usize % 32);
            let weight = (state >> 40) as f64 % 7.0;
            fine[(r * 32 + g) * 32 + b] += weight;
            coarse[(r / 4 * 8 + g / 4) * 8 + b / 4] += weight;
        }
        let histograms = Histograms::new(32, fine, 8, coarse, 400).unwrap();
        let (method, colors) = (PaletteMethod::Hull, ColorCount::Fixed(6));
        let settings = ExtractionSettings { method, colors, ..Default::default() };
        let center = |bin: usize| [bin / 1024, bin / 32 % 32, bin % 32].map(|index| (index as f64 + 0.5) / 32.0);
        let bins: Vec<[f64; 3]> = (0..32usize.pow(3)).map(center).collect();
        let total = histograms.total_weight();
        let weights: Vec<f64> = histograms.fine().iter().map(|weight| weight / total).collect();
        let centers = k_means(&bins, &weights, &initial_centers(&histograms, &settings), &settings).unwrap();
        let sorted = |palette: Palette| {
            let mut colors = palette.colors;
            colors.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2])));
            colors
        };
        let extracted =
            extract::extract_from_samples(&histograms, &[], &settings, &Progress::default()).unwrap().palette;
        assert_eq!(sorted(simplify_hull(&centers, 6).unwrap()), sorted(extracted));
    }

    /// Next to a heavy color, one of hardly any weight is lost in rounding, and no center with it.
    #[test]
    fn centers_are_numbers_whatever_the_weights() {
        let (colors, centers) = ([[0.0; 3], [1.0; 3]], [[0.4; 3], [5.0; 3]]);
        let settings = ExtractionSettings { max_iterations: 1, ..Default::default() };
        let found = k_means(&colors, &[1e-20, 1.0], &centers, &settings).unwrap();
        assert!(found.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)), "{found:?}");
    }

    #[test]
    fn clusters_of_invalid_colors_are_errors() {
        let settings = ExtractionSettings::default();
        let one = [[0.5; 3]];
        for (weights, center, found) in [
            (&[][..], Some([0.5; 3]), "found 0 weights, expected one for each of 1 colors"),
            (&[-1.0], Some([0.5; 3]), "found -1 as weight 0"),
            (&[0.0], Some([0.5; 3]), "found no colors with weight"),
            (&[1.0], None, "found no colors with weight, or no initial centers"),
            (&[1.0], Some([f64::NAN; 3]), "found [NaN, NaN, NaN] as initial center 0"),
        ] {
            let error = k_means(&one, weights, center.as_slice(), &settings).unwrap_err().to_string();
            assert!(error.starts_with(found), "{error}");
        }
    }
}
