//! The archive: finding an array in an `.npz` file and streaming its elements, without trust in what the file claims.

use std::io::{self, Read, Seek, SeekFrom};

use zip::{CompressionMethod, ZipArchive, read::ZipFile, result::ZipError};

use super::error::{ReadFault, printable};
use super::npy::{Dtype, Header, Number};

/// Members that an archive may have; a PlenOctree has a dozen.
const MAX_MEMBERS: u64 = 4096;
/// How many times smaller than its content a large array may be. Trained fields do not reach 10, and of smooth synthetic
/// ones only those small enough not to be asked.
const MAX_RATIO: u64 = 200;
/// How many times smaller than its content a deflated array can be at all.
const DEFLATE_RATIO: u64 = 1032;
/// Bytes that count as large for an array that is streamed.
const LARGE: u64 = 1 << 30;
/// Bytes that count as large for an array that is held in memory.
const LARGE_IN_MEMORY: u64 = 128 << 20;
/// Bytes of a text that are read.
const MAX_TEXT: u64 = 1 << 10;
/// Elements that are converted together.
const BLOCK: usize = 1 << 16;

/// An open archive.
pub(super) struct Archive<R> {
    zip: ZipArchive<R>,
    bytes: u64,
}

impl<R: Read + Seek> Archive<R> {
    /// Reads the archive's directory.
    pub fn open(mut reader: R) -> Result<Self, ReadFault> {
        let bytes = check_directory(&mut reader)?;
        let zip = ZipArchive::new(reader).map_err(|error| match error {
            ZipError::Io(error) if error.raw_os_error().is_some() => ReadFault::Io(error),
            error => not_an_archive(format!("a zip directory that cannot be read ({error})")),
        })?;
        Ok(Self { zip, bytes })
    }

    /// Whether there is an array of this name.
    pub fn has(&self, key: &str) -> bool {
        self.zip.file_names().any(|name| name.strip_suffix(".npy") == Some(key))
    }

    /// The memory that what the file says about `key` may take.
    pub fn room(&self, key: &'static str) -> Room {
        Room { key, packed: self.bytes }
    }

    /// Opens the array `key`, which holds what `meaning` says.
    pub fn array(&mut self, key: &'static str, meaning: &'static str) -> Result<Array<'_>, ReadFault> {
        let fault = |found: String, expected| ReadFault::Member { key, found, expected };
        let zip_fault = |error| match error {
            ZipError::Io(error) => member_fault(key, error),
            ZipError::FileNotFound => ReadFault::Missing { key, expected: meaning },
            error => fault(format!("a member that cannot be read ({error})"), "a stored or deflated array"),
        };
        let name = format!("{key}.npy");
        // Of the ways in which a member can be encrypted, `by_name` refuses one and panics at another. The latter is
        // found by a try with a password, which `by_name_decrypt` uses only where the member says that it needs one.
        match self.zip.by_name_decrypt(&name, &[]).map(|member| member.is_ok()) {
            Ok(true) => {}
            Ok(false) => return Err(fault("an encrypted member".into(), "a stored or deflated array")),
            Err(error @ ZipError::UnsupportedArchive(_)) => {
                let found =
                    self.compression(&name).unwrap_or_else(|| format!("a member that cannot be read ({error})"));
                return Err(fault(found, "a stored or deflated array"));
            }
            Err(error) => return Err(zip_fault(error)),
        }
        let bytes = self.bytes;
        let mut reader = self.zip.by_name(&name).map_err(zip_fault)?;
        let size = reader.size();
        let packed = reader.compressed_size();
        let stored = reader.compression() == CompressionMethod::Stored;
        if packed > bytes.saturating_sub(reader.data_start()) {
            return Err(fault(format!("{packed} bytes in a file of {bytes}"), "a whole npy array"));
        }
        if size > packed.saturating_mul(if stored { 1 } else { DEFLATE_RATIO }) {
            return Err(bomb(key, size, packed));
        }
        check_ratio(key, size, packed, LARGE)?;
        let (header, length) = Header::read(&mut reader).map_err(|error| member_fault(key, error))?;
        let content = header.elements().and_then(|count| count.checked_mul(header.dtype.size.max(1)));
        if content.and_then(|content| content.checked_add(length)).is_none_or(|whole| whole > size) {
            return Err(ReadFault::Shape {
                key,
                found: header.shape,
                expected: format!("no more than the {size} bytes that are there"),
            });
        }
        Ok(Array { key, header, packed, reader })
    }
}

impl<R: Read + Seek> Archive<R> {
    /// How a member is compressed that cannot be unpacked, for messages.
    fn compression(&mut self, name: &str) -> Option<String> {
        (0..self.zip.len()).find_map(|index| {
            let member = self.zip.by_index_raw(index).ok().filter(|member| member.name() == name)?;
            #[allow(deprecated)]
            let method = member.compression().to_u16();
            let known = match method {
                9 => " (Deflate64)",
                12 => " (Bzip2)",
                14 => " (LZMA)",
                93 => " (Zstd)",
                _ => "",
            };
            Some(format!("compression method {method}{known}"))
        })
    }
}

