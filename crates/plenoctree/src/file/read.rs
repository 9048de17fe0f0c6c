//! Reads a PlenOctree from the arrays of its file.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::error::{ReadError, ReadFault, printable};
use super::frame::{EXACT_FRAME, check_frame, in_float32};
use super::leaves::read_data;
use super::npy::{REALS, Real, WHOLES, Whole, with_real, with_whole};
use super::npz::{Archive, Array};
use super::packed::{MAGIC, read_packed};
use super::quantized::{QUANTIZED, read_quantized};
use super::walk::Tree;
use crate::{
    field::{Activation, Basis, Frame, PlenOctree, UpAxis},
    sampling::InvalidSetting,
};

/// Maximum number of nodes in a file: 31 bits must be enough to count the cells.
const MAX_NODES: u64 = (1 << 28) - 1;

/// Settings for reading a PlenOctree file.
///
/// They supply what files do not record, and select the leaves to keep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct LoadSettings {
    /// Function that maps the sum of the harmonics to radiance. `None`, the default, selects the one that a packed
    /// field records, and [`Basis::default_activation`] for other files. Fields converted from Plenoxels need
    /// [`Activation::ShiftedRelu`].
    pub activation: Option<Activation>,
    /// Axis of the field's frame that points up. `None`, the default, selects the one that a packed field records, and
    /// [`UpAxis::Z`] for other files.
    pub up: Option<UpAxis>,
    /// Density below which leaves are dropped: per world unit or, if the box is more than 10 units wide, per tenth of
    /// its longest side. Otherwise, fields in small units, such as millimeters, would lose their faint cells.
    /// 0.01 by default. Leaves whose density is 0 or negative are always dropped. NaN is an error.
    pub density_threshold: f32,
}

impl Default for LoadSettings {
    fn default() -> Self {
        Self { activation: None, up: None, density_threshold: 0.01 }
    }
}

impl LoadSettings {
    /// Returns the density per world unit below which leaves are dropped, for a field of a frame.
    pub fn density_threshold_in(&self, frame: Frame) -> f32 {
        let side = frame.scale.recip().max_element();
        let length = (0.1 * side).max(1.0);
        (f64::from(self.density_threshold) / length) as f32
    }
}

