//! Renders with the plugin.

use std::time::{Duration, Instant};

use bevy::{
    diagnostic::{DiagnosticPath, DiagnosticsStore},
    prelude::*,
    render::{
        RenderApp,
        diagnostic::RenderDiagnosticsPlugin,
        renderer::{RenderAdapterInfo, RenderDevice},
    },
};
use bevy_plenoctree::{
    FieldPalette, GpuField, POSTERIZE_SPANS, Palettes, PlenOctreePlugin, Posterize, Prop, PropQuality, QualityPreset,
    VOLUME_SPANS,
    headless::{Headless, exact_camera, pinhole_view},
};
use image::{DynamicImage, RgbImage};
use plenoctree::{PlenOctree, camera::PinholeCamera};

use super::renderer::{Adapter, FrameTimes, Job, PosterizeSettings, Render, Views};
use crate::{Result, preset::Preset};

/// How long to wait until the field is on the GPU.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(120);

/// Renders with a headless app.
pub struct GpuRenderer {
    headless: Headless,
    job: Job,
    prop: Entity,
    camera: Entity,
    field: Handle<PlenOctree>,
}

impl GpuRenderer {
    /// Starts the app and uploads the field. `cameras` are those to render later.
    pub fn new(job: Job, cameras: &[PinholeCamera]) -> Result<Self> {
        let largest = cameras.iter().fold(UVec2::ONE, |size, camera| size.max(UVec2::new(camera.width, camera.height)));
        let mut headless = Headless::new(largest, |app| {
            app.add_plugins((PlenOctreePlugin, RenderDiagnosticsPlugin));
        })?;
        let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
        GpuField::check(&job.field, &device.limits())?;

        let target = headless.target();
        let world = headless.app.world_mut();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(job.field.clone());
        world.resource_mut::<Palettes>().insert(&field, FieldPalette::new(job.palette.clone()));
        let [r, g, b] = job.background;
        let prop = world.spawn(Prop(field.clone())).id();
        let camera = world.spawn((exact_camera(Color::srgb_u8(r, g, b)), target, quality(job.quality))).id();
        headless.wait_until_ready(UPLOAD_TIMEOUT)?;
        Ok(Self { headless, job, prop, camera, field })
    }

    fn capture(&mut self) -> Result<RgbImage> {
        Ok(DynamicImage::from(self.headless.capture()?).into_rgb8())
    }

    /// Shows these colors, or the source colors.
    fn show(&mut self, colors: Option<&[[f64; 3]]>) {
        let mut palettes = self.headless.app.world_mut().resource_mut::<Palettes>();
        if let Some(palette) = palettes.get_mut(&self.field) {
            palette.reset();
            for (index, color) in colors.unwrap_or_default().iter().enumerate() {
                palette.set(index, Color::srgb(color[0] as f32, color[1] as f32, color[2] as f32));
            }
        }
    }

    /// Returns the milliseconds that the volume and the posterize passes of the last frame since `start` took, or
    /// `None` if the adapter has no timestamps.
    fn measure(&mut self, start: Instant) -> [Option<f64>; 2] {
        // Measurements arrive at most this many frames later. Those frames draw nothing.
        const FRAMES: usize = 4;
        self.activate(false);
        (0..FRAMES).for_each(|_| self.headless.update());
        self.activate(true);
        let diagnostics = self.headless.app.world().resource::<DiagnosticsStore>();
        [VOLUME_SPANS, POSTERIZE_SPANS].map(|spans| elapsed(diagnostics, spans, start))
    }

    fn activate(&mut self, active: bool) {
        if let Some(mut camera) = self.headless.app.world_mut().get_mut::<Camera>(self.camera) {
            camera.is_active = active;
        }
    }
}

impl Render for GpuRenderer {
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Views, FrameTimes)> {
        self.headless.resize(UVec2::new(camera.width, camera.height));
        let view = pinhole_view(camera, self.job.field.up());
        let posterize = posterize(self.job.posterize);
        let world = self.headless.app.world_mut();
        world.entity_mut(self.camera).insert(view);
        world.entity_mut(self.prop).remove::<Posterize>();
        self.show(None);
        let start = Instant::now();
        let original = self.capture()?;
        // Discard its times, so that they are not mistaken for those of the next frame.
        self.measure(start);

        self.headless.app.world_mut().entity_mut(self.prop).insert(posterize);
        let start = Instant::now();
        let posterized = self.capture()?;
        let total = start.elapsed().as_secs_f64() * 1e3;
        let [volume, posterize] = self.measure(start);
        let times = FrameTimes { volume, posterize, total: Some(total) };

        let recolored = match self.job.recolored.clone() {
            Some(colors) => {
                self.show(Some(&colors));
                Some(self.capture()?)
            }
            None => None,
        };
        Ok((Views { original, posterized, recolored }, times))
    }

    fn adapter(&self) -> Adapter {
        let info = &self.headless.app.sub_app(RenderApp).world().resource::<RenderAdapterInfo>().0;
        Adapter {
            name: info.name.clone(),
            backend: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info),
        }
    }
}

/// Returns the total time of these spans since `start`, in milliseconds, or `None` if none of them ran.
fn elapsed(diagnostics: &DiagnosticsStore, spans: &[&str], start: Instant) -> Option<f64> {
    let measured = spans.iter().filter_map(|span| {
        let path = DiagnosticPath::new(format!("render/{span}/elapsed_gpu"));
        let measurement = diagnostics.get(&path)?.measurement()?;
        (measurement.time > start).then_some(measurement.value)
    });
    measured.reduce(|sum, time| sum + time)
}

fn posterize(settings: PosterizeSettings) -> Posterize {
    Posterize {
        blend_steps: settings.blend_steps,
        softness: settings.softness,
        min_opacity: settings.min_opacity,
        ..Posterize::default()
    }
}

fn quality(preset: Preset) -> PropQuality {
    let preset = match preset {
        Preset::Exact => QualityPreset::Exact,
        Preset::High => QualityPreset::High,
        Preset::Balanced => QualityPreset::Balanced,
        Preset::Fast => QualityPreset::Fast,
    };
    preset.quality()
}
