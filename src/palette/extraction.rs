//! Palette extraction while the app keeps running.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
    time::Duration,
};

use bevy::{
    platform::{hash::FixedHasher, time::Instant},
    prelude::*,
    render::renderer::RenderAdapterInfo,
    tasks::{Task, block_on, poll_once},
};
use indexmap::IndexMap;
use plenoctree::{
    PlenOctree,
    palette::{Extraction, ExtractionError, ExtractionSettings, extract_from_samples, extract_with},
    sampling::{Canceled, Progress, SamplingSettings, sample},
};
use wgpu::DeviceType;

use super::{
    posterized::Posterized,
    ready::{PaletteFailed, PaletteReady},
    resource::{FieldPalette, Palettes},
    samples::{ExtractionSamples, SampleOrigin},
};
use crate::{
    background,
    sampling::{RawSamples, SamplingFailure, SamplingJob, SamplingJobs},
};

/// The maximum number of extractions that run at the same time. Each takes additional memory.
const MOST_RUNNING: usize = 4;

/// The processor that samples the radiance of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum PaletteSampler {
    /// Uses the GPU, or the CPU if the GPU is emulated in software, on the same CPU cores. This is the default.
    #[default]
    Auto,
    /// Uses compute shaders in the render world. Falls back to the CPU if they cannot sample the field. Fields whose files
    /// [record](SampleOrigin::Recorded) their samples are not sampled.
    Gpu,
    /// Uses all CPU cores but one, in the background.
    Cpu,
}

/// Configures palette extraction and reports its progress.
///
/// If the field of a posterized or recolored prop, or of a posterized view, has no palette, and there is no file to
/// load one from, one is extracted while the app keeps running, up to four at the same time. The field is sampled on
/// the GPU, a slice per frame, or on the CPU. Work on the CPU runs on dedicated threads, which leave one core and
/// Bevy's task pools to the app. The log says where a field is sampled, and so does
/// [`PaletteReady`](crate::PaletteReady).
#[derive(Resource, Reflect)]
#[reflect(Resource, Default)]
#[type_path = "bevy_plenoctree"]
pub struct PaletteExtraction {
    /// The settings of extractions. Extractions that are already running keep theirs. Those that failed are tried again
    /// with other settings.
    ///
    /// Defaults to [`ExtractionSettings::default`]: tones, for which at most
    /// [`ENOUGH_LEAVES`](ExtractionSettings::ENOUGH_LEAVES) leaves are sampled. The method is that of the first
    /// posterized prop or view of the field that names one ([`Posterize::method`](crate::Posterize::method)), unless the
    /// extraction was [requested](Self::request). If all of them name other methods before the palette is ready, the
    /// extraction starts over.
    pub settings: ExtractionSettings,
    /// Whether every field without a palette gets one. If false, only the fields that you [request](Self::request) do,
    /// and the props of all others wait until you insert a palette. Extractions that are already running continue.
    ///
    /// Disable it where nobody sees props, such as on a dedicated server: without a GPU, every field that arrives would
    /// be sampled on the CPU.
    ///
    /// Defaults to true.
    pub automatic: bool,
    /// The processor that samples fields.
    ///
    /// Defaults to [`PaletteSampler::Auto`].
    pub sampler: PaletteSampler,
    /// The GPU time per frame that sampling may take. In frames that sample, there are at least about 65,000 rays, however
    /// small it is. Palettes of tones then look at the field from afar, in seven views of 96 x 96 rays per frame. With `None`,
    /// all of it happens in a single frame, which is meant for apps without a window. Changes take effect at once.
    ///
    /// Defaults to 4 ms.
    pub budget: Option<Duration>,
    /// What is to be extracted, in this order.
    #[reflect(ignore)]
    requested: IndexMap<AssetId<PlenOctree>, Request, FixedHasher>,
    #[reflect(ignore)]
    running: HashMap<AssetId<PlenOctree>, Running>,
    #[reflect(ignore)]
    failed: HashMap<AssetId<PlenOctree>, (ExtractionSettings, ExtractionError)>,
    #[reflect(ignore)]
    sampled: HashMap<AssetId<PlenOctree>, ExtractionSamples>,
}

