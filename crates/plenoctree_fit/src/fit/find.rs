//! Finds the files of pictures.

use std::path::{Path, PathBuf};

/// Extensions that the file names of pictures may lack, as in NeRF-synthetic.
const ENDINGS: [&str; 6] = ["png", "jpg", "jpeg", "PNG", "JPG", "JPEG"];

/// Finds a picture whose name may lack its extension, or have the separators of another system. If the name is absolute
/// or the pictures are `moved`, they may also be in a part of the named folders.
pub fn picture(folder: &Path, name: &str, moved: bool) -> Option<PathBuf> {
    let with_ending = |path: PathBuf| {
        let mut others = ENDINGS.iter().map(|ending| path.with_added_extension(ending));
        if path.is_file() { Some(path.clone()) } else { others.find(|path| path.is_file()) }
    };
    let name = if folder.join(name).exists() { name.into() } else { name.replace('\\', "/") };
    let windows = name.as_bytes().get(1) == Some(&b':');
    with_ending(folder.join(&name)).or_else(|| {
        let parts: Vec<&str> = name.split('/').collect();
        let fewest = if moved || windows || name.starts_with('/') { parts.len() } else { 0 };
        (1..fewest).find_map(|first| with_ending(folder.join(parts[first..].join("/"))))
    })
}

/// Returns the folder of a file.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