/// How much memory an array may take.
#[derive(Clone, Copy)]
pub(super) struct Room {
    key: &'static str,
    /// Bytes that it takes in the file.
    packed: u64,
}

impl Room {
    /// Refuses what would take so many bytes in memory and so few in the file that it is likelier a bomb.
    pub fn check(self, bytes: u64) -> Result<(), ReadFault> {
        check_ratio(self.key, bytes, self.packed, LARGE_IN_MEMORY)
    }
}

/// Refuses an array that is large and packed so tightly that it is likelier a bomb than a field.
fn check_ratio(key: &'static str, size: u64, packed: u64, large: u64) -> Result<(), ReadFault> {
    if size > large && size > packed.saturating_mul(MAX_RATIO) { Err(bomb(key, size, packed)) } else { Ok(()) }
}

fn bomb(key: &'static str, size: u64, packed: u64) -> ReadFault {
    let found = format!("{size} bytes packed in {packed}");
    ReadFault::Member { key, found, expected: "an array that is not packed beyond what fields are" }
}

fn not_an_archive(found: impl Into<String>) -> ReadFault {
    ReadFault::NotAnArchive { found: found.into() }
}

fn member_fault(key: &'static str, error: io::Error) -> ReadFault {
    if error.raw_os_error().is_some() {
        return ReadFault::Io(error);
    }
    let found = match error.kind() {
        io::ErrorKind::UnexpectedEof => "its end too early".into(),
        _ => error.to_string(),
    };
    ReadFault::Member { key, found, expected: "a whole npy array" }
}

/// Checks the end of the archive and returns the file's length.
///
/// The `zip` crate reserves room for as many members as the directory claims and searches for a zip64 directory byte by
/// byte, so a hostile file could make it take all memory or hours.
fn check_directory(reader: &mut (impl Read + Seek)) -> Result<u64, ReadFault> {
    const END: usize = 22;
    const LOCATOR: usize = 20;
    const END_64: usize = 56;
    let bytes = reader.seek(SeekFrom::End(0))?;
    let tail_length = bytes.min((END + LOCATOR + usize::from(u16::MAX)) as u64);
    reader.seek(SeekFrom::Start(bytes - tail_length))?;
    let mut tail = vec![0; tail_length as usize];
    reader.read_exact(&mut tail)?;
    let end = (0..=tail.len().saturating_sub(END)).rev().find(|&at| tail[at..].starts_with(b"PK\x05\x06"));
    let Some((end, record)) = end.and_then(|end| Some((end, tail.get(end..end + END)?))) else {
        return Err(not_an_archive(if bytes == 0 { "an empty file" } else { "no zip directory at its end" }));
    };
    let comment = usize::from(u16::from_le_bytes([record[20], record[21]]));
    if end + END + comment > tail.len() {
        return Err(not_an_archive("a zip directory that is cut short"));
    }
    let mut members = u64::from(u16::from_le_bytes([record[8], record[9]]));
    let locator = (tail.len() - END - comment).checked_sub(LOCATOR).map(|at| &tail[at..at + LOCATOR]);
    if let Some([b'P', b'K', 6, 7, _, _, _, _, place @ .., _, _, _, _]) = locator {
        let mut record = [0; END_64];
        let place = place.try_into().map(u64::from_le_bytes).unwrap_or(u64::MAX);
        if place <= bytes.saturating_sub(END_64 as u64) {
            reader.seek(SeekFrom::Start(place))?;
            reader.read_exact(&mut record)?;
        }
        let [b'P', b'K', 6, 6, rest @ ..] = record else {
            return Err(not_an_archive("a zip64 directory that is not where it should be"));
        };
        members = rest[28..36].try_into().map(u64::from_le_bytes).unwrap_or(u64::MAX);
    }
    if members > MAX_MEMBERS {
        return Err(not_an_archive(format!("a zip directory of {members} members")));
    }
    reader.rewind()?;
    Ok(bytes)
}

/// An array whose elements are still to be read.
pub(super) struct Array<'a> {
    key: &'static str,
    header: Header,
    /// Bytes that it takes in the file.
    packed: u64,
    reader: ZipFile<'a>,
}

