//! Tests sampling in a running app, on the GPU and on the CPU, against the float64 reference.

use std::time::Duration;

use bevy::prelude::*;
use bevy_plenoctree::{
    Activation, ColorCount, ExtractionSamples, ExtractionSettings, ObserverRegion, PaletteExtraction, PaletteMethod,
    PaletteSampler, Palettes, PlenOctree, Posterize, Prop, SampleOrigin, SamplingSettings, UpAxis,
};
use glam::DVec3;
use half::f16;
use plenoctree::{
    BakeSettings, Basis, Cell, Frame, PackSettings, Packed, bake,
    palette::extract_from_samples,
    reference::sample_histograms,
    sampling::{Histograms, Lattice, Progress, SamplePoint, SamplingPlan, View, sample},
};

use super::stage::{Stage, wait_for};

/// Bakes two lumps that occlude each other, in faint fog. Colors depend on position and direction, and the sides of the
/// box differ in length, so that cells are not cubes.
fn lumps(depth: u32, basis: Basis) -> PlenOctree {
    let settings = BakeSettings {
        depth,
        min: DVec3::new(-1.0, -1.0, -1.0),
        max: DVec3::new(1.4, 1.0, 1.1),
        basis,
        ..Default::default()
    };
    let lump = |at: DVec3, center: DVec3| 40.0 * (0.5 - at.distance(center)).max(0.0);
    bake(
        &settings,
        |at| {
            let fog = if at.length() < 0.9 { 0.03 } else { 0.0 };
            fog + lump(at, DVec3::new(-0.3, 0.0, 0.1)) + lump(at, DVec3::new(0.5, 0.2, -0.2))
        },
        |at| move |direction: DVec3| 0.5 + 0.3 * (5.0 * at).map(f64::sin) + 0.2 * direction,
    )
    .unwrap()
}

/// An app that extracts palettes.
struct Extractor(Stage);

impl Extractor {
    fn new() -> Self {
        let mut app = Self(Stage::new(1));
        app.0.close();
        app.extraction().budget = None;
        app
    }

    fn extraction(&mut self) -> Mut<'_, PaletteExtraction> {
        self.0.world().resource_mut()
    }

    /// Extracts a palette. Returns the samples, the palette's colors, and the number of frames it took.
    fn extract(
        &mut self,
        field: &PlenOctree,
        settings: &ExtractionSettings,
        sampler: PaletteSampler,
    ) -> (ExtractionSamples, Vec<[f64; 3]>, u32) {
        self.0.clear();
        let mut extraction = self.extraction();
        extraction.settings = settings.clone();
        extraction.sampler = sampler;
        self.0.spawn_prop(field, Posterize::default());
        let field = self.0.field();
        let (mut frames, mut progress) = (0, 0.0);
        wait_for("a palette", || {
            self.0.update(1);
            frames += 1;
            let extraction = self.0.resource::<PaletteExtraction>();
            assert!(extraction.error(&field).is_none(), "{:?}", extraction.error(&field));
            if extraction.sampled(&field).is_some() {
                return true;
            }
            let now = extraction.progress(&field).unwrap_or(0.0);
            assert!((progress..=1.0).contains(&now), "progress went from {progress} to {now}");
            progress = now;
            false
        });
        let sampled = self.0.resource::<PaletteExtraction>().sampled(&field).unwrap().clone();
        (sampled, self.0.resource::<Palettes>().get(&field).unwrap().palette().colors.clone(), frames)
    }
}

/// Returns the sum of absolute differences divided by the total, for the histogram where it is larger.
fn difference(found: &Histograms, expected: &Histograms) -> f64 {
    let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / b.iter().sum::<f64>();
    of(found.fine(), expected.fine()).max(of(found.coarse(), expected.coarse()))
}

