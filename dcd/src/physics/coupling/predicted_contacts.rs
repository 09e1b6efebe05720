//! Predicts contacts across borders by swept AABBs and balls. Before anything touches, regions exchange the
//! boxes and balls of bodies near the border, with their velocities, and sweep them over the next ticks. Both
//! sides compare the list that they sent with the list that they received, so that both find the same
//! predicted contacts (meetings). A region whose bodies reach into another cell announces how far they reach,
//! and is sent the bodies that are there.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::island;
use super::neighbours::{LOOKAHEAD_TICKS, Neighbours, are_beside};
use super::sweep::for_each_overlap;
use super::{Border, Moment};
use crate::physics::convert;
use crate::physics::outbox::Outbox;
use crate::physics::partition::Partition;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyKind, BorderMessage, NearbyBodies, NearbyBody};
use crate::space::{BodyId, Bounds, RegionSet};

/// The number of ticks for which contacts are predicted ahead. A body that is sent after one tick is compared
/// in the next and held in the one after.
pub(super) const AHEAD_TICKS: f32 = 3.0;
/// The speed, m/s, up to which the narrow phase finds the contacts of a body that both regions hold already.
/// Contacts of faster bodies are predicted.
const SLOW_M_S: f32 = 0.5;
/// The margin, metres, by which the boxes of all bodies are grown when contacts are predicted.
const MARGIN_M: f64 = 0.05;
/// The most ticks after which a body far from any border is checked again.
const LONGEST_REST: u32 = 8;
/// The gain of speed between checks, m/s, up to which a body is still checked in time.
const SURPRISE_M_S: f32 = 10.0;

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
    /// Bodies whose velocity has just changed by more than their own radius per tick.
    #[serde(skip)]
    pub sudden: Vec<BodyRef>,
    /// Scratch lists by rank.
    lists: Vec<Vec<NearbyBody>>,
}

/// A body owned here near the border, with its AABB and its swept AABB.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Near {
    pub link: BodyRef,
    /// Its AABB now, and the radius of a ball around the middle of that box.
    bounds: Bounds,
    radius_m: f32,
    velocity: Vector,
    /// Its swept AABB: around all that it may reach in the ticks to come.
    pub swept: Bounds,
    awake: bool,
    /// The size of its island as sent: the number of its bodies owned here.
    pub island: u16,
    /// Says whether this region keeps its island at home.
    stays: bool,
    /// Says whether it is a part of a multibody.
    articulated: bool,
    /// Says whether it is a character or a vehicle.
    driven: bool,
    /// Says whether it asks for continuous collision detection.
    ccd: bool,
}

impl Near {
    fn nearby(&self) -> NearbyBody {
        NearbyBody {
            id: self.link.id,
            bounds: self.bounds,
            radius_m: self.radius_m,
            velocity: self.velocity.to_array(),
            awake: self.awake,
            island: self.island,
            stays: self.stays || self.articulated || self.driven,
            articulated: self.articulated,
            driven: self.driven,
            ccd: self.ccd,
            goes: RegionSet::EMPTY,
        }
    }

    /// Returns the regions that hold it, or into whose cells it may come.
    fn goes(&self, region: &Region, partition: &Partition) -> RegionSet {
        region.slot(self.link.handle).holders.union(partition.touching(&self.swept))
    }
}

/// A predicted contact between a body owned here and one that is owned by another region.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Meeting {
    /// The body owned here.
    pub own: BodyId,
    /// The size of its island as sent to the other region; 0 if the other body sleeps, or asks for continuous
    /// collision detection.
    own_island: u16,
    /// Rank of the other body's owner.
    pub rank: usize,
    /// The size of the other body's island, in bodies that its region owns; 1 for a character and for a
    /// kinematic part of a multibody, 0 for any other body that no contact moves.
    pub island: u16,
    /// Says whether the other body stays in its region, whatever it meets.
    pub stays: bool,
    /// Says whether the other body is a part of a multibody.
    pub articulated: bool,
    /// Says whether the other body is a character or a vehicle.
    pub driven: bool,
    /// Regions that hold the other body, or may come to own it soon.
    pub goes: RegionSet,
}

impl Meeting {
    /// Returns whether the island of the body owned here is so much larger than the other one that the other one
    /// alone need be held by both regions. By the sizes that both regions know, never both outweigh.
    pub(super) fn outweighs(self) -> bool {
        !self.stays && island::outweighs(self.own_island, self.island)
    }

