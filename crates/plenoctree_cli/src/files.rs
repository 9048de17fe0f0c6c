//! Checks and writes files, with errors that name them. Files are complete before they replace others.

use std::{
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use image::{ImageBuffer, PixelWithColorType, codecs::png::PngEncoder};

use crate::result::Result;

/// Creates a folder and its parents, unless they exist.
pub fn create_folder(path: &Path) -> Result {
    Ok(fs::create_dir_all(path).map_err(|error| format!("{}: cannot be created: {error}", path.display()))?)
}

/// Checks that inputs exist.
pub fn check_inputs(inputs: &[&Path]) -> Result {
    for input in inputs {
        fs::metadata(input).map_err(|error| format!("{}: cannot be read: {error}", input.display()))?;
    }
    Ok(())
}

/// Checks that inputs exist and that files can be written, before the work starts: files that are neither inputs nor
/// each other.
pub fn check_outputs(outputs: &[&Path], inputs: &[&Path]) -> Result {
    check_inputs(inputs)?;
    for (index, output) in outputs.iter().enumerate() {
        let name = output.display();
        if inputs.iter().any(|input| is_same(output, input)) {
            return Err(format!("{name}: would overwrite its input; choose another --out").into());
        }
        if outputs[..index].iter().any(|other| is_same(output, other)) {
            return Err(format!("{name}: two files would be written under this name; choose two names").into());
        }
        if output.is_dir() {
            return Err(format!("{name}: is a folder; choose the name of a file").into());
        }
        check_writable(output).map_err(|error| format!("{name}: cannot be written: {error}"))?;
    }
    Ok(())
}

/// Returns an error if [`write`] would fail.
fn check_writable(path: &Path) -> io::Result<()> {
    if fs::metadata(path).is_ok_and(|existing| !existing.is_file()) {
        // A device or a pipe, which would be written to.
        return Ok(());
    }
    // Fails with `None` once the file could be written, so that nothing is replaced.
    match plenoctree::replace_file(path, |_| Err(None::<io::Error>)) {
        Err(Some(error)) => Err(error),
        Ok(()) | Err(None) => Ok(()),
    }
}

/// Whether two paths lead to the same file, which need not exist.
fn is_same(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| -> Option<PathBuf> {
        fs::canonicalize(path).ok().or_else(|| {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
        })
    };
    place(a).is_some_and(|a| place(b).is_some_and(|b| a == b))
}

/// Writes a file, replacing an existing one.
pub fn write(path: &Path, fill: impl FnOnce(&mut File) -> io::Result<()>) -> Result {
    Ok(plenoctree::replace_file(path, fill)
        .map_err(|error| format!("{}: cannot be written: {error}", path.display()))?)
}

/// Writes a text file, replacing an existing one.
pub fn write_text(path: &Path, text: &str) -> Result {
    write(path, |file| file.write_all(text.as_bytes()))
}

/// Writes an image as PNG, replacing an existing file.
pub fn write_image<P>(path: &Path, image: &ImageBuffer<P, Vec<u8>>) -> Result
where
    P: PixelWithColorType<Subpixel = u8>,
{
    write(path, |file| {
        let mut file = BufWriter::new(file);
        image.write_with_encoder(PngEncoder::new(&mut file)).map_err(io::Error::other)?;
        file.flush()
    })
}
