//! Measures round trips to peers, and the offsets of their clocks, by pings (thesis 3.3.9, 4.3.1.5). Far
//! peers are pinged more rarely than near ones. The delay is the median of the last few round trips; the
//! thesis takes the average.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::Peer;
use crate::protocol::{Message, Ping, Pong};

/// The number of round trips kept per peer.
const KEPT: usize = 16;
/// The number of round trips to a new peer that are made often, so that a single one does not count for much.
const FIRST: usize = 3;

/// Returns the seconds between pings: `interval(t) = Imin + (Imax − Imin)·(t − tmin)/(tmax − tmin)`, kept
/// within [Imin, Imax] (thesis 4.3.1.5). Delays are in milliseconds, intervals in seconds.
pub fn ping_interval_s(delay_ms: f64, delays_ms: [f64; 2], intervals_s: [f64; 2]) -> f64 {
    let share = (delay_ms - delays_ms[0]) / (delays_ms[1] - delays_ms[0]);
    (intervals_s[0] + (intervals_s[1] - intervals_s[0]) * share).clamp(intervals_s[0], intervals_s[1])
}

/// The largest drift between two clocks, parts per million: each clock may run up to 500 ppm fast or slow.
const DRIFT_PPM: u64 = 1_000;

/// The delay and the clock offset that the four time stamps of a round trip give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RoundTrip {
    /// The time on the way, both ways together, microseconds.
    pub delay_us: u64,
    /// The peer's clock minus ours, microseconds; off by at most half the delay.
    pub offset_us: i64,
}

/// The estimated offset of a peer's clock, with a bound on its error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockOffset {
    /// The peer's clock minus ours, microseconds.
    pub offset_us: i64,
    /// The bound on the error of that, microseconds.
    pub error_us: u64,
}

/// The interval of pings to the server, whatever the delay: the server's clock is everybody's, and clocks
/// drift apart. It is also the interval to a peer that has not answered [`FIRST`] times, since groups form by
/// delays.
const OFTEN: Duration = Duration::from_millis(250);

/// The intervals of pings to near and far peers, seconds. The thesis's example has 5 to 500 s; but a member that has
/// become far keeps its group waiting until that is noticed.
const INTERVALS_S: [f64; 2] = [5.0, 30.0];
/// The interval while round trips are unlike the median. That changes after half of [`KEPT`]: a process that was stopped
/// for fewer seconds is taken to be no farther away.
const UNSETTLED: Duration = Duration::from_secs(1);
/// A round trip is unlike the median if it takes over twice as long, or under half, and this much more: less is jitter
/// of schedulers, microseconds.
const UNLIKE_US: f64 = 10_000.0;

#[derive(Clone, Debug)]
struct Entry {
    next: Duration,
    /// The last round trips, each with the time at which it was complete.
    trips: VecDeque<(Duration, RoundTrip)>,
}

impl Entry {
    /// Returns whether the last round trip is unlike the median: the way may have become another one.
    fn is_unsettled(&self) -> bool {
        let (Some((_, last)), Some(middle_us)) = (self.trips.back(), middle_us(&self.trips)) else {
            return false;
        };
        let last_us = last.delay_us as f64;
        let (less, more) = (last_us.min(middle_us), last_us.max(middle_us));
        self.trips.len() > FIRST && more > 2.0 * less + UNLIKE_US
    }
}

/// Pings every linked peer at an interval of its own.
///
/// [`Pinger::clock`] bounds the error of every peer's clock offset. Only for the server's clock is that error
/// small: under 5 ms where round trips take less than 7 ms and pings arrive. Others are pinged at
/// intervals between which clocks drift apart by 5 ms at least.
#[derive(Clone, Debug, Default)]
pub struct Pinger {
    peers: BTreeMap<Peer, Entry>,
}

impl Pinger {
    /// Adds a peer whose link is up; its first ping is due at once.
    pub fn add(&mut self, now: Duration, peer: Peer) {
        self.peers.insert(peer, Entry { next: now, trips: VecDeque::new() });
    }

    /// Removes a peer whose link is gone.
    pub fn remove(&mut self, peer: Peer) {
        self.peers.remove(&peer);
    }

    /// Returns when the next ping is due.
    pub fn timeout(&self) -> Option<Duration> {
        self.peers.values().map(|entry| entry.next).min()
    }

    /// Returns the pings that are due, in order of peers.
    pub fn due(&mut self, now: Duration) -> Vec<(Peer, Message)> {
        let mut pings = Vec::new();
        for (&peer, entry) in self.peers.iter_mut().filter(|(_, entry)| entry.next <= now) {
            let interval = match middle_us(&entry.trips) {
                Some(delay_us) if peer != Peer::Server && entry.trips.len() >= FIRST => {
                    Duration::from_secs_f64(ping_interval_s(delay_us / 1e3, [10.0, 1_000.0], INTERVALS_S))
                }
                _ => OFTEN,
            };
            entry.next = now + interval;
            pings.push((peer, Self::ask(now)));
        }
        pings
    }

