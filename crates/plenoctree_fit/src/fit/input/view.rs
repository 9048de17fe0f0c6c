//! Views: pictures, and the cameras that took them.

use std::{f64::consts::FRAC_PI_2, path::PathBuf, sync::Arc};

use glam::{DMat3, DVec2, DVec3};
use image::{GrayImage, metadata::Orientation};
use plenoctree::camera::PinholeCamera;

use super::{
    lens::{Distortion, Lens},
    picture,
};

/// Smallest distance of the points for which the ray through a distorting lens is computed, in pixels. In between,
/// directions are interpolated, which is off by less than a hundredth of a pixel.
const FINEST_LATTICE: u32 = 4;
/// Square of that distance, relative to the width of the picture: the error grows with the one and falls with the
/// other.
const LATTICE: f64 = 0.04;
/// Number of lenses whose directions are kept for other cameras.
const MOST_LENSES: usize = 32;

/// A posed camera: a lens and a pose.
#[derive(Clone, Debug)]
pub struct ViewCamera {
    /// Width of the picture, in pixels.
    pub width: u32,
    /// Height of the picture, in pixels.
    pub height: u32,
    /// The lens.
    pub lens: Lens,
    /// Axes of the camera in the field's frame: x points right, y up, and the camera looks along -z.
    pub rotation: DMat3,
    /// Position in the field's frame.
    pub position: DVec3,
    /// Directions at the lattice's points, if the lens distorts.
    directions: Option<Arc<Directions>>,
    /// Which pixels are known, if not all are.
    known: Option<Known>,
}

/// Which pixels of a picture are known: those that are at least half bright in a mask.
#[derive(Clone, Debug)]
struct Known {
    mask: Arc<GrayImage>,
    /// How many pixels of the mask a pixel is wide.
    downscale: u32,
}

/// Directions in the camera's frame, at the points of a lattice.
#[derive(Debug)]
struct Directions {
    /// Distance of the points, in pixels.
    distance: u32,
    columns: usize,
    values: Vec<DVec3>,
    /// Whether the lens has no direction at a point, whose value is made up. Empty if it has all.
    gaps: Vec<bool>,
}

impl Directions {
    /// Returns a point of the picture for which there is no direction, if that is its middle, or if there are more of
    /// these than of others.
    fn new(width: u32, height: u32, lens: &Lens) -> Result<Self, DVec2> {
        let middle = 0.5 * DVec2::new(width.into(), height.into());
        lens.unproject(middle).ok_or(middle)?;
        let distance = ((LATTICE * f64::from(width.max(height))).sqrt() as u32).max(FINEST_LATTICE);
        let (columns, rows) = (width / distance + 2, height / distance + 2);
        let mut values = Vec::with_capacity((columns * rows) as usize);
        let (mut gaps, mut gap) = (Vec::with_capacity(values.capacity()), None);
        for row in 0..rows {
            for column in 0..columns {
                let point = DVec2::new(f64::from(column * distance), f64::from(row * distance));
                let point = point.min(DVec2::new(width.into(), height.into()));
                let direction = lens.unproject(point);
                gaps.push(direction.is_none());
                gap = gap.or(direction.is_none().then_some(point));
                let straight = ((point - lens.center) / lens.focal).extend(1.0);
                values.push((direction.unwrap_or(straight) * DVec3::new(1.0, -1.0, -1.0)).normalize());
            }
        }
        match gap {
            None => gaps = Vec::new(),
            Some(gap) if 2 * gaps.iter().filter(|gap| **gap).count() > gaps.len() => return Err(gap),
            Some(_) => {}
        }
        Ok(Self { distance, columns: columns as usize, values, gaps })
    }

    /// Returns whether the directions in a pixel are between those of the lens.
    fn knows(&self, x: u32, y: u32) -> bool {
        let [x, y] = [x, y].map(|at| (at / self.distance) as usize);
        let first = y * self.columns + x;
        let corners = [first, first + 1, first + self.columns, first + self.columns + 1];
        corners.iter().all(|corner| !self.gaps[*corner])
    }
}

/// Creates cameras. Those with the same lens share its directions, which take time and megabytes for large photographs.
#[derive(Default)]
pub struct CameraMaker(Vec<(u32, u32, Lens, Arc<Directions>)>);

