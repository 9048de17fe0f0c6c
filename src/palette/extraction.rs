//! Extraction beside the running app.

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

/// What samples the radiance of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[type_path = "bevy_plenoctree"]
pub enum PaletteSampler {
    /// The GPU if it is one, the CPU where graphics are in software: there the same cores would do both.
    #[default]
    Auto,
    /// Compute shaders in the render world; the CPU if they cannot.
    Gpu,
    /// All cores, in a task.
    Cpu,
}

/// What was sampled for a palette that was extracted.
#[derive(Clone, Debug)]
pub struct ExtractionSamples {
    /// The visible weight of all radiance samples.
    pub histograms: Arc<Histograms>,
    /// Whether the GPU sampled, or the CPU.
    pub on_gpu: bool,
}

/// The palettes that are being extracted, and how.
///
/// A field of a posterized prop or view that has no palette gets one while the app keeps running. The GPU samples it in
/// slices, some every frame, or the CPU does in a task; k-means and hull follow in a task.
#[derive(Resource, Reflect)]
#[reflect(Resource, Default)]
#[type_path = "bevy_plenoctree"]
pub struct PaletteExtraction {
    /// Settings of the extractions that start from now on.
    pub settings: ExtractionSettings,
    /// What samples.
    pub sampler: PaletteSampler,
    /// GPU time that sampling may take of a frame; `None` takes all it needs in one, for apps without a window. 4 ms by
    /// default.
    pub budget: Option<Duration>,
    #[reflect(ignore)]
    wanted: HashSet<AssetId<PlenOctree>>,
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
            wanted: HashSet::new(),
            running: HashMap::new(),
            failed: HashMap::new(),
            sampled: HashMap::new(),
        }
    }
}

struct Running {
    /// Whether a palette that the field was given in the meantime is to be replaced.
    replaces: bool,
    progress: Arc<Progress>,
    stage: Stage,
}

enum Stage {
    /// A task works out what the render world needs to know.
    Planning(Task<SamplingJob>, Instant),
    /// The render world samples, since then.
    Sampling(Arc<SamplingJob>, Instant),
    /// A task does the rest, or everything.
    Computing(Task<Result<(Extraction, ExtractionSamples), ExtractionError>>),
}

impl PaletteExtraction {
    /// How far the extraction of a field's palette is, 0 to 1; `None` if there is none under way.
    pub fn progress(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<f32> {
        self.running.get(&field.into()).map(|running| running.progress.fraction())
    }

    /// Why a field's palette could not be extracted.
    pub fn error(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionError> {
        self.failed.get(&field.into())
    }

    /// What a field's last extraction sampled.
    pub fn sampled(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionSamples> {
        self.sampled.get(&field.into())
    }

    /// Extracts a field's palette anew, with the settings as they are now; one that is under way is given up.
    ///
    /// The palette that the field has stays until the new one is there, and is then replaced: changed colors and a
    /// palette that was given as well.
    pub fn restart(&mut self, field: impl Into<AssetId<PlenOctree>>) {
        let id = field.into();
        self.give_up(id);
        self.wanted.insert(id);
    }

    fn give_up(&mut self, id: AssetId<PlenOctree>) {
        self.failed.remove(&id);
        if let Some(running) = self.running.remove(&id) {
            running.progress.cancel();
        }
    }
}

/// Drops what was found out about fields that changed or are gone.
pub(super) fn forget(
    mut events: MessageReader<AssetEvent<PlenOctree>>,
    mut extraction: ResMut<PaletteExtraction>,
    mut palettes: ResMut<Palettes>,
) {
    for event in events.read() {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else {
            continue;
        };
        extraction.give_up(*id);
        extraction.sampled.remove(id);
        let removed = matches!(event, AssetEvent::Removed { .. });
        if removed {
            extraction.wanted.remove(id);
        }
        // A palette that a user gave survives a hot reload.
        if palettes.get(*id).is_some_and(|palette| removed || palette.extraction().is_some()) {
            palettes.remove(*id);
        }
    }
}

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
    let ids: HashSet<_> = extraction.wanted.iter().copied().chain(missing).collect();
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
            _ => on_cpu(field.clone(), settings, progress.clone()),
        };
        let replaces = extraction.wanted.remove(&id);
        extraction.running.insert(id, Running { replaces, progress, stage });
    }
}

fn on_cpu(field: PlenOctree, settings: ExtractionSettings, progress: Arc<Progress>) -> Stage {
    Stage::Computing(AsyncComputeTaskPool::get().spawn(async move {
        let start = Instant::now();
        let histograms = sample(&field, &settings.sampling, &progress)?;
        finish_sampled(histograms, false, start.elapsed(), &settings)
    }))
}

fn finish_sampled(
    histograms: Histograms,
    on_gpu: bool,
    sampling: Duration,
    settings: &ExtractionSettings,
) -> Result<(Extraction, ExtractionSamples), ExtractionError> {
    let mut extraction = extract_from_histograms(&histograms, settings)?;
    extraction.seconds.sampling = sampling.as_secs_f64();
    Ok((extraction, ExtractionSamples { histograms: Arc::new(histograms), on_gpu }))
}

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
            // Meanwhile the field was given one, or one to wait for.
            Ok(_) if !running.replaces && !palettes.lacks(*id) => {}
            Ok((found, from)) => {
                palettes.arrive(*id, FieldPalette::from_extraction(found));
                sampled.insert(*id, from);
            }
            Err(error) => {
                error!("{id} has no palette: {error}");
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
            AsyncComputeTaskPool::get().spawn(async move { finish_sampled(histograms, true, sampling, &settings) }),
        ),
        Err(failure) => {
            warn!("{} is sampled on the CPU: {failure}", job.id);
            on_cpu(job.field.clone(), settings, job.progress.clone())
        }
    }
}
