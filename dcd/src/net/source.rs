//! Shares what callers cost among the places that they call from: of calls that prove their address some are ignored, at random where all come
//! from one place and call once; who calls again, as everybody does that means it, goes first.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::time::{Duration, Instant};

use quinn::ConnectionId;

/// The time that a handshake may take of the network's thread is that of one in so long with one source, and of one in half as long with all.
/// It takes some 0.2 ms.
const EACH: Duration = Duration::from_millis(1);
/// What may come at once after a pause: all of this time. Who calls for the first time has half of it.
const BURST: Duration = Duration::from_millis(512);
/// The calls that are known to have been ignored: those of more than a second at 10,000 per second. QUIC calls again after 300 ms.
const KNOWN: usize = 16_384;

/// The place that a caller writes from: an IPv4 address, or all IPv6 addresses whose first 64 bits are the same, which are one customer's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Source(IpAddr);

impl Source {
    pub(super) fn of(addr: SocketAddr) -> Self {
        Self(match addr.ip().to_canonical() {
            IpAddr::V6(ip) => Ipv6Addr::from_bits(ip.to_bits() >> 64 << 64).into(),
            ip => ip,
        })
    }
}

/// A call, by where it comes from and what its caller called it first.
pub(super) type Call = (SocketAddr, ConnectionId);

/// Knows the calls of late.
#[derive(Debug, Default)]
pub(super) struct Calls {
    /// The sources of those that were taken last, as many as there are connections of strangers: what is over is forgotten, as if calls ended in
    /// the order in which they came.
    last: VecDeque<Source>,
    counts: BTreeMap<Source, usize>,
    /// When those of each source, and all, would have come at an even pace; of a source that keeps to it nothing is known.
    even_at: BTreeMap<Source, Instant>,
    all_even_at: Option<Instant>,
    /// Those that were ignored last, in order and by themselves.
    ignored: VecDeque<Call>,
    known: BTreeSet<Call>,
}

impl Calls {
    /// Notes a call that comes while so many of `room` connections are there. Returns whether it is to be taken: at the pace of its source and of
    /// all, and from one source only while at most half of the room is taken, or less than half by itself.
    pub(super) fn take(&mut self, now: Instant, call: Call, there: usize, room: usize) -> bool {
        while self.last.len() > there
            && let Some(over) = self.last.pop_front()
        {
            self.forget(over);
        }
        let source = Source::of(call.0);
        let ahead = if self.known.contains(&call) { BURST } else { BURST / 2 };
        let is_due = |even_at: Option<&Instant>| even_at.is_none_or(|&at| at <= now + ahead);
        let is_due = is_due(self.even_at.get(&source)) && is_due(self.all_even_at.as_ref());
        let of_it = self.counts.get(&source).copied().unwrap_or(0);
        let has_room = there < room && (there <= room / 2 || of_it < room / 2);
        match is_due && has_room {
            true => self.note(now, source),
            false => self.ignore(call),
        }
        is_due && has_room
    }

    fn note(&mut self, now: Instant, source: Source) {
        self.last.push_back(source);
        *self.counts.entry(source).or_default() += 1;
        let next = |even_at: Option<Instant>, each| even_at.map_or(now, |at| at.max(now)) + each;
        self.all_even_at = Some(next(self.all_even_at, EACH / 2));
        let even_at = next(self.even_at.get(&source).copied(), EACH);
        // No more of them are ahead of the pace than come in a burst of all.
        self.even_at.retain(|_, at| *at > now);
        self.even_at.insert(source, even_at);
    }

    fn ignore(&mut self, call: Call) {
        if self.known.insert(call) {
            self.ignored.push_back(call);
        }
        if self.ignored.len() > KNOWN
            && let Some(oldest) = self.ignored.pop_front()
        {
            self.known.remove(&oldest);
        }
    }