#[test]
fn gpu_sampling_matches_the_reference() {
    let mut app = Extractor::new();
    let settings = |sampling| ExtractionSettings { sampling, ..default() };
    for (basis, settings) in [
        (Basis::Sh9, ExtractionSettings::default()),
        (Basis::Sh1, ExtractionSettings { method: PaletteMethod::Hull, ..default() }),
        (Basis::Rgba, settings(SamplingSettings { directions: 1, multisamples: 3, ..default() })),
        (Basis::Rgba, ExtractionSettings { method: PaletteMethod::Hull, ..default() }),
        (
            Basis::Sh4,
            settings(SamplingSettings {
                observers: ObserverRegion::Sphere,
                fine_bins: 20,
                coarse_bins: 5,
                ..default()
            }),
        ),
    ] {
        // Rays cross more leaves of the first one.
        let mut field = lumps(if basis == Basis::Sh9 { 5 } else { 4 }, basis);
        if basis == Basis::Sh4 || (basis, settings.method) == (Basis::Rgba, PaletteMethod::Hull) {
            // With a codebook. Colors that are the same in all directions are not on the border of two bins.
            field = Packed::new(&field, &PackSettings::default(), &Progress::default()).unwrap().field().clone();
        }
        let expected = sample_histograms(&field, &settings.sampling).unwrap();
        if matches!(basis, Basis::Sh9 | Basis::Sh4) {
            let (sampled, ..) = app.extract(&field, &settings, PaletteSampler::Cpu);
            assert_eq!(sampled.origin, SampleOrigin::Cpu);
            // A sample may be rounded to the next bin.
            let off = difference(&sampled.histograms, &expected);
            assert!(off < 1e-5, "{basis:?}: {off}");
        }
        let (sampled, colors, _) = app.extract(&field, &settings, PaletteSampler::Gpu);
        assert_eq!(sampled.origin, SampleOrigin::Gpu);
        assert_eq!(sampled.histograms.samples(), expected.samples());
        let off = difference(&sampled.histograms, &expected);
        assert!(off < 1e-4, "{basis:?}: {off}");
        let views = View::all(&field, &settings.view_rays(&field), &Progress::default()).unwrap();
        let reference = extract_from_samples(&expected, &views, &settings, &Progress::default()).unwrap();
        assert_eq!(colors.len(), reference.palette.colors.len());
        for (color, expected) in colors.iter().zip(&reference.palette.colors) {
            assert!(DVec3::from(*color).distance(DVec3::from(*expected)) < 0.005, "{colors:?}");
        }
    }
}

/// The leaves of a solid field hide their own centers. It has a palette all the same, on both processors, even if its
/// optical depths are larger than the largest float.
#[test]
fn solid_fields_have_palettes() {
    let mut app = Extractor::new();
    for (observers, size, density) in [
        (ObserverRegion::UpperHemisphere, 1.0, 1e4),
        (ObserverRegion::Sphere, 1.0, 1e7),
        (ObserverRegion::Sphere, 1.0, 1e30),
        (ObserverRegion::Sphere, 32.0, 3e38),
        (ObserverRegion::Sphere, 2f64.powi(50), 1e26),
    ] {
        let settings = BakeSettings {
            depth: 4,
            min: DVec3::splat(-size),
            max: DVec3::splat(size),
            basis: Basis::Sh4,
            ..Default::default()
        };
        let ball = |at: DVec3| if at.length() < 0.8 * size { density } else { 0.0 };
        let field = bake(&settings, ball, |at| move |direction| 0.5 + 0.3 * at / size + 0.1 * direction).unwrap();
        let mut settings = ExtractionSettings::default();
        (settings.sampling.observers, settings.sampling.directions) = (observers, 1);
        let expected = sample_histograms(&field, &settings.sampling).unwrap();
        assert!(expected.total_weight() > 0.0);
        for sampler in [PaletteSampler::Gpu, PaletteSampler::Cpu] {
            let (sampled, colors, _) = app.extract(&field, &settings, sampler);
            assert_eq!(sampled.origin == SampleOrigin::Gpu, sampler == PaletteSampler::Gpu);
            let off = difference(&sampled.histograms, &expected);
            assert!(off < 1e-4, "{sampler:?}, {density:e}: {off}");
            assert!(colors.len() > 6, "{} colors", colors.len());
        }
    }
}

