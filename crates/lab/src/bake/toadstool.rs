//! A toadstool house.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{
    noise::{noise, random},
    prop::Prop,
    sdf::*,
    shade::Material,
};

/// The toadstool, with its spots and the plants around it.
pub struct Toadstool {
    spots: Vec<Spot>,
    blades: Vec<Tuft>,
    flowers: Vec<Flower>,
}

/// A white spot on the cap.
struct Spot {
    /// The unit vector from the cap's center, in the cap's space.
    direction: DVec3,
    radius: f64,
}

/// Blades of grass from one root.
struct Tuft {
    root: DVec3,
    tips: [DVec3; 5],
}

struct Flower {
    root: DVec3,
    head: DVec3,
    violet: bool,
}

/// The parts of the toadstool, by material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    Grass,
    Soil,
    Stem,
    Skirt,
    Cap,
    Spot,
    Door,
    Wood,
    Brass,
    Pane,
    Stone,
    Picket,
    SmallStem,
    SmallCap,
    Petal(bool),
    Stalk,
    Bush,
    Roof,
}

/// The height of the top of the ground.
const GROUND: f64 = -0.72;
const CAP: DVec3 = DVec3::new(0.0, 0.06, 0.06);
const CAP_RADII: DVec3 = DVec3::new(0.80, 0.80, 0.74);
/// Round windows in the stem, as angles from the front.
const WINDOWS: [f64; 2] = [-0.95, 0.95];
const DORMER: DVec3 = DVec3::new(0.0, -0.70, 0.40);
const STONES: [(f64, f64, f64); 6] = [
    (0.02, -0.50, 0.10),
    (-0.06, -0.64, 0.085),
    (0.07, -0.71, 0.07),
    (0.19, -0.58, 0.06),
    (-0.2, -0.53, 0.05),
    (-0.14, -0.75, 0.05),
];
const SMALL: [(f64, f64, f64); 3] = [(0.55, -0.36, 1.0), (0.67, -0.20, 0.66), (0.42, -0.50, 0.5)];
const CHIMNEY: DVec3 = DVec3::new(0.44, 0.22, 0.66);

impl Toadstool {
    /// Places spots, grass and flowers.
    pub fn new() -> Self {
        let ring = |index: usize, seed: u64, low: f64, high: f64| {
            let angle = 2.0 * PI * random(index, seed);
            let radius = low + (high - low) * random(index, seed + 1).sqrt();
            DVec3::new(radius * angle.cos(), radius * angle.sin(), GROUND)
        };
        let spots = (0..60)
            .map(|index| {
                let z = 0.93 - 0.0145 * index as f64;
                let angle = index as f64 * 2.399_963 + 0.4;
                let r = (1.0 - z * z).sqrt();
                Spot {
                    direction: DVec3::new(r * angle.cos(), r * angle.sin(), z),
                    radius: 0.065 + 0.075 * random(index, 21),
                }
            })
            .fold(Vec::new(), |mut spots: Vec<Spot>, spot| {
                let place = |spot: &Spot| spot.direction * CAP_RADII + CAP;
                let free = |other: &Spot| place(other).distance(place(&spot)) > other.radius + spot.radius + 0.11;
                let clear = place(&spot).distance(DORMER) > 0.24 + spot.radius
                    && place(&spot).distance(CHIMNEY) > 0.16 + spot.radius;
                if clear && spots.iter().all(free) {
                    spots.push(spot);
                }
                spots
            });
        let on_path = |p: &DVec3| p.x.abs() < 0.2 && p.y < 0.0;
        let blades = (0..64)
            .map(|index| ring(index, 31, 0.44, 0.80))
            .filter(|root| !on_path(root))
            .enumerate()
            .map(|(index, root)| {
                let tips = std::array::from_fn(|blade| {
                    let seed = 40 + blade as u64;
                    root + DVec3::new(random(index, seed) - 0.5, random(index, seed + 10) - 0.5, 0.0) * 0.13
                        + DVec3::Z * (0.06 + 0.07 * random(index, seed + 20))
                });
                Tuft { root, tips }
            })
            .collect();
        let flowers = (0..30)
            .map(|index| ring(index, 71, 0.50, 0.76))
            .filter(|root| {
                !on_path(root) && SMALL.iter().all(|&(x, y, _)| root.truncate().distance(DVec2::new(x, y)) > 0.13)
            })
            .enumerate()
            .map(|(index, root)| {
                let lean = DVec3::new(random(index, 73) - 0.5, random(index, 74) - 0.5, 0.0) * 0.08;
                Flower {
                    root,
                    head: root + lean + DVec3::Z * (0.09 + 0.06 * random(index, 75)),
                    violet: index % 2 == 0,
                }
            })
            .collect();
        Self { spots, blades, flowers }
    }

