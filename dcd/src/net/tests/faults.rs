//! Tests peers that break rules, are slow, or vanish.

use std::time::Instant;

use super::*;
use crate::net::join::{JoinRequest, anonymous};
use crate::net::key::Key;
use crate::net::quic_config;
use crate::net::source::Calls;
use crate::space::{ClientId, NodeId};

#[test]
fn a_killed_peer_is_reported_within_the_idle_time_out() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    node.connect_to(&server.process);
    let start = Instant::now();
    node.net.vanish();
    assert_eq!(server.process.closed().0, CloseCause::TimedOut);
    let waited = start.elapsed();
    assert!(waited < Duration::from_secs(3), "{waited:?}");
}

/// Returns limits with times that are short for tests.
fn impatient() -> Limits {
    Limits {
        idle_timeout: Duration::from_millis(400),
        keep_alive: Duration::from_millis(50),
        client_idle_timeout: Duration::from_millis(600),
        client_keep_alive: Duration::from_millis(100),
        ..Limits::default()
    }
}

#[test]
fn a_silent_peer_that_lives_is_kept() {
    let (idle, alive) = (Duration::from_secs(2), Duration::from_millis(200));
    // Ten times the keep-alive: on a busy machine some keep-alives may be late.
    let limits = Limits {
        idle_timeout: idle,
        keep_alive: alive,
        client_idle_timeout: idle,
        client_keep_alive: alive,
        ..Limits::default()
    };
    let server = Server::with_limits(limits.clone());
    for role in [JoinRole::Node, JoinRole::Client] {
        let peer = Process::start(server.join(role), None, limits.clone());
        let (here, _) = peer.connect_to(&server.process);
        assert!(peer.events.recv_timeout(2 * idle).is_err(), "nothing happens for long");
        peer.net.send(here, Lane::Client, b"still here").unwrap();
        assert_eq!(server.process.frame().1, b"still here");
        peer.net.shutdown();
        server.process.closed();
    }
}

#[test]
fn whoever_dials_says_how_long_silence_may_last_and_who_answers_has_the_last_word() {
    let patient = Limits { client_idle_timeout: HOUR, client_keep_alive: HOUR, ..Limits::default() };
    let server = Server::with_limits(Limits { client_idle_timeout: Duration::from_secs(2), ..impatient() });
    for (theirs, range_ms) in [(impatient(), 400..2_000), (patient, 1_500..10_000)] {
        let client = Process::start(server.join(JoinRole::Client), None, theirs);
        client.connect_to(&server.process);
        let start = Instant::now();
        client.net.vanish();
        assert_eq!(server.process.closed().0, CloseCause::TimedOut);
        let waited_ms = start.elapsed().as_millis();
        assert!(range_ms.contains(&waited_ms), "{waited_ms} ms, expected {range_ms:?}");
    }
}

#[test]
fn a_client_hears_that_its_server_is_gone_though_only_the_client_breaks_the_silence() {
    let server = Server::start();
    let client = Process::start(server.join(JoinRole::Client), None, impatient());
    client.connect_to(&server.process);
    let Server { process, .. } = server;
    process.net.vanish();
    assert_eq!(client.closed().0, CloseCause::TimedOut);
}

#[test]
fn a_server_that_is_started_again_ends_the_links_of_its_predecessor_at_once() {
    let server = Server::start();
    let listen = server.addr();
    // Clients and nodes that would never notice the end by themselves.
    let patient = Limits { idle_timeout: HOUR, client_idle_timeout: HOUR, ..Limits::default() };
    let client = Process::start(server.join(JoinRole::Client), None, patient.clone());
    let node = Process::start(server.join(JoinRole::Node), None, patient);
    let (here, _) = client.connect_to(&server.process);
    node.connect_to(&server.process);
    let Server { process, authority, folder } = server;
    process.net.vanish();
    drop((process.events, authority));
    let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
    let (identity, limits) = (authority.server_identity().unwrap(), Limits::default());
    let config = NetConfig { listen, identity, authority: Some(authority), renewed_by: Vec::new(), limits };
    let (_net, _events) = Net::start(config).unwrap();
    assert_eq!(node.closed().0, CloseCause::Forgotten, "by its keep-alives");
    // An error means that the client's keep-alives were first.
    let _ = client.net.send(here, Lane::Client, b"are you there?");
    assert_eq!(client.closed().0, CloseCause::Forgotten, "by what it sends");
}

