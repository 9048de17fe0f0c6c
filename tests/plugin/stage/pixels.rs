//! Reading and comparing frames.

use bevy::prelude::*;
use glam::DVec3;
use image::{Rgba, RgbaImage};
use plenoctree::reference::Rendering;

pub fn at(frame: &RgbaImage, x: u32, y: u32) -> [u8; 3] {
    let [r, g, b, _] = frame.get_pixel(x, y).0;
    [r, g, b]
}

pub fn middle(frame: &RgbaImage) -> [u8; 3] {
    at(frame, frame.width() / 2, frame.height() / 2)
}

/// Returns the places of all pixels.
pub fn places(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> + Clone {
    (0..width * height).map(move |index| (index % width, index / width))
}

pub fn color(encoded: DVec3) -> Color {
    let [red, green, blue] = encoded.as_vec3().to_array();
    Color::srgb(red, green, blue)
}

/// Returns a color in encoded sRGB.
pub fn encoded(color: impl Into<Color>) -> DVec3 {
    Srgba::from(color.into()).to_vec3().as_dvec3()
}

/// Returns a pixel in 8-bit steps of encoded sRGB.
pub fn steps(pixel: &Rgba<u8>) -> DVec3 {
    DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into())
}

/// Returns the light of a pixel.
pub fn linear(pixel: &Rgba<u8>) -> Vec3 {
    LinearRgba::from(Color::srgb_u8(pixel[0], pixel[1], pixel[2])).to_vec3()
}

pub fn bytes(color: Color) -> [u8; 3] {
    Srgba::from(color).to_u8_array_no_alpha()
}

pub fn is_near(found: [u8; 3], expected: Color, tolerance: u8) -> bool {
    let expected = bytes(expected);
    (0..3).all(|c| found[c].abs_diff(expected[c]) <= tolerance)
}

#[track_caller]
pub fn assert_near(found: [u8; 3], expected: Color, tolerance: u8, what: &str) {
    assert!(is_near(found, expected, tolerance), "{what}: {found:?}, expected {:?}", bytes(expected));
}

/// Counts the pixels in which two frames differ by more than `tolerance`.
pub fn differing(a: &RgbaImage, b: &RgbaImage, tolerance: u8) -> usize {
    assert_eq!(a.dimensions(), b.dimensions());
    let differs = |(a, b): (&Rgba<u8>, &Rgba<u8>)| (0..4).any(|c| a[c].abs_diff(b[c]) > tolerance);
    a.pixels().zip(b.pixels()).filter(|pixels| differs(*pixels)).count()
}

/// Asserts that two frames are equal.
#[track_caller]
pub fn assert_same(found: &RgbaImage, expected: &RgbaImage, what: &str) {
    let differ = |(x, y, pixel): &(u32, u32, &Rgba<u8>)| expected.get_pixel(*x, *y) != *pixel;
    let wrong: Vec<_> = found.enumerate_pixels().filter(differ).map(|(x, y, _)| (x, y)).collect();
    assert!(wrong.is_empty(), "{what}: {} pixels differ, such as {:?}", wrong.len(), &wrong[..wrong.len().min(8)]);
}

/// Returns the root mean square difference of a frame from the expected colors, in 8-bit steps.
pub fn difference(frame: &RgbaImage, expected: &[DVec3]) -> f64 {
    root_mean_square(frame.pixels().zip(expected.iter().copied()))
}

/// Returns the root mean square difference of a frame from a rendering over a background, in 8-bit steps: that of the
/// pixels where either of them shows anything but the background.
pub fn difference_of_prop(frame: &RgbaImage, expected: &Rendering, background: DVec3) -> f64 {
    root_mean_square(of_prop(frame, expected, background).map(|(_, pixel, color)| (pixel, color)))
}

/// Returns the pixels of a frame where it or a rendering shows anything but the background: where they are, and what was
/// found and expected.
pub fn of_prop<'a>(
    frame: &'a RgbaImage,
    expected: &Rendering,
    background: DVec3,
) -> impl Iterator<Item = ((u32, u32), &'a Rgba<u8>, DVec3)> {
    let pixels = frame.enumerate_pixels().zip(expected.over(background));
    let pixels = pixels.map(|((x, y, pixel), color)| ((x, y), pixel, color));
    pixels.filter(move |(_, pixel, color)| is_off(pixel, background, 0.5) || *color != background)
}

/// Returns the root mean square difference of pixels from the expected colors, in 8-bit steps.
pub fn root_mean_square<'a>(pixels: impl Iterator<Item = (&'a Rgba<u8>, DVec3)>) -> f64 {
    let (mut squares, mut count) = (0.0, 0u32);
    for (pixel, color) in pixels {
        squares += (steps(pixel) - 255.0 * color.clamp(DVec3::ZERO, DVec3::ONE)).length_squared() / 3.0;
        count += 1;
    }
    (squares / f64::from(count.max(1))).sqrt()
}

/// Whether a pixel differs from a color by more than `tolerance` steps in a channel.
pub fn is_off(pixel: &Rgba<u8>, expected: DVec3, tolerance: f64) -> bool {
    (steps(pixel) - 255.0 * expected.clamp(DVec3::ZERO, DVec3::ONE)).abs().max_element() > tolerance
}
