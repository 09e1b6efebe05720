//! Keeps what a client that joined with an area of interest asks the server for: scenery where the area moves
//! to, and bodies that it hears of and does not know.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::protocol::{Area, FromClient, MAX_INTRODUCED};
use crate::space::BodyId;

/// The time after which a body that is still unknown is asked for again.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// The time after which scenery that the server would not look for is asked for again.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// What was asked of the server; nothing, if the client was told the whole world.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    /// The area whose scenery is known; `None`: the whole world's is.
    known: Option<Area>,
    asked: BTreeMap<BodyId, Duration>,
    /// Says whether the server was asked for scenery since the client joined, and when it is asked again.
    has_looked: bool,
    look_again_at: Option<Duration>,
}

impl Surroundings {
    /// Returns the surroundings of a client that joins with this interest.
    pub(super) fn of(interest: Option<Area>) -> Self {
        let known = interest.map(|area| area.with_surroundings());
        Self { known, asked: BTreeMap::new(), has_looked: false, look_again_at: None }
    }

    /// Returns whether the client was told the whole world.
    pub(super) fn is_whole(&self) -> bool {
        self.known.is_none()
    }

    /// Returns what to send the server when the area of interest has changed to this one, if it reaches
    /// beyond what is known.
    pub(super) fn turn_to(&mut self, interest: Option<Area>) -> Option<FromClient> {
        let known = self.known?;
        if interest.is_some_and(|area| known.contains(&area)) {
            return None;
        }
        self.known = interest.map(|area| area.with_surroundings());
        self.has_looked = true;
        Some(FromClient::Interest(self.known))
    }

    /// Notes that the server refuses something that it was asked too often. That may be this.
    pub(super) fn refused(&mut self, now: Duration) {
        if self.has_looked {
            self.look_again_at.get_or_insert(now + LOOK_AGAIN);
        }
    }

    /// Returns when scenery is asked for again.
    pub(super) fn timeout(&self) -> Option<Duration> {
        self.look_again_at
    }

    /// Returns what to send the server again, if that is due: scenery that was refused is not known.
    pub(super) fn look_again(&mut self, now: Duration) -> Option<FromClient> {
        self.look_again_at.take_if(|at| *at <= now).map(|_| FromClient::Interest(self.known))
    }

    /// Returns which of these bodies, which the client does not know, to ask the server for now.
    pub(super) fn ask(&mut self, now: Duration, strangers: Vec<BodyId>) -> Vec<BodyId> {
        if self.known.is_none() {
            return Vec::new();
        }
        self.asked.retain(|_, at| now < *at + ASK_AGAIN);
        let mut new: Vec<_> = strangers.into_iter().filter(|id| !self.asked.contains_key(id)).collect();
        new.truncate(MAX_INTRODUCED);
        self.asked.extend(new.iter().map(|&id| (id, now)));
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(x: f64, radius_m: f64) -> Area {
        Area { centre: [x, 0.0, 0.0], radius_m }
    }

    #[test]
    fn scenery_is_asked_for_once_the_area_leaves_what_is_known() {
        let mut surroundings = Surroundings::of(Some(area(0.0, 20.0)));
        assert_eq!(surroundings.turn_to(Some(area(10.0, 20.0))), None);
        let wider = area(40.0, 20.0).with_surroundings();
        assert_eq!(surroundings.turn_to(Some(area(40.0, 20.0))), Some(FromClient::Interest(Some(wider))));
        assert_eq!(surroundings.turn_to(Some(area(35.0, 20.0))), None);
        assert_eq!(surroundings.turn_to(None), Some(FromClient::Interest(None)));
        assert_eq!(surroundings.turn_to(Some(area(900.0, 20.0))), None, "all of it is known");
    }

    #[test]
    fn scenery_that_the_server_would_not_look_for_is_asked_for_again() {
        let at = Duration::from_millis;
        let mut surroundings = Surroundings::of(Some(area(0.0, 20.0)));
        surroundings.refused(at(0));
        assert_eq!(surroundings.timeout(), None, "that was of something else");
        for to in [Some(area(900.0, 20.0)), None] {
            let asked = surroundings.turn_to(to);
            assert!(asked.is_some());
            surroundings.refused(at(100));
            surroundings.refused(at(200));
            assert_eq!((surroundings.timeout(), surroundings.look_again(at(1_099))), (Some(at(1_100)), None));
            assert_eq!(surroundings.look_again(at(1_100)), asked);
            assert_eq!((surroundings.timeout(), surroundings.look_again(at(9_999))), (None, None));
        }
    }

    #[test]
    fn a_stranger_is_asked_for_again_after_a_while_only() {
        let mut surroundings = Surroundings::of(Some(area(0.0, 20.0)));
        let ids: Vec<_> = (0..3).map(BodyId::persistent).collect();
        let at = Duration::from_millis;
        assert_eq!(surroundings.ask(at(0), ids[..2].to_vec()), ids[..2]);
        assert_eq!(surroundings.ask(at(100), ids.clone()), ids[2..]);
        assert_eq!(surroundings.ask(at(501), ids.clone()), ids[..2]);
        assert_eq!(Surroundings::of(None).ask(at(0), ids), []);
    }
}
