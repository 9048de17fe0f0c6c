//! Plans the frames of all views, and prepares what their passes need.

use bevy::{
    camera::{MainPassResolutionOverride, NormalizedRenderTarget},
    core_pipeline::{
        core_3d::{Transparent3d, prepare_core_3d_depth_textures},
        oit::OrderIndependentTransparencySettings,
        prepass::PreviousViewData,
    },
    ecs::entity::EntityHashSet,
    platform::collections::HashMap,
    prelude::*,
    render::{
        GpuResourceAppExt, Render, RenderStartup, RenderSystems,
        camera::{ExtractedCamera, TemporalJitter},
        render_asset::RenderAssets,
        render_phase::ViewSortedRenderPhases,
        render_resource::{BufferUsages, CachedRenderPipelineId, PipelineCache, TextureUsages},
        renderer::{RenderDevice, RenderQueue},
        sync_world::MainEntity,
        view::ExtractedView,
    },
};

use super::{
    extract::{ExtractedProps, VisibleProps},
    frame::{Comparison, Pass, Pipelines, PropView, RaySet, Slot},
    passes,
    plan::{Feature, Known, Plan, choose_levels, decide, drawn_viewport, look_ahead},
    uniforms::PaletteBuffer,
};
use crate::{
    camera::PropPlacement,
    gpu::{FieldReports, GpuField, LeftOut, Readiness, Report, Shaders, ViewTooLarge},
    sets::PlenOctreeRenderSystems,
};

/// Plans the frames of views.
pub(super) fn plugin(render_app: &mut SubApp) {
    render_app.world_mut().register_required_components::<VisibleProps, PropView>();
    render_app
        .init_gpu_resource::<PaletteBuffer>()
        .add_systems(RenderStartup, (forget_views, init).chain())
        .add_systems(
            Render,
            (
                agree_about_targets.in_set(RenderSystems::CreateViews),
                read_depth.before(prepare_core_3d_depth_textures).in_set(RenderSystems::PrepareResources),
                choose_levels.in_set(PlenOctreeRenderSystems::ChooseLevels),
                plan_views.in_set(PlenOctreeRenderSystems::PlanViews),
            ),
        );
}

fn init(mut commands: Commands, shaders: Res<Shaders>) {
    #[cfg(feature = "shadows")]
    let lights = Some(passes::lights_layout());
    #[cfg(not(feature = "shadows"))]
    let lights = None;
    commands.insert_resource(Pipelines::new(&shaders, lights));
}

/// Removes the components of views that belong to a lost device. The next extraction adds them again.
fn forget_views(mut commands: Commands, views: Query<Entity, With<VisibleProps>>) {
    for view in &views {
        commands.entity(view).remove_with_requires::<VisibleProps>();
    }
}

/// Lets the cameras of a target agree about its size. Bevy tells them of a new size a frame later, unless they are new
/// or change themselves, and the textures that they share are of the size that any of them expects: which one may
/// differ from texture to texture, because cameras that draw props are listed elsewhere than others.
fn agree_about_targets(
    mut cameras: Query<&mut ExtractedCamera>,
    mut sizes: Local<HashMap<NormalizedRenderTarget, UVec2>>,
) {
    sizes.clear();
    for mut camera in &mut cameras {
        if let (Some(target), Some(size)) = (camera.target.clone(), camera.physical_target_size) {
            camera.physical_target_size = Some(*sizes.entry(target).or_insert(size));
        }
    }
}

/// Lets passes read the depth textures of cameras that draw something, and at the display, save them.
fn read_depth(mut cameras: Query<(&mut Camera3d, &VisibleProps)>) {
    for (mut camera, visible) in &mut cameras {
        if !visible.is_empty() {
            camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
            if visible.placement == PropPlacement::Display {
                camera.depth_texture_usages.0 |= TextureUsages::COPY_SRC.bits();
            }
        }
    }
}

