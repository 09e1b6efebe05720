//! Tests that a leader goes on whatever happens to the thread that tells clients.

use std::collections::BTreeSet;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use super::*;
use crate::cluster::Leader;
use crate::net::{Authority, Limits, Net, NetConfig};
use crate::protocol::{
    Done, Heard, Member, RelayNews, Report, SharedState, Velocity, View, ViewNumber, WorldPose,
};
use crate::sim::sim_world;
use crate::space::{BodyId, Epoch, GroupId, NodeId, RegionId, Tick};

const PATIENCE: Duration = Duration::from_secs(20);
const BODIES: u32 = 100;

/// More ticks, and more acknowledgements of a client, than may wait.
const MANY: usize = 9_000;

/// A leader that computes alone and has one client, to which there is no link.
struct Stage {
    leader: Leader,
    nodes: Vec<NodeId>,
    tick: u64,
}

impl Stage {
    fn new() -> Self {
        Self::with(None)
    }

    /// Returns the same with a client that is the user of another member, if one is given, or has a link of
    /// its own.
    fn with(participant: Option<NodeId>) -> Self {
        let node = NodeId(1);
        let world = sim_world(1);
        let view = View {
            events: false,
            viewpoints: Vec::new(),
            group: GroupId(1),
            number: ViewNumber(1),
            tick: Tick(0),
            leader: node,
            members: [Some((node, None)), participant.map(|node| (node, Some(CLIENT)))]
                .into_iter()
                .flatten()
                .map(|(node, client)| Member { node, address: ([127, 0, 0, 1], 1).into(), client })
                .collect(),
            tree: world.tree.clone(),
            allocation: [(RegionId(1), node)].into(),
        };
        let mut leader = Leader::new(Duration::ZERO, &view, &world).with_replication_elsewhere();
        if participant.is_none() {
            leader.admit(CLIENT);
        }
        leader.take_interest(CLIENT, None);
        let nodes = [Some(node), participant].into_iter().flatten().collect();
        let mut stage = Self { leader, nodes, tick: 0 };
        stage.done();
        stage
    }

    fn done(&mut self) {
        let (view, tick) = (ViewNumber(1), Tick(self.tick));
        let done = Done {
            view,
            tick,
            rounds_wanted: 1,
            holds: None,
            events: vec![],
            answers: vec![],
            load: None,
            compute_us: 0,
            regions: vec![],
        };
        self.nodes.iter().for_each(|&node| self.leader.done(node, done.clone()));
    }

    /// Completes a tick in which all bodies move and the client acknowledges something. Returns the events of
    /// replication that follow.
    fn tick(&mut self) -> Vec<ReplicationEvent> {
        self.tick += 1;
        self.leader.dispatch(Duration::from_secs(self.tick)).expect("nobody is waited for");
        let states = states(self.tick);
        self.leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(self.tick), states });
        self.done();
        self.leader.heard(CLIENT, Heard { series: 9, datagrams: vec![], lost: false, bytes_per_s: 0 });
        self.leader.take_replication_events()
    }
}

const CLIENT: ClientId = ClientId(7);

/// Returns the states of all bodies after a tick.
fn states(tick: u64) -> Vec<SharedState> {
    let state = |index| SharedState {
        id: BodyId::persistent(index),
        owner: RegionId(1),
        epoch: Epoch(0),
        pose: WorldPose::at([tick as f64, 0.0, 0.0]),
        velocity: Velocity::default(),
        sleeping: false,
    };
    (0..BODIES).map(state).collect()
}

fn guess(tick: u64) -> ReplicationEvent {
    ReplicationEvent::Speculative { tick: Tick(tick), states: states(tick), silent: BTreeSet::new() }
}

fn admit() -> ReplicationEvent {
    ReplicationEvent::Admit { client: CLIENT, turn: 0, told_elsewhere: false, area: None }
}

fn outlet() -> (Net, Outlet, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
    let identity = authority.server_identity().unwrap();
    let listen = ([127, 0, 0, 1], 0).into();
    let config = NetConfig {
        listen,
        identity,
        authority: Some(authority),
        renewed_by: Vec::new(),
        limits: Limits::default(),
    };
    let (net, _) = Net::start(config).unwrap();
    let outlet = Outlet { keys: Keys::default(), datagrams: net.datagrams(), sent: Arc::default() };
    (net, outlet, folder)
}

