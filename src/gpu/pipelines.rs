//! The state of Bevy's pipelines.

use bevy::{
    render::render_resource::{CachedPipelineState, PipelineCache, PipelineDescriptor},
    shader::ShaderCacheError,
};

/// The name of custom stages, with which the labels of their pipelines begin.
pub(crate) const STAGE: &str = "plenoctree_stage";

/// Returns the labels of the pipelines that are still being compiled, or whose shaders are still being loaded.
pub(crate) fn waiting(cache: &PipelineCache) -> impl Iterator<Item = &str> {
    cache.pipelines().filter_map(|pipeline| match &pipeline.state {
        CachedPipelineState::Queued | CachedPipelineState::Creating(_) => Some(label(&pipeline.descriptor)),
        CachedPipelineState::Err(error) if is_loading(error) => Some(label(&pipeline.descriptor)),
        CachedPipelineState::Ok(_) | CachedPipelineState::Err(_) => None,
    })
}

/// Returns the labels of the pipelines that could not be created, and why.
pub(crate) fn failed(cache: &PipelineCache) -> impl Iterator<Item = (&str, &ShaderCacheError)> {
    cache.pipelines().filter_map(|pipeline| match &pipeline.state {
        CachedPipelineState::Err(error) if !is_loading(error) => Some((label(&pipeline.descriptor), error)),
        _ => None,
    })
}

/// Returns whether an error only means that a shader is still being loaded.
pub(crate) fn is_loading(error: &ShaderCacheError) -> bool {
    matches!(error, ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable)
}

fn label(descriptor: &PipelineDescriptor) -> &str {
    let label = match descriptor {
        PipelineDescriptor::RenderPipelineDescriptor(descriptor) => &descriptor.label,
        PipelineDescriptor::ComputePipelineDescriptor(descriptor) => &descriptor.label,
    };
    label.as_deref().unwrap_or("a pipeline without a label")
}

/// Returns whether props cannot be drawn without a pipeline with this label. They can without custom stages, whose
/// shaders may be missing or wrong, and while palettes are sampled on the CPU.
pub(super) fn draws_props(label: &str) -> bool {
    let others = [STAGE, "plenoctree_sampling", "plenoctree_views"];
    label.starts_with("plenoctree_") && !others.iter().any(|other| label.starts_with(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever else their labels say.
    #[test]
    fn custom_stages_are_not_needed_to_draw_props() {
        assert!(draws_props("plenoctree_volume") && !draws_props("main_opaque_pass_3d"));
        assert!(!draws_props(STAGE) && !draws_props(&format!("{STAGE} shaders/lines.wgsl")));
    }
}
