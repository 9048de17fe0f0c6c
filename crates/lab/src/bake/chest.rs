//! A treasure chest on mossy flagstones.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, I64Vec3};

use super::{
    noise::{hash, noise, random},
    prop::Prop,
    sdf::*,
    shade::Material,
};

/// The chest, with the coins in and around it.
pub struct Chest {
    heaps: Vec<Heap>,
    pearls: Vec<DVec3>,
}

/// Coins within a ball.
struct Heap {
    center: DVec3,
    radius: f64,
    coins: Vec<Coin>,
}

/// A coin, and how it is turned.
struct Coin {
    center: DVec3,
    tilt: f64,
    turn: f64,
}

/// The parts of the chest, by material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    Stone,
    Moss,
    /// The boards, which run along x (true) or y.
    Wood(bool),
    Iron,
    Rivet,
    Brass,
    Dark,
    Velvet,
    Gold,
    Coin,
    Pearl,
    Ruby,
    Sapphire,
    Emerald,
}

/// The height of the flagstones.
const FLOOR: f64 = -0.72;
/// Half the size of the chest's body along x and y, and its height.
const HALF: DVec2 = DVec2::new(0.62, 0.40);
const HEIGHT: f64 = 0.56;
const RIM: f64 = FLOOR + HEIGHT;
/// The angle by which the lid is open.
const OPEN: f64 = 1.83;
/// The height of the lid's vault.
const VAULT: f64 = 0.31;
/// The thickness of the walls, the width of their boards, and the radius of a coin.
const WALL: f64 = 0.055;
const BOARD: f64 = 0.14;
const COIN: f64 = 0.080;
/// The largest distance of a coin from the center of its heap.
const REACH: f64 = 0.17;
const CROWN: DVec3 = DVec3::new(0.25, -0.02, RIM + 0.13);
/// Gems: their place, size, and how they are turned.
const GEMS: [(DVec3, f64, f64, Part); 6] = [
    (DVec3::new(-0.05, -0.20, RIM + 0.045), 0.105, 0.5, Part::Emerald),
    (DVec3::new(-0.34, 0.05, RIM + 0.05), 0.10, -0.6, Part::Sapphire),
    (DVec3::new(0.02, 0.10, RIM + 0.12), 0.10, 0.4, Part::Ruby),
    (DVec3::new(0.62, -0.60, FLOOR + 0.052), 0.095, 0.75, Part::Ruby),
    (DVec3::new(-0.66, -0.53, FLOOR + 0.05), 0.09, -0.8, Part::Emerald),
    (DVec3::new(0.47, -0.26, RIM + 0.01), 0.085, -0.4, Part::Sapphire),
];

/// The height of the treasure in the chest.
fn treasure(p: DVec3) -> f64 {
    let across = (p.truncate() / (HALF - WALL)).clamp(DVec2::splat(-1.0), DVec2::ONE);
    RIM - 0.10 + 0.18 * (1.0 - across.x * across.x) * (1.0 - across.y * across.y)
}

/// How much wider the chest is at a height than halfway up.
fn taper(z: f64) -> f64 {
    0.96 + 0.08 * ((z - FLOOR) / HEIGHT).clamp(0.0, 1.0)
}

