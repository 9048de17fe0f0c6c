//! Extracts the palette of a field: the steps of section 3 of the method, one after another.

use glam::DVec3;
use web_time::Instant;

use super::{
    colors::Palette,
    errors::ColorErrors,
    fit::Cloud,
    kmeans::{self, Clusters},
    method::{ColorCount, PaletteMethod},
    order::order,
    settings::ExtractionSettings,
    simplify::simplify,
    tones::{self, Enough, tones},
};
use crate::{
    field::PlenOctree,
    sampling::{Bins, Canceled, Histograms, InvalidSetting, Progress, SamplingError, SamplingSettings, View, sample},
};

/// An extracted palette, and how it was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Extraction {
    /// The palette, with every channel in [0, 1]. Its weights are shares of the visible weight and sum to 1.
    pub palette: Palette,
    /// How it was extracted.
    pub report: ExtractionReport,
}

/// How a palette was extracted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtractionReport {
    /// Number of radiance samples: leaves times direction cells, including samples without weight.
    pub radiance_samples: u64,
    /// Total weight of all samples.
    pub total_weight: f64,
    /// How far the fine histogram's colors are from their labels, with the settings' `blend_steps`, or
    /// without blends if the method is [`PaletteMethod::Tones`].
    pub errors: ColorErrors,
    /// What [`ColorCount::Auto`] keeps within its tolerance: the root mean square of `errors` or, if the method is
    /// [`PaletteMethod::Tones`], the largest of it and those of what is seen, in color and in hue.
    pub largest_error: f64,
    /// K: number of clusters. `None` unless the method is [`PaletteMethod::Hull`].
    pub clusters: Option<usize>,
    /// Number of corners of the clusters' convex hull, before it was simplified. `None` unless the method is
    /// [`PaletteMethod::Hull`].
    pub hull_vertices: Option<usize>,
    /// Time spent on each part of the extraction.
    pub seconds: ExtractionTimes,
}

/// Time spent on each part of an extraction, in seconds. The parts are those of table 1 of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExtractionTimes {
    /// Radiance samples, histograms and views: steps 1 to 5, and the points of step 11. 0 if these were given.
    pub sampling: f64,
    /// K-means: steps 6 and 7.
    pub filtering: f64,
    /// The convex hull, its simplification and the order of the colors: steps 8 and 9.
    pub hull: f64,
    /// The fit to the labels: step 10, or steps 11 and 12.
    pub fitting: f64,
}

/// An error that occurs when extracting a palette.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExtractionError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// The field has no leaves, or none whose light leaves it.
    #[error("nothing of the field is visible: it is empty, or too faint")]
    NothingVisible,
    /// [`Progress::cancel`] was called.
    #[error(transparent)]
    Canceled(#[from] Canceled),
}

impl From<SamplingError> for ExtractionError {
    fn from(error: SamplingError) -> Self {
        match error {
            SamplingError::Setting(setting) => Self::Setting(setting),
            SamplingError::Canceled(canceled) => Self::Canceled(canceled),
        }
    }
}

/// Extracts the palette of a whole field, on all cores.
///
/// The same field and settings always give the same palette, bit for bit.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if nothing is visible in the field, or if the extraction is canceled.
pub fn extract(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    progress: &Progress,
) -> Result<Extraction, ExtractionError> {
    extract_with(field, settings, progress, |sampling| sample(field, sampling, progress))
        .map(|(extraction, _)| extraction)
}

/// Extracts the palette of a whole field like [`extract`], with histograms from another sampler than [`sample`], and
/// also returns the histograms.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if nothing is visible in the field, if the sampler fails, or if the
/// extraction is canceled.
pub fn extract_with(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    progress: &Progress,
    sampler: impl FnOnce(&SamplingSettings) -> Result<Histograms, SamplingError>,
) -> Result<(Extraction, Histograms), ExtractionError> {
    settings.validate()?;
    let start = Instant::now();
    let histograms = sampler(&settings.sampling_of(field))?;
    let views = View::all(field, &settings.view_rays(field), progress)?;
    let sampling = start.elapsed().as_secs_f64();
    let mut extraction = extract_from_samples(&histograms, &views, settings, progress)?;
    extraction.report.seconds.sampling = sampling;
    Ok((extraction, histograms))
}

