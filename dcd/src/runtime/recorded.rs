//! Allows the physics of a node to be recorded and replayed: reads its bodies bit by bit.

use std::collections::BTreeSet;

use rapier3d::prelude::*;

use super::PhysicsDevice;
use crate::cluster::{PhysicsCommand, PhysicsEvent};
use crate::physics::{Ownership, Region, RegionHost};
use crate::recording::{BodyBits, Physics, Readout};
use crate::space::{BodyId, RegionId};

impl Physics for PhysicsDevice {
    fn execute(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, String> {
        self.run(command).map_err(|error| error.to_string())
    }
}

impl Readout for PhysicsDevice {
    fn regions(&self) -> Vec<RegionId> {
        self.host().into_iter().flat_map(|host| host.regions()).map(Region::id).collect()
    }

    fn bodies(&self, region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_> {
        let regions = self.host().into_iter().flat_map(|host| host.regions());
        Box::new(regions.filter(move |one| one.id() == region).flat_map(bodies_of))
    }

    fn set(&mut self, body: BodyId, bits: &BodyBits) -> bool {
        self.host_mut().is_some_and(|host| disturb(host, body, bits))
    }

    fn touching(&self, body: BodyId) -> Vec<BodyId> {
        let Some((region, handle)) = self.host().and_then(|host| host.owned(body)) else { return Vec::new() };
        touching_in(region, handle)
    }
}

/// Sets the state of an owned body; returns whether there is such a body.
pub(super) fn disturb(host: &mut RegionHost, body: BodyId, bits: &BodyBits) -> bool {
    let pose =
        Pose::from_parts(Vector::from_array(bits.translation_f32()), Rotation::from_array(bits.rotation()));
    host.disturb(body, pose, Vector::from_array(bits.linvel()), Vector::from_array(bits.angvel()))
}

/// Returns the movable bodies that a region owns, bit by bit.
pub(super) fn bodies_of(region: &Region) -> impl Iterator<Item = (BodyId, BodyBits)> {
    // In the order of Rapier's set, which is that of memory.
    region.physics().bodies.iter().filter_map(|(handle, body)| {
        let (id, role) = region.role_of(handle)?;
        let bits = || {
            BodyBits::of_f32(
                body.translation().to_array(),
                body.rotation().to_array(),
                body.linvel().to_array(),
                body.angvel().to_array(),
            )
        };
        (role == Ownership::Owner).then(|| (id, bits()))
    })
}

/// Returns the bodies that a body touches in a region, in id order.
pub(super) fn touching_in(region: &Region, handle: RigidBodyHandle) -> Vec<BodyId> {
    let world = region.physics();
    let colliders = world.bodies.get(handle).into_iter().flat_map(|body| body.colliders());
    let pairs = colliders.flat_map(|&collider| world.narrow_phase.contact_pairs_with(collider));
    let touching = pairs.filter(|pair| pair.has_any_active_contact());
    let parents = touching.flat_map(|pair| [pair.collider1, pair.collider2]);
    let bodies = parents.filter_map(|collider| world.colliders.get(collider)?.parent());
    let others: BTreeSet<_> =
        bodies.filter(|other| *other != handle).filter_map(|other| Some(region.role_of(other)?.0)).collect();
    others.into_iter().collect()
}
