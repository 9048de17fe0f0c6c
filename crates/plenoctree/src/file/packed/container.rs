//! The container of a packed field: a header, and sections with checksums, deflated where that makes them smaller.

use std::io::{Read, Seek, SeekFrom};

use flate2::read::DeflateDecoder;

use super::super::{error::ReadFault, room::room};

/// The first bytes of every file. As in PNG files, they reveal conversion of line endings.
pub const MAGIC: [u8; 8] = *b"\x89PLO\r\n\x1a\n";
/// The version that this code reads and writes.
const VERSION: u16 = 2;
/// Largest number of sections.
const MAX_SECTIONS: usize = 64;
/// Bytes before the list of sections: magic, version, number of sections, checksum of the list.
const PREFIX: usize = 16;
/// Bytes of a section's entry: name, checksum, size in the file, size of its content.
const ENTRY: usize = 24;
/// Largest compression ratio of deflate.
const DEFLATE_RATIO: u64 = 1032;

/// A part of the file, not yet read.
struct Section {
    name: [u8; 4],
    checksum: u32,
    stored: u64,
    raw: u64,
    /// Position in the file.
    start: u64,
}

/// An open file, whose list of sections is valid.
pub(super) struct Container<R> {
    reader: R,
    bytes: u64,
    sections: Vec<Section>,
    /// Bytes of content that were read so far.
    read: u64,
}

/// Returns the error for a section, or for the `header`.
pub(super) fn fault(section: &'static str, found: impl Into<String>, expected: impl Into<String>) -> ReadFault {
    ReadFault::Packed { section, found: found.into(), expected: expected.into() }
}

impl<R: Read + Seek> Container<R> {
    /// Reads the header. The reader is at the start of the file.
    pub fn open(mut reader: R) -> Result<Self, ReadFault> {
        const HEADER: &str = "header";
        let bytes = reader.seek(SeekFrom::End(0))?;
        reader.rewind()?;
        let short = || fault(HEADER, format!("{bytes} bytes"), "a complete header: the file is truncated");
        let mut prefix = [0; PREFIX];
        if bytes < PREFIX as u64 {
            return Err(short());
        }
        reader.read_exact(&mut prefix)?;
        let [_, _, _, _, _, _, _, _, v0, v1, n0, n1, checksum @ ..] = prefix;
        let version = u16::from_le_bytes([v0, v1]);
        if prefix[..8] != MAGIC {
            return Err(fault(HEADER, "other leading bytes", "those of a packed field"));
        }
        if version != VERSION {
            return Err(fault(HEADER, format!("version {version}"), format!("version {VERSION}")));
        }
        let count = usize::from(u16::from_le_bytes([n0, n1]));
        if count > MAX_SECTIONS {
            return Err(fault(HEADER, format!("{count} sections"), format!("at most {MAX_SECTIONS}")));
        }
        if bytes < (PREFIX + count * ENTRY) as u64 {
            return Err(short());
        }
        let mut list = vec![0; count * ENTRY];
        reader.read_exact(&mut list)?;
        if crc32fast::hash(&list) != u32::from_le_bytes(checksum) {
            return Err(fault(HEADER, "a wrong checksum", "that of the list of sections"));
        }
        let mut start = (PREFIX + list.len()) as u64;
        let mut sections = Vec::with_capacity(count);
        for entry in list.chunks_exact(ENTRY) {
            let word = |at: usize| u32::from_le_bytes([entry[at], entry[at + 1], entry[at + 2], entry[at + 3]]);
            let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
            let name = [entry[0], entry[1], entry[2], entry[3]];
            let section = Section { name, checksum: word(4), stored: long(8), raw: long(16), start };
            start = start.saturating_add(section.stored);
            sections.push(section);
        }
        if start != bytes {
            let why = if start > bytes { "the file is truncated" } else { "something follows the field" };
            return Err(fault(HEADER, format!("{bytes} bytes"), format!("{start}: {why}")));
        }
        Ok(Self { reader, bytes, sections, read: 0 })
    }

    /// Returns an error if `bytes` of memory are so many more than the file has that it was likely made to exhaust
    /// memory.
    pub fn check_room(&self, section: &'static str, bytes: u64) -> Result<(), ReadFault> {
        if bytes > room(self.bytes) {
            return Err(fault(section, format!("{bytes} bytes from a file of {}", self.bytes), "a plausible size"));
        }
        Ok(())
    }

