//! Replaces files atomically, so that readers never see half of one and a failure loses nothing.

use std::{
    fs::{self, File, Metadata},
    io,
    path::{Path, PathBuf},
    process,
    sync::atomic::{AtomicU32, Ordering},
    time::SystemTime,
};

/// Creates or replaces the file at `path` with what `fill` writes, as fields and palettes are written.
///
/// `fill` gets a temporary file in the same folder, which then takes the place of an existing file and keeps its
/// permissions. Links are followed. Anything but a regular file, such as a pipe, is written to directly.
///
/// # Errors
///
/// Returns an error if `fill` does. If the folder does not exist or is read-only, or if the existing file is read-only,
/// returns an error before it calls `fill`. The existing file is then unchanged, and the temporary one is removed.
pub fn replace_file<E: From<io::Error>>(
    path: impl AsRef<Path>,
    fill: impl FnOnce(&mut File) -> Result<(), E>,
) -> Result<(), E> {
    let path = path.as_ref();
    let existing = fs::metadata(path).ok();
    if existing.as_ref().is_some_and(|existing| !existing.is_file()) {
        return fill(&mut File::create(path)?);
    }
    check_replaceable(existing.as_ref())?;
    let (mut file, temporary) = create_beside(&follow_links(path)?)?;
    let written = fill(&mut file);
    drop(file);
    if let Err(error) = written.and_then(|()| Ok(move_file(&temporary, path)?)) {
        // The first error is more informative than a second one.
        let _ = fs::remove_file(&temporary);
        return Err(error);
    }
    Ok(())
}

/// Moves a complete file to `path`, where it takes the place of an existing one as in [`replace_file`]: for several
/// files that belong together, of which none is to be replaced before all are complete.
///
/// # Errors
///
/// Returns an error if the existing file is read-only, or if `path` leads to another file system. Both files are then
/// unchanged but for permissions.
pub fn move_file(from: impl AsRef<Path>, path: impl AsRef<Path>) -> io::Result<()> {
    let target = follow_links(path.as_ref())?;
    let existing = fs::metadata(&target).ok();
    check_replaceable(existing.as_ref())?;
    let file = File::options().append(true).open(&from)?;
    if let Some(existing) = existing {
        file.set_permissions(existing.permissions())?;
    }
    // It must be on disk before it is renamed.
    file.sync_all()?;
    drop(file);
    fs::rename(from, &target)?;
    // Watchers of folders may report only a rename, which Bevy does not treat as a change. A new modification time is a
    // change.
    let _ = File::options().append(true).open(&target).and_then(|file| file.set_modified(SystemTime::now()));
    Ok(())
}

/// Removes what this process has not finished writing in a folder: for programs that end while they write, for example
/// on Ctrl-C. Whatever is still being written fails.
pub fn remove_unfinished_files(folder: impl AsRef<Path>) {
    let prefix = temporary_prefix();
    let is_ours = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().starts_with(&prefix);
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    // There is nobody left to tell.
    entries.filter(is_ours).for_each(|entry| _ = fs::remove_file(entry.path()));
}

/// Returns how the names of the temporary files of this process begin.
fn temporary_prefix() -> String {
    format!(".plenoctree-{}-", process::id())
}

/// Returns the path that links at `path` lead to, whether or not there is a file.
///
/// # Errors
///
/// Returns an error if the links lead in a circle.
pub fn follow_links(path: impl AsRef<Path>) -> io::Result<PathBuf> {
    /// As many as Linux follows.
    const MOST: usize = 40;
    let mut target = path.as_ref().to_path_buf();
    for _ in 0..=MOST {
        let Ok(next) = fs::read_link(&target) else { return Ok(target) };
        target.pop();
        target.push(next);
    }
    Err(io::Error::other("too many links"))
}

