//! Predicts contacts across borders by swept AABBs and balls. Before anything touches, regions exchange the
//! boxes and balls of bodies near the border, with their velocities, and sweep them over the next ticks. Both
//! sides compare the list that they sent with the list that they received, so that both find the same
//! predicted contacts (meetings). A region whose bodies reach into another cell announces how far they reach,
//! and is sent the bodies that are there.
//!
//! This file exchanges the lists. `look` chooses the bodies (`near`) for them, `meeting` compares them, and
//! `held` predicts contacts among the bodies that are in one region already.

mod held;
mod look;
mod meeting;
mod near;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

pub(super) use self::look::{LONGEST_REST, SURPRISE_M_S, look, look_at};
pub(super) use self::meeting::Meeting;
use self::near::Near;
pub(in crate::physics) use self::near::swept_bounds;
use super::neighbours::{LOOKAHEAD_TICKS, Neighbours, are_beside};
use super::{Border, Moment};
use crate::physics::convert;
use crate::physics::outbox::Outbox;
use crate::physics::partition::Partition;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::{BodyRef, Region};
use crate::protocol::{BodyKind, BorderMessage, NearbyBodies, NearbyBody};
use crate::space::{Bounds, RegionSet};

/// The number of ticks for which contacts are predicted ahead. A body that is sent after one tick is compared
/// in the next and held in the one after.
pub(super) const AHEAD_TICKS: f32 = 3.0;
/// The speed, m/s, up to which the narrow phase finds the contacts of a body that both regions hold already.
/// Contacts of faster bodies are predicted.
const SLOW_M_S: f32 = 0.5;
/// The margin, metres, by which the boxes of all bodies are grown when contacts are predicted.
const MARGIN_M: f64 = 0.05;

/// The lists of bodies near the border that a region sent and received, and the contacts predicted from them; kept from tick to tick.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PredictedContacts {
    /// Bodies owned here near or beyond the border, in id order.
    pub near: Vec<Near>,
    /// The bodies sent to each region last, by rank.
    shown: Vec<NearbyBodies>,
    /// The bodies received from each region last, by rank.
    seen: Vec<NearbyBodies>,
    /// Regions with a list that changed, so that contacts with them must be predicted anew.
    changed: RegionSet,
    /// The result of [`PredictedContacts::acquainted`], for as long as no list has changed.
    #[serde(skip)]
    acquainted: Option<RegionSet>,
    /// The predicted contacts, in order of body.
    pub meetings: Vec<Meeting>,
    /// The length of a tick, and how far ahead contacts are predicted, seconds.
    tick_s: f32,
    ahead_s: f32,
    /// The box, in region space, in which bodies concern no other region.
    inner: (Vector, Vector),
    /// The velocities, when they were last looked at, of bodies owned here that were fast, in order of Rapier's handles.
    flying: Vec<(RigidBodyHandle, Vector)>,
    /// Bodies whose velocity has just changed so much that they fly.
    #[serde(skip)]
    pub sudden: Vec<BodyRef>,
    /// Scratch lists by rank.
    lists: Vec<Vec<NearbyBody>>,
}

impl PredictedContacts {
    pub(super) fn new(regions: usize) -> Self {
        let predicted = vec![NearbyBodies::default(); regions];
        Self {
            shown: predicted.clone(),
            seen: predicted,
            lists: vec![Vec::new(); regions],
            inner: (Vector::splat(f32::INFINITY), Vector::splat(f32::NEG_INFINITY)),
            ..Self::default()
        }
    }