    /// Returns a ping.
    pub fn ask(now: Duration) -> Message {
        Message::Ping(Ping { sent_us: micros(now) })
    }

    /// Returns the answer to a ping.
    pub fn answer(now: Duration, ping: Ping) -> Message {
        Message::Pong(Pong { sent_us: ping.sent_us, received_us: micros(now), answered_us: micros(now) })
    }

    /// Takes an answer in. An answer with impossible times is ignored.
    pub fn pong(&mut self, now: Duration, from: Peer, pong: Pong) {
        let (Some(entry), Some(trip)) = (self.peers.get_mut(&from), round_trip(pong, micros(now))) else {
            return;
        };
        entry.trips.push_back((now, trip));
        if entry.trips.len() > KEPT {
            entry.trips.pop_front();
        }
        if entry.is_unsettled() {
            entry.next = entry.next.min(now + UNSETTLED);
        }
    }

    /// Returns whether the last round trip to a peer is unlike those before. It says nothing about the way then, until
    /// most are like it.
    pub fn is_unsettled(&self, peer: Peer) -> bool {
        self.peers.get(&peer).is_some_and(Entry::is_unsettled)
    }

    /// Returns the median of the last round trips to a peer, microseconds.
    pub fn delay_us(&self, peer: Peer) -> Option<f64> {
        middle_us(&self.peers.get(&peer)?.trips)
    }

    /// Returns the newest round trip to a peer, microseconds.
    pub fn latest_us(&self, peer: Peer) -> Option<u64> {
        self.peers.get(&peer)?.trips.back().map(|(_, trip)| trip.delay_us)
    }

    /// Returns the peer's clock offset from the one of the last round trips with the smallest error: quick,
    /// and not long ago.
    pub fn clock(&self, now: Duration, peer: Peer) -> Option<ClockOffset> {
        let of = |&(at, trip): &(Duration, RoundTrip)| {
            let drift_us = micros(now.saturating_sub(at)) * DRIFT_PPM / 1_000_000;
            // Stamps are whole microseconds.
            ClockOffset { offset_us: trip.offset_us, error_us: trip.delay_us / 2 + drift_us + 2 }
        };
        self.peers.get(&peer)?.trips.iter().map(of).min_by_key(|clock| clock.error_us)
    }
}

fn round_trip(pong: Pong, now_us: u64) -> Option<RoundTrip> {
    let whole = now_us.checked_sub(pong.sent_us)?;
    let delay_us = whole.checked_sub(pong.answered_us.checked_sub(pong.received_us)?)?;
    let outward = i128::from(pong.received_us) - i128::from(pong.sent_us);
    let homeward = i128::from(pong.answered_us) - i128::from(now_us);
    Some(RoundTrip { delay_us, offset_us: i64::try_from((outward + homeward) / 2).ok()? })
}

/// Returns the median delay, microseconds. A process that was stopped for a while gives a few late answers,
/// which say nothing about the way to it. An average over them would keep a node out of its group for many
/// minutes.
fn middle_us(trips: &VecDeque<(Duration, RoundTrip)>) -> Option<f64> {
    let mut delays_us: Vec<u64> = trips.iter().map(|(_, trip)| trip.delay_us).collect();
    delays_us.sort_unstable();
    let last = delays_us.len().checked_sub(1)?;
    Some(delays_us[last / 2] as f64)
}

