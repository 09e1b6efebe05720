//! Defines the errors of authorities, identities, joins, connections and sending. Each message names cause
//! and remedy.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use super::{CloseCode, JoinRole, MAX_DATAGRAM_BYTES, PeerName};

/// The error of an authority, an identity, a join or a connection.
#[derive(Debug, thiserror::Error)]
pub enum NetError {
    /// A file or folder cannot be used.
    #[error("cannot use {}: {source}; {}", path.display(), to_use(.source))]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The content of a file is not what it should be.
    #[error("{} is damaged or of another program ({what}); {remedy}", path.display())]
    Damaged {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// Another server runs with the same data folder.
    #[error("another server is running with the data folder {}; stop it or choose another folder", path.display())]
    FolderTaken {
        /// The folder.
        path: PathBuf,
    },
    /// The folder has the keys of another world.
    #[error(
        "{} is another authority than that of the world's other servers; name a folder without one, which gets theirs", path.display()
    )]
    OtherAuthority {
        /// The file.
        path: PathBuf,
    },
    /// The record of joins cannot be read or written, so that nobody can be let in.
    #[error("joins cannot be recorded: {0}")]
    Joins(String),
    /// The text of a token is not valid, or the token is not the one that is needed.
    #[error(transparent)]
    Token(#[from] TokenError),
    /// Another process uses the port.
    #[error("{addr} is in use by another process; stop it, choose another port, or port 0 for any free one")]
    PortTaken {
        /// The address.
        addr: SocketAddr,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {addr}: {source}; {}", to_listen(.source))]
    Bind {
        /// The address.
        addr: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// Nobody answers.
    #[error("no answer from {addr} within {} ms; check that it is running, the address, and that UDP passes", waited.as_millis().next_multiple_of(10))]
    Unreachable {
        /// The address that was dialled.
        addr: SocketAddr,
        /// How long the answer was waited for.
        waited: Duration,
    },
    /// The process that answers is not the one that was dialled.
    #[error(
        "{addr} does not prove to be {expected}: {detail}; check the address, and take a token or certificate of that server"
    )]
    WrongPeer {
        /// The address that was dialled.
        addr: SocketAddr,
        /// The name that should have answered.
        expected: PeerName,
        /// What TLS said.
        detail: String,
    },
    /// The server refuses this process.
    #[error("{addr} refuses: {reason}")]
    Refused {
        /// The address that was dialled.
        addr: SocketAddr,
        /// The reason, for programs.
        code: CloseCode,
        /// The server's text, with cause and remedy.
        reason: String,
    },
    /// The server cannot let a process in by this token.
    #[error("{addr} refuses the token: {reason}")]
    TokenRefused {
        /// The address that was dialled.
        addr: SocketAddr,
        /// The server's text, with cause and remedy.
        reason: String,
    },
    /// The connection broke before it could be used.
    #[error("the connection to {addr} failed: {detail}; try again, and see the log of the other side")]
    Broken {
        /// The address that was dialled.
        addr: SocketAddr,
        /// What QUIC said.
        detail: String,
    },
    /// The TLS library refuses the keys or certificates.
    #[error("TLS cannot be set up ({0}); if it is a certificate's age, join anew with a fresh token")]
    Tls(String),
    /// A token for a server was asked for: servers own the authority and never join.
    #[error(
        "a server needs no token: it runs on the folder of its authority; mint for node, client or participant"
    )]
    ServerToken,
    /// The runtime's threads cannot be started.
    #[error("cannot start the network threads: {0}; raise the limit of threads or of open files")]
    Threads(io::Error),
}

/// Returns the remedy where a file or folder cannot be used.
fn to_use(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room there",
        io::ErrorKind::PermissionDenied => {
            "run this as the user whom it belongs to (beside a server: runuser -u dcd -- dcd ...)"
        }
        _ => "check that it exists and that this user may read and write it",
    }
}

/// Returns the remedy where an address cannot be listened on.
fn to_listen(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::PermissionDenied => {
            "choose a port above 1023, or give the program the right to the lower ones (CAP_NET_BIND_SERVICE)"
        }
        _ => "choose an address of this machine",
    }
}

