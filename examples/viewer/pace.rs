//! Redraws the window continuously while something happens, and otherwise only once in a while.

use std::time::{Duration, Instant};

use bevy::{
    prelude::*,
    render::view::screenshot::Screenshot,
    window::WindowEvent,
    winit::{UpdateMode, WinitSettings},
};
use bevy_plenoctree::{PaletteExtraction, Prop, PropState};

use crate::loader::Loader;

/// How long to redraw after input, so that animations of the UI finish and the camera comes to rest.
const AFTERGLOW: Duration = Duration::from_secs(2);
/// The time between frames while nothing happens. The field's file is still watched.
const IDLE: Duration = Duration::from_secs(1);

pub fn set(
    mut settings: ResMut<WinitSettings>,
    mut input: MessageReader<WindowEvent>,
    mut last_input: Local<Option<Instant>>,
    loader: Res<Loader>,
    extraction: Res<PaletteExtraction>,
    props: Query<(&Prop, &PropState)>,
    screenshots: Query<(), With<Screenshot>>,
) {
    if input.read().last().is_some() {
        *last_input = Some(Instant::now());
    }
    let busy = loader.reading().is_some()
        || last_input.is_some_and(|last| last.elapsed() < AFTERGLOW)
        || props.iter().any(|(prop, state)| state.is_waiting() || extraction.progress(&prop.0).is_some())
        || !screenshots.is_empty();
    let mode = if busy { UpdateMode::Continuous } else { UpdateMode::reactive(IDLE) };
    *settings = WinitSettings { focused_mode: mode, unfocused_mode: mode };
}
