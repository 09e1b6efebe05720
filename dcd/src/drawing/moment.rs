//! Copies from a world what is shown of it, between two of its steps.

use std::sync::Arc;

use super::geometry::{Geometries, Mesh, Part};
use super::slots::Slots;
use super::source::{BorderSeen, ContactSeen, Details, Ghost, RegionSeen, Seen, Source, Tie};
use crate::protocol::{BodyKind, WorldPose};
use crate::space::BodyId;

/// The most contacts of one picture.
const MOST_CONTACTS: usize = 8192;
/// The number of pictures for which a slot that became empty stays empty: longer than any picture is kept.
pub(crate) const KEPT_FRAMES: u64 = 2400;

/// A body that came or changed its look. All fixed bodies arrive if one of them came, went or was moved.
pub(crate) struct Arrival {
    pub(crate) slot: u32,
    pub(crate) id: BodyId,
    pub(crate) kind: u8,
    /// Says whether it is an avatar of this process.
    pub(crate) own: bool,
    /// Its pose, if it is fixed.
    pub(crate) fixed: Option<WorldPose>,
    pub(crate) parts: Vec<Part>,
}

/// A joint: the slots of its bodies, whether these are fixed, and its anchors on them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JointSeen {
    pub(crate) slots: [(u32, bool); 2],
    pub(crate) anchors: [[f32; 3]; 2],
}

/// A ghost, by the slot of its body.
#[derive(Clone, Copy)]
pub(crate) struct GhostSeen {
    pub(crate) slot: u32,
    pub(crate) holder: u16,
    pub(crate) off_m_s: f32,
}

/// The state of a world that is shown at a tick, and what changed since the last look.
#[derive(Default)]
pub(crate) struct Moment {
    pub(crate) number: u64,
    pub(crate) tick: u64,
    /// Movable bodies in id order, and their slots.
    pub(crate) rows: Vec<Seen>,
    pub(crate) slots: Arc<Vec<u32>>,
    pub(crate) slot_count: u32,
    pub(crate) regions: Vec<RegionSeen>,
    pub(crate) borders: Vec<BorderSeen>,
    pub(crate) ghosts: Vec<GhostSeen>,
    pub(crate) contacts: Vec<ContactSeen>,
    pub(crate) arrivals: Vec<Arrival>,
    /// Slots that are empty now, and whether they are of fixed bodies.
    pub(crate) departures: Vec<(u32, bool)>,
    pub(crate) meshes: Vec<Mesh>,
    /// All joints, if any came, went, or is on a fixed body that was moved.
    pub(crate) joints: Option<Vec<JointSeen>>,
    pub(crate) details: Vec<Details>,
}

/// What a look includes on request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wishes {
    pub(crate) contacts: bool,
    /// Bodies that viewers have chosen.
    pub(crate) chosen: Vec<BodyId>,
}

/// The state of looks at a world that is kept from one look to the next.
#[derive(Default)]
pub(crate) struct Looker {
    movable: Slots,
    fixed: Slots,
    /// The poses of fixed bodies, in id order.
    places: Vec<WorldPose>,
    joints: Vec<JointSeen>,
    geometries: Geometries,
    number: u64,
    /// The tick of the last look.
    tick: u64,
    /// The ids of the last look, kept to use their memory again.
    ids: Vec<(BodyId, u64)>,
}

