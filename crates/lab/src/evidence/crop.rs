//! Enlarged parts of pictures.

use image::{GenericImageView, ImageBuffer, Pixel, RgbImage, imageops};

/// The side of a part, as a share of the picture's shorter side.
const SHARE: f64 = 0.25;
/// How many times parts are enlarged.
const ZOOM: u32 = 4;

/// A square part of pictures of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    left: u32,
    top: u32,
    side: u32,
}

impl Crop {
    /// Returns the part where `measure` is largest, of pictures of this size. `measure` is called for every pixel.
    pub fn of_most((width, height): (u32, u32), measure: impl Fn(u32, u32) -> f64) -> Self {
        let side = ((SHARE * f64::from(width.min(height))).round() as u32).max(1);
        let step = (side / 4).max(1) as usize;
        let sum = |left: u32, top: u32| -> f64 {
            (top..top + side).flat_map(|y| (left..left + side).map(move |x| (x, y))).map(|(x, y)| measure(x, y)).sum()
        };
        let places = (0..=height - side)
            .step_by(step)
            .flat_map(|top| (0..=width - side).step_by(step).map(move |left| Self { left, top, side }));
        let found = places.map(|crop| (sum(crop.left, crop.top), crop));
        // The first of equal places.
        let most = found.reduce(|most, next| if next.0 > most.0 { next } else { most });
        most.map_or(Self { left: 0, top: 0, side }, |(_, crop)| crop)
    }

    /// Returns the part of a picture where another differs most.
    pub fn of_difference(a: &RgbImage, b: &RgbImage) -> Self {
        let difference = |x: u32, y: u32| {
            let (a, b) = (a.get_pixel(x, y), b.get_pixel(x, y));
            a.0.iter().zip(b.0).map(|(a, b)| f64::from(a.abs_diff(b))).sum()
        };
        Self::of_most(a.dimensions(), difference)
    }

    /// Returns the part of a picture.
    pub fn part<P: Pixel<Subpixel = u8> + 'static>(&self, image: &ImageBuffer<P, Vec<u8>>) -> ImageBuffer<P, Vec<u8>> {
        image.view(self.left, self.top, self.side, self.side).to_image()
    }

    /// Returns the part of a picture, enlarged so that its pixels show.
    pub fn enlarged(&self, image: &RgbImage) -> RgbImage {
        let (part, side) = (self.part(image), ZOOM * self.side);
        imageops::resize(&part, side, side, imageops::FilterType::Nearest)
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn the_part_with_the_difference_is_found() {
        let black = RgbImage::new(64, 48);
        let mut dotted = black.clone();
        (40..44).for_each(|x| dotted.put_pixel(x, 30, Rgb([255; 3])));
        let crop = Crop::of_difference(&black, &dotted);
        let part = crop.enlarged(&dotted);
        assert_eq!(part.dimensions(), (48, 48));
        assert_eq!(part.pixels().filter(|pixel| pixel.0 == [255; 3]).count(), 4 * 16);
        Crop::of_difference(&RgbImage::new(1, 1), &RgbImage::new(1, 1)).enlarged(&RgbImage::new(1, 1));
    }
}
