//! Tests what a leader holds for a client that does not acknowledge what it is told, and what it tells it
//! when it does again.

use std::collections::VecDeque;

use super::*;

const BODIES: u32 = 1_000;
/// The most bytes that may be held beside what each body takes.
const MOST_BYTES: usize = 64 << 10;
/// The most bytes that a body takes: the newest state that was acknowledged and four later ones, a hundred
/// bytes each.
const BODY_BYTES: usize = 540;

/// A leader of a thousand bodies that move in every tick, and its client, whose acknowledgements take a fifth
/// of a second.
struct Told {
    leader: Leader,
    random: crate::sim::Random,
    tick: u64,
    come: VecDeque<(u64, Heard)>,
}

impl Told {
    fn new() -> Self {
        let mut leader = leader();
        leader.take_messages();
        Self { leader, random: crate::sim::Random::new(5), tick: 0, come: VecDeque::new() }
    }

    /// Plays ticks. The client acknowledges the datagrams for which `hears` returns true. Returns the most
    /// bytes that were held of bodies, and the most of the rest.
    fn play(&mut self, ticks: u64, hears: impl Fn(u64, u32) -> bool) -> (usize, usize) {
        let mut most = (0, 0);
        for _ in 0..ticks {
            self.tick += 1;
            let tick = self.tick;
            self.leader.dispatch(Duration::from_millis(17 * tick)).unwrap();
            let random = &mut self.random;
            let mut state = |i| SharedState {
                id: BodyId::persistent(i),
                owner: RegionId(1),
                epoch: crate::space::Epoch(0),
                pose: WorldPose::at([tick as f64, random.unit(), random.unit()]),
                velocity: Velocity::default(),
                sleeping: false,
            };
            let states = (0..BODIES).map(&mut state).collect();
            if tick.is_multiple_of(3) {
                self.leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
            }
            both_done(&mut self.leader, tick, vec![], vec![]);
            for (_, message) in self.leader.take_messages() {
                let ToClient::CompactStates { part, .. } = message else { continue };
                if hears(tick, part.number) {
                    let datagrams = vec![(part.number, 1)];
                    let heard = Heard { series: part.series, datagrams, lost: false, bytes_per_s: 0 };
                    self.come.push_back((tick + 12, heard));
                }
            }
            while let Some((_, heard)) = self.come.pop_front_if(|(due, _)| *due <= tick) {
                self.leader.heard(CLIENT, heard);
            }
            let (bodies, rest) = self.leader.replication_here().bytes_of(CLIENT);
            most = (most.0.max(bodies), most.1.max(rest));
        }
        most
    }
}

/// The entries of maps and sets and the capacities of queues count; what the allocator and ordered maps add
/// does not.
#[test]
fn a_client_that_stops_reading_costs_its_leader_no_more_than_one_that_reads() {
    let mut told = Told::new();
    let reads = told.play(240, |_, number| !number.is_multiple_of(20));
    println!("a client that reads: {reads:?}");
    assert!(reads.0 > BODIES as usize * 200, "all bodies are told of: {reads:?}");
    assert!(reads.0 <= BODIES as usize * BODY_BYTES && reads.1 <= MOST_BYTES, "{reads:?}");
    let stops = told.play(90, |_, _| false);
    println!("one that stops: {stops:?}");
    assert!(stops.0 <= BODIES as usize * BODY_BYTES && stops.1 <= MOST_BYTES, "{stops:?}");
    let silent = told.play(300, |_, _| false);
    println!("one that is silent for more than a second: {silent:?}");
    assert!(silent.0 + silent.1 <= MOST_BYTES, "{silent:?}");
}

#[test]
fn a_client_that_never_acknowledges_or_hardly_ever_costs_no_more_than_that() {
    let never = Told::new().play(300, |_, _| false);
    println!("a client that never acknowledges: {never:?}");
    assert!(never.0 <= BODIES as usize * BODY_BYTES && never.1 <= MOST_BYTES, "{never:?}");
    // It acknowledges often enough to be sent all that its link carries.
    let mut told = Told::new();
    let rarely = told.play(900, |tick, _| tick % 48 == 0);
    println!("one that does so twice a second: {rarely:?}");
    assert!(rarely.0 > BODIES as usize * 200, "all bodies are told of: {rarely:?}");
    assert!(rarely.0 <= BODIES as usize * BODY_BYTES && rarely.1 <= MOST_BYTES, "{rarely:?}");
}

/// Checks that what a client acknowledges while it is silent, later than the tick in which it is told so
/// little, counts.
#[test]
fn a_client_that_was_silent_for_long_and_hears_again_is_told_of_all_again() {
    let mut told = Told::new();
    let hears = |_: u64, number: u32| !number.is_multiple_of(20);
    told.play(240, hears);
    told.play(90, |_, _| false);
    let silent = told.play(1, |_, _| false);
    assert!(silent.0 < BODIES as usize * 20, "it is given up: {silent:?}");
    told.play(240, hears);
    let back = told.play(1, hears);
    println!("a client that is back: {back:?}");
    assert!(back.0 > BODIES as usize * 200, "all bodies are told of: {back:?}");
}
