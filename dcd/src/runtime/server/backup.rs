//! Writes backups: data folders from which another server goes on with this server's world.

use std::fs;
use std::io;
use std::path::Path;

use crate::cluster::directory::{Batch, Directory, DirectoryError, Entry};
use crate::net::{Authority, NetError};
use crate::runtime::durable::sync_name;
use crate::runtime::{ProcessError, RedbDirectory};

/// Writes a backup. It is written beside its place first, so that nobody takes a part of it for the whole.
/// The record of joins is read after the stored world, so that it names every process that is in that world.
pub(super) fn write(folder: &Path, entries: Vec<Entry>, authority: &Authority) -> Result<(), ProcessError> {
    let refused = |cause: String| ProcessError::Backup { folder: folder.to_owned(), cause };
    if folder.exists() {
        return Err(refused("it is there already".to_owned()));
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let part = folder.with_file_name(format!(".{name}.part"));
    // Left over from a backup that was not finished.
    let _ = fs::remove_dir_all(&part);
    create_private(&part).map_err(|error| refused(error.to_string()))?;
    let written = fill(&part, entries, authority).and_then(|()| {
        fs::rename(&part, folder).and_then(|()| sync_name(folder)).map_err(|error| error.to_string())
    });
    if written.is_err() {
        let _ = fs::remove_dir_all(&part);
    }
    written.map_err(refused)
}

fn fill(folder: &Path, entries: Vec<Entry>, authority: &Authority) -> Result<(), String> {
    let writes = entries.into_iter().map(|entry| (entry.key, Some(entry.value))).collect();
    let written = RedbDirectory::open(folder)
        .and_then(|mut directory| directory.commit(&Batch { writes, durable: true }, &[]));
    written.map_err(|error| match error {
        DirectoryError::Unwritable { cause, .. } | DirectoryError::Unreadable { cause, .. } => cause,
        other => other.to_string(),
    })?;
    authority.copy_to(folder).map_err(|error| match error {
        NetError::File { source, .. } => source.to_string(),
        other => other.to_string(),
    })
}

/// Creates a folder that only its owner can access.
fn create_private(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}
