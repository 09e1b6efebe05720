//! A process's place in the network: one UDP port, its connections, and the threads that serve them.

use std::collections::BTreeMap;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, mpsc};

use quinn::crypto::rustls::{QuicClientConfig, QuicServerConfig};
use quinn::{ClientConfig, Connection, Endpoint, EndpointConfig, Incoming, ServerConfig, TokioRuntime};
use tokio::runtime::Runtime;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::events::Delivery;
use super::join::{answer, explain};
use super::peer::{CODE_DONE, CODE_REFUSED, GreetError, Lanes, Peer, greet};
use super::verify::{answering, dialling, names_of_peer};
use super::{
    Authority, CloseCause, Identity, Lane, Limits, NetError, NetEvent, NetEvents, NetTotals, PeerKey,
    PeerName, PeerStats,
};

/// What a process needs to take part.
pub struct NetConfig {
    /// Where to listen; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Who we are.
    pub identity: Identity,
    /// The server's authority: with it, joins are answered.
    pub authority: Option<Arc<Authority>>,
    /// Time-outs and sizes.
    pub limits: Limits,
}

/// The network of one process. Its methods return at once and may be called from any thread; what happens comes back as
/// [`NetEvents`]. Dropping it shuts it down.
pub struct Net {
    shared: Arc<Shared>,
    /// `None` once it is shut down.
    runtime: Option<Runtime>,
}

/// Why something is not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// No such connection, or none any more.
    #[error("the peer is not connected; wait for its Connected event or dial it again")]
    NotConnected,
    /// The peer reads too slowly.
    #[error(
        "{waiting_bytes} bytes wait for a slow peer, the limit is {limit_bytes}; send less, later, or close it"
    )]
    Full {
        /// What waits.
        waiting_bytes: usize,
        /// What may wait.
        limit_bytes: usize,
    },
    /// The frame is longer than peers accept from our role.
    #[error("a frame of {bytes} bytes, peers accept {limit_bytes}; split it")]
    FrameTooLong {
        /// What it has.
        bytes: usize,
        /// What it may have.
        limit_bytes: usize,
    },
    /// The datagram does not fit into a packet.
    #[error("a datagram of {bytes} bytes, {max} fit into a packet; split it", max = super::MAX_DATAGRAM_BYTES)]
    DatagramTooLong {
        /// What it has.
        bytes: usize,
    },
}

impl Net {
    /// Listens, and on a server begins to answer joins.
    pub fn start(config: NetConfig) -> Result<(Self, NetEvents), NetError> {
        let NetConfig { listen, identity, authority, limits } = config;
        if let Some(authority) = &authority {
            authority.open_ledger()?;
        }
        let answer = server_config(&identity, authority.is_some(), &limits)?;
        let dial = client_config(&identity, &limits)?;
        let socket = UdpSocket::bind(listen).map_err(|source| match source.kind() {
            io::ErrorKind::AddrInUse => NetError::PortTaken { addr: listen },
            _ => NetError::Bind { addr: listen, source },
        })?;
        // One thread: a message then passes through QUIC without changing threads, which halves its delay (measured).
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .max_blocking_threads(4)
            .thread_name("dcd-net")
            .enable_all()
            .build()
            .map_err(NetError::Threads)?;
        let endpoint = {
            let _context = runtime.enter();
            Endpoint::new(EndpointConfig::default(), Some(answer), socket, Arc::new(TokioRuntime))
                .map_err(|source| NetError::Bind { addr: listen, source })?
        };
        let local_addr = endpoint.local_addr().map_err(|source| NetError::Bind { addr: listen, source })?;
        let (events, receiver) = NetEvents::channel();
        let shared = Arc::new(Shared {
            local_addr,
            endpoint,
            dial,
            who: identity.who(),
            authority,
            connection_slots: Arc::new(Semaphore::new(limits.connections)),
            handshake_slots: Arc::new(Semaphore::new(limits.handshakes)),
            limits,
            peers: RwLock::default(),
            next_key: AtomicU64::new(1),
            totals: Mutex::default(),
            events: Mutex::new(Some(events)),
        });
        runtime.spawn(accept(shared.clone()));
        Ok((Self { shared, runtime: Some(runtime) }, receiver))
    }

