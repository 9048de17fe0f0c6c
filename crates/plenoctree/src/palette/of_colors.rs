//! The palette of colors that are at hand, such as a picture's pixels.

use glam::DVec3;

use super::{
    colors::{InvalidPalette, Palette},
    extract::order,
    kmeans::Clusters,
    simplify::simplify,
};

/// The corners of the convex hull of `colors` (encoded sRGB), simplified to `wanted` of them: steps 8 and 9 of section 3 of
/// the method, on their own.
///
/// Of a picture's pixels this is the palette of Tan et al. (2016), which the method is compared to. A cloud of colors with
/// a volume has at least four corners, so that four is the least it can give. The colors are in [0, 1]; the
/// weights are the shares of the given colors that lie nearest to each, heaviest first.
///
/// # Errors
///
/// If there are no colors, if one is not finite, or if the hull keeps more than [`Palette::MAX_COLORS`] corners.
pub fn simplify_hull(colors: &[[f64; 3]], wanted: usize) -> Result<Palette, InvalidPalette> {
    if colors.is_empty() {
        return Err(InvalidPalette::Colors { found: 0 });
    }
    if let Some(index) = colors.iter().position(|color| !color.iter().all(|channel| channel.is_finite())) {
        return Err(InvalidPalette::Color { index, found: colors[index] });
    }
    let mut outer = colors.to_vec();
    (0..3).for_each(|axis| keep_ends(&mut outer, axis));
    let points: Vec<DVec3> = outer.into_iter().map(DVec3::from).collect();
    let corners = simplify(&points, wanted).corners;
    let corners = corners.iter().map(|corner| corner.clamp(DVec3::ZERO, DVec3::ONE).into()).collect();

    let share = 1.0 / colors.len() as f64;
    let palette = order(corners, &Clusters { centers: colors.to_vec(), weights: vec![share; colors.len()] });
    palette.validate()?;
    Ok(palette)
}

/// Of all colors on a line along an axis, keeps the two at its ends: the others cannot be corners. That leaves the surface
/// of the thousands of colors on the lattice that a picture of 8 bits has.
fn keep_ends(colors: &mut Vec<[f64; 3]>, axis: usize) {
    let line = |color: &[f64; 3]| [color[(axis + 1) % 3], color[(axis + 2) % 3]];
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

    fn picture() -> impl Strategy<Value = Vec<[f64; 3]>> {
        let pixel = prop::array::uniform3(0..8u8).prop_map(|p| p.map(|x| f64::from(x) / 7.0));
        prop::collection::vec(pixel, 1..200)
    }

    proptest! {
        /// Colors that cannot be corners do not matter, and any picture has a palette.
        #[test]
        fn only_the_surface_matters(colors in picture(), wanted in 4usize..10) {
            let palette = simplify_hull(&colors, wanted).unwrap();
            prop_assert!((palette.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(palette.weights.is_sorted_by(|a, b| a >= b));
            prop_assert!(palette.colors.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)));

            let mut outer = colors.clone();
            (0..3).for_each(|axis| keep_ends(&mut outer, axis));
            let points = |colors: &[[f64; 3]]| colors.iter().map(|&color| color.into()).collect::<Vec<DVec3>>();
            let corners = |colors: &[[f64; 3]]| {
                let mut corners = simplify(&points(colors), usize::MAX).corners;
                corners.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
                corners
            };
            let (all, outer) = (corners(&colors), corners(&outer));
            prop_assert_eq!(all.len(), outer.len());
            prop_assert!(all.iter().zip(&outer).all(|(a, b)| a.distance(*b) < 1e-9));
        }
    }

    /// A picture whose colors fill the cube has its corners as palette.
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
    fn nothing_has_no_palette() {
        assert_eq!(simplify_hull(&[], 6), Err(InvalidPalette::Colors { found: 0 }));
        let error = simplify_hull(&[[0.0; 3], [0.5, f64::INFINITY, 0.0]], 6).unwrap_err();
        assert!(matches!(error, InvalidPalette::Color { index: 1, .. }));
    }
}
