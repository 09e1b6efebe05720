//! Shares what callers cost among the places that they call from: of calls that prove their address some are ignored, at random where all come
//! from one place and call once; who calls again, as everybody does that means it, goes first.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use quinn::ConnectionId;

/// The time that a handshake may take of the network's thread is that of one in so long with one source, and of one in half as long with all.
/// It takes some 0.2 ms.
const EACH: Duration = Duration::from_millis(1);
/// What may come at once after a pause: all of this time. Who calls for the first time has half of it; of what all have together, sources that
/// have more than a few connections have three eighths of that, so that what is left is for those from elsewhere.
const BURST: Duration = Duration::from_millis(512);
/// A source with fewer connections than these goes before the others.
const FEW: usize = 8;
/// Who calls so long after it was first ignored calls again. A dcd process does after 300 ms (`link::FIRST_PROBE`), others after a second (RFC 9002,
/// 6.2.2): packets that were sent in a row, or twice by the way, are the same call.
const AGAIN: Duration = Duration::from_millis(250);
/// The calls that are known to have been ignored: those of more than a second at 10,000 per second.
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

/// So many connections of each source are there.
#[derive(Clone, Debug, Default)]
struct Counts(Arc<Mutex<BTreeMap<Source, usize>>>);

impl Counts {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<Source, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The part that a call has in what its source may have, until it is given back or dropped.
#[derive(Debug)]
pub(super) struct Part {
    counts: Counts,
    source: Mutex<Option<Source>>,
}

impl Part {
    fn new(counts: &Counts, source: Source) -> Arc<Self> {
        *counts.lock().entry(source).or_default() += 1;
        Arc::new(Self { counts: counts.clone(), source: Mutex::new(Some(source)) })
    }

    /// Gives it back before its connection is over, which is a peer's now.
    pub(super) fn give_back(&self) {
        let Some(source) = self.source.lock().unwrap_or_else(PoisonError::into_inner).take() else { return };
        let mut counts = self.counts.lock();
        if let Some(count) = counts.get_mut(&source) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&source);
            }
        }
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        self.give_back();
    }
}

/// Knows the calls of late.
#[derive(Debug)]
pub(super) struct Calls {
    handshakes: usize,
    closing: usize,
    counts: Counts,
    /// When those of each source, and all, would have come at an even pace; of a source that keeps to it nothing is known.
    even_at: BTreeMap<Source, Instant>,
    all_even_at: Option<Instant>,
    /// Those that were ignored last, in order and by themselves, and when they first were.
    ignored: VecDeque<(Instant, Call)>,
    known: BTreeMap<Call, Instant>,
}

impl Calls {
    /// Returns what shares out the room for so many handshakes, and for so many connections beside them that come to their end.
    pub(super) fn new(handshakes: usize, closing: usize) -> Self {
        let (even_at, all_even_at) = (BTreeMap::new(), None);
        let (ignored, known) = (VecDeque::new(), BTreeMap::new());
        Self { handshakes, closing, counts: Counts::default(), even_at, all_even_at, ignored, known }
    }

    /// Notes a call that comes while so many connections are there, and a handshake may begin or not. Returns its part if it is to be taken: at
    /// the pace of its source and of all, and while its source has less of those that come to their end than there is room left for.
    pub(super) fn take(
        &mut self,
        now: Instant,
        call: Call,
        there: usize,
        may_begin: bool,
    ) -> Option<Arc<Part>> {
        let source = Source::of(call.0);
        let of_it = self.counts.lock().get(&source).copied().unwrap_or(0);
        let calls_again = self.known.get(&call).is_some_and(|&at| at + AGAIN <= now);
        let ahead = if calls_again { BURST } else { BURST / 2 };
        let ahead_of_all = if of_it < FEW { ahead } else { ahead * 3 / 8 };
        let is_due = |even_at: Option<&Instant>, ahead| even_at.is_none_or(|&at| at <= now + ahead);
        let is_due =
            is_due(self.even_at.get(&source), ahead) && is_due(self.all_even_at.as_ref(), ahead_of_all);
        if !(may_begin && is_due && self.has_room(of_it, there)) {
            self.ignore(now, call);
            return None;
        }
        self.known.remove(&call);
        self.note(now, source);
        Some(Part::new(&self.counts, source))
    }

