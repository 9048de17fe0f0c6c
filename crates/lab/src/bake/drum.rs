//! A snare drum on its stand: red lacquer, chrome, and two sticks at rest.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{noise::noise, prop::Prop, sdf::*, shade::Material};

/// The drum.
pub struct Drum;

/// The parts of the drum, by material.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    Shell,
    Head,
    Chrome,
    Stick,
    Tip,
    Badge,
    Rubber,
    Rug,
    Tassel,
}

/// The center of the drum, its radius and half its height.
const CENTER: DVec3 = DVec3::new(0.0, 0.0, 0.13);
const RADIUS: f64 = 0.60;
const HALF: f64 = 0.31;
const LUGS: usize = 8;
/// The height of the top of the rug.
const FLOOR: f64 = -0.86;

/// Transforms a point to the space of the drum, which is tilted toward its player.
fn to_drum(p: DVec3) -> DVec3 {
    (p - CENTER).rotate_x(-0.17)
}

impl Drum {
    fn body(&self, q: DVec3, nearest: &mut Nearest<Part>) {
        nearest.add(cylinder(q, RADIUS, HALF, 0.01), Part::Shell);
        // Three shallow beads around the shell.
        for z in [-0.018, 0.018] {
            nearest.add(torus(q - DVec3::Z * z, RADIUS - 0.004, 0.013), Part::Shell);
        }
        nearest.add(cylinder(q, RADIUS + 0.012, HALF + 0.012, 0.02), Part::Shell);
        nearest.add(cylinder(q - DVec3::Z * (HALF + 0.012), RADIUS + 0.014, 0.022, 0.018), Part::Head);
        for z in [HALF + 0.014, -HALF - 0.006] {
            let ring = DVec2::new(q.truncate().length() - RADIUS - 0.034, q.z - z);
            nearest.add(rectangle(ring, DVec2::new(0.020, 0.052), 0.016), Part::Chrome);
            let flange = ring + DVec2::new(-0.012, 0.045 * z.signum());
            nearest.add(rectangle(flange, DVec2::new(0.028, 0.013), 0.012), Part::Chrome);
        }
    }

    fn hardware(&self, q: DVec3, nearest: &mut Nearest<Part>) {
        let (l, _) = fold(q.rotate_z(PI / LUGS as f64), LUGS);
        let l = l - DVec3::X * (RADIUS + 0.035);
        for z in [-0.135, 0.135] {
            let case = rod(l - DVec3::Z * z, DVec3::new(0.0, 0.0, -0.055), DVec3::new(0.0, 0.0, 0.055), 0.040, 0.040);
            nearest.add(
                blend(case, cuboid(l - DVec3::new(-0.03, 0.0, z), DVec3::new(0.03, 0.036, 0.085), 0.015), 0.02),
                Part::Chrome,
            );
        }
        nearest.add(cylinder(l - DVec3::X * 0.018, 0.014, HALF + 0.04, 0.004), Part::Chrome);
        for z in [HALF + 0.05, -HALF - 0.05] {
            nearest.add(cylinder(l - DVec3::new(0.018, 0.0, z), 0.026, 0.022, 0.006), Part::Chrome);
        }
        // The maker's badge, on the front.
        let badge = (q - DVec3::new(0.0, -RADIUS - 0.018, 0.0)).rotate_x(PI / 2.0);
        let (point, _) = fold(badge.rotate_z(-PI / 2.0), 5);
        let star = 0.85 * ((point.x - 0.105) * 0.32 + point.y.abs() * 0.95);
        nearest.add(cylinder(badge, 0.135, 0.022, 0.012), Part::Badge);
        nearest.add(extrude(star, badge.z, 0.036, 0.006), Part::Shell);
    }

    fn sticks(&self, q: DVec3, nearest: &mut Nearest<Part>) {
        let top = HALF + 0.058;
        for (angle, lift, shift) in [(0.62, 0.0, -0.03), (-0.50, 0.052, 0.05)] {
            let s = (q - DVec3::new(shift, -0.08, top + lift)).rotate_z(-angle - PI / 2.0);
            let s = s.rotate_y(if lift > 0.0 { -0.045 } else { 0.0 });
            let end = DVec3::new(0.56, 0.0, 0.0);
            nearest.add(rod(s, DVec3::new(-0.66, 0.0, 0.0), DVec3::new(0.30, 0.0, 0.0), 0.036, 0.034), Part::Stick);
            nearest.add(rod(s, DVec3::new(0.30, 0.0, 0.0), end, 0.034, 0.017), Part::Stick);
            nearest.add(ellipsoid(s - end - DVec3::X * 0.03, DVec3::new(0.052, 0.032, 0.032)), Part::Tip);
            nearest.add(rod(s, DVec3::new(-0.69, 0.0, 0.0), DVec3::new(-0.50, 0.0, 0.0), 0.041, 0.041), Part::Rug);
        }
    }

