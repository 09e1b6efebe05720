//! Tests a leader's replication together with that of its relay, over links of all widths.

use std::collections::VecDeque;

use super::*;
use crate::delta::Receiver;
use crate::protocol::{Velocity, WorldPose, encoded_len};
use crate::sim::{Random, sim_world};
use crate::space::{Epoch, RegionId};

const LEADER: NodeId = NodeId(1);
const RELAY: NodeId = NodeId(2);
const CLIENT: ClientId = ClientId(7);
const BODIES: u32 = 800;
/// The number of ticks that an acknowledgement takes.
const BACK_TICKS: u64 = 2;
/// More bytes than one tick's news take on the link.
const NEWS_BYTES: usize = 32 << 10;

fn state(id: BodyId, tick: u64, at: [f64; 3]) -> (BodyId, (SharedState, Tick)) {
    let (owner, epoch, pose) = (RegionId(1), Epoch(0), WorldPose::at(at));
    let velocity = Velocity::default();
    (id, (SharedState { id, owner, epoch, pose, velocity, sleeping: false }, Tick(tick)))
}

/// A leader, its relay, and the link between them, which carries a number of bytes per tick.
struct Stage {
    leader: StateReplication,
    relay: StateReplication,
    tick: u64,
    carried: usize,
    credit: usize,
    link: VecDeque<ToRelay>,
    back: VecDeque<(u64, Message)>,
    /// Messages for the client, by whom they come.
    by_leader: Vec<ToClient>,
    by_relay: Vec<ToClient>,
    most_waiting: usize,
    news: usize,
}

impl Stage {
    fn new(carried: usize) -> Self {
        let world = sim_world(1);
        let member = |node| Member { node, address: ([127, 0, 0, 1], 1).into(), client: None };
        let view = View {
            events: false,
            viewpoints: Vec::new(),
            group: GroupId(1),
            number: ViewNumber(1),
            tick: Tick(0),
            leader: LEADER,
            members: [LEADER, RELAY].map(member).into(),
            tree: world.tree.clone(),
            allocation: [(RegionId(1), LEADER)].into(),
        };
        let new = || StateReplication::new(Duration::ZERO, &view, &world, &BTreeMap::new());
        Self {
            leader: new(),
            relay: new(),
            tick: 0,
            carried,
            credit: 0,
            link: VecDeque::new(),
            back: VecDeque::new(),
            by_leader: Vec::new(),
            by_relay: Vec::new(),
            most_waiting: 0,
            news: 0,
        }
    }

    fn relays(&mut self, turn: u32, area: Option<Area>) {
        self.leader.handle(ReplicationEvent::Relay { client: CLIENT, node: RELAY, turn, area });
    }

    /// Completes a tick, and lets the link carry what it can meanwhile.
    fn tick(&mut self, news: TickNews, moved: Latest) {
        self.tick += 1;
        let opened = Duration::from_millis(16 * self.tick);
        self.leader.handle(ReplicationEvent::Tick(news.after(Tick(self.tick), opened, false, moved)));
        self.by_leader.extend(self.leader.take_messages().into_iter().map(|(_, message)| message));
        for (to, message) in self.leader.take_member_messages() {
            let Message::Relay(message) = message else { panic!("{message:?}") };
            assert_eq!(to, RELAY);
            self.news += 1;
            self.link.push_back(message);
        }
        let waiting = self.link.iter().map(encoded_len).sum();
        self.most_waiting = self.most_waiting.max(waiting);
        self.credit = self.credit.saturating_add(self.carried);
        while let Some(message) = self.link.pop_front_if(|message| encoded_len(message) <= self.credit) {
            self.credit -= encoded_len(&message);
            self.relay.handle(ReplicationEvent::ByLeader(message));
        }
        if self.link.is_empty() {
            self.credit = 0;
        }
        self.by_relay.extend(self.relay.take_messages().into_iter().map(|(_, message)| message));
        for (to, message) in self.relay.take_member_messages() {
            assert_eq!(to, LEADER);
            self.back.push_back((self.tick + BACK_TICKS, message));
        }
        while let Some((_, message)) = self.back.pop_front_if(|(at, _)| *at <= self.tick) {
            let Message::Fed { number, .. } = message else { panic!("{message:?}") };
            self.leader.handle(ReplicationEvent::Fed { node: RELAY, number });
        }
    }

    fn ticks(&mut self, count: u64) {
        (0..count).for_each(|_| self.tick(TickNews::default(), Latest::new()));
    }
}

fn places(latest: &Latest) -> BTreeMap<BodyId, [i64; 3]> {
    let mm = |at: f64| (1_000.0 * at).round() as i64;
    latest.iter().map(|(&id, (state, _))| (id, state.pose.translation.map(mm))).collect()
}