    /// Returns whether a source that has so many of those that are there may have one more. Of those beyond the handshakes, as large a part is
    /// its own as it has of all; one source may so have half of what comes to its end, two a third each, and there is always some left.
    fn has_room(&self, of_it: usize, there: usize) -> bool {
        let over = there.saturating_sub(self.handshakes);
        let left = self.closing.saturating_sub(over);
        there < self.handshakes || left > 0 && of_it.saturating_mul(over) < left.saturating_mul(there)
    }

    fn note(&mut self, now: Instant, source: Source) {
        let next = |even_at: Option<Instant>, each| even_at.map_or(now, |at| at.max(now)) + each;
        self.all_even_at = Some(next(self.all_even_at, EACH / 2));
        let even_at = next(self.even_at.get(&source).copied(), EACH);
        // No more of them are ahead of the pace than come in a burst of all.
        self.even_at.retain(|_, at| *at > now);
        self.even_at.insert(source, even_at);
    }

    fn ignore(&mut self, now: Instant, call: Call) {
        if let Entry::Vacant(entry) = self.known.entry(call) {
            entry.insert(now);
            self.ignored.push_back((now, call));
        }
        // One that was taken, and ignored again later, has a newer entry.
        if self.ignored.len() > KNOWN
            && let Some((at, oldest)) = self.ignored.pop_front()
            && self.known.get(&oldest) == Some(&at)
        {
            self.known.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calls() -> Calls {
        Calls::new(1_000, 100_000)
    }

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

    /// Takes what these hosts call in turns until no more are taken. Returns how many are there.
    fn fill(calls: &mut Calls, parts: &mut Vec<(u8, Arc<Part>)>, hosts: &[u8]) -> usize {
        let now = Instant::now();
        for number in 0..1_000 {
            for &host in hosts {
                // The pace holds none of them back.
                (calls.even_at, calls.all_even_at) = (BTreeMap::new(), None);
                parts.extend(calls.take(now, call(host, number), parts.len(), true).map(|part| (host, part)));
            }
        }
        parts.len()
    }

    #[test]
    fn one_source_may_have_half_of_the_room_two_a_third_each_and_there_is_always_some_left() {
        for (hosts, there) in [(&[1][..], 60), (&[1, 2], 77), (&[1, 2, 3], 86), (&[1, 2, 3, 4], 91)] {
            let (mut calls, mut parts) = (Calls::new(10, 100), Vec::new());
            assert_eq!(fill(&mut calls, &mut parts, hosts), there, "{hosts:?}");
            assert!(fill(&mut calls, &mut parts, &[9]) > there, "from elsewhere one more is taken");
            drop(parts);
            assert!(calls.counts.lock().is_empty(), "what is over is forgotten");
        }
    }

    #[test]
    fn one_source_may_have_all_handshakes_and_half_of_what_comes_to_its_end_however_little_that_is() {
        for (handshakes, closing, there) in [(8, 4, 10), (8, 8, 12), (8, 1, 9), (8, 0, 8)] {
            let mut calls = Calls::new(handshakes, closing);
            assert_eq!(fill(&mut calls, &mut Vec::new(), &[1]), there, "{handshakes} and {closing}");
        }
    }

    #[test]
    fn what_others_end_gives_nothing_back_to_a_source_nor_does_a_part_count_that_is_a_peers() {
        let (mut calls, mut parts) = (Calls::new(10, 100), Vec::new());
        fill(&mut calls, &mut parts, &[1]);
        for _ in 0..50 {
            fill(&mut calls, &mut parts, &[2]);
            parts.retain(|(host, _)| *host == 1);
        }
        assert_eq!(fill(&mut calls, &mut parts, &[1]), 60);
        parts[0].1.give_back();
        assert_eq!(calls.counts.lock()[&Source::of(call(1, 0).0)], 59);
        drop(parts);
        assert!(calls.counts.lock().is_empty(), "each is given back once");
    }

    #[test]
    fn two_sources_that_call_again_and_again_keep_nobody_from_elsewhere_from_being_heard() {
        let (mut calls, start) = (calls(), Instant::now());
        let (mut parts, mut elsewhere) = (Vec::new(), 0);
        for number in 0..20_000 {
            let now = start + number * Duration::from_micros(100);
            for host in [1, 2] {
                parts.extend(calls.take(now, call(host, number), 0, true));
                // What came before calls again.
                if let Some(before) = number.checked_sub(3_000) {
                    parts.extend(calls.take(now, call(host, before), 0, true));
                }
            }
            if number % 100 == 0 {
                elsewhere += u32::from(calls.take(now, call(3, number), 0, true).is_some());
            }
        }
        assert_eq!(elsewhere, 200, "each at its first call");
    }

    #[test]
    fn who_sends_a_call_twice_in_a_row_or_once_more_when_it_was_taken_does_not_call_again() {
        let (mut calls, start) = (calls(), Instant::now());
        let late = start + AGAIN;
        let mut take = |now, number| calls.take(now, call(1, number), 0, true).is_some();
        let taken = (0..1_000).filter(|&number| take(start, number)).count();
        assert_eq!(taken, 257);
        assert!(!take(start, 999), "in a row");
        // As many as come in a burst of who calls for the first time.
        assert_eq!((1_000..2_000).filter(|&number| take(late, number)).count(), 250);
        assert!(take(late, 999), "it calls again");
        assert!(!take(late, 999), "it was taken");
    }

    #[test]
    fn who_finds_no_room_for_a_handshake_is_not_charged_and_goes_first_when_it_calls_again() {
        let (mut calls, start) = (calls(), Instant::now());
        assert!((0..1_000).all(|number| calls.take(start, call(1, number), 0, false).is_none()));
        assert!(calls.even_at.is_empty() && calls.all_even_at.is_none() && calls.counts.lock().is_empty());
        let late = start + AGAIN;
        let taken = (0..1_000).filter(|&number| calls.take(late, call(1, number), 0, true).is_some()).count();
        assert_eq!(taken, 513);
    }

    #[test]
    fn of_a_flood_from_one_source_as_many_are_taken_as_a_thread_can_bear_and_all_from_elsewhere() {
        let (mut calls, start) = (calls(), Instant::now());
        let (mut taken, mut elsewhere) = (0, 0);
        for number in 0..20_000 {
            let now = start + number * Duration::from_micros(100);
            taken += u32::from(calls.take(now, call(1, number), 0, true).is_some());
            if number % 100 == 0 {
                elsewhere += u32::from(calls.take(now, call(2, number), 0, true).is_some());
            }
        }
        assert_eq!(elsewhere, 200);
        assert_eq!(taken, 2_256, "those of two seconds, and at once those of a quarter");
        assert!(calls.known.len() == KNOWN && calls.ignored.len() == KNOWN && calls.even_at.len() == 1);
    }

    #[test]
    fn of_those_who_call_from_one_place_who_calls_again_goes_first() {
        let (mut calls, start) = (calls(), Instant::now());
        let mut waiting = VecDeque::new();
        let (mut again, mut honest) = (0, 0);
        for number in 0..20_000 {
            let now = start + number * Duration::from_micros(100);
            calls.take(now, call(1, number), 0, true);
            if number % 100 == 0 && calls.take(now, call(1, 100_000 + number), 0, true).is_none() {
                waiting.push_back((now + Duration::from_millis(300), 100_000 + number));
            }
            while let Some(&(at, number)) = waiting.front().filter(|(at, _)| *at <= now) {
                waiting.pop_front();
                (again, honest) =
                    (again + 1, honest + u32::from(calls.take(at, call(1, number), 0, true).is_some()));
            }
        }
        assert!(again > 100 && honest == again, "{honest} of {again}");
    }

    #[test]
    fn of_a_flood_from_everywhere_twice_as_many_are_taken_and_little_is_kept() {
        let (mut calls, start) = (calls(), Instant::now());
        let mut taken = 0;
        for number in 0..20_000_u32 {
            let now = start + number * Duration::from_micros(100);
            let [.., a, b] = number.to_be_bytes();
            let call = (([10, 0, a, b], 7).into(), ConnectionId::new(&[1]));
            taken += u32::from(calls.take(now, call, 0, true).is_some());
            assert!(calls.even_at.len() <= 11, "who keeps to its pace is forgotten");
        }
        assert_eq!(taken, 4_512);
    }
}
