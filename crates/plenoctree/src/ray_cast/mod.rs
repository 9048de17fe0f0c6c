//! Casts rays at a single field, in the field's own frame.

mod normal;

use std::f64::consts::LN_2;

use glam::DVec3;

use self::normal::normal_at;
use crate::field::PlenOctree;

/// A hit of a ray on a field, in the field's frame and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldHit {
    /// Point where the opacity along the ray reaches one half.
    pub point: DVec3,
    /// Distance from the ray's origin to that point, in world units of the field.
    pub distance: f64,
    /// Direction in which opacity falls off around the point, smoothed over a few cells. A unit vector. Points back
    /// along the ray if opacity is the same all around.
    pub normal: DVec3,
    /// Color of the whole ray, in encoded sRGB: the accumulated radiance divided by the opacity.
    pub color: DVec3,
    /// Opacity of the whole ray, 0.5 to 1.
    pub opacity: f64,
}

impl PlenOctree {
    /// Casts the ray `origin + t direction`, t >= 0, and returns the point where its opacity reaches one half. Returns
    /// `None` if it never does.
    ///
    /// `origin` and `direction` are in the field's frame. `direction` is a unit vector.
    ///
    /// ```
    /// use plenoctree::{BakeSettings, bake};
    /// use glam::DVec3;
    ///
    /// let settings = BakeSettings { depth: 6, ..Default::default() };
    /// let ball = bake(&settings, |at| if at.length() < 0.8 { 1e3 } else { 0.0 }, |_| |_| DVec3::splat(0.5))?;
    /// let hit = ball.cast_ray(DVec3::new(3.0, 0.0, 0.0), DVec3::NEG_X).unwrap();
    /// assert!((hit.distance - 2.2).abs() < 0.05 && hit.normal.x > 0.99);
    /// assert!(ball.cast_ray(DVec3::new(3.0, 0.0, 0.0), DVec3::X).is_none());
    /// # Ok::<(), plenoctree::BakeError>(())
    /// ```
    pub fn cast_ray(&self, origin: DVec3, direction: DVec3) -> Option<FieldHit> {
        // The distance at which the opacity reaches one half, and the density there.
        let (mut depth, mut half) = (0.0, None);
        let (color, opacity) = self.render_ray_visiting(origin, direction, |crossing, density| {
            let missing = LN_2 - depth;
            depth += density * crossing.length;
            if half.is_none() && depth >= LN_2 {
                half = Some((crossing.start + missing / density, density));
            }
        });
        let (distance, density) = half?;
        let point = origin + distance * direction;
        Some(FieldHit {
            point,
            distance,
            normal: normal_at(self, point, density).unwrap_or(-direction),
            color: color / opacity,
            opacity,
        })
    }
}
