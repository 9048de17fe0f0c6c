//! What is logged.

use std::{
    fmt::Debug,
    sync::{Arc, Mutex},
};

use bevy::log::{
    tracing::{
        Event, Subscriber,
        field::{Field, Visit},
        subscriber::with_default,
    },
    tracing_subscriber::{
        Layer, Registry,
        layer::{Context, SubscriberExt},
    },
};

/// Collects what is logged.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<String>>);

impl<S: Subscriber> Layer<S> for Log {
    fn on_event(&self, event: &Event, _: Context<S>) {
        event.record(&mut self.clone());
    }
}

impl Visit for Log {
    fn record_debug(&mut self, _: &Field, value: &dyn Debug) {
        *self.0.lock().unwrap() += &format!("{value:?}\n");
    }
}

/// Returns what `work` returns, and the lines that it logs on this thread.
pub fn logged<T>(work: impl FnOnce() -> T) -> (T, String) {
    let log = Log::default();
    let result = with_default(Registry::default().with(log.clone()), work);
    let lines = log.0.lock().unwrap().clone();
    (result, lines)
}
