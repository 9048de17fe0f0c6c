//! Recolors props: fades the palette of a field from day to night, and overrides one ramp for a single prop.
//!
//! ```sh
//! cargo run --release --example recolor
//! ```

use bevy::prelude::*;
use bevy_plenoctree::prelude::*;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, PlenOctreePlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, fade_to_night)
        .run();
}

pub fn setup(mut commands: Commands, assets: Res<AssetServer>) {
    let field = assets.load("toadstool.plenoctree");
    commands.spawn((Prop(field.clone()), Posterize::default(), Transform::from_xyz(-1.1, 0.0, 0.0)));
    // The red of the cap, from shadow to highlight. An override applies to its own entity only.
    commands.spawn((
        Prop(field),
        Posterize::default(),
        PaletteOverride::default().with_ramp("red", Color::srgb(0.15, 0.35, 0.85)),
        Transform::from_xyz(1.1, 0.0, 0.0),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.3, 4.5).looking_at(Vec3::ZERO, Vec3::Y)));
}

/// All props of a field share its palette, and it can change in every frame.
fn fade_to_night(time: Res<Time>, props: Query<&Prop>, mut palettes: ResMut<Palettes>) {
    let night = Color::srgb(0.05, 0.07, 0.3);
    let darkness = 0.5 - 0.5 * (0.5 * time.elapsed_secs()).cos();
    for prop in &props {
        // This is `None` until the palette is extracted.
        if let Some(palette) = palettes.get_mut(&prop.0) {
            let dark: Vec<_> = palette.source().map(|color| BlendSpace::Oklab.mix(color, night, 0.7)).collect();
            palette.blend_from_source(&dark, darkness, BlendSpace::Oklab);
        }
    }
}
