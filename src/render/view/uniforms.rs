//! What `view.wgsl` declares.

use bevy::{prelude::*, render::render_resource::ShaderType};

use super::rays::Rays;
use crate::{
    posterize::{MAX_BLEND_STEPS, MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS, Posterize},
    prop::SolidOpacity,
    quality::PropQuality,
    render::extract::{ExtractedPosterize, ExtractedProp},
};

/// `Prop` of `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
pub(super) struct PropUniform {
    clip_from_box: Mat4,
    origin: Mat3,
    direction: Mat3,
    scale: Vec3,
    mirrored: u32,
    low: Vec3,
    colors: u32,
    high: Vec3,
    first_color: u32,
    blend_steps: u32,
    softness: f32,
    min_opacity: f32,
    iterations: u32,
    radius: i32,
    spatial_falloff: f32,
    range_falloff: f32,
    reference: Vec2,
    near: f32,
    solid_transmittance: f32,
}

impl PropUniform {
    pub fn new(prop: &ExtractedProp, rays: &Rays, quality: &PropQuality) -> Self {
        let matrix =
            |columns: [glam::DVec3; 3]| Mat3::from_cols_array_2d(&columns.map(|column| column.as_vec3().into()));
        Self {
            clip_from_box: rays.clip_from_box.as_mat4(),
            origin: matrix(rays.origin),
            direction: matrix(rays.direction),
            scale: prop.placement.frame.scale.as_vec3(),
            mirrored: u32::from(rays.mirrored),
            low: rays.low.as_vec3(),
            high: rays.high.as_vec3(),
            reference: rays.reference.as_vec2(),
            near: rays.near as f32,
            solid_transmittance: solid_transmittance(prop.solid, quality),
            ..Self::posterize(prop.posterize, quality)
        }
    }

    /// How something is posterized that is no prop.
    pub fn posterize(posterize: Option<ExtractedPosterize>, quality: &PropQuality) -> Self {
        let settings = sound(posterize.map(|posterize| posterize.settings).unwrap_or_default());
        let falloff = |sigma: f32| 0.5 / (sigma * sigma);
        Self {
            colors: posterize.map_or(0, |posterize| posterize.colors),
            first_color: posterize.map_or(0, |posterize| posterize.first_color),
            blend_steps: settings.blend_steps,
            softness: settings.softness,
            min_opacity: settings.min_opacity,
            iterations: settings.filter.iterations.min(quality.filter_iterations),
            radius: settings.filter.radius.min(quality.filter_radius) as i32,
            spatial_falloff: falloff(settings.filter.spatial_sigma),
            range_falloff: falloff(settings.filter.range_sigma),
            ..default()
        }
    }

    /// How often the filter runs for it.
    pub fn filtered(&self) -> u32 {
        if self.colors > 0 { self.iterations } else { 0 }
    }
}

/// `View` of `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
pub(super) struct ViewUniform {
    pub corner: UVec2,
    pub size: UVec2,
    pub depth: Vec4,
    pub exposure: f32,
    pub everything: u32,
    pub pixel: Vec2,
    pub stop_transmittance: f32,
    pub min_weight: f32,
}

/// The transmittance at which a prop is solid; a ray that ends there is solid too. Negative for never.
fn solid_transmittance(solid: SolidOpacity, quality: &PropQuality) -> f32 {
    match solid {
        SolidOpacity::At(opacity) => (1.0 - opacity.clamp(0.0, 1.0)).max(quality.stop_transmittance),
        SolidOpacity::Never => -1.0,
    }
}

/// Clamps every setting to its valid range, so that no shader divides by zero or loops for long.
fn sound(posterize: Posterize) -> Posterize {
    let Posterize { blend_steps, softness, min_opacity, mut filter } = posterize;
    filter.iterations = filter.iterations.min(MAX_FILTER_ITERATIONS);
    filter.radius = filter.radius.min(MAX_FILTER_RADIUS);
    // f32::max takes the other one for NaN.
    filter.spatial_sigma = filter.spatial_sigma.max(1e-3);
    filter.range_sigma = filter.range_sigma.max(1e-3);
    Posterize {
        blend_steps: blend_steps.clamp(1, MAX_BLEND_STEPS),
        softness: softness.max(0.0),
        min_opacity: min_opacity.max(0.0),
        filter,
    }
}
