//! The toys on the carousel.

use bevy::{light::NotShadowCaster, prelude::*};
use bevy_plenoctree::{PaletteOverride, Posterize, Prop};

use crate::stand::{Footprint, standing};

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (hop, change_colors));
}

/// The fields on the rings, from the middle outward: the file, and the ramp to paint.
const TOYS: [(&str, &str); 5] = [
    ("toadstool.plenoctree", "red"),
    ("robot.plenoctree", "body"),
    ("gumballs.plenoctree", "body"),
    ("drum.plenoctree", "shell"),
    ("chest.plenoctree", "wood"),
];

/// The hue of a toy in degrees, and the ramp that gets it.
#[derive(Component)]
struct Painted {
    hue: f32,
    ramp: &'static str,
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
    let (file, ramp) = TOYS[ring % TOYS.len()];
    // The toy in the middle is the largest; the others vary in size.
    let scale = if ring == 0 { 1.2 } else { [0.9, 1.05, 0.8][place as usize % 3] };
    let stand = standing(at, scale, around);
    commands
        .spawn((
            Prop(assets.load(file)),
            Posterize::default(),
            PaletteOverride::default(),
            Footprint::of(file),
            // Casting shadows would cost more than drawing this many props.
            NotShadowCaster,
            Painted { hue: (around.to_degrees() + 47.0 * ring as f32) % 360.0, ramp },
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
        colors.set_ramp(painted.ramp, Color::oklch(0.62, 0.15, hue));
    }
}