impl Chest {
    /// Heaps up the coins.
    pub fn new() -> Self {
        let inner = HALF - WALL - 0.05;
        let in_chest = (0..230).map(|index| {
            let at = DVec2::new((0.754_877_67 * index as f64).fract(), (0.569_840_29 * index as f64).fract());
            let at = ((2.0 * at - 1.0) * inner).extend(0.0);
            Coin {
                center: at.with_z(treasure(at) + 0.035 * random(index, 1)),
                tilt: 0.75 * random(index, 2),
                turn: TAU * random(index, 3),
            }
        });
        let scattered = (0..26).map(|index| {
            let angle = -PI / 2.0 + 3.6 * (random(index, 4) - 0.5);
            let radius = 0.62 + 0.22 * random(index, 5);
            let at = DVec3::new(radius * 1.02 * angle.cos(), radius * angle.sin(), FLOOR + 0.018);
            Coin { center: at, tilt: 0.12 * random(index, 6), turn: TAU * random(index, 7) }
        });
        let outside = |coin: &Coin| coin.center.y < -0.49 || coin.center.x.abs() > 0.74;
        let stack = |at: DVec2, count: usize| {
            (0..count).map(move |index| {
                let shift = 0.02 * DVec2::from_angle(7.0 * random(index, 8));
                let height = FLOOR + 0.016 + 0.031 * index as f64;
                Coin { center: (at + shift).extend(height), tilt: 0.0, turn: 0.0 }
            })
        };
        let leaning = [
            Coin { center: DVec3::new(0.20, -0.50, FLOOR + 0.065), tilt: 1.15, turn: 1.45 },
            Coin { center: DVec3::new(-0.29, -0.51, FLOOR + 0.06), tilt: 1.1, turn: 1.8 },
        ];
        let mut heaps: Vec<Heap> = Vec::new();
        let coins = in_chest
            .chain(scattered.filter(outside))
            .chain(stack(DVec2::new(0.37, -0.62), 7))
            .chain(stack(DVec2::new(0.23, -0.69), 3))
            .chain(stack(DVec2::new(-0.76, 0.10), 4))
            .chain(leaning);
        for coin in coins {
            match heaps.iter_mut().find(|heap| heap.center.distance(coin.center) < REACH) {
                Some(heap) => heap.coins.push(coin),
                None => heaps.push(Heap { center: coin.center, radius: REACH + COIN + 0.01, coins: vec![coin] }),
            }
        }
        let pearls = (0..27)
            .map(|index| {
                let t = index as f64 / 26.0;
                let z = RIM + 0.03 - 0.33 * (PI * t).sin().powf(0.8);
                DVec3::new(-0.50 + 0.40 * t, -HALF.y * taper(z) - 0.040, z)
            })
            .collect();
        Self { heaps, pearls }
    }

    fn flagstones(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let slab = cylinder(p - DVec3::Z * (FLOOR - 0.10), 0.96, 0.14, 0.03);
        if slab > 0.08 {
            return nearest.add(slab - 0.02, Part::Stone);
        }
        let warp = p + 0.02 * DVec3::new(noise(p * 5.0, 31), noise(p * 5.0, 32), 0.0);
        let (r, angle) = (warp.truncate().length(), warp.y.atan2(warp.x));
        let ring = ((r / 0.235).floor()).min(3.0);
        let count = [1.0, 7.0, 12.0, 17.0][ring as usize];
        let sector = angle / TAU * count + 0.37 * ring;
        let in_ring = (r - 0.235 * ring).min(if ring < 3.0 { 0.235 * (ring + 1.0) - r } else { 1.0 });
        let in_sector = if ring > 0.0 { (0.5 - (sector - sector.floor() - 0.5).abs()) / count * TAU * r } else { 1.0 };
        let joint = if ring > 0.0 { in_ring.min(in_sector) } else { 0.235 - r };
        let stone = I64Vec3::new(ring as i64, sector.floor().rem_euclid(count) as i64, 0);
        let top = 0.020 * hash(stone, 33) + 0.006 * noise(p * 14.0, 34);
        let edge = if ring == 3.0 { 0.02 * hash(stone, 35) } else { 0.0 };
        let groove = 0.035 * smoothstep(0.030, 0.0, joint);
        let side = cylinder(p - DVec3::Z * (FLOOR - 0.10), 0.93 - edge - groove, 0.10 - top - groove, 0.03);
        nearest.add(0.85 * side + 0.006 * noise(p * 9.0, 36), Part::Stone);
        let clump = noise(p * 3.1, 37) + 0.5 * noise(p * 7.0, 38);
        let lush = 0.030 * smoothstep(0.05, 0.8, clump);
        let fuzz = 0.008 * noise(p * 34.0, 39);
        let moss = cylinder(p - DVec3::Z * (FLOOR - 0.115), 0.912 + 0.8 * lush, 0.105 + lush, 0.04);
        nearest.add(0.85 * (moss + fuzz), Part::Moss);
    }

