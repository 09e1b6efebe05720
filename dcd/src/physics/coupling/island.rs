//! Finds the islands near borders (awake bodies that touch or are tied by joints) and chooses the region that
//! is to compute each. A small enough island moves whole to one region, the one that owns most of it, and is
//! computed there as in one world. The bodies of larger islands stay where they are.
//!
//! An island may lie in many regions, each of which sees only its own part and its neighbours'. So each
//! region sends its neighbours the parts that it knows of and how many hops away they are, nearest first, as
//! many as make the island too large. Sizes spread from part to part, and all regions come to the same sum. A
//! part that no longer exists is reported from ever farther away, until no region reports it one hop nearer;
//! then no region counts it any longer. Meanwhile it may be counted twice. So sizes heard over more than one
//! border must hold for as long as that takes before they make an island whole or split it.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Moment;
use super::shared::SharedBodies;
use crate::physics::outbox::Outbox;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::physics::settings::WHOLE;
use crate::protocol::{BIG_ISLAND, BodyKind, BorderMessage, IslandPart};
use crate::space::{BodyId, RegionSet};

/// The part of the limit below which an island that is not whole becomes so: hysteresis, so that no island
/// flaps.
const ENTER: f32 = 0.85;
/// The part of an island's bodies that must lie in its region for it to stay there. It also stays while half
/// as many lie there as in the region with most of them.
const STAY: f32 = 0.25;
/// The number of bodies above which islands move body by body. Such islands that stay here are searched
/// through only every [`WALK_TICKS`] ticks; a body that is hidden from a border for that long stays held at
/// it.
const LARGE: usize = 256;
const WALK_TICKS: u64 = 8;
/// The least ratio of the sizes of two islands that meet at which the smaller one alone is held by both their
/// regions, if the larger one is anchored.
const OUTWEIGHS: u16 = 2;
/// Ticks from when a region finds its islands until its neighbours have used the parts that it sent.
const TICKS_PER_HOP: u32 = 2;

/// The islands that come near a border, as found last; kept for its memory.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Islands {
    /// The place in `found` plus one, or 0 for a body in no island, by Rapier's body index.
    of: Vec<u32>,
    /// The generation of the body that last entered an island, by Rapier's body index. Another body may have
    /// its place since.
    #[serde(skip)]
    generations: Vec<u32>,
    touched: Vec<RigidBodyHandle>,
    pub found: Vec<Island>,
    /// Parts received from others in the last exchange, with the sender's rank, in order of rank and part.
    told: Vec<(usize, IslandPart)>,
    /// How many of the islands in `found` are kept from earlier ticks.
    #[serde(skip)]
    kept: usize,
    #[serde(skip)]
    open: Vec<RigidBodyHandle>,
    /// Islands that no longer exist, kept for their memory.
    #[serde(skip)]
    spare: Spare,
}

/// Emptied islands, which a copy of the world leaves out.
#[derive(Debug, Default)]
struct Spare(Vec<Island>);

impl Clone for Spare {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// An island: awake bodies that touch or are tied by joints, as far as this region sees them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Island {
    /// Its bodies owned here.
    pub members: Vec<BodyRef>,
    /// How many of its bodies are owned by others and held here.
    ghosts: usize,
    /// The lowest id in it, ghosts among them.
    lowest: Option<BodyId>,
    /// The regions that hold all of its bodies.
    held_by: RegionSet,
    /// Says whether it is too large to move whole.
    pub big: bool,
    /// Says whether it is too large to move at once, by its parts in this region and its direct neighbours.
    pub large: bool,
    /// Says whether the search for it was broken off: it has too many bodies in this region alone, or touches an
    /// island that has.
    endless: bool,
    /// The lowest id of its members, or of the endless island to which it belongs.
    name: Option<BodyId>,
    /// Says whether something touches it or ties it together.
    pub pressed: bool,
    /// Says whether it touches something that no contact moves.
    grounded: bool,
    /// Says whether it does, or is tied to something that no contact moves: its momentum is not conserved.
    pub anchored: bool,
    /// Says whether it is to be whole, by the sizes of its parts; as it was, until these are summed up.
    whole: bool,
    /// Ticks for which the sizes of its parts have contradicted `whole`.
    doubt: u16,
    /// Parts of other regions that it touches, by owner's rank and name.
    beside: Vec<(usize, BodyId)>,
    /// Bodies of other regions whose part has not been received yet, with their owner's rank.
    unheard: Vec<(usize, BodyId)>,
    /// All known parts, this region's first, then by hops.
    parts: Vec<IslandPart>,
    /// How many of its bodies each other region owns, with the rank of that region.
    elsewhere: Vec<(usize, usize)>,
    /// Rank of the region it moves to, unless it is big.
    pub target: usize,
    /// Says whether all of it may move there.
    pub ready: bool,
}

