//! Tests palettes the way games use them: on the screen, in settings, and without allocations.

use std::any::TypeId;

use bevy::{
    app::AppLabel,
    color::Mix,
    prelude::*,
    reflect::{
        TypeRegistry,
        serde::{TypedReflectDeserializer, TypedReflectSerializer},
    },
    render::RenderApp,
};
use bevy_plenoctree::{
    BilateralFilter, BlendSpace, ColorCount, ExtractionSettings, FieldPalette, ObserverRegion, Palette, PaletteMethod,
    PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop, RampAdjustment, SamplingSettings,
};
use serde::de::DeserializeSeed;

use super::stage::{
    Stage,
    fields::cube,
    pixels::{assert_near, at, bytes, encoded},
};

const SIZE: UVec2 = UVec2::new(64, 32);
pub(super) const COLORS: [Color; 2] = [Color::srgb(0.8, 0.2, 0.2), Color::srgb(0.1, 0.1, 0.6)];
pub(super) const RED: Color = COLORS[0];

/// Bakes a box of the first color.
pub(super) fn solid(density: f64) -> PlenOctree {
    cube(density, encoded(RED))
}

/// Two props of one field, side by side.
struct Scene(Stage);

impl Scene {
    fn new(configure: impl FnOnce(&mut App)) -> Self {
        let mut stage = Stage::with(SIZE, configure);
        // Without a filter, the surroundings of a prop do not affect its color.
        let posterize = Posterize { filter: BilateralFilter { iterations: 0, ..default() }, ..default() };
        stage.spawn_prop(&solid(1e4), (posterize, Transform::from_xyz(-1.0, 0.0, 0.0)));
        stage.paint(FieldPalette::from_colors(COLORS).unwrap());
        stage.spawn((Prop(stage.field()), posterize, Transform::from_xyz(1.0, 0.0, 0.0)));
        stage.set(Transform::from_xyz(0.0, 0.0, 3.0));
        stage.wait();
        Self(stage)
    }

    /// Captures the next frame and returns the colors of the two props.
    fn colors(&mut self) -> [[u8; 3]; 2] {
        let frame = self.0.capture();
        [SIZE.x / 4, 3 * SIZE.x / 4].map(|x| at(&frame, x, SIZE.y / 2))
    }

    #[track_caller]
    fn assert_both_show(&mut self, expected: Color) {
        for found in self.colors() {
            assert_near(found, expected, 1, "a prop");
        }
    }

    /// Runs the `ExtractSchedule`, including Bevy's own systems.
    fn run_extract_schedule(&mut self) {
        let apps = self.0.headless.app.sub_apps_mut();
        let render = apps.sub_apps.get_mut(&RenderApp.intern()).unwrap();
        render.extract(apps.main.world_mut());
    }
}

#[test]
fn copies_of_a_prop_can_have_different_colors() {
    let mut scene = Scene::new(|_| {});
    let [ours, theirs] = [Color::srgb(0.2, 0.7, 0.3), Color::srgb(0.9, 0.8, 0.1)];
    scene.assert_both_show(RED);

    scene.0.dress(PaletteOverride::default().with(0, ours));
    let [found_left, found_right] = scene.colors();
    assert_near(found_left, ours, 1, "a prop");
    assert_near(found_right, RED, 1, "a prop");

    // Colors without an override are still the field's.
    scene.0.palette().set(0, theirs);
    let mut own = PaletteOverride::default().with(1, ours);
    scene.0.dress(own.clone());
    scene.assert_both_show(theirs);

    own.set(0, ours);
    own.unset(0);
    own.set(Palette::MAX_COLORS, ours);
    assert_eq!([0, 1, 2, Palette::MAX_COLORS].map(|index| own.get(index)), [None, Some(ours), None, None]);
    own.reset();
    assert_eq!(own.get(1), None);
}

