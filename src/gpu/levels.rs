//! The forms of a field that cameras ask for: with all its leaves, without faint ones, with larger cells.

use std::sync::Arc;

use super::{
    faintness::Faintness,
    field::{GpuLevel, Uploader},
};
use crate::{field::PlenOctree, quality::Quality};

/// So many frames after a form was drawn last, its memory is given back.
const KEPT: u32 = 600;

/// Which form of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Level {
    /// How many times cells are as wide as the field's, as a power of two, if there are as large ones.
    pub coarser: u32,
    /// Leaves that are less dense are left out.
    density_threshold: f32,
}

/// A field's forms in GPU memory.
pub(super) struct Levels {
    source: PlenOctree,
    faintness: Option<Faintness>,
    /// The field itself, for ever, and others while they are drawn.
    made: Vec<Made>,
}

struct Made {
    level: Level,
    /// `None` if the GPU cannot hold it.
    gpu: Option<Arc<GpuLevel>>,
    /// Frames since it was drawn.
    idle: u32,
}

impl Levels {
    pub fn new(source: PlenOctree, uploader: &Uploader) -> Self {
        let gpu = uploader.upload(&source);
        Self { source, faintness: None, made: vec![Made { level: Level::default(), gpu, idle: 0 }] }
    }

    pub fn get(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.made.iter().find(|made| made.level == level)?.gpu.as_ref()
    }

    /// The form that a `quality` asks for, with cells so much coarser. It is made if it is not there.
    pub fn make(&mut self, coarser: u32, quality: &Quality, uploader: &Uploader) -> Level {
        let faint = if quality.opacity_loss > 0.0 {
            self.faintness.get_or_insert_with(|| Faintness::of(&self.source)).threshold(quality.opacity_loss)
        } else {
            0.0
        };
        let level = Level { coarser, density_threshold: faint.max(quality.density_threshold) };
        if let Some(made) = self.made.iter_mut().find(|made| made.level == level) {
            made.idle = 0;
            return level;
        }
        let mut field = self.source.thinned(level.density_threshold);
        for _ in 0..coarser {
            let Some(next) = field.coarser(1) else { break };
            field = next;
        }
        self.made.push(Made { level, gpu: uploader.upload(&field), idle: 0 });
        level
    }

    /// Ends a frame: what was not drawn for long is dropped.
    pub fn age(&mut self) {
        for made in &mut self.made {
            made.idle = made.idle.saturating_add(1);
        }
        self.made.retain(|made| made.level == Level::default() || made.idle < KEPT);
    }

    pub fn iter(&self) -> impl Iterator<Item = &GpuLevel> {
        self.made.iter().filter_map(|made| made.gpu.as_deref())
    }
}
