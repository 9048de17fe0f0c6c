//! Tests custom render stages between the labels and the screen.

use bevy::{camera::Viewport, prelude::*, shader::Shader};
use bevy_plenoctree::{
    BilateralFilter, EdgeSmoothing, LabelStages, Palette, PaletteLabel, Posterize, PosterizeView, Prop, PropPlacement,
    PropState,
};

use super::scene::{COLOR, PALETTE, SIZE, SOLID, Stage, assert_near, at, differing, middle, scene};
use crate::stage::wait_for;

/// Draws the label of a pixel in red and its owner in green, in sixteenths.
const MARK: &str = "
@group(1) @binding(0) var colors: texture_2d<f32>;
@group(1) @binding(1) var labels: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let label = textureLoad(labels, vec2<u32>(position.xy), 0).rg;
    let color = textureLoad(colors, vec2<u32>(position.xy), 0);
    return vec4(vec2<f32>(label) / 16.0, 0.0, color.a);
}
";

/// Swaps red and blue.
const SWAP: &str = "
@group(1) @binding(0) var colors: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(colors, vec2<u32>(position.xy), 0).bgra;
}
";

/// Halves all channels.
const HALVE: &str = "
@group(1) @binding(0) var colors: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let color = textureLoad(colors, vec2<u32>(position.xy), 0);
    return vec4(0.5 * color.rgb, color.a);
}
";

/// Adds shaders to an app, and returns them as stages.
fn stages<const N: usize>(scene: &mut Stage, sources: [&str; N]) -> LabelStages {
    LabelStages(sources.map(|source| scene.add(Shader::from_wgsl(source.to_string(), "stage.wgsl"))).to_vec())
}

fn hard() -> Posterize {
    let filter = BilateralFilter { iterations: 1, taps: 6, ..default() };
    let edges = EdgeSmoothing::Off;
    Posterize { blend_steps: 2, softness: 0.0, min_opacity: 0.3, filter, edges, ..Posterize::paper() }
}

fn posterized() -> Stage {
    let mut scene = scene(SOLID);
    scene.dress(hard());
    scene
}

/// Returns the color in which the stage draws a label and its owner.
fn marked(label: u32, owner: u32) -> Color {
    Color::srgb(label as f32 / 16.0, owner as f32 / 16.0, 0.0)
}

#[test]
fn a_stage_reads_labels_and_owners_and_writes_the_screen() {
    let mut scene = posterized();
    let without = scene.capture();
    let encoded = |color: Color| Srgba::from(color).to_f32_array_no_alpha().map(f64::from);
    let palette = Palette::new(PALETTE.map(encoded).to_vec()).unwrap();
    let label = PaletteLabel::nearest(encoded(COLOR).into(), &palette, hard().blend_steps).unwrap();
    for msaa in [Msaa::Off, Msaa::Sample4] {
        for place in [PropPlacement::Scene, PropPlacement::Display] {
            let mark = stages(&mut scene, [MARK]);
            scene.set((msaa, place, mark));
            let frame = scene.capture();
            assert_near(middle(&frame), marked(2 + label.index as u32, 1), 1, &format!("{msaa:?}, {place:?}"));
            assert_eq!(at(&frame, 1, 1), at(&without, 1, 1), "next to the prop");
        }
    }
    scene.unset::<LabelStages>();
    scene.set((Msaa::Off, PropPlacement::Scene));
    assert!(scene.capture() == without, "without the stage again");
}

/// Props are drawn, and ready, without stages whose shaders are missing or wrong.
#[test]
fn props_do_not_wait_for_broken_stages() {
    let mut scene = posterized();
    scene.wait();
    let broken = [
        "@fragment fn fragment() { wrong }",
        "#import nothing::such\n@fragment fn fragment() -> @location(0) vec4<f32> { return such(); }",
    ];
    let mut broken = broken.map(|shader| stages(&mut scene, [shader])).to_vec();
    broken.push(LabelStages(vec![Handle::default()]));
    let missing = ["there is no such stage.wgsl", "nor this one.wgsl"];
    let missing = missing.map(|path| LabelStages(vec![scene.world().resource::<AssetServer>().load(path)]));
    for stages in missing.into_iter().chain(broken) {
        scene.set(stages);
        let field = scene.field();
        let later = scene.world().spawn((Prop(field), Visibility::Hidden)).id();
        wait_for("a prop that is ready", || {
            scene.update(1);
            scene.get::<PropState>(later) == &PropState::Ready
        });
        scene.update(20);
        let prop = scene.prop();
        assert_eq!(scene.get::<PropState>(prop), &PropState::Ready);
    }
}

#[test]
fn props_as_trained_and_posterized_views_have_different_labels() {
    let mut scene = scene(SOLID);
    let mark = stages(&mut scene, [MARK]);
    scene.set((Msaa::Off, mark));
    assert_near(middle(&scene.capture()), marked(1, 0), 1, "as trained");
    let field = scene.field();
    scene.set((PosterizeView(field), hard()));
    let [red, green, _] = middle(&scene.capture());
    assert!(red >= 2 * 16 - 1 && green == 0, "{red} {green}");
}

/// Stages run in order, each on the result of the one before it, in viewports of any size, and on smooth edges too. Two
/// that undo each other change nothing.
#[test]
fn stages_run_in_order() {
    let mut scene = posterized();
    let corner =
        Viewport { physical_position: UVec2::new(7, 3), physical_size: UVec2::new(SIZE - 11, SIZE - 9), ..default() };
    for (viewport, edges) in [(None, EdgeSmoothing::Coverage), (Some(corner), EdgeSmoothing::Off)] {
        scene.camera_mut().viewport = viewport;
        scene.dress(Posterize { edges, ..hard() });
        for msaa in [Msaa::Off, Msaa::Sample4] {
            scene.set(msaa);
            let [once, twice] = [stages(&mut scene, [SWAP]), stages(&mut scene, [SWAP, SWAP])];
            scene.unset::<LabelStages>();
            let direct = scene.capture();
            scene.set(once);
            let swapped = scene.capture();
            let [r, g, b] = middle(&direct);
            assert_eq!(middle(&swapped), [b, g, r], "{msaa:?}");
            scene.set(twice);
            let staged = scene.capture();
            assert_ne!(middle(&direct), at(&direct, 0, 0), "the prop is visible");
            // Stages decide for whole pixels, so that a mesh in front of a prop hides none of their samples.
            assert_eq!(differing(&direct, &staged, 1), 0, "{msaa:?}");
        }
    }
}

/// A view at rest keeps what it shows without stages, so stages never run on their own results.
#[test]
fn stages_change_what_is_shown_once() {
    let mut scene = posterized();
    let [r, g, b] = middle(&scene.capture()).map(f64::from);
    let both = stages(&mut scene, [HALVE, SWAP]);
    scene.set(both);
    for frame in 0..5 {
        let found = middle(&scene.capture()).map(f64::from);
        let off = [0.5 * b - found[0], 0.5 * g - found[1], 0.5 * r - found[2]];
        assert!(off.iter().all(|off| off.abs() <= 1.0), "frame {frame}: {found:?} of {:?}", [r, g, b]);
    }
}