impl Islands {
    /// Returns the island of a body, if it is near a border.
    pub(super) fn of(&self, handle: RigidBodyHandle) -> Option<&Island> {
        let (index, generation) = handle.into_raw_parts();
        let place = *self.of.get(index as usize)? as usize;
        let island = self.found.get(place.checked_sub(1)?)?;
        (self.generations.get(index as usize) == Some(&generation)).then_some(island)
    }

    /// Completes a restore from a snapshot.
    pub(super) fn resume(&mut self) {
        for place in 0..self.touched.len() {
            self.sign(self.touched[place]);
        }
    }

    /// Records the generation of the body with this index.
    fn sign(&mut self, handle: RigidBodyHandle) {
        let (index, generation) = handle.into_raw_parts();
        if self.generations.len() <= index as usize {
            self.generations.resize(self.of.len(), 0);
        }
        self.generations[index as usize] = generation;
    }

    /// Returns how many bodies of a body's island this region owns, as sent to other regions.
    pub(super) fn size(&self, handle: RigidBodyHandle) -> u16 {
        self.of(handle).map_or(1, |island| if island.big { BIG_ISLAND } else { island.own_size().max(1) })
    }

    /// Returns how many bodies a body's island has as this region sees it, ghosts included.
    pub(super) fn seen(&self, handle: RigidBodyHandle) -> u16 {
        self.of(handle).map_or(1, |island| {
            if island.big { BIG_ISLAND } else { told(island.members.len() + island.ghosts) }
        })
    }

    /// Returns whether anything in a body's island, as far as this region owns it, touches something that no
    /// contact moves.
    pub(super) fn is_grounded(&self, handle: RigidBodyHandle) -> bool {
        self.of(handle).is_some_and(|island| island.grounded)
    }

    /// Returns the name of this region's part of a body's island, for the regions that hold the body.
    pub(super) fn part(&self, handle: RigidBodyHandle) -> Option<BodyId> {
        self.of(handle)?.name
    }

    /// Sends the parts of each island that was found last to all regions that hold any of its bodies.
    pub(super) fn tell(&self, region: &Region, outbox: &mut Outbox) {
        let mut hearers = vec![RegionSet::EMPTY; self.found.len()];
        for &handle in &self.touched {
            // Some bodies have moved away since.
            let here = region.physics().bodies.contains(handle);
            let concerned = match region.role_of(handle).filter(|_| here) {
                Some((_, Ownership::Owner)) => region.slot(handle).holders,
                // The owner may hold none of the bodies that touch its body here.
                Some((_, Ownership::Ghost { owner })) => RegionSet::only(owner),
                _ => continue,
            };
            let place = self.of[handle.into_raw_parts().0 as usize] as usize - 1;
            hearers[place] = hearers[place].union(concerned);
        }
        // Islands that belong to an endless one have its name, and are sent once.
        let mut endless: Vec<(Option<BodyId>, RegionSet)> = Vec::new();
        for (island, mut hearers) in self.found.iter().zip(hearers) {
            if island.endless && !hearers.is_empty() {
                match endless.iter_mut().find(|(name, _)| *name == island.name) {
                    Some((_, told)) => {
                        hearers = hearers.without(*told);
                        *told = told.union(hearers);
                    }
                    None => endless.push((island.name, hearers)),
                }
            }
            for rank in hearers.iter() {
                outbox.to(rank).islands.extend_from_slice(&island.parts);
            }
        }
    }

