//! Puts bodies into given states, as clients need that predict a world and are told otherwise.

use rapier3d::prelude::*;

use super::Region;
use crate::physics::convert;
use crate::protocol::BodyState;
use crate::space::BodyId;

impl Region {
    /// Puts a body held here into a state, as if it had reached that state by itself.
    pub(in crate::physics) fn put(&mut self, id: BodyId, state: &BodyState) {
        let Some(handle) = self.handle_of(id) else { return };
        let pose = convert::region_from_world(self.anchor, &state.pose);
        self.change(handle, |body| {
            body.set_position(pose, false);
            if state.sleeping {
                body.sleep();
                return;
            }
            body.wake_up(false);
            body.set_linvel(convert::vector(state.velocity.linear), false);
            body.set_angvel(convert::vector(state.velocity.angular), false);
            body.activation_mut().time_since_can_sleep = state.still_s;
        });
        self.set_gait(id, state.gait);
        self.set_drive(id, state.drive);
    }

    /// Updates the broad phase for bodies that came or were put elsewhere since the last step, since controllers
    /// query it before the next one.
    pub(in crate::physics) fn find_moved(&mut self) {
        let touched = self.touched.clone();
        let PhysicsWorld { bodies, colliders, broad_phase, integration_parameters, .. } = self.world_mut();
        bodies.propagate_modified_body_positions_to_colliders(colliders);
        let moved = touched.iter().filter_map(|&handle| bodies.get(handle)).flat_map(RigidBody::colliders);
        for &handle in moved {
            let Some(collider) = colliders.get(handle).filter(|collider| collider.is_enabled()) else {
                continue;
            };
            let aabb = collider.compute_broad_phase_aabb(integration_parameters, bodies);
            broad_phase.set_aabb(integration_parameters, handle, aabb);
        }
    }
}
