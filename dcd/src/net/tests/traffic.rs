//! Tests frames and datagrams between proven peers.

use std::time::Instant;

use super::*;

/// A close code that the test defines.
const LEAVING: CloseCode = CloseCode(CloseCode::FIRST_FREE + 1);

#[test]
fn frames_arrive_in_order_on_every_lane_and_in_both_directions() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let (here, there) = node.connect_to(&server.process);
    for number in 0..300u32 {
        for lane in Lane::ALL {
            node.net.send(here, lane, number.to_le_bytes()).unwrap();
            server.process.net.send(there, lane, number.to_be_bytes()).unwrap();
        }
    }
    for (process, from_bytes) in
        [(&server.process, u32::from_le_bytes as fn([u8; 4]) -> u32), (&node, u32::from_be_bytes)]
    {
        let mut expected = [0; 4];
        for _ in 0..1_200 {
            let (lane, bytes) = process.frame();
            assert_eq!(from_bytes(bytes.try_into().unwrap()), expected[lane.index()]);
            expected[lane.index()] += 1;
        }
        assert_eq!(expected, [300; 4]);
    }
    let stats = node.net.stats(here).unwrap();
    assert_eq!(
        (stats.frames_in, stats.frames_out, stats.bytes_in, stats.bytes_out),
        (1_200, 1_200, 4_800, 4_800)
    );
}

#[test]
fn frames_of_every_size_up_to_the_limit_arrive_whole() {
    let limits = Limits { frame_bytes: 3 << 20, ..Limits::default() };
    let server = Server::with_limits(limits.clone());
    let node = Process::start(server.join(JoinRole::Node), None, limits);
    let (here, _) = node.connect_to(&server.process);
    for bytes in [0, 1, 1_200, 65_536, 65_537, 1 << 20, 3 << 20] {
        let frame: Vec<u8> = (0..bytes).map(|at: usize| (at * 31) as u8).collect();
        node.net.send(here, Lane::Object, &frame).unwrap();
        let (lane, received) = server.process.frame();
        assert_eq!((lane, received.len()), (Lane::Object, bytes));
        assert!(received == frame);
    }
    let too_long = node.net.send(here, Lane::Object, vec![0; (3 << 20) + 1]);
    assert!(matches!(too_long, Err(SendError::FrameTooLong { .. })));
}

#[test]
fn datagrams_arrive_and_longer_ones_are_an_error() {
    let server = Server::start();
    let client = server.process(JoinRole::Client);
    let (here, there) = client.connect_to(&server.process);
    client.net.send_datagram(here, vec![3; MAX_DATAGRAM_BYTES]).unwrap();
    let NetEvent::Datagram { peer, bytes } = server.process.next() else { panic!("expected a datagram") };
    assert_eq!((peer, bytes), (there, vec![3; MAX_DATAGRAM_BYTES]));
    let too_long = client.net.send_datagram(here, vec![3; MAX_DATAGRAM_BYTES + 1]);
    assert_eq!(too_long, Err(SendError::DatagramTooLong { bytes: MAX_DATAGRAM_BYTES + 1 }));
}

#[test]
fn a_client_that_floods_is_read_at_its_pace_and_a_node_at_its_own() {
    let server = Server::with_limits(Limits { client_frames_per_s: 2_000, ..Limits::default() });
    let processes = [JoinRole::Client, JoinRole::Node].map(|role| server.process(role));
    for (process, held_back) in processes.iter().zip([true, false]) {
        let (here, there) = process.connect_to(&server.process);
        for number in 0..2_400_u32 {
            process.net.send(here, Lane::Client, number.to_le_bytes()).unwrap();
        }
        for number in 0..2_400_u32 {
            assert_eq!(server.process.frame().1, number.to_le_bytes(), "nothing is lost");
        }
        let stats = server.process.net.stats(there).unwrap();
        assert_eq!(stats.frames_held_back > 0, held_back, "{:?}", process.net.who());
    }
}