    /// Translates all ranks. Where a list has changed, contacts are predicted anew at the end of the next
    /// exchange.
    pub(super) fn remap_ranks(&mut self, ranks: &RankRemap) {
        ranks.list(&mut self.shown, NearbyBodies::default);
        ranks.list(&mut self.seen, NearbyBodies::default);
        ranks.list(&mut self.lists, Vec::new);
        for nearby in self.shown.iter_mut().chain(&mut self.seen) {
            nearby.visitors = ranks.set(nearby.visitors);
            for body in &mut nearby.bodies {
                body.goes = ranks.set(body.goes);
            }
        }
        self.changed = ranks.set(self.changed);
        self.acquainted = None;
        self.meetings.retain(|meeting| ranks.to[meeting.rank].is_some());
        for meeting in &mut self.meetings {
            meeting.rank = ranks.rank(meeting.rank);
            meeting.goes = ranks.set(meeting.goes);
        }
    }

    /// Stores, for every body near the border, the size of its island and whether that is kept here, to be
    /// sent.
    pub(super) fn set_islands(&mut self, of: impl Fn(RigidBodyHandle) -> (u16, bool)) {
        for near in &mut self.near {
            (near.island, near.stays) = of(near.link.handle);
        }
    }

    /// Returns the regions with which a list was exchanged that is not empty, and the regions of which those
    /// said that they visit the same cell. These regions know of it as well.
    pub(super) fn acquainted(&mut self) -> RegionSet {
        if let Some(known) = self.acquainted {
            return known;
        }
        #[cfg(test)]
        LOOKS.set(LOOKS.get() + self.seen.len());
        let listed = |lists: &[NearbyBodies], rank: usize| lists[rank] != NearbyBodies::default();
        let listed =
            (0..self.seen.len()).filter(|&rank| listed(&self.shown, rank) || listed(&self.seen, rank));
        let visitors = self.seen.iter().map(|nearby| nearby.visitors);
        *self.acquainted.insert(visitors.fold(listed.collect(), RegionSet::union))
    }

    /// Returns the regions whose bodies reach out of their cells to this box, as far as they have said so here.
    pub(super) fn reaching(&self, bounds: &Bounds) -> RegionSet {
        self.with_extent(|extent| extent.touches(bounds))
    }

    fn with_extent(&self, is_asked: impl Fn(&Bounds) -> bool) -> RegionSet {
        let asked = |nearby: &NearbyBodies| nearby.extent.as_ref().is_some_and(&is_asked);
        self.seen.iter().enumerate().filter(|(_, nearby)| asked(nearby)).map(|(rank, _)| rank).collect()
    }

    /// Returns the regions to which the extent of this region's bodies is sent: the others that it touches, those
    /// beside both these and this one, whose bodies may come there too, and those whose bodies reach there, as
    /// the regions there report. So no region receives what happens far away.
    fn audience(
        &self,
        own: RegionSet,
        extent: &Bounds,
        partition: &Partition,
        beside: RegionSet,
    ) -> RegionSet {
        let there = partition.touching(extent).without(own);
        let comes = |rank: &usize| there.iter().any(|cell| are_beside(partition, cell, *rank));
        let all = there.union(beside.iter().filter(comes).collect());
        there.iter().fold(all, |all, rank| all.union(self.seen[rank].visitors))
    }

    /// Returns whether a message says no more than how far another region's bodies reach, and that is not into
    /// this one's cell.
    pub(super) fn reaches_elsewhere(&self, region: &Region, rank: usize, message: &BorderMessage) -> bool {
        let Some(nearby) = &message.nearby else { return false };
        let before = &self.seen[rank];
        let extents = [before.extent, nearby.extent];
        let is_elsewhere = extents.iter().flatten().all(|extent| !region.cell().touches(extent));
        let is_same = nearby.bodies == before.bodies && nearby.visitors == before.visitors;
        is_elsewhere && is_same && message.says_only_nearby()
    }

    /// Returns the regions whose bodies reach into this one's cell.
    fn visitors(&self, region: &Region) -> RegionSet {
        self.with_extent(|extent| region.cell().touches(extent))
    }
}

