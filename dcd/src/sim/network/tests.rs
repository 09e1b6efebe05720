//! Tests the network alone: which messages arrive, in which order, and when links end.

use super::*;
use crate::protocol::link::{
    CLIENT_IDLE_TIMEOUT, CLIENT_KEEP_ALIVE, FIRST_PROBE, HANDSHAKE_TIMEOUT, IDLE_TIMEOUT,
};
use crate::space::ClientId;

const A: Peer = Peer::Node(NodeId(1));
const B: Peer = Peer::Node(NodeId(2));
const C: Peer = Peer::Client(ClientId(1));
const MS: Duration = Duration::from_millis(1);
/// A silence that ends no link: an end may have heard the last keep-alive a while before, and hears the next
/// a while after.
const SHORT: Duration =
    Duration::from_millis((IDLE_TIMEOUT.as_millis() - 2 * KEEP_ALIVE.as_millis()) as u64 - 10);

struct World {
    network: Network,
    now: Duration,
    /// What arrived: when, at which process, and what.
    log: Vec<(Duration, Peer, Arrival)>,
}

impl World {
    fn new(conditions: NetworkConditions, seed: u64) -> Self {
        Self::bounded(conditions, Bounds::default(), seed)
    }

    fn bounded(conditions: NetworkConditions, bounds: Bounds, seed: u64) -> Self {
        let mut network = Network::new(conditions, bounds, seed);
        [A, B, C].into_iter().for_each(|peer| network.start(Duration::ZERO, peer));
        Self { network, now: Duration::ZERO, log: Vec::new() }
    }

    /// Creates a world in which two processes have a link, at 100 ms.
    fn linked(conditions: NetworkConditions, seed: u64) -> Self {
        let mut world = Self::new(conditions, seed);
        world.network.dial(Duration::ZERO, A, B);
        world.run_to(100 * MS);
        assert_eq!(world.told(A, true), 1);
        assert_eq!(world.told(B, true), 1);
        world
    }

    fn run_to(&mut self, end: Duration) {
        while self.network.next_time().is_some_and(|time| time <= end) {
            self.now = self.network.next_time().unwrap();
            self.network.step();
            self.collect(true);
        }
        self.now = end;
    }

    fn collect(&mut self, reads: bool) {
        while let Some(delivery) = self.network.take() {
            if reads {
                self.network.read(&delivery);
            }
            self.log.push((self.now, delivery.to, delivery.arrival));
        }
    }

    fn send(&mut self, from: Peer, to: Peer, lane: Lane, number: u8) {
        self.network.send(self.now, from, to, lane, vec![number; 100]);
        self.collect(true);
    }

    fn frames(&self, to: Peer, datagrams: bool) -> Vec<u8> {
        let number = |(_, at, arrival): &(Duration, Peer, Arrival)| match arrival {
            Arrival::Frame(_, bytes, datagram) if *at == to && *datagram == datagrams => Some(bytes[0]),
            _ => None,
        };
        self.log.iter().filter_map(number).collect()
    }

    /// Returns how often a process heard that a link began, or ended.
    fn told(&self, who: Peer, connected: bool) -> usize {
        let is_it = |arrival: &Arrival| match arrival {
            Arrival::Connected(_) => connected,
            Arrival::Disconnected(_) | Arrival::Unanswered(_) => !connected,
            _ => false,
        };
        self.log.iter().filter(|(_, to, arrival)| *to == who && is_it(arrival)).count()
    }

    fn ended(&self, who: Peer) -> Option<Duration> {
        let is_it = |(_, to, arrival): &&(Duration, Peer, Arrival)| {
            *to == who && matches!(arrival, Arrival::Disconnected(_) | Arrival::Unanswered(_))
        };
        self.log.iter().find(is_it).map(|(time, ..)| *time)
    }
}

fn calm() -> NetworkConditions {
    NetworkConditions::calm(Path::up_to(2_000))
}

#[test]
fn frames_arrive_once_and_in_order_whatever_is_lost_doubled_or_overtaken() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        world.network.conditions = NetworkConditions { loss: 0.2, reorder: 0.2, duplicate: 0.2, ..calm() };
        for number in 0..100 {
            world.send(A, B, Lane::Control, number);
            world.send(A, B, Lane::State, number);
            world.run_to(world.now + 5 * MS);
        }
        world.run_to(world.now + 2_000 * MS);
        assert_eq!(world.frames(B, false), (0..100).collect::<Vec<_>>(), "seed {seed}");
        let datagrams = world.frames(B, true);
        assert!(!datagrams.is_sorted(), "seed {seed}: some are overtaken");
        let distinct: BTreeSet<_> = datagrams.iter().collect();
        assert!((60..95).contains(&distinct.len()), "seed {seed}: {} of 100 arrive", distinct.len());
        assert!(datagrams.len() > distinct.len(), "seed {seed}: some arrive twice");
    }
}

