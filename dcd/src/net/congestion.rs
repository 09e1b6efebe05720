//! Controls how many bytes may be in flight to a peer, by the share of bytes that are lost and by delay.
//!
//! Most of what is sent is state that is out of date a moment later, at a rate that its sender bounds.
//! Controllers that take every loss for congestion leave such a link almost nothing where packets are lost by
//! chance: Cubic gives 30 kB/s at a loss of 5 % and 200 ms, which is some 60 moving bodies (measured).
//! quinn's BBR sometimes stays at a quarter of what the link carries, since a sender that is not always busy
//! shows it little.
//!
//! So this controller takes a few losses for chance, as real-time media do (loss-based control of
//! draft-ietf-rmcat-gcc-02, 6), and takes a queue that grows on the path for congestion before anything is
//! lost.

use std::any::Any;
use std::sync::Arc;
use std::time::{Duration, Instant};

use quinn::congestion::{Controller, ControllerFactory};
use quinn_proto::RttEstimator;

use super::source::Part;

/// The share of lost bytes up to which the window grows.
const CHANCE: f64 = 0.08;
/// The share of lost bytes above which the window shrinks, by half that share.
const CONGESTION: f64 = 0.10;
/// A round trip is congested if it takes longer than the shortest one times this factor, plus [`QUEUE`].
const LONGER: u32 = 2;
/// The second part of the bound of [`LONGER`].
const QUEUE: Duration = Duration::from_millis(100);
/// The least time for which the shortest trip counts. It counts at most twice as long, since the path may
/// change.
const MEMORY: Duration = Duration::from_secs(4);
/// Trips that are longer than the shortest by this factor may be so because of a queue of our own. Once per
/// [`MEMORY`] that queue is drained.
const SUSPECT: f64 = 1.25;
/// The share of the window that is left for the round in which the queue is drained.
const DRAIN: f64 = 0.25;
/// The share of the window that is left after a round of congested trips.
const BACK_OFF: f64 = 0.85;
/// The factor by which the window grows with each round that used it, after the first congestion. Until then
/// it doubles.
const GROWTH: f64 = 1.08;
/// The share of the window from which on it counts as used. QUIC's pacing spreads what is sent over a round
/// trip by the window. So it holds a batch of states back long before the window is full, without saying so.
const USED: f64 = 0.4;
/// The least time of a round.
const ROUND: Duration = Duration::from_millis(100);
/// The smallest window, in packets.
const LEAST: u64 = 8;
/// The first window, in packets: what an idle link may send at once.
const FIRST: u64 = 32;
/// The largest window, in bytes.
const MOST: u64 = 8 << 20;

/// The factory of congestion controllers, for all connections or for that of one caller.
#[derive(Debug, Default)]
pub(super) struct ToleratesLoss {
    /// The caller's part. QUIC keeps this factory with the settings of the connection until it has forgotten
    /// the connection; nothing else tells when that is.
    _part: Option<Arc<Part>>,
}

impl ToleratesLoss {
    /// Returns the factory for a caller's connection. It keeps the caller's part for as long as QUIC knows of
    /// the connection.
    pub(super) fn of_caller(part: Arc<Part>) -> Self {
        Self { _part: Some(part) }
    }
}

impl ControllerFactory for ToleratesLoss {
    fn build(self: Arc<Self>, now: Instant, mtu: u16) -> Box<dyn Controller> {
        Box::new(Window::new(now, mtu))
    }
}

/// The congestion window of one connection.
#[derive(Clone, Debug)]
struct Window {
    mtu: u64,
    bytes: u64,
    /// Says whether there has been no congestion yet.
    probes: bool,
    round: Round,
    shortest: Shortest,
    /// The window to go back to after a round in which the queue is drained.
    after_drain: Option<u64>,
}

/// The shortest of the last trips: since a time, and in an equally long time before it.
#[derive(Clone, Debug)]
struct Shortest {
    since: Instant,
    now: Duration,
    before: Duration,
}

