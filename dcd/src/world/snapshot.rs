//! Saves a local or served world to a snapshot, and restores worlds from snapshots.

use std::io::{Read, Write};
use std::path::Path;

use super::{Error, Inner, World};
use crate::runtime::LocalWorld;

/// Snapshots of local worlds, and of served worlds by their server.
impl World {
    /// Returns an error if this role cannot save and load its world.
    #[doc(hidden)]
    pub fn can_be_saved(&self) -> Result<(), Error> {
        match &self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.can_be_saved(),
        }
    }

    /// Writes a snapshot of the whole world. [`World::restore`] makes a world from it that goes on with
    /// bit-identical results. The number of threads is not part of a snapshot. It is written in blocks of 1
    /// MiB; nothing larger is kept in memory.
    ///
    /// A server writes its world as it is after one tick, for which the nodes stop for some ticks. The
    /// snapshot is one of a local world, with avatars, but without what Rapier remembers of contacts, and
    /// without what the program did since its last step. The call waits for half a minute at most. Clients
    /// and nodes return an error.
    ///
    /// ```
    /// use dcd::prelude::*;
    ///
    /// let mut world = World::new(WorldConfig::default())?;
    /// let mut saved = Vec::new();
    /// world.save(&mut saved)?;
    /// let mut again = World::restore(&saved[..], 2)?;
    /// world.step()?;
    /// again.step()?;
    /// assert_eq!(world.state_hash()?, again.state_hash()?);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn save(&self, to: impl Write) -> Result<(), Error> {
        match &self.inner {
            Inner::Local(world) => Ok(world.save(to)?),
            Inner::Remote(world) => Ok(world.saved()?.save(to)?),
        }
    }

    /// Writes a snapshot to a file, as by [`World::save`]. It is written beside its place first, so that a
    /// partial file never replaces a whole one. A symbolic link stays, and the file to which it leads is
    /// replaced. Devices, pipes and folders are refused.
    pub fn save_file(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        match &self.inner {
            Inner::Local(world) => Ok(world.save_file(path.as_ref())?),
            Inner::Remote(world) => Ok(world.saved()?.save_file(path.as_ref())?),
        }
    }

    /// Makes a local world from a snapshot that [`World::save`] wrote, read up to the end of `from`, to be
    /// stepped by `threads` threads.
    ///
    /// Damage of any kind is an error. There is no protection against malicious snapshots: restore none from
    /// people whom you do not trust.
    pub fn restore(from: impl Read, threads: usize) -> Result<Self, Error> {
        Ok(LocalWorld::restore(from, threads)?.into())
    }

    /// Makes a local world from a file that [`World::save_file`] wrote, as by [`World::restore`].
    pub fn restore_file(path: impl AsRef<Path>, threads: usize) -> Result<Self, Error> {
        Self::restore(LocalWorld::open_snapshot(path.as_ref())?, threads)
    }

    /// Replaces this world by a snapshot that [`World::save`] wrote, of an earlier or later time, and keeps
    /// this world's threads and hooks. Ids that this world has given are not given again. After an error
    /// nothing has changed.
    ///
    /// Where something was made since the save, what is made now gets other ids than it got then. A world of
    /// several regions then goes on to other bits, since how contacts are found again at a border depends on
    /// ids. [`World::checkpoint`] gives the same ids again.
    ///
    /// A server's world goes on with the bodies and joints of the snapshot, for all nodes and clients, and
    /// its ticks go on. What the program did since its last step is dropped. Avatars belong to their clients:
    /// those that are in both worlds go where they were, and none comes or goes.
    pub fn reload(&mut self, from: impl Read) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => {
                world.reload(from)?;
                self.last_step.go_back();
                Ok(())
            }
            Inner::Remote(world) => {
                world.can_be_saved()?;
                world.replace(&LocalWorld::restore(from, 1)?)
            }
        }
    }

    /// Replaces this world by a snapshot file that [`World::save_file`] wrote, as by [`World::reload`].
    pub fn reload_file(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.can_be_saved()?;
        self.reload(LocalWorld::open_snapshot(path.as_ref())?)
    }
}
