//! An app without a window that captures frames, for tests and tools. Requires the feature `headless`.

mod camera;
mod error;
mod plugins;
#[cfg(feature = "picking")]
mod pointer;
mod readback;
mod waiting;

pub use camera::{exact_camera, pinhole_view};
pub use error::HeadlessError;
pub use plugins::HeadlessPlugins;
#[cfg(feature = "headless-lit")]
pub use plugins::LitMeshPlugins;

use std::{
    collections::HashSet,
    path::Path,
    time::{Duration, Instant},
};

use bevy::{
    app::{AppLabel, PluginGroupBuilder},
    asset::handle_internal_asset_events,
    camera::RenderTarget,
    prelude::*,
    render::{
        RenderApp,
        error_handler::RenderErrorHandler,
        render_resource::{PipelineCache, PollType, TextureFormat, TextureUsages},
        renderer::RenderDevice,
        settings::WgpuSettings,
    },
    time::TimeReceiver,
};
use image::RgbaImage;

use crate::{gpu::UploadBudget, prop::PropError};

/// An app without a window that renders to an image: update it until the assets are ready, then capture a frame.
///
/// Frames run only when you ask for them: [`update`](Self::update),
/// [`update_without_drawing`](Self::update_without_drawing) and [`capture`](Self::capture) run one each, and
/// [`wait_until_ready`](Self::wait_until_ready) as many as it takes. All run on the calling thread and return after
/// rendering. Time follows the wall clock; insert Bevy's `TimeUpdateStrategy::ManualDuration` for reproducible frames.
/// The app has the plugins of [`HeadlessPlugins`]; add `LitMeshPlugins` (feature
/// `headless-lit`) for lit meshes.
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
/// let field = world.resource::<AssetServer>().load("drum.plenoctree");
/// world.spawn((Prop(field), Posterize::default()));
/// world.spawn((Camera3d::default(), target, Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y)));
/// headless.wait_until_ready(std::time::Duration::from_secs(60))?;
/// headless.capture()?.save("drum.png")?;
/// # Ok(()) }
/// ```
pub struct Headless {
    /// The app. Use its world to spawn entities and to read results.
    pub app: App,
    /// The longest time that [`capture`](Self::capture) waits until its frame is complete.
    ///
    /// Defaults to two minutes.
    pub time_limit: Duration,
    target: Handle<Image>,
    /// Where the mouse pointer was last.
    #[cfg(feature = "picking")]
    pointer: Option<Vec2>,
}

impl Headless {
    /// Creates an app with [`HeadlessPlugins`] and everything that `configure` adds. Its target is an image of `size`
    /// pixels.
    ///
    /// When it returns, no frame and no schedule has run: [`Startup`] runs with the first frame.
    ///
    /// Returns [`HeadlessError::NoAdapter`] if there is no graphics adapter.
    pub fn new(size: UVec2, configure: impl FnOnce(&mut App)) -> Result<Self, HeadlessError> {
        Self::build(size, HeadlessPlugins.build(), configure)
    }

    /// Creates an app like [`new`](Self::new) that loads its assets from `folder`, relative to the current directory.
    /// Tools use it to open files anywhere. Its path must be UTF-8.
    ///
    /// Returns [`HeadlessError::NoAdapter`] if there is no graphics adapter.
    pub fn with_assets(size: UVec2, folder: &Path, configure: impl FnOnce(&mut App)) -> Result<Self, HeadlessError> {
        // Bevy looks for relative paths in the folder of the project or of the program.
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
        let assets = AssetPlugin { file_path: folder.to_string_lossy().into(), ..default() };
        Self::build(size, HeadlessPlugins.set(assets), configure)
    }

