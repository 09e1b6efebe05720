//! Writes backups: data folders from which another server goes on with the world of this one.

use std::fs;
use std::io;
use std::path::Path;

use crate::cluster::directory::{Batch, Directory, DirectoryError, Entry};
use crate::net::Authority;
use crate::runtime::{ProcessError, RedbDirectory};

/// Writes a backup beside its place first, so that nobody takes a part of one for the whole. What is stored of the world has been read
/// before the record of joins is, so that every process that is in the world is on that record.
pub(super) fn write(folder: &Path, entries: Vec<Entry>, authority: &Authority) -> Result<(), ProcessError> {
    let refused = |error: io::Error| DirectoryError::Unwritable {
        place: folder.display().to_string(),
        cause: error.to_string(),
    };
    if folder.exists() {
        return Err(refused(io::Error::new(io::ErrorKind::AlreadyExists, "it is there already")).into());
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let part = folder.with_file_name(format!(".{name}.part"));
    // Of one that was not finished.
    let _ = fs::remove_dir_all(&part);
    create_private(&part).map_err(refused)?;
    let written =
        fill(&part, entries, authority).and_then(|()| Ok(fs::rename(&part, folder).map_err(refused)?));
    if written.is_err() {
        let _ = fs::remove_dir_all(&part);
    }
    written
}

fn fill(folder: &Path, entries: Vec<Entry>, authority: &Authority) -> Result<(), ProcessError> {
    let writes = entries.into_iter().map(|entry| (entry.key, Some(entry.value))).collect();
    RedbDirectory::open(folder)?.commit(&Batch { writes, durable: true }, &[])?;
    Ok(authority.copy_to(folder)?)
}

/// Makes a folder for its owner alone.
fn create_private(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}
