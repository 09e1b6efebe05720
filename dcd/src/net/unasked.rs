//! Keeps who begins a handshake and does not finish it, connections that have not greeted or asked for anything yet, and those that were refused:
//! what has waited longest gives way where there is no room for another, so that who only occupies a place does not keep others from joining.
//! Who has proved its name gives way last, a few times under one name: with its certificate a process may call as often as it likes.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use quinn::Connection;
use tokio::sync::Notify;

use super::{CloseCode, PeerName};

/// Connections in the order in which they came.
#[derive(Default)]
pub(super) struct Unasked(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    next: u64,
    places: BTreeMap<Number, Waiter>,
}

struct Waiter {
    gives_way: Arc<Notify>,
    connection: Option<Connection>,
    who: Option<PeerName>,
}

/// So many connections of one name give way last: a peer is called at several addresses at once.
const OF_ONE_NAME: usize = 8;

/// Whether a name is proved, and the place in the order in which they came.
type Number = (bool, u64);

/// A connection's place among them, until it is dropped.
pub(super) struct Place<'a> {
    of: &'a Unasked,
    number: Number,
    gives_way: Arc<Notify>,
}

impl Unasked {
    /// Notes who begins a handshake, which has no connection yet; or a connection that may ask now, or read why it was refused.
    pub(super) fn enter(&self, connection: Option<&Connection>) -> Place<'_> {
        self.enter_as(None, connection)
    }

    /// Notes a connection with a process that has proved its name and is to greet: its token may have been used up a moment ago.
    pub(super) fn enter_proven(&self, who: PeerName, connection: &Connection) -> Place<'_> {
        self.enter_as(Some(who), Some(connection))
    }

    fn enter_as(&self, who: Option<PeerName>, connection: Option<&Connection>) -> Place<'_> {
        let mut waiting = self.lock();
        let of_name = || waiting.places.values().filter(|waiter| waiter.who == who).count();
        let is_proven = who.is_some() && of_name() < OF_ONE_NAME;
        let number = (is_proven, waiting.next);
        waiting.next += 1;
        let gives_way = Arc::new(Notify::new());
        let waiter = Waiter { gives_way: gives_way.clone(), connection: connection.cloned(), who };
        waiting.places.insert(number, waiter);
        Place { of: self, number, gives_way }
    }

    /// Returns how many there are.
    pub(super) fn count(&self) -> usize {
        self.lock().places.len()
    }

    /// Ends what has waited longest; returns whether there was anything. Its handshake slot is free soon.
    pub(super) fn give_way(&self) -> bool {
        let Some((_, waiter)) = self.lock().places.pop_first() else { return false };
        let Waiter { gives_way, connection, .. } = waiter;
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
    /// Returns whether it has been told to give way: another waits for it.
    pub(super) fn is_given_up(&self) -> bool {
        !self.of.lock().places.contains_key(&self.number)
    }

    /// Returns once it has to give way.
    pub(super) async fn gives_way(&self) {
        self.gives_way.notified().await;
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.of.lock().places.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::NodeId;

    fn name(node: u32) -> PeerName {
        PeerName::Node(NodeId(node))
    }

    #[test]
    fn what_has_waited_longest_gives_way_and_who_has_proved_its_name_last() {
        let unasked = Unasked::default();
        let places = [Some(name(1)), None, None].map(|who| unasked.enter_as(who, None));
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
        let often: Vec<_> = (0..=OF_ONE_NAME).map(|_| unasked.enter_as(Some(name(1)), None)).collect();
        let stranger = unasked.enter_as(None, None);
        let other = unasked.enter_as(Some(name(2)), None);
        assert!(unasked.give_way());
        let is_there = |place: &Place<'_>| !place.is_given_up();
        assert!(!is_there(&often[OF_ONE_NAME]), "the last of them counts as a stranger, and came before one");
        assert!(is_there(&stranger) && is_there(&other) && is_there(&often[0]));
    }
}
