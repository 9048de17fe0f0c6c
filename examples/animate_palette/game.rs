//! What the game does with palettes.

use bevy::prelude::*;
use bevy_plenoctree::{BlendSpace, Palette, PaletteOverride, Palettes, Prop};

pub fn plugin(app: &mut App) {
    app.init_resource::<Night>()
        .add_message::<Hit>()
        .add_systems(Update, (set_sun, paint_by_night, wear_team_colors, swing, start_flashes, flash).chain());
}

/// Seconds from one noon to the next.
const DAY: f32 = 12.0;
/// Seconds from one hit to the next while nobody plays.
const SWING: f32 = 2.0;
/// Seconds that a flash takes.
const FLASH: f32 = 0.4;

/// How much of the night has come: 0 at noon, 1 at midnight.
#[derive(Resource, Default)]
pub struct Night(pub f32);

/// What a prop looks like at midnight.
#[derive(Component)]
pub struct ByNight(pub [Color; 6]);

/// The color of a robot's metal, by day and by night.
#[derive(Component)]
pub struct Team {
    pub by_day: Color,
    pub by_night: Color,
}

/// What can be hit.
#[derive(Component)]
pub struct Target;

/// Something was hit.
#[derive(Message)]
struct Hit(Entity);

/// The seconds since a hit.
#[derive(Component)]
struct Flashing(f32);

/// The robots' metal among the colors of their palette.
const METAL: usize = 0;

fn set_sun(time: Res<Time>, mut night: ResMut<Night>) {
    let height = (std::f32::consts::TAU * time.elapsed_secs() / DAY).cos();
    night.0 = (0.5 - 0.7 * height).clamp(0.0, 1.0);
}

/// Day to night, for all props of a field at once.
fn paint_by_night(night: Res<Night>, mut palettes: ResMut<Palettes>, props: Query<(&Prop, &ByNight)>) {
    for (prop, by_night) in &props {
        if let Some(palette) = palettes.get_mut(&prop.0) {
            palette.fade(&by_night.0, night.0, BlendSpace::Oklab);
        }
    }
}

/// The robots share a field and its palette, but not the color of their metal.
fn wear_team_colors(night: Res<Night>, mut robots: Query<(&Team, &mut PaletteOverride)>) {
    for (team, mut colors) in &mut robots {
        colors.set(METAL, BlendSpace::Oklab.mix(team.by_day, team.by_night, night.0));
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

/// All white at first, and then back to what the prop's field shows at this time of the day.
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
