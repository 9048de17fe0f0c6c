//! Reports to the main world what is on the GPU, and what does not fit.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bevy::{
    prelude::*,
    render::{Extract, render_resource::PipelineCache},
};
use plenoctree::PlenOctree;

use super::{
    pipelines,
    readiness::{LeftOut, Readiness},
    upload::FieldTooLarge,
};

/// A message written in [`PreUpdate`] when all of a field has arrived on the GPU and the pipelines that draw it are
/// compiled, and again whenever the field is reloaded or a lost GPU device is replaced.
///
/// The field's props are drawn in the same frame, unless they wait for a palette. To know whether a prop can be drawn,
/// use [`PropState`](crate::PropState).
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldReady {
    /// The field.
    pub field: AssetId<PlenOctree>,
}

/// A message written in [`PreUpdate`] when the GPU cannot hold a field, or a level of it that a camera or a light
/// requests ([`PropQuality`](crate::PropQuality)).
///
/// If the device does not forbid its size (see [`FieldTooLarge::limit`]), it is tried again every two seconds.
/// [`FieldReady`] is written if that succeeds. The message is written once, for the first attempt.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct FieldFailed {
    /// The field.
    pub field: AssetId<PlenOctree>,
    /// The part that does not fit, and its size.
    pub error: FieldTooLarge,
    /// Whether only a level does not fit. Another level is drawn in its place. Otherwise, the field's props are not
    /// drawn; if a field was reloaded or replaced, the earlier one still is.
    pub only_level: bool,
}

/// A message written in [`PreUpdate`] when the GPU has too little memory for the textures that a camera needs to draw
/// props: about 21 bytes for each pixel of the part that they cover or, if anything is posterized, 95. This depends on
/// its settings and on what it sees, and is more while something moves.
///
/// The camera draws no props then. It tries again every two seconds, and when its size or the number of props that it
/// sees changes. The message is written once per shortage, which ends when an attempt succeeds, or when the camera has
/// nothing to draw.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct ViewFailed {
    /// The camera.
    pub camera: Entity,
    /// The size of its view.
    pub error: ViewTooLarge,
}

/// The error for a camera whose textures do not fit on the GPU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "drawing props in a view of {} x {} pixels needs more GPU memory than is available; use a smaller view, or fewer \
     or smaller fields",
    .size.x, .size.y
)]
pub struct ViewTooLarge {
    /// The size of the part of the target that the camera draws to, in pixels.
    pub size: UVec2,
}

/// A report of the render world.
pub(crate) enum Report {
    /// Whether a field can be drawn.
    Field(AssetId<PlenOctree>, Result<(), FieldTooLarge>),
    /// A level of a field that is not drawn.
    Level(AssetId<PlenOctree>, FieldTooLarge),
    /// A camera that draws no props.
    View(Entity, ViewTooLarge),
    /// The share of a field that has arrived.
    Progress(AssetId<PlenOctree>, f32),
    /// The device is new, so nothing is on it.
    NewDevice,
}

#[derive(Default)]
struct Inbox {
    reports: Vec<Report>,
    /// The last frame that was rendered with all pipelines.
    drawn: u64,
    pipeline_error: Option<String>,
}

/// Carries reports from the render world to the main world. Both worlds hold a clone.
#[derive(Resource, Clone, Default)]
pub(crate) struct FieldReports(Arc<Mutex<Inbox>>);

impl FieldReports {
    pub fn send(&self, report: Report) {
        self.inbox().reports.push(report);
    }

    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What the main world knows about the GPU.
#[derive(Resource, Default)]
pub(crate) struct GpuStatus {
    /// Whether there is a render world, which reports.
    has_reports: bool,
    outcomes: HashMap<AssetId<PlenOctree>, Result<(), FieldTooLarge>>,
    /// The shares of fields that are arriving.
    progress: HashMap<AssetId<PlenOctree>, f32>,
    frame: u64,
    drawn: u64,
    pipeline_error: Option<String>,
}

impl GpuStatus {
    /// Returns whether a loaded field is on the GPU, or `None` if that is not known yet. Without a GPU, every field
    /// counts as arrived.
    pub fn outcome(&self, field: AssetId<PlenOctree>) -> Option<Result<(), &FieldTooLarge>> {
        if !self.has_reports {
            return Some(Ok(()));
        }
        self.outcomes.get(&field).map(|outcome| outcome.as_ref().copied())
    }

    /// Returns how much of a field is on the GPU, from 0 to 1.
    pub fn progress(&self, field: AssetId<PlenOctree>) -> f32 {
        let arriving = || self.progress.get(&field).copied().unwrap_or(0.0);
        self.outcome(field).map_or_else(arriving, |_| 1.0)
    }

    /// Returns whether there is a GPU, which reports.
    pub fn has_reports(&self) -> bool {
        self.has_reports
    }

    /// Returns the number of this frame.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// Returns whether this frame or a later one was rendered with all pipelines.
    pub fn has_drawn(&self, frame: u64) -> bool {
        !self.has_reports || self.drawn >= frame
    }