#[test]
fn a_frame_longer_than_the_role_may_send_closes_the_connection() {
    let server = Server::start();
    let generous = Limits { client_frame_bytes: 1 << 20, ..Limits::default() };
    let client = Process::start(server.join(JoinRole::Client), None, generous);
    let (here, _) = client.connect_to(&server.process);
    client.net.send(here, Lane::Client, vec![0; 64 << 10]).unwrap();
    assert_eq!(server.process.frame().1.len(), 64 << 10);
    client.net.send(here, Lane::Client, vec![0; (64 << 10) + 1]).unwrap();
    let (cause, reason) = server.process.closed();
    assert_eq!(cause, CloseCause::Violation);
    assert!(reason.contains("a frame of 65537 bytes on the client lane"), "{reason}");
    let (cause, told) = client.closed();
    assert_eq!((cause, told), (CloseCause::ByPeer(CloseCode::VIOLATION), reason));
    assert_eq!(server.process.net.totals().violations, 1);
}

#[test]
fn an_anonymous_peer_that_does_not_join_is_closed() {
    // It must be closed for what it sends, not for taking its time.
    let server = Server::with_limits(Limits { handshake_timeout: HOUR, ..Limits::default() });
    let fingerprint = server.token(JoinRole::Node).fingerprint;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    for attempt in 0..2 {
        let closed = runtime.block_on(async {
            let (_endpoint, connecting) = anonymous(server.addr(), fingerprint, PATIENCE).unwrap();
            let connection = connecting.await.unwrap();
            if attempt == 0 {
                let mut stream = connection.open_uni().await.unwrap();
                stream.write_all(b"let me in").await.unwrap();
                tokio::time::timeout(PATIENCE, connection.closed()).await.unwrap()
            } else {
                connection.send_datagram(b"let me in".to_vec().into()).unwrap();
                tokio::time::timeout(PATIENCE, connection.closed()).await.unwrap()
            }
        });
        assert!(closed.to_string().contains("may only ask to join"), "{closed}");
    }
    assert_eq!(server.process.net.totals().joins_refused, 2);
    assert!(server.process.events.try_recv().is_err(), "the role's loop hears nothing of it");
}

#[test]
fn peers_of_another_version_are_told_both() {
    let server = Server::start();
    let identity = server.join(JoinRole::Node);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let versions = format!("version {PROTOCOL_VERSION}, the other 77");
    for (greeting, reason) in [([0, 77, 0, 0, 0], versions.as_str()), ([9, 1, 0, 0, 0], "greeting")] {
        let closed = runtime.block_on(async {
            let endpoint = quinn::Endpoint::client(anywhere()).unwrap();
            let crypto = crate::net::verify::dialling(&identity).unwrap();
            let crypto = quinn::crypto::rustls::QuicClientConfig::try_from(crypto).unwrap();
            let config = quinn::ClientConfig::new(Arc::new(crypto));
            let connection =
                endpoint.connect_with(config, server.addr(), "server.dcd").unwrap().await.unwrap();
            let mut stream = connection.open_uni().await.unwrap();
            stream.write_all(&greeting).await.unwrap();
            tokio::time::timeout(PATIENCE, connection.closed()).await.unwrap()
        });
        assert!(closed.to_string().contains(reason), "{closed}");
    }
    assert!(server.process.events.try_recv().is_err(), "the role's loop hears nothing of it");
}

