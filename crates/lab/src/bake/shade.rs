//! The studio in which props are photographed: a warm key light, a bright sky, and the materials that they light.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use plenoctree::{
    sphere::spiral,
    srgb::{decode, encode},
};

use super::sdf::smoothstep;

/// The material of a prop at a point of its surface.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// The color of the paint or the tint of the metal, in encoded sRGB.
    pub color: DVec3,
    /// How much the surface reflects, and how tight its highlights are: 0 is chalk, 1 is lacquer.
    pub gloss: f64,
    /// The share of metal, from 0 to 1. Metal has no paint and only reflects.
    pub metal: f64,
    /// The light that the surface emits, as a share of its color.
    pub glow: f64,
}

impl Material {
    /// Returns paint of a color (encoded sRGB) and a gloss.
    pub fn paint(color: [f64; 3], gloss: f64) -> Self {
        Self { color: DVec3::from_array(color), gloss, metal: 0.0, glow: 0.0 }
    }

    /// Returns polished metal of a tint (encoded sRGB).
    pub fn metal(color: [f64; 3]) -> Self {
        Self { metal: 1.0, ..Self::paint(color, 0.9) }
    }

    /// Returns the material of a lit pane or lamp.
    pub fn lamp(color: [f64; 3], glow: f64) -> Self {
        Self { glow, ..Self::paint(color, 0.6) }
    }

    /// Returns the mean of materials that meet within a cell.
    pub fn mean<const N: usize>(materials: [Self; N]) -> Self {
        let share = 1.0 / N as f64;
        materials.iter().fold(Self { color: DVec3::ZERO, gloss: 0.0, metal: 0.0, glow: 0.0 }, |sum, material| Self {
            color: sum.color + share * material.color,
            gloss: sum.gloss + share * material.gloss,
            metal: sum.metal + share * material.metal,
            glow: sum.glow + share * material.glow,
        })
    }

    /// Returns the same material, lighter or darker.
    pub fn shaded(mut self, factor: f64) -> Self {
        self.color *= factor;
        self
    }

    /// Returns the same material, with its color mixed with another one (encoded sRGB).
    pub fn mixed(mut self, color: [f64; 3], share: f64) -> Self {
        self.color = self.color.lerp(DVec3::from_array(color), share.clamp(0.0, 1.0));
        self
    }

    /// Returns the light that the surface emits, and that of the key light which it reflects to the eye, if `lit`.
    pub fn reflected(&self, normal: DVec3, eye: DVec3, key: DVec3, lit: bool) -> DVec3 {
        let albedo = self.color.map(decode);
        let glow = self.glow * albedo;
        let lambert = normal.dot(key).max(0.0);
        if !lit {
            return glow;
        }
        let half = (eye + key).normalize_or(normal);
        let fresnel = self.fresnel(albedo, eye.dot(half));
        let power = self.power();
        let highlight = (power + 2.0) / 8.0 * half.dot(normal).max(0.0).powf(power);
        let matte = (1.0 - self.metal) * albedo * (1.0 - fresnel);
        glow + (matte + highlight * fresnel) * lambert * KEY_SUN
    }

    /// Returns a random direction in which light that goes to the eye may have arrived, and the share of it that does.
    pub fn bounce(&self, normal: DVec3, eye: DVec3, random: [f64; 3]) -> (DVec3, DVec3) {
        let albedo = self.color.map(decode);
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let around = |z: f64| {
            let r = (1.0 - z * z).max(0.0).sqrt();
            let (sin, cos) = (TAU * random[1]).sin_cos();
            r * cos * tangent + r * sin * bitangent + z * normal
        };
        let fresnel = self.fresnel(albedo, eye.dot(normal));
        let glossy = if self.metal == 1.0 { 1.0 } else { fresnel.max_element().clamp(0.1, 0.9) };
        if random[2] < glossy {
            let half = around(random[0].powf(1.0 / (self.power() + 1.0)));
            let direction = 2.0 * eye.dot(half) * half - eye;
            let away = direction.dot(normal);
            let direction = if away < 0.0 { direction - 2.0 * away * normal } else { direction };
            (direction, fresnel / glossy)
        } else {
            (around(random[0].sqrt()), (1.0 - self.metal) * albedo * (1.0 - fresnel) / (1.0 - glossy))
        }
    }

