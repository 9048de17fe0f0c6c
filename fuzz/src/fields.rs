//! Checks for the field reader: it must return a usable field or an error message, and use little memory for either.

use std::io::Cursor;

use allocation_counter::measure;
use glam::{DVec3, UVec3};
use half::f16;
use plenoctree::{
    Frame, LoadSettings, PlenOctree, ReadError,
    camera::PinholeCamera,
    palette::{ExtractionError, ExtractionSettings, extract},
    sampling::{Progress, SamplingSettings},
};

use crate::{message::check_message, settings::Settings};

/// The memory that reading may take for any file, in bytes: buffers, the state of the decompressor, and room for the
/// 4096 members that a directory may claim.
const BASE_MEMORY: u64 = 2 << 20;
/// The bytes of memory per byte of unpacked arrays. Rows of a codebook need the most: one byte stands for three float16
/// values.
const MEMORY_RATIO: u64 = 16;
/// How many times larger than the file its arrays can be.
const DEFLATE_RATIO: u64 = 1032;
/// The maximum number of leaves of fields from which palettes are extracted.
const MOST_EXTRACTED: usize = 512;
/// The maximum depth of those fields. Extraction divides coarse leaves into finest cells while that is worth its
/// memory.
const DEEPEST_EXTRACTED: u32 = 6;

/// Reads `bytes` and checks the result. `unpacked` is the size of the arrays in bytes, if known.
pub fn check_field(bytes: &[u8], unpacked: Option<u64>, settings: &Settings) {
    let mut result = None;
    let peak = measure(|| result = Some(read(bytes, &settings.load()))).bytes_max;
    let unpacked = unpacked.unwrap_or(DEFLATE_RATIO * bytes.len() as u64);
    assert!(peak <= BASE_MEMORY + MEMORY_RATIO * unpacked, "{peak} bytes of memory for {unpacked} of arrays");
    match result {
        Some(Ok(field)) => {
            check_written(&field);
            check_seen(&field);
            let coarser = field.coarser(1);
            assert_eq!(coarser.is_some(), field.depth() > 1);
            coarser.iter().for_each(check_seen);
            if settings.extract && field.leaves() <= MOST_EXTRACTED && field.depth() <= DEEPEST_EXTRACTED {
                check_extracted(&field);
            }
        }
        Some(Err(error)) => check_message(&error, 0),
        None => unreachable!(),
    }
}

fn read(bytes: &[u8], settings: &LoadSettings) -> Result<PlenOctree, ReadError> {
    PlenOctree::read_from(Cursor::new(bytes), "fuzz.npz", settings)
}

/// Checks that a field is the same after it is written and read again, except for the two documented roundings.
fn check_written(field: &PlenOctree) {
    let mut bytes = Cursor::new(Vec::new());
    field.write_to(&mut bytes).expect("what was read can be written");
    let settings = LoadSettings {
        activation: Some(field.activation()),
        up: Some(field.up()),
        density_threshold: 0.0,
        ..Default::default()
    };
    let again = read(bytes.get_ref(), &settings).expect("what was written can be read");
    let single = |v: DVec3| v.as_vec3().as_dvec3();
    let frame = field.frame();
    assert_eq!(again.frame(), Frame { offset: single(frame.offset), scale: single(frame.scale) });
    let parts = |field: &PlenOctree| (field.basis(), field.activation(), field.up(), field.depth());
    assert_eq!(parts(&again), parts(field));
    assert_eq!(again.nodes(), field.nodes());
    assert_eq!(again.coefficients(), field.coefficients());
    let half = |&density: &f32| f16::from_f32(density).clamp(f16::MIN_POSITIVE_SUBNORMAL, f16::MAX).to_f32();
    assert!(again.densities().iter().copied().eq(field.densities().iter().map(half)));
}

/// Checks that a field has finite bounds, and finite colors from all directions.
pub fn check_seen(field: &PlenOctree) {
    assert_eq!(field.leaf_cells().count(), field.leaves());
    let Some((low, high)) = field.bounds() else {
        assert_eq!(field.leaves(), 0);
        return;
    };
    assert!(low.as_vec3().is_finite() && high.as_vec3().is_finite(), "the box from {low} to {high}");
    let directions = [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::new(0.36, 0.48, -0.8)];
    let cells = f64::from(1u32 << field.depth());
    for leaf in field.leaf_cells().step_by(1 + field.leaves() / 16) {
        let (cell, corner, size) = field.locate(leaf.corner + UVec3::splat(leaf.size - 1));
        assert_eq!((cell.as_leaf(), corner, size), (Some(leaf.leaf), leaf.corner, leaf.size));
        let middle = field.frame().to_world((leaf.corner.as_dvec3() + 0.5 * f64::from(leaf.size)) / cells);
        for direction in directions {
            assert!(field.radiance(leaf.leaf, direction).is_finite());
            check_ray(field, middle, direction);
        }
    }
    for (azimuth, elevation) in [(0.0, 0.0), (2.1, 0.7)] {
        let camera = PinholeCamera::around(field, 3, 2, azimuth, elevation).expect("the field is not empty");
        for (x, y) in [(0.5, 0.5), (1.5, 1.0), (2.5, 1.5)] {
            let (origin, direction) = camera.ray(x, y);
            check_ray(field, origin, direction);
        }
    }
}

fn check_ray(field: &PlenOctree, origin: DVec3, direction: DVec3) {
    let (color, opacity) = field.render_ray(origin, direction);
    assert!(color.is_finite() && (0.0..=1.0).contains(&opacity), "{color}, {opacity} from {origin} along {direction}");
}

/// Checks that extraction gives a valid palette, or reports that nothing is visible.
fn check_extracted(field: &PlenOctree) {
    let sampling =
        SamplingSettings { directions: 1, multisamples: 1, fine_bins: 8, coarse_bins: 4, ..Default::default() };
    let settings = ExtractionSettings { sampling, ..Default::default() };
    match extract(field, &settings, &Progress::default()) {
        Ok(extraction) => {
            let palette = extraction.palette;
            palette.validate().expect("a palette that a file may hold");
            assert!(palette.colors.as_flattened().iter().all(|channel| (0.0..=1.0).contains(channel)));
            assert!((palette.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{:?}", palette.weights);
        }
        Err(ExtractionError::NothingVisible) => {}
        Err(error) => panic!("{error}"),
    }
}
