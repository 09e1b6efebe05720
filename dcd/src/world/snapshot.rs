//! Saves a local world, or a served one, to a snapshot file and restores it.

use std::io::{Read, Write};
use std::path::Path;

use super::{Error, Inner, World};
use crate::runtime::LocalWorld;

/// Snapshots of local worlds, and of served ones by their server.
impl World {
    /// Returns an error if this process cannot save and load its world.
    #[doc(hidden)]
    pub fn can_be_saved(&self) -> Result<(), Error> {
        match &self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.can_be_saved(),
        }
    }

    /// Writes the whole world: [`World::restore`] gives one that goes on from here to the same bits. The number of threads is not
    /// part of it. It is written in blocks of a mebibyte; nothing larger is kept in memory.
    ///
    /// A server writes the world as it is after one tick, for which its nodes stop for some ticks: as a local world, avatars too,
    /// without what Rapier remembers of contacts. What its program did since its last step is not in it. It waits for half a minute at most.
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

    /// Saves to a file. It is written beside its place first, so that a partial file never replaces a whole one. A symbolic link
    /// stays, and the file that it leads to is replaced; devices, pipes and folders are refused.
    pub fn save_file(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        match &self.inner {
            Inner::Local(world) => Ok(world.save_file(path.as_ref())?),
            Inner::Remote(world) => Ok(world.saved()?.save_file(path.as_ref())?),
        }
    }

    /// Reads a world that [`World::save`] wrote, up to the end of `from`, to be stepped by `threads` threads.
    ///
    /// Damage of any kind is an error. There is no guard against malice: restore no snapshot of people whom you do not trust.
    pub fn restore(from: impl Read, threads: usize) -> Result<Self, Error> {
        Ok(LocalWorld::restore(from, threads)?.into())
    }

    /// Reads a world that [`World::save_file`] wrote.
    pub fn restore_file(path: impl AsRef<Path>, threads: usize) -> Result<Self, Error> {
        Self::restore(LocalWorld::open_snapshot(path.as_ref())?, threads)
    }

    /// Replaces this world by one that [`World::save`] wrote, earlier or later, and keeps the threads and hooks of this one. Ids
    /// that this world has given are not given again. After an error nothing has changed.
    ///
    /// A server's world goes on with the bodies and joints of the saved one, for all nodes and clients, and its ticks go on; what its
    /// program did since its last step is dropped. Avatars are their clients': those that are in both go where they were,
    /// and none comes or goes.
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

    /// Replaces this world by one that [`World::save_file`] wrote, as [`World::reload`].
    pub fn reload_file(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.can_be_saved()?;
        self.reload(LocalWorld::open_snapshot(path.as_ref())?)
    }
}