impl Default for PaletteExtraction {
    fn default() -> Self {
        Self {
            settings: ExtractionSettings::default(),
            automatic: true,
            sampler: PaletteSampler::default(),
            budget: Some(Duration::from_millis(4)),
            requested: IndexMap::default(),
            running: HashMap::new(),
            failed: HashMap::new(),
            sampled: HashMap::new(),
        }
    }
}

#[derive(Clone, Copy)]
struct Request {
    purpose: Purpose,
    /// Whether it was made in an earlier frame.
    is_waiting: bool,
}

/// What an extraction is for, which decides what it may replace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Purpose {
    /// The field has no palette.
    Missing,
    /// The field has one that was extracted from an earlier version of it. Replaces that one, and no other.
    Outdated,
    /// [`PaletteExtraction::request`] was called. Replaces any palette.
    Requested,
}

impl Purpose {
    /// Returns whether the result becomes the palette of the field.
    fn applies(self, field: AssetId<PlenOctree>, palettes: &Palettes) -> bool {
        match self {
            Self::Missing => palettes.lacks(field),
            Self::Outdated => palettes.lacks(field) || palettes.keeps_extracted(field),
            Self::Requested => true,
        }
    }
}

struct Running {
    purpose: Purpose,
    settings: ExtractionSettings,
    progress: Arc<Progress>,
    step: Step,
}

enum Step {
    /// A task prepares the job for the render world. Stores when it started.
    Planning(Task<Result<SamplingJob, Canceled>>, Instant),
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

    /// Returns why a field's last extraction failed, or `None` if it did not, if it is tried again with other settings,
    /// or if a palette was inserted or removed since then.
    pub fn error(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionError> {
        self.failed.get(&field.into()).map(|(_, error)| error)
    }

    /// Returns the samples of a field's last successful extraction, or `None` if there was none.
    pub fn sampled(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionSamples> {
        self.sampled.get(&field.into())
    }

    /// Extracts a field's palette with the current settings, even if it has one. Cancels an extraction that is already
    /// running. If the field is reloaded meanwhile, its new version is extracted.
    ///
    /// The field keeps its palette until the new one is ready. The new one then replaces it, including its shown
    /// colors, even if the palette was loaded or inserted. If the palette is [inserted](Palettes::insert) or
    /// [removed](Palettes::remove) in a later frame, that cancels the extraction.
    pub fn request(&mut self, field: impl Into<AssetId<PlenOctree>>) {
        let id = field.into();
        self.cancel(id);
        self.enqueue(id, Purpose::Requested);
    }

    fn enqueue(&mut self, id: AssetId<PlenOctree>, purpose: Purpose) {
        self.requested.insert(id, Request { purpose, is_waiting: false });
    }

    /// Returns the settings for a field without a palette.
    fn settings_for(&self, field: AssetId<PlenOctree>, posterized: &Posterized) -> ExtractionSettings {
        let wanted = posterized.methods().find_map(|(of, method)| method.filter(|_| of == field));
        ExtractionSettings { method: wanted.unwrap_or(self.settings.method), ..self.settings.clone() }
    }

    /// Returns whether the extraction of a field failed, and would fail again.
    fn has_failed(&self, field: AssetId<PlenOctree>, posterized: &Posterized) -> bool {
        self.failed.get(&field).is_some_and(|(settings, _)| {
            let now = self.settings_for(field, posterized);
            // Those that are invalid may differ from themselves.
            now == *settings || now.validate().is_err()
        })
    }

    /// Cancels the extraction of a field and returns what it was for, if there was one.
    fn cancel(&mut self, id: AssetId<PlenOctree>) -> Option<Purpose> {
        self.failed.remove(&id);
        let requested = self.requested.shift_remove(&id).map(|request| request.purpose);
        let running = self.running.remove(&id).map(|running| {
            running.progress.cancel();
            running.purpose
        });
        requested.max(running)
    }
}

/// Forgets the results for fields that were changed or removed, and for palettes that were assigned.
pub(super) fn forget(
    mut events: MessageReader<AssetEvent<PlenOctree>>,
    mut extraction: ResMut<PaletteExtraction>,
    mut palettes: ResMut<Palettes>,
    fields: Res<Assets<PlenOctree>>,
    posterized: Posterized,
) {
    if !palettes.assigned.is_empty() {
        for id in palettes.bypass_change_detection().assigned.drain(..) {
            // Which came first is not known if both happened since the last frame.
            if extraction.requested.get(&id).is_some_and(|request| !request.is_waiting) {
                extraction.failed.remove(&id);
            } else {
                extraction.cancel(id);
            }
        }
    }
    for event in events.read() {
        // A field whose handles are gone before it is loaded is unused, but never removed.
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id } | AssetEvent::Unused { id }) = event else {
            continue;
        };
        let purpose = extraction.cancel(*id);
        extraction.sampled.remove(id);
        // It may have been removed and added again.
        if !matches!(event, AssetEvent::Modified { .. }) && !fields.contains(*id) {
            palettes.remove(*id);
            continue;
        }
        // A palette that was loaded or inserted survives a hot reload of the field. One that was extracted is kept
        // until its replacement is ready, if anything shows it.
        let is_outdated = palettes.get(*id).is_some_and(|palette| palette.extraction().is_some());
        let is_shown = is_outdated && posterized.fields().any(|field| field == *id);
        let purpose = purpose.max(is_shown.then_some(Purpose::Outdated));
        if let Some(purpose) = purpose.filter(|purpose| *purpose > Purpose::Missing) {
            extraction.enqueue(*id, purpose);
        } else if is_outdated {
            palettes.remove(*id);
        }
    }
}