fn micros(time: Duration) -> u64 {
    time.as_micros() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::NodeId;

    #[test]
    fn the_interval_is_the_thesis_example_and_stays_between_its_ends() {
        let interval = |delay| ping_interval_s(delay, [10.0, 1_000.0], [5.0, 500.0]);
        assert_eq!([interval(25.0), interval(0.0), interval(5_000.0)], [12.5, 5.0, 500.0]);
    }

    #[test]
    fn four_time_stamps_give_delay_and_offset() {
        let mut pinger = Pinger::default();
        let peer = Peer::Node(NodeId(2));
        pinger.add(Duration::ZERO, peer);
        assert_eq!(pinger.due(Duration::ZERO).len(), 1);
        assert!(pinger.due(Duration::from_millis(10)).is_empty());
        // 10 ms each way, the peer's clock 1 s ahead, 5 ms until it answers.
        let pong = Pong { sent_us: 0, received_us: 1_010_000, answered_us: 1_015_000 };
        pinger.pong(Duration::from_millis(25), peer, pong);
        assert_eq!(pinger.delay_us(peer), Some(20_000.0));
        let clock = ClockOffset { offset_us: 1_000_000, error_us: 10_002 };
        assert_eq!(pinger.clock(Duration::from_millis(25), peer), Some(clock));
    }

    #[test]
    fn who_has_not_answered_is_asked_again_soon_and_who_has_not_for_long() {
        let (mut pinger, peer) = (Pinger::default(), Peer::Node(NodeId(2)));
        pinger.add(Duration::ZERO, peer);
        let mut asked = Vec::new();
        for ms in (0..20_000).step_by(50) {
            let now = Duration::from_millis(ms);
            if !pinger.due(now).is_empty() {
                asked.push(ms);
                // The first two pings get lost.
                if asked.len() > 2 {
                    let sent_us = micros(now);
                    let pong = Pong { sent_us, received_us: sent_us, answered_us: sent_us };
                    pinger.pong(now, peer, pong);
                }
            }
        }
        assert_eq!(asked, [0, 250, 500, 750, 1_000, 1_250, 6_250, 11_250, 16_250]);
    }

    /// Returns the milliseconds from the first round trip that takes `after_us`, in place of `before_us`, until the median
    /// is as long; `None` if it takes so for `lasts` pings only.
    fn noticed(before_us: u64, after_us: u64, lasts: usize) -> Option<u64> {
        let (mut pinger, peer) = (Pinger::default(), Peer::Node(NodeId(2)));
        pinger.add(Duration::ZERO, peer);
        let (mut first, mut pings) = (None, 0);
        for ms in (0..600_000).step_by(50) {
            let now = Duration::from_millis(ms);
            if !pinger.due(now).is_empty() {
                pings += 1;
                let is_other = pings > KEPT && pings <= KEPT.saturating_add(lasts);
                let delay_us = if is_other { after_us } else { before_us };
                let (sent_us, middle_us) = (micros(now), micros(now) + delay_us / 2);
                let pong = Pong { sent_us, received_us: middle_us, answered_us: middle_us };
                pinger.pong(now + Duration::from_micros(delay_us), peer, pong);
                first = first.or(is_other.then_some(ms));
            }
            if pinger.delay_us(peer) == Some(after_us as f64) {
                return Some(ms - first?);
            }
        }
        None
    }

    #[test]
    fn a_way_that_has_become_another_one_is_known_ten_seconds_after_the_first_ping_over_it() {
        for (before_us, after_us) in [(4_000, 200_000), (200_000, 4_000)] {
            let took = noticed(before_us, after_us, usize::MAX);
            assert!(took.is_some_and(|ms| ms <= 10_000), "{before_us} to {after_us} us: {took:?} ms");
            assert_eq!(noticed(before_us, after_us, 6), None, "a stall of six seconds is none");
        }
    }

    #[test]
    fn late_answers_say_nothing_of_the_way_while_most_are_in_time() {
        let (mut pinger, peer) = (Pinger::default(), Peer::Node(NodeId(2)));
        pinger.add(Duration::ZERO, peer);
        let mut trip = |at: u64, delay_ms: u64| {
            let (sent_us, now) = (at * 1_000_000, Duration::from_millis(1_000 * at + delay_ms));
            pinger.pong(now, peer, Pong { sent_us, received_us: sent_us, answered_us: sent_us });
            pinger.delay_us(peer).map(|us| us / 1e3)
        };
        assert_eq!(
            [3_000, 10, 2_000, 10].map(|ms| trip(0, ms)).map(Option::unwrap),
            [3_000.0, 10.0, 2_000.0, 10.0]
        );
        let worse: Vec<_> = (1..8).filter_map(|at| trip(at, 50)).collect();
        assert_eq!(worse, [50.0; 7], "what lasts counts");
    }

    #[test]
    fn a_clock_is_known_by_a_quick_trip_until_drift_makes_a_later_one_better() {
        let (mut pinger, peer) = (Pinger::default(), Peer::Server);
        pinger.add(Duration::ZERO, peer);
        let trip = |pinger: &mut Pinger, at_us: u64, delay_us: u64, ahead_us: u64| {
            let middle_us = at_us + delay_us / 2 + ahead_us;
            let pong = Pong { sent_us: at_us, received_us: middle_us, answered_us: middle_us };
            pinger.pong(Duration::from_micros(at_us + delay_us), peer, pong);
        };
        trip(&mut pinger, 0, 1_000, 50);
        trip(&mut pinger, 2_000_000, 4_000, 70);
        let now = Duration::from_millis(2_004);
        // The first trip's error is 0.5 ms plus 1 ms for each second since; the second's is 2 ms.
        assert_eq!(pinger.clock(now, peer).unwrap(), ClockOffset { offset_us: 70, error_us: 2_002 });
        trip(&mut pinger, 60_000_000, 200_000, 90);
        let clock = pinger.clock(Duration::from_millis(60_200), peer).unwrap();
        assert_eq!((clock.offset_us, clock.error_us), (70, 2_000 + 58_196 + 2), "slow trips tell little");
    }

    #[test]
    fn a_pong_from_the_future_is_ignored() {
        let mut pinger = Pinger::default();
        let peer = Peer::Server;
        pinger.add(Duration::ZERO, peer);
        pinger.pong(Duration::ZERO, peer, Pong { sent_us: 9, received_us: u64::MAX, answered_us: 0 });
        assert_eq!(pinger.delay_us(peer), None);
    }
}