    /// Returns the regions that must hold the body owned here for what it meets: the other body's, and those that
    /// the other body goes to if it is driven.
    pub(super) fn concerned(self) -> RegionSet {
        let goes = if self.driven { self.goes } else { RegionSet::EMPTY };
        goes.union(RegionSet::only(self.rank))
    }
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

    /// Predicts contacts with the regions whose lists changed.
    pub(super) fn meet(&mut self) {
        let changed = std::mem::take(&mut self.changed);
        if changed.is_empty() {
            return;
        }
        let Self { meetings, shown, seen, ahead_s, .. } = self;
        meetings.retain(|meeting| !changed.contains(meeting.rank));
        for rank in changed.iter() {
            for_each_overlap(&shown[rank].bodies, &seen[rank].bodies, f64::from(*ahead_s), |own, other| {
                if own.awake || other.awake {
                    let NearbyBody { island, stays, articulated, driven, goes, .. } = *other;
                    // What else belongs to a sleeping body's island is not known. A copy that CCD has not
                    // stopped would go on.
                    let weighs = other.awake && !other.ccd;
                    let (own, own_island) = (own.id, if weighs { own.island } else { 0 });
                    meetings.push(Meeting {
                        own,
                        own_island,
                        rank,
                        island,
                        stays,
                        articulated,
                        driven,
                        goes,
                    });
                }
            });
        }
        meetings.sort_unstable_by_key(|meeting| (meeting.own, meeting.rank, meeting.island));
    }

    /// Returns the regions with whose bodies contacts are predicted, and those that such bodies may come to.
    pub(super) fn met_with(&self) -> RegionSet {
        self.meetings.iter().fold(RegionSet::EMPTY, |all, meeting| {
            all.union(RegionSet::only(meeting.rank)).union(meeting.goes)
        })
    }

    /// Returns the predicted contacts of one body.
    pub(super) fn meetings_of(&self, own: BodyId) -> impl Iterator<Item = &Meeting> {
        let from = self.meetings.partition_point(|meeting| meeting.own < own);
        self.meetings[from..].iter().take_while(move |meeting| meeting.own == own)
    }

    /// Returns the bodies owned here with a predicted contact to a body that is held here and led by another
    /// region, with the rank of that region. It solves the contact, so that it must hold both bodies by then.
    /// Bodies that their owner leads are left out, since meetings name them already.
    pub(super) fn joining(&self, region: &Region) -> Vec<(RigidBodyHandle, usize)> {
        let led = region.held_elsewhere().filter_map(|link| {
            let slot = region.slot(link.handle);
            let rank = slot.led_by.filter(|rank| *rank != region.rank())?;
            let is_met = slot.role == Ownership::Replica { owner: rank };
            (!is_met).then(|| (link, RegionSet::only(rank)))
        });
        let found = self.met_here(region, led, |_| true);
        found.into_iter().flat_map(|(one, ranks)| ranks.iter().map(move |rank| (one, rank))).collect()
    }

    /// Returns the bodies owned here that `asks` selects and that have a predicted contact to a split body
    /// held here, in order of handle: they are to be split too. All regions that hold both solve such a
    /// contact, each against a part of the mass, so that a whole body would get a part of what the other one
    /// loses.
    pub(super) fn splitting(
        &self,
        region: &Region,
        is_split: impl Fn(RigidBodyHandle) -> bool,
        asks: impl Fn(RigidBodyHandle) -> bool,
    ) -> Vec<RigidBodyHandle> {
        let split = region.held_elsewhere().filter(|link| is_split(link.handle));
        let found = self.met_here(region, split.map(|link| (link, RegionSet::EMPTY)), asks);
        let mut found: Vec<_> = found.into_iter().map(|(one, _)| one).collect();
        found.sort_unstable_by_key(|handle| handle.into_raw_parts());
        found.dedup();
        found
    }

    /// Returns the awake bodies owned here that `asks` selects and that have a predicted contact to one of
    /// `held`, with the regions noted with that one.
    fn met_here(
        &self,
        region: &Region,
        held: impl Iterator<Item = (BodyRef, RegionSet)>,
        asks: impl Fn(RigidBodyHandle) -> bool,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let mut held = held.peekable();
        if held.peek().is_none() {
            return Vec::new();
        }
        let asked = self.near.iter().filter(|near| near.awake && asks(near.link.handle));
        let asked: Vec<_> = asked.map(Near::nearby).collect();
        if asked.is_empty() {
            return Vec::new();
        }
        let nearby = |(link, goes)| NearbyBody { goes, ..near(region, link, self.ahead_s).nearby() };
        let held: Vec<_> = held.map(nearby).collect();
        let mut found = Vec::new();
        for_each_overlap(&asked, &held, f64::from(self.ahead_s), |one, other| {
            if one.id != other.id {
                found.extend(region.handle_of(one.id).map(|handle| (handle, other.goes)));
            }
        });
        found
    }