    /// Returns the share of light that is reflected as by a mirror.
    fn fresnel(&self, albedo: DVec3, cosine: f64) -> DVec3 {
        let mirror = DVec3::splat(0.05 * self.gloss).lerp(albedo, self.metal);
        mirror + (self.gloss * (1.0 - mirror)).max(DVec3::ZERO) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
    }

    /// Returns the exponent of highlights: the higher, the tighter.
    fn power(&self) -> f64 {
        6.0 + 70.0 * self.gloss * self.gloss
    }
}

/// The direction toward the key light.
const KEY: DVec3 = DVec3::new(-0.50, -0.56, 0.66);
const KEY_LIGHT: DVec3 = DVec3::new(0.78, 0.72, 0.62);
/// The light of the key light on a surface that faces it, in path-traced pictures.
const KEY_SUN: DVec3 = DVec3::new(1.10, 0.98, 0.80);
/// The brightness of the surroundings there, relative to what glossy surfaces reflect otherwise.
const SKYLIGHT: f64 = 0.8;
const SKY: DVec3 = DVec3::new(0.43, 0.47, 0.54);
const FLOOR: DVec3 = DVec3::new(0.27, 0.25, 0.24);

/// A point of a lit surface, which can be seen from any direction.
pub struct LitPoint {
    material: Material,
    normal: DVec3,
    key: DVec3,
    shadow: f64,
    open: f64,
}

impl LitPoint {
    /// Lights `point`, whose surface has the `normal`. `distance` returns the signed distance to the whole prop.
    pub fn new(material: Material, point: DVec3, normal: DVec3, distance: impl Fn(DVec3) -> f64) -> Self {
        let key = KEY.normalize();
        let shadow = if normal.dot(key) > -0.1 { shadow(point + 0.02 * normal, key, &distance) } else { 0.0 };
        let open = openness(point, normal, &distance);
        Self { material, normal, key, shadow, open }
    }

    /// Returns the radiance along `direction`, from the eye into the scene, in encoded sRGB.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let Material { color, gloss, metal, glow } = self.material;
        let albedo = color.map(decode);
        // A surface is never seen from behind, so any radiance will do there. Mirroring the eye is smoothest.
        let eye = -direction;
        let eye = if eye.dot(self.normal) < 0.0 { eye - 2.0 * eye.dot(self.normal) * self.normal } else { eye };

        let half = (eye + self.key).normalize_or(self.normal);
        let facing = 1.0 - eye.dot(self.normal).clamp(0.0, 1.0);
        let mirror = DVec3::splat(0.05 * gloss.sqrt()).lerp(albedo, metal);
        let fresnel = mirror + (0.6 * gloss * (1.0 - mirror).max(DVec3::ZERO)) * facing.powi(4);
        let power = 6.0 + 70.0 * gloss * gloss;
        let highlight = (power + 2.0) / 8.0 * half.dot(self.normal).max(0.0).powf(power);
        let lambert = self.normal.dot(self.key).max(0.0);
        let mirrored = 2.0 * eye.dot(self.normal) * self.normal - eye;
        let seen = surroundings(mirrored) * (0.25 + 0.75 * self.open);
        let seen = (0.6 + 0.4 * metal) * seen;
        let glossy = fresnel * gloss * (seen + 2.6 * highlight * lambert * self.shadow * KEY_LIGHT);

