//! Writing a PlenOctree in svox's layout.

use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use glam::DVec3;
use half::f16;
use npyz::{AutoSerialize, DType, NpyWriter, Serialize, WriteOptions, WriterBuilder};
use zip::write::{FileOptions, ZipWriter};

use crate::field::PlenOctree;

/// Content from which an array's sizes are written in 64 bits. Under the 4 GiB of 32 bits, since what does not compress
/// grows a little.
const LARGE: u64 = 0xf000_0000;
/// svox's own value for `depth_limit`; deeper trees get their own depth.
const DEPTH_LIMIT: i64 = 10;
/// svox's own value for `geom_resize_fact`.
const RESIZE_FACTOR: f64 = 1.5;

/// Why a field could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file could not be created or written.
    #[error("cannot be written: {0}")]
    Io(#[from] io::Error),
    /// The frame's offset or scale is outside float32, in which files hold it.
    #[error("{key}: found {found}, expected a number that float32 can hold")]
    Frame {
        /// The array that would hold it.
        key: &'static str,
        /// The number.
        found: f64,
    },
}

impl PlenOctree {
    /// Writes a file that svox, volrend and [`Self::read`] read: a deflated `.npz`. An existing file is overwritten.
    ///
    /// A written file read again gives the same field but for two roundings: the format holds densities in float16 (the
    /// nearest, but no more than 65504 and never 0) and the frame in float32. A field that was read from a usual file is
    /// in that precision already. The activation and the up axis are not in the file: [`LoadSettings`](super::LoadSettings)
    /// must name them again, and a threshold that is not above the densities.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        // Before the file is touched.
        single(self)?;
        self.write_to(File::create(path)?)
    }

    /// [`Self::write`] for a file that is already open or in memory.
    pub fn write_to(&self, writer: impl Write + Seek) -> Result<(), WriteError> {
        let (scale, offset) = single(self)?;
        let mut writer = BufWriter::new(writer);
        let mut archive = Archive(ZipWriter::new(&mut writer));
        let values = self.basis().coefficients() + 1;
        let nodes = self.nodes().len() as u64;
        let (parents, reached) = self.parents();
        archive.array("data_dim", &[], [values as i64])?;
        archive.array("child", &[nodes, 2, 2, 2], self.child_offsets())?;
        archive.array("parent_depth", &[nodes, 2], parents.into_iter().flatten())?;
        archive.array("n_internal", &[], [nodes as i64])?;
        archive.array("n_free", &[], [nodes as i64 - reached])?;
        archive.array("invradius3", &[3], scale)?;
        archive.array("offset", &[3], offset)?;
        archive.array("depth_limit", &[], [i64::from(self.depth()).max(DEPTH_LIMIT)])?;
        archive.array("geom_resize_fact", &[], [RESIZE_FACTOR])?;
        archive.begin("data", f16::default_dtype(), &[nodes, 2, 2, 2, values as u64], |data| self.write_cells(data))?;
        let name = self.basis().name();
        let characters = format!("<U{}", name.len()).parse().map_err(io::Error::other)?;
        archive.begin("data_format", DType::new_scalar(characters), &[], |text| text.push(name))?;
        archive.0.finish().map_err(io::Error::from)?;
        drop(archive);
        Ok(writer.flush()?)
    }

    /// For every cell the distance to the node below it, or 0.
    fn child_offsets(&self) -> impl Iterator<Item = i32> {
        self.nodes().iter().zip(0i64..).flat_map(|(cells, node)| {
            cells.iter().map(move |cell| cell.as_node().map_or(0, |below| (i64::from(below) - node) as i32))
        })
    }

    /// For every node its parent's cell, as 8 times the parent plus the cell, and its depth; also the number of nodes
    /// that the root reaches. The others have parent -1, as svox marks nodes that are free.
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

    /// `data`: for every cell its leaf's coefficients and density, or zeros.
    fn write_cells(&self, data: &mut NpyWriter<f16, impl Write>) -> io::Result<()> {
        let count = self.basis().coefficients();
        let nothing = vec![f16::ZERO; count];
        for cell in self.nodes().as_flattened() {
            let (coefficients, density) = match cell.as_leaf().map(|leaf| leaf as usize) {
                Some(leaf) => {
                    let density = f16::from_f32(self.densities()[leaf]);
                    (
                        &self.coefficients()[leaf * count..][..count],
                        density.clamp(f16::MIN_POSITIVE_SUBNORMAL, f16::MAX),
                    )
                }
                None => (&nothing[..], f16::ZERO),
            };
            for value in coefficients {
                data.push(value)?;
            }
            data.push(&density)?;
        }
        Ok(())
    }
}

/// The frame's scale and offset in float32.
fn single(field: &PlenOctree) -> Result<([f32; 3], [f32; 3]), WriteError> {
    let frame = field.frame();
    let (scale, offset) = (frame.scale.as_vec3(), frame.offset.as_vec3());
    let fault = |key, exact: DVec3, at: usize| WriteError::Frame { key, found: exact[at] };
    if let Some(at) = (0..3).find(|&at| !scale[at].is_finite() || scale[at] <= 0.0) {
        return Err(fault("invradius3", frame.scale, at));
    }
    if let Some(at) = (0..3).find(|&at| !offset[at].is_finite()) {
        return Err(fault("offset", frame.offset, at));
    }
    Ok((scale.to_array(), offset.to_array()))
}

/// An archive that is being written.
struct Archive<W: Write + Seek>(ZipWriter<W>);

impl<W: Write + Seek> Archive<W> {
    /// Adds an array of numbers.
    fn array<T: AutoSerialize>(
        &mut self,
        key: &str,
        shape: &[u64],
        numbers: impl IntoIterator<Item = T>,
    ) -> io::Result<()> {
        self.begin(key, T::default_dtype(), shape, |array| array.extend(numbers))
    }

    /// Adds an array that `fill` fills.
    fn begin<T: Serialize + ?Sized>(
        &mut self,
        key: &str,
        dtype: DType,
        shape: &[u64],
        fill: impl FnOnce(&mut NpyWriter<T, BufWriter<&mut ZipWriter<W>>>) -> io::Result<()>,
    ) -> io::Result<()> {
        let bytes = shape.iter().product::<u64>().saturating_mul(dtype.num_bytes().unwrap_or(0) as u64);
        // Without the time of writing, so that a field always gives the same file.
        let options = FileOptions::default().last_modified_time(Default::default()).large_file(bytes > LARGE);
        self.0.start_file(format!("{key}.npy"), options)?;
        let writer = BufWriter::new(&mut self.0);
        let mut array = WriteOptions::new().dtype(dtype).shape(shape).writer(writer).begin_nd()?;
        fill(&mut array)?;
        array.finish()
    }
}
