//! Makes the names of new files and folders outlive a power cut: their content alone does not.

#[cfg(unix)]
use std::fs::File;
use std::io;
use std::path::Path;

/// Makes the name of a file or folder durable.
pub(super) fn sync_name(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    // Elsewhere folders cannot be opened.
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}