#[test]
fn under_load_callers_prove_their_address_first_and_get_in_all_the_same() {
    let server = Server::with_limits(Limits { handshakes_before_retry: 0, ..Limits::default() });
    let node = server.process(JoinRole::Node);
    node.connect_to(&server.process);
}

/// Sends a request and reads no byte of the answer.
async fn deaf(server: &Server, request: &[u8]) -> (quinn::Endpoint, quinn::Connection, quinn::RecvStream) {
    let crypto = crate::net::verify::joining(server.token(JoinRole::Node).fingerprint).unwrap();
    let crypto = quinn::crypto::rustls::QuicClientConfig::try_from(crypto).unwrap();
    let mut config = quinn::ClientConfig::new(Arc::new(crypto));
    let mut transport = quinn::TransportConfig::default();
    transport.stream_receive_window(0_u32.into());
    // Keeps the connection alive, however slow the machine is.
    transport.keep_alive_interval(Some(Duration::from_millis(50)));
    transport.max_idle_timeout(Some(quinn::VarInt::from_u32(60_000).into()));
    config.transport_config(Arc::new(transport));
    let local = std::net::SocketAddr::from((std::net::Ipv4Addr::LOCALHOST, 0));
    let endpoint = quinn::Endpoint::client(local).unwrap();
    let name = &PeerName::Server.dns_names()[0];
    let connection = endpoint.connect_with(config, server.addr(), name).unwrap().await.unwrap();
    let (mut send, receive) = connection.open_bi().await.unwrap();
    send.write_all(request).await.unwrap();
    send.finish().unwrap();
    (endpoint, connection, receive)
}

fn of_one_thread() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap()
}

#[test]
fn handshakes_beyond_the_limit_are_not_answered() {
    let (handshakes, linger) = (1, HOUR);
    let server = Server::with_limits(Limits { handshakes, linger, ..Limits::default() });
    let (token, key, used) =
        (server.token(JoinRole::Node), Key::generate().unwrap(), server.token(JoinRole::Node));
    let text = used.to_string();
    let request = JoinRequest { key: key.public(), proof: key.prove(&text), token: text, resume: None };
    let runtime = of_one_thread();
    // Its token is used up, so it keeps its place.
    let asked = runtime.block_on(deaf(&server, &request.encode(crate::net::PROTOCOL_VERSION)));
    let begun = Instant::now();
    while server.process.net.totals().joins_granted == 0 {
        assert!(begun.elapsed() < PATIENCE, "it is not let in");
        std::thread::yield_now();
    }
    let error = join(&[server.addr()], &token, None, Duration::from_millis(300)).unwrap_err();
    assert!(matches!(error, NetError::Unreachable { .. }), "{error}");
    asked.1.close(0_u32.into(), b"");
    runtime.block_on(asked.0.wait_idle());
    drop((asked, runtime));
    join(&[server.addr()], &token, None, PATIENCE).unwrap();
    // A handshake that is over makes room even though the peer stays.
    let (one, two) = (server.process(JoinRole::Node), server.process(JoinRole::Node));
    one.connect_to(&server.process);
    two.connect_to(&server.process);
}

#[test]
fn who_begins_handshakes_and_does_not_finish_them_keeps_nobody_from_joining() {
    let (handshakes, handshake_timeout) = (8, HOUR);
    let limits =
        Limits { handshakes, handshakes_before_retry: handshakes, handshake_timeout, ..Limits::default() };
    let server = Server::with_limits(limits);
    let token = server.token(JoinRole::Node);
    // Forwards what callers send to the server, and nothing back.
    let way = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let (at, to) = (way.local_addr().unwrap(), server.addr());
    let (passed, arrived) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut packet = [0; 2_048];
        while let Ok((length, from)) = way.recv_from(&mut packet) {
            let is_end = from != to && passed.send(from).is_err();
            if is_end || from != to && way.send_to(&packet[..length], to).is_err() {
                break;
            }
        }
    });
    let runtime = of_one_thread();
    let dial = || async { anonymous(at, token.fingerprint, HOUR).unwrap() };
    let dialling: Vec<_> = (0..handshakes).map(|_| runtime.block_on(dial())).collect();
    let mut heard = std::collections::BTreeSet::new();
    while heard.len() < handshakes {
        heard.insert(arrived.recv_timeout(PATIENCE).unwrap());
    }
    for _ in 0..2 * handshakes {
        server.join(JoinRole::Client);
    }
    drop((dialling, arrived));
}