    fn body(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let wide = taper(p.z);
        let q = DVec3::new(p.x / wide, p.y / wide, p.z - FLOOR - 0.5 * HEIGHT);
        let half = HALF.extend(0.5 * HEIGHT);
        let outer = 0.95 * cuboid(q, half, 0.012);
        if outer > 0.12 {
            return nearest.add(outer - 0.06, Part::Wood(true));
        }
        let cavity = cuboid(q - DVec3::Z * 0.1, half - DVec3::new(WALL, WALL, 0.06), 0.01);
        let board = ((p.z - FLOOR) / BOARD).fract() - 0.5;
        let groove = 0.012 * smoothstep(0.08, 0.0, 0.5 - board.abs());
        let along = q.x.abs() - half.x < q.y.abs() - half.y;
        nearest.add((outer + groove).max(-cavity), Part::Wood(along));
        let lining = (cavity.abs() - 0.008).max(q.z - 0.5 * HEIGHT + 0.012);
        nearest.add(lining, Part::Velvet);

        let plate = outer - 0.018;
        let straps = blend_cut(plate, (q.x.abs() - 0.33).abs() - 0.040, 0.012);
        let posts = (half.x - 0.055 - q.x.abs()).max(half.y - 0.055 - q.y.abs());
        let rim = (0.5 * HEIGHT - 0.050 - q.z).min(q.z + 0.5 * HEIGHT - 0.045);
        let frame = blend_cut(plate, posts.min(rim), 0.012);
        nearest.add(straps.min(frame).max(-cavity), Part::Iron);
        for z in [-0.17, 0.0, 0.17] {
            let front = DVec3::new((q.x.abs() - 0.33).abs(), q.y.abs() - half.y - 0.018, q.z - z);
            nearest.add(ellipsoid(front, DVec3::new(0.022, 0.016, 0.022)), Part::Rivet);
            let corner = DVec3::new(q.x.abs() - half.x + 0.027, q.y.abs() - half.y - 0.018, q.z - z);
            nearest.add(ellipsoid(corner, DVec3::new(0.018, 0.014, 0.018)), Part::Rivet);
            let side = DVec3::new(q.x.abs() - half.x - 0.018, q.y.abs() - half.y + 0.027, q.z - z);
            nearest.add(ellipsoid(side, DVec3::new(0.014, 0.018, 0.018)), Part::Rivet);
        }

        // The lock, and a ring on either side.
        let lock = p - DVec3::new(0.0, -HALF.y * 1.035 - 0.018, RIM - 0.135);
        let face = DVec2::new(lock.x, lock.z);
        let shield =
            blend_cut(rectangle(face, DVec2::new(0.115, 0.125), 0.03), (face + DVec2::Y * -0.07).length() - 0.20, 0.02);
        nearest.add(extrude(shield, lock.y, 0.028, 0.012), Part::Brass);
        let key = ((face - DVec2::Y * 0.005).length() - 0.026).min(rectangle(
            face + DVec2::Y * 0.045,
            DVec2::new(0.013, 0.045),
            0.004,
        ));
        nearest.add(extrude(key, lock.y, 0.032, 0.002), Part::Dark);
        for x in [-0.075, 0.075] {
            let nail = DVec3::new(lock.x - x, lock.y + 0.028, lock.z - 0.085);
            nearest.add(ellipsoid(nail, DVec3::new(0.016, 0.011, 0.016)), Part::Rivet);
        }
        let ear = DVec3::new(q.x.abs() - half.x - 0.028, q.y, q.z - 0.10);
        nearest.add(rod(ear, DVec3::Y * -0.085, DVec3::Y * 0.085, 0.030, 0.030), Part::Brass);
        let ring = (ear - DVec3::new(0.022, 0.0, -0.075)).rotate_y(PI / 2.0);
        nearest.add(torus(ring * DVec3::new(1.15, 1.0, 1.0), 0.085, 0.020) * 0.9, Part::Brass);
    }

