//! Inflates the members of archives, with zlib-rs.

use std::io::{self, Read};

use zip::{CompressionMethod, read::ZipFile};
use zlib_rs::{Inflate, InflateFlush, Status, crc32::crc32};

/// The number of compressed bytes that are read at a time.
const PART: usize = 1 << 16;
/// The size of the window of a raw deflate stream, as a power of two.
const WINDOW_BITS: u8 = 15;

/// The content of a member.
pub(super) struct Content<'a> {
    member: ZipFile<'a>,
    /// `None` if the member is stored.
    inflate: Option<Inflate>,
    part: Vec<u8>,
    /// The bytes of `part` that are not inflated yet.
    start: usize,
    end: usize,
    has_ended: bool,
    checksum: u32,
}

impl<'a> Content<'a> {
    /// Reads the content of a stored or deflated member, which was opened raw.
    pub fn new(member: ZipFile<'a>) -> Self {
        let inflate = (member.compression() == CompressionMethod::Deflated).then(|| Inflate::new(false, WINDOW_BITS));
        Self { member, inflate, part: vec![0; PART], start: 0, end: 0, has_ended: false, checksum: 0 }
    }

    /// Inflates some bytes. Returns 0 at the end.
    fn inflate(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Some(inflate) = &mut self.inflate else { return self.member.read(buffer) };
        while !self.has_ended {
            if self.start == self.end {
                (self.start, self.end) = (0, self.member.read(&mut self.part)?);
            }
            let (read, written) = (inflate.total_in(), inflate.total_out());
            let status = inflate.decompress(&self.part[self.start..self.end], buffer, InflateFlush::NoFlush);
            let status = status.map_err(|_| io::Error::other("a corrupt deflate stream"))?;
            let (read, written) = ((inflate.total_in() - read) as usize, (inflate.total_out() - written) as usize);
            self.start += read;
            self.has_ended = status == Status::StreamEnd;
            if written > 0 {
                return Ok(written);
            }
            if read == 0 && self.end == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
        Ok(0)
    }
}

impl Read for Content<'_> {
    /// Fails at the end if the checksum does not match.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let count = self.inflate(buffer)?;
        self.checksum = crc32(self.checksum, &buffer[..count]);
        if count == 0 && self.checksum != self.member.crc32() {
            return Err(io::Error::other("a wrong checksum"));
        }
        Ok(count)
    }
}