/// A caller that begins handshakes, proves its address, and says nothing more.
struct Caller {
    endpoint: quinn_proto::Endpoint,
    config: quinn_proto::ClientConfig,
    socket: std::net::UdpSocket,
    target: SocketAddr,
}

impl Caller {
    fn new(server: &Server, host: [u8; 4]) -> Self {
        let crypto = crate::net::verify::joining(server.token(JoinRole::Node).fingerprint).unwrap();
        let crypto = quinn::crypto::rustls::QuicClientConfig::try_from(crypto).unwrap();
        let socket = std::net::UdpSocket::bind((std::net::Ipv4Addr::from(host), 0)).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
        Self {
            endpoint: quinn_proto::Endpoint::new(Arc::default(), None, true, None),
            config: quinn_proto::ClientConfig::new(Arc::new(crypto)),
            socket,
            target: server.addr(),
        }
    }

    /// Begins a handshake. Returns whether it was asked for a proof of its address, and gave it.
    fn call(&mut self) -> bool {
        let now = Instant::now();
        let (handle, mut connection) =
            self.endpoint.connect(now, self.config.clone(), self.target, "server.dcd").unwrap();
        self.send(now, &mut connection);
        let (mut packet, mut proves) = ([0; 2_048], false);
        while let (false, Ok((length, from))) = (proves, self.socket.recv_from(&mut packet)) {
            let bytes = packet[..length].iter().copied().collect();
            let event = self.endpoint.handle(now, from, None, None, bytes, &mut Vec::new());
            if let Some(quinn_proto::DatagramEvent::ConnectionEvent(of, event)) = event
                && of == handle
            {
                connection.handle_event(event);
                self.send(now, &mut connection);
                proves = true;
            }
        }
        self.endpoint.handle_event(handle, quinn_proto::EndpointEvent::drained());
        proves
    }

    fn send(&self, now: Instant, connection: &mut quinn_proto::Connection) {
        let mut bytes = Vec::new();
        while let Some(transmit) = connection.poll_transmit(now, 1, &mut bytes) {
            self.socket.send_to(&bytes[..transmit.size], self.target).unwrap();
            bytes.clear();
        }
    }
}

#[test]
fn who_falls_silent_in_handshakes_leaves_few_connections_behind() {
    let (handshakes, closing) = (8, 8);
    let handshakes_before_retry = 0;
    let limits =
        Limits { handshakes, closing, handshakes_before_retry, handshake_timeout: HOUR, ..Limits::default() };
    let server = Server::with_limits(limits);
    let mut caller = Caller::new(&server, [127, 0, 0, 1]);
    let (mut proved, begun) = (0, Instant::now());
    while proved < 100 || server.process.net.totals().handshakes_refused < 80 {
        proved += usize::from(caller.call());
        let open = server.process.net.open_connections();
        assert!(open <= handshakes + closing, "{open} after {proved} handshakes");
        assert!(begun.elapsed() < PATIENCE, "{proved} handshakes");
    }
    server.join(JoinRole::Client);
}

