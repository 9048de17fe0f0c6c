//! A gumball machine: clear glass with balls of every color behind it.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{
    noise::random,
    prop::{Glass, Prop},
    sdf::*,
    shade::Material,
};

/// The machine, with its balls in place.
pub struct Gumballs {
    balls: Vec<DVec3>,
}

/// The parts of the machine, by material.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    Body,
    Trim,
    Steel,
    Dark,
    Label,
    Ball(usize),
}

/// The center and the radius of the globe.
const GLOBE: DVec3 = DVec3::new(0.0, 0.0, 0.26);
const RADIUS: f64 = 0.56;
const BALL: f64 = 0.108;
/// The height up to which the balls lie.
const FILL: f64 = 0.46;
const COLORS: [[f64; 3]; 6] = [
    [0.93, 0.10, 0.14],
    [1.00, 0.80, 0.10],
    [0.20, 0.68, 0.25],
    [1.00, 0.50, 0.08],
    [0.98, 0.42, 0.66],
    [0.98, 0.96, 0.92],
];

impl Gumballs {
    /// Creates the machine and fills the globe.
    pub fn new() -> Self {
        // Balls lie along the glass, then on top, packed as closely as possible.
        let ring = RADIUS - BALL - 0.035;
        let shell = (0..900).map(|index| {
            let z = -0.95 + 1.95 * index as f64 / 900.0;
            let angle = 2.399_963 * index as f64;
            let r = (1.0 - z * z).max(0.0).sqrt();
            GLOBE + ring * DVec3::new(r * angle.cos(), r * angle.sin(), z)
        });
        let heap = (0..900).map(|index| {
            let (angle, r) = (2.399_963 * index as f64, 0.36 * (index as f64 / 900.0).sqrt());
            let lift = 0.07 * random(index, 1) + 0.06 * (1.0 - r / 0.36);
            DVec3::new(r * angle.cos(), r * angle.sin(), FILL - 0.04 + lift)
        });
        // Balls farther inside show between those in front.
        let behind = shell.clone().map(|ball| GLOBE + 0.68 * (ball - GLOBE));
        let mut balls: Vec<DVec3> = Vec::new();
        for ball in shell.filter(|ball| ball.z < FILL).chain(heap).chain(behind.filter(|ball| ball.z < FILL - 0.06)) {
            let apart = if ball.distance(GLOBE) < 0.8 * ring { 1.5 } else { 1.9 };
            if balls.iter().all(|other| other.distance(ball) > apart * BALL) {
                balls.push(ball);
            }
        }
        Self { balls }
    }

    fn globe(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let g = p - GLOBE;
        for (index, ball) in self.balls.iter().enumerate() {
            nearest.add(sphere(p - *ball, BALL), Part::Ball(index % COLORS.len()));
        }
        // One large ball stands in for those inside, which are not visible.
        nearest.add(sphere(g, RADIUS - 0.30).max(p.z - FILL + 0.12), Part::Dark);
        let lid = g - DVec3::Z * (RADIUS - 0.07);
        nearest.add(cylinder(lid, 0.285, 0.038, 0.025), Part::Trim);
        let dome = ellipsoid(lid - DVec3::Z * 0.03, DVec3::new(0.25, 0.25, 0.13)).max(0.02 - lid.z);
        nearest.add(dome, Part::Body);
        nearest.add(sphere(lid - DVec3::Z * 0.195, 0.058), Part::Trim);
    }

