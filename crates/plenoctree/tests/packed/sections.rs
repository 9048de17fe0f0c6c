//! The sections of a packed field, to change and to write again with valid checksums. Written from `docs/format.md`.

use std::io::Read;

use flate2::{
    Compression,
    read::{DeflateDecoder, DeflateEncoder},
};

/// A file, as its sections' contents.
pub struct Sections {
    pub version: u16,
    /// A section whose deflate stream is to be damaged, with a valid checksum.
    pub damaged: Option<&'static str>,
    /// A section, and the size that its content is to claim.
    pub claimed: Option<(&'static str, u64)>,
    all: Vec<(String, Vec<u8>)>,
}

fn all_of(mut reader: impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).unwrap();
    bytes
}

fn number<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().unwrap()
}

impl Sections {
    pub fn parse(bytes: &[u8]) -> Self {
        assert_eq!(bytes[..8], *b"\x89PLO\r\n\x1a\n");
        let count = usize::from(u16::from_le_bytes(number(bytes, 10)));
        let mut start = 16 + 24 * count;
        let all = (0..count)
            .map(|index| {
                let entry = &bytes[16 + 24 * index..][..24];
                let length = u64::from_le_bytes(number(entry, 8)) as usize;
                let stored = &bytes[start..start + length];
                start += length;
                assert_eq!(crc32fast::hash(stored), u32::from_le_bytes(number(entry, 4)));
                let size = u64::from_le_bytes(number(entry, 16));
                let content = if size == length as u64 { stored.to_vec() } else { all_of(DeflateDecoder::new(stored)) };
                assert_eq!(content.len() as u64, size);
                (String::from_utf8(entry[..4].to_vec()).unwrap(), content)
            })
            .collect();
        assert_eq!(start, bytes.len());
        Self { version: u16::from_le_bytes(number(bytes, 8)), damaged: None, claimed: None, all }
    }

    pub fn get(&mut self, name: &str) -> &mut Vec<u8> {
        &mut self.all.iter_mut().find(|(other, _)| other == name).unwrap().1
    }

    pub fn add(&mut self, name: &str, content: Vec<u8>) {
        self.all.push((name.into(), content));
    }

    pub fn remove(&mut self, name: &str) {
        self.all.retain(|(other, _)| other != name);
    }

    pub fn repeat(&mut self, name: &str) {
        let content = self.get(name).clone();
        self.add(name, content);
    }

    pub fn bytes(&self) -> Vec<u8> {
        let (mut list, mut body) = (Vec::new(), Vec::new());
        for (name, content) in &self.all {
            let mut stored = all_of(DeflateEncoder::new(&content[..], Compression::default()));
            if stored.len() == content.len() {
                stored.clone_from(content);
            }
            if self.damaged == Some(name) {
                // A block of a type that does not exist.
                stored[0] |= 6;
            }
            let claimed = self.claimed.filter(|(other, _)| other == name).map(|(_, length)| length);
            list.extend(name.as_bytes());
            list.extend(crc32fast::hash(&stored).to_le_bytes());
            list.extend((stored.len() as u64).to_le_bytes());
            list.extend(claimed.unwrap_or(content.len() as u64).to_le_bytes());
            body.extend(stored);
        }
        let mut bytes = b"\x89PLO\r\n\x1a\n".to_vec();
        bytes.extend(self.version.to_le_bytes());
        bytes.extend((self.all.len() as u16).to_le_bytes());
        bytes.extend(crc32fast::hash(&list).to_le_bytes());
        bytes.extend(list);
        bytes.extend(body);
        bytes
    }
}
