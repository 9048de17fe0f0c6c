//! Selects the views: examples that palettes may be made from, and others that show the results.

use std::path::Path;

use plenoctree::{PlenOctree, camera::PinholeCamera};
use plenoctree_cli::{result::Result, transforms, turntable};

use super::Arguments;

/// The number of example views, as in figure 8 of the paper.
pub const EXAMPLES: usize = 7;
/// The length of an image's longer side if no size is given, in pixels.
const SIDE: u32 = 320;

/// The cameras of the report. None is in both lists.
pub struct Views {
    /// The views that Chao et al. make palettes from.
    pub examples: Vec<PinholeCamera>,
    /// The views that show the results.
    pub shown: Vec<PinholeCamera>,
}

/// Selects the views evenly from the given cameras. If there are too few, or none, turntables complete them.
pub fn select(field: &PlenOctree, path: &Path, arguments: &Arguments) -> Result<Views> {
    let mut cameras = match &arguments.cameras {
        Some(file) => transforms::read(file, arguments.size)?.cameras,
        None => Vec::new(),
    };
    if arguments.size.is_none() {
        cameras = cameras.into_iter().map(limited).collect();
    }
    let size = arguments.size.unwrap_or((SIDE, SIDE));
    let count = arguments.views as usize;
    let turn = |frames| {
        let turn = turntable::full_turn(field, size, frames);
        turn.ok_or_else(|| format!("{}: nothing is visible in the field", path.display()))
    };
    if cameras.is_empty() {
        // Every view of the results is halfway between two examples.
        let (examples, others) = turn(2 * EXAMPLES)?.into_iter().enumerate().partition(|(index, _)| index % 2 == 0);
        let camera = |(_, camera)| camera;
        let (examples, others): (Vec<_>, Vec<_>) = (examples, others);
        let others: Vec<PinholeCamera> = others.into_iter().map(camera).collect();
        return Ok(Views { examples: examples.into_iter().map(camera).collect(), shown: spread(&others, count) });
    }
    if cameras.len() <= EXAMPLES {
        return Ok(Views { examples: turn(EXAMPLES)?, shown: spread(&cameras, count) });
    }
    let examples: Vec<usize> = positions(cameras.len(), EXAMPLES).collect();
    let others: Vec<_> = (0..cameras.len()).filter(|index| !examples.contains(index)).map(|i| cameras[i]).collect();
    Ok(Views { examples: examples.into_iter().map(|index| cameras[index]).collect(), shown: spread(&others, count) })
}

/// Returns the view with its longer side at most [`SIDE`] pixels long.
fn limited(camera: PinholeCamera) -> PinholeCamera {
    let longer = camera.width.max(camera.height);
    if longer <= SIDE {
        return camera;
    }
    let scaled = |side: u32| ((u64::from(side) * u64::from(SIDE)).div_ceil(u64::from(longer)) as u32).max(1);
    camera.resized(scaled(camera.width), scaled(camera.height))
}

/// Returns at most `count` of the cameras, evenly spread.
fn spread(cameras: &[PinholeCamera], count: usize) -> Vec<PinholeCamera> {
    positions(cameras.len(), count.min(cameras.len())).map(|index| cameras[index]).collect()
}

/// Returns the middles of `count` equal parts of `0..length`. `count` is at most `length`.
fn positions(length: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |part| (2 * part + 1) * length / (2 * count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_even_and_different() {
        assert_eq!(positions(200, 7).collect::<Vec<_>>(), [14, 42, 71, 100, 128, 157, 185]);
        for length in 1..40 {
            for count in 1..=length {
                let chosen: Vec<_> = positions(length, count).collect();
                assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]) && chosen.iter().all(|at| *at < length));
            }
        }
    }

    /// Photographs keep their proportions.
    #[test]
    fn large_views_are_scaled_down() {
        let camera = PinholeCamera::new(1600, 900, 0.7, glam::DMat4::IDENTITY);
        let small = limited(camera);
        assert_eq!((small.width, small.height), (320, 180));
        assert_eq!(limited(small), small);
        let (_, expected) = camera.ray(1600.0, 900.0);
        assert!(small.ray(320.0, 180.0).1.distance(expected) < 1e-12);
    }
}