/// Extracts the palette from samples of a field: steps 6 to 12.
///
/// Histograms may have any number of bins. [`PaletteMethod::Tones`] finds the colors that are seen in views of the
/// field, along the [rays](ExtractionSettings::view_rays) of the settings. Without views, tones are those of the
/// histograms, and their ramps are [guessed](Palette::guess_ramps).
///
/// # Errors
///
/// Returns an error if a setting is out of range, if the histograms have no weight, or if the extraction is canceled.
pub fn extract_from_samples(
    histograms: &Histograms,
    views: &[View],
    settings: &ExtractionSettings,
    progress: &Progress,
) -> Result<Extraction, ExtractionError> {
    settings.validate()?;
    let mut seconds = ExtractionTimes::default();
    let (mut clusters, mut hull_vertices) = (None, None);
    let mut salient = 0.0;
    let start = Instant::now();
    let palette = match settings.method {
        PaletteMethod::Hull => {
            let filtered = filter(histograms, settings, progress)?.ok_or(ExtractionError::NothingVisible)?;
            seconds.filtering = start.elapsed().as_secs_f64();
            let start = Instant::now();
            let centers: Vec<DVec3> = filtered.centers.iter().map(|&center| center.into()).collect();
            // The first number of colors to try is the smallest.
            let mut simplified = None;
            let palette = choose(histograms, settings, progress, |colors| {
                let simplified = simplified.get_or_insert_with(|| simplify(&centers, colors, progress));
                progress.check()?;
                hull_vertices = Some(simplified.before());
                let corners = simplified.corners(colors).iter();
                Ok(order(corners.map(|corner| corner.clamp(DVec3::ZERO, DVec3::ONE).into()).collect(), &filtered))
            })?;
            seconds.hull = start.elapsed().as_secs_f64();
            clusters = Some(filtered.centers.len());
            palette
        }
        PaletteMethod::Fitted => {
            let cloud = Cloud::new(&histograms.fine).ok_or(ExtractionError::NothingVisible)?;
            let palette =
                choose(histograms, settings, progress, |colors| cloud.fit(colors, settings.blend_steps, progress))?;
            seconds.fitting = start.elapsed().as_secs_f64();
            palette
        }
        PaletteMethod::Tones => {
            let mut colors = tones::seen_colors(views);
            if colors.is_empty() {
                colors = tones::binned_colors(&histograms.fine);
            }
            let points = tones::points(&colors, progress)?;
            let within = |tolerance: f64| {
                let points = &points;
                move |palette: &Palette| {
                    // Labels are assigned by method.
                    let palette = Palette { method: Some(settings.method), ..palette.clone() };
                    let errors = ColorErrors::of_labels_unless_canceled(histograms, &palette, 1, progress)?;
                    Ok(errors.rmse.max(tones::salient_error(points, &palette)) <= tolerance)
                }
            };
            let palette = match settings.colors {
                ColorCount::Usual => tones(&points, Enough::Error(TONE_ERROR), progress)?,
                ColorCount::Fixed(count) => tones(&points, Enough::Count(count), progress)?,
                ColorCount::Auto { tolerance } => tones(&points, Enough::Palette(&within(tolerance)), progress)?,
            };
            let mut palette = palette.ok_or(ExtractionError::NothingVisible)?;
            palette.ramps = palette.ramps_in_views(views);
            // Labels are assigned by method.
            salient = tones::salient_error(&points, &Palette { method: Some(settings.method), ..palette.clone() });
            seconds.fitting = start.elapsed().as_secs_f64();
            palette
        }
    };
    let palette = Palette { method: Some(settings.method), ..palette };
    let errors = ColorErrors::of_labels_unless_canceled(histograms, &palette, settings.steps(), progress)?;
    let report = ExtractionReport {
        radiance_samples: histograms.samples(),
        total_weight: histograms.total_weight(),
        errors,
        largest_error: errors.rmse.max(salient),
        clusters,
        hull_vertices,
        seconds,
    };
    progress.finish();
    Ok(Extraction { palette, report })
}

