//! Locks a data folder for the one server that uses it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek as _, Write as _};
use std::path::Path;

use crate::cluster::directory::DirectoryError;
use crate::net::{NetError, open_private};
#[cfg(feature = "etcd")]
use crate::runtime::waiting::Waiting;
use crate::runtime::waiting::is_waiting;

/// The file that locks a data folder. It has contents if the world is stored elsewhere.
const LOCK: &str = "world.lock";

/// The lock of a data folder. The operating system releases it when the process ends, however it ends.
pub(in crate::runtime) struct FolderLock(File);

impl FolderLock {
    /// Locks the folder. `place` is named in the error if another server has locked it.
    pub(in crate::runtime) fn take(folder: &Path, place: &Path) -> Result<Self, DirectoryError> {
        let path = folder.join(LOCK);
        let shown = || path.display().to_string();
        let lock = open_private(&path, OpenOptions::new().write(true).create(true).truncate(false))
            .map_err(|error| DirectoryError::Unreadable { place: shown(), cause: cause(&error) })?;
        match lock.try_lock() {
            Ok(()) => Ok(Self(lock)),
            Err(TryLockError::WouldBlock) => {
                Err(DirectoryError::Taken { place: place.display().to_string() })
            }
            Err(TryLockError::Error(error)) => {
                Err(DirectoryError::Unreadable { place: shown(), cause: error.to_string() })
            }
        }
    }

    /// Writes down whether the world is stored elsewhere, for those who find the folder without a server.
    pub(in crate::runtime) fn note(&self, elsewhere: bool) -> io::Result<()> {
        self.0.set_len(0)?;
        (&self.0).rewind()?;
        (&self.0).write_all(if elsewhere { b"the world is in etcd\n" } else { b"" })
    }
}

/// Releases the lock explicitly: a child process that is just being started also has the file open for a
/// moment.
impl Drop for FolderLock {
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

/// Returns whether a server uses this data folder now.
pub(crate) fn is_served(folder: &Path) -> Result<bool, DirectoryError> {
    if !is_there(&folder.join(LOCK))? {
        return Ok(false);
    }
    match FolderLock::take(folder, folder) {
        Ok(_) => Ok(false),
        Err(DirectoryError::Taken { .. }) => Ok(true),
        Err(error) => Err(error),
    }
}

/// Returns whether the last server of this data folder stored its world elsewhere.
pub(crate) fn is_elsewhere(folder: &Path) -> Result<bool, DirectoryError> {
    let path = folder.join(LOCK);
    match path.metadata() {
        Ok(lock) => Ok(lock.len() > 0),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => {
            Err(DirectoryError::Unreadable { place: path.display().to_string(), cause: error.to_string() })
        }
    }
}

/// The file by which a server shows that it stands by.
const STANDBY: &str = "standby";

/// Shows that a server with this data folder stands by, for as long as what this returns lives.
#[cfg(feature = "etcd")]
pub(super) fn show_standby(folder: &Path) -> Result<Waiting, DirectoryError> {
    if is_standby(folder) {
        return Err(DirectoryError::Taken { place: folder.display().to_string() });
    }
    let path = folder.join(STANDBY);
    let shown = Waiting::show(&path);
    shown.map_err(|error| DirectoryError::Unwritable {
        place: path.display().to_string(),
        cause: error.to_string(),
    })
}

/// Returns whether a server with this data folder stands by now.
pub(crate) fn is_standby(folder: &Path) -> bool {
    is_waiting(&folder.join(STANDBY))
}

/// Returns whether a file exists, or an error if that is unknown: the folder may be another user's.
pub(crate) fn is_there(path: &Path) -> Result<bool, DirectoryError> {
    path.try_exists().map_err(|error| DirectoryError::Unreadable {
        place: path.display().to_string(),
        cause: error.to_string(),
    })
}

/// Returns the system's message, without the words that [`DirectoryError`] adds itself.
pub(super) fn cause(error: &NetError) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}
