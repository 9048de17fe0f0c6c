//! Animates the palettes.

use bevy::prelude::*;
use bevy_plenoctree::{BlendSpace, Palette, PaletteOverride, Palettes, Prop};

use crate::night::{Night, paint_by_night};

pub fn plugin(app: &mut App) {
    app.init_resource::<Night>()
        .add_message::<Hit>()
        .add_systems(Update, (set_sun, paint_by_night, wear_team_colors, swing, start_flashes, flash).chain());
}

/// Seconds from one noon to the next.
const DAY: f32 = 12.0;
/// Seconds from one automatic hit to the next.
const SWING: f32 = 2.0;
/// The duration of a flash, in seconds.
const FLASH: f32 = 0.4;

/// The color of a robot's metal, by day and by night.
#[derive(Component)]
pub struct Team {
    pub by_day: Color,
    pub by_night: Color,
}

/// A prop that can be hit.
#[derive(Component)]
pub struct Target;

/// Sent when a target is hit.
#[derive(Message)]
struct Hit(Entity);

/// Flashes after a hit. Holds the seconds since then.
#[derive(Component)]
struct Flashing(f32);

fn set_sun(time: Res<Time>, mut night: ResMut<Night>) {
    let height = (std::f32::consts::TAU * time.elapsed_secs() / DAY).cos();
    night.0 = (0.5 - 0.7 * height).clamp(0.0, 1.0);
}

/// Overrides the color of each robot's metal. The robots share a field and its palette.
fn wear_team_colors(night: Res<Night>, mut robots: Query<(&Team, &mut PaletteOverride)>) {
    for (team, mut colors) in &mut robots {
        colors.set_ramp("body", BlendSpace::Oklab.mix(team.by_day, team.by_night, night.0));
    }
}

fn swing(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    buttons: Res<ButtonInput<MouseButton>>,
    mut timer: Local<Option<Timer>>,
    targets: Query<Entity, With<Target>>,
    mut hits: MessageWriter<Hit>,
) {
    let timer = timer.get_or_insert_with(|| Timer::from_seconds(SWING, TimerMode::Repeating));
    let by_itself = timer.tick(time.delta()).just_finished();
    if by_itself || keys.just_pressed(KeyCode::Space) || buttons.just_pressed(MouseButton::Left) {
        hits.write_batch(targets.iter().map(Hit));
    }
}

fn start_flashes(mut hits: MessageReader<Hit>, mut commands: Commands) {
    for Hit(target) in hits.read() {
        commands.entity(*target).insert(Flashing(0.0));
    }
}

/// Turns a prop white, then fades it back to the colors that its field shows at this time of day.
fn flash(
    time: Res<Time>,
    palettes: Res<Palettes>,
    mut commands: Commands,
    mut props: Query<(Entity, &Prop, &mut Flashing, &mut PaletteOverride)>,
) {
    const WHITE: [Color; Palette::MAX_COLORS] = [Color::WHITE; Palette::MAX_COLORS];
    for (entity, prop, mut flashing, mut colors) in &mut props {
        let Some(palette) = palettes.get(&prop.0) else {
            continue;
        };
        let strength = 1.0 - flashing.0 / FLASH;
        if strength > 0.0 {
            colors.blend(palette.shown(), &WHITE, strength * strength, BlendSpace::Encoded);
        } else {
            colors.reset();
            commands.entity(entity).remove::<Flashing>();
        }
        flashing.0 += time.delta_secs();
    }
}
