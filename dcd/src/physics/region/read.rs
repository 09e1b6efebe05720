//! Reads the state of bodies that a region holds, in world space: pose, velocity, records and AABBs.

use rapier3d::prelude::*;

use super::Region;
use crate::physics::{convert, record};
use crate::protocol::{BodyRecord, BodyState, BodyTraits, SharedState, Velocity, WorldPose};
use crate::space::{BodyId, Bounds, Epoch};

impl Region {
    /// Returns the length of the substep in which the contacts of a body were last solved, in seconds.
    /// Rapier's impulses of the body are those of that substep, however long ago it was.
    pub(in crate::physics) fn solved_dt_s(&self, handle: RigidBodyHandle) -> f32 {
        let noted = self.solved_dt_s.get(handle.into_raw_parts().0 as usize);
        noted.copied().unwrap_or(self.world.integration_parameters.dt)
    }

    /// Returns the body of a collider held here, and the collider's index in that body.
    pub(in crate::physics) fn collider_name(&self, collider: ColliderHandle) -> Option<(BodyId, u16)> {
        self.listener.name_of(collider)
    }

    /// Returns a body's pose in world space, as this region sees it.
    #[inline]
    pub fn world_pose(&self, handle: RigidBodyHandle) -> WorldPose {
        convert::world_from_region(self.anchor, self.world.bodies[handle].position())
    }

    /// Returns a body's velocity, as this region sees it.
    #[inline]
    pub fn velocity(&self, handle: RigidBodyHandle) -> Velocity {
        convert::velocity_of(&self.world.bodies[handle])
    }

    /// Returns [`Region::world_pose`] and [`Region::velocity`] of a body, by one look-up.
    #[inline]
    pub fn motion(&self, handle: RigidBodyHandle) -> (WorldPose, Velocity) {
        let body = &self.world.bodies[handle];
        (convert::world_from_region(self.anchor, body.position()), convert::velocity_of(body))
    }

    /// Returns the whole record of a body held here.
    pub fn body_record(&self, handle: RigidBodyHandle) -> BodyRecord {
        let slot = self.slot(handle);
        BodyRecord {
            id: slot.id,
            epoch: slot.epoch,
            state: self.body_state(handle),
            traits: slot.traits.clone(),
            user_data: self.world.bodies[handle].user_data,
        }
    }

    /// Returns the traits of a body held here: all of it that no step changes.
    pub(crate) fn traits_of(&self, handle: RigidBodyHandle) -> &BodyTraits {
        &self.slot(handle).traits
    }

    /// Returns the epoch of a body held here.
    pub fn epoch_of(&self, handle: RigidBodyHandle) -> Epoch {
        self.slot(handle).epoch
    }

    /// Returns the state of a body held here, in world space: all of it that a step changes.
    pub fn body_state(&self, handle: RigidBodyHandle) -> BodyState {
        let mut state = record::state_of(&self.world.bodies[handle], self.anchor);
        if let Some((force, torque)) = self.user_load(handle) {
            (state.force, state.torque) = (force.to_array(), torque.to_array());
        }
        state.gait = self.gait(handle);
        state.drive = self.drive(handle);
        state
    }

    /// Returns the state of a body that its owner sends to the other holders.
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

    /// Returns a cube in world space around the origin of a body, `half_m` metres to each side.
    pub(in crate::physics) fn world_box(&self, handle: RigidBodyHandle, half_m: f64) -> Bounds {
        let centre = convert::world_point(self.anchor, self.world.bodies[handle].translation());
        Bounds::around(centre, [half_m; 3])
    }

    /// Converts a box from region space to world space.
    pub(in crate::physics) fn box_in_world(&self, aabb: Aabb) -> Bounds {
        let point = |point| convert::world_point(self.anchor, point);
        Bounds { min: point(aabb.mins), max: point(aabb.maxs) }
    }

    /// Returns the AABB of a body's colliders now, in world space.
    pub(crate) fn world_bounds(&self, handle: RigidBodyHandle) -> Bounds {
        self.slot(handle).outline.bounds(&self.world.bodies[handle], &self.world.colliders, self.anchor)
    }
}
