//! Chooses the region whose result all regions follow, for bodies that several regions compute whole.
//!
//! A collision keeps its momentum only if all bodies in it follow one region, and if that region holds all of
//! them. But regions see different islands: one island here may be two there, and may touch a body that
//! others do not hold. So islands of several regions that have a body in common form a group, and a group
//! follows one region: one that holds all bodies of all these islands, if there is one. Among equals a region
//! in which one of the bodies was stopped in flight comes first, since it has met what the others do not see
//! yet; then the region that sees most of them.
//!
//! Groups are formed among bodies that the same regions hold. These regions all know the same of the bodies,
//! so that all choose alike.

use std::cmp::Reverse;

use rapier3d::prelude::*;

use super::launch::stopped_um;
use super::shared::{Shared, SharedBodies};
use crate::physics::region::{BodyRef, Region};
use crate::protocol::CopyState;
use crate::space::{BodyId, RegionSet};

/// The leader of each group, as found last; kept for its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Leaders {
    /// The place in `parents` plus one, or 0 for a body in no group, by Rapier's body index.
    of: Vec<u32>,
    touched: Vec<RigidBodyHandle>,
    /// The parent of each body: another body of its group that is nearer to the group's root; the root itself
    /// for the root.
    parents: Vec<u32>,
    /// The rank of each group's leader, by place of the group's root.
    leaders: Vec<Option<usize>>,
    copies: Vec<Copied>,
    /// The sets of regions that hold bodies, in order, each with the number by which copies are sorted.
    sets: Vec<(RegionSet, u32)>,
    /// The copies by number of their set of regions, rank, island, place of their body, and their own place.
    order: Vec<(u32, u32, BodyId, u32, u32)>,
    views: Vec<View>,
}

/// One region's copy of a body.
#[derive(Clone, Copy, Debug)]
struct Copied {
    /// The number of the set of regions that hold the body.
    set: u32,
    rank: usize,
    island: BodyId,
    /// The body's place in [`Leaders::parents`].
    place: u32,
    view: View,
}

/// What one region sees of a group.
#[derive(Clone, Copy, Debug)]
struct View {
    root: u32,
    rank: usize,
    /// The regions that hold all that it sees.
    held_by: RegionSet,
    /// How many bodies it sees, and how many of them it owns.
    seen: u32,
    size: u32,
    /// How far one of the bodies was kept back here, micrometres.
    stopped_um: i64,
}

impl Leaders {
    /// Finds the groups of these bodies and their leaders, after copies have been exchanged.
    pub(super) fn find(
        &mut self,
        region: &Region,
        shared: &SharedBodies,
        bodies: impl Iterator<Item = BodyRef>,
        tick_s: f32,
    ) {
        for handle in self.touched.drain(..) {
            self.of[handle.into_raw_parts().0 as usize] = 0;
        }
        self.copies.clear();
        self.sets.clear();
        self.parents.clear();
        for link in bodies {
            if let Some(shared) = shared.get(link.handle) {
                self.enter(region, link.handle, shared, tick_s);
            }
        }
        self.lead();
    }

    /// Returns the rank of the region that leads a body's group; none where nothing touches the body.
    pub(super) fn of(&self, handle: RigidBodyHandle) -> Option<usize> {
        let place = *self.of.get(handle.into_raw_parts().0 as usize)?;
        self.leaders[self.root(place.checked_sub(1)?) as usize]
    }

    /// Enters a body that touches something in any region.
    fn enter(&mut self, region: &Region, handle: RigidBodyHandle, shared: &Shared, tick_s: f32) {
        let counts = |copy: &CopyState| copy.sound && !copy.sleeping;
        let heard = || shared.heard.iter().map(|(rank, copy)| (*rank, copy));
        let all = || heard().chain([(region.rank(), &shared.own)]);
        if !region.physics().bodies[handle].is_dynamic()
            || !all().any(|(_, copy)| counts(copy) && copy.seen > 1)
        {
            return;
        }
        let place = self.parents.len() as u32;
        let index = handle.into_raw_parts().0 as usize;
        if self.of.len() <= index {
            self.of.resize(index + 1, 0);
        }
        self.of[index] = place + 1;
        self.touched.push(handle);
        self.parents.push(place);
        let set = match self.sets.binary_search_by_key(&shared.members, |(set, _)| *set) {
            Ok(at) => self.sets[at].1,
            Err(at) => {
                let number = self.sets.len() as u32;
                self.sets.insert(at, (shared.members, number));
                number
            }
        };
        let leap_m = region.leap_m(handle);
        for (rank, copy) in all().filter(|(_, copy)| counts(copy)) {
            let &CopyState { island, held_by, .. } = copy;
            let behind_um = |(_, ahead): (usize, &CopyState)| stopped_um(ahead, copy, leap_m, tick_s);
            let stopped_um = all().filter(|(_, copy)| counts(copy)).map(behind_um).max().unwrap_or(0);
            let (seen, size) = (copy.seen.into(), copy.size.into());
            let view = View { root: place, rank, held_by, seen, size, stopped_um };
            self.copies.push(Copied { set, rank, island, place, view });
        }
    }

