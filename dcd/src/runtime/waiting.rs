//! Shows that a process waits for an answer, by a file that the process holds locked. The operating system
//! unlocks the file when the process ends, however it ends. Ids of processes would not do: in another
//! container they are those of other processes.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// The sign of a process that waits. The file stays when the sign is dropped, and says no more then that
/// anybody waits.
pub(crate) struct Waiting {
    _locked: File,
}

impl Waiting {
    /// Gives the sign. The file appears when it is locked, so that nobody takes it for one that was left.
    pub(crate) fn show(path: &Path) -> io::Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
        let locked = File::create(&part)?;
        let shown = locked.lock().and_then(|()| fs::rename(&part, path));
        if shown.is_err() {
            let _ = fs::remove_file(&part);
        }
        shown.map(|()| Self { _locked: locked })
    }
}

/// Returns whether the process that gave this sign waits still. If that cannot be known, it does.
pub(crate) fn is_waiting(path: &Path) -> bool {
    match File::open(path) {
        Ok(sign) => sign.try_lock_shared().is_err(),
        Err(error) => error.kind() != io::ErrorKind::NotFound,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_waits_is_known_for_as_long_as_its_process_lives() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("asker-1");
        assert!(!is_waiting(&path));
        let former = Waiting::show(&path).unwrap();
        assert!(is_waiting(&path) && is_waiting(&path));
        drop(former);
        assert!(path.exists() && !is_waiting(&path));
        let _again = Waiting::show(&path).unwrap();
        assert!(is_waiting(&path));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no part of it is left");
    }
}
