//! Decides what a view draws in a frame.

use std::hash::{BuildHasher, Hash, Hasher};

use super::{
    motion::{Former, FormerProp, Motion},
    overlap::overlaps,
    view::{Feature, Kind, Plan, PlannedProp, SPACING, Target},
};
use crate::{
    camera::PropPlacement,
    gpu::{GpuField, GpuLevel, Level},
    posterize::{BeforePalette, EdgeSmoothing, MAX_FILTER_RADIUS},
    prop::SolidOpacity,
    render::{
        colors::PlacedPalette,
        extract::{ExtractedInk, ExtractedPosterize, ExtractedProp, ExtractedProps, OrderedProp, VisibleProps},
        rays::{Rays, covered, depth_from_distance, is_orthographic},
        uniforms::{FilterUniform, LabelsUniform, PlanValues, PropUniform, Rect, ScreenUniform, Smooths, ViewUniform},
    },
};
use bevy::{
    camera::{Exposure, Viewport},
    core_pipeline::prepass::PreviousViewData,
    ecs::entity::EntityHashMap,
    platform::{collections::HashMap, hash::FixedHasher},
    prelude::*,
    render::{
        camera::{ExtractedCamera, TemporalJitter},
        render_asset::RenderAssets,
        view::ExtractedView,
    },
};

/// The largest number of lists of pixels at edges, which take an eighth of a byte per pixel each. A power of two, so that
/// buffers of them are seldom recreated.
const MOST_LISTS: u32 = 16;

/// What is known of a view before its frame is planned.
pub(in crate::render) struct Known<'a> {
    pub extracted: &'a ExtractedProps,
    pub fields: &'a RenderAssets<GpuField>,
    pub view: &'a ExtractedView,
    pub camera: &'a ExtractedCamera,
    pub samples: u32,
    pub viewport: Viewport,
    /// Where in the frame the props are shown.
    pub placement: PropPlacement,
    pub jitter: Option<&'a TemporalJitter>,
    pub previous: Option<&'a PreviousViewData>,
    pub visible: &'a VisibleProps,
    pub has_objects: bool,
    /// The plan of the last frame.
    pub last: &'a Plan,
    /// The last frame, if its labels and its depth exist.
    pub former: Option<&'a Former>,
}

impl Known<'_> {
    pub fn in_scene(&self) -> bool {
        self.placement == PropPlacement::Scene
    }

    pub fn has_fog(&self) -> bool {
        self.in_scene() && self.visible.has_fog
    }

    pub fn has_motion(&self) -> bool {
        self.in_scene() && self.visible.has_motion
    }

    pub fn is_lit(&self, prop: &ExtractedProp) -> bool {
        self.in_scene() && self.visible.has_lights && prop.lighting.is_some()
    }
}

/// A prop whose rays are known.
struct VisibleProp<'a> {
    index: usize,
    prop: &'a ExtractedProp,
    field: &'a GpuLevel,
    level: Level,
    rays: Rays,
    posterize: Option<&'a ExtractedPosterize>,
    /// The palette by which it is posterized, or recolored as trained.
    palette: Option<&'a PlacedPalette>,
    /// What was planned of it, in a view that is held.
    held: Option<&'a PlannedProp>,
}

impl VisibleProp<'_> {
    fn may_be_solid(&self) -> bool {
        self.prop.solid != SolidOpacity::Never
    }
}

/// How pixels look that a prop or the posterized view owns: how they are posterized, the palette, and the lines.
type Owner<'a> = (Option<&'a ExtractedPosterize>, Option<&'a PlacedPalette>, Option<ExtractedInk>);