/// Starts extractions for the fields that need a palette, and those that were requested. Cancels those whose palette
/// would not replace the one that the field has now, and those that no prop or view wants any longer, because all of
/// them name another method. These start over.
pub(super) fn start(
    mut extraction: ResMut<PaletteExtraction>,
    palettes: Res<Palettes>,
    fields: Res<Assets<PlenOctree>>,
    adapter: Option<Res<RenderAdapterInfo>>,
    server: Res<AssetServer>,
    posterized: Posterized,
) {
    let is_unwanted = |(id, running): &(&AssetId<PlenOctree>, &Running)| {
        !running.purpose.applies(**id, &palettes)
            || running.purpose != Purpose::Requested && posterized.reject(**id, running.settings.method)
    };
    let unwanted: Vec<_> = extraction.running.iter().filter(is_unwanted).map(|(id, _)| *id).collect();
    for id in unwanted {
        if let Some(purpose) = extraction.cancel(id).filter(|purpose| purpose.applies(id, &palettes)) {
            extraction.enqueue(id, purpose);
        }
    }
    let mut seen = HashSet::new();
    let missing = posterized.fields().filter(|id| {
        extraction.automatic
            && palettes.lacks(*id)
            && !extraction.running.contains_key(id)
            && !extraction.requested.contains_key(id)
            && seen.insert(*id)
            && !extraction.has_failed(*id, &posterized)
    });
    let ids: Vec<_> = extraction.requested.keys().copied().chain(missing).collect();
    let on_gpu = adapter.is_some_and(|adapter| match extraction.sampler {
        PaletteSampler::Auto => adapter.device_type != DeviceType::Cpu,
        PaletteSampler::Gpu => true,
        PaletteSampler::Cpu => false,
    });
    for id in ids {
        if extraction.running.len() >= MOST_RUNNING {
            break;
        }
        let Some(field) = fields.get(id) else {
            continue;
        };
        let purpose = extraction.requested.shift_remove(&id).map_or(Purpose::Missing, |request| request.purpose);
        let settings = match purpose {
            Purpose::Requested => extraction.settings.clone(),
            Purpose::Missing | Purpose::Outdated => extraction.settings_for(id, &posterized),
        };
        extraction.failed.remove(&id);
        let progress = Arc::new(settings.progress());
        let is_valid = settings.validate().is_ok();
        // The CPU reads what the file records, and rejects invalid settings.
        let origin = if is_valid && field.histograms(&settings.sampling).is_some() {
            SampleOrigin::Recorded
        } else if is_valid && on_gpu {
            SampleOrigin::Gpu
        } else {
            SampleOrigin::Cpu
        };
        if is_valid {
            let (name, leaves) = (field_name(&server, id), field.leaves());
            info!("extracting the palette of {name}: {leaves} leaves, sampled {origin}");
        }
        let step = match origin {
            SampleOrigin::Gpu => {
                let (field, settings, progress) = (field.clone(), settings.clone(), progress.clone());
                let plan = move || background::on_cores(|| SamplingJob::new(id, field, settings, progress));
                Step::Planning(background::spawn(plan), Instant::now())
            }
            SampleOrigin::Recorded | SampleOrigin::Cpu => {
                let (field, settings, progress) = (field.clone(), settings.clone(), progress.clone());
                compute(move || extract_on_cpu(&field, origin, &settings, &progress))
            }
        };
        extraction.running.insert(id, Running { purpose, settings, progress, step });
    }
    if !extraction.requested.is_empty() {
        extraction.requested.values_mut().for_each(|request| request.is_waiting = true);
    }
}

