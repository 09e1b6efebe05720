//! Defines [`Error`], the error of the methods of [`World`](super::World) in every role.

use std::fmt;

use super::role::Unsupported;
use crate::drawing::GltfError;
use crate::physics::{QueryError, ShapeError};
use crate::recording::RecordingError;
#[cfg(feature = "net")]
use crate::runtime::{ConnectionError, ProcessError};
use crate::runtime::{SnapshotError, WorldError};
use crate::scene::SceneError;

/// The error of the methods of [`World`](super::World). Each message names cause and remedy. `Debug` prints
/// the message too, so that a `main` which returns the error shows it.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The world refuses a body, joint, setting or number.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The world cannot hold a shape, or a shape cannot be sent to other processes.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A spatial query cannot be answered.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// A snapshot cannot be written or read.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// A world cannot be recorded.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A glTF file cannot be written.
    #[error(transparent)]
    Gltf(#[from] GltfError),
    /// A scene cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The role of this process does not support the call.
    #[error(transparent)]
    Unsupported(#[from] Unsupported),
    /// This process cannot join or serve a world, or cannot go on.
    #[cfg(feature = "net")]
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A connection does not allow what was asked of it.
    #[cfg(feature = "net")]
    #[error(transparent)]
    Connection(#[from] ConnectionError),
    /// The world goes on without this process, or has ended. Every later call that needs the link returns
    /// this error again.
    #[cfg(feature = "net")]
    #[error("{0}")]
    Lost(String),
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
