//! Accepts and dials connections, and serves each from the first packet until it ends.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockWriteGuard};
use std::time::{Instant, SystemTime};

use quinn::{ClientConfig, Connection, ConnectionError, Endpoint, Incoming, ServerConfig};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::events::{EventSender, HeldEvent};
use super::first::{AGAIN, first_of};
use super::join::{answer, explain, finds_us_expired, is_expired};
use super::peer::{GreetError, Lanes, Peer, greet};
use super::seldom::Seldom;
use super::source::{Calls, Part};
#[cfg(feature = "physics")]
use super::stats::Counting;
use super::unasked::Unasked;
use super::verify::names_of_peer;
use super::{
    Authority, CloseCause, CloseCode, Limits, NetError, NetEvent, NetTotals, PeerKey, PeerName, PeerStats,
};

/// The state that callers and tasks share.
pub(super) struct Shared {
    pub(super) local_addr: SocketAddr,
    pub(super) endpoint: Endpoint,
    /// The settings for links that others dial. They change with the certificate, as those of the endpoint
    /// do.
    pub(super) answer: RwLock<ServerConfig>,
    /// The settings for links that this process dials. They change when the certificate is renewed.
    pub(super) dial: RwLock<ClientConfig>,
    /// The time until which the certificate proves the name.
    pub(super) expiry: Mutex<SystemTime>,
    /// Says whether a peer that we dialled has found our certificate expired since it was renewed.
    pub(super) is_refused_for_age: AtomicBool,
    pub(super) who: PeerName,
    pub(super) authority: Option<Arc<Authority>>,
    pub(super) limits: Limits,
    /// Limits the log lines about refused joins.
    pub(super) refusals: Seldom,
    /// Permits. Each proven peer that dialled us has one until its `Closed` event is read.
    pub(super) connection_slots: Arc<Semaphore>,
    /// Permits. Each handshake or join under way has one.
    pub(super) handshake_slots: Arc<Semaphore>,
    /// The handshakes and joins that may give way to others.
    pub(super) unasked: Unasked,
    pub(super) peers: RwLock<BTreeMap<PeerKey, Arc<Peer>>>,
    /// Peers that we have closed, until their connections are over: their traffic still counts. Locked after
    /// `peers`, before `totals`.
    pub(super) leaving: Mutex<BTreeMap<PeerKey, Arc<Peer>>>,
    pub(super) next_key: AtomicU64,
    pub(super) totals: Mutex<NetTotals>,
    #[cfg(feature = "physics")]
    pub(super) counting: Counting,
    /// `None` once the network is shut down, so that readers of events see the end.
    pub(super) events: Mutex<Option<EventSender>>,
}

impl Shared {
    pub(super) fn new_key(&self) -> PeerKey {
        PeerKey(self.next_key.fetch_add(1, Ordering::Relaxed))
    }

    pub(super) fn set_dial(&self, config: ClientConfig) {
        *self.dial.write().unwrap_or_else(PoisonError::into_inner) = config;
    }

    pub(super) fn set_answer(&self, config: ServerConfig) {
        self.endpoint.set_server_config(Some(config.clone()));
        *self.answer.write().unwrap_or_else(PoisonError::into_inner) = config;
    }

    /// Returns the settings for a caller's link. They hold the caller's part until QUIC has forgotten the
    /// link.
    fn answer_to(&self, part: Arc<Part>, in_haste: bool) -> Arc<ServerConfig> {
        let mut config = self.answer.read().unwrap_or_else(PoisonError::into_inner).clone();
        config.transport_config(self.limits.answering_caller(
            u8::from(self.authority.is_some()),
            in_haste,
            part,
        ));
        Arc::new(config)
    }

    pub(super) fn set_expiry(&self, expiry: SystemTime) {
        *self.expiry.lock().unwrap_or_else(PoisonError::into_inner) = expiry;
    }

    pub(super) fn peer(&self, key: PeerKey) -> Option<Arc<Peer>> {
        self.peers.read().unwrap_or_else(PoisonError::into_inner).get(&key).cloned()
    }

    pub(super) fn peers_mut(&self) -> RwLockWriteGuard<'_, BTreeMap<PeerKey, Arc<Peer>>> {
        self.peers.write().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn leaving(&self) -> MutexGuard<'_, BTreeMap<PeerKey, Arc<Peer>>> {
        self.leaving.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the traffic over all connections, and calls `look` with the traffic over each living one.
    pub(super) fn sum(&self, mut look: impl FnMut(PeerKey, PeerStats)) -> NetTotals {
        let peers = self.peers.read().unwrap_or_else(PoisonError::into_inner);
        let leaving = self.leaving();
        let mut totals = *self.totals();
        totals.peers = peers.len() as u64;
        for (&key, peer) in &*peers {
            let stats = peer.stats();
            totals.traffic.add(&stats);
            look(key, stats);
        }
        leaving.values().for_each(|peer| totals.traffic.add(&peer.stats()));
        totals
    }

