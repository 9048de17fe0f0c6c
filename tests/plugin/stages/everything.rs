//! Tests [`PosterizeView`], which posterizes everything in view with one palette.

use bevy::{
    camera::{Exposure, Hdr, Viewport},
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    diagnostic::{DiagnosticPath, DiagnosticsStore},
    prelude::*,
    render::diagnostic::RenderDiagnosticsPlugin,
};
use bevy_plenoctree::{
    BilateralFilter, EdgeSmoothing, FieldPalette, POSTERIZE_SPANS, PaletteOverride, Palettes, Posterize, PosterizeView,
    PropPlacement, VOLUME_SPANS,
};
use image::RgbaImage;

use super::scene::{
    COLOR, PALETTE, SHOWN, SIZE, SOLID, Stage, assert_near, at, cube, is_near, middle, over, scene, scene_with,
    scene_with_meshes, spawn_square,
};
use crate::stage::unlit;

fn hard() -> Posterize {
    let filter = BilateralFilter { iterations: 2, taps: 6, ..default() };
    let edges = EdgeSmoothing::Off;
    Posterize { blend_steps: 1, softness: 0.0, min_opacity: 0.3, filter, edges, ..Posterize::paper() }
}

/// Nearest to the second color of the palette.
const SKY: Color = Color::srgb(0.2, 0.2, 0.15);
/// Nearest to the third color of the palette.
const STRAW: Color = Color::srgb(0.8, 0.8, 0.4);

/// Returns a scene with a straw-colored square in the left half, and no prop.
fn without_a_prop() -> Stage {
    let mut scene = scene_with_meshes(SOLID);
    let (prop, field) = (scene.prop(), scene.field());
    scene.world().despawn(prop);
    scene.set_background(SKY);
    scene.set((PosterizeView(field), hard()));
    spawn_square(&mut scene, Vec3::new(-0.6, 0.0, 0.0), 0.8, unlit(STRAW));
    scene
}

/// A pixel of the square.
const MESH: (u32, u32) = (SIZE / 4, SIZE / 2);
/// A pixel of the sky.
const EMPTY: (u32, u32) = (SIZE * 3 / 4, SIZE / 2);

/// Counts the pixels that show no palette color.
fn unlabeled(frame: &RgbaImage) -> usize {
    let pixels = frame.pixels().map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    pixels.filter(|pixel| !SHOWN.iter().any(|color| is_near(*pixel, *color, 1))).count()
}

#[test]
fn meshes_and_sky_show_only_labels() {
    let mut scene = without_a_prop();
    for (msaa, placement) in [Msaa::Off, Msaa::Sample4]
        .into_iter()
        .flat_map(|msaa| [PropPlacement::Scene, PropPlacement::Display].map(|placement| (msaa, placement)))
    {
        scene.set((msaa, placement));
        for hdr in [false, true] {
            scene.set_if(hdr, Hdr);
            let (frame, what) = (scene.capture(), format!("{msaa:?}, {placement:?}, hdr {hdr}"));
            assert_eq!(unlabeled(&frame), 0, "{what}");
            assert_near(at(&frame, MESH.0, MESH.1), SHOWN[2], 1, &what);
            assert_near(at(&frame, EMPTY.0, EMPTY.1), SHOWN[1], 1, &what);
        }
    }
    // At the display, the scene is posterized after tonemapping.
    scene.set((Hdr, Tonemapping::TonyMcMapface, DebandDither::Enabled, Exposure::OVERCAST));
    assert_eq!(unlabeled(&scene.capture()), 0);
    scene.set(PropPlacement::Scene);
    assert_ne!(unlabeled(&scene.capture()), 0);
}