#[test]
fn a_callers_part_lasts_until_quic_has_forgotten_its_connection() {
    let (server, limits) = (Server::start(), Limits::default());
    let identity = server.join(JoinRole::Node);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let call = (anywhere(), quinn::ConnectionId::new(&[1]));
        let part = Calls::new(1, 1).take(Instant::now(), call, 0, true).unwrap();
        let lasts = Arc::downgrade(&part);
        let mut answer = quic_config::server_config(&identity, false, &limits).unwrap();
        answer.transport_config(limits.answering_caller(0, false, part));
        let called = quinn::Endpoint::server(answer, anywhere()).unwrap();
        let caller = quinn::Endpoint::client(anywhere()).unwrap();
        let dial = quic_config::client_config(&identity, &limits).unwrap();
        let name = &identity.who().dns_names()[0];
        let _connecting = caller.connect_with(dial, called.local_addr().unwrap(), name).unwrap();
        let connection = called.accept().await.unwrap().await.unwrap();
        called.set_server_config(None);
        connection.close(0_u32.into(), b"");
        drop(connection);
        assert!(lasts.upgrade().is_some(), "QUIC remembers it for some round trips");
        called.wait_idle().await;
        assert!(lasts.upgrade().is_none());
    });
}

#[test]
fn who_calls_often_from_one_place_pushes_nobody_out_who_calls_from_elsewhere() {
    let handshakes = 8;
    let limits =
        Limits { handshakes, handshakes_before_retry: 1, handshake_timeout: HOUR, ..Limits::default() };
    let server = Server::with_limits(limits);
    // The packets of a joining process go to the server through this socket, and the answer comes late.
    let way = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    way.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
    let (at, to, token) = (way.local_addr().unwrap(), server.addr(), server.token(JoinRole::Node));
    let begun = Instant::now();
    let mut packet = [0; 2_048];
    let mut receive = || {
        assert!(begun.elapsed() < 2 * PATIENCE, "nothing comes of it");
        way.recv_from(&mut packet).ok().map(|(length, from)| (packet[..length].to_vec(), from))
    };
    std::thread::scope(|scope| {
        let joining = scope.spawn(|| join(&[at], &token, None, PATIENCE));
        let (first, joiner) = std::iter::repeat_with(&mut receive).flatten().next().unwrap();
        way.send_to(&first, to).unwrap();
        let mut receive_from = |peer| loop {
            if let Some((packet, from)) = receive()
                && from == peer
            {
                break packet;
            }
        };
        let answer = receive_from(to);
        let mut caller = Caller::new(&server, [127, 0, 0, 2]);
        while server.process.net.totals().handshakes_refused < 3 * handshakes as u64 {
            caller.call();
            assert!(begun.elapsed() < PATIENCE, "none gives way");
        }
        way.send_to(&answer, joiner).unwrap();
        while !joining.is_finished() {
            if let Some((packet, from)) = receive() {
                way.send_to(&packet, if from == to { joiner } else { to }).unwrap();
            }
        }
        joining.join().unwrap().unwrap();
    });
}

#[test]
fn who_is_named_and_does_not_greet_keeps_nobody_from_joining() {
    let server = Server::with_limits(Limits { handshakes: 1, handshake_timeout: HOUR, ..Limits::default() });
    let token = server.token(JoinRole::Node);
    let identity = server.join(JoinRole::Node);
    let runtime = of_one_thread();
    let idle = runtime.block_on(async {
        let endpoint = quinn::Endpoint::client(anywhere()).unwrap();
        let crypto = crate::net::verify::dialling(&identity).unwrap();
        let crypto = quinn::crypto::rustls::QuicClientConfig::try_from(crypto).unwrap();
        let mut config = quinn::ClientConfig::new(Arc::new(crypto));
        let mut transport = quinn::TransportConfig::default();
        transport.keep_alive_interval(Some(Duration::from_millis(50)));
        config.transport_config(Arc::new(transport));
        let connecting = endpoint.connect_with(config, server.addr(), "server.dcd").unwrap();
        (connecting.await.unwrap(), endpoint)
    });
    join(&[server.addr()], &token, None, PATIENCE).unwrap();
    drop((idle, runtime));
}