    pub(super) fn totals(&self) -> MutexGuard<'_, NetTotals> {
        self.totals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn events(&self) -> Option<EventSender> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Accepts incoming connections, as many at a time as there is room for.
pub(super) async fn accept(shared: Arc<Shared>) {
    let mut calls = Calls::new(shared.limits.handshakes, shared.limits.closing);
    while let Some(incoming) = shared.endpoint.accept().await {
        let under_way = shared.limits.handshakes - shared.handshake_slots.available_permits();
        if under_way >= shared.limits.handshakes_before_retry && incoming.may_retry() {
            // The address is forged, or the peer dials again. Either way we keep no state of it.
            let _ = incoming.retry();
            continue;
        }
        let call = (incoming.remote_address(), incoming.orig_dst_cid());
        let slot = shared.handshake_slots.clone().try_acquire_owned().ok();
        let may_begin = slot.is_some() || shared.unasked.count() > 0;
        let Some(part) = calls.take(Instant::now(), call, shared.strangers(), may_begin) else {
            shared.totals().handshakes_refused += 1;
            incoming.ignore();
            continue;
        };
        match slot {
            Some(slot) => {
                tokio::spawn(receive(shared.clone(), incoming, part, slot));
            }
            None => {
                shared.unasked.give_way();
                tokio::spawn(receive_when_free(shared.clone(), incoming, part));
            }
        }
    }
}

impl Shared {
    /// Returns the number of connections that are not those of peers: of processes that join or call, or that
    /// did a moment ago.
    fn strangers(&self) -> usize {
        let peers = self.peers.read().unwrap_or_else(PoisonError::into_inner).len() + self.leaving().len();
        self.endpoint.open_connections().saturating_sub(peers)
    }

