//! An app without a window that captures frames, for tests and tools. Requires the feature `headless`.

mod camera;
mod plugins;
mod readback;

pub use camera::{exact_camera, pinhole_view};
pub use plugins::HeadlessPlugins;

use std::time::{Duration, Instant};

use bevy::{
    asset::LoadState,
    camera::RenderTarget,
    prelude::*,
    render::{
        RenderApp,
        render_asset::RenderAssets,
        render_resource::{PipelineCache, PollType, TextureFormat, TextureUsages},
        renderer::RenderDevice,
        settings::WgpuSettings,
    },
};
use image::RgbaImage;
use plenoctree::{PlenOctree, palette::ExtractionError};

use crate::{
    gpu::{FieldTooLarge, GpuField},
    palette::{PaletteExtraction, Palettes},
    posterize::Posterize,
    prop::Prop,
    stage::PosterizeView,
};

/// An error of [`Headless`].
#[derive(Debug, thiserror::Error)]
pub enum HeadlessError {
    /// There is no graphics adapter, not even a software one.
    #[error("no usable graphics adapter (install a Vulkan driver, such as Mesa's lavapipe): {0}")]
    NoAdapter(String),
    /// The field of a prop or of a posterized view could not be loaded.
    #[error("{0}")]
    Field(String),
    /// The field of a prop does not fit on the GPU.
    #[error(transparent)]
    TooLarge(FieldTooLarge),
    /// A palette could not be extracted.
    #[error(transparent)]
    Palette(ExtractionError),
    /// The scene was not ready before the timeout.
    #[error("the scene was not ready after {0:?}")]
    TimedOut(Duration),
    /// The frame could not be read back from the GPU.
    #[error("failed to read the frame back: {0}")]
    Readback(String),
}

/// An app without a window that renders to an image: update it until the assets are ready, then capture a frame.
///
/// Frames run only when you ask for them: in [`update`](Self::update), [`wait_until_ready`](Self::wait_until_ready) and
/// [`capture`](Self::capture), which run on the calling thread and return after rendering. Time follows the wall clock;
/// insert Bevy's `TimeUpdateStrategy::ManualDuration` for reproducible frames. See [`HeadlessPlugins`] for the plugins
/// that an app may need in addition.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, Posterize, Prop, headless::Headless};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut headless = Headless::new(UVec2::new(640, 480), |app| {
///     app.add_plugins(PlenOctreePlugin);
/// })?;
/// let target = headless.target();
/// let world = headless.app.world_mut();
/// let field = world.resource::<AssetServer>().load("drum.npz");
/// world.spawn((Prop(field), Posterize::default()));
/// world.spawn((Camera3d::default(), target, Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y)));
/// headless.wait_until_ready(std::time::Duration::from_secs(60))?;
/// headless.capture()?.save("drum.png")?;
/// # Ok(()) }
/// ```
pub struct Headless {
    /// The app. Use its world to spawn entities and to read results.
    pub app: App,
    target: Handle<Image>,
}

impl Headless {
    /// Creates an app with [`HeadlessPlugins`] and everything that `configure` adds. Its target is an image of `size`
    /// pixels.
    ///
    /// Returns [`HeadlessError::NoAdapter`] if there is no graphics adapter.
    pub fn new(size: UVec2, configure: impl FnOnce(&mut App)) -> Result<Self, HeadlessError> {
        Self::build(size, WgpuSettings::default(), configure)
    }

    /// Creates an app like [`new`](Self::new), on a device that is restricted to `limits`. Use it to test how an app
    /// behaves on less capable machines.
    ///
    /// Returns [`HeadlessError::NoAdapter`] if there is no graphics adapter.
    pub fn with_limits(
        size: UVec2,
        limits: wgpu::Limits,
        configure: impl FnOnce(&mut App),
    ) -> Result<Self, HeadlessError> {
        Self::build(size, WgpuSettings { constrained_limits: Some(limits), ..default() }, configure)
    }

    fn build(size: UVec2, settings: WgpuSettings, configure: impl FnOnce(&mut App)) -> Result<Self, HeadlessError> {
        plugins::check_adapter().map_err(HeadlessError::NoAdapter)?;
        let mut app = App::new();
        app.add_plugins(HeadlessPlugins.set(plugins::render_plugin(settings)));
        configure(&mut app);
        app.finish();
        app.cleanup();
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(target_image(size));
        Ok(Self { app, target })
    }

    /// Resizes the target to `size` pixels, starting with the next frame. A size of 0 counts as 1.
    pub fn resize(&mut self, size: UVec2) {
        let mut images = self.app.world_mut().resource_mut::<Assets<Image>>();
        if let Some(mut image) = images.get_mut(&self.target)
            && image.size() != size
        {
            *image = target_image(size);
        }
    }