/// The weights of leaves in a tiny box are huge, and their sum still fits. Those in a huge box are tiny.
#[test]
fn boxes_of_any_size_are_sampled() {
    let mut app = Extractor::new();
    for size in [1e-15, 1e12] {
        let settings = BakeSettings {
            depth: 3,
            min: DVec3::splat(-size),
            max: DVec3::splat(size),
            basis: Basis::Sh1,
            min_density: 0.0,
            ..Default::default()
        };
        let field = bake(&settings, |_| 2.0 / size, |at| move |_| 0.5 + 0.4 * at / size).unwrap();
        let sampling = SamplingSettings { directions: 1, ..default() };
        let settings = ExtractionSettings { sampling, method: PaletteMethod::Hull, ..default() };
        let expected = sample_histograms(&field, &settings.sampling).unwrap();
        for sampler in [PaletteSampler::Gpu, PaletteSampler::Cpu] {
            let (sampled, ..) = app.extract(&field, &settings, sampler);
            assert_eq!(sampled.origin == SampleOrigin::Gpu, sampler == PaletteSampler::Gpu);
            let off = difference(&sampled.histograms, &expected);
            assert!(off < 1e-4, "{sampler:?}, {size}: {off}");
        }
    }
}

/// A field with too many cells for a lattice is sampled through its octree, also where rays enter leaves.
#[test]
fn fields_with_too_many_cells_are_sampled() {
    const DEPTH: u32 = 9;
    let mut app = Extractor::new();
    for density in [1.0, 1e6] {
        // A branch toward either corner, each with a leaf at every level.
        let mut nodes = vec![[Cell::EMPTY; 8]];
        let mut leaves = 0;
        for corner in [0, 7] {
            let mut parent = 0;
            for level in 1..=DEPTH {
                let mut leaf = || {
                    leaves += 1;
                    Cell::leaf(leaves - 1)
                };
                if level == DEPTH {
                    nodes[parent][corner] = leaf();
                } else {
                    nodes[parent][3] = if nodes[parent][3] == Cell::EMPTY { leaf() } else { nodes[parent][3] };
                    nodes[parent][corner] = Cell::node(nodes.len() as u32);
                    parent = nodes.len();
                    nodes.push([Cell::EMPTY; 8]);
                }
            }
        }
        let densities = (0..leaves).map(|leaf| density / (1 + leaf) as f32).collect();
        let coefficients = (0..3 * leaves).map(|k| f16::from_f32((k * 7 % 11) as f32 / 11.0)).collect();
        let frame = Frame::spanning(DVec3::splat(-1.0), DVec3::splat(1.0));
        let field =
            PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Z, nodes, densities, coefficients)
                .unwrap();
        let progress = Progress::default();
        assert_eq!(Lattice::new(&field, DEPTH, &progress), Ok(None));
        let settings = ExtractionSettings {
            sampling: SamplingSettings { observers: ObserverRegion::Sphere, ..default() },
            method: PaletteMethod::Hull,
            ..default()
        };
        let point = SamplingPlan::new(&field, &settings.sampling, &progress).unwrap().point;
        assert_eq!(point == SamplePoint::Entry, density > 1e3);
        let expected = sample_histograms(&field, &settings.sampling).unwrap();
        let (sampled, ..) = app.extract(&field, &settings, PaletteSampler::Gpu);
        assert_eq!(sampled.origin, SampleOrigin::Gpu);
        let off = difference(&sampled.histograms, &expected);
        assert!(off < 1e-4, "{density}: {off}");
    }
}

/// A leaf with a trillionth of another leaf's weight is counted, and just as accurately.
#[test]
fn weights_a_trillion_apart_are_both_counted() {
    let mut app = Extractor::new();
    let frame = Frame::spanning(DVec3::splat(-1e-5), DVec3::splat(1e-5));
    let mut cells = [Cell::EMPTY; 8];
    (cells[0], cells[7]) = (Cell::leaf(0), Cell::leaf(1));
    let coefficients = [0.9, 0.1, 0.1, 0.1, 0.1, 0.9].map(f16::from_f32).to_vec();
    let densities = vec![6e4, 4e-8];
    let field =
        PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Z, vec![cells], densities, coefficients)
            .unwrap();
    let settings = ExtractionSettings::default();
    let expected = sample_histograms(&field, &settings.sampling).unwrap();
    let filled = expected.fine().iter().filter(|weight| **weight > 0.0);
    assert!(filled.clone().fold(0.0f64, |a, b| a.max(*b)) > 1e12 * filled.clone().fold(f64::MAX, |a, b| a.min(*b)));
    for sampler in [PaletteSampler::Gpu, PaletteSampler::Cpu] {
        let (sampled, ..) = app.extract(&field, &settings, sampler);
        for (found, expected) in sampled.histograms.fine().iter().zip(expected.fine()) {
            assert!((found - expected).abs() <= 1e-5 * expected, "{sampler:?}: {found}, expected {expected}");
        }
    }
}

