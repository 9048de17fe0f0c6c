//! The props in every shadow map, and their uniforms.

use bevy::{
    ecs::entity::EntityHashSet,
    platform::collections::HashMap,
    prelude::*,
    render::{
        render_asset::RenderAssets,
        render_resource::{BindGroup, BufferUsages, CachedRenderPipelineId, PipelineCache},
        renderer::{RenderDevice, RenderQueue},
        view::ExtractedView,
    },
};

use super::{
    cached::{CachedCasters, CasterKey, Tile},
    pipeline::{SHADOW_SPAN, passes},
    texels::{LightView, clip_from_part, map_size, parts},
};
use crate::{
    gpu::{Allocator, GpuField, LeftOut, Level, TreeShape, WrittenBuffer},
    quality::PropQuality,
    render::{
        extract::{ExtractedProps, VisibleProps},
        frame::{Access, BindGroups, FirstGroup, Pipelines, PropView, Slot, TILE_FORMAT},
        uniforms::{PropUniform, ViewUniform},
    },
};

/// The props in a shadow map.
#[derive(Component, Default)]
pub(super) struct MapProps {
    pub order: Vec<Caster>,
    /// What is drawn into tiles, before the map.
    pub filled: Vec<Drawn>,
    /// What is drawn into the map.
    pub drawn: Vec<Drawn>,
    pub cached: CachedCasters,
    allocator: Allocator,
    view: WrittenBuffer,
    /// The uniforms of draw calls: what rays are marched through, and the tiles that are copied.
    uniforms: Vec<PropUniform>,
    props: WrittenBuffer,
    groups: BindGroups,
    /// Bind group 0.
    pub group: Option<BindGroup>,
}

/// A prop in a map.
pub(super) struct Caster {
    /// The prop's entity in the main world.
    pub entity: Entity,
    /// Its index in `ExtractedProps::props`.
    pub index: usize,
    /// The level that the light requests.
    pub level: Level,
}

/// A draw call.
#[derive(Clone)]
pub(super) struct Drawn {
    /// The prop's entity in the main world.
    pub entity: Entity,
    pub pipeline: CachedRenderPipelineId,
    /// Bind group 1.
    pub group: BindGroup,
    /// The texels that it can cover.
    pub rect: URect,
    /// The index of its uniform.
    pub instance: u32,
}

/// Forgets what was on a lost device.
pub(super) fn forget_maps(mut maps: Query<&mut MapProps>) {
    for mut map in &mut maps {
        *map = default();
    }
}