impl Shortest {
    fn new(since: Instant) -> Self {
        Self { since, now: Duration::MAX, before: Duration::MAX }
    }

    fn see(&mut self, trip: Duration) {
        self.now = self.now.min(trip);
    }

    /// Forgets trips that are too long ago. Returns whether it did.
    fn age(&mut self, now: Instant) -> bool {
        let is_due = now.saturating_duration_since(self.since) > MEMORY;
        if is_due {
            let is_old = now.saturating_duration_since(self.since) > 2 * MEMORY;
            *self = Self {
                since: now,
                now: Duration::MAX,
                before: if is_old { Duration::MAX } else { self.now },
            };
        }
        is_due
    }

    fn get(&self) -> Duration {
        self.now.min(self.before)
    }
}

/// What became of the packets since a time.
#[derive(Clone, Debug)]
struct Round {
    since: Instant,
    acked: u64,
    lost: u64,
    /// Says whether a router said that its queue grows.
    is_marked: bool,
    trip: Duration,
}

impl Round {
    fn new(since: Instant) -> Self {
        Self { since, acked: 0, lost: 0, is_marked: false, trip: Duration::ZERO }
    }
}

impl Window {
    fn new(now: Instant, mtu: u16) -> Self {
        let mtu = u64::from(mtu);
        Self {
            mtu,
            bytes: FIRST * mtu,
            probes: true,
            round: Round::new(now),
            shortest: Shortest::new(now),
            after_drain: None,
        }
    }

    fn scale(&mut self, factor: f64) {
        self.bytes = ((self.bytes as f64 * factor) as u64).clamp(LEAST * self.mtu, MOST);
    }

    /// Ends a round: adapts the window to what was lost in it, and to how long its trips took.
    fn judge(&mut self, now: Instant) {
        let round = std::mem::replace(&mut self.round, Round::new(now));
        let is_suspect = round.trip.as_secs_f64() > SUSPECT * self.shortest.get().as_secs_f64();
        if let Some(bytes) = self.after_drain.take() {
            self.bytes = bytes;
            return;
        }
        if self.shortest.age(now) && is_suspect {
            self.after_drain = Some(self.bytes);
            return self.scale(DRAIN);
        }
        let lost = round.lost as f64 / (round.acked + round.lost).max(1) as f64;
        let elapsed_s = now.saturating_duration_since(round.since).as_secs_f64().max(1e-3);
        let in_flight = (round.acked + round.lost) as f64 * round.trip.as_secs_f64() / elapsed_s;
        let is_used = in_flight > USED * self.bytes as f64;
        let is_queued =
            round.is_marked || round.trip > self.shortest.get().saturating_mul(LONGER).saturating_add(QUEUE);
        if lost > CONGESTION || is_queued {
            self.probes = false;
            self.scale(if is_queued { BACK_OFF.min(1.0 - lost / 2.0) } else { 1.0 - lost / 2.0 });
        } else if lost <= CHANCE && is_used {
            self.scale(if self.probes { 2.0 } else { GROWTH });
        }
    }
}

impl Controller for Window {
    fn on_ack(&mut self, now: Instant, sent: Instant, bytes: u64, _: bool, rtt: &RttEstimator) {
        self.round.acked += bytes;
        self.round.trip = rtt.get();
        self.shortest.see(now.saturating_duration_since(sent));
        if now.saturating_duration_since(self.round.since) >= ROUND.max(self.round.trip) {
            self.judge(now);
        }
    }

    fn on_congestion_event(&mut self, _now: Instant, _sent: Instant, is_persistent: bool, lost_bytes: u64) {
        self.round.lost += lost_bytes;
        // A report without lost bytes means that a router says that its queue grows (ECN).
        self.round.is_marked |= lost_bytes == 0;
        if is_persistent {
            self.probes = false;
            self.scale(0.5);
            self.after_drain = self.after_drain.map(|bytes| bytes.min(2 * self.bytes));
        }
    }

