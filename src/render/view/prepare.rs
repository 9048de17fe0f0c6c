//! Prepares the props of every view: their uniforms, their colors, and the part of the viewport that they cover.

use bevy::{
    camera::{Exposure, MainPassResolutionOverride},
    core_pipeline::prepass::PreviousViewData,
    prelude::*,
    render::{
        camera::{ExtractedCamera, TemporalJitter},
        render_asset::RenderAssets,
        renderer::{RenderDevice, RenderQueue},
        view::ExtractedView,
    },
};

use super::{
    motion::Motion,
    overlap::Overlaps,
    props::{DrawnProp, Overlap, ViewProps},
    textures::{drawn_viewport, spacing},
    uniforms::{PropUniform, ViewUniform},
};
use crate::{
    gpu::{GpuField, Level},
    posterize::MAX_FILTER_RADIUS,
    render::{
        extract::{ExtractedProps, VisibleProps},
        rays::Placement,
    },
    stage::PropStage,
};

/// Memory that is reused from view to view.
#[derive(Default)]
pub(super) struct Scratch {
    /// The pixels that each prop of a view can cover.
    rects: Vec<URect>,
    overlaps: Overlaps,
}

/// Writes the uniforms and the colors of every view.
pub(super) fn prepare_views(
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut scratch: Local<Scratch>,
    mut views: Query<(
        Option<(&ExtractedView, &ExtractedCamera, &Msaa)>,
        Option<&MainPassResolutionOverride>,
        (Option<&TemporalJitter>, Option<&PreviousViewData>),
        &VisibleProps,
        &mut ViewProps,
    )>,
) {
    let Scratch { rects, overlaps } = &mut *scratch;
    for (camera, resolution, (jitter, previous), visible, mut buffers) in &mut views {
        let quality = &visible.quality;
        let ViewProps {
            order,
            drawn,
            iterations,
            rect,
            stage,
            has_stages,
            pipelines,
            view: uniform,
            props,
            colors,
            ..
        } = &mut *buffers;
        drawn.clear();
        pipelines.clear();
        props.get_mut().clear();
        rects.clear();
        (*iterations, *rect) = (0, URect::EMPTY);
        // Cameras that are not active are not extracted.
        let Some((view, camera, msaa)) = camera else {
            continue;
        };
        let Some(viewport) = drawn_viewport(camera, resolution) else {
            continue;
        };
        let size = viewport.physical_size;
        let spacing = spacing(quality);
        let reach = UVec2::splat(reach(spacing));
        // After upscaling, textures with the size of the main pass no longer fit the target.
        *stage = if resolution.is_some() { PropStage::Scene } else { visible.stage };
        *has_stages = visible.has_stages;

        // At the display, the effects that jitter is for are over.
        let jitter = jitter.filter(|_| *stage == PropStage::Scene);
        let motion = Motion::new(view, jitter, previous, size);
        for ordered in order {
            let (Some(prop), wanted) = (extracted.props.get(ordered.index), ordered.level) else {
                continue;
            };
            let Some(field) = fields.get(prop.field) else {
                continue;
            };
            let level = field.resolve(wanted);
            // A level with fewer leaves may have a smaller box.
            let bounds = field.level(level).and_then(|level| level.bounds);
            let placement = match bounds {
                Some((low, high)) if level != Level::default() => Placement { low, high, ..prop.placement },
                _ => prop.placement,
            };
            let Some(rays) = placement.rays(&view.world_from_view, motion.clip_from_view, size) else {
                continue;
            };
            let covered = covered(rays.clip_from_box, size);
            if !covered.is_empty() {
                *rect = rect.union(extended(covered, reach, size));
            }
            rects.push(covered);
            let uniform = PropUniform::new(prop, &rays, motion.previous_from_clip(prop), quality);
            let overlap = if uniform.may_be_solid() { Overlap::Solid } else { Overlap::Thin };
            let smooths_edges = uniform.smooths_edges();
            let lit = (prop.is_lit() && *stage == PropStage::Scene).then_some(ordered.index);
            drawn.push(DrawnProp { field: prop.field, level, overlap, lit, smooths_edges, rect: covered });
            props.get_mut().push(uniform);
        }
        for ((prop, uniform), overlaps) in drawn.iter_mut().zip(props.get_mut()).zip(overlaps.find(rects)) {
            if !overlaps {
                prop.overlap = Overlap::None;
                uniform.smooth_slits();
            }
        }
        if drawn.iter().all(|prop| prop.overlap != Overlap::Solid) {
            drawn.iter_mut().for_each(|prop| prop.overlap = Overlap::None);
        }
        let everything = visible.everything.filter(|posterize| posterize.colors > 0);
        if everything.is_some() {
            *rect = URect::from_corners(UVec2::ZERO, size);
            props.get_mut().push(PropUniform::posterize(everything, quality));
        }
        if rect.is_empty() {
            continue;
        }
        *iterations = props.get().iter().map(PropUniform::filtered).max().unwrap_or(0);
        // Copy the colors of all props, so that indices are the same in every view.
        colors.get_mut().clone_from(&extracted.colors);
        if colors.get().is_empty() {
            colors.get_mut().push(Vec4::ZERO);
        }
        let [z, w] = [view.clip_from_view.z_axis, view.clip_from_view.w_axis];
        *uniform.get_mut() = ViewUniform {
            corner: viewport.physical_position,
            size,
            depth: Vec4::new(z.z, w.z, z.w, w.w),
            exposure: exposure(camera, *stage),
            everything: everything.map_or(0, |_| props.get().len() as u32),
            spacing,
            error: quality.error,
            stop_transmittance: quality.stop_transmittance,
            edge_rays: if msaa.samples() > 1 { 8 } else { quality.edge_rays },
            low: rect.min,
            high: rect.max,
            unjittered_from_clip: motion.unjittered_from_clip.as_mat4(),
            // Nothing is divided by an empty range.
            depth_range: Vec2::new(viewport.depth.start, (viewport.depth.end - viewport.depth.start).max(1e-6)),
        };
        uniform.write_buffer(&device, &queue);
        props.write_buffer(&device, &queue);
        colors.write_buffer(&device, &queue);
    }
}

