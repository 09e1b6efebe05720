//! Keeps the lines of a server's record of joins in a file of its folder, unless its servers share another
//! place.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::NetError;
use super::files::{at, open_private, replace_private};

/// A text of whole lines that is kept durably, for one server at a time.
pub(crate) trait Journal: Send {
    /// Returns where the lines are kept.
    fn place(&self) -> PathBuf;

    /// Returns all lines. If the last line has no end, a crash cut it.
    fn read(&mut self) -> Result<String, NetError>;

    /// Replaces all lines.
    fn replace(&mut self, text: &str) -> Result<(), NetError>;

    /// Adds a line, with its end. The line is durable when this returns.
    fn append(&mut self, line: &str) -> Result<(), NetError>;
}

/// The record of joins in `joins.log` of a folder, which is locked for this server.
pub(super) struct FileJournal {
    log: File,
    /// The length of the whole lines in the log, in bytes.
    log_bytes: u64,
    log_path: PathBuf,
    lock: File,
}

impl FileJournal {
    /// Opens the file, or makes it.
    pub(super) fn open(folder: &Path) -> Result<Self, NetError> {
        let lock_path = folder.join("server.lock");
        let lock = open_private(&lock_path, OpenOptions::new().create(true).append(true))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => NetError::FolderTaken { path: folder.to_owned() },
            TryLockError::Error(source) => at(&lock_path)(source),
        })?;
        let log_path = folder.join("joins.log");
        let log = open_private(&log_path, OpenOptions::new().create(true).append(true))?;
        Ok(Self { log, log_bytes: 0, log_path, lock })
    }
}

/// The lock is released explicitly: a child process that is just being started also has the file open for a
/// moment.
impl Drop for FileJournal {
    fn drop(&mut self) {
        let _ = self.lock.unlock();
    }
}

impl Journal for FileJournal {
    fn place(&self) -> PathBuf {
        self.log_path.clone()
    }

    fn read(&mut self) -> Result<String, NetError> {
        fs::read_to_string(&self.log_path).map_err(at(&self.log_path))
    }

    fn replace(&mut self, text: &str) -> Result<(), NetError> {
        replace_private(&self.log_path, text.as_bytes())?;
        self.log = open_private(&self.log_path, OpenOptions::new().append(true))?;
        self.log_bytes = text.len() as u64;
        Ok(())
    }

    fn append(&mut self, line: &str) -> Result<(), NetError> {
        if let Err(error) = self.log.write_all(line.as_bytes()).and_then(|()| self.log.sync_data()) {
            // Half a line, as on a full disk, must not run into the next one. If this fails too, opening the
            // log again cuts it, unless more was written to it; then the error names the damage.
            let _ = self.log.set_len(self.log_bytes);
            return Err(at(&self.log_path)(error));
        }
        self.log_bytes += line.len() as u64;
        Ok(())
    }
}
