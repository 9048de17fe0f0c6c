//! The game: a bar shows the progress, then swatches show the palette, and the prop fades in.

use bevy::{core_pipeline::tonemapping::Tonemapping, prelude::*};
use bevy_plenoctree::{Palette, PaletteExtraction, PaletteSampler, prelude::*};

/// The frame in which the field arrives.
pub const ARRIVAL: u32 = 60;
const BACKGROUND: Color = Color::srgb(0.93, 0.9, 0.84);

pub fn build(app: &mut App) {
    let arrives = |mut frame: Local<u32>| {
        *frame += 1;
        *frame == ARRIVAL
    };
    app.add_plugins(PlenOctreePlugin)
        .insert_resource(ClearColor(BACKGROUND))
        .add_systems(Startup, set_up)
        .add_systems(Update, (arrive.run_if(arrives), show_progress, animate));
}

fn set_up(mut commands: Commands, mut extraction: ResMut<PaletteExtraction>, mut gizmos: ResMut<GizmoConfigStore>) {
    // Software adapters sample on the CPU by default.
    extraction.sampler = PaletteSampler::Gpu;
    gizmos.config_mut::<DefaultGizmoConfigGroup>().0.line.width = 24.0;
    let place = Transform::from_xyz(0.0, 0.3, 5.0).looking_at(Vec3::new(0.0, -0.1, 0.0), Vec3::Y);
    commands.spawn((Camera3d::default(), Tonemapping::None, place));
}

fn arrive(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::toon(), PaletteOverride::default()));
}

/// Draws a part of a line below the prop, from 0 to 1.
fn draw(gizmos: &mut Gizmos, from: f32, to: f32, color: Color) {
    let [from, to] = [from, to].map(|x| Vec3::new(3.0 * x - 1.5, -1.45, 0.0));
    gizmos.line(from, to, color);
}

fn show_progress(mut gizmos: Gizmos, props: Query<(&Prop, &PropProgress)>, palettes: Res<Palettes>) {
    for (_, progress) in props.iter().filter(|(prop, _)| palettes.get(&prop.0).is_none()) {
        draw(&mut gizmos, 0.0, progress.fraction(), Color::srgb(0.5, 0.45, 0.4));
    }
}

/// Turns the hue of the heaviest ramp from the first frame in which there is a palette. Fades the palette in from the
/// color of the background: first swatches of its colors, then the prop.
fn animate(
    time: Res<Time>,
    mut age: Local<f32>,
    mut palettes: ResMut<Palettes>,
    mut props: Query<(&Prop, &mut PaletteOverride)>,
    mut gizmos: Gizmos,
) {
    for (prop, mut colors) in &mut props {
        let Some(palette) = palettes.get_mut(&prop.0) else { continue };
        *age += time.delta_secs();
        palette.set_ramp(0, Color::oklch(0.6, 0.16, 60.0 * *age));
        colors.blend(&[BACKGROUND; Palette::MAX_COLORS], palette.shown(), *age - 1.0, BlendSpace::Oklab);
        let width = 1.0 / palette.shown().len() as f32;
        for (index, color) in palette.shown().iter().enumerate() {
            let (left, color) = (index as f32 * width, BlendSpace::Oklab.mix(BACKGROUND, *color, *age));
            draw(&mut gizmos, left, left + 0.8 * width, color);
        }
    }
}