/// All bodies move, some go and some come again, inputs are applied and interests change, and the link
/// carries all, a third, or a fifth. The relay comes to know all that it must, however late, and the link
/// never has much to carry.
#[test]
fn a_relay_behind_a_narrow_link_is_told_the_newest_of_everything() {
    for (carried, all) in [(usize::MAX, true), (2 << 10, false), (1_200, false)] {
        let mut random = Random::new(carried as u64);
        let mut stage = Stage::new(carried);
        let ids: Vec<_> = (0..BODIES).map(BodyId::persistent).collect();
        let place = |random: &mut Random| [0; 3].map(|_: i32| (128.0 * random.unit()).round());
        stage.relays(1, None);
        let mut gone = BTreeSet::new();
        for round in 1..=150 {
            let mut news = TickNews::default();
            let dies = ids[random.below(BODIES.into()) as usize];
            if gone.insert(dies) {
                news.is_gone(dies);
            }
            if round % 7 == 0 {
                gone.pop_first();
            }
            news.has_applied(CLIENT, (round, 3));
            news.interested(
                CLIENT,
                (round % 2 == 0).then_some(Area { centre: [0.0; 3], radius_m: round as f64 }),
            );
            let alive = ids.iter().filter(|id| !gone.contains(id));
            let moved = alive.map(|&id| state(id, round, place(&mut random))).collect();
            stage.tick(news, moved);
        }
        assert!(stage.most_waiting < (256 << 10) + NEWS_BYTES, "{} bytes wait", stage.most_waiting);
        assert_eq!(stage.news == 150, all, "{} are told of 150 ticks", stage.news);
        stage.ticks(400);
        assert_eq!(places(&stage.relay.latest), places(&stage.leader.latest), "at {carried} bytes per tick");
        assert_eq!(stage.relay.applied[&CLIENT], (150, 3));
        assert_eq!(stage.relay.audiences[&CLIENT].radius_m(), 150.0);
        assert_eq!(stage.relay.tick, Tick(550));
    }
}

#[test]
fn guesses_do_not_pile_up_before_a_relay_that_takes_in_nothing() {
    let mut stage = Stage::new(0);
    stage.relays(1, None);
    stage.ticks(1);
    let states: Vec<_> = (0..100).map(|id| state(BodyId::persistent(id), 3, [1.0; 3]).1.0).collect();
    for _ in 0..100 {
        let (tick, silent) = (Tick(3), BTreeSet::new());
        stage.leader.handle(ReplicationEvent::Speculative { tick, states: states.clone(), silent });
    }
    let bytes: usize = stage.leader.take_member_messages().iter().map(|(_, m)| encoded_len(m)).sum();
    assert!(bytes > 1_000 && bytes < 16 << 10, "{bytes} bytes wait");
}

/// Everything on its way is lost with the link, and the next message comes over another: it refers to what
/// the relay never had.
#[test]
fn a_relay_that_has_missed_something_tells_nothing_until_it_begins_anew() {
    let mut stage = Stage::new(usize::MAX);
    let moved =
        |tick| (0..9).map(|id| state(BodyId::persistent(id), tick, [tick as f64, 0.0, 0.0])).collect();
    stage.relays(1, None);
    stage.tick(TickNews::default(), moved(1));
    assert!(!std::mem::take(&mut stage.by_relay).is_empty());
    stage.leader.handle(ReplicationEvent::Tick(TickNews::default().after(
        Tick(2),
        Duration::ZERO,
        false,
        moved(2),
    )));
    drop(stage.leader.take_member_messages());
    stage.tick = 2;
    stage.tick(TickNews::default(), moved(3));
    stage.tick(TickNews::default(), moved(4));
    assert!(stage.by_relay.is_empty(), "{:?}", stage.by_relay);
    assert!(stage.back.len() < 2, "nor does it say that it has read it");
}

/// While nobody hears the relay, bodies leave a client's area in all ways: by a jump, fast and at once
/// asleep, slowly, and twice.
#[test]
fn whoever_tells_a_client_after_a_silent_relay_tells_what_has_left_its_area_meanwhile() {
    let area = Area { centre: [0.0; 3], radius_m: 10.0 };
    let ways: [fn(u64) -> f64; 5] = [
        |tick| if tick < 100 { 2.0 } else { 4_000.0 },
        |tick| 1.0 * tick.clamp(100, 300) as f64 - 100.0,
        |tick| 0.03 * tick as f64,
        |tick| [900.0, 3.0, -700.0][(tick as usize / 90).min(2)],
        // This one was never near.
        |tick| 500.0 + tick as f64,
    ];
    let mut stage = Stage::new(usize::MAX);
    let place =
        |at: u64, tick: u64| state(BodyId::persistent(at as u32), tick, [ways[at as usize](tick), 0.0, 0.0]);
    let tell = |stage: &mut Stage| {
        let tick = stage.tick + 1;
        let has_moved = |at: &u64| tick == 1 || ways[*at as usize](tick) != ways[*at as usize](tick - 1);
        let moved = (0..5).filter(has_moved).map(|at| place(at, tick)).collect();
        stage.tick(TickNews::default(), moved);
    };
    tell(&mut stage);
    stage.relays(1, Some(area));
    (0..600).for_each(|_| tell(&mut stage));
    stage.by_leader.clear();
    let area = Some(Some(area));
    stage.leader.handle(ReplicationEvent::Admit { client: CLIENT, turn: 2, told_elsewhere: true, area });
    tell(&mut stage);
    let mut receiver = Receiver::default();
    receiver.set_motion(stage.leader.motion);
    let mut told = BTreeSet::new();
    for message in &stage.by_leader {
        if let ToClient::CompactStates { stamp, part } = message {
            let states = receiver.take_in(Duration::ZERO, stamp.tick, part, false).unwrap();
            told.extend(states.iter().map(|state| state.id.index()));
        }
    }
    assert_eq!(told, (0..4).collect());
}
