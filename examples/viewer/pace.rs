//! How often the window is drawn: all the time while something is going on, else only now and then.

use std::time::{Duration, Instant};

use bevy::{
    prelude::*,
    render::view::screenshot::Screenshot,
    window::WindowEvent,
    winit::{UpdateMode, WinitSettings},
};
use bevy_plenoctree::{PaletteExtraction, Prop};

use crate::loader::Loader;

/// How long it goes on after input: animations of the interface, and the camera until it has come to rest.
const AFTERGLOW: Duration = Duration::from_secs(2);
/// Between two frames when nothing is going on; the watcher of the field's file still looks at it.
const IDLE: Duration = Duration::from_secs(1);

pub fn set(
    mut settings: ResMut<WinitSettings>,
    mut input: MessageReader<WindowEvent>,
    mut last_input: Local<Option<Instant>>,
    loader: Res<Loader>,
    extraction: Res<PaletteExtraction>,
    props: Query<&Prop>,
    screenshots: Query<(), With<Screenshot>>,
) {
    if input.read().last().is_some() {
        *last_input = Some(Instant::now());
    }
    let busy = loader.reading().is_some()
        || last_input.is_some_and(|last| last.elapsed() < AFTERGLOW)
        || props.iter().any(|prop| extraction.progress(&prop.0).is_some())
        || !screenshots.is_empty();
    let mode = if busy { UpdateMode::Continuous } else { UpdateMode::reactive(IDLE) };
    *settings = WinitSettings { focused_mode: mode, unfocused_mode: mode };
}
