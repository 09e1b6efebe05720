//! Ends a stored world from outside its server: by a request in the data folder, which a running server
//! obeys.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::RedbDirectory;
use super::directory::{is_elsewhere, is_served, is_standby, is_there};
use super::waiting::{Waiting, is_waiting};
use crate::cluster::directory::{Batch, Directory, DirectoryError};

/// The file that asks the server of a data folder to end its world.
const REQUEST: &str = "end-request";
/// How often a server looks for a request.
const LOOK: Duration = Duration::from_millis(200);
/// How often the asking process looks whether the server has ended.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// The requests, as their server sees them.
pub(super) struct EndRequests {
    path: PathBuf,
    looked: Instant,
}

impl EndRequests {
    /// Looks for requests in this folder from now on, and removes one that was made to a former server.
    pub(super) fn of(folder: &Path) -> Self {
        let path = folder.join(REQUEST);
        let _ = std::fs::remove_file(&path);
        Self { path, looked: Instant::now() }
    }

    /// Returns whether there is a request, and removes it. One whose asker has ended is dropped. Looks no more
    /// often than every [`LOOK`].
    pub(super) fn take(&mut self) -> bool {
        if self.looked.elapsed() < LOOK {
            return false;
        }
        self.looked = Instant::now();
        let is_meant = is_waiting(&self.path);
        std::fs::remove_file(&self.path).is_ok() && is_meant
    }
}

/// The outcome of ending a stored world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorldEnd {
    /// No server ran: the world was removed from the folder.
    Removed,
    /// The server has ended the world for all, and has stopped.
    ByServer,
    /// The folder stores no world.
    Nothing,
    /// The server of the folder stands by: another server has the world. Nothing was done.
    StandsBy,
    /// The server has stopped, but has not ended its world, which is stored elsewhere: another server may go on
    /// with it.
    Kept,
    /// The server took the request, but did not end the world in time.
    Underway,
    /// The server did not take the request in time. The request is withdrawn, and the world goes on.
    Unheard,
}

/// Ends the world of a data folder. A running server ends it, which this waits for; if none runs, this
/// removes the world that is stored in the folder. Beside a server that stands by this does nothing.
pub fn end_world(folder: &Path, timeout: Duration) -> Result<WorldEnd, DirectoryError> {
    let begun = Instant::now();
    let path = folder.join(REQUEST);
    let (mut asked, mut heard, mut was_elsewhere) = (false, false, false);
    let mut waiting = None;
    loop {
        // A server that takes over locks the folder before it stands by no longer.
        let stands_by = is_standby(folder);
        if !is_served(folder)? {
            if stands_by && !asked {
                return Ok(WorldEnd::StandsBy);
            }
            if asked {
                // Removes a request that came when the server was ending already.
                let _ = std::fs::remove_file(&path);
            }
            // A server notes in its folder that its world is elsewhere, until the world has ended.
            match (is_elsewhere(folder)?, asked) {
                (true, true) => return Ok(WorldEnd::Kept),
                (true, false) => return Ok(WorldEnd::Nothing),
                (false, _) if was_elsewhere => return Ok(WorldEnd::ByServer),
                (false, _) => {}
            }
            match (remove(folder), asked) {
                // A server has just started.
                (Err(DirectoryError::Taken { .. }), _) => continue,
                (Err(error), _) => return Err(error),
                (Ok(true), _) => return Ok(WorldEnd::Removed),
                (Ok(false), true) => return Ok(WorldEnd::ByServer),
                (Ok(false), false) => return Ok(WorldEnd::Nothing),
            }
        }
        heard |= asked && !path.exists();
        if begun.elapsed() >= timeout {
            // Withdraws the request: otherwise a slow server would end its world when nobody expects that any
            // more.
            heard |= asked && std::fs::remove_file(&path).is_err();
            return Ok(if heard { WorldEnd::Underway } else { WorldEnd::Unheard });
        }
        // Asks again if the request was taken: a server that was just starting removes it as one to a former
        // server.
        if asked && path.exists() {
            std::thread::sleep(LOOK_AGAIN);
            continue;
        }
        // The former request is over first: it was taken.
        drop(waiting.take());
        waiting = Some(Waiting::show(&path).map_err(|error| refused(&path, &error))?);
        asked = true;
        was_elsewhere |= is_elsewhere(folder)?;
    }
}

/// Returns why a folder takes no request: it may be another user's.
fn refused(path: &Path, error: &io::Error) -> DirectoryError {
    let (place, cause) = (path.display().to_string(), error.to_string());
    match error.kind() {
        io::ErrorKind::PermissionDenied => DirectoryError::Unreadable { place, cause },
        _ => DirectoryError::Unwritable { place, cause },
    }
}

/// Removes the world that is stored in a folder. Returns whether there was one: there is if its server died
/// meanwhile.
fn remove(folder: &Path) -> Result<bool, DirectoryError> {
    if !is_there(&folder.join("world.redb"))? {
        return Ok(false);
    }
    let mut directory = RedbDirectory::open(folder)?;
    let entries = directory.load()?;
    let is_stored = !entries.is_empty();
    let writes = entries.into_iter().map(|entry| (entry.key, None)).collect();
    directory.commit(&Batch { writes, durable: true }, &[])?;
    Ok(is_stored)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_whose_asker_has_ended_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(REQUEST);
        let mut requests = EndRequests::of(folder.path());
        let mut taken = || {
            requests.looked = requests.looked.checked_sub(LOOK).unwrap();
            requests.take()
        };
        assert!(!taken());
        let asker = Waiting::show(&path).unwrap();
        assert!(taken() && !path.exists());
        drop(asker);
        drop(Waiting::show(&path).unwrap());
        assert!(!taken() && !path.exists());
    }

    #[test]
    fn a_wait_of_no_time_or_for_ever_is_one_too() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(end_world(folder.path(), Duration::MAX).unwrap(), WorldEnd::Nothing);
        let _served = RedbDirectory::open(folder.path()).unwrap();
        assert_eq!(
            end_world(folder.path(), Duration::ZERO).unwrap(),
            WorldEnd::Unheard,
            "it was never asked"
        );
    }
}