/// The error for a frame or datagram that is not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// The connection does not exist, or no longer.
    #[error("the peer is not connected; wait for its Connected event or dial it again")]
    NotConnected,
    /// The peer reads too slowly.
    #[error(
        "{waiting_bytes} bytes wait for a slow peer, the limit is {limit_bytes}; send less, later, or close it"
    )]
    Full {
        /// The bytes that wait.
        waiting_bytes: usize,
        /// The most bytes that may wait.
        limit_bytes: usize,
    },
    /// The frame is longer than peers accept from this process's role.
    #[error("a frame of {bytes} bytes, peers accept {limit_bytes}; split it")]
    FrameTooLong {
        /// The length of the frame.
        bytes: usize,
        /// The longest frame that peers accept.
        limit_bytes: usize,
    },
    /// The datagram does not fit into a packet.
    #[error("a datagram of {bytes} bytes, {max} fit into a packet; split it", max = MAX_DATAGRAM_BYTES)]
    DatagramTooLong {
        /// The length of the datagram.
        bytes: usize,
    },
}

/// The error for a text that is not a token, or not the one that is needed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// The text is no token at all.
    #[error(
        "this is no dcd token: {0}; give the whole text that `dcd token` printed or dcd_token_create wrote, which begins with \
         dcd1-"
    )]
    Malformed(&'static str),
    /// The text is a token with an error in it.
    #[error(
        "the token is mistyped or cut off: its checksum is wrong; copy the whole line that `dcd token` printed or \
         dcd_token_create wrote"
    )]
    Mistyped,
    /// The token is for another role.
    #[error(
        "the token is for a {found}, a {wanted} was to join; mint one with `dcd token --role {wanted}`, or `World::token` (dcd_token_create) at \
         the server"
    )]
    WrongRole {
        /// The role that it is for.
        found: JoinRole,
        /// The role that it should be for.
        wanted: JoinRole,
    },
}

/// The reason for which a server refuses a join. Its text is sent to the joiner.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinRefusal {
    /// The two programs have different protocol versions.
    #[error(
        "this server speaks protocol version {server}, the joiner speaks {joiner}; run the same dcd version on both"
    )]
    Version {
        /// The version of the server.
        server: u32,
        /// The version of the joiner.
        joiner: u32,
    },
    /// The bytes are not a request.
    #[error("the join request cannot be read ({0}); run the same dcd version on both sides")]
    Malformed(&'static str),
    /// The text in the request is not a token.
    #[error("{0}")]
    BadToken(TokenError),
    /// The token was minted elsewhere, or is forged.
    #[error(
        "the token was not minted by this server's authority; mint one with `dcd token` on its data folder, or \
         `World::token` (dcd_token_create) at the server"
    )]
    OtherAuthority,
    /// The token has expired.
    #[error(
        "the token has expired; mint a new one with `dcd token`, or `World::token` (dcd_token_create) at the server"
    )]
    Expired,
    /// The token was used before, as often as it may be.
    #[error(
        "the token has been used already, by as many processes as it lets in: one, unless `--uses` says more; mint a new one with `dcd token`, or \
         `World::token` (dcd_token_create) at the server"
    )]
    Used,
    /// The resume key is for another role than the token.
    #[error(
        "the token is for a {token}, the resume key is of a {resume}; mint a token with `dcd token --role {resume}`, or \
         `World::token` (dcd_token_create) at the server"
    )]
    WrongRole {
        /// The role that the token is for.
        token: JoinRole,
        /// The role that the joiner had before.
        resume: JoinRole,
    },
    /// The resume key is of another authority, or is forged.
    #[error(
        "the resume key, which an identity file (`--identity`) keeps, is not of this server's authority, as after a new data folder; \
         move the file away, or join without the key, and a token gives new ids"
    )]
    BadResumeKey,
    /// The certificate to be renewed is not of this authority, or not the sender's.
    #[error(
        "the certificate is not one of this server's authority, or not the sender's; join anew with a fresh token"
    )]
    BadCertificate,
    /// The server sent the process away on purpose.
    #[error("the server sent this process away; it comes back with a new token only")]
    SentAway,
    /// The server failed to record the join.
    #[error("the server could not record the join ({0}); see its log and its disk")]
    Server(String),
}

impl JoinRefusal {
    /// Returns whether the cause is the token or the resume key, so that another may do.
    pub(super) fn is_of_token(&self) -> bool {
        matches!(
            self,
            Self::BadToken(_)
                | Self::OtherAuthority
                | Self::Expired
                | Self::Used
                | Self::WrongRole { .. }
                | Self::BadResumeKey
        )
    }
}