    /// Forgets the parts received in the exchange before.
    pub(super) fn forget_told(&mut self) {
        self.told.clear();
    }

    /// Stores the island parts sent by the region of this rank. Must be called in the order of ranks.
    pub(super) fn hear(&mut self, rank: usize, message: &BorderMessage) {
        let from = self.told.len();
        self.told.extend(message.islands.iter().map(|part| (rank, *part)));
        // The sort is stable: the parts of each island stay in their order.
        self.told[from..].sort_by_key(|(_, part)| part.of);
    }

    fn told_by(&self, rank: usize, name: BodyId) -> impl Iterator<Item = &IslandPart> {
        let from = self.told.partition_point(|(other, part)| (*other, part.of) < (rank, name));
        let those = move |(other, part): &&(usize, IslandPart)| (*other, part.of) == (rank, name);
        self.told[from..].iter().take_while(those).map(|(_, part)| part)
    }

    /// Translates the ranks in all parts, received and found.
    pub(super) fn remap_ranks(&mut self, ranks: &RankRemap) {
        self.told
            .retain(|(rank, part)| ranks.to[*rank].is_some() && ranks.to[usize::from(part.rank)].is_some());
        for (rank, part) in &mut self.told {
            (*rank, part.rank) = (ranks.rank(*rank), ranks.rank(part.rank.into()) as u8);
        }
        self.told.sort_by_key(|(rank, part)| (*rank, part.of));
        for island in &mut self.found {
            island.held_by = ranks.set(island.held_by);
            island.parts.retain(|part| ranks.to[usize::from(part.rank)].is_some());
            for part in &mut island.parts {
                part.rank = ranks.rank(part.rank.into()) as u8;
            }
        }
    }

    /// Finds the islands of these bodies anew, and the region that is to compute each.
    pub(super) fn find(
        &mut self,
        region: &mut Region,
        shared: &SharedBodies,
        moment: Moment<'_>,
        seeds: impl Iterator<Item = RigidBodyHandle>,
    ) {
        self.keep_large(region, shared, moment);
        for seed in seeds {
            if takes_part(region, seed) && self.place(seed) == 0 {
                self.explore(region, shared, moment, seed);
            }
        }
        self.found[..self.kept].iter_mut().for_each(Island::complete);
        let mut names: Vec<_> =
            self.found.iter().enumerate().filter_map(|(place, island)| Some((island.name?, place))).collect();
        names.sort_unstable();
        for place in 0..self.found.len() {
            if self.found[place].name.is_some() {
                let mut parts = std::mem::take(&mut self.found[place].parts);
                self.reckon(place, &names, region.rank(), moment, &mut parts);
                self.found[place].parts = parts;
            }
        }
        for island in &mut self.found {
            island.settle(region, moment);
        }
        for &handle in &self.touched {
            let island = &self.found[self.of[handle.into_raw_parts().0 as usize] as usize - 1];
            let (whole, doubt) = (island.whole, island.doubt);
            if region.slot(handle).role == Ownership::Owner {
                let slot = region.slot_mut(handle);
                (slot.whole, slot.doubt) = (whole, doubt);
            }
        }
    }

