//! Tests slow peers, links that break, and programs that write too much, over real QUIC links.

use std::sync::Arc;
use std::time::SystemTime;

use super::*;
use crate::net::{Authority, Identity, Limits, NetConfig, NetEvents, join};
use crate::protocol::{Chunk, FromClient, Input, Program, Velocity};
use crate::runtime::{Cause, ConnectionChange, ConnectionError};
use crate::sim::{sim_body, sim_world};
use crate::space::{BodyId, Tick};

const PATIENCE: Duration = Duration::from_secs(20);

/// A server and another process, with a link that is up. The other process reads only when told to.
struct Pair {
    links: Links,
    events: NetEvents,
    other: Net,
    other_events: NetEvents,
    peer: Peer,
    folder: tempfile::TempDir,
}

fn start(identity: Identity, authority: Option<Arc<Authority>>, limits: Limits) -> (Net, NetEvents) {
    let listen = ([127, 0, 0, 1], 0).into();
    Net::start(NetConfig { listen, identity, authority, renewed_by: Vec::new(), limits }).unwrap()
}

impl Pair {
    fn new(role: crate::net::JoinRole) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
        let identity = authority.server_identity().unwrap();
        let (net, events) = start(identity, Some(authority.clone()), Limits::default());
        let token = authority.issue_token(role, PATIENCE, SystemTime::now()).unwrap();
        let joined = join(&[net.local_addr()], &token, None, PATIENCE).unwrap();
        joined.save(&folder.path().join("joined")).unwrap();
        let (other, other_events) =
            start(joined, None, Limits { frame_bytes: 512 << 10, ..Limits::default() });
        other.connect(net.local_addr(), PeerName::Server);
        let mut links = Links::new(net, Connections::new(PeerName::Server, || ()));
        let connected = links.translate(events.recv_timeout(PATIENCE).unwrap());
        let LinkEvent::Connected(peer, _) = connected[0] else { panic!("{connected:?}") };
        Self { links, events, other, other_events, peer, folder }
    }

    /// Starts the other process again, and returns the former one.
    fn start_other(&mut self) -> Net {
        let joined = Identity::load(&self.folder.path().join("joined")).unwrap();
        let (other, events) = start(joined, None, Limits::default());
        self.other_events = events;
        std::mem::replace(&mut self.other, other)
    }

    /// Returns the changes of the connection with the other process since the last call.
    fn changes(&self) -> Vec<ConnectionChange> {
        self.links.connections.take_events().into_iter().map(|event| event.change).collect()
    }

    /// Returns the link events of the next network event.
    fn hear(&mut self) -> Vec<LinkEvent> {
        let event = self.events.recv_timeout(PATIENCE).unwrap();
        self.links.translate(event)
    }

    fn tell(&mut self, message: ToClient) {
        let client = ClientId(1);
        self.links.send(self.peer, &Message::ToClient(client, message));
    }

    /// Sends some 300 kB of a world.
    fn tell_bodies(&mut self) {
        let bodies = (0..1_000).map(|id| sim_body(BodyId::persistent(id), [0.0; 3])).collect();
        self.tell(ToClient::Chunk(Chunk::Bodies(bodies)));
    }

    fn tell_world(&mut self, chunks: usize) {
        self.tell(ToClient::Welcome {
            id: ClientId(1),
            logical_time: 0,
            next_built: (0, 0),
            incarnation: 1,
            world: sim_world(2),
        });
        (0..chunks).for_each(|_| self.tell_bodies());
        self.tell(ToClient::WorldEnd);
    }

    fn waiting_bytes(&self) -> usize {
        self.links.waiting.values().map(|waiting| waiting.bytes).sum()
    }

    /// Sends until sockets have taken in nothing for half a second; returns the time then.
    fn fill_sockets(&mut self) -> Instant {
        let began = Instant::now();
        let (mut waiting, mut since) = (self.waiting_bytes(), began);
        loop {
            let now = Instant::now();
            self.links.flush(now);
            if self.waiting_bytes() != waiting {
                (waiting, since) = (self.waiting_bytes(), now);
            }
            if now - since > Duration::from_millis(500) || now - began > PATIENCE {
                return now;
            }
            std::thread::yield_now();
        }
    }

    /// Lets the other process read until nothing waits any more.
    fn read_all(&mut self) {
        while self.links.flush(Instant::now()) {
            while self.other_events.recv_timeout(Duration::from_millis(10)).is_ok() {}
        }
    }

    fn given_up(&mut self) -> Vec<Peer> {
        let events = self.links.take_given_up().into_iter();
        events
            .map(|event| match event {
                LinkEvent::Disconnected { peer, ending: Some(Ending::TooSlow), .. } => peer,
                other => panic!("{other:?}"),
            })
            .collect()
    }
}