    /// Waits, at most [`Limits::linger`], until all that have asked to join have their answers, since their
    /// tokens are used up. Nobody is let in from then on.
    pub(super) async fn answer_joins(&self) {
        let asked = self.limits.handshakes.saturating_sub(self.unasked.count());
        let answered = self.handshake_slots.acquire_many(asked as u32);
        if let Ok(Ok(slots)) = tokio::time::timeout(self.limits.linger, answered).await {
            slots.forget();
        }
    }
}

/// Serves one incoming connection once another has given way and freed its slot.
async fn receive_when_free(shared: Arc<Shared>, incoming: Incoming, part: Arc<Part>) {
    if let Ok(slot) = shared.handshake_slots.clone().acquire_owned().await {
        receive(shared, incoming, part, slot).await;
    }
}

/// Completes a handshake.
async fn connect(
    shared: &Shared,
    incoming: Incoming,
    part: Arc<Part>,
) -> Result<Connection, ConnectionError> {
    // A caller had to prove its address only because many call.
    let in_haste = !incoming.may_retry();
    incoming.accept_with(shared.answer_to(part, in_haste))?.await
}

/// Serves one incoming connection: that of a proven peer for as long as it stays, an anonymous one for one
/// join.
async fn receive(shared: Arc<Shared>, incoming: Incoming, part: Arc<Part>, handshake: OwnedSemaphorePermit) {
    let timeout = shared.limits.handshake_timeout;
    let addr = incoming.remote_address();
    let place = shared.unasked.enter_begun(addr);
    let connected = tokio::select! {
        connected = tokio::time::timeout(timeout, connect(&shared, incoming, part.clone())) => connected.ok(),
        () = place.gives_way() => None,
    };
    // The handshake may have been told to give way just as it finished.
    let is_given_up = place.is_given_up();
    drop(place);
    let connection = match connected.filter(|_| !is_given_up) {
        Some(Ok(connection)) => connection,
        Some(Err(error)) => {
            tracing::debug!(%addr, "handshake failed: {error}");
            if is_expired(&error)
                && let Some(left_out) = shared.refusals.tell(Instant::now())
            {
                tracing::warn!(
                    %addr, left_out,
                    "refuses a peer whose certificate has expired by this machine's clock; it gets a new one where it asks \
                     for one; if this comes again, see that the clocks of both machines agree (NTP)"
                );
            }
            shared.totals().handshakes_refused += 1;
            return;
        }
        None => {
            shared.totals().handshakes_refused += 1;
            return;
        }
    };
    let Some(who) = names_of_peer(connection.peer_identity()) else {
        let count = |let_in| {
            let mut totals = shared.totals();
            if let_in { totals.joins_granted += 1 } else { totals.joins_refused += 1 }
        };
        match shared.authority.clone() {
            Some(authority) => {
                let Shared { limits, refusals, unasked, .. } = &*shared;
                answer(&connection, authority, limits, refusals, unasked, count).await;
            }
            None => count(false),
        }
        return;
    };
    if let Some(reason) = shared.authority.as_ref().and_then(|authority| authority.barred_for(who)) {
        shared.totals().handshakes_refused += 1;
        connection.close(CloseCode::SENT_AWAY.into(), reason.as_bytes());
        return;
    }
    let Ok(slot) = shared.connection_slots.clone().try_acquire_owned() else {
        shared.totals().handshakes_refused += 1;
        connection.close(CloseCode::REFUSED.into(), b"there is no room for more peers; try again later");
        return;
    };
    let place = shared.unasked.enter_proven(who, &connection);
    let greeted = tokio::time::timeout(timeout, greet(&connection)).await;
    drop(place);
    match greeted {
        Ok(Ok(lanes)) => {
            drop(handshake);
            part.give_back();
            carry(&shared, shared.new_key(), who, connection, lanes, Some(slot)).await;
        }
        Ok(Err(_)) | Err(_) => {
            tracing::debug!(%addr, %who, "no greeting");
            shared.totals().handshakes_refused += 1;
            connection.close(CloseCode::REFUSED.into(), b"no greeting in time");
        }
    }
}

/// Dials a peer that is at one of these addresses, and carries the connection.
pub(super) async fn dial(shared: Arc<Shared>, key: PeerKey, addrs: Vec<SocketAddr>, expected: PeerName) {
    let timeout = shared.limits.handshake_timeout;
    let trial = |addr| {
        let shared = shared.clone();
        async move { reach(&shared, addr, expected).await }
    };
    let until = Instant::now() + timeout;
    let answered = loop {
        let left = until.saturating_duration_since(Instant::now());
        let answered = match first_of(&addrs, left, trial).await {
            // Only one connection is greeted: a peer that is greeted twice keeps the newer one and ends the
            // other.
            Ok((addr, who, connection)) => {
                let greeted = tokio::time::timeout(timeout, greet_at(&shared, addr, expected, &connection));
                let late = || Err(NetError::Unreachable { addr, waited: timeout });
                greeted.await.unwrap_or_else(|_| late()).map(|lanes| (who, connection, lanes))
            }
            Err(error) => break Err(error),
        };
        match answered {
            // The server was about to stop, and another one takes over.
            Err(_) if addrs.len() > 1 && Instant::now() + AGAIN < until => tokio::time::sleep(AGAIN).await,
            answered => break answered,
        }
    };
    match answered {
        Ok((who, connection, lanes)) => carry(&shared, key, who, connection, lanes, None).await,
        Err(error) => {
            if let Some(events) = shared.events() {
                let _ = events
                    .send(HeldEvent { event: NetEvent::ConnectFailed { peer: key, error }, share: None });
            }
        }
    }
}

/// Connects to the peer that is at an address.
async fn reach(
    shared: &Shared,
    addr: SocketAddr,
    expected: PeerName,
) -> Result<(SocketAddr, PeerName, Connection), NetError> {
    let name = &expected.dns_names()[0];
    let config = shared.dial.read().unwrap_or_else(PoisonError::into_inner).clone();
    let connection = shared
        .endpoint
        .connect_with(config, addr, name)
        .map_err(|error| NetError::Broken { addr, detail: error.to_string() })?
        .await
        .map_err(|error| failed(shared, addr, expected, error))?;
    let who = names_of_peer(connection.peer_identity()).filter(|who| who.answers_to(expected));
    let Some(who) = who else {
        connection.close(CloseCode::REFUSED.into(), b"your certificate has another name");
        return Err(NetError::WrongPeer { addr, expected, detail: "its names are others".to_owned() });
    };
    Ok((addr, who, connection))
}

/// Returns the error for a connection that was dialled and that failed. A certificate that the peer finds
/// expired is renewed.
fn failed(shared: &Shared, addr: SocketAddr, expected: PeerName, error: ConnectionError) -> NetError {
    if finds_us_expired(&error) {
        shared.is_refused_for_age.store(true, Ordering::Relaxed);
    }
    explain(addr, expected, shared.limits.idle_timeout_of(shared.who), error)
}

/// Opens the lanes of a connection to the peer at an address. From then on the connection counts.
async fn greet_at(
    shared: &Shared,
    addr: SocketAddr,
    expected: PeerName,
    connection: &Connection,
) -> Result<Lanes, NetError> {
    match greet(connection).await {
        Ok(lanes) => Ok(lanes),
        Err(GreetError::Lost(error)) => Err(failed(shared, addr, expected, error)),
        Err(GreetError::Refused(reason)) => Err(NetError::Refused { addr, code: CloseCode::REFUSED, reason }),
    }
}

/// Carries a connection from its `Connected` event to its `Closed` event.
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
    let _ = events.send(HeldEvent { event: NetEvent::Connected { peer: key, who, addr }, share: None });
    let (cause, reason) = peer.run(receivers, &events).await;
    // All three are locked at once, so that no sum misses the connection or counts it twice.
    let (mut peers, mut leaving, mut totals) = (shared.peers_mut(), shared.leaving(), shared.totals());
    peers.remove(&key);
    leaving.remove(&key);
    let last = PeerStats { bytes_waiting: 0, rtt: Default::default(), ..peer.stats() };
    totals.traffic.add(&last);
    totals.violations += u64::from(cause == CloseCause::Violation);
    drop((totals, leaving, peers));
    let _ = events.send(HeldEvent { event: NetEvent::Closed { peer: key, who, cause, reason }, share: slot });
}
