//! What fields may hold.

use std::ops::ControlFlow;

use bevy_plenoctree::{
    PlenOctree,
    field::{Activation, Basis, Cell, Frame, InvalidField, UpAxis},
    reference,
};
use glam::DVec3;
use half::f16;

use crate::stage::{Stage, activated, chain, field, is_near, looking};

/// Fog that lets exp(-2 sigma) through from front to back, at every depth of the tree: in float64 the path is exact to
/// 1e-12, and pictures are right to the last of their 255 steps.
#[test]
fn fog_is_as_dense_at_every_depth() {
    let camera = looking(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    for depth in [1, 2, 3, 5, 8, 9, 12, 16] {
        for density in [0.1f32, 1.0] {
            let fog = chain(depth, 6, Some(density), density);
            for origin in [DVec3::new(0.5 - 1e-9, 0.5 - 1e-9, 6.0), DVec3::new(-0.3, 0.2, 6.0)] {
                let mut path = 0.0;
                reference::march(&fog, origin, DVec3::NEG_Z, |crossing| {
                    path += crossing.length;
                    ControlFlow::Continue(())
                });
                assert!((path - 2.0).abs() < 1e-12, "{path} at depth {depth}");
            }
            let mut stage = Stage::new(&fog);
            stage.check(&fog, &camera, &format!("depth {depth}"));
            let middle = *stage.picture(&camera).get_pixel(16, 16);
            let blue = 255.0 * (1.0 - (-2.0 * f64::from(density)).exp());
            assert!((f64::from(middle[2]) - blue).abs() <= 1.0, "{middle:?} at depth {depth}, expected {blue}");
        }
    }
}

/// `1 - exp(-x)` from where it is x to where it is 1; what a pixel shows of it, and that nothing else comes out.
#[test]
fn any_optical_depth_is_drawn() {
    let camera = looking(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    for exponent in -12..=4 {
        let depth = 10f64.powi(exponent);
        let fog = chain(1, 0, Some((0.5 * depth) as f32), (0.5 * depth) as f32);
        let middle = *Stage::new(&fog).picture(&camera).get_pixel(16, 16);
        let expected = if depth > 4.7 { 255.0 } else { -255.0 * (-depth).exp_m1() };
        assert!((f64::from(middle[2]) - expected).abs() <= 1.0, "{middle:?} at {depth}, expected {expected}");
    }
    // Half floats, which files hold, end before 1e5; leaves may be denser.
    let solid = chain(1, 0, Some(5e5), 5e5);
    let pixel = *Stage::new(&solid).picture(&camera).get_pixel(16, 16);
    assert!(is_near(pixel.0, [64, 128, 255, 255]), "{pixel:?}");
}

#[test]
fn thin_and_dense_leaves_are_neighbours() {
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    for (beside, last) in [(1e-8, 65504.0), (65504.0, 1e-8), (0.01, 65504.0)] {
        for depth in [1, 3, 7] {
            let both = chain(depth, 7, Some(beside), last);
            Stage::new(&both).check(&both, &camera, &format!("{beside} beside {last}, depth {depth}"));
        }
    }
}

#[test]
fn a_single_chain_of_sixteen_levels_is_one_small_leaf() {
    // Towards the corner at (1, 1, 1), in finest cells of 2^-15.
    let leaf = chain(16, 7, None, 65504.0);
    let side = 2f64.powi(-15);
    let middle = DVec3::splat(1.0 - 0.5 * side);
    let camera = looking(middle + DVec3::new(0.0, 0.0, 2.0 * side), middle);
    let mut stage = Stage::new(&leaf);
    stage.check(&leaf, &camera, "one leaf");
    assert!(stage.picture(&camera).get_pixel(16, 16)[2] > 200);
}

#[test]
fn one_leaf_and_none() {
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    let one = chain(1, 3, None, 5.0);
    Stage::new(&one).check(&one, &camera, "one leaf");
    let none = field(Basis::Sh9, vec![[Cell::EMPTY; 8]], vec![], vec![]);
    let black = Stage::new(&none).picture(&camera);
    assert!(black.pixels().all(|pixel| pixel.0 == [0, 0, 0, 255]));
}

/// Sums of harmonics at the ends of what half floats hold make colours, under every activation.
#[test]
fn the_largest_harmonics_are_colours() {
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    for value in [-65504.0, -1e4, 0.0, 1e4, 65504.0] {
        let node = std::array::from_fn(|cell| Cell::leaf(cell as u32));
        let coefficients = vec![f16::from_f32(value); 8 * Basis::Sh9.coefficients()];
        let sums = field(Basis::Sh9, vec![node], vec![3.0; 8], coefficients);
        for activation in [Activation::Sigmoid, Activation::ShiftedRelu, Activation::Identity] {
            let sums = activated(&sums, activation);
            let picture = Stage::new(&sums).picture(&camera);
            if activation == Activation::Sigmoid {
                Stage::new(&sums).check(&sums, &camera, &format!("{value}"));
            }
            assert!(picture.pixels().all(|pixel| pixel[3] == 255));
        }
    }
}

#[test]
fn what_is_not_finite_is_refused() {
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