#[test]
fn transparent_meshes_are_posterized_only_at_the_display() {
    let mut scene = without_a_prop();
    let red = Color::srgba(1.0, 0.0, 0.0, 0.5);
    spawn_square(&mut scene, Vec3::new(0.6, 0.0, 0.0), 0.8, unlit(red));
    let label = SHOWN[1].to_linear();
    let tinted = Color::from(label * 0.5 + red.to_linear().with_alpha(1.0) * 0.5);
    assert_near(at(&scene.capture(), EMPTY.0, EMPTY.1), tinted, 2, "in the scene");
    scene.set(PropPlacement::Display);
    assert_eq!(unlabeled(&scene.capture()), 0);
}

/// Posterized props keep their own palette, and everything else gets the view's.
#[test]
fn props_are_posterized_once() {
    let mut scene = scene_with_meshes(SOLID);
    let other = scene.add(cube(1.0));
    let [pink, teal] = [Color::srgb(0.9, 0.5, 0.6), Color::srgb(0.1, 0.5, 0.5)];
    // With a single color, everything shows that color.
    let single = FieldPalette::from_colors([pink]).unwrap();
    scene.world().resource_mut::<Palettes>().insert(&other, single);
    scene.set((PosterizeView(other.clone()), hard()));
    assert!(scene.capture().pixels().all(|pixel| is_near([pixel[0], pixel[1], pixel[2]], pink, 1)));

    scene.dress(hard());
    let frame = scene.capture();
    assert_near(middle(&frame), SHOWN[0], 1, "the prop");
    assert_near(at(&frame, 1, 1), pink, 1, "next to the prop");

    // Recolor the palette, then override it for the view.
    scene.world().resource_mut::<Palettes>().get_mut(&other).unwrap().set(0, teal);
    assert_near(at(&scene.capture(), 1, 1), teal, 1, "recolored");

    // A red mesh in front of the prop shows no red, not even where its edge crosses a pixel.
    let mesh = spawn_square(&mut scene, Vec3::new(0.21, 0.13, 1.0), 0.4, unlit(Color::srgb(1.0, 0.0, 0.0)));
    scene.dress(Posterize { edges: EdgeSmoothing::Coverage, ..hard() });
    for msaa in [Msaa::Sample4, Msaa::Off] {
        scene.set(msaa);
        let red = scene.capture().pixels().map(|pixel| pixel[0]).max();
        assert!(red < Some(40), "{msaa:?}: {red:?}");
    }
    scene.world().despawn(mesh);
    scene.dress(hard());

    scene.set(PaletteOverride::default().with(0, COLOR));
    assert_near(at(&scene.capture(), 1, 1), COLOR, 1, "overridden");
    assert_near(middle(&scene.capture()), SHOWN[0], 1, "the prop, with an override on the view");

    // The view posterizes pixels that are too thin for the prop to posterize.
    scene.dress(Posterize { min_opacity: 2.0, ..hard() });
    assert_near(middle(&scene.capture()), COLOR, 1, "a thin prop");
}

#[test]
fn removing_posterize_restores_the_view() {
    let mut scene = scene(1.0);
    let field = scene.field();
    scene.set_background(SKY);
    let before = scene.capture();
    assert_near(middle(&before), over(1.0 - (-1f32).exp(), COLOR, SKY, 1.0), 2, "the fog");
    scene.set(PosterizeView(field));
    assert!(scene.capture() != before);
    scene.unset::<Posterize>();
    assert!(scene.capture() == before);
}

/// A view draws on without props. What was behind one that is gone is seen again.
#[test]
fn a_prop_that_is_hidden_hides_nothing() {
    let mut scene = scene_with_meshes(SOLID);
    let field = scene.field();
    scene.set_background(SKY);
    scene.set((PosterizeView(field), hard()));
    scene.dress(Visibility::Hidden);
    // Bevy draws transparent meshes after props.
    spawn_square(&mut scene, Vec3::new(0.0, 0.0, -2.0), 3.0, unlit(STRAW.with_alpha(0.9)));
    let without = scene.capture();
    scene.dress(Visibility::Visible);
    let with = scene.capture();
    assert!(middle(&with) != middle(&without));
    scene.dress(Visibility::Hidden);
    assert!(scene.capture() == without);
}