#[test]
fn loss_shows_as_delay_on_reliable_lanes() {
    let mut world = World::linked(calm(), 1);
    world.network.conditions.loss = 1.0;
    world.send(A, B, Lane::Border, 1);
    world.run_to(150 * MS);
    world.network.conditions.loss = 0.0;
    assert!(world.frames(B, false).is_empty());
    world.run_to(450 * MS);
    assert_eq!(world.frames(B, false), [1]);
}

#[test]
fn a_cut_shorter_than_the_time_out_ends_no_link_and_loses_no_frame() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        for cut in Cut::between(A, B, world.now + SHORT) {
            world.network.cut(world.now, cut);
        }
        world.send(A, B, Lane::Control, 1);
        world.send(B, A, Lane::State, 2);
        world.run_to(100 * MS + SHORT);
        assert!(world.frames(B, false).is_empty());
        world.run_to(3_000 * MS);
        assert_eq!((world.told(A, false), world.told(B, false)), (0, 0), "seed {seed}");
        assert_eq!((world.frames(B, false), world.frames(A, true)), (vec![1], vec![]));
    }
}

#[test]
fn a_longer_cut_ends_the_link_at_both_ends_and_loses_what_was_under_way() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        for cut in Cut::between(A, B, world.now + 5_000 * MS) {
            world.network.cut(world.now, cut);
        }
        world.send(A, B, Lane::Control, 1);
        world.run_to(10_000 * MS);
        for end in [A, B] {
            let after = world.ended(end).unwrap() - 100 * MS;
            assert!(after >= IDLE_TIMEOUT - KEEP_ALIVE && after <= IDLE_TIMEOUT, "seed {seed}: {after:?}");
            assert_eq!(world.told(end, false), 1);
        }
        assert!(world.frames(B, false).is_empty());
    }
}

#[test]
fn of_a_one_way_cut_the_deaf_end_ends_first_and_the_other_by_its_own_time_out() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        let until = world.now + 10_000 * MS;
        world.network.cut(world.now, Cut { from: Who::one(A), to: Who::one(B), until });
        world.send(B, A, Lane::Control, 1);
        world.run_to(10_000 * MS);
        let (a, b) = (world.ended(A).unwrap() - 100 * MS, world.ended(B).unwrap() - 100 * MS);
        assert!(b <= IDLE_TIMEOUT, "seed {seed}: {b:?}");
        assert!(a >= b + IDLE_TIMEOUT - KEEP_ALIVE && a <= b + IDLE_TIMEOUT, "seed {seed}: {a:?} {b:?}");
        assert_eq!(world.frames(A, false), [1], "the open way carries until then");
    }
}

#[test]
fn once_the_way_is_open_a_reset_tells_the_other_end() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        let until = world.now + 1_600 * MS;
        world.network.cut(world.now, Cut { from: Who::one(A), to: Who::one(B), until });
        world.run_to(10_000 * MS);
        let a = world.ended(A).unwrap() - 100 * MS;
        assert!(a <= 1_600 * MS + KEEP_ALIVE + 10 * MS, "seed {seed}: {a:?}");
        assert_eq!((world.told(A, false), world.told(B, false)), (1, 1));
    }
}

#[test]
fn a_call_that_nobody_answers_ends_with_the_time_out() {
    let mut world = World::new(calm(), 1);
    world.network.crash(Duration::ZERO, B);
    world.network.dial(Duration::ZERO, A, B);
    world.network.send(Duration::ZERO, A, B, Lane::Control, vec![1]);
    world.run_to(5_000 * MS);
    assert_eq!((world.ended(A), world.told(A, true)), (Some(HANDSHAKE_TIMEOUT), 0));
}

#[test]
fn a_first_packet_is_sent_again_after_a_while_and_then_each_time_after_twice_as_long() {
    let connected =
        |heals_ms: u64| {
            let mut world = World::new(calm(), 1);
            for cut in Cut::between(A, B, Duration::from_millis(heals_ms)) {
                world.network.cut(Duration::ZERO, cut);
            }
            world.network.dial(Duration::ZERO, A, B);
            world.run_to(5_000 * MS);
            world.log.iter().find(|(_, to, _)| *to == A).map(|(time, _, arrival)| {
                (time.as_millis() / 50 * 50, matches!(arrival, Arrival::Connected(_)))
            })
        };
    assert_eq!(FIRST_PROBE, 300 * MS);
    let heals_ms = [0, 290, 310, 890, 910, 2_090, 2_110];
    let answered_ms = [0, 300, 900, 900, 2_100, 2_100].map(|ms| Some((ms, true)));
    assert_eq!(heals_ms.map(connected)[..6], answered_ms);
    assert_eq!(connected(2_110), Some((2_500, false)));
}