#[test]
fn a_node_greets_for_its_own_client_alone() {
    for own in [true, false] {
        let mut pair = Pair::new(crate::net::JoinRole::Participant);
        let NetEvent::Connected { peer: server, .. } = pair.other_events.recv_timeout(PATIENCE).unwrap()
        else {
            panic!("it is linked")
        };
        let client = match own {
            true => pair.other.who().client(),
            false => Some(ClientId(99)),
        };
        let role = JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client, resume: None, heard: 0 };
        let hello = protocol::encode(&Message::Hello(Hello { version: protocol::VERSION, role }));
        pair.other.send(server, crate::net::Lane::Admin, &hello).unwrap();
        let events = pair.hear();
        let is_heard = matches!(events[..], [LinkEvent::Message { .. }]);
        let is_ended = |event: &LinkEvent| {
            matches!(event, LinkEvent::Disconnected { ending: Some(Ending::BrokeRule), .. })
        };
        assert_eq!((is_heard, events.iter().all(is_ended)), (own, !own));
    }
}

#[test]
fn a_participant_that_is_closed_in_one_role_is_gone_in_the_other() {
    for as_node in [true, false] {
        let mut pair = Pair::new(crate::net::JoinRole::Participant);
        let who = pair.other.who();
        let roles = [Peer::Node(who.node().unwrap()), Peer::Client(who.client().unwrap())];
        let [closed, other] = if as_node { roles } else { [roles[1], roles[0]] };
        pair.links.close(closed, Ending::Refused, "it greets too often");
        let gone = pair.links.take_given_up().into_iter().map(|event| match event {
            LinkEvent::Disconnected { peer, ending: Some(Ending::Refused), .. } => peer,
            other => panic!("{other:?}"),
        });
        assert_eq!(gone.collect::<Vec<_>>(), [other]);
        assert_eq!(roles.map(|role| pair.links.key(role)), [None, None]);
    }
}

#[test]
fn only_what_may_overtake_others_comes_in_a_datagram() {
    let input = |tick| Input {
        body: BodyId::avatar(ClientId(1), 0),
        logical_time: 1,
        tick: Tick(tick),
        velocity: Velocity::default(),
        pose: None,
        drive: None,
    };
    for (tick, is_heard) in [(7, true), (0, false)] {
        let mut pair = Pair::new(crate::net::JoinRole::Client);
        let NetEvent::Connected { peer: server, .. } = pair.other_events.recv_timeout(PATIENCE).unwrap()
        else {
            panic!("it is linked")
        };
        let message = Message::FromClient(ClientId(1), FromClient::Input(input(tick)));
        pair.other.send_datagram(server, protocol::encode(&message)).unwrap();
        let events = pair.hear();
        match is_heard {
            true => assert!(matches!(events[..], [LinkEvent::Message { .. }]), "{events:?}"),
            false => assert!(
                matches!(events[..], [LinkEvent::Disconnected { ending: Some(Ending::BrokeRule), .. }]),
                "{events:?}"
            ),
        }
    }
}

#[test]
fn a_client_may_be_slow_while_it_is_told_of_the_world_and_not_afterwards() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    pair.tell_world(60);
    assert!(pair.waiting_bytes() > 4 << 20, "{}", pair.waiting_bytes());
    pair.read_all();
    assert_eq!((pair.waiting_bytes(), pair.given_up()), (0, vec![]));
    // It reads nothing from here on. At first its own process still takes messages in.
    let mut told = 0;
    while pair.links.key(pair.peer).is_some() {
        pair.tell(ToClient::Chunk(Chunk::Bodies(vec![sim_body(BodyId::persistent(1), [0.0; 3]); 100])));
        assert_eq!(pair.waiting_bytes(), 0);
        told += 1;
        std::thread::sleep(Duration::from_micros(200));
        assert!(told < 100_000);
    }
    assert_eq!(pair.given_up(), [pair.peer], "our own server hears of it");
    assert_eq!(pair.given_up(), []);
    let closed = pair.events.recv_timeout(PATIENCE).unwrap();
    assert!(pair.links.translate(closed).is_empty(), "once");
    while let Ok(event) = pair.other_events.recv_timeout(PATIENCE) {
        if let NetEvent::Closed { cause, .. } = event {
            assert_eq!(cause, CloseCause::ByPeer(Ending::TooSlow.code()));
            return pair.other.shutdown();
        }
    }
    panic!("the client is not told");
}