    fn lid(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let hinge = DVec3::new(0.0, HALF.y * 1.04, RIM);
        let l = (p - hinge).rotate_x(OPEN) + DVec3::new(0.0, HALF.y * 1.04, 0.0);
        let half = HALF * 1.04;
        let stretch = half.y / VAULT;
        let vault = DVec2::new(l.y, l.z * stretch);
        let curve = (vault.length() - half.y) / (0.5 + 0.5 * stretch);
        let solid = |grow: f64| {
            let ends = blend_cut(curve - grow, l.x.abs() - half.x - grow, 0.012);
            blend_cut(ends, -l.z, 0.008)
        };
        let cavity = (curve + WALL).max(l.x.abs() - half.x + WALL);
        let around = vault.y.atan2(vault.x) * half.y / BOARD;
        let board = around - around.floor() - 0.5;
        let groove = 0.012 * smoothstep(0.08, 0.0, 0.5 - board.abs());
        let ends = l.x.abs() - half.x > curve;
        let board = l.z / BOARD - (l.z / BOARD).floor() - 0.5;
        let groove = if ends { 0.012 * smoothstep(0.08, 0.0, 0.5 - board.abs()) } else { groove };
        nearest.add(0.9 * (solid(0.0) + groove).max(-cavity), Part::Wood(!ends));

        // Quilted velvet, with a golden button where the seams cross.
        let (u, v) = (l.x / 0.085, vault.y.atan2(vault.x) * half.y / 0.085);
        let (a, b) = ((0.5 * PI * (u + v)).sin().abs(), (0.5 * PI * (u - v)).sin().abs());
        let puff = 0.016 * (a * b).sqrt();
        let lining = (cavity.abs() - 0.010 - puff).max(-l.z + 0.012);
        nearest.add(0.75 * lining, Part::Velvet);

        let plate = solid(0.018);
        let straps = blend_cut(plate, (l.x.abs() - 0.343).abs() - 0.040, 0.012);
        let frame = blend_cut(plate, (half.x - 0.055 - l.x.abs()).max(-0.055 - curve).min(l.z - 0.05), 0.012);
        nearest.add(0.9 * straps.min(frame).max(-cavity), Part::Iron);
        for index in 0..5 {
            let angle = PI * (f64::from(index) + 0.5) / 5.0;
            let (sin, cos) = angle.sin_cos();
            let at = DVec2::new(half.y * cos, VAULT * sin) * 1.045;
            for (x, radius) in [(0.343, 0.021), (half.x - 0.027, 0.018)] {
                let rivet = DVec3::new(l.x.abs() - x, l.y - at.x, l.z - at.y);
                nearest.add(sphere(rivet, radius), Part::Rivet);
            }
        }
        // The hasp.
        let hasp = l - DVec3::new(0.0, -half.y - 0.028, 0.03);
        let face = DVec2::new(hasp.x, hasp.z);
        let tongue = rectangle(face + DVec2::Y * 0.03, DVec2::new(0.055, 0.11), 0.05);
        nearest.add(extrude(tongue, hasp.y, 0.018, 0.008), Part::Brass);
        nearest.add(cuboid(hasp - DVec3::new(0.0, -0.02, -0.07), DVec3::new(0.014, 0.03, 0.03), 0.01), Part::Brass);
        // The hinges.
        for x in [-0.343, 0.343] {
            let barrel = p - hinge - DVec3::new(x, 0.022, 0.0);
            nearest.add(rod(barrel, DVec3::X * -0.055, DVec3::X * 0.055, 0.028, 0.028), Part::Iron);
        }
    }

    fn gold(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let inner = cuboid(p - DVec3::Z * RIM, (HALF - WALL + 0.01).extend(0.3), 0.01);
        let heap = 0.8 * (p.z - treasure(p) + 0.012 + 0.02 * noise(p * 16.0, 41));
        nearest.add(heap.max(inner).max(RIM - 0.2 - p.z), Part::Gold);
    }

    fn coins(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        for heap in &self.heaps {
            nearest.add_group(p, heap.center, heap.radius, |nearest| {
                for coin in &heap.coins {
                    let away = p - coin.center;
                    if away.length_squared() > (nearest.distance.max(0.0) + COIN + 0.02).powi(2) {
                        continue;
                    }
                    let c = away.rotate_z(coin.turn).rotate_x(coin.tilt);
                    let r = c.truncate().length();
                    let relief = 0.005 * smoothstep(0.066, 0.058, r) - 0.004 * smoothstep(0.036, 0.028, r);
                    nearest.add(0.95 * (cylinder(c, COIN, 0.0155, 0.006) + relief), Part::Coin);
                }
            });
        }
    }

    fn crown(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let c = (p - CROWN).rotate_x(0.34).rotate_y(-0.22);
        let (radius, count) = (0.175, 8);
        let (f, index) = fold(c, count);
        let flare = f.truncate().length() - radius - 0.25 * (c.z + 0.05);
        let share = (f.y.atan2(f.x) * count as f64 / PI).abs();
        let peak = c.z - 0.03 - 0.13 * (1.0 - share);
        let band = blend_cut(flare.abs() - 0.015, (0.62 * peak).max(-0.075 - c.z), 0.01);
        nearest.add(0.9 * band, Part::Gold);
        for z in [-0.065, 0.005] {
            nearest.add(torus(c - DVec3::Z * z, radius + 0.25 * (z + 0.05), 0.020), Part::Gold);
        }
        let tip = DVec3::new(radius + 0.25 * 0.21, 0.0, 0.165);
        nearest.add(sphere(f - tip, 0.026), Part::Pearl);
        let stone = f - DVec3::new(radius + 0.022, 0.0, -0.030);
        let gem = if index % 2 == 0 { Part::Ruby } else { Part::Sapphire };
        nearest.add(ellipsoid(stone, DVec3::new(0.016, 0.028, 0.026)), gem);
        let cap = ellipsoid(c + DVec3::Z * 0.02, DVec3::new(0.160, 0.160, 0.115));
        nearest.add(cap.max(-0.06 - c.z), Part::Velvet);
    }

