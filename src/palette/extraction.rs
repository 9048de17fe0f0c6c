//! Palette extraction while the app keeps running.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    render::renderer::RenderAdapterInfo,
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};
use plenoctree::{
    PlenOctree,
    palette::{Extraction, ExtractionError, ExtractionSettings, extract_from_histograms},
    sampling::{Histograms, Progress, sample},
};
use wgpu::DeviceType;

use super::{
    posterized::Posterized,
    resource::{FieldPalette, Palettes},
};
use crate::sampling::{SamplingFailure, SamplingJob, SamplingJobs};

/// The processor that samples the radiance of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[type_path = "bevy_plenoctree"]
pub enum PaletteSampler {
    /// Uses the GPU, or the CPU if the GPU is emulated in software, on the same CPU cores. This is the default.
    #[default]
    Auto,
    /// Uses compute shaders in the render world. Falls back to the CPU if they cannot sample the field.
    Gpu,
    /// Uses all CPU cores, in a background task.
    Cpu,
}

/// The samples that a palette was extracted from.
#[derive(Clone, Debug)]
pub struct ExtractionSamples {
    /// The histograms of all radiance samples, weighted by visibility.
    pub histograms: Arc<Histograms>,
    /// Whether the samples were taken on the GPU. If not, they were taken on the CPU.
    pub on_gpu: bool,
}

/// Configures palette extraction and reports its progress.
///
/// If the field of a posterized prop or view has no palette, and there is no file to load one from, one is extracted
/// while the app keeps running. The field is sampled on the GPU, a few slices per frame, or on the CPU, in a background
/// task. The palette is then found in a background task.
#[derive(Resource, Reflect)]
#[reflect(Resource, Default)]
#[type_path = "bevy_plenoctree"]
pub struct PaletteExtraction {
    /// The settings of extractions. Extractions that are already running keep theirs.
    ///
    /// Defaults to those of the paper, with all leaves and 6 colors.
    pub settings: ExtractionSettings,
    /// The processor that samples fields.
    ///
    /// Defaults to [`PaletteSampler::Auto`].
    pub sampler: PaletteSampler,
    /// The GPU time per frame that sampling may take. With `None`, a field is sampled in a single frame, which is meant
    /// for apps without a window.
    ///
    /// Defaults to 4 ms.
    pub budget: Option<Duration>,
    #[reflect(ignore)]
    requested: HashSet<AssetId<PlenOctree>>,
    #[reflect(ignore)]
    running: HashMap<AssetId<PlenOctree>, Running>,
    #[reflect(ignore)]
    failed: HashMap<AssetId<PlenOctree>, ExtractionError>,
    #[reflect(ignore)]
    sampled: HashMap<AssetId<PlenOctree>, ExtractionSamples>,
}

impl Default for PaletteExtraction {
    fn default() -> Self {
        Self {
            settings: ExtractionSettings::default(),
            sampler: PaletteSampler::default(),
            budget: Some(Duration::from_millis(4)),
            requested: HashSet::new(),
            running: HashMap::new(),
            failed: HashMap::new(),
            sampled: HashMap::new(),
        }
    }
}

struct Running {
    /// Whether the result replaces a palette that the field already has.
    replaces: bool,
    progress: Arc<Progress>,
    stage: Stage,
}

enum Stage {
    /// A task prepares the job for the render world. Stores when it started.
    Planning(Task<SamplingJob>, Instant),
    /// The render world is sampling. Stores when planning started.
    Sampling(Arc<SamplingJob>, Instant),
    /// A task computes the palette from the histograms, after sampling the field itself if the CPU samples.
    Computing(Task<Result<(Extraction, ExtractionSamples), ExtractionError>>),
}

