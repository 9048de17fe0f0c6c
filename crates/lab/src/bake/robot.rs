//! A tin robot.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{prop::Prop, sdf::*, shade::Material};

/// The robot.
pub struct Robot;

/// The parts of the robot, by material.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    Body,
    Trim,
    Steel,
    Dark,
    Eye,
    Pupil,
    Panel,
    Gauge,
    Needle,
    Knob(u8),
    Lamp,
}

/// The height of the floor under the feet.
const FLOOR: f64 = -0.90;

impl Robot {
    fn head(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let h = (p - DVec3::new(0.0, 0.0, 0.56)).rotate_z(0.10);
        nearest.add(cuboid(h, DVec3::new(0.31, 0.26, 0.235), 0.09), Part::Body);
        // A band over the crown, like a helmet's.
        nearest.add(cuboid(h, DVec3::new(0.055, 0.275, 0.25), 0.05), Part::Trim);
        // Face: a dark screen in a frame, with eyes and a grille.
        let face = h + DVec3::Y * 0.25;
        nearest.add(
            extrude(
                rectangle(DVec2::new(face.x, face.z - 0.035), DVec2::new(0.245, 0.125), 0.10),
                face.y,
                0.035,
                0.015,
            ),
            Part::Steel,
        );
        nearest.add(
            extrude(
                rectangle(DVec2::new(face.x, face.z - 0.035), DVec2::new(0.215, 0.095), 0.08),
                face.y,
                0.042,
                0.005,
            ),
            Part::Dark,
        );
        for x in [-0.11, 0.11] {
            let eye = (face - DVec3::new(x, -0.04, 0.035)).rotate_x(PI / 2.0);
            nearest.add(cylinder(eye, 0.072, 0.022, 0.015), Part::Eye);
            nearest.add(cylinder(eye - DVec3::new(0.012, 0.0, 0.0), 0.030, 0.034, 0.010), Part::Pupil);
        }
        for x in [-2.0, -1.0, 0.0, 1.0, 2.0] {
            nearest.add(
                rod(face, DVec3::new(0.046 * x, -0.01, -0.165), DVec3::new(0.046 * x, -0.01, -0.125), 0.017, 0.017),
                Part::Steel,
            );
        }
        // Ears and antennas.
        let ear = (h.with_x(h.x.abs()) - DVec3::X * 0.33).rotate_y(PI / 2.0);
        nearest.add(cylinder(ear, 0.105, 0.035, 0.02), Part::Trim);
        nearest.add(cylinder(ear - DVec3::Z * 0.04, 0.062, 0.035, 0.02), Part::Steel);
        let mast = DVec3::Z * 0.25;
        nearest.add(cylinder(h - mast, 0.075, 0.03, 0.015), Part::Steel);
        nearest.add(rod(h, mast, mast + DVec3::Z * 0.16, 0.016, 0.012), Part::Steel);
        nearest.add(sphere(h - mast - DVec3::Z * 0.19, 0.058), Part::Lamp);
    }

    fn torso(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let collar = cylinder(p - DVec3::Z * 0.295, 0.15 + 0.012 * (p.z * 130.0).sin(), 0.06, 0.01);
        nearest.add(0.8 * collar, Part::Dark);
        let taper = 1.0 + 0.14 * (p.z + 0.05);
        let body = cuboid(DVec3::new(p.x / taper, p.y / taper, p.z + 0.07), DVec3::new(0.40, 0.29, 0.33), 0.09);
        nearest.add(0.93 * body, Part::Body);
        for z in [0.215, -0.345] {
            let ring = cuboid(DVec3::new(p.x / taper, p.y / taper, p.z - z), DVec3::new(0.412, 0.302, 0.032), 0.03);
            nearest.add(0.93 * ring, Part::Trim);
        }
        let f = p - DVec3::new(0.0, -0.285, -0.06);
        nearest.add(
            extrude(rectangle(f.with_y(f.z).truncate(), DVec2::new(0.29, 0.20), 0.05), f.y, 0.042, 0.02),
            Part::Steel,
        );
        nearest.add(
            extrude(rectangle(f.with_y(f.z).truncate(), DVec2::new(0.262, 0.172), 0.035), f.y, 0.048, 0.006),
            Part::Panel,
        );
        // A gauge, knobs and a row of lamps.
        let g = (f - DVec3::new(-0.115, -0.05, 0.035)).rotate_x(PI / 2.0);
        nearest.add(cylinder(g, 0.112, 0.022, 0.012), Part::Steel);
        nearest.add(cylinder(g, 0.092, 0.026, 0.004), Part::Gauge);
        let dial = g.rotate_z(0.7);
        nearest.add(
            extrude(
                rectangle(dial.truncate() - DVec2::X * 0.03, DVec2::new(0.045, 0.010), 0.004),
                dial.z,
                0.036,
                0.004,
            ),
            Part::Needle,
        );
        for (index, (x, z)) in [(0.07, 0.10), (0.19, 0.10), (0.07, -0.02), (0.19, -0.02)].into_iter().enumerate() {
            let knob = (f - DVec3::new(x, -0.06, z)).rotate_x(PI / 2.0);
            nearest.add(cylinder(knob, 0.042, 0.024, 0.014), Part::Knob(index as u8));
        }
        for index in 0..5 {
            let x = -0.20 + 0.10 * f64::from(index);
            nearest.add(sphere(f - DVec3::new(x, -0.045, -0.125), 0.028), Part::Knob((index % 3) as u8));
        }
        // The wind-up key, on the back.
        let key = p - DVec3::new(0.0, 0.43, 0.0);
        nearest.add(rod(p, DVec3::new(0.0, 0.25, 0.0), DVec3::new(0.0, 0.45, 0.0), 0.032, 0.032), Part::Steel);
        let loops = (key.with_x(key.x.abs()) - DVec3::new(0.10, 0.02, 0.0)).rotate_x(PI / 2.0);
        nearest.add(torus(loops, 0.075, 0.030), Part::Gauge);
        // Rivets.
        let corner = DVec3::new(p.x.abs() - 0.345 * taper, p.y + 0.285 * taper, (p.z + 0.065).abs() - 0.20);
        nearest.add(sphere(corner, 0.022), Part::Steel);
    }

