//! Tests that views keep what they drew, that every change is visible immediately, and that frames are the same as if
//! everything were redrawn.

use bevy::{
    camera::{Exposure, Hdr, ScalingMode, Viewport},
    core_pipeline::prepass::MotionVectorPrepass,
    light::DirectionalLightShadowMap,
    prelude::*,
    render::{camera::TemporalJitter, error_handler::RenderErrorHandler},
};
use bevy_plenoctree::{
    BilateralFilter, BorderSmoothing, EdgeSmoothing, FieldPalette, Ink, InkBorders, InkColor, LabelStages, Palette,
    PaletteMethod, PaletteOverride, Palettes, PlenOctree, Posterize, PosterizeView, Prop, PropLighting, PropPlacement,
    PropQuality, PropTint, Ramp, Recolor, SolidOpacity,
};
use glam::DVec3;
use image::RgbaImage;

use crate::stage::{Stage, fields::colored, pixels::assert_same, unlit};

const SIZE: u32 = 64;
/// The palette of all fields, in encoded sRGB.
const COLORS: [[f64; 3]; 3] = [[0.8, 0.2, 0.1], [0.1, 0.3, 0.8], [0.9, 0.9, 0.2]];

/// Bakes a cube from -1/2 to 1/2 whose color differs from place to place.
fn field(hue: f64) -> PlenOctree {
    let inside = |at: DVec3| if at.abs().max_element() < 0.5 { 2.0 } else { 0.0 };
    colored(4, inside, |at| 0.5 + 0.5 * (9.0 * at + hue).map(f64::sin))
}

/// A view of two props that overlap, one of them posterized or none, with a mesh between them, one behind them, and a
/// pane of glass.
#[derive(Deref, DerefMut)]
struct View {
    #[deref]
    stage: Stage,
    meshes: [Entity; 2],
    fields: [Handle<PlenOctree>; 2],
    posterizes: bool,
}

impl View {
    fn new(posterizes: bool) -> Self {
        let mut stage = Stage::with_meshes(SIZE);
        // Otherwise, Bevy would stop rendering, and frames would remain the same.
        stage.world().insert_resource(RenderErrorHandler(|error, _, _| panic!("{}", error.description)));
        let fields = [(0.0, Vec3::ZERO), (1.5, Vec3::new(0.4, 0.3, -0.8))].map(|(hue, place)| {
            let prop = stage.spawn_prop(&field(hue), Transform::from_translation(place));
            let field = stage.get::<Prop>(prop).0.clone();
            let mut palette = Palette::new(COLORS.to_vec()).unwrap();
            let ramps = ["red", "blue", "yellow"].into_iter().enumerate();
            palette.ramps = ramps.map(|(tone, name)| Ramp { name: name.into(), tones: vec![tone] }).collect();
            let palette = FieldPalette::new(palette);
            stage.world().resource_mut::<Palettes>().insert(&field, palette);
            field
        });
        if posterizes {
            stage.dress(Posterize::default());
        }
        let meshes = [Vec3::new(-0.2, -0.4, 0.1), Vec3::new(-0.8, 0.3, -1.2)].map(|place| {
            let material = unlit(Color::srgb(0.3, 0.7, 0.4));
            stage.spawn_mesh(Cuboid::from_length(0.5), material, Transform::from_translation(place))
        });
        // A pane of glass shows where props are solid.
        let slanted = Transform::from_xyz(0.3, 0.2, 0.4).with_rotation(Quat::from_rotation_y(1.0));
        stage.spawn_mesh(Rectangle::new(1.4, 0.6), unlit(Color::srgba(0.2, 0.1, 0.9, 0.5)), slanted);
        stage.set_background(Color::srgb(0.4, 0.6, 0.5));
        stage.set((PropQuality::EXACT, Transform::from_xyz(0.3, 0.2, 2.2).looking_at(Vec3::ZERO, Vec3::Y)));
        Self { stage, meshes, fields, posterizes }
    }

    fn show_as_trained(&mut self) {
        for prop in self.props.clone() {
            self.world().entity_mut(prop).remove::<Posterize>();
        }
    }

    /// Captures a frame in which nothing is kept: a camera that is not active drops what it has drawn.
    fn capture_anew(&mut self) -> RgbaImage {
        self.camera_mut().is_active = false;
        self.update(1);
        self.camera_mut().is_active = true;
        self.capture()
    }

    fn set_prop(&mut self, prop: usize, components: impl Bundle) {
        let prop = self.props[prop];
        self.insert(prop, components);
    }

