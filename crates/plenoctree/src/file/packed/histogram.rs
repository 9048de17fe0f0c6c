//! The section `BINS`: the histogram of the field before it was packed.

use super::super::error::ReadFault;
use super::{container::fault, sections::BINS};
use crate::sampling::{ObserverRegion, Recorded, SamplingSettings};

/// Bytes that say how the field was sampled.
const SETTINGS: usize = 12;
/// Bytes before the presence of the bins.
const PREFIX: usize = SETTINGS + 8;

/// The most bytes of the section, with 64 bins per channel.
pub const MOST_BYTES: u64 = PREFIX as u64 + (64 * 64 * 64) / 8 + 8 * (64 * 64 * 64);

/// Reads the section `BINS`.
pub fn read(bytes: &[u8]) -> Result<Recorded, ReadFault> {
    let short = || fault(BINS, format!("{} bytes", bytes.len()), format!("at least {PREFIX}"));
    let (prefix, rest) = bytes.split_first_chunk::<PREFIX>().ok_or_else(short)?;
    let settings = settings(prefix)?;
    let bins = settings.fine_bins.pow(3);
    let damaged = || fault(BINS, "damaged content", "the weights of all bins");
    let (present, numbers) = rest.split_at_checked(bins.div_ceil(8)).ok_or_else(damaged)?;
    let (numbers, []) = numbers.as_chunks::<8>() else { return Err(damaged()) };
    let holds = |bin: usize| present[bin / 8] >> (bin % 8) & 1 == 1;
    let mut numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let weights = (0..bins).map(|bin| if holds(bin) { numbers.next() } else { Some(0.0) }).collect::<Option<Vec<_>>>();
    let weights = weights.filter(|_| numbers.next().is_none()).ok_or_else(damaged)?;
    let samples = u64::from_le_bytes(std::array::from_fn(|index| prefix[SETTINGS + index]));
    let total: f64 = weights.iter().sum();
    if !(total.is_normal() && weights.iter().all(|weight| *weight >= 0.0)) {
        return Err(fault(BINS, format!("a weight of {total}"), "positive numbers"));
    }
    Ok(Recorded { settings, samples, weights })
}

/// Reads how the field was sampled, in the first [`SETTINGS`] bytes.
fn settings(prefix: &[u8]) -> Result<SamplingSettings, ReadFault> {
    let observers = match prefix[0] {
        0 => ObserverRegion::UpperHemisphere,
        1 => ObserverRegion::Sphere,
        other => return Err(fault(BINS, format!("observers {other}"), "0 or 1")),
    };
    let [directions, multisamples, fine_bins] = [1, 2, 3].map(|at| usize::from(prefix[at]));
    let settings = SamplingSettings {
        observers,
        directions,
        multisamples,
        fine_bins,
        stop_transmittance: f64::from_le_bytes(std::array::from_fn(|index| prefix[4 + index])),
        coarse_bins: 1,
        sample_fraction: None,
    };
    settings.validate().map_err(|error| fault(BINS, format!("{} {}", error.setting, error.found), error.expected))?;
    Ok(settings)
}

/// Writes the section `BINS`.
#[cfg(feature = "write")]
pub fn write(recorded: &Recorded) -> Vec<u8> {
    let Recorded { settings, samples, weights } = recorded;
    let observers = u8::from(settings.observers == ObserverRegion::Sphere);
    let mut bytes = vec![observers, settings.directions as u8, settings.multisamples as u8, settings.fine_bins as u8];
    bytes.extend(settings.stop_transmittance.to_le_bytes());
    bytes.extend(samples.to_le_bytes());
    let bits =
        |weights: &[f64]| (0..).zip(weights).fold(0, |bits, (bin, weight)| bits | u8::from(*weight > 0.0) << bin);
    bytes.extend(weights.chunks(8).map(bits));
    bytes.extend(weights.iter().filter(|weight| **weight > 0.0).flat_map(|weight| weight.to_le_bytes()));
    bytes
}
