//! The toys on the carousel.

use bevy::prelude::*;
use bevy_plenoctree::{PaletteOverride, Posterize, Prop};

use crate::stand::{Footprint, standing};

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (hop, change_colors));
}

/// The fields of the rings, from the middle outwards: file, and which of its colors is painted.
const TOYS: [(&str, usize); 4] = [("toadstool.npz", 0), ("robot.npz", 0), ("gumballs.npz", 0), ("drum.npz", 2)];

/// The hue of a toy, in degrees, and which of its palette's colors has it.
#[derive(Component)]
struct Painted {
    hue: f32,
    index: usize,
}

/// Where a toy that hops stands, and when it begins, in radians.
#[derive(Component)]
struct Hopping {
    ground: f32,
    phase: f32,
}

/// Spawns the toy of a place of a ring, at a point of it, looking outwards.
pub fn spawn_toy(
    commands: &mut Commands,
    assets: &AssetServer,
    ring: usize,
    place: u32,
    at: Vec3,
    around: f32,
) -> Entity {
    let (file, index) = TOYS[ring % TOYS.len()];
    // The middle one is the largest; the others are not all alike.
    let scale = if ring == 0 { 1.2 } else { [0.9, 1.05, 0.8][place as usize % 3] };
    let stand = standing(at, scale, around);
    commands
        .spawn((
            Prop(assets.load(file)),
            Posterize::default(),
            PaletteOverride::default(),
            Footprint::of(file),
            Painted { hue: (around.to_degrees() + 47.0 * ring as f32) % 360.0, index },
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

/// The colors go once around in half a minute.
fn change_colors(time: Res<Time>, mut toys: Query<(&Painted, &mut PaletteOverride)>) {
    for (painted, mut colors) in &mut toys {
        let hue = (painted.hue + 12.0 * time.elapsed_secs()) % 360.0;
        colors.set(painted.index, Color::oklch(0.68, 0.17, hue));
    }
}
