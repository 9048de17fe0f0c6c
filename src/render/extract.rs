//! Extracts props and cameras to the render world, into buffers that are reused in every frame.

use std::any::TypeId;

use bevy::{
    asset::LoadState,
    camera::visibility::VisibleEntities,
    core_pipeline::{prepass::MotionVectorPrepass, tonemapping::Tonemapping},
    ecs::entity::EntityHashMap,
    prelude::*,
    render::{Extract, render_asset::RenderAssets, render_resource::ShaderType, sync_world::RenderEntity},
};

use plenoctree::{PlenOctree, palette::Palette};

use super::{
    colors::{PlacedColors, PlacedPalette},
    rays::Pose,
};
use crate::{
    camera::{LabelStages, PosterizeView, PropPlacement},
    gpu::{GpuField, GpuLevel, Level},
    ink::{Ink, InkBorders, InkColor, MAX_INK_PIXELS},
    lighting::PropLighting,
    palette::{FieldPalette, PaletteExtraction, PaletteOverride, Palettes},
    posterize::{BeforePalette, Posterize},
    prop::{DrawnField, Prop, PropTint, SolidOpacity},
    quality::PropQuality,
    recolor::{Recolor, before_palette},
    state::DrawnOverride,
};

/// Every prop that a camera may see in this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedProps {
    pub props: Vec<ExtractedProp>,
    /// The palette colors of all props and posterized views.
    pub colors: PlacedColors,
    /// The index in `props` of each entity of the main world.
    pub index: EntityHashMap<usize>,
    /// The transforms of the previous frame, if a camera draws motion vectors.
    transforms: EntityHashMap<GlobalTransform>,
}

pub(super) struct ExtractedProp {
    pub entity: Entity,
    pub field: AssetId<PlenOctree>,
    pub pose: Pose,
    /// The prop's transform in the previous frame.
    pub previous: GlobalTransform,
    pub solid: SolidOpacity,
    /// The factors of linear light.
    pub tint: Vec3,
    pub posterize: Option<ExtractedPosterize>,
    /// The palette by which it is recolored as trained. `None` if it is posterized.
    pub recolor: Option<PlacedPalette>,
    pub ink: Option<ExtractedInk>,
    /// The index of the prop with its earlier field, which is drawn until this one is on the GPU.
    pub stand_in: Option<usize>,
    pub lighting: Option<PropLighting>,
}

impl ExtractedProp {
    pub fn is_brightened(&self) -> bool {
        self.lighting.is_some_and(|lighting| lighting.brightness > 0.0)
    }

    /// Returns its field at a level, or at one that stands in for it, which of the two that is, and its pose: fewer
    /// leaves may have a smaller box.
    pub fn at_level<'a>(
        &self,
        level: Level,
        fields: &'a RenderAssets<GpuField>,
    ) -> Option<(&'a GpuLevel, Level, Pose)> {
        let field = fields.get(self.field)?;
        let level = field.resolve(level);
        let at_level = field.level(level)?;
        let (low, high) = at_level.bounds?;
        Some((&**at_level, level, Pose { low, high, ..self.pose }))
    }
}

impl ExtractedProps {
    /// Returns the index of the prop to draw for prop `index`: itself, or the one that stands in for it, whichever is
    /// on the GPU.
    pub fn drawn(&self, index: usize, fields: &RenderAssets<GpuField>) -> Option<usize> {
        let is_ready = |index: &usize| {
            let field = self.props.get(*index).and_then(|prop| fields.get(prop.field));
            field.is_some_and(|field| field.level(Level::default()).is_some())
        };
        [Some(index), self.props.get(index)?.stand_in].into_iter().flatten().find(is_ready)
    }
}

/// How a prop or a view is posterized: its settings, clamped, and the location of its palette.
#[derive(Clone, Copy)]
pub(super) struct ExtractedPosterize {
    pub settings: Posterize,
    pub palette: PlacedPalette,
}