/// Decides how to draw the props of every map, and writes their uniforms.
pub(super) fn prepare_maps(
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    (device, queue): (Res<RenderDevice>, Res<RenderQueue>),
    cache: Res<PipelineCache>,
    mut pipelines: ResMut<Pipelines>,
    views: Query<(&VisibleProps, &PropView)>,
    mut maps: Query<(&ExtractedView, &mut MapProps)>,
) {
    let waiting = waiting_props(&extracted, &views);
    let layout = pipelines.first_layout(FirstGroup::Map);
    let layout_of_tile =
        cache.get_bind_group_layout(&pipelines.bound_layout(SHADOW_SPAN, Access::Read, &[Slot::ShadowTile]));
    let mut of_trees = HashMap::<TreeShape, [CachedRenderPipelineId; 3]>::default();
    for (view, mut map) in &mut maps {
        let MapProps { order, filled, drawn, cached, allocator, view: of_view, uniforms, props, groups, group } =
            &mut *map;
        let size = map_size(view, &device);
        // Shadows do not appear before the props that cast them, but those that are there stay.
        let mut hidden = waiting.clone();
        drawn.iter().for_each(|call| _ = hidden.remove(&call.entity));
        filled.clear();
        drawn.clear();
        uniforms.clear();
        cached.begin();
        groups.begin();
        for Caster { entity, index, level } in order {
            let Some(prop) = extracted.props.get(*index).filter(|_| !hidden.contains(entity)) else {
                continue;
            };
            let Some((level, _, pose)) = prop.at_level(*level, &fields) else {
                continue;
            };
            let Some(seen) = LightView::new(&pose, view, size) else {
                continue;
            };
            let tree = level.shape.into();
            let [march, fill, copy] = *of_trees.entry(tree).or_insert_with(|| {
                passes(tree).map(|pass| pipelines.id(&cache, &pass, &pass.programs[0], TILE_FORMAT))
            });
            let caster = PropUniform::caster(prop, &seen.rays, &PropQuality::EXACT);
            let texels = seen.to_cache();
            let key = CasterKey { caster, field: level.bind_group.id(), texels };
            // At most as much memory as the map itself takes.
            let tile = cached.update(*entity, key, size.x * size.y, |size| {
                let is_ready = |id| cache.get_render_pipeline(id).is_some();
                if !is_ready(fill) || !is_ready(copy) {
                    return None;
                }
                // Without memory, rays are marched in every frame.
                allocator.create(&device, || Tile::new(&device, &layout_of_tile, size))
            });
            let near = seen.near as f32;
            let on_map = Drawn {
                entity: *entity,
                pipeline: march,
                group: level.bind_group.clone(),
                rect: seen.to_march(),
                instance: 0,
            };
            let Some(tile) = tile else {
                push(drawn, uniforms, &on_map, size, caster.at(seen.shift, near));
                continue;
            };
            if !tile.is_filled {
                let size = texels.size().as_uvec2();
                let rect = URect { min: UVec2::ZERO, max: size };
                let into_tile = Drawn { pipeline: fill, rect, ..on_map.clone() };
                push(filled, uniforms, &into_tile, size, caster.at(-texels.min, seen.rays.near as f32));
            }
            let from_tile = Drawn { pipeline: copy, group: tile.group.clone(), rect: seen.on_map(), ..on_map };
            push(drawn, uniforms, &from_tile, size, PropUniform::tile(texels.min + seen.shift, near));
        }
        cached.end();
        if drawn.is_empty() {
            continue;
        }
        let [z, w] = [view.clip_from_view.z_axis, view.clip_from_view.w_axis];
        let depth = Vec4::new(z.z, w.z, z.w, w.w);
        let uniform = ViewUniform { size, depth, spacing: 1, ..default() };
        of_view.set(&device, &queue, "plenoctree_map", BufferUsages::UNIFORM, &uniform);
        props.set(&device, &queue, "plenoctree_map_props", BufferUsages::STORAGE, uniforms);
        let bindings: Option<Vec<_>> = [&*of_view, &*props].into_iter().map(WrittenBuffer::binding).collect();
        *group = bindings.map(|bindings| groups.get(&device, &cache, &layout, &bindings));
    }
}

/// Returns the props that views do not draw because a pipeline is not ready, as entities of the main world.
fn waiting_props(extracted: &ExtractedProps, views: &Query<(&VisibleProps, &PropView)>) -> EntityHashSet {
    let waiting = views.iter().filter(|(_, view)| view.left_out == LeftOut::More);
    let ordered = waiting.flat_map(|(visible, _)| &visible.order);
    let mut props: EntityHashSet =
        ordered.filter_map(|ordered| Some(extracted.props.get(ordered.index)?.entity)).collect();
    if !props.is_empty() {
        views.iter().flat_map(|(_, view)| view.drawn_props()).for_each(|drawn| _ = props.remove(&drawn));
    }
    props
}

/// Adds the draw calls of a prop, one for every part of a texture of this `size`, and their uniforms.
fn push(calls: &mut Vec<Drawn>, uniforms: &mut Vec<PropUniform>, call: &Drawn, size: UVec2, uniform: PropUniform) {
    for rect in parts(call.rect, size) {
        calls.push(Drawn { rect, instance: uniforms.len() as u32, ..call.clone() });
        uniforms.push(uniform.drawn_to(clip_from_part(rect, size)));
    }
}
