//! The field as a Bevy asset.

use std::io::Cursor;

use bevy::{
    asset::{AssetLoader, LoadContext, UntypedAssetId, VisitAssetDependencies, io::Reader},
    prelude::*,
    reflect::{TypePath, impl_reflect},
};

use crate::field::{Activation, LoadSettings, PlenOctree, Precision, ReadError, UpAxis};

// The field itself knows nothing of Bevy; this is all that makes an asset of it.
impl Asset for PlenOctree {}

impl VisitAssetDependencies for PlenOctree {
    fn visit_dependencies(&self, _visit: &mut impl FnMut(UntypedAssetId)) {}
}

impl TypePath for PlenOctree {
    fn type_path() -> &'static str {
        "bevy_plenoctree::field::PlenOctree"
    }

    fn short_type_path() -> &'static str {
        "PlenOctree"
    }
}

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq)]
    #[type_path = "bevy_plenoctree::field"]
    struct LoadSettings {
        activation: Option<Activation>,
        up: UpAxis,
        density_threshold: f32,
        precision: Precision,
    }
);

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq, Hash)]
    #[type_path = "bevy_plenoctree::field"]
    enum Precision {
        Half,
        Byte,
    }
);

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq, Hash)]
    #[type_path = "bevy_plenoctree::field"]
    enum Activation {
        Sigmoid,
        ShiftedRelu,
        Identity,
    }
);

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq, Hash)]
    #[type_path = "bevy_plenoctree::field"]
    enum UpAxis {
        Y,
        Z,
    }
);

/// Loads `.npz` files as [`PlenOctree`]s, off the main thread, hot reload included.
///
/// The file's bytes are in memory while it loads; [`PlenOctree::read`] streams them instead. [`LoadSettings`] say what
/// the file cannot.
#[derive(Default, TypePath)]
pub struct PlenOctreeLoader;

impl AssetLoader for PlenOctreeLoader {
    type Asset = PlenOctree;
    type Settings = LoadSettings;
    type Error = ReadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &LoadSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<PlenOctree, ReadError> {
        let label = context.path().to_string();
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|error| ReadError { file: label.clone(), fault: error.into() })?;
        PlenOctree::read_from(Cursor::new(bytes), &label, settings)
    }

    fn extensions(&self) -> &[&str] {
        &["npz"]
    }
}
