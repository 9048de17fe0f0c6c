//! Tests the frames that the plugin draws, against the float64 reference and known colors.

use bevy::{camera::Viewport, prelude::*, render::render_asset::RenderAssets};
use bevy_plenoctree::{
    Activation, BorderSmoothing, EdgeSmoothing, FieldPalette, GpuField, Palette, PaletteMethod, PlenOctree, Posterize,
    UpAxis, headless::pinhole_view,
};
use glam::{DMat4, DVec3};
use plenoctree::{
    BakeSettings, Basis, Cell, PackSettings, Packed, bake, camera::PinholeCamera, reference, sampling::Progress,
};

use super::stage::{
    Stage,
    fields::{SOLID, activated, cube, field},
    pixels::{assert_near, difference_of_prop, is_off, middle},
};

const SIZE: u32 = 96;

/// Bakes a soft ball whose color depends on position and direction.
fn ball(basis: Basis) -> PlenOctree {
    let settings = BakeSettings {
        depth: 5,
        min: DVec3::new(-1.0, -1.5, -1.0),
        max: DVec3::new(1.0, 1.0, 1.2),
        basis,
        ..Default::default()
    };
    bake(
        &settings,
        |at| (30.0 * (0.8 - at.length())).clamp(0.0, 12.0),
        |at| {
            move |direction: DVec3| {
                let tint = 0.5 + 0.4 * (7.0 * at).map(f64::sin);
                tint + 0.2 * direction.dot(at.normalize_or_zero()) * DVec3::new(1.0, -0.5, 0.3)
            }
        },
    )
    .unwrap()
}

fn pinhole() -> PinholeCamera {
    PinholeCamera::new(SIZE, SIZE, 0.7, DMat4::IDENTITY).looking_at(DVec3::new(2.0, -2.2, 1.4), DVec3::ZERO, DVec3::Z)
}

fn palette() -> Palette {
    Palette::new(vec![[0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.15, 0.2, 0.9], [0.95, 0.9, 0.85], [0.05, 0.05, 0.1]])
        .unwrap()
}

/// Creates a scene with a prop in front of white.
fn scene(field: &PlenOctree) -> Stage {
    in_stage(Stage::new(SIZE), field)
}

fn in_stage(mut stage: Stage, field: &PlenOctree) -> Stage {
    stage.set_background(Color::WHITE);
    stage.set(pinhole_view(&pinhole(), field.up()));
    stage.spawn_prop(field, ());
    stage.paint(FieldPalette::new(palette()));
    stage.wait();
    stage
}

#[test]
fn every_basis_matches_the_reference() {
    let mut scene: Option<Stage> = None;
    for basis in Basis::ALL {
        let ball = ball(basis);
        for activation in [Activation::Sigmoid, Activation::ShiftedRelu, Activation::Identity] {
            let field = activated(&ball, activation);
            let expected = reference::render(&field, &pinhole());
            let scene = scene.get_or_insert_with(|| self::scene(&field));
            scene.show(&field);
            let difference = difference_of_prop(&scene.capture(), &expected, DVec3::ONE);
            // Rounding to 8 bits alone makes a difference of 0.29; 50 dB is a difference of 0.8.
            assert!(difference < 0.4, "{basis:?} {activation:?}: {difference}");
        }
    }
}

/// The codebooks of a packed field are on the GPU too, where a leaf takes 10 bytes.
#[test]
fn packed_fields_match_the_reference() {
    let mut scene: Option<Stage> = None;
    for basis in [Basis::Sh1, Basis::Sh9, Basis::Sh25] {
        let settings = PackSettings { rows: 300, ..default() };
        let packed = Packed::new(&ball(basis), &settings, &Progress::default()).unwrap();
        let field = packed.field();
        let expected = reference::render(field, &pinhole());
        let scene = scene.get_or_insert_with(|| self::scene(field));
        scene.show(field);
        let difference = difference_of_prop(&scene.capture(), &expected, DVec3::ONE);
        assert!(difference < 0.4, "{basis:?}: {difference}");
        let codebook = field.codebook().unwrap();
        let fields = scene.render_world().resource::<RenderAssets<GpuField>>();
        let bytes = fields.get(&scene.field()).unwrap().bytes();
        assert!(bytes <= GpuField::byte_size(field) + (1 << 17), "{bytes}");
        // The table, whole rows of textures, and rows of codebooks that are padded to texels.
        let table = 16 << (3 * (field.depth() - 2));
        let rows = codebook.luma.len() + codebook.chroma.len();
        let most = table + 10 * field.leaves() + rows + (1 << 17);
        assert!(bytes <= most as u64, "{basis:?}: {bytes} of {most}");
    }
}

