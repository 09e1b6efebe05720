//! Chooses which regions are stepped in a tick, and by how many ticks: those at a lower rate stay behind the present for some ticks and
//! catch up in one step. Regions that share bodies, or are about to, are at one time always, so that copies of one moment are
//! compared.

use super::RegionHost;
use crate::physics::coupling::Side;
use crate::space::{RegionId, RegionSet};

/// The most ticks that any region is behind the present, and one.
const COARSEST: u8 = 4;

impl RegionHost {
    /// Returns the most ticks that one step of a region may have.
    pub(super) fn coarsest(&self) -> u8 {
        if self.governor.is_some() { COARSEST } else { 1 }
    }

    /// Returns by how many ticks a region computed here is behind the present.
    pub fn behind(&self, region: RegionId) -> u8 {
        let side = self.sides.iter().find(|side| side.region.id() == region);
        side.map_or(0, |side| side.clock.owed)
    }

    /// Chooses for each region by how many ticks it is stepped in the tick that begins.
    pub(super) fn schedule(&mut self) {
        let mut levels = [0; 3];
        for group in self.bound() {
            let members =
                || group.iter().filter_map(|rank| self.place_of[rank]).map(|place| &self.sides[place]);
            // Where all rest nothing is stepped, and what was chosen stands.
            let busy = members().filter(|side| !side.is_idle()).map(|side| side.clock.rate).min();
            let rate = busy.or(members().map(|side| side.clock.rate).min()).unwrap_or(1);
            levels[rate.ilog2() as usize] += members().count();
            let owed = members().map(|side| side.clock.owed).max().unwrap_or(0);
            // Groups of one rate take turns, so that ticks take alike.
            let turn = group.iter().next().expect("a group has a member") as u64;
            let is_awaited = members().any(Side::is_awaited);
            let is_due =
                is_awaited || owed + 1 >= rate || (self.tick.0 + 1 + turn).is_multiple_of(rate.into());
            for rank in group.iter() {
                let Some(place) = self.place_of[rank] else { continue };
                let side = &mut self.sides[place];
                // What rests is the same at any time.
                let rests = side.is_idle();
                let owed = if rests { 0 } else { side.clock.owed };
                (side.clock.span, side.clock.owed) =
                    if is_due || rests { (owed + 1, 0) } else { (0, owed + 1) };
            }
        }
        if let Some(governor) = &mut self.governor {
            governor.note_levels(levels);
        }
    }

    /// Returns the regions in groups that must be at one time.
    fn bound(&self) -> Vec<RegionSet> {
        let mut groups: Vec<RegionSet> = Vec::new();
        for side in &self.sides {
            let bound = side.bound_to().union(RegionSet::only(side.region.rank()));
            // Groups are apart: those that it is bound to become one with it.
            let (joined, apart): (Vec<_>, Vec<_>) =
                groups.into_iter().partition(|group| !group.intersection(bound).is_empty());
            groups = apart;
            groups.push(joined.into_iter().fold(bound, RegionSet::union));
        }
        groups
    }
}