    fn gems(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        for (index, &(center, size, tilt, part)) in GEMS.iter().enumerate() {
            nearest.add_group(p, center, 1.2 * size, |nearest| {
                let g = (p - center).rotate_y(tilt).rotate_x(0.3).rotate_z(index as f64);
                let (f, _) = fold(g, 8);
                let crown = 0.72 * f.x + 0.69 * f.z - 0.86 * size;
                let pavilion = 0.70 * f.x - 0.71 * f.z - 0.70 * size;
                nearest.add(crown.max(pavilion).max(f.z - 0.46 * size).max(f.x - 0.98 * size), part);
            });
        }
    }
}

impl Prop for Chest {
    type Part = Part;
    const DEPTH: u32 = 8;
    const HALF: f64 = 1.05;
    const CENTER: DVec3 = DVec3::new(0.0, 0.03, -0.15);
    const RADIUS: f64 = 1.18;

    fn nearest(&self, position: DVec3) -> Nearest<Part> {
        let mut nearest = Nearest::new(f64::INFINITY, Part::Stone);
        self.flagstones(position, &mut nearest);
        self.body(position, &mut nearest);
        nearest.add_group(position, DVec3::new(0.0, 0.50, RIM + 0.42), 0.88, |nearest| self.lid(position, nearest));
        nearest.add_group(position, DVec3::Z * RIM, 0.72, |nearest| self.gold(position, nearest));
        nearest.add_group(position, DVec3::new(0.0, 0.0, -0.4), 1.0, |nearest| self.coins(position, nearest));
        nearest.add_group(position, CROWN, 0.34, |nearest| self.crown(position, nearest));
        self.gems(position, &mut nearest);
        nearest.add_group(position, DVec3::new(-0.30, -0.45, RIM - 0.14), 0.32, |nearest| {
            for pearl in &self.pearls {
                nearest.add(sphere(position - *pearl, 0.026), Part::Pearl);
            }
        });
        nearest
    }

    fn material(&self, part: Part, p: DVec3) -> Material {
        match part {
            Part::Stone => {
                let stain = 0.5 + 0.5 * noise(p * 4.0, 51);
                let speckle = 0.10 * noise(p * 30.0, 52) + 0.06 * noise(p * 11.0, 53);
                Material::paint([0.47, 0.52, 0.64], 0.15).mixed([0.60, 0.62, 0.68], stain).shaded(1.0 + speckle)
            }
            Part::Moss => {
                let light = 0.5 + 0.5 * noise(p * 12.0, 54) + 0.3 * noise(p * 40.0, 55);
                Material::paint([0.20, 0.42, 0.08], 0.0).mixed([0.50, 0.68, 0.16], light)
            }
            Part::Wood(along) => {
                let stretch = if along { DVec3::new(2.2, 17.0, 17.0) } else { DVec3::new(17.0, 2.2, 17.0) };
                let board = I64Vec3::new(((p.z - FLOOR) / BOARD).floor() as i64, i64::from(along), 0);
                let bent = p + 0.05 * noise(p * 3.0, 56);
                let grain = noise(bent * stretch, 57) + 0.5 * noise(bent * stretch * 2.3, 58);
                let tone = 0.45 + 0.35 * grain + 0.5 * (hash(board, 59) - 0.5);
                Material::paint([0.10, 0.45, 0.62], 0.35).mixed([0.04, 0.22, 0.37], tone)
            }
            Part::Iron => {
                let worn = 0.5 + 0.5 * noise(p * 9.0, 60);
                Material { gloss: 0.5, ..Material::paint([0.20, 0.22, 0.29], 0.5).mixed([0.30, 0.32, 0.40], worn) }
            }
            Part::Rivet | Part::Brass => Material { gloss: 0.7, ..Material::metal([0.98, 0.74, 0.30]) },
            Part::Dark => Material::paint([0.05, 0.04, 0.05], 0.1),
            Part::Velvet => Material::paint([0.46, 0.08, 0.56], 0.1),
            Part::Gold | Part::Coin => Material { gloss: 0.75, ..Material::metal([1.0, 0.80, 0.26]) },
            Part::Pearl => Material::paint([0.97, 0.94, 0.92], 0.8),
            Part::Ruby => Material { glow: 0.10, ..Material::paint([0.90, 0.03, 0.14], 1.0) },
            Part::Sapphire => Material { glow: 0.10, ..Material::paint([0.08, 0.25, 0.92], 1.0) },
            Part::Emerald => Material { glow: 0.10, ..Material::paint([0.04, 0.68, 0.32], 1.0) },
        }
    }
}