    fn find_light(&mut self) -> Entity {
        self.world().query_filtered::<Entity, With<DirectionalLight>>().single(self.world()).unwrap()
    }

    fn move_by(&mut self, entity: Entity, by: Vec3) {
        self.world().get_mut::<Transform>(entity).unwrap().translation += by;
    }

    fn material(&mut self, mesh: usize) -> Handle<StandardMaterial> {
        self.get::<MeshMaterial3d<StandardMaterial>>(self.meshes[mesh]).0.clone()
    }
}

type Change = fn(&mut View);

/// Makes changes in a view that rests between them, and in one in which nothing is ever kept. Returns the last frame.
fn draw_changes(
    new: impl Fn() -> View,
    changes: impl Iterator<Item = &'static (&'static str, Change)>,
    is_invisible: impl Fn(&str) -> bool,
) -> RgbaImage {
    let [mut view, mut fresh] = [new(), new()];
    view.wait();
    fresh.wait();
    let mut before = fresh.capture();
    (0..3).for_each(|_| assert_same(&view.capture(), &before, "a view at rest"));
    for (what, change) in changes {
        for view in [&mut view, &mut fresh] {
            change(view);
            if !view.posterizes {
                view.show_as_trained();
            }
        }
        let anew = fresh.capture_anew();
        // A capture waits for new pipelines, levels and fields. Waiting without drawing would drop what is kept. A view
        // takes two frames to come to rest, and the third is kept.
        for frame in 0..3 {
            assert_same(&view.capture(), &anew, &format!("{what}, frame {frame}"));
        }
        assert!(is_invisible(what) || anew != before, "{what} changes nothing");
        before = anew;
    }
    before
}