/// Sums of integers do not depend on the order in which slices and threads add to them.
#[test]
fn slices_of_any_size_give_the_same_bits() {
    let mut app = Extractor::new();
    let field = lumps(4, Basis::Sh1);
    let settings = ExtractionSettings::default();
    let (at_once, colors, _) = app.extract(&field, &settings, PaletteSampler::Gpu);
    app.extraction().budget = Some(Duration::from_micros(1));
    let (sliced, sliced_colors, frames) = app.extract(&field, &settings, PaletteSampler::Gpu);
    assert!(frames > 3, "{frames} frames");
    assert_eq!(at_once.histograms, sliced.histograms);
    assert_eq!(colors, sliced_colors);
}

/// A fraction of the leaves represents all of them: the total weight and the colors stay about the same. The GPU and
/// the CPU sample the same leaves.
#[test]
fn a_fraction_of_the_leaves_represents_all() {
    let mut app = Extractor::new();
    let field = lumps(5, Basis::Sh4);
    let whole = sample(&field, &SamplingSettings::default(), &Progress::default()).unwrap();
    for fraction in [0.5, 0.2] {
        let settings = ExtractionSettings {
            sampling: SamplingSettings { sample_fraction: Some(fraction), ..default() },
            ..Default::default()
        };
        let some = sample(&field, &settings.sampling, &Progress::default()).unwrap();
        let weight = some.total_weight() / whole.total_weight();
        assert!((weight - 1.0).abs() < 0.1, "{fraction}: {weight} of the weight");
        // Of a coarse histogram, little is in other bins, and the mean color is the same.
        let elsewhere: f64 = some.coarse().iter().zip(whole.coarse()).map(|(a, b)| (a - b).abs()).sum();
        let elsewhere = 0.5 * elsewhere / whole.total_weight();
        let mean = |histograms: &Histograms| {
            let sum = (0..512).map(|bin| {
                let [r, g, b] = [bin / 64, bin / 8 % 8, bin % 8].map(|x| (x as f64 + 0.5) / 8.0);
                histograms.coarse()[bin] * DVec3::new(r, g, b)
            });
            sum.sum::<DVec3>() / histograms.total_weight()
        };
        let shift = mean(&some).distance(mean(&whole));
        assert!(elsewhere < 0.1 && shift < 0.02, "{fraction}: {elsewhere} of the weight elsewhere, shifted by {shift}");
        assert!(difference(&some, &whole) > 1e-3, "{fraction} changed nothing");
        let (on_gpu, ..) = app.extract(&field, &settings, PaletteSampler::Gpu);
        assert!(difference(&on_gpu.histograms, &some) < 1e-4, "the GPU sampled different leaves");
    }
}

/// One app runs several jobs in sequence, and then one of them again.
#[test]
fn fields_are_sampled_in_sequence_on_the_gpu() {
    let mut app = Extractor::new();
    app.extraction().sampler = PaletteSampler::Gpu;
    let fields = [Basis::Sh1, Basis::Sh4].map(|basis| {
        let prop = app.0.spawn_prop(&lumps(4, basis), Posterize::default());
        app.0.get::<Prop>(prop).0.clone()
    });
    app.0.wait();
    let mut extraction = app.extraction();
    assert!(
        fields.iter().all(|field| extraction.sampled(field).is_some_and(|sampled| sampled.origin == SampleOrigin::Gpu))
    );
    extraction.settings.colors = ColorCount::Fixed(2);
    extraction.request(&fields[0]);
    wait_for("two colors", || {
        app.0.update(1);
        app.0.resource::<Palettes>().get(&fields[0]).unwrap().palette().colors.len() == 2
    });
}