    fn forget(&mut self, source: Source) {
        if let Some(count) = self.counts.get_mut(&source) {
            *count -= 1;
            if *count == 0 {
                self.counts.remove(&source);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: usize = 100_000;

    fn at(addr: &str) -> Source {
        Source::of(addr.parse().unwrap())
    }

    /// A call from a host, by its number.
    fn call(host: u8, number: u32) -> Call {
        (([192, 0, 2, host], 7).into(), ConnectionId::new(&number.to_be_bytes()))
    }

    #[test]
    fn the_addresses_of_one_customer_are_one_source() {
        assert_eq!(at("192.0.2.1:1"), at("[::ffff:192.0.2.1]:2"));
        assert_ne!(at("192.0.2.1:1"), at("192.0.2.2:1"));
        assert_eq!(at("[2001:db8:0:1::7]:1"), at("[2001:db8:0:1:ffff::8]:2"));
        assert_ne!(at("[2001:db8:0:1::7]:1"), at("[2001:db8:0:2::7]:1"));
    }

    #[test]
    fn one_source_may_have_half_of_the_room_and_those_from_elsewhere_the_other() {
        let (mut calls, room, now) = (Calls::default(), 100, Instant::now());
        let mut take = |host, there| calls.take(now, call(host, 0), there, room);
        let mut there = 0;
        while take(1, there) {
            there += 1;
        }
        assert_eq!(there, 51);
        while take(2, there) {
            there += 1;
        }
        assert_eq!(there, room, "all that there is room for");
        // Half of them are over, as it seems those that were taken first.
        assert!(take(2, room / 2) && take(1, room / 2 + 1) && take(1, 0));
        assert_eq!((calls.last.len(), calls.counts.len()), (1, 1), "what is over is forgotten");
    }

    #[test]
    fn of_a_flood_from_one_source_as_many_are_taken_as_a_thread_can_bear_and_all_from_elsewhere() {
        let (mut calls, start) = (Calls::default(), Instant::now());
        let (mut taken, mut elsewhere) = (0, 0);
        for number in 0..20_000 {
            let now = start + number * Duration::from_micros(100);
            taken += u32::from(calls.take(now, call(1, number), 0, ROOM));
            if number % 100 == 0 {
                elsewhere += u32::from(calls.take(now, call(2, number), 0, ROOM));
            }
        }
        assert_eq!(elsewhere, 200);
        assert_eq!(taken, 2_256, "those of two seconds, and at once those of a quarter");
        assert!(calls.known.len() == KNOWN && calls.ignored.len() == KNOWN && calls.even_at.len() == 1);
    }

    #[test]
    fn of_those_who_call_from_one_place_who_calls_again_goes_first() {
        let (mut calls, start) = (Calls::default(), Instant::now());
        let mut waiting = VecDeque::new();
        let (mut again, mut honest) = (0, 0);
        for number in 0..20_000 {
            let now = start + number * Duration::from_micros(100);
            calls.take(now, call(1, number), 0, ROOM);
            if number % 100 == 0 && !calls.take(now, call(1, 100_000 + number), 0, ROOM) {
                waiting.push_back((now + Duration::from_millis(300), 100_000 + number));
            }
            while let Some(&(at, number)) = waiting.front().filter(|(at, _)| *at <= now) {
                waiting.pop_front();
                (again, honest) = (again + 1, honest + u32::from(calls.take(at, call(1, number), 0, ROOM)));
            }
        }
        assert!(again > 100 && honest == again, "{honest} of {again}");
    }

    #[test]
    fn of_a_flood_from_everywhere_twice_as_many_are_taken_and_little_is_kept() {
        let (mut calls, start) = (Calls::default(), Instant::now());
        let mut taken = 0;
        for number in 0..20_000_u32 {
            let now = start + number * Duration::from_micros(100);
            let [.., a, b] = number.to_be_bytes();
            let call = (([10, 0, a, b], 7).into(), ConnectionId::new(&[1]));
            taken += u32::from(calls.take(now, call, 0, ROOM));
            assert!(calls.even_at.len() <= 11, "who keeps to its pace is forgotten");
        }
        assert_eq!(taken, 4_512);
    }
}