    /// The left arm or, mirrored, the right; lifted sideways by `lift` and forward by `reach`.
    fn arm(&self, p: DVec3, lift: f64, reach: f64, nearest: &mut Nearest<Part>) {
        let shoulder = DVec3::new(0.47, 0.0, 0.12);
        nearest.add(sphere(p - shoulder, 0.115), Part::Trim);
        let a = (p - shoulder).rotate_y(lift).rotate_x(-reach);
        let wave = 0.014 * (a.z * 95.0).sin();
        nearest.add(
            0.75 * (rod(a, DVec3::new(0.03, 0.0, -0.08), DVec3::new(0.03, 0.0, -0.32), 0.068, 0.068) + wave),
            Part::Dark,
        );
        let wrist = a - DVec3::new(0.03, 0.0, -0.37);
        nearest.add(cylinder(wrist, 0.105, 0.065, 0.025), Part::Body);
        nearest.add(cylinder(wrist + DVec3::Z * 0.065, 0.085, 0.02, 0.01), Part::Steel);
        // A claw, open at the bottom.
        let claw = (wrist + DVec3::Z * 0.16).rotate_x(PI / 2.0);
        let gap = DVec2::new(claw.x.abs() - 0.062, claw.y - 0.05);
        let ring = torus(claw, 0.088, 0.036);
        nearest.add(
            ring.max(
                gap.x.min(0.0).max(-0.062 - gap.x).max(0.0) - if claw.y > 0.0 { claw.x.abs() - 0.055 } else { 1.0 },
            ),
            Part::Trim,
        );
    }

    fn legs(&self, p: DVec3, nearest: &mut Nearest<Part>) {
        let l = p.with_x(p.x.abs()) - DVec3::new(0.20, 0.0, 0.0);
        let wave = 0.014 * (p.z * 90.0).sin();
        nearest.add(
            0.75 * (rod(l, DVec3::new(0.0, 0.0, -0.40), DVec3::new(0.0, 0.0, -0.68), 0.092, 0.092) + wave),
            Part::Dark,
        );
        let boot = l - DVec3::new(0.01, -0.05, FLOOR + 0.115);
        let toe = blend(
            cuboid(boot - DVec3::Z * -0.03, DVec3::new(0.165, 0.235, 0.085), 0.07),
            cylinder(boot - DVec3::new(-0.01, 0.05, 0.06), 0.14, 0.09, 0.05),
            0.06,
        );
        nearest.add(toe, Part::Body);
        nearest.add(cuboid(boot + DVec3::Z * 0.09, DVec3::new(0.178, 0.248, 0.028), 0.026), Part::Trim);
    }
}

impl Prop for Robot {
    type Part = Part;
    const DEPTH: u32 = 8;
    const HALF: f64 = 1.15;

    fn nearest(&self, position: DVec3) -> Nearest<Part> {
        let mut nearest = Nearest::new(f64::INFINITY, Part::Body);
        nearest.add_group(position, DVec3::new(0.0, 0.0, -0.06), 0.66, |nearest| self.torso(position, nearest));
        nearest.add_group(position, DVec3::new(0.0, -0.02, 0.64), 0.52, |nearest| self.head(position, nearest));
        nearest.add_group(position, DVec3::new(0.0, -0.05, -0.68), 0.54, |nearest| self.legs(position, nearest));
        let mirrored = position.with_x(-position.x);
        nearest.add_group(position, DVec3::new(0.55, -0.1, -0.12), 0.56, |nearest| {
            self.arm(position, 0.16, 0.55, nearest)
        });
        nearest.add_group(position, DVec3::new(-0.65, -0.1, 0.30), 0.60, |nearest| {
            self.arm(mirrored, 2.45, 0.25, nearest)
        });
        nearest
    }

    fn material(&self, part: Part, _position: DVec3) -> Material {
        match part {
            Part::Body => Material::paint([0.06, 0.69, 0.71], 0.9),
            Part::Trim => Material::paint([1.0, 0.55, 0.10], 0.8),
            Part::Steel => Material::metal([0.88, 0.89, 0.92]),
            Part::Dark => Material::paint([0.17, 0.18, 0.26], 0.5),
            Part::Eye => Material::lamp([1.0, 0.90, 0.35], 0.35),
            Part::Pupil => Material::paint([0.10, 0.10, 0.16], 0.8),
            Part::Panel => Material::paint([0.98, 0.93, 0.80], 0.4),
            Part::Gauge => Material::paint([1.0, 0.80, 0.16], 0.6),
            Part::Needle => Material::paint([0.85, 0.08, 0.12], 0.4),
            Part::Knob(0) => Material::lamp([0.92, 0.10, 0.14], 0.1),
            Part::Knob(1) => Material::lamp([0.98, 0.78, 0.12], 0.1),
            Part::Knob(2) => Material::lamp([0.20, 0.70, 0.28], 0.1),
            Part::Knob(_) => Material::paint([0.22, 0.32, 0.72], 0.7),
            Part::Lamp => Material::lamp([0.95, 0.12, 0.16], 0.25),
        }
    }
}
