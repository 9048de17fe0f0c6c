//! Fields with extreme contents.

use std::ops::ControlFlow;

use bevy::color::Color;
use bevy_plenoctree::{Activation, PlenOctree, UpAxis};
use glam::DVec3;
use half::f16;
use plenoctree::{Basis, Cell, Frame, InvalidField, MAX_DEPTH, reference};

use super::stage::{Alone, chain, looking};
use crate::stage::{
    fields::{activated, colored, eight, field},
    pixels::assert_near,
};

/// Fog transmits exp(-2 sigma) from front to back, at every depth of the tree. In float64, the path is exact to 1e-12,
/// and pixels are exact to 1/255.
#[test]
fn fog_is_equally_dense_at_every_depth() {
    let camera = looking(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let mut stage = Alone::new(&chain(1, 0, None, 1.0));
    for depth in [1, 2, 3, 5, 8, 9, 12, 16] {
        for density in [0.1f32, 1.0] {
            let fog = chain(depth, 6, Some(density), density);
            for origin in [DVec3::new(0.5 - 1e-9, 0.5 - 1e-9, 6.0), DVec3::new(-0.3, 0.2, 6.0)] {
                let mut path = 0.0;
                fog.march(origin, DVec3::NEG_Z, |crossing| {
                    path += crossing.length;
                    ControlFlow::Continue(())
                });
                assert!((path - 2.0).abs() < 1e-12, "{path} at depth {depth}");
            }
            stage.check_field(&fog, &camera, &format!("depth {depth}"));
            let middle = stage.middle(&camera);
            let blue = 255.0 * (1.0 - (-2.0 * f64::from(density)).exp());
            assert!((f64::from(middle[2]) - blue).abs() <= 1.0, "{middle:?} at depth {depth}, expected {blue}");
        }
    }
}

/// Renders `1 - exp(-x)` from where it equals x to where it equals 1, and checks what pixels show of it.
#[test]
fn any_optical_depth_is_drawn() {
    let camera = looking(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let mut stage = Alone::new(&chain(1, 0, None, 1.0));
    for exponent in -12..=4 {
        let depth = 10f64.powi(exponent);
        let fog = chain(1, 0, Some((0.5 * depth) as f32), (0.5 * depth) as f32);
        let (color, opacity) = fog.render_ray(DVec3::new(0.1, 0.2, 6.0), DVec3::NEG_Z);
        let exact = if depth > 4.7 { 1.0 } else { -(-2.0 * f64::from(fog.densities()[0])).exp_m1() };
        assert!((opacity / exact - 1.0).abs() < 1e-12 && (color.z / exact - 1.0).abs() < 1e-12, "{opacity} at {depth}");
        stage.show(&fog);
        let middle = stage.middle(&camera);
        let expected = if depth > 4.7 { 255.0 } else { -255.0 * (-depth).exp_m1() };
        assert!((f64::from(middle[2]) - expected).abs() <= 1.0, "{middle:?} at {depth}, expected {expected}");
    }
    // Leaves can be denser than the largest half float that files can hold, which is less than 1e5.
    stage.show(&chain(1, 0, Some(5e5), 5e5));
    assert_near(stage.middle(&camera), Color::srgb(0.25, 0.5, 1.0), 1, "solid");
}

/// A radiance of 65504 shows what 262,144 thin leaves absorb, with 64 along a ray: one step of a byte is an opacity of
/// 6e-8. If `1 - exp(-x)` suffered from cancellation, a tenth of the light would be missing.
#[test]
fn thin_fog_absorbs_light_accurately() {
    const CELLS: i32 = 64;
    for depth in [1.2e-7, 3e-8] {
        let density = f64::from(CELLS) * depth / 2.0;
        let fog = colored(6, |_| density, |_| DVec3::ONE);
        assert_eq!(fog.leaves(), CELLS.pow(3) as usize);
        let radiance = vec![f16::MAX; 3 * fog.leaves()];
        let nodes = fog.nodes().to_vec();
        let glow = field(Basis::Rgba, nodes, fog.densities().to_vec(), radiance);
        let expected = 255.0 * f64::from(f16::MAX) * f64::from(CELLS) * depth;
        let camera = looking(DVec3::new(0.01, 0.01, 6.0), DVec3::new(0.01, 0.01, 0.0));
        let middle = Alone::new(&glow).middle(&camera);
        assert!((f64::from(middle[2]) - expected).abs() <= 2.0, "{middle:?} at {depth}, expected {expected}");
    }
}

/// The path of a ray through fog is exact to 1e-5. The light that the fog adds and the light that a wall behind it
/// takes away are 30,000 times as bright as the remaining difference, so an error of 1e-5 in the path is a fifth of a
/// byte's range.
#[test]
fn paths_through_fog_are_exact_on_the_gpu() {
    let (glow, wall) = (f16::from_f32(30_000.0), f16::from_f32(-30_016.0));
    // 1/2 = glow (1 - T) + wall T
    let (g, w) = (f64::from(glow), f64::from(wall));
    let density = -(((g - 0.5) / (g - w)).ln()) as f32;
    let left = g + (w - g) * (-f64::from(density)).exp();
    let mut stage = Alone::new(&chain(1, 0, None, 1.0));
    for depth in 1..=16 {
        // The root's cells with lower z are the wall. The other cells get smaller toward the middle of its top.
        let (mut nodes, mut densities, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        for level in 1..=depth {
            let finer = if level == 1 { 7 } else { 1 };
            nodes.push(std::array::from_fn(|cell| {
                if cell == finer && level < depth {
                    return Cell::node(level);
                }
                let is_wall = level == 1 && cell & 1 == 0;
                densities.push(if is_wall { 1e6 } else { density });
                colors.extend([if is_wall { wall } else { glow }; 3]);
                Cell::leaf(densities.len() as u32 - 1)
            }));
        }
        stage.show(&field(Basis::Rgba, nodes, densities, colors));
        for side in [0.3, 0.02, 1e-3, 2f64.powi(-17)] {
            let at = DVec3::new(side, side, 0.0);
            let middle = stage.middle(&looking(at + 6.0 * DVec3::Z, at));
            // A fifth of 255.
            assert!((f64::from(middle[0]) - 255.0 * left).abs() < 51.0, "{middle:?} at {side}, depth {depth}");
        }
    }
}

#[test]
fn thin_and_dense_leaves_can_be_neighbors() {
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    let mut stage = Alone::new(&chain(1, 0, None, 1.0));
    for (beside, last) in [(1e-8, 65504.0), (65504.0, 1e-8), (0.01, 65504.0)] {
        for depth in [1, 3, 7] {
            let both = chain(depth, 7, Some(beside), last);
            stage.check_field(&both, &camera, &format!("{beside} next to {last}, depth {depth}"));
        }
    }
}

#[test]
fn a_single_chain_of_sixteen_levels_is_one_small_leaf() {
    // Toward the corner at (1, 1, 1), in finest cells of 2^-15.
    let leaf = chain(16, 7, None, 65504.0);
    let side = 2f64.powi(-15);
    let middle = DVec3::splat(1.0 - 0.5 * side);
    let camera = looking(middle + DVec3::new(0.0, 0.0, 2.0 * side), middle);
    let mut stage = Alone::new(&leaf);
    stage.check(&leaf, &camera, "one leaf");
    assert!(stage.middle(&camera)[2] > 200);
}

#[test]
fn fields_of_one_leaf_and_of_none_are_drawn() {
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    let one = chain(1, 3, None, 5.0);
    let mut stage = Alone::new(&one);
    stage.check(&one, &camera, "one leaf");
    let none = field(Basis::Sh9, vec![[Cell::EMPTY; 8]], vec![], vec![]);
    stage.show(&none);
    let black = stage.see(&camera);
    assert!(black.pixels().all(|pixel| pixel.0 == [0, 0, 0, 255]));
}

/// Sums of harmonics at the limits of half floats become colors, with every activation.
#[test]
fn the_largest_harmonics_become_colors() {
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    let mut stage = Alone::new(&chain(1, 0, None, 1.0));
    for value in [-65504.0, -1e4, 0.0, 1e4, 65504.0] {
        let sums = eight(Basis::Sh9, 3.0, &vec![f16::from_f32(value); Basis::Sh9.coefficients()]);
        for activation in [Activation::Sigmoid, Activation::ShiftedRelu, Activation::Identity] {
            let sums = activated(&sums, activation);
            let expected = reference::render(&sums, &camera);
            let covered = expected.opacity.iter().filter(|opacity| **opacity > 0.5).count();
            assert!(covered > 100, "{covered} pixels");
            stage.check_field(&sums, &camera, &format!("{value}, {activation:?}"));
        }
    }
}

/// Finest cells are counted in 32-bit integers and in floats, which limits the depth.
#[test]
fn trees_with_too_many_levels_are_rejected() {
    for (levels, fits) in [(MAX_DEPTH, true), (MAX_DEPTH + 1, false)] {
        let node = |level| {
            let below = if level == levels { Cell::leaf(0) } else { Cell::node(level) };
            std::array::from_fn(|cell| if cell == 7 { below } else { Cell::EMPTY })
        };
        let (frame, nodes) = (Frame::spanning(DVec3::NEG_ONE, DVec3::ONE), (1..=levels).map(node).collect());
        let coefficients = vec![f16::ONE; 3];
        let made = PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, nodes, vec![1.0], coefficients);
        assert!(if fits { made.is_ok() } else { matches!(made, Err(InvalidField::TooDeep)) });
    }
}

#[test]
fn invalid_numbers_are_rejected() {
    let frame = Frame::spanning(DVec3::NEG_ONE, DVec3::ONE);
    let node = |_| vec![std::array::from_fn(|cell| if cell == 0 { Cell::leaf(0) } else { Cell::EMPTY })];
    let make = |density: f32, k: f16| {
        PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, node(()), vec![density], vec![k; 3])
    };
    for density in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0] {
        assert!(matches!(make(density, f16::ONE), Err(InvalidField::Number { .. })), "density {density}");
    }
    for k in [f16::NAN, f16::INFINITY, f16::NEG_INFINITY] {
        assert!(matches!(make(1.0, k), Err(InvalidField::Number { .. })), "coefficient {k}");
    }
}
