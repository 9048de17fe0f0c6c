use std::time::Duration;

use glam::UVec3;
use half::f16;
use proptest::prelude::*;

use super::*;
use crate::{
    bake::{BakeSettings, bake},
    field::{Activation, Basis, Cell, Frame, UpAxis},
    pack::{PackSettings, Packed},
    reference::sample_histograms,
    sampling::{ObserverRegion, SamplingPlan},
};

/// Returns a pseudorandom sequence of numbers in [0, 1).
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 33) as f64) / (1u64 << 31) as f64
    }
}

/// Returns a random field of at most `depth` levels, in which cells of every level may be leaves, empty or
/// subdivided.
fn field(seed: u64, depth: u32, scale: [f64; 3], up: UpAxis) -> PlenOctree {
    let mut next = numbers(seed);
    let mut nodes = vec![[Cell::EMPTY; 8]];
    let mut density = Vec::new();
    let mut queue = vec![(0, 1)];
    while let Some((node, level)) = queue.pop() {
        for part in 0..8 {
            let kind = next();
            nodes[node as usize][part] = if level < depth && kind < 0.6 {
                let child = nodes.len() as u32;
                nodes.push([Cell::EMPTY; 8]);
                queue.push((child, level + 1));
                Cell::node(child)
            } else if kind < if level == depth { 0.5 } else { 0.65 } {
                density.push((40.0f64 * next() * next() + 0.01) as f32);
                Cell::leaf(density.len() as u32 - 1)
            } else {
                Cell::EMPTY
            };
        }
    }
    let coefficients = (0..density.len() * 27).map(|_| f16::from_f64(4.0 * next() - 2.0)).collect();
    let frame = Frame { offset: DVec3::new(0.5, 0.4, 0.3), scale: scale.into() };
    PlenOctree::new(frame, Basis::Sh9, Activation::Sigmoid, up, nodes, density, coefficients).unwrap()
}

fn settings(observers: ObserverRegion) -> SamplingSettings {
    SamplingSettings { observers, ..Default::default() }
}

fn blocks(field: &PlenOctree) -> Option<Blocks> {
    Blocks::new(field, &Progress::default()).unwrap()
}

fn difference(a: &Histograms, b: &Histograms) -> f64 {
    let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>();
    (of(a.fine(), b.fine()) + of(a.coarse(), b.coarse())) / b.total_weight()
}