/// Plans the frame of a view, without what is `missing`. Returns `None` if it draws nothing.
///
/// With a `held` plan, that of the last frame, it draws the same levels of the same props with the same pipelines, in
/// their current places and colors. What is new waits, and of what is gone, only the pipelines stay: they draw the same
/// without it.
pub(in crate::render) fn decide(known: &Known, missing: &[Feature], held: Option<&Plan>) -> Option<Plan> {
    let Known { extracted, view, camera, visible, viewport, placement, .. } = known;
    let in_scene = known.in_scene();
    let size = viewport.physical_size;
    // At the display, the effects that jitter is for are over.
    let motion = Motion::new(view, known.jitter.filter(|_| in_scene), known.previous, size);
    let frame = Frame { known, missing, held, motion: &motion };
    let is_sparse =
        held.map_or(visible.quality.ray_tolerance > 0.0 && frame.has(Feature::Sparse), |held| held.is_sparse);
    let spacing = if is_sparse { SPACING } else { 1 };

    // What is drawn, and where.
    let seen = frame.seen();
    let rects: Vec<_> = seen.iter().map(|seen| covered(seen.rays.clip_from_box, size)).collect();
    let view_posterize = frame.view_posterize();
    // The viewport may be that of another size. See `agree_about_targets`.
    let target_size = camera.physical_target_size?;
    let most = target_size.saturating_sub(viewport.physical_position).min(size);
    let rect = match view_posterize {
        Some(_) => Rect { low: UVec2::ZERO, size: most, viewport: size },
        None => drawn_rect(&rects, spacing, size, most)?,
    };
    if rect.size.min_element() == 0 {
        return None;
    }
    let found = overlaps(&rects);
    let overlaps = seen.iter().zip(&found).any(|(seen, found)| *found && seen.may_be_solid());
    let planned = |((seen, covered), found)| frame.planned(seen, covered, &rect, found, overlaps);
    let props: Vec<_> = seen.iter().zip(&rects).zip(found).map(planned).collect();

    // How it looks.
    let colors = &extracted.colors.list;
    let of_props = seen.iter().map(|seen| (seen.posterize, seen.palette, seen.prop.ink.or(visible.ink)));
    let of_view = view_posterize.map(|view| (Some(view), Some(&view.palette), None));
    let owners: Vec<Owner> = of_props.chain(of_view).collect();
    let filters: Vec<_> =
        owners.iter().map(|(posterize, ..)| FilterUniform::new(*posterize, &visible.quality)).collect();
    let pixels = 0.5 * size.y as f32 * motion.clip_from_view.y_axis.y.abs();
    let label = |(posterize, palette, ink): &Owner| LabelsUniform::new(*posterize, *palette, *ink, pixels);
    let mut labelings: Vec<_> = owners.iter().map(label).collect();
    let steady = frame.steady(&seen, colors);
    let steadies = held.map_or(!steady.is_empty(), Plan::steadies);
    let mut now = Former::new(&motion, rect, steady);
    let follows_last = known.former.is_some_and(|former| now.follow(former, &motion));
    for (seen, labeling) in seen.iter().zip(&mut labelings) {
        if let (Some(posterize), Some(former)) = (seen.posterize, now.former(seen.prop.entity)) {
            *labeling = labeling.steady(posterize.settings.steadiness, *former);
        }
    }

    // What pipelines depend on. A held view keeps it.
    let lit = || seen.iter().zip(&props).filter(|(_, prop)| prop.kind.is_lit).map(|(seen, _)| seen.prop);
    let iterations = filters.iter().map(|filter| filter.iterations).max().unwrap_or(0);
    let finishes = frame.has(Feature::Finish);
    let pipelines = held.cloned().unwrap_or_else(|| Plan {
        is_sparse,
        iterations,
        filters_apart: filters.iter().all(FilterUniform::is_apart),
        posterizes: owners.iter().any(|(posterize, ..)| posterize.is_some()),
        posterizes_view: view_posterize.is_some(),
        overlaps,
        tonemapping: visible.tonemapping,
        has_fog: known.has_fog() && frame.has(Feature::Fog),
        is_lit: lit().next().is_some(),
        is_brightened: lit().any(ExtractedProp::is_brightened),
        has_hard_shadows: visible.has_hard_shadows,
        has_several_props: props.len() > 1,
        smooths: props.iter().any(|prop| prop.smooths != Smooths::Nothing),
        estimates_edges: visible.quality.estimates_edges,
        has_smooth_borders: finishes && labelings.iter().any(|labels| labels.smooth_borders > 0),
        has_ink: finishes && labelings.iter().any(|labels| labels.ink.lines > 0),
        stages: if frame.has(Feature::Stages) { visible.stages.clone() } else { vec![] },
        ..default()
    });

    let (mut uniforms, edge_lists) = frame.prop_uniforms(&seen, &props, &rect);
    uniforms.extend(view_posterize.map(|_| PropUniform::view_posterize()));
    let values = PlanValues {
        view: ViewUniform { props: uniforms.len() as u32, edge_lists, ..frame.view_uniform(&rect, spacing) },
        screen: ScreenUniform {
            // Relative to Bevy's default exposure, or 1 after tonemapping. Shaders divide by it.
            exposure: match placement {
                PropPlacement::Scene => (camera.exposure / Exposure::default().exposure()).clamp(1e-6, 1e6),
                PropPlacement::Display => 1.0,
            },
            view_posterize: view_posterize.map_or(0, |_| uniforms.len() as u32),
        },
        palettes: palettes_hash(&owners, colors),
        props: uniforms,
        filters,
        labelings,
    };
    Some(Plan {
        viewport: viewport.clone(),
        rect,
        placement: *placement,
        samples: known.samples,
        target: Target {
            format: view.target_format,
            samples: if in_scene { known.samples } else { 1 },
            space: camera.compositing_space,
            size: target_size,
        },
        has_lamps: visible.has_lamps,
        smooths_all_light: pipelines.is_brightened && lit().all(ExtractedProp::is_brightened),
        // How often a held view filters may change, but not whether it does, or whether it does so more than once.
        iterations: if pipelines.iterations > 1 { iterations.max(1) } else { pipelines.iterations },
        has_motion: known.has_motion() && held.is_none_or(|held| held.has_motion),
        // A posterized view shows nothing but labels.
        has_objects: known.has_objects && frame.has(Feature::Objects) && !in_scene && view_posterize.is_none(),
        former: steadies.then_some(now),
        follows_last,
        recolors: seen.iter().any(|seen| seen.prop.recolor.is_some_and(|palette| palette.is_changed)),
        props,
        values,
        ..pipelines
    })
}