#[test]
fn a_thread_that_is_held_up_keeps_no_tick_waiting_and_tells_the_newest_states_when_it_goes_on() {
    let (_net, outlet, _folder) = outlet();
    let (told, tells) = mpsc::channel();
    let (open, gate) = mpsc::channel::<()>();
    let fan_out = FanOut::start(outlet, move |message: Told| {
        told.send(message).unwrap();
        let _ = gate.recv();
    })
    .unwrap();
    // If this test fails, this lets the thread go on before the thread is waited for.
    let open = open;
    let mut stage = Stage::new();
    assert!(fan_out.handle(stage.tick()));
    // The thread has begun to tell the first tick, and stands still.
    let first = tells.recv_timeout(PATIENCE).unwrap();
    assert!(
        matches!(first.message, Message::ToClient(_, ToClient::CompactStates { stamp, .. }) if stamp.tick == Tick(1))
    );
    let begin = Instant::now();
    for _ in 0..MANY {
        assert!(fan_out.handle(stage.tick()));
    }
    println!("{:?} for {MANY} ticks", begin.elapsed());
    let waiting = fan_out.inbox.lock().events.len();
    assert!(waiting <= TICKS, "{waiting} events wait");
    assert!(fan_out.ear().waiting() <= HEARD);
    let last = Tick(stage.tick);
    // From here on the thread is never held up.
    drop(open);
    let next = tells.recv_timeout(PATIENCE).unwrap();
    assert!(
        matches!(next.message, Message::ToClient(_, ToClient::CompactStates { stamp, .. }) if stamp.tick == last)
    );
    drop(fan_out);
    assert!(
        tells
            .try_iter()
            .all(|told| matches!(told.message, Message::ToClient(_, ToClient::CompactStates { stamp, .. }) if stamp.tick == last))
    );
}

/// Returns an acknowledgement that is recognised by its series.
fn heard(series: u32) -> Heard {
    Heard { series, datagrams: vec![], lost: false, bytes_per_s: 0 }
}

#[test]
fn a_guess_that_came_true_while_clients_were_told_what_was_before_it_is_told_to_nobody() {
    for came_true in [false, true] {
        let (_net, outlet, _folder) = outlet();
        let (told, tells) = mpsc::channel();
        let (open, gate) = mpsc::channel::<()>();
        let fan_out = FanOut::start(outlet, move |message: Told| {
            told.send(message).unwrap();
            let _ = gate.recv();
        })
        .unwrap();
        // If this test fails, this lets the thread go on before the thread is waited for.
        let open = open;
        let mut stage = Stage::new();
        assert!(fan_out.handle(stage.tick()));
        let next = || {
            let told = tells.recv_timeout(PATIENCE).unwrap();
            let Message::ToClient(_, message) = &told.message else { panic!("there are no relays") };
            let stamp = stamp_of(message).copied();
            stamp.map(|stamp| (stamp.tick, stamp.speculative))
        };
        assert_eq!(next(), Some((Tick(1), false)));
        // The thread takes both at once, and stands still while it tells the first of them.
        let both = stage.tick().into_iter().chain([guess(3)]).collect();
        assert!(fan_out.handle(both));
        loop {
            open.send(()).unwrap();
            if next() == Some((Tick(2), false)) {
                break;
            }
        }
        if came_true {
            assert!(fan_out.handle(stage.tick()));
        }
        drop(open);
        let told =
            std::iter::from_fn(|| Some(next())).find(|told| told.is_some_and(|(tick, _)| tick == Tick(3)));
        assert_eq!(told, Some(Some((Tick(3), !came_true))));
    }
}

#[test]
fn what_is_acknowledged_past_the_leader_counts_as_of_its_newest_tick() {
    let (ear, mut stage) = (Ear::default(), Stage::new());
    for _ in 0..3 {
        stage.tick().into_iter().for_each(|event| ear.0.lock().push(event));
        ear.hear(CLIENT, heard(3));
        let waiting = ear.0.lock();
        assert_eq!(lock(&waiting.heard).of[&CLIENT].back(), Some(&(heard(3), Tick(stage.tick))));
    }
    ear.0.lock().end();
    assert_eq!(ear.waiting(), 0);
    ear.hear(CLIENT, heard(3));
    assert_eq!(ear.waiting(), 0, "nothing is told any more");
}

