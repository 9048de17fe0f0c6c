//! Reads the cameras and the names of the pictures in `transforms.json` files.

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::{DMat3, DVec2, DVec3};

use super::{
    lens::{Distortion, Lens},
    parts::{FitInput, InputFolders},
    picture,
    view::{CameraMaker, View},
};
use crate::{
    file::{Fault, ply::Ply},
    fit::{
        error::FitError,
        find,
        transforms::{Camera, DISTORTION, File, WrongValue},
    },
};

/// Reads a file of cameras, and the sizes of their pictures.
pub fn read(path: &Path, folders: &InputFolders) -> Result<FitInput, FitError> {
    let file = File::read(path)?;
    let mut maker = CameraMaker::default();
    let (mut frames, mut views, mut missing) = (Vec::new(), Vec::new(), Vec::new());
    for (index, frame) in file.frames.iter().enumerate() {
        match view(path, folders, index, &file, &mut maker)? {
            Listed::View(view) => {
                frames.push(frame);
                views.push(*view);
            }
            Listed::Missing(picture) => missing.push(picture),
        }
    }
    if let (true, Some(first)) = (views.is_empty(), missing.first()) {
        let found = format!("no file {}", first.display());
        return Err(FitError::found(path, "frames[0].file_path", found, "a PNG or JPEG file"));
    }
    // A focal length in pixels is for pictures of one size.
    let sized = |camera: &Camera| camera.intrinsics.w.is_some() || camera.intrinsics.h.is_some();
    if file.camera.intrinsics.is_in_pixels() && !sized(&file.camera) {
        let mut common = (frames.iter().zip(&views))
            .filter(|(frame, _)| !frame.camera.intrinsics.is_in_pixels() && !sized(&frame.camera))
            .map(|(_, view)| (view, (view.camera.width, view.camera.height)));
        if let Some((first, size)) = common.next()
            && let Some((odd, (width, height))) = common.find(|(_, other)| *other != size)
        {
            let expected =
                format!("{}x{} as in {}, or w and h in every frame", size.0, size.1, first.picture.display());
            return Err(FitError::found(&odd.picture, "size", format!("{width}x{height}"), expected));
        }
    }
    let (mut points, mut notes) = (Vec::new(), Vec::new());
    let mut sizes = frames.iter().zip(&views).map(|(frame, View { camera, .. })| {
        let size = (camera.width, camera.height);
        (size, frame.camera.clone().or(file.camera.clone()).stated(size))
    });
    if let Some((size, stated)) = sizes.find(|(size, stated)| (size.0.into(), size.1.into()) != *stated) {
        notes.push(picture::scaled_note(size, stated));
    }
    if let Some(name) = &file.ply_file_path {
        match find::picture(find::folder_of(path), name, false) {
            Some(cloud) => points = points_of(&cloud)?,
            None => notes.push(format!("ply_file_path: no file {name}, so the points of the scene are not known")),
        }
    }
    // nerfstudio writes the same mask to every frame, for parts of a lens or of a rig. Masks of objects differ.
    let mut masks = views.iter().filter_map(|view| view.mask.as_ref());
    if let Some(first) = masks.next().cloned() {
        let others = masks.clone().count();
        let place = |mask: &PathBuf| fs::canonicalize(mask).ok();
        let is_first = |mask: &PathBuf| *mask == first || place(mask) == place(&first);
        if masks.all(is_first) && (others > 0 || folders.ignored.iter().any(is_first)) {
            let (sharing, all, mask) = (1 + others, views.len(), first.display());
            notes.push(format!("{sharing} of {all} frames have the mask {mask}, so what is black in it is ignored"));
            views.iter_mut().for_each(|view| view.ignored = view.mask.take());
        }
    }
    let masked = views.iter().filter(|view| view.mask.is_some()).count();
    if masked > 0 {
        let all = views.len();
        notes.push(format!(
            "{masked} of {all} frames have masks of their own: what is black in them counts as empty, while nerfstudio \
             ignores it"
        ));
    }
    Ok(FitInput { views, points, missing, notes })
}

/// Reads the points of a `.ply` file. Those that are not finite are left out.
fn points_of(path: &Path) -> Result<Vec<DVec3>, FitError> {
    let bytes = fs::read(path).map_err(FitError::io(path))?;
    let read = || {
        let ply = Ply::new(&bytes)?;
        let mut rows = ply.rows("vertex")?.ok_or_else(|| Fault::found("header", "no element `vertex`", "points"))?;
        let column = |name| rows.element.required(name, "the properties x, y and z");
        let columns = [column("x")?, column("y")?, column("z")?];
        let (mut points, mut row) = (Vec::with_capacity(rows.certain), Vec::new());
        while rows.read(&mut row)? {
            points.push(DVec3::from_array(columns.map(|column| row[column])));
        }
        points.retain(|point| point.is_finite());
        Ok(points)
    };
    read().map_err(FitError::fault(path))
}