    fn on_mtu_update(&mut self, new_mtu: u16) {
        self.mtu = new_mtu.into();
        self.scale(1.0);
    }

    fn window(&self) -> u64 {
        self.bytes
    }

    fn clone_box(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn initial_window(&self) -> u64 {
        FIRST * self.mtu
    }

    fn into_any(self: Box<Self>) -> Box<dyn Any> {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates rounds in which the share `sent` of the window is sent per trip, the share `lost` of that is
    /// lost, and trips take `trip_ms`. Returns the window.
    fn after(rounds: u32, sent: f64, lost: f64, trip_ms: u64) -> u64 {
        let start = Instant::now();
        let mut window = Window::new(start, 1_200);
        for round in 1..=rounds {
            let trip = Duration::from_millis(trip_ms);
            let sent = sent * window.bytes as f64 * ROUND.as_secs_f64() / trip.as_secs_f64();
            window.round.acked = (sent * (1.0 - lost)) as u64;
            window.round.lost = (sent * lost) as u64;
            window.round.trip = trip;
            window.shortest.see(Duration::from_millis(50));
            window.judge(start + ROUND * round);
        }
        window.bytes
    }

    #[test]
    fn a_way_that_becomes_longer_is_not_taken_for_a_queue_for_long() {
        let start = Instant::now();
        let mut shortest = Shortest::new(start);
        shortest.see(Duration::from_millis(10));
        for round in 1..90 {
            shortest.age(start + ROUND * round);
            shortest.see(Duration::from_millis(200));
        }
        assert_eq!(shortest.get(), Duration::from_millis(200));
    }

    #[test]
    fn losses_by_chance_leave_a_link_what_it_carries() {
        assert_eq!(after(60, 0.9, 0.05, 60), MOST);
        assert_eq!(after(60, 0.3, 0.05, 60), FIRST * 1_200, "what is not used does not grow");
    }

    #[test]
    fn many_losses_or_a_queue_make_the_window_small() {
        assert_eq!(after(60, 0.9, 0.3, 60), LEAST * 1_200);
        assert_eq!(after(60, 0.9, 0.0, 300), LEAST * 1_200);
        assert_eq!(after(60, 0.9, 0.09, 60), FIRST * 1_200, "in between it stays");
    }

    /// Simulates a link of 125 kB/s with a queue of 64 kB, 50 ms away, that also loses 3 % by chance.
    #[test]
    fn a_narrow_link_is_used_and_its_queue_stays_short() {
        let start = Instant::now();
        let mut window = Window::new(start, 1_200);
        let (rate, room, base_s) = (125_000.0, 64_000.0, 0.05);
        let (mut carried, mut trips) = (0.0, Vec::new());
        for round in 1..=400 {
            let in_path = rate * base_s;
            let queue = (window.bytes as f64 - in_path).clamp(0.0, room);
            let trip_s = base_s + queue / rate;
            let overflow = (window.bytes as f64 - in_path - room).max(0.0);
            let lost = overflow + 0.03 * window.bytes as f64;
            let rounds = ROUND.as_secs_f64() / trip_s;
            window.round.acked = (rounds * (window.bytes as f64 - lost).max(0.0)) as u64;
            window.round.lost = (rounds * lost) as u64;
            window.round.trip = Duration::from_secs_f64(trip_s);
            window.shortest.see(window.round.trip);
            if round > 100 {
                carried += (window.bytes as f64 / trip_s).min(rate) / 300.0;
                trips.push(trip_s);
            }
            window.judge(start + ROUND * round);
        }
        let worst_s = trips.iter().copied().fold(0.0, f64::max);
        assert!(carried > 0.95 * rate, "{carried} bytes per second");
        assert!(worst_s < 0.4, "a trip of {worst_s} s");
    }
}