    /// Returns the render target. Add it to a camera to make it draw to the captured image.
    pub fn target(&self) -> RenderTarget {
        RenderTarget::Image(self.target.clone().into())
    }

    /// Runs one frame. When it returns, the frame's commands have been submitted to the GPU.
    pub fn update(&mut self) {
        self.app.update();
        // Without a window, nothing else polls the device. Polling runs its callbacks, such as the one for a lost
        // device.
        let render = self.app.get_sub_app(RenderApp);
        if let Some(device) = render.and_then(|render| render.world().get_resource::<RenderDevice>()) {
            // Bevy's error handler receives errors as well.
            let _ = device.poll(PollType::Poll);
        }
    }

    /// Runs frames until everything is ready to be drawn: the fields of all [`Prop`]s are on the GPU, all
    /// [`Posterize`]d props and [views](PosterizeView) have their palettes, and all pipelines have their shaders. Until
    /// Bevy has loaded its own shaders, cameras draw nothing.
    ///
    /// Returns an error if a field cannot be loaded or does not fit on the GPU, if a palette cannot be extracted, or if
    /// the scene is not ready after `timeout`.
    pub fn wait_until_ready(&mut self, timeout: Duration) -> Result<(), HeadlessError> {
        let start = Instant::now();
        loop {
            self.update();
            if self.is_ready()? {
                return Ok(());
            }
            if start.elapsed() > timeout {
                return Err(HeadlessError::TimedOut(timeout));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn is_ready(&mut self) -> Result<bool, HeadlessError> {
        let world = self.app.world_mut();
        let mut props = world.query::<(&Prop, Has<Posterize>)>();
        let props: Vec<_> = props.iter(world).map(|(prop, posterized)| (prop.0.clone(), posterized)).collect();
        let mut views = world.query_filtered::<&PosterizeView, With<Posterize>>();
        let views: Vec<_> = views.iter(world).map(|view| view.0.clone()).collect();
        let mut ready = self.pipelines_are_ready();
        for (field, posterized) in props {
            ready &= self.has_field(&field)? && (!posterized || self.has_palette(&field)?);
        }
        for field in views {
            if !self.has_palette(&field)? {
                self.check_load_state(&field)?;
                ready = false;
            }
        }
        Ok(ready)
    }

    fn pipelines_are_ready(&self) -> bool {
        let render = self.app.get_sub_app(RenderApp);
        let cache = render.and_then(|render| render.world().get_resource::<PipelineCache>());
        cache.is_none_or(|cache| cache.waiting_pipelines().next().is_none())
    }

    fn has_pending_levels(&self) -> bool {
        let render = self.app.get_sub_app(RenderApp);
        let fields = render.and_then(|render| render.world().get_resource::<RenderAssets<GpuField>>());
        fields.is_some_and(|fields| fields.iter().any(|(_, field)| field.is_busy()))
    }

    fn check_load_state(&self, field: &Handle<PlenOctree>) -> Result<(), HeadlessError> {
        match self.app.world().resource::<AssetServer>().load_state(field) {
            LoadState::Failed(error) => Err(HeadlessError::Field(error.to_string())),
            _ => Ok(()),
        }
    }

    fn has_field(&self, field: &Handle<PlenOctree>) -> Result<bool, HeadlessError> {
        self.check_load_state(field)?;
        let render = self.app.get_sub_app(RenderApp);
        let fields = render.and_then(|render| render.world().get_resource::<RenderAssets<GpuField>>());
        match fields.and_then(|fields| fields.get(field)?.outcome()) {
            Some(outcome) => outcome.map(|()| true).map_err(|error| HeadlessError::TooLarge(error.clone())),
            None => Ok(false),
        }
    }

    fn has_palette(&self, field: &Handle<PlenOctree>) -> Result<bool, HeadlessError> {
        let world = self.app.world();
        match world.resource::<PaletteExtraction>().error(field) {
            Some(error) => Err(HeadlessError::Palette(error.clone())),
            None => Ok(world.resource::<Palettes>().get(field).is_some()),
        }
    }

    /// Runs one more frame and returns it as an image in encoded sRGB, with the top row first. If the frame requests
    /// levels that are not ready yet, runs frames until they are.
    ///
    /// Returns [`HeadlessError::Readback`] if the frame cannot be read back.
    pub fn capture(&mut self) -> Result<RgbaImage, HeadlessError> {
        self.update();
        while self.has_pending_levels() {
            std::thread::sleep(Duration::from_millis(1));
            self.update();
        }
        readback::read(&self.app, &self.target)
    }
}

fn target_image(size: UVec2) -> Image {
    let size = size.max(UVec2::ONE);
    let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    image
}
