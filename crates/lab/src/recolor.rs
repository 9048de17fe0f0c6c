//! Automatic recolorings, to show and measure recolored frames.

use bevy::color::{Hsva, Srgba};
use plenoctree::palette::Palette;

/// HSV chroma above which a palette color has a hue.
const CHROMATIC: f32 = 0.1;
/// The angle between hues that count as the same, in degrees.
const SAME: f32 = 40.0;
/// The share of the main color's saturation from which a color of the same hue counts as a shade of it. Less saturated
/// ones look gray or, if the main color is red, tan.
const SHADE: f32 = 0.75;

/// Turns the hue of every color by 180 degrees, at the same HSV saturation and value.
///
/// A turn of 120 degrees would only permute the channels, and change no difference between frames.
pub fn opposite_hues(colors: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let opposite = |color: &[f64; 3]| {
        let (low, high) = color.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(*c), b.max(*c)));
        color.map(|channel| low + high - channel)
    };
    colors.iter().map(opposite).collect()
}

/// Turns the palette's main hue, with all of its shades, by 180 degrees: like a user who turns a red prop blue.
///
/// The main hue is that of the color with the largest product of weight and chroma. Palettes without one are unchanged.
pub fn opposite_main_hue(palette: &Palette) -> Vec<[f64; 3]> {
    let hsv = |&[r, g, b]: &[f64; 3]| Hsva::from(Srgba::rgb(r as f32, g as f32, b as f32));
    let hsv: Vec<Hsva> = palette.colors.iter().map(hsv).collect();
    let chroma = |index: usize| hsv[index].saturation * hsv[index].value;
    let strength = |index: &usize| palette.weights[*index] * f64::from(chroma(*index));
    let chromatic = (0..hsv.len()).filter(|&index| chroma(index) >= CHROMATIC);
    let Some(main) = chromatic.max_by(|a, b| strength(a).total_cmp(&strength(b))) else {
        return palette.colors.clone();
    };
    let turned = opposite_hues(&palette.colors);
    let same = |index: usize| {
        let apart = (hsv[index].hue - hsv[main].hue).rem_euclid(360.0);
        let is_shade = hsv[index].saturation >= SHADE * hsv[main].saturation;
        chroma(index) >= CHROMATIC && apart.min(360.0 - apart) <= SAME && is_shade
    };
    (0..hsv.len()).map(|index| if same(index) { turned[index] } else { palette.colors[index] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_are_turned_and_grays_kept() {
        let turned = opposite_hues(&[[1.0, 0.5, 0.0], [0.3, 0.3, 0.3], [0.25, 0.25, 0.75]]);
        assert_eq!(turned, [[0.0, 0.5, 1.0], [0.3, 0.3, 0.3], [0.75, 0.75, 0.25]]);
    }

    /// Dark and light red turn cyan together; blue, gray, brown and tan stay, and so does a small but vivid green.
    #[test]
    fn the_main_hue_turns_with_its_shades() {
        let red = [[0.9, 0.1, 0.1], [0.4, 0.05, 0.1]];
        let others = [[0.1, 0.2, 0.9], [0.5, 0.5, 0.52], [0.54, 0.45, 0.42], [0.8, 0.54, 0.34], [0.0, 1.0, 0.0]];
        let palette = Palette {
            colors: [red.to_vec(), others.to_vec()].concat(),
            weights: vec![0.3, 0.2, 0.1, 0.19, 0.1, 0.1, 0.01],
            method: None,
            ramps: vec![],
            shown: vec![],
        };
        let shown = opposite_main_hue(&palette);
        assert_eq!(shown[2..], others);
        assert!(
            shown[..2].iter().zip(red).all(|(shown, red)| shown[0] < 0.11 && shown[1] >= red[0] - 0.06),
            "{shown:?}"
        );
        let gray = Palette::new(vec![[0.2; 3], [0.7; 3]]).unwrap();
        assert_eq!(opposite_main_hue(&gray), gray.colors);
    }
}