    fn ground(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let slab = cylinder(p - DVec3::Z * (GROUND - 0.12), 0.90, 0.16, 0.02);
        if slab > 0.1 {
            return nearest.add(slab, Part::Grass);
        }
        let angle = p.y.atan2(p.x);
        let rough = noise(p * 9.0, 1) * 0.010 + noise(p * 23.0, 2) * 0.005;
        let fringe = 0.022 * (9.0 * angle + 1.5 * (4.0 * angle).sin()).sin() + 0.012 * (17.0 * angle).sin();
        let middle = GROUND - 0.055;
        let turf = cylinder(p - DVec3::Z * middle, 0.86, 0.055, 0.05);
        let drip = DVec2::new(p.truncate().length() - 0.81, p.z - (GROUND - 0.07 - fringe));
        let drip = rectangle(drip, DVec2::new(0.045, 0.06), 0.04);
        nearest.add(blend(turf, drip, 0.03) + rough, Part::Grass);
        let taper = 0.80 + 0.35 * (p.z + 0.80);
        let soil = (p.truncate().length() - taper).max(-(p.z + 0.93)).max(p.z - GROUND + 0.03);
        nearest.add(0.9 * soil + noise(p * 8.0, 3) * 0.02 - 0.01, Part::Soil);
        for (x, y, radius) in STONES {
            let stone = p - DVec3::new(x, y, GROUND + 0.003);
            nearest.add(ellipsoid(stone, DVec3::new(radius, 0.8 * radius, 0.03)), Part::Stone);
        }
    }

    fn house(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let q = p - DVec3::Y * 0.06;
        let t = ((p.z - GROUND) / 0.8).clamp(0.0, 1.0);
        let radius = 0.43 - 0.24 * t + 0.06 * t * t;
        let ripple = 0.006 * (13.0 * q.y.atan2(q.x) + 2.0 * noise(p * 3.0, 5)).sin() * (1.0 - t);
        let wall = 0.93 * (q.truncate().length() - radius + ripple);
        let stem = wall.max(GROUND - 0.06 - p.z).max(p.z - 0.15);
        nearest.add(stem, Part::Stem);
        // A frill under the cap.
        let frill = 0.012 * (16.0 * q.y.atan2(q.x)).sin();
        let flare = DVec2::new(q.truncate().length() - 0.30 - frill, p.z + 0.11 - frill);
        let flare = DVec2::new(0.8 * flare.x + 0.6 * flare.y, 0.8 * flare.y - 0.6 * flare.x);
        nearest.add(rectangle(flare, DVec2::new(0.075, 0.016), 0.015), Part::Skirt);

        nearest.add_group(p, DVec3::new(0.0, -0.35, -0.5), 0.34, |nearest| self.door(p, nearest));
        nearest.add_group(p, DVec3::new(0.0, -0.12, -0.36), 0.42, |nearest| {
            for angle in WINDOWS {
                let w = (q.rotate_z(-angle) - DVec3::new(0.0, -0.368, -0.36)).rotate_x(-0.24);
                self.window(w, 0.088, 0.022, nearest);
            }
        });
    }