#[test]
fn a_client_may_be_slow_while_it_is_told_of_what_another_builds() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    pair.tell_world(1);
    pair.read_all();
    let insert = |pair: &mut Pair, count: u32| {
        for id in 0..count {
            let body = sim_body(BodyId::persistent(id), [0.0; 3]);
            pair.tell(ToClient::Inserted { body, shapes: Vec::new(), joints: Vec::new() });
        }
    };
    insert(&mut pair, 30_000);
    assert!(pair.waiting_bytes() > 1 << 20, "{}", pair.waiting_bytes());
    // Other messages keep their place.
    pair.tell(ToClient::Built(7));
    assert_eq!(pair.given_up(), []);
    pair.read_all();
    assert_eq!((pair.waiting_bytes(), pair.links.told.len(), pair.given_up()), (0, 0, vec![]));
    // It takes nothing in any more; this is more than sockets take.
    insert(&mut pair, 40_000);
    let stuck = pair.fill_sockets();
    pair.links.flush(stuck + STUCK / 2);
    assert_eq!(pair.given_up(), []);
    pair.links.flush(stuck + STUCK);
    assert_eq!(pair.given_up(), [pair.peer]);
    insert(&mut pair, 1);
    assert_eq!((pair.waiting_bytes(), pair.links.told.len()), (0, 0), "there is no link");
}

#[test]
fn a_client_may_be_behind_by_some_of_what_others_build_and_by_no_avatars() {
    let mut most = [0, 0];
    let bodies = [BodyId::persistent(1), BodyId::avatar(ClientId(2), 0)];
    for (most, body) in most.iter_mut().zip(bodies) {
        let mut pair = Pair::new(crate::net::JoinRole::Client);
        pair.tell_world(1);
        pair.read_all();
        while pair.links.key(pair.peer).is_some() {
            let body = sim_body(body, [0.0; 3]);
            pair.tell(ToClient::Inserted { body, shapes: Vec::new(), joints: Vec::new() });
            *most = pair.waiting_bytes().max(*most);
        }
        assert_eq!(pair.given_up(), [pair.peer]);
    }
    assert!((15 << 20..=16 << 20).contains(&most[0]), "{most:?}");
    assert_eq!(most[1], 0);
}

#[test]
fn a_node_may_be_behind_by_a_world_and_no_more() {
    let mut pair = Pair::new(crate::net::JoinRole::Node);
    pair.links.world_bytes = 8 << 20;
    let mut most = 0;
    while pair.links.key(pair.peer).is_some() {
        pair.tell_bodies();
        most = most.max(pair.waiting_bytes());
    }
    assert!((7 << 20..=8 << 20).contains(&most), "{most}");
    assert_eq!((pair.given_up(), pair.waiting_bytes()), (vec![pair.peer], 0));
}

#[test]
fn who_takes_in_nothing_for_long_is_given_up_however_little_waits() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    pair.tell_world(60);
    assert!(pair.links.flush(Instant::now()));
    let stuck = pair.fill_sockets();
    assert!(pair.links.flush(stuck + STUCK / 2));
    assert_eq!(pair.given_up(), []);
    pair.links.flush(stuck + STUCK);
    assert_eq!((pair.given_up(), pair.waiting_bytes()), (vec![pair.peer], 0));
    // A peer that takes in a little now and then is slow, and stays.
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    pair.tell_world(60);
    let mut now = Instant::now();
    for part in 0..6 {
        let before = pair.waiting_bytes();
        while pair.waiting_bytes() == before {
            let _ = pair.other_events.recv_timeout(Duration::from_millis(10));
            assert!(pair.links.flush(now));
        }
        now += STUCK * 2 / 3;
        assert!(pair.links.flush(now), "part {part}");
        assert_eq!(pair.given_up(), [], "part {part}");
    }
}

