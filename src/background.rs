//! Runs work that takes longer than a frame on dedicated threads.
//!
//! On small machines, Bevy's task pools have a single thread each, which compiles pipelines and reads files. Long work
//! in them would block all of that. Where a thread can lower its priority, these do, so that they use only the time
//! that frames leave.

use std::{sync::OnceLock, thread::available_parallelism};

use bevy::tasks::Task;

/// The size in bytes above which memory is freed in the background. Freeing less takes a negligible time.
const MUCH: u64 = 1 << 20;

/// Runs `work` on a dedicated thread, and returns a task that ends with it. Dropping the task discards the result.
///
/// The web has no threads: there, Bevy runs all tasks on the main thread, including this one.
pub(crate) fn spawn<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Task<T> {
    #[cfg(not(target_arch = "wasm32"))]
    {
        let (runnable, task) = async_task::spawn(async move { work() }, on_thread);
        runnable.schedule();
        task
    }
    #[cfg(target_arch = "wasm32")]
    return bevy::tasks::AsyncComputeTaskPool::get().spawn(async move { work() });
}

/// Drops `value`, which holds `bytes` of memory: on a thread of its own if that takes long.
///
/// While memory is given back, the system and the driver hold locks that frames may wait for. So the thread keeps the
/// priority of frames, and is done soon.
pub(crate) fn discard(value: impl Send + 'static, bytes: u64) {
    #[cfg(not(target_arch = "wasm32"))]
    if bytes >= MUCH {
        // If there can be no other thread, this drops it.
        let _ = std::thread::Builder::new().name("plenoctree".into()).spawn(move || drop(value));
    }
}

/// Runs a task on a new thread of low priority, or right here if there can be no other thread.
#[cfg(not(target_arch = "wasm32"))]
fn on_thread(task: async_task::Runnable) {
    use std::sync::{Arc, Mutex, PoisonError};
    let task = Arc::new(Mutex::new(Some(task)));
    let run = |task: &Mutex<Option<async_task::Runnable>>| {
        let task = task.lock().unwrap_or_else(PoisonError::into_inner).take();
        task.map(async_task::Runnable::run);
    };
    let own = task.clone();
    let thread = std::thread::Builder::new().name("plenoctree".into());
    let started = thread.spawn(move || {
        yield_to_frames();
        run(&own);
    });
    if started.is_err() {
        run(&task);
    }
}

/// Lowers the priority of this thread on systems that support it: frames get several times its share of a core.
fn yield_to_frames() {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    let _ = rustix::process::setpriority_process(None, 10);
}

/// Runs `work`, which rayon splits into parts, on all cores but one, which is left to the app. Returns when it is done.
///
/// Do not wait for a lock in `work`: while it waits for its parts, its thread may start other work that takes the same
/// lock.
pub(crate) fn on_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static CORES: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
    let cores = CORES.get_or_init(|| {
        let threads = available_parallelism().map_or(1, |cores| cores.get() - 1).max(1);
        let name = |index| format!("plenoctree {index}");
        let builder = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(name);
        builder.start_handler(|_| yield_to_frames()).build().ok()
    });
    match cores {
        Some(cores) => cores.install(work),
        // The threads could not be started.
        None => work(),
    }
}
