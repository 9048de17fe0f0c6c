//! Limits colors to those that a screen can show.

use glam::DVec3;

use crate::palette::oklab::{from_oklab, linear_from_oklab};

/// Returns a color of Oklab in encoded sRGB. If it is `limited`, it gets as much chroma as fits in [0, 1] at its
/// lightness and hue.
pub(super) fn shown(oklab: DVec3, limited: bool) -> [f64; 3] {
    if !limited {
        return from_oklab(oklab).into();
    }
    let mut inside = oklab;
    if !fits(oklab) {
        inside.x = inside.x.clamp(0.0, 1.0);
        let with = |share: f64| DVec3::new(inside.x, share * oklab.y, share * oklab.z);
        let (mut most, mut outside) = (0.0, 1.0);
        for _ in 0..32 {
            let middle = 0.5 * (most + outside);
            if fits(with(middle)) { most = middle } else { outside = middle }
        }
        inside = with(most);
    }
    from_oklab(inside).clamp(DVec3::ZERO, DVec3::ONE).into()
}

/// Linear light that encodes to -1e-6 and to 1 + 1e-6.
const RANGE: (f64, f64) = (-1e-6 / 12.92, 1.0 + 1e-6 * 2.4 / 1.055);

/// Returns whether all channels are in [0, 1], but for rounding. Encoding is monotonic, so this needs none.
fn fits(oklab: DVec3) -> bool {
    let linear = linear_from_oklab(oklab);
    linear.cmpge(DVec3::splat(RANGE.0)).all() && linear.cmple(DVec3::splat(RANGE.1)).all()
}