    fn door(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let d = p - DVec3::new(0.0, -0.33, GROUND);
        let outline = d.with_y(d.z).truncate();
        nearest.add(extrude(arch(outline, 0.165, 0.25), d.y, 0.06, 0.012), Part::Wood);
        if extrude(arch(outline, 0.120, 0.25), d.y + 0.1, 0.08, 0.0) < nearest.distance.max(0.05) {
            nearest.distance = nearest.distance.max(-extrude(arch(outline, 0.122, 0.25), d.y + 0.07, 0.05, 0.0));
            let groove = 0.007 * smoothstep(0.012, 0.0, (d.x.rem_euclid(0.06) - 0.03).abs());
            nearest.add(extrude(arch(outline, 0.120, 0.25), d.y, 0.045 - groove, 0.004), Part::Door);
        }
        nearest.add(cuboid(d - DVec3::new(0.0, -0.07, 0.018), DVec3::new(0.20, 0.07, 0.022), 0.014), Part::Stone);
        nearest.add(sphere(d - DVec3::new(0.075, -0.06, 0.17), 0.020), Part::Brass);
        self.window(d - DVec3::new(0.0, -0.045, 0.265), 0.055, 0.015, nearest);
    }

    /// Adds a round window that faces -y.
    fn window(&self, p: DVec3, radius: f64, bar: f64, nearest: &mut Nearest<Part>) {
        let w = p.rotate_x(PI / 2.0);
        let frame = DVec2::new(w.truncate().length() - radius, w.z);
        nearest.add(rectangle(frame, DVec2::new(bar, 1.5 * bar), 0.6 * bar), Part::Wood);
        nearest.add(cylinder(w, radius, 0.4 * bar, 0.003), Part::Pane);
        let cross = (w.x.abs().min(w.y.abs()) - 0.4 * bar).max(w.truncate().length() - radius);
        nearest.add(cross.max(w.z.abs() - 0.8 * bar), Part::Wood);
    }

    fn cap(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let q = (p - CAP).rotate_x(0.06);
        let dome = if q.z > 0.0 { CAP_RADII } else { CAP_RADII.with_z(0.17) };
        let cap = ellipsoid(q, dome);
        if cap > 0.15 {
            nearest.add(cap - 0.05, Part::Cap);
        } else {
            self.skin(p, q, cap, nearest);
        }
        self.dormer(p, nearest);
        self.chimney(p, nearest);
    }

    /// Adds the cap near its surface: gills, bumps and spots. `q` is the point in the cap's space, `cap` the smooth
    /// distance.
    fn skin(&self, p: DVec3, q: DVec3, cap: f64, nearest: &mut Nearest<Part>) {
        let wave = (44.0 * q.y.atan2(q.x)).sin();
        let gills = 0.009 * wave * smoothstep(-0.01, -0.06, q.z) * smoothstep(0.2, 0.45, q.truncate().length());
        let bump = 0.012 * noise(p * 2.5, 7);
        nearest.add(cap + gills + bump, Part::Cap);
        if cap.abs() < 0.12 {
            for spot in &self.spots {
                let center = spot.direction * CAP_RADII;
                let axis = (spot.direction / CAP_RADII).normalize();
                let away = q - center;
                let wobble = 1.0 + 0.10 * noise(away * 9.0 + spot.radius * 99.0, 8);
                let side = (away - away.dot(axis) * axis).length() - spot.radius * wobble;
                nearest.add(extrude(side, cap + bump, 0.030, 0.022), Part::Spot);
            }
        }
    }

    fn dormer(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let d = p - DORMER;
        nearest.add_group(p, DORMER + DVec3::Y * 0.12, 0.26, |nearest| {
            nearest.add(cylinder((d - DVec3::Y * 0.14).rotate_x(PI / 2.0), 0.170, 0.15, 0.02), Part::Stem);
            self.window(d + DVec3::Y * 0.015, 0.135, 0.028, nearest);
        });
    }

