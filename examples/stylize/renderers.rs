//! The two ways to a picture: the plugin on a GPU, and the float64 reference.

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
    FieldPalette, Palette, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Preset, Prop,
    camera::PinholeCamera,
    gpu::GpuField,
    headless::{Headless, exact_camera, pinhole_view},
    picture::{POSTERIZE_SPAN, VOLUME_SPAN},
    reference::{Picture, Posterization, posterize, render},
};
use glam::DVec3;
use image::{DynamicImage, RgbImage};

use crate::{Result, output::Pictures, report::Adapter};

/// What to draw.
pub struct Job {
    pub field: PlenOctree,
    pub palette: Palette,
    /// The palette to recolor with.
    pub recolored: Option<Vec<[f64; 3]>>,
    pub look: Posterize,
    /// For the GPU; the reference is always exact.
    pub quality: Preset,
    /// Encoded sRGB.
    pub background: [u8; 3],
}

/// Milliseconds that a posterized view took; `None` where it could not be measured.
#[derive(Clone, Copy, Default)]
pub struct FrameTimes {
    /// The volume pass.
    pub volume: Option<f64>,
    /// The posterize pass.
    pub posterize: Option<f64>,
    /// The whole frame, until its picture was in memory.
    pub total: Option<f64>,
}

pub trait Render {
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Pictures, FrameTimes)>;
    fn adapter(&self) -> Adapter;
}

/// Longest wait for the field to be on the GPU.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(120);

pub struct GpuRenderer {
    headless: Headless,
    job: Job,
    prop: Entity,
    camera: Entity,
    field: Handle<PlenOctree>,
}

impl GpuRenderer {
    pub fn new(job: Job, size: (u32, u32)) -> Result<Self> {
        let mut headless = Headless::new(size.into(), |app| {
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
        let camera = world.spawn((exact_camera(Color::srgb_u8(r, g, b)), target, job.quality.quality())).id();
        headless.wait_until_ready(UPLOAD_TIMEOUT)?;
        Ok(Self { headless, job, prop, camera, field })
    }

    fn shoot(&mut self) -> Result<RgbImage> {
        Ok(DynamicImage::from(self.headless.picture()?).into_rgb8())
    }

    fn show(&mut self, colors: Option<&[[f64; 3]]>) {
        let mut palettes = self.headless.app.world_mut().resource_mut::<Palettes>();
        if let Some(palette) = palettes.get_mut(&self.field) {
            palette.reset();
            for (index, color) in colors.unwrap_or_default().iter().enumerate() {
                palette.set(index, Color::srgb(color[0] as f32, color[1] as f32, color[2] as f32));
            }
        }
    }

    /// What the last frame since `start` took in the two passes; none where the adapter has no timestamps.
    fn measure(&mut self, start: Instant) -> [Option<f64>; 2] {
        // Measurements arrive this many frames later at most, which draw nothing.
        const FRAMES: usize = 4;
        self.activate(false);
        (0..FRAMES).for_each(|_| self.headless.update());
        self.activate(true);
        let diagnostics = self.headless.app.world().resource::<DiagnosticsStore>();
        [VOLUME_SPAN, POSTERIZE_SPAN].map(|span| {
            let path = DiagnosticPath::new(format!("render/{span}/elapsed_gpu"));
            let measurement = diagnostics.get(&path)?.measurement()?;
            (measurement.time > start).then_some(measurement.value)
        })
    }

    fn activate(&mut self, active: bool) {
        if let Some(mut camera) = self.headless.app.world_mut().get_mut::<Camera>(self.camera) {
            camera.is_active = active;
        }
    }
}

impl Render for GpuRenderer {
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Pictures, FrameTimes)> {
        self.headless.resize(UVec2::new(camera.width, camera.height));
        let view = pinhole_view(camera, self.job.field.up());
        let look = self.job.look;
        let world = self.headless.app.world_mut();
        world.entity_mut(self.camera).insert(view);
        world.entity_mut(self.prop).remove::<Posterize>();
        self.show(None);
        let start = Instant::now();
        let original = self.shoot()?;
        // Its times must not be taken for those of the next.
        self.measure(start);

        self.headless.app.world_mut().entity_mut(self.prop).insert(look);
        let start = Instant::now();
        let posterized = self.shoot()?;
        let total = start.elapsed().as_secs_f64() * 1e3;
        let [volume, posterize] = self.measure(start);
        let times = FrameTimes { volume, posterize, total: Some(total) };

        let recolored = match self.job.recolored.clone() {
            Some(colors) => {
                self.show(Some(&colors));
                Some(self.shoot()?)
            }
            None => None,
        };
        Ok((Pictures { original, posterized, recolored }, times))
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

pub struct ReferenceRenderer {
    job: Job,
}

impl ReferenceRenderer {
    pub fn new(job: Job) -> Self {
        Self { job }
    }
}

impl Render for ReferenceRenderer {
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Pictures, FrameTimes)> {
        let Job { field, palette, recolored, look, background, .. } = &self.job;
        let background = DVec3::from(background.map(|c| f64::from(c) / 255.0));
        let settings = Posterization {
            blend_steps: look.blend_steps,
            softness: look.softness.into(),
            min_opacity: look.min_opacity.into(),
            ..Posterization::default()
        };
        let colors = |colors: &[[f64; 3]]| colors.iter().map(|&color| color.into()).collect::<Vec<DVec3>>();
        let extracted = colors(&palette.colors);

        let start = Instant::now();
        let picture = render(field, camera);
        let volume = start.elapsed();
        let posterized = to_image(&picture, &posterize(&picture, background, &extracted, &extracted, &settings));
        let total = start.elapsed();
        let pictures = Pictures {
            original: to_image(&picture, &picture.over(background)),
            posterized,
            recolored: recolored.as_ref().map(|shown| {
                to_image(&picture, &posterize(&picture, background, &extracted, &colors(shown), &settings))
            }),
        };
        let times = FrameTimes {
            volume: Some(volume.as_secs_f64() * 1e3),
            posterize: Some((total - volume).as_secs_f64() * 1e3),
            total: Some(total.as_secs_f64() * 1e3),
        };
        Ok((pictures, times))
    }

    fn adapter(&self) -> Adapter {
        Adapter { name: "float64 reference".into(), backend: "cpu".into(), driver: env!("CARGO_PKG_VERSION").into() }
    }
}

fn to_image(size: &Picture, colors: &[DVec3]) -> RgbImage {
    RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
        let color = colors[y as usize * size.width + x as usize];
        image::Rgb(color.to_array().map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8))
    })
}
