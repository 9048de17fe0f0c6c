//! Renders with the plugin.

use std::time::{Duration, Instant};

use bevy::{
    camera::visibility::NoFrustumCulling,
    diagnostic::{DiagnosticPath, DiagnosticsStore},
    prelude::*,
    render::{
        RenderApp,
        diagnostic::RenderDiagnosticsPlugin,
        renderer::{RenderAdapterInfo, RenderDevice},
    },
};
use bevy_plenoctree::{
    BilateralFilter, BorderSmoothing, EdgeSmoothing, FieldPalette, GpuField, Ink, MAX_FILTER_RADIUS, POSTERIZE_SPANS,
    Palettes, PlenOctreePlugin, Posterize, Prop, PropQuality, VOLUME_SPANS,
    headless::{Headless, exact_camera, pinhole_view},
};
use glam::DVec3;
use image::{DynamicImage, RgbImage, RgbaImage};
use plenoctree::{PlenOctree, UpAxis, camera::PinholeCamera, reference::Posterization};

use super::interface::{Adapter, FrameTimes, Look, PosterizeSettings, Render, Scene};
use crate::{preset::Preset, result::Result};

/// How long to wait until the field is on the GPU.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(120);

/// Renders with a headless app.
pub struct GpuRenderer {
    headless: Headless,
    up: UpAxis,
    /// What is at the origin of the scene, in the field's frame: Bevy's positions are float32.
    center: DVec3,
    prop: Entity,
    camera: Entity,
    field: Handle<PlenOctree>,
    ink_width: f32,
}

/// The width of ink, relative to the largest side of the field.
const INK_WIDTH: f64 = 0.006;

impl GpuRenderer {
    /// Starts the app and uploads the field. `cameras` are those to render later.
    pub fn new(scene: Scene, cameras: &[PinholeCamera]) -> Result<Self> {
        let largest = cameras.iter().fold(UVec2::ONE, |size, camera| size.max(UVec2::new(camera.width, camera.height)));
        let mut headless = Headless::new(largest, |app| {
            app.add_plugins((PlenOctreePlugin, RenderDiagnosticsPlugin));
        })?;
        let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
        GpuField::check(&scene.field, &device.limits())?;

        let target = headless.target();
        let world = headless.app.world_mut();
        let up = scene.field.up();
        let bounds = scene.field.dense_bounds();
        let side = bounds.map(|(low, high)| (high - low).max_element());
        let ink_width = side.map_or(Ink::default().width, |side| (INK_WIDTH * side) as f32);
        let center = bounds.map_or(DVec3::ZERO, |(low, high)| (0.5 * low + 0.5 * high).as_vec3().as_dvec3());
        let place = Transform::from_translation((up.to_y_up() * -center).as_vec3());
        let field = world.resource_mut::<Assets<PlenOctree>>().add(scene.field);
        let [r, g, b] = scene.background;
        let prop = world.spawn((Prop(field.clone()), place, NoFrustumCulling)).id();
        // The background is transparent, so that the alpha of a frame as trained is the field's opacity.
        let background = Color::srgb_u8(r, g, b).with_alpha(0.0);
        let camera = world.spawn((exact_camera(background), target, quality(scene.quality))).id();
        headless.wait_until_ready(UPLOAD_TIMEOUT)?;
        Ok(Self { headless, up, center, prop, camera, field, ink_width })
    }

    /// Aims the camera.
    fn view(&mut self, camera: &PinholeCamera) {
        self.headless.resize(UVec2::new(camera.width, camera.height));
        let camera = PinholeCamera { position: camera.position - self.center, ..*camera };
        let view = pinhole_view(&camera, self.up);
        self.headless.app.world_mut().entity_mut(self.camera).insert(view);
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
    fn original(&mut self, camera: &PinholeCamera) -> Result<RgbaImage> {
        self.view(camera);
        self.headless.app.world_mut().entity_mut(self.prop).remove::<Posterize>();
        let start = Instant::now();
        let image = self.headless.capture()?;
        // Discard its times, so that they are not mistaken for those of the next frame.
        self.measure(start);
        Ok(image)
    }

    fn posterized(&mut self, camera: &PinholeCamera, look: &Look) -> Result<(RgbImage, FrameTimes)> {
        self.view(camera);
        let mut palette = FieldPalette::new(look.palette.clone());
        for (shown, color) in palette.shown_mut().iter_mut().zip(look.shown) {
            *shown = Color::srgb(color[0] as f32, color[1] as f32, color[2] as f32);
        }
        let world = self.headless.app.world_mut();
        world.resource_mut::<Palettes>().insert(&self.field, palette);
        let mut prop = world.entity_mut(self.prop);
        prop.insert(posterize(look.settings));
        if look.settings.ink {
            prop.insert(Ink { width: self.ink_width, ..default() });
        } else {
            prop.remove::<Ink>();
        }
        let start = Instant::now();
        let image = DynamicImage::from(self.headless.capture()?).into_rgb8();
        let total = start.elapsed().as_secs_f64() * 1e3;
        let [volume, posterize] = self.measure(start);
        Ok((image, FrameTimes { volume, posterize, total: Some(total) }))
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
    let Posterization { blend_steps, softness, min_opacity, .. } = settings.posterization;
    let Posterization { iterations, radius, taps, spatial_sigma, range_sigma, .. } = settings.posterization;
    Posterize {
        blend_steps,
        softness: softness as f32,
        min_opacity: min_opacity as f32,
        filter: BilateralFilter {
            iterations,
            radius,
            taps: taps.min(MAX_FILTER_RADIUS),
            spatial_sigma: spatial_sigma as f32,
            range_sigma: range_sigma as f32,
        },
        edges: if settings.smooth_edges { EdgeSmoothing::Coverage } else { EdgeSmoothing::Off },
        borders: if settings.smooth_edges { BorderSmoothing::Interpolated } else { BorderSmoothing::Off },
        ..Posterize::default()
    }
}

fn quality(preset: Preset) -> PropQuality {
    match preset {
        Preset::Exact => PropQuality::EXACT,
        Preset::High => PropQuality::HIGH,
        Preset::Balanced => PropQuality::BALANCED,
        Preset::Fast => PropQuality::FAST,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::toon;

    #[test]
    fn filters_are_those_of_the_plugin() {
        let of = |posterization| posterize(PosterizeSettings { posterization, ..default() }).filter;
        assert_eq!(of(toon()), Posterize::toon().filter);
        assert_eq!(of(Posterization::default()), Posterize::paper().filter);
    }
}