impl CameraMaker {
    /// Creates a camera. Returns a point of the picture for which there is no direction, if the lens is not defined in
    /// its middle, or in most of it. Elsewhere, pixels without a direction are not known.
    pub fn camera(
        &mut self,
        width: u32,
        height: u32,
        lens: Lens,
        rotation: DMat3,
        position: DVec3,
    ) -> Result<ViewCamera, DVec2> {
        let mut directions = None;
        if lens.distortion != Distortion::None {
            let known = self.0.iter().find(|known| (known.0, known.1, known.2) == (width, height, lens));
            let table = match known {
                Some((.., table)) => table.clone(),
                None => Arc::new(Directions::new(width, height, &lens)?),
            };
            if known.is_none() {
                self.0.truncate(MOST_LENSES - 1);
                self.0.insert(0, (width, height, lens, table.clone()));
            }
            directions = Some(table);
        }
        Ok(ViewCamera { width, height, lens, rotation, position, directions, known: None })
    }
}

impl ViewCamera {
    /// Creates a camera that sees what a pinhole camera sees.
    pub(in crate::fit) fn pinhole(camera: &PinholeCamera) -> Self {
        let PinholeCamera { width, height, focal_x, focal_y, center_x, center_y, rotation, position } = *camera;
        let (focal, center) = (DVec2::new(focal_x, focal_y), DVec2::new(center_x, center_y));
        let lens = Lens { focal, center, distortion: Distortion::None };
        Self { width, height, lens, rotation, position, directions: None, known: None }
    }

    /// Creates a camera whose axis is in the middle of its picture.
    #[cfg(test)]
    pub(in crate::fit) fn centered([width, height]: [u32; 2], focal: f64, rotation: DMat3, position: DVec3) -> Self {
        let center = 0.5 * DVec2::new(width.into(), height.into());
        let lens = Lens { focal: DVec2::splat(focal), center, distortion: Distortion::None };
        Self { width, height, lens, rotation, position, directions: None, known: None }
    }

    /// Returns the camera for a picture downscaled by `factor` (0 counts as 1), with a lens that cameras share.
    /// Incomplete pixels at the edges are cut off.
    pub(in crate::fit) fn downscaled_by(&self, maker: &mut CameraMaker, factor: u32) -> Result<Self, DVec2> {
        let factor = factor.max(1);
        let (width, height) = ((self.width / factor).max(1), (self.height / factor).max(1));
        let lens = self.lens.downscaled(factor.into());
        let camera = maker.camera(width, height, lens, self.rotation, self.position)?;
        let known = self.known.clone().map(|known| Known { downscale: known.downscale * factor, ..known });
        Ok(ViewCamera { known, ..camera })
    }

    /// Sets which pixels are known: those that are white in a mask of the picture's size.
    pub(super) fn set_known(&mut self, mask: Arc<GrayImage>) {
        self.known = Some(Known { mask, downscale: 1 });
    }

    /// Returns whether the lens has no direction for some pixels.
    pub(super) fn has_gaps(&self) -> bool {
        self.directions.as_ref().is_some_and(|table| !table.gaps.is_empty())
    }

    /// Returns whether what the picture shows at a pixel is known.
    #[inline]
    pub(in crate::fit) fn knows(&self, x: u32, y: u32) -> bool {
        if let Some(table) = self.directions.as_ref().filter(|table| !table.gaps.is_empty())
            && !table.knows(x, y)
        {
            return false;
        }
        let Some(Known { mask, downscale }) = &self.known else { return true };
        let (left, top) = (x * downscale, y * downscale);
        let (right, bottom) = ((left + downscale).min(mask.width()), (top + downscale).min(mask.height()));
        (top..bottom).all(|y| (left..right).all(|x| mask.get_pixel(x, y)[0] >= 128))
    }

    /// Returns the same as [`Self::project`] if the picture is known there.
    pub(in crate::fit) fn sees(&self, position: DVec3) -> Option<(DVec2, f64)> {
        self.project(position).filter(|(point, _)| self.knows(point.x as u32, point.y as u32))
    }