#[test]
fn only_the_viewport_is_posterized() {
    let mut scene = without_a_prop();
    let (physical_position, physical_size) = (UVec2::new(5, 11), UVec2::new(30, 20));
    scene.camera_mut().viewport = Some(Viewport { physical_position, physical_size, ..default() });
    for placement in [PropPlacement::Scene, PropPlacement::Display] {
        scene.set(placement);
        let frame = scene.capture();
        let view = image::imageops::crop_imm(&frame, 5, 11, 30, 20).to_image();
        assert_eq!(unlabeled(&view), 0, "{placement:?}");
        let outside = unlabeled(&frame);
        assert_eq!(outside as u32, SIZE * SIZE - 30 * 20, "{placement:?}");
    }
}

/// Exposure, softness and blend steps affect a view's labels like a prop's.
#[test]
fn labels_of_a_view_follow_the_exposure_and_blend() {
    let mut scene = without_a_prop();
    let ev100 = Exposure::default().ev100;
    // At half the exposure, a color half as bright as straw gets the label of straw, which is drawn half as bright.
    scene.set(Exposure { ev100: ev100 + 1.0 });
    scene.set_background((STRAW.to_linear() * 0.5).into());
    let half = (SHOWN[2].to_linear() * 0.5).into();
    assert_near(at(&scene.capture(), EMPTY.0, EMPTY.1), half, 1, "at half the exposure");
    scene.unset::<Exposure>();
    let filter = BilateralFilter { iterations: 0, ..default() };
    // Two thirds of the way from one color to the other.
    let two_thirds = |a: Color, b: Color| {
        let mixed = Srgba::from(a).to_vec3().lerp(Srgba::from(b).to_vec3(), 2.0 / 3.0);
        Color::srgb(mixed.x, mixed.y, mixed.z)
    };
    scene.set_background(two_thirds(PALETTE[1], PALETTE[2]));
    scene.set(Posterize { blend_steps: 3, softness: 0.0, min_opacity: 0.0, filter, ..hard() });
    assert_near(at(&scene.capture(), EMPTY.0, EMPTY.1), two_thirds(SHOWN[1], SHOWN[2]), 1, "a blend");
}

/// The passes run if there is something to draw, and only then.
#[test]
fn passes_run_only_if_there_is_something_to_draw() {
    let mut scene = scene_with(SOLID, |app| {
        app.add_plugins(RenderDiagnosticsPlugin);
    });
    let (prop, field) = (scene.prop(), scene.field());
    // Returns when each pass was last measured. Measurements arrive a few frames later.
    let mut last_run = |change: &mut dyn FnMut(&mut Stage)| {
        change(&mut scene);
        scene.update(8);
        let diagnostics = scene.world().resource::<DiagnosticsStore>();
        [VOLUME_SPANS, POSTERIZE_SPANS].map(|spans| {
            let path = DiagnosticPath::new(format!("render/{}/elapsed_cpu", spans[0]));
            diagnostics.get(&path).unwrap().measurement().unwrap().time
        })
    };
    let with_a_prop = last_run(&mut |_| {});
    let without = last_run(&mut |scene| {
        scene.world().despawn(prop);
    });
    assert_eq!(last_run(&mut |_| {}), without);
    let posterized = last_run(&mut |scene| {
        scene.set(PosterizeView(field.clone()));
    });
    assert!((0..2).all(|pass| with_a_prop[pass] <= without[pass] && without[pass] < posterized[pass]));
}

#[test]
fn a_view_without_a_palette_gets_one() {
    let mut scene = without_a_prop();
    let fog = scene.add(cube(1.0));
    scene.set(PosterizeView(fog.clone()));
    scene.wait();
    let palette = scene.world().resource::<Palettes>().get(&fog).unwrap();
    assert!(palette.extraction().is_some());
    let only = palette.shown()[0];
    assert_eq!(palette.shown().len(), 1);
    assert_near(middle(&scene.capture()), only, 1, "a view in the field's only color");
}
