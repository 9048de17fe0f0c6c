//! A ray against one field, in the field's own frame.

mod normal;

use std::{f64::consts::LN_2, ops::ControlFlow};

use glam::DVec3;

use self::normal::normal_at;
use crate::field::PlenOctree;

/// Where a ray meets a field. Everything is in the field's frame and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldHit {
    /// Where the opacity along the ray reaches one half.
    pub point: DVec3,
    /// Distance of that point from the ray's origin.
    pub distance: f64,
    /// The direction in which opacity falls off around the point, smoothed over a few cells; a unit vector. Where it
    /// falls off in no direction, back along the ray.
    pub normal: DVec3,
    /// The color that is seen along the whole ray: the accumulated radiance over the opacity, encoded sRGB.
    pub color: DVec3,
    /// Opacity along the whole ray, one half to 1.
    pub opacity: f64,
}

impl PlenOctree {
    /// Where the ray `origin + t direction`, t >= 0, has lost half of its light; `None` if it never does. `direction` is
    /// a unit vector.
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
        let (distance, density) = half_way(self, origin, direction)?;
        let point = origin + distance * direction;
        let (color, opacity) = self.render_ray(origin, direction);
        Some(FieldHit {
            point,
            distance,
            normal: normal_at(self, point, density).unwrap_or(-direction),
            color: color / opacity,
            opacity,
        })
    }
}

/// The distance at which half of the light is gone, and the density there.
fn half_way(field: &PlenOctree, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let mut depth = 0.0;
    let mut found = None;
    field.march(origin, direction, |crossing| {
        let density = f64::from(field.densities()[crossing.leaf as usize]);
        let missing = LN_2 - depth;
        depth += density * crossing.length;
        if depth < LN_2 {
            return ControlFlow::Continue(());
        }
        found = Some((crossing.start + missing / density, density));
        ControlFlow::Break(())
    });
    found
}