impl PaletteExtraction {
    /// Returns the progress of a field's extraction, from 0 to 1, or `None` if none is running.
    pub fn progress(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<f32> {
        self.running.get(&field.into()).map(|running| running.progress.fraction())
    }

    /// Returns why a field's last extraction failed, or `None` if it did not.
    pub fn error(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionError> {
        self.failed.get(&field.into())
    }

    /// Returns the samples of a field's last successful extraction, or `None` if there was none.
    pub fn sampled(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionSamples> {
        self.sampled.get(&field.into())
    }

    /// Extracts a field's palette again, with the current settings. Cancels an extraction that is already running.
    ///
    /// The field keeps its palette until the new one is ready. The new one then replaces it, including edited colors,
    /// even if the palette was loaded or inserted.
    pub fn restart(&mut self, field: impl Into<AssetId<PlenOctree>>) {
        let id = field.into();
        self.cancel(id);
        self.requested.insert(id);
    }

    fn cancel(&mut self, id: AssetId<PlenOctree>) {
        self.failed.remove(&id);
        if let Some(running) = self.running.remove(&id) {
            running.progress.cancel();
        }
    }
}

/// Drops the results of fields that were changed or removed.
pub(super) fn forget(
    mut events: MessageReader<AssetEvent<PlenOctree>>,
    mut extraction: ResMut<PaletteExtraction>,
    mut palettes: ResMut<Palettes>,
) {
    for event in events.read() {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else {
            continue;
        };
        extraction.cancel(*id);
        extraction.sampled.remove(id);
        let removed = matches!(event, AssetEvent::Removed { .. });
        if removed {
            extraction.requested.remove(id);
        }
        // A palette that was loaded or inserted survives a hot reload of the field.
        if palettes.get(*id).is_some_and(|palette| removed || palette.extraction().is_some()) {
            palettes.remove(*id);
        }
    }
}

/// Starts extractions for the fields that need a palette, and those that were requested.
pub(super) fn start(
    mut extraction: ResMut<PaletteExtraction>,
    palettes: Res<Palettes>,
    fields: Res<Assets<PlenOctree>>,
    adapter: Option<Res<RenderAdapterInfo>>,
    posterized: Posterized,
) {
    let missing = posterized.fields().filter(|id| {
        palettes.lacks(*id) && !extraction.failed.contains_key(id) && !extraction.running.contains_key(id)
    });
    let ids: HashSet<_> = extraction.requested.iter().copied().chain(missing).collect();
    let on_gpu = adapter.is_some_and(|adapter| match extraction.sampler {
        PaletteSampler::Auto => adapter.device_type != DeviceType::Cpu,
        PaletteSampler::Gpu => true,
        PaletteSampler::Cpu => false,
    });
    for id in ids {
        let Some(field) = fields.get(id) else {
            continue;
        };
        let progress = Arc::new(Progress::default());
        let settings = extraction.settings.clone();
        let stage = match settings.validate() {
            Ok(()) if on_gpu => {
                let (field, budget, progress) = (field.clone(), extraction.budget, progress.clone());
                let plan = async move { SamplingJob::new(id, field, settings, budget, progress) };
                Stage::Planning(AsyncComputeTaskPool::get().spawn(plan), Instant::now())
            }
            _ => sample_on_cpu(field.clone(), settings, progress.clone()),
        };
        let replaces = extraction.requested.remove(&id);
        extraction.running.insert(id, Running { replaces, progress, stage });
    }
}

fn sample_on_cpu(field: PlenOctree, settings: ExtractionSettings, progress: Arc<Progress>) -> Stage {
    Stage::Computing(AsyncComputeTaskPool::get().spawn(async move {
        let start = Instant::now();
        let histograms = sample(&field, &settings.sampling, &progress)?;
        extract(histograms, false, start.elapsed(), &settings)
    }))
}

fn extract(
    histograms: Histograms,
    on_gpu: bool,
    sampling: Duration,
    settings: &ExtractionSettings,
) -> Result<(Extraction, ExtractionSamples), ExtractionError> {
    let mut extraction = extract_from_histograms(&histograms, settings)?;
    extraction.seconds.sampling = sampling.as_secs_f64();
    Ok((extraction, ExtractionSamples { histograms: Arc::new(histograms), on_gpu }))
}

/// Advances running extractions and inserts the palettes of those that have finished.
pub(super) fn finish(
    mut extraction: ResMut<PaletteExtraction>,
    mut jobs: ResMut<SamplingJobs>,
    mut palettes: ResMut<Palettes>,
) {
    if jobs.0.iter().any(|job| !job.is_open()) {
        jobs.0.retain(|job| job.is_open());
    }
    if extraction.running.is_empty() {
        return;
    }
    let PaletteExtraction { running, failed, sampled, .. } = &mut *extraction;
    running.retain(|id, running| {
        let task = match &mut running.stage {
            Stage::Computing(task) => task,
            Stage::Planning(task, start) => {
                if let Some(job) = block_on(poll_once(task)).map(Arc::new) {
                    jobs.0.push(job.clone());
                    running.stage = Stage::Sampling(job, *start);
                }
                return true;
            }
            Stage::Sampling(job, start) => {
                if let Some(outcome) = job.take_outcome() {
                    running.stage = after_sampling(job, outcome, start.elapsed());
                }
                return true;
            }
        };
        let Some(result) = block_on(poll_once(task)) else {
            return true;
        };
        match result {
            // The field has been given another palette in the meantime, or one is loading.
            Ok(_) if !running.replaces && !palettes.lacks(*id) => {}
            Ok((extraction, samples)) => {
                palettes.arrive(*id, FieldPalette::from_extraction(extraction));
                sampled.insert(*id, samples);
            }
            Err(error) => {
                error!("failed to extract the palette of field {id}: {error}");
                failed.insert(*id, error);
            }
        }
        false
    });
}

fn after_sampling(job: &SamplingJob, outcome: Result<Histograms, SamplingFailure>, sampling: Duration) -> Stage {
    let settings = job.settings.clone();
    match outcome {
        Ok(histograms) => Stage::Computing(
            AsyncComputeTaskPool::get().spawn(async move { extract(histograms, true, sampling, &settings) }),
        ),
        Err(failure) => {
            warn!("sampling field {} on the CPU instead of the GPU: {failure}", job.id);
            sample_on_cpu(job.field.clone(), settings, job.progress.clone())
        }
    }
}
