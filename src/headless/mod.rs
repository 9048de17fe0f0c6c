//! An app without a window: for tests, for pictures from a command line.

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

/// Why a headless app gives no picture.
#[derive(Debug, thiserror::Error)]
pub enum HeadlessError {
    /// There is no GPU, nor a software one.
    #[error("no usable graphics adapter: install a Vulkan driver (Mesa's lavapipe will do): {0}")]
    NoAdapter(String),
    /// The field of a prop or of a posterized view could not be loaded.
    #[error("{0}")]
    Field(String),
    /// The GPU cannot hold the field of a prop.
    #[error(transparent)]
    TooLarge(FieldTooLarge),
    /// A palette could not be extracted.
    #[error(transparent)]
    Palette(ExtractionError),
    /// The scene was not ready in time.
    #[error("the scene was not ready after {0:?}")]
    TimedOut(Duration),
    /// The GPU did not hand the picture over.
    #[error("reading the picture back failed: {0}")]
    Readback(String),
}

/// An app that renders into a picture instead of a window, stepped by hand.
///
/// Everything runs on the calling thread, frame by frame: a call of [`Self::update`] has rendered when it returns. Time
/// runs by the clock on the wall; insert Bevy's `TimeUpdateStrategy::ManualDuration` for pictures that repeat. Waiting and
/// taking a picture run frames too. [`HeadlessPlugins`] says what else an app may need.
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
    /// The app: spawn what you like, read what you need.
    pub app: App,
    target: Handle<Image>,
}

impl Headless {
    /// Builds an app of [`HeadlessPlugins`] and whatever `configure` adds, with a target of `size` pixels.
    pub fn new(size: UVec2, configure: impl FnOnce(&mut App)) -> Result<Self, HeadlessError> {
        Self::build(size, WgpuSettings::default(), configure)
    }

    /// The same on a device that can do no more than `limits`, to see what happens on lesser machines than this.
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

    /// Makes the picture another size from the next frame on.
    pub fn resize(&mut self, size: UVec2) {
        let mut images = self.app.world_mut().resource_mut::<Assets<Image>>();
        if let Some(mut image) = images.get_mut(&self.target)
            && image.size() != size
        {
            *image = target_image(size);
        }
    }

    /// What a camera needs to draw into the picture.
    pub fn target(&self) -> RenderTarget {
        RenderTarget::Image(self.target.clone().into())
    }

    /// Runs one frame, to its end on the GPU's queue.
    pub fn update(&mut self) {
        self.app.update();
        // Nobody else asks whether the GPU has something to say, be it that the device is lost.
        let render = self.app.get_sub_app(RenderApp);
        if let Some(device) = render.and_then(|render| render.world().get_resource::<RenderDevice>()) {
            // An error is told to Bevy's handler too.
            let _ = device.poll(PollType::Poll);
        }
    }

    /// Runs frames until every [`Prop`]'s field is on the GPU, every [`Posterize`]d one and every posterized
    /// [view](PosterizeView) has its palette, and no pipeline waits for its shader: until Bevy has loaded its own, cameras
    /// draw nothing.
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
        let mut ready = self.has_pipelines();
        for (field, posterized) in props {
            ready &= self.has_field(&field)? && (!posterized || self.has_palette(&field)?);
        }
        for field in views {
            if !self.has_palette(&field)? {
                self.check_loads(&field)?;
                ready = false;
            }
        }
        Ok(ready)
    }

    fn has_pipelines(&self) -> bool {
        let render = self.app.get_sub_app(RenderApp);
        let cache = render.and_then(|render| render.world().get_resource::<PipelineCache>());
        cache.is_none_or(|cache| cache.waiting_pipelines().next().is_none())
    }

    fn makes_levels(&self) -> bool {
        let render = self.app.get_sub_app(RenderApp);
        let fields = render.and_then(|render| render.world().get_resource::<RenderAssets<GpuField>>());
        fields.is_some_and(|fields| fields.iter().any(|(_, field)| field.is_busy()))
    }

    fn check_loads(&self, field: &Handle<PlenOctree>) -> Result<(), HeadlessError> {
        match self.app.world().resource::<AssetServer>().load_state(field) {
            LoadState::Failed(error) => Err(HeadlessError::Field(error.to_string())),
            _ => Ok(()),
        }
    }

    fn has_field(&self, field: &Handle<PlenOctree>) -> Result<bool, HeadlessError> {
        self.check_loads(field)?;
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

    /// Runs one more frame and returns the picture, rows from the top, encoded sRGB. Where it asks for a level of detail that is
    /// not made yet, frames run until it is.
    pub fn capture(&mut self) -> Result<RgbaImage, HeadlessError> {
        self.update();
        while self.makes_levels() {
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