impl Looker {
    /// Looks at a world. `memory` is a moment that is no longer needed: its memory is used again.
    pub(crate) fn look(&mut self, world: &impl Source, wishes: &Wishes, memory: Moment) -> Moment {
        self.number += 1;
        let Moment { mut rows, .. } = memory;
        rows.clear();
        let mut ids = std::mem::take(&mut self.ids);
        ids.clear();
        world.for_each_movable(|id, seen| {
            ids.push((id, seen.appearance));
            rows.push(seen);
        });
        let mut moment = Moment { number: self.number, tick: world.tick(), rows, ..Moment::default() };
        // Pictures of later ticks are dropped when the world goes back.
        if moment.tick < std::mem::replace(&mut self.tick, moment.tick) {
            moment.departures.extend((0..self.movable.clear()).map(|slot| (slot, false)));
            moment.departures.extend((0..self.fixed.clear()).map(|slot| (slot, true)));
        }
        let change = self.movable.update(&ids, self.number, KEPT_FRAMES);
        self.ids = ids;
        moment.departures.extend(change.went.into_iter().map(|slot| (slot, false)));
        for (id, slot) in change.came {
            self.arrive(world, id, slot, None, &mut moment);
        }
        let are_moved = self.look_at_fixed(world, &mut moment);
        let joints: Vec<_> = world.joints().values().filter_map(|joint| self.tie(joint)).collect();
        if are_moved || joints != self.joints {
            self.joints.clone_from(&joints);
            moment.joints = Some(joints);
        }
        moment.slots = Arc::clone(self.movable.in_order());
        moment.slot_count = self.movable.count();
        moment.meshes = self.geometries.take_fresh();
        moment.regions = world.regions();
        moment.borders = world.borders();
        let ghost = |ghost: Ghost| {
            let slot = self.movable.of(ghost.id)?;
            Some(GhostSeen { slot, holder: ghost.holder, off_m_s: ghost.off_m_s })
        };
        moment.ghosts = world.ghosts().into_iter().filter_map(ghost).collect();
        if wishes.contacts {
            moment.contacts = world.contacts(MOST_CONTACTS);
        }
        moment.details = wishes.chosen.iter().filter_map(|&id| world.details(id)).collect();
        moment
    }

    /// Looks at the fixed bodies; returns whether any came, went or was moved.
    fn look_at_fixed(&mut self, world: &impl Source, moment: &mut Moment) -> bool {
        let (mut ids, mut places) = (Vec::new(), Vec::new());
        world.for_each_fixed(|id, &pose, appearance| {
            ids.push((id, appearance));
            places.push(pose);
        });
        if places == self.places && self.fixed.are(&ids) {
            return false;
        }
        let change = self.fixed.update(&ids, self.number, KEPT_FRAMES);
        moment.departures.extend(change.went.iter().map(|&slot| (slot, true)));
        // All of them arrive: nobody needs to know which of them came or were moved.
        let slots = Arc::clone(self.fixed.in_order());
        for ((&(id, _), &slot), &pose) in ids.iter().zip(slots.iter()).zip(&places) {
            self.arrive(world, id, slot, Some(pose), moment);
        }
        self.places = places;
        true
    }

    /// Adds a body to the arrivals of a moment.
    fn arrive(
        &mut self,
        world: &impl Source,
        id: BodyId,
        slot: u32,
        fixed: Option<WorldPose>,
        moment: &mut Moment,
    ) {
        let Some(record) = world.record(id) else { return };
        let parts = self.geometries.of_body(&record, |hash| world.shape(hash));
        let kind = match record.traits.kind {
            BodyKind::Dynamic => 0,
            BodyKind::Fixed => 1,
            BodyKind::KinematicPosition | BodyKind::KinematicVelocity => 2,
        };
        moment.arrivals.push(Arrival { slot, id, kind, own: world.is_own(id), fixed, parts });
    }