    /// Returns the unit direction, in the field's frame, of the ray through a point of the picture.
    pub fn direction(&self, point: DVec2) -> DVec3 {
        let local = match &self.directions {
            None => {
                let straight = (point - self.lens.center) / self.lens.focal;
                DVec3::new(straight.x, -straight.y, -1.0)
            }
            Some(table) => {
                let size = DVec2::new(self.width.into(), self.height.into());
                let distance = f64::from(table.distance);
                let at = point.clamp(DVec2::ZERO, size) / distance;
                let cell = at.floor();
                // The last points of the lattice are on the picture's edge.
                let edge = (size / distance - cell).min(DVec2::ONE).max(DVec2::splat(1e-9));
                let part = ((at - cell) / edge).min(DVec2::ONE);
                let first = cell.y as usize * table.columns + cell.x as usize;
                let row = |first: usize| table.values[first].lerp(table.values[first + 1], part.x);
                row(first).lerp(row(first + table.columns), part.y)
            }
        };
        (self.rotation * local).normalize()
    }

    /// Returns the point of the picture that shows `position`, and its depth along the optical axis, or `None` if the
    /// camera does not see it.
    pub fn project(&self, position: DVec3) -> Option<(DVec2, f64)> {
        let local = self.rotation.transpose() * (position - self.position);
        let forward = local * DVec3::new(1.0, -1.0, -1.0);
        let point = self.lens.project(forward)?;
        let size = DVec2::new(self.width.into(), self.height.into());
        let inside = point.cmpge(DVec2::ZERO).all() && point.cmplt(size).all();
        // The polynomials of distortion fold over far outside the picture.
        let unfolded = || self.direction(point).dot((position - self.position).normalize()) > 0.999;
        (inside && (self.directions.is_none() || unfolded())).then_some((point, forward.z))
    }

    /// Returns the direction in which the camera looks.
    pub fn axis(&self) -> DVec3 {
        -self.rotation.z_axis
    }
}

/// A picture with its camera.
#[derive(Clone, Debug)]
pub struct View {
    /// Name of the picture, as the input writes it.
    pub name: String,
    /// Path of the picture.
    pub picture: PathBuf,
    /// Path of a mask: white shows the object.
    pub mask: Option<PathBuf>,
    /// Path of a mask that frames share: what is black in it is not known.
    pub ignored: Option<PathBuf>,
    /// The camera, for the picture in its full size.
    pub camera: ViewCamera,
}

