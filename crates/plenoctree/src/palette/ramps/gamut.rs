//! Limits colors to those that a screen can show.

use glam::DVec3;

use crate::palette::oklab::from_oklab;

/// Returns a color of Oklab in encoded sRGB. If it is `limited`, it gets as much chroma as fits in [0, 1] at its
/// lightness and hue.
pub(super) fn shown(oklab: DVec3, limited: bool) -> [f64; 3] {
    let color = from_oklab(oklab);
    if !limited || fits(color) {
        return if limited { color.clamp(DVec3::ZERO, DVec3::ONE).into() } else { color.into() };
    }
    let lightness = oklab.x.clamp(0.0, 1.0);
    let with = |share: f64| from_oklab(DVec3::new(lightness, share * oklab.y, share * oklab.z));
    let (mut inside, mut outside) = (0.0, 1.0);
    for _ in 0..32 {
        let middle = 0.5 * (inside + outside);
        if fits(with(middle)) { inside = middle } else { outside = middle }
    }
    with(inside).clamp(DVec3::ZERO, DVec3::ONE).into()
}

/// Returns whether all channels are in [0, 1], but for rounding.
fn fits(color: DVec3) -> bool {
    color.cmpge(DVec3::splat(-1e-6)).all() && color.cmple(DVec3::splat(1.0 + 1e-6)).all()
}