/// The number of colors of a palette whose colors are blended, unless settings specify another.
const USUAL: usize = 6;
/// The error of tones, as a distance in tone space, that is small enough.
const TONE_ERROR: f64 = 0.03;

/// Returns the palette with the number of colors that the settings specify. `find` finds a palette of at most a number
/// of colors.
fn choose(
    histograms: &Histograms,
    settings: &ExtractionSettings,
    progress: &Progress,
    mut find: impl FnMut(usize) -> Result<Palette, Canceled>,
) -> Result<Palette, Canceled> {
    let tolerance = match settings.colors {
        ColorCount::Usual => return find(USUAL),
        ColorCount::Fixed(colors) => return find(colors),
        ColorCount::Auto { tolerance } => tolerance,
    };
    for colors in 1..ColorCount::MOST {
        let palette = find(colors)?;
        let errors = ColorErrors::of_labels_unless_canceled(histograms, &palette, settings.blend_steps, progress)?;
        if errors.rmse <= tolerance {
            return Ok(palette);
        }
    }
    find(ColorCount::MOST)
}

/// Clusters the histograms into representative colors: steps 6 and 7. Returns `None` if there is no weight.
fn filter(
    histograms: &Histograms,
    settings: &ExtractionSettings,
    progress: &Progress,
) -> Result<Option<Clusters>, Canceled> {
    let bins = &histograms.fine;
    let (points, weights): (Vec<_>, Vec<_>) = bins
        .shares()
        .enumerate()
        .map(|(bin, share)| (bins.center(bin), share))
        .filter(|(_, weight)| *weight > 0.0)
        .unzip();
    let centers = initial_centers(&histograms.coarse, settings.coarse_threshold);
    if points.is_empty() || centers.is_empty() {
        return Ok(None);
    }
    kmeans::cluster(&points, &weights, centers, settings.max_iterations, settings.tolerance, progress).map(Some)
}