#[test]
fn posterization_and_recoloring_match_the_reference() {
    let field = ball(Basis::Sh9);
    let rendering = reference::render(&field, &pinhole());
    let mut shown: Vec<DVec3> = palette().colors.into_iter().map(DVec3::from).collect();
    // Tones of a ramp blend over more than those of two.
    let mut tones = palette();
    tones.method = Some(PaletteMethod::Tones);
    tones.gather_tones(&[0, 1], "first").unwrap();
    tones.gather_tones(&[2, 3, 4], "second").unwrap();
    let mut scene = scene(&field);
    for (posterize, recolored) in [
        (Posterize::paper(), false),
        (Posterize { softness: 0.0, blend_steps: 2, ..Posterize::paper() }, true),
        (Posterize { softness: 0.4, blend_steps: 1, min_opacity: 0.9, ..Posterize::paper() }, true),
        // It skips pixels.
        (Posterize { filter: Posterize::default().filter, ..Posterize::paper() }, true),
        (Posterize { softness: 0.6, borders: BorderSmoothing::Off, ..Posterize::soft() }, true),
    ] {
        let of_tones = posterize.method != Some(PaletteMethod::Hull);
        let palette = if of_tones { tones.clone() } else { palette() };
        scene.paint(FieldPalette::new(palette.clone()));
        let posterize = Posterize { edges: EdgeSmoothing::Off, ..posterize };
        if recolored {
            shown[0] = DVec3::new(0.2, 0.4, 1.0);
            scene.palette().set(0, Color::srgb(0.2, 0.4, 1.0));
        }
        scene.dress(posterize);
        let settings = reference::Posterization {
            space: palette.label_space(),
            // Tones do not blend with one another.
            blend_steps: if of_tones { 1 } else { posterize.blend_steps },
            softness: posterize.softness.into(),
            min_opacity: posterize.min_opacity.into(),
            iterations: posterize.filter.iterations,
            radius: posterize.filter.radius,
            taps: posterize.filter.taps,
            spatial_sigma: posterize.filter.spatial_sigma.into(),
            range_sigma: posterize.filter.range_sigma.into(),
        };
        let expected = reference::posterize(&rendering, DVec3::ONE, &palette, &shown, &settings);
        let frame = scene.capture();
        let pixels = frame.pixels().zip(&expected).zip(&rendering.opacity);
        // The background is easy.
        let object: Vec<_> = pixels.filter(|(_, opacity)| **opacity > 0.0).map(|(pixel, _)| pixel).collect();
        let more_than = |most| object.iter().filter(|(pixel, color)| is_off(pixel, **color, most)).count();
        let (size, slightly, clearly) = (object.len(), more_than(2.0), more_than(8.0));
        // Half floats move some pixels across the border between two labels, or across the least opacity.
        let what =
            format!("{posterize:?}: of {size} pixels, {slightly} are off by more than 2, {clearly} by more than 8");
        assert!(size > 2000 && slightly * 50 < size && clearly * 100 < size, "{what}");
    }
}