#[test]
fn what_was_sent_before_the_link_was_up_follows_it() {
    let mut world = World::new(calm(), 1);
    world.network.dial(Duration::ZERO, A, B);
    world.send(B, A, Lane::Control, 1);
    world.send(A, B, Lane::Border, 2);
    world.run_to(100 * MS);
    assert_eq!((world.frames(A, false), world.frames(B, false)), (vec![1], vec![2]));
}

#[test]
fn closing_lets_what_was_sent_arrive_first() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        world.network.conditions.loss = 0.1;
        (1..=5).for_each(|number| world.send(A, B, Lane::Control, number));
        world.network.close(world.now, A, B);
        world.run_to(3_000 * MS);
        assert_eq!((world.told(A, false), world.told(B, false)), (0, 1), "seed {seed}");
        let last = world.log.last().unwrap();
        assert!(matches!(last, (_, B, Arrival::Disconnected(A))), "seed {seed}");
        assert!([1, 2, 3, 4, 5].starts_with(&world.frames(B, false)), "seed {seed}");
    }
}

#[test]
fn of_two_links_of_the_same_two_the_newer_counts() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        world.network.dial(world.now, A, B);
        world.run_to(1_000 * MS);
        world.send(A, B, Lane::Control, 1);
        world.run_to(9_000 * MS);
        assert_eq!([world.told(A, true), world.told(B, true)], [2, 2]);
        assert_eq!(world.told(B, false), 0, "who is called again is not told of the former link's end");
        let last = world.log.iter().rfind(|(_, to, _)| *to == A).unwrap();
        assert!(matches!(last.2, Arrival::Connected(B)), "seed {seed}: {last:?}");
        assert_eq!(world.frames(B, false), [1]);
        assert_eq!(world.network.links.len(), 1, "seed {seed}");
    }
}

#[test]
fn the_links_of_a_dead_process_end_by_time_out_or_sooner() {
    let mut quick = 0;
    for seed in 0..100 {
        let mut world = World::linked(calm(), seed);
        world.network.crash(world.now, A);
        world.run_to(5_000 * MS);
        let after = world.ended(B).unwrap() - 100 * MS;
        assert!(after <= IDLE_TIMEOUT);
        quick += u32::from(after < 50 * MS);
        assert!(world.network.links.is_empty(), "seed {seed}");
    }
    assert!((10..50).contains(&quick), "{quick} of 100");
}

#[test]
fn the_links_of_a_client_end_by_a_longer_time_out() {
    for (dead, lives) in [(C, B), (B, C)] {
        for seed in 0..50 {
            let mut world = World::new(calm(), seed);
            world.network.dial(Duration::ZERO, C, B);
            world.run_to(100 * MS);
            world.network.crash(world.now, dead);
            world.run_to(20_000 * MS);
            let after = world.ended(lives).unwrap() - 100 * MS;
            let in_time = CLIENT_IDLE_TIMEOUT - CLIENT_KEEP_ALIVE..=CLIENT_IDLE_TIMEOUT;
            assert!(after < 50 * MS || in_time.contains(&after), "seed {seed}: {after:?}");
            assert!(world.network.links.is_empty(), "seed {seed}");
        }
    }
}

#[test]
fn a_client_learns_by_what_it_sends_or_by_its_keep_alive_that_its_peer_was_started_again() {
    for (seed, sends) in (0..50).flat_map(|seed| [(seed, true), (seed, false)]) {
        let mut world = World::new(calm(), seed);
        world.network.dial(Duration::ZERO, C, B);
        world.run_to(100 * MS);
        world.network.crash(world.now, B);
        world.run_to(500 * MS);
        world.network.start(world.now, B);
        if sends && world.ended(C).is_none() {
            world.send(C, B, Lane::Control, 1);
        }
        world.run_to(9_000 * MS);
        let within = if sends { 10 * MS } else { CLIENT_KEEP_ALIVE + 10 * MS };
        let ended = world.ended(C).unwrap();
        assert!(ended <= 500 * MS + within, "seed {seed}, sends {sends}: {ended:?}");
        assert!(world.frames(B, false).is_empty(), "the one that is back knows of no link");
    }
}

