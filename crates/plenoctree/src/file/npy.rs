//! The header of a `.npy` array: its element type, order and shape.

use std::fmt::Display;
use std::io::{self, Read};

use bytemuck::Pod;
use half::f16;

/// Maximum length of a header, in bytes. numpy writes 118 bytes for arrays of plain numbers.
const MAX_HEADER: usize = 1 << 16;
/// Maximum number of axes, as in numpy.
const MAX_AXES: usize = 64;

/// The element type in a header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Dtype {
    /// The dtype as written in the header, such as `<f2`.
    pub name: String,
    /// The letter of its kind: `f`, `i`, `u`, `U`, `S`, `O`, ...
    pub kind: char,
    /// Bytes per element.
    pub size: u64,
    /// Whether the byte order is the opposite of this machine's.
    pub swapped: bool,
}

impl Dtype {
    fn parse(name: &str) -> Option<Self> {
        let mut letters = name.chars();
        let mut kind = letters.next()?;
        let mut big = cfg!(target_endian = "big");
        if "<>|=".contains(kind) {
            big = kind == '>' || (big && kind != '<');
            kind = letters.next()?;
        }
        let count = match letters.as_str() {
            "" => 0,
            digits => digits.parse().ok()?,
        };
        // numpy gives the size of a Unicode string in characters of four bytes.
        let size = if kind == 'U' { 4u64.checked_mul(count)? } else { count };
        Some(Self { name: name.to_owned(), kind, size, swapped: big != cfg!(target_endian = "big") })
    }
}

/// The header of an array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub dtype: Dtype,
    /// Whether the first axis varies fastest instead of the last.
    pub fortran: bool,
    pub shape: Vec<u64>,
}

impl Header {
    /// Reads a header, leaving `reader` at the first element. Also returns the length of the header in bytes.
    ///
    /// This does not use the parser of `npyz`, which allocates whatever the length field claims, recurses as deeply as
    /// the header nests, and multiplies the shape without checks.
    pub fn read(reader: &mut impl Read) -> io::Result<(Self, u64)> {
        let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
        let mut start = [0; 8];
        reader.read_exact(&mut start)?;
        let [b'\x93', b'N', b'U', b'M', b'P', b'Y', version, _] = start else {
            return Err(invalid("no npy header".into()));
        };
        let mut length = [0; 4];
        let digits = match version {
            1 => 2,
            2 | 3 => 4,
            _ => return Err(invalid(format!("npy version {version}"))),
        };
        reader.read_exact(&mut length[..digits])?;
        let length = u32::from_le_bytes(length) as usize;
        if length > MAX_HEADER {
            return Err(invalid(format!("an npy header of {length} bytes")));
        }
        let mut text = vec![0; length];
        reader.read_exact(&mut text)?;
        let header = std::str::from_utf8(&text).ok().and_then(Self::parse);
        let header = header.ok_or_else(|| invalid("a malformed npy header".into()))?;
        Ok((header, (8 + digits + length) as u64))
    }

    /// Parses the Python literal `{'descr': '<f2', 'fortran_order': False, 'shape': (1, 2), }`.
    fn parse(text: &str) -> Option<Self> {
        let (mut dtype, mut fortran, mut shape) = (None, None, None);
        let mut rest = text.trim().strip_prefix('{')?.trim_start();
        while !rest.starts_with('}') {
            let (key, value) = quoted(rest)?;
            rest = value.trim_start().strip_prefix(':')?.trim_start();
            match key {
                "descr" if rest.starts_with('[') => {
                    // A structured dtype. No array of a PlenOctree has one, so its fields are ignored.
                    let end = matching(rest)?;
                    dtype = Some(Dtype { name: rest[..end].into(), kind: 'V', size: 0, swapped: false });
                    rest = &rest[end..];
                }
                "descr" => {
                    let (name, after) = quoted(rest)?;
                    dtype = Some(Dtype::parse(name)?);
                    rest = after;
                }
                "fortran_order" => {
                    let word = rest.find(|c: char| !c.is_alphabetic())?;
                    fortran = Some(match &rest[..word] {
                        "True" => true,
                        "False" => false,
                        _ => return None,
                    });
                    rest = &rest[word..];
                }
                "shape" => {
                    let (axes, after) = rest.strip_prefix('(')?.split_once(')')?;
                    // Python 2 wrote long integers with an L.
                    let axes =
                        axes.trim().trim_end_matches(',').split(',').map(|axis| axis.trim().trim_end_matches('L'));
                    shape = Some(match axes.clone().next() {
                        Some("") => Vec::new(),
                        _ => axes.take(MAX_AXES + 1).map(|axis| axis.parse().ok()).collect::<Option<_>>()?,
                    });
                    rest = after;
                }
                _ => return None,
            }
            rest = rest.trim_start();
            rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        }
        let shape = shape.filter(|shape| shape.len() <= MAX_AXES);
        Some(Self { dtype: dtype?, fortran: fortran?, shape: shape? })
    }