/// Returns the path of a field or, if it has none, its id.
pub(crate) fn field_name(server: &AssetServer, field: AssetId<PlenOctree>) -> String {
    server.get_path(field).map_or_else(|| format!("field {field}"), |path| path.to_string())
}

/// Starts a task that computes a palette on all cores but one.
fn compute(work: impl FnOnce() -> Result<(Extraction, ExtractionSamples), ExtractionError> + Send + 'static) -> Step {
    Step::Computing(background::spawn(move || background::on_cores(work)))
}

/// Samples a field, or reads what its file records, and computes the palette.
fn extract_on_cpu(
    field: &PlenOctree,
    origin: SampleOrigin,
    settings: &ExtractionSettings,
    progress: &Progress,
) -> Result<(Extraction, ExtractionSamples), ExtractionError> {
    let sampler = |sampling: &SamplingSettings| sample(field, sampling, progress);
    let (extraction, histograms) = extract_with(field, settings, progress, sampler)?;
    Ok((extraction, ExtractionSamples { histograms: Arc::new(histograms), origin }))
}

/// Advances running extractions and inserts the palettes of those that have finished.
pub(super) fn finish(
    mut extraction: ResMut<PaletteExtraction>,
    mut jobs: ResMut<SamplingJobs>,
    mut palettes: ResMut<Palettes>,
    (mut ready, mut failures): (MessageWriter<PaletteReady>, MessageWriter<PaletteFailed>),
    server: Res<AssetServer>,
) {
    // Jobs are extracted whenever they change.
    if jobs.open.iter().any(|job| !job.is_open()) {
        jobs.open.retain(|job| job.is_open());
    }
    if jobs.budget != extraction.budget {
        jobs.budget = extraction.budget;
    }
    if extraction.running.is_empty() {
        return;
    }
    let PaletteExtraction { running, failed, sampled, .. } = &mut *extraction;
    running.retain(|id, running| {
        let task = match &mut running.step {
            Step::Computing(task) => task,
            Step::Planning(task, start) => {
                match block_on(poll_once(task)) {
                    None => {}
                    Some(Ok(job)) => {
                        let job = Arc::new(job);
                        jobs.open.push(job.clone());
                        running.step = Step::Sampling(job, *start);
                    }
                    Some(Err(Canceled)) => return false,
                }
                return true;
            }
            Step::Sampling(job, start) => {
                if let Some(outcome) = job.take_outcome() {
                    running.step = after_sampling(job, outcome, start.elapsed());
                }
                return true;
            }
        };
        let Some(result) = block_on(poll_once(task)) else {
            return true;
        };
        match result {
            // The field has been given another palette in the meantime, or one is loading.
            Ok(_) if !running.purpose.applies(*id, &palettes) => {}
            Ok((extraction, samples)) => {
                let (count, of) = (extraction.palette.colors.len(), extraction.report.radiance_samples);
                let (name, origin, seconds) = (field_name(&server, *id), samples.origin, extraction.report.seconds);
                info!(
                    "extracted {count} colors of {name} from {of} radiance samples, taken {origin}: {:.2} s of \
                     sampling, {:.2} s of computing",
                    seconds.sampling,
                    seconds.filtering + seconds.hull + seconds.fitting
                );
                palettes.arrive(*id, FieldPalette::from_extraction(extraction));
                ready.write(PaletteReady { field: *id, sampled: Some(origin) });
                sampled.insert(*id, samples);
            }
            Err(error) => {
                error!("failed to extract the palette of {}: {error}", field_name(&server, *id));
                failures.write(PaletteFailed { field: *id, error: error.clone() });
                failed.insert(*id, (running.settings.clone(), error));
            }
        }
        false
    });
}