/// Returns the camera's exposure relative to Bevy's default exposure, or 1 after tonemapping.
fn exposure(camera: &ExtractedCamera, stage: PropStage) -> f32 {
    match stage {
        // Shaders divide by the exposure.
        PropStage::Scene => (camera.exposure / Exposure::default().exposure()).clamp(1e-6, 1e6),
        PropStage::Display => 1.0,
    }
}

/// Returns the rectangle of pixels that the unit cube can cover.
pub(in crate::render) fn covered(clip_from_box: glam::DMat4, size: UVec2) -> URect {
    let everything = URect::from_corners(UVec2::ZERO, size);
    match extent(clip_from_box, size) {
        // The casts saturate.
        Some([low, high]) => everything.intersect(URect::from_corners(low.as_uvec2(), high.as_uvec2())),
        None => everything,
    }
}

/// Returns the corners of the pixels that the unit cube can cover, which may be out of view, or `None` if a part of the
/// cube is behind the camera.
pub(in crate::render) fn extent(clip_from_box: glam::DMat4, size: UVec2) -> Option<[glam::DVec2; 2]> {
    let (mut low, mut high) = (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY);
    for corner in 0..8 {
        let corner = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let clip = clip_from_box * corner.as_dvec3().extend(1.0);
        if clip.w <= 0.0 {
            return None;
        }
        let ndc = glam::DVec2::new(clip.x, -clip.y) / clip.w;
        let point = 0.5 * (ndc + 1.0) * size.as_dvec2();
        (low, high) = (low.min(point), high.max(point));
    }
    Some([low.floor(), high.ceil()])
}

/// Returns how far from the pixels of its box a prop can be seen, plus how far from there the filter reads: a pixel
/// between the rays of the grid is interpolated.
fn reach(spacing: u32) -> u32 {
    spacing + MAX_FILTER_RADIUS
}

/// Returns a rectangle that is extended on every side, within a viewport of `size`.
fn extended(rect: URect, reach: UVec2, size: UVec2) -> URect {
    URect { min: rect.min.saturating_sub(reach), max: (rect.max + reach).min(size) }
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Holds even if corners of the box are behind the camera.
        #[test]
        fn what_is_seen_of_a_box_is_covered(
            eye in prop::array::uniform3(-1.0..2.0f64),
            target in prop::array::uniform3(-0.5..1.5f64),
            point in prop::array::uniform3(0.0..=1.0f64),
            size_of_box in prop::array::uniform3(0.01..1.0f64),
        ) {
            let (eye, target, size) = (DVec3::from(eye), DVec3::from(target), UVec2::new(1600, 1200));
            prop_assume!((target - eye).length() > 0.01);
            let view = DMat4::look_at_rh(eye, target, DVec3::new(0.1, 1.0, 0.2).normalize());
            let clip_from_box = DMat4::perspective_infinite_reverse_rh(1.0, 4.0 / 3.0, 0.01)
                * view
                * DMat4::from_scale(size_of_box.into());
            let clip = clip_from_box * DVec3::from(point).extend(1.0);
            let ndc = glam::DVec2::new(clip.x, -clip.y) / clip.w;
            if clip.w > 0.0 && ndc.abs().max_element() < 1.0 {
                let pixel = (0.5 * (ndc + 1.0) * size.as_dvec2()).as_uvec2();
                let rect = covered(clip_from_box, size);
                // A point between two pixels belongs to both.
                let (low, high) = (rect.min.saturating_sub(UVec2::ONE), rect.max + 1);
                prop_assert!(pixel.cmpge(low).all() && pixel.cmplt(high).all(), "{pixel} in {rect:?}");
            }
        }
    }
}