#[test]
fn a_change_is_visible_in_the_same_frame() {
    #[derive(Resource)]
    struct Wanted(Color);
    fn paint(wanted: Option<Res<Wanted>>, mut palettes: ResMut<Palettes>, props: Query<&Prop>) {
        for prop in &props {
            if let (Some(wanted), Some(palette)) = (&wanted, palettes.get_mut(&prop.0)) {
                palette.set(0, wanted.0);
            }
        }
    }
    let mut scene = Scene::new(|app| {
        app.add_systems(Update, paint);
    });
    for step in 0..8u8 {
        let color = Color::srgb_u8(32 * step, 255 - 20 * step, step.wrapping_mul(83));
        scene.0.world().insert_resource(Wanted(color));
        // This is one update, which runs the system and renders the frame.
        scene.assert_both_show(color);
    }
    scene.0.world().remove_resource::<Wanted>();
    scene.0.palette().reset();
    scene.assert_both_show(RED);
}

#[test]
fn blends_reach_the_screen() {
    let mut scene = Scene::new(|_| {});
    let (from, to) = ([Color::srgb(1.0, 1.0, 0.0), RED], [Color::srgb(0.0, 0.0, 1.0), RED]);
    // Halfway between yellow and blue in Oklab, with Bevy's conversions.
    let oklab = Color::from(Oklaba::from(from[0]).mix(&to[0].into(), 0.5));
    for (space, halfway) in [(BlendSpace::Encoded, Color::srgb(0.5, 0.5, 0.5)), (BlendSpace::Oklab, oklab)] {
        for (t, expected) in [(0.0, from[0]), (0.5, halfway), (1.0, to[0]), (7.0, to[0])] {
            scene.0.palette().blend(&from, &to, t, space);
            scene.assert_both_show(expected);
        }
        for (t, expected) in [(0.0, RED), (1.0, to[0])] {
            scene.0.palette().blend_from_source(&to, t, space);
            scene.assert_both_show(expected);
        }
    }
}

/// Blending with more or fewer colors than the palette has changes only the colors that both have.
#[test]
fn blends_with_other_lengths_change_the_colors_in_common() {
    let white = [Color::WHITE; 5];
    let mut palette = FieldPalette::from_colors(COLORS).unwrap();
    palette.blend(&white, &white[..1], 0.5, BlendSpace::Oklab);
    assert_eq!(palette.shown().iter().map(|color| bytes(*color)).collect::<Vec<_>>(), [[255; 3], bytes(COLORS[1])]);
    palette.blend_from_source(&white, 1.0, BlendSpace::Encoded);
    assert_eq!(palette.shown(), &white[..2]);
    palette.reset();
    assert_eq!(palette.shown(), COLORS);
}

#[test]
fn a_change_allocates_nothing() {
    let mut scene = Scene::new(|_| {});
    scene.0.dress(PaletteOverride::default());
    let change = |scene: &mut Scene, t: f32| {
        let white = [Color::WHITE; 2];
        scene.0.palette().blend(&COLORS, &white, t, BlendSpace::Oklab);
        scene.0.palette().blend_from_source(&white, t, BlendSpace::Encoded);
        scene.0.palette().set(0, Color::hsv(30.0, 1.0, t));
        let prop = scene.0.prop();
        let mut own = scene.0.world().get_mut::<PaletteOverride>(prop).unwrap();
        own.reset();
        own.blend(&COLORS, &white, t, BlendSpace::Encoded);
    };
    // Let buffers grow to their final size.
    for _ in 0..4 {
        change(&mut scene, 0.5);
        scene.run_extract_schedule();
    }
    // Bevy's own systems allocate more in some frames than in others, depending on what other threads do, and the
    // fewest allocations may be rare. What a change costs, it costs in every frame, so frames with a change never
    // come down to the fewest of those without.
    let mut fewest = [u64::MAX; 2];
    for step in 0..2_000 {
        let changed = step % 2;
        if changed == 1 {
            let t = 0.025 * (step % 40) as f32;
            let count = allocation_counter::measure(|| change(&mut scene, t)).count_total;
            assert_eq!(count, 0, "the change itself allocates, in step {step}");
        }
        let count = allocation_counter::measure(|| scene.run_extract_schedule()).count_total;
        fewest[changed] = fewest[changed].min(count);
        if step >= 39 && fewest[0] == fewest[1] {
            return;
        }
    }
    panic!("extraction allocates after a change: {} times instead of {}", fewest[1], fewest[0]);
}

