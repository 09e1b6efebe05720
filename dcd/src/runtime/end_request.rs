//! Ends a stored world from outside its server: a request in the data folder, which a running server obeys.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::RedbDirectory;
use crate::cluster::directory::{Batch, Directory, DirectoryError};

/// The file that asks the server of a data folder to end its world.
const REQUEST: &str = "end-request";
/// How often a server looks for it.
const LOOK: Duration = Duration::from_millis(200);
/// How often the other side looks whether the server is done.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// The request as its server sees it.
pub(super) struct EndRequests {
    path: PathBuf,
    looked: Instant,
}

impl EndRequests {
    /// Forgets a request to a former server of this folder.
    pub(super) fn of(folder: &Path) -> Self {
        let path = folder.join(REQUEST);
        let _ = std::fs::remove_file(&path);
        Self { path, looked: Instant::now() }
    }

    /// Returns whether there is one, and takes it away.
    pub(super) fn take(&mut self) -> bool {
        if self.looked.elapsed() < LOOK {
            return false;
        }
        self.looked = Instant::now();
        std::fs::remove_file(&self.path).is_ok()
    }
}

/// How a stored world was ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorldEnd {
    /// No server ran: it is removed from the folder.
    Removed,
    /// Its server ended it for all, and has stopped.
    ByServer,
    /// The folder keeps no world.
    Nothing,
    /// Its server has not ended it in time.
    Unheard,
}

/// Ends the world of a data folder: by its server, which is waited for, or, where none runs, by removing what is stored.
pub fn end_world(folder: &Path, timeout: Duration) -> Result<WorldEnd, DirectoryError> {
    if !folder.join("world.redb").exists() {
        return Ok(WorldEnd::Nothing);
    }
    let deadline = Instant::now() + timeout;
    let mut asked = false;
    loop {
        match RedbDirectory::open(folder) {
            Ok(mut directory) => {
                // One that came when the server was ending already.
                let _ = std::fs::remove_file(folder.join(REQUEST));
                let entries = directory.load()?;
                let end = match (entries.is_empty(), asked) {
                    (true, true) => WorldEnd::ByServer,
                    (true, false) => WorldEnd::Nothing,
                    (false, _) => WorldEnd::Removed,
                };
                // Also where its server died meanwhile.
                let writes = entries.into_iter().map(|entry| (entry.key, None)).collect();
                directory.commit(&Batch { writes, durable: true }, &[])?;
                return Ok(end);
            }
            Err(DirectoryError::Taken { .. }) if Instant::now() >= deadline => return Ok(WorldEnd::Unheard),
            Err(DirectoryError::Taken { .. }) => {
                let path = folder.join(REQUEST);
                // Once more if it is taken: a server that was just starting takes it for one to the server before.
                if asked && path.exists() {
                    std::thread::sleep(LOOK_AGAIN);
                    continue;
                }
                std::fs::write(&path, []).map_err(|error| DirectoryError::Unwritable {
                    place: path.display().to_string(),
                    cause: error.to_string(),
                })?;
                asked = true;
            }
            Err(error) => return Err(error),
        }
    }
}