#[test]
fn who_was_stopped_for_long_has_lost_its_links_and_hears_of_it_before_or_after_what_it_finds() {
    let (mut before, mut after) = (0, 0);
    for seed in 0..100 {
        let mut world = World::linked(calm(), seed);
        world.network.stop(world.now, A);
        world.run_to(5_000 * MS);
        assert!(world.ended(B).unwrap() - 100 * MS <= IDLE_TIMEOUT);
        let ended = world.network.resume(world.now, A);
        world.collect(true);
        match ended.len() {
            1 => before += 1,
            _ => after += 1,
        }
        world.run_to(10_000 * MS);
        assert_eq!(world.told(A, false), 1, "seed {seed}");
        assert!(world.ended(A).unwrap() <= 5_000 * MS + 2 * KEEP_ALIVE, "seed {seed}");
    }
    assert!(before > 20 && after > 20, "{before} {after}");
}

#[test]
fn when_both_ends_are_stopped_one_after_the_other_both_keep_the_link_or_both_lose_it() {
    let mut kept = 0;
    for seed in 0..200 {
        let mut world = World::linked(calm(), seed);
        world.network.stop(world.now, A);
        world.run_to(world.now + 500 * MS);
        world.network.stop(world.now, B);
        world.run_to(world.now + 5_000 * MS);
        for peer in [A, B] {
            world.network.resume(world.now, peer);
            world.collect(true);
            world.run_to(world.now + 500 * MS);
        }
        world.run_to(world.now + 3_000 * MS);
        assert_eq!(world.told(A, false), world.told(B, false), "seed {seed}");
        kept += usize::from(world.network.is_linked(A, B));
    }
    assert!((1..200).contains(&kept), "{kept} of 200 kept the link");
}

#[test]
fn a_short_stop_ends_no_link() {
    for seed in 0..50 {
        let mut world = World::linked(calm(), seed);
        world.network.stop(world.now, A);
        world.run_to(world.now + SHORT);
        world.network.resume(world.now, A);
        world.run_to(9_000 * MS);
        assert_eq!((world.told(A, false), world.told(B, false)), (0, 0), "seed {seed}");
    }
}

#[test]
fn a_reader_that_does_not_read_is_given_up_at_the_bound_and_datagrams_are_dropped() {
    let bounds =
        Bounds { inbox_bytes: 1_000, client_queue_bytes: 2_000, datagram_bytes: 500, ..Bounds::default() };
    let mut world = World::bounded(calm(), bounds, 1);
    world.network.dial(Duration::ZERO, C, A);
    world.run_to(100 * MS);
    for number in 0..200 {
        world.network.send(world.now, A, C, Lane::Control, vec![number; 100]);
        world.network.send(world.now, A, C, Lane::State, vec![number; 100]);
        while world.network.next_time().is_some_and(|time| time <= world.now + 5 * MS) {
            world.network.step();
            world.collect(false);
        }
        world.now += 5 * MS;
    }
    assert_eq!(world.frames(C, true).len(), 5, "what fits into the inbox");
    assert_eq!(world.frames(C, false).len(), 30, "what fits into inbox and queue");
    assert_eq!((world.told(A, false), world.told(C, false)), (1, 1));
    let traffic = world.network.traffic();
    assert_eq!((traffic.overflows, traffic.most_queued_for_client), (1, 2_000));
}

#[test]
fn sites_are_far_from_one_another_and_the_server_is_where_it_is() {
    let mut conditions = calm();
    conditions.far = Path { base_us: 60_000, jitter_us: 0 };
    conditions.sites = [(B, 1)].into();
    assert_eq!(conditions.path(A, C), calm().near);
    assert_eq!(conditions.path(A, B).base_us, 60_000);
    let server = conditions.path(Peer::Server, B);
    assert_eq!(server, conditions.far);
    conditions.server = Some(Path { base_us: 5_000, jitter_us: 0 });
    assert_eq!(
        [(Peer::Server, B), (B, Peer::Server)].map(|(a, b)| conditions.path(a, b).base_us),
        [5_000; 2]
    );
}

#[test]
fn the_last_packets_of_a_dead_process_do_not_keep_its_link() {
    for seed in 0..50 {
        let mut world = World::linked(NetworkConditions::calm(Path { base_us: 20_000, jitter_us: 0 }), seed);
        world.send(A, B, Lane::Control, 1);
        world.send(A, B, Lane::State, 2);
        world.network.crash(world.now, A);
        world.run_to(5_000 * MS);
        assert_eq!(world.told(B, false), 1, "seed {seed}");
    }
}