        // Light that bounces between walls takes on their color, which makes corners saturated instead of gray.
        let open = DVec3::splat(self.open) / (1.0 - 0.8 * albedo * (1.0 - self.open));
        let ambient = FLOOR.lerp(SKY, 0.5 + 0.5 * self.normal.z) * open;
        let matte = albedo * (ambient + lambert * self.shadow * KEY_LIGHT);
        let sum = (1.0 - metal) * matte * (1.0 - fresnel) + glossy;
        (sum + glow * albedo).map(|light| encode(shoulder(light).max(0.0)))
    }
}

/// Returns a direction toward a point of the key light, which is a disk.
pub fn toward_key(point: DVec2) -> DVec3 {
    let key = KEY.normalize();
    let (tangent, bitangent) = key.any_orthonormal_pair();
    (key + 0.12 * (point.x * tangent + point.y * bitangent)).normalize()
}

/// Returns the light that arrives from a direction in which there is nothing.
pub fn sky(direction: DVec3) -> DVec3 {
    SKYLIGHT * surroundings(direction)
}

/// Returns how bright light is in a picture, in encoded sRGB.
pub fn expose(light: f64) -> f64 {
    encode(shoulder(light).max(0.0)).clamp(0.0, 1.0)
}

/// Returns what a mirror reflects: a bright sky with the key light's glow in it, a dark floor, and two tall lamps.
fn surroundings(direction: DVec3) -> DVec3 {
    let up = direction.z;
    let sky = DVec3::ONE.lerp(DVec3::new(0.36, 0.50, 0.72), smoothstep(0.1, 0.8, up));
    let floor = DVec3::new(0.24, 0.23, 0.26).lerp(DVec3::new(0.07, 0.07, 0.09), smoothstep(0.0, -0.7, up));
    let glow = 0.8 * direction.dot(KEY.normalize()).max(0.0).powi(6);
    let around = direction.truncate().normalize_or_zero();
    let lamp = |x: f64, y: f64| smoothstep(0.88, 0.99, around.dot(DVec2::new(x, y))) * smoothstep(0.9, 0.6, up.abs());
    let lamps = 4.5 * lamp(-0.86, -0.51) + 1.4 * lamp(0.87, 0.50);
    floor.lerp(sky, smoothstep(-0.12, 0.08, up)) + (glow + lamps) * KEY_LIGHT
}

/// Returns how much of the key light reaches `point`, from 0 to 1. The penumbra widens with the distance to the
/// occluder.
fn shadow(point: DVec3, toward: DVec3, distance: &impl Fn(DVec3) -> f64) -> f64 {
    let (mut light, mut t) = (1.0_f64, 0.015);
    for _ in 0..48 {
        let free = distance(point + t * toward);
        light = light.min(0.5 + 0.5 * 9.0 * free / t);
        if light <= 0.0 {
            return 0.0;
        }
        t += free.clamp(0.012, 0.12);
        if t > 2.2 {
            break;
        }
    }
    smoothstep(0.0, 1.0, light)
}

/// Returns how much of the sky and floor a point sees, from 0 to 1: cones over the hemisphere, weighted by the cosine.
fn openness(point: DVec3, normal: DVec3, distance: &impl Fn(DVec3) -> f64) -> f64 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (mut sum, mut total) = (0.0, 0.0);
    for local in spiral(14, [0.0, 1.0]) {
        let direction = local.x * tangent + local.y * bitangent + local.z * normal;
        let (mut free, mut t) = (1.0_f64, 0.025);
        while t < 0.75 {
            let gap = distance(point + t * direction);
            free = free.min(0.15 + gap / (0.45 * t));
            if free <= 0.0 {
                break;
            }
            t += gap.max(0.5 * t);
        }
        sum += local.z * free.clamp(0.0, 1.0);
        total += local.z;
    }
    sum / total
}

/// Leaves the lower half unchanged and compresses the rest, so that nothing burns out.
fn shoulder(light: f64) -> f64 {
    const KNEE: f64 = 0.55;
    if light < KNEE { light } else { KNEE + (0.97 - KNEE) * (1.0 - (-(light - KNEE) / (0.97 - KNEE)).exp()) }
}