#[test]
fn who_greets_while_worlds_wait_for_others_is_heard_once_those_read_or_are_given_up() {
    for reads in [true, false] {
        let mut pair = Pair::new(crate::net::JoinRole::Client);
        pair.links.worlds_bytes = 1 << 20;
        pair.tell_world(60);
        let authority = Authority::load_or_create(pair.folder.path()).unwrap();
        let token = authority.issue_token(crate::net::JoinRole::Client, PATIENCE, SystemTime::now()).unwrap();
        let server = pair.links.net.local_addr();
        let (second, events) =
            start(join(&[server], &token, None, PATIENCE).unwrap(), None, Limits::default());
        let key = second.connect(server, PeerName::Server);
        let connected = events.recv_timeout(PATIENCE).unwrap();
        assert!(matches!(connected, NetEvent::Connected { .. }), "{connected:?}");
        assert!(matches!(pair.hear()[..], [LinkEvent::Connected(..)]));
        let role = JoinAs::Client { interest: None };
        let again = Message::Hello(Hello { version: protocol::VERSION, role });
        let hello = protocol::encode(&again);
        second.send(key, crate::net::Lane::Admin, hello).unwrap();
        assert!(pair.hear().is_empty(), "it waits");
        second.send(key, crate::net::Lane::Admin, protocol::encode(&again)).unwrap();
        assert!(pair.hear().is_empty(), "so does the same said again");
        assert!(pair.links.next_greeting(Instant::now()).is_none() && pair.links.flush(Instant::now()));
        if reads {
            while pair.waiting_bytes() > 0 {
                let _ = pair.other_events.recv_timeout(Duration::from_millis(10));
                pair.links.flush(Instant::now());
            }
            assert_eq!(pair.given_up(), []);
        } else {
            let stuck = pair.fill_sockets();
            pair.links.flush(stuck + PRESSED);
            assert_eq!(pair.given_up(), [pair.peer]);
        }
        let heard = pair.links.next_greeting(Instant::now());
        let second = Peer::Client(ClientId(2));
        assert!(matches!(heard, Some(LinkEvent::Message { from, .. }) if from == second), "{heard:?}");
        assert!(pair.links.next_greeting(Instant::now()).is_none());
    }
}

#[test]
fn who_greets_is_heard_in_the_end_however_slowly_others_read() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    pair.links.worlds_bytes = 1 << 20;
    pair.tell_world(60);
    let (role, key) = (JoinAs::Client { interest: None }, pair.links.key(pair.peer).unwrap());
    let hello = Message::Hello(Hello { version: protocol::VERSION, role });
    let greets =
        |client: u32| LinkEvent::Message { from: Peer::Client(ClientId(client)), message: hello.clone() };
    let now = Instant::now();
    let who = PeerName::Client(ClientId(1));
    assert!(pair.links.in_turn(key, who, greets(1), now).is_empty());
    assert!(pair.links.next_greeting(now + LONGEST_WAIT / 2).is_none());
    assert!(pair.links.next_greeting(now + LONGEST_WAIT).is_some());
}

#[test]
fn who_reads_one_long_frame_for_long_is_not_given_up() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    // The first one takes no long frames.
    let former = pair.start_other();
    pair.other.connect(pair.links.net.local_addr(), PeerName::Server);
    pair.hear();
    drop(former);
    let key = pair.links.key(pair.peer).unwrap();
    pair.tell_world(0);
    pair.read_all();
    let bodies = (0..40_000).map(|id| sim_body(BodyId::persistent(id), [0.0; 3])).collect();
    pair.tell_world(0);
    pair.tell(ToClient::Chunk(Chunk::Bodies(bodies)));
    pair.tell(ToClient::WorldEnd);
    assert!(pair.waiting_bytes() > 0, "it waits behind a frame of 12 MB");
    let mut now = Instant::now();
    pair.links.flush(now);
    let mut looks = 0;
    while pair.waiting_bytes() > 0 {
        let left = pair.links.net.bytes_waiting(key);
        let begun = Instant::now();
        let is_read = |is: usize| is == 0 || is + LEAST_READ <= left;
        while !is_read(pair.links.net.bytes_waiting(key)) {
            assert!(begun.elapsed() < PATIENCE, "nothing is read of {left} bytes");
            std::thread::yield_now();
        }
        now += STUCK * 2 / 3;
        pair.links.flush(now);
        assert_eq!(pair.given_up(), [], "after {looks} looks");
        looks += 1;
    }
    pair.read_all();
}

