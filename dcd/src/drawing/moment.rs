//! Copies what is shown of a world out of it, between two of its steps.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::geometry::{Geometries, Mesh, Part};
use super::slots::Slots;
use super::source::{BorderSeen, ContactSeen, Details, Ghost, RegionSeen, Seen, Source};
use crate::protocol::{BodyKind, WorldPose};
use crate::space::{BodyId, JointId};

/// The most contacts of one picture.
const MOST_CONTACTS: usize = 8192;
/// For how many pictures a slot that became empty is kept so: longer than any picture is kept.
pub(crate) const KEPT_FRAMES: u64 = 2400;

/// A body that came.
pub(crate) struct Arrival {
    pub(crate) slot: u32,
    pub(crate) id: BodyId,
    pub(crate) kind: u8,
    /// Whether it is an avatar of this process.
    pub(crate) own: bool,
    /// Where it is, if it is fixed.
    pub(crate) fixed: Option<WorldPose>,
    pub(crate) parts: Vec<Part>,
}

/// A joint: the slots of its bodies, whether these are fixed, and where it is on each.
#[derive(Clone, Copy)]
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

/// What is shown of a world at a tick, and what changed since the last such look.
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
    /// All joints, if any came or went with bodies.
    pub(crate) joints: Option<Vec<JointSeen>>,
    pub(crate) details: Vec<Details>,
}

/// What a look is to tell besides.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wishes {
    pub(crate) contacts: bool,
    /// Bodies that viewers have chosen.
    pub(crate) chosen: Vec<BodyId>,
}

/// What is known of the world's bodies from one look to the next.
#[derive(Default)]
pub(crate) struct Looker {
    movable: Slots,
    fixed: Slots,
    /// Where fixed bodies are, in id order.
    places: Vec<WorldPose>,
    joints: BTreeMap<JointId, (BodyId, BodyId, [[f32; 3]; 2])>,
    geometries: Geometries,
    number: u64,
    /// Ids of the last look: memory to use again.
    ids: Vec<BodyId>,
}

impl Looker {
    /// Looks at a world; `memory` is a moment that is of no use any more.
    pub(crate) fn look(&mut self, world: &impl Source, wishes: &Wishes, memory: Moment) -> Moment {
        self.number += 1;
        let Moment { mut rows, .. } = memory;
        rows.clear();
        let mut ids = std::mem::take(&mut self.ids);
        ids.clear();
        world.for_each_movable(|id, seen| {
            ids.push(id);
            rows.push(seen);
        });
        let mut moment = Moment { number: self.number, tick: world.tick(), rows, ..Moment::default() };
        let change = self.movable.update(&ids, self.number, KEPT_FRAMES);
        self.ids = ids;
        let mut tied = !change.went.is_empty();
        moment.departures.extend(change.went.into_iter().map(|slot| (slot, false)));
        for (id, slot) in change.came {
            tied |= self.arrive(world, id, slot, None, &mut moment);
        }
        tied |= self.look_at_fixed(world, &mut moment);
        if tied {
            self.joints.retain(|_, (a, b, _)| [*a, *b].iter().all(|&id| world.record(id).is_some()));
            moment.joints = Some(self.joints.values().filter_map(|joint| self.tie(joint)).collect());
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

    fn look_at_fixed(&mut self, world: &impl Source, moment: &mut Moment) -> bool {
        let (mut ids, mut places) = (Vec::new(), Vec::new());
        world.for_each_fixed(|id, &pose| {
            ids.push(id);
            places.push(pose);
        });
        if places == self.places && self.fixed.are(&ids) {
            return false;
        }
        let change = self.fixed.update(&ids, self.number, KEPT_FRAMES);
        moment.departures.extend(change.went.iter().map(|&slot| (slot, true)));
        // All of them: which of many were moved, and were not there before, matters to nobody.
        let slots = Arc::clone(self.fixed.in_order());
        let mut tied = true;
        for ((&id, &slot), &pose) in ids.iter().zip(slots.iter()).zip(&places) {
            tied |= self.arrive(world, id, slot, Some(pose), moment);
        }
        self.places = places;
        tied
    }

    /// Notes a body that came; returns whether it has joints.
    fn arrive(
        &mut self,
        world: &impl Source,
        id: BodyId,
        slot: u32,
        fixed: Option<WorldPose>,
        moment: &mut Moment,
    ) -> bool {
        let Some(record) = world.record(id) else { return false };
        let parts = self.geometries.of_body(&record, |hash| world.shape(hash));
        let kind = match record.traits.kind {
            BodyKind::Dynamic => 0,
            BodyKind::Fixed => 1,
            BodyKind::KinematicPosition | BodyKind::KinematicVelocity => 2,
        };
        moment.arrivals.push(Arrival { slot, id, kind, own: world.is_own(id), fixed, parts });
        let joints = world.joints_of(id);
        let has_joints = !joints.is_empty();
        let anchors = joints.into_iter().map(|joint| {
            let anchors = [joint.frame_a.translation, joint.frame_b.translation];
            (joint.id, (joint.a, joint.b, anchors))
        });
        self.joints.extend(anchors);
        has_joints
    }

    fn tie(&self, (a, b, anchors): &(BodyId, BodyId, [[f32; 3]; 2])) -> Option<JointSeen> {
        let slot = |id: BodyId| {
            let movable = self.movable.of(id).map(|slot| (slot, false));
            movable.or_else(|| self.fixed.of(id).map(|slot| (slot, true)))
        };
        Some(JointSeen { slots: [slot(*a)?, slot(*b)?], anchors: *anchors })
    }
}