/// Every change that a frame can show. The names are those of what determines a frame, and of the scene.
const CHANGES: &[(&str, Change)] = &[
    ("a prop moves", |view| view.move_by(view.props[0], Vec3::new(0.05, 0.0, 0.0))),
    ("the other prop moves", |view| view.move_by(view.props[1], Vec3::new(0.0, -0.1, 0.0))),
    ("a prop turns and mirrors", |view| {
        let place = Transform::from_rotation(Quat::from_rotation_y(0.3)).with_scale(Vec3::new(-1.0, 1.1, 1.0));
        view.set_prop(0, place);
    }),
    ("the order of props", |view| view.move_by(view.props[1], Vec3::new(0.0, 0.0, 1.4))),
    ("the field of a prop", |view| view.set_prop(1, Prop(view.fields[0].clone()))),
    ("the contents of a field", |view| {
        let handle = view.fields[0].clone();
        view.world().resource_mut::<Assets<PlenOctree>>().insert(&handle, field(0.7)).unwrap();
    }),
    ("a tint", |view| view.set_prop(1, PropTint(Color::linear_rgb(0.5, 1.0, 0.2)))),
    ("a tint of a posterized prop", |view| view.set_prop(0, PropTint(Color::linear_rgb(0.5, 0.9, 1.0)))),
    ("where a prop is solid", |view| view.set_prop(1, SolidOpacity::Never)),
    ("where the other prop is solid", |view| view.set_prop(0, SolidOpacity::Never)),
    ("a prop is posterized", |view| view.set_prop(1, Posterize { softness: 0.0, ..default() })),
    ("a prop as trained", |view| {
        let prop = view.props[1];
        view.world().entity_mut(prop).remove::<Posterize>();
    }),
    ("a prop as trained is recolored", |view| {
        let own = PaletteOverride::default().with(0, Color::srgb(0.1, 0.7, 0.3));
        view.set_prop(1, (Recolor::default(), own));
    }),
    ("its colors", |view| view.set_prop(1, PaletteOverride::default().with(0, Color::srgb(0.2, 0.2, 0.3)))),
    ("its own colors again", |view| view.set_prop(1, PaletteOverride::default())),
    ("the opacity of thin pixels", |view| view.set_prop(0, Posterize { min_opacity: 0.9, ..default() })),
    ("the filter", |view| {
        let filter = BilateralFilter { iterations: 2, radius: 4, taps: 6, spatial_sigma: 5.0, range_sigma: 40.0 };
        view.set_prop(0, Posterize { filter, ..default() });
    }),
    ("the width of the filter", |view| {
        let filter = BilateralFilter { iterations: 2, radius: 4, taps: 6, spatial_sigma: 0.5, range_sigma: 40.0 };
        view.set_prop(0, Posterize { filter, ..default() });
    }),
    ("hard edges", |view| view.set_prop(0, Posterize { edges: EdgeSmoothing::Off, ..default() })),
    ("blend steps", |view| view.set_prop(0, Posterize { blend_steps: 1, ..default() })),
    ("hard borders", |view| view.set_prop(0, Posterize { borders: BorderSmoothing::Off, ..default() })),
    ("ink", |view| view.set_prop(0, Ink { width: 0.05, ..default() })),
    ("the color of ink", |view| {
        view.set_prop(0, Ink { width: 0.05, color: InkColor::Flat(Color::WHITE), ..default() })
    }),
    ("ink between pairs of colors", |view| {
        view.set_prop(0, Ink { width: 0.05, borders: InkBorders::Pairs(vec![[0, 1], [1, 2]]), ..default() });
    }),
    ("ink between other pairs", |view| {
        view.set_prop(0, Ink { width: 0.05, borders: InkBorders::Pairs(vec![[0, 2]]), ..default() });
    }),
    ("no ink", |view| {
        let prop = view.props[0];
        view.world().entity_mut(prop).remove::<Ink>();
    }),
    ("softness", |view| view.set_prop(0, Posterize { blend_steps: 1, softness: 0.3, ..default() })),
    ("a palette", |view| {
        let field = view.fields[0].clone();
        view.world().resource_mut::<Palettes>().get_mut(&field).unwrap().set(1, Color::srgb(0.9, 0.1, 0.9));
    }),
    ("a palette of tones", |view| {
        let field = view.fields[0].clone();
        let mut palettes = view.world().resource_mut::<Palettes>();
        let palette = palettes.get(&field).unwrap().palette().clone();
        let tones = Palette { method: Some(PaletteMethod::Tones), ..palette };
        palettes.insert(&field, FieldPalette::new(tones));
    }),
    ("an override", |view| {
        let mut own = PaletteOverride::default();
        own.set(1, Color::srgb(0.0, 0.9, 0.1));
        view.set_prop(0, own);
    }),
    ("a mesh moves between props", |view| view.move_by(view.meshes[0], Vec3::new(0.1, 0.1, 0.0))),
    ("a mesh moves into a prop", |view| view.move_by(view.meshes[0], Vec3::new(0.0, 0.0, -0.2))),
    ("a mesh is hidden", |view| {
        let mesh = view.meshes[0];
        view.world().entity_mut(mesh).insert(Visibility::Hidden);
    }),
    ("the color of a mesh", |view| {
        let material = view.material(1);
        let mut materials = view.world().resource_mut::<Assets<StandardMaterial>>();
        materials.get_mut(&material).unwrap().base_color = Color::srgb(0.9, 0.8, 0.1);
    }),
    ("the background", |view| {
        view.camera_mut().clear_color = Color::srgb(0.2, 0.1, 0.3).into();
    }),
    ("a prop is hidden", |view| view.set_prop(1, Visibility::Hidden)),
    ("a prop is shown", |view| view.set_prop(1, Visibility::Visible)),
    ("the camera moves", |view| view.move_by(view.camera, Vec3::new(0.1, 0.0, 0.1))),
    ("the projection", |view| {
        view.set(Projection::Perspective(PerspectiveProjection { fov: 0.9, ..default() }));
    }),
    ("jitter", |view| view.set(TemporalJitter { offset: Vec2::new(0.4, -0.3) })),
    ("where rays stop", |view| view.set(PropQuality { stop_transmittance: 0.3, ..PropQuality::EXACT })),
    ("faint leaves", |view| view.set(PropQuality { density_threshold: 1e3, ..PropQuality::EXACT })),
    ("a level of detail", |view| view.set(PropQuality { cell_size: 20.0, ..PropQuality::EXACT })),
    ("exact again", |view| view.set(PropQuality::EXACT)),
    ("samples", |view| view.set(Msaa::Sample4)),
    ("HDR", |view| view.set(Hdr)),
    ("exposure", |view| view.set(Exposure { ev100: 10.5 })),
    ("the place in the frame", |view| view.set(PropPlacement::Display)),
    ("one sample", |view| view.set(Msaa::Off)),
    ("a posterized view", |view| {
        let field = view.fields[1].clone();
        view.set((PosterizeView(field), Posterize::default()));
    }),
    ("custom stages", |view| {
        let idle = view.idle_stage();
        view.set((idle, Posterize { softness: 0.1, ..default() }));
    }),
    ("the viewport", |view| {
        view.camera_mut().viewport =
            Some(Viewport { physical_position: UVec2::new(8, 4), physical_size: UVec2::splat(SIZE - 16), ..default() });
    }),
    ("the viewport moves", |view| {
        view.camera_mut().viewport.as_mut().unwrap().physical_position = UVec2::new(0, 10);
    }),
    ("a view that is not posterized", |view| {
        view.unset::<(PosterizeView, LabelStages)>();
    }),
    ("motion vectors", |view| view.set((PropPlacement::Scene, MotionVectorPrepass))),
];

