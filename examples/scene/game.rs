//! Day and night, and the lever that switches between them.

use bevy::prelude::*;

use crate::night::Night;

pub fn plugin(app: &mut App) {
    app.init_resource::<Night>().add_systems(Update, (pull, update_night, turn_levers).chain());
}

/// Seconds from day to night.
const DUSK: f32 = 1.5;
/// Until someone pulls the lever, it moves by itself once per this many seconds.
const IDLE_INTERVAL: f32 = 4.0;

/// A lever that switches between day and night.
#[derive(Component, Default)]
pub struct Lever {
    pub down: bool,
}

fn pull(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    mut levers: Query<&mut Lever>,
    mut played: Local<bool>,
    mut timer: Local<Option<Timer>>,
) {
    let by_hand = keys.just_pressed(KeyCode::Space);
    *played |= by_hand;
    let timer = timer.get_or_insert_with(|| Timer::from_seconds(IDLE_INTERVAL, TimerMode::Repeating));
    let by_itself = timer.tick(time.delta()).just_finished() && !*played;
    if by_hand || by_itself {
        levers.iter_mut().for_each(|mut lever| lever.down = !lever.down);
    }
}

fn update_night(time: Res<Time>, mut night: ResMut<Night>, levers: Query<&Lever>) {
    let step = time.delta_secs() / DUSK;
    let step = if levers.iter().any(|lever| lever.down) { step } else { -step };
    night.0 = (night.0 + step).clamp(0.0, 1.0);
}

fn turn_levers(night: Res<Night>, mut levers: Query<&mut Transform, With<Lever>>) {
    for mut lever in &mut levers {
        lever.rotation = Quat::from_rotation_x(0.6 + 1.9 * night.0);
    }
}
