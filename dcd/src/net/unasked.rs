//! Lists connections that only occupy places, and ends one of them when there is no room for another:
//! unfinished handshakes, connections that have not greeted or asked for anything yet, and refused ones.
//!
//! So callers that only occupy places do not keep others from joining. Which one gives way:
//!
//! - **Source.** One of the source that has most.
//! - **Kind.** Within a source, one of the kind that it has more of: unfinished handshakes, or connections.
//!   Of these, the one that has waited longest.
//! - **Proven names.** Connections that have proved their name give way last, but only a few under one name:
//!   with its certificate a process may call as often as it likes.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use quinn::Connection;
use tokio::sync::Notify;

use super::source::Source;
use super::{CloseCode, PeerName};

/// The connections by the source that they come from, in the order in which they came.
#[derive(Default)]
pub(super) struct Unasked(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    next: u64,
    places: BTreeMap<u64, Waiter>,
    /// The waiters that have proved their names, as far as they give way last.
    proven: BTreeSet<u64>,
    /// All others by source: unfinished handshakes, and connections.
    strangers: BTreeMap<Source, [BTreeSet<u64>; 2]>,
}

struct Waiter {
    gives_way: Arc<Notify>,
    connection: Option<Connection>,
    who: Option<PeerName>,
    source: Source,
}

/// The number of connections under one name that give way last. It is above one because a peer is called at
/// several addresses at once.
const OF_ONE_NAME: usize = 8;

/// A connection's place among them, which it has until this is dropped.
pub(super) struct Place<'a> {
    of: &'a Unasked,
    number: u64,
    gives_way: Arc<Notify>,
}

impl Waiting {
    /// Takes out a place; returns `None` if it was given up before.
    fn remove(&mut self, number: u64) -> Option<Waiter> {
        let waiter = self.places.remove(&number)?;
        self.proven.remove(&number);
        if let Some(kinds) = self.strangers.get_mut(&waiter.source) {
            kinds.iter_mut().for_each(|kind| _ = kind.remove(&number));
            if kinds.iter().all(BTreeSet::is_empty) {
                self.strangers.remove(&waiter.source);
            }
        }
        Some(waiter)
    }

    /// Returns the place that is to give way next.
    fn first(&self) -> Option<u64> {
        let count_and_oldest = |kinds: &[BTreeSet<u64>; 2]| {
            let oldest = kinds.iter().filter_map(BTreeSet::first).min().copied();
            (kinds.iter().map(BTreeSet::len).sum::<usize>(), Reverse(oldest))
        };
        let Some([begun, made]) = self.strangers.values().max_by_key(|kinds| count_and_oldest(kinds)) else {
            return self.proven.first().copied();
        };
        // A caller that has answered, and so may ask in a moment, is not pushed out by callers that fall
        // silent. Nor do idle connections push out all new callers.
        if begun.len() < made.len() { made } else { begun }.first().copied()
    }
}