#[test]
fn shown_colors_are_drawn_exactly() {
    let color = DVec3::new(0.6, 0.3, 0.8);
    let mut scene = scene(&cube(SOLID, color));
    scene.dress(Posterize::default());
    scene.paint(FieldPalette::new(Palette::new(vec![color.to_array(), [0.0; 3]]).unwrap()));
    for step in (0..=51u8).step_by(3) {
        let set = Color::srgb_u8(5 * step, 255 - 5 * step, step.wrapping_mul(83));
        scene.palette().set(0, set);
        assert_near(middle(&scene.capture()), set, 1, "shown");
    }
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let field = ball(Basis::Sh4);
    let capture = || {
        let mut scene = scene(&field);
        scene.dress(Posterize::default());
        scene.capture()
    };
    assert_eq!(capture(), capture());
}

#[test]
fn a_viewport_shows_the_same_as_a_whole_target() {
    let mut scene = scene(&ball(Basis::Sh1));
    scene.dress(Posterize::default());
    let half = pinhole().resized(SIZE / 2, SIZE / 2);
    scene.headless.resize(UVec2::splat(SIZE / 2));
    let expected = scene.capture_from(&half, UpAxis::Z);
    scene.headless.resize(UVec2::splat(SIZE));
    scene.camera_mut().viewport = Some(Viewport {
        physical_position: UVec2::new(SIZE / 2, SIZE / 4),
        physical_size: UVec2::splat(SIZE / 2),
        ..default()
    });
    let frame = scene.capture();
    let part = image::imageops::crop_imm(&frame, SIZE / 2, SIZE / 4, SIZE / 2, SIZE / 2).to_image();
    assert_eq!(part, expected);
}

/// Coefficients are stored in rows of a texture, as long as the device allows. Fields look the same in short rows.
#[test]
fn a_field_in_many_rows_looks_the_same() {
    let field = ball(Basis::Sh9);
    let whole = scene(&field).capture();
    // Instead of 8192 texels.
    for row in [512, 256] {
        let limits = wgpu::Limits { max_texture_dimension_2d: row, ..wgpu::Limits::default() };
        let stage = Stage::limited(SIZE, limits, |_| ());
        assert!(in_stage(stage, &field).capture() == whole, "in rows of {row}");
    }
}

#[test]
fn a_field_that_does_not_fit_is_rejected_with_its_size() {
    let field = ball(Basis::Sh9);
    let bytes = 64 * field.leaves() as u64;
    let limits = wgpu::Limits { max_texture_dimension_2d: 64, ..wgpu::Limits::default() };
    let error = GpuField::check(&field, &limits).unwrap_err();
    assert_eq!((error.what, error.bytes, error.limit), ("coefficients", bytes, Some(64 * 64 * 16)));
    assert!(error.to_string().contains(&bytes.to_string()) && error.to_string().contains(&(64 * 64 * 16).to_string()));
    assert!(GpuField::check(&field, &wgpu::Limits::default()).is_ok());
}

/// A field with few leaves and many nodes does not fit because of the records of its nodes.
#[test]
fn a_field_with_too_many_records_is_rejected() {
    const LEVELS: u32 = 14;
    // In every cell of the first levels, a chain of nodes with a single leaf.
    let (mut nodes, mut leaves) = (vec![[Cell::EMPTY; 8]], 0);
    let mut below = vec![0];
    for level in 1..LEVELS {
        for node in std::mem::take(&mut below) {
            for cell in 0..if level < 4 { 8 } else { 1 } {
                nodes[node as usize][cell] = Cell::node(nodes.len() as u32);
                below.push(nodes.len() as u32);
                nodes.push([Cell::EMPTY; 8]);
            }
        }
    }
    for node in below {
        nodes[node as usize][5] = Cell::leaf(leaves);
        leaves += 1;
    }
    let (densities, colors) = (vec![1.0; leaves as usize], vec![half::f16::ONE; 3 * leaves as usize]);
    let field = field(Basis::Rgba, nodes, densities, colors);
    let limit = |side: u32| {
        let limits = wgpu::Limits { max_texture_dimension_2d: side, ..wgpu::Limits::default() };
        GpuField::check(&field, &limits).map_err(|error| (error.what, error.limit))
    };
    assert!(leaves <= 32 * 32);
    assert_eq!(limit(32), Err(("child records", Some(32 * 32 * 16))));
    assert_eq!(limit(256), Ok(()));
}
