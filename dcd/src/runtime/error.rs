//! Defines the error with which a process of a cluster fails to start or to go on.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use super::{DeviceError, WorldError};
use crate::cluster::directory::DirectoryError;
use crate::net::{JoinRole, NetError, TokenError};
use crate::physics::{HostError, ShapeError};
use crate::protocol::Refusal;
use crate::space::TreeError;

/// The error of a server, node, client or participant. Each message names cause and remedy.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// An error of the network.
    #[error(transparent)]
    Net(#[from] NetError),
    /// An error of the stored directory, which outlives the server.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// The token is malformed or for another role.
    #[error(transparent)]
    Token(#[from] TokenError),
    /// An error of the physics.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The regions cannot be made as asked.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// The recording cannot be written.
    #[error("cannot record to {path}: {cause}; check the path, its permissions and the disk")]
    Record {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The metrics endpoint cannot be opened.
    #[error(
        "cannot answer for metrics at {address}: {cause}; give a free address of this machine, or port 0 for any"
    )]
    Metrics {
        /// The address asked for.
        address: SocketAddr,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The world cannot be made as asked.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A body or shape of the scene cannot be used.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A body of the scene cannot be inserted.
    #[error(transparent)]
    Host(#[from] HostError),
    /// The identity has another role than the process needs.
    #[error("this identity is of a {has}, the process is to be a {needs}: join with a token of that role")]
    Role {
        /// The role of the identity.
        has: JoinRole,
        /// The role that the process needs.
        needs: JoinRole,
    },
    /// The server, or the network, ended the process's link.
    #[error(
        "the link to the server at {server} is gone ({reason}); start the server again and join with a new token"
    )]
    ServerGone {
        /// The address of the server.
        server: SocketAddr,
        /// The reason in the words of the network or the server.
        reason: String,
    },
    /// The server did not come back in the time that the process waits for it.
    #[error(
        "the server at {server} has been out of reach for {} s ({reason}); start it again with its --data and --listen, and \
         this process with a new token, or a node with its --identity; --give-up lets it wait longer",
        waited.as_secs_f64()
    )]
    GivenUp {
        /// The address of the server.
        server: SocketAddr,
        /// How long the process waited.
        waited: Duration,
        /// The network's last reason.
        reason: String,
    },
    /// The server is there, but the node that leads the client's group is out of reach.
    #[error(
        "the node at {leader}, which tells this client of the world, has been out of reach for {} s ({reason}); let UDP through to \
         it, or start it with --advertise and an address that is reached from here; --give-up lets this process wait longer",
        waited.as_secs_f64()
    )]
    LeaderUnreachable {
        /// The leader's address, as its server says.
        leader: SocketAddr,
        /// How long the process waited.
        waited: Duration,
        /// The network's last reason.
        reason: String,
    },
    /// Another process with the same identity took its place.
    #[error(
        "another process has joined the server at {server} with this one's identity, and took its place; give each process \
         an identity file of its own (--identity), and start this one again if it was the right one"
    )]
    Superseded {
        /// The address of the server.
        server: SocketAddr,
    },
    /// The server ended this node.
    #[error("the server at {server} ended this node: {reason}")]
    Evicted {
        /// The address of the server.
        server: SocketAddr,
        /// The server's words, with cause and remedy.
        reason: String,
    },
    /// The server's user disconnected the process.
    #[error(
        "the server at {server} sent this process away ({reason}); join with a new token, if it gives one"
    )]
    SentAway {
        /// The address of the server.
        server: SocketAddr,
        /// The words of the server's user.
        reason: String,
    },
    /// The user asked to leave, and the server did not release the process in time.
    #[error(
        "the server at {server} did not take this process's share over within {waited:?}; it is gone without: the others \
         go on from the last checkpoint"
    )]
    NotReleased {
        /// The address of the server.
        server: SocketAddr,
        /// How long the process waited.
        waited: Duration,
    },
    /// The world was not received in time.
    #[error(
        "the server at {server} did not tell the whole world within {waited:?}: it or the link is slow; wait longer"
    )]
    Timeout {
        /// The address of the server.
        server: SocketAddr,
        /// How long the process waited.
        waited: Duration,
    },
    /// The server did not report the state of its world in time.
    #[error("the server at {server} has not answered within {waited:?}: it or the link is slow; ask again")]
    NoStatus {
        /// The address of the server.
        server: SocketAddr,
        /// How long the process waited.
        waited: Duration,
    },
    /// The server or leader refused.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The process's own thread has ended.
    #[error("this process has left the world already; join anew")]
    Stopped,
    /// The process has ended; the cause was reported before.
    #[error("{0}")]
    Ended(String),
    /// The world was ended for all its servers while this one stood by.
    #[error("the world has ended while this server stood by; started again it would begin the world anew")]
    WorldEnded,
    /// A backup cannot be written. The world runs on.
    #[error("cannot write a backup to {}: {cause}; name a folder that is not there yet, where the server's user may make one", folder.display())]
    Backup {
        /// The folder that the backup was to be written to.
        folder: PathBuf,
        /// The system's reason.
        cause: String,
    },
    /// A stored world cannot be resumed.
    #[error(transparent)]
    Restore(#[from] crate::cluster::RestoreError),
    /// The nodes did not report in time what they own.
    #[error("the nodes have not said within {} s what they own; {}", waited.as_secs(), match linked {
        0 => "none has a link to the server: start one, and save again",
        _ => "save again, or see the server's log for who hangs",
    })]
    NotSaved {
        /// How long the server waited.
        waited: Duration,
        /// The number of nodes that have a link to the server.
        linked: usize,
    },
    /// A saved world is stepped in another way than the world that it should replace.
    #[error(
        "the saved world has ticks of {} s and gravity {:?}, and this one ticks of {} s and gravity {:?}: serve the saved one \
         as a world of its own",
        theirs.0, theirs.1, ours.0, ours.1
    )]
    OtherSteps {
        /// The saved world's tick, seconds, and its gravity, m/s².
        theirs: (f32, [f32; 3]),
        /// The served world's tick and gravity.
        ours: (f32, [f32; 3]),
    },
    /// A part of a saved world cannot be sent to nodes.
    #[error("the saved world has a {field} that cannot be sent to nodes: {rule}")]
    Unservable {
        /// The field.
        field: &'static str,
        /// The rule that its value breaks.
        rule: &'static str,
    },
    /// Members that are not in lockstep cannot use a coupling with consensus.
    #[error(
        "members that run ahead of one another (--lag) agree by `owner` only, not by `{coupling}`: add --coupling owner"
    )]
    Lag {
        /// The coupling that was asked for.
        coupling: &'static str,
    },
    /// An internal error (a bug).
    #[error(
        "a fault of dcd ended this process's part in the world; please report it with the message printed above"
    )]
    Fault,
    /// The operating system cannot start a thread.
    #[error("cannot start a thread: {0}; raise the limit of threads")]
    Thread(std::io::Error),
}