#[test]
fn what_waited_for_a_link_is_not_told_over_the_next_one() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    pair.tell_world(30);
    assert!(pair.waiting_bytes() > 1 << 20, "{}", pair.waiting_bytes());
    // The process is started again before its former link is found dead.
    let former = pair.start_other();
    pair.other.connect(pair.links.net.local_addr(), PeerName::Server);
    pair.hear();
    assert_eq!((pair.waiting_bytes(), pair.links.told.len()), (0, 0));
    pair.tell_world(1);
    let first = std::iter::from_fn(|| pair.other_events.recv_timeout(PATIENCE).ok()).find_map(|event| {
        let NetEvent::Frame { bytes, .. } = event else { return None };
        Some(protocol::decode(&bytes).unwrap())
    });
    assert!(matches!(first, Some(Message::ToClient(_, ToClient::Welcome { .. }))), "{first:?}");
    drop(former);
}

#[test]
fn a_connection_is_lost_and_back_under_its_name_until_its_process_goes() {
    let mut pair = Pair::new(crate::net::JoinRole::Participant);
    let connections = pair.links.connections.clone();
    assert_eq!(pair.changes(), [ConnectionChange::Came]);
    let [first] = &connections.list()[..] else { panic!("one connection, though it has two voices") };
    assert!(first.is_up && first.who.node().is_some() && first.who.client().is_some());

    let gone = pair.start_other();
    gone.vanish();
    assert_eq!(pair.hear().len(), 2, "both voices");
    let [ConnectionChange::Lost(reason)] = &pair.changes()[..] else { panic!() };
    assert!(reason.cause == Cause::Broken && reason.text.contains("nothing was heard"), "{reason:?}");
    assert!(!connections.get(first.id).unwrap().is_up);
    let seen = connections.arrivals();
    assert!(!connections.wait(seen, Duration::ZERO));
    pair.other.connect(pair.links.net.local_addr(), PeerName::Server);
    assert_eq!(pair.hear().len(), 2);
    assert!(connections.wait(seen, Duration::ZERO));
    assert_eq!(pair.changes(), [ConnectionChange::Back]);
    assert!(connections.get(first.id).unwrap().is_up);
    // The process dials again before its former link is found dead.
    let former = pair.start_other();
    pair.other.connect(pair.links.net.local_addr(), PeerName::Server);
    pair.hear();
    assert_eq!(pair.changes(), [ConnectionChange::Lost(Ending::Superseded.reason()), ConnectionChange::Back]);
    drop(former);

    pair.links.flush(Instant::now());
    pair.links.flush(Instant::now() + COUNT);
    let traffic = connections.get(first.id).unwrap().traffic;
    assert!(traffic.packets_out > 0 && traffic.rtt > Duration::ZERO, "{traffic:?}");
    let other = pair.start_other();
    other.shutdown();
    while connections.get(first.id).is_some() {
        pair.hear();
    }
    assert_eq!(pair.changes(), [ConnectionChange::Gone(Reason::new(Cause::Left, "shut down"))]);
    assert_eq!(connections.list(), []);
}

#[test]
fn a_connection_that_does_not_come_back_is_gone_but_for_the_server() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    let other = Connections::new(PeerName::Client(ClientId(1)), || ());
    let NetEvent::Connected { peer, who, addr } = pair.other_events.recv_timeout(PATIENCE).unwrap() else {
        panic!()
    };
    other.linked(peer, who, addr);
    other.lost(peer, Reason::new(Cause::Broken, "it is dead"));
    other.refresh(Instant::now() + Duration::from_secs(3_600), |_| None);
    assert_eq!(other.list().len(), 1);
    pair.start_other().vanish();
    pair.hear();
    pair.links.flush(Instant::now());
    assert_eq!(pair.changes().len(), 2, "came and lost");
    pair.links.flush(Instant::now() + Duration::from_secs(3_600));
    assert_eq!(pair.changes(), [ConnectionChange::Gone(Reason::new(Cause::Broken, "it did not come back"))]);
}