fn after_sampling(job: &SamplingJob, outcome: Result<RawSamples, SamplingFailure>, sampling: Duration) -> Step {
    let (id, field, settings, progress) = (job.id, job.field.clone(), job.settings.clone(), job.progress.clone());
    compute(move || match outcome.and_then(|samples| samples.convert(&settings.sampling, &progress)) {
        Ok((histograms, views)) => {
            let mut extraction = extract_from_samples(&histograms, &views, &settings, &progress)?;
            extraction.report.seconds.sampling = sampling.as_secs_f64();
            Ok((extraction, ExtractionSamples { histograms: Arc::new(histograms), origin: SampleOrigin::Gpu }))
        }
        Err(failure) => {
            warn!("sampling field {id} on the CPU instead of the GPU: {failure}");
            extract_on_cpu(&field, SampleOrigin::Cpu, &settings, &progress)
        }
    })
}

#[cfg(test)]
mod tests {
    use plenoctree::{BakeSettings, bake, palette::PaletteMethod};

    use super::*;
    use crate::{PlenOctreePlugin, Posterize, Prop};

    /// An app that has just begun to extract the palette of a field.
    fn extracting() -> (App, Handle<PlenOctree>, Entity) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
        app.world_mut().resource_mut::<PaletteExtraction>().sampler = PaletteSampler::Cpu;
        let settings = BakeSettings { depth: 6, ..default() };
        let field = bake(&settings, |_| 1.0, |at| move |_| 0.5 + 0.4 * at).unwrap();
        let field = app.world_mut().resource_mut::<Assets<PlenOctree>>().add(field);
        let prop = app.world_mut().spawn((Prop(field.clone()), Posterize::default())).id();
        wait(&mut app, |app| running(app, &field).is_some());
        (app, field, prop)
    }

    fn wait(app: &mut App, done: impl Fn(&App) -> bool) {
        for _ in 0..10_000 {
            app.update();
            if done(app) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("waited in vain");
    }

    /// Returns the method and the progress of a field's extraction, if one is running.
    fn running(app: &App, field: &Handle<PlenOctree>) -> Option<(PaletteMethod, Arc<Progress>)> {
        let running = app.world().resource::<PaletteExtraction>().running.get(&field.id())?;
        Some((running.settings.method, running.progress.clone()))
    }

    /// Nothing is computed for a field that has been given a palette.
    #[test]
    fn another_palette_ends_an_extraction() {
        let (mut app, field, _) = extracting();
        let (_, progress) = running(&app, &field).unwrap();
        let white = FieldPalette::from_colors([Color::WHITE]).unwrap();
        app.world_mut().resource_mut::<Palettes>().insert(&field, white);
        app.update();
        assert!(progress.is_canceled() && running(&app, &field).is_none());
    }

    /// If all props name another method, an extraction starts over, also if it replaces the palette of an earlier
    /// version of the field.
    #[test]
    fn another_method_starts_over() {
        for purpose in [Purpose::Missing, Purpose::Outdated] {
            let (mut app, field, prop) = extracting();
            app.world_mut().resource_mut::<PaletteExtraction>().running.get_mut(&field.id()).unwrap().purpose = purpose;
            let (method, progress) = running(&app, &field).unwrap();
            assert_eq!(method, PaletteMethod::Tones);
            app.world_mut().get_mut::<Posterize>(prop).unwrap().method = Some(PaletteMethod::Hull);
            app.update();
            assert!(progress.is_canceled());
            let (method, progress) = running(&app, &field).unwrap();
            assert!(method == PaletteMethod::Hull && !progress.is_canceled());
            let running = &app.world().resource::<PaletteExtraction>().running;
            assert_eq!(running.get(&field.id()).map(|running| running.purpose), Some(purpose));
        }
    }
}
