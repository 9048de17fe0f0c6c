//! The results that a view keeps.

use bevy::shader::ShaderDefVal;

/// A result that a view keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum KeptPart {
    /// The layer, and everything that it is made from.
    Layer,
    /// The composite, before and after the filter.
    Composite,
    /// What the label pass and the blend pass show.
    Labels,
}

impl KeptPart {
    /// Returns the definition that makes `fullscreen.wgsl` draw nothing while it is kept.
    pub fn definition(self) -> ShaderDefVal {
        match self {
            Self::Layer => "KEPT_LAYER".into(),
            Self::Composite => "KEPT_COMPOSITE".into(),
            Self::Labels => "KEPT_LABELS".into(),
        }
    }
}
