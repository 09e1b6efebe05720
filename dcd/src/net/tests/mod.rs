//! Tests the network over real QUIC on loopback, with all peers in one process.

mod faults;
mod joining;
mod traffic;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use tempfile::TempDir;

use super::*;

/// A time far longer than anything takes. A test that waits this long has failed.
const PATIENCE: Duration = Duration::from_secs(20);
const HOUR: Duration = Duration::from_secs(3600);

/// A process with its events.
struct Process {
    net: Net,
    events: NetEvents,
}

/// A server on a port of the system's choice.
struct Server {
    process: Process,
    authority: Arc<Authority>,
    folder: TempDir,
}

impl Process {
    fn start(identity: Identity, authority: Option<Arc<Authority>>, limits: Limits) -> Self {
        let config = NetConfig { listen: anywhere(), identity, authority, renewed_by: Vec::new(), limits };
        let (net, events) = Net::start(config).unwrap();
        Self { net, events }
    }

    fn next(&self) -> NetEvent {
        self.events.recv_timeout(PATIENCE).expect("something happens")
    }

    fn connected(&self) -> (PeerKey, PeerName) {
        match self.next() {
            NetEvent::Connected { peer, who, .. } => (peer, who),
            other => panic!("expected a connection, got {other:?}"),
        }
    }

    fn refused(&self) -> NetError {
        match self.next() {
            NetEvent::ConnectFailed { error, .. } => error,
            other => panic!("expected a failure to connect, got {other:?}"),
        }
    }

    fn frame(&self) -> (Lane, Vec<u8>) {
        match self.next() {
            NetEvent::Frame { lane, bytes, .. } => (lane, bytes),
            other => panic!("expected a frame, got {other:?}"),
        }
    }

    fn closed(&self) -> (CloseCause, String) {
        match self.next() {
            NetEvent::Closed { cause, reason, .. } => (cause, reason),
            other => panic!("expected the end of a connection, got {other:?}"),
        }
    }

    /// Connects to `other`; returns the keys of the connection here and there.
    fn connect_to(&self, other: &Process) -> (PeerKey, PeerKey) {
        let key = self.net.connect(other.net.local_addr(), other.net.who());
        assert_eq!(self.connected(), (key, other.net.who()));
        let (there, who) = other.connected();
        assert_eq!(who, self.net.who());
        (key, there)
    }
}

impl Server {
    fn start() -> Self {
        Self::with_limits(Limits::default())
    }

    fn with_limits(limits: Limits) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
        let identity = authority.server_identity().unwrap();
        Self { process: Process::start(identity, Some(authority.clone()), limits), authority, folder }
    }

    fn addr(&self) -> SocketAddr {
        self.process.net.local_addr()
    }

    fn token(&self, role: JoinRole) -> Token {
        self.authority.issue_token(role, HOUR, SystemTime::now()).unwrap()
    }

    fn join(&self, role: JoinRole) -> Identity {
        join(&[self.addr()], &self.token(role), None, PATIENCE).unwrap()
    }

    /// Starts a process that has joined and listens.
    fn process(&self, role: JoinRole) -> Process {
        Process::start(self.join(role), None, Limits::default())
    }
}

fn anywhere() -> SocketAddr {
    "127.0.0.1:0".parse().unwrap()
}