    fn tie(&self, Tie { bodies: [a, b], anchors }: &Tie) -> Option<JointSeen> {
        let slot = |id: BodyId| {
            let movable = self.movable.of(id).map(|slot| (slot, false));
            movable.or_else(|| self.fixed.of(id).map(|slot| (slot, true)))
        };
        Some(JointSeen { slots: [slot(*a)?, slot(*b)?], anchors: *anchors })
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::drawing::geometry::{BALL, BOX};
    use crate::runtime::{LocalWorld, WorldConfig};

    fn world() -> LocalWorld {
        LocalWorld::new(WorldConfig::default()).unwrap()
    }

    fn insert(world: &mut LocalWorld, body: RigidBodyBuilder, collider: ColliderBuilder) -> BodyId {
        world.insert(body, collider).unwrap()
    }

    fn look(looker: &mut Looker, world: &LocalWorld) -> Moment {
        looker.look(world.host(), &Wishes::default(), Moment::default())
    }

    /// Returns the bodies that came, with their geometries.
    fn came(moment: &Moment) -> Vec<(BodyId, Vec<u16>)> {
        let of = |arrival: &Arrival| arrival.parts.iter().map(|part| part.geometry).collect();
        moment.arrivals.iter().map(|arrival| (arrival.id, of(arrival))).collect()
    }

    #[test]
    fn joints_are_shown_from_when_they_are_made_until_they_are_removed() {
        let mut world = world();
        let ball = ColliderBuilder::ball(0.5);
        let a = insert(&mut world, RigidBodyBuilder::fixed(), ball.clone());
        let b = insert(&mut world, RigidBodyBuilder::dynamic().translation(Vector::X), ball);
        let mut looker = Looker::default();
        look(&mut looker, &world);
        assert_eq!(look(&mut looker, &world).joints, None);
        let joint = world.insert_joint(a, b, RopeJointBuilder::new(2.0)).unwrap();
        let shown = look(&mut looker, &world).joints.expect("it is new");
        assert_eq!((shown.len(), shown[0].slots), (1, [(0, true), (0, false)]));
        assert_eq!(look(&mut looker, &world).joints, None);
        world.remove_joint(joint).unwrap();
        assert_eq!(look(&mut looker, &world).joints, Some(Vec::new()));
    }

    #[test]
    fn a_body_is_shown_anew_where_a_world_that_went_back_gives_its_id_again() {
        let mut world = world();
        let (ball, cube) = (ColliderBuilder::ball(0.5), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        let stays =
            insert(&mut world, RigidBodyBuilder::dynamic().translation(9.0 * Vector::X), ball.clone());
        let checkpoint = world.checkpoint();
        let mut looker = Looker::default();
        let mut play = |kind: &RigidBodyBuilder, collider: &ColliderBuilder| {
            world.rewind(&checkpoint).unwrap();
            let id = insert(&mut world, kind.clone(), collider.clone());
            world.step().unwrap();
            (id, look(&mut looker, &world))
        };
        for kind in [RigidBodyBuilder::dynamic(), RigidBodyBuilder::fixed()] {
            let (id, first) = play(&kind, &ball);
            assert_eq!(came(&first).last(), Some(&(id, vec![BALL])));
            let (again, second) = play(&kind, &cube);
            assert_eq!((again, came(&second)), (id, vec![(id, vec![BOX])]), "{stays} is as it was");
            assert_eq!(second.departures.len(), 1);
            assert!(came(&play(&kind, &cube).1).is_empty(), "it is like the one before");
        }
    }

    #[test]
    fn a_world_that_goes_back_again_and_again_shows_no_more_slots_than_it_has_bodies() {
        let mut world = world();
        let ball = ColliderBuilder::ball(0.5);
        let at = |x: f32| RigidBodyBuilder::dynamic().translation(x * Vector::X);
        let first = insert(&mut world, at(0.0), ball.clone());
        let checkpoint = world.checkpoint();
        let mut looker = Looker::default();
        for _ in 0..5 {
            world.rewind(&checkpoint).unwrap();
            let early = look(&mut looker, &world);
            assert_eq!((&early.slots[..], early.slot_count), (&[0][..], 1));
            world.remove(first).unwrap();
            let others = [2.0, 4.0].map(|x| insert(&mut world, at(x), ball.clone()));
            world.step().unwrap();
            let late = look(&mut looker, &world);
            assert_eq!(came(&late), others.map(|id| (id, vec![BALL])));
            assert_eq!((late.rows.len(), late.slot_count), (2, 3), "the picture before is kept");
        }
    }

    #[test]
    fn a_body_is_shown_anew_once_it_has_another_collider() {
        let mut world = world();
        let id = insert(&mut world, RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5));
        let mut looker = Looker::default();
        look(&mut looker, &world);
        world.insert_collider(id, ColliderBuilder::cuboid(0.1, 0.1, 2.0)).unwrap();
        let moment = look(&mut looker, &world);
        assert_eq!((came(&moment), moment.departures), (vec![(id, vec![BALL, BOX])], vec![(0, false)]));
    }
}
