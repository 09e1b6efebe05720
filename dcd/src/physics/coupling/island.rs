//! Islands near borders: awake bodies that touch or are tied, and where they should be computed. An island small enough
//! goes whole to one region, to the one that owns most of it; there it is computed as in one world. Larger ones stay
//! where their bodies are.

use std::cmp::Ordering;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Moment;
use super::reach;
use super::sight::{self, Meeting, Sights};
use crate::physics::convert;
use crate::physics::region::{Link, Region, Role};
use crate::protocol::{BIG_ISLAND, BodyKind};

/// An island that is not whole yet becomes so below this part of the limit, so that none flaps.
const ENTER: f32 = 0.85;
/// An island stays where it is as long as this part of its bodies lies there.
const STAY: f32 = 0.25;

/// The islands that come near a border, as found last; kept for its memory.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Islands {
    /// By Rapier's body index: place in `found`, plus one.
    of: Vec<u32>,
    touched: Vec<RigidBodyHandle>,
    pub found: Vec<Island>,
    #[serde(skip)]
    open: Vec<RigidBodyHandle>,
}

/// Bodies that touch or are tied.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Island {
    /// Those owned here.
    pub members: Vec<Link>,
    /// Too large to move whole.
    pub big: bool,
    /// Something touches it or ties it together.
    pub pressed: bool,
    /// The first with a body that is not held here: with one that is not free, or with any.
    soonest: Option<Meeting>,
    /// Was to be whole already.
    whole: bool,
    /// How many bodies others own of it, by rank.
    elsewhere: Vec<(usize, usize)>,
    /// Rank of the region it goes to, unless it is big.
    pub target: usize,
}

impl Islands {
    /// The island of a body, if it is near a border.
    pub(super) fn of(&self, handle: RigidBodyHandle) -> Option<&Island> {
        let place = *self.of.get(handle.into_raw_parts().0 as usize)?;
        self.found.get((place as usize).checked_sub(1)?)
    }

    /// How many bodies of a body's island this region owns, for others.
    pub(super) fn size(&self, handle: RigidBodyHandle) -> u16 {
        self.of(handle).map_or(1, |island| {
            if island.big {
                BIG_ISLAND
            } else {
                island.members.len().clamp(1, usize::from(BIG_ISLAND) - 1) as u16
            }
        })
    }

    /// Finds anew the islands of these bodies, and where each is to be computed.
    pub(super) fn find(
        &mut self,
        region: &mut Region,
        sights: &Sights,
        moment: Moment<'_>,
        seeds: impl Iterator<Item = RigidBodyHandle>,
    ) {
        for handle in self.touched.drain(..) {
            self.of[handle.into_raw_parts().0 as usize] = 0;
        }
        self.found.clear();
        for seed in seeds {
            if takes_part(region, seed) && self.place(seed) == 0 {
                self.explore(region, sights, moment, seed);
            }
        }
        for island in &mut self.found {
            island.settle(region, moment);
            for link in &island.members {
                region.slot_mut(link.handle).whole = !island.big;
            }
        }
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
        self.touched.push(handle);
        self.open.push(handle);
    }

    /// Follows contacts and joints from a body, until the island is seen to be too large.
    fn explore(&mut self, region: &Region, sights: &Sights, moment: Moment<'_>, seed: RigidBodyHandle) {
        let (limit, tick_s) = (moment.settings.island_limit, moment.settings.dt_s);
        let mut island = Island::default();
        self.open.clear();
        self.enter(seed);
        while let Some(handle) = self.open.pop() {
            let slot = region.slot(handle);
            match slot.role {
                Role::Owner => {
                    island.members.push(Link { id: slot.id, handle });
                    island.pressed |= reach::is_pressed(region, handle);
                    island.whole |= slot.whole;
                    for meeting in sights.meetings_of(slot.id).filter(|meeting| meeting.island > 0) {
                        island.meet(meeting);
                    }
                }
                Role::Replica { owner } => {
                    let heard = slot.shared.iter().flat_map(|shared| &shared.heard);
                    let told = heard.filter(|(rank, _)| *rank == owner).map(|(_, copy)| copy.island).max();
                    island.count(owner, told.unwrap_or(1).max(1));
                }
                Role::Immovable => unreachable!("only what moves is entered"),
            }
            if island.total() > limit {
                island.big = true;
            }
            if island.big {
                break;
            }
            let mut met_big = false;
            let owned = region.slot(handle).role == Role::Owner;
            reach::for_each_contact(region, handle, |other, touches| {
                // Bodies that will touch belong together before they do.
                let linked = touches
                    || owned != (region.slot(other).role == Role::Owner)
                    || sight::will_meet(region, handle, other, tick_s);
                if !linked || !takes_part(region, other) {
                    return;
                }
                match self.place(other) as usize {
                    0 => self.enter(other),
                    place => met_big |= self.found.get(place - 1).is_some_and(|other| other.big),
                }
            });
            island.big |= met_big;
        }
        island.members.sort_unstable_by_key(|link| link.id);
        self.found.push(island);
    }
}

