//! Keeps which contacts began and have not ended, to be found by either body.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::protocol::ContactKey;
use crate::space::BodyId;

/// The contacts that were told to have begun and not yet to have ended, each with whether one of the two is a sensor.
#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(from = "BTreeMap<ContactKey, bool>", into = "BTreeMap<ContactKey, bool>")]
pub(super) struct Touching {
    /// Each twice, below both bodies, so that those of a body lie side by side: a body that goes costs what it touches.
    by_body: BTreeMap<(BodyId, ContactKey), bool>,
}

impl Touching {
    pub(super) fn insert(&mut self, key: ContactKey, sensor: bool) {
        for body in [key.a, key.b] {
            self.by_body.insert((body, key), sensor);
        }
    }

    /// Removes a contact. Returns whether it was here.
    pub(super) fn remove(&mut self, key: ContactKey) -> bool {
        let [below_a, _] = [key.a, key.b].map(|body| self.by_body.remove(&(body, key)));
        below_a.is_some()
    }

    /// Removes and returns those contacts of a body, in the order of their keys, that are to go.
    pub(super) fn take_of(
        &mut self,
        body: BodyId,
        goes: impl Fn(&ContactKey) -> bool,
    ) -> Vec<(ContactKey, bool)> {
        let none = BodyId::from_bits(0);
        let first = ContactKey { a: none, b: none, collider_a: 0, collider_b: 0 };
        let all = self.by_body.range((body, first)..).take_while(|((of, _), _)| *of == body);
        let all = all.filter(|((_, key), _)| goes(key));
        let all: Vec<_> = all.map(|((_, key), sensor)| (*key, *sensor)).collect();
        for (key, _) in &all {
            self.remove(*key);
        }
        all
    }
}

impl From<BTreeMap<ContactKey, bool>> for Touching {
    fn from(contacts: BTreeMap<ContactKey, bool>) -> Self {
        let mut touching = Self::default();
        contacts.into_iter().for_each(|(key, sensor)| touching.insert(key, sensor));
        touching
    }
}

impl From<Touching> for BTreeMap<ContactKey, bool> {
    fn from(touching: Touching) -> Self {
        touching.by_body.into_iter().map(|((_, key), sensor)| (key, sensor)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(a: u32, b: u32) -> ContactKey {
        ContactKey { a: BodyId::persistent(a), b: BodyId::persistent(b), collider_a: 0, collider_b: 1 }
    }

    fn touching(pairs: &[(u32, u32)]) -> Touching {
        let mut touching = Touching::default();
        pairs.iter().for_each(|&(a, b)| touching.insert(key(a, b), a == 1));
        touching
    }

    fn left(touching: Touching) -> Vec<ContactKey> {
        BTreeMap::from(touching).into_keys().collect()
    }

    #[test]
    fn a_body_takes_its_contacts_with_it_as_the_lower_and_as_the_higher_one() {
        let mut touching = touching(&[(2, 3), (1, 2), (1, 3), (0, 1)]);
        let ended = touching.take_of(BodyId::persistent(2), |_| true);
        assert_eq!(ended, [(key(1, 2), true), (key(2, 3), false)]);
        assert!(touching.take_of(BodyId::persistent(2), |_| true).is_empty());
        assert!(!touching.remove(key(2, 3)), "neither body knows it any more");
        assert_eq!(left(touching), [key(0, 1), key(1, 3)]);
    }

    #[test]
    fn what_is_not_to_go_stays() {
        let mut touching = touching(&[(1, 2), (2, 3)]);
        assert_eq!(touching.take_of(BodyId::persistent(2), |key| key.b == BodyId::persistent(2)).len(), 1);
        assert_eq!(left(touching), [key(2, 3)]);
    }

    #[test]
    fn an_ended_contact_is_known_to_neither_body() {
        let mut touching = touching(&[(1, 2), (1, 3)]);
        assert!(touching.remove(key(1, 2)) && !touching.remove(key(1, 2)));
        assert!(touching.take_of(BodyId::persistent(2), |_| true).is_empty());
        assert_eq!(touching.take_of(BodyId::persistent(1), |_| true), [(key(1, 3), true)]);
        assert!(touching.by_body.is_empty());
    }
}
