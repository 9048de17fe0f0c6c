//! Finds arrays in an `.npz` archive and streams their elements, without trusting what the file claims.

use std::io::{self, Read, Seek, SeekFrom, Take};

use bytemuck::Pod;
use zip::{CompressionMethod, ZipArchive, read::ZipFile, result::ZipError};

use super::error::{ReadFault, printable};
use super::npy::{Dtype, Header, swap};
use super::room::room;

/// Maximum number of members in an archive. A PlenOctree has a dozen.
const MAX_MEMBERS: u64 = 4096;
/// Maximum compression ratio that deflate can reach.
const DEFLATE_RATIO: u64 = 1032;
/// Maximum size of a text, in bytes.
const MAX_TEXT: u64 = 1 << 10;
/// Number of elements that are converted at a time.
const CHUNK: usize = 1 << 16;

/// An open archive.
pub(super) struct Archive<R> {
    zip: ZipArchive<R>,
    bytes: u64,
}

impl<R: Read + Seek> Archive<R> {
    /// Opens an archive and reads its directory.
    pub fn open(mut reader: R) -> Result<Self, ReadFault> {
        let bytes = check_directory(&mut reader)?;
        let zip = ZipArchive::new(reader).map_err(|error| match error {
            ZipError::Io(error) if error.raw_os_error().is_some() => ReadFault::Io(error),
            error => not_an_archive(format!("an unreadable zip directory ({error})")),
        })?;
        let mut archive = Self { zip, bytes };
        archive.check_overlaps()?;
        Ok(archive)
    }

    /// Returns an error if two members share bytes, which lets a small file claim a lot of content.
    fn check_overlaps(&mut self) -> Result<(), ReadFault> {
        let mut members = Vec::new();
        for index in 0..self.zip.len() {
            match self.zip.by_index_raw(index) {
                Ok(member) => {
                    let end = member.data_start().saturating_add(member.compressed_size());
                    if end <= self.bytes {
                        members.push((member.header_start(), end, index));
                    }
                }
                Err(ZipError::Io(error)) if error.raw_os_error().is_some() => return Err(ReadFault::Io(error)),
                // No array is read from it, or opening that array returns an error.
                Err(_) => {}
            }
        }
        members.sort_unstable();
        match members.windows(2).find(|pair| pair[1].0 < pair[0].1) {
            None => Ok(()),
            Some(pair) => {
                let name = |(.., index): (u64, u64, usize)| {
                    self.zip.by_index_raw(index).map_or_else(|_| String::new(), |member| printable(member.name()))
                };
                let [first, second] = [pair[0], pair[1]].map(name);
                Err(not_an_archive(format!("the overlapping members {first} and {second}")))
            }
        }
    }

    /// Returns whether the archive has an array named `key`.
    pub fn has(&self, key: &str) -> bool {
        self.zip.file_names().any(|name| name.strip_suffix(".npy") == Some(key))
    }

    /// Returns the memory limit for data expanded from the array `key`, relative to the size of the whole file.
    pub fn room(&self, key: &'static str) -> Room {
        Room { key, file: self.bytes }
    }

