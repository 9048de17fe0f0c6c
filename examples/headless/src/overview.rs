//! One picture of everything: the field as trained, posterized and recolored, its palette, and the turn of the camera.

use bevy::prelude::{Color, ColorToPacked, Vec2};
use bevy_plenoctree::Palette;
use image::{
    Rgba, RgbaImage,
    imageops::{FilterType, overlay, resize},
};

use crate::colors;

/// The width of the picture, and the space around and between its parts, in pixels.
const WIDTH: u32 = 1600;
const GAP: u32 = 40;
/// The largest width of a swatch, its height, and the radius of the corners of a ramp, in pixels.
const SWATCH: (f32, f32) = (100.0, 56.0);
const RADIUS: f32 = 12.0;

/// Draws large views in a row, the palette with the colors that are shown instead below it, and a row of small views.
pub fn draw(large: &[&RgbaImage], small: &[&RgbaImage], palette: &Palette, shown: &[Color]) -> RgbaImage {
    let row =
        |views: &[&RgbaImage], gap: u32| (WIDTH - GAP - (views.len() as u32) * gap - GAP + gap) / views.len() as u32;
    let (large_size, small_size) = (row(large, GAP), row(small, GAP / 4));
    let swatches = 2 * SWATCH.1 as u32 + GAP / 4;
    let mut picture = RgbaImage::from_pixel(WIDTH, large_size + swatches + small_size + 4 * GAP, Rgba([255; 4]));
    let mut put = |views: &[&RgbaImage], size: u32, gap: u32, top: u32| {
        for (index, view) in (0..).zip(views) {
            let view = resize(*view, size, size, FilterType::CatmullRom);
            overlay(&mut picture, &view, i64::from(GAP + index * (size + gap)), i64::from(top));
        }
    };
    put(large, large_size, GAP, GAP);
    put(small, small_size, GAP / 4, large_size + swatches + 3 * GAP);
    let source = palette.colors.iter().map(|color| Color::srgb_from_array(color.map(|channel| channel as f32)));
    let top = (large_size + 2 * GAP) as f32;
    draw_ramps(&mut picture, palette, &source.collect::<Vec<_>>(), top);
    draw_ramps(&mut picture, palette, shown, top + SWATCH.1 + 0.25 * GAP as f32);
    picture
}

/// Draws the colors of each ramp side by side, from shadow to highlight.
fn draw_ramps(picture: &mut RgbaImage, palette: &Palette, colors: &[Color], top: f32) {
    let groups = colors::groups(palette);
    let gaps = (0.5 * GAP as f32) * (groups.len() as f32 - 1.0);
    let all = (WIDTH - 2 * GAP) as f32 - gaps;
    let width = (all / palette.colors.len() as f32).clamp(1.0, SWATCH.0).floor();
    let mut left = (0.5 * (WIDTH as f32 - gaps - width * palette.colors.len() as f32)).max(0.0).floor();
    for (_, tones) in groups {
        let size = Vec2::new(width * tones.len() as f32, SWATCH.1);
        for (x, y) in (0..size.x as u32).flat_map(|x| (0..size.y as u32).map(move |y| (x, y))) {
            let at = Vec2::new(x as f32, y as f32) + 0.5;
            let Some(color) = colors.get(tones[(at.x / width) as usize]) else { continue };
            // How far the pixel is outside of the ramp's rounded outline.
            let corner = (at - 0.5 * size).abs() - (0.5 * size - RADIUS);
            let inside = (0.5 - (corner.max(Vec2::ZERO).length() - RADIUS)).clamp(0.0, 1.0);
            let [red, green, blue] = color.to_srgba().to_u8_array_no_alpha();
            if let Some(pixel) = picture.get_pixel_mut_checked((left + at.x) as u32, (top + at.y) as u32) {
                let over = |new: u8, old: u8| (f32::from(new) * inside + f32::from(old) * (1.0 - inside)).round() as u8;
                let Rgba(old) = *pixel;
                *pixel = Rgba([over(red, old[0]), over(green, old[1]), over(blue, old[2]), 255]);
            }
        }
        left += size.x + 0.5 * GAP as f32;
    }
}
