//! The toys on the carousel.

use bevy::{light::NotShadowCaster, prelude::*};
use bevy_plenoctree::{PaletteMethod, PaletteOverride, Posterize, Prop};

use crate::stand::{Footprint, standing};

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (hop, change_colors));
}

/// The fields on the rings, from the middle outward: the file, and the indices of the palette colors to paint, each
/// darker than the one before.
const TOYS: [(&str, &[usize]); 5] = [
    ("toadstool.plenoctree", &[0]),
    ("robot.plenoctree", &[1, 0]),
    ("gumballs.plenoctree", &[0]),
    ("drum.plenoctree", &[3]),
    ("chest.plenoctree", &[1]),
];

/// The hue of a toy in degrees, and the indices of the palette colors that get it.
#[derive(Component)]
struct Painted {
    hue: f32,
    shades: &'static [usize],
}

/// The ground height of a hopping toy, and the phase of its hops in radians.
#[derive(Component)]
struct Hopping {
    ground: f32,
    phase: f32,
}

/// Spawns a toy at a place on a ring, facing outward.
pub fn spawn_toy(
    commands: &mut Commands,
    assets: &AssetServer,
    ring: usize,
    place: u32,
    at: Vec3,
    around: f32,
) -> Entity {
    let (file, shades) = TOYS[ring % TOYS.len()];
    // The toy in the middle is the largest; the others vary in size.
    let scale = if ring == 0 { 1.2 } else { [0.9, 1.05, 0.8][place as usize % 3] };
    let stand = standing(at, scale, around);
    commands
        .spawn((
            Prop(assets.load(file)),
            // The palettes in files have six colors, too.
            Posterize { method: Some(PaletteMethod::Fitted), ..default() },
            PaletteOverride::default(),
            Footprint::of(file),
            // Casting shadows would cost more than drawing this many props.
            NotShadowCaster,
            Painted { hue: (around.to_degrees() + 47.0 * ring as f32) % 360.0, shades },
            Hopping { ground: stand.translation.y, phase: 3.0 * around },
            stand,
        ))
        .id()
}

fn hop(time: Res<Time>, mut toys: Query<(&Hopping, &mut Transform)>) {
    for (hopping, mut place) in &mut toys {
        place.translation.y = hopping.ground + 0.12 * (4.0 * time.elapsed_secs() + hopping.phase).sin().max(0.0);
    }
}

/// Rotates the hue of each toy once every half minute.
fn change_colors(time: Res<Time>, mut toys: Query<(&Painted, &mut PaletteOverride)>) {
    for (painted, mut colors) in &mut toys {
        let hue = (painted.hue + 12.0 * time.elapsed_secs()) % 360.0;
        for (darker, &shade) in painted.shades.iter().enumerate() {
            let darker = 0.6f32.powi(darker as i32);
            colors.set(shade, Color::oklch(0.68 * darker, 0.17 * darker, hue));
        }
    }
}