    /// Gathers all known parts of an island, up to the limit.
    fn reckon(
        &self,
        place: usize,
        names: &[(BodyId, usize)],
        own: usize,
        moment: Moment<'_>,
        parts: &mut Vec<IslandPart>,
    ) {
        let island = &self.found[place];
        let of = island.name.expect("it has members");
        let part = |name, rank: usize, size, whole, hops| IslandPart {
            of,
            name,
            rank: rank as u8,
            size,
            whole,
            hops,
        };
        parts.clear();
        parts.push(part(of, own, island.own_size(), island.whole, 0));
        for &(rank, name) in &island.beside {
            for told in self.told_by(rank, name) {
                let hops = told.hops.saturating_add(1);
                if usize::from(told.rank) != own {
                    parts.push(IslandPart { of, hops, ..*told });
                    continue;
                }
                // This region knows its own parts best.
                let found = names.partition_point(|(other, _)| *other < told.name);
                if let Some(&(_, found)) = names.get(found).filter(|(other, _)| *other == told.name) {
                    let found = &self.found[found];
                    parts.push(part(told.name, own, found.own_size(), found.whole, hops));
                }
            }
        }
        parts.extend(island.unheard.iter().map(|&(rank, id)| part(id, rank, 1, true, 1)));
        parts.sort_unstable_by_key(|part| (part.name, part.hops, part.rank));
        parts.dedup_by_key(|part| part.name);
        parts.sort_unstable_by_key(|part| (part.hops, part.name));
        let (mut total, mut kept, mut reach) = (0, 0, 0);
        for part in parts.iter() {
            if total > moment.settings.island_limit || part.hops > reach + 1 {
                break;
            }
            (total, kept, reach) = (total + usize::from(part.size), kept + 1, part.hops);
        }
        parts.truncate(kept);
    }

    fn place(&mut self, handle: RigidBodyHandle) -> u32 {
        let index = handle.into_raw_parts().0 as usize;
        if self.of.len() <= index {
            self.of.resize(index + 1, 0);
        }
        self.of[index]
    }

    fn enter(&mut self, handle: RigidBodyHandle) {
        self.of[handle.into_raw_parts().0 as usize] = self.found.len() as u32 + 1;
        self.sign(handle);
        self.touched.push(handle);
        self.open.push(handle);
    }

    /// Follows contacts and joints from a body, until the island is complete or known to be too large.
    fn explore(&mut self, region: &Region, shared: &SharedBodies, moment: Moment<'_>, seed: RigidBodyHandle) {
        let limit = moment.settings.island_limit;
        let from = self.touched.len();
        let mut joins = None;
        let mut island = self.spare.0.pop().unwrap_or_default();
        self.open.clear();
        self.enter(seed);
        while let Some(handle) = self.open.pop() {
            let slot = region.slot(handle);
            island.note(slot.id, held_by(region, shared, handle));
            match slot.role {
                Ownership::Owner => {
                    island.members.push(BodyRef { id: slot.id, handle });
                    island.pressed = island.pressed || region.is_pressed(handle);
                    island.grounded = island.grounded || region.is_grounded(handle);
                    island.anchored = island.anchored || island.grounded || region.is_tied_down(handle);
                    island.whole |= slot.whole;
                    island.doubt = island.doubt.max(slot.doubt);
                    let heard = shared.get(handle).into_iter().flat_map(|shared| &shared.heard);
                    for (rank, copy) in heard.filter(|(_, copy)| !copy.sleeping) {
                        if let Some(part) =
                            copy.part.filter(|&part| self.told_by(*rank, part).next().is_some())
                        {
                            island.beside.push((*rank, part));
                        }
                    }
                }
                Ownership::Ghost { owner } => {
                    island.ghosts += 1;
                    let heard = shared.get(handle).into_iter().flat_map(|shared| &shared.heard);
                    let copy = heard.filter(|(rank, _)| *rank == owner).map(|(_, copy)| copy).next();
                    let part = copy.filter(|copy| !copy.sleeping).and_then(|copy| copy.part);
                    match part.filter(|&part| self.told_by(owner, part).next().is_some()) {
                        Some(part) if island.beside.last() == Some(&(owner, part)) => {}
                        Some(part) => island.beside.push((owner, part)),
                        None => island.unheard.push((owner, slot.id)),
                    }
                }
                Ownership::Immovable => unreachable!("only what moves is entered"),
            }
            if island.members.len() > limit {
                island.endless = true;
            }
            if island.endless {
                break;
            }
            let mut endless = None;
            region.for_each_contact(handle, |other, touches| {
                // An entered body comes again with each pair of colliders, and from its own side.
                let place = self.place(other) as usize;
                if !touches || place > self.found.len() || !takes_part(region, other) {
                    return;
                }
                match place {
                    0 => self.enter(other),
                    place if place <= self.kept => joins = Some(place - 1),
                    place => {
                        let other = self.found.get(place - 1).filter(|other| other.endless);
                        endless = endless.or(other.map(|other| other.name));
                    }
                }
            });
            if let Some(name) = endless {
                (island.endless, island.name) = (true, name);
            }
        }
        match joins {
            Some(place) => {
                for handle in &self.touched[from..] {
                    self.of[handle.into_raw_parts().0 as usize] = place as u32 + 1;
                }
                self.found[place].take_in(island);
            }
            None => {
                island.complete();
                self.found.push(island);
            }
        }
    }

