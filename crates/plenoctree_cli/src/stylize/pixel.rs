//! Wishes for single pixels of the first view.

use glam::DVec3;
use plenoctree::palette::{Palette, PaletteLabel, Unmet, Wish};

use crate::{hex, result::Result};

/// A wish that a pixel of the first view gets a color.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelWish {
    at: (u32, u32),
    color: [u8; 3],
}

/// Parses `x,y=#rrggbb`.
pub fn parse(text: &str) -> Result<PixelWish, String> {
    const EXPECTED: &str = "expected X,Y=#RRGGBB";
    let (at, color) = text.split_once('=').ok_or(EXPECTED)?;
    let (x, y) = at.split_once(',').ok_or(EXPECTED)?;
    let number = |digits: &str| digits.parse().map_err(|_| EXPECTED.to_string());
    Ok(PixelWish { at: (number(x)?, number(y)?), color: hex::parse(color)? })
}

/// Moves the ramps of the pixels' labels so that all wishes come true, and writes their colors to `shown`, where others
/// stay. The views have `width` and `height`, and `label_at` returns the color of the label of a pixel of the first
/// one, in the palette's own colors, or `None` where the prop is not posterized.
pub fn apply(
    wishes: &[PixelWish],
    palette: &Palette,
    blend_steps: u32,
    (width, height): (u32, u32),
    label_at: impl Fn(u32, u32) -> Option<DVec3>,
    shown: &mut [[f64; 3]],
) -> Result {
    let wish = |PixelWish { at: (x, y), color }: &PixelWish| {
        if *x >= width || *y >= height {
            return Err(format!("--pixel {x},{y}: the views have {width} x {height} pixels"));
        }
        let shown = label_at(*x, *y).ok_or_else(|| format!("--pixel {x},{y}: the prop is not posterized there"))?;
        let label = shown_label(shown, palette, blend_steps).ok_or("the palette is empty")?;
        Ok(Wish { label, color: hex::unit(*color) })
    };
    let found: Vec<Wish> = wishes.iter().map(wish).collect::<Result<_, String>>()?;
    let moved = palette.recolored(shown, &found, &[]).map_err(|error| {
        let message = |unmet: &Unmet| {
            let (x, y) = wishes[unmet.wish].at;
            format!("--pixel {x},{y} {unmet}")
        };
        error.unmet.iter().map(message).collect::<Vec<_>>().join("; ")
    })?;
    shown.iter_mut().zip(moved).for_each(|(shown, moved)| *shown = moved);
    Ok(())
}

/// Returns the label whose color is shown, but for rounding.
fn shown_label(pixel: DVec3, palette: &Palette, blend_steps: u32) -> Option<PaletteLabel> {
    // Labels are compared in encoded sRGB, in which they are rounded, whatever the space of the palette.
    let encoded = Palette { method: None, ..palette.clone() };
    PaletteLabel::nearest(pixel, &encoded, blend_steps)
}

#[cfg(test)]
mod tests {
    use plenoctree::palette::Ramp;

    use super::*;

    fn palette() -> Palette {
        let mut palette = Palette::new(vec![[0.4, 0.08, 0.08], [0.8, 0.2, 0.2], [0.9; 3]]).unwrap();
        palette.ramps = vec![Ramp { name: "cap".into(), tones: vec![0, 1] }];
        palette
    }

    /// The pixel gets its color, and the rest of its ramp moves with it. Other recolorings stay.
    #[test]
    fn the_ramp_of_a_pixel_moves() {
        let (palette, blue) = (palette(), [0.0, 0.0, 1.0]);
        let mut shown = vec![palette.colors[0], palette.colors[1], blue];
        let wish = parse("1,0=#3060c0").unwrap();
        apply(&[wish], &palette, 1, (2, 2), |_, _| Some(DVec3::new(0.8, 0.2, 0.2)), &mut shown).unwrap();
        assert_eq!(hex::quantize(shown[1]), [0x30, 0x60, 0xc0]);
        assert!(shown[0][2] > shown[0][0] && shown[0][2] < shown[1][2] && shown[2] == blue, "{shown:?}");
    }

    /// Whatever a ramp showed before, a pixel can get the color back that it has in the palette, and colors in no ramp
    /// the one that they show.
    #[test]
    fn what_is_there_can_be_wished() {
        let (palette, blue) = (palette(), [0.0, 0.0, 1.0]);
        let mut shown = vec![blue; 3];
        let wishes = ["0,0=#cc3333", "1,0=#0000ff"].map(|wish| parse(wish).unwrap());
        let label_at = |x: u32, _: u32| Some(if x == 0 { DVec3::new(0.8, 0.2, 0.2) } else { DVec3::splat(0.9) });
        apply(&wishes, &palette, 1, (2, 2), label_at, &mut shown).unwrap();
        let expected = [palette.colors[0], palette.colors[1], blue].map(hex::quantize);
        assert_eq!([shown[0], shown[1], shown[2]].map(hex::quantize), expected);
    }

    #[test]
    fn errors_say_what_is_wrong() {
        for (text, message) in [
            ("1,0", "expected X,Y=#RRGGBB"),
            ("1=#000000", "expected X,Y=#RRGGBB"),
            ("1,-1=#000000", "expected X,Y=#RRGGBB"),
            ("1,0=blue", "expected #RRGGBB"),
            ("2,0=#000000", "--pixel 2,0: the views have 2 x 2 pixels"),
            ("1,1=#000000", "--pixel 1,1: the prop is not posterized there"),
            ("0,0=#000000", "--pixel 0,0 cannot be met: its colors are in no ramp"),
        ] {
            let palette = palette();
            let label_at = |x, y| ((x, y) != (1, 1)).then_some(DVec3::splat(0.9));
            let error = match parse(text) {
                Ok(wish) => apply(&[wish], &palette, 1, (2, 2), label_at, &mut palette.colors.clone()),
                Err(error) => Err(error.into()),
            };
            let error = error.unwrap_err().to_string();
            assert!(error.contains(message), "{text}: {error}");
        }
    }
}
