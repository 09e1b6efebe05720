//! Defines the error of [`World`](super::World), for every role.

use std::fmt;

use super::role::Unsupported;
use crate::drawing::GltfError;
use crate::physics::{QueryError, ShapeError};
use crate::recording::RecordingError;
#[cfg(feature = "net")]
use crate::runtime::{ConnectionError, ProcessError};
use crate::runtime::{SnapshotError, WorldError};
use crate::scene::SceneError;

/// The error of a world's methods. Each message names cause and remedy; `Debug` prints it too, as for a `main` that returns the error.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A body, joint, setting or number is refused.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A shape cannot be held, or cannot travel.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A question cannot be answered.
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
    /// The role cannot do it.
    #[error(transparent)]
    Unsupported(#[from] Unsupported),
    /// A process cannot join or serve a world, or go on.
    #[cfg(feature = "net")]
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A connection cannot do what is asked of it.
    #[cfg(feature = "net")]
    #[error(transparent)]
    Connection(#[from] ConnectionError),
    /// The world goes on without this process, or has ended. Every later call that needs the link says so again.
    #[cfg(feature = "net")]
    #[error("{0}")]
    Lost(String),
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