/// Returns the centers of the bins with more than `threshold` of the weight, in the order of their indices.
///
/// If there are none, returns the centers of the `1 / threshold` heaviest bins: the largest number of bins that could
/// be above the threshold. In any case, returns at most [`ExtractionSettings::MAX_CLUSTERS`], the heaviest.
pub(super) fn initial_centers(bins: &Bins, threshold: f64) -> Vec<[f64; 3]> {
    let mut chosen: Vec<usize> =
        (0..).zip(bins.shares()).filter(|(_, share)| *share > threshold).map(|(i, _)| i).collect();
    let mut most = ExtractionSettings::MAX_CLUSTERS;
    if chosen.is_empty() {
        most = most.min((1.0 / threshold) as usize);
        chosen = (0..bins.weights.len()).filter(|&i| bins.weights[i] > 0.0).collect();
    }
    if chosen.len() > most {
        chosen.sort_by(|&a, &b| bins.weights[b].total_cmp(&bins.weights[a]).then(a.cmp(&b)));
        chosen.truncate(most);
        chosen.sort_unstable();
    }
    chosen.into_iter().map(|bin| bins.center(bin)).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };

    fn extract_from_histograms(
        histograms: &Histograms,
        settings: &ExtractionSettings,
    ) -> Result<Extraction, ExtractionError> {
        extract_from_samples(histograms, &[], settings, &Progress::default())
    }

    /// Tones may be near to nearly all of the weight, and far from rare colors, which also count.
    #[test]
    fn rare_colors_count_in_the_largest_error() {
        let (mut fine, mut coarse) = (vec![1.0; 32 * 32 * 32], vec![64.0; 8 * 8 * 8]);
        fine[(16 * 32 + 16) * 32 + 16] = 1e8;
        coarse[(4 * 8 + 4) * 8 + 4] = 1e8;
        let histograms = Histograms::new(32, fine, 8, coarse, 0).unwrap();
        let settings = ExtractionSettings { colors: ColorCount::Auto { tolerance: 0.005 }, ..Default::default() };
        let report = extract_from_histograms(&histograms, &settings).unwrap().report;
        assert!(report.errors.rmse < 0.005 && report.largest_error > 0.005, "{report:?}");
    }

    /// Returns histograms with 24 and 8 bins per channel, so that centers of coarse bins are also centers of fine bins.
    fn histograms(colors: &[([f64; 3], f64)]) -> Histograms {
        Histograms::of(24, colors)
    }

    fn hull() -> ExtractionSettings {
        ExtractionSettings { method: PaletteMethod::Hull, ..Default::default() }
    }

    const RED: [f64; 3] = [15.0 / 16.0, 1.0 / 16.0, 1.0 / 16.0];
    const GREEN: [f64; 3] = [1.0 / 16.0, 15.0 / 16.0, 1.0 / 16.0];
    const BLUE: [f64; 3] = [1.0 / 16.0, 1.0 / 16.0, 15.0 / 16.0];
    const BLACK: [f64; 3] = [1.0 / 16.0; 3];
    const GRAY: [f64; 3] = [3.0 / 16.0; 3];

    /// Weights may be so large that their sum is infinite.
    #[test]
    fn the_scale_of_weights_does_not_matter() {
        let found = |scale: f64| {
            let weights =
                [(RED, 4.0), (GREEN, 3.0), (BLUE, 2.0), (BLACK, 1.0)].map(|(color, weight)| (color, scale * weight));
            extract_from_histograms(&histograms(&weights), &hull()).unwrap().palette
        };
        let (usual, largest) = (found(1.0), found(4e307));
        let numbers = |palette: &Palette| [palette.colors.as_flattened(), &palette.weights].concat();
        let pairs = numbers(&usual).into_iter().zip(numbers(&largest));
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-12), "{usual:?}, {largest:?}");
    }

    /// The corners of the cloud become the palette, heaviest first. A color inside adds its weight to the nearest
    /// corner.
    #[test]
    fn corners_come_heaviest_first() {
        let weights = [(RED, 1.0), (GREEN, 3.0), (BLUE, 1.0), (BLACK, 1.0), (GRAY, 1.5)];
        let extraction = extract_from_histograms(&histograms(&weights), &hull()).unwrap();
        let expected = [GREEN, BLACK, BLUE, RED];
        for (found, expected) in extraction.palette.colors.iter().zip(expected) {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        }
        let shares: Vec<f64> = extraction.palette.weights.iter().map(|weight| weight * 7.5).collect();
        assert!(shares.iter().zip([3.0, 2.5, 1.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{shares:?}");
        let report = extraction.report;
        assert_eq!((report.clusters, report.hull_vertices, report.total_weight), (Some(5), Some(4), 7.5));
    }

    /// Half of the work on a palette of tones comes after sampling, and is counted. Of other palettes, next to nothing
    /// does.
    #[test]
    fn progress_counts_what_comes_after_sampling() {
        let settings = BakeSettings { depth: 5, basis: Basis::Rgba, directions: 1, ..Default::default() };
        let color = |at: DVec3| move |_: DVec3| 0.5 + 0.4 * (4.0 * at).map(f64::sin);
        let field = bake(&settings, |at| if at.length() < 0.8 { 50.0 } else { 0.0 }, color).unwrap();
        for (method, sampling) in [(PaletteMethod::Tones, 0.5), (PaletteMethod::Hull, 1.0)] {
            let settings = ExtractionSettings { method, ..Default::default() };
            let progress = settings.progress();
            let histograms = sample(&field, &settings.sampling, &progress).unwrap();
            assert_eq!(progress.fraction(), sampling);
            let views = View::all(&field, &settings.view_rays(&field), &progress).unwrap();
            extract_from_samples(&histograms, &views, &settings, &progress).unwrap();
            assert_eq!(progress.fraction(), 1.0, "{method:?}");
        }
    }

    /// Recorded histograms count as samples that are taken.
    #[cfg(feature = "write")]
    #[test]
    fn progress_counts_recorded_samples() {
        let settings = BakeSettings { depth: 3, basis: Basis::Rgba, ..Default::default() };
        let field = bake(&settings, |_| 50.0, |_| |_| DVec3::splat(0.5)).unwrap();
        let field = field.recording_histograms(&Progress::default()).unwrap();
        let progress = Progress::default();
        sample(&field, &SamplingSettings::default(), &progress).unwrap();
        assert_eq!(progress.fraction(), 1.0);
    }

    /// Pixels get labels from an opacity of 80/255 on, so what is never half opaque has tones, too.
    #[test]
    fn glass_has_a_tone() {
        let (red, blue) = (DVec3::new(0.8, 0.1, 0.1), DVec3::new(0.1, 0.2, 0.9));
        // Two balls, one of which absorbs at most 43% of the light.
        let density = |at: DVec3| match [-0.5, 0.5].map(|x| at.distance(DVec3::new(x, 0.0, 0.0)) < 0.4) {
            [true, _] => 1e3,
            [_, true] => 0.7,
            _ => 0.0,
        };
        let settings = BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, ..Default::default() };
        let field = bake(&settings, density, |at| move |_| if at.x < 0.0 { red } else { blue }).unwrap();
        let palette = extract(&field, &ExtractionSettings::default(), &Progress::default()).unwrap().palette;
        for color in [red, blue] {
            let off = |tone: &[f64; 3]| DVec3::from(*tone).distance(color);
            assert!(palette.colors.iter().any(|tone| off(tone) < 0.05), "{color} in {palette:?}");
        }
    }

    #[test]
    fn one_color_is_a_palette() {
        for method in PaletteMethod::ALL {
            let settings = ExtractionSettings { method, ..Default::default() };
            let extraction = extract_from_histograms(&histograms(&[(RED, 2.0)]), &settings).unwrap();
            assert_eq!(extraction.palette.weights, [1.0]);
            assert_eq!(extraction.palette.colors.len(), 1);
            assert_eq!(extraction.palette.method, Some(method));
        }
    }

    /// The number of colors is the smallest that keeps the error within the tolerance.
    #[test]
    fn as_many_colors_as_the_tolerance_needs() {
        let corners = [RED, GREEN, BLUE, BLACK, [15.0 / 16.0; 3]];
        let histograms = histograms(&corners.map(|color| (color, 1.0)));
        let mut before = usize::MAX;
        for tolerance in [0.001, 0.1, 0.2, 1.0] {
            let settings = |colors| ExtractionSettings { colors, ..Default::default() };
            let auto = extract_from_histograms(&histograms, &settings(ColorCount::Auto { tolerance })).unwrap();
            let count = auto.palette.colors.len();
            assert!(auto.report.errors.rmse <= tolerance && count <= before, "{tolerance}: {auto:?}");
            if count > 1 {
                let fewer = extract_from_histograms(&histograms, &settings(ColorCount::Fixed(count - 1))).unwrap();
                assert!(fewer.report.errors.rmse > tolerance, "{tolerance}: {count} colors");
            }
            before = count;
        }
        assert_eq!(before, 1);
    }

    /// If weight is spread so evenly that no bin is above the threshold, the heaviest bins make the palette.
    #[test]
    fn evenly_spread_weight_has_a_palette() {
        let even: Vec<([f64; 3], f64)> =
            (0..512).map(|i| ([i / 64, i / 8 % 8, i % 8].map(|x| (f64::from(x) + 0.5) / 8.0), 1.0)).collect();
        let extraction = extract_from_histograms(&histograms(&even), &hull()).unwrap();
        assert_eq!(extraction.report.clusters, Some(125));
        let all = ExtractionSettings { coarse_threshold: 0.0, ..hull() };
        let extraction = extract_from_histograms(&histograms(&even), &all).unwrap();
        assert_eq!(extraction.report.clusters, Some(ExtractionSettings::MAX_CLUSTERS));
    }

    #[test]
    fn nothing_visible_is_an_error() {
        for method in PaletteMethod::ALL {
            let settings = ExtractionSettings { method, ..Default::default() };
            let result = extract_from_histograms(&histograms(&[]), &settings);
            assert_eq!(result, Err(ExtractionError::NothingVisible));
        }
    }

    /// Histograms with as many bins as settings allow, all of them filled, and the weight on a shell: k-means has the
    /// most points and centers, and every center is a corner of the hull.
    fn largest_histograms() -> Histograms {
        let weight = |color: [f64; 3]| {
            let radius = DVec3::from(color).distance(DVec3::splat(0.5));
            1e-9 + (-((radius - 0.4) / 0.03).powi(2)).exp()
        };
        let weights = |n: usize| {
            let channel = |i: usize| (i as f64 + 0.5) / n as f64;
            (0..n * n * n).map(|i| weight([i / (n * n), i / n % n, i % n].map(channel))).collect()
        };
        Histograms::new(64, weights(64), 16, weights(16), 0).unwrap()
    }

    /// The largest settings take seconds for k-means alone, and for the hull alone, so that each is canceled midway.
    #[test]
    fn every_stage_can_be_canceled() {
        let histograms = largest_histograms();
        let k_means = ExtractionSettings { coarse_threshold: 0.0, max_iterations: 1000, tolerance: 0.0, ..hull() };
        let hull = ExtractionSettings { max_iterations: 1, ..k_means.clone() };
        let fit = ExtractionSettings { colors: ColorCount::Auto { tolerance: 1e-9 }, ..Default::default() };
        let tones = ExtractionSettings { method: PaletteMethod::Tones, ..fit.clone() };
        for (stage, settings) in [("k-means", k_means), ("hull", hull), ("fit", fit), ("tones", tones)] {
            for after in [0, 100] {
                let progress = Progress::default();
                let result = std::thread::scope(|scope| {
                    let worker = scope.spawn(|| extract_from_samples(&histograms, &[], &settings, &progress));
                    std::thread::sleep(Duration::from_millis(after));
                    progress.cancel();
                    worker.join().unwrap()
                });
                assert_eq!(result, Err(ExtractionError::Canceled(Canceled)), "{stage} after {after} ms");
            }
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_palette() {
        let settings = BakeSettings { depth: 5, basis: Basis::Sh4, ..Default::default() };
        let density = |at: DVec3| 20.0 * (0.9 - at.length()).max(0.0);
        let radiance = |at: DVec3| move |direction: DVec3| 0.5 + 0.35 * (5.0 * at).map(f64::sin) + 0.1 * direction;
        let field = bake(&settings, density, radiance).unwrap();
        let on = |threads: usize, method: PaletteMethod| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let settings = ExtractionSettings { method, ..Default::default() };
            let mut extraction = pool.install(|| extract(&field, &settings, &Progress::default())).unwrap();
            extraction.report.seconds = ExtractionTimes::default();
            extraction
        };
        for method in PaletteMethod::ALL {
            let alone = on(1, method);
            assert!(
                alone.report.clusters.is_none_or(|clusters| clusters > 20) && alone.palette.colors.len() >= 6,
                "{alone:?}"
            );
            assert_eq!(alone, on(3, method));
        }
    }

    proptest! {
        /// Any histogram with weight has a valid palette: colors in the cube, and weights that sum to 1 in descending
        /// order.
        #[test]
        fn any_weight_has_a_palette(
            colors in prop::collection::vec((prop::array::uniform3(0.0..1.0f64), 1e-6..10.0f64), 1..100),
            wanted in 1usize..=12,
            method in prop::sample::select(&PaletteMethod::ALL[..]),
        ) {
            let settings = ExtractionSettings { method, colors: ColorCount::Fixed(wanted), ..Default::default() };
            let palette = extract_from_histograms(&histograms(&colors), &settings).unwrap().palette;
            prop_assert_eq!(palette.validate(), Ok(()));
            prop_assert!(palette.colors.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)));
            prop_assert!((palette.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(palette.weights.is_sorted_by(|a, b| a >= b));
        }
    }
}
