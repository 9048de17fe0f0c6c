//! A view that draws props, and the execution of its passes.

use bevy::{
    core_pipeline::prepass::ViewPrepassTextures,
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::*,
        renderer::{RenderContext, ViewQuery},
        view::{ViewDepthTexture, ViewTarget},
    },
};

use super::{
    cache::Cache,
    pass::{Access, CachedResult, Clear, FirstGroup, Pass, Place},
    pipelines::Pipelines,
    slot::Slot,
    textures::{Textures, bind},
};
#[cfg(feature = "shadows")]
use crate::render::shades::Shades;
use crate::{
    camera::PropPlacement,
    gpu::{LeftOut, ViewTooLarge},
    render::{
        plan::{Feature, Plan},
        uniforms::{PaletteBuffer, ViewBuffers},
    },
};

/// A view that draws props: the plan of its frame, the passes that follow from it, and what they need.
#[derive(Component, Default)]
pub(crate) struct PropView {
    pub(in crate::render) plan: Plan,
    pub(in crate::render) passes: Vec<Pass>,
    /// What is left out because a pipeline is not ready.
    pub(in crate::render) left_out: LeftOut,
    /// For how many frames it has been drawn as before, because pipelines are not ready.
    pub(in crate::render) held_frames: u32,
    /// Whether the plan was drawn, or is about to be. Bevy skips cameras of windows that have no size.
    pub(in crate::render) is_drawn: bool,
    pub(in crate::render) textures: Textures,
    pub(in crate::render) buffers: ViewBuffers,
    pub(in crate::render) cached: Cache,
    /// Bind group 0 of passes that read Bevy's lights, and its offsets.
    pub(in crate::render) lights: Option<(BindGroup, Vec<u32>)>,
    #[cfg(feature = "shadows")]
    pub(in crate::render) shades: Shades,
    /// What determines the memory that it needs, when there was too little.
    pub(in crate::render) shortage: Option<(ViewTooLarge, usize)>,
}

impl PropView {
    /// Returns what there is too little memory for.
    #[cfg(feature = "headless")]
    pub fn shortage(&self) -> Option<&ViewTooLarge> {
        self.shortage.as_ref().map(|(error, _)| error)
    }

    /// Lets the view draw nothing in this frame, and forgets what it drew.
    pub(in crate::render) fn clear(&mut self) {
        self.plan = default();
        self.passes.clear();
        self.textures.clear();
        self.cached = default();
        #[cfg(feature = "shadows")]
        {
            self.shades = default();
        }
        self.left_out = LeftOut::Nothing;
    }
}

/// What a view has besides its own textures.
type Others = (&'static ViewTarget, &'static ViewDepthTexture, Option<&'static ViewPrepassTextures>);

/// What passes need.
struct Frame<'a> {
    cache: &'a PipelineCache,
    pipelines: &'a Pipelines,
    palettes: &'a PaletteBuffer,
    target: &'a ViewTarget,
    depth: &'a ViewDepthTexture,
    prepass: Option<&'a ViewPrepassTextures>,
}

/// Runs the passes of a view at one place in the frame. Those after the layer run only if the view's props are drawn at
/// this `placement`.
pub(in crate::render) fn run(
    InMut((place, placement)): InMut<(Place, PropPlacement)>,
    view: ViewQuery<(&mut PropView, Others)>,
    cache: Res<PipelineCache>,
    pipelines: Res<Pipelines>,
    palettes: Res<PaletteBuffer>,
    mut ctx: RenderContext,
) {
    let (mut view, (target, depth, prepass)) = view.into_inner();
    if view.plan.placement != *placement && *place != Place::Layer {
        return;
    }
    let frame = Frame { cache: &cache, pipelines: &pipelines, palettes: &palettes, target, depth, prepass };
    view.is_drawn = true;
    let passes = std::mem::take(&mut view.passes);
    compare(*place, &mut view, &frame, &mut ctx);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let here: Vec<_> = passes.iter().filter(|pass| pass.place == *place).collect();
    for named in here.chunk_by(|a, b| a.name == b.name) {
        let span = diagnostics.time_span(ctx.command_encoder(), named[0].name);
        for pass in named {
            // Nothing is missing: passes are planned only if they can run.
            let _ = draw(pass, &view, &frame, &mut ctx);
        }
        span.end(ctx.command_encoder());
    }
    if *place == Place::Present && *placement == PropPlacement::Scene && !here.is_empty() {
        copy_depth(&frame, &mut ctx);
    }
    view.passes = passes;
}