    /// Returns the bodies owned here that are to move to another region and have a predicted contact to a
    /// dynamic body that stays, in order of handle.
    pub(super) fn parting(
        &self,
        region: &Region,
        moves: impl Fn(RigidBodyHandle) -> bool,
    ) -> Vec<RigidBodyHandle> {
        let dynamic = |near: &&Near| region.slot(near.link.handle).traits.kind == BodyKind::Dynamic;
        let all = || self.near.iter().filter(dynamic);
        let is_out = |near: &&Near| near.awake && !region.cell().contains_box(&near.swept);
        let going: Vec<_> = all().filter(is_out).filter(|near| moves(near.link.handle)).collect();
        if going.is_empty() {
            return Vec::new();
        }
        // The boxes of both are swept equally far: how far does not change while a world lasts.
        let around = going.iter().map(|near| near.swept).reduce(|all, bounds| all.union(&bounds));
        let is_in_reach = |near: &&Near| around.is_some_and(|around| around.touches(&near.swept));
        // Bodies that go along need not be out of the cell yet.
        let staying = all().filter(is_in_reach).filter(|near| !moves(near.link.handle)).collect();
        let nearby = |nears: Vec<&Near>| nears.into_iter().map(Near::nearby).collect::<Vec<_>>();
        let mut found = Vec::new();
        for_each_overlap(&nearby(going), &nearby(staying), f64::from(self.ahead_s), |one, _| {
            found.extend(region.handle_of(one.id));
        });
        found.sort_unstable_by_key(|handle| handle.into_raw_parts());
        found.dedup();
        found
    }

    /// Returns the kinematic bodies owned here that may carry bodies of this region, with the regions where
    /// the carried bodies may soon be.
    pub(super) fn carriers(
        &self,
        region: &Region,
        partition: &Partition,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let is_carried = |near: &Near| near.driven || is_dynamic(region, near);
        self.going_with(region, partition, |near| !is_carried(near), is_carried)
    }

    /// Returns the dynamic bodies owned here that a character or a vehicle of this region may meet, with the
    /// regions where that may soon be.
    pub(super) fn on_the_way(
        &self,
        region: &Region,
        partition: &Partition,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        self.going_with(region, partition, |near| is_dynamic(region, near), |near| near.driven)
    }

    /// Returns the bodies that `stays` selects and that may touch one that `goes` selects, with the regions where
    /// that one may soon be.
    fn going_with(
        &self,
        region: &Region,
        partition: &Partition,
        stays: impl Fn(&Near) -> bool,
        goes: impl Fn(&Near) -> bool,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let own = RegionSet::only(region.rank());
        let going = self.near.iter().filter(|near| near.awake && goes(near));
        let going =
            going.map(|near| NearbyBody { goes: near.goes(region, partition).without(own), ..near.nearby() });
        let going: Vec<_> = going.filter(|near| !near.goes.is_empty()).collect();
        if going.is_empty() {
            return Vec::new();
        }
        let staying: Vec<_> = self.near.iter().filter(|near| stays(near)).map(Near::nearby).collect();
        let mut found = Vec::new();
        for_each_overlap(&staying, &going, f64::from(self.ahead_s), |one, other| {
            if one.id != other.id {
                found.extend(region.handle_of(one.id).map(|handle| (handle, other.goes)));
            }
        });
        found
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
        let reaches = |nearby: &NearbyBodies| nearby.extent.is_some_and(|extent| extent.touches(bounds));
        self.seen.iter().enumerate().filter(|(_, nearby)| reaches(nearby)).map(|(rank, _)| rank).collect()
    }

    /// Returns the regions to which the extent of this region's bodies is sent: those that it touches, those
    /// beside both these and this one, whose bodies may come there too, and those whose bodies reach there, as
    /// the regions there report. So no region receives what happens far away.
    fn audience(&self, extent: &Bounds, partition: &Partition, beside: RegionSet) -> RegionSet {
        let there = partition.touching(extent);
        let comes = |rank: &usize| there.iter().any(|cell| are_beside(partition, cell, *rank));
        let all = there.union(beside.iter().filter(comes).collect());
        there.iter().fold(all, |all, rank| all.union(self.seen[rank].visitors))
    }