/// What decisions are made from. See [`decide`].
struct Frame<'a> {
    known: &'a Known<'a>,
    missing: &'a [Feature],
    held: Option<&'a Plan>,
    motion: &'a Motion,
}

impl<'a> Frame<'a> {
    fn has(&self, feature: Feature) -> bool {
        self.held.map_or(!self.missing.contains(&feature), |held| held.keeps(feature))
    }

    /// Returns the props that can be drawn, back to front. In a view that is held, only those of the last frame are.
    fn seen(&self) -> Vec<VisibleProp<'a>> {
        let last = self.known.last.drawn_props().map(|prop| (prop.entity, prop)).collect();
        self.known.visible.order.iter().filter_map(|ordered| self.see(ordered, &last)).collect()
    }

    /// Returns a prop with its rays, if it can be drawn. As long as there are no labels, a posterized prop is only drawn if
    /// the `last` frame drew it as trained, or its settings say so.
    fn see(&self, ordered: &OrderedProp, last: &EntityHashMap<&'a PlannedProp>) -> Option<VisibleProp<'a>> {
        let known = self.known;
        let prop = known.extracted.props.get(ordered.index)?;
        let last = last.get(&prop.entity).copied();
        let held = if self.held.is_some() { Some(last?) } else { None };
        let (field, level, pose) = prop.at_level(held.map_or(ordered.level, |held| held.level), known.fields)?;
        let size = known.viewport.physical_size;
        let rays = pose.rays(&known.view.world_from_view, self.motion.clip_from_view, size)?;
        let posterize = prop.posterize.as_ref().filter(|posterize| posterize.palette.colors > 0);
        let has_labels = self.has(Feature::Posterize);
        if posterize.is_some_and(|posterize| posterize.settings.before_palette == BeforePalette::Hide)
            && !has_labels
            && last.is_none_or(|last| last.is_posterized)
        {
            return None;
        }
        let palette = posterize.map(|posterize| &posterize.palette).or(prop.recolor.as_ref());
        Some(VisibleProp {
            index: ordered.index,
            prop,
            field,
            level,
            rays,
            posterize: posterize.filter(|_| has_labels && held.is_none_or(|held| held.is_posterized)),
            palette,
            held,
        })
    }

    /// Returns how the view is posterized, if it is.
    fn view_posterize(&self) -> Option<&'a ExtractedPosterize> {
        let view = self.known.visible.view_posterize.as_ref();
        view.filter(|view| view.palette.colors > 0 && self.has(Feature::Posterize))
            .filter(|_| self.held.is_none_or(|held| held.posterizes_view))
    }

    /// Decides what is drawn of a prop that covers these pixels of the viewport, of which `rect` is drawn. `found` says
    /// whether it overlaps others, and `overlaps` whether that matters anywhere in the view.
    fn planned(&self, seen: &VisibleProp, covered: &URect, rect: &Rect, found: bool, overlaps: bool) -> PlannedProp {
        let held = seen.held;
        let in_rect = |corner: UVec2| corner.saturating_sub(rect.low).min(rect.size);
        let is_smooth = seen.posterize.is_some_and(|posterize| posterize.settings.edges == EdgeSmoothing::Coverage)
            && held.map_or(self.has(Feature::Edges), |held| held.smooths != Smooths::Nothing);
        let kind = Kind {
            shape: seen.field.shape,
            overlaps: found && overlaps,
            is_lit: self.known.is_lit(seen.prop) && self.has(Feature::Lighting),
            may_recolor: seen.prop.recolor.is_some(),
        };
        PlannedProp {
            entity: seen.prop.entity,
            index: seen.index,
            field: seen.field.bind_group.clone(),
            level: seen.level,
            kind: held.map_or(kind, |held| Kind { shape: kind.shape, ..held.kind }),
            may_be_solid: held.map_or(seen.may_be_solid(), |held| held.may_be_solid),
            is_posterized: seen.posterize.is_some(),
            smooths: match (is_smooth, found) {
                (false, _) => Smooths::Nothing,
                (true, true) => Smooths::Silhouette,
                (true, false) => Smooths::Slits,
            },
            rect: URect { min: in_rect(covered.min), max: in_rect(covered.max) },
            is_left_out: false,
        }
    }

    /// Returns the uniforms of props, and the number of lists of pixels at edges. Props of a field share a list. Those of
    /// many fields do, too.
    fn prop_uniforms(&self, seen: &[VisibleProp], props: &[PlannedProp], rect: &Rect) -> (Vec<PropUniform>, u32) {
        let mut fields = HashMap::new();
        let uniform = |(seen, prop): (&VisibleProp, &PlannedProp)| {
            let previous = self.motion.previous_from_clip(seen.prop);
            let quality = &self.known.visible.quality;
            let mut uniform =
                PropUniform::new(seen.prop, &seen.rays, rect, previous, quality, seen.posterize, prop.smooths);
            let (first, size) = prop.batches();
            (uniform.first_batch, uniform.batches_across) = (first, size.x);
            if prop.smooths != Smooths::Nothing {
                let next = fields.len() as u32;
                uniform.field = *fields.entry(prop.field.id()).or_insert(next);
            }
            uniform
        };
        let uniforms = seen.iter().zip(props).map(uniform).collect();
        (uniforms, (fields.len() as u32).clamp(1, MOST_LISTS).next_power_of_two())
    }

    /// Returns the props that may keep their labels in the next frame.
    fn steady(&self, seen: &[VisibleProp], colors: &[Vec4]) -> EntityHashMap<FormerProp> {
        let keeps = self.known.visible.quality.steady_labels && self.has(Feature::Finish);
        let steady = (1..).zip(seen).filter_map(|(owner, seen)| {
            let posterize = seen.posterize.filter(|posterize| keeps && posterize.settings.is_steady())?;
            let (place, field) = (seen.prop.pose.world_from_prop, seen.prop.field);
            Some((seen.prop.entity, FormerProp::new(owner, place, field, labels_hash(posterize, colors))))
        });
        steady.collect()
    }

    /// Returns the uniform of the view, but for what follows from the props.
    fn view_uniform(&self, rect: &Rect, spacing: u32) -> ViewUniform {
        let Known { view, viewport, visible, samples, .. } = self.known;
        let clip_from_view = self.motion.clip_from_view;
        ViewUniform {
            corner: viewport.physical_position + rect.low,
            size: rect.size,
            depth: depth_from_distance(view.clip_from_view),
            spacing,
            ray_tolerance: visible.quality.ray_tolerance,
            stop_transmittance: visible.quality.stop_transmittance,
            edge_rays: if *samples > 1 { 8 } else { visible.quality.edge_rays },
            unjittered_from_clip: (self.motion.unjittered_from_clip * rect.viewport_from_clip()).as_mat4(),
            // Nothing is divided by an empty range.
            depth_range: Vec2::new(viewport.depth.start, (viewport.depth.end - viewport.depth.start).max(1e-6)),
            height: if is_orthographic(clip_from_view) { (2.0 / clip_from_view.y_axis.y).abs() } else { 0.0 },
            ..default()
        }
    }
}