/// Compares the scene, and the light on props, with what they were in the last frame, if a result of this frame may be
/// cached.
fn compare(place: Place, view: &mut PropView, frame: &Frame, ctx: &mut RenderContext) {
    let PropView { plan, cached, textures, buffers, .. } = view;
    let results = match place {
        Place::Layer => &[CachedResult::Layer][..],
        Place::Posterize => &[CachedResult::Composite, CachedResult::Labels],
        Place::Hide | Place::Restore | Place::Present | Place::Objects => &[],
    };
    for result in results {
        let scene = match result {
            CachedResult::Layer => Some(frame.depth.view()),
            CachedResult::Composite => plan.posterizes.then(|| frame.target.main_texture_view()),
            CachedResult::Labels => Slot::of_light(plan).and_then(|slot| textures.get(slot)),
        };
        let comparison = frame.pipelines.comparison.as_ref();
        cached.compare(*result, scene, plan, buffers, comparison, frame.cache, ctx);
    }
}

/// Draws a pass. Returns `None` if something is missing.
fn draw(pass: &Pass, view: &PropView, frame: &Frame, ctx: &mut RenderContext) -> Option<()> {
    let cache = frame.cache;
    // It lists elements, a bit each.
    for slot in pass.stores.iter().filter(|slot| matches!(slot, Slot::BatchGaps | Slot::BatchEdges)) {
        ctx.command_encoder().clear_buffer(view.textures.buffer(*slot)?, 0, None);
    }
    // What may be cached is cleared by a draw call, because only the GPU knows whether it must be.
    let may_keep = pass.result.is_some_and(|result| !view.cached.is_drawn(result));
    let clear = pass.clear.or(pass.covers_all.then_some(Clear::Zero)).filter(|_| !may_keep);
    let (colors, depth) = attachments(pass, view, frame, clear)?;
    let first = first_group(pass, view, frame, ctx)?;
    // Only this group has dynamic offsets.
    let offsets = view.lights.as_ref().filter(|_| pass.group == FirstGroup::Lights).map_or(&[][..], |(_, all)| all);
    let bound: Vec<_> =
        pass.bound().map(|(access, slots)| group(pass, access, slots, view, frame, ctx)).collect::<Option<_>>()?;

    let mut recorded = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(pass.name),
        color_attachments: &colors,
        depth_stencil_attachment: depth,
        ..default()
    });
    let area = pass.area(&view.plan);
    let (corner, size) = (area.min.as_vec2(), area.size().as_vec2());
    recorded.set_viewport(corner.x, corner.y, size.x, size.y, 0.0, 1.0);
    recorded.set_scissor_rect(area.min.x, area.min.y, area.width(), area.height());
    recorded.set_bind_group(0, &first, offsets);
    if let (true, Some(id)) = (may_keep, pass.clearing) {
        recorded.set_render_pipeline(cache.get_render_pipeline(id)?);
        recorded.draw(0..3, 0..1);
    }
    for draw in &pass.draws {
        recorded.set_render_pipeline(cache.get_render_pipeline(*pass.pipelines.get(draw.program)?)?);
        let mut next = 1;
        if let Some(field) = &draw.field {
            recorded.set_bind_group(1, field, &[]);
            next = 2;
        }
        if pass.programs.get(draw.program)?.reads {
            for (index, group) in (next..).zip(&bound) {
                recorded.set_bind_group(index, group, &[]);
            }
        }
        recorded.draw(draw.vertices.clone(), draw.instance..draw.instance + 1);
    }
    Some(())
}

type Attachments<'a> = (Vec<Option<RenderPassColorAttachment<'a>>>, Option<RenderPassDepthStencilAttachment<'a>>);

