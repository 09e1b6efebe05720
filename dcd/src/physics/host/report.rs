//! Reports what the last step did: contact events, bodies that changed owner, and the time that it took.

use super::RegionHost;
use crate::physics::region::{Profile, Region};
use crate::protocol::{Handover, RegionEvents};

impl RegionHost {
    /// Returns the contact events of the regions since [`RegionHost::clear_events`], in rank order.
    pub fn events(&self) -> impl Iterator<Item = &RegionEvents> {
        self.regions().map(Region::events)
    }

    /// Clears the contact events of the regions.
    pub fn clear_events(&mut self) {
        for side in &mut self.sides {
            side.region.clear_events();
        }
    }

    /// Returns what the last tick took, summed over the regions here.
    pub fn profile(&self) -> Profile {
        let sum = self.regions().fold(Profile::default(), |sum, region| sum.and(&region.profile()));
        Profile { border: self.exchange_time, ..sum }
    }

    /// Returns how many bodies changed owner since the host was made, counted at the new owner.
    pub fn transfers(&self) -> u64 {
        self.transfers
    }

    /// Returns the handovers of bodies from regions here to others in the last [`RegionHost::step`], in id
    /// order.
    pub fn handovers(&self) -> &[Handover] {
        &self.handovers
    }
}
