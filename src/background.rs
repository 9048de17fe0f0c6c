//! Runs work that takes longer than a frame on dedicated threads.
//!
//! On small machines, Bevy's task pools have a single thread each, which compiles pipelines and reads files. Long work
//! in them would block all of that. On Linux and Android, these threads have a low priority, so that they use only the
//! time that frames leave.

use std::{
    sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    thread::available_parallelism,
    time::Duration,
};

use bevy::{ecs::resource::Resource, tasks::Task};

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

/// Runs `work`, which reads a file, on one of a few threads that files share: a game may load dozens at the same time. Its
/// parts for rayon run there, too. Returns a task like [`spawn`].
pub(crate) fn read<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Task<T> {
    #[cfg(not(target_arch = "wasm32"))]
    {
        static READERS: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
        let readers = READERS.get_or_init(|| threads(spare_cores().div_ceil(2), "plenoctree reader"));
        let schedule = move |task: async_task::Runnable| match readers {
            Some(readers) => readers.spawn(|| _ = task.run()),
            None => on_thread(task),
        };
        let (runnable, task) = async_task::spawn(async move { work() }, schedule);
        runnable.schedule();
        task
    }
    #[cfg(target_arch = "wasm32")]
    return spawn(work);
}

/// Drops `value`, which holds `bytes` of memory: on a thread of its own if that takes long.
///
/// While memory is given back, the system and the driver hold locks that frames may wait for. So the thread keeps the
/// priority of frames, and is done soon.
pub(crate) fn discard(value: impl Send + 'static, bytes: u64) {
    if bytes >= MUCH
        && let Some(freeing) = FREEING.begin()
    {
        // If there can be no other thread, this drops it.
        let _ = std::thread::Builder::new().name("plenoctree".into()).spawn(move || {
            let _freeing = freeing;
            drop(value);
        });
    }
}

/// While an app's render world has it, [`discard`] uses threads. Once the last one is dropped, they have ended: drivers
/// crash if a program exits while a thread still gives memory back.
#[derive(Resource)]
pub(crate) struct FreesInBackground(&'static Freeing);

impl FreesInBackground {
    pub fn new() -> Self {
        Self::of(&FREEING)
    }

    fn of(freeing: &'static Freeing) -> Self {
        freeing.counts().apps += 1;
        Self(freeing)
    }
}

impl Drop for FreesInBackground {
    fn drop(&mut self) {
        let mut counts = self.0.counts();
        counts.apps -= 1;
        let is_busy = |counts: &mut Counts| counts.apps == 0 && counts.threads > 0;
        // Where there are no threads, there is no clock either.
        if is_busy(&mut counts) {
            // A crash is better than a program that does not exit.
            drop(self.0.changed.wait_timeout_while(counts, Duration::from_secs(5), is_busy));
        }
    }
}

static FREEING: Freeing = Freeing { counts: Mutex::new(Counts { apps: 0, threads: 0 }), changed: Condvar::new() };

/// Apps whose memory is freed in the background, and threads that free some.
struct Freeing {
    counts: Mutex<Counts>,
    changed: Condvar,
}

struct Counts {
    apps: usize,
    threads: usize,
}

impl Freeing {
    fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns what a thread holds until it ends, or `None` if there must be no thread.
    fn begin(&'static self) -> Option<FreeingThread> {
        let mut counts = self.counts();
        (counts.apps > 0).then(|| {
            counts.threads += 1;
            FreeingThread(self)
        })
    }
}

struct FreeingThread(&'static Freeing);

impl Drop for FreeingThread {
    fn drop(&mut self) {
        self.0.counts().threads -= 1;
        self.0.changed.notify_all();
    }
}

/// Runs a task on a new thread of low priority, or right here if there can be no other thread.
#[cfg(not(target_arch = "wasm32"))]
fn on_thread(task: async_task::Runnable) {
    use std::sync::Arc;
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
    match CORES.get_or_init(|| threads(spare_cores(), "plenoctree")) {
        Some(cores) => cores.install(work),
        None => work(),
    }
}

/// Returns the number of cores, but one, which is left to the app, and at least 1.
pub(crate) fn spare_cores() -> usize {
    available_parallelism().map_or(1, |cores| cores.get() - 1).max(1)
}

/// Starts `count` threads of low priority, or returns `None` if they cannot be started. Rayon's own threads are for the
/// app: those that start first would give theirs the low priority.
fn threads(count: usize, name: &'static str) -> Option<rayon::ThreadPool> {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(count);
    let builder = builder.thread_name(move |index| format!("{name} {index}"));
    // A panic ends only its task, as on other threads.
    builder.start_handler(|_| yield_to_frames()).panic_handler(|_| {}).build().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The last app waits for the threads that free its memory, and what is freed after that needs no thread.
    #[test]
    fn apps_end_after_what_frees_their_memory() {
        static LOCAL: Freeing = Freeing { counts: Mutex::new(Counts { apps: 0, threads: 0 }), changed: Condvar::new() };
        assert!(LOCAL.begin().is_none());
        let apps = [(); 2].map(|()| FreesInBackground::of(&LOCAL));
        let thread = LOCAL.begin().unwrap();
        let [first, last] = apps;
        drop(first);
        let freeing = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            drop(thread);
        });
        assert_eq!(LOCAL.counts().threads, 1);
        drop(last);
        assert_eq!(LOCAL.counts().threads, 0);
        assert!(LOCAL.begin().is_none());
        freeing.join().unwrap();
    }
}
