//! The sections of the histogram of the field before it was packed: exact, or rounded in earlier files.

use super::super::error::ReadFault;
use super::{
    container::fault,
    entropy::Decoder,
    sections::{BINS, HISTOGRAM},
};
use crate::sampling::{ObserverRegion, Recorded, SamplingSettings};

/// Bytes that say how the field was sampled.
const SETTINGS: usize = 12;
/// Bytes before the presence of the bins.
const PREFIX: usize = SETTINGS + 8;
/// Bytes before the rounded weights.
const ROUNDED_PREFIX: usize = SETTINGS + 16;
/// The number of codes of rounded weights.
const CODES: u16 = 512;
const CONTEXTS: usize = 16;

/// Reads the section `BINS`.
pub fn read(bytes: &[u8]) -> Result<Recorded, ReadFault> {
    let (prefix, rest) = split::<PREFIX>(BINS, bytes)?;
    let settings = settings(BINS, prefix)?;
    let bins = settings.fine_bins.pow(3);
    let damaged = || fault(BINS, "damaged content", "the weights of all bins");
    let (present, numbers) = rest.split_at_checked(bins.div_ceil(8)).ok_or_else(damaged)?;
    let (numbers, []) = numbers.as_chunks::<8>() else { return Err(damaged()) };
    let holds = |bin: usize| present[bin / 8] >> (bin % 8) & 1 == 1;
    let mut numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let weights = (0..bins).map(|bin| if holds(bin) { numbers.next() } else { Some(0.0) }).collect::<Option<Vec<_>>>();
    let weights = weights.filter(|_| numbers.next().is_none()).ok_or_else(damaged)?;
    let samples = u64::from_le_bytes(std::array::from_fn(|index| prefix[SETTINGS + index]));
    checked(BINS, Recorded { settings, samples, weights })
}

/// Reads the section `HIST`, in which weights have five significant bits.
pub fn read_rounded(bytes: &[u8]) -> Result<Recorded, ReadFault> {
    let (prefix, stream) = split::<ROUNDED_PREFIX>(HISTOGRAM, bytes)?;
    let settings = settings(HISTOGRAM, prefix)?;
    let [unit, samples] = [0, 8].map(|at| std::array::from_fn(|index| prefix[SETTINGS + at + index]));
    let (unit, samples) = (f64::from_le_bytes(unit), u64::from_le_bytes(samples));
    let damaged = || fault(HISTOGRAM, "damaged content", "the weights of all bins");
    let mut decoder = Decoder::new(stream, CONTEXTS).ok_or_else(damaged)?;
    let bins = settings.fine_bins.pow(3);
    let mut codes = Vec::with_capacity(bins);
    for _ in 0..bins {
        let code = decoder.number(context(&codes, settings.fine_bins)).and_then(|code| u16::try_from(code).ok());
        codes.push(code.filter(|code| *code < CODES).ok_or_else(damaged)?);
    }
    if !decoder.has_ended() {
        return Err(damaged());
    }
    let weights = codes.into_iter().map(|code| weight(code) * unit).collect();
    checked(HISTOGRAM, Recorded { settings, samples, weights })
}

fn split<'a, const N: usize>(section: &'static str, bytes: &'a [u8]) -> Result<(&'a [u8; N], &'a [u8]), ReadFault> {
    let short = || fault(section, format!("{} bytes", bytes.len()), format!("at least {N}"));
    bytes.split_first_chunk::<N>().ok_or_else(short)
}

/// Reads how the field was sampled, in the first [`SETTINGS`] bytes.
fn settings(section: &'static str, prefix: &[u8]) -> Result<SamplingSettings, ReadFault> {
    let observers = match prefix[0] {
        0 => ObserverRegion::UpperHemisphere,
        1 => ObserverRegion::Sphere,
        other => return Err(fault(section, format!("observers {other}"), "0 or 1")),
    };
    let [directions, multisamples, fine_bins] = [1, 2, 3].map(|at| usize::from(prefix[at]));
    let settings = SamplingSettings {
        observers,
        directions,
        multisamples,
        fine_bins,
        stop_transmittance: f64::from_le_bytes(std::array::from_fn(|index| prefix[4 + index])),
        coarse_bins: 1,
        sample_fraction: 1.0,
    };
    settings
        .validate()
        .map_err(|error| fault(section, format!("{} {}", error.setting, error.found), error.expected))?;
    Ok(settings)
}

fn checked(section: &'static str, recorded: Recorded) -> Result<Recorded, ReadFault> {
    let total: f64 = recorded.weights.iter().sum();
    if !(total.is_normal() && recorded.weights.iter().all(|weight| *weight >= 0.0)) {
        return Err(fault(section, format!("a weight of {total}"), "positive numbers"));
    }
    Ok(recorded)
}

/// Returns the context of the next code: how large those of the bins with less blue and with less green are.
fn context(before: &[u16], bins: usize) -> usize {
    let size = |back: usize| match before.len().checked_sub(back).map_or(0, |place| before[place]) {
        0 => 0,
        1..32 => 1,
        32..112 => 2,
        _ => 3,
    };
    4 * size(1) + size(bins)
}

/// Returns the weight of a code, in units: codes below 32 are units, and each further 16 have twice the step.
fn weight(code: u16) -> f64 {
    let shift = (code / 16).max(1) - 1;
    f64::from(code - 16 * shift) * f64::from(shift).exp2()
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