/// Returns the part of the viewport to draw: the pixels of `rects`, how far a prop can be seen from them, and how far
/// from there the filter reads, but no pixel from `most` on. A pixel between the rays of the grid is interpolated. The
/// grid begins at a multiple of its spacing, so that it is the same wherever the part begins.
fn drawn_rect(rects: &[URect], spacing: u32, viewport: UVec2, most: UVec2) -> Option<Rect> {
    let covered = rects.iter().filter(|rect| !rect.is_empty()).copied().reduce(|a, b| a.union(b))?;
    let reach = spacing + MAX_FILTER_RADIUS;
    let low = covered.min.saturating_sub(UVec2::splat(reach)) / spacing * spacing;
    let high = (covered.max + reach).min(most);
    Some(Rect { low, size: high.saturating_sub(low), viewport })
}

/// Returns a number that is different for different labels: what their source colors are, and how they blend.
fn labels_hash(posterize: &ExtractedPosterize, colors: &[Vec4]) -> u64 {
    let (first, count) = (posterize.palette.first_color as usize, posterize.palette.colors as usize);
    let source = bytemuck::cast_slice::<_, u8>(colors.get(first..first + count).unwrap_or_default());
    FixedHasher.hash_one((source, posterize.settings.blend_steps, posterize.palette.is_of_tones()))
}

/// Returns a number that is different for different colors of the palettes, and for different pairs of ramps between
/// which ink is drawn.
fn palettes_hash(owners: &[Owner], colors: &[Vec4]) -> u64 {
    let mut hasher = FixedHasher.build_hasher();
    for (_, palette, ink) in owners {
        let pairs = ink.as_ref().map(|ink| bytemuck::cast_slice::<_, u8>(ink.pairs_in(colors)));
        (palette.map(|palette| palette.hash), pairs).hash(&mut hasher);
    }
    hasher.finish()
}
