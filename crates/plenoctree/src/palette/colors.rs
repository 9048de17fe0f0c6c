//! Palettes and their files.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    method::PaletteMethod,
    ramp::{self, InvalidRamps, Ramp},
};
use crate::{histograms::shares, save::replace_file};

/// A few colors that represent everything visible in a field, the heaviest first.
///
/// Palette files are JSON: `{"colors": [[r, g, b], ...], "weights": [...], "method": "fitted"}`. If a file has no
/// weights, all colors have the same weight. `method` is left out unless the palette was extracted, and `ramps`, such
/// as `[{"name": "red", "tones": [3, 0]}]`, and `shown`, such as `[[r, g, b], ...]`, if there are none. Channels of
/// `colors` in palette files are from 0 to 1. In other files, such as saved games, any [valid](Self::validate) palette
/// can be stored with serde.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PaletteJson")]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_asset::Asset, bevy_reflect::Reflect),
    reflect(Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct Palette {
    /// Colors in encoded sRGB. Extracted colors, and those in files, are in [0, 1]. Handmade colors may exceed this
    /// range, such as neon colors.
    pub colors: Vec<[f64; 3]>,
    /// Weight of each color: the amount of visible weight that is nearest to it. Finite and not negative, with a sum
    /// that is finite in float32. The weights of an extracted palette sum to 1.
    pub weights: Vec<f64>,
    /// How the palette was extracted, or `None` if it was not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<PaletteMethod>,
    /// Which colors are shades of one material, or none if that is not known. [`PaletteMethod::Tones`] finds them;
    /// [`guess_ramps`](Self::guess_ramps) guesses those of any palette.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ramps: Vec<Ramp>,
    /// Shown colors: what appears in place of each color, or nothing if the colors themselves appear. In encoded sRGB,
    /// without limits, unless they [look like bytes](Self::write) in a file.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "bevy", reflect(default))]
    pub shown: Vec<[f64; 3]>,
}

/// The content of a palette file. What is null counts as left out.
#[derive(Deserialize)]
struct PaletteJson {
    colors: Vec<[f64; 3]>,
    weights: Option<Vec<f64>>,
    method: Option<PaletteMethod>,
    ramps: Option<Vec<Ramp>>,
    shown: Option<Vec<[f64; 3]>>,
}

/// An error that occurs when colors and weights do not make a palette.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPalette {
    /// There are too few or too many colors or weights, or one of them is out of range.
    #[error("found {found}, expected {expected}")]
    Value {
        /// What was found, and where it is.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The ramps do not fit the colors.
    #[error(transparent)]
    Ramps(#[from] InvalidRamps),
}

impl InvalidPalette {
    pub(super) fn new(found: String, expected: impl Into<String>) -> Self {
        Self::Value { found, expected: expected.into() }
    }

    /// Returns an error unless all colors are finite in float32, in which they are shown. `what` names them in it.
    pub(super) fn check_colors(what: &str, colors: &[[f64; 3]]) -> Result<(), Self> {
        match colors.iter().position(|color| !color.iter().all(|channel| (*channel as f32).is_finite())) {
            Some(index) => {
                let found = format!("{:?} as {what} {index}", colors[index]);
                Err(Self::new(found, "finite numbers within the range of float32"))
            }
            None => Ok(()),
        }
    }

    /// Returns an error unless there is a finite, non-negative weight for each color.
    pub(super) fn check_weights(weights: &[f64], colors: usize) -> Result<(), Self> {
        if weights.len() != colors {
            return Err(Self::new(format!("{} weights", weights.len()), format!("one for each of {colors} colors")));
        }
        match weights.iter().position(|weight| !weight.is_finite() || *weight < 0.0) {
            Some(index) => {
                Err(Self::new(format!("{} as weight {index}", weights[index]), "a finite, non-negative number"))
            }
            None => Ok(()),
        }
    }
}

/// More than games show in encoded sRGB: it is 776 times as bright as white.
const BRIGHTEST: f64 = 16.0;

fn is_byte(channel: f64) -> bool {
    (0.0..=255.0).contains(&channel) && channel.fract() == 0.0
}

/// Returns a question for those who write bytes.
fn meant(color: &[f64; 3]) -> &'static str {
    let looks_like_bytes = color.iter().all(|channel| (0.0..=255.0).contains(channel));
    if looks_like_bytes { " (did you mean 0 to 255? Divide by 255)" } else { "" }
}

/// An error that occurs when reading or writing a palette file.
#[derive(Debug, thiserror::Error)]
pub enum PaletteFileError {
    /// The file could not be opened, read or written.
    #[error("palette {}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file is not JSON, has no `colors`, or has a value of the wrong type.
    #[error("palette {}: not a palette file: {source}", path.display())]
    Json {
        /// Path of the file.
        path: PathBuf,
        /// The error of the parser.
        source: serde_json::Error,
    },
    /// The colors and weights do not make a palette.
    #[error("palette {}: {source}", path.display())]
    Invalid {
        /// Path of the file.
        path: PathBuf,
        /// What was found, and what was expected.
        source: InvalidPalette,
    },
}

impl Palette {
    /// Maximum number of colors in a palette.
    pub const MAX_COLORS: usize = 64;

    /// Creates a palette of colors (encoded sRGB) that all have the same weight.
    ///
    /// # Errors
    ///
    /// Returns an error if there are no colors, more than [`Self::MAX_COLORS`], or one that is not finite in float32.
    pub fn new(colors: Vec<[f64; 3]>) -> Result<Self, InvalidPalette> {
        let weights = equal_weights(colors.len());
        let palette = Self::weighted(colors, weights);
        palette.validate()?;
        Ok(palette)
    }

    /// Creates a palette of colors and weights, with nothing else.
    pub(super) fn weighted(colors: Vec<[f64; 3]>, weights: Vec<f64>) -> Self {
        Self { colors, weights, method: None, ramps: Vec::new(), shown: Vec::new() }
    }

    /// Returns the colors that appear: the [shown](Self::shown) ones or, if there are none, the palette's own.
    pub fn shown_colors(&self) -> &[[f64; 3]] {
        if self.shown.is_empty() { &self.colors } else { &self.shown }
    }

    /// Checks what must hold for the palette in a file, too.
    fn validate_for_file(&self) -> Result<(), InvalidPalette> {
        self.validate()?;
        let is_outside = |color: &[f64; 3]| color.iter().any(|channel| !(0.0..=1.0).contains(channel));
        if let Some(index) = self.colors.iter().position(is_outside) {
            let found = self.colors[index];
            let expected = format!("channels from 0 to 1{}", meant(&found));
            return Err(InvalidPalette::new(format!("{found:?} as color {index}"), expected));
        }
        let too_bright = self.shown.iter().position(|color| color.iter().any(|channel| *channel > BRIGHTEST));
        match too_bright.filter(|_| self.shown.iter().flatten().all(|channel| is_byte(*channel))) {
            Some(index) => {
                let found = self.shown[index];
                let expected = format!("1 for white{}", meant(&found));
                Err(InvalidPalette::new(format!("{found:?} as shown color {index}"), expected))
            }
            None => Ok(()),
        }
    }

    /// Checks that the palette is valid. It may not be, because its fields are public.
    ///
    /// # Errors
    ///
    /// Returns an error if there are no colors or more than [`Self::MAX_COLORS`], if there is not one weight per color,
    /// if a color is not finite in float32, if a weight is negative or not finite, if the sum of the weights is not
    /// finite in float32, if there are shown colors but not one per color, or if the ramps do not fit the colors.
    pub fn validate(&self) -> Result<(), InvalidPalette> {
        let count = self.colors.len();
        if !(1..=Self::MAX_COLORS).contains(&count) {
            return Err(InvalidPalette::new(format!("{count} colors"), format!("1 to {}", Self::MAX_COLORS)));
        }
        InvalidPalette::check_weights(&self.weights, count)?;
        InvalidPalette::check_colors("color", &self.colors)?;
        // Means of ramps and shares of colors multiply weights.
        let sum: f64 = self.weights.iter().sum();
        if !(sum as f32).is_finite() {
            let found = format!("weights that sum to {sum:e}");
            return Err(InvalidPalette::new(found, "a sum within the range of float32"));
        }
        if ![0, count].contains(&self.shown.len()) {
            let expected = format!("one for each of {count} colors, or none");
            return Err(InvalidPalette::new(format!("{} shown colors", self.shown.len()), expected));
        }
        InvalidPalette::check_colors("shown color", &self.shown)?;
        Ok(self.validate_ramps()?)
    }

    /// Returns the share of a color in the weight of all, from 0 to 1. Without any weight, all shares are the same.
    pub fn share(&self, index: usize) -> f64 {
        if self.weights.iter().all(|weight| *weight == 0.0) {
            return (self.colors.len() as f64).recip();
        }
        shares(&self.weights).nth(index).unwrap_or(0.0)
    }

    /// Checks that the ramps fit the colors, whatever else of the palette is valid.
    ///
    /// # Errors
    ///
    /// Returns an error if a ramp has no tones, a tone that the palette lacks or that is in a ramp already, a name that
    /// ramps cannot have, or that of another ramp.
    pub fn validate_ramps(&self) -> Result<(), InvalidRamps> {
        ramp::validate(&self.ramps, self.colors.len())
    }

    /// Reads a palette file.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or does not hold a valid palette.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, PaletteFileError> {
        let path = path.as_ref();
        let json = std::fs::read(path);
        Self::from_json(&json.map_err(|source| PaletteFileError::Io { path: path.to_path_buf(), source })?, path)
    }

    /// Parses the content of a palette file. `path` is the name of the file in errors.
    ///
    /// # Errors
    ///
    /// Returns an error if the content is not a valid palette.
    pub fn from_json(json: &[u8], path: &Path) -> Result<Self, PaletteFileError> {
        let path = || path.to_path_buf();
        // Some editors write a byte order mark.
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        let file: PaletteJson =
            serde_json::from_slice(json).map_err(|source| PaletteFileError::Json { path: path(), source })?;
        Self::try_from(file)
            .and_then(|palette| palette.validate_for_file().map(|()| palette))
            .map_err(|source| PaletteFileError::Invalid { path: path(), source })
    }

    /// Writes a palette file, or replaces an existing one.
    ///
    /// The file is first written under another name in the same folder, so that it is never seen half-written.
    ///
    /// # Errors
    ///
    /// Returns an error if the palette is invalid, if a channel of its own colors is not from 0 to 1, if its shown colors
    /// look like bytes because all channels are integers from 0 to 255 and one is above 16, or if writing fails. An
    /// existing file is then unchanged.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), PaletteFileError> {
        let path = path.as_ref();
        let name = || path.to_path_buf();
        self.validate_for_file().map_err(|source| PaletteFileError::Invalid { path: name(), source })?;
        let text =
            serde_json::to_string(self).map_err(|source| PaletteFileError::Json { path: name(), source })? + "\n";
        replace_file(path, |file| file.write_all(text.as_bytes()))
            .map_err(|source| PaletteFileError::Io { path: name(), source })
    }
}

