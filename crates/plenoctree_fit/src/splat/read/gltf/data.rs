//! Buffers of glTF documents, and the numbers in them.

use std::borrow::Cow;

use base64::{
    Engine, alphabet,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::percent_decode_str;

use super::document::Document;
use crate::{
    file::{Fault, Number},
    splat::read::shared::{Beside, LARGEST_FILE},
};

/// Exporters disagree about the end of the data.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Returns the content of all buffers, and adds the sizes of those that are not in the file to `size`.
pub fn read_buffers<'a>(
    document: &Document,
    binary: Option<&'a [u8]>,
    size: &mut u64,
    beside: Beside,
) -> Result<Vec<Cow<'a, [u8]>>, Fault> {
    let mut buffers = Vec::new();
    let mut read = 0;
    for (index, buffer) in document.buffers.iter().enumerate() {
        let what = format!("buffers[{index}]");
        let content = match (&buffer.uri, binary) {
            (None, Some(binary)) if index == 0 => Cow::Borrowed(binary),
            (None, _) => return Err(Fault::found(what, "no uri", "a file, data, or the binary chunk")),
            (Some(uri), _) => {
                let content = match uri.strip_prefix("data:").and_then(|data| data.split_once(";base64,")) {
                    Some((_, data)) => {
                        BASE64.decode(data).map_err(|error| Fault::found(what.clone(), error.to_string(), "base64"))?
                    }
                    None => beside(&percent_decode_str(uri).decode_utf8_lossy())?,
                };
                // Many buffers may be the same file.
                read += content.len() as u64;
                if read > LARGEST_FILE {
                    return Err(Fault::found("buffers", format!("{read} bytes"), "at most 2 GiB in all"));
                }
                *size += content.len() as u64;
                content.into()
            }
        };
        if (content.len() as u64) < buffer.byte_length {
            let expected = format!("{} bytes", buffer.byte_length);
            return Err(Fault::found(what, format!("{} bytes", content.len()), expected));
        }
        buffers.push(content);
    }
    Ok(buffers)
}

/// A document and its buffers.
pub struct File<'a> {
    pub document: &'a Document,
    pub buffers: Vec<&'a [u8]>,
    /// The size of the file and of the files next to it.
    pub size: u64,
}

impl File<'_> {
    /// Returns the numbers of an accessor. `name` is the attribute that it is for, and `kind` the type that it must
    /// have.
    pub fn accessor(&self, index: usize, name: &str, kind: &'static str) -> Result<Floats<'_>, Fault> {
        let Some(accessor) = self.document.accessors.get(index) else {
            let expected = format!("one of {}", self.document.accessors.len());
            return Err(Fault::found(name, format!("accessor {index}"), expected));
        };
        if accessor.r#type != kind {
            return Err(Fault::found(name, accessor.r#type.as_str(), kind));
        }
        if accessor.sparse.is_some() {
            return Err(Fault::found(name, "a sparse accessor", "one that is not sparse"));
        }
        let (number, largest) = match accessor.component_type {
            5120 => (Number::I8, 127.0),
            5121 => (Number::U8, 255.0),
            5122 => (Number::I16, 32767.0),
            5123 => (Number::U16, 65535.0),
            5126 => (Number::F32, 1.0),
            other => return Err(Fault::found(name, format!("component type {other}"), "a type of glTF 2.0")),
        };
        let parts = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let size = parts * number.size();
        let (bytes, stride) = self.view(accessor.buffer_view.unwrap_or(usize::MAX), name)?;
        let stride = stride.unwrap_or(size as u64);
        let needed = match accessor.count {
            0 => 0,
            count => (count - 1).saturating_mul(stride).saturating_add(size as u64),
        };
        let end = accessor.byte_offset.saturating_add(needed);
        if end > bytes.len() as u64 || stride < size as u64 {
            let found = format!("{} bytes with a stride of {stride}", bytes.len());
            return Err(Fault::found(name, found, format!("{end} bytes with a stride of at least {size}")));
        }
        let bytes = &bytes[accessor.byte_offset as usize..end as usize];
        let unit = if accessor.normalized { 1.0 / largest } else { 1.0 };
        Ok(Floats { bytes, number, stride: stride as usize, count: accessor.count, unit })
    }

    /// Returns the bytes of a view and their stride.
    pub fn view(&self, index: usize, what: &str) -> Result<(&[u8], Option<u64>), Fault> {
        let views = &self.document.buffer_views;
        let Some(view) = views.get(index) else {
            return Err(Fault::found(what, "no buffer view", format!("one of {}", views.len())));
        };
        let Some(buffer) = self.buffers.get(view.buffer) else {
            let expected = format!("one of {}", self.buffers.len());
            return Err(Fault::found(what, format!("buffer {}", view.buffer), expected));
        };
        let end = view.byte_offset.saturating_add(view.byte_length);
        if end > buffer.len() as u64 {
            return Err(Fault::found(what, format!("a buffer of {} bytes", buffer.len()), format!("{end} bytes")));
        }
        Ok((&buffer[view.byte_offset as usize..end as usize], view.byte_stride))
    }
}

/// The numbers of an attribute.
pub struct Floats<'a> {
    bytes: &'a [u8],
    number: Number,
    stride: usize,
    pub count: u64,
    /// The reciprocal of the number that stores 1.
    unit: f64,
}

impl Floats<'_> {
    /// Returns the numbers at an index.
    pub fn get<const N: usize>(&self, index: usize) -> [f32; N] {
        let bytes = &self.bytes[index * self.stride..];
        std::array::from_fn(|part| (self.unit * self.number.read(&bytes[part * self.number.size()..], false)) as f32)
    }
}
