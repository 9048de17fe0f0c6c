//! Turns of conversions, which take much time and memory.

use async_lock::{Semaphore, SemaphoreGuard};

/// The number of captures and fields that are converted or packed at the same time. Each occupies all cores for most of
/// the time, so more of them would only take more memory.
static TURNS: Semaphore = Semaphore::new(2);

/// Waits for a turn, which lasts until the guard is dropped.
pub(super) async fn turn() -> SemaphoreGuard<'static> {
    TURNS.acquire().await
}
