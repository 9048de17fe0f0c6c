//! A tin of paint, baked when the game starts. All tins share one field; each prop overrides the color of the paint.

use bevy::prelude::{Color, default};
use bevy_plenoctree::{FieldPalette, PlenOctree};
use glam::{DVec2, DVec3};
use plenoctree::{BakeError, BakeSettings, Basis, bake, palette::InvalidPalette};

/// The index of the paint's color in the palette.
pub const PAINT: usize = 0;

const COLORS: [DVec3; 4] = [
    DVec3::new(0.9, 0.15, 0.15),
    DVec3::new(0.93, 0.91, 0.86),
    DVec3::new(0.56, 0.57, 0.62),
    DVec3::new(0.2, 0.18, 0.2),
];
const LABEL: usize = 1;
const METAL: usize = 2;

/// The radius of the tin, in world units of the field.
const RADIUS: f64 = 0.42;
/// The height of the tin, in world units of the field. It stands on z = 0.
const HEIGHT: f64 = 0.8;

pub fn palette() -> Result<FieldPalette, InvalidPalette> {
    FieldPalette::from_colors(COLORS.map(|color| Color::srgb(color.x as f32, color.y as f32, color.z as f32)))
}

pub fn field() -> Result<PlenOctree, BakeError> {
    let settings = BakeSettings {
        depth: 6,
        min: DVec3::new(-0.55, -0.55, -0.05),
        max: DVec3::new(0.55, 0.55, 1.05),
        basis: Basis::Rgba,
        ..default()
    };
    bake(&settings, |at| if surface(at).0 < 0.0 { 400.0 } else { 0.0 }, |at| move |_| shade(at))
}

/// Returns the signed distance to the tin, and the color of its nearest part.
fn surface(at: DVec3) -> (f64, usize) {
    let around = DVec2::new(at.truncate().length(), at.z);
    let boxed = |center: DVec2, half: DVec2| {
        let outside = (around - center).abs() - half;
        outside.max(DVec2::ZERO).length() + outside.max_element().min(0.0)
    };
    let ring = |radius: f64, height: f64, tube: f64| around.distance(DVec2::new(radius, height)) - tube;
    let band = boxed(DVec2::new(RADIUS - 0.02, 0.5 * HEIGHT), DVec2::new(0.03, 0.24));
    let parts = [
        (boxed(DVec2::new(RADIUS - 0.03, 0.5 * HEIGHT), DVec2::new(0.03, 0.5 * HEIGHT)), METAL),
        (boxed(DVec2::new(0.0, 0.02), DVec2::new(RADIUS, 0.02)), METAL),
        (ring(RADIUS, 0.03, 0.04), METAL),
        (ring(RADIUS - 0.01, HEIGHT, 0.045), METAL),
        (band, LABEL),
        (boxed(DVec2::new(0.0, 0.5 * HEIGHT), DVec2::new(RADIUS - 0.04, 0.44 * HEIGHT)), PAINT),
        (drips(at), PAINT),
    ];
    parts.into_iter().fold((f64::INFINITY, METAL), |a, b| if b.0 < a.0 { b } else { a })
}

/// Returns the signed distance to the paint that ran over the rim. Each drip has an angle, a length and a width.
fn drips(at: DVec3) -> f64 {
    const DRIPS: [(f64, f64, f64); 5] =
        [(-1.9, 0.42, 0.075), (-1.45, 0.2, 0.06), (-1.1, 0.3, 0.065), (0.3, 0.25, 0.07), (2.4, 0.35, 0.07)];
    let distances = DRIPS.map(|(angle, length, width)| {
        let foot = (RADIUS + 0.025) * DVec2::from_angle(angle);
        let height = at.z.clamp(HEIGHT - length, HEIGHT + 0.02);
        at.distance(foot.extend(height)) - width
    });
    distances.into_iter().fold(f64::INFINITY, f64::min)
}

/// Returns the color of the nearest surface, lit by a lamp from the upper left.
fn shade(at: DVec3) -> DVec3 {
    let (_, color) = surface(at);
    let step = 0.03;
    let slope = DVec3::AXES.map(|axis| surface(at + step * axis).0 - surface(at - step * axis).0);
    let light = DVec3::from(slope).normalize_or_zero().dot(DVec3::new(-0.4, -0.6, 0.7));
    if light < -0.1 && color != PAINT {
        COLORS[3].lerp(COLORS[color], 0.5)
    } else {
        COLORS[color] * (0.8 + 0.2 * light)
    }
}