/// Stores the bodies near the border that another region sent. Bodies here that its extent did not reach
/// before are to be checked once: sleeping bodies are not checked by themselves, and bodies far from any
/// border not for some ticks.
pub(super) fn see(region: &Region, border: &mut Border, rank: usize, message: &BorderMessage) {
    let Some(nearby) = &message.nearby else { return };
    let before = border.predicted.seen[rank].extent;
    for part in nearby.extent.iter().flat_map(|extent| beyond(extent, before.as_ref())) {
        let part = part.grown(MARGIN_M);
        let aabb = Aabb::new(
            convert::region_point(region.anchor(), part.min),
            convert::region_point(region.anchor(), part.max),
        );
        let found = region.physics().intersect_aabb_conservative(aabb, QueryFilter::exclude_fixed());
        border.overlooked.extend(found.filter_map(|(_, collider)| collider.parent()));
    }
    let predicted = &mut border.predicted;
    let seen = &mut predicted.seen[rank];
    (seen.extent, seen.visitors) = (nearby.extent, nearby.visitors);
    seen.bodies.clone_from(&nearby.bodies);
    predicted.changed.insert(rank);
    predicted.acquainted = None;
}

/// Returns the parts of a box that lie outside another: a slab for each face that sticks out.
fn beyond(bounds: &Bounds, other: Option<&Bounds>) -> Vec<Bounds> {
    let Some(other) = other.filter(|other| other.touches(bounds)) else { return vec![*bounds] };
    let (mut rest, mut parts) = (*bounds, Vec::new());
    for axis in 0..3 {
        if rest.min[axis] < other.min[axis] {
            let mut part = rest;
            part.max[axis] = other.min[axis];
            rest.min[axis] = other.min[axis];
            parts.push(part);
        }
        if rest.max[axis] > other.max[axis] {
            let mut part = rest;
            part.min[axis] = other.max[axis];
            rest.max[axis] = other.max[axis];
            parts.push(part);
        }
    }
    parts
}

/// Sends every neighbour the bodies near its border, if that list changed.
pub(super) fn show(
    region: &Region,
    predicted: &mut PredictedContacts,
    neighbours: &mut Neighbours,
    outbox: &mut Outbox,
    moment: Moment<'_>,
) {
    let own = RegionSet::only(region.rank());
    let has_strangers = neighbours.has_strangers(moment.partition.len());
    let mut extent: Option<Bounds> = None;
    let fast: Vec<_> = predicted.seen.iter().map(|nearby| fast_bounds(nearby, predicted.ahead_s)).collect();
    let extents = predicted.seen.iter().enumerate();
    let extents: Vec<_> = extents.filter_map(|(rank, nearby)| Some((rank, nearby.extent?))).collect();
    #[cfg(test)]
    LOOKS.set(LOOKS.get() + predicted.near.len() * extents.len());
    let shown = moment.team.spread(&predicted.near, |near| {
        let bounds = near.swept;
        let mut viewers = moment.partition.touching(&bounds);
        for (rank, extent) in &extents {
            if extent.touches(&bounds) {
                viewers.insert(*rank);
            }
        }
        let mut wanted = RegionSet::EMPTY;
        if has_strangers {
            let ahead_s = predicted.ahead_s + LOOKAHEAD_TICKS * predicted.tick_s;
            let soon = near.bounds.swept(near.velocity.to_array(), ahead_s.into());
            wanted = moment.partition.touching(&soon).union(viewers);
        }
        let slot = region.slot(near.link.handle);
        let dynamic = slot.traits.kind == BodyKind::Dynamic;
        // A contact between a fast and a slow body is predicted before they touch, so that both must be sent.
        let meets = |rank: &usize| fast[*rank].is_some_and(|fast| fast.touches(&near.swept));
        // Reach does not spread from a kinematic body, so that its contacts do not keep it where it is held.
        let known = if near.velocity.length() > SLOW_M_S || !dynamic {
            RegionSet::EMPTY
        } else {
            let met = slot.holders.iter().filter(meets).map(RegionSet::only);
            slot.holders.without(met.fold(RegionSet::EMPTY, RegionSet::union))
        };
        let to = viewers.without(known).without(own);
        let nearby = (!to.is_empty()).then(|| NearbyBody {
            // A character stops at what it meets, so that its region must hold that. What carries a multibody
            // is in no other region.
            island: match dynamic {
                true => near.island,
                false => u16::from(slot.traits.character.is_some() || near.articulated),
            },
            goes: if dynamic || near.driven { near.goes(region, moment.partition) } else { RegionSet::EMPTY },
            ..near.nearby()
        });
        let reaches = (!region.cell().contains_box(&bounds)).then_some(bounds);
        (nearby, to, wanted, reaches)
    });
    for (nearby, to, wanted, reaches) in shown {
        neighbours.want(wanted);
        if let Some(bounds) = reaches {
            extent = Some(extent.map_or(bounds, |extent| extent.union(&bounds)));
        }
        if let Some(nearby) = nearby {
            to.iter().for_each(|rank| predicted.lists[rank].push(nearby));
        }
    }
    let audience = extent.map_or(RegionSet::EMPTY, |extent| {
        predicted.audience(own, &extent, moment.partition, neighbours.beside())
    });
    let now = neighbours.now();
    let visitors = predicted.visitors(region);
    for (rank, list) in predicted.lists.iter_mut().enumerate() {
        if !now.contains(rank) {
            list.clear();
            continue;
        }
        let extent = extent.filter(|_| audience.contains(rank));
        let met =
            if visitors.contains(rank) { visitors.without(RegionSet::only(rank)) } else { RegionSet::EMPTY };
        let shown = &mut predicted.shown[rank];
        if (shown.extent, shown.visitors) != (extent, met) || shown.bodies != *list {
            (shown.extent, shown.visitors) = (extent, met);
            std::mem::swap(&mut shown.bodies, list);
            outbox.to(rank).nearby = Some(shown.clone());
            predicted.changed.insert(rank);
            predicted.acquainted = None;
        }
        list.clear();
    }
}