#[test]
fn of_each_client_the_newest_acknowledgements_wait_whatever_others_say() {
    let (ear, mut stage, other) = (Ear::default(), Stage::new(), ClientId(8));
    stage.tick().into_iter().for_each(|event| ear.0.lock().push(event));
    ear.hear(other, heard(1));
    (1..=MANY as u32).for_each(|series| ear.hear(CLIENT, heard(series)));
    ear.hear(other, heard(2));
    let (events, heard_of_all) = ear.0.lock().take();
    let taken = in_order(events, heard_of_all);
    let of = |who| {
        let series = |event: &ReplicationEvent| match event {
            ReplicationEvent::Heard { client, heard, .. } if *client == who => Some(heard.series),
            _ => None,
        };
        taken.iter().filter_map(series).collect::<Vec<_>>()
    };
    assert_eq!(of(other), [1, 2]);
    assert_eq!(of(CLIENT), ((MANY - HEARD) as u32 + 1..=MANY as u32).collect::<Vec<_>>());
    let is_heard = |event: &ReplicationEvent| matches!(event, ReplicationEvent::Heard { .. });
    let is_tick = |event: &ReplicationEvent| matches!(event, ReplicationEvent::Tick(_));
    assert!(taken.iter().rposition(is_heard) < taken.iter().position(is_tick), "they count for this tick");
    // What came over a former link is about what does not count any more.
    ear.hear(CLIENT, heard(1));
    ear.hear(other, heard(1));
    ear.0.lock().push(admit());
    assert_eq!(ear.waiting(), 1);
}

#[test]
fn what_is_acknowledged_to_a_process_that_does_not_lead_is_dropped() {
    let (ear, mut stage) = (Ear::default(), Stage::new());
    ear.hear(CLIENT, heard(1));
    assert_eq!(ear.waiting(), 0, "it does not lead yet");
    stage.tick().into_iter().for_each(|event| ear.0.lock().push(event));
    ear.0.lock().take();
    ear.hear(CLIENT, heard(1));
    assert_eq!(ear.waiting(), 1);
    ear.0.lock().push(ReplicationEvent::End);
    assert_eq!(ear.waiting(), 0, "it leads no more");
    ear.hear(CLIENT, heard(1));
    assert_eq!(ear.waiting(), 0);
}

#[test]
fn a_participant_whose_link_is_made_anew_is_told_on() {
    let (net, outlet, _folder) = outlet();
    let (keys, sent) = (outlet.keys.clone(), outlet.sent.clone());
    let fan_out = FanOut::start(outlet, |_| ()).unwrap();
    let mut stage = Stage::with(Some(NodeId(2)));
    for link in 1..=2 {
        // Nobody answers there, but each connection has a key of its own.
        let key = net.connect(([127, 0, 0, 1], 1).into(), crate::net::PeerName::Server);
        keys.write().unwrap().insert(Peer::Node(NodeId(2)), key);
        let before = *sent.lock().unwrap();
        let begun = Instant::now();
        while *sent.lock().unwrap() == before {
            assert!(begun.elapsed() < PATIENCE, "nothing more is sent over link {link}");
            fan_out.handle(stage.tick());
            std::thread::yield_now();
        }
    }
}

#[test]
fn what_waits_is_told_before_it_ends() {
    let (_net, outlet, _folder) = outlet();
    let (told, tells) = mpsc::channel();
    let fan_out = FanOut::start(outlet, move |message: Told| told.send(message).unwrap()).unwrap();
    let mut stage = Stage::new();
    fan_out.handle(stage.tick());
    drop(fan_out);
    let is_of_states =
        |told: Told| matches!(told.message, Message::ToClient(_, ToClient::CompactStates { .. }));
    assert!(tells.try_iter().any(is_of_states));
}

#[test]
fn few_ticks_wait_and_who_tells_clients_makes_one_of_them() {
    let (mut waiting, mut stage) = (Waiting::default(), Stage::new());
    let ticks = |events: &VecDeque<ReplicationEvent>| {
        let tick = |event: &ReplicationEvent| match event {
            ReplicationEvent::Tick(news) => Some(news.tick().0),
            _ => None,
        };
        events.iter().filter_map(tick).collect::<Vec<_>>()
    };
    for _ in 0..10 {
        stage.tick().into_iter().for_each(|event| waiting.push(event));
    }
    assert_eq!(ticks(&waiting.events), [0, 1, 2, 10], "the newest states alone remain");
    make_one_tick(&mut waiting.events);
    assert_eq!(ticks(&waiting.events), [10]);
    assert!(
        matches!(
            waiting.events.make_contiguous(),
            [
                ReplicationEvent::Begin(_),
                ReplicationEvent::Admit { client: CLIENT, .. },
                ..,
                ReplicationEvent::Tick(_)
            ]
        ),
        "all else stays, and it is in the last one's place"
    );
    assert_eq!(lock(&waiting.heard).of[&CLIENT].len(), 10);
}

