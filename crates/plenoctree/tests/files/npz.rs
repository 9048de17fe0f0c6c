//! Small PlenOctree files, built byte by byte so that every part can be invalid.

use std::io::{Cursor, Write};

use half::f16;
use plenoctree::Basis;
use zip::{
    CompressionMethod,
    write::{FileOptions, ZipWriter},
};

/// Nodes of the example's file; the last is out of the root's reach.
pub const NODES: usize = 6;
/// Its cells.
pub const CELLS: usize = 8 * NODES;

/// How an array is laid out.
#[derive(Clone, Copy)]
pub struct Layout {
    pub descr: &'static str,
    pub fortran: bool,
}

pub fn c(descr: &'static str) -> Layout {
    Layout { descr, fortran: false }
}

pub fn fortran(descr: &'static str) -> Layout {
    Layout { descr, fortran: true }
}

/// A `.npy` with this header text before `content`.
pub fn npy_with_header(version: u8, header: &str, content: &[u8]) -> Vec<u8> {
    let mut npy = b"\x93NUMPY".to_vec();
    npy.extend([version, 0]);
    match version {
        1 => npy.extend((header.len() as u16).to_le_bytes()),
        _ => npy.extend((header.len() as u32).to_le_bytes()),
    }
    npy.extend(header.as_bytes());
    npy.extend(content);
    npy
}

pub fn header(layout: Layout, shape: &[usize]) -> String {
    let order = if layout.fortran { "True" } else { "False" };
    let axes: String = shape.iter().map(|axis| format!("{axis}, ")).collect();
    format!("{{'descr': '{}', 'fortran_order': {order}, 'shape': ({axes}), }}    \n", layout.descr)
        .replace("(, )", "()")
        .replace(", )", ",)")
}

/// An array of `numbers`, which are in C order.
pub fn npy(layout: Layout, shape: &[usize], numbers: &[f64]) -> Vec<u8> {
    assert_eq!(numbers.len(), shape.iter().product::<usize>());
    let mut content = Vec::new();
    for at in 0..numbers.len() {
        let mut index = at;
        if layout.fortran {
            // From the index in Fortran order to the place on each axis, and from those to the index in C order.
            let mut left = at;
            index = 0;
            let mut stride = numbers.len();
            for &axis in shape {
                stride /= axis;
                index += left % axis * stride;
                left /= axis;
            }
        }
        content.extend(element(layout.descr, numbers[index]));
    }
    npy_with_header(1, &header(layout, shape), &content)
}

fn element(descr: &str, number: f64) -> Vec<u8> {
    let mut bytes = match &descr[1..] {
        "f2" => f16::from_f64(number).to_le_bytes().to_vec(),
        "f4" => (number as f32).to_le_bytes().to_vec(),
        "f8" => number.to_le_bytes().to_vec(),
        "i1" => (number as i8).to_le_bytes().to_vec(),
        "i2" => (number as i16).to_le_bytes().to_vec(),
        "i4" => (number as i32).to_le_bytes().to_vec(),
        "i8" => (number as i64).to_le_bytes().to_vec(),
        "u1" => (number as u8).to_le_bytes().to_vec(),
        "u2" => (number as u16).to_le_bytes().to_vec(),
        "u4" => (number as u32).to_le_bytes().to_vec(),
        "u8" => (number as u64).to_le_bytes().to_vec(),
        other => panic!("no element of {other}"),
    };
    if descr.starts_with('>') {
        bytes.reverse();
    }
    bytes
}

/// A scalar string of dtype `S#` or `U#`.
pub fn text(descr: &'static str, text: &str) -> Vec<u8> {
    let length: usize = descr[2..].parse().unwrap();
    let mut content: Vec<u8> = text
        .chars()
        .flat_map(|letter| match descr.as_bytes() {
            [b'>', b'U', ..] => u32::from(letter).to_be_bytes().to_vec(),
            [_, b'U', ..] => u32::from(letter).to_le_bytes().to_vec(),
            _ => vec![letter as u8],
        })
        .collect();
    content.resize(if descr.contains('U') { 4 * length } else { length }, 0);
    npy_with_header(1, &header(c(descr), &[]), &content)
}

