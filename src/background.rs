//! Runs what takes longer than a frame on threads of its own.
//!
//! On small machines, Bevy's task pools have a single thread each, which compiles pipelines and reads files. Long work
//! in them would keep all of that waiting.

use std::{sync::OnceLock, thread::available_parallelism};

use bevy::tasks::Task;

/// Runs `work` on a thread of its own, and returns a task that ends with it. Dropping the task discards the result.
///
/// The web has no threads. There, Bevy runs all tasks on the main thread, and this one too.
pub(crate) fn spawn<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Task<T> {
    #[cfg(not(target_arch = "wasm32"))]
    return blocking::unblock(work);
    #[cfg(target_arch = "wasm32")]
    return bevy::tasks::AsyncComputeTaskPool::get().spawn(async move { work() });
}

/// Runs `work`, which rayon splits into parts, on all cores but one, which is left to the app. Returns when it is done.
///
/// Do not wait for a lock in `work`: while it waits for its parts, its thread may start other work.
pub(crate) fn on_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static CORES: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
    let cores = CORES.get_or_init(|| {
        let threads = available_parallelism().map_or(1, |cores| cores.get() - 1).max(1);
        let name = |index| format!("plenoctree {index}");
        rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(name).build().ok()
    });
    match cores {
        Some(cores) => cores.install(work),
        // Threads of its own could not be started.
        None => work(),
    }
}
