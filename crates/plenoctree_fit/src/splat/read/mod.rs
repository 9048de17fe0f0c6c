//! Reads captures, without trusting what a file claims.

mod gltf;
mod packed_ply;
mod ply;
mod settings;
mod shared;
mod sog;
mod splat;
mod spz;

pub use settings::{SplatSettings, SpzAxes};

use std::{fs, io, path::Path};

use self::shared::{Beside, LARGEST_FILE};
use super::{error::SplatError, splats::Splats};
use crate::file::{Fault, printable, without_mark};

/// The formats, for errors.
const FORMATS: &str = "a capture: .ply, .spz, .sog, .splat, .glb, .gltf, or the meta.json of a SOG folder";
/// The same for formats that other programs convert.
const CONVERTED: &str = "another capture: convert it to .ply or .sog with splat-transform or SuperSplat";

impl Splats {
    /// Reads a capture: a `.ply` file of 3D Gaussian splatting, also one that PlayCanvas' tools compressed, SPZ
    /// (versions 2 to 4), SOG (a `.sog` file, its `meta.json`, or the folder of it), glTF with
    /// `KHR_gaussian_splatting`, or a `.splat` file. The format is detected from the content of the file, and that of
    /// `.splat` files from the extension.
    ///
    /// All formats give the same coordinates for the same capture: those of the `.ply` file.
    ///
    /// # Errors
    ///
    /// Returns an error that names the file if it cannot be read or is damaged, or if it has no valid Gaussian.
    pub fn read(path: impl AsRef<Path>, settings: &SplatSettings) -> Result<Self, SplatError> {
        let path = path.as_ref();
        let path = if path.is_dir() { path.join("meta.json") } else { path.to_path_buf() };
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let file = path.display().to_string();
        let bytes = fs::read(&path).map_err(|source| SplatError::Io { file: printable(&file), source })?;
        Self::from_bytes(&bytes, &file, settings, &mut |name| {
            let beside = folder.join(name);
            if fs::metadata(&beside)?.len() > LARGEST_FILE {
                return Err(io::Error::new(io::ErrorKind::FileTooLarge, "larger than 2 GiB"));
            }
            fs::read(beside)
        })
    }

    /// Reads a capture from memory, like [`Self::read`].
    ///
    /// `file` is its name in errors, whose extension tells `.splat` files from others. `beside` reads a file next to it,
    /// because some formats consist of several files.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Self::read`].
    pub fn from_bytes(
        bytes: &[u8],
        file: &str,
        settings: &SplatSettings,
        beside: &mut dyn FnMut(&str) -> io::Result<Vec<u8>>,
    ) -> Result<Self, SplatError> {
        let mut beside = |name: &str| {
            // Only from the same folder or below it.
            if name.split(['/', '\\']).any(|part| part == "..") || name.starts_with(['/', '\\']) || name.contains(':') {
                return Err(Fault::found("a file next to it", name, "a name in the same folder"));
            }
            beside(name).map_err(|error| Fault::found(name, error.to_string(), "a file next to it"))
        };
        let extension = Path::new(file).extension().unwrap_or_default().to_ascii_lowercase();
        let mut read = || {
            let splats = match bytes {
                [b'p', b'l', b'y', b'\n' | b'\r', ..] => ply::read(bytes),
                [0x1f, 0x8b, 8, ..] | [b'N', b'G', b'S', b'P', ..] => spz::read(bytes, settings.spz_axes),
                [b'P', b'K', 3, 4, ..] => sog::read_bundle(bytes),
                [b'g', b'l', b'T', b'F', ..] => gltf::read_binary(bytes, &mut beside),
                _ if extension == "splat" => splat::read(bytes),
                _ if extension == "ksplat" => Err(Fault::found("format", "a .ksplat file", CONVERTED)),
                _ if first_letter(without_mark(bytes)) == Some(b'{') => read_json(without_mark(bytes), &mut beside),
                _ => Err(Fault::found("format", start(bytes), FORMATS)),
            }?;
            if splats.is_empty() {
                let found = match splats.dropped() {
                    0 => "none".into(),
                    dropped => format!("{dropped}, all with damaged numbers"),
                };
                return Err(Fault::found("Gaussians", found, "at least one"));
            }
            Ok(splats.trimmed())
        };
        read().map_err(|fault| fault.of(file))
    }
}

fn read_json(bytes: &[u8], beside: Beside) -> Result<Splats, Fault> {
    let json: serde_json::Value =
        serde_json::from_slice(bytes).map_err(|error| Fault::found("JSON", error.to_string(), FORMATS))?;
    if json.get("means").is_some() {
        sog::read_meta(json, bytes.len() as u64, beside)
    } else if json.get("asset").is_some() {
        gltf::read_text(bytes, beside)
    } else if json.get("lodLevels").is_some() || json.get("filenames").is_some() {
        Err(sog::streamed("JSON"))
    } else {
        Err(Fault::found("JSON", "neither `means` nor `asset`", FORMATS))
    }
}

fn first_letter(bytes: &[u8]) -> Option<u8> {
    bytes.iter().copied().find(|byte| !byte.is_ascii_whitespace())
}

/// Describes the start of a file.
fn start(bytes: &[u8]) -> String {
    match bytes {
        [] => "an empty file".into(),
        _ => format!("a file that starts with {:02x?}", &bytes[..bytes.len().min(4)]),
    }
}
