//! The uniforms that `view.wgsl` declares.

use bevy::{prelude::*, render::render_resource::ShaderType};
use glam::DMat4;

use crate::{
    posterize::EdgeSmoothing,
    prop::SolidOpacity,
    quality::PropQuality,
    render::{
        extract::{ExtractedPosterize, ExtractedProp},
        rays::Rays,
    },
};

/// Matches `Prop` in `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(in crate::render) struct PropUniform {
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
    tint: Vec3,
    smooths_edges: u32,
    previous_from_clip: Mat4,
}

impl PropUniform {
    pub fn new(prop: &ExtractedProp, rays: &Rays, previous_from_clip: DMat4, quality: &PropQuality) -> Self {
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
            tint: prop.tint,
            previous_from_clip: previous_from_clip.as_mat4(),
            ..Self::posterize(prop.posterize, quality)
        }
    }

    /// Creates the uniform of a caster, which has only what rays through its densities need.
    #[cfg(feature = "shadows")]
    pub fn caster(prop: &ExtractedProp, rays: &Rays) -> Self {
        let whole = Self::new(prop, rays, DMat4::IDENTITY, &PropQuality::EXACT);
        Self {
            origin: whole.origin,
            direction: whole.direction,
            scale: whole.scale,
            low: whole.low,
            high: whole.high,
            reference: whole.reference,
            near: whole.near,
            solid_transmittance: whole.solid_transmittance,
            ..default()
        }
    }

    /// Returns the same caster with texels counted from another one, and rays that begin at another distance.
    #[cfg(feature = "shadows")]
    pub fn at(&self, shift: IVec2, near: f32) -> Self {
        Self { reference: self.reference + shift.as_vec2(), near, ..*self }
    }

    /// Returns the same caster, drawn to a part of a texture.
    #[cfg(feature = "shadows")]
    pub fn drawn_to(&self, clip_from_part: Mat4) -> Self {
        Self { clip_from_box: clip_from_part, ..*self }
    }

    /// Creates the uniform of a posterized view, without the placement of a prop.
    pub fn posterize(posterize: Option<ExtractedPosterize>, quality: &PropQuality) -> Self {
        let settings = posterize.map(|posterize| posterize.settings).unwrap_or_default().clamped();
        let falloff = |sigma: f32| 0.5 / (sigma * sigma);
        Self {
            colors: posterize.map_or(0, |posterize| posterize.colors),
            first_color: posterize.map_or(0, |posterize| posterize.first_color),
            blend_steps: settings.blend_steps,
            softness: settings.softness,
            min_opacity: settings.min_opacity,
            iterations: settings.filter.iterations.min(quality.filter_iterations),
            radius: settings.filter.radius as i32,
            spatial_falloff: falloff(settings.filter.spatial_sigma),
            range_falloff: falloff(settings.filter.range_sigma),
            tint: Vec3::ONE,
            smooths_edges: u32::from(settings.edges == EdgeSmoothing::Coverage),
            ..default()
        }
    }

    /// Returns whether the prop is ever solid.
    pub fn may_be_solid(&self) -> bool {
        self.solid_transmittance >= 0.0
    }

    /// Returns what the layer depends on: everything but what only later passes read. The layer shows that a prop is
    /// posterized, but not how.
    pub fn of_layer(&self) -> Self {
        Self {
            colors: self.colors.min(1),
            iterations: 0,
            radius: 0,
            spatial_falloff: 0.0,
            range_falloff: 0.0,
            smooths_edges: self.smooths_edges,
            ..self.of_composite()
        }
    }

    /// Returns what the filtered composite depends on: everything but what only the label pass reads.
    pub fn of_composite(&self) -> Self {
        Self { first_color: 0, blend_steps: 0, softness: 0.0, smooths_edges: 0, ..*self }
    }

    /// Returns what labels depend on besides the filtered composite and the palette.
    pub fn of_labels(&self) -> Self {
        Self {
            colors: self.colors,
            blend_steps: self.blend_steps,
            softness: self.softness,
            tint: self.tint,
            smooths_edges: self.smooths_edges,
            ..default()
        }
    }

    /// Returns the source colors and the shown colors among those of all props.
    pub fn palette<'a>(&self, colors: &'a [Vec4]) -> &'a [Vec4] {
        let first = self.first_color as usize;
        colors.get(first..first + 2 * self.colors as usize).unwrap_or_default()
    }

    /// Returns whether the prop is posterized.
    pub fn is_posterized(&self) -> bool {
        self.colors > 0
    }

    /// Returns whether the edges of the prop are smooth.
    pub fn smooths_edges(&self) -> bool {
        self.is_posterized() && self.smooths_edges > 0
    }

    /// Also smooths the edges of slits, if other edges are smooth. Only the scene may be behind them.
    pub fn smooth_slits(&mut self) {
        if self.smooths_edges > 0 {
            self.smooths_edges = 2;
        }
    }

    /// Returns the number of filter iterations that it needs.
    pub fn filtered(&self) -> u32 {
        if self.is_posterized() { self.iterations } else { 0 }
    }
}