    /// Creates an app like [`new`](Self::new), on a device that is restricted to `limits` and has no optional features.
    /// Use it to test how an app behaves on less capable machines, and in browsers.
    ///
    /// Returns [`HeadlessError::NoAdapter`] if there is no graphics adapter.
    pub fn with_limits(
        size: UVec2,
        limits: wgpu::Limits,
        configure: impl FnOnce(&mut App),
    ) -> Result<Self, HeadlessError> {
        let settings = WgpuSettings {
            features: wgpu::Features::empty(),
            constrained_limits: Some(limits),
            disabled_features: Some(wgpu::Features::all()),
            ..default()
        };
        Self::build(size, HeadlessPlugins.set(plugins::render_plugin(settings)), configure)
    }

    fn build(
        size: UVec2,
        plugins: PluginGroupBuilder,
        configure: impl FnOnce(&mut App),
    ) -> Result<Self, HeadlessError> {
        plugins::check_adapter().map_err(HeadlessError::NoAdapter)?;
        let mut app = App::new();
        app.add_plugins(plugins);
        // Nobody watches the frames.
        app.insert_resource(UploadBudget(None));
        app.insert_resource(RenderErrorHandler(error::keep_failure));
        configure(&mut app);
        app.finish();
        app.cleanup();
        #[cfg(feature = "headless-lit")]
        plugins::light_every_frame(&mut app);
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(target_image(size));
        Ok(Self {
            app,
            time_limit: Duration::from_secs(120),
            target,
            #[cfg(feature = "picking")]
            pointer: None,
        })
    }

    /// Resizes the target to `size` pixels, starting with the next frame. A size of 0 counts as 1. The viewports of
    /// cameras must fit in it: otherwise, wgpu reports an error, and rendering ends.
    pub fn resize(&mut self, size: UVec2) {
        let world = self.app.world_mut();
        let mut images = world.resource_mut::<Assets<Image>>();
        if images.get(&self.target).is_some_and(|image| image.size() != size) {
            _ = images.insert(&self.target, target_image(size));
            // Cameras would hear of it a frame later.
            world.write_message(AssetEvent::Modified { id: self.target.id() });
        }
    }

    /// Returns the render target. Add it to a camera to make it draw to the captured image.
    pub fn target(&self) -> RenderTarget {
        RenderTarget::Image(self.target.clone().into())
    }

    /// Runs one frame. When it returns, the frame's commands have been submitted to the GPU.
    pub fn update(&mut self) {
        self.app.update();
        self.poll();
    }

    /// Runs one frame in which no camera draws. The app's systems cannot tell the difference. On a GPU that is emulated
    /// in software, it takes far less time than one that is drawn.
    pub fn update_without_drawing(&mut self) {
        let apps = self.app.sub_apps_mut();
        apps.main.run_default_schedule();
        let world = apps.main.world_mut();
        let mut cameras = world.query::<(Entity, &mut Camera)>();
        let active = cameras.iter_mut(world).filter(|(_, camera)| camera.is_active).map(|(entity, mut camera)| {
            camera.bypass_change_detection().is_active = false;
            entity
        });
        let active: Vec<_> = active.collect();
        for app in apps.sub_apps.values_mut() {
            app.extract(world);
            app.update();
        }
        for entity in active {
            if let Ok((_, mut camera)) = cameras.get_mut(world, entity) {
                camera.bypass_change_detection().is_active = true;
            }
        }
        world.clear_trackers();
        self.poll();
    }

