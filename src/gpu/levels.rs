//! The levels of a field that cameras request.

use std::sync::{Arc, OnceLock};

use bevy::tasks::{Task, block_on, poll_once};
use plenoctree::{Faintness, PlenOctree};

use super::{
    level::Level,
    upload::{FieldTooLarge, GpuLevel, LevelData, Upload, Uploaded, Uploader},
};
use crate::background;

/// The number of frames after which an unused level is evicted.
const KEPT_FRAMES: u32 = 600;

/// The levels of a field in GPU memory. The field itself is always kept; other levels are kept while cameras request
/// them.
pub(super) struct Levels {
    source: PlenOctree,
    faintness: Arc<OnceLock<Faintness>>,
    slots: Vec<Slot>,
}

struct Slot {
    level: Level,
    state: State,
    /// The number of frames since the last request.
    idle: u32,
}

enum State {
    /// Being made in the background, which takes longer than a frame.
    Making(Task<LevelData>),
    Uploading(Upload),
    Ready(Arc<GpuLevel>),
    Failed(FieldTooLarge),
}

impl Levels {
    pub fn new(source: PlenOctree, uploader: &Uploader) -> Self {
        let data = LevelData::new(source);
        let state = State::from(uploader.upload(&data));
        let slot = Slot { level: Level::default(), state, idle: 0 };
        Self { source: data.field, faintness: Arc::default(), slots: vec![slot] }
    }

    pub fn get(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.slots.iter().find(|slot| slot.level == level)?.state.ready()
    }

    /// Returns whether the field itself can be drawn, or `None` if that is not known yet.
    pub fn outcome(&self) -> Option<Result<(), &FieldTooLarge>> {
        match &self.slots.first()?.state {
            State::Ready(_) => Some(Ok(())),
            State::Failed(error) => Some(Err(error)),
            State::Making(_) | State::Uploading(_) => None,
        }
    }

    /// Requests a level for this frame.
    pub fn request(&mut self, level: Level) {
        if let Some(slot) = self.slots.iter_mut().find(|slot| slot.level == level) {
            slot.idle = 0;
            return;
        }
        let (field, faintness) = (self.source.clone(), self.faintness.clone());
        let make = move || LevelData::new(level.make(&field, &faintness));
        let state = State::Making(background::spawn(make));
        self.slots.push(Slot { level, state, idle: 0 });
    }

    /// Uploads the levels that were requested in this frame and have been made. If one fails, returns its error.
    pub fn upload(&mut self, uploader: &Uploader) -> Option<FieldTooLarge> {
        let mut failure = None;
        for slot in self.slots.iter_mut().filter(|slot| slot.idle == 0) {
            let next = match &mut slot.state {
                State::Making(task) => block_on(poll_once(task)).map(|data| uploader.upload(&data).into()),
                State::Uploading(upload) => upload.poll().map(|outcome| Uploaded::Now(outcome).into()),
                State::Ready(_) | State::Failed(_) => None,
            };
            if let Some(next) = next {
                if let State::Failed(error) = &next {
                    failure = Some(error.clone());
                }
                slot.state = next;
            }
        }
        failure
    }

    /// Returns the level to draw: `wanted` if it is ready, otherwise one that stands in for it.
    pub fn resolve(&self, wanted: Level) -> Level {
        if self.get(wanted).is_some() {
            return wanted;
        }
        let ready = self.slots.iter().filter(|slot| slot.state.ready().is_some());
        let ready = ready.map(|slot| slot.level).filter(|level| level.stands_in_for(wanted));
        ready.max_by_key(|level| level.coarser()).unwrap_or_default()
    }

    /// Returns whether a level that was requested in the last frame is not ready yet.
    pub fn are_pending(&self) -> bool {
        let waits = |state: &State| matches!(state, State::Making(_) | State::Uploading(_));
        self.slots.iter().any(|slot| slot.idle <= 1 && waits(&slot.state))
    }

    /// Ends the frame: evicts levels that have not been requested for [`KEPT_FRAMES`].
    pub fn age(&mut self) {
        for slot in &mut self.slots {
            slot.idle = slot.idle.saturating_add(1);
        }
        self.slots.retain(|slot| slot.level == Level::default() || slot.idle < KEPT_FRAMES);
    }

    pub fn iter(&self) -> impl Iterator<Item = &GpuLevel> {
        self.slots.iter().filter_map(|slot| slot.state.ready()).map(AsRef::as_ref)
    }
}

impl State {
    fn ready(&self) -> Option<&Arc<GpuLevel>> {
        match self {
            Self::Ready(level) => Some(level),
            Self::Making(_) | Self::Uploading(_) | Self::Failed(_) => None,
        }
    }
}

impl From<Uploaded> for State {
    fn from(uploaded: Uploaded) -> Self {
        match uploaded {
            Uploaded::Now(Ok(level)) => Self::Ready(level),
            Uploaded::Now(Err(error)) => Self::Failed(error),
            Uploaded::Later(upload) => Self::Uploading(upload),
        }
    }
}