/// Matches `View` in `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(in crate::render) struct ViewUniform {
    pub corner: UVec2,
    pub size: UVec2,
    pub depth: Vec4,
    pub exposure: f32,
    pub everything: u32,
    pub spacing: u32,
    pub error: f32,
    pub stop_transmittance: f32,
    pub edge_rays: u32,
    pub low: UVec2,
    pub high: UVec2,
    pub unjittered_from_clip: Mat4,
    pub depth_range: Vec2,
}

impl ViewUniform {
    /// Returns what the layer depends on: everything but what only later passes read.
    pub fn of_layer(&self) -> Self {
        Self { exposure: 0.0, everything: 0, ..*self }
    }
}

/// Returns the transmittance at which a prop is solid, or a negative value for never. Rays that stop count as solid,
/// but empty parts of a prop never do.
fn solid_transmittance(solid: SolidOpacity, quality: &PropQuality) -> f32 {
    match solid {
        SolidOpacity::At(opacity) => (1.0 - opacity.clamp(f32::EPSILON, 1.0)).max(quality.stop_transmittance),
        SolidOpacity::Never => -1.0,
    }
}

#[cfg(all(test, feature = "headless"))]
mod tests {
    use bevy::render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ShaderStages, StorageBuffer, UniformBuffer,
        binding_types::{storage_buffer_read_only, uniform_buffer},
    };

    use super::*;
    use crate::tests::layouts::{counting, read_back};

    const SHADER: &str = "
#import bevy_plenoctree::view::{colors, props, view}

@group(1) @binding(0) var<storage, read_write> found: array<f32>;