impl ExtractedPosterize {
    fn new(
        settings: &Posterize,
        field: AssetId<PlenOctree>,
        palette: &FieldPalette,
        own: Option<&PaletteOverride>,
        colors: &mut PlacedColors,
    ) -> Self {
        let blend_steps = settings.blend_steps_of(palette.palette());
        let settings = Posterize { blend_steps, ..*settings }.clamped();
        Self { settings, palette: colors.place_palette(field, palette, own) }
    }
}

/// The lines of a prop. Matches `Ink` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct ExtractedInk {
    /// Which edges have lines, as bits.
    pub lines: u32,
    /// The index in [`ExtractedProps::colors`] of the pairs of ramps that have lines.
    pub pairs: u32,
    /// In linear light, with opacity.
    pub color: Vec4,
    /// The share of the label's own light.
    pub tone: f32,
    /// In world units, and in the uniform in pixels at w = 1 in clip space.
    pub width: f32,
    /// The difference of depth at a crease, in world units.
    pub crease: f32,
    pub max_pixels: f32,
}

/// How many times the width of a line the depth breaks at the faintest crease.
const CREASE: f32 = 8.0;
/// The number of ramps that pairs tell apart: as many as a palette has colors.
const RAMPS: usize = Palette::MAX_COLORS;
/// The bit of lines between pairs of ramps.
const PAIRS: u32 = 16;

impl ExtractedInk {
    /// Returns the lines of an ink, or `None` if there are none. Places its pairs among `colors`.
    fn new(ink: &Ink, colors: &mut PlacedColors) -> Option<Self> {
        // `f32::max` ignores NaN.
        let width = ink.width.max(0.0);
        let (color, tone) = match ink.color {
            InkColor::Flat(color) => (LinearRgba::from(color).to_vec4(), 0.0),
            InkColor::Tone(share) => (Vec4::W, share.max(0.0).clamp(0.0, 1.0)),
        };
        if width == 0.0 || color.w.max(0.0) == 0.0 {
            return None;
        }
        let (borders, pairs) = match &ink.borders {
            InkBorders::None => (0, 0),
            InkBorders::Ramps => (4, 0),
            InkBorders::Labels => (8, 0),
            InkBorders::Pairs(pairs) => (PAIRS, colors.place(&masks(pairs), RAMPS, Vec::new)),
        };
        let lines = u32::from(ink.silhouette) + 2 * u32::from(ink.creases) + borders;
        (lines > 0).then(|| Self {
            lines,
            pairs,
            color: color.max(Vec4::ZERO).min(Vec4::new(65504.0, 65504.0, 65504.0, 1.0)),
            tone,
            width,
            crease: CREASE * width,
            max_pixels: ink.max_pixels.max(1.0).clamp(1.0, MAX_INK_PIXELS),
        })
    }

    /// Returns the pairs of ramps that have lines.
    pub fn pairs_in<'a>(&self, colors: &'a [Vec4]) -> &'a [Vec4] {
        let first = self.pairs as usize;
        colors.get(first..first + RAMPS).filter(|_| self.lines & PAIRS != 0).unwrap_or_default()
    }
}

/// Returns the ramps to which each ramp has lines: 64 bits, 16 in each channel, which floats hold exactly.
fn masks(pairs: &[[usize; 2]]) -> [Vec4; RAMPS] {
    let mut masks = [[0u32; 4]; RAMPS];
    for [a, b] in pairs.iter().filter(|pair| pair.iter().all(|ramp| *ramp < RAMPS)) {
        masks[*a][b >> 4] |= 1 << (b & 15);
        masks[*b][a >> 4] |= 1 << (a & 15);
    }
    masks.map(|mask| Vec4::from(mask.map(|bits| bits as f32)))
}