    /// Returns the regions whose bodies reach into this one's cell.
    fn visitors(&self, region: &Region) -> RegionSet {
        let reaches =
            |nearby: &NearbyBodies| nearby.extent.is_some_and(|extent| region.cell().touches(&extent));
        self.seen.iter().enumerate().filter(|(_, nearby)| reaches(nearby)).map(|(rank, _)| rank).collect()
    }

    /// Finds the part of the region where bodies concern no other region: its cell without what the other
    /// regions' bodies reach into.
    fn find_inner(&mut self, region: &Region) {
        let cell = region.cell();
        let mut inner = Bounds::new(cell.min, cell.max);
        for extent in self.seen.iter().filter_map(|nearby| nearby.extent) {
            cut(&mut inner, &extent);
        }
        let inner = inner.grown(-MARGIN_M);
        self.inner = (
            convert::region_point(region.anchor(), inner.min),
            convert::region_point(region.anchor(), inner.max),
        );
    }

    /// Returns for how many ticks a body surely stays in that part, if nothing speeds it up by more than
    /// [`SURPRISE_M_S`]; at most [`LONGEST_REST`]. A body that is hit harder is checked at most that many
    /// ticks late.
    fn rest_of(&self, region: &Region, handle: RigidBodyHandle) -> u32 {
        let body = &region.physics().bodies[handle];
        let centre = body.center_of_mass();
        let gap = (centre - self.inner.0).min(self.inner.1 - centre).min_element();
        let speed = body.linvel().length() + SURPRISE_M_S;
        let gap = gap - region.slot(handle).reach_m - self.ahead_s * body.linvel().length();
        ((gap / (speed * self.tick_s)).max(0.0) as u32).min(LONGEST_REST)
    }
}