#[test]
fn of_a_client_that_floods_with_datagrams_some_are_dropped_and_of_a_node_none() {
    let server = Server::with_limits(Limits { client_frames_per_s: 1, ..Limits::default() });
    let processes = [JoinRole::Client, JoinRole::Node].map(|role| server.process(role));
    for (process, is_paced) in processes.iter().zip([true, false]) {
        let (here, there) = process.connect_to(&server.process);
        let stats = || server.process.net.stats(there).unwrap();
        for sent in 0..100 {
            process.net.send_datagram(here, vec![3; 10]).unwrap();
            while stats().datagrams_in <= sent {
                std::thread::yield_now();
            }
        }
        assert_eq!(stats().datagrams_dropped > 0, is_paced, "{:?}", process.net.who());
        assert!(matches!(server.process.next(), NetEvent::Datagram { .. }), "those of its pace are read");
        process.net.send(here, Lane::Client, b"a frame").unwrap();
        let mut events = std::iter::repeat_with(|| server.process.next());
        let frame = events.find(|event| !matches!(event, NetEvent::Datagram { .. }));
        assert!(matches!(frame, Some(NetEvent::Frame { .. })), "{frame:?}");
        assert_eq!(stats().frames_held_back, 0, "its frames do not wait for that");
    }
}

#[test]
fn nodes_and_participants_know_one_another_by_name() {
    let server = Server::start();
    let (node, both) = (server.process(JoinRole::Node), server.process(JoinRole::Participant));
    node.net.connect(both.net.local_addr(), PeerName::Node(both.net.who().node().unwrap()));
    assert_eq!(node.connected().1, both.net.who());
    assert_eq!(both.connected().1, node.net.who());
}

#[test]
fn closing_delivers_what_was_sent_before() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let (here, _) = node.connect_to(&server.process);
    for _ in 0..20 {
        node.net.send(here, Lane::Object, vec![1; 100_000]).unwrap();
    }
    node.net.close(here, LEAVING, "leaving");
    assert_eq!(node.net.send(here, Lane::Object, [0]), Err(SendError::NotConnected));
    for _ in 0..20 {
        assert_eq!(server.process.frame().1.len(), 100_000);
    }
    assert_eq!(server.process.closed(), (CloseCause::ByPeer(LEAVING), "leaving".to_owned()));
    assert_eq!(node.closed().0, CloseCause::ByUs);
    assert_eq!(server.process.net.totals().traffic.frames_in, 20, "counters outlive connections");
    assert_eq!(server.process.net.totals().peers, 0);
}

#[test]
fn what_arrived_before_the_end_is_delivered_to_a_slow_reader_too() {
    let limits = Limits { frame_bytes: 1 << 20, linger: PATIENCE, ..Limits::default() };
    let server = Server::with_limits(limits.clone());
    let node = Process::start(server.join(JoinRole::Node), None, limits);
    let (here, _) = node.connect_to(&server.process);
    // The first frame fills the inbox, so that the second one waits in QUIC when the connection ends.
    for _ in 0..2 {
        node.net.send(here, Lane::Object, vec![1; 1 << 20]).unwrap();
    }
    node.net.close(here, LEAVING, "leaving");
    assert_eq!(node.closed().0, CloseCause::ByUs);
    for _ in 0..2 {
        assert_eq!(server.process.frame().1.len(), 1 << 20);
    }
    assert_eq!(server.process.closed().0, CloseCause::ByPeer(LEAVING));
}

#[test]
fn what_a_connection_has_carried_counts_while_it_is_being_closed_and_afterwards() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let (here, _) = node.connect_to(&server.process);
    node.net.send(here, Lane::Object, vec![1; 1_000]).unwrap();
    assert_eq!(server.process.frame().1.len(), 1_000);
    let sent = || node.net.totals().traffic.bytes_out;
    let before = sent();
    assert!(before >= 1_000);
    node.net.close(here, LEAVING, "leaving");
    assert_eq!(sent(), before, "at once");
    loop {
        assert_eq!(sent(), before, "until it is over");
        match node.events.try_recv() {
            Ok(NetEvent::Closed { .. }) => break,
            _ => std::thread::yield_now(),
        }
    }
    assert_eq!((sent(), node.net.totals().peers), (before, 0));
}