    /// Where we listen.
    pub fn local_addr(&self) -> SocketAddr {
        self.shared.local_addr
    }

    /// Who we are.
    pub fn who(&self) -> PeerName {
        self.shared.who
    }

    /// Dials `addr`, where `expected` must prove itself. [`NetEvent::Connected`] or [`NetEvent::ConnectFailed`] tells.
    pub fn connect(&self, addr: SocketAddr, expected: PeerName) -> PeerKey {
        let key = self.shared.new_key();
        if let Some(runtime) = &self.runtime {
            runtime.spawn(dial(self.shared.clone(), key, addr, expected));
        }
        key
    }

    /// Sends a frame, reliably and after those sent on the same lane before.
    pub fn send(&self, peer: PeerKey, lane: Lane, frame: impl AsRef<[u8]>) -> Result<(), SendError> {
        let frame = frame.as_ref();
        let limit_bytes = self.shared.limits.frame_bytes_of(self.shared.who);
        if frame.len() > limit_bytes {
            return Err(SendError::FrameTooLong { bytes: frame.len(), limit_bytes });
        }
        self.shared.peer(peer).ok_or(SendError::NotConnected)?.send(lane, frame)
    }

    /// Sends a datagram of up to [`MAX_DATAGRAM_BYTES`](super::MAX_DATAGRAM_BYTES). It may be lost; on a congested link
    /// the oldest that wait are dropped.
    pub fn send_datagram(&self, peer: PeerKey, bytes: Vec<u8>) -> Result<(), SendError> {
        self.shared.peer(peer).ok_or(SendError::NotConnected)?.send_datagram(bytes)
    }

    /// Closes a connection after what was sent has arrived or [`Limits::linger`] has passed. `reason` reaches the peer.
    pub fn close(&self, peer: PeerKey, reason: &str) {
        let peer = self.shared.peers_mut().remove(&peer);
        if let (Some(runtime), Some(peer)) = (&self.runtime, peer) {
            let (shared, reason) = (self.shared.clone(), reason.to_owned());
            runtime.spawn(async move { peer.close(&reason, &shared.limits).await });
        }
    }

    /// What has passed over a living connection.
    pub fn stats(&self, peer: PeerKey) -> Option<PeerStats> {
        self.shared.peer(peer).map(|peer| peer.stats())
    }

    /// What has passed over all.
    pub fn totals(&self) -> NetTotals {
        let peers = self.shared.peers.read().unwrap_or_else(PoisonError::into_inner);
        let mut totals = *self.shared.totals();
        totals.peers = peers.len() as u64;
        for peer in peers.values() {
            totals.traffic.add(&peer.stats());
        }
        totals
    }

    /// Closes all connections as [`Net::close`] does and ends the threads. Takes little more than [`Limits::linger`] at most.
    pub fn shutdown(mut self) {
        self.end();
    }

