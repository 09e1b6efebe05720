//! Defines the error of saving and restoring a snapshot.

use bincode::error::{DecodeError, EncodeError};

use crate::runtime::WorldError;

/// The error of saving or restoring a snapshot.
#[derive(Debug, thiserror::Error)]
pub enum SnapshotError {
    /// The file is no snapshot, by its first bytes.
    #[error(
        "not a snapshot of dcd: give what `dcd save`, `dcd run --save`, `World::save` or dcd_snapshot_save wrote"
    )]
    Foreign,
    /// The snapshot is of another dcd or another Rapier, or was made with other features.
    #[error(
        "the snapshot is of {made_by}, this is {this}; restore it by the dcd that made it, or make it anew"
    )]
    Unlike {
        /// The build that made the snapshot.
        made_by: String,
        /// The build that should restore it.
        this: String,
    },
    /// The snapshot ends too early.
    #[error("the snapshot is cut off after {0} bytes: copy it again, or make it anew")]
    Truncated(u64),
    /// A checksum does not match, or something follows the end.
    #[error(
        "the snapshot is damaged within the block that begins at byte {0}: copy it again, or make it anew"
    )]
    Damaged(u64),
    /// The checksums match, but the content is no world.
    #[error("the snapshot makes no world ({0}): it was made by another build of dcd; restore it by that one")]
    Undecodable(DecodeError),
    /// Something in the world cannot be written to a file.
    #[error("cannot save the world ({0}); remove bodies of a custom shape")]
    Unsavable(EncodeError),
    /// The file cannot be read or written.
    #[error("the snapshot cannot be read or written: {0}; check the path, its permissions and the disk")]
    Io(#[from] std::io::Error),
    /// There cannot be that many threads, or the operating system refuses to start one.
    #[error(transparent)]
    Threads(#[from] WorldError),
}

impl From<EncodeError> for SnapshotError {
    fn from(error: EncodeError) -> Self {
        match error {
            EncodeError::Io { inner, .. } => Self::Io(inner),
            error => Self::Unsavable(error),
        }
    }
}
