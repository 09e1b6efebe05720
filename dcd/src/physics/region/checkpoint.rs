//! Goes back to a former tick: a region's bodies with what Rapier remembers of their contacts, which poses and velocities do not show.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use super::Region;
use super::characters::Walking;
use super::vehicles::Driving;
use crate::physics::convert;
use crate::protocol::BodyState;
use crate::space::BodyId;

/// What a region held after a tick. It can be restored as long as no body, collider or joint was inserted, removed or changed since.
pub(in crate::physics) struct Checkpoint {
    anchor: [f64; 3],
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    impulse_joints: ImpulseJointSet,
    characters: BTreeMap<BodyId, Walking>,
    vehicles: BTreeMap<BodyId, Driving>,
    solved_dt_s: Vec<f32>,
}

impl Region {
    /// Returns what it holds now, after a step.
    pub(in crate::physics) fn checkpoint(&self) -> Checkpoint {
        let world = &self.world;
        Checkpoint {
            anchor: self.anchor,
            islands: world.islands.clone(),
            broad_phase: world.broad_phase.clone(),
            narrow_phase: world.narrow_phase.clone(),
            bodies: world.bodies.clone(),
            colliders: world.colliders.clone(),
            impulse_joints: world.impulse_joints.clone(),
            characters: self.characters.clone(),
            vehicles: self.vehicles.clone(),
            solved_dt_s: self.solved_dt_s.clone(),
        }
    }

    /// Goes back to what it held.
    pub(in crate::physics) fn restore(&mut self, to: &Checkpoint) {
        self.anchor = to.anchor;
        self.world.islands.clone_from(&to.islands);
        self.world.broad_phase.clone_from(&to.broad_phase);
        self.world.narrow_phase.clone_from(&to.narrow_phase);
        self.world.bodies.clone_from(&to.bodies);
        self.world.colliders.clone_from(&to.colliders);
        self.world.impulse_joints.clone_from(&to.impulse_joints);
        self.characters.clone_from(&to.characters);
        self.vehicles.clone_from(&to.vehicles);
        self.solved_dt_s.clone_from(&to.solved_dt_s);
        self.touched.clear();
        self.moved.take();
        self.stir();
    }

    /// Puts a body held here into another state, as if it had come into that by itself.
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

    /// Has the broad phase find bodies that were put elsewhere since the last step: controllers look there before the next one.
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