impl View {
    /// Returns the axes of the picture as it is shown, in the camera's frame: turned as its EXIF data says.
    pub(in crate::fit) fn shown_axes(&self) -> DMat3 {
        let quarters = match picture::orientation(&self.picture) {
            Orientation::Rotate90 | Orientation::Rotate90FlipH => 1.0,
            Orientation::Rotate180 | Orientation::FlipVertical => 2.0,
            Orientation::Rotate270 | Orientation::Rotate270FlipH => 3.0,
            Orientation::NoTransforms | Orientation::FlipHorizontal => 0.0,
        };
        // What is at the left of a picture that is to be turned clockwise is up.
        DMat3::from_rotation_z(quarters * FRAC_PI_2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Interpolated directions of a wide lens are within a hundredth of a pixel of the exact ones, up to the edge.
    #[test]
    fn distorted_rays_are_accurate() {
        for distortion in [
            Distortion::Radial { radial: [-0.25, 0.07, 0.0, 0.0], divisor: [0.0; 3], tangential: [1e-3, -2e-3] },
            Distortion::Fisheye([0.03, -0.01, 2e-3, 0.0]),
        ] {
            for scale in [1, 10] {
                let large = f64::from(scale);
                let center = large * DVec2::new(203.0, 147.0);
                let lens = Lens { focal: DVec2::splat(large * 300.0), center, distortion };
                let maker = &mut CameraMaker::default();
                let camera = maker.camera(402 * scale, 301 * scale, lens, DMat3::IDENTITY, DVec3::ZERO).unwrap();
                for at in [(0.5, 0.5), (13.2, 200.9), (401.5, 300.5), (203.0, 147.0), (399.0, 1.5), (222.5, 299.9)] {
                    let at = large * DVec2::from(at);
                    let (back, _) = camera.project(camera.direction(at)).unwrap();
                    assert!((back - at).length() < 0.01, "{distortion:?}: {at}: {back}");
                }
            }
        }
    }

    /// A pixel is known if all that it is the mean of are white in the mask, and only what is known is seen.
    #[test]
    fn known_pixels_are_white_in_the_mask() {
        let mut camera = ViewCamera::centered([6, 2], 4.0, DMat3::IDENTITY, DVec3::ZERO);
        assert!(camera.knows(0, 0) && camera.sees(DVec3::new(-0.6, 0.0, -1.0)).is_some());
        let mask = GrayImage::from_fn(6, 2, |x, _| image::Luma([if x < 3 { 0 } else { 255 }]));
        camera.set_known(Arc::new(mask));
        assert_eq!([0, 1, 2, 3, 4, 5].map(|x| camera.knows(x, 1)), [false, false, false, true, true, true]);
        assert!(camera.project(DVec3::new(-0.6, 0.0, -1.0)).is_some());
        assert_eq!([-0.6, 0.6].map(|x| camera.sees(DVec3::new(x, 0.0, -1.0)).is_some()), [false, true]);
        let half = camera.downscaled_by(&mut CameraMaker::default(), 2).unwrap();
        assert_eq!([0, 1, 2].map(|x| half.knows(x, 0)), [false, false, true]);
    }

    /// Pixels for which a lens has no direction are not known, and nothing is seen there; a lens without any in the middle
    /// is an error.
    #[test]
    fn lenses_may_lack_directions_at_the_corners() {
        // The radius is largest, 0.77, at an angle of 1.15.
        let distortion = Distortion::Fisheye([-0.25, 0.0, 0.0, 0.0]);
        let lens = Lens { focal: DVec2::splat(60.0), center: DVec2::splat(40.0), distortion };
        let camera = |lens| CameraMaker::default().camera(80, 80, lens, DMat3::IDENTITY, DVec3::ZERO);
        let wide = camera(lens).unwrap();
        assert!(wide.has_gaps());
        let known = |camera: &ViewCamera, factor: u32| {
            for y in 0..camera.height {
                for x in 0..camera.width {
                    let point = DVec2::new(x.into(), y.into()) + 0.5;
                    let radius = f64::from(factor) * (point - camera.lens.center).length();
                    let (inside, outside) = (radius < 34.0, radius > 48.0);
                    assert!(!inside && !outside || camera.knows(x, y) == inside, "{x} {y}");
                    assert!((camera.direction(point).length() - 1.0).abs() < 1e-9);
                    if camera.knows(x, y) && inside {
                        let (back, _) = camera.sees(5.0 * camera.direction(point)).unwrap();
                        assert!((back - point).length() < 0.2, "{point} {back}");
                    }
                }
            }
        };
        known(&wide, 1);
        known(&wide.downscaled_by(&mut CameraMaker::default(), 2).unwrap(), 2);
        assert!(camera(Lens { center: DVec2::splat(-40.0), ..lens }).is_err());
        assert!(camera(Lens { focal: DVec2::splat(20.0), ..lens }).is_err());
        let whole = camera(Lens { focal: DVec2::splat(90.0), ..lens }).unwrap();
        assert!(!whole.has_gaps() && whole.knows(0, 0));
    }

    /// Cameras with the same lens share its directions, and those of a photograph of 12 megapixels take less than 3 MB.
    #[test]
    fn lenses_are_shared() {
        let distortion = Distortion::Radial { radial: [-0.1, 0.0, 0.0, 0.0], divisor: [0.0; 3], tangential: [0.0; 2] };
        let lens = Lens { focal: DVec2::splat(3000.0), center: DVec2::new(2000.0, 1500.0), distortion };
        let mut maker = CameraMaker::default();
        let mut table = |focal: f64| {
            let lens = Lens { focal: DVec2::splat(focal), ..lens };
            let camera = maker.camera(4000, 3000, lens, DMat3::IDENTITY, DVec3::ZERO).unwrap();
            camera.directions.unwrap()
        };
        let tables = [table(3000.0), table(3100.0), table(3000.0)];
        assert!(Arc::ptr_eq(&tables[0], &tables[2]) && !Arc::ptr_eq(&tables[0], &tables[1]));
        assert!(24 * tables[0].values.len() < 3_000_000);
    }
}