impl Island {
    fn meet(&mut self, meeting: &Meeting) {
        let first = |a: &Meeting, b: &Meeting| (a.free, a.after_s) <= (b.free, b.after_s);
        if self.soonest.is_none_or(|soonest| !first(&soonest, meeting)) {
            self.soonest = Some(*meeting);
        }
        // What is free comes here by itself.
        if !meeting.free {
            self.count(meeting.rank, meeting.island);
        }
    }

    fn count(&mut self, rank: usize, island: u16) {
        self.big |= island == BIG_ISLAND;
        let size = usize::from(island);
        match self.elsewhere.iter_mut().find(|(other, _)| *other == rank) {
            Some((_, most)) => *most = size.max(*most),
            None => self.elsewhere.push((rank, size)),
        }
    }

    fn total(&self) -> usize {
        self.members.len() + self.elsewhere.iter().map(|(_, size)| size).sum::<usize>()
    }

    /// Says where the island is to be computed.
    fn settle(&mut self, region: &Region, moment: Moment<'_>) {
        let own = region.rank();
        let limit = moment.settings.island_limit as f32;
        self.big |= !self.whole && self.total() as f32 > ENTER * limit;
        self.target = own;
        if self.big || self.members.is_empty() {
            return;
        }
        if let Some(meeting) = self.soonest.filter(|_| !self.pressed) {
            let size = self.members.len().cmp(&usize::from(meeting.island));
            self.target = match (meeting.free, size) {
                // What is free goes to what is not, the smaller to the larger, and equals go where they will meet.
                (false, _) | (_, Ordering::Less) => meeting.rank,
                (_, Ordering::Greater) => own,
                _ if meeting.place == own || meeting.place == meeting.rank => meeting.place,
                _ => meeting.rank.min(own),
            };
            return;
        }
        if !self.elsewhere.is_empty() {
            // Most bodies, then the lowest rank: all owners come to the same result.
            let all = self.elsewhere.iter().copied().chain([(own, self.members.len())]);
            let best = all.max_by_key(|&(rank, size)| (size, std::cmp::Reverse(rank)));
            self.target = best.map_or(own, |(rank, _)| rank);
            return;
        }
        let mut centres: Vec<(usize, usize)> = Vec::new();
        for link in &self.members {
            let centre = region.physics().bodies[link.handle].center_of_mass();
            let centre = convert::world_point(region.anchor(), centre);
            let rank = super::membership::home_of(region, moment.partition, centre);
            match centres.iter_mut().find(|(other, _)| *other == rank) {
                Some((_, count)) => *count += 1,
                None => centres.push((rank, 1)),
            }
        }
        let here = centres.iter().find(|(rank, _)| *rank == own).map_or(0, |(_, count)| *count);
        if (here as f32) < STAY * self.members.len() as f32 && !self.has_company(region, moment.settings.dt_s)
        {
            let best = centres.into_iter().max_by_key(|&(rank, count)| (count, std::cmp::Reverse(rank)));
            self.target = best.map_or(own, |(rank, _)| rank);
        }
    }
}

impl Island {
    /// Whether it will meet others of this region soon: it would only come back.
    fn has_company(&self, region: &Region, tick_s: f32) -> bool {
        let stranger = |handle| self.members.iter().all(|member| member.handle != handle);
        self.members.iter().any(|&member| sight::has_company(region, member, tick_s, stranger))
    }
}

/// Islands are of awake bodies that contacts can move.
fn takes_part(region: &Region, handle: RigidBodyHandle) -> bool {
    region.slot(handle).traits.kind == BodyKind::Dynamic && !region.physics().bodies[handle].is_sleeping()
}
