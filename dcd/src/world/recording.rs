//! Records a local world to a file, or its last seconds in memory.

use std::fs;
use std::path::Path;
use std::time::Duration;

use super::role::Instead;
use super::{Error, World};
use crate::recording::{Background, RecordingError};

const RECORD: &str = "record a world by itself";

/// Recordings of local worlds. Nodes and participants are recorded from their beginning:
/// [`JoinConfig::record`](crate::network::JoinConfig).
impl World {
    /// Begins to record this world to a file: a snapshot of it as it is now, what is done to it from now on, and a digest of each region
    /// after each step. `dcd replay` computes it again from that, bit for bit, `dcd diff` finds where two recordings differ.
    /// A thread of its own writes the file; what a crash loses is the last tenth of a second. A recording that was going on ends.
    ///
    /// What a program changes by its own code ([`World::update`]) is recorded by its effect. What has no form of its own is recorded by
    /// a further snapshot before the next step: colliders that come, go or change, vehicles and characters that a program controls,
    /// links of multibodies, settings, a load balance that is set, going back to a checkpoint or a save. Contact hooks are recorded by their answers: a replay needs no hooks.
    ///
    /// ```
    /// use dcd::prelude::*;
    ///
    /// # let folder = std::env::temp_dir().join(format!("dcd-record-{}", std::process::id()));
    /// # std::fs::create_dir_all(&folder)?;
    /// # let path = folder.join("fall.dcdr");
    /// let mut world = World::new(WorldConfig::default())?;
    /// world.record_to(&path)?;
    /// world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// world.step()?;
    /// world.stop_recording()?;
    /// assert!(path.metadata()?.len() > 100);
    /// # std::fs::remove_dir_all(folder)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Recording`] where the file cannot be written. [`Error::Unsupported`] in other roles.
    pub fn record_to(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let world = self.local_mut(RECORD, Instead::RecordNodes)?;
        // It may be to the same file.
        world.end_former_recording();
        let file = Background::create(path.as_ref()).map_err(RecordingError::from)?;
        Ok(world.record(file)?)
    }

    /// Begins to record this world in memory, and keeps at least the last so much time of it by the clock on the wall, about twice as much at most: for
    /// "what happened just now?" Each stretch of that time begins with a snapshot. [`World::keep_recording`] writes it.
    ///
    /// # Errors
    /// As [`World::record_to`].
    pub fn record_last(&mut self, time: Duration) -> Result<(), Error> {
        Ok(self.local_mut(RECORD, Instead::RecordNodes)?.record_last(time)?)
    }

    /// Writes to a file what [`World::record_last`] has kept, and goes on recording. A file that is there is replaced once the new one is
    /// whole.
    ///
    /// # Errors
    /// As [`World::record_to`], also if nothing is recorded in memory.
    pub fn keep_recording(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let world = self.local_mut(RECORD, Instead::RecordNodes)?;
        let mut kept = Vec::new();
        world.keep_recording(&mut kept)?;
        let path = path.as_ref();
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let written = fs::write(&part, kept).and_then(|()| fs::rename(&part, path));
        if written.is_err() {
            let _ = fs::remove_file(&part);
        }
        Ok(written.map_err(RecordingError::from)?)
    }

    /// Ends the recording, and waits until it is written. Does nothing where nothing is recorded, and in other roles.
    ///
    /// # Errors
    /// [`Error::Recording`] if anything of it could not be written: the file ends there.
    pub fn stop_recording(&mut self) -> Result<(), Error> {
        match self.local_mut(RECORD, Instead::RecordNodes) {
            Ok(world) => Ok(world.stop_recording()?),
            Err(_) => Ok(()),
        }
    }
}
