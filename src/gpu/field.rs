//! A field in GPU memory.

use std::sync::Arc;

use bevy::{
    ecs::system::SystemParamItem,
    prelude::*,
    render::render_asset::{PrepareAssetError, RenderAsset},
};
use plenoctree::PlenOctree;

use super::{
    budget::Allowance,
    layout::FieldShape,
    level::Level,
    levels::Levels,
    records::Records,
    upload::{self, FieldTooLarge, GpuLevel, Uploader},
};

/// A [`PlenOctree`] in GPU memory. Stored in the render world, in `RenderAssets<GpuField>`.
///
/// It exists from the frame in which its asset was added, and arrives slice by slice. If the asset is replaced, the
/// earlier version is drawn until the new one has arrived.
pub struct GpuField {
    levels: Levels,
    /// Those of the previous version, while they are drawn.
    earlier: Option<Levels>,
    /// Whether this version is drawn.
    is_drawn: bool,
    /// Whether it is drawn from the next frame on.
    is_new: bool,
    /// The outcome of the upload that was reported to the main world: whether it succeeded.
    reported: Option<bool>,
}

impl GpuField {
    /// Returns the bytes that `field` takes in GPU memory, not counting the rest of the last row of textures, and levels
    /// that a camera's [`PropQuality`](crate::PropQuality) may request. Visits every node.
    pub fn byte_size(field: &PlenOctree) -> u64 {
        Records::bytes(field, upload::table_allowance(field))
            + upload::arrays(field).iter().map(|(_, bytes, _)| bytes).sum::<u64>()
    }

    /// Checks whether a device with these `limits` can hold the field.
    pub fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
        upload::check(field, limits)
    }

    /// Returns the size in GPU memory, in bytes, including the levels that cameras requested, and an earlier version
    /// that is still drawn.
    pub fn bytes(&self) -> u64 {
        [Some(&self.levels), self.earlier.as_ref()].into_iter().flatten().flat_map(Levels::iter).map(|l| l.bytes).sum()
    }

    /// Returns whether the field can be drawn, or `None` while it is arriving.
    pub fn outcome(&self) -> Option<Result<(), &FieldTooLarge>> {
        self.levels.outcome().filter(|outcome| outcome.is_err() || self.is_drawn)
    }

    /// Returns how much of the field is on the GPU, from 0 to 1.
    pub fn progress(&self) -> f32 {
        self.levels.progress()
    }

    /// Returns the levels to draw, if any: those of an earlier version while this one is arriving.
    fn drawn(&self) -> Option<&Levels> {
        if self.is_drawn { Some(&self.levels) } else { self.earlier.as_ref() }
    }

    /// Returns the version of the field that is drawn.
    pub(crate) fn drawn_field(&self) -> Option<&PlenOctree> {
        self.drawn().map(Levels::source)
    }

    /// Returns a level of the version that is drawn, if it is ready.
    pub(crate) fn level(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.drawn()?.get(level)
    }

    /// Returns the field itself, if it has arrived: this version, and no earlier one.
    pub(crate) fn arrived(&self) -> Option<&Arc<GpuLevel>> {
        self.levels.get(Level::default())
    }

    /// Returns the shape of this version if it is arriving, so that its pipelines can be compiled in the meantime.
    pub(crate) fn arriving_shape(&self) -> Option<FieldShape> {
        self.levels.shape().filter(|_| !self.is_drawn)
    }

    /// Requests a level for this frame.
    pub(crate) fn request(&mut self, level: Level) {
        match &mut self.earlier {
            Some(earlier) if !self.is_drawn => earlier.request(level, false),
            _ => self.levels.request(level, true),
        }
    }

    /// Returns the level to draw: `wanted` if it is ready, otherwise one that stands in for it.
    pub(crate) fn resolve(&self, wanted: Level) -> Level {
        self.drawn().map_or_else(Level::default, |levels| levels.resolve(wanted))
    }

    /// Returns whether no frame shows this version yet, although the GPU has not rejected it.
    #[cfg(feature = "headless")]
    pub(crate) fn is_arriving(&self) -> bool {
        self.is_new || self.outcome().is_none()
    }

    /// Returns whether a level that a camera requested in the last frame is not ready yet.
    pub fn has_pending_levels(&self) -> bool {
        self.levels.are_pending()
    }

    /// Returns the number of threads that make levels, also those that no camera requests any more.
    pub(crate) fn threads(&self) -> usize {
        self.levels.threads()
    }

    /// Returns whether the field itself, and every level that was requested in the last frame, is ready, or made by a
    /// thread, or waits for one.
    #[cfg(feature = "headless")]
    pub(crate) fn awaits_threads(&self) -> bool {
        !self.is_new && self.levels.await_threads()
    }

    /// Makes and uploads the field, and the levels that were requested in this frame, as far as the allowance goes. If
    /// a level fails for the first time, returns its error.
    pub(super) fn advance(&mut self, uploader: &Uploader, allowance: &mut Allowance) -> Option<FieldTooLarge> {
        self.levels.advance(uploader, allowance)
    }

    /// Ends the frame. If the field has arrived, and `has_pipelines` says that no pipeline for it is missing, it is
    /// drawn from the next frame on. Evicts levels that no camera has requested for a long time.
    pub(super) fn end_frame(&mut self, has_pipelines: bool) {
        self.is_new = !self.is_drawn && has_pipelines && self.arrived().is_some();
        if self.is_new {
            self.is_drawn = true;
            self.earlier = None;
        }
        self.levels.age();
    }

    /// Returns the outcome of the upload when it is first known, or if a later attempt has succeeded, and `None` from
    /// then on.
    pub(super) fn take_outcome(&mut self) -> Option<Result<(), FieldTooLarge>> {
        let outcome = self.outcome()?.map_err(Clone::clone);
        let is_new = self.reported.replace(outcome.is_ok()) != Some(outcome.is_ok());
        is_new.then_some(outcome)
    }
}

impl RenderAsset for GpuField {
    type SourceAsset = PlenOctree;
    type Param = ();

    fn prepare_asset(
        field: PlenOctree,
        _: AssetId<PlenOctree>,
        _: &mut SystemParamItem<Self::Param>,
        previous: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<PlenOctree>> {
        let earlier = previous.and_then(Self::drawn).map(Levels::ready);
        Ok(Self { levels: Levels::new(field), earlier, is_drawn: false, is_new: false, reported: None })
    }
}