/// Creates a temporary file in the folder of `target`.
fn create_beside(target: &Path) -> io::Result<(File, PathBuf)> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    loop {
        let name = format!("{}{}.tmp", temporary_prefix(), COUNT.fetch_add(1, Ordering::Relaxed));
        let temporary = target.with_file_name(name);
        match File::create_new(&temporary) {
            Ok(file) => return Ok((file, temporary)),
            // Left behind by a killed process with the same id.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// Returns an error if the existing file is read-only.
fn check_replaceable(existing: Option<&Metadata>) -> io::Result<()> {
    if existing.is_some_and(|existing| existing.permissions().readonly()) {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the existing file is read-only"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::{
        io::{Read, Write},
        sync::atomic::AtomicBool,
    };

    use tempfile::TempDir;

    use super::*;

    fn names(folder: &TempDir) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    fn write(path: &Path, text: &str) -> io::Result<()> {
        replace_file(path, |file| file.write_all(text.as_bytes()))
    }

    #[test]
    fn a_failure_leaves_the_old_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let fail = |path: &Path| {
            replace_file(path, |file| {
                file.write_all(b"half")?;
                Err(io::Error::other("the disk is full"))
            })
        };
        assert_eq!(fail(&path).unwrap_err().to_string(), "the disk is full");
        assert!(names(&folder).is_empty(), "{:?}", names(&folder));
        write(&path, "old").unwrap();
        assert!(fail(&path).is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(&folder), ["file"]);
        assert_eq!(write(&folder.path().join("no/such/folder"), "new").unwrap_err().kind(), io::ErrorKind::NotFound);
        assert!(write(folder.path(), "new").is_err() && names(&folder) == ["file"]);
    }

    /// Readers that read the file while it is replaced, over and over, always see a complete one, old or new.
    #[test]
    fn readers_see_whole_files_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let texts = ["a".repeat(100_000), "b".repeat(50_000)];
        write(&path, &texts[0]).unwrap();
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| {
                let mut reads = 0;
                while !done.load(Ordering::Relaxed) || reads == 0 {
                    let mut text = String::new();
                    File::open(&path).unwrap().read_to_string(&mut text).unwrap();
                    assert!(texts.contains(&text), "{} bytes", text.len());
                    reads += 1;
                }
            });
            for round in 0..50 {
                write(&path, &texts[round % 2]).unwrap();
            }
            done.store(true, Ordering::Relaxed);
            reader.join().unwrap();
        });
        assert_eq!(names(&folder), ["file"]);
    }

    #[test]
    fn what_is_unfinished_can_be_removed() {
        let folder = tempfile::tempdir().unwrap();
        let (old, new) = (folder.path().join("old"), folder.path().join("new"));
        write(&old, "old").unwrap();
        fs::write(folder.path().join(".plenoctree-of-others.tmp"), "").unwrap();
        let ends = replace_file(&new, |_| {
            remove_unfinished_files(&folder);
            assert_eq!(names(&folder), [".plenoctree-of-others.tmp", "old"]);
            Ok::<_, io::Error>(())
        });
        assert!(ends.is_err() && names(&folder) == [".plenoctree-of-others.tmp", "old"]);
    }

    #[cfg(unix)]
    #[test]
    fn permissions_and_links_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("file"), folder.path().join("link"));
        write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("file", &link).unwrap();
        write(&link, "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o440)).unwrap();
        assert_eq!(write(&path, "newer").unwrap_err().kind(), io::ErrorKind::PermissionDenied);
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(&folder), ["file", "link"]);
    }

    /// A link to a file that does not exist yet creates it, wherever it is, and links in a circle are an error.
    #[cfg(unix)]
    #[test]
    fn links_may_lead_to_new_files() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("below")).unwrap();
        symlink("below/second", folder.path().join("first")).unwrap();
        symlink("../file", folder.path().join("below/second")).unwrap();
        write(&folder.path().join("first"), "new").unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("file")).unwrap(), "new");
        assert!(["first", "below/second"].iter().all(|link| folder.path().join(link).is_symlink()));
        symlink("circle", folder.path().join("circle")).unwrap();
        assert!(write(&folder.path().join("circle"), "new").is_err());
        assert!(folder.path().join("circle").is_symlink());
    }
}
