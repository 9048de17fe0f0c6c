//! From inputs of the target `field` to inputs of `field_bytes` that hold the same archives.
//!
//! `cargo run --release --example archives -- corpus/field corpus/field_bytes`

use std::{env, error::Error, fs, mem::size_of, path::PathBuf};

use arbitrary::{Arbitrary, Unstructured};
use plenoctree_fuzz::FieldFile;

/// Bytes that a seed may have.
const LONGEST: usize = 8192;
/// Bytes of the settings, with which inputs of both targets begin.
const SETTINGS: usize = size_of::<(u8, bool)>() + size_of::<f32>() + size_of::<bool>();

fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = env::args_os().skip(1).map(PathBuf::from);
    let (from, to) = paths.next().zip(paths.next()).ok_or("expected two folders")?;
    fs::create_dir_all(&to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let input = fs::read(entry.path())?;
        let Ok(file) = FieldFile::arbitrary_take_rest(Unstructured::new(&input)) else { continue };
        let seed = [&input[..SETTINGS], &file.build().0].concat();
        if seed.len() <= LONGEST {
            fs::write(to.join(entry.file_name()), seed)?;
        }
    }
    Ok(())
}