/// Those that only posterized props show.
const CHANGES_OF_LABELS: &[&str] = &[
    "a prop is posterized",
    "a prop as trained",
    "the opacity of thin pixels",
    "the filter",
    "the width of the filter",
    "hard edges",
    "blend steps",
    "hard borders",
    "ink",
    "the color of ink",
    "ink between pairs of colors",
    "ink between other pairs",
    "no ink",
    "softness",
    "an override",
];

/// The next frame shows any change, and so do the frames after it, in which everything is kept.
#[test]
fn every_change_is_drawn_at_once() {
    let is_invisible = |what: &str| what == "motion vectors";
    let before = draw_changes(|| View::new(true), CHANGES.iter(), is_invisible);
    // The same again in a fresh app, all at once.
    let mut fresh = View::new(true);
    fresh.wait();
    CHANGES.iter().for_each(|(_, change)| change(&mut fresh));
    fresh.update(1);
    fresh.wait();
    assert_same(&fresh.capture(), &before, "a fresh app, all changes in a frame");
}

/// The same where no prop is posterized.
#[test]
fn every_change_of_props_as_trained_is_drawn_at_once() {
    let changes = CHANGES.iter().filter(|(what, _)| !CHANGES_OF_LABELS.contains(what));
    draw_changes(|| View::new(false), changes, |what| what == "motion vectors");
}

/// Light on props, which no setting of theirs may tell from that of the frame before.
const CHANGES_OF_LIGHT: &[(&str, Change)] = &[
    ("the sun turns", |view| {
        let sun = view.find_light();
        view.world().get_mut::<Transform>(sun).unwrap().rotate_y(0.7);
    }),
    ("the sun's color", |view| {
        let sun = view.find_light();
        view.world().get_mut::<DirectionalLight>(sun).unwrap().color = Color::srgb(1.0, 0.6, 0.4);
    }),
    ("a mesh moves into the light", |view| {
        let mesh = view.meshes[1];
        view.insert(mesh, Transform::from_xyz(0.4, 0.8, 1.2));
    }),
    ("a mesh moves in the light", |view| view.move_by(view.meshes[1], Vec3::new(-0.2, 0.0, 0.0))),
    ("shadows", |view| view.set_prop(0, PropLighting { shadows: 0.3, ..PropLighting::toon(2.0) })),
    ("a lamp", |view| {
        let lamp = PointLight { intensity: 1e5, ..default() };
        view.spawn((lamp, Transform::from_xyz(-0.4, 1.0, 1.5)));
    }),
    ("brightness", |view| view.set_prop(0, PropLighting::toon(0.5))),
    ("bands", |view| view.set_prop(0, PropLighting { bands: 3, ..PropLighting::toon(0.5) })),
    ("a palette in light", |view| {
        let field = view.fields[0].clone();
        view.world().resource_mut::<Palettes>().get_mut(&field).unwrap().set(1, Color::srgb(0.9, 0.1, 0.9));
    }),
    ("no sun", |view| {
        let sun = view.find_light();
        view.world().despawn(sun);
    }),
];

/// The same of light.
#[test]
fn every_change_of_light_is_drawn_at_once() {
    let new = || {
        let mut view = View::new(true);
        // Bevy clears them in every frame.
        view.world().insert_resource(DirectionalLightShadowMap { size: 512 });
        let sun = DirectionalLight { illuminance: 3000.0, shadow_maps_enabled: true, ..default() };
        view.spawn((sun, Transform::default().looking_to(Vec3::new(-0.6, -0.3, -1.0), Vec3::Y)));
        view.set_prop(0, PropLighting::toon(2.0));
        view.set_prop(1, PropLighting::default());
        view
    };
    draw_changes(new, CHANGES_OF_LIGHT.iter(), |_| false);
}