impl Array<'_> {
    /// The array's name.
    pub fn key(&self) -> &'static str {
        self.key
    }

    /// The type of its elements.
    pub fn dtype(&self) -> &Dtype {
        &self.header.dtype
    }

    /// Whether it is in Fortran order.
    pub fn fortran(&self) -> bool {
        self.header.fortran
    }

    /// Its axes.
    pub fn shape(&self) -> &[u64] {
        &self.header.shape
    }

    /// The refusal of its dtype.
    pub fn dtype_fault(&self, expected: &'static str) -> ReadFault {
        ReadFault::Dtype { key: self.key, found: printable(&self.header.dtype.name), expected }
    }

    /// The refusal of its shape.
    pub fn shape_fault(&self, expected: impl Into<String>) -> ReadFault {
        ReadFault::Shape { key: self.key, found: self.header.shape.clone(), expected: expected.into() }
    }

    /// Refuses any other shape.
    pub fn check_shape(&self, expected: &[u64]) -> Result<(), ReadFault> {
        if self.header.shape == expected { Ok(()) } else { Err(self.shape_fault(format!("{expected:?}"))) }
    }

    /// The memory that it may take.
    pub fn room(&self) -> Room {
        Room { key: self.key, packed: self.packed }
    }

    /// The one string in the array, from bytes or unicode.
    pub fn text(mut self) -> Result<String, ReadFault> {
        let Dtype { kind, size, swapped, .. } = self.header.dtype;
        if !matches!(kind, 'U' | 'S') || size > MAX_TEXT {
            return Err(self.dtype_fault("a short string"));
        }
        if self.header.elements() != Some(1) {
            return Err(self.shape_fault("[]"));
        }
        let mut bytes = vec![0; size as usize];
        self.reader.read_exact(&mut bytes).map_err(|error| member_fault(self.key, error))?;
        let letter = |letter: u32| char::from_u32(letter).unwrap_or(char::REPLACEMENT_CHARACTER);
        let text: String = match kind {
            'S' => bytes.iter().map(|&byte| char::from(byte)).collect(),
            _ => bytes
                .chunks_exact(4)
                .map(|code| u32::from_ne_bytes([code[0], code[1], code[2], code[3]]))
                .map(|code| letter(if swapped { code.swap_bytes() } else { code }))
                .collect(),
        };
        self.finish()?;
        Ok(text.trim_end_matches('\0').to_owned())
    }

    /// Streams the elements, whose dtype must be that of `T`, in blocks, from the file's order and byte order.
    ///
    /// `visit` gets the index of an element, counted in C order, and it and its successors along the last axes: whole
    /// rows of `width` where the file is in C order, single elements where it is in Fortran order. In C order
    /// elements from `end` on are not visited.
    pub fn stream<T: Number>(
        mut self,
        width: usize,
        end: usize,
        mut visit: impl FnMut(usize, &[T]) -> Result<(), ReadFault>,
    ) -> Result<(), ReadFault> {
        let too_large = || self.shape_fault("an array that fits in memory");
        let shape: Option<Vec<usize>> = self.header.shape.iter().map(|&axis| axis.try_into().ok()).collect();
        let shape = shape.ok_or_else(too_large)?;
        let elements =
            shape.iter().try_fold(1usize, |product, &axis| product.checked_mul(axis)).ok_or_else(too_large)?;
        if elements == 0 {
            return self.finish();
        }
        let end = if self.header.fortran { elements } else { end.min(elements) };
        let width = width.max(1);
        let mut buffer = vec![T::zeroed(); end.min(width * (BLOCK / width).max(1))];
        let mut order = FortranOrder::new(&shape);
        let mut start = 0;
        while start < end {
            let length = buffer.len().min(end - start);
            let block = &mut buffer[..length];
            self.reader.read_exact(bytemuck::cast_slice_mut(block)).map_err(|error| member_fault(self.key, error))?;
            if self.header.dtype.swapped {
                block.iter_mut().for_each(|number| *number = number.swap());
            }
            if self.header.fortran {
                for number in block.chunks_exact(1) {
                    visit(order.next(), number)?;
                }
            } else {
                for (row, numbers) in block.chunks(width).enumerate() {
                    visit(start + row * width, numbers)?;
                }
            }
            start += length;
        }
        self.finish()
    }

    /// Reads on to the end of the member, where its checksum is compared.
    fn finish(mut self) -> Result<(), ReadFault> {
        io::copy(&mut self.reader, &mut io::sink()).map(|_| ()).map_err(|error| member_fault(self.key, error))
    }
}

/// Counts through an array in Fortran order and tells each element's index in C order.
struct FortranOrder {
    /// Length of each axis, its stride in C order, and the place on it.
    axes: Vec<(usize, usize, usize)>,
    index: usize,
}

impl FortranOrder {
    fn new(shape: &[usize]) -> Self {
        let mut stride = 1;
        let mut axes: Vec<_> = shape
            .iter()
            .rev()
            .map(|&length| {
                let axis = (length, stride, 0);
                stride *= length;
                axis
            })
            .collect();
        axes.reverse();
        Self { axes, index: 0 }
    }

    fn next(&mut self) -> usize {
        let index = self.index;
        for (length, stride, place) in &mut self.axes {
            *place += 1;
            self.index += *stride;
            if *place < *length {
                break;
            }
            self.index -= *stride * *length;
            *place = 0;
        }
        index
    }
}
