//! Driver errors, such as running out of memory, caught where they occur instead of in the middle of a frame.

use std::time::Duration;

use bevy::{
    platform::time::Instant,
    render::{
        render_resource::{Buffer, BufferDescriptor, BufferUsages},
        renderer::RenderDevice,
    },
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

/// Creates textures and buffers as long as there is memory for them.
#[derive(Default)]
pub(crate) struct Allocator {
    errors: DriverErrors,
    failed: Option<Instant>,
}

/// How long nothing is created after a failure of the driver.
pub(super) const PAUSE: Duration = Duration::from_secs(2);

impl Allocator {
    /// Returns what `create` creates, or `None` if there is no memory for it, or was none a moment ago.
    pub fn create<T>(&mut self, device: &RenderDevice, create: impl FnOnce() -> T) -> Option<T> {
        if self.is_pausing() {
            return None;
        }
        self.try_again();
        let created = self.errors.watch(device, create);
        self.error().is_none().then_some(created)
    }

    /// Returns a buffer, or `None` if there is no memory for it or if the device cannot bind as much.
    pub fn buffer(
        &mut self,
        device: &RenderDevice,
        label: &'static str,
        size: u64,
        usage: BufferUsages,
    ) -> Option<Buffer> {
        if usage.contains(BufferUsages::STORAGE) && size > device.limits().max_storage_buffer_binding_size {
            self.failed.get_or_insert_with(Instant::now);
            return None;
        }
        let descriptor = BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.create(device, || device.create_buffer(&descriptor))
    }

    /// Returns the driver's message if the last attempt failed.
    pub fn error(&mut self) -> Option<&str> {
        let error = self.errors.first();
        if error.is_some() {
            self.failed.get_or_insert_with(Instant::now);
        }
        error
    }

    /// Returns whether the last attempt failed a moment ago.
    pub fn is_pausing(&self) -> bool {
        self.failed.is_some_and(|failed| failed.elapsed() < PAUSE)
    }

    /// Ends the pause.
    pub fn try_again(&mut self) {
        if self.failed.take().is_some() {
            self.errors = DriverErrors::default();
        }
    }
}
