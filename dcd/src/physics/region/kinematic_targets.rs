//! Moves kinematic bodies to their user's targets by the end of the tick, in equal parts over its substeps.
//! Rapier alone would move them there in the first substep and stop them in the others, so that the bodies
//! they touch would feel a multiple of their speed.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Region;
use crate::protocol::BodyKind;

/// The kinematic bodies of a region, their targets, and how many substeps of the tick are done.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct KinematicTargets {
    /// Bodies that are kinematic by position, in order of insertion into the region. A forgotten body stays
    /// here until the next tick begins: taking each out at once would take time in proportion to the others.
    bodies: Vec<Noted>,
    /// The number by which each body is noted as kinematic, by position or by velocity, or 0 if it is not; by
    /// Rapier's body index. `count` is how many are.
    kinematic: Vec<u32>,
    count: usize,
    /// The number that was given last.
    last: u32,
    targets: Vec<(Noted, Pose)>,
    done: usize,
}

/// A kinematic body, and the number by which it was noted. It is forgotten once its index has another number.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Noted {
    handle: RigidBodyHandle,
    number: u32,
}

impl KinematicTargets {
    /// Notes that a body is of this kind from now on.
    pub(super) fn note(&mut self, handle: RigidBodyHandle, kind: BodyKind) {
        self.forget(handle);
        if matches!(kind, BodyKind::KinematicPosition | BodyKind::KinematicVelocity) {
            let index = handle.into_raw_parts().0 as usize;
            if self.kinematic.len() <= index {
                self.kinematic.resize(index + 1, 0);
            }
            // When a number is given again it has long been forgotten: lists are cleared in every tick.
            self.last = self.last.wrapping_add(1).max(1);
            self.kinematic[index] = self.last;
            self.count += 1;
            if kind == BodyKind::KinematicPosition {
                self.bodies.push(Noted { handle, number: self.last });
            }
        }
    }

    /// Returns whether any body here is kinematic.
    pub(super) fn any_kinematic(&self) -> bool {
        self.count > 0
    }

    /// Forgets a body.
    pub(super) fn forget(&mut self, handle: RigidBodyHandle) {
        let number = self.kinematic.get_mut(handle.into_raw_parts().0 as usize);
        if number.is_some_and(|number| std::mem::take(number) != 0) {
            self.count -= 1;
        }
    }

    /// Returns whether a body is still what it was noted as.
    fn holds(&self, noted: Noted) -> bool {
        #[cfg(test)]
        tests::LOOKS.set(tests::LOOKS.get() + 1);
        self.kinematic[noted.handle.into_raw_parts().0 as usize] == noted.number
    }

    /// Returns whether the substep to come is the first of its tick.
    pub(super) fn is_first(&self) -> bool {
        self.done == 0
    }

    /// Gives up the tick under way: the next substep begins one.
    pub(super) fn reset(&mut self) {
        (self.done, self.targets) = (0, Vec::new());
    }
}

/// Sets the kinematic targets of the substep to come, in a tick of `steps` substeps.
pub(super) fn approach(region: &mut Region, steps: usize) {
    let mut targets = std::mem::take(&mut region.targets);
    let bodies = &mut region.world_mut().bodies;
    if targets.done == 0 {
        let mut noted = std::mem::take(&mut targets.bodies);
        noted.retain(|&noted| targets.holds(noted));
        targets.bodies = noted;
        targets.targets.clear();
        let bodies = targets.bodies.iter().filter_map(|&noted| Some((noted, bodies.get(noted.handle)?)));
        let going = bodies.filter(|(_, body)| body.next_position() != body.position() && !body.is_sleeping());
        targets.targets.extend(going.map(|(noted, body)| (noted, *body.next_position())));
    }
    let left = steps.saturating_sub(targets.done).max(1);
    if steps > 1 {
        for (noted, target) in targets.targets.iter().filter(|(noted, _)| targets.holds(*noted)) {
            if let Some(body) = bodies.get_mut(noted.handle) {
                body.set_next_kinematic_position(part_of_way(body, target, left));
            }
        }
    }
    targets.done = if left == 1 { 0 } else { targets.done + 1 };
    region.targets = targets;
}

/// Returns the pose after one of `parts` equal parts of the way. The centre of mass moves in a straight line,
/// as in Rapier.
fn part_of_way(body: &RigidBody, target: &Pose, parts: usize) -> Pose {
    if parts == 1 {
        return *target;
    }
    let (from, centre, t) = (body.position(), body.local_center_of_mass(), 1.0 / parts as f32);
    let (start, end) = (*from * centre, *target * centre);
    let rotation = from.rotation.slerp(target.rotation, t);
    Pose::from_parts(start + (end - start) * t - rotation * centre, rotation)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use rapier3d::prelude::*;

    use crate::runtime::{LocalWorld, WorldConfig};

    thread_local! {
        /// How often a body was checked for being kinematic still.
        pub(super) static LOOKS: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn many_kinematic_bodies_are_forgotten_without_each_being_looked_at_for_each() {
        const MANY: usize = 500;
        let mut world = LocalWorld::new(WorldConfig { threads: 1, ..WorldConfig::default() }).unwrap();
        let door = |world: &mut LocalWorld, i: usize| {
            let body = RigidBodyBuilder::kinematic_position_based();
            let at = Vector::new(2.0 * i as f32, 0.0, 0.0);
            world.insert(body.translation(at), ColliderBuilder::ball(0.5)).unwrap()
        };
        let doors: Vec<_> = (0..MANY).map(|i| door(&mut world, i)).collect();
        world.step().unwrap();
        let before = LOOKS.get();
        for &id in &doors[1..] {
            world.remove(id).unwrap();
        }
        // A new body takes the place of one that is gone, in Rapier too; another one is noted twice.
        let last = door(&mut world, 1);
        for kind in [RigidBodyType::Dynamic, RigidBodyType::KinematicPositionBased] {
            world.update(doors[0], |body| body.set_body_type(kind, true)).unwrap();
        }
        for id in [doors[0], last] {
            let up = |body: &mut RigidBody| body.set_next_kinematic_translation(Vector::new(0.0, 3.0, 0.0));
            world.update(id, up).unwrap();
        }
        world.step().unwrap();
        world.step().unwrap();
        assert!(LOOKS.get() - before <= 2 * MANY, "{} looks", LOOKS.get() - before);
        for id in [doors[0], last] {
            assert_eq!(world.motion(id).unwrap().0.translation[1], 3.0);
        }
    }
}