    /// Runs frames until everything is ready to be drawn: all [`Prop`](crate::Prop)s are [`Ready`](crate::PropState),
    /// all [posterized views](crate::PosterizeView) have their palettes, and all pipelines have their shaders.
    ///
    /// Cameras draw only once all fields and palettes have arrived, and then at least one frame: a GPU that is emulated
    /// in software takes long to draw frames that nobody sees.
    ///
    /// Returns an error if a prop, a palette, a pipeline or rendering has failed, or if the scene is not ready after
    /// `timeout`; it says what was not.
    pub fn wait_until_ready(&mut self, timeout: Duration) -> Result<(), HeadlessError> {
        let start = Instant::now();
        let (mut failures, mut is_drawn) = (0, false);
        loop {
            if is_drawn {
                self.update();
            } else {
                self.update_without_drawing();
            }
            match waiting::for_data(&mut self.app) {
                Ok(None) if is_drawn => match waiting::for_drawing(&mut self.app)? {
                    Some(waiting_for) => pause(start, timeout, waiting_for)?,
                    None => return Ok(()),
                },
                Ok(waiting_for) => {
                    is_drawn = waiting_for.is_none();
                    waiting_for.map_or(Ok(()), |waiting_for| pause(start, timeout, waiting_for))?;
                }
                // The render world reports two frames later that a field that was too large has been replaced.
                Err(HeadlessError::Prop(PropError::TooLarge(_))) if failures < 2 => failures += 1,
                Err(error) => return Err(error),
            }
        }
    }

    /// Runs one frame and returns it as an image in encoded sRGB, with the top row first.
    ///
    /// If pipelines, levels, or loaded fields have not arrived on the GPU yet, waits for them and renders the frame
    /// again. No system of the main world runs in the meantime, so the frame is still the next one. Does not wait for
    /// fields and palettes that are being loaded: call [`wait_until_ready`](Self::wait_until_ready) first.
    ///
    /// Returns an error if a pipeline has failed, if the GPU reported an error in an earlier frame, if the frame is not
    /// complete after [`time_limit`](Self::time_limit), or if it cannot be read back.
    pub fn capture(&mut self) -> Result<RgbaImage, HeadlessError> {
        let start = Instant::now();
        self.update();
        let mut shaders: HashSet<_> = self.app.world().resource::<Assets<Shader>>().ids().collect();
        while let Some(waiting_for) = waiting::for_frame(&self.app)? {
            pause(start, self.time_limit, waiting_for)?;
            if !waiting::rests(&self.app) {
                self.redraw(&mut shaders);
            }
        }
        readback::read(&self.app, &self.target, self.time_limit)
    }

    /// Renders the last frame again. `shaders` are those that the renderer already has.
    fn redraw(&mut self, shaders: &mut HashSet<AssetId<Shader>>) {
        let apps = self.app.sub_apps_mut();
        let (world, Some(render)) = (apps.main.world_mut(), apps.sub_apps.get_mut(&RenderApp.intern())) else {
            return;
        };
        // Systems in the main world would receive the shaders that Bevy loads, and the time of the last rendering.
        handle_internal_asset_events(world);
        if let Some(mut cache) = render.world_mut().get_resource_mut::<PipelineCache>() {
            for (id, shader) in world.resource::<Assets<Shader>>().iter().filter(|(id, _)| shaders.insert(*id)) {
                cache.set_shader(id, shader.clone());
            }
        }
        if let Some(time) = world.get_resource::<TimeReceiver>() {
            while time.0.try_recv().is_ok() {}
        }
        render.extract(world);
        render.update();
        self.poll();
    }

    /// Without a window, nothing else polls the device. Polling runs its callbacks, such as the one for a lost device.
    fn poll(&self) {
        let render = self.app.get_sub_app(RenderApp);
        if let Some(device) = render.and_then(|render| render.world().get_resource::<RenderDevice>()) {
            // Bevy's error handler receives errors as well.
            let _ = device.poll(PollType::Poll);
        }
    }
}

/// How long an app waits for what is made in the background before it asks again.
const PAUSE: Duration = Duration::from_millis(5);

/// Waits a moment. Fails if the time limit is exceeded.
fn pause(start: Instant, limit: Duration, waiting_for: String) -> Result<(), HeadlessError> {
    if start.elapsed() > limit {
        return Err(HeadlessError::TimedOut { limit, waiting_for });
    }
    std::thread::sleep(PAUSE);
    Ok(())
}

fn target_image(size: UVec2) -> Image {
    let size = size.max(UVec2::ONE);
    let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    image
}