impl Unasked {
    /// Adds a caller that begins a handshake, which has no connection yet.
    pub(super) fn enter_begun(&self, from: SocketAddr) -> Place<'_> {
        self.enter_as(from, None, None)
    }

    /// Adds a connection that may ask now, or may read why it was refused.
    pub(super) fn enter(&self, connection: &Connection) -> Place<'_> {
        self.enter_as(connection.remote_address(), None, Some(connection))
    }

    /// Adds a connection with a process that has proved its name and is to greet. It gives way last, since
    /// its token may have been used up a moment ago.
    pub(super) fn enter_proven(&self, who: PeerName, connection: &Connection) -> Place<'_> {
        self.enter_as(connection.remote_address(), Some(who), Some(connection))
    }

    fn enter_as(
        &self,
        from: SocketAddr,
        who: Option<PeerName>,
        connection: Option<&Connection>,
    ) -> Place<'_> {
        let source = Source::of(from);
        let mut waiting = self.lock();
        let of_name = || waiting.places.values().filter(|waiter| waiter.who == who).count();
        let is_proven = who.is_some() && of_name() < OF_ONE_NAME;
        let number = waiting.next;
        waiting.next += 1;
        match is_proven {
            true => waiting.proven.insert(number),
            false => {
                let kind = usize::from(connection.is_some() || who.is_some());
                waiting.strangers.entry(source).or_default()[kind].insert(number)
            }
        };
        let gives_way = Arc::new(Notify::new());
        let waiter = Waiter { gives_way: gives_way.clone(), connection: connection.cloned(), who, source };
        waiting.places.insert(number, waiter);
        Place { of: self, number, gives_way }
    }

    /// Returns the number of places.
    pub(super) fn count(&self) -> usize {
        self.lock().places.len()
    }

    /// Ends the one that is to give way next. Returns whether there was any. Its handshake slot is free soon.
    pub(super) fn give_way(&self) -> bool {
        let mut waiting = self.lock();
        let waiter = waiting.first().and_then(|number| waiting.remove(number));
        drop(waiting);
        let Some(Waiter { gives_way, connection, .. }) = waiter else { return false };
        gives_way.notify_one();
        let reason = b"others wait to join, and nothing was asked here that waits for an answer; try again";
        if let Some(connection) = connection {
            connection.close(CloseCode::REFUSED.into(), reason);
        }
        true
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place<'_> {
    /// Returns whether this place was told to give way because another caller waits for it.
    pub(super) fn is_given_up(&self) -> bool {
        !self.of.lock().places.contains_key(&self.number)
    }

    /// Returns once this place has to give way.
    pub(super) async fn gives_way(&self) {
        self.gives_way.notified().await;
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.of.lock().remove(self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::NodeId;

    fn name(node: u32) -> PeerName {
        PeerName::Node(NodeId(node))
    }

    fn at(host: u8) -> SocketAddr {
        ([192, 0, 2, host], 7).into()
    }

    #[test]
    fn what_has_waited_longest_gives_way_and_who_has_proved_its_name_last() {
        let unasked = Unasked::default();
        let places = [Some(name(1)), None, None].map(|who| unasked.enter_as(at(1), who, None));
        let there = || places.iter().map(|place| !place.is_given_up()).collect::<Vec<_>>();
        for left in [[true, false, true], [true, false, false], [false; 3]] {
            assert!(unasked.give_way());
            assert_eq!(there(), left);
        }
        assert!(!unasked.give_way());
    }

    #[test]
    fn a_name_that_calls_often_keeps_no_stranger_out() {
        let unasked = Unasked::default();
        let often: Vec<_> = (0..=OF_ONE_NAME).map(|_| unasked.enter_as(at(1), Some(name(1)), None)).collect();
        let stranger = unasked.enter_begun(at(2));
        let other = unasked.enter_as(at(2), Some(name(2)), None);
        assert!(unasked.give_way());
        let is_there = |place: &Place<'_>| !place.is_given_up();
        assert!(!is_there(&often[OF_ONE_NAME]), "the last of them counts as a stranger, and came before one");
        assert!(is_there(&stranger) && is_there(&other) && is_there(&often[0]));
    }

    #[test]
    fn one_of_the_source_that_has_most_gives_way() {
        let unasked = Unasked::default();
        let enter = |host| unasked.enter_begun(at(host));
        let (first, mut often) = (enter(1), vec![enter(2)]);
        for _ in 0..1_000 {
            often.push(enter(2));
            assert!(unasked.give_way());
        }
        assert!(!first.is_given_up(), "it came before all of them, from elsewhere");
        assert_eq!(often.iter().filter(|place| !place.is_given_up()).count(), 1);
        assert!(unasked.give_way() && first.is_given_up(), "of as many who has waited longest");
        drop((first, often));
        assert!(!unasked.give_way() && unasked.lock().strangers.is_empty(), "nothing is kept of who is gone");
    }

    #[test]
    fn who_has_answered_is_not_pushed_out_by_who_calls_and_falls_silent_nor_the_other_way_round() {
        let unasked = Unasked::default();
        // A connection beyond the number for one name counts as a stranger that has answered.
        let _named: Vec<_> = (0..OF_ONE_NAME).map(|_| unasked.enter_as(at(3), Some(name(1)), None)).collect();
        let answered = || unasked.enter_as(at(1), Some(name(1)), None);
        let begun = || unasked.enter_begun(at(1));
        let is_there = |place: &Place<'_>| !place.is_given_up();
        let (first, mut silent) = (answered(), vec![begun()]);
        for _ in 0..1_000 {
            silent.push(begun());
            assert!(unasked.give_way());
        }
        assert!(is_there(&first) && silent.iter().filter(|place| is_there(place)).count() == 1);
        drop((first, silent));
        let (first, mut idle) = (begun(), vec![answered()]);
        for _ in 0..1_000 {
            idle.push(answered());
            assert!(unasked.give_way());
        }
        assert!(is_there(&first) && idle.iter().filter(|place| is_there(place)).count() == 1);
    }
}