type View = (
    &'static MainEntity,
    Option<(&'static ExtractedView, &'static ExtractedCamera, &'static Msaa)>,
    Option<&'static MainPassResolutionOverride>,
    (Option<&'static TemporalJitter>, Option<&'static PreviousViewData>, Has<OrderIndependentTransparencySettings>),
    &'static mut VisibleProps,
    &'static mut PropView,
);

pub(super) fn plan_views(
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    (device, queue): (Res<RenderDevice>, Res<RenderQueue>),
    (cache, shaders): (Res<PipelineCache>, Res<Shaders>),
    mut pipelines: ResMut<Pipelines>,
    phases: Option<Res<ViewSortedRenderPhases<Transparent3d>>>,
    (reports, mut readiness): (Res<FieldReports>, ResMut<Readiness>),
    mut palettes: ResMut<PaletteBuffer>,
    mut views: Query<View>,
) {
    palettes.0.set(&device, &queue, "plenoctree_palettes", BufferUsages::STORAGE, &extracted.colors.list);
    pipelines.waiting.clear();
    let mut rests = false;
    for (camera_entity, camera, resolution, (jitter, previous, has_oit), mut visible, mut view) in &mut views {
        let view = &mut *view;
        let drawn = camera.zip(camera.and_then(|(_, camera, _)| drawn_viewport(camera, resolution)));
        let Some(((extracted_view, camera, msaa), viewport)) = drawn.filter(|_| !visible.is_empty()) else {
            view.clear();
            view.shortage = None;
            continue;
        };
        if is_short_of_memory(view, viewport.physical_size, visible.props.len()) {
            visible.clear();
            view.clear();
            continue;
        }
        let phase = phases.as_ref().and_then(|phases| phases.get(&extracted_view.retained_view_entity));
        let known = Known {
            extracted: &extracted,
            fields: &fields,
            view: extracted_view,
            camera,
            samples: msaa.samples(),
            viewport,
            // After upscaling, textures with the size of the main pass no longer fit the target.
            placement: resolution.map_or(visible.placement, |_| PropPlacement::Scene),
            jitter,
            previous,
            visible: &visible,
            // Their order is resolved once a frame.
            has_objects: !has_oit && phase.is_some_and(|phase| !phase.items.is_empty()),
            last: &view.plan,
            former: view.plan.former.as_ref().filter(|_| view.is_drawn),
        };
        let (planned, left_out) = plan(&known, &mut view.held_frames, &mut pipelines, &cache);
        let (ahead, kinds) = look_ahead(&known);
        passes::request(&ahead, &kinds, &mut pipelines, &cache);
        let Some((mut plan, passes)) = planned else {
            view.clear();
            (view.left_out, view.shortage) = (left_out, None);
            continue;
        };
        passes::request_alike(&mut plan, &kinds, &mut pipelines, &cache);
        (view.plan, view.left_out, view.is_drawn) = (plan, left_out, false);
        view.passes = passes;
        let PropView { plan, passes, textures, buffers, cached, .. } = view;
        if plan.follows_last {
            textures.swap(Slot::Labels, Slot::FormerLabels);
            textures.swap(Slot::Depth(RaySet::Pixels), Slot::FormerDepth);
        }
        let has_memory = textures.provide(&device, passes, plan);
        buffers.set(&device, &queue, &plan.values);
        #[cfg(feature = "shadows")]
        if plan.is_lit {
            let lit = passes::lit_props(plan, &extracted, &mut view.shades);
            buffers.lit.set(&device, &queue, "plenoctree_lit", BufferUsages::STORAGE, &lit);
            buffers.shades.set(&device, &queue, "plenoctree_shades", BufferUsages::STORAGE, &view.shades.colors);
        } else {
            view.shades = default();
            (buffers.lit, buffers.shades) = default();
        }
        if has_memory {
            rests |= cached.decide(&device, passes, textures, buffers, left_out < LeftOut::More, plan);
        }
        if !has_memory || view.textures.allocator.error().is_some() {
            report_shortage(view, visible.props.len(), camera_entity.id(), &reports);
            continue;
        }
        view.shortage = None;
        view.buffers.set_first_drawn(&device, &queue, view.cached.first_drawn());
    }
    readiness.waiting.clone_from(&pipelines.waiting);
    readiness.left_out = views.iter().map(|(.., view)| view.left_out).max().unwrap_or_default();
    if rests {
        pipelines.comparison.get_or_insert_with(|| Comparison::new(&cache, &shaders));
    }
}

/// The most frames for which a view is drawn as before because of pipelines that are not ready. They may never be.
/// Fewer than those for which a level is kept that is drawn but no longer requested.
const MOST_HELD_FRAMES: u32 = 500;

/// Plans the frame of a view, without what needs a pipeline that is not ready. If the last frame drew that, all is
/// drawn as then. Returns the plan with its passes, or `None` if nothing is drawn, and what was left out.
fn plan(
    known: &Known,
    held_frames: &mut u32,
    pipelines: &mut Pipelines,
    cache: &PipelineCache,
) -> (Option<(Plan, Vec<Pass>)>, LeftOut) {
    let (mut missing, mut left_out) = (vec![], LeftOut::Nothing);
    let mut may_hold = known.last.keeps(Feature::Base) && *held_frames < MOST_HELD_FRAMES;
    loop {
        let Some(mut plan) = decide(known, &missing, None) else {
            return (None, left_out);
        };
        // Textures of the scene follow these.
        let kind = |plan: &Plan| (plan.placement, plan.samples, plan.target.format);
        may_hold &= kind(&plan) == kind(known.last);
        let (passes, lack) = with_pipelines(&plan, known.last, pipelines, cache);
        if lack.was_drawn
            && std::mem::take(&mut may_hold)
            && let Some(plan) = decide(known, &[], Some(known.last))
            && let (passes, Lack { is_any: false, .. }) = with_pipelines(&plan, known.last, pipelines, cache)
        {
            *held_frames += 1;
            return (Some((plan, passes)), LeftOut::More);
        }
        match lack.feature {
            None => {
                *held_frames = 0;
                plan.props.iter_mut().for_each(|prop| prop.is_left_out = lack.props.contains(&prop.entity));
                return (Some((plan, passes)), if lack.is_any { LeftOut::More } else { left_out });
            }
            Some(Feature::Base) => return (None, LeftOut::More),
            Some(feature) => {
                missing.push(feature);
                let fails = feature == Feature::Stages && lack.fails;
                left_out = left_out.max(if fails { LeftOut::Stages } else { LeftOut::More });
            }
        }
    }
}

/// What a plan must do without because a pipeline is not ready.
#[derive(Default)]
struct Lack {
    /// Whether it does without anything, be it the clearing of results.
    is_any: bool,
    /// A feature without which to plan again.
    feature: Option<Feature>,
    /// Whether a pipeline of this feature could not be created.
    fails: bool,
    /// Whether the last frame drew some of it.
    was_drawn: bool,
    /// The props that are not drawn.
    props: EntityHashSet,
}

/// Returns the passes of a plan with their pipelines, without the props whose pipelines are not ready.
fn with_pipelines(plan: &Plan, last: &Plan, pipelines: &mut Pipelines, cache: &PipelineCache) -> (Vec<Pass>, Lack) {
    let (mut passes, mut lack) = (passes::of(plan), Lack::default());
    let target = plan.target.format;
    for pass in &mut passes {
        let ready: Vec<_> = pass.programs.iter().map(|program| pipelines.get(cache, pass, program, target)).collect();
        if ready.iter().any(Option::is_none) {
            lack.is_any = true;
            if pass.may_leave_out_props() {
                let drawn: EntityHashSet = last.drawn_props().map(|prop| prop.entity).collect();
                // The others only find out what hides props.
                let draws_props = matches!(pass.writes[..], [Slot::Color(_), ..]);
                pass.draws.retain(|draw| {
                    let is_ready = ready.get(draw.program).is_some_and(Option::is_some);
                    if let Some(prop) = draw.prop_of(plan).filter(|_| !is_ready) {
                        lack.was_drawn |= drawn.contains(&prop.entity);
                        lack.props.extend(draws_props.then_some(prop.entity));
                    }
                    is_ready
                });
            } else if lack.feature.is_none() {
                lack.feature = Some(pass.feature);
                lack.fails = pass.programs.iter().any(|program| pipelines.fails(cache, pass, program, target));
            }
        }
        pass.pipelines = ready.into_iter().map(|id| id.unwrap_or(CachedRenderPipelineId::INVALID)).collect();
        if pass.result.is_some() && pass.clear.is_some() {
            pass.clearing = pipelines.clear(cache, pass, target);
            lack.is_any |= pass.clearing.is_none();
        }
    }
    lack.was_drawn |= lack.feature.is_some_and(|feature| last.keeps(feature));
    (passes, lack)
}

/// Returns whether a view had too little memory a moment ago, and needs as much as then.
fn is_short_of_memory(view: &mut PropView, size: UVec2, props: usize) -> bool {
    let needs_same = view.shortage.as_ref().is_some_and(|(error, of)| error.size == size && *of == props);
    if needs_same && view.textures.allocator.is_pausing() {
        return true;
    }
    view.textures.allocator.try_again();
    false
}

/// Lets a view draw nothing because it has too little memory, and gives back what it got.
fn report_shortage(view: &mut PropView, props: usize, camera: Entity, reports: &FieldReports) {
    let too_large = ViewTooLarge { size: view.plan.viewport.physical_size };
    let error =
        view.textures.allocator.error().unwrap_or("a buffer would be larger than the device may bind").to_string();
    if view.shortage.is_none() {
        error!("camera {camera} draws no props: {too_large}: {error}");
        reports.send(Report::View(camera, too_large.clone()));
    }
    view.shortage = Some((too_large, props));
    view.clear();
}