/// Returns a box around all that another region's fast bodies may reach in the ticks to come.
fn fast_bounds(nearby: &NearbyBodies, ahead_s: f32) -> Option<Bounds> {
    let ahead_s = f64::from(ahead_s);
    let fast = nearby.bodies.iter().filter(|body| Vector::from_array(body.velocity).length() > SLOW_M_S);
    fast.map(|body| body.bounds.swept(body.velocity, ahead_s)).reduce(|all, bounds| all.union(&bounds))
}

#[cfg(test)]
thread_local! {
    pub(super) static LOOKS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    impl PredictedContacts {
        /// Forgets with which regions lists were exchanged.
        pub(in crate::physics::coupling) fn forget(&mut self) {
            self.acquainted = None;
        }
    }

    #[test]
    fn parts_beyond_a_box_cover_what_is_not_in_it_and_nothing_twice() {
        let mut dice = ChaCha8Rng::seed_from_u64(7);
        let mut roll =
            |from: f64, to: f64| from + (to - from) * f64::from(dice.next_u32()) / f64::from(u32::MAX);
        let mut around = || {
            let centre = std::array::from_fn(|_| roll(-2.0, 2.0));
            Bounds::around(centre, std::array::from_fn(|_| roll(0.1, 2.0)))
        };
        for _ in 0..200 {
            let (bounds, other) = (around(), around());
            let parts = beyond(&bounds, Some(&other));
            for _ in 0..50 {
                let point = around().centre();
                let inside = |bounds: &Bounds| bounds.contains(&Bounds::new(point, point));
                let expected = usize::from(inside(&bounds) && !inside(&other));
                assert_eq!(parts.iter().filter(|part| inside(part)).count(), expected);
            }
        }
        let bounds = Bounds::around([0.0; 3], [1.0; 3]);
        assert!(beyond(&bounds, Some(&bounds)).is_empty(), "nothing new is nothing to look through");
        assert_eq!(beyond(&bounds, None), [bounds]);
    }
}