    fn end(&mut self) {
        let Some(runtime) = self.runtime.take() else { return };
        let shared = self.shared.clone();
        let closing = runtime.spawn(async move {
            let peers = std::mem::take(&mut *shared.peers_mut());
            let mut closing = tokio::task::JoinSet::new();
            for peer in peers.into_values() {
                let shared = shared.clone();
                closing.spawn(async move { peer.close("shut down", &shared.limits).await });
            }
            while closing.join_next().await.is_some() {}
            shared.endpoint.close(CODE_DONE, b"shut down");
            let _ = tokio::time::timeout(shared.limits.linger, shared.endpoint.wait_idle()).await;
        });
        // Waiting from a plain thread, which a caller inside another runtime need not be.
        let waiting = std::thread::spawn(move || {
            let _ = runtime.block_on(closing);
            runtime.shutdown_timeout(std::time::Duration::from_millis(100));
        });
        let _ = waiting.join();
        self.shared.events.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    /// Goes without a word, as a killed process does.
    #[cfg(test)]
    pub(super) fn vanish(mut self) {
        let runtime = self.runtime.take().expect("it is running");
        runtime.shutdown_timeout(std::time::Duration::from_secs(5));
    }
}

impl Drop for Net {
    fn drop(&mut self) {
        self.end();
    }
}

/// What callers and tasks share.
struct Shared {
    local_addr: SocketAddr,
    endpoint: Endpoint,
    dial: ClientConfig,
    who: PeerName,
    authority: Option<Arc<Authority>>,
    limits: Limits,
    /// Taken by each proven peer that dialled us, until its `Closed` event is read.
    connection_slots: Arc<Semaphore>,
    /// Taken by each handshake or join under way.
    handshake_slots: Arc<Semaphore>,
    peers: RwLock<BTreeMap<PeerKey, Arc<Peer>>>,
    next_key: AtomicU64,
    totals: Mutex<NetTotals>,
    /// `None` once it is shut down, so that readers of events see the end.
    events: Mutex<Option<mpsc::Sender<Delivery>>>,
}

impl Shared {
    fn new_key(&self) -> PeerKey {
        PeerKey(self.next_key.fetch_add(1, Ordering::Relaxed))
    }

    fn peer(&self, key: PeerKey) -> Option<Arc<Peer>> {
        self.peers.read().unwrap_or_else(PoisonError::into_inner).get(&key).cloned()
    }