/// A frame of the file.
enum Listed {
    View(Box<View>),
    /// There is no such picture.
    Missing(PathBuf),
}

fn view(
    path: &Path,
    folders: &InputFolders,
    index: usize,
    file: &File,
    maker: &mut CameraMaker,
) -> Result<Listed, FitError> {
    let own = find::folder_of(path);
    let folder = folders.pictures.as_deref().unwrap_or(own);
    let frame = &file.frames[index];
    let fault = |wrong| file.fault(path, index, wrong);
    let name = frame.name.as_ref().ok_or_else(|| {
        FitError::found(path, format!("frames[{index}].file_path"), "nothing", "the path of a picture")
    })?;
    let moved = folders.pictures.is_some();
    let Some(picture) = find::picture(folder, name, moved) else { return Ok(Listed::Missing(folder.join(name))) };
    // Masks of a folder replace those that the file names.
    let mask = match frame.mask_path.as_ref().filter(|_| folders.masks.is_none()) {
        Some(name) => Some(
            find::picture(own, name, false)
                .or_else(|| find::picture(folder, name, moved))
                .ok_or_else(|| fault(("mask_path", format!("no file {}", own.join(name).display()), "a picture")))?,
        ),
        None => None,
    };
    let pose = frame.pose().map_err(fault)?;
    let own = frame.camera.clone().or(file.camera.clone());
    let size = picture::size(&picture)?;
    let stated = own.stated(size);
    // One side does not tell whether a picture is a scaled copy.
    let is_whole = own.intrinsics.w.is_some() == own.intrinsics.h.is_some();
    let scale = picture::scale(size, stated).filter(|scale| is_whole || *scale == DVec2::ONE);
    let Some(scale) = scale else {
        let expected = match (own.intrinsics.w, own.intrinsics.h) {
            (Some(width), Some(height)) => {
                format!("{width}x{height}, as w and h in {} state, or a scaled copy", path.display())
            }
            (Some(width), None) => format!("a width of {width}, as w in {} states", path.display()),
            _ => format!("a height of {}, as h in {} states", stated.1, path.display()),
        };
        return Err(FitError::found(&picture, "size", format!("{}x{}", size.0, size.1), expected));
    };
    let lens = own.lens(stated.into()).map_err(fault)?.scaled(scale);
    let camera =
        maker.camera(size.0, size.1, lens, DMat3::from_mat4(pose), pose.w_axis.truncate()).map_err(|point| {
            let key =
                DISTORTION.into_iter().zip(own.distortion()).find(|(_, k)| *k != 0.0).map_or("k1", |(key, _)| key);
            fault((key, format!("a lens without a direction at {point}"), "a lens that covers the picture"))
        })?;
    Ok(Listed::View(Box::new(View { name: name.clone(), picture, mask, ignored: None, camera })))
}

impl Camera {
    /// Returns the size that the file states, or that of the picture.
    fn stated(&self, size: (u32, u32)) -> (f64, f64) {
        (self.intrinsics.w.unwrap_or(size.0.into()), self.intrinsics.h.unwrap_or(size.1.into()))
    }

    /// Returns the lens for pictures of this size.
    fn lens(&self, size: DVec2) -> Result<Lens, WrongValue> {
        let (focal, center) = self.intrinsics.focal_and_center(size)?;
        if let Some(model) = self.unknown_model() {
            let expected = "OPENCV, PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV_FISHEYE";
            return Err(("camera_model", model.into(), expected));
        }
        let distortion = self.distortion();
        if let Some((key, wrong)) = DISTORTION.into_iter().zip(distortion).find(|(_, k)| k.abs() > 1e3) {
            return Err((key, format!("{wrong:?}"), "a coefficient of distortion from -1000 to 1000"));
        }
        let [k1, k2, k3, k4, p1, p2] = distortion;
        let distortion = if self.is_fisheye() {
            Distortion::Fisheye([k1, k2, k3, k4])
        } else if distortion == [0.0; 6] {
            Distortion::None
        } else {
            Distortion::Radial { radial: [k1, k2, k3, k4], divisor: [0.0; 3], tangential: [p1, p2] }
        };
        Ok(Lens { focal, center, distortion })
    }
}