    fn chimney(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        nearest.add_group(p, CHIMNEY, 0.32, |nearest| {
            let c = (p - CHIMNEY).rotate_y(-0.12);
            let course = 0.006 * smoothstep(0.010, 0.0, (c.z.rem_euclid(0.07) - 0.035).abs());
            nearest.add(cylinder(c, 0.082 - course, 0.20, 0.01), Part::Stone);
            nearest.add(cylinder(c - DVec3::Z * 0.19, 0.105, 0.025, 0.02), Part::Stone);
            let hat = c - DVec3::Z * 0.255;
            let cone = (0.75 * (hat.truncate().length() - 0.14 + 1.25 * hat.z)).max(-hat.z);
            nearest.add(cone - 0.008, Part::Roof);
            let posts = hat.truncate().abs().distance(DVec2::splat(0.045)) - 0.014;
            nearest.add(posts.max((hat.z + 0.03).abs() - 0.04), Part::Wood);
        });
    }

    fn garden(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        for tuft in &self.blades {
            nearest.add_group(p, tuft.root, 0.17, |nearest| {
                for tip in tuft.tips {
                    nearest.add(rod(p, tuft.root, tip, 0.020, 0.006), Part::Grass);
                }
            });
        }
        for flower in &self.flowers {
            nearest.add_group(p, flower.head, 0.22, |nearest| {
                nearest.add(rod(p, flower.root, flower.head, 0.009, 0.009), Part::Stalk);
                let (petal, _) = fold(p - flower.head, 5);
                let petal = ellipsoid((petal - DVec3::X * 0.034).rotate_y(0.25), DVec3::new(0.034, 0.024, 0.013));
                nearest.add(petal, Part::Petal(flower.violet));
                nearest.add(sphere(p - flower.head - DVec3::Z * 0.010, 0.018), Part::Brass);
            });
        }
        for (x, y, size) in SMALL {
            let root = DVec3::new(x, y, GROUND);
            nearest.add_group(p, root, 0.45 * size, |nearest| {
                let q = (p - root) / size;
                nearest.add(size * rod(q, DVec3::ZERO, DVec3::new(0.02, 0.0, 0.2), 0.062, 0.042), Part::SmallStem);
                let c = (q - DVec3::new(0.02, 0.0, 0.19)).rotate_y(0.15);
                let dome =
                    ellipsoid(c, if c.z > 0.0 { DVec3::new(0.15, 0.15, 0.15) } else { DVec3::new(0.15, 0.15, 0.04) });
                nearest.add(size * dome, Part::SmallCap);
            });
        }
        nearest.add_group(p, DVec3::new(-0.52, 0.34, -0.6), 0.36, |nearest| {
            let leaf = noise(p * 22.0, 9) * 0.018;
            let ball = |x, y, z, r| sphere(p - DVec3::new(x, y, z), r);
            let bush = blend(ball(-0.58, 0.28, -0.62, 0.15), ball(-0.46, 0.44, -0.60, 0.18), 0.05);
            nearest.add(bush.min(ball(-0.60, 0.42, -0.52, 0.12)) + leaf, Part::Bush);
        });
        nearest.add_group(p, DVec3::Z * GROUND, 0.85, |nearest| self.fence(p, nearest));
    }

    fn fence(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        // Pickets along the edge, with two rails between them.
        let angle = p.y.atan2(p.x);
        for (first, count) in [(3.38, 6), (-0.62, 5)] {
            let step = 0.155;
            let index = ((angle - first + PI).rem_euclid(2.0 * PI) - PI) / step;
            let index = index.round().clamp(0.0, f64::from(count - 1));
            let picket = p.rotate_z(-(first + step * index)) - DVec3::new(0.775, 0.0, GROUND + 0.09);
            let tip = (0.7 * (picket.y.abs() - 0.030 + (picket.z - 0.07).max(0.0) * 0.8))
                .max(picket.x.abs() - 0.014)
                .max(picket.z.abs() - 0.11);
            nearest.add(tip - 0.005, Part::Picket);
            let middle = first + 0.5 * step * f64::from(count - 1);
            let rail = p.rotate_z(-middle);
            let around = rail.y.atan2(rail.x).abs() - 0.5 * step * f64::from(count - 1);
            let beam = DVec2::new(p.truncate().length() - 0.765, (p.z - GROUND - 0.09).abs() - 0.035);
            nearest.add(rectangle(beam, DVec2::new(0.011, 0.014), 0.005).max(0.75 * around), Part::Picket);
        }
    }
}

