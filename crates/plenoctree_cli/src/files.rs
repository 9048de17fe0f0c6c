//! Checks and writes files, with errors that name them. Files are complete before they replace others.

use std::{
    collections::HashSet,
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use image::{ImageBuffer, PixelWithColorType, codecs::png::PngEncoder};
use plenoctree::palette::Palette;
use serde_json::Value;

use crate::{console, number::counted, result::Result};

/// The folders that are written to, each with those of it and its parents that are new.
static WRITTEN: Mutex<Vec<(PathBuf, Vec<PathBuf>)>> = Mutex::new(Vec::new());

/// Creates a folder and its parents, unless they exist.
pub fn create_folder(path: &Path) -> Result {
    let new = path.ancestors().take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists());
    let new = new.map(PathBuf::from).collect();
    fs::create_dir_all(path).map_err(|error| format!("{}: cannot be created: {error}", path.display()))?;
    WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).push((path.into(), new));
    Ok(())
}

/// Removes what a command leaves behind that fails or is stopped: unfinished files, and new folders without anything in
/// them.
pub fn clean_up() {
    for (folder, new) in WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).iter().rev() {
        plenoctree::remove_unfinished_files(folder);
        new.iter().for_each(|folder| _ = fs::remove_dir(folder));
    }
}

/// Returns the folder of a file.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Checks that inputs exist.
pub fn check_inputs(inputs: &[&Path]) -> Result {
    for input in inputs {
        fs::metadata(input).map_err(|error| format!("{}: cannot be read: {error}", input.display()))?;
    }
    Ok(())
}

/// Returns the size of a file in bytes.
pub fn size(path: &Path) -> Result<u64> {
    let metadata = fs::metadata(path).map_err(|error| format!("{}: {error}", path.display()))?;
    if metadata.is_dir() {
        return Err(format!("{}: found a folder, expected a file", path.display()).into());
    }
    Ok(metadata.len())
}

/// Checks that inputs exist and that files can be written, before the work starts: files that are neither inputs nor
/// each other. Creates the folders that they go to.
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
        create_folder(folder_of(output))?;
        // Where a link leads is written to.
        let target = plenoctree::follow_links(output).unwrap_or_else(|_| output.into());
        if folder_of(&target).is_dir() {
            create_folder(folder_of(&target))?;
        }
        check_writable(output).map_err(|error| format!("{name}: cannot be written: {error}"))?;
    }
    Ok(())
}

/// Checks that the name of an image says what it is.
pub fn check_image(image: &Path) -> Result {
    match image.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("png") => Ok(()),
        _ => Err(format!("{}: the name of the image must end in .png", image.display()).into()),
    }
}

/// Copies what `path` holds, if `is_lost` says that it would be lost, to a file next to it that does not exist yet, and
/// says so. `what` is what it holds.
fn keep_former(path: &Path, what: &str, is_lost: impl FnOnce(&[u8]) -> bool) -> Result {
    // Pipes and devices hold nothing.
    if !path.is_file() {
        return Ok(());
    }
    let Ok(former) = fs::read(path) else { return Ok(()) };
    if !is_lost(&former) {
        return Ok(());
    }
    let names =
        (1..).map(|number| path.with_added_extension(if number == 1 { "old".into() } else { format!("old{number}") }));
    for name in names.take(1000) {
        match fs::read(&name) {
            Ok(kept) if kept != former => continue,
            Ok(_) => {}
            Err(_) => write(&name, |file| file.write_all(&former))?,
        }
        console::complain!("{}: replaced; the {what} before is now {}", path.display(), name.display());
        return Ok(());
    }
    Err(format!("{}: would be lost: there are a thousand older ones next to it; choose another --out", path.display())
        .into())
}

/// Keeps the palette at `path` under another name, unless it is the same as the one that replaces it.
pub fn keep_former_palette(path: &Path, new: Option<&Palette>) -> Result {
    keep_former(path, "palette", |former| {
        new.is_none_or(|new| Palette::from_json(former, path).ok().as_ref() != Some(new))
    })
}

/// Keeps the report at `path` under another name, unless `is_same` says that it is about the same as the one that
/// replaces it.
pub fn keep_former_report(path: &Path, is_same: impl FnOnce(&Value) -> bool) -> Result {
    keep_former(path, "report", |former| serde_json::from_slice(former).map_or(true, |report| !is_same(&report)))
}

/// Checks that nothing in a folder that is read is written, if what is written there has names for which `writes` is
/// true.
pub fn check_folder(folder: &Path, inputs: &[&Path], writes: impl Fn(&str) -> bool) -> Result {
    let is_written = |input: &Path| {
        let name = input.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| writes(name) && is_same(input, &folder.join(name)))
    };
    match inputs.iter().find(|input| is_written(input)) {
        Some(input) => Err(format!("{}: would be overwritten; choose another --out", input.display()).into()),
        None => Ok(()),
    }
}

/// Warns if there are images from an earlier run beside those that were `written`: nothing else tells them apart.
pub fn warn_of_earlier_images<'a>(
    folder: &Path,
    written: impl IntoIterator<Item = &'a String>,
    is_image: impl Fn(&str) -> bool,
) {
    let written: HashSet<_> = written.into_iter().collect();
    let names = fs::read_dir(folder).into_iter().flatten().flatten().flat_map(|entry| entry.file_name().into_string());
    let mut earlier: Vec<_> = names.filter(|name| is_image(name) && !written.contains(name)).collect();
    earlier.sort();
    if let Some(first) = earlier.first() {
        let images = counted(earlier.len(), "image", "images");
        console::complain!("warning: {}: also holds {images} from an earlier run, such as {first}", folder.display());
    }
}

/// Checks that no input is in a folder that is written.
pub fn check_outside<'a>(folder: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result {
    let place = |path: &Path| fs::canonicalize(path).ok();
    let Some(folder) = place(folder) else { return Ok(()) };
    match inputs.into_iter().find(|input| place(input).is_some_and(|input| input.starts_with(&folder))) {
        Some(input) => {
            let folder = folder.display();
            Err(format!("{}: is in {folder}, which is written to; choose another --out", input.display()).into())
        }
        None => Ok(()),
    }
}

/// Returns an error if [`write`] would fail.
fn check_writable(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        // A device or a pipe, which would be written to.
        Ok(existing) if !existing.is_file() => return Ok(()),
        Err(error) if error.kind() == io::ErrorKind::InvalidFilename => return Err(error),
        _ => {}
    }
    // Fails with `None` once the file could be written, so that nothing is replaced.
    match plenoctree::replace_file(path, |_| Err(None::<io::Error>)) {
        Err(Some(error)) => Err(error),
        Ok(()) | Err(None) => Ok(()),
    }
}

/// Whether two paths lead to the same file, which need not exist.
pub fn is_same(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| -> Option<PathBuf> {
        fs::canonicalize(path).ok().or_else(|| Some(fs::canonicalize(folder_of(path)).ok()?.join(path.file_name()?)))
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