/// Keeps `inner` clear of a box, by moving the face that has the shortest way to go.
fn cut(inner: &mut Bounds, away: &Bounds) {
    if !inner.touches(away) {
        return;
    }
    let (mut least, mut face) = (f64::INFINITY, None);
    for axis in 0..3 {
        let (low, high) = (away.max[axis] - inner.min[axis], inner.max[axis] - away.min[axis]);
        for (distance, upper) in [(low, false), (high, true)] {
            if distance < least {
                (least, face) = (distance, Some((axis, upper)));
            }
        }
    }
    match face {
        Some((axis, true)) => inner.max[axis] = away.min[axis],
        Some((axis, false)) => inner.min[axis] = away.max[axis],
        // It spans an unbounded cell: no part of the cell is out of its reach.
        None => *inner = Bounds::new([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]),
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

/// Checks bodies owned here: keeps a list of those near the border, and lets the others rest.
pub(super) fn look(
    region: &mut Region,
    predicted: &mut PredictedContacts,
    moment: Moment<'_>,
    handles: &[RigidBodyHandle],
) {
    predicted.tick_s = moment.settings.dt_s;
    predicted.ahead_s = ahead_ticks(moment) * moment.settings.dt_s;
    let now = moment.tick.0 as u32;
    predicted.find_inner(region);
    let rests = moment.team.spread(handles, |&handle| {
        (region.slot(handle).role == Ownership::Owner).then(|| predicted.rest_of(region, handle))
    });
    let mut close = Vec::new();
    // By Rapier's body index: the place in `close` plus one.
    let mut places = vec![0; region.index_bound()];
    for (&handle, rest) in handles.iter().zip(rests) {
        let (Some(rest), place) = (rest, &mut places[index_of(handle)]) else { continue };
        if rest > 0 {
            region.rest_until(handle, now + rest);
            *place = FAR;
        } else if *place == 0 {
            close.push(BodyRef { id: region.slot(handle).id, handle });
            *place = close.len() as u32;
        }
    }
    let ahead_s = predicted.ahead_s;
    let mut found: Vec<_> = moment.team.spread(&close, |&link| Some(near(region, link, ahead_s)));
    // By Rapier's handle, not by id, so that nothing is hashed.
    let own = |near: &Near| region.role_of(near.link.handle) == Some((near.link.id, Ownership::Owner));
    let PredictedContacts { near, seen, sudden, tick_s, .. } = predicted;
    let jumps = |link: BodyRef, by: Vector| by.length() * *tick_s > region.slot(link.handle).reach_m;
    sudden.clear();
    near.retain_mut(|known| {
        let place = if own(known) { places[index_of(known.link.handle)] } else { FAR };
        if let Some(anew) = place.checked_sub(1).and_then(|place| found.get_mut(place as usize)?.take()) {
            if jumps(anew.link, anew.velocity - known.velocity) {
                sudden.push(anew.link);
            }
            *known = anew;
        }
        place != FAR
    });
    let mut newcomers: Vec<_> = found.into_iter().flatten().collect();
    // A body that comes so near without having been seen coming was sped up.
    sudden.extend(newcomers.iter().filter(|near| jumps(near.link, near.velocity)).map(|near| near.link));
    if !newcomers.is_empty() {
        newcomers.sort_unstable_by_key(|near| near.link.id);
        near.append(&mut newcomers);
        // The two ordered lists are merged.
        near.sort_by_key(|near| near.link.id);
    }
    // Of many regions, most have no body that reaches out of its cell.
    let extents: Vec<_> = seen.iter().filter_map(|nearby| nearby.extent).collect();
    near.retain_mut(|near| {
        near.awake = !region.physics().bodies[near.link.handle].is_sleeping();
        // A sleeping body that no other region's bodies reach concerns none, until it wakes or their extent
        // reaches it.
        near.awake
            || !region.cell().contains_box(&near.swept)
            || extents.iter().any(|extent| extent.touches(&near.swept))
    });
}

/// The mark of a body that is far from any border.
const FAR: u32 = u32::MAX;

fn is_dynamic(region: &Region, near: &Near) -> bool {
    region.slot(near.link.handle).traits.kind == BodyKind::Dynamic
}

fn index_of(handle: RigidBodyHandle) -> usize {
    handle.into_raw_parts().0 as usize
}

fn near(region: &Region, link: BodyRef, ahead_s: f32) -> Near {
    let body = &region.physics().bodies[link.handle];
    let turn_m = (body.angvel().length() * ahead_s).min(1.0) * region.slot(link.handle).reach_m;
    let bounds = region.world_bounds(link.handle).grown(MARGIN_M + f64::from(turn_m));
    // A region that drives a vehicle holds what its wheels stand on.
    let wheels_m = f64::from(region.wheels_reach_m(link.handle));
    let bounds = match wheels_m {
        0.0 => bounds,
        wheels_m => bounds.union(&region.world_box(link.handle, wheels_m)),
    };
    let velocity = Vector::from_array(convert::velocity_of(body).linear);
    let velocity = region.heading(link.handle, velocity);
    let swept = bounds.swept(velocity.to_array(), f64::from(ahead_s));
    let traits = &region.slot(link.handle).traits;
    Near {
        link,
        bounds,
        radius_m: radius_of(region, link.handle, &bounds),
        velocity,
        swept,
        awake: true,
        island: 1,
        stays: false,
        articulated: region.is_articulated(link.handle),
        driven: traits.character.is_some() || traits.vehicle.is_some(),
        ccd: body.is_ccd_enabled(),
    }
}

/// Returns the radius of a ball around the middle of a body's AABB that holds all of it, however it turns.
fn radius_of(region: &Region, handle: RigidBodyHandle, bounds: &Bounds) -> f32 {
    let slot = region.slot(handle);
    let corner_m = norm(bounds.size()) / 2.0;
    // Only the box includes what a character or a vehicle asks for.
    if slot.traits.character.is_some() || slot.traits.vehicle.is_some() {
        return corner_m as f32;
    }
    let (middle, centre) = (bounds.centre(), region.centre_of(handle));
    let aside_m = norm(std::array::from_fn(|i| middle[i] - centre[i]));
    corner_m.min(aside_m + f64::from(slot.reach_m) + MARGIN_M) as f32
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Returns how many ticks ahead contacts are predicted. They are more where a region may be behind the
/// present time: its bodies are swept from where they were some ticks ago, and it cannot hold a body before
/// it has caught up.
fn ahead_ticks(moment: Moment<'_>) -> f32 {
    AHEAD_TICKS + f32::from(moment.coarsest - 1)
}

/// Returns the swept AABB of a body held here.
pub(in crate::physics) fn swept_bounds(region: &Region, handle: RigidBodyHandle, tick_s: f32) -> Bounds {
    near(region, BodyRef { id: region.slot(handle).id, handle }, AHEAD_TICKS * tick_s).swept
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
        predicted.audience(&extent, moment.partition, neighbours.beside())
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

    #[test]
    fn what_others_reach_into_is_no_longer_inner() {
        let mut inner = Bounds::new([f64::NEG_INFINITY, 0.0, 0.0], [10.0; 3]);
        cut(&mut inner, &Bounds::new([8.0, 2.0, 2.0], [11.0, 4.0, 4.0]));
        assert_eq!((inner.min[0], inner.max), (f64::NEG_INFINITY, [8.0, 10.0, 10.0]));
        cut(&mut inner, &Bounds::new([20.0; 3], [21.0; 3]));
        assert_eq!(inner.max, [8.0, 10.0, 10.0]);
    }
}
