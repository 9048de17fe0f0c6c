//! The section of the histogram of the field before it was packed.

use super::super::error::ReadFault;
#[cfg(feature = "write")]
use super::entropy::Encoder;
use super::{container::fault, entropy::Decoder, sections::HISTOGRAM};
use crate::sampling::{ObserverRegion, Recorded, SamplingSettings};

/// Bytes before the weights.
const PREFIX: usize = 28;
const CONTEXTS: usize = 16;

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

pub fn read(bytes: &[u8]) -> Result<Recorded, ReadFault> {
    let (prefix, stream) = bytes
        .split_first_chunk::<PREFIX>()
        .ok_or_else(|| fault(HISTOGRAM, format!("{} bytes", bytes.len()), format!("at least {PREFIX}")))?;
    let number = |at: usize| f64::from_le_bytes(std::array::from_fn(|index| prefix[at + index]));
    let observers = match prefix[0] {
        0 => ObserverRegion::UpperHemisphere,
        1 => ObserverRegion::Sphere,
        other => return Err(fault(HISTOGRAM, format!("observers {other}"), "0 or 1")),
    };
    let [directions, multisamples, fine_bins] = [1, 2, 3].map(|at| usize::from(prefix[at]));
    let settings = SamplingSettings {
        observers,
        directions,
        multisamples,
        fine_bins,
        stop_transmittance: number(4),
        coarse_bins: 1,
        sample_fraction: 1.0,
    };
    settings
        .validate()
        .map_err(|error| fault(HISTOGRAM, format!("{} {}", error.setting, error.found), error.expected))?;
    let (unit, samples) = (number(12), u64::from_le_bytes(std::array::from_fn(|index| prefix[20 + index])));
    let damaged = || fault(HISTOGRAM, "damaged content", "the weights of all bins");
    let mut decoder = Decoder::new(stream, CONTEXTS).ok_or_else(damaged)?;
    let mut weights = Vec::with_capacity(fine_bins.pow(3));
    for _ in 0..fine_bins.pow(3) {
        let code = decoder.number(context(&weights, fine_bins)).and_then(|code| u16::try_from(code).ok());
        weights.push(code.filter(|code| *code < Recorded::CODES).ok_or_else(damaged)?);
    }
    if !decoder.has_ended() {
        return Err(damaged());
    }
    let recorded = Recorded { settings, samples, weights, unit };
    let total: f64 = recorded.weights.iter().map(|code| recorded.weight(*code)).sum();
    if !(unit.is_normal() && total.is_normal() && total > 0.0) {
        return Err(fault(HISTOGRAM, format!("a weight of {total}"), "a positive number"));
    }
    Ok(recorded)
}

#[cfg(feature = "write")]
pub fn write(recorded: &Recorded) -> Vec<u8> {
    let Recorded { settings, samples, weights, unit } = recorded;
    let observers = u8::from(settings.observers == ObserverRegion::Sphere);
    let mut bytes = vec![observers, settings.directions as u8, settings.multisamples as u8, settings.fine_bins as u8];
    bytes.extend(settings.stop_transmittance.to_le_bytes());
    bytes.extend(unit.to_le_bytes());
    bytes.extend(samples.to_le_bytes());
    let mut encoder = Encoder::new(CONTEXTS);
    for (bin, weight) in weights.iter().enumerate() {
        encoder.number(context(&weights[..bin], settings.fine_bins), u32::from(*weight));
    }
    bytes.extend(encoder.finish());
    bytes
}
