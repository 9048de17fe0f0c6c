//! Refining fields.

use glam::{DVec3, Vec4};
use half::f16;
use plenoctree::{
    Activation, BakeSettings, Basis, Cell, Frame, PlenOctree, UpAxis, bake, camera::PinholeCamera, reference::render,
};
use plenoctree_fit::{FitProgress, RefineSettings, Refined, Shot, refine};

use super::scene::cameras;

/// A ball that is as bright as `light` says.
fn ball(light: impl Fn(DVec3) -> DVec3 + Sync) -> PlenOctree {
    let settings = BakeSettings { depth: 6, basis: Basis::Sh1, ..BakeSettings::default() };
    bake(
        &settings,
        |at| if at.length() < 0.6 { 60.0 } else { 0.0 },
        |at| {
            let color = light(at);
            move |_| color
        },
    )
    .unwrap()
}

/// Returns pictures of a field.
fn shots(shown: &PlenOctree, cameras: &[PinholeCamera]) -> Vec<Shot> {
    let shot = |camera: &PinholeCamera| {
        let rendering = render(shown, camera);
        let pixels = rendering.color.iter().zip(&rendering.opacity);
        Shot::new(camera, &pixels.map(|(color, opacity)| color.extend(*opacity).as_vec4()).collect::<Vec<Vec4>>())
    };
    cameras.iter().map(shot).collect()
}

/// Refines a field with pictures of another one, and measures it with pictures of a third one.
fn refined_by(field: &PlenOctree, shown: &PlenOctree, measured: &PlenOctree, effort: f64) -> Refined {
    let (training, others) = (cameras(24), cameras(30).split_off(24));
    let settings = RefineSettings { effort, ..RefineSettings::default() };
    let [shown, measured] = [(shown, training), (measured, others)].map(|(field, cameras)| shots(field, &cameras));
    refine(field, &shown, &measured, &settings, &FitProgress::default()).unwrap()
}

/// Refines a field with pictures of another one.
fn refined(field: &PlenOctree, shown: &PlenOctree, effort: f64) -> Refined {
    refined_by(field, shown, shown, effort)
}

/// Refining ends after a round if the field is right, and does not make it worse.
#[test]
fn refining_ends_when_it_does_not_pay() {
    let field = ball(|at| 0.5 + 0.4 * at);
    let Refined { field: same, rounds, .. } = refined(&field, &field, 0.05);
    assert_eq!(rounds.len(), 1, "{rounds:?}");
    assert!(rounds[0].gain_db.unwrap() < 0.02, "{rounds:?}");
    let (origin, direction) = (DVec3::new(0.0, 4.0, 0.1), DVec3::NEG_Y);
    let [(before, _), (after, _)] = [&field, &same].map(|field| field.render_ray(origin, direction));
    assert!((before - after).abs().max_element() < 0.01, "{before} {after}");
}

/// It goes on while a field of the wrong colors becomes better, and reports what each round gained.
#[test]
fn refining_goes_on_while_it_pays() {
    let (gray, colored) = (ball(|_| DVec3::splat(0.5)), ball(|at| 0.5 + 0.4 * at));
    let Refined { rounds, kept, .. } = refined(&gray, &colored, 0.01);
    let gains: Vec<f64> = rounds.iter().map(|round| round.gain_db.unwrap()).collect();
    assert!(gains.len() >= 3, "{gains:?}");
    assert!(gains[..gains.len() - 1].iter().all(|gain| *gain > 0.02), "{gains:?}");
    for pair in rounds.windows(2) {
        let gain = pair[1].stage.psnr_db.unwrap() - pair[0].stage.psnr_db.unwrap();
        assert!((gain - pair[1].gain_db.unwrap()).abs() < 1e-9, "{rounds:?}");
    }
    assert!(gains.iter().sum::<f64>() > 3.0, "{gains:?}");
    // A last round that loses something is undone.
    assert_eq!(kept, gains.iter().take_while(|gain| **gain > 0.0).count(), "{gains:?}");
}

/// What makes the field worse is undone: here, a gray ball becomes brighter, while it is measured by a dark one.
#[test]
fn what_loses_is_undone() {
    let [dark, gray, bright] = [0.05, 0.5, 0.55].map(|light| ball(move |_| DVec3::splat(light)));
    let Refined { field: same, rounds, kept, .. } = refined_by(&gray, &bright, &dark, 0.02);
    assert!(rounds[0].gain_db.unwrap() < 0.0, "{rounds:?}");
    assert_eq!(kept, 0, "{rounds:?}");
    assert!(same.nodes() == gray.nodes() && same.densities() == gray.densities());
    assert!(same.coefficients() == gray.coefficients());
}

/// The same shots give the same field on any number of threads, with fewer leaves where they agree or are hidden.
#[test]
fn refined_fields_do_not_depend_on_threads() {
    let (gray, colored) = (ball(|_| DVec3::splat(0.5)), ball(|at| 0.5 + 0.4 * at));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| refined(&gray, &colored, 0.002))
    };
    let [one, three] = [1, 3].map(with);
    assert!(one.kept > 0 && one.field.leaves() < gray.leaves(), "{}", one.field.leaves());
    assert_eq!(one.field.nodes(), three.field.nodes());
    assert_eq!(one.field.densities(), three.field.densities());
    assert_eq!(one.field.coefficients(), three.field.coefficients());
}

/// A cube that is a single leaf, half as wide as all, and a finest leaf away from it.
fn large_leaf(depth: usize, light: f32) -> PlenOctree {
    let mut nodes = vec![[Cell::EMPTY; 8]; depth];
    (1..depth).for_each(|level| nodes[level - 1][0] = Cell::node(level as u32));
    nodes[depth - 1][0] = Cell::leaf(0);
    nodes[0][7] = Cell::leaf(1);
    let frame = Frame::spanning(DVec3::splat(-1.0), DVec3::splat(1.0));
    let coefficients = vec![f16::from_f32(light); 6];
    PlenOctree::new(frame, Basis::Sh1, Activation::Sigmoid, UpAxis::Z, nodes, vec![9.0; 2], coefficients).unwrap()
}

/// A refined field stands as the original does.
#[test]
fn refined_fields_keep_their_up_axis() {
    let field = large_leaf(6, 0.0).with_up(UpAxis::Y);
    let Refined { field: brighter, kept, .. } = refined(&field, &large_leaf(6, 2.0), 0.001);
    assert!(kept > 0);
    assert_eq!(brighter.up(), UpAxis::Y);
}

/// Large leaves are refined, too, and do not become many.
#[test]
fn large_leaves_are_refined() {
    for (depth, size) in [(6, 32), (3, 4)] {
        let Refined { field, rounds, .. } = refined(&large_leaf(depth, -2.0), &large_leaf(depth, 0.0), 0.05);
        assert!(rounds[0].gain_db.unwrap() > 3.0, "{rounds:?}");
        assert!(field.leaf_cells().map(|cell| cell.size).eq([1, size]), "{} leaves", field.leaves());
    }
}