/// Fields with leaves of all sizes, sampled in every direction, agree with float64, also if their frame is not a
/// cube. The seeds are fixed because rounding may move a sample next to the border of a bin into another bin.
#[test]
fn histograms_match_float64() {
    for (seed, scale, observers, up) in [
        (1, [0.4, 0.4, 0.4], ObserverRegion::UpperHemisphere, UpAxis::Z),
        (2, [0.4, 0.9, 0.1], ObserverRegion::Sphere, UpAxis::Z),
        (3, [2.0, 0.3, 0.5], ObserverRegion::UpperHemisphere, UpAxis::Y),
    ] {
        let field = field(seed, 5, scale, up);
        let settings = settings(observers);
        let found = sample(&field, &settings, &Progress::default()).unwrap();
        let expected = sample_histograms(&field, &settings).unwrap();
        assert!(found.total_weight() > 0.0 && blocks(&field).is_some());
        assert!(difference(&found, &expected) < 1e-6, "{}", difference(&found, &expected));
        assert_eq!(found.samples(), expected.samples());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// Marching blocks and marching single rays give the same visibility for any tree. (A single bin, so that
    /// borders of bins do not matter.)
    #[test]
    fn blocks_and_single_rays_agree(
        seed: u64,
        depth in 1u32..6,
        scale in prop::array::uniform3(0.1..3.0f64),
        stop in prop_oneof![Just(0.0), Just(1e-2), 0.0..0.9f64],
        point in prop_oneof![Just(SamplePoint::Center), Just(SamplePoint::Entry)],
    ) {
        let field = field(seed, depth, scale, UpAxis::Z);
        let progress = Progress::default();
        let weight = |stop_transmittance: f64, blocks| {
            let settings = SamplingSettings {
                stop_transmittance,
                fine_bins: 1,
                coarse_bins: 1,
                ..settings(ObserverRegion::Sphere)
            };
            let leaves = chosen_leaves(&field, &settings, &progress).unwrap();
            Sampler::new(&field, &settings, point, blocks, &progress).unwrap().run(&leaves).unwrap().total_weight()
        };
        // Rounding may hide a leaf whose transmittance is that at which it is hidden.
        let [least, most] = [1.0 + 1e-5, 1.0 - 1e-5].map(|nudge| weight(stop * nudge, None));
        let found = weight(stop, blocks(&field));
        prop_assert!(found >= (1.0 - 1e-5) * least && found <= (1.0 + 1e-5) * most, "{least} {found} {most}");
    }
}

/// Leaves of all sizes are sampled in blocks, and much of the work of larger ones is shared, too.
#[test]
fn leaves_of_all_sizes_are_sampled_in_blocks() {
    let field = field(5, 6, [0.4; 3], UpAxis::Z);
    let (settings, progress) = (settings(ObserverRegion::Sphere), Progress::default());
    let leaves = chosen_leaves(&field, &settings, &progress).unwrap();
    let sampler = Sampler::new(&field, &settings, SamplePoint::Center, blocks(&field), &progress).unwrap();
    let units = sampler.units(&leaves).unwrap();
    let mut found = Vec::new();
    for unit in &units {
        let Unit::Block(unit) = unit else { panic!("a leaf alone") };
        found.extend(unit.leaves.iter().map(|leaf| leaf.leaf));
    }
    found.sort_unstable();
    assert!(found.iter().copied().eq(0..field.leaves() as u32));
    let larger = leaves.iter().filter(|cell| cell.size > 1).count();
    let shared = units.iter().filter(|unit| matches!(unit, Unit::Block(unit) if unit.start == Start::Corner));
    assert!(larger > 2 * shared.count(), "{larger}");
}

/// The coefficients of packed fields are not rounded to half precision first.
#[test]
#[cfg(feature = "write")]
fn histograms_of_packed_fields_match_float64() {
    for (seed, observers, up) in
        [(4, ObserverRegion::UpperHemisphere, UpAxis::Y), (5, ObserverRegion::Sphere, UpAxis::Z)]
    {
        let field = field(seed, 4, [0.4, 0.5, 0.6], up);
        let settings = settings(observers);
        let packed = Packed::new(&field, &PackSettings::default(), &Progress::default()).unwrap();
        let bins = SamplingSettings { fine_bins: 30, ..settings };
        let found = sample(packed.field(), &bins, &Progress::default()).unwrap();
        let expected = sample_histograms(packed.field(), &bins).unwrap();
        assert!(packed.field().codebook().is_some() && found.total_weight() > 0.0);
        assert!(difference(&found, &expected) < 1e-6, "{}", difference(&found, &expected));
    }
}

/// Returns a ball of depth 4 of this density, in a haze, in colors that depend on place and direction.
fn ball(density: f64, haze: f64) -> PlenOctree {
    let settings = BakeSettings { depth: 4, basis: Basis::Sh4, ..Default::default() };
    let tint = |at: DVec3| move |direction: DVec3| 0.5 + 0.3 * at + 0.1 * direction;
    let inside = |at: DVec3| if at.length() < 0.7 { density } else { haze };
    bake(&settings, inside, tint).unwrap()
}

/// A solid ball shows its colors however dense it is, as in float64.
#[test]
fn solid_fields_are_sampled_where_rays_enter_them() {
    let upper: &[_] = &[(1e3, 1e-2), (1e4, 1e-2), (1e6, 0.5), (1e6, 0.0), (1e30, 1e-2)];
    for (observers, haze, fields) in
        [(ObserverRegion::UpperHemisphere, 0.0, upper), (ObserverRegion::Sphere, 0.02, &[(1e3, 1e-2), (1e6, 0.0)])]
    {
        for &(density, stop) in fields {
            let field = ball(density, haze);
            let settings = SamplingSettings { stop_transmittance: stop, ..settings(observers) };
            let found = sample(&field, &settings, &Progress::default()).unwrap();
            let expected = sample_histograms(&field, &settings).unwrap();
            assert!(found.total_weight() > 0.0);
            assert!(difference(&found, &expected) < 1e-6, "{density}: {}", difference(&found, &expected));
            let single = {
                let progress = Progress::default();
                let leaves = chosen_leaves(&field, &settings, &progress).unwrap();
                Sampler::new(&field, &settings, SamplePoint::Entry, None, &progress).unwrap().run(&leaves).unwrap()
            };
            assert!(difference(&single, &expected) < 1e-6, "{density}: {}", difference(&single, &expected));
            // Beyond some density, nothing changes any more: rays see the surface.
            let denser = sample(&ball(10.0 * density, haze), &settings, &Progress::default()).unwrap();
            assert!(difference(&found, &denser) < 200.0 / density + 1e-6, "{density}");
        }
    }
}

/// Leaves that hide themselves do not matter as long as they are less than half of what observers see.
#[test]
fn other_fields_are_sampled_at_the_centers_of_leaves() {
    let settings = BakeSettings { depth: 5, basis: Basis::Rgba, ..Default::default() };
    let cut = |height: f64| {
        let inside = move |at: DVec3| if at.z > height { 1e6 } else { 60.0 };
        let field = bake(&settings, inside, |_| |_| DVec3::ONE).unwrap();
        let observers = self::settings(ObserverRegion::Sphere);
        SamplePoint::choose(&field, &observers, &Progress::default()).unwrap()
    };
    assert_eq!([cut(1.0), cut(0.4), cut(-0.4)], [SamplePoint::Center, SamplePoint::Center, SamplePoint::Entry]);
}

/// Of a large field, the leaves that are examined first may all be hidden, by leaves too few to be among them.
#[test]
fn few_large_leaves_that_hide_all_others_are_found() {
    // A solid cube. Its surface is 57 leaves, and there are 229,376 inside.
    let (mut nodes, mut leaves) = (vec![[Cell::EMPTY; 8]], 0u32);
    let mut queue = vec![(0usize, 0, 0usize)];
    while let Some((node, level, octant)) = queue.pop() {
        for part in 0..8 {
            // Opposite to where an octant is in the cube, its part is at the center.
            let is_surface = level == 1 && (part + octant != 7 || octant == 7);
            nodes[node][part] = if is_surface || level == 6 {
                leaves += 1;
                Cell::leaf(leaves - 1)
            } else {
                queue.push((nodes.len(), level + 1, part));
                nodes.push([Cell::EMPTY; 8]);
                Cell::node(nodes.len() as u32 - 1)
            };
        }
    }
    let frame = Frame { offset: DVec3::splat(0.5), scale: DVec3::splat(0.5) };
    let (densities, coefficients) = (vec![1e6; leaves as usize], vec![f16::ZERO; 3 * leaves as usize]);
    let field =
        PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Z, nodes, densities, coefficients).unwrap();
    let (settings, progress) = (settings(ObserverRegion::UpperHemisphere), Progress::default());
    let few = SamplingSettings { sample_fraction: Some(4096.0 / f64::from(leaves)), ..settings.clone() };
    assert!(chosen_leaves(&field, &few, &progress).unwrap().iter().all(|leaf| leaf.size == 1));
    assert_eq!(SamplePoint::choose(&field, &settings, &progress), Ok(SamplePoint::Entry));
}