/// A prop of a view, in drawing order.
pub(super) struct OrderedProp {
    /// The distance of its center along the view direction.
    pub distance: f64,
    /// Its index in `ExtractedProps::props`.
    pub index: usize,
    /// The level that the view requests.
    pub level: Level,
}

/// The props that a camera draws, and its settings. A component of cameras in the render world.
#[derive(Component, Default)]
pub(super) struct VisibleProps {
    /// The props that the camera sees, as indices into [`ExtractedProps::props`].
    pub props: Vec<usize>,
    /// Those of them that can be drawn, back to front.
    pub order: Vec<OrderedProp>,
    /// The posterized view: how to posterize the pixels that no posterized prop owns.
    pub view_posterize: Option<ExtractedPosterize>,
    pub placement: PropPlacement,
    pub quality: PropQuality,
    /// The lines of props without ink of their own.
    pub ink: Option<ExtractedInk>,
    pub stages: Vec<Handle<Shader>>,
    pub has_motion: bool,
    pub has_fog: bool,
    /// How the camera's materials map tones, if they do so themselves: without `Hdr`.
    pub tonemapping: Option<Tonemapping>,
    /// Whether Bevy lights scenes, which its `PbrPlugin` does.
    pub has_lights: bool,
    pub has_lamps: bool,
    pub has_hard_shadows: bool,
}

impl VisibleProps {
    pub fn is_empty(&self) -> bool {
        self.props.is_empty() && self.view_posterize.is_none()
    }

    pub fn clear(&mut self) {
        self.props.clear();
        self.view_posterize = None;
    }
}

/// The components that determine a prop's colors, besides the palette of its field.
type PropColors = (
    Option<&'static PropTint>,
    Option<&'static Posterize>,
    Option<&'static Recolor>,
    (Option<&'static PaletteOverride>, Option<&'static DrawnOverride>),
    Option<&'static Ink>,
    Option<&'static PropLighting>,
);

/// The components that determine what a camera draws.
type CameraSettings = (
    Option<&'static PropPlacement>,
    Option<&'static PropQuality>,
    Option<(&'static PosterizeView, &'static Posterize)>,
    Option<&'static PaletteOverride>,
    Option<&'static Ink>,
    Option<&'static LabelStages>,
    Has<MotionVectorPrepass>,
);

/// Extracts the props that any camera may draw.
pub(super) fn extract_props(
    mut extracted: ResMut<ExtractedProps>,
    fields: Extract<Res<Assets<PlenOctree>>>,
    on_gpu: Res<RenderAssets<GpuField>>,
    palettes: Extract<Res<Palettes>>,
    extraction: Extract<Res<PaletteExtraction>>,
    props: Extract<
        Query<(Entity, (&Prop, &DrawnField), Option<&SolidOpacity>, PropColors, &GlobalTransform, &ViewVisibility)>,
    >,
) {
    let ExtractedProps { props: list, colors, index, transforms } = &mut *extracted;
    list.clear();
    colors.begin();
    index.clear();
    for (entity, (prop, drawn), solid, colored, transform, visibility) in &props {
        let (tint, posterize, recolor, (own, kept), ink, lighting) = colored;
        if !visibility.get() {
            continue;
        }
        let mut push = |handle: &Handle<PlenOctree>, own: Option<&PaletteOverride>, stand_in| {
            let field = fields.get(handle)?;
            // After a reload, the earlier version is drawn until the new one has arrived.
            let field = on_gpu.get(handle).and_then(GpuField::drawn_field).unwrap_or(field);
            let (low, high) = field.tree_bounds()?;
            let palette = palettes.get(handle);
            let posterize = posterize.zip(palette);
            let recolor = recolor.and(palette).filter(|_| posterize.is_none());
            list.push(ExtractedProp {
                entity,
                field: handle.id(),
                pose: Pose {
                    world_from_prop: *transform,
                    up: field.up(),
                    frame: field.frame(),
                    low,
                    high,
                    cells: f64::from(1u32 << field.depth()),
                },
                previous: transforms.get(&entity).copied().unwrap_or(*transform),
                solid: solid.copied().unwrap_or_default(),
                tint: tint.copied().unwrap_or_default().factors(),
                posterize: posterize
                    .map(|(settings, palette)| ExtractedPosterize::new(settings, handle.id(), palette, own, colors)),
                recolor: recolor.map(|palette| colors.place_palette(handle.id(), palette, own)),
                // Ink without lines keeps the camera's ink away.
                ink: ink.filter(|_| posterize.is_some()).map(|ink| ExtractedInk::new(ink, colors).unwrap_or_default()),
                stand_in,
                lighting: lighting.map(|lighting| lighting.clamped()),
            });
            Some(list.len() - 1)
        };
        let stand_in = drawn.stand_in(&prop.0).and_then(|field| push(field, kept.map(|kept| &kept.0), None));
        let hides = before_palette(posterize, recolor) == Some(BeforePalette::Hide);
        let waits = hides && palettes.get(&prop.0).is_none() && extraction.error(&prop.0).is_none();
        let own = if waits { None } else { push(&prop.0, own, stand_in) };
        if let Some(drawn) = own.or(stand_in) {
            index.insert(entity, drawn);
        }
    }
}

