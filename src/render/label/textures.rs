//! The textures that custom stages read and write.

use std::sync::atomic::{AtomicUsize, Ordering};

use bevy::{
    prelude::*,
    render::{
        render_resource::{TextureFormat, TextureView},
        renderer::RenderDevice,
    },
};

use crate::{
    render::{
        extract::VisibleProps,
        view::{ViewMemory, ViewProps},
    },
    stage::PropStage,
};

pub(in crate::render) const SHOWN_FORMAT: TextureFormat = LabelTextures::COLOR_FORMAT;
pub(super) const LABEL_FORMAT: TextureFormat = LabelTextures::LABEL_FORMAT;

/// What the label pass shows: encoded sRGB and opacity, or a negative opacity where nothing is drawn. A component of
/// views that draw anything. Custom stages start from it.
#[derive(Component)]
pub(in crate::render) struct ShownTexture(pub TextureView);

/// The textures that custom stages read and write. A component of views in the render world, for cameras with
/// [`LabelStages`](crate::LabelStages).
///
/// The textures have the size of the part of the target that the camera's main pass draws to. Only the pixels within
/// [`Self::rect`] are shown.
#[derive(Component)]
pub struct LabelTextures {
    /// Labels, in [`Self::LABEL_FORMAT`]. Red is 0 where nothing is drawn, 1 where a prop is drawn as trained, and
    /// otherwise 2 plus the [index of the nearest label](plenoctree::palette::PaletteLabel::index). Green is 1 plus the
    /// index of the posterized prop among the view's props, sorted from back to front, or 0 if there is no such prop.
    ///
    /// Both are those of the center of a pixel. At the edge of a prop, its colors are blended with what is behind
    /// ([`EdgeSmoothing`](crate::EdgeSmoothing)); labels are not.
    pub labels: TextureView,
    /// The part of the textures that is shown, in pixels.
    pub rect: URect,
    /// Where in the frame the view's props are drawn. A custom stage that is meant for the other [`PropStage`] must do
    /// nothing.
    pub stage: PropStage,
    colors: [TextureView; 2],
    current: AtomicUsize,
}

/// The textures of one custom stage, which must write every pixel of the destination within [`LabelTextures::rect`].
pub struct StageWrite<'a> {
    /// The current colors, in [`LabelTextures::COLOR_FORMAT`]: encoded sRGB and opacity. Opacity is negative where
    /// nothing is drawn.
    pub source: &'a TextureView,
    /// The new colors, in the same format, for later stages and the screen.
    pub destination: &'a TextureView,
}

impl LabelTextures {
    /// The format of the color textures.
    pub const COLOR_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
    /// The format of [`Self::labels`].
    pub const LABEL_FORMAT: TextureFormat = TextureFormat::Rg32Uint;

    /// Returns the textures for a stage that changes colors. Call this once per stage and view, and write the
    /// destination.
    pub fn stage_write(&self) -> StageWrite<'_> {
        let source = self.current.fetch_xor(1, Ordering::SeqCst);
        StageWrite { source: &self.colors[source], destination: &self.colors[1 - source] }
    }

    /// Returns the current colors.
    pub fn colors(&self) -> &TextureView {
        &self.colors[self.current.load(Ordering::SeqCst)]
    }

    /// Returns both color textures. One of them has the current colors.
    pub(in crate::render) fn both(&self) -> &[TextureView; 2] {
        &self.colors
    }
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    mut views: Query<(Entity, &VisibleProps, &ViewProps, &mut ViewMemory)>,
) {
    for (entity, visible, props, mut memory) in &mut views {
        let mut texture = |label, format| memory.view(&device, label, format, props.viewport_size()?);
        let shown = texture("plenoctree_shown", SHOWN_FORMAT);
        let stages = shown.clone().filter(|_| visible.has_stages).and_then(|shown| {
            Some(LabelTextures {
                labels: texture("plenoctree_labels", LABEL_FORMAT)?,
                rect: props.rect,
                stage: props.stage,
                colors: [shown, texture("plenoctree_staged", SHOWN_FORMAT)?],
                current: AtomicUsize::new(0),
            })
        });
        match stages {
            Some(stages) => commands.entity(entity).insert(stages),
            None => commands.entity(entity).remove::<LabelTextures>(),
        };
        match shown {
            Some(shown) => commands.entity(entity).insert(ShownTexture(shown)),
            None => commands.entity(entity).remove::<ShownTexture>(),
        };
    }
}