@compute @workgroup_size(1)
fn read() {
    // The second element, so that the stride is tested too.
    let prop = props[1];
    for (var c = 0u; c < 4u; c++) {
        for (var r = 0u; r < 4u; r++) {
            found[4u * c + r] = prop.clip_from_box[c][r];
            found[60u + 4u * c + r] = prop.previous_from_clip[c][r];
            found[93u + 4u * c + r] = view.unjittered_from_clip[c][r];
        }
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            found[16u + 3u * c + r] = prop.origin[c][r];
            found[25u + 3u * c + r] = prop.direction[c][r];
        }
        found[34u + c] = prop.scale[c];
        found[38u + c] = prop.low[c];
        found[42u + c] = prop.high[c];
    }
    found[37] = f32(prop.mirrored);
    found[41] = f32(prop.colors);
    found[45] = f32(prop.first_color);
    found[46] = f32(prop.blend_steps);
    found[47] = prop.softness;
    found[48] = prop.min_opacity;
    found[49] = f32(prop.iterations);
    found[50] = f32(prop.radius);
    found[51] = prop.spatial_falloff;
    found[52] = prop.range_falloff;
    found[53] = prop.reference.x;
    found[54] = prop.reference.y;
    found[55] = prop.near;
    found[56] = prop.solid_transmittance;
    found[57] = prop.tint.x;
    found[58] = prop.tint.y;
    found[59] = prop.tint.z;
    found[76] = f32(view.corner.x);
    found[77] = f32(view.corner.y);
    found[78] = f32(view.size.x);
    found[79] = f32(view.size.y);
    for (var i = 0u; i < 4u; i++) {
        found[80u + i] = view.depth[i];
    }
    found[84] = view.exposure;
    found[85] = f32(view.everything);
    found[86] = f32(view.spacing);
    found[87] = view.error;
    found[88] = view.stop_transmittance;
    found[89] = f32(view.low.x);
    found[90] = f32(view.low.y);
    found[91] = f32(view.high.x);
    found[92] = f32(view.high.y);
    found[109] = f32(prop.smooths_edges);
    found[110] = colors[1].y;
    found[111] = f32(view.edge_rays);
    found[112] = view.depth_range.x;
    found[113] = view.depth_range.y;
}
";

    #[test]
    fn shaders_find_every_field_of_props_and_views() {
        let mut next = counting();
        let prop = PropUniform {
            clip_from_box: Mat4::from_cols_array(&std::array::from_fn(|_| next())),
            origin: Mat3::from_cols_array(&std::array::from_fn(|_| next())),
            direction: Mat3::from_cols_array(&std::array::from_fn(|_| next())),
            scale: Vec3::new(next(), next(), next()),
            mirrored: next() as u32,
            low: Vec3::new(next(), next(), next()),
            colors: next() as u32,
            high: Vec3::new(next(), next(), next()),
            first_color: next() as u32,
            blend_steps: next() as u32,
            softness: next(),
            min_opacity: next(),
            iterations: next() as u32,
            radius: next() as i32,
            spatial_falloff: next(),
            range_falloff: next(),
            reference: Vec2::new(next(), next()),
            near: next(),
            solid_transmittance: next(),
            tint: Vec3::new(next(), next(), next()),
            previous_from_clip: Mat4::from_cols_array(&std::array::from_fn(|_| next())),
            ..default()
        };
        let view = ViewUniform {
            corner: UVec2::new(next() as u32, next() as u32),
            size: UVec2::new(next() as u32, next() as u32),
            depth: Vec4::new(next(), next(), next(), next()),
            exposure: next(),
            everything: next() as u32,
            spacing: next() as u32,
            error: next(),
            stop_transmittance: next(),
            edge_rays: 0,
            low: UVec2::new(next() as u32, next() as u32),
            high: UVec2::new(next() as u32, next() as u32),
            unjittered_from_clip: Mat4::from_cols_array(&std::array::from_fn(|_| next())),
            depth_range: Vec2::ZERO,
        };
        let prop = PropUniform { smooths_edges: next() as u32, ..prop };
        let color = next();
        let view = ViewUniform { edge_rays: next() as u32, depth_range: Vec2::new(next(), next()), ..view };
        let layout = BindGroupLayoutDescriptor::new(
            "layout_test",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    uniform_buffer::<ViewUniform>(false),
                    storage_buffer_read_only::<Vec<PropUniform>>(false),
                    storage_buffer_read_only::<Vec<Vec4>>(false),
                ),
            ),
        );
        let found: [f32; 114] = read_back(SHADER.into(), layout, |device, queue, run| {
            let mut view = UniformBuffer::from(view);
            let mut props = StorageBuffer::from(vec![PropUniform::default(), prop]);
            let mut colors = StorageBuffer::from(vec![Vec4::ZERO, Vec4::new(0.0, color, 0.0, 0.0)]);
            view.write_buffer(device, queue);
            props.write_buffer(device, queue);
            colors.write_buffer(device, queue);
            run(&[view.binding().unwrap(), props.binding().unwrap(), colors.binding().unwrap()]);
        });
        let expected: [f32; 114] = std::array::from_fn(|index| (index + 1) as f32);
        assert_eq!(found, expected);
    }
}
