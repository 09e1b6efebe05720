//! What a region says of the bodies that it holds, in world space.

use rapier3d::prelude::*;

use super::Region;
use crate::physics::{convert, record};
use crate::protocol::{BodyRecord, BodyState, SharedState, Velocity, WorldPose};
use crate::space::{Bounds, Epoch};

impl Region {
    /// The length of the substep in which the contacts of a body were solved last, in seconds: impulses that Rapier
    /// keeps for it are of that step, be it long ago.
    pub(in crate::physics) fn solved_dt_s(&self, handle: RigidBodyHandle) -> f32 {
        let noted = self.solved_dt_s.get(handle.into_raw_parts().0 as usize);
        noted.copied().unwrap_or(self.world.integration_parameters.dt)
    }

    /// A body's pose in world space, as this region sees it.
    #[inline]
    pub fn world_pose(&self, handle: RigidBodyHandle) -> WorldPose {
        convert::world_from_region(self.anchor, self.world.bodies[handle].position())
    }

    /// How a body moves, as this region sees it.
    #[inline]
    pub fn velocity(&self, handle: RigidBodyHandle) -> Velocity {
        convert::velocity_of(&self.world.bodies[handle])
    }

    /// [`Region::world_pose`] and [`Region::velocity`] of a body, by one look-up.
    #[inline]
    pub fn motion(&self, handle: RigidBodyHandle) -> (WorldPose, Velocity) {
        let body = &self.world.bodies[handle];
        (convert::world_from_region(self.anchor, body.position()), convert::velocity_of(body))
    }

    /// A body held here, whole.
    pub fn body_record(&self, handle: RigidBodyHandle) -> BodyRecord {
        let slot = self.slot(handle);
        BodyRecord {
            id: slot.id,
            epoch: slot.epoch,
            state: self.body_state(handle),
            traits: slot.traits.clone(),
        }
    }

    /// The epoch of a body held here.
    pub fn epoch_of(&self, handle: RigidBodyHandle) -> Epoch {
        self.slot(handle).epoch
    }

    /// What a step changes of a body held here, in world space.
    pub fn body_state(&self, handle: RigidBodyHandle) -> BodyState {
        let mut state = record::state_of(&self.world.bodies[handle], self.anchor);
        if let Some((force, torque)) = self.user_load(handle) {
            (state.force, state.torque) = (force.to_array(), torque.to_array());
        }
        state
    }

    /// What the owner of a body says of it.
    pub fn shared_state(&self, handle: RigidBodyHandle) -> SharedState {
        let (slot, body) = (self.slot(handle), &self.world.bodies[handle]);
        SharedState {
            id: slot.id,
            owner: self.id,
            epoch: slot.epoch,
            pose: convert::world_from_region(self.anchor, body.position()),
            velocity: convert::velocity_of(body),
            sleeping: body.is_sleeping(),
        }
    }

    /// A box around a body's colliders now, in world space.
    pub(in crate::physics) fn world_bounds(&self, handle: RigidBodyHandle) -> Bounds {
        self.slot(handle).outline.bounds(&self.world.bodies[handle], &self.world.colliders, self.anchor)
    }
}
