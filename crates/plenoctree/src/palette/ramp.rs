//! Ramps: the palette colors of one material, from shadow to highlight.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::oklab::oklab;

/// The palette colors of one material, ordered from shadow to highlight. Section 3 of the method, step 12.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect), reflect(Clone, Debug, PartialEq), type_path = "plenoctree")]
pub struct Ramp {
    /// A name that no other ramp of the palette has, such as `red` or `cap`. Not empty, not a number, and without `=`,
    /// `:`, `,`, control characters and spaces at its ends, so that it can be told from an index and from other names
    /// on the command line.
    pub name: String,
    /// Indices of palette colors, the darkest first. At least one, and none that another ramp of the palette has.
    pub tones: Vec<usize>,
}

/// An error that occurs when ramps do not fit a palette.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRamps {
    /// The palette has no such ramp.
    #[error("found ramp {found}, expected one of {expected} ramps, counted from 0")]
    Ramp {
        /// Index found.
        found: usize,
        /// Number of ramps.
        expected: usize,
    },
    /// The palette has no such color.
    #[error("found tone {found}, expected one of {expected} palette colors, counted from 0")]
    Tone {
        /// Index found.
        found: usize,
        /// Number of palette colors.
        expected: usize,
    },
    /// A color belongs to two ramps, or to one of them twice.
    #[error("found tone {tone} twice, expected every palette color in at most one ramp")]
    Twice {
        /// Index of the color.
        tone: usize,
    },
    /// A ramp has no tones.
    #[error("found a ramp \"{name}\" without tones, expected at least one")]
    Empty {
        /// The ramp's name.
        name: String,
    },
    /// A name is empty, a number, or has characters that it must not have.
    #[error("found the name \"{}\", expected one that is not a number, without `=`, `:`, `,`, control characters and \
        spaces at its ends", found.escape_debug())]
    Name {
        /// The name found.
        found: String,
    },
    /// Two ramps have the same name.
    #[error("found two ramps with the name \"{name}\", expected different names")]
    SameName {
        /// The name.
        name: String,
    },
}

/// Checks that ramps fit a palette of `colors` colors.
pub(super) fn validate(ramps: &[Ramp], colors: usize) -> Result<(), InvalidRamps> {
    let mut seen = vec![false; colors];
    for (index, Ramp { name, tones }) in ramps.iter().enumerate() {
        if !is_name(name) {
            return Err(InvalidRamps::Name { found: name.clone() });
        }
        if ramps[..index].iter().any(|other| other.name == *name) {
            return Err(InvalidRamps::SameName { name: name.clone() });
        }
        if tones.is_empty() {
            return Err(InvalidRamps::Empty { name: name.clone() });
        }
        for &tone in tones {
            let seen = seen.get_mut(tone).ok_or(InvalidRamps::Tone { found: tone, expected: colors })?;
            if std::mem::replace(seen, true) {
                return Err(InvalidRamps::Twice { tone });
            }
        }
    }
    Ok(())
}

/// Sorts palette colors from shadow to highlight. Those that the palette does not have come last.
pub(super) fn sort(tones: &mut [usize], colors: &[[f64; 3]]) {
    let lightness = |tone: usize| colors.get(tone).map_or(f64::INFINITY, |color| oklab(DVec3::from(*color)).x);
    tones.sort_by(|&a, &b| lightness(a).total_cmp(&lightness(b)).then(a.cmp(&b)));
}

/// Returns whether a ramp can have this name.
pub(super) fn is_name(name: &str) -> bool {
    let reserved = |c: char| matches!(c, '=' | ':' | ',') || c.is_control();
    let is_number = name.bytes().all(|byte| byte.is_ascii_digit());
    !name.is_empty() && !is_number && !name.contains(reserved) && name == name.trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_can_be_told_from_numbers() {
        assert!(["cap", "red 2", "2nd", "Kappe"].into_iter().all(is_name));
        assert!(!["", " ", "3", "a=b", "ramp:1", "a\nb"].into_iter().any(is_name));
    }

    /// The command line separates names by commas, which spaces may surround.
    #[test]
    fn names_can_be_told_from_each_other() {
        assert!(!["a,b", ",", " cap", "cap ", "cap\u{3000}"].into_iter().any(is_name));
    }
}