    fn section(&self, name: &'static str) -> Result<&Section, ReadFault> {
        let mut found = self.sections.iter().filter(|section| section.name == *name.as_bytes());
        match (found.next(), found.next()) {
            (Some(section), None) => Ok(section),
            (None, _) => Err(fault(name, "no section", "one")),
            _ => Err(fault(name, "several sections", "one")),
        }
    }

    /// Returns whether there is such a section.
    pub fn has(&self, name: &'static str) -> bool {
        self.sections.iter().any(|section| section.name == *name.as_bytes())
    }

    /// Returns the size of a section's content, as the file claims it.
    pub fn size(&self, name: &'static str) -> Result<u64, ReadFault> {
        self.section(name).map(|section| section.raw)
    }

    /// Reads a section whose content has at most `most` bytes.
    pub fn read_up_to(&mut self, name: &'static str, most: u64) -> Result<Vec<u8>, ReadFault> {
        let length = self.size(name)?;
        if length > most {
            return Err(fault(name, format!("{length} bytes of content"), format!("at most {most}")));
        }
        self.read(name, length)
    }

    /// Reads a section, whose content must have `length` bytes.
    pub fn read(&mut self, name: &'static str, length: u64) -> Result<Vec<u8>, ReadFault> {
        let &Section { checksum, stored: size, raw, start, .. } = self.section(name)?;
        if raw != length {
            return Err(fault(name, format!("{raw} bytes of content"), format!("{length}")));
        }
        if length > size.saturating_mul(DEFLATE_RATIO) {
            return Err(fault(name, format!("{length} bytes deflated to {size}"), "a possible ratio"));
        }
        self.read = self.read.saturating_add(length);
        self.check_room(name, self.read)?;
        self.reader.seek(SeekFrom::Start(start))?;
        // No more than the file has: the sections end where it ends.
        let mut stored = Vec::new();
        self.reader.by_ref().take(size).read_to_end(&mut stored)?;
        if stored.len() as u64 != size {
            return Err(fault(name, "an unexpected end", "a complete section"));
        }
        if crc32fast::hash(&stored) != checksum {
            return Err(fault(name, "a wrong checksum", "that of the section"));
        }
        if raw == size {
            return Ok(stored);
        }
        let mut content = Vec::new();
        // A byte more shows that the stream is longer.
        match DeflateDecoder::new(&stored[..]).take(length + 1).read_to_end(&mut content) {
            Ok(_) if content.len() as u64 == length => Ok(content),
            _ => Err(fault(name, "a damaged deflate stream", format!("one of {length} bytes"))),
        }
    }
}

/// Deflates the sections and returns the whole file, and the size of every section in it.
#[cfg(feature = "write")]
pub(super) fn build(sections: &[(&'static str, Vec<u8>)]) -> (Vec<u8>, Vec<(&'static str, usize)>) {
    use flate2::{Compression, read::DeflateEncoder};
    use rayon::prelude::*;

    /// What deflate must save to be worth the time: the share of a section that is one over this.
    const LEAST_GAIN: usize = 50;
    let stored = |(_, raw): &(_, Vec<u8>)| {
        let mut deflated = Vec::new();
        let result = DeflateEncoder::new(&raw[..], Compression::best()).read_to_end(&mut deflated);
        let is_smaller = result.is_ok() && deflated.len() < raw.len() - raw.len() / LEAST_GAIN;
        if is_smaller { deflated } else { raw.clone() }
    };
    let stored: Vec<Vec<u8>> = sections.par_iter().map(stored).collect();
    let mut list = Vec::new();
    for ((name, raw), stored) in sections.iter().zip(&stored) {
        list.extend(name.as_bytes());
        list.extend(crc32fast::hash(stored).to_le_bytes());
        list.extend((stored.len() as u64).to_le_bytes());
        list.extend((raw.len() as u64).to_le_bytes());
    }
    let mut file = MAGIC.to_vec();
    file.extend(VERSION.to_le_bytes());
    file.extend((sections.len() as u16).to_le_bytes());
    file.extend(crc32fast::hash(&list).to_le_bytes());
    file.extend(list);
    file.extend(stored.concat());
    let sizes = sections.iter().zip(&stored).map(|((name, _), stored)| (*name, stored.len())).collect();
    (file, sizes)
}