    /// Returns why a pipeline that draws props could not be created, if there is one.
    pub fn pipeline_error(&self) -> Option<&str> {
        self.pipeline_error.as_deref()
    }
}

/// Receives the reports and writes messages. Runs in the main world.
pub(super) fn receive(
    reports: Option<Res<FieldReports>>,
    mut status: ResMut<GpuStatus>,
    loaded: Res<Assets<PlenOctree>>,
    mut fields: MessageReader<AssetEvent<PlenOctree>>,
    mut ready: MessageWriter<FieldReady>,
    mut failed: MessageWriter<FieldFailed>,
    mut failed_views: MessageWriter<ViewFailed>,
) {
    status.frame += 1;
    for event in fields.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } = event {
            status.outcomes.remove(id);
            status.progress.remove(id);
        }
    }
    let Some(reports) = reports else { return };
    status.has_reports = true;
    let mut inbox = reports.inbox();
    status.drawn = inbox.drawn;
    if status.pipeline_error != inbox.pipeline_error {
        status.pipeline_error.clone_from(&inbox.pipeline_error);
    }
    for report in inbox.reports.drain(..) {
        // Rendering runs in parallel with the next frame, in which the field may have been removed.
        if let Report::Field(field, _) | Report::Progress(field, _) = &report
            && loaded.get(*field).is_none()
        {
            continue;
        }
        match report {
            Report::NewDevice => {
                status.outcomes.clear();
                status.progress.clear();
            }
            Report::Progress(field, share) => {
                // What is known is the outcome of an earlier version: rendering runs in parallel with the next frame.
                status.outcomes.remove(&field);
                status.progress.insert(field, share);
            }
            Report::Level(field, error) => {
                failed.write(FieldFailed { field, error, only_level: true });
            }
            Report::View(camera, error) => {
                failed_views.write(ViewFailed { camera, error });
            }
            Report::Field(field, outcome) => {
                status.outcomes.insert(field, outcome.clone());
                status.progress.remove(&field);
                match outcome {
                    Ok(()) => {
                        ready.write(FieldReady { field });
                    }
                    Err(error) => {
                        failed.write(FieldFailed { field, error, only_level: false });
                    }
                }
            }
        }
    }
}

/// The number of the frame that is being rendered.
#[derive(Resource, Default)]
pub(super) struct RenderedFrame(u64);

pub(super) fn extract_frame(status: Extract<Res<GpuStatus>>, mut frame: ResMut<RenderedFrame>) {
    frame.0 = status.frame;
}

/// Reports whether all pipelines were ready when this frame was rendered.
pub(super) fn report_pipelines(
    cache: Res<PipelineCache>,
    readiness: Res<Readiness>,
    frame: Res<RenderedFrame>,
    reports: Res<FieldReports>,
) {
    let mut inbox = reports.inbox();
    let is_waiting = pipelines::waiting(&cache).any(pipelines::draws_props);
    if readiness.left_out < LeftOut::More && !is_waiting {
        inbox.drawn = frame.0;
    }
    let error = pipelines::failed(&cache).find(|(label, _)| pipelines::draws_props(label));
    inbox.pipeline_error = error.map(|(label, error)| format!("{label}: {error}"));
}

/// Forgets what was on a lost device.
pub(super) fn report_new_device(reports: Res<FieldReports>) {
    reports.send(Report::NewDevice);
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use plenoctree::{BakeSettings, bake};

    use super::*;

    /// A field may be changed or removed in the frame in which it arrives.
    #[test]
    fn what_is_known_of_an_earlier_version_does_not_last() {
        let (mut world, reports) = (World::new(), FieldReports::default());
        world.insert_resource(reports.clone());
        world.init_resource::<GpuStatus>();
        world.init_resource::<Messages<AssetEvent<PlenOctree>>>();
        world.init_resource::<Messages<FieldReady>>();
        world.init_resource::<Messages<FieldFailed>>();
        world.init_resource::<Messages<ViewFailed>>();
        let field = bake(&BakeSettings { depth: 1, ..default() }, |_| 1.0, |_| |_| DVec3::ONE).unwrap();
        let mut fields = Assets::default();
        let id = fields.add(field).id();
        world.insert_resource(fields);
        let receive = |world: &mut World, report: Report| {
            reports.send(report);
            world.run_system_cached(receive).unwrap();
            let status = world.resource::<GpuStatus>();
            (status.outcome(id).map(|outcome| outcome.is_ok()), status.progress(id))
        };
        receive(&mut world, Report::Field(id, Ok(())));
        assert_eq!(receive(&mut world, Report::Progress(id, 0.5)), (None, 0.5));
        assert_eq!(receive(&mut world, Report::Field(id, Ok(()))), (Some(true), 1.0));
        world.resource_mut::<Assets<PlenOctree>>().remove(id);
        world.write_message(AssetEvent::<PlenOctree>::Removed { id });
        assert_eq!(receive(&mut world, Report::Field(id, Ok(()))), (None, 0.0));
        assert_eq!(receive(&mut world, Report::Progress(id, 0.5)), (None, 0.0));
    }
}
