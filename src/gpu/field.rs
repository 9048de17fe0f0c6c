//! A field in GPU memory.

use std::sync::Arc;

use bevy::{
    asset::RenderAssetUsages,
    ecs::system::SystemParamItem,
    prelude::*,
    render::render_asset::{AssetExtractionError, PrepareAssetError, RenderAsset},
};
use plenoctree::PlenOctree;

use super::{
    level::Level,
    levels::Levels,
    records::Records,
    upload::{self, FieldTooLarge, GpuLevel, Uploader},
};

/// A [`PlenOctree`] in GPU memory. Stored in the render world, in `RenderAssets<GpuField>`.
pub struct GpuField {
    levels: Levels,
    /// Whether the outcome of the upload was reported to the main world.
    reported: bool,
}

impl GpuField {
    /// Returns an upper bound on the bytes that `field` takes in GPU memory, not counting levels that a camera's
    /// [`PropQuality`](crate::PropQuality) may request.
    pub fn byte_size(field: &PlenOctree) -> u64 {
        Records::most_bytes(field, upload::table_allowance(field))
            + upload::arrays(field).iter().map(|(_, bytes, _)| bytes).sum::<u64>()
    }

    /// Checks whether a device with these `limits` can hold the field.
    pub fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
        upload::check(field, limits)
    }

    /// Returns the size in GPU memory, in bytes, including the levels that cameras requested.
    pub fn bytes(&self) -> u64 {
        self.levels.iter().map(|level| level.bytes).sum()
    }

    /// Returns whether the field can be drawn, or `None` if the driver has not reported it yet.
    pub fn outcome(&self) -> Option<Result<(), &FieldTooLarge>> {
        self.levels.outcome()
    }

    /// Returns a level, if it is ready.
    pub(crate) fn level(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.levels.get(level)
    }

    /// Requests a level for this frame.
    pub(crate) fn request(&mut self, level: Level) {
        self.levels.request(level);
    }

    /// Returns the level to draw: `wanted` if it is ready, otherwise one that stands in for it.
    pub(crate) fn resolve(&self, wanted: Level) -> Level {
        self.levels.resolve(wanted)
    }

    /// Returns whether a level that a camera requested in the last frame is not ready yet.
    pub fn has_pending_levels(&self) -> bool {
        self.levels.are_pending()
    }

    /// Uploads the levels that were requested in this frame and have been made. If one fails, returns its error.
    pub(super) fn upload(&mut self, uploader: &Uploader) -> Option<FieldTooLarge> {
        self.levels.upload(uploader)
    }

    /// Ends the frame: evicts levels that no camera has requested for a long time.
    pub(super) fn age(&mut self) {
        self.levels.age();
    }

    /// Returns the outcome of the upload when it is first known, and `None` from then on.
    pub(super) fn take_outcome(&mut self) -> Option<Result<(), FieldTooLarge>> {
        let outcome = self.levels.outcome().filter(|_| !self.reported)?;
        self.reported = true;
        Some(outcome.map_err(Clone::clone))
    }
}

impl RenderAsset for GpuField {
    type SourceAsset = PlenOctree;
    type Param = Uploader<'static>;

    fn asset_usage(_: &PlenOctree) -> RenderAssetUsages {
        // The main world keeps the field for palette extraction. The arrays are shared, so the copy is cheap.
        RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD
    }

    fn take_gpu_data(source: &mut PlenOctree, _: Option<&Self>) -> Result<PlenOctree, AssetExtractionError> {
        Ok(source.clone())
    }

    fn byte_len(source: &PlenOctree) -> Option<usize> {
        usize::try_from(Self::byte_size(source)).ok()
    }

    fn prepare_asset(
        field: PlenOctree,
        _: AssetId<PlenOctree>,
        uploader: &mut SystemParamItem<Self::Param>,
        _: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<PlenOctree>> {
        Ok(Self { levels: Levels::new(field, uploader), reported: false })
    }
}