    /// Returns the number of elements, or `None` if it overflows.
    pub fn elements(&self) -> Option<u64> {
        self.shape.iter().try_fold(1u64, |product, &axis| product.checked_mul(axis))
    }
}

/// Splits a Python string literal without escapes off the start of `text`. Returns its content and the rest.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|quote| "'\"".contains(*quote))?;
    text[1..].split_once(quote)
}

/// Returns the end of the bracketed literal at the start of `text`.
fn matching(text: &str) -> Option<usize> {
    let mut open = 0;
    for (at, letter) in text.char_indices() {
        match letter {
            '[' => open += 1,
            ']' => open -= 1,
            _ => {}
        }
        if open == 0 {
            return Some(at + 1);
        }
    }
    None
}

/// The dtypes that [`Real`] reads, for messages.
pub(super) const REALS: &str = "<f2, <f4 or <f8";
/// The dtypes that [`Whole`] reads, for messages.
pub(super) const WHOLES: &str = "an integer";

/// Reverses the order of a number's bytes.
pub(super) fn swap<T: Pod>(mut number: T) -> T {
    bytemuck::bytes_of_mut(&mut number).reverse();
    number
}

/// A floating-point number in an array.
pub(super) trait Real: Pod + Display + Into<f64> {
    /// Converts to float64, which is exact.
    fn to_f64(self) -> f64 {
        self.into()
    }
    /// Rounds to the nearest float32. Numbers beyond its range become infinite.
    fn to_f32(self) -> f32 {
        self.to_f64() as f32
    }
    /// Rounds to the nearest float16. Returns `None` for NaN and beyond +-65504.
    fn to_f16(self) -> Option<f16>;
}

impl Real for f16 {
    fn to_f16(self) -> Option<f16> {
        self.is_finite().then_some(self)
    }
}

impl Real for f32 {
    fn to_f16(self) -> Option<f16> {
        (self.abs() <= f16::MAX.to_f32()).then(|| f16::from_f32(self))
    }
}

impl Real for f64 {
    fn to_f16(self) -> Option<f16> {
        (self.abs() <= f16::MAX.to_f64()).then(|| f16::from_f64(self))
    }
}

/// An integer in an array.
pub(super) trait Whole: Pod + TryInto<i64> {
    /// Converts to `i64`, saturating.
    fn to_i64(self) -> i64 {
        self.try_into().unwrap_or(i64::MAX)
    }
}

impl<T: Pod + TryInto<i64>> Whole for T {}

/// Runs `$body` with `$number` as the Rust type of a dtype, if it is one of these. Evaluates to `None` for others.
macro_rules! with_type {
    ($dtype:expr, $number:ident => $body:expr, $($kind:literal $size:literal $type:ty),+) => {
        match ($dtype.kind, $dtype.size) {
            $(($kind, $size) => {
                type $number = $type;
                Some($body)
            })+
            _ => None,
        }
    };
}

/// The same, for floating-point dtypes.
macro_rules! with_real {
    ($dtype:expr, $number:ident => $body:expr) => {
        $crate::file::npy::with_type!($dtype, $number => $body, 'f' 2 half::f16, 'f' 4 f32, 'f' 8 f64)
    };
}

/// The same, for integer dtypes.
macro_rules! with_whole {
    ($dtype:expr, $number:ident => $body:expr) => {
        $crate::file::npy::with_type!(
            $dtype, $number => $body,
            'i' 1 i8, 'i' 2 i16, 'i' 4 i32, 'i' 8 i64, 'u' 1 u8, 'u' 2 u16, 'u' 4 u32, 'u' 8 u64
        )
    };
}

pub(super) use {with_real, with_type, with_whole};
