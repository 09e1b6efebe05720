//! Merges the contact events of all regions into those of the world. A pair that several regions hold is
//! reported once.

use std::collections::{BTreeMap, BTreeSet};

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{ContactForce, ContactKey, RegionEvents, Touch};
use crate::space::{BodyId, RegionId};

/// The contact events of the world in one tick, each pair of colliders once.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct WorldEvents {
    /// The contacts that began or ceased, in key order.
    pub touches: Vec<Touch>,
    /// The contacts that pressed harder than a collider's threshold, in key order.
    pub forces: Vec<ContactForce>,
}

#[cfg(feature = "physics")]
impl WorldEvents {
    /// Adds the forces of steps between two ticks, by which regions caught up. Of two forces on a pair the stronger
    /// is told: they did not act at one time.
    pub(crate) fn add_early(&mut self, mut early: Vec<ContactForce>) {
        if early.is_empty() {
            return;
        }
        add_up(&mut early);
        self.forces.append(&mut early);
        self.forces.sort_by(|a, b| a.key.cmp(&b.key).then(b.magnitude_n.total_cmp(&a.magnitude_n)));
        self.forces.dedup_by_key(|force| force.key);
    }
}

/// Adds up the forces on each pair, and leaves those above their threshold, in key order.
fn add_up(forces: &mut Vec<ContactForce>) {
    forces.sort_by_key(|force| force.key);
    forces.dedup_by(|other, sum| {
        let same = other.key == sum.key;
        if same {
            sum.force_n = std::array::from_fn(|i| sum.force_n[i] + other.force_n[i]);
            sum.magnitude_n += other.magnitude_n;
        }
        same
    });
    forces.retain(|force| force.magnitude_n > force.threshold_n);
}

/// The record of which regions see each contact. A contact begins when the first region sees it, and ceases
/// when the last region no longer does, so a body that changes region does not seem to let go. A contact
/// whose collider becomes a sensor, or ceases to be one, ceases and begins.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ContactLedger {
    seen_by: BTreeMap<ContactKey, Vec<RegionId>>,
    /// The contacts by their second bodies, made once the contacts of a body are to be found: not all worlds
    /// ask for that.
    #[serde(skip)]
    by_second: Option<BTreeSet<(BodyId, ContactKey)>>,
}

impl ContactLedger {
    /// Merges the regions' events of one tick, which must be given in region order. `out` is overwritten.
    /// Forces on a pair add up over the regions that hold it and the substeps of the tick.
    pub fn merge<'a>(&mut self, regions: impl IntoIterator<Item = &'a RegionEvents>, out: &mut WorldEvents) {
        out.touches.clear();
        out.forces.clear();
        let mut changed: BTreeMap<ContactKey, TouchChange> = BTreeMap::new();
        for events in regions {
            for touch in &events.touches {
                if let Some(by_second) = &mut self.by_second {
                    by_second.insert((touch.key.b, touch.key));
                }
                let seen_by = self.seen_by.entry(touch.key).or_default();
                let change = changed.entry(touch.key).or_insert(TouchChange {
                    before: !seen_by.is_empty(),
                    began: None,
                    ended: None,
                });
                if touch.began {
                    if !seen_by.contains(&events.region) {
                        seen_by.push(events.region);
                    }
                    change.began.get_or_insert(*touch);
                } else {
                    seen_by.retain(|&region| region != events.region);
                    change.ended.get_or_insert(*touch);
                }
            }
            out.forces.extend_from_slice(&events.forces);
        }
        for (key, change) in changed {
            let now = !self.seen_by[&key].is_empty();
            if !now {
                self.remove(key);
            }
            let turned = change.began.zip(change.ended).filter(|(began, ended)| began.sensor != ended.sensor);
            if let Some((began, ended)) = turned.filter(|_| change.before && now) {
                out.touches.extend([ended, began]);
                continue;
            }
            if !change.before {
                out.touches.extend(change.began);
            }
            if !now && (change.before || change.began.is_some()) {
                out.touches.extend(change.ended);
            }
        }
        add_up(&mut out.forces);
    }

    /// Renames a region from now on.
    pub fn rename(&mut self, from: RegionId, to: RegionId) {
        for region in self.seen_by.values_mut().flatten().filter(|region| **region == from) {
            *region = to;
        }
    }

    /// Forgets what regions see for which `is_kept` is false.
    pub fn keep_regions(&mut self, mut is_kept: impl FnMut(RegionId) -> bool) {
        self.seen_by.retain(|_, seen_by| {
            seen_by.retain(|&region| is_kept(region));
            !seen_by.is_empty()
        });
        self.by_second = None;
    }

    /// Forgets the contacts of bodies that are no longer in the world.
    pub fn forget_bodies(&mut self, bodies: &BTreeSet<BodyId>) {
        let named = |key: &ContactKey| (key.b, *key);
        let by_second = self.by_second.get_or_insert_with(|| self.seen_by.keys().map(named).collect());
        let lowest = BodyId::from_bits(0);
        let mut gone = Vec::new();
        for &id in bodies {
            let first = ContactKey { a: id, b: lowest, collider_a: 0, collider_b: 0 };
            gone.extend(self.seen_by.range(first..).map(|(key, _)| *key).take_while(|key| key.a == id));
            let first = (id, ContactKey { a: lowest, ..first });
            gone.extend(by_second.range(first..).map(|(_, key)| *key).take_while(|key| key.b == id));
        }
        #[cfg(test)]
        tests::LOOKS.set(tests::LOOKS.get() + gone.len());
        gone.into_iter().for_each(|key| self.remove(key));
    }

    fn remove(&mut self, key: ContactKey) {
        self.seen_by.remove(&key);
        if let Some(by_second) = &mut self.by_second {
            by_second.remove(&(key.b, key));
        }
    }
}