impl TryFrom<PaletteJson> for Palette {
    type Error = InvalidPalette;

    fn try_from(PaletteJson { colors, weights, method, ramps, shown }: PaletteJson) -> Result<Self, InvalidPalette> {
        let weights = weights.unwrap_or_else(|| equal_weights(colors.len()));
        let (ramps, shown) = (ramps.unwrap_or_default(), shown.unwrap_or_default());
        let palette = Self { colors, weights, method, ramps, shown };
        palette.validate()?;
        Ok(palette)
    }
}

fn equal_weights(colors: usize) -> Vec<f64> {
    vec![1.0 / colors as f64; colors]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn parse(text: &str) -> Result<Palette, String> {
        Palette::from_json(text.as_bytes(), Path::new("x.json")).map_err(|error| error.to_string())
    }

    #[test]
    fn shares_add_up() {
        for (weights, expected) in
            [([3.0, 1.0], [0.75, 0.25]), ([1.5e308, 1.5e308], [0.5, 0.5]), ([0.0, 0.0], [0.5, 0.5])]
        {
            let mut palette = Palette::new(vec![[0.1; 3], [0.9; 3]]).unwrap();
            palette.weights = weights.into();
            assert_eq!([0, 1].map(|index| palette.share(index)), expected);
        }
    }

    proptest! {
        /// A written palette is read back with its colors in the same order.
        #[test]
        fn files_keep_palettes(colors in prop::collection::vec(prop::array::uniform3(0.0..=1.0f64), 1..=64)) {
            let mut palette = Palette::new(colors).unwrap();
            palette.weights.iter_mut().enumerate().for_each(|(i, w)| *w = (i as f64).sqrt());
            let read = parse(&serde_json::to_string(&palette).unwrap()).unwrap();
            let numbers = |palette: &Palette| [palette.colors.as_flattened(), &palette.weights].concat();
            let (read, written) = (numbers(&read), numbers(&palette));
            prop_assert_eq!(read.len(), written.len());
            prop_assert!(read.iter().zip(&written).all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs()));
        }
    }

    #[test]
    fn files_may_have_a_byte_order_mark() {
        let json = b"\xef\xbb\xbf{\"colors\": [[0.0, 0.5, 1.0]]}";
        assert_eq!(Palette::from_json(json, Path::new("x.json")).unwrap().colors, [[0.0, 0.5, 1.0]]);
    }

    /// What palette files cannot hold, because it looks like a mistake of who wrote them.
    #[test]
    fn saved_games_keep_all_valid_palettes() {
        let neon = Palette::new(vec![[2.0, -0.5, 0.5], [0.0; 3]]).unwrap();
        let bright = Palette { shown: vec![[20.0, 0.0, 0.0], [0.0; 3]], ..Palette::new(vec![[0.5; 3]; 2]).unwrap() };
        for palette in [neon, bright] {
            let saved = serde_json::to_string(&palette).unwrap();
            assert_eq!(serde_json::from_str::<Palette>(&saved).unwrap(), palette);
            parse(&saved).unwrap_err();
        }
    }

    #[test]
    fn files_have_colors_weights_and_the_method() {
        let colors = vec![[0.0, 0.5, 1.0], [0.75, 0.25, 0.0]];
        let mut palette = Palette::weighted(colors, vec![0.75, 0.25]);
        let handmade = r#"{"colors":[[0.0,0.5,1.0],[0.75,0.25,0.0]],"weights":[0.75,0.25]}"#;
        assert_eq!(serde_json::to_string(&palette).unwrap(), handmade);
        palette.method = Some(PaletteMethod::Fitted);
        let extracted = handmade.replace('}', r#","method":"fitted"}"#);
        assert_eq!(serde_json::to_string(&palette).unwrap(), extracted);
        assert_eq!(parse(&extracted).unwrap(), palette);
    }

    #[test]
    fn files_may_have_ramps() {
        let text =
            r#"{"colors":[[0.0,0.5,1.0],[1.0,0.0,0.0]],"weights":[0.75,0.25],"ramps":[{"name":"sea","tones":[0]}]}"#;
        let palette = parse(text).unwrap();
        assert_eq!(palette.ramps, [Ramp { name: "sea".into(), tones: vec![0] }]);
        assert_eq!(serde_json::to_string(&palette).unwrap(), text);
    }

    #[test]
    fn files_may_have_shown_colors() {
        let text =
            r#"{"colors":[[0.0,0.5,1.0],[1.0,0.0,0.0]],"weights":[0.75,0.25],"shown":[[2.0,-0.5,1.0],[0.1,0.2,0.3]]}"#;
        let palette = parse(text).unwrap();
        assert_eq!(palette.shown_colors(), [[2.0, -0.5, 1.0], [0.1, 0.2, 0.3]]);
        assert_eq!(serde_json::to_string(&palette).unwrap(), text);
        assert_eq!(Palette { shown: vec![], ..palette }.shown_colors(), [[0.0, 0.5, 1.0], [1.0, 0.0, 0.0]]);
    }

    #[test]
    fn weights_are_optional() {
        assert_eq!(parse(r#"{"colors": [[0, 0, 0], [1, 1, 1]]}"#).unwrap().weights, [0.5, 0.5]);
    }

    #[test]
    fn null_counts_as_left_out() {
        let colors = r#""colors": [[0, 0, 0], [1, 1, 1]]"#;
        let null = r#""weights": null, "method": null, "ramps": null, "shown": null"#;
        assert_eq!(parse(&format!("{{{colors}, {null}}}")).unwrap(), parse(&format!("{{{colors}}}")).unwrap());
    }

    #[test]
    fn errors_say_what_was_found_and_expected() {
        let colors = format!(r#"{{"colors": {:?}}}"#, [[0.5; 3]; 65]);
        for (text, message) in [
            (r#"{"colors": []}"#, "found 0 colors, expected 1 to 64"),
            (&colors, "found 65 colors, expected 1 to 64"),
            (r#"{"colors": [[0, 0, 0]], "weights": []}"#, "found 0 weights, expected one for each of 1 colors"),
            (
                r#"{"colors": [[0, 0, 0]], "weights": [-1]}"#,
                "found -1 as weight 0, expected a finite, non-negative number",
            ),
            (
                r#"{"colors": [[0, 0, 0], [1, 1, 1]], "weights": [1e308, 1e308]}"#,
                "found weights that sum to inf, expected a sum within the range of float32",
            ),
            (r#"{"colors": [[0, 0, 0]], "weights": [1e39]}"#, "found weights that sum to 1e39, expected a sum within"),
            (
                r#"{"colors": [[0, 0, 0], [255, 128, 0]]}"#,
                "found [255.0, 128.0, 0.0] as color 1, expected channels from 0 to 1 (did you mean 0 to 255? Divide by \
                 255)",
            ),
            (r#"{"colors": [[0, 0, 1.01]]}"#, "did you mean 0 to 255?"),
            (r#"{"colors": [[-0.5, 0, 2]]}"#, "found [-0.5, 0.0, 2.0] as color 0, expected channels from 0 to 1"),
            (r#"{"colors": [[0, 0]]}"#, "invalid length 2, expected an array of length 3"),
            (r#"{"colors": [[0, 0, 1e999]]}"#, "number out of range"),
            (r#"{"colors": [[0, 0, null]]}"#, "invalid type: null, expected f64"),
            (r#"{"weights": [1]}"#, "missing field `colors`"),
            (
                r#"{"colors": [[0, 0, 0]], "shown": [[0, 0, 0], [1, 1, 1]]}"#,
                "found 2 shown colors, expected one for each of 1 colors, or none",
            ),
            (r#"{"colors": [[0, 0, 0]], "shown": [[0, 0, 1e39]]}"#, "as shown color 0, expected finite numbers"),
            (
                r#"{"colors": [[0, 0, 0], [1, 1, 1]], "shown": [[1, 0, 0], [255, 64, 0]]}"#,
                "found [255.0, 64.0, 0.0] as shown color 1, expected 1 for white (did you mean 0 to 255? Divide by 255)",
            ),
            (
                r#"{"colors": [[0, 0, 0]], "method": "guess"}"#,
                "unknown variant `guess`, expected one of `hull`, `fitted`, `tones`",
            ),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
        for (ramps, message) in [
            (r#"[{"name": "a", "tones": [2]}]"#, "found tone 2, expected one of 2 palette colors"),
            (r#"[{"name": "a", "tones": [1]}, {"name": "b", "tones": [0, 1]}]"#, "found tone 1 twice"),
            (r#"[{"name": "a", "tones": []}]"#, "found a ramp \"a\" without tones"),
            (r#"[{"name": "7", "tones": [0]}]"#, "found the name \"7\""),
            (
                r#"[{"name": "a,b", "tones": [0]}]"#,
                "found the name \"a,b\", expected one that is not a number, without",
            ),
            (r#"[{"name": "a ", "tones": [0]}]"#, "without `=`, `:`, `,`, control characters and spaces at its ends"),
            (r#"[{"name": "a", "tones": [1]}, {"name": "a", "tones": [0]}]"#, "found two ramps with the name \"a\""),
            (r#"[{"tones": [1]}]"#, "missing field `name`"),
        ] {
            let error = parse(&format!(r#"{{"colors": [[0, 0, 0], [1, 1, 1]], "ramps": {ramps}}}"#)).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
        let error = Palette::new(vec![[0.0; 3], [0.0, f64::NAN, 0.0]]).unwrap_err();
        let expected = "expected finite numbers within the range of float32";
        assert_eq!(error.to_string(), format!("found [0.0, NaN, 0.0] as color 1, {expected}"));
        for beyond in [f64::NEG_INFINITY, 1e39, -1e300] {
            assert!(Palette::new(vec![[beyond, 0.0, 0.0]]).unwrap_err().to_string().contains(expected));
        }
        assert!(Palette::new(vec![[f32::MAX.into(), 0.0, 0.0]]).is_ok());
        assert!(parse(r#"{"colors": [[0, 0, 1e39]]}"#).unwrap_err().contains(expected));
    }

    /// A palette that cannot be written leaves the old file unchanged, and no other file.
    #[test]
    fn a_failed_write_loses_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.palette.json");
        let palette = Palette::new(vec![[0.5; 3]; 2]).unwrap();
        palette.write(&path).unwrap();
        let invalid = Palette { weights: vec![], ..palette.clone() };
        let neon = Palette::new(vec![[2.0, 0.5, 0.5]]).unwrap();
        for palette in [&invalid, &neon] {
            assert!(matches!(palette.write(&path), Err(PaletteFileError::Invalid { .. })));
        }
        assert_eq!(Palette::read(&path).unwrap(), palette);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    }

    #[test]
    fn files_are_named_in_errors() {
        let error = Palette::read("no/such/palette.json").unwrap_err();
        assert!(error.to_string().contains("no/such/palette.json"), "{error}");
    }
}
