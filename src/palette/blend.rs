//! Blending colors and palettes.

use bevy::{color::Mix, prelude::*};
use plenoctree::srgb::{decode, encode};

/// The space in which two colors are blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum BlendSpace {
    /// Encoded sRGB, as in most image editors. Simple, but complementary colors blend to a dull gray.
    Encoded,
    /// Oklab, a perceptual space: lightness and hue change evenly. This is the default.
    #[default]
    Oklab,
}

impl BlendSpace {
    /// Blends two colors: returns `from` at `t` = 0 and `to` at `t` = 1, and in between, a color in encoded sRGB.
    ///
    /// `t` is clamped to 0..=1, and NaN counts as 0. Both ends are returned exactly as given.
    pub fn mix(self, from: Color, to: Color, t: f32) -> Color {
        if t >= 1.0 {
            return to;
        }
        if t > 0.0 {
            return match self {
                Self::Encoded => Srgba::from(from).mix(&to.into(), t).into(),
                Self::Oklab => encoded(oklab(from).mix(&oklab(to), t)),
            };
        }
        from
    }

    /// Blends two palettes color by color. The result has as many colors as the shorter one.
    pub(super) fn mix_all(self, from: &[Color], to: &[Color], t: f32) -> impl Iterator<Item = Color> {
        from.iter().zip(to).map(move |(from, to)| self.mix(*from, *to, t))
    }
}

/// Converts a color to Oklab. Unlike Bevy, decodes negative channels of encoded sRGB like positive ones, as ramps do
/// that move beyond what displays show.
fn oklab(color: Color) -> Oklaba {
    let [red, green, blue] = Srgba::from(color).to_f32_array_no_alpha().map(|channel| decode(channel.into()) as f32);
    LinearRgba::new(red, green, blue, color.alpha()).into()
}

/// Converts Oklab to encoded sRGB in the same way.
fn encoded(lab: Oklaba) -> Color {
    let linear = LinearRgba::from(lab);
    let [red, green, blue] = linear.to_f32_array_no_alpha().map(|channel| encode(channel.into()) as f32);
    Color::srgba(red, green, blue, linear.alpha)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn color() -> impl Strategy<Value = Color> {
        prop::array::uniform3(-0.3..=1.3f32).prop_map(|[r, g, b]| Color::srgb(r, g, b))
    }

    fn space() -> impl Strategy<Value = BlendSpace> {
        prop_oneof![Just(BlendSpace::Encoded), Just(BlendSpace::Oklab)]
    }

    fn distance(a: Color, b: Color) -> f32 {
        Srgba::from(a).to_vec3().distance(Srgba::from(b).to_vec3())
    }

    proptest! {
        #[test]
        fn ends_are_exact(space in space(), from in color(), to in color(), beyond in 0.0..1e9f32) {
            prop_assert_eq!(space.mix(from, to, -beyond), from);
            prop_assert_eq!(space.mix(from, to, 1.0 + beyond), to);
            prop_assert_eq!(space.mix(from, to, f32::NAN), from);
        }

        #[test]
        fn swapping_the_ends_changes_nothing(space in space(), from in color(), to in color(), t in 0.0..=1.0f32) {
            prop_assert!(distance(space.mix(from, to, t), space.mix(to, from, 1.0 - t)) < 1e-3);
        }

        /// There are no jumps, neither at the ends nor in between.
        #[test]
        fn blends_are_continuous(space in space(), from in color(), to in color(), t in 0.0..=1.0f32) {
            let step = 1e-4;
            prop_assert!(distance(space.mix(from, to, t), space.mix(from, to, t + step)) < 0.02);
        }
    }

    #[test]
    fn midpoints_are_correct() {
        let error =
            |space: BlendSpace, from, to, gray| distance(space.mix(from, to, 0.5), Color::srgb(gray, gray, gray));
        let (black, white) = (Color::BLACK, Color::WHITE);
        assert!(error(BlendSpace::Encoded, black, white, 0.5) < 1e-6);
        // An Oklab lightness of 0.5 is 0.125 in linear sRGB and 0.3886 in encoded sRGB.
        assert!(error(BlendSpace::Oklab, black, white, 0.3886) < 1e-3);
        let (yellow, blue) = (Color::srgb(1.0, 1.0, 0.0), Color::srgb(0.0, 0.0, 1.0));
        assert!(error(BlendSpace::Encoded, yellow, blue, 0.5) < 1e-6);
        assert!(error(BlendSpace::Oklab, yellow, blue, 0.5) > 0.1);
        // Colors that no display shows, as ramps can have, are on the same line.
        let [tan, orange] = [Color::srgb(0.86, 0.75, 0.53), Color::srgb(0.85, 0.6, -0.35)];
        let mix = |from, share| Srgba::from(BlendSpace::Oklab.mix(from, orange, share)).to_vec3();
        let found = mix(BlendSpace::Oklab.mix(tan, orange, 0.5), 0.5);
        assert!(found.distance(mix(tan, 0.75)) < 1e-3, "{found} instead of {}", mix(tan, 0.75));
    }
}
