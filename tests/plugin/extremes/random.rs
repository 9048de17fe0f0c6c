//! Random trees, densities, colors and cameras.

use std::cell::RefCell;

use bevy_plenoctree::PlenOctree;
use glam::DVec3;
use half::f16;
use plenoctree::{Basis, Cell};
use proptest::prelude::*;

use super::stage::{Alone, looking};
use crate::stage::fields::field;

/// The content of a cell in a random tree: a node, a leaf of some density and color, or nothing.
#[derive(Clone, Debug)]
struct Choice {
    kind: u8,
    density: f32,
    color: [f32; 3],
}

fn choices() -> impl Strategy<Value = Vec<Choice>> {
    let choice = (0u8..10, -3.0..4.0f32, prop::array::uniform3(-0.2..1.2f32));
    prop::collection::vec(
        choice.prop_map(|(kind, exponent, color)| Choice { kind, density: 10f32.powf(exponent), color }),
        8..400,
    )
}

/// Fills cells with choices, level by level, until none are left.
fn tree(choices: &[Choice], depth: usize) -> PlenOctree {
    let (mut nodes, mut levels) = (vec![[Cell::EMPTY; 8]], vec![1]);
    let (mut density, mut coefficients) = (Vec::new(), Vec::new());
    for (place, choice) in choices.iter().enumerate() {
        let (node, cell) = (place / 8, place % 8);
        if node >= nodes.len() {
            break;
        }
        if choice.kind < 4 && levels[node] < depth {
            nodes[node][cell] = Cell::node(nodes.len() as u32);
            levels.push(levels[node] + 1);
            nodes.push([Cell::EMPTY; 8]);
        } else if choice.kind < 8 {
            nodes[node][cell] = Cell::leaf(density.len() as u32);
            density.push(choice.density);
            coefficients.extend(choice.color.map(f16::from_f32));
        }
    }
    field(Basis::Rgba, nodes, density, coefficients)
}

thread_local! {
    /// One app for all cases.
    static SHOWN: RefCell<Option<Alone>> = const { RefCell::new(None) };
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, max_shrink_iters: 60, ..Default::default() })]

    #[test]
    fn random_trees_match_the_reference(
        choices in choices(),
        depth in 1usize..=12,
        eye in prop::array::uniform3(-3.0..3.0f64),
        target in prop::array::uniform3(-0.5..0.5f64),
    ) {
        let (eye, target) = (DVec3::from(eye), DVec3::from(target));
        prop_assume!((eye - target).length() > 0.1);
        let tree = tree(&choices, depth);
        SHOWN.with_borrow_mut(|shown| {
            let stage = shown.get_or_insert_with(|| Alone::new(&tree));
            stage.check_field(&tree, &looking(eye, target), "a random tree");
        });
    }
}