/// The arrays of a file.
#[derive(Clone, Default)]
pub struct Arrays(pub Vec<(String, Vec<u8>)>);

impl Arrays {
    /// The arrays with `key` replaced or added.
    pub fn with(mut self, key: &str, npy: Vec<u8>) -> Self {
        self = self.without(key);
        self.0.push((key.into(), npy));
        self
    }

    pub fn without(mut self, key: &str) -> Self {
        self.0.retain(|(other, _)| other != key);
        self
    }

    pub fn zip(&self, method: CompressionMethod) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (key, npy) in &self.0 {
            let options = FileOptions::default().compression_method(method);
            // Room for what only hostile files have there.
            zip.start_file_with_extra_data(format!("{key}.npy"), options).unwrap();
            zip.write_all(&[0xef, 0xbe, 7, 0, 1, 0, b'A', b'E', 1, 0, 0]).unwrap();
            zip.end_extra_data().unwrap();
            zip.write_all(npy).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    pub fn stored(&self) -> Vec<u8> {
        self.zip(CompressionMethod::Stored)
    }
}

/// The place in a zip of the directory's entry for `key`.
pub fn directory_entry(zip: &[u8], key: &str) -> usize {
    let name = format!("{key}.npy").into_bytes();
    (0..zip.len() - 46)
        .find(|&at| zip[at..].starts_with(b"PK\x01\x02") && zip[at + 46..].starts_with(&name))
        .expect("the member is there")
}

/// `child` of the example: two levels below the root, one branch going back in the file; node 5 is free.
pub fn child() -> Vec<f64> {
    let mut child = vec![0.0; CELLS];
    child[3] = 1.0; // 0 -> 1
    child[6] = 4.0; // 0 -> 4
    child[8 + 7] = 1.0; // 1 -> 2
    child[4 * 8] = -1.0; // 4 -> 3
    child[5 * 8 + 2] = 77.0;
    child
}

/// Density of each cell of the example: leaves under the threshold, at 0 and below 0 among them; leftovers in cells
/// that are not leaves.
pub fn sigma() -> Vec<f64> {
    let mut sigma: Vec<f64> =
        (0..CELLS).map(|cell| [2.5, 0.0, 100.0, -3.0, 0.0078125, 0.75, 40000.0, 0.015625][cell * 5 % 8]).collect();
    sigma[3] = f64::NAN;
    sigma[5 * 8 + 1] = f64::INFINITY;
    sigma
}

/// Coefficient `k` of a cell, exact in float16.
pub fn coefficient(cell: usize, k: usize) -> f64 {
    if cell == 3 || cell >= 5 * 8 { f64::NAN } else { ((cell * 37 + k * 11) % 512) as f64 / 64.0 - 4.0 }
}

/// `data` of the example.
pub fn data(basis: Basis) -> Vec<f64> {
    let sigma = sigma();
    (0..CELLS)
        .flat_map(|cell| (0..basis.coefficients()).map(move |k| coefficient(cell, k)).chain([sigma[cell]]))
        .collect()
}

pub fn data_shape(basis: Basis) -> Vec<usize> {
    vec![NODES, 2, 2, 2, basis.coefficients() + 1]
}

/// The example's file as svox writes it, without bookkeeping.
pub fn example(basis: Basis) -> Arrays {
    Arrays::default()
        .with("data_dim", npy(c("<i8"), &[], &[(basis.coefficients() + 1) as f64]))
        .with("child", npy(c("<i4"), &[NODES, 2, 2, 2], &child()))
        .with("invradius3", npy(c("<f4"), &[3], &[0.5, 0.25, 0.125]))
        .with("offset", npy(c("<f4"), &[3], &[0.5, 0.375, 0.0]))
        .with("data", npy(c("<f2"), &data_shape(basis), &data(basis)))
        .with("data_format", text("<U4", basis.name()))
}
