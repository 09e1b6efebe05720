//! How far borders reach into a region along contacts and joints: which bodies are within some hops of another region's.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::island::{Island, Islands};
use crate::physics::partition::HUB_REACH_M;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::BodyKind;
use crate::space::RegionSet;

/// The regions that each body is within reach of; kept for its memory.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Reach {
    /// By Rapier's body index.
    marks: Vec<RegionSet>,
    /// Bodies with a mark.
    pub reached: Vec<RigidBodyHandle>,
    #[serde(skip)]
    frontier: Vec<(RigidBodyHandle, RegionSet)>,
    #[serde(skip)]
    next: Vec<(RigidBodyHandle, RegionSet)>,
}

impl Reach {
    /// Regions of whose bodies this one is within reach, as found last.
    pub(super) fn of(&self, handle: RigidBodyHandle) -> RegionSet {
        let mark = self.marks.get(handle.into_raw_parts().0 as usize);
        mark.copied().unwrap_or_default()
    }

    /// Finds anew which bodies are within `depth` hops of those that other regions own, or will own: `leaving` are bodies
    /// owned here that are on their way. `met` are bodies owned here that
    /// come near one which is not held here, with the regions that own those: they are one hop away.
    pub(super) fn spread(
        &mut self,
        region: &Region,
        islands: &Islands,
        depth: usize,
        leaving: impl Iterator<Item = (RigidBodyHandle, usize)>,
        met: impl Iterator<Item = (RigidBodyHandle, usize)>,
    ) {
        let draws = |handle| islands.of(handle).is_some_and(|island| island.draws(region.rank()));
        for handle in self.reached.drain(..) {
            self.marks[handle.into_raw_parts().0 as usize] = RegionSet::EMPTY;
        }
        self.frontier.clear();
        for link in region.replicas() {
            if let Ownership::Replica { owner } = region.slot(link.handle).role {
                self.frontier.push((link.handle, RegionSet::only(owner)));
            }
        }
        self.frontier.extend(leaving.map(|(handle, rank)| (handle, RegionSet::only(rank))));
        let mut met = Some(met);
        for _ in 0..depth {
            self.next.clear();
            for index in 0..self.frontier.len() {
                let (handle, set) = self.frontier[index];
                if passes_on(region, handle) {
                    region.for_each_neighbour(handle, |other| {
                        if !region.is_articulated(other) && !draws(other) {
                            self.mark(other, set);
                        }
                    });
                }
            }
            let met = met.take().into_iter().flatten();
            for (handle, rank) in met.filter(|(handle, _)| !region.is_articulated(*handle) && !draws(*handle))
            {
                self.mark(handle, RegionSet::only(rank));
            }
            std::mem::swap(&mut self.frontier, &mut self.next);
        }
    }

    /// Of a small island all is within reach of whom a part of it is: so that they see all that presses on that part. Of a large one
    /// they see less than its owner does, whose word stands.
    pub(super) fn complete(&mut self, region: &Region, islands: &Islands) {
        self.next.clear();
        let small = |island: &&Island| !island.big && island.members.len() > 1 && !island.large;
        for island in islands.found.iter().filter(small) {
            let reached = |link: &BodyRef| self.of(link.handle);
            let all = island.members.iter().map(reached).fold(RegionSet::EMPTY, RegionSet::union);
            for link in island.members.iter().filter(|link| !region.is_articulated(link.handle)) {
                self.mark(link.handle, all);
            }
        }
    }

    /// Marks what no contact moves with the regions of those that it carries: with all that hold what touches it, though
    /// they only follow it there, and with those that `met` names. It must be there before what it carries is owned there.
    pub(super) fn carry(&mut self, region: &Region, met: Vec<(RigidBodyHandle, RegionSet)>) {
        if !region.has_kinematic() {
            return;
        }
        let own = RegionSet::only(region.rank());
        let mut carriers = met;
        for link in region.held_elsewhere() {
            let slot = region.slot(link.handle);
            if slot.traits.kind == BodyKind::Dynamic {
                region.for_each_contact(link.handle, |other, _| carriers.push((other, slot.holders)));
            }
        }
        for (handle, set) in carriers {
            let slot = region.slot(handle);
            let set = set.without(own);
            if slot.role == Ownership::Owner && slot.traits.kind != BodyKind::Dynamic && !set.is_empty() {
                self.mark(handle, set);
            }
        }
    }

    fn mark(&mut self, handle: RigidBodyHandle, set: RegionSet) {
        let index = handle.into_raw_parts().0 as usize;
        if self.marks.len() <= index {
            self.marks.resize(index + 1, RegionSet::EMPTY);
        }
        let new = set.without(self.marks[index]);
        if !new.is_empty() {
            if self.marks[index].is_empty() {
                self.reached.push(handle);
            }
            self.marks[index] = self.marks[index].union(new);
            self.next.push((handle, new));
        }
    }
}

/// A hub, and what no contact moves, is held wherever its neighbours are but does not draw others along.
fn passes_on(region: &Region, handle: RigidBodyHandle) -> bool {
    let slot = region.slot(handle);
    slot.reach_m <= HUB_REACH_M && slot.traits.kind == BodyKind::Dynamic
}
