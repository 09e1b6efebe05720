//! Defines how a subcommand fails: with a cause, a remedy and an exit code.

use std::io::Write as _;
use std::process::ExitCode;

use crate::cluster::directory::DirectoryError;
use crate::net::NetError;
use crate::runtime::{ProcessError, WorldError};
use crate::scene::SceneError;

/// The failure of a subcommand.
#[derive(Debug)]
pub(super) struct Failure {
    message: String,
    code: u8,
}

impl Failure {
    /// Creates a failure of usage: what the user asked for is impossible, and nothing was done.
    pub(super) fn usage(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: 2 }
    }

    /// Creates a failure of a run: something failed while it ran.
    pub(super) fn run(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: 1 }
    }

    /// Creates a failure after which there is nothing to go on with. Either the world has ended, so that a
    /// server that is started again begins it anew, or a node has ended in order.
    pub(super) fn ended(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: 3 }
    }

    /// Creates the failure of Ctrl-C, where there is nothing to report.
    pub(super) fn interrupted() -> Self {
        Self { message: "ended by Ctrl-C".to_owned(), code: 130 }
    }

    /// Prints it on standard error for people, and returns the exit code.
    pub(super) fn report(self) -> ExitCode {
        let _ = writeln!(std::io::stderr(), "error: {}", self.message);
        self.exit_code()
    }

    pub(super) fn message(&self) -> &str {
        &self.message
    }

    pub(super) fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code)
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<WorldError> for Failure {
    fn from(error: WorldError) -> Self {
        let message = error.to_string();
        match error {
            WorldError::Tree(_) | WorldError::Setting { .. } => Self::usage(message),
            _ => Self::run(message),
        }
    }
}

impl From<ProcessError> for Failure {
    fn from(error: ProcessError) -> Self {
        let message = error.to_string();
        match error {
            ProcessError::World(error) => error.into(),
            ProcessError::WorldEnded => Self::ended(message),
            // What the user gave cannot be used, and no server was told anything yet.
            ProcessError::Restore(_)
            | ProcessError::Directory(
                DirectoryError::Damaged { .. }
                | DirectoryError::Foreign { .. }
                | DirectoryError::Format { .. }
                | DirectoryError::Unreadable { .. }
                | DirectoryError::Unreachable { .. },
            )
            | ProcessError::Record { .. }
            | ProcessError::Metrics { .. }
            | ProcessError::Token(_)
            | ProcessError::Tree(_)
            | ProcessError::Shape(_)
            | ProcessError::Role { .. }
            | ProcessError::Lag { .. }
            | ProcessError::Net(
                NetError::Token(_)
                | NetError::TokenRefused { .. }
                | NetError::File { .. }
                | NetError::Damaged { .. }
                | NetError::WrongPeer { .. }
                | NetError::Bind { .. },
            ) => Self::usage(message),
            _ => Self::run(message),
        }
    }
}

impl From<NetError> for Failure {
    fn from(error: NetError) -> Self {
        ProcessError::from(error).into()
    }
}
