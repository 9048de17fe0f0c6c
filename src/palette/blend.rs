//! Colors between colors.

use bevy::{color::Mix, prelude::*};

use super::oklab;

/// The space in which two colors are blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum BlendSpace {
    /// Encoded sRGB, as image editors do it: simple, but complementary colors meet in a dull gray.
    Encoded,
    /// Oklab, which is perceptual: lightness and hue change evenly.
    #[default]
    Oklab,
}

impl BlendSpace {
    /// The color that is the share `t` of the way from `from` to `to`, in encoded sRGB. 0 and everything below it is
    /// `from`, 1 and everything above is `to`, exactly; so is not-a-number `from`.
    pub fn mix(self, from: Color, to: Color, t: f32) -> Color {
        if t >= 1.0 {
            return to;
        }
        if t > 0.0 {
            return match self {
                Self::Encoded => Srgba::from(from).mix(&to.into(), t).into(),
                Self::Oklab => oklab::mix(from.into(), to.into(), t).into(),
            };
        }
        from
    }

    /// The blends of two palettes, color by color, as far as both go.
    pub(super) fn mix_all(self, from: &[Color], to: &[Color], t: f32) -> impl Iterator<Item = Color> {
        from.iter().zip(to).map(move |(from, to)| self.mix(*from, *to, t))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn color() -> impl Strategy<Value = Color> {
        prop::array::uniform3(0.0..=1.0f32).prop_map(|[r, g, b]| Color::srgb(r, g, b))
    }

    fn space() -> impl Strategy<Value = BlendSpace> {
        prop_oneof![Just(BlendSpace::Encoded), Just(BlendSpace::Oklab)]
    }

    fn distance(a: Color, b: Color) -> f32 {
        Srgba::from(a).to_vec3().distance(Srgba::from(b).to_vec3())
    }

    proptest! {
        #[test]
        fn the_ends_are_exact(space in space(), from in color(), to in color(), beyond in 0.0..1e9f32) {
            prop_assert_eq!(space.mix(from, to, -beyond), from);
            prop_assert_eq!(space.mix(from, to, 1.0 + beyond), to);
            prop_assert_eq!(space.mix(from, to, f32::NAN), from);
        }

        #[test]
        fn there_and_back_is_the_same(space in space(), from in color(), to in color(), t in 0.0..=1.0f32) {
            prop_assert!(distance(space.mix(from, to, t), space.mix(to, from, 1.0 - t)) < 1e-3);
        }

        /// Nothing jumps: neither at the ends nor between.
        #[test]
        fn blends_are_continuous(space in space(), from in color(), to in color(), t in 0.0..=1.0f32) {
            let step = 1e-4;
            prop_assert!(distance(space.mix(from, to, t), space.mix(from, to, t + step)) < 0.02);
        }
    }

    #[test]
    fn halfway_is_what_the_space_says() {
        let differs =
            |space: BlendSpace, from, to, gray| distance(space.mix(from, to, 0.5), Color::srgb(gray, gray, gray));
        let (black, white) = (Color::BLACK, Color::WHITE);
        assert!(differs(BlendSpace::Encoded, black, white, 0.5) < 1e-6);
        // Lightness 0.5 is a linear 0.125, encoded 0.3886.
        assert!(differs(BlendSpace::Oklab, black, white, 0.3886) < 1e-3);
        let (yellow, blue) = (Color::srgb(1.0, 1.0, 0.0), Color::srgb(0.0, 0.0, 1.0));
        assert!(differs(BlendSpace::Encoded, yellow, blue, 0.5) < 1e-6);
        assert!(differs(BlendSpace::Oklab, yellow, blue, 0.5) > 0.1);
    }
}
