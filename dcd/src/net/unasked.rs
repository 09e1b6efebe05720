//! Keeps who begins a handshake and does not finish it, connections that have not greeted or asked for anything yet, and those that were refused:
//! what has waited longest gives way where there is no room for another, so that who only occupies a place does not keep others from joining.
//! Who has proved its name gives way last.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use quinn::Connection;
use tokio::sync::Notify;

use super::CloseCode;

/// Connections in the order in which they came.
#[derive(Default)]
pub(super) struct Unasked(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    next: u64,
    places: BTreeMap<Number, (Arc<Notify>, Option<Connection>)>,
}

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
        self.enter_as(false, connection)
    }

    /// Notes a connection with a process that has proved its name and is to greet: its token may have been used up a moment ago.
    pub(super) fn enter_proven(&self, connection: &Connection) -> Place<'_> {
        self.enter_as(true, Some(connection))
    }

    fn enter_as(&self, is_proven: bool, connection: Option<&Connection>) -> Place<'_> {
        let mut waiting = self.lock();
        let number = (is_proven, waiting.next);
        waiting.next += 1;
        let gives_way = Arc::new(Notify::new());
        waiting.places.insert(number, (gives_way.clone(), connection.cloned()));
        Place { of: self, number, gives_way }
    }

    /// Returns how many there are.
    pub(super) fn count(&self) -> usize {
        self.lock().places.len()
    }

    /// Ends what has waited longest; returns whether there was anything. Its handshake slot is free soon.
    pub(super) fn give_way(&self) -> bool {
        let Some((_, (gives_way, connection))) = self.lock().places.pop_first() else { return false };
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

    #[test]
    fn what_has_waited_longest_gives_way_and_who_has_proved_its_name_last() {
        let unasked = Unasked::default();
        let places = [true, false, false].map(|is_proven| unasked.enter_as(is_proven, None));
        let there = || {
            places.iter().map(|place| unasked.lock().places.contains_key(&place.number)).collect::<Vec<_>>()
        };
        for left in [[true, false, true], [true, false, false], [false; 3]] {
            assert!(unasked.give_way());
            assert_eq!(there(), left);
        }
        assert!(!unasked.give_way());
    }
}
