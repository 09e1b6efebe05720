//! Moves kinematic bodies to their user's targets by the end of the tick, in equal parts over its substeps. Rapier alone would
//! have them there after the first substep and still in the others, so that bodies they touch would feel a multiple of their
//! speed.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Region;
use crate::protocol::BodyKind;

/// The kinematic bodies of a region, their targets, and how many substeps of the tick are done.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct KinematicTargets {
    /// Bodies that are kinematic by position, in the order of insertion into the region.
    bodies: Vec<RigidBodyHandle>,
    /// By Rapier's body index: whether it is kinematic, by position or by velocity; and how many are.
    kinematic: Vec<bool>,
    count: usize,
    targets: Vec<(RigidBodyHandle, Pose)>,
    done: usize,
}

impl KinematicTargets {
    /// Notes that a body is of this kind from now on.
    pub(super) fn note(&mut self, handle: RigidBodyHandle, kind: BodyKind) {
        self.forget(handle);
        if kind == BodyKind::KinematicPosition {
            self.bodies.push(handle);
        }
        if matches!(kind, BodyKind::KinematicPosition | BodyKind::KinematicVelocity) {
            let index = handle.into_raw_parts().0 as usize;
            if self.kinematic.len() <= index {
                self.kinematic.resize(index + 1, false);
            }
            self.kinematic[index] = true;
            self.count += 1;
        }
    }

    /// Returns whether any body here is kinematic.
    pub(super) fn any_kinematic(&self) -> bool {
        self.count > 0
    }

    /// Forgets a body.
    pub(super) fn forget(&mut self, handle: RigidBodyHandle) {
        let kinematic = self.kinematic.get_mut(handle.into_raw_parts().0 as usize);
        if kinematic.is_some_and(std::mem::take) {
            self.count -= 1;
            self.bodies.retain(|&other| other != handle);
            self.targets.retain(|(other, _)| *other != handle);
        }
    }

    /// Returns whether the substep to come is the first of its tick.
    pub(super) fn is_first(&self) -> bool {
        self.done == 0
    }

    /// Gives up the tick under way.
    pub(super) fn reset(&mut self) {
        (self.done, self.targets) = (0, Vec::new());
    }
}

/// Sets the kinematic targets of the substep to come, in a tick of `steps` substeps.
pub(super) fn approach(region: &mut Region, steps: usize) {
    let mut targets = std::mem::take(&mut region.targets);
    let bodies = &mut region.world_mut().bodies;
    if targets.done == 0 {
        targets.targets.clear();
        let bodies = targets.bodies.iter().filter_map(|&handle| Some((handle, bodies.get(handle)?)));
        let going = bodies.filter(|(_, body)| body.next_position() != body.position() && !body.is_sleeping());
        targets.targets.extend(going.map(|(handle, body)| (handle, *body.next_position())));
    }
    let left = steps.saturating_sub(targets.done).max(1);
    if steps > 1 {
        for (handle, target) in &targets.targets {
            if let Some(body) = bodies.get_mut(*handle) {
                body.set_next_kinematic_position(part_of_way(body, target, left));
            }
        }
    }
    targets.done = if left == 1 { 0 } else { targets.done + 1 };
    region.targets = targets;
}

/// Returns the pose after one of `parts` equal parts of the way: the centre of mass in a straight line, as Rapier takes it.
fn part_of_way(body: &RigidBody, target: &Pose, parts: usize) -> Pose {
    if parts == 1 {
        return *target;
    }
    let (from, centre, t) = (body.position(), body.local_center_of_mass(), 1.0 / parts as f32);
    let (start, end) = (*from * centre, *target * centre);
    let rotation = from.rotation.slerp(target.rotation, t);
    Pose::from_parts(start + (end - start) * t - rotation * centre, rotation)
}
