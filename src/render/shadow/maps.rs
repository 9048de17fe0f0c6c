//! The props in every shadow map, and their uniforms.

use bevy::{
    camera::visibility::RenderLayers,
    pbr::{ExtractedPointLight, LightEntity, Shadow, ShadowView},
    prelude::*,
    render::{
        render_asset::RenderAssets,
        render_phase::ViewBinnedRenderPhases,
        render_resource::{BindGroupEntries, CachedRenderPipelineId, PipelineCache, StorageBuffer, UniformBuffer},
        renderer::{RenderDevice, RenderQueue},
        view::ExtractedView,
    },
};
use glam::{DMat4, DVec2};

use super::{casters::Casters, pipeline::ShadowPipeline};
use crate::{
    gpu::{GpuField, Level, MAX_PROPS_IN_VIEW},
    prop::SolidOpacity,
    quality::PropQuality,
    render::{
        bind_group::KeptBindGroup,
        extract::ExtractedProps,
        rays::{Placement, Rays},
        view::{DrawnProp, Overlap, PropUniform, ViewUniform, covered, levels_coarser},
    },
};

/// The quality of shadows of lights without their own: cells are no larger than texels.
const QUALITY: PropQuality = PropQuality { cell_size: 1.0, ..PropQuality::EXACT };

/// The props in a shadow map.
#[derive(Component, Default)]
pub(super) struct MapProps {
    /// Their indices in `ExtractedProps::props`, and the levels that the light requests.
    order: Vec<(usize, Level)>,
    /// The props, once for every tile.
    pub drawn: Vec<DrawnProp>,
    /// The tiles: the texels that the prop can cover.
    pub rects: Vec<URect>,
    /// The pipeline of every tile.
    pub pipelines: Vec<Option<CachedRenderPipelineId>>,
    view: UniformBuffer<ViewUniform>,
    props: StorageBuffer<Vec<PropUniform>>,
    pub group: KeptBindGroup,
}

/// Forgets what was on a lost device.
pub(super) fn forget_maps(mut maps: Query<&mut MapProps>) {
    for mut map in &mut maps {
        *map = default();
    }
}

/// Finds the props in every map, and requests their levels.
pub(super) fn choose_levels(
    extracted: Res<ExtractedProps>,
    casters: Res<Casters>,
    mut fields: ResMut<RenderAssets<GpuField>>,
    phases: Option<Res<ViewBinnedRenderPhases<Shadow>>>,
    lamps: Query<&ExtractedPointLight>,
    mut maps: Query<(&ExtractedView, &LightEntity, &RenderLayers, &mut MapProps), With<ShadowView>>,
) {
    for (view, light, layers, mut map) in &mut maps {
        map.order.clear();
        // Lights that are out of view keep their maps, but Bevy does not draw them.
        if !phases.as_ref().is_some_and(|phases| phases.contains_key(&view.retained_view_entity)) {
            continue;
        }
        let (LightEntity::Directional { light_entity, .. }
        | LightEntity::Point { light_entity, .. }
        | LightEntity::Spot { light_entity }) = light;
        let quality = casters.qualities.get(light_entity).unwrap_or(&QUALITY);
        let reach = lamps.get(*light_entity).map_or(f64::INFINITY, |lamp| lamp.range.into());
        let in_layers = casters.props.iter().filter(|(_, of_prop)| of_prop.intersects(layers));
        map.order.extend(in_layers.filter_map(|(entity, _)| {
            let index = extracted.drawn(*extracted.index.get(entity)?, &fields)?;
            let prop = extracted.props.get(index).filter(|prop| prop.solid != SolidOpacity::Never)?;
            let rays = rays_in(&prop.placement, view).filter(|rays| is_in(rays, view, reach))?;
            let most = prop.placement.cells.log2() as u32;
            let coarser = if quality.cell_size > 0.0 { levels_coarser(rays.cell_size, quality.cell_size) } else { 0 };
            let level = Level::new(coarser.min(most), quality);
            fields.get_mut(prop.field)?.request(level);
            Some((index, level))
        }));
        map.order.truncate(MAX_PROPS_IN_VIEW);
    }
}

