//! Fades the colors of props between day and night.

use bevy::prelude::*;
use bevy_plenoctree::{BlendSpace, Palettes, Prop};

/// How far night has fallen: 0 by day, 1 at night.
#[derive(Resource, Default)]
pub struct Night(pub f32);

/// The ramps of a prop's field, by name, and their colors at night.
#[derive(Component)]
pub struct ByNight(pub Vec<(&'static str, Color)>);

/// Fades palettes between day and night, for all props of a field at once.
pub fn paint_by_night(night: Res<Night>, mut palettes: ResMut<Palettes>, props: Query<(&Prop, &ByNight)>) {
    for (prop, by_night) in &props {
        let Some(palette) = palettes.get_mut(&prop.0) else {
            continue;
        };
        for (name, color) in &by_night.0 {
            if let Some(ramp) = palette.ramp(name)
                && let Some(by_day) = palette.ramp_color(ramp)
            {
                palette.set_ramp(ramp, BlendSpace::Oklab.mix(by_day, *color, night.0));
            }
        }
    }
}