/// A leaf that is alone in its field is only occluded by its own cell, so its weight is known.
#[test]
fn a_single_leaf_is_occluded_by_half_of_its_cell() {
    let mut nodes = vec![[Cell::EMPTY; 8]; 3];
    (nodes[0][3], nodes[1][5], nodes[2][6]) = (Cell::node(1), Cell::node(2), Cell::leaf(0));
    let frame = Frame { offset: DVec3::ZERO, scale: DVec3::splat(0.5) };
    let coefficients = vec![f16::from_f64(0.75), f16::from_f64(0.25), f16::from_f64(0.5)];
    let field =
        PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Z, nodes, vec![3.0], coefficients).unwrap();
    let histograms = sample(&field, &settings(ObserverRegion::UpperHemisphere), &Progress::default()).unwrap();
    // The cell is 1/8 of the cube, or 1/4 of a world unit, wide.
    let rays: Vec<DVec3> =
        observers(UpAxis::Z, &settings(ObserverRegion::UpperHemisphere)).into_iter().flatten().collect();
    let weight = |ray: &DVec3| 3.0 * (-3.0 * 0.125 / ray.abs().max_element()).exp();
    let expected = rays.iter().map(weight).sum::<f64>() / 4.0;
    let found = histograms.fine()[(24 * 32 + 8) * 32 + 16];
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    assert!((histograms.total_weight() / found - 1.0).abs() < 1e-12);
}

