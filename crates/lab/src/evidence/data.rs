//! What the figures show.

use std::sync::Arc;

use plenoctree::{PlenOctree, palette::Extraction, sampling::Histograms};
use plenoctree_cli::renderer::Render;

use super::{methods::Methods, shot::Shot, views::Views};
use crate::report::Folder;

/// What the figures show.
pub struct Evidence {
    /// The field's name.
    pub name: String,
    pub field: PlenOctree,
    pub views: Views,
    pub renderer: Box<dyn Render>,
    pub folder: Folder,
    pub histograms: Arc<Histograms>,
    /// The extractions by hull and by fit.
    pub extractions: [Extraction; 2],
    pub methods: Methods,
    /// The drawings of the palettes, in the order of [`Method::ALL`].
    pub drawings: Vec<String>,
    /// The views that show results.
    pub shots: Vec<Shot>,
}
