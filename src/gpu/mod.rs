//! Fields on the GPU: their levels, the layout of their data, uploads, and the shaders.

mod budget;
mod buffers;
mod constants;
mod errors;
mod field;
mod layout;
mod level;
mod levels;
mod payload;
pub(crate) mod pipelines;
mod readiness;
mod records;
mod report;
mod shaders;
mod slices;
mod systems;
mod textures;
mod upload;

pub use budget::UploadBudget;
pub(crate) use buffers::{WrittenBuffer, buffer_with};
pub use constants::MAX_PROPS_IN_VIEW;
pub(crate) use constants::SAMPLING_WORKGROUP;
pub(crate) use errors::Allocator;
pub use field::GpuField;
pub(crate) use layout::{FieldShape, TreeShape, field_layout};
pub(crate) use level::Level;
pub(crate) use readiness::{LeftOut, Readiness};
pub(crate) use records::tree_depth;
pub use report::{FieldFailed, FieldReady, ViewFailed, ViewTooLarge};
pub(crate) use report::{FieldReports, GpuStatus, Report};
pub(crate) use shaders::{Shaders, field_definitions};
pub use upload::FieldTooLarge;
pub(crate) use upload::{GpuLevel, field_bytes};

use bevy::{
    prelude::*,
    render::{
        ExtractSchedule, Render, RenderApp, RenderStartup, RenderSystems,
        extract_resource::ExtractResourcePlugin,
        render_asset::{AssetExtractionSystems, RenderAssetPlugin},
    },
};

use crate::{
    background::FreesInBackground,
    sets::{PlenOctreeRenderSystems, PlenOctreeSystems},
};

/// Uploads every loaded [`PlenOctree`](plenoctree::PlenOctree) to the GPU.
pub(crate) struct GpuFieldPlugin;

impl Plugin for GpuFieldPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GpuStatus>()
            .init_resource::<UploadBudget>()
            .register_type::<UploadBudget>()
            .add_message::<FieldReady>()
            .add_message::<FieldFailed>()
            .add_message::<ViewFailed>()
            .add_systems(PreUpdate, report::receive.in_set(PlenOctreeSystems::ReportFields));
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        let reports = report::FieldReports::default();
        app.insert_resource(reports.clone());
        let shaders = Shaders::add_to(app);
        app.add_plugins((RenderAssetPlugin::<GpuField>::default(), ExtractResourcePlugin::<UploadBudget>::default()));
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app
                .insert_resource(shaders)
                .insert_resource(reports)
                .insert_resource(FreesInBackground::new())
                .init_resource::<Readiness>()
                .init_resource::<report::RenderedFrame>()
                .add_systems(RenderStartup, report::report_new_device)
                .add_systems(
                    ExtractSchedule,
                    (report::extract_frame, systems::extract_missing.after(AssetExtractionSystems)),
                )
                .add_systems(
                    Render,
                    (
                        systems::upload_levels.in_set(PlenOctreeRenderSystems::UploadLevels),
                        (systems::end_frame, report::report_pipelines).in_set(RenderSystems::Cleanup),
                    ),
                );
        }
    }
}