/// With several samples per pixel, a mesh may uncover some of them while a pixel's first sample, whose depth ends the
/// ray of the pixel, stays covered.
#[test]
fn a_mesh_may_move_by_parts_of_pixels() {
    let mut view = View::new(true);
    // The mesh faces the camera, so that its depth stays the same.
    let scaling_mode = ScalingMode::Fixed { width: 3.0, height: 3.0 };
    let flat = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() };
    view.set((Projection::Orthographic(flat), Transform::from_xyz(0.0, 0.0, 3.0), Msaa::Sample4));
    view.move_by(view.meshes[0], Vec3::new(0.0, 0.0, 0.9));
    view.wait();
    let (mut before, mut changes) = (view.capture(), 0);
    for step in 0..8 {
        view.move_by(view.meshes[0], Vec3::new(3.0 / SIZE as f32 / 8.0, 0.0, 0.0));
        let kept: Vec<_> = (0..3).map(|_| view.capture()).collect();
        let anew = view.capture_anew();
        kept.iter().for_each(|frame| assert_same(frame, &anew, &format!("step {step}")));
        changes += usize::from(anew != before);
        before = anew;
    }
    assert!(changes >= 4, "only {changes} of 8 steps are seen");
}

/// Changes that last for a single frame leave no trace, and are seen in that frame.
#[test]
fn changes_are_undone_at_once() {
    for posterizes in [true, false] {
        undo_changes(posterizes);
    }
}

fn undo_changes(posterizes: bool) {
    let mut view = View::new(posterizes);
    view.wait();
    let still: Vec<_> = (0..4).map(|_| view.capture()).collect();
    let there_and_back: &[(&str, Change, Change)] = &[
        (
            "a mesh",
            |view| view.move_by(view.meshes[0], Vec3::new(0.25, 0.0, 0.0)),
            |view| view.move_by(view.meshes[0], Vec3::new(-0.25, 0.0, 0.0)),
        ),
        (
            "a color",
            |view| {
                let material = view.material(1);
                let mut materials = view.world().resource_mut::<Assets<StandardMaterial>>();
                materials.get_mut(&material).unwrap().base_color = Color::srgb(0.9, 0.8, 0.1);
            },
            |view| {
                let material = view.material(1);
                let mut materials = view.world().resource_mut::<Assets<StandardMaterial>>();
                materials.get_mut(&material).unwrap().base_color = Color::srgb(0.3, 0.7, 0.4);
            },
        ),
        (
            "the camera",
            |view| view.move_by(view.camera, Vec3::new(0.25, 0.0, 0.0)),
            |view| view.move_by(view.camera, Vec3::new(-0.25, 0.0, 0.0)),
        ),
        ("a prop", |view| view.set_prop(1, Visibility::Hidden), |view| view.set_prop(1, Visibility::Visible)),
    ];
    for (what, there, back) in there_and_back {
        for rest in 0..4 {
            there(&mut view);
            assert!(view.capture() != still[0], "{what}, after {rest} frames of rest");
            back(&mut view);
            for frame in 0..=rest {
                assert_same(&view.capture(), &still[0], &format!("{what} is back, frame {frame} of {rest}"));
            }
        }
    }
    still.iter().for_each(|frame| assert_same(frame, &still[0], "a still view"));
}

/// Whether edges follow from opacity changes what a later pass lists for an earlier result.
#[test]
fn edges_are_drawn_anew_when_rays_replace_opacity() {
    // Opacity shows where the ball ends: cells are larger than pixels.
    let ball = |at: DVec3| if at.length() < 0.7 { 20.0 } else { 0.0 };
    let mut stage = Stage::of(96, &colored(5, ball, |_| DVec3::new(0.8, 0.2, 0.1)));
    stage.dress(Posterize::default());
    stage.paint(FieldPalette::new(Palette::new(COLORS.to_vec()).unwrap()));
    stage.set_background(Color::WHITE);
    let place = |x: f32| Transform::from_xyz(x, 0.2, 2.2).looking_at(Vec3::ZERO, Vec3::Y);
    stage.set((PropQuality::EXACT, place(0.0)));
    stage.wait();
    stage.capture();
    stage.set((PropQuality::default(), place(0.3)));
    let estimated = (0..4).map(|_| stage.capture()).last().unwrap();
    stage.set(PropQuality::EXACT);
    let frames: Vec<_> = (0..3).map(|_| stage.capture()).collect();
    stage.camera_mut().is_active = false;
    stage.update(1);
    stage.camera_mut().is_active = true;
    let anew = stage.capture();
    assert_ne!(anew, estimated);
    for frame in frames {
        assert_same(&frame, &anew, "exact again");
    }
}
