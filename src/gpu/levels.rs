//! The levels of a field that cameras request.

use std::sync::{Arc, OnceLock};

use bevy::{
    log::warn,
    platform::time::Instant,
    tasks::{Task, block_on, poll_once},
};
use plenoctree::{Faintness, PlenOctree};

use super::{
    budget::Allowance,
    errors::PAUSE,
    layout::FieldShape,
    level::Level,
    slices::Upload,
    upload::{FieldTooLarge, GpuLevel, LevelData, Uploader, field_bytes},
};
use crate::background;

/// The number of frames after which an unused level is evicted.
const IDLE_FRAMES: u32 = 600;

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
    /// The last failure, until the level is ready.
    failure: Option<FieldTooLarge>,
}

/// The state of a level. Each state leads to the next one, and from a failure for lack of memory to the first one.
enum State {
    Requested,
    /// Being made in the background, which takes longer than a frame.
    Making(Task<LevelData>),
    Uploading(Box<Upload>),
    Ready(Arc<GpuLevel>),
    /// Stores since when.
    Failed(Instant),
}

impl Levels {
    pub fn new(source: PlenOctree) -> Self {
        Self { source, faintness: Arc::default(), slots: vec![Slot::new(Level::default())] }
    }

    /// Returns the levels that are ready, to be drawn until another version of the field is.
    pub fn ready(&self) -> Self {
        let ready = self.slots.iter().filter_map(|slot| {
            let state = State::Ready(slot.state.ready()?.clone());
            Some(Slot { level: slot.level, state, idle: slot.idle, failure: None })
        });
        Self { source: self.source.clone(), faintness: self.faintness.clone(), slots: ready.collect() }
    }

    pub fn source(&self) -> &PlenOctree {
        &self.source
    }

    pub fn get(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.slots.iter().find(|slot| slot.level == level)?.state.ready()
    }

    /// Returns whether the field itself can be drawn, or `None` if that is not known yet. After a failure, it cannot
    /// until another attempt has succeeded.
    pub fn outcome(&self) -> Option<Result<(), &FieldTooLarge>> {
        let slot = self.slots.first()?;
        match slot.state {
            State::Ready(_) => Some(Ok(())),
            _ => slot.failure.as_ref().map(Err),
        }
    }

    /// Returns the shape of the field itself, once it is known.
    pub fn shape(&self) -> Option<FieldShape> {
        match &self.slots.first()?.state {
            State::Uploading(upload) => Some(upload.shape()),
            State::Ready(level) => Some(level.shape),
            State::Requested | State::Making(_) | State::Failed(_) => None,
        }
    }

    /// Returns how much of the field itself is on the GPU, from 0 to 1.
    pub fn progress(&self) -> f32 {
        match self.slots.first().map(|slot| &slot.state) {
            Some(State::Uploading(upload)) => upload.progress(),
            Some(State::Ready(_)) => 1.0,
            _ => 0.0,
        }
    }

    /// Returns the number of threads that make levels, also those that no camera requests any more.
    pub fn threads(&self) -> usize {
        let is_busy = |state: &State| matches!(state, State::Making(task) if !task.is_finished());
        self.slots.iter().filter(|slot| is_busy(&slot.state)).count()
    }

    /// Returns whether the field itself, and every level that was requested in the last frame, is ready, or made by a
    /// thread, or waits for one.
    #[cfg(feature = "headless")]
    pub fn await_threads(&self) -> bool {
        let is_wanted = |slot: &&Slot| slot.idle <= 1 || slot.level == Level::default();
        self.slots.iter().filter(is_wanted).all(|slot| match &slot.state {
            State::Making(task) => !task.is_finished(),
            State::Uploading(_) => false,
            State::Requested | State::Ready(_) | State::Failed(_) => true,
        })
    }

    /// Requests a level for this frame. It is made if `makes_more`.
    pub fn request(&mut self, level: Level, makes_more: bool) {
        if let Some(slot) = self.slots.iter_mut().find(|slot| slot.level == level) {
            slot.idle = 0;
        } else if makes_more {
            self.slots.push(Slot::new(level));
        }
    }

