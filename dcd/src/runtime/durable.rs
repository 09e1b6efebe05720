//! Makes the names of new files and folders survive a power cut: syncing their content does not.

#[cfg(unix)]
use std::fs::File;
use std::io;
use std::path::Path;

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
