//! Opens a recording of any kind for its replay.

use std::io::Read;

use super::entries::Entries;
use super::entry::{NodeEntry, Subject};
use super::local::{LocalEntry, LocalReplay};
use super::node::NodeReplay;
use super::server::{ServerEntry, ServerReplay};
use super::{LocalPhysics, Physics, RecordingError, Replayed};
use crate::cluster::CanBuild;
use crate::space::Tick;

/// The maker of the physics that replays compute with.
pub trait Computers {
    /// Returns the physics of a node; `None` if the node's was the simulator's (`stand_in`) and there is none
    /// here.
    fn node(&self, stand_in: bool) -> Option<Box<dyn Physics>>;
    /// Returns how a server tells which shapes can be built; `None` if servers cannot be replayed here.
    fn can_build(&self) -> Option<CanBuild>;
    /// Returns a local world; `None` if local worlds cannot be replayed here.
    fn local(&self) -> Option<Box<dyn LocalPhysics>>;
}

/// Opens a recording, and begins its replay.
pub fn open(
    from: impl Read + Send + 'static,
    computers: &impl Computers,
) -> Result<Box<dyn Replayed>, RecordingError> {
    let (entries, subject) = Entries::open(Box::new(from))?;
    let without =
        |what: &str| RecordingError::Unsuitable(format!("this program cannot compute {what} again"));
    match subject {
        Subject::Node { seed, stand_in } => {
            let physics = computers.node(stand_in).ok_or_else(|| without("a simulated node"))?;
            Ok(Box::new(NodeReplay::new(entries, &seed, physics)))
        }
        Subject::Server => {
            let can_build = computers.can_build().ok_or_else(|| without("a server"))?;
            Ok(Box::new(ServerReplay::begin(entries, can_build)?))
        }
        Subject::Local => {
            let world = computers.local().ok_or_else(|| without("a local world"))?;
            Ok(Box::new(LocalReplay::new(entries, world)))
        }
    }
}

/// Returns the last tick of a recording, as far as it can be read.
pub fn last_tick(from: impl Read + Send + 'static) -> Result<Tick, RecordingError> {
    let (mut entries, subject) = Entries::open(Box::new(from))?;
    let mut last = Tick(0);
    match subject {
        Subject::Node { .. } => {
            while let Ok(Some(entry)) = entries.next::<NodeEntry>() {
                if let NodeEntry::Settled(digests) = entry {
                    last = last.max(digests.tick);
                }
            }
        }
        Subject::Server => {
            while let Ok(Some(entry)) = entries.next::<ServerEntry>() {
                if let ServerEntry::Told { tick, .. } = entry {
                    last = last.max(tick);
                }
            }
        }
        Subject::Local => {
            while let Ok(Some(entry)) = entries.next::<LocalEntry>() {
                if let LocalEntry::Stepped(digests) = entry {
                    last = last.max(digests.tick);
                }
            }
        }
    }
    Ok(last)
}
