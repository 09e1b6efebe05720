//! Records a local world to a file, or its last seconds in memory.

use std::fs;
use std::path::Path;
use std::time::Duration;

use super::role::Instead;
use super::{Error, World};
use crate::recording::{Background, RecordingError};

const RECORD: &str = "record a world by itself";

/// Recordings of local worlds. A node or participant is recorded from its beginning instead:
/// [`JoinConfig::record`](crate::network::JoinConfig).
impl World {
    /// Begins to record this world to a file: a snapshot of the world as it is now, what is done to it from
    /// now on, and a digest of each region after each step. `dcd replay` computes the world again from the
    /// file, bit for bit, and `dcd diff` finds where two recordings differ. A thread of its own writes the
    /// file, and a crash loses the last tenth of a second. A recording in progress ends.
    ///
    /// Changes that a program makes by its own code ([`World::update`]) are recorded by their effect. Some
    /// changes have no entry of their own; for them a further snapshot is recorded before the next step:
    /// colliders that come, go or change, vehicles and characters that a program controls, links of
    /// multibodies, settings, a load balance that is set, and going back to a checkpoint or a save. Contact
    /// hooks are recorded by their answers, so that a replay needs no hooks.
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
    /// [`Error::Recording`] if the file cannot be written. [`Error::Unsupported`] in other roles.
    pub fn record_to(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let world = self.local_mut(RECORD, Instead::RecordNodes)?;
        // It may be to the same file.
        world.end_former_recording();
        let file = Background::create(path.as_ref()).map_err(RecordingError::from)?;
        Ok(world.record(file)?)
    }

    /// Begins to record this world in memory, to answer "what happened just now?" At least the last `time` of
    /// it is kept, by wall clock, and at most about twice as much. Each stretch of that length begins with a
    /// snapshot. [`World::keep_recording`] writes what is kept to a file.
    ///
    /// # Errors
    /// The same as [`World::record_to`].
    pub fn record_last(&mut self, time: Duration) -> Result<(), Error> {
        Ok(self.local_mut(RECORD, Instead::RecordNodes)?.record_last(time)?)
    }

    /// Writes to a file what [`World::record_last`] has kept, and goes on recording. The new file replaces an
    /// existing one once it is whole.
    ///
    /// # Errors
    /// The same as [`World::record_to`], and [`Error::Recording`] if nothing is recorded in memory.
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

    /// Ends the recording, and waits until it is written. Does nothing if no recording is in progress, and in
    /// other roles.
    ///
    /// # Errors
    /// [`Error::Recording`] if a part of it could not be written: the file ends there.
    pub fn stop_recording(&mut self) -> Result<(), Error> {
        match self.local_mut(RECORD, Instead::RecordNodes) {
            Ok(world) => Ok(world.stop_recording()?),
            Err(_) => Ok(()),
        }
    }
}
