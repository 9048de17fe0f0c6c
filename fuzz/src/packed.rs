//! Generates packed fields from the fuzzer's bytes: sections with valid checksums. Without edits, the file is valid.

use arbitrary::Arbitrary;
use miniz_oxide::deflate::compress_to_vec;

use crate::settings::Settings;

/// The sections of the example in the order of the file.
const NAMES: [&str; 8] = ["HEAD", "TREE", "DENS", "LEVL", "BASE", "BOOK", "ROWS", "BINS"];

/// A packed field with valid checksums, and the settings to read it with.
#[derive(Arbitrary, Debug)]
pub struct PackedFile<'a> {
    pub settings: Settings,
    basis: u8,
    /// The cells of nodes, level by level, as far as they go.
    cells: &'a [u8],
    depth: u8,
    edits: Vec<Edit<'a>>,
}

#[derive(Arbitrary, Debug)]
enum Edit<'a> {
    Bytes { section: u8, at: u16, bytes: &'a [u8] },
    Length { section: u8, length: u16 },
    Content { section: u8, size: u64 },
    Stored { section: u8, bytes: &'a [u8] },
    Rename { section: u8, other: u8 },
    Version(u16),
    File { at: u16, byte: u8 },
}

/// A section: its name, its content, the size that it claims, and what is stored if that is not the content.
struct Section<'a> {
    name: &'static str,
    content: Vec<u8>,
    size: Option<u64>,
    stored: Option<&'a [u8]>,
}

impl PackedFile<'_> {
    /// Returns the file and the size of its sections' contents in bytes.
    pub fn bytes(&self) -> (Vec<u8>, u64) {
        let mut sections = self.sections();
        let mut version = 2;
        for edit in &self.edits {
            let place = |section: &u8| usize::from(*section) % NAMES.len();
            match edit {
                Edit::Bytes { section, at, bytes } => {
                    let content = &mut sections[place(section)].content;
                    content.iter_mut().skip(usize::from(*at)).zip(*bytes).for_each(|(old, new)| *old = *new);
                }
                Edit::Length { section, length } => sections[place(section)].content.resize((*length).into(), 0),
                Edit::Content { section, size } => sections[place(section)].size = Some(*size),
                Edit::Stored { section, bytes } => sections[place(section)].stored = Some(bytes),
                Edit::Rename { section, other } => sections[place(section)].name = NAMES[place(other)],
                Edit::Version(number) => version = *number,
                Edit::File { .. } => {}
            }
        }
        let unpacked = sections.iter().map(|section| section.content.len() as u64).sum();
        let mut file = write(&sections, version);
        for edit in &self.edits {
            if let Edit::File { at, byte } = edit {
                let at = usize::from(*at) % file.len();
                file[at] = *byte;
            }
        }
        (file, unpacked)
    }

    /// Returns valid sections, with a tree of the requested cells.
    fn sections(&self) -> Vec<Section<'_>> {
        let basis = self.basis % 6;
        let functions = [1, 1, 4, 9, 16, 25][usize::from(basis)];
        let depth = usize::from(self.depth % 20) + 1;
        let (mut tree, mut count, mut nodes, mut leaves) = (Vec::new(), 1, 0, 0);
        let mut cells = self.cells.iter().copied();
        for level in 1..=depth {
            let filled: Vec<u8> = (0..count).map(|_| cells.next().unwrap_or(0)).collect();
            // Every other cell that is not empty is a leaf, and all of them at the deepest level.
            let whole: Vec<u8> = filled.iter().map(|bits| if level == depth { *bits } else { bits & 0x55 }).collect();
            let ones = |bytes: &[u8]| bytes.iter().map(|bits| bits.count_ones()).sum::<u32>();
            nodes += count;
            leaves += ones(&whole);
            count = ones(&filled) - ones(&whole);
            tree.extend(filled);
            if level < depth {
                tree.extend(whole);
            }
        }
        let shares = functions > 1 && leaves > 0;
        let rows = if shares { 2 } else { 0 };
        let mut head = vec![basis, 0, 1, depth as u8];
        for number in [nodes, leaves, 1, rows, 0, rows, 0] {
            head.extend(number.to_le_bytes());
        }
        head.extend([0.25f32, 0.125].map(f32::to_le_bytes).as_flattened());
        head.extend([0.5f64, 0.5, 0.5, 0.25, 0.25, 0.25].map(f64::to_le_bytes).as_flattened());
        // Streams in which every number is the same have no bits: all contexts have one symbol, the 0 or, of leaves'
        // rows, the 1, which stands for the row before. Every bin of the histogram has the weight 1.
        let used = leaves > 0;
        let mut histogram = vec![0, 2, 2, 4];
        histogram.extend(0.01f64.to_le_bytes());
        histogram.extend(16u64.to_le_bytes());
        histogram.extend([0xff; 8]);
        histogram.extend([1f64.to_le_bytes(); 64].as_flattened());
        let contents = [
            head,
            tree,
            vec![0, 0x3c],
            constant(9, 0, used),
            constant(36, 0, used),
            constant(3 * (functions - 1), 0, shares),
            constant(36, 1, shares),
            histogram,
        ];
        let section = |(name, content)| Section { name, content, size: None, stored: None };
        NAMES.into_iter().zip(contents).map(section).collect()
    }
}

/// Returns a coded stream whose contexts have only one symbol.
fn constant(contexts: usize, symbol: u8, used: bool) -> Vec<u8> {
    let mut stream = 4u32.to_le_bytes().to_vec();
    for _ in 0..contexts {
        if used {
            // A frequency of 4096.
            stream.push(symbol + 1);
            stream.resize(stream.len() + usize::from(symbol), 0);
            stream.extend([128, 32]);
        } else {
            stream.push(0);
        }
    }
    stream.extend((1u32 << 23).to_le_bytes());
    stream
}

fn write(sections: &[Section], version: u16) -> Vec<u8> {
    let (mut list, mut body) = (Vec::new(), Vec::new());
    for Section { name, content, size, stored } in sections {
        let stored = stored.map_or_else(|| compress_to_vec(content, 1), <[u8]>::to_vec);
        list.extend(name.as_bytes());
        list.extend(crc32fast::hash(&stored).to_le_bytes());
        list.extend((stored.len() as u64).to_le_bytes());
        list.extend(size.unwrap_or(content.len() as u64).to_le_bytes());
        body.extend(stored);
    }
    let mut file = b"\x89PLO\r\n\x1a\n".to_vec();
    file.extend(version.to_le_bytes());
    file.extend((sections.len() as u16).to_le_bytes());
    file.extend(crc32fast::hash(&list).to_le_bytes());
    file.extend(list);
    file.extend(body);
    file
}