    fn peers_mut(&self) -> std::sync::RwLockWriteGuard<'_, BTreeMap<PeerKey, Arc<Peer>>> {
        self.peers.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn totals(&self) -> MutexGuard<'_, NetTotals> {
        self.totals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn events(&self) -> Option<mpsc::Sender<Delivery>> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Takes calls, as many at a time as there is room for.
async fn accept(shared: Arc<Shared>) {
    while let Some(incoming) = shared.endpoint.accept().await {
        let under_way = shared.limits.handshakes - shared.handshake_slots.available_permits();
        if under_way >= shared.limits.handshakes_before_retry && incoming.may_retry() {
            // The address is forged or the caller calls again; either way we keep nothing of it.
            let _ = incoming.retry();
            continue;
        }
        match shared.handshake_slots.clone().try_acquire_owned() {
            Ok(slot) => {
                tokio::spawn(receive(shared.clone(), incoming, slot));
            }
            Err(_) => {
                shared.totals().handshakes_refused += 1;
                incoming.ignore();
            }
        }
    }
}

/// Serves one caller: a proven peer for as long as it stays, an anonymous one for one join.
async fn receive(shared: Arc<Shared>, incoming: Incoming, handshake: OwnedSemaphorePermit) {
    let timeout = shared.limits.handshake_timeout;
    let addr = incoming.remote_address();
    let connected = tokio::time::timeout(timeout, async { incoming.accept()?.await }).await;
    let connection = match connected {
        Ok(Ok(connection)) => connection,
        Ok(Err(error)) => {
            tracing::debug!(%addr, "handshake failed: {error}");
            shared.totals().handshakes_refused += 1;
            return;
        }
        Err(_) => {
            shared.totals().handshakes_refused += 1;
            return;
        }
    };
    let Some(who) = names_of_peer(connection.peer_identity()) else {
        let let_in = match shared.authority.clone() {
            Some(authority) => answer(&connection, authority, &shared.limits).await,
            None => false,
        };
        let mut totals = shared.totals();
        if let_in {
            totals.joins_granted += 1
        } else {
            totals.joins_refused += 1
        }
        return;
    };
    let Ok(slot) = shared.connection_slots.clone().try_acquire_owned() else {
        shared.totals().handshakes_refused += 1;
        connection.close(CODE_REFUSED, b"there is no room for more peers; try again later");
        return;
    };
    match tokio::time::timeout(timeout, greet(&connection)).await {
        Ok(Ok(lanes)) => {
            drop(handshake);
            carry(&shared, shared.new_key(), who, connection, lanes, Some(slot)).await;
        }
        Ok(Err(_)) | Err(_) => {
            tracing::debug!(%addr, %who, "no greeting");
            shared.totals().handshakes_refused += 1;
            connection.close(CODE_REFUSED, b"no greeting in time");
        }
    }
}

async fn dial(shared: Arc<Shared>, key: PeerKey, addr: SocketAddr, expected: PeerName) {
    let timeout = shared.limits.handshake_timeout;
    let greeted = tokio::time::timeout(timeout, call(&shared, addr, expected)).await;
    match greeted.unwrap_or(Err(NetError::Unreachable { addr, waited: timeout })) {
        Ok((who, connection, lanes)) => carry(&shared, key, who, connection, lanes, None).await,
        Err(error) => {
            if let Some(events) = shared.events() {
                let _ = events
                    .send(Delivery { event: NetEvent::ConnectFailed { peer: key, error }, share: None });
            }
        }
    }
}

async fn call(
    shared: &Shared,
    addr: SocketAddr,
    expected: PeerName,
) -> Result<(PeerName, Connection, Lanes), NetError> {
    let failed = |error| explain(addr, expected, shared.limits.idle_timeout, error);
    let name = &expected.dns_names()[0];
    let connection = shared
        .endpoint
        .connect_with(shared.dial.clone(), addr, name)
        .map_err(|error| NetError::Broken { addr, detail: error.to_string() })?
        .await
        .map_err(failed)?;
    let who = names_of_peer(connection.peer_identity()).filter(|who| who.answers_to(expected));
    let Some(who) = who else {
        connection.close(CODE_REFUSED, b"your certificate has another name");
        return Err(NetError::WrongPeer { addr, expected, detail: "its names are others".to_owned() });
    };
    match greet(&connection).await {
        Ok(lanes) => Ok((who, connection, lanes)),
        Err(GreetError::Lost(error)) => Err(failed(error)),
        Err(GreetError::Refused(reason)) => Err(NetError::Refused { addr, reason }),
    }
}

/// A connection's life between its `Connected` and its `Closed`.
async fn carry(
    shared: &Arc<Shared>,
    key: PeerKey,
    who: PeerName,
    connection: Connection,
    lanes: Lanes,
    slot: Option<OwnedSemaphorePermit>,
) {
    let Some(events) = shared.events() else { return };
    let addr = connection.remote_address();
    let (peer, receivers) = Peer::new(key, who, connection, lanes, &shared.limits);
    shared.peers_mut().insert(key, peer.clone());
    let _ = events.send(Delivery { event: NetEvent::Connected { peer: key, who, addr }, share: None });
    let (cause, reason) = peer.run(receivers, &events).await;
    shared.peers_mut().remove(&key);
    let mut totals = shared.totals();
    let last = PeerStats { bytes_waiting: 0, rtt: Default::default(), ..peer.stats() };
    totals.traffic.add(&last);
    totals.violations += u64::from(cause == CloseCause::Violation);
    drop(totals);
    let _ = events.send(Delivery { event: NetEvent::Closed { peer: key, who, cause, reason }, share: slot });
}

fn server_config(
    identity: &Identity,
    anonymous_may_join: bool,
    limits: &Limits,
) -> Result<ServerConfig, NetError> {
    let crypto = QuicServerConfig::try_from(answering(identity, anonymous_may_join)?)
        .map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = ServerConfig::with_crypto(Arc::new(crypto));
    // What comes before a handshake is accepted waits in memory: few packets of few callers.
    config.max_incoming(256).incoming_buffer_size(16 << 10).incoming_buffer_size_total(4 << 20);
    // One stream for a join; it is refused where none are answered.
    config.transport_config(limits.transport(u8::from(anonymous_may_join)));
    Ok(config)
}

fn client_config(identity: &Identity, limits: &Limits) -> Result<ClientConfig, NetError> {
    let crypto =
        QuicClientConfig::try_from(dialling(identity)?).map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = ClientConfig::new(Arc::new(crypto));
    config.transport_config(limits.transport(0));
    Ok(config)
}