    /// Opens the array `key`. `meaning` describes its content in errors.
    pub fn array(&mut self, key: &'static str, meaning: &'static str) -> Result<Array<'_>, ReadFault> {
        let fault = |found: String, expected| ReadFault::Member { key, found, expected };
        let zip_fault = |error| match error {
            ZipError::Io(error) => member_fault(key, error),
            ZipError::FileNotFound => ReadFault::Missing { key, expected: meaning },
            error => fault(format!("an unreadable member ({error})"), "a stored or deflated array"),
        };
        let name = format!("{key}.npy");
        // Depending on how a member is encrypted, `by_name` returns an error or panics. Opening the member with a
        // password first detects the latter case: `by_name_decrypt` uses the password only if the member claims to need
        // one.
        match self.zip.by_name_decrypt(&name, &[]).map(|member| member.is_ok()) {
            Ok(true) => {}
            Ok(false) => return Err(fault("an encrypted member".into(), "a stored or deflated array")),
            Err(error @ ZipError::UnsupportedArchive(_)) => {
                let found = self.compression(&name).unwrap_or_else(|| format!("an unreadable member ({error})"));
                return Err(fault(found, "a stored or deflated array"));
            }
            Err(error) => return Err(zip_fault(error)),
        }
        let bytes = self.bytes;
        let member = self.zip.by_name(&name).map_err(zip_fault)?;
        let size = member.size();
        let packed = member.compressed_size();
        let stored = member.compression() == CompressionMethod::Stored;
        if packed > bytes.saturating_sub(member.data_start()) {
            return Err(fault(format!("{packed} bytes in a file of {bytes} bytes"), "a complete npy array"));
        }
        if size > packed.saturating_mul(if stored { 1 } else { DEFLATE_RATIO }) {
            return Err(bomb(key, size, packed));
        }
        Room { key, file: bytes }.check(size)?;
        let mut reader = member.take(size);
        let (header, length) = Header::read(&mut reader).map_err(|error| member_fault(key, error))?;
        let content = header.elements().and_then(|count| count.checked_mul(header.dtype.size.max(1)));
        if content.and_then(|content| content.checked_add(length)).is_none_or(|whole| whole > size) {
            return Err(ReadFault::Shape {
                key,
                found: header.shape,
                expected: format!("a shape that fits in {size} bytes"),
            });
        }
        Ok(Array { key, header, file: bytes, size, reader })
    }
}

impl<R: Read + Seek> Archive<R> {
    /// Describes the compression of a member that cannot be decompressed, for messages.
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

/// The memory limit of an array.
#[derive(Clone, Copy)]
pub(super) struct Room {
    key: &'static str,
    /// Size of the file, in bytes.
    file: u64,
}

impl Room {
    /// Returns an error if `bytes` is so much more than the size of the file that the file is likely a zip bomb.
    pub fn check(self, bytes: u64) -> Result<(), ReadFault> {
        if bytes <= room(self.file) { Ok(()) } else { Err(bomb(self.key, bytes, self.file)) }
    }
}

fn bomb(key: &'static str, size: u64, packed: u64) -> ReadFault {
    let found = format!("{size} bytes compressed to {packed}");
    ReadFault::Member { key, found, expected: "a plausible compression ratio" }
}

fn not_an_archive(found: impl Into<String>) -> ReadFault {
    ReadFault::NotAnArchive { found: found.into() }
}

fn member_fault(key: &'static str, error: io::Error) -> ReadFault {
    if error.raw_os_error().is_some() {
        return ReadFault::Io(error);
    }
    let found = match error.kind() {
        io::ErrorKind::UnexpectedEof => "an unexpected end".into(),
        _ => match error.to_string().as_str() {
            // What `zip` says.
            "Invalid checksum" => "a wrong checksum".into(),
            other => other.into(),
        },
    };
    ReadFault::Member { key, found, expected: "a complete npy array" }
}

/// Checks the end of the archive and returns the length of the file.
///
/// The `zip` crate allocates memory for as many members as the directory claims, and searches for a zip64 directory
/// byte by byte. A hostile file could exhaust memory or take hours.
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
        let mut start = [0; 4];
        reader.rewind()?;
        let is_archive = reader.read_exact(&mut start).is_ok() && start == *b"PK\x03\x04";
        return Err(not_an_archive(match () {
            () if is_archive => "no zip directory at the end (the file is truncated)",
            () if bytes == 0 => "an empty file",
            () => "no zip directory at the end",
        }));
    };
    let comment = usize::from(u16::from_le_bytes([record[20], record[21]]));
    if end + END + comment > tail.len() {
        return Err(not_an_archive("a truncated zip directory"));
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
            return Err(not_an_archive("a misplaced zip64 directory"));
        };
        members = rest[28..36].try_into().map(u64::from_le_bytes).unwrap_or(u64::MAX);
    }
    if members > MAX_MEMBERS {
        return Err(not_an_archive(format!("a zip directory with {members} members")));
    }
    reader.rewind()?;
    Ok(bytes)
}