    /// Makes and uploads the field itself and the levels that were requested in this frame, as far as the allowance
    /// goes. If one fails for the first time, returns its error.
    pub fn advance(&mut self, uploader: &Uploader, allowance: &mut Allowance) -> Option<FieldTooLarge> {
        let Self { source, faintness, slots } = self;
        let mut failure = None;
        for slot in slots.iter_mut().filter(|slot| slot.idle == 0 || slot.level == Level::default()) {
            if let Err(error) = slot.advance(source, faintness, uploader, allowance) {
                slot.state = State::Failed(Instant::now());
                if slot.failure.is_none() {
                    failure = Some(error.clone());
                }
                slot.failure = Some(error);
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

    /// Returns whether a level that was requested in the last frame is not ready yet, and has not failed.
    pub fn are_pending(&self) -> bool {
        let waits = |slot: &Slot| slot.failure.is_none() && slot.state.ready().is_none();
        self.slots.iter().any(|slot| slot.idle <= 1 && waits(slot))
    }

    /// Ends the frame: evicts levels that have not been requested for [`IDLE_FRAMES`].
    pub fn age(&mut self) {
        for slot in &mut self.slots {
            slot.idle = slot.idle.saturating_add(1);
        }
        self.slots.retain(|slot| slot.level == Level::default() || slot.idle < IDLE_FRAMES);
    }

    pub fn iter(&self) -> impl Iterator<Item = &GpuLevel> {
        self.slots.iter().filter_map(|slot| slot.state.ready()).map(AsRef::as_ref)
    }
}

impl Drop for Levels {
    fn drop(&mut self) {
        background::discard(self.source.clone(), field_bytes(&self.source));
    }
}

impl Slot {
    fn new(level: Level) -> Self {
        Self { level, state: State::Requested, idle: 0, failure: None }
    }

    fn advance(
        &mut self,
        source: &PlenOctree,
        faintness: &Arc<OnceLock<Faintness>>,
        uploader: &Uploader,
        allowance: &mut Allowance,
    ) -> Result<(), FieldTooLarge> {
        let begin = |data| Upload::begin(data, uploader).map(|upload| State::Uploading(Box::new(upload)));
        let is_itself = self.level == Level::default();
        if let State::Failed(since) = self.state
            && self.failure.as_ref().is_some_and(|error| error.limit.is_none())
            && since.elapsed() >= PAUSE
        {
            self.state = State::Requested;
        }
        if let State::Requested = self.state {
            if is_itself && LevelData::is_quick(source) && allowance.allows_more() {
                self.state = begin(LevelData::new(source.clone()))?;
            } else if allowance.free_threads > 0 {
                allowance.free_threads -= 1;
                let (level, field, faintness) = (self.level, source.clone(), faintness.clone());
                let make = move || LevelData::new(if is_itself { field } else { level.make(&field, &faintness) });
                self.state = State::Making(background::spawn(make));
            }
        }
        if let State::Making(task) = &mut self.state
            && task.is_finished()
            && allowance.allows_more()
            && let Some(data) = block_on(poll_once(task))
        {
            self.state = begin(data)?;
        }
        if let State::Uploading(upload) = &mut self.state
            && !allowance.is_taken
        {
            match upload.advance(uploader, allowance) {
                Some(Ok(level)) => {
                    self.state = State::Ready(level);
                    self.failure = None;
                }
                Some(Err(error)) => {
                    if self.failure.is_none() {
                        let message = upload.rejection().unwrap_or_default();
                        warn!("the driver rejected a field of {} bytes: {message}", error.bytes);
                    }
                    return Err(error);
                }
                None => allowance.is_taken = true,
            }
        }
        Ok(())
    }
}

impl State {
    fn ready(&self) -> Option<&Arc<GpuLevel>> {
        match self {
            Self::Ready(level) => Some(level),
            Self::Requested | Self::Making(_) | Self::Uploading(_) | Self::Failed(_) => None,
        }
    }
}
