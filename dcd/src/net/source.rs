//! Shares what callers cost among the places that they call from. Some of the calls that prove their address
//! are ignored: at random where all come from one place and call once. A caller that calls again, as every
//! honest one does, goes first.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use quinn::ConnectionId;

/// The pace of handshakes: one per this time from one source, and one per half of it from all. A handshake
/// takes some 0.2 ms of the network's thread.
const EACH: Duration = Duration::from_millis(1);
/// The burst that may come at once after a pause: this time's worth. A caller that calls for the first time
/// has half of it. Of the burst of all sources, one with [`FEW`] or more connections has three eighths of
/// that, so that the rest is left for callers from elsewhere.
const BURST: Duration = Duration::from_millis(512);
/// A source with fewer connections than this goes before the others.
const FEW: usize = 8;
/// The time after which an ignored call that comes once more counts as a caller that calls again. A dcd
/// process calls again after 300 ms (`link::FIRST_PROBE`), others after a second (RFC 9002, 6.2.2). Packets
/// that were sent in a row, or doubled on the way, are the same call.
const AGAIN: Duration = Duration::from_millis(250);
/// The number of ignored calls that are remembered: those of more than a second, at 10,000 per second.
const KNOWN: usize = 16_384;

/// The place that a caller writes from: an IPv4 address, or all IPv6 addresses with the same first 64 bits,
/// which belong to one customer.
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

/// A call: the address that it comes from, and the connection id that its caller chose first.
pub(super) type Call = (SocketAddr, ConnectionId);

/// The number of connections of each source.
#[derive(Clone, Debug, Default)]
struct Counts(Arc<Mutex<BTreeMap<Source, usize>>>);

impl Counts {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<Source, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The part that a call takes of what its source may have, until it is given back or dropped.
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

    /// Gives the part back before the connection is over: the connection is a peer's from now on.
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

/// The calls of late, by which the room for callers is shared out.
#[derive(Debug)]
pub(super) struct Calls {
    handshakes: usize,
    closing: usize,
    counts: Counts,
    /// The times at which the calls of each source, and those of all, would have come at an even pace. A
    /// source that keeps to the pace has no entry.
    even_at: BTreeMap<Source, Instant>,
    all_even_at: Option<Instant>,
    /// The calls that were ignored last: in order, and with the time when each was ignored first.
    ignored: VecDeque<(Instant, Call)>,
    known: BTreeMap<Call, Instant>,
}

impl Calls {
    /// Returns the record that shares out the room for `handshakes` handshakes, and for `closing` connections
    /// besides that come to their end.
    pub(super) fn new(handshakes: usize, closing: usize) -> Self {
        let (even_at, all_even_at) = (BTreeMap::new(), None);
        let (ignored, known) = (VecDeque::new(), BTreeMap::new());
        Self { handshakes, closing, counts: Counts::default(), even_at, all_even_at, ignored, known }
    }

    /// Notes a call that comes while `there` connections exist; `may_begin` says whether a handshake may
    /// begin. Returns the call's part if it is to be taken. It must keep to the pace of its source and of
    /// all, and its source must have less of the connections that come to their end than there is room left.
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

    /// Returns whether a source that has `of_it` of the `there` connections may have one more. Its share of
    /// those beyond the handshakes is assumed to be its share of all. So one source may have half of the room
    /// for what comes to its end, two a third each, and some is always left.
    fn has_room(&self, of_it: usize, there: usize) -> bool {
        let over = there.saturating_sub(self.handshakes);
        let left = self.closing.saturating_sub(over);
        there < self.handshakes || left > 0 && of_it.saturating_mul(over) < left.saturating_mul(there)
    }

    fn note(&mut self, now: Instant, source: Source) {
        let next = |even_at: Option<Instant>, each| even_at.map_or(now, |at| at.max(now)) + each;
        self.all_even_at = Some(next(self.all_even_at, EACH / 2));
        let even_at = next(self.even_at.get(&source).copied(), EACH);
        // No more sources are ahead of the pace than call in one burst of all.
        self.even_at.retain(|_, at| *at > now);
        self.even_at.insert(source, even_at);
    }

    fn ignore(&mut self, now: Instant, call: Call) {
        if let Entry::Vacant(entry) = self.known.entry(call) {
            entry.insert(now);
            self.ignored.push_back((now, call));
        }
        // A call that was taken, and ignored again later, has a newer entry.
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

    /// Returns a call from a host, by its number.
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

    /// Takes what these hosts call in turns until no more calls are taken. Returns how many connections are
    /// there.
    fn fill(calls: &mut Calls, parts: &mut Vec<(u8, Arc<Part>)>, hosts: &[u8]) -> usize {
        let now = Instant::now();
        for number in 0..1_000 {
            for &host in hosts {
                // Without a pace that holds any of them back.
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
                // A call from before is repeated.
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
        // As many as the burst of callers that call for the first time.
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
