//! Reads numbers and parts from the front of a byte string.

use super::fault::Fault;

/// Bytes that are read from the front.
pub struct Bytes<'a> {
    rest: &'a [u8],
}

impl<'a> Bytes<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Returns the next `count` bytes. `what` describes them in errors.
    pub fn take(&mut self, count: u64, what: &str) -> Result<&'a [u8], Fault> {
        let split = usize::try_from(count).ok().and_then(|count| self.rest.split_at_checked(count));
        let Some((taken, rest)) = split else {
            let expected = format!("{count} bytes: the file is truncated");
            return Err(Fault::found(what, format!("{} bytes", self.rest.len()), expected));
        };
        self.rest = rest;
        Ok(taken)
    }

    pub fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Fault> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N as u64, what)?);
        Ok(array)
    }

    pub fn u32(&mut self, what: &str) -> Result<u32, Fault> {
        self.array(what).map(u32::from_le_bytes)
    }

    pub fn u64(&mut self, what: &str) -> Result<u64, Fault> {
        self.array(what).map(u64::from_le_bytes)
    }

    pub fn f64(&mut self, what: &str) -> Result<f64, Fault> {
        self.array(what).map(f64::from_le_bytes)
    }

    /// Returns a text that ends with a zero.
    pub fn text(&mut self, what: &str) -> Result<String, Fault> {
        let end = self.rest.iter().position(|byte| *byte == 0).unwrap_or(self.rest.len());
        let text = self.take(end as u64 + 1, what)?;
        Ok(String::from_utf8_lossy(&text[..end]).into_owned())
    }
}

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    /// Returns the size in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Reads a number from the start of `bytes`, which has at least [`Self::size`] bytes.
    pub fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        let size = self.size();
        let mut little = [0; 8];
        little[..size].copy_from_slice(&bytes[..size]);
        if big_endian {
            little[..size].reverse();
        }
        let [a, b, c, d, ..] = little;
        match self {
            Self::I8 => i8::from_le_bytes([a]).into(),
            Self::U8 => a.into(),
            Self::I16 => i16::from_le_bytes([a, b]).into(),
            Self::U16 => u16::from_le_bytes([a, b]).into(),
            Self::I32 => i32::from_le_bytes([a, b, c, d]).into(),
            Self::U32 => u32::from_le_bytes([a, b, c, d]).into(),
            Self::F32 => f32::from_le_bytes([a, b, c, d]).into(),
            Self::F64 => f64::from_le_bytes(little),
        }
    }
}