    /// Forgets the islands found last, except large ones that are to stay here. Those are searched through
    /// only every [`WALK_TICKS`] ticks, and bodies that come to touch them join them meanwhile.
    fn keep_large(&mut self, region: &Region, shared: &SharedBodies, moment: Moment<'_>) {
        for handle in self.touched.drain(..) {
            self.of[handle.into_raw_parts().0 as usize] = 0;
        }
        let Self { found, spare, .. } = self;
        if moment.tick.0.is_multiple_of(WALK_TICKS) {
            spare.0.extend(found.drain(..).map(Island::emptied));
        }
        found.retain_mut(|island| {
            // A body inserted since may have a former one's place, but not its handle.
            let here = |link: &BodyRef| {
                region.physics().bodies.contains(link.handle)
                    && region.role_of(link.handle) == Some((link.id, Ownership::Owner))
                    && takes_part(region, link.handle)
            };
            let large = island.members.len() > LARGE && !island.big && island.target == region.rank();
            let stays = large && {
                let held_by = moment
                    .team
                    .spread(&island.members, |link| here(link).then(|| held_by(region, shared, link.handle)));
                island.begin_anew(held_by);
                island.members.len() > LARGE
            };
            if !stays {
                spare.0.push(std::mem::take(island).emptied());
            }
            stays
        });
        self.kept = self.found.len();
        for (place, island) in self.found.iter().enumerate() {
            for link in &island.members {
                self.of[link.handle.into_raw_parts().0 as usize] = place as u32 + 1;
                self.touched.push(link.handle);
            }
        }
    }
}

impl Island {
    /// Returns an island of no bodies that keeps the memory of this one.
    fn emptied(self) -> Self {
        let Self { mut members, mut beside, mut unheard, mut parts, mut elsewhere, .. } = self;
        members.clear();
        beside.clear();
        unheard.clear();
        parts.clear();
        elsewhere.clear();
        Self { members, beside, unheard, parts, elsewhere, ..Self::default() }
    }

    /// Returns whether bodies of other regions belong to it.
    pub(super) fn spans(&self) -> bool {
        self.ghosts > 0 || !self.beside.is_empty()
    }

    /// Returns whether regions with less of it need not hold any of its bodies owned here: this region leads
    /// the island, and the bodies of it that those regions own move here.
    pub(super) fn draws(&self, own: usize) -> bool {
        !self.big && self.target == own && (self.large || !self.elsewhere.is_empty())
    }

    /// Returns the lowest id in it, and the regions that hold all of it.
    pub(super) fn view(&self) -> (BodyId, RegionSet) {
        (self.lowest.expect("an island has bodies"), self.held_by)
    }

    /// Notes a body of the island, and the regions that hold that body.
    fn note(&mut self, id: BodyId, held_by: RegionSet) {
        self.held_by = self.lowest.map_or(held_by, |_| self.held_by.intersection(held_by));
        self.lowest = Some(self.lowest.map_or(id, |lowest| lowest.min(id)));
    }

    /// Merges an island that touches this one into it.
    fn take_in(&mut self, other: Self) {
        let (lowest, held_by) = other.view();
        self.note(lowest, held_by);
        self.members.extend(other.members);
        self.ghosts += other.ghosts;
        self.pressed |= other.pressed;
        self.grounded |= other.grounded;
        self.anchored |= other.anchored;
        self.beside.extend(other.beside);
        self.unheard.extend(other.unheard);
    }