#[test]
fn who_has_no_name_and_asks_nothing_keeps_nobody_from_joining() {
    let (handshakes, handshake_timeout) = (8, HOUR);
    let server = Server::with_limits(Limits { handshakes, handshake_timeout, ..Limits::default() });
    let token = server.token(JoinRole::Node);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let idle = || async {
        let (endpoint, connecting) = anonymous(server.addr(), token.fingerprint, HOUR).unwrap();
        (connecting.await.unwrap(), endpoint)
    };
    let idle: Vec<_> = (0..handshakes).map(|_| runtime.block_on(idle())).collect();
    join(&[server.addr()], &token, None, PATIENCE).unwrap();
    server.join(JoinRole::Client);
    let closed =
        runtime.block_on(async { tokio::time::timeout(PATIENCE, idle[0].0.closed()).await }).unwrap();
    assert!(closed.to_string().contains("nothing was asked"), "{closed}");
    assert!(idle[handshakes - 1].0.close_reason().is_none(), "the newest may ask yet");
}

#[test]
fn who_is_refused_and_does_not_read_why_keeps_nobody_from_joining() {
    let (handshakes, handshake_timeout) = (8, HOUR);
    let server = Server::with_limits(Limits { handshakes, handshake_timeout, ..Limits::default() });
    let token = server.token(JoinRole::Node);
    let runtime = of_one_thread();
    let deaf: Vec<_> = (0..handshakes).map(|_| runtime.block_on(deaf(&server, b"x"))).collect();
    let begun = Instant::now();
    while server.process.net.totals().joins_refused < handshakes as u64 {
        assert!(begun.elapsed() < PATIENCE, "not all were refused");
        std::thread::yield_now();
    }
    join(&[server.addr()], &token, None, PATIENCE).unwrap();
    server.join(JoinRole::Client);
    assert!(deaf[handshakes - 1].1.close_reason().is_none(), "the newest may read yet");
}

#[test]
fn a_node_does_not_talk_to_anonymous_peers_at_all() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let error = join(&[node.net.local_addr()], &server.token(JoinRole::Node), None, PATIENCE).unwrap_err();
    assert!(matches!(error, NetError::WrongPeer { .. }), "a node is no server: {error}");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let authority = server.token(JoinRole::Node).fingerprint;
    let closed = runtime.block_on(async {
        let (endpoint, _) = anonymous(node.net.local_addr(), authority, PATIENCE).unwrap();
        let crypto = crate::net::verify::joining(authority).unwrap();
        let crypto = quinn::crypto::rustls::QuicClientConfig::try_from(crypto).unwrap();
        let config = quinn::ClientConfig::new(Arc::new(crypto));
        let name = &node.net.who().dns_names()[0];
        let connection = endpoint.connect_with(config, node.net.local_addr(), name).unwrap().await;
        match connection {
            Ok(connection) => tokio::time::timeout(PATIENCE, connection.closed()).await.unwrap(),
            Err(error) => error,
        }
    });
    assert!(closed.to_string().contains("certificate"), "{closed}");
    assert!(node.events.try_recv().is_err());
}

#[test]
fn whoever_answers_under_another_name_is_not_talked_to() {
    let server = Server::start();
    let (one, two) = (server.process(JoinRole::Node), server.process(JoinRole::Participant));
    let half_right = PeerName::Participant(two.net.who().node().unwrap(), ClientId(9));
    for expected in [PeerName::Node(NodeId(9)), PeerName::Server, half_right] {
        one.net.connect(two.net.local_addr(), expected);
        let error = one.refused();
        assert!(matches!(error, NetError::WrongPeer { .. }), "{error}");
    }
}

#[test]
fn processes_of_two_worlds_do_not_talk() {
    let (server, foreign) = (Server::start(), Server::start());
    let stranger = foreign.process(JoinRole::Node);
    stranger.net.connect(server.addr(), PeerName::Server);
    let error = stranger.refused();
    assert!(matches!(error, NetError::WrongPeer { .. }), "{error}");
}