impl PlenOctree {
    /// Extensions of the files that [`Self::read`] reads.
    pub const EXTENSIONS: [&'static str; 2] = ["plenoctree", "npz"];

    /// Reads a PlenOctree file: a packed field (`.plenoctree`), or an `.npz` file as written by svox, sxyu/plenoctree,
    /// the compression of volrend or the conversion of svox2. The format is detected from the content, not the name.
    ///
    /// Arrays of `.npz` files are streamed, and only the leaves that are kept take up memory. Nodes and leaves are
    /// sorted in depth-first order, and nodes that the root does not reach are dropped. Arrays may be in C or Fortran
    /// order, with either byte order and any number type that converts without loss of meaning. Coefficients are
    /// rounded to float16 and densities to float32. Infinite densities, which svox stores for those beyond 65504, are
    /// read as 65504.
    ///
    /// # Errors
    ///
    /// Returns an error that names the file, the array, what was found and what was expected. Coefficients beyond the
    /// range of float16, and densities beyond the range of float32, are errors, and so is a setting out of range.
    pub fn read(path: impl AsRef<Path>, settings: &LoadSettings) -> Result<Self, ReadError> {
        let path = path.as_ref();
        let label = path.display().to_string();
        match File::open(path) {
            Ok(file) => Self::read_from(BufReader::new(file), &label, settings),
            Err(error) => Err(ReadError::new(&label, error.into())),
        }
    }

    /// Reads a PlenOctree from an open file or from memory, like [`Self::read`]. `label` is the name of the file in
    /// errors.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Self::read`].
    pub fn read_from(mut reader: impl Read + Seek, label: &str, settings: &LoadSettings) -> Result<Self, ReadError> {
        read(&mut reader, settings).map_err(|fault| ReadError::new(label, fault))
    }
}

/// The input of an archive. Used as a trait object, so that the reading code is compiled only once.
trait Source: Read + Seek {}

impl<R: Read + Seek> Source for R {}

fn read(reader: &mut dyn Source, settings: &LoadSettings) -> Result<PlenOctree, ReadFault> {
    let threshold = settings.density_threshold;
    InvalidSetting::check(!threshold.is_nan(), "density_threshold", threshold.into(), "a number")?;
    let mut first = Vec::new();
    Read::take(&mut *reader, MAGIC.len() as u64).read_to_end(&mut first)?;
    reader.rewind()?;
    if first == MAGIC {
        let field = read_packed(reader)?.with_settings(settings.activation, settings.up);
        let threshold = settings.density_threshold_in(field.frame());
        return Ok(field.thinned(threshold));
    }
    let mut archive = Archive::open(reader)?;
    let basis = read_basis(&mut archive)?;
    let frame = read_frame(&mut archive)?;
    let mut tree = read_tree(&mut archive)?;
    let threshold = settings.density_threshold_in(frame);
    let keep = |density: f32| density > 0.0 && density >= threshold;
    let quantized = !archive.has("data") && QUANTIZED.iter().any(|key| archive.has(key));
    let (density, coefficients) = if quantized {
        read_quantized(&mut archive, basis, &mut tree, keep)?
    } else {
        read_data(&mut archive, basis, &mut tree, keep)?
    };
    let activation = settings.activation.unwrap_or(basis.default_activation());
    PlenOctree::new(frame, basis, activation, settings.up.unwrap_or_default(), tree.nodes, density, coefficients)
        .map_err(ReadFault::Field)
}

fn read_basis(archive: &mut Archive<impl Read + Seek>) -> Result<Basis, ReadFault> {
    let values = read_data_dim(archive)?;
    let by_values = || match values {
        4 => Some(Basis::Rgba),
        3.. if values % 3 == 1 => Basis::from_functions(usize::try_from(values / 3).ok()?),
        _ => None,
    };
    let basis = if archive.has("data_format") {
        let format = archive.array("data_format", "the basis")?.text()?;
        match Basis::ALL.into_iter().find(|basis| basis.name() == format) {
            Some(basis) => Some(basis),
            None if format.starts_with("SG") || format.starts_with("ASG") => {
                return Err(ReadFault::Gaussians { format: printable(&format) });
            }
            None => {
                return Err(ReadFault::Value {
                    key: "data_format",
                    found: printable(&format),
                    expected: "RGBA, SH1, SH4, SH9, SH16 or SH25".into(),
                });
            }
        }
    } else {
        by_values()
    };
    let expected = match basis {
        Some(basis) if values == basis.coefficients() as i64 + 1 => return Ok(basis),
        Some(basis) => format!("{} for {}", basis.coefficients() + 1, basis.name()),
        None => "4, 13, 28, 49 or 76".into(),
    };
    Err(ReadFault::Value { key: "data_dim", found: values.to_string(), expected })
}

/// Reads the number of values per leaf.
fn read_data_dim(archive: &mut Archive<impl Read + Seek>) -> Result<i64, ReadFault> {
    let array = archive.array("data_dim", "the number of values per leaf")?;
    check_single(&array)?;
    let fault = array.dtype_fault(WHOLES);
    let mut values = 0;
    with_whole!(array.dtype(), T => array.stream::<T>(1, 1, |_, number| {
        values = number[0].to_i64();
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    Ok(values)
}

fn read_frame(archive: &mut Archive<impl Read + Seek>) -> Result<Frame, ReadFault> {
    let key = if !archive.has("invradius3") && archive.has("invradius") { "invradius" } else { "invradius3" };
    let array = archive.array(key, "the reciprocal of the cube's width")?;
    let scale = if key == "invradius" {
        check_single(&array)?;
        DVec3::splat(read_numbers::<1>(array)?[0])
    } else {
        array.check_shape(&[3])?;
        DVec3::from_array(read_numbers(array)?)
    };
    let array = archive.array("offset", "the offset of the cube")?;
    array.check_shape(&[3])?;
    let offset = DVec3::from_array(read_numbers(array)?);
    let frame = exact_frame(archive, Frame { offset, scale })?;
    check_frame(["offset", key], frame)?;
    Ok(frame)
}

/// Returns the frame of which `rounded` is a rounding, if the archive has it. A tool that knows only float32 may have
/// moved the field since.
fn exact_frame(archive: &mut Archive<impl Read + Seek>, rounded: Frame) -> Result<Frame, ReadFault> {
    if !archive.has(EXACT_FRAME) {
        return Ok(rounded);
    }
    let array = archive.array(EXACT_FRAME, "the exact offset and scale of the cube")?;
    array.check_shape(&[2, 3])?;
    let [x, y, z, scales @ ..] = read_numbers::<6>(array)?;
    let exact = Frame { offset: DVec3::new(x, y, z), scale: DVec3::from_array(scales) };
    Ok(if in_float32(exact) == rounded { exact } else { rounded })
}

fn read_tree(archive: &mut Archive<impl Read + Seek>) -> Result<Tree, ReadFault> {
    let array = archive.array("child", "the tree")?;
    let &[nodes @ 1..=MAX_NODES, 2, 2, 2] = array.shape() else {
        return Err(array.shape_fault(format!("[n, 2, 2, 2] with n from 1 to {MAX_NODES}")));
    };
    let fault = array.dtype_fault(WHOLES);
    let cells = 8 * nodes as usize;
    array.room().check(4 * cells as u64)?;
    let mut child = vec![0; cells];
    with_whole!(array.dtype(), T => array.stream::<T>(8, cells, |first, offsets| {
        for (child, offset) in child[first..].iter_mut().zip(offsets) {
            // Offsets beyond 32 bits point outside the array, clamped or not.
            *child = offset.to_i64().clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        }
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    Tree::walk(child).map_err(ReadFault::Tree)
}

/// Reads a small array of `N` numbers of any type.
fn read_numbers<const N: usize>(array: Array) -> Result<[f64; N], ReadFault> {
    let fault = array.dtype_fault(REALS);
    let mut result = [0.0; N];
    let done = if array.dtype().kind == 'f' {
        with_real!(array.dtype(), T => array.stream::<T>(1, N, |at, number| {
            result[at] = number[0].to_f64();
            Ok(())
        }))
    } else {
        with_whole!(array.dtype(), T => array.stream::<T>(1, N, |at, number| {
            result[at] = number[0].to_i64() as f64;
            Ok(())
        }))
    };
    done.unwrap_or(Err(fault))?;
    Ok(result)
}

fn check_single(array: &Array) -> Result<(), ReadFault> {
    if array.shape().iter().all(|&axis| axis == 1) { Ok(()) } else { Err(array.shape_fault("[]")) }
}