    /// Sorts its members and names it, after all that belongs to it has been found.
    fn complete(&mut self) {
        self.members.sort_unstable_by_key(|link| link.id);
        self.name = self.name.or_else(|| Some(self.members.first()?.id));
        self.beside.sort_unstable();
        self.beside.dedup();
    }

    /// Clears its parts in other regions, which are found anew, and keeps the members that are still here,
    /// with the regions that hold each.
    fn begin_anew(&mut self, held_by: Vec<Option<RegionSet>>) {
        (self.ghosts, self.lowest, self.name) = (0, None, None);
        let mut members = std::mem::take(&mut self.members);
        let mut held_by = held_by.into_iter();
        members.retain(|link| match held_by.next().flatten() {
            Some(held_by) => {
                self.note(link.id, held_by);
                true
            }
            None => false,
        });
        self.members = members;
        self.beside.clear();
        self.unheard.clear();
        self.elsewhere.clear();
    }

    /// Returns how many of its bodies this region owns.
    fn own_size(&self) -> u16 {
        if self.endless { BIG_ISLAND } else { self.members.len().min(usize::from(BIG_ISLAND) - 1) as u16 }
    }

    /// Returns how many bodies are in its parts.
    fn total(&self) -> usize {
        self.parts.iter().map(|part| usize::from(part.size)).sum()
    }

    /// Decides whether the island is to be whole, by the sizes of its parts and by whether these were whole
    /// before.
    fn judge(&mut self, limit: usize) {
        if limit >= WHOLE {
            (self.whole, self.doubt) = (true, 0);
            return;
        }
        let total = self.total();
        let close = total as f32 > ENTER * limit as f32 && !self.parts.iter().all(|part| part.whole);
        let split = total > limit || close;
        if split != self.whole {
            self.doubt = 0;
            return;
        }
        let hops = u32::from(self.parts.last().map_or(0, |part| part.hops));
        // A part one hop away is reported by its owner, and never twice. It takes time to be sure that there
        // are no parts behind it.
        let known = if split { hops <= 1 } else { hops == 0 };
        let patience = if self.endless || known { 0 } else { TICKS_PER_HOP * (hops + 2) };
        self.doubt = self.doubt.saturating_add(1);
        if u32::from(self.doubt) >= patience.max(1) {
            (self.whole, self.doubt) = (!split, 0);
        }
    }

    /// Chooses the region where the island is to be computed.
    fn settle(&mut self, region: &Region, moment: Moment<'_>) {
        let own = region.rank();
        let limit = moment.settings.island_limit;
        self.target = own;
        let known = self.parts.iter().filter(|part| part.hops <= 1).map(|part| usize::from(part.size));
        self.large = known.sum::<usize>() > LARGE;
        if self.members.is_empty() {
            return;
        }
        self.judge(limit);
        let mut here = 0;
        let large = self.large;
        // Reports at second hand are late: in a large island whose parts come together and apart, parts that
        // no longer exist would count.
        for part in self.parts.iter().filter(|part| !large || part.hops <= 1 || usize::from(part.rank) == own)
        {
            let (rank, size) = (usize::from(part.rank), usize::from(part.size));
            match self.elsewhere.iter_mut().find(|(other, _)| *other == rank) {
                _ if rank == own => here += size,
                Some((_, sum)) => *sum += size,
                None => self.elsewhere.push((rank, size)),
            }
        }
        self.big = !self.whole;
        if self.big {
            return;
        }
        if !self.elsewhere.is_empty() {
            // The region with most bodies, among equals the one of the lowest rank: all owners come to the
            // same result.
            let all = self.elsewhere.iter().copied().chain([(own, here)]);
            let best = all.max_by_key(|&(rank, size)| (size, std::cmp::Reverse(rank)));
            self.target = best.map_or(own, |(rank, _)| rank);
            return;
        }
        let mut centres: Vec<(usize, usize)> = Vec::new();
        let mut count = |rank| match centres.iter_mut().find(|(other, _)| *other == rank) {
            Some((_, count)) => *count += 1,
            None => centres.push((rank, 1)),
        };
        let home_of = |link: &BodyRef| moment.home_of(region, link.handle);
        match self.large {
            true => moment.team.spread(&self.members, home_of).into_iter().for_each(count),
            false => self.members.iter().map(home_of).for_each(&mut count),
        }
        let here = centres.iter().find(|(rank, _)| *rank == own).map_or(0, |(_, count)| *count);
        let best = centres.into_iter().max_by_key(|&(rank, count)| (count, std::cmp::Reverse(rank)));
        let stays = (here as f32) >= STAY * self.members.len() as f32;
        if let Some((rank, _)) = best.filter(|&(_, most)| !stays && 2 * here < most) {
            self.target = rank;
        }
    }
}

