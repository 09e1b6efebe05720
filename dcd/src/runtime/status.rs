//! Asks a server for the status of its world, without taking part in that world.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::member::interface_towards;
use super::{JoinConfig, ProcessError};
use crate::net::{
    CloseCode, JoinRole, Lane, Limits, Net, NetConfig, NetEvent, NetEvents, PeerKey, PeerName, SendError,
};
use crate::protocol::{self, Message, Status};

/// A link to a server, over which the server is asked for the status of its world.
pub struct StatusLink {
    net: Net,
    events: NetEvents,
    /// All addresses at which the server may be.
    servers: Vec<SocketAddr>,
    link: PeerKey,
}

impl StatusLink {
    /// Connects with a client's token, and waits for the link no longer than the configuration's timeout. The
    /// process takes no part in the world: it is told of no body.
    pub fn connect(config: &JoinConfig) -> Result<Self, ProcessError> {
        let begun = Instant::now();
        let identity = config.join(JoinRole::Client)?;
        let net = NetConfig {
            listen: SocketAddr::new(interface_towards(&config.servers()), 0),
            identity,
            authority: None,
            renewed_by: config.servers(),
            limits: Limits::default(),
        };
        let (net, events) = Net::start(net)?;
        let servers = config.servers();
        let link = net.connect_to_one_of(&servers, PeerName::Server);
        let status = Self { net, events, servers, link };
        status.wait_for_link(begun, config.timeout)?;
        Ok(status)
    }

    /// Dials the server again, at all addresses, after its link has broken. No token is used up.
    pub fn dial_again(&mut self, timeout: Duration) -> Result<(), ProcessError> {
        let begun = Instant::now();
        self.net.close(self.link, CloseCode::DONE, "dialled anew");
        self.link = self.net.connect_to_one_of(&self.servers, PeerName::Server);
        self.wait_for_link(begun, timeout)
    }

    fn wait_for_link(&self, begun: Instant, timeout: Duration) -> Result<(), ProcessError> {
        self.wait(begun, timeout, |event| matches!(event, NetEvent::Connected { .. }).then_some(()))
    }

    /// Asks for the status, and waits for the answer. A server answers at most ten times per second.
    pub fn ask(&self, timeout: Duration) -> Result<Status, ProcessError> {
        let begun = Instant::now();
        let gone = |reason: String| ProcessError::ServerGone { server: self.servers[0], reason };
        let question = protocol::encode(&Message::AskStatus);
        match self.net.send(self.link, Lane::Admin, &question) {
            // Why a link is gone is said by its last event.
            Ok(()) | Err(SendError::NotConnected) => {}
            Err(error) => return Err(gone(error.to_string())),
        }
        self.wait(begun, timeout, |event| match event {
            NetEvent::Frame { bytes, .. } => match protocol::decode(&bytes) {
                Ok(Message::Status(status)) => Some(Ok(status)),
                Ok(_) => None,
                // For example an answer of another version.
                Err(error) => Some(Err(gone(error.to_string()))),
            },
            _ => None,
        })?
    }

    fn wait<T>(
        &self,
        begun: Instant,
        timeout: Duration,
        take: impl Fn(NetEvent) -> Option<T>,
    ) -> Result<T, ProcessError> {
        let server = self.servers[0];
        loop {
            let left = timeout.saturating_sub(begun.elapsed());
            match self.events.recv_timeout(left) {
                Ok(event) if event.peer() != self.link => {}
                Ok(NetEvent::ConnectFailed { error, .. }) => return Err(error.into()),
                Ok(NetEvent::Closed { reason, .. }) => {
                    return Err(ProcessError::ServerGone { server, reason });
                }
                Ok(event) => {
                    if let Some(taken) = take(event) {
                        return Ok(taken);
                    }
                }
                Err(_) => return Err(ProcessError::NoStatus { server, waited: timeout }),
            }
        }
    }
}
