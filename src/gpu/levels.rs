//! The forms of a field that cameras ask for: with all its leaves, without faint ones, with larger cells.

use std::sync::{Arc, OnceLock};

use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};

use super::{
    faintness::Faintness,
    field::{Form, GpuLevel, Uploader},
};
use crate::{field::PlenOctree, quality::Quality};

/// So many frames after a form was asked for last, its memory is given back.
const KEPT: u32 = 600;

/// Which form of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Level {
    /// How many times the width of cells is doubled, if there are as large ones.
    coarser: u32,
    /// Leaves that are less dense are left out.
    density_threshold: f32,
    /// Faint leaves are left out until rays lose so much.
    opacity_loss: f32,
}

impl Level {
    /// What a `quality` asks for where cells are to be doubled `coarser` times.
    pub fn new(coarser: u32, quality: &Quality) -> Self {
        Self { coarser, density_threshold: quality.density_threshold, opacity_loss: quality.opacity_loss }
    }

    /// The field in this form.
    fn of(self, field: &PlenOctree, faintness: &OnceLock<Faintness>) -> PlenOctree {
        let mut threshold = self.density_threshold;
        if self.opacity_loss > 0.0 {
            threshold = threshold.max(faintness.get_or_init(|| Faintness::of(field)).threshold(self.opacity_loss));
        }
        let mut field = field.thinned(threshold);
        for _ in 0..self.coarser {
            let Some(next) = field.coarser(1) else { break };
            field = next;
        }
        field
    }

    /// Whether this form can stand in for `wanted` until that is made: it shows no less.
    fn stands_in_for(self, wanted: Self) -> bool {
        self.coarser <= wanted.coarser
            && self.density_threshold <= wanted.density_threshold
            && self.opacity_loss <= wanted.opacity_loss
    }
}

/// A field's forms in GPU memory.
pub(super) struct Levels {
    source: PlenOctree,
    faintness: Arc<OnceLock<Faintness>>,
    /// The field itself, for ever, and others while they are asked for.
    made: Vec<Made>,
}

struct Made {
    level: Level,
    state: State,
    /// Frames since it was asked for.
    idle: u32,
}

enum State {
    /// Made in the background, since that takes longer than a frame may.
    Making(Task<Form>),
    /// `None` if the GPU cannot hold it.
    Ready(Option<Arc<GpuLevel>>),
}

impl Levels {
    pub fn new(source: PlenOctree, uploader: &Uploader) -> Self {
        let form = Form::new(source);
        let state = State::Ready(uploader.upload(&form));
        Self {
            source: form.field,
            faintness: Arc::default(),
            made: vec![Made { level: Level::default(), state, idle: 0 }],
        }
    }

    pub fn get(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.made.iter().find(|made| made.level == level)?.state.ready()
    }

    /// The form to draw where one is wanted: that, or what stands in for it while it is made.
    pub fn ask(&mut self, wanted: Level, uploader: &Uploader) -> Level {
        let place = self.made.iter().position(|made| made.level == wanted).unwrap_or_else(|| {
            let (field, faintness) = (self.source.clone(), self.faintness.clone());
            let task = AsyncComputeTaskPool::get().spawn(async move { Form::new(wanted.of(&field, &faintness)) });
            self.made.push(Made { level: wanted, state: State::Making(task), idle: 0 });
            self.made.len() - 1
        });
        let made = &mut self.made[place];
        made.idle = 0;
        if let State::Making(task) = &mut made.state
            && let Some(form) = block_on(poll_once(task))
        {
            made.state = State::Ready(uploader.upload(&form));
        }
        if made.state.ready().is_some() {
            return wanted;
        }
        let ready = self.made.iter().filter(|made| made.state.ready().is_some() && made.level.stands_in_for(wanted));
        ready.map(|made| made.level).max_by_key(|level| level.coarser).unwrap_or_default()
    }

    /// Whether a form that was asked for in the last frame is still being made.
    pub fn is_busy(&self) -> bool {
        self.made.iter().any(|made| made.idle <= 1 && matches!(made.state, State::Making(_)))
    }

    /// Ends a frame: what was not asked for in a long time is dropped.
    pub fn age(&mut self) {
        for made in &mut self.made {
            made.idle = made.idle.saturating_add(1);
        }
        self.made.retain(|made| made.level == Level::default() || made.idle < KEPT);
    }

    pub fn iter(&self) -> impl Iterator<Item = &GpuLevel> {
        self.made.iter().filter_map(|made| made.state.ready()).map(AsRef::as_ref)
    }
}

impl State {
    fn ready(&self) -> Option<&Arc<GpuLevel>> {
        match self {
            Self::Ready(level) => level.as_ref(),
            Self::Making(_) => None,
        }
    }
}
