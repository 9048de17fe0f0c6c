//! The input of a fit.

use std::path::PathBuf;

use glam::DVec3;

use super::view::View;

/// Pictures with their cameras, and points of the scene if they are known.
#[derive(Clone, Debug, Default)]
pub struct FitInput {
    /// The views, in the order of the names of their pictures.
    pub views: Vec<View>,
    /// Points on the surfaces of the scene. Empty if none are known.
    pub points: Vec<DVec3>,
    /// The pictures that the input lists and that are not there. They are left out of `views`.
    pub missing: Vec<PathBuf>,
    /// What else users should know about the input, such as models that are left out: a sentence each, for a warning.
    pub notes: Vec<String>,
}

/// The folders of pictures and masks, if they are not in the usual places.
#[derive(Clone, Debug, Default)]
pub struct InputFolders {
    /// The folder of the pictures. Names in a COLMAP model are relative to it.
    pub pictures: Option<PathBuf>,
    /// A folder of masks: for `name.jpg`, `name.jpg.png`, `name.png` or `name.jpg`, in the same folders below it as the
    /// picture or directly in it. White shows the object, or 1 if there is no brighter pixel.
    pub masks: Option<PathBuf>,
    /// Masks of lenses: where frames name one of these, what is black in it is not known, even if no other frame does.
    pub ignored: Vec<PathBuf>,
}
