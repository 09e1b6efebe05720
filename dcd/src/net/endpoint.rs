//! Runs a process's network endpoint: one UDP port, its connections, and the threads that serve them.

#[cfg(feature = "physics")]
use std::collections::BTreeMap;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::{Duration, SystemTime};

use quinn::{Endpoint, TokioRuntime};
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

use super::calls::{Shared, accept, dial};
#[cfg(feature = "physics")]
use super::datagrams::Datagrams;
use super::quic_config::{client_config, endpoint_config, server_config};
use super::renewal::renew_in_time;
use super::seldom::Seldom;
#[cfg(feature = "physics")]
use super::stats::Counted;
use super::unasked::Unasked;
use super::{
    Authority, CloseCode, Identity, Lane, Limits, NetError, NetEvents, NetTotals, PeerKey, PeerName,
    PeerStats, SendError,
};
use crate::priority::give_way;

/// The most links whose traffic is counted by the thread that asks for it. Reading what the network's thread
/// wrote last takes a microsecond per link.
#[cfg(feature = "physics")]
pub(super) const FEW: usize = 16;

/// The settings of a process's network.
pub struct NetConfig {
    /// The address to listen on; port 0 takes any free port.
    pub listen: SocketAddr,
    /// The identity of this process.
    pub identity: Identity,
    /// The authority, on a server only: with it, joins are answered.
    pub authority: Option<Arc<Authority>>,
    /// The addresses of the server that renews the certificate; empty if the certificate outlives the
    /// process.
    pub renewed_by: Vec<SocketAddr>,
    /// Time-outs and sizes.
    pub limits: Limits,
}

/// The network of one process. Its methods return at once and may be called from any thread; outcomes come
/// back as [`NetEvents`]. Dropping it shuts it down.
pub struct Net {
    shared: Arc<Shared>,
    /// `None` once it is shut down.
    runtime: Option<Runtime>,
    /// Connections that are being closed: shutting down waits for them.
    closing: Mutex<Vec<JoinHandle<()>>>,
}

impl Net {
    /// Starts to listen, and on a server to answer joins.
    pub fn start(config: NetConfig) -> Result<(Self, NetEvents), NetError> {
        let NetConfig { listen, identity, authority, renewed_by, limits } = config;
        if let Some(authority) = &authority {
            authority.open_ledger()?;
        }
        let answer = server_config(&identity, authority.is_some(), &limits)?;
        let dial = client_config(&identity, &limits)?;
        let socket = bind(listen)?;
        // One thread leaves the cores to the regions. Two gain little (measured on two cores, both ends in
        // one process): a round trip of 65 instead of 80 µs at full rate, and of 150 to 350 µs with either at
        // 100 frames per second.
        let is_client_only = identity.who().is_client_only();
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .max_blocking_threads(4)
            .thread_name("dcd-net")
            .on_thread_start(move || {
                // A client computes no region, and its program draws.
                if !is_client_only {
                    give_way();
                }
            })
            .enable_all()
            .build()
            .map_err(NetError::Threads)?;
        let endpoint = {
            let _context = runtime.enter();
            let config = endpoint_config(authority.as_deref(), &identity);
            Endpoint::new(config, Some(answer.clone()), socket, Arc::new(TokioRuntime))
                .map_err(|source| NetError::Bind { addr: listen, source })?
        };
        let local_addr = endpoint.local_addr().map_err(|source| NetError::Bind { addr: listen, source })?;
        let (events, receiver) = NetEvents::channel();
        let shared = Arc::new(Shared {
            local_addr,
            endpoint,
            answer: RwLock::new(answer),
            dial: RwLock::new(dial),
            expiry: Mutex::new(identity.expires()),
            is_refused_for_age: Default::default(),
            who: identity.who(),
            authority,
            connection_slots: Arc::new(Semaphore::new(limits.connections)),
            handshake_slots: Arc::new(Semaphore::new(limits.handshakes)),
            unasked: Unasked::default(),
            limits,
            refusals: Seldom::default(),
            peers: RwLock::default(),
            leaving: Mutex::default(),
            next_key: AtomicU64::new(1),
            totals: Mutex::default(),
            #[cfg(feature = "physics")]
            counting: Default::default(),
            events: Mutex::new(Some(events)),
        });
        runtime.spawn(accept(shared.clone()));
        if !renewed_by.is_empty() {
            runtime.spawn(renew_in_time(shared.clone(), identity, renewed_by));
        }
        Ok((Self { shared, runtime: Some(runtime), closing: Mutex::default() }, receiver))
    }

