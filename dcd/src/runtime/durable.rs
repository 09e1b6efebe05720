//! Replaces files as a whole, and makes the names of new files and folders survive a power cut: syncing their
//! content does not.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Writes a file by `write`. The file is written beside its place first, so that a partial file never replaces
/// a whole one. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes and folders
/// are refused.
pub(crate) fn replace_file<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&File) -> Result<(), E>,
) -> Result<(), E> {
    let place = &place_of(path)?;
    let mut part = place.as_os_str().to_owned();
    part.push(".part");
    let written = File::create(&part).map_err(E::from).and_then(|file| {
        write(&file)?;
        // Without this the new name might be on the disk before the content: after a power cut an empty file
        // would be all that is left.
        file.sync_all()?;
        fs::rename(&part, place)?;
        Ok(sync_name(place)?)
    });
    if written.is_err() {
        let _ = fs::remove_file(&part);
    }
    written
}

/// Returns the path that a file of this path is written to: the target of a symbolic link. Anything but a
/// regular file there is an error.
fn place_of(path: &Path) -> io::Result<PathBuf> {
    match fs::metadata(path) {
        Ok(found) if found.is_file() => fs::canonicalize(path),
        Ok(_) => Err(irregular()),
        // A link that leads nowhere would be replaced itself.
        Err(_) if path.is_symlink() => Err(irregular()),
        Err(_) => Ok(path.to_owned()),
    }
}

/// The error of a path at which there is a device, a pipe or a folder.
pub(super) fn irregular() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, "there is something that is not a regular file")
}

/// Makes the name of a file or folder durable.
pub(super) fn sync_name(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    // On other systems a folder cannot be opened as a file.
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn put(path: &Path, content: &str) -> io::Result<()> {
        replace_file(path, |mut file| file.write_all(content.as_bytes()))
    }

    #[test]
    fn what_was_there_stays_until_all_is_written_and_a_failure_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world");
        put(&path, "one").unwrap();
        let failed = replace_file(&path, |mut file| {
            file.write_all(b"tw").and(Err(io::Error::other("the disk is full")))
        });
        assert_eq!(failed.unwrap_err().to_string(), "the disk is full");
        assert_eq!(fs::read_to_string(&path).unwrap(), "one");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_is_no_regular_file_is_refused() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let [file, link, lost] = ["file", "link", "lost"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        symlink(&file, &link).unwrap();
        put(&link, "new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        symlink(folder.path().join("nowhere"), &lost).unwrap();
        for path in [&lost, Path::new("/dev/null"), folder.path()] {
            let refused = put(path, "new").unwrap_err().to_string();
            assert!(refused.contains("not a regular file"), "{path:?}: {refused}");
        }
    }
}