    fn stand(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let hub = DVec3::new(0.0, 0.02, -0.42);
        nearest.add(rod(p, hub, hub - DVec3::Z * 0.30, 0.035, 0.035), Part::Chrome);
        nearest.add(cylinder(p - hub, 0.070, 0.05, 0.02), Part::Rubber);
        nearest.add(cylinder(p - hub + DVec3::Z * 0.26, 0.062, 0.035, 0.02), Part::Chrome);
        for leg in 0..3 {
            let turned = (p - hub.with_z(0.0)).rotate_z(-PI / 2.0 - 2.0 * PI / 3.0 * f64::from(leg));
            let foot = DVec3::new(0.52, 0.0, FLOOR + 0.035);
            nearest.add(rod(turned, DVec3::new(0.03, 0.0, hub.z - 0.02), foot, 0.026, 0.026), Part::Chrome);
            nearest.add(
                rod(turned, DVec3::new(0.03, 0.0, hub.z - 0.26), DVec3::new(0.30, 0.0, -0.70), 0.018, 0.018),
                Part::Chrome,
            );
            nearest.add(
                rod(turned, foot - DVec3::new(0.03, 0.0, -0.03), foot + DVec3::X * 0.03, 0.048, 0.048),
                Part::Rubber,
            );
            // An arm of the basket that holds the drum, tilted like the drum.
            let arm = to_drum(p).rotate_z(-PI / 2.0 - 2.0 * PI / 3.0 * f64::from(leg));
            let elbow = DVec3::new(RADIUS + 0.085, 0.0, -HALF - 0.075);
            nearest.add(rod(arm, DVec3::new(0.0, 0.0, -HALF - 0.22), elbow, 0.028, 0.024), Part::Chrome);
            nearest.add(rod(arm, elbow, elbow + DVec3::Z * 0.16, 0.032, 0.032), Part::Rubber);
        }
    }

    fn rug(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let weave = 0.004 * noise(p * 40.0, 1);
        nearest.add(cylinder(p - DVec3::Z * (FLOOR - 0.03), 0.84, 0.03, 0.02) + weave, Part::Rug);
        let (tassel, _) = fold(p - DVec3::Z * (FLOOR - 0.036), 48);
        nearest.add(rod(tassel, DVec3::X * 0.83, DVec3::X * 0.91, 0.016, 0.022), Part::Tassel);
    }
}

impl Prop for Drum {
    type Part = Part;
    const DEPTH: u32 = 8;
    const HALF: f64 = 1.45;

    fn nearest(&self, position: DVec3) -> Nearest<Part> {
        let q = to_drum(position);
        let mut nearest = Nearest::new(f64::INFINITY, Part::Shell);
        self.body(q, &mut nearest);
        self.rug(position, &mut nearest);
        nearest.add_group(q, DVec3::ZERO, 0.84, |nearest| self.hardware(q, nearest));
        nearest.add_group(q, DVec3::Z * (HALF + 0.06), 0.85, |nearest| self.sticks(q, nearest));
        nearest.add_group(position, DVec3::new(0.0, 0.0, -0.45), 0.86, |nearest| self.stand(position, nearest));
        nearest
    }

    fn material(&self, part: Part, p: DVec3) -> Material {
        match part {
            Part::Shell => Material::paint([0.88, 0.05, 0.09], 1.0),
            Part::Head => {
                let r = to_drum(p).truncate().length();
                let ring = smoothstep(0.008, 0.002, (r - 0.50).abs());
                Material::paint([0.98, 0.96, 0.91], 0.35).mixed([0.70, 0.68, 0.66], ring)
            }
            Part::Chrome => Material::metal([0.88, 0.89, 0.92]),
            Part::Stick => {
                let grain = noise(to_drum(p) * DVec3::new(9.0, 9.0, 60.0), 2);
                Material::paint([0.87, 0.62, 0.33], 0.35).mixed([0.76, 0.48, 0.22], 0.5 + 0.5 * grain)
            }
            Part::Tip => Material::paint([0.97, 0.80, 0.52], 0.5),
            Part::Badge => Material::paint([0.99, 0.78, 0.15], 0.8),
            Part::Rubber => Material::paint([0.16, 0.16, 0.20], 0.3),
            Part::Rug => {
                let r = p.truncate().length();
                let angle = p.y.atan2(p.x);
                let band = smoothstep(0.012, 0.004, (r - 0.70).abs() - 0.045);
                let diamonds = smoothstep(0.1, -0.1, ((r - 0.70).abs() / 0.045) - (12.0 * angle).sin().abs());
                let knots = 0.08 * noise(p * 30.0, 3);
                let base = Material::paint([0.04, 0.56, 0.58], 0.0).mixed([0.98, 0.92, 0.76], band);
                if p.z > 0.0 {
                    Material::paint([0.04, 0.56, 0.58], 0.3)
                } else {
                    base.mixed([0.95, 0.70, 0.12], band * diamonds).shaded(1.0 + knots)
                }
            }
            Part::Tassel => Material::paint([0.98, 0.90, 0.70], 0.0),
        }
    }
}