    /// Returns the address that this process listens on.
    pub fn local_addr(&self) -> SocketAddr {
        self.shared.local_addr
    }

    /// Returns the time until which the certificate proves the name in new links.
    pub fn expires(&self) -> SystemTime {
        *self.shared.expiry.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the name of this process.
    pub fn who(&self) -> PeerName {
        self.shared.who
    }

    /// Dials `addr`, where `expected` must prove itself. [`Connected`](super::NetEvent::Connected) or
    /// [`ConnectFailed`](super::NetEvent::ConnectFailed) follows.
    pub fn connect(&self, addr: SocketAddr, expected: PeerName) -> PeerKey {
        self.connect_to_one_of(&[addr], expected)
    }

    /// Dials a peer that is at one of these addresses, and takes the address that answers first.
    pub fn connect_to_one_of(&self, addrs: &[SocketAddr], expected: PeerName) -> PeerKey {
        let key = self.shared.new_key();
        if let Some(runtime) = &self.runtime {
            runtime.spawn(dial(self.shared.clone(), key, addrs.to_vec(), expected));
        }
        key
    }

    /// Sends a frame, reliably and after those sent before on the same lane.
    pub fn send(&self, peer: PeerKey, lane: Lane, frame: impl AsRef<[u8]>) -> Result<(), SendError> {
        let frame = frame.as_ref();
        let limit_bytes = self.shared.limits.frame_bytes_of(self.shared.who);
        if frame.len() > limit_bytes {
            return Err(SendError::FrameTooLong { bytes: frame.len(), limit_bytes });
        }
        self.shared.peer(peer).ok_or(SendError::NotConnected)?.send(lane, frame)
    }

    /// Sends a datagram of up to [`MAX_DATAGRAM_BYTES`](super::MAX_DATAGRAM_BYTES). It may be lost; on a
    /// congested link the oldest waiting datagrams are dropped.
    pub fn send_datagram(&self, peer: PeerKey, bytes: Vec<u8>) -> Result<(), SendError> {
        self.shared.peer(peer).ok_or(SendError::NotConnected)?.send_datagram(bytes)
    }

    /// Returns the bytes of datagrams that wait to be sent: more than a few mean a narrow link.
    pub fn datagrams_waiting(&self, peer: PeerKey) -> usize {
        self.shared.peer(peer).map_or(0, |peer| peer.datagrams_waiting())
    }

    /// Returns the bytes of frames that wait on the world's lanes.
    #[cfg(feature = "physics")]
    pub(crate) fn bytes_waiting(&self, peer: PeerKey) -> usize {
        self.shared.peer(peer).map_or(0, |peer| peer.bytes_waiting())
    }

    /// Returns a handle that sends datagrams from another thread, until this network is shut down.
    #[cfg(feature = "physics")]
    pub(crate) fn datagrams(&self) -> Datagrams {
        let runtime = self.runtime.as_ref().expect("it has not been shut down").handle().clone();
        Datagrams { shared: self.shared.clone(), runtime }
    }

    /// Bars a process that has joined: from now on it is let in with a new token only, and is told why. Its
    /// present link goes on.
    #[cfg(feature = "physics")]
    pub(crate) fn bar(&self, who: PeerName, reason: String) {
        if let Some(authority) = &self.shared.authority {
            authority.bar(who, reason);
        }
    }

    /// Closes a connection once what was sent has arrived, or [`Limits::linger`] has passed. `code` and
    /// `reason` reach the peer.
    pub fn close(&self, peer: PeerKey, code: CloseCode, reason: &str) {
        let peer = {
            let mut peers = self.shared.peers_mut();
            let closed = peers.remove(&peer);
            self.shared.leaving().extend(closed.clone().map(|closed| (peer, closed)));
            closed
        };
        if let (Some(runtime), Some(peer)) = (&self.runtime, peer) {
            let (shared, reason) = (self.shared.clone(), reason.to_owned());
            let task = runtime.spawn(async move { peer.close(code, &reason, &shared.limits).await });
            let mut closing = self.closing.lock().unwrap_or_else(PoisonError::into_inner);
            closing.retain(|task| !task.is_finished());
            closing.push(task);
        }
    }

    /// Returns the traffic over a living connection.
    pub fn stats(&self, peer: PeerKey) -> Option<PeerStats> {
        self.shared.peer(peer).map(|peer| peer.stats())
    }

    /// Returns the traffic over all connections.
    pub fn totals(&self) -> NetTotals {
        self.shared.sum(|_, _| ())
    }

    /// Returns the traffic over all connections, and over each. With more than [`FEW`] links it returns the
    /// last count, and has the network's thread count anew: the caller, which may have a tick to compute,
    /// does not wait for clients' links.
    #[cfg(feature = "physics")]
    pub(crate) fn counted(&self) -> Arc<Counted> {
        let count = |shared: &Shared| {
            let mut links = BTreeMap::new();
            let totals = shared.sum(|key, stats| _ = links.insert(key, stats));
            shared.counting.end(Counted { totals, links });
        };
        let is_few = self.shared.peers.read().unwrap_or_else(PoisonError::into_inner).len() <= FEW;
        match &self.runtime {
            Some(runtime) if !is_few => {
                if self.shared.counting.begin() {
                    let shared = self.shared.clone();
                    runtime.spawn(async move { count(&shared) });
                }
            }
            _ => count(&self.shared),
        }
        self.shared.counting.last()
    }

    /// Closes all connections as [`Net::close`] does, and ends the threads. Takes little more than
    /// [`Limits::linger`] at most.
    pub fn shutdown(mut self) {
        self.end();
    }

    fn end(&mut self) {
        let Some(runtime) = self.runtime.take() else { return };
        let shared = self.shared.clone();
        let begun = std::mem::take(&mut *self.closing.lock().unwrap_or_else(PoisonError::into_inner));
        let closing = runtime.spawn(async move {
            let peers = std::mem::take(&mut *shared.peers_mut());
            let mut closing = tokio::task::JoinSet::new();
            for peer in peers.into_values() {
                let shared = shared.clone();
                closing.spawn(async move { peer.close(CloseCode::DONE, "shut down", &shared.limits).await });
            }
            while closing.join_next().await.is_some() {}
            for task in begun {
                let _ = task.await;
            }
            shared.answer_joins().await;
            shared.endpoint.close(CloseCode::DONE.into(), b"shut down");
            let _ = tokio::time::timeout(shared.limits.linger, shared.endpoint.wait_idle()).await;
        });
        // Waits on a plain thread, since the caller may be inside another runtime.
        let waiting = std::thread::spawn(move || {
            let _ = runtime.block_on(closing);
            runtime.shutdown_timeout(Duration::from_millis(100));
        });
        let _ = waiting.join();
        self.shared.events.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    /// Returns how many connections QUIC remembers.
    #[cfg(test)]
    pub(crate) fn open_connections(&self) -> usize {
        self.shared.endpoint.open_connections()
    }

    /// Stops without closing connections, as a killed process does.
    #[cfg(test)]
    pub(crate) fn vanish(mut self) {
        let runtime = self.runtime.take().expect("it is running");
        runtime.shutdown_timeout(Duration::from_secs(5));
    }
}

impl Drop for Net {
    fn drop(&mut self) {
        self.end();
    }
}

/// Checks that this address can be listened on, before anything is made for a server.
#[cfg(feature = "physics")]
pub(crate) fn check_address(listen: SocketAddr) -> Result<(), NetError> {
    bind(listen).map(drop)
}

fn bind(listen: SocketAddr) -> Result<UdpSocket, NetError> {
    UdpSocket::bind(listen).map_err(|source| match source.kind() {
        io::ErrorKind::AddrInUse => NetError::PortTaken { addr: listen },
        _ => NetError::Bind { addr: listen, source },
    })
}