/// Returns whether an island of so many bodies is so much larger than another that what they solve together is
/// solved where the larger one is. No split island is larger or smaller than another.
pub(super) fn outweighs(one: u16, other: u16) -> bool {
    one < BIG_ISLAND && other > 0 && one >= other.saturating_mul(OUTWEIGHS)
}

/// Returns a number of bodies as it is sent: clamped, so that it is not mistaken for [`BIG_ISLAND`].
fn told(count: usize) -> u16 {
    count.clamp(1, usize::from(BIG_ISLAND) - 1) as u16
}

/// Returns the regions that hold a body, this one included.
fn held_by(region: &Region, shared: &SharedBodies, handle: RigidBodyHandle) -> RegionSet {
    let alone = || region.slot(handle).holders.union(RegionSet::only(region.rank()));
    shared.get(handle).map_or_else(alone, |shared| shared.members)
}

/// Returns whether a body can be part of an island: awake, and movable by contacts.
fn takes_part(region: &Region, handle: RigidBodyHandle) -> bool {
    region.slot(handle).traits.kind == BodyKind::Dynamic && !region.physics().bodies[handle].is_sleeping()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::shapes::ShapeLibrary;
    use crate::protocol::WorldPose;
    use crate::space::{Bounds, Cell, RegionId};

    #[test]
    fn of_two_islands_at_most_one_outweighs_the_other_and_none_a_split_one() {
        for one in [1, 2, 7, 300, BIG_ISLAND - 1] {
            for other in [0, 1, 2, 7, 300, BIG_ISLAND] {
                assert!(!(outweighs(one, other) && outweighs(other, one)), "{one}, {other}");
            }
            assert!(!outweighs(BIG_ISLAND, one));
        }
        assert!(outweighs(40, 1) && !outweighs(1, 1) && !outweighs(40, BIG_ISLAND) && !outweighs(40, 0));
    }

    #[test]
    fn a_body_in_the_place_of_another_is_not_in_its_island() {
        let part = Bounds::around([0.0; 3], [10.0; 3]);
        let mut region = Region::new(RegionId(0), 0, Cell::EVERYWHERE, &part, [0.0; 3]);
        let mut shapes = ShapeLibrary::default();
        let mut insert = |region: &mut Region, index: u32| {
            let (body, ball) = (RigidBodyBuilder::dynamic().build(), ColliderBuilder::ball(0.5));
            let body = shapes.describe(BodyId::persistent(index), WorldPose::default(), &body, &[ball]);
            region.insert(body.unwrap(), Ownership::Owner, RegionSet::EMPTY, &shapes).unwrap()
        };
        let former = insert(&mut region, 0);
        let mut islands = Islands::default();
        assert_eq!(islands.place(former), 0);
        islands.enter(former);
        islands.found.push(Island::default());
        assert!(region.remove(BodyId::persistent(0)));
        let present = insert(&mut region, 1);
        assert_eq!(former.into_raw_parts().0, present.into_raw_parts().0);
        // A snapshot leaves out what can be found again.
        for _ in 0..2 {
            assert!(islands.of(former).is_some() && islands.of(present).is_none());
            assert_eq!(islands.size(present), 1);
            islands.generations.clear();
            islands.resume();
        }
    }
}
