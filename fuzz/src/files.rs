//! Generates PlenOctree files from the fuzzer's bytes. Zeros give a valid file, and other bytes change it.

use std::io::{Cursor, Write};

use arbitrary::Arbitrary;
use half::f16;
use plenoctree::Basis;
use zip::{
    CompressionMethod,
    write::{FileOptions, ZipWriter},
};

use crate::settings::Settings;

/// An archive of arrays with valid checksums, and the settings to read it with.
#[derive(Arbitrary, Debug)]
pub struct FieldFile<'a> {
    pub settings: Settings,
    basis: u8,
    tree: Tree<'a>,
    content: Content,
    /// The element type and order of each array.
    layouts: [u8; KEYS.len()],
    /// The float16 values for coefficients and densities, repeated as needed.
    numbers: &'a [u8],
    edits: Vec<Edit<'a>>,
    packing: Packing<'a>,
}

#[derive(Arbitrary, Debug)]
enum Tree<'a> {
    /// Every node is in a cell of an earlier node. Two bytes per node choose the node and the cell.
    Hung(&'a [u8]),
    /// The same, but the file stores all nodes after the root in reverse order.
    Reversed(&'a [u8]),
    /// Every node contains the next one.
    Chain(u8),
    /// All cells are divided, down to this depth.
    Full(u8),
}

#[derive(Arbitrary, Debug)]
enum Content {
    Data,
    Quantized { retained: u8, rows: u8 },
}

/// A change that may make the file invalid. `key` is an index into [`KEYS`].
#[derive(Arbitrary, Debug)]
enum Edit<'a> {
    Number { key: u8, at: u16, number: f64 },
    Whole { key: u8, at: u16, number: i64 },
    Bytes { key: u8, at: u16, bytes: &'a [u8] },
    Axis { key: u8, axis: u8, length: u64 },
    Axes { key: u8, axes: u16, length: u8 },
    Type { key: u8, descr: Descr<'a> },
    Version { key: u8, version: u8 },
    HeaderLength { key: u8, length: u32 },
    HeaderByte { key: u8, at: u8, byte: u8 },
    Header { key: u8, text: &'a [u8] },
    Length { key: u8, length: u16 },
    Member { key: u8, bytes: &'a [u8] },
    Without { key: u8 },
    Rename { key: u8, other: u8 },
    Text { text: Name<'a> },
}

#[derive(Arbitrary, Debug)]
enum Descr<'a> {
    Known(u8),
    Text(&'a str),
}

#[derive(Arbitrary, Debug)]
enum Name<'a> {
    Known(u8),
    Text(&'a str),
}

#[derive(Arbitrary, Debug)]
struct Packing<'a> {
    deflated: bool,
    large: bool,
    comment: &'a [u8],
    before: &'a [u8],
    /// Changes to the zip's own records: the record, the byte within it, and its value.
    patches: Vec<(u8, u8, u8)>,
}

const DATA_DIM: usize = 0;
const CHILD: usize = 1;
const SCALE: usize = 2;
const OFFSET: usize = 3;
const FORMAT: usize = 4;
const DATA: usize = 5;
const SIGMA: usize = 6;
const RETAINED: usize = 7;
const COLORS: usize = 8;
const MAP: usize = 9;
const KEYS: [&str; 11] = [
    "data_dim",
    "child",
    "invradius3",
    "offset",
    "data_format",
    "data",
    "sigma",
    "data_retained",
    "quant_colors",
    "quant_map",
    "invradius",
];

const REALS: [&str; 6] = ["<f4", "<f2", "<f8", ">f2", ">f4", ">f8"];
const WHOLES: [&str; 12] = ["<i4", "|i1", "<i2", "<i8", "|u1", "<u2", "<u4", "<u8", ">i2", ">i4", ">i8", ">u2"];
const OTHERS: [&str; 12] =
    ["|O", "<U4", ">U300", "|S5", "<c8", "|b1", "<f16", "<M8[s]", "|V8", "<U4611686018427387904", "|i0", "f"];
const NAMES: [&str; 8] = ["RGBA", "SH1", "SH4", "SH9", "SH16", "SH25", "SG25", "ASG8"];

/// The maximum number of nodes below the root of a tree.
const MOST_NODES: usize = 200;

/// An array to write.
struct Array {
    key: &'static str,
    version: u8,
    descr: String,
    fortran: bool,
    shape: Vec<u64>,
    /// Replaces the header that matches the other fields.
    header: Option<Vec<u8>>,
    length: Option<u32>,
    content: Vec<u8>,
    /// Replaces the whole member.
    member: Option<Vec<u8>>,
}

impl Array {
    /// Creates an array of the numbers that `number` returns for every index in C order.
    fn new(key: usize, layout: u8, types: &[&str], shape: &[usize], number: impl Fn(usize) -> f64) -> Self {
        let descr = types[usize::from(layout & 0x7f) % types.len()];
        let fortran = layout & 0x80 != 0;
        let count = shape.iter().product();
        let mut content = Vec::with_capacity(count * 8);
        for at in 0..count {
            let (mut index, mut left, mut stride) = (at, at, count);
            if fortran {
                index = 0;
                for &axis in shape {
                    stride /= axis;
                    index += left % axis * stride;
                    left /= axis;
                }
            }
            put(&mut content, descr, number(index));
        }
        let shape = shape.iter().map(|&axis| axis as u64).collect();
        Self { shape, fortran, content, ..Self::empty(key, descr) }
    }

    /// Creates an array with a single string.
    fn text(layout: u8, text: &str) -> Self {
        let length = text.chars().count();
        let (descr, content): (String, Vec<u8>) = match layout % 3 {
            0 => (format!("<U{length}"), text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect()),
            1 => (format!(">U{length}"), text.chars().flat_map(|c| u32::from(c).to_be_bytes()).collect()),
            _ => (format!("|S{length}"), text.chars().map(|c| c as u8).collect()),
        };
        Self { content, ..Self::empty(FORMAT, &descr) }
    }

    fn empty(key: usize, descr: &str) -> Self {
        Self {
            key: KEYS[key],
            version: 1,
            descr: descr.into(),
            fortran: false,
            shape: Vec::new(),
            header: None,
            length: None,
            content: Vec::new(),
            member: None,
        }
    }

    fn npy(&self) -> Vec<u8> {
        if let Some(member) = &self.member {
            return member.clone();
        }
        let header = self.header.clone().unwrap_or_else(|| self.header());
        let length = self.length.unwrap_or(header.len() as u32).to_le_bytes();
        let mut npy = b"\x93NUMPY".to_vec();
        npy.extend([self.version, 0]);
        npy.extend(&length[..if self.version == 1 { 2 } else { 4 }]);
        npy.extend(header);
        npy.extend(&self.content);
        npy
    }

    fn header(&self) -> Vec<u8> {
        let order = if self.fortran { "True" } else { "False" };
        let axes: String = self.shape.iter().map(|axis| format!("{axis},")).collect();
        format!("{{'descr': '{}', 'fortran_order': {order}, 'shape': ({axes}), }}\n", self.descr).into_bytes()
    }

    /// Overwrites one element.
    fn set_number(&mut self, at: u16, number: f64) {
        let mut bytes = Vec::new();
        put(&mut bytes, &self.descr, number);
        self.set(usize::from(at) * bytes.len(), &bytes);
    }

    /// Overwrites the content, starting at byte `at`.
    fn set(&mut self, at: usize, bytes: &[u8]) {
        for (to, from) in self.content.iter_mut().skip(at).zip(bytes) {
            *to = *from;
        }
    }
}

/// Appends a number of a known type.
fn put(content: &mut Vec<u8>, descr: &str, number: f64) {
    let start = content.len();
    match &descr[1..] {
        "f2" => content.extend(f16::from_f64(number).to_le_bytes()),
        "f4" => content.extend((number as f32).to_le_bytes()),
        "f8" => content.extend(number.to_le_bytes()),
        other => {
            let size = usize::from(other.as_bytes()[1] - b'0');
            content.extend(&(number as i64).to_le_bytes()[..size]);
        }
    }
    if descr.starts_with('>') {
        content[start..].reverse();
    }
}

impl FieldFile<'_> {
    /// Returns the file, and the total size of its arrays in bytes.
    pub fn build(&self) -> (Vec<u8>, u64) {
        let mut arrays = self.arrays();
        for edit in &self.edits {
            edit.apply(&mut arrays);
        }
        let members: Vec<(&str, Vec<u8>)> = arrays.iter().map(|array| (array.key, array.npy())).collect();
        let unpacked = members.iter().map(|(_, npy)| npy.len() as u64).sum();
        (self.packing.zip(&members), unpacked)
    }

    fn arrays(&self) -> Vec<Array> {
        let basis = Basis::ALL[usize::from(self.basis) % Basis::ALL.len()];
        let (functions, count) = (basis.functions(), basis.coefficients());
        let child = self.tree.child();
        let nodes = child.len() / 8;
        let layout = |key: usize| self.layouts[key];
        let number = |at: usize, default: f64| match self.numbers.len() / 2 {
            0 => default,
            length => f16::from_le_bytes([0, 1].map(|byte| self.numbers[at % length * 2 + byte])).into(),
        };
        let mut arrays = vec![
            Array::new(DATA_DIM, layout(DATA_DIM), &WHOLES, &[], |_| (count + 1) as f64),
            Array::new(CHILD, layout(CHILD), &WHOLES, &[nodes, 2, 2, 2], |at| child[at]),
            Array::new(SCALE, layout(SCALE), &REALS, &[3], |_| 0.5),
            Array::new(OFFSET, layout(OFFSET), &REALS, &[3], |_| 0.5),
            Array::text(layout(FORMAT), basis.name()),
        ];
        match self.content {
            Content::Data => {
                let values = |at: usize| number(at, if at % (count + 1) == count { 1.0 } else { 0.25 });
                arrays.push(Array::new(DATA, layout(DATA), &REALS, &[nodes, 2, 2, 2, count + 1], values));
            }
            Content::Quantized { retained, rows } => {
                let (retained, rows) = (usize::from(retained) % (functions + 1), usize::from(rows) + 1);
                let coded = functions - retained;
                let row = |at: usize| number(at, 0.0).abs().min(255.0).floor() % rows as f64;
                let cells = [nodes, 2, 2, 2];
                let real = |key, shape: &[usize]| Array::new(key, layout(key), &REALS, shape, |at| number(at, 1.0));
                arrays.push(real(SIGMA, &cells));
                arrays.push(real(RETAINED, &[&[retained], &cells[..], &[3]].concat()));
                arrays.push(real(COLORS, &[coded, rows, 3]));
                arrays.push(Array::new(MAP, layout(MAP), &WHOLES, &[&[coded], &cells[..]].concat(), row));
            }
        }
        arrays
    }
}

impl Tree<'_> {
    /// Returns the `child` array of the file.
    fn child(&self) -> Vec<f64> {
        let (hung, reversed): (Vec<[usize; 2]>, bool) = match self {
            Self::Hung(bytes) => (pairs(bytes), false),
            Self::Reversed(bytes) => (pairs(bytes), true),
            Self::Chain(nodes) => ((0..usize::from(*nodes) % 32).map(|node| [node, node]).collect(), false),
            Self::Full(depth) => {
                let nodes = (8usize.pow(u32::from(depth % 3)) - 1) / 7 * 8;
                ((0..nodes).map(|node| [node / 8, node % 8]).collect(), false)
            }
        };
        let nodes = hung.len().min(MOST_NODES) + 1;
        // Returns where the file stores a node. The root stays first.
        let place = |node: usize| if reversed && node > 0 { nodes - node } else { node };
        let mut child = vec![0.0; 8 * nodes];
        for (node, [parent, cell]) in (1..nodes).zip(hung) {
            let parent = place(parent % node);
            let slot = &mut child[8 * parent + cell % 8];
            if *slot == 0.0 {
                *slot = place(node) as f64 - parent as f64;
            }
        }
        child
    }
}

fn pairs(bytes: &[u8]) -> Vec<[usize; 2]> {
    bytes.chunks_exact(2).map(|pair| [pair[0].into(), pair[1].into()]).collect()
}

impl Edit<'_> {
    fn apply(&self, arrays: &mut Vec<Array>) {
        let place = |arrays: &Vec<Array>, key: u8| {
            let key = KEYS[usize::from(key) % KEYS.len()];
            arrays.iter().position(|array| array.key == key)
        };
        let (key, change): (u8, Box<dyn Fn(&mut Array) + '_>) = match *self {
            Self::Without { key } => {
                if let Some(at) = place(arrays, key) {
                    arrays.remove(at);
                }
                return;
            }
            Self::Text { ref text } => {
                let text = match *text {
                    Name::Known(name) => NAMES[usize::from(name) % NAMES.len()],
                    Name::Text(text) => text,
                };
                (FORMAT as u8, Box::new(move |array| *array = Array::text(0, text)))
            }
            Self::Number { key, at, number } => (
                key,
                Box::new(move |array| {
                    if REALS.contains(&&*array.descr) {
                        array.set_number(at, number);
                    }
                }),
            ),
            Self::Whole { key, at, number } => (
                key,
                Box::new(move |array| {
                    if WHOLES.contains(&&*array.descr) {
                        array.set_number(at, number as f64);
                    }
                }),
            ),
            Self::Bytes { key, at, bytes } => (key, Box::new(move |array| array.set(at.into(), bytes))),
            Self::Axis { key, axis, length } => (
                key,
                Box::new(move |array| match array.shape.get_mut(usize::from(axis)) {
                    Some(axis) => *axis = length,
                    None => array.shape.push(length),
                }),
            ),
            Self::Axes { key, axes, length } => {
                (key, Box::new(move |array| array.shape = vec![length.into(); axes.into()]))
            }
            Self::Type { key, ref descr } => {
                let descr = match *descr {
                    Descr::Known(at) => {
                        let mut known = REALS.iter().chain(&WHOLES).chain(&OTHERS).cycle();
                        known.nth(at.into()).map_or("", |name| name)
                    }
                    Descr::Text(text) => text,
                };
                (key, Box::new(move |array| array.descr = descr.into()))
            }
            Self::Version { key, version } => (key, Box::new(move |array| array.version = version)),
            Self::HeaderLength { key, length } => (key, Box::new(move |array| array.length = Some(length))),
            Self::HeaderByte { key, at, byte } => (
                key,
                Box::new(move |array| {
                    let mut header = array.header.take().unwrap_or_else(|| array.header());
                    if let Some(place) = header.get_mut(usize::from(at)) {
                        *place = byte;
                    }
                    array.header = Some(header);
                }),
            ),
            Self::Header { key, text } => (key, Box::new(move |array| array.header = Some(text.into()))),
            Self::Length { key, length } => (key, Box::new(move |array| array.content.resize(length.into(), 0))),
            Self::Member { key, bytes } => (key, Box::new(move |array| array.member = Some(bytes.into()))),
            Self::Rename { key, other } => {
                let other = KEYS[usize::from(other) % KEYS.len()];
                (key, Box::new(move |array| array.key = other))
            }
        };
        if let Some(at) = place(arrays, key) {
            change(&mut arrays[at]);
        }
    }
}

impl Packing<'_> {
    fn zip(&self, members: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut bytes = Cursor::new(self.before.to_vec());
        bytes.set_position(self.before.len() as u64);
        let mut zip = ZipWriter::new(bytes);
        let method = if self.deflated { CompressionMethod::Deflated } else { CompressionMethod::Stored };
        let options = FileOptions::default().compression_method(method).large_file(self.large);
        for (key, npy) in members {
            let name = format!("{key}.npy");
            if self.patches.is_empty() {
                zip.start_file(name, options).expect("in memory");
            } else {
                // Add an extra field for patches to change. Only hostile files have one.
                zip.start_file_with_extra_data(name, options).expect("in memory");
                zip.write_all(&[0xef, 0xbe, 7, 0, 1, 0, b'A', b'E', 1, 0, 0]).expect("in memory");
                zip.end_extra_data().expect("in memory");
            }
            zip.write_all(npy).expect("in memory");
        }
        zip.set_raw_comment(self.comment.to_vec());
        let mut bytes = zip.finish().expect("in memory").into_inner();
        if !self.patches.is_empty() {
            let records: Vec<usize> =
                (0..bytes.len() - 3).filter(|&at| matches!(bytes[at..at + 4], [b'P', b'K', 1..=8, 1..=8])).collect();
            for &(record, at, value) in &self.patches {
                let place = records[usize::from(record) % records.len()] + usize::from(at);
                if let Some(byte) = bytes.get_mut(place) {
                    *byte = value;
                }
            }
        }
        bytes
    }
}
