//! The props in every shadow map, and how they are drawn into it.

use bevy::{
    ecs::entity::EntityHashSet,
    pbr::{ShadowView, ViewLightEntities},
    platform::collections::HashMap,
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_phase::TrackedRenderPass,
        render_resource::*,
        renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery},
        view::ExtractedView,
    },
};

use super::{
    cached::{CachedCasters, CasterKey, Tile},
    texels::{LightView, clip_from_part, map_size, parts},
};
use crate::{
    gpu::{Allocator, GpuField, LeftOut, Level, TreeShape, WrittenBuffer},
    quality::PropQuality,
    render::{
        extract::{ExtractedProps, VisibleProps},
        frame::{Access, FirstGroup, Pass, Pipelines, Place, Program, PropView, Slot, TILE_FORMAT, bind},
        rays::depth_from_distance,
        uniforms::{PropUniform, ViewUniform},
    },
};

/// The name of the pass's span in Bevy's render diagnostics. There is one per camera, for all of its cascades, and one
/// for every map of a point or spot light.
pub const SHADOW_SPAN: &str = "plenoctree_shadow";

/// The props in a shadow map.
#[derive(Component, Default)]
pub(super) struct MapProps {
    pub order: Vec<(usize, Level)>,
    /// What is drawn into tiles, before the map.
    filled: Vec<Drawn>,
    /// What is drawn into the map.
    drawn: Vec<Drawn>,
    cached: CachedCasters,
    allocator: Allocator,
    view: WrittenBuffer,
    /// The uniforms of draw calls: what rays are marched through, and the tiles that are copied.
    uniforms: Vec<PropUniform>,
    props: WrittenBuffer,
    group: Option<BindGroup>,
}

/// A draw call.
#[derive(Clone)]
struct Drawn {
    entity: Entity,
    pipeline: CachedRenderPipelineId,
    group: BindGroup,
    /// The texels that it can cover.
    rect: URect,
    /// The index of its uniform.
    instance: u32,
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
        let MapProps { order, filled, drawn, cached, allocator, view: of_view, uniforms, props, group } = &mut *map;
        let size = map_size(view, &device);
        // Shadows do not appear before the props that cast them, but those that are there stay.
        let mut hidden = waiting.clone();
        drawn.iter().for_each(|call| _ = hidden.remove(&call.entity));
        filled.clear();
        drawn.clear();
        uniforms.clear();
        cached.begin();
        for (index, level) in order {
            let Some(prop) = extracted.props.get(*index).filter(|prop| !hidden.contains(&prop.entity)) else {
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
            let tile = cached.update(prop.entity, key, size.x * size.y, |size| {
                let is_ready = |id| cache.get_render_pipeline(id).is_some();
                if !is_ready(fill) || !is_ready(copy) {
                    return None;
                }
                // Without memory, rays are marched in every frame.
                allocator.create(&device, || Tile::new(&device, &layout_of_tile, size))
            });
            let near = seen.near as f32;
            let on_map = Drawn {
                entity: prop.entity,
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
        if drawn.is_empty() {
            continue;
        }
        let depth = depth_from_distance(view.clip_from_view);
        let uniform = ViewUniform { size, depth, spacing: 1, ..default() };
        of_view.set(&device, &queue, "plenoctree_map", BufferUsages::UNIFORM, &uniform);
        props.set(&device, &queue, "plenoctree_map_props", BufferUsages::STORAGE, uniforms);
        let bindings: Option<Vec<_>> = [&*of_view, &*props].into_iter().map(WrittenBuffer::binding).collect();
        *group = bindings.map(|bindings| bind(&device, &cache, &layout, &bindings));
    }
}

/// Returns the props that views do not draw because a pipeline is not ready, as entities of the main world.
fn waiting_props(extracted: &ExtractedProps, views: &Query<(&VisibleProps, &PropView)>) -> EntityHashSet {
    let waiting = views.iter().filter(|(_, view)| view.left_out == LeftOut::More);
    let ordered = waiting.flat_map(|(visible, _)| &visible.order);
    let mut props: EntityHashSet =
        ordered.filter_map(|ordered| Some(extracted.props.get(ordered.index)?.entity)).collect();
    if !props.is_empty() {
        let drawn = views.iter().flat_map(|(_, view)| view.plan.drawn_props());
        drawn.for_each(|drawn| _ = props.remove(&drawn.entity));
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

/// Returns the passes that march rays into the map, march rays into a tile, and copy a tile into the map. Only their
/// pipelines are used.
fn passes(tree: TreeShape) -> [Pass; 3] {
    // Bevy's maps have the depth order of the scene's depth texture.
    let shadow = Program::new("shadow").define("SHADOW_MAP").depth_test(CompareFunction::Greater, true);
    let program = |tree| Program { vertex: "shadow", tree, ..shadow.clone() };
    let pass = |program| Pass {
        group: FirstGroup::Map,
        depth: Some(Slot::TargetDepth),
        ..Pass::fullscreen(SHADOW_SPAN, Place::Layer, None, vec![program])
    };
    [
        pass(program(Some(tree))),
        Pass { writes: vec![Slot::ShadowTile], depth: None, ..pass(program(Some(tree)).define("TO_TILE")) },
        Pass { reads: vec![vec![Slot::ShadowTile]], ..pass(program(None).define("FROM_TILE")) },
    ]
}

/// Draws into the maps of a view: those of directional lights, if it is a camera, or else the map of a point or spot
/// light, which is a view of its own, because all cameras share it.
pub(super) fn draw_maps(
    view: ViewQuery<Option<&ViewLightEntities>>,
    mut maps: Query<(&ShadowView, &mut MapProps)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let own = [view.entity()];
    let views = view.into_inner().map_or(&own[..], |camera| &camera.lights[..]);
    if maps.iter_many(views).all(|(_, map)| map.drawn.is_empty()) {
        return;
    }
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), SHADOW_SPAN);
    let mut maps = maps.iter_many_mut(views);
    while let Some((view, mut map)) = maps.fetch_next() {
        draw(view, &mut map, &cache, &mut ctx);
    }
    span.end(ctx.command_encoder());
}

fn draw(view: &ShadowView, map: &mut MapProps, cache: &PipelineCache, ctx: &mut RenderContext) {
    let MapProps { filled, drawn, cached, group, .. } = map;
    let (false, Some(group)) = (drawn.is_empty(), &*group) else {
        return;
    };
    for calls in filled.chunk_by(|a, b| a.entity == b.entity) {
        let Some(tile) = calls.first().and_then(|call| cached.tile(call.entity)) else {
            continue;
        };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(SHADOW_SPAN),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &tile.texture,
                depth_slice: None,
                resolve_target: None,
                ops: default(),
            })],
            ..default()
        });
        draw_calls(&mut pass, group, calls, cache);
        tile.is_filled = true;
    }
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(SHADOW_SPAN),
        depth_stencil_attachment: Some(view.depth_attachment.get_attachment(StoreOp::Store)),
        ..default()
    });
    draw_calls(&mut pass, group, drawn, cache);
}

fn draw_calls<'a>(
    pass: &mut TrackedRenderPass<'a>,
    group: &'a BindGroup,
    calls: &'a [Drawn],
    cache: &'a PipelineCache,
) {
    pass.set_bind_group(0, group, &[]);
    for call in calls {
        let Some(pipeline) = cache.get_render_pipeline(call.pipeline) else {
            continue;
        };
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(1, &call.group, &[]);
        pass.set_scissor_rect(call.rect.min.x, call.rect.min.y, call.rect.width(), call.rect.height());
        pass.draw(0..3, call.instance..call.instance + 1);
    }
}
