//! Writes the textures of a level to the GPU, slice by slice.

use std::{borrow::Cow, collections::VecDeque, ops::Range, sync::Arc};

use bevy::tasks::{Task, block_on, poll_once};

use super::{
    budget::Allowance,
    errors::DriverErrors,
    layout::FieldShape,
    textures::write,
    upload::{FieldTooLarge, GpuLevel, LevelData, Textures, Uploader},
};
use crate::background;

/// The approximate number of bytes in a slice.
const SLICE: usize = 1 << 20;
/// The approximate number of bytes that are packed ahead of time, in one task.
const AHEAD: usize = 8 << 20;
/// The number of bytes that take less time to pack than a thread takes to start.
const PACKED_AT_ONCE: usize = 1 << 17;
/// The number of bytes after which the queue may free its copies within a frame.
const SUBMITTED: usize = 64 << 20;

/// An upload in progress.
pub(super) struct Upload {
    data: Arc<LevelData>,
    level: Arc<GpuLevel>,
    textures: Textures,
    errors: DriverErrors,
    /// The slices that are not written yet.
    slices: VecDeque<Slice>,
    /// The contents of the next slices that must be packed.
    packed: VecDeque<Vec<u32>>,
    packing: Option<Task<Vec<Vec<u32>>>>,
    written: usize,
}

/// Some layers of a texture.
struct Slice {
    texture: usize,
    layers: Range<u32>,
    /// The range of the texture's bytes.
    bytes: Range<usize>,
}

impl Upload {
    /// Creates the textures. Fails if they are larger than the device allows.
    pub fn begin(data: LevelData, uploader: &Uploader) -> Result<Self, FieldTooLarge> {
        let mut errors = DriverErrors::default();
        let (level, textures) = uploader.begin(&data, &mut errors)?;
        let mut slices = VecDeque::new();
        for (index, (texture, layers)) in textures.iter().enumerate() {
            let bytes = layers.texels() * texture.format().block_copy_size(None).unwrap_or(1) as usize;
            let step = (SLICE / bytes).clamp(1, layers.count as usize) as u32;
            slices.extend((0..layers.count).step_by(step as usize).map(|first| {
                let end = (first + step).min(layers.count);
                Slice { texture: index, layers: first..end, bytes: bytes * first as usize..bytes * end as usize }
            }));
        }
        Ok(Self {
            data: Arc::new(data),
            level: Arc::new(level),
            textures,
            errors,
            slices,
            packed: VecDeque::new(),
            packing: None,
            written: 0,
        })
    }

    pub fn shape(&self) -> FieldShape {
        self.level.shape
    }

    /// Returns the share that is written, from 0 to 1.
    pub fn progress(&self) -> f32 {
        let left: usize = self.slices.iter().map(|slice| slice.bytes.len()).sum();
        self.written as f32 / (self.written + left).max(1) as f32
    }

    /// Writes the slices for which there is time. Returns the level when it is complete, or an error if the driver
    /// rejects it.
    pub fn advance(
        &mut self,
        uploader: &Uploader,
        allowance: &mut Allowance,
    ) -> Option<Result<Arc<GpuLevel>, FieldTooLarge>> {
        if self.errors.first().is_none() {
            self.pack_ahead();
            let mut errors = std::mem::take(&mut self.errors);
            errors.watch(&uploader.device, || self.write(uploader, allowance));
            self.errors = errors;
        }
        if self.rejection().is_some() {
            return Some(Err(FieldTooLarge { what: "textures", bytes: self.level.bytes, limit: None }));
        }
        (self.slices.is_empty() && !self.errors.are_pending()).then(|| Ok(self.level.clone()))
    }

    /// Returns the driver's message if it rejected the level.
    pub fn rejection(&mut self) -> Option<&str> {
        self.errors.first()
    }

    /// Packs the next slices that must be packed, in the background if there are many.
    fn pack_ahead(&mut self) {
        if let Some(packed) = self.packing.as_mut().and_then(|task| block_on(poll_once(task))) {
            self.packed.extend(packed);
            self.packing = None;
        }
        let packed: usize = self.packed.iter().map(|words| 4 * words.len()).sum();
        if self.packing.is_some() || 2 * packed > AHEAD {
            return;
        }
        let (mut next, mut bytes) = (Vec::new(), 0);
        let to_pack = self.slices.iter().filter(|slice| self.data.plain(slice.texture).is_none());
        for slice in to_pack.skip(self.packed.len()) {
            if bytes >= AHEAD {
                break;
            }
            bytes += slice.bytes.len();
            next.push(slice.bytes.clone());
        }
        if next.is_empty() {
            return;
        }
        let data = self.data.clone();
        let pack = move || next.into_iter().map(|bytes| data.pack(bytes)).collect::<Vec<_>>();
        if bytes <= PACKED_AT_ONCE {
            self.packed.extend(pack());
        } else {
            self.packing = Some(background::spawn(pack));
        }
    }

    fn write(&mut self, uploader: &Uploader, allowance: &mut Allowance) {
        let mut unsubmitted = 0;
        while let Some(Slice { texture: index, layers, bytes }) = self.slices.front() {
            let plain = self.data.plain(*index);
            let is_packed = plain.is_some() || !self.packed.is_empty();
            let Some((texture, _)) = self.textures.get(*index).filter(|_| is_packed && allowance.allows_more()) else {
                break;
            };
            if let Some(all) = plain {
                write(&uploader.queue, texture, layers.clone(), &padded(all, bytes.clone()));
            } else {
                let words = self.packed.pop_front().unwrap_or_default();
                write(&uploader.queue, texture, layers.clone(), bytemuck::cast_slice(&words));
            }
            self.written += bytes.len();
            unsubmitted += bytes.len();
            self.slices.pop_front();
            if unsubmitted >= SUBMITTED {
                uploader.queue.submit([]);
                unsubmitted = 0;
            }
        }
    }
}

/// Returns a part of `all`, with zeros beyond its end.
fn padded(all: &[u8], part: Range<usize>) -> Cow<'_, [u8]> {
    match all.get(part.clone()) {
        Some(bytes) => bytes.into(),
        None => {
            let mut bytes = all.get(part.start..).unwrap_or_default().to_vec();
            bytes.resize(part.len(), 0);
            bytes.into()
        }
    }
}