    fn machine(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let r = p.truncate().length();
        // Collar, tapered body, foot.
        nearest.add(cylinder(p + DVec3::Z * 0.22, 0.40, 0.050, 0.03), Part::Trim);
        let side = 0.96 * (r - (0.37 - 0.22 * (p.z + 0.25)).min(0.52));
        nearest.add(blend_cut(side, (p.z + 0.51).abs() - 0.27, 0.05), Part::Body);
        nearest.add(cylinder(p + DVec3::Z * 0.785, 0.56, 0.035, 0.03), Part::Trim);
        let foot = rectangle(DVec2::new(r, p.z + 0.86), DVec2::new(0.66, 0.05), 0.045);
        nearest.add(foot, Part::Body);

        // The front plate with the crank and the coin slot, and the chute below.
        let tilt = (p - DVec3::new(0.0, -0.425, -0.42)).rotate_x(-0.20);
        nearest.add(
            extrude(rectangle(tilt.with_y(tilt.z).truncate(), DVec2::new(0.185, 0.135), 0.05), tilt.y, 0.035, 0.015),
            Part::Steel,
        );
        let crank = (tilt - DVec3::new(0.03, -0.05, -0.01)).rotate_x(PI / 2.0);
        nearest.add(cylinder(crank, 0.088, 0.025, 0.012), Part::Trim);
        let handle = crank.rotate_z(-0.5) - DVec3::Z * 0.05;
        nearest.add(cuboid(handle, DVec3::new(0.080, 0.022, 0.035), 0.018), Part::Steel);
        nearest
            .add(cuboid(tilt - DVec3::new(-0.125, -0.035, 0.02), DVec3::new(0.010, 0.008, 0.055), 0.004), Part::Dark);
        let chute = (p - DVec3::new(0.0, -0.49, -0.70)).rotate_x(-0.20);
        let mouth = chute.with_y(chute.z + 0.03).truncate();
        nearest.add(extrude(arch(mouth, 0.125, 0.07), chute.y, 0.065, 0.02), Part::Steel);
        nearest.add(extrude(arch(mouth - DVec2::Y * 0.015, 0.090, 0.055), chute.y + 0.02, 0.052, 0.003), Part::Dark);
        nearest.add(sphere(p - DVec3::new(0.02, -0.585, -0.675), 0.062), Part::Ball(0));

        // A star on either side.
        for side in [-1.0, 1.0] {
            let s = p.rotate_z(-side * 1.25) - DVec3::new(0.0, -0.435, -0.50);
            let s = s.rotate_x(-0.20).rotate_x(PI / 2.0);
            let (point, _) = fold(s.rotate_z(-PI / 2.0), 5);
            let star = (point.x - 0.13) * 0.35 + point.y.abs() * 0.936;
            nearest.add(extrude(star, s.z, 0.028, 0.01), Part::Label);
        }
    }
}

impl Prop for Gumballs {
    type Part = Part;
    const DEPTH: u32 = 8;
    const HALF: f64 = 1.6;

    fn nearest(&self, position: DVec3) -> Nearest<Part> {
        let mut nearest = Nearest::new(f64::INFINITY, Part::Body);
        nearest.add_group(position, DVec3::new(0.0, 0.0, -0.55), 0.77, |nearest| self.machine(position, nearest));
        nearest.add_group(position, GLOBE + DVec3::Z * 0.09, 0.66, |nearest| self.globe(position, nearest));
        nearest
    }

    fn material(&self, part: Part, _position: DVec3) -> Material {
        match part {
            Part::Body => Material::paint([0.16, 0.30, 0.80], 0.9),
            Part::Trim => Material::paint([1.0, 0.76, 0.14], 0.9),
            Part::Steel => Material::metal([0.88, 0.89, 0.92]),
            Part::Dark => Material::paint([0.14, 0.13, 0.20], 0.2),
            Part::Label => Material::paint([0.98, 0.96, 0.92], 0.5),
            Part::Ball(kind) => Material::paint(COLORS[kind], 0.8),
        }
    }

    fn glass(&self, position: DVec3) -> Option<Glass> {
        let away = position - GLOBE;
        let pane = (away.length() - RADIUS).abs() - 0.013;
        Some(Glass {
            distance: pane.max(away.z - RADIUS + 0.08).max(-0.45 - away.z),
            density: 5.0,
            normal: away.normalize_or(DVec3::Z),
            material: Material::paint([0.82, 0.92, 0.97], 1.0),
        })
    }
}
