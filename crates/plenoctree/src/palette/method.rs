//! How a palette is found, and how many colors it has.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

/// How a palette is found from the samples of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq, Hash),
    type_path = "plenoctree"
)]
pub enum PaletteMethod {
    /// The corners of the simplified convex hull of all colors, as in the paper: section 3 of the method, steps 6 to 9.
    /// Misses colors inside the hull, and is sensitive to small changes of the field.
    Hull,
    /// The colors whose labels are nearest to the colors of the field: section 3 of the method, step 10.
    Fitted,
    /// The colors that are seen of the field, as many as it needs, up to [`ColorCount::MOST_TONES`]. Each is a label by
    /// itself, without blends: section 3 of the method, step 11. Keeps small but distinct parts. Its colors form ramps,
    /// by material. The default.
    #[default]
    Tones,
}

impl PaletteMethod {
    /// All methods.
    pub const ALL: [Self; 3] = [Self::Hull, Self::Fitted, Self::Tones];

    /// Returns the method's name in palette files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hull => "hull",
            Self::Fitted => "fitted",
            Self::Tones => "tones",
        }
    }
}

/// The number of colors of an extracted palette.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub enum ColorCount {
    /// The usual number of the method: at most 6 colors, or for [`PaletteMethod::Tones`], as many as the field needs,
    /// up to [`ColorCount::MOST_TONES`]. The default.
    #[default]
    Usual,
    /// At most this many colors, 1 to 64. A palette has fewer if the field has fewer, and that of
    /// [`PaletteMethod::Hull`] has more if the hull cannot be simplified further: a cloud of colors that has a volume
    /// always keeps at least four.
    Fixed(usize),
    /// As few colors as keep the error to the nearest label ([`ColorErrors::rmse`](super::ColorErrors::rmse)) within
    /// `tolerance`, but at most [`ColorCount::MOST`].
    ///
    /// Those of [`PaletteMethod::Tones`], at most [`ColorCount::MOST_TONES`], also keep both errors of what is seen,
    /// [`rmse`](super::ColorErrors::rmse) and [`hue`](super::ColorErrors::hue), within `tolerance`, where rare colors
    /// count more than their share. So small parts keep their hue in a field that is dark otherwise.
    Auto {
        /// The largest error, as a distance of a channel in encoded sRGB. More than 0 and at most 1.
        tolerance: f64,
    },
}

impl ColorCount {
    /// The largest number of colors that [`ColorCount::Auto`] chooses.
    pub const MOST: usize = 16;

    /// The largest number of tones that a palette of [`PaletteMethod::Tones`] has, unless more are asked for.
    pub const MOST_TONES: usize = 40;

    /// [`ColorCount::Auto`] with the default tolerance, 0.05.
    pub const AUTO: Self = Self::Auto { tolerance: 0.05 };
}
