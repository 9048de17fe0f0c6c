//! A field on the GPU.

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

/// A [`PlenOctree`] in GPU memory, in the render world's `RenderAssets<GpuField>`.
pub struct GpuField {
    levels: Levels,
    /// Whether the main world was told what became of it.
    reported: bool,
}

impl GpuField {
    /// An upper bound of the bytes that `field` takes in GPU memory, without the levels that cameras'
    /// [`PropQuality`](crate::PropQuality) may ask for.
    pub fn byte_size(field: &PlenOctree) -> u64 {
        Records::most_bytes(field, upload::table_allowance(field))
            + upload::arrays(field).iter().map(|(_, bytes)| bytes).sum::<u64>()
    }

    /// Whether a device with these `limits` can hold the field.
    pub fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
        upload::check(field, limits)
    }

    /// Bytes in GPU memory, including the levels that cameras ask for.
    pub fn bytes(&self) -> u64 {
        self.levels.iter().map(|level| level.bytes).sum()
    }

    /// Whether the field can be drawn; `None` until the driver has told.
    pub fn outcome(&self) -> Option<Result<(), &FieldTooLarge>> {
        self.levels.outcome()
    }

    /// A level that is ready.
    pub(crate) fn level(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.levels.get(level)
    }

    /// Asks for a level in this frame.
    pub(crate) fn request(&mut self, level: Level) {
        self.levels.request(level);
    }

    /// The level to draw where one is wanted.
    pub(crate) fn resolve(&self, wanted: Level) -> Level {
        self.levels.resolve(wanted)
    }

    /// Whether a level that a camera asked for in the last frame is not ready yet.
    pub fn is_busy(&self) -> bool {
        self.levels.is_busy()
    }

    /// Uploads the levels that were asked for in this frame and have been made. Returns why one of them failed.
    pub(super) fn upload(&mut self, uploader: &Uploader) -> Option<FieldTooLarge> {
        self.levels.upload(uploader)
    }

    /// Ends a frame: evicts levels that no camera has asked for in a long time.
    pub(super) fn age(&mut self) {
        self.levels.age();
    }

    /// What became of the field, once.
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
        // The main world keeps the field, for extraction; the arrays are shared, so the copy costs nothing.
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
