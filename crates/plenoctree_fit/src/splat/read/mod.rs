//! Reads captures, without trusting what a file claims.

mod bytes;
mod gltf;
mod ply;
mod settings;
mod shared;
mod sog;
mod spz;

pub use settings::{SplatSettings, SpzAxes};

use std::{fs, io, path::Path};

use self::shared::Beside;
use super::{
    error::{Fault, SplatError},
    splats::Splats,
};

/// The formats, for errors.
const FORMATS: &str = "a capture: .ply, .spz, .sog, .glb, .gltf, or the meta.json of a SOG folder";
/// Largest size of a file next to a capture, such as an image: 2 GiB.
const LARGEST_FILE: u64 = 2 << 30;

impl Splats {
    /// Reads a capture: a `.ply` file of 3D Gaussian splatting, SPZ (versions 2 to 4), SOG (a `.sog` file, its
    /// `meta.json`, or the folder of it), or glTF with `KHR_gaussian_splatting`. The format is detected from the
    /// content of the file.
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
        let bytes = fs::read(&path).map_err(|error| Fault::Io(error).of(&file))?;
        Self::from_bytes(&bytes, &file, settings, &mut |name| {
            let beside = folder.join(name);
            if fs::metadata(&beside)?.len() > LARGEST_FILE {
                return Err(io::Error::new(io::ErrorKind::FileTooLarge, "larger than 2 GiB"));
            }
            fs::read(beside)
        })
    }

    /// Returns whether a capture is an SPZ file that does not record its axes, so that [`Self::from_bytes`] takes those
    /// of the settings. If they are wrong, the capture is upside down. False if it is damaged.
    pub fn assumes_axes(bytes: &[u8]) -> bool {
        spz::assumes_axes(bytes)
    }

    /// Reads a capture from memory, like [`Self::read`].
    ///
    /// `file` is its name in errors. `beside` reads a file next to it, because some formats consist of several files.
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
        let mut read = || {
            let splats = match bytes {
                [b'p', b'l', b'y', b'\n' | b'\r', ..] => ply::read(bytes),
                [0x1f, 0x8b, ..] | [b'N', b'G', b'S', b'P', ..] => spz::read(bytes, settings.spz_axes),
                [b'P', b'K', 3, 4, ..] => sog::read_bundle(bytes),
                [b'g', b'l', b'T', b'F', ..] => gltf::read_binary(bytes, &mut beside),
                _ if first_letter(bytes) == Some(b'{') => read_json(bytes, &mut beside),
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
    } else {
        Err(Fault::found("JSON", "neither `means` nor `asset`", FORMATS))
    }
}

fn first_letter(bytes: &[u8]) -> Option<u8> {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).iter().copied().find(|byte| !byte.is_ascii_whitespace())
}

/// Describes the start of a file.
fn start(bytes: &[u8]) -> String {
    match bytes {
        [] => "an empty file".into(),
        _ => format!("a file that starts with {:02x?}", &bytes[..bytes.len().min(4)]),
    }
}