/// Systems that rely on the documented order of the plugin's sets find it.
#[test]
fn palettes_are_updated_after_reports() {
    use bevy_plenoctree::PlenOctreeSystems::{ReportFields, UpdatePalettes};
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    app.add_systems(PreUpdate, (|| {}).after(UpdatePalettes).before(ReportFields));
    let fails = app.world_mut().schedule_scope(PreUpdate, |world, schedule| schedule.initialize(world).is_err());
    assert!(fails, "a system runs between the two");
}

#[test]
fn invalid_palettes_are_rejected() {
    assert!(FieldPalette::from_colors([Color::NONE; 0]).is_err());
    assert!(FieldPalette::from_colors([Color::WHITE; Palette::MAX_COLORS + 1]).is_err());
    assert!(FieldPalette::from_colors([Color::srgb(f32::NAN, 0.0, 0.0)]).is_err());
    // Ramps that do not fit are left out.
    let mut cut = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2]]).unwrap();
    cut.gather_tones(&[0, 1], "cap").unwrap();
    cut.colors.truncate(1);
    let mut palette = FieldPalette::new(cut);
    assert!(!palette.adjust_ramp(0, &RampAdjustment::default()));
    // So are those whose tones have no weights.
    let mut light = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2]]).unwrap();
    light.gather_tones(&[0, 1], "cap").unwrap();
    light.weights.truncate(1);
    let mut palette = FieldPalette::new(light);
    assert!(!palette.adjust_ramp(0, &RampAdjustment::default()));
    // Their ramps must be valid all the same.
    let unnamed = palette.edit_ramps(|palette| {
        palette.ramps[0].name.clear();
        Ok(())
    });
    assert!(unnamed.is_err() && palette.ramp("cap") == Some(0));
}

/// Returns a value after a round trip through text.
pub(super) fn round_trip<T: FromReflect + TypePath>(value: &T, registry: &TypeRegistry) -> T {
    let text = serde_json::to_string(&TypedReflectSerializer::new(value, registry)).unwrap();
    let registration = registry.get(TypeId::of::<T>()).unwrap();
    let deserializer = TypedReflectDeserializer::new(registration, registry);
    let read = deserializer.deserialize(&mut serde_json::Deserializer::from_str(&text)).unwrap();
    T::from_reflect(&*read).unwrap()
}

/// Settings are registered, as inspectors and scenes require, and survive a round trip through text.
#[test]
fn settings_are_reflected() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let posterize = Posterize { softness: 0.125, filter: BilateralFilter { radius: 3, ..default() }, ..default() };
    assert_eq!(round_trip(&posterize, &registry), posterize);
    let own = PaletteOverride::default().with(2, Color::oklab(0.5, 0.1, -0.1));
    assert_eq!(round_trip(&own, &registry), own);
    let settings = ExtractionSettings {
        sampling: SamplingSettings { observers: ObserverRegion::Sphere, ..default() },
        method: PaletteMethod::Hull,
        colors: ColorCount::Auto { tolerance: 0.125 },
        ..default()
    };
    assert_eq!(round_trip(&settings, &registry), settings);
    for path in ["Posterize", "Prop", "PaletteOverride"] {
        let registration = registry.get_with_type_path(&format!("bevy_plenoctree::{path}")).unwrap();
        assert!(registration.data::<ReflectComponent>().is_some(), "{path}");
    }
}

/// Colors that a palette does not have are rejected, not ignored.
#[test]
fn colors_out_of_range_are_rejected() {
    let mut palette = FieldPalette::from_colors(COLORS).unwrap();
    assert!(palette.set(1, Color::WHITE));
    assert!(!palette.set(2, Color::WHITE));
    assert!(palette.source().eq(COLORS));
    assert_eq!(palette.shown(), [COLORS[0], Color::WHITE]);
    let mut own = PaletteOverride::default();
    assert!(own.set(Palette::MAX_COLORS - 1, Color::WHITE));
    assert!(!own.set(Palette::MAX_COLORS, Color::WHITE));
}