struct TouchChange {
    before: bool,
    began: Option<Touch>,
    ended: Option<Touch>,
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::space::Tick;

    thread_local! {
        pub(super) static LOOKS: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn of_bodies_that_go_the_contacts_alone_are_looked_at() {
        let key = |a, b| ContactKey {
            a: BodyId::persistent(a),
            b: BodyId::persistent(b),
            collider_a: 0,
            collider_b: 0,
        };
        // A row of bodies that each touch the next, and one body that touches all.
        let keys = (1..1_000).map(|a| key(a, a + 1)).chain((1..1_000).map(|b| key(0, b)));
        let touches: Vec<_> = keys.map(|key| Touch { key, ..touch(true) }).collect();
        let mut ledger = ContactLedger::default();
        let tell = |ledger: &mut ContactLedger, touches: Vec<Touch>| {
            ledger.merge(&[RegionEvents { touches, ..seen(1, &[]) }], &mut WorldEvents::default());
        };
        tell(&mut ledger, touches);
        let mut left: BTreeSet<_> = ledger.seen_by.keys().copied().collect();
        let mut forget = |ledger: &mut ContactLedger, ids: &[u32]| {
            let ids: BTreeSet<_> = ids.iter().copied().map(BodyId::persistent).collect();
            let before = LOOKS.get();
            ledger.forget_bodies(&ids);
            left.retain(|key| !ids.contains(&key.a) && !ids.contains(&key.b));
            assert!(ledger.seen_by.keys().eq(&left));
            LOOKS.get() - before
        };
        assert_eq!(forget(&mut ledger, &[500]), 3);
        assert_eq!(forget(&mut ledger, &[500]), 0);
        assert_eq!(forget(&mut ledger, &[501]), 2);
        // Contacts that began or ceased since then must be known too.
        tell(&mut ledger, vec![Touch { key: key(7, 8), ..touch(false) }]);
        assert_eq!(ledger.seen_by.len(), 1_998 - 3 - 2 - 1);
        let mut again = ledger.clone();
        again.by_second = None;
        ledger.forget_bodies(&[BodyId::persistent(8)].into());
        again.forget_bodies(&[BodyId::persistent(8)].into());
        assert!(ledger.seen_by == again.seen_by && ledger.by_second == again.by_second);
    }

    fn touch(began: bool) -> Touch {
        let key =
            ContactKey { a: BodyId::persistent(1), b: BodyId::persistent(2), collider_a: 0, collider_b: 0 };
        Touch { key, began, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }
    }

    fn seen(region: u32, touches: &[bool]) -> RegionEvents {
        let touches = touches.iter().map(|&began| touch(began)).collect();
        RegionEvents { region: RegionId(region), tick: Tick(0), touches, forces: vec![] }
    }

    fn merged(ledger: &mut ContactLedger, regions: &[RegionEvents]) -> Vec<bool> {
        let mut out = WorldEvents::default();
        ledger.merge(regions, &mut out);
        out.touches.iter().map(|touch| touch.began).collect()
    }

    #[test]
    fn a_contact_seen_by_two_regions_begins_and_ceases_once() {
        let mut ledger = ContactLedger::default();
        assert_eq!(merged(&mut ledger, &[seen(1, &[true]), seen(2, &[true])]), [true]);
        assert_eq!(merged(&mut ledger, &[seen(1, &[false])]), [] as [bool; 0]);
        assert_eq!(merged(&mut ledger, &[seen(2, &[false])]), [false]);
    }

    #[cfg(feature = "physics")]
    #[test]
    fn of_the_forces_before_a_tick_and_in_it_the_stronger_is_told() {
        let force = |magnitude_n| ContactForce {
            key: touch(true).key,
            force_n: [0.0, magnitude_n, 0.0],
            magnitude_n,
            threshold_n: 10.0,
        };
        for (early, most_n) in [(vec![4.0, 5.0], 20.0), (vec![8.0, 30.0], 38.0), (vec![15.0], 20.0)] {
            let mut told = WorldEvents { forces: vec![force(20.0)], ..WorldEvents::default() };
            told.add_early(early.into_iter().map(force).collect());
            assert_eq!(told.forces, [force(most_n)]);
        }
    }

    #[test]
    fn forces_on_a_pair_add_up_and_are_told_above_its_threshold() {
        let force = |magnitude_n| ContactForce {
            key: touch(true).key,
            force_n: [0.0, magnitude_n, 0.0],
            magnitude_n,
            threshold_n: 10.0,
        };
        let of = |region, forces| RegionEvents { forces, ..seen(region, &[]) };
        let mut out = WorldEvents::default();
        let mut ledger = ContactLedger::default();
        ledger.merge(&[of(1, vec![force(3.0), force(4.0)]), of(2, vec![force(5.0)])], &mut out);
        assert_eq!((out.forces.len(), out.forces[0].magnitude_n, out.forces[0].force_n[1]), (1, 12.0, 12.0));
        ledger.merge(&[of(1, vec![force(3.0)]), of(2, vec![force(7.0)])], &mut out);
        assert!(out.forces.is_empty(), "10 N are not above 10 N");
    }

    #[test]
    fn a_contact_that_changes_region_is_not_interrupted() {
        let mut ledger = ContactLedger::default();
        assert_eq!(merged(&mut ledger, &[seen(1, &[true])]), [true]);
        assert_eq!(merged(&mut ledger, &[seen(1, &[false]), seen(2, &[true])]), [] as [bool; 0]);
        assert_eq!(merged(&mut ledger, &[seen(2, &[false])]), [false]);
    }

    #[test]
    fn a_contact_that_becomes_that_of_a_sensor_ceases_and_begins_once() {
        let turned = |region| {
            let of = seen(region, &[false, true]);
            let touches = of.touches.into_iter().map(|touch| Touch { sensor: touch.began, ..touch });
            RegionEvents { touches: touches.collect(), ..of }
        };
        let mut ledger = ContactLedger::default();
        assert_eq!(merged(&mut ledger, &[seen(1, &[true]), seen(2, &[true])]), [true]);
        assert_eq!(merged(&mut ledger, &[turned(1), turned(2)]), [false, true]);
        assert_eq!(merged(&mut ledger, &[seen(1, &[false])]), [] as [bool; 0]);
        assert_eq!(merged(&mut ledger, &[seen(2, &[false])]), [false]);
    }

    #[test]
    fn a_contact_that_begins_and_ceases_in_one_tick_is_reported_as_both() {
        let mut ledger = ContactLedger::default();
        assert_eq!(merged(&mut ledger, &[seen(1, &[true, false])]), [true, false]);
    }
}