    /// Finds the groups of the copies entered, and their leaders.
    fn lead(&mut self) {
        let key = |(at, copied): (usize, &Copied)| {
            (copied.set, copied.rank as u32, copied.island, copied.place, at as u32)
        };
        self.order.clear();
        self.order.extend(self.copies.iter().enumerate().map(key));
        // The keys are sorted, not the copies, which are large.
        self.order.sort_unstable();
        self.join();
        self.choose();
    }

    /// Joins the bodies of each island of each region, and adds up what each region sees of a group.
    fn join(&mut self) {
        self.views.clear();
        let (copies, order) = (std::mem::take(&mut self.copies), std::mem::take(&mut self.order));
        for island in order.chunk_by(|a, b| (a.0, a.1, a.2) == (b.0, b.1, b.2)) {
            let copies = island.iter().map(|&(.., at)| &copies[at as usize]);
            let first = copies.clone().next().expect("an island has copies");
            let mut all = first.view;
            for copied in copies {
                let (a, b) = (self.root(first.place), self.root(copied.place));
                self.parents[a.max(b) as usize] = a.min(b);
                all.held_by = all.held_by.intersection(copied.view.held_by);
                (all.seen, all.size) = (all.seen.max(copied.view.seen), all.size.max(copied.view.size));
                all.stopped_um = all.stopped_um.max(copied.view.stopped_um);
            }
            self.views.push(all);
        }
        (self.copies, self.order) = (copies, order);
        self.flatten();
        let mut views = std::mem::take(&mut self.views);
        views.iter_mut().for_each(|view| view.root = self.root(view.root));
        views.sort_unstable_by_key(|view| (view.root, view.rank));
        self.views = views;
    }

    /// Chooses the leader of each group.
    fn choose(&mut self) {
        self.leaders.clear();
        self.leaders.resize(self.parents.len(), None);
        for group in self.views.chunk_by(|a, b| a.root == b.root) {
            let held_by = group.iter().fold(RegionSet::ALL, |all, view| all.intersection(view.held_by));
            let of_region = |views: &[View]| {
                let sum = |of: fn(&View) -> u32| views.iter().map(of).fold(0, u32::saturating_add);
                let rank = views[0].rank;
                let stopped_um = views.iter().map(|view| view.stopped_um).max();
                let (seen, size) = (sum(|view| view.seen), sum(|view| view.size));
                (held_by.contains(rank), stopped_um, seen, size, Reverse(rank))
            };
            let best = group.chunk_by(|a, b| a.rank == b.rank).map(of_region).max();
            self.leaders[group[0].root as usize] = best.map(|(.., Reverse(rank))| rank);
        }
    }

    fn root(&self, of: u32) -> u32 {
        let mut at = of;
        while self.parents[at as usize] != at {
            at = self.parents[at as usize];
        }
        at
    }

    /// Points all bodies at the roots of their groups. A root comes before the other bodies of its group.
    fn flatten(&mut self) {
        for place in 0..self.parents.len() {
            self.parents[place] = self.parents[self.parents[place] as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A copy: the place of its body, the rank of its region, the lowest id in its island there, how many bodies that has, and the
    /// regions that hold all of them.
    type Seen<'a> = (u32, usize, u32, u32, &'a [usize]);

    /// Returns the leader of each of so many bodies, which the regions 0 and 1 hold.
    fn leaders(bodies: u32, copies: &[Seen<'_>]) -> Vec<Option<usize>> {
        let copied = |&(place, rank, island, seen, held_by): &Seen<'_>| {
            let held_by = held_by.iter().copied().collect();
            let view = View { root: place, rank, held_by, seen, size: 0, stopped_um: 0 };
            Copied { set: 0, rank, island: BodyId::persistent(island), place, view }
        };
        let mut all = Leaders { parents: (0..bodies).collect(), ..Leaders::default() };
        all.copies = copies.iter().map(copied).collect();
        all.lead();
        (0..bodies).map(|place| all.leaders[all.root(place) as usize]).collect()
    }

    #[test]
    fn islands_that_overlap_follow_one_region_though_each_region_sees_them_apart() {
        // Region 0 sees one island of five; in region 1 its two bodies are in one of two and one of four.
        let copies =
            [(0, 0, 3, 5, &[0, 1][..]), (1, 0, 3, 5, &[0, 1]), (0, 1, 8, 2, &[0, 1]), (1, 1, 9, 4, &[0, 1])];
        assert_eq!(leaders(2, &copies), [Some(1), Some(1)], "six against five");
        let apart = [copies[0], (1, 0, 4, 5, &[0, 1]), copies[2], (1, 1, 9, 6, &[0, 1])];
        assert_eq!(leaders(2, &apart), [Some(0), Some(1)], "each for itself");
    }

    #[test]
    fn who_holds_all_leads_and_where_nobody_does_who_sees_most() {
        let larger = [(0, 0, 3, 9, &[0][..]), (0, 1, 3, 2, &[0, 1])];
        assert_eq!(leaders(1, &larger), [Some(0)]);
        let smaller = [(0, 0, 3, 2, &[0][..]), (0, 1, 3, 9, &[0, 1])];
        assert_eq!(leaders(1, &smaller), [Some(0)], "what strikes it in region 0 is not in region 1");
        let neither = [(0, 0, 3, 2, &[0][..]), (0, 1, 3, 9, &[1])];
        assert_eq!(leaders(1, &neither), [Some(1)]);
    }
}
