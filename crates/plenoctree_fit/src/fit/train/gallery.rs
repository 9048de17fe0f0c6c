//! The pictures to fit to: all of them in memory, or as many at a time as fit.

use std::sync::Arc;

use plenoctree::random::Random;
use rayon::prelude::*;

use crate::fit::{
    error::FitError,
    input::{Picture, View, ViewCamera},
};

/// A view whose picture is in memory.
#[derive(Clone, Debug)]
pub struct TrainView {
    /// Index among the views that are fitted to.
    pub number: usize,
    pub camera: ViewCamera,
    pub picture: Arc<Picture>,
}

/// The views to fit to.
pub struct Gallery {
    views: Vec<View>,
    cameras: Vec<ViewCamera>,
    downscale: u32,
    /// Number of views to hold at a time.
    at_once: usize,
    /// The views in memory.
    held: Vec<TrainView>,
    /// Views that this round over all views has not shown yet.
    waiting: Vec<usize>,
}

impl Gallery {
    /// Creates a gallery that holds at most `memory` bytes of pictures. `cameras` are those of the downscaled pictures.
    pub fn new(views: Vec<View>, cameras: Vec<ViewCamera>, downscale: u32, memory: u64) -> Self {
        let bytes = |camera: &ViewCamera| 4 * u64::from(camera.width) * u64::from(camera.height);
        let largest = cameras.iter().map(bytes).max().unwrap_or(1);
        let total: u64 = cameras.iter().map(bytes).sum();
        let at_once = if total <= memory { cameras.len() } else { (memory / largest) as usize }.max(1);
        Self { views, cameras, downscale, at_once, held: Vec::new(), waiting: Vec::new() }
    }

    /// Creates a gallery of pictures that are in memory and stay there. Views are numbered in their order.
    pub fn held(held: Vec<TrainView>) -> Self {
        let cameras: Vec<ViewCamera> = held.iter().map(|view| view.camera.clone()).collect();
        Self { views: Vec::new(), at_once: held.len(), cameras, downscale: 1, held, waiting: Vec::new() }
    }

    /// Returns the number of views.
    pub fn len(&self) -> usize {
        self.cameras.len()
    }

    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Returns all cameras, for the downscaled pictures.
    pub fn cameras(&self) -> Vec<&ViewCamera> {
        self.cameras.iter().collect()
    }

    /// Calls `visit` with every view in order, without exceeding the memory limit.
    ///
    /// # Errors
    ///
    /// Returns an error if a picture cannot be read.
    pub fn each(&mut self, mut visit: impl FnMut(&TrainView)) -> Result<(), FitError> {
        let all: Vec<usize> = (0..self.len()).collect();
        for numbers in all.chunks(self.at_once) {
            self.hold(numbers)?;
            self.held.iter().for_each(&mut visit);
        }
        Ok(())
    }

    /// Returns the views of the next round: all of them, or some that have not been used since all others were.
    ///
    /// # Errors
    ///
    /// Returns an error if a picture cannot be read.
    pub fn next_round(&mut self, random: &mut Random) -> Result<Vec<TrainView>, FitError> {
        let numbers = self.next_numbers(random);
        self.hold(&numbers)?;
        Ok(self.held.clone())
    }

    /// Returns the number of pixels in the files of the views in memory.
    pub fn pixels_read(&self) -> u64 {
        let pixels: usize = self.held.iter().map(|view| view.picture.pixels.len()).sum();
        pixels as u64 * u64::from(self.downscale).pow(2)
    }

    /// Returns the numbers of these views. Rounds are about equally large.
    fn next_numbers(&mut self, random: &mut Random) -> Vec<usize> {
        if self.at_once >= self.len() {
            return (0..self.len()).collect();
        }
        if self.waiting.is_empty() {
            self.waiting = (0..self.len()).collect();
            random.shuffle(&mut self.waiting);
        }
        let waiting = self.waiting.len();
        self.waiting.split_off(waiting - waiting.div_ceil(waiting.div_ceil(self.at_once)))
    }

    /// Reads these pictures, and drops all others.
    fn hold(&mut self, numbers: &[usize]) -> Result<(), FitError> {
        if self.held.iter().map(|view| view.number).eq(numbers.iter().copied()) {
            return Ok(());
        }
        self.held.clear();
        let read = |&number: &usize| {
            let view = &self.views[number];
            let picture = Picture::read(&view.picture, view.mask.as_deref(), self.downscale)?;
            Ok(TrainView { number, camera: self.cameras[number].clone(), picture: Arc::new(picture) })
        };
        self.held = numbers.par_iter().map(read).collect::<Result<_, FitError>>()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    /// Rounds over a part of the views show all of them, about equally many at a time, before any is shown again.
    #[test]
    fn rounds_are_even_and_show_all_views() {
        let mut random = Random::new(1);
        for (views, at_once, sizes) in
            [(9, 4, vec![3, 3, 3]), (11, 10, vec![6, 5]), (3, 1, vec![1; 3]), (5, 7, vec![5])]
        {
            let camera = ViewCamera::centered([2; 2], 1.0, DMat3::IDENTITY, DVec3::ZERO);
            // A picture takes 16 bytes.
            let mut gallery = Gallery::new(Vec::new(), vec![camera; views], 1, 16 * at_once);
            for _ in 0..3 {
                let rounds: Vec<Vec<usize>> = sizes.iter().map(|_| gallery.next_numbers(&mut random)).collect();
                assert!(rounds.iter().map(Vec::len).eq(sizes.iter().copied()), "{rounds:?}");
                let mut shown = rounds.concat();
                shown.sort_unstable();
                assert!(shown.into_iter().eq(0..views));
            }
        }
    }
}
