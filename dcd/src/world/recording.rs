//! Records a local world to a file, or its last seconds in memory.

use std::io::Write;
use std::path::Path;
use std::time::Duration;

use super::role::Instead;
use super::{Error, World};
use crate::recording::RecordingError;
use crate::runtime::replace_file;

const RECORD: &str = "record a world by itself";

/// Recordings of local worlds. A node or participant is recorded from its beginning instead:
/// [`JoinConfig::record`](crate::network::JoinConfig).
impl World {
    /// Begins to record this world to a file: a snapshot of the world as it is now, what is done to it from
    /// now on, and a digest of each region after each step. `dcd replay` computes the world again from the
    /// file, bit for bit, and `dcd diff` finds where two recordings differ. A thread of its own writes the
    /// file, and a crash loses the last tenth of a second. A file that is there is replaced, unless another
    /// recording is being written to it.
    ///
    /// A recording in progress ends. If that one is not whole, its error is returned and no new one begins;
    /// the call may then be repeated. A world that is dropped ends its recording too, and can only log that
    /// it is not whole: call [`World::stop_recording`] first.
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
        Ok(self.local_mut(RECORD, Instead::RecordNodes)?.record_to(path.as_ref())?)
    }

    /// Begins to record this world in memory, to answer "what happened just now?" At least the last `time` of
    /// it is kept, by wall clock, and at most about twice as much. Each stretch of that length begins with a
    /// snapshot. [`World::keep_recording`] writes what is kept to a file. A recording in progress ends as by
    /// [`World::record_to`].
    ///
    /// # Errors
    /// The same as [`World::record_to`].
    pub fn record_last(&mut self, time: Duration) -> Result<(), Error> {
        Ok(self.local_mut(RECORD, Instead::RecordNodes)?.record_last(time)?)
    }

    /// Writes to a file what [`World::record_last`] has kept, and goes on recording. The new file replaces an
    /// existing one once it is whole. A symbolic link stays, and the file to which it leads is replaced.
    /// Devices, pipes and folders are refused.
    ///
    /// # Errors
    /// The same as [`World::record_to`], and [`Error::Recording`] if nothing is recorded in memory.
    pub fn keep_recording(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let world = self.local_mut(RECORD, Instead::RecordNodes)?;
        let mut kept = Vec::new();
        world.keep_recording(&mut kept)?;
        let path = path.as_ref();
        let written = replace_file(path, |mut file| file.write_all(&kept));
        Ok(written.map_err(|error| RecordingError::Unwritable { path: path.to_owned(), error })?)
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

#[cfg(all(test, unix))]
mod tests {
    use std::fs;

    use super::*;
    use crate::runtime::WorldConfig;

    #[test]
    fn each_file_of_a_world_replaces_the_target_of_a_link_and_nothing_else() {
        type Save = fn(&mut World, &Path) -> Result<(), Error>;
        let saves: [(&str, Save); 3] = [
            ("a recording", |world, path| world.keep_recording(path)),
            ("a snapshot", |world, path| world.save_file(path)),
            ("a glTF file", |world, path| world.save_gltf(path)),
        ];
        let mut world = World::new(WorldConfig::default()).unwrap();
        world.record_last(Duration::from_secs(9)).unwrap();
        world.step().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink(&file, &link).unwrap();
        for (what, save) in saves {
            fs::write(&file, "old").unwrap();
            save(&mut world, &link).unwrap();
            assert!(link.is_symlink() && fs::read(&file).unwrap() != b"old", "{what}");
            let refused = save(&mut world, Path::new("/dev/null")).unwrap_err().to_string();
            assert!(refused.contains("not a regular file"), "{what}: {refused}");
        }
    }
}