impl Prop for Toadstool {
    type Part = Part;
    const DEPTH: u32 = 8;
    const HALF: f64 = 1.5;

    fn nearest(&self, position: DVec3) -> Nearest<Part> {
        let mut nearest = Nearest::new(f64::INFINITY, Part::Soil);
        self.ground(position, &mut nearest);
        self.house(position, &mut nearest);
        self.cap(position, &mut nearest);
        if position.z < GROUND + 0.40 + nearest.distance.max(0.0) {
            nearest.add_group(position, DVec3::Z * GROUND, 0.98, |nearest| self.garden(position, nearest));
        }
        nearest
    }

    fn material(&self, part: Part, p: DVec3) -> Material {
        match part {
            Part::Grass => {
                let light = 0.5 + 0.5 * noise(p * 7.0, 21) + 2.5 * (p.z - GROUND);
                Material::paint([0.28, 0.62, 0.17], 0.0).mixed([0.55, 0.80, 0.22], 0.75 * light)
            }
            Part::Soil => {
                let layer = (30.0 * p.z + 3.0 * noise(p * 4.0, 22)).sin();
                Material::paint([0.50, 0.31, 0.18], 0.0).mixed([0.38, 0.22, 0.13], 0.5 + 0.5 * layer)
            }
            Part::Stem => Material::paint([0.98, 0.91, 0.76], 0.0).mixed(
                [0.90, 0.76, 0.56],
                1.3 * (GROUND + 0.30 - p.z) + 0.15 * noise(p * DVec3::new(14.0, 14.0, 3.0), 23),
            ),
            Part::Skirt => Material::paint([1.0, 0.95, 0.83], 0.0),
            Part::Cap => {
                let q = (p - CAP).rotate_x(0.06);
                let under = smoothstep(0.0, -0.04, q.z);
                let deep = 0.4 * smoothstep(0.35, 0.0, q.z);
                Material::paint([0.90, 0.10, 0.10], 0.75 * (1.0 - under))
                    .mixed([0.72, 0.05, 0.12], deep)
                    .mixed([0.98, 0.84, 0.70], under)
            }
            Part::Spot => Material::paint([0.99, 0.97, 0.92], 0.4),
            Part::Door => Material::paint([0.05, 0.58, 0.66], 0.5)
                .shaded(1.0 - 0.06 * noise(p * DVec3::new(60.0, 60.0, 6.0), 24).abs()),
            Part::Wood => {
                Material::paint([0.52, 0.30, 0.15], 0.3).mixed([0.40, 0.22, 0.11], 0.5 + 0.5 * noise(p * 30.0, 25))
            }
            Part::Brass => Material::paint([0.98, 0.74, 0.14], 0.7),
            Part::Pane => Material::lamp([1.0, 0.83, 0.30], 0.45),
            Part::Stone => {
                Material::paint([0.64, 0.64, 0.70], 0.25).mixed([0.50, 0.50, 0.58], 0.5 + 0.5 * noise(p * 11.0, 26))
            }
            Part::Picket => Material::paint([0.97, 0.96, 0.93], 0.3),
            Part::SmallStem => Material::paint([0.98, 0.93, 0.80], 0.25),
            Part::SmallCap => {
                Material::paint([0.98, 0.62, 0.10], 0.7).mixed([0.90, 0.42, 0.06], 0.5 + 0.5 * noise(p * 10.0, 27))
            }
            Part::Petal(true) => Material::paint([0.58, 0.36, 0.86], 0.3),
            Part::Petal(false) => Material::paint([1.0, 0.97, 0.95], 0.3),
            Part::Stalk => Material::paint([0.30, 0.60, 0.20], 0.0),
            Part::Bush => {
                Material::paint([0.12, 0.46, 0.22], 0.0).mixed([0.25, 0.60, 0.25], 0.5 + 0.5 * noise(p * 18.0, 28))
            }
            Part::Roof => Material::paint([0.05, 0.55, 0.66], 0.5),
        }
    }
}
