//! Reads the input of a fit: pictures with their cameras.

mod colmap;
mod lens;
mod parts;
mod picture;
mod transforms;
mod view;

use std::{
    collections::{HashMap, HashSet},
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::error::FitError;

pub use lens::{Distortion, Lens};
pub use parts::{FitInput, InputFolders};
pub use picture::Picture;
pub(super) use view::CameraMaker;
pub use view::{View, ViewCamera};

/// Maximum number of pictures in an input.
const MAX_VIEWS: usize = 100_000;

impl FitInput {
    /// Reads an input:
    ///
    /// - a `transforms.json` file of NeRF, instant-ngp or nerfstudio, or a folder with a `transforms.json` or
    ///   `transforms_train.json`,
    /// - a COLMAP model: a folder with `cameras`, `images` and, if there are points, `points3D`, as `.bin` or `.txt`,
    ///   or one with such a model in `sparse/0`, `sparse` or `colmap/sparse/0`. Of several models in `sparse/0`,
    ///   `sparse/1` and so on, that with the most pictures counts. The pictures are in a folder `images` next to it or
    ///   above it.
    ///
    /// Pictures are PNG or JPEG files.
    ///
    /// # Errors
    ///
    /// Returns an error that names the file if one cannot be read or has unexpected content, if all pictures or any
    /// mask are missing, if a picture or mask does not have the stated size, or if a camera has no valid pose or lens.
    /// If only some of the pictures are missing, they are listed in [`FitInput::missing`].
    pub fn read(path: &Path, folders: &InputFolders) -> Result<Self, FitError> {
        let mut input = if path.is_file() {
            transforms::read(path, folders)?
        } else if let Some(file) = ["transforms.json", "transforms_train.json"]
            .map(|name| path.join(name))
            .into_iter()
            .find(|file| file.exists())
        {
            transforms::read(&file, folders)?
        } else if let Some((model, others)) = model_in(path) {
            let mut input = colmap::read(&model, folders)?;
            if !others.is_empty() {
                let named = |(folder, size): &(PathBuf, u64)| format!("{} ({size} pictures)", folder.display());
                let others: Vec<String> = others.iter().map(named).collect();
                let model = model.display();
                input.notes.push(format!("only {model} is used, the largest model; left out: {}", others.join(", ")));
            }
            input
        } else {
            fs::metadata(path).map_err(FitError::io(path))?;
            let expected = "transforms.json, transforms_train.json, or a COLMAP model (cameras, images, points3D)";
            return Err(FitError::found(path, "folder", "none of the known files", expected));
        };
        if input.views.is_empty() || input.views.len() > MAX_VIEWS {
            let found = format!("{} views", input.views.len());
            return Err(FitError::found(path, "views", found, format!("1 to {MAX_VIEWS}")));
        }
        // The order of files varies, so sort them by name, with numbers in numeric order.
        input.views.sort_by_cached_key(|view| natural(&view.name));
        let all = input.views.len();
        let mut listed = HashSet::new();
        input.views.retain(|View { picture, camera, .. }| {
            let pose = [camera.rotation.to_cols_array().as_slice(), &camera.position.to_array()].concat();
            listed.insert((picture.clone(), pose.into_iter().map(f64::to_bits).collect::<Vec<_>>()))
        });
        // One of them would be fitted and another one held out, or they would count twice.
        if input.views.len() < all {
            let again = all - input.views.len();
            input
                .notes
                .push(format!("{again} of {all} pictures are left out: they are listed twice, with the same pose"));
        }
        let gaps = input.views.iter().filter(|view| view.camera.has_gaps()).count();
        if gaps > 0 {
            let all = input.views.len();
            input
                .notes
                .push(format!("the lenses of {gaps} of {all} pictures are not defined in parts, which are ignored"));
        }
        if let Some(folder) = &folders.masks {
            for view in &mut input.views {
                view.mask = Some(mask_in(folder, &view.name, &view.picture)?);
            }
        }
        let mut known = HashMap::new();
        for View { ignored, camera, .. } in &mut input.views {
            let Some(path) = ignored else { continue };
            let mask = match known.get(path) {
                Some(mask) => mask,
                None => known.entry(path.clone()).or_insert(Arc::new(picture::read_mask(path)?)),
            };
            camera.set_known(mask.clone());
        }
        for view in &input.views {
            for mask in view.mask.iter().chain(&view.ignored) {
                let (size, expected) = (picture::size(mask)?, (view.camera.width, view.camera.height));
                if size != expected {
                    let [found, expected] = [size, expected].map(|(w, h)| format!("{w}x{h} pixels"));
                    return Err(FitError::found(mask, "size of the mask", found, format!("its picture's {expected}")));
                }
            }
        }
        Ok(input)
    }
}

/// Finds the COLMAP model in a folder. Returns the largest one, and the others with their numbers of pictures.
fn model_in(path: &Path) -> Option<(PathBuf, Vec<(PathBuf, u64)>)> {
    // Parts of the scene that COLMAP could not connect.
    let parts = |folder: PathBuf| {
        let names = fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
        let mut numbers: Vec<u32> = names.filter_map(|name| name.to_str()?.parse().ok()).collect();
        numbers.sort_unstable();
        numbers.into_iter().map(move |number| folder.join(number.to_string())).collect::<Vec<_>>()
    };
    let sparse = path.join("sparse");
    let places =
        [vec![path.into()], parts(sparse.clone()), vec![sparse], parts(path.join("colmap/sparse")), parts(path.into())];
    let models = places.into_iter().map(|place| place.into_iter().filter(|folder| colmap::is_model(folder)));
    let models: Vec<PathBuf> = models.map(Iterator::collect).find(|models: &Vec<_>| !models.is_empty())?;
    let mut sized: Vec<(PathBuf, u64)> = match &models[..] {
        [model] => vec![(model.clone(), 0)],
        _ => models.iter().map(|model| (model.clone(), colmap::size(model))).collect(),
    };
    // The first of the largest.
    let largest = sized.iter().rev().max_by_key(|(_, size)| *size)?.0.clone();
    sized.retain(|(model, _)| *model != largest);
    Some((largest, sized))
}

/// Finds the mask of a picture, in the same folders below `folder` as the input names for the picture, or in some of
/// them.
fn mask_in(folder: &Path, name: &str, picture: &Path) -> Result<PathBuf, FitError> {
    let file = picture.file_name().unwrap_or_default();
    let candidates = |folder: &Path| {
        let same = folder.join(file);
        [same.with_added_extension("png"), same.with_extension("png"), same]
    };
    let parts: Vec<&str> = name.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | "..")).collect();
    let folders = &parts[..parts.len().saturating_sub(1)];
    let within = |first: usize| candidates(&folder.join(folders[first..].iter().collect::<PathBuf>()));
    (0..=folders.len()).flat_map(within).find(|path| path.is_file()).ok_or_else(|| {
        let [whole, stem, _] = candidates(folder);
        FitError::found(picture, "mask", "none", format!("{} or {}", whole.display(), stem.display()))
    })
}

/// Returns a key that sorts `r_2` before `r_10`.
fn natural(name: &str) -> Vec<(u64, String)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let letters = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (text, from_digits) = rest.split_at(letters);
        let digits = from_digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(from_digits.len());
        let (number, after) = from_digits.split_at(digits);
        parts.push((0, text.into()));
        parts.push((number.parse().unwrap_or(u64::MAX), number.into()));
        rest = after;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count() {
        let mut names = ["r_10", "r_2", "b/3.png", "r_1", "b/20.png"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["b/3.png", "b/20.png", "r_1", "r_2", "r_10"]);
    }
}