#[test]
fn a_slow_reader_costs_its_limit_and_does_not_hold_up_others() {
    let server = Server::start();
    // The inbox holds two frames of the longest kind, 2 MiB.
    let limits = Limits { frame_bytes: 1 << 20, ..Limits::default() };
    let slow = Process::start(server.join(JoinRole::Client), None, limits);
    let quick = server.process(JoinRole::Client);
    let (_, to_slow) = slow.connect_to(&server.process);
    let (_, to_quick) = quick.connect_to(&server.process);
    let frame = vec![5; 60_000];
    let mut sent = 0;
    let mut last_taken = Instant::now();
    let full = loop {
        match server.process.net.send(to_slow, Lane::Object, &frame) {
            Ok(()) => {
                sent += 1;
                last_taken = Instant::now();
                // The inbox, one stream's window, our window and our queue bound it.
                assert!(sent * frame.len() < 4 << 20, "{sent} frames and no end");
            }
            Err(error) if last_taken.elapsed() > Duration::from_millis(300) => break error,
            Err(_) => std::thread::yield_now(),
        }
        let waiting = server.process.net.stats(to_slow).unwrap().bytes_waiting;
        assert!(waiting <= 64 << 10, "{waiting}");
    };
    assert!(matches!(full, SendError::Full { limit_bytes: 65_536, .. }), "{full:?}");
    server.process.net.send(to_quick, Lane::Object, b"you still hear me").unwrap();
    assert_eq!(quick.frame().1, b"you still hear me");
    // Nothing is lost once it reads again.
    for _ in 0..sent {
        assert_eq!(slow.frame().1, frame);
    }
    server.process.net.send(to_slow, Lane::Object, b"welcome back").unwrap();
    assert_eq!(slow.frame().1, b"welcome back");
}

#[test]
fn datagrams_for_a_loop_that_does_not_read_are_dropped_and_counted() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let (here, there) = node.connect_to(&server.process);
    let mut sent = 0;
    let deadline = Instant::now() + PATIENCE;
    while server.process.net.stats(there).unwrap().datagrams_dropped == 0 {
        node.net.send_datagram(here, vec![1; 1_000]).unwrap();
        sent += 1;
        assert!(Instant::now() < deadline, "{sent} datagrams and none dropped");
    }
    let kept = server.process.events.try_iter().count();
    // The inbox's 64 KiB, and what is let in from the 64 KiB buffers of both ends while the inbox is read.
    assert!((1..=200).contains(&kept), "{kept} of {sent} wait");
}

#[test]
fn a_port_that_is_taken_is_named() {
    let server = Server::start();
    let node = server.join(JoinRole::Node);
    let taken = server.addr();
    let config = NetConfig {
        listen: taken,
        identity: node,
        authority: None,
        renewed_by: Vec::new(),
        limits: Limits::default(),
    };
    let Err(error @ NetError::PortTaken { .. }) = Net::start(config) else { panic!("it is taken") };
    assert!(error.to_string().contains(&taken.to_string()), "{error}");
}

#[test]
fn a_second_server_on_the_same_folder_is_refused() {
    let server = Server::start();
    let authority = Arc::new(Authority::load_or_create(server.folder.path()).unwrap());
    let config = NetConfig {
        listen: anywhere(),
        identity: authority.server_identity().unwrap(),
        authority: Some(authority),
        renewed_by: Vec::new(),
        limits: Limits::default(),
    };
    assert!(matches!(Net::start(config), Err(NetError::FolderTaken { .. })));
}

#[test]
fn an_address_where_nobody_answers_is_named_within_the_time_out() {
    // A socket that never answers, held here so that no other process can take the port meanwhile.
    let silent = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let addr = silent.local_addr().unwrap();
    let server = Server::start();
    let start = Instant::now();
    let error = join(&[addr], &server.token(JoinRole::Node), None, Duration::from_millis(700)).unwrap_err();
    assert!(matches!(error, NetError::Unreachable { .. }) && error.to_string().contains(&addr.to_string()));
    server.process.net.connect(addr, PeerName::Node(NodeId(1)));
    assert!(matches!(server.process.refused(), NetError::Unreachable { .. }));
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}
