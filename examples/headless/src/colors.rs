//! The ramps of a palette, and what the demo does to one of them.

use bevy::{color::Oklcha, prelude::*};
use bevy_plenoctree::{Palette, headless::Headless, prelude::*};

/// The least chroma of a recolored ramp. Turning the hue of a gray changes nothing.
const CHROMA: f32 = 0.1;

/// Returns the names and the colors of ramps, from shadow to highlight, and then those that belong to none.
pub fn groups(palette: &Palette) -> Vec<(&str, Vec<usize>)> {
    let mut groups: Vec<_> = palette.ramps.iter().map(|ramp| (ramp.name.as_str(), ramp.tones.clone())).collect();
    let rest: Vec<_> = (0..palette.colors.len()).filter(|tone| palette.ramp_of(*tone).is_none()).collect();
    if !rest.is_empty() {
        groups.push(("", rest));
    }
    groups
}

/// Shows the ramp with most color in another hue, so many degrees away. Returns its name, or `None` if there is no
/// ramp.
pub fn turn_hue(headless: &mut Headless, field: &Handle<PlenOctree>, degrees: f32) -> Option<String> {
    let mut palettes = headless.app.world_mut().resource_mut::<Palettes>();
    let shown = palettes.get_mut(field)?;
    let palette = shown.palette();
    let ramps = palette.ramps.iter().enumerate().filter_map(|(index, ramp)| {
        let mean = palette.ramp_color(index)?.map(|channel| channel as f32);
        let mean = Oklcha::from(Color::srgb_from_array(mean));
        let weight: f64 = ramp.tones.iter().map(|tone| palette.weights[*tone]).sum();
        Some((weight as f32 * mean.chroma, index, mean))
    });
    let (_, ramp, mean) = ramps.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let name = palette.ramps[ramp].name.clone();
    let color = Oklcha { hue: (mean.hue + degrees).rem_euclid(360.0), chroma: mean.chroma.max(CHROMA), ..mean };
    shown.set_ramp(ramp, color);
    Some(name)
}
