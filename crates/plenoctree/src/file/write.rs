//! Writes `.npz` files: PlenOctrees in svox's layout, and histograms.

use std::io::{self, BufWriter, Seek, Write};
use std::mem::ManuallyDrop;
use std::path::Path;

use glam::DVec3;
use half::f16;
use npyz::{AutoSerialize, DType, NpyWriter, Serialize, WriteOptions, WriterBuilder};
use zip::write::{FileOptions, ZipWriter};

use super::{
    error::ReadFault,
    frame::{EXACT_FRAME, check_frame, in_float32},
    room::TooEven,
};
use crate::{
    field::{Frame, PlenOctree},
    histograms::Histograms,
    save::replace_file,
};

/// Size of an array, in bytes, above which its zip entry uses 64-bit sizes. It is less than the 4 GiB of 32-bit sizes
/// because incompressible content grows a little.
const LARGE: u64 = 0xf000_0000;
/// svox's default `depth_limit`. Deeper trees write their own depth.
const DEPTH_LIMIT: i64 = 10;
/// svox's default `geom_resize_fact`.
const RESIZE_FACTOR: f64 = 1.5;
/// How far float32 may move a corner of a field, in finest cells.
const MOST_SHIFT: f64 = 0.01;

/// An error that occurs when writing a field.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file could not be created or written.
    #[error("cannot be written: {0}")]
    Io(#[from] io::Error),
    /// The field's frame is not within the range of float32, in which files store it.
    #[error(transparent)]
    Frame(ReadFault),
    /// The file would be too small for what it holds.
    #[error(transparent)]
    TooEven(#[from] TooEven),
}

impl PlenOctree {
    /// Writes a deflated `.npz` file that svox, volrend and [`Self::read`] can read. Replaces an existing file.
    ///
    /// The file is first written under another name in the same folder, so that it is never seen half-written.
    ///
    /// Reading the file returns the same field except for two roundings. The format stores densities in float16: the
    /// nearest value, but at most 65504 and never 0. It stores the frame in float32. Fields read from ordinary files
    /// have this precision already. Where float32 would move a field, because it is far from the origin, another array
    /// holds the frame in float64. [`Self::read`] knows it, but svox and volrend do not.
    ///
    /// The file records neither the activation nor the up axis. Set them again in [`LoadSettings`](super::LoadSettings)
    /// when reading it, with a density threshold no higher than the densities.
    ///
    /// # Errors
    ///
    /// Returns an error if the frame does not fit in float32, if so much of a large field is the same that readers would
    /// reject the file, or if writing fails. An existing file is then unchanged.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        replace_file(path.as_ref(), |file| self.write_to(file))
    }

    /// Writes the field to an open file or to memory, like [`Self::write`].
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Self::write`].
    pub fn write_to(&self, mut writer: impl Write + Seek) -> Result<(), WriteError> {
        check_written(self.frame())?;
        let mut archive = Archive::new(BufWriter::new(&mut writer));
        let values = self.basis().coefficients() + 1;
        let nodes = self.nodes().len() as u64;
        archive.structure(self)?;
        archive.frame(self)?;
        archive.begin("data", f16::default_dtype(), &[nodes, 2, 2, 2, values as u64], |data| self.write_cells(data))?;
        archive.text("data_format", self.basis().name())?;
        archive.finish(2 * 8 * nodes * values as u64)
    }

    /// Returns the offset from each cell's node to its child node, or 0 for cells without one.
    fn child_offsets(&self) -> impl Iterator<Item = i32> {
        self.nodes().iter().zip(0i64..).flat_map(|(cells, node)| {
            cells.iter().map(move |cell| cell.as_node().map_or(0, |below| (i64::from(below) - node) as i32))
        })
    }

    /// Returns the parent and depth of every node, and the number of nodes that the root reaches.
    ///
    /// A parent is given as a cell: 8 times the node plus the index of the cell. Nodes that the root does not reach
    /// have parent -1, svox's mark for free nodes.
    fn parents(&self) -> (Vec<[i32; 2]>, i64) {
        let mut parents = vec![[-1, 0]; self.nodes().len()];
        parents[0] = [0, 0];
        let mut reached = 1;
        let mut stack = vec![0u32];
        while let Some(node) = stack.pop() {
            let depth = parents[node as usize][1] + 1;
            for (cell, place) in self.nodes()[node as usize].iter().zip(8 * i64::from(node)..) {
                if let Some(below) = cell.as_node() {
                    parents[below as usize] = [place as i32, depth];
                    reached += 1;
                    stack.push(below);
                }
            }
        }
        (parents, reached)
    }

    /// Writes `data`: the coefficients and density of every cell, zeros for cells without a leaf.
    fn write_cells(&self, data: &mut NpyWriter<f16, impl Write>) -> io::Result<()> {
        let zeros = vec![f16::ZERO; self.basis().coefficients()];
        let mut coefficients = Vec::new();
        for cell in self.nodes().as_flattened() {
            let (coefficients, density) = match cell.as_leaf().map(|leaf| leaf as usize) {
                Some(leaf) => {
                    coefficients.clear();
                    self.stored().visit_halves(self.basis(), leaf, |_, k| coefficients.push(k));
                    (&coefficients, half_density(self.densities()[leaf]))
                }
                None => (&zeros, f16::ZERO),
            };
            for value in coefficients {
                data.push(value)?;
            }
            data.push(&density)?;
        }
        Ok(())
    }
}

impl Histograms {
    /// Writes the arrays that [`Self::read`] reads to a deflated `.npz` file. Replaces an existing file.
    ///
    /// # Errors
    ///
    /// Returns an error if writing fails, or if so many weights are the same that readers would reject the file. An
    /// existing file is then unchanged.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        replace_file(path.as_ref(), |file| {
            let mut archive = Archive::new(BufWriter::new(file));
            for (key, bins) in [("fine", &self.fine), ("coarse", &self.coarse)] {
                archive.array(key, &[bins.per_channel as u64; 3], bins.weights.iter().copied())?;
            }
            archive.finish(8 * (self.fine.weights.len() + self.coarse.weights.len()) as u64)
        })
    }
}

/// Rounds a density to float16, but to neither 0 nor infinity.
pub(crate) fn half_density(density: f32) -> f16 {
    f16::from_f32(density).clamp(f16::MIN_POSITIVE_SUBNORMAL, f16::MAX)
}

/// Returns an error unless readers accept a frame.
pub(crate) fn check_written(frame: Frame) -> Result<(), WriteError> {
    check_frame(["offset", "invradius3"], frame).map_err(WriteError::Frame)
}

/// Returns whether float32 would move a corner of a field.
fn moves_in_float32(field: &PlenOctree) -> bool {
    let exact = field.frame();
    let shift = |corner: DVec3| (in_float32(exact).to_tree(exact.to_world(corner)) - corner).abs().max_element();
    shift(DVec3::ZERO).max(shift(DVec3::ONE)) * f64::from(field.depth()).exp2() > MOST_SHIFT
}

/// An archive being written. After an error, it is not dropped: that would try to finish it, and print another error.
pub(crate) struct Archive<W: Write + Seek>(ManuallyDrop<ZipWriter<W>>);

impl<W: Write + Seek> Archive<W> {
    pub fn new(writer: W) -> Self {
        Self(ManuallyDrop::new(ZipWriter::new(writer)))
    }

    /// Ends the archive, of which readers make this many bytes.
    pub fn finish(mut self, content: u64) -> Result<(), WriteError> {
        let mut writer = self.0.finish().map_err(io::Error::from)?;
        drop(ManuallyDrop::into_inner(self.0));
        writer.flush()?;
        Ok(TooEven::check(content, writer.stream_position()?)?)
    }

    /// Adds the tree, the number of values per leaf, and svox's own bookkeeping.
    pub fn structure(&mut self, field: &PlenOctree) -> io::Result<()> {
        let nodes = field.nodes().len() as u64;
        let (parents, reached) = field.parents();
        self.array("data_dim", &[], [(field.basis().coefficients() + 1) as i64])?;
        self.array("child", &[nodes, 2, 2, 2], field.child_offsets())?;
        self.array("parent_depth", &[nodes, 2], parents.into_iter().flatten())?;
        self.array("n_internal", &[], [nodes as i64])?;
        self.array("n_free", &[], [nodes as i64 - reached])?;
        self.array("depth_limit", &[], [i64::from(field.depth()).max(DEPTH_LIMIT)])?;
        self.array("geom_resize_fact", &[], [RESIZE_FACTOR])
    }

    /// Adds the frame, which fits in float32.
    pub fn frame(&mut self, field: &PlenOctree) -> io::Result<()> {
        let Frame { offset, scale } = field.frame();
        self.array("invradius3", &[3], scale.as_vec3().to_array())?;
        self.array("offset", &[3], offset.as_vec3().to_array())?;
        if moves_in_float32(field) {
            self.array(EXACT_FRAME, &[2, 3], [offset, scale].map(|numbers| numbers.to_array()).into_iter().flatten())?;
        }
        Ok(())
    }

    /// Adds a string.
    pub fn text(&mut self, key: &str, text: &str) -> io::Result<()> {
        let characters = format!("<U{}", text.len()).parse().map_err(io::Error::other)?;
        self.begin(key, DType::new_scalar(characters), &[], |array| array.push(text))
    }

    /// Adds an array of numbers.
    pub fn array<T: AutoSerialize>(
        &mut self,
        key: &str,
        shape: &[u64],
        numbers: impl IntoIterator<Item = T>,
    ) -> io::Result<()> {
        self.begin(key, T::default_dtype(), shape, |array| array.extend(numbers))
    }

    /// Adds an array whose elements `fill` writes.
    fn begin<T: Serialize + ?Sized>(
        &mut self,
        key: &str,
        dtype: DType,
        shape: &[u64],
        fill: impl FnOnce(&mut NpyWriter<T, BufWriter<&mut ZipWriter<W>>>) -> io::Result<()>,
    ) -> io::Result<()> {
        let bytes = shape.iter().product::<u64>().saturating_mul(dtype.num_bytes().unwrap_or(0) as u64);
        // No modification time, so that a field always gives the same file.
        let options = FileOptions::default().last_modified_time(Default::default()).large_file(bytes > LARGE);
        self.0.start_file(format!("{key}.npy"), options)?;
        let writer = BufWriter::new(&mut *self.0);
        let mut array = WriteOptions::new().dtype(dtype).shape(shape).writer(writer).begin_nd()?;
        fill(&mut array)?;
        array.finish()
    }
}
