//! Saves a world to a snapshot between two ticks, and restores it, to go on bit for bit as if it had not been
//! interrupted. In memory (`checkpoint`) this works without encoding anything.
//!
//! A snapshot holds Rapier's own state of every region and all other state of the regions. A header names the
//! build that made it (`header`), and blocks with checksums follow (`blocks`). Damage is found before
//! anything is decoded.

mod blocks;
mod checkpoint;
mod error;
mod header;
#[cfg(test)]
mod tests;

use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::choice::Why;
use super::config::check_threads;
use super::durable::{irregular, replace_file};
use super::joint_strength::Strengths;
use super::{LocalWorld, WorldError};
use crate::physics::RegionHost;
use crate::protocol::{ContactLedger, WorldEvents, read_state, write_state};
use blocks::{BlockReader, BlockWriter};
pub use checkpoint::Checkpoint;
pub use error::SnapshotError;

/// The format number. It grows with every change of what is saved, including the order of fields.
const FORMAT: u32 = 31;

impl LocalWorld {
    /// Writes the whole world. [`LocalWorld::restore`] returns a world that goes on from here to the same
    /// bits. The number of threads is not saved. The snapshot is written in blocks of a mebibyte; nothing
    /// larger is kept in memory.
    ///
    /// ```
    /// use dcd::runtime::{LocalWorld, WorldConfig};
    ///
    /// let mut world = LocalWorld::new(WorldConfig::default())?;
    /// let mut saved = Vec::new();
    /// world.save(&mut saved)?;
    /// let mut again = LocalWorld::restore(&saved[..], 2)?;
    /// world.step()?;
    /// again.step()?;
    /// assert_eq!(world.state_hash(), again.state_hash());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn save(&self, mut to: impl Write) -> Result<(), SnapshotError> {
        self.save_to(&mut to)
    }

    fn save_to(&self, to: &mut dyn Write) -> Result<(), SnapshotError> {
        let Self {
            host,
            ledger,
            events,
            next_body,
            next_joint,
            strengths,
            last_step: _,
            why: _,
            tape: _,
            identity: _,
        } = self;
        let header = header::write(FORMAT, to)?;
        let mut blocks = BlockWriter::new(to, header);
        let saved = Saved { host, ledger, events, next_body: *next_body, next_joint: *next_joint, strengths };
        write_state(&saved, &mut blocks)?;
        Ok(blocks.finish()?)
    }

    /// Reads a world that [`LocalWorld::save`] wrote, up to the end of `from`, to be stepped by `threads`
    /// threads.
    ///
    /// Damage of any kind is an error. There is no guard against malice: the checksums need no key, and
    /// whoever writes right ones can give Rapier broken indices. Do not restore snapshots of people whom you
    /// do not trust.
    pub fn restore(mut from: impl Read, threads: usize) -> Result<Self, SnapshotError> {
        Self::restore_from(&mut from, threads)
    }

    fn restore_from(from: &mut dyn Read, threads: usize) -> Result<Self, SnapshotError> {
        check_threads(threads)?;
        let header = header::read(FORMAT, from)?;
        let mut blocks = BlockReader::new(from, header);
        let restored = read_state(&mut blocks);
        let Restored { mut host, ledger, events, next_body, next_joint, strengths } =
            restored.map_err(|error| blocks.failure().unwrap_or(SnapshotError::Undecodable(error)))?;
        blocks.finish()?;
        host.resume();
        host.set_threads(threads).map_err(WorldError::from)?;
        let why = Why::Saved;
        Ok(Self {
            host,
            ledger,
            events,
            next_body,
            next_joint,
            strengths,
            last_step: Duration::ZERO,
            why,
            tape: None,
            identity: Arc::default(),
        })
    }

    /// Replaces this world by one that [`LocalWorld::save`] wrote, earlier or later. This world's threads and
    /// hooks are kept. Ids that this world has given are not given again. After an error nothing has changed.
    pub fn reload(&mut self, from: impl Read) -> Result<(), SnapshotError> {
        let mut world = Self::restore(from, 1)?;
        world.host.serve_as(&self.host).map_err(WorldError::from)?;
        world.next_body = world.next_body.max(self.next_body);
        world.next_joint = world.next_joint.max(self.next_joint);
        world.tape = self.tape.take();
        world.identity = Arc::clone(&self.identity);
        *self = world;
        self.tape_spoilt();
        Ok(())
    }

    /// Saves to a file. The file is written beside its place first, so that a partial file never replaces a
    /// whole one. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes and
    /// folders are refused.
    pub fn save_file(&self, path: &Path) -> Result<(), SnapshotError> {
        replace_file(path, |file| self.save(BufWriter::new(file)))
    }

    /// Opens a file for [`LocalWorld::restore`] or [`LocalWorld::reload`]. Devices, pipes and folders are
    /// refused: some never end.
    pub fn open_snapshot(path: &Path) -> Result<impl Read + use<>, SnapshotError> {
        if !fs::metadata(path)?.is_file() {
            return Err(irregular().into());
        }
        Ok(BufReader::with_capacity(1 << 16, File::open(path)?))
    }

    /// Returns whether these first bytes of a file are those of a snapshot. Eight bytes are enough.
    pub fn is_snapshot(beginning: &[u8]) -> bool {
        beginning.starts_with(&header::MAGIC)
    }
}

#[derive(Serialize)]
struct Saved<'a> {
    host: &'a RegionHost,
    ledger: &'a ContactLedger,
    events: &'a WorldEvents,
    next_body: u32,
    next_joint: u64,
    strengths: &'a Strengths,
}

/// The fields of [`Saved`], owned.
#[derive(Deserialize)]
struct Restored {
    host: RegionHost,
    ledger: ContactLedger,
    events: WorldEvents,
    next_body: u32,
    next_joint: u64,
    strengths: Strengths,
}