/// Writes the uniforms of every map.
pub(super) fn prepare_maps(
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut maps: Query<(&ExtractedView, &mut MapProps)>,
) {
    for (view, mut map) in &mut maps {
        let MapProps { order, drawn, rects, view: uniform, props, .. } = &mut *map;
        drawn.clear();
        rects.clear();
        props.get_mut().clear();
        for (index, wanted) in order {
            let Some(prop) = extracted.props.get(*index) else {
                continue;
            };
            let Some(field) = fields.get(prop.field) else {
                continue;
            };
            let level = field.resolve(*wanted);
            let Some((low, high)) = field.level(level).and_then(|level| level.bounds) else {
                continue;
            };
            let Some(mut rays) = rays_in(&Placement { low, high, ..prop.placement }, view) else {
                continue;
            };
            for rect in tiles(covered(rays.clip_from_box, size(view)), size(view)) {
                rays.clip_from_box = clip_from_rect(rect, size(view));
                rects.push(rect);
                let (overlap, smooths_edges) = (Overlap::None, false);
                drawn.push(DrawnProp { field: prop.field, level, overlap, smooths_edges, rect });
                props.get_mut().push(PropUniform::new(prop, &rays, DMat4::IDENTITY, &PropQuality::EXACT));
            }
        }
        if drawn.is_empty() {
            continue;
        }
        let [z, w] = [view.clip_from_view.z_axis, view.clip_from_view.w_axis];
        let depth = Vec4::new(z.z, w.z, z.w, w.w);
        *uniform.get_mut() = ViewUniform { size: size(view), depth, pixel: Vec2::ONE, ..default() };
        uniform.write_buffer(&device, &queue);
        props.write_buffer(&device, &queue);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<ShadowPipeline>,
    mut maps: Query<&mut MapProps>,
) {
    for mut map in &mut maps {
        let MapProps { drawn, view, props, group, .. } = &mut *map;
        if let (false, Some(view), Some(props)) = (drawn.is_empty(), view.binding(), props.binding()) {
            let entries = BindGroupEntries::sequential((view, props));
            group.update(&device, &cache, "plenoctree_shadow", &pipeline.view, &entries);
        }
    }
}

/// Returns the parts of a rectangle in the quarters of a map.
fn tiles(rect: URect, size: UVec2) -> impl Iterator<Item = URect> {
    let middle = size / 2;
    let quarter = move |corner: u32| {
        let low = middle * UVec2::new(corner & 1, corner >> 1);
        URect { min: low, max: UVec2::select(low.cmpgt(UVec2::ZERO), size, middle) }
    };
    (0..4).map(quarter).map(move |quarter| rect.intersect(quarter)).filter(|tile| !tile.is_empty())
}

/// Returns the transform from the unit square to a tile. The square begins at the tile's outer corner, so that twice its
/// size is still within the map: the triangle of the pass need not be clipped, which would split it.
fn clip_from_rect(rect: URect, size: UVec2) -> DMat4 {
    let clip = |point: UVec2| (2.0 * point.as_dvec2() / size.as_dvec2() - 1.0) * DVec2::new(1.0, -1.0);
    let (low, high) = (clip(rect.min), clip(rect.max));
    let begin = DVec2::select(low.abs().cmpge(high.abs()), low, high);
    let extent = low + high - 2.0 * begin;
    DMat4::from_translation(begin.extend(0.0)) * DMat4::from_scale(extent.extend(1.0))
}

fn size(view: &ExtractedView) -> UVec2 {
    view.viewport.zw()
}

fn rays_in(placement: &Placement, view: &ExtractedView) -> Option<Rays> {
    placement.light_rays(&view.world_from_view, view.clip_from_view, size(view))
}

/// Returns whether a prop is in a map, and nearer than the light reaches.
fn is_in(rays: &Rays, view: &ExtractedView, reach: f64) -> bool {
    let nearest = view.clip_from_view.as_dmat4() * glam::DVec4::new(0.0, 0.0, -rays.near, 1.0);
    rays.near < reach && nearest.z > 0.0 && !covered(rays.clip_from_box, size(view)).is_empty()
}