impl ProcessError {
    /// Returns this error to report it once more: in the same words, and of the same kind if a bug or a disk
    /// caused it.
    pub(crate) fn again(&self) -> Self {
        match self {
            Self::Fault => Self::Fault,
            Self::Directory(error) => Self::Directory(error.clone()),
            Self::Record { path, cause } => {
                let cause = io::Error::new(cause.kind(), cause.to_string());
                Self::Record { path: path.clone(), cause }
            }
            other => Self::Ended(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::mem::discriminant;

    use super::*;

    #[test]
    fn who_asks_again_hears_the_same_words_of_a_bug_and_of_a_disk_also_of_the_same_kind() {
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        let (path, place) = (PathBuf::from("server.dcdr"), "world.redb".to_owned());
        for (error, stays) in [
            (ProcessError::Fault, true),
            (DirectoryError::Unwritable { place, cause: full().to_string() }.into(), true),
            (ProcessError::Record { path, cause: full() }, true),
            (ProcessError::WorldEnded, false),
        ] {
            let again = error.again().again();
            assert_eq!(again.to_string(), error.to_string());
            let kind =
                if stays { discriminant(&error) } else { discriminant(&ProcessError::Ended(String::new())) };
            assert_eq!(discriminant(&again), kind, "{error}");
        }
    }
}
