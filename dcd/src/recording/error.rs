//! Defines the error of making, reading and replaying a recording.

use std::path::PathBuf;

/// The error of making, reading or replaying a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file is no recording, by its first bytes.
    #[error("not a recording of dcd: give what `--record`, `World::record_to` or dcd_record wrote")]
    Foreign,
    /// The recording has another format.
    #[error(
        "the recording has format {theirs}, this dcd reads format {ours}: replay it by the dcd that made it"
    )]
    Format {
        /// The format of the file.
        theirs: u32,
        /// The format of this build of dcd.
        ours: u32,
    },
    /// A checksum does not match.
    #[error("the recording is damaged within the chunk that begins at byte {0}: copy it again")]
    Damaged(u64),
    /// The checksums match, yet the content is no recording.
    #[error("the recording cannot be read ({0}): it was made by another build of dcd; replay it by that one")]
    Undecodable(String),
    /// The recording has no beginning: the process was killed at once.
    #[error("the recording ends before its world begins: there is nothing to replay")]
    Empty,
    /// The replay did not ask its physics for something that the recording has an answer to.
    #[error(
        "the replay parts from the recording after tick {tick}, outside the physics: the recorded machine took an answer of \
         its physics that this one did not ask for; replay it by the dcd that made it"
    )]
    Astray {
        /// The last completed tick.
        tick: u64,
    },
    /// The replay's physics cannot go on.
    #[error("the replay's physics cannot go on: {0}")]
    Physics(String),
    /// One of several recordings that are replayed together has an error.
    #[error("{name}: {error}")]
    Of {
        /// The name of the recording.
        name: String,
        /// The error of that recording.
        error: Box<RecordingError>,
    },
    /// The recording is of a kind that cannot be used in this way.
    #[error("{0}")]
    Unsuitable(String),
    /// The file that a world is to be recorded to cannot be written.
    #[error(
        "cannot record to \"{}\": {error}; check the path, its permissions and the disk, or name another file",
        path.display()
    )]
    Unwritable {
        /// The path of the file.
        path: PathBuf,
        /// The operating system's message.
        error: std::io::Error,
    },
    /// A part of the recording could not be written: the file ends there.
    #[error(
        "the recording \"{}\" is not whole: {error}; it can be replayed up to there: make room on the disk and record again",
        path.display()
    )]
    NotWhole {
        /// The path of the file.
        path: PathBuf,
        /// The operating system's message.
        error: std::io::Error,
    },
    /// The recording that was going on is not whole. It has ended, and no new one has begun.
    #[error("the recording before failed: {0}; no new one has begun: repeat the call")]
    Former(Box<RecordingError>),
    /// The file cannot be read or written.
    #[error("the recording cannot be read or written: {0}; check the path, its permissions and the disk")]
    Io(#[from] std::io::Error),
}