/// Extracts what cameras draw of these props, and where the props are, for the motion of the next frame.
pub(super) fn extract_views(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedProps>,
    mut views: Query<&mut VisibleProps>,
    palettes: Extract<Res<Palettes>>,
    (server, shaders): (Extract<Res<AssetServer>>, Extract<Res<Assets<Shader>>>),
    props: Extract<Query<(Entity, &GlobalTransform), With<Prop>>>,
    cameras: Extract<Query<(RenderEntity, &Camera, &VisibleEntities, CameraSettings), With<Camera3d>>>,
) {
    let ExtractedProps { colors, index, transforms, .. } = &mut *extracted;
    transforms.clear();
    if cameras.iter().any(|(.., (.., has_motion))| has_motion) {
        transforms.extend(props.iter().map(|(entity, transform)| (entity, *transform)));
    }
    views.iter_mut().for_each(|mut view| view.clear());
    let active = cameras.iter().filter(|(_, camera, ..)| camera.is_active);
    for (entity, _, visible, (placement, quality, view_posterize, own, ink, stages, has_motion)) in active {
        let seen = visible.iter(TypeId::of::<Prop>()).filter_map(|entity| index.get(entity).copied());
        let view_posterize = view_posterize.and_then(|(view, settings)| {
            let palette = palettes.get(&view.0)?;
            Some(ExtractedPosterize::new(settings, view.0.id(), palette, own, colors))
        });
        let ink = ink.and_then(|ink| ExtractedInk::new(ink, colors));
        let placement = placement.copied().unwrap_or_default();
        let quality = quality.copied().unwrap_or_default().clamped();
        let mut new = None;
        let view = match views.get_mut(entity) {
            Ok(view) => view.into_inner(),
            Err(_) => new.insert(VisibleProps::default()),
        };
        view.props.extend(seen);
        (view.view_posterize, view.placement, view.quality, view.ink) = (view_posterize, placement, quality, ink);
        view.stages.clear();
        // Nothing waits for shaders that failed to load, or that nothing loads.
        let fails = |stage: &Handle<Shader>| match server.get_load_state(stage) {
            Some(state) => matches!(state, LoadState::Failed(_)),
            None => !shaders.contains(stage),
        };
        let stages = stages.map(|stages| &stages.0).filter(|stages| !stages.iter().any(fails));
        view.stages.extend(stages.into_iter().flatten().cloned());
        view.has_motion = has_motion;
        // A camera that has seen no prop yet has no component of the plugin.
        if let Some(new) = new.filter(|view| !view.is_empty()) {
            commands.entity(entity).insert(new);
        }
    }
}