/// The reference decides by the same rays whether a field is solid.
#[test]
fn leaves_that_nearly_hide_their_centers_are_sampled_where_float64_samples_them() {
    let settings = settings(ObserverRegion::UpperHemisphere);
    for (density, point) in [(6.9, SamplePoint::Center), (7.4, SamplePoint::Entry), (7.8, SamplePoint::Entry)] {
        let mut node = [Cell::EMPTY; 8];
        node[0] = Cell::leaf(0);
        let frame = Frame { offset: DVec3::ZERO, scale: DVec3::splat(0.5) };
        let (basis, activation, color) = (Basis::Rgba, Activation::Identity, vec![f16::from_f64(0.75); 3]);
        let field = PlenOctree::new(frame, basis, activation, UpAxis::Z, vec![node], vec![density], color).unwrap();
        assert_eq!(SamplePoint::choose(&field, &settings, &Progress::default()), Ok(point), "{density}");
        let found = sample(&field, &settings, &Progress::default()).unwrap();
        let difference = difference(&found, &sample_histograms(&field, &settings).unwrap());
        assert!(difference < 1e-6, "{density}: {difference}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let field = field(7, 5, [0.4; 3], UpAxis::Z);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sample(&field, &settings(ObserverRegion::UpperHemisphere), &Progress::default())).unwrap()
    };
    assert_eq!(on(1), on(2));
    assert_eq!(on(1), on(5));
}

/// A tree of the maximum depth is too deep for a lattice, but is sampled correctly.
#[test]
fn deep_trees_are_sampled() {
    let depth = crate::field::MAX_DEPTH as usize;
    let mut nodes = vec![[Cell::EMPTY; 8]; depth];
    for (level, node) in nodes.iter_mut().enumerate().take(depth - 1) {
        (node[0], node[7]) = (Cell::leaf(level as u32), Cell::node(level as u32 + 1));
    }
    nodes[depth - 1][3] = Cell::leaf(depth as u32 - 1);
    let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
    let coefficients = vec![f16::ZERO; 3 * depth];
    let densities = vec![1.0; depth];
    let field =
        PlenOctree::new(frame, Basis::Sh1, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients).unwrap();
    assert!(blocks(&field).is_none());
    let settings = settings(ObserverRegion::Sphere);
    let found = sample(&field, &settings, &Progress::default()).unwrap();
    let expected = sample_histograms(&field, &settings).unwrap();
    assert!(difference(&found, &expected) < 1e-9);
}

#[test]
fn empty_fields_have_no_weight() {
    let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
    let nodes = vec![[Cell::EMPTY; 8]];
    let field = PlenOctree::new(frame, Basis::Sh1, Activation::Sigmoid, UpAxis::Z, nodes, vec![], vec![]).unwrap();
    assert_eq!(field.cell_bounds(), None::<(UVec3, UVec3)>);
    let histograms = sample(&field, &SamplingSettings::default(), &Progress::default()).unwrap();
    assert_eq!((histograms.total_weight(), histograms.samples()), (0.0, 0));
}

#[test]
fn progress_ends_at_one() {
    let field = field(1, 4, [0.4; 3], UpAxis::Z);
    let progress = Progress::default();
    assert_eq!(progress.fraction(), 0.0);
    sample(&field, &SamplingSettings::default(), &progress).unwrap();
    assert_eq!(progress.fraction(), 1.0);
}

/// Every step looks at whether it is canceled, so no step before it has to.
#[test]
fn every_step_can_be_canceled() {
    let field = field(1, 4, [0.4; 3], UpAxis::Z);
    let (settings, progress, canceled) = (SamplingSettings::default(), Progress::default(), Progress::default());
    let leaves = chosen_leaves(&field, &settings, &progress).unwrap();
    canceled.cancel();
    let sampler = || Sampler::new(&field, &settings, SamplePoint::Center, blocks(&field), &progress).unwrap();
    assert!(Blocks::new(&field, &canceled).is_err());
    assert!(Sampler::new(&field, &settings, SamplePoint::Center, None, &canceled).is_err());
    assert!(chosen_leaves(&field, &settings, &canceled).is_err());
    assert!(weight_bound(&field, &settings, SamplePoint::Center, &canceled).is_err());
    assert!(SamplingPlan::new(&field, &settings, &canceled).is_err());
    let canceled_sampler = Sampler { progress: &canceled, ..sampler() };
    assert!(canceled_sampler.units(&leaves).is_err());
    let units = sampler().units(&leaves).unwrap();
    let mut worker = Worker { tally: Tally::new(1, 1, 1.0), depths: Vec::new(), coefficients: Vec::new() };
    assert!(units.iter().all(|unit| canceled_sampler.sample(&mut worker, unit).is_err()));
    assert_eq!(sample(&field, &settings, &canceled), Err(SamplingError::Canceled(Canceled)));
}

/// Sampling many leaves with as many rays as settings allow would take minutes. If it is canceled, most of them
/// are not sampled.
#[test]
fn most_of_a_large_field_is_not_sampled_once_canceled() {
    let settings = BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, ..Default::default() };
    let field = bake(&settings, |_| 1.0, |at| move |_: DVec3| 0.5 + 0.4 * at).unwrap();
    let settings = SamplingSettings { multisamples: 16, stop_transmittance: 0.0, ..Default::default() };
    // While planning, after a few milliseconds, and while sampling, once the first leaves are done.
    for after in [Some(0), Some(10), Some(50), Some(200), None] {
        let progress = Progress::default();
        let result = std::thread::scope(|scope| {
            let worker = scope.spawn(|| sample(&field, &settings, &progress));
            match after {
                Some(milliseconds) => std::thread::sleep(Duration::from_millis(milliseconds)),
                None => {
                    while progress.fraction() == 0.0 {
                        std::thread::sleep(Duration::from_millis(1));
                    }
                }
            }
            progress.cancel();
            worker.join().unwrap()
        });
        assert_eq!(result, Err(SamplingError::Canceled(Canceled)), "after {after:?} ms");
        assert!(progress.fraction() < 0.5, "after {after:?} ms: {}", progress.fraction());
    }
}
