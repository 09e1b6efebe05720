//! Defines what a recording needs of physics: that it can be read bit by bit, disturbed on purpose, and
//! commanded.

use std::any::Any;

use super::{BodyBits, digest};
use crate::cluster::{PhysicsCommand, PhysicsEvent};
use crate::space::{BodyId, RegionId};

/// Regions that can be read bit by bit. Those who made the value know its type, and can downcast to it.
pub trait Readout: Any {
    /// Returns the regions that are computed.
    fn regions(&self) -> Vec<RegionId>;
    /// Returns the bodies that a region owns, in any order.
    fn bodies(&self, region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_>;
    /// Sets the state of an owned body, whatever follows from it. Returns whether the body is owned here.
    fn set(&mut self, body: BodyId, bits: &BodyBits) -> bool;
    /// Returns the bodies that a body touches, in id order.
    fn touching(&self, body: BodyId) -> Vec<BodyId>;
}

/// The physics of a node: the real one, or the simulator's stand-in.
pub trait Physics: Readout {
    /// Carries out a command, and returns its answer; `None` for commands that have none.
    fn execute(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, String>;
}

/// Returns the digest of each region.
pub fn digests_of(regions: &(impl Readout + ?Sized)) -> Vec<(RegionId, u64)> {
    regions.regions().into_iter().map(|region| (region, digest(regions.bodies(region)))).collect()
}

/// Returns the region and the state of a body that is owned there.
pub(super) fn bits_of(regions: &(impl Readout + ?Sized), body: BodyId) -> Option<(RegionId, BodyBits)> {
    regions.regions().into_iter().find_map(|region| {
        let bits = regions.bodies(region).find_map(|(id, bits)| (id == body).then_some(bits))?;
        Some((region, bits))
    })
}
