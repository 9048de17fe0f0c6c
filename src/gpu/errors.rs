//! Driver errors, such as running out of memory, caught where they occur instead of in the middle of a frame.

use bevy::{
    render::renderer::RenderDevice,
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};

/// The errors of several calls.
#[derive(Default)]
pub(super) struct DriverErrors {
    first: Option<String>,
    /// Those that the driver has not reported yet.
    pending: Vec<Task<Option<wgpu::Error>>>,
}

impl DriverErrors {
    /// Catches the errors of `work`. A texture without memory also invalidates everything that uses it.
    pub fn watch<T>(&mut self, device: &RenderDevice, work: impl FnOnce() -> T) -> T {
        let device = device.wgpu_device();
        let invalid = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let result = work();
        let (memory, invalid) = (memory.pop(), invalid.pop());
        let mut error = Box::pin(async move {
            let memory = memory.await;
            memory.or(invalid.await)
        });
        // Native drivers report errors immediately, browsers later.
        match block_on(poll_once(&mut error)) {
            Some(error) => self.add(error),
            None => self.pending.push(AsyncComputeTaskPool::get().spawn(error)),
        }
        result
    }

    /// Returns the first error. Others may be reported later.
    pub fn first(&mut self) -> Option<&str> {
        let reported: Vec<_> = self.pending.iter_mut().map(|task| block_on(poll_once(task))).collect();
        let mut reports = reported.iter();
        self.pending.retain(|_| reports.next().is_none_or(Option::is_none));
        reported.into_iter().flatten().for_each(|error| self.add(error));
        self.first.as_deref()
    }

    /// Returns whether the driver has not reported everything yet.
    pub fn are_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    fn add(&mut self, error: Option<wgpu::Error>) {
        if self.first.is_none() {
            self.first = error.map(|error| error.to_string());
        }
    }
}