/// Occupies the network's thread until the sender that this returns is dropped.
#[cfg(feature = "physics")]
fn occupy(net: &Net) -> std::sync::mpsc::Sender<()> {
    let ((begin, begun), (open, gate)) = (std::sync::mpsc::channel(), std::sync::mpsc::channel::<()>());
    net.datagrams().runtime.spawn(async move {
        begin.send(()).unwrap();
        let _ = gate.recv();
    });
    begun.recv_timeout(PATIENCE).unwrap();
    open
}

#[cfg(feature = "physics")]
#[test]
fn the_traffic_of_many_links_is_counted_by_the_networks_thread() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let net = &server.process.net;
    let sent = || net.counted().totals.traffic.bytes_out;
    let say = |key| net.send_datagram(key, vec![1; 100]).unwrap();
    let (_, first) = node.connect_to(&server.process);
    for _ in 1..super::super::endpoint::FEW {
        node.connect_to(&server.process);
    }
    say(first);
    assert_eq!(sent(), 100, "that of few is as it is now");
    assert!(matches!(node.next(), NetEvent::Datagram { .. }));
    node.connect_to(&server.process);
    let open = occupy(net);
    say(first);
    assert_eq!((sent(), sent()), (100, 100), "whoever asks does not count");
    drop(open);
    let begun = Instant::now();
    while sent() != 200 {
        assert!(begun.elapsed() < PATIENCE, "nobody counts");
        std::thread::yield_now();
    }
    let counted = net.counted();
    let links = &counted.links;
    assert_eq!((links.len() as u64, links[&first].bytes_out), (net.totals().peers, 200));
}

#[cfg(feature = "physics")]
#[test]
fn events_are_passed_on_by_the_networks_thread_after_those_that_came_before() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let (here, _) = node.connect_to(&server.process);
    let Process { net: _net, events } = server.process;
    node.net.send(here, Lane::Object, [0]).unwrap();
    let (tell, tells) = std::sync::mpsc::channel();
    events.pass_to(move |held| {
        let name = std::thread::current().name().map(str::to_owned);
        let NetEvent::Frame { bytes, .. } = held.into_event() else { return false };
        tell.send((bytes, name)).is_ok()
    });
    for kind in [1, 2] {
        node.net.send(here, Lane::Object, [kind]).unwrap();
    }
    let passed = [(); 3].map(|()| tells.recv_timeout(PATIENCE).unwrap());
    assert_eq!(passed.each_ref().map(|(bytes, _)| bytes[0]), [0, 1, 2]);
    assert_eq!(passed[2].1.as_deref(), Some("dcd-net"));
}

#[test]
fn shutting_down_tells_peers_and_ends_the_events() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    node.connect_to(&server.process);
    let Process { net, events } = node;
    net.shutdown();
    assert_eq!(server.process.closed(), (CloseCause::ByPeer(CloseCode::DONE), "shut down".to_owned()));
    assert!(matches!(events.recv_timeout(PATIENCE), Ok(NetEvent::Closed { cause: CloseCause::ByUs, .. })));
    assert!(events.recv_timeout(PATIENCE).is_err());
}

/// Prints measured times; run with `--nocapture`. The bound is loose: it catches a delayed flush, not a slow
/// machine.
#[test]
fn a_small_frame_goes_to_and_fro_at_once() {
    let server = Server::start();
    let node = server.process(JoinRole::Node);
    let (here, there) = node.connect_to(&server.process);
    let mut round_trips: Vec<Duration> = Vec::new();
    for _ in 0..2_000 {
        let start = Instant::now();
        node.net.send(here, Lane::Object, [7; 64]).unwrap();
        server.process.frame();
        server.process.net.send(there, Lane::Object, [7; 64]).unwrap();
        node.frame();
        round_trips.push(start.elapsed());
    }
    round_trips.sort();
    let at = |share: usize| round_trips[round_trips.len() * share / 1000];
    println!("round trip: median {:?}, 99 % {:?}, 99.9 % {:?}", at(500), at(990), at(999));
    assert!(at(500) < Duration::from_millis(5), "median {:?}", at(500));
}