#[test]
fn a_program_that_takes_nothing_holds_up_its_writer_and_not_the_world() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    let connections = pair.links.connections.clone();
    let id = connections.list()[0].id;
    let mut written = 0;
    while connections.send(id, &[7; 10_000], Delivery::Message) != Err(ConnectionError::Full) {
        pair.links.flush(Instant::now());
        written += 1;
    }
    assert!((25..=26).contains(&written), "a window on its way, and one that waits: {written}");
    connections.send(id, b"newest", Delivery::Datagram).unwrap();
    pair.tell_world(10);
    let (mut worlds, mut messages, mut datagrams) = (0, 0, 0);
    let mut quiet = false;
    while worlds == 0 || !quiet {
        pair.links.flush(Instant::now());
        let event = pair.other_events.recv_timeout(Duration::from_millis(200));
        quiet = event.is_err();
        match event {
            Ok(NetEvent::Frame { lane: crate::net::Lane::Program, .. }) => messages += 1,
            Ok(NetEvent::Frame { bytes, .. }) => {
                let end = Message::ToClient(ClientId(1), ToClient::WorldEnd);
                worlds += usize::from(protocol::decode(&bytes).unwrap() == end);
            }
            Ok(NetEvent::Datagram { .. }) => datagrams += 1,
            _ => {}
        }
    }
    // As many messages as the window holds, and the whole world.
    assert_eq!((worlds, messages, pair.waiting_bytes()), (1, 13, 0));
    assert!(datagrams <= 1);
    assert_eq!((pair.given_up(), connections.list().len()), (vec![], 1));
}

#[test]
fn who_writes_more_than_there_is_room_for_or_to_the_wrong_program_is_disconnected() {
    let frame = |bytes| protocol::encode(&Message::Program(Program::Message(vec![0; bytes])));
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    let NetEvent::Connected { peer: server, .. } = pair.other_events.recv_timeout(PATIENCE).unwrap() else {
        panic!()
    };
    for _ in 0..5 {
        pair.other.send(server, crate::net::Lane::Program, frame(30_000)).unwrap();
    }
    let closed: Vec<_> = (0..5).flat_map(|_| pair.hear()).collect();
    let [LinkEvent::Disconnected { ending: Some(Ending::BrokeRule), text: reason, .. }] = &closed[..] else {
        panic!("{closed:?}")
    };
    assert!(reason.contains("than there was room for"), "{reason}");
    let connections = &pair.links.connections;
    assert_eq!(connections.take_messages().len(), 4);
    assert_eq!(connections.list(), []);

    let client = Connections::new(PeerName::Client(ClientId(1)), || ());
    client.linked(server, PeerName::Node(NodeId(1)), ([127, 0, 0, 1], 1).into());
    assert!(client.heard(server, Program::Datagram(vec![1])).is_err());
    let node = client.list()[0].id;
    assert_eq!(client.send(node, b"psst", Delivery::Message), Err(ConnectionError::NotByServer));
}

#[test]
fn messages_outlive_their_link_and_not_without_bound() {
    let pair = Pair::new(crate::net::JoinRole::Client);
    let NetEvent::Connected { peer: link, who, addr } = pair.other_events.recv_timeout(PATIENCE).unwrap()
    else {
        panic!()
    };
    let connections = Connections::new(PeerName::Client(ClientId(1)), || ());
    let say = |bytes| connections.heard(link, Program::Message(vec![0; bytes])).unwrap();
    connections.linked(link, who, addr);
    say(1);
    let id = connections.list()[0].id;
    connections.send(id, b"never sent", Delivery::Message).unwrap();
    connections.lost(link, Reason::new(Cause::Broken, "cut"));
    assert_eq!(connections.send(id, b"", Delivery::Message), Err(ConnectionError::Lost));
    assert_eq!(connections.take_messages().len(), 1, "it has come");
    connections.linked(link, who, addr);
    assert!(!connections.send_waiting(|_, _, _| panic!("it was lost with its link")));
    // Links come and go, with messages that nobody takes.
    for _ in 0..60 {
        (0..4).for_each(|_| say(30_000));
        connections.gone(link, Reason::new(Cause::Left, "left"));
        connections.linked(link, who, addr);
    }
    say(2);
    let kept = connections.take_messages();
    assert_eq!(kept.len(), 25 * 4 + 1, "those of 35 links are more than 4 MiB, and are forgotten");
    assert_eq!(kept.last().map(|message| message.bytes.len()), Some(2));
}

#[test]
fn an_attempt_that_fails_says_nothing_of_a_peer_that_is_linked_or_dialled_again() {
    let mut pair = Pair::new(crate::net::JoinRole::Client);
    let closed = std::net::UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    pair.links.dial(pair.peer, &[closed]);
    assert!(pair.hear().is_empty(), "it is linked");
    let stranger = Peer::Node(NodeId(9));
    pair.links.dial(stranger, &[closed]);
    pair.links.dial(stranger, &[closed]);
    assert!(pair.hear().is_empty(), "it is dialled again");
    let [LinkEvent::Disconnected { peer, .. }] = pair.hear()[..] else { panic!("all attempts have failed") };
    assert_eq!(peer, stranger);
}