/// Returns what a pass draws to. Where it does not `clear` them, they keep what they hold.
fn attachments<'a>(
    pass: &Pass,
    view: &'a PropView,
    frame: &Frame<'a>,
    clear: Option<Clear>,
) -> Option<Attachments<'a>> {
    let attach = |slot: &Slot| {
        let load = clear.map_or(LoadOp::Load, |clear| LoadOp::Clear(clear.color()));
        Some(match slot {
            Slot::Target => match view.plan.placement {
                PropPlacement::Scene => frame.target.get_color_attachment(),
                // Post-processing continues with the resolved texture.
                PropPlacement::Display => frame.target.get_unsampled_color_attachment(),
            },
            Slot::PrepassMotion => frame.prepass?.motion_vectors.as_ref()?.get_attachment(),
            slot => RenderPassColorAttachment {
                view: view.textures.get(*slot)?,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load, store: StoreOp::Store },
            },
        })
    };
    let colors = pass.writes.iter().map(attach).collect();
    let depth = match pass.depth {
        Some(Slot::TargetDepth) => Some(frame.depth.get_attachment(StoreOp::Store)),
        Some(slot) => {
            let load = if clear.is_some() { LoadOp::Clear(0.0) } else { LoadOp::Load };
            // Without operations, it is only tested.
            let depth_ops = pass.writes_depth().then_some(Operations { load, store: StoreOp::Store });
            Some(RenderPassDepthStencilAttachment { view: view.textures.get(slot)?, depth_ops, stencil_ops: None })
        }
        None => None,
    };
    Some((colors, depth))
}

/// Returns bind group 0 of a pass.
fn first_group(pass: &Pass, view: &PropView, frame: &Frame, ctx: &RenderContext) -> Option<BindGroup> {
    if pass.group == FirstGroup::Lights {
        return view.lights.as_ref().map(|(group, _)| group.clone());
    }
    let mut resources = view.buffers.bindings(frame.palettes)?;
    if pass.group.samples().is_some() {
        // Where objects are hidden and drawn again, the scene's depth holds props.
        let is_saved = pass.feature == Feature::Objects;
        let scene_depth = if is_saved { view.textures.get(Slot::SceneDepth)? } else { frame.depth.view() };
        resources.push(BindingResource::TextureView(scene_depth));
    }
    if let FirstGroup::Batches(_, list) = pass.group {
        resources.push(view.textures.buffer(list)?.as_entire_binding());
    }
    Some(bind(ctx.render_device(), frame.cache, &frame.pipelines.first_layout(pass.group), &resources))
}

/// Returns the bind group of what a pass reads or stores to.
fn group(
    pass: &Pass,
    access: Access,
    slots: &[Slot],
    view: &PropView,
    frame: &Frame,
    ctx: &RenderContext,
) -> Option<BindGroup> {
    let PropView { textures, buffers, .. } = view;
    let resource = |slot: &Slot| match slot {
        Slot::View => buffers.view.binding(),
        Slot::Screen => buffers.screen.binding(),
        Slot::Lit => buffers.lit.binding(),
        Slot::Shades => buffers.shades.binding(),
        Slot::Scene => Some(BindingResource::TextureView(frame.target.main_texture_view())),
        slot => match textures.buffer(*slot) {
            Some(buffer) => Some(buffer.as_entire_binding()),
            None => Some(BindingResource::TextureView(textures.get(*slot)?)),
        },
    };
    let resources: Vec<_> = slots.iter().map(resource).collect::<Option<_>>()?;
    let layout = frame.pipelines.bound_layout(pass.name, access, slots);
    Some(bind(ctx.render_device(), frame.cache, &layout, &resources))
}

/// Copies the depth of the scene, which now includes props, to the texture that effects read, as Bevy's prepass does, if
/// there is one.
fn copy_depth(frame: &Frame, ctx: &mut RenderContext) {
    if let Some(prepass) = frame.prepass
        && let Some(depth) = &prepass.depth
    {
        let (from, to) = (frame.depth.texture.as_image_copy(), depth.texture.texture.as_image_copy());
        ctx.command_encoder().copy_texture_to_texture(from, to, prepass.size);
    }
}

impl Clear {
    fn color(self) -> wgpu::Color {
        match self {
            Self::Zero => wgpu::Color::TRANSPARENT,
            Self::White => wgpu::Color { a: 0.0, ..wgpu::Color::WHITE },
            Self::NegativeAlpha => wgpu::Color { a: -1.0, ..wgpu::Color::TRANSPARENT },
        }
    }
}