#[test]
fn of_guesses_the_newest_waits_and_what_comes_true_takes_its_place() {
    let mut waiting = Waiting::default();
    for tick in 1..=3 {
        waiting.push(guess(tick));
    }
    assert!(matches!(
        waiting.events.make_contiguous(),
        [ReplicationEvent::Speculative { tick: Tick(3), .. }]
    ));
    let mut stage = Stage::new();
    let news = stage.tick().into_iter().find(|event| matches!(event, ReplicationEvent::Tick(_))).unwrap();
    waiting.push(news);
    assert!(matches!(waiting.events.make_contiguous(), [ReplicationEvent::Tick(_)]));
    waiting.push(guess(5));
    waiting.end();
    assert!(matches!(waiting.events.make_contiguous(), [ReplicationEvent::Tick(_)]), "and none at the end");
}

/// Holds up a relay's thread while its leader tells it many ticks. Then the relay must read all of them, in
/// order, tell only the newest states, and report that it has read them.
#[test]
fn a_relay_whose_thread_was_held_up_reads_all_and_tells_the_newest() {
    let mut stage = Stage::new();
    let mut begin = None;
    let is_begin = |event: &ReplicationEvent| matches!(event, ReplicationEvent::Begin(_));
    if let Some(ReplicationEvent::Begin(new)) = stage.tick().into_iter().find(is_begin) {
        begin = Some(new);
    }
    let mut leader = begin.unwrap();
    let (_net, outlet, _folder) = outlet();
    let (told, tells) = mpsc::channel();
    let (open, gate) = mpsc::channel::<()>();
    let relay = FanOut::start(outlet, move |message: Told| {
        told.send(message).unwrap();
        let _ = gate.recv();
    })
    .unwrap();
    // If this test fails, this lets the thread go on before the thread is waited for.
    let open = open;
    relay.handle(vec![ReplicationEvent::Begin(leader.clone())]);
    leader.handle(ReplicationEvent::Relay { client: CLIENT, node: NodeId(2), turn: 1, area: None });
    let mut last = 0;
    let mut tick = |stage: &mut Stage| {
        let is_tick = |event: &ReplicationEvent| matches!(event, ReplicationEvent::Tick(_));
        stage.tick().into_iter().filter(is_tick).for_each(|event| leader.handle(event));
        for (_, message) in leader.take_member_messages() {
            let Message::Relay(message) = message else { panic!("{message:?}") };
            if let ToRelay::News(news) = &message {
                last = news.number;
            }
            assert!(relay.handle(vec![ReplicationEvent::ByLeader(message)]));
        }
        last
    };
    tick(&mut stage);
    let stamp = |told: &Told| match &told.message {
        Message::ToClient(_, message) => stamp_of(message).copied(),
        _ => None,
    };
    let first = tells.recv_timeout(PATIENCE).unwrap();
    assert_eq!(stamp(&first).map(|stamp| stamp.tick), Some(Tick(stage.tick)), "{:?}", first.message);
    let number = (0..40).map(|_| tick(&mut stage)).max().unwrap();
    let newest = Tick(stage.tick);
    drop(open);
    let is_newest = |stamp: &Stamp| stamp.tick == newest || stamp.tick == Tick(2);
    let (mut is_told, mut is_read) = (false, false);
    while !(is_told && is_read) {
        let told = tells.recv_timeout(PATIENCE).unwrap();
        match &told.message {
            Message::Fed { number: read, .. } => is_read = *read == number,
            _ => is_told |= stamp(&told).filter(is_newest).expect("no other is told").tick == newest,
        }
    }
}

#[test]
fn what_a_leader_tells_its_relay_beyond_all_bounds_is_dropped() {
    let mut waiting = Waiting::default();
    for number in 0..100 {
        let states = vec![0; 1 << 20];
        let news = RelayNews { number, follows: number, states, ..RelayNews::default() };
        waiting.push(ReplicationEvent::ByLeader(ToRelay::News(Box::new(news))));
    }
    assert!(waiting.fed_bytes() <= FED + (1 << 20) && waiting.events.len() < 70);
}
