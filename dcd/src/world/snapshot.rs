//! Saves a local world to a snapshot file and restores it.

use std::io::{Read, Write};
use std::path::Path;

use super::role::Instead;
use super::{Error, World};
use crate::runtime::LocalWorld;

const SAVE: &str = "be saved or loaded";

/// Snapshots of local worlds: a server keeps its world by itself.
impl World {
    /// Returns an error if this process cannot save and load its world.
    #[doc(hidden)]
    pub fn can_be_saved(&self) -> Result<(), Error> {
        self.local(SAVE, Instead::ServerKeeps).map(drop)
    }

    /// Writes the whole world: [`World::restore`] gives one that goes on from here to the same bits. The number of threads is not
    /// part of it. It is written in blocks of a mebibyte; nothing larger is kept in memory.
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
        Ok(self.local(SAVE, Instead::ServerKeeps)?.save(to)?)
    }

    /// Saves to a file. It is written beside its place first, so that a partial file never replaces a whole one. A symbolic link
    /// stays, and the file that it leads to is replaced; devices, pipes and folders are refused.
    pub fn save_file(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        Ok(self.local(SAVE, Instead::ServerKeeps)?.save_file(path.as_ref())?)
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
    pub fn reload(&mut self, from: impl Read) -> Result<(), Error> {
        Ok(self.local_mut(SAVE, Instead::ServerKeeps)?.reload(from)?)
    }
}