/// An array whose elements have not been read yet.
pub(super) struct Array<'a> {
    key: &'static str,
    header: Header,
    /// Size of the file, in bytes.
    file: u64,
    /// Size that the directory claims, in bytes.
    size: u64,
    /// Reads no more than the claimed size.
    reader: Take<ZipFile<'a>>,
}

impl Array<'_> {
    /// Returns the name of the array.
    pub fn key(&self) -> &'static str {
        self.key
    }

    /// Returns the type of the elements.
    pub fn dtype(&self) -> &Dtype {
        &self.header.dtype
    }

    /// Returns whether the array is in Fortran order.
    pub fn fortran(&self) -> bool {
        self.header.fortran
    }

    /// Returns the length of every axis.
    pub fn shape(&self) -> &[u64] {
        &self.header.shape
    }

    /// Returns the error for an unsupported dtype.
    pub fn dtype_fault(&self, expected: &'static str) -> ReadFault {
        ReadFault::Dtype { key: self.key, found: printable(&self.header.dtype.name), expected }
    }

    /// Returns the error for a wrong shape.
    pub fn shape_fault(&self, expected: impl Into<String>) -> ReadFault {
        ReadFault::Shape { key: self.key, found: self.header.shape.clone(), expected: expected.into() }
    }

    /// Returns an error unless the shape is `expected`.
    pub fn check_shape(&self, expected: &[u64]) -> Result<(), ReadFault> {
        if self.header.shape == expected { Ok(()) } else { Err(self.shape_fault(format!("{expected:?}"))) }
    }

    /// Returns the memory limit of the array.
    pub fn room(&self) -> Room {
        Room { key: self.key, file: self.file }
    }

    /// Reads the only string in the array, from bytes or Unicode.
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

    /// Streams the elements in chunks, in the order of the file. `T` must match the dtype. The byte order is converted.
    ///
    /// `visit` is called with consecutive elements along the last axes, and with the index of the first of them in C
    /// order. It gets whole rows of `width` elements if the file is in C order, and single elements if it is in Fortran
    /// order. In C order, elements from `end` on are skipped.
    pub fn stream<T: Pod>(
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
        let mut buffer = vec![T::zeroed(); end.min(width * (CHUNK / width).max(1))];
        let mut order = FortranOrder::new(&shape);
        let mut start = 0;
        while start < end {
            let length = buffer.len().min(end - start);
            let chunk = &mut buffer[..length];
            self.reader.read_exact(bytemuck::cast_slice_mut(chunk)).map_err(|error| member_fault(self.key, error))?;
            if self.header.dtype.swapped {
                chunk.iter_mut().for_each(|number| *number = swap(*number));
            }
            if self.header.fortran {
                for number in chunk.chunks_exact(1) {
                    visit(order.next(), number)?;
                }
            } else {
                for (row, numbers) in chunk.chunks(width).enumerate() {
                    visit(start + row * width, numbers)?;
                }
            }
            start += length;
        }
        self.finish()
    }

    /// Reads to the end of the member, where its checksum is verified, and checks that it has the claimed size.
    fn finish(mut self) -> Result<(), ReadFault> {
        let fault = |error| member_fault(self.key, error);
        io::copy(&mut self.reader, &mut io::sink()).map_err(fault)?;
        if self.reader.limit() > 0 {
            return Err(fault(io::ErrorKind::UnexpectedEof.into()));
        }
        // Only reading past the last byte shows where the member ends, and verifies the checksum.
        match self.reader.into_inner().read(&mut [0]).map_err(fault)? {
            0 => Ok(()),
            _ => Err(fault(io::Error::other(format!("more than the {} bytes that it claims", self.size)))),
        }
    }
}

/// Steps through an array in Fortran order and returns the index of each element in C order.
struct FortranOrder {
    /// Length, stride in C order and current position of each axis.
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
