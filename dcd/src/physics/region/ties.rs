//! Keeps the joints of a region, and inserts them into Rapier and removes them from it. A joint whose bodies
//! several regions hold is solved in each of them. The forces of its motors and springs are split among these
//! regions, as masses are; locks and limits of an axis need no splitting.
//!
//! Joints are inserted into Rapier and removed from it only when its step begins. Until then Rapier would
//! keep note of the change where no snapshot includes it.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Ownership, Region};
use crate::physics::articulation::{self, LinkSettings};
use crate::physics::joints;
use crate::protocol::{JointRecord, LinkMotion};
use crate::space::{BodyId, JointId, RegionSet};

/// A joint as its user knows it, and its handle in Rapier.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct HeldJoint {
    pub record: JointRecord,
    /// None while it is not in Rapier.
    handle: Option<Solver>,
    /// The number of regions that solve it.
    parts: usize,
}

/// The solver of Rapier that has a joint, with the joint's handle there.
#[derive(Clone, Copy, Serialize, Deserialize)]
enum Solver {
    Impulses(ImpulseJointHandle),
    Multibody(MultibodyJointHandle),
}

/// The changes of joints to be applied to Rapier when the next step begins.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct JointNews {
    /// The joints to be inserted, in order of insertion.
    tied: Vec<JointId>,
    /// Says whether all joints in `tied` are known to have nothing to move, or a disabled end. They wait until a
    /// body changes in that.
    #[serde(skip)]
    waits: bool,
    untied: Vec<Solver>,
    /// Removed bodies.
    gone: Vec<RigidBodyHandle>,
    /// Joints changed in place. Rapier knows of the changes, but no snapshot of it includes them.
    changed: Vec<ImpulseJointHandle>,
    /// Bodies to be woken because their joints were changed or removed. Rapier's own list of these has no
    /// order.
    woken: Vec<RigidBodyHandle>,
}

impl Region {
    /// Inserts new joints into Rapier and removes old ones. A step must follow.
    pub(in crate::physics) fn tell_joints(&mut self) {
        let mut news = std::mem::take(&mut self.joint_news);
        for handle in news.untied.drain(..) {
            match handle {
                Solver::Impulses(handle) => drop(self.world_mut().impulse_joints.remove(handle, false)),
                Solver::Multibody(handle) => self.world_mut().multibody_joints.remove(handle, false),
            }
        }
        for handle in news.gone.drain(..) {
            // Nothing is left of the body's joints but its node in the joint graph. A multibody has no body
            // without a joint.
            self.world_mut().impulse_joints.remove_joints_attached_to_rigid_body(handle);
        }
        for handle in news.woken.drain(..) {
            self.world_mut().wake_up(handle, true);
        }
        let mut linked = Vec::new();
        let tied = if news.waits { Vec::new() } else { std::mem::take(&mut news.tied) };
        news.waits = true;
        for id in tied {
            #[cfg(test)]
            tests::LOOKS.set(tests::LOOKS.get() + 1);
            let ends = self.joint_ends(id).filter(|_| self.joints[&id].handle.is_none());
            let Some((a, b)) = ends else { continue };
            if !self.is_solvable(a, b) {
                news.tied.push(id);
                continue;
            }
            if let Some(mut held) = self.joints.remove(&id) {
                held.handle = match held.record.link {
                    Some(_) => self.link(a, b, &held.record).map(Solver::Multibody),
                    None => {
                        let mut joint = joints::joint_of(&held.record);
                        joints::share_out(&mut joint, &held.record, held.parts);
                        // Inserted into the set itself, a joint lets sleepers sleep; inserted by the world,
                        // it would wake them.
                        Some(Solver::Impulses(self.world_mut().impulse_joints.insert(a, b, joint, false)))
                    }
                };
                if let Some(Solver::Multibody(_)) = held.handle {
                    linked.push(id);
                }
                if !held.record.contacts_enabled {
                    self.renew_contacts_between([Some(a), Some(b)]);
                }
                self.joints.insert(id, held);
            }
        }
        for id in linked {
            let held = &self.joints[&id];
            if let (Some(Solver::Multibody(handle)), Some(link)) = (held.handle, held.record.link) {
                articulation::equip_link(&mut self.world_mut().multibody_joints, handle, &link);
            }
        }
        news.changed.clear();
        self.joint_news = news;
    }

    /// Marks a joint to be inserted into Rapier by the next step.
    fn await_solver(&mut self, id: JointId) {
        self.joint_news.tied.push(id);
        self.joint_news.waits = false;
    }

    /// Makes the next step check whether waiting joints can be solved, after a body was enabled or its type
    /// changed.
    pub(in crate::physics) fn look_at_ties(&mut self) {
        self.joint_news.waits = false;
    }

    /// Takes the joints of a body out of Rapier after it was enabled or disabled, and lets them wait until
    /// they can be solved. Rapier itself does not look at the other end.
    pub(super) fn tie_anew(&mut self, handle: RigidBodyHandle) {
        for id in self.slot(handle).joints.clone() {
            let Some(mut held) = self.joints.remove(&id) else { continue };
            if let Some(solver) = held.handle {
                held.record = self.whole_record(&held);
                held.handle = None;
                self.joint_news.untied.push(solver);
                self.await_solver(id);
            } else if let Some(motion) = self.present_motion(&held.record)
                && let Some(link) = &mut held.record.link
            {
                // Its bodies may have moved while it waited.
                link.motion = Some(motion);
            }
            self.joints.insert(id, held);
        }
    }

    /// Returns the motion of a link that is no longer in Rapier, computed from the states of its bodies;
    /// `None` if it never had any.
    fn present_motion(&self, record: &JointRecord) -> Option<LinkMotion> {
        let known = record.link?.motion?;
        let [a, b] = [record.a, record.b].map(|end| self.handle_of(end));
        let (a, b) = (a?, b?);
        let parent = |&of: &RigidBodyHandle| {
            let id = self.slot(of).id;
            let above = self.slot(of).joints.iter().filter_map(|joint| self.joints.get(joint));
            let mut links = above.filter(|above| above.record.link.is_some() && above.record.b == id);
            self.handle_of(links.next()?.record.a)
        };
        // Bounded, since another process may have sent a loop.
        let root = std::iter::successors(Some(a), parent).take(self.joints.len() + 1).last()?;
        let [a, b, root] = [a, b, root].map(|body| self.body_state(body));
        Some(articulation::motion_of(&joints::joint_of(record), Some(&known), &a, &b, &root))
    }

    /// Returns whether a joint between two bodies has anything to move, and no disabled end. Rapier would
    /// panic at any other joint, so such joints wait.
    fn is_solvable(&self, a: RigidBodyHandle, b: RigidBodyHandle) -> bool {
        let [a, b] = [a, b].map(|end| &self.physics().bodies[end]);
        (a.is_dynamic() || b.is_dynamic()) && a.is_enabled() && b.is_enabled()
    }

    /// Makes the second body a link of the first one's multibody, unless one of them is a ghost here: ghosts
    /// follow their owner's state.
    fn link(
        &mut self,
        a: RigidBodyHandle,
        b: RigidBodyHandle,
        record: &JointRecord,
    ) -> Option<MultibodyJointHandle> {
        let is_ghost = |end| matches!(self.slot(end).role, Ownership::Ghost { .. });
        // Rapier ends the program at a link that is not dynamic.
        if is_ghost(a) || is_ghost(b) || !self.physics().bodies[b].is_dynamic() {
            return None;
        }
        let joint = joints::joint_of(record);
        articulation::insert_link(&mut self.world_mut().multibody_joints, a, b, joint, &record.link?)
    }

    /// Inserts or removes the multibody joints of a body whose owner has changed: only the owner's region
    /// solves a multibody.
    pub(in crate::physics) fn relink(&mut self, handle: RigidBodyHandle) {
        for id in self.slot(handle).joints.clone() {
            let Some(mut held) = self.joints.remove(&id) else { continue };
            if held.record.link.is_some() {
                let owned = !matches!(self.slot(handle).role, Ownership::Ghost { .. });
                match held.handle {
                    None if owned => self.await_solver(id),
                    Some(solver) if !owned => {
                        held.record = self.whole_record(&held);
                        self.joint_news.untied.push(solver);
                        held.handle = None;
                    }
                    _ => {}
                }
            }
            self.joints.insert(id, held);
        }
    }

    /// Removes a body from Rapier's world; its joints stay until the next step begins.
    pub(in crate::physics) fn remove_from_rapier(&mut self, handle: RigidBodyHandle) {
        self.unstepped.remove(&handle.into_raw_parts().0);
        let PhysicsWorld {
            bodies, islands, colliders, impulse_joints, multibody_joints, soft_bodies, ..
        } = self.world_mut();
        let is_tied = impulse_joints.attached_joints(handle).next().is_some();
        if !is_tied && multibody_joints.rigid_body_link(handle).is_none() {
            bodies.remove(handle, islands, colliders, impulse_joints, multibody_joints, soft_bodies, true);
            return;
        }
        let (mut none, mut no_links) = (ImpulseJointSet::new(), MultibodyJointSet::new());
        bodies.remove(handle, islands, colliders, &mut none, &mut no_links, soft_bodies, true);
        self.joint_news.gone.push(handle);
    }

    /// Marks the joints that were changed since the last step as changed in Rapier again, after the region
    /// was restored from a snapshot.
    pub(in crate::physics) fn repeat_joint_changes(&mut self) {
        for handle in self.joint_news.changed.clone() {
            let _ = self.world_mut().impulse_joints.get_mut(handle, false);
        }
    }

    /// Inserts a joint, if it is not here yet. If only one of its bodies is held here, the joint waits for
    /// the other.
    pub(in crate::physics) fn insert_joint(&mut self, joint: &JointRecord) {
        if let Some(held) = self.joints.get_mut(&joint.id) {
            // The state of the link at its owner, for the region that solves it next.
            if held.handle.is_none() && joint.link.is_some_and(|link| link.motion.is_some()) {
                held.record.link = joint.link;
            }
            return;
        }
        let (a, b) = match (self.handle_of(joint.a), self.handle_of(joint.b)) {
            (Some(a), Some(b)) => (a, b),
            (None, None) => return,
            _ => {
                self.waiting.insert(joint.id, joint.clone());
                return;
            }
        };
        self.waiting.remove(&joint.id);
        self.joints.insert(joint.id, HeldJoint { record: joint.clone(), handle: None, parts: 1 });
        self.await_solver(joint.id);
        self.unsettle();
        for end in [a, b] {
            self.slot_mut(end).joints.push(joint.id);
            self.note_retied(end);
        }
        self.share_joint(joint.id);
    }

    /// Forgets the joints that wait for a removed body.
    pub(in crate::physics) fn forget_ties(&mut self, id: BodyId) {
        if !self.waiting.is_empty() {
            self.waiting.retain(|_, joint| joint.a != id && joint.b != id);
        }
    }

    /// Removes a joint and wakes its bodies.
    pub(in crate::physics) fn remove_joint(&mut self, id: JointId) {
        self.waiting.remove(&id);
        let Some(joint) = self.joints.remove(&id) else { return };
        if let Some(handle) = joint.handle {
            self.joint_news.untied.push(handle);
            let ends = [joint.record.a, joint.record.b].map(|end| self.handle_of(end));
            self.joint_news.woken.extend(ends.into_iter().flatten());
            if !joint.record.contacts_enabled {
                self.renew_contacts_between(ends);
            }
        } else {
            self.joint_news.tied.retain(|&other| other != id);
        }
        self.unsettle();
        for end in [joint.record.a, joint.record.b] {
            if let Some(end) = self.handle_of(end) {
                self.slot_mut(end).joints.retain(|&other| other != id);
                self.note_retied(end);
            }
        }
    }

    /// Does something that removes joints, and lets their ends sleep on.
    pub(super) fn without_waking_ends(&mut self, work: impl FnOnce(&mut Self)) {
        let woken = self.joint_news.woken.len();
        work(self);
        self.joint_news.woken.truncate(woken);
    }

    /// Lets a user change a joint in place, whole, and wakes its bodies. Returns whether the joint is held
    /// here, or waits.
    pub(in crate::physics) fn change_joint(
        &mut self,
        id: JointId,
        change: impl FnOnce(&mut GenericJoint),
    ) -> bool {
        if let Some(record) = self.waiting.get_mut(&id) {
            let mut joint = joints::joint_of(record);
            change(&mut joint);
            *record = joints::renewed(record, &joint);
            return true;
        }
        let Some(mut held) = self.joints.remove(&id) else { return false };
        let collided = held.record.contacts_enabled;
        let ends = [held.record.a, held.record.b].map(|end| self.handle_of(end));
        if let [Some(a), Some(b)] = ends
            && self.is_solvable(a, b)
        {
            self.joint_news.woken.extend([a, b]);
        }
        match held.handle {
            None => {
                let mut joint = joints::joint_of(&held.record);
                change(&mut joint);
                held.record = joints::renewed(&held.record, &joint);
            }
            Some(Solver::Multibody(handle)) => {
                let link = self.world_mut().multibody_joints.get_mut(handle);
                if let Some(link) = link.and_then(|(multibody, index)| multibody.link_mut(index)) {
                    change(&mut link.joint.data);
                    held.record = joints::renewed(&held.record, &link.joint.data);
                }
            }
            Some(Solver::Impulses(handle)) => {
                let joint = self.rapier_joint(handle);
                joints::share_out(joint, &held.record, 1);
                change(joint);
                held.record = joints::renewed(&held.record, joint);
                joints::share_out(joint, &held.record, held.parts);
            }
        }
        if held.record.contacts_enabled != collided {
            self.renew_contacts_between(ends);
        }
        self.joints.insert(id, held);
        true
    }

    /// Splits the forces of a joint anew, after the holders of its ends have changed.
    pub(in crate::physics) fn share_joint(&mut self, id: JointId) {
        let Some(mut held) = self.joints.remove(&id) else { return };
        let both = self.bearers_of(held.record.a).intersection(self.bearers_of(held.record.b));
        let parts = both.len().max(1);
        if parts != held.parts {
            held.parts = parts;
            if let Some(Solver::Impulses(handle)) = held.handle {
                joints::share_out(self.rapier_joint(handle), &held.record, parts);
            }
        }
        self.joints.insert(id, held);
    }

    fn rapier_joint(&mut self, handle: ImpulseJointHandle) -> &mut GenericJoint {
        self.joint_news.changed.push(handle);
        let joint = self.world_mut().impulse_joints.get_mut(handle, false);
        &mut joint.expect("a joint held here").data
    }

    /// Returns the regions whose copies of a body have a part of its mass; all regions for an immovable body.
    fn bearers_of(&self, id: BodyId) -> RegionSet {
        let own = RegionSet::only(self.rank());
        let Some(handle) = self.handle_of(id) else { return own };
        let slot = self.slot(handle);
        match slot.role {
            Ownership::Immovable => RegionSet::ALL,
            _ => slot.mass_split.as_ref().map_or(own, |mass_split| mass_split.among),
        }
    }

    /// Returns the record of a joint that is held here, whole, with the impulses of the last step or the
    /// motion of its link; or the record of one that waits.
    pub(in crate::physics) fn joint_record(&self, id: JointId) -> Option<JointRecord> {
        let held = self.joints.get(&id).map(|held| self.whole_record(held));
        held.or_else(|| self.waiting.get(&id).cloned())
    }

    fn whole_record(&self, held: &HeldJoint) -> JointRecord {
        let (mut record, parts) = (held.record.clone(), held.parts as f32);
        let joint = match held.handle {
            Some(Solver::Impulses(handle)) => {
                self.physics().impulse_joints.get(handle).map(|joint| &joint.data)
            }
            Some(Solver::Multibody(handle)) => {
                self.physics().multibody_joints.get(handle).and_then(|(multibody, index)| {
                    record.link = record.link.map(|link| articulation::record_of(multibody, index, &link));
                    Some(&multibody.link(index)?.joint.data)
                })
            }
            None => None,
        };
        let Some(joint) = joint else { return record };
        for (limit, now) in record.limits.iter_mut().zip(&joint.limits) {
            limit.impulse = now.impulse * parts;
        }
        for (motor, now) in record.motors.iter_mut().zip(&joint.motors) {
            motor.impulse = now.impulse * parts;
        }
        record
    }

    /// Changes the settings that only multibody joints have. Returns whether the joint is one, and held here.
    pub(in crate::physics) fn change_link(&mut self, id: JointId, settings: &LinkSettings) -> bool {
        let Some(mut held) = self.joints.remove(&id) else { return false };
        let is_link = held.record.link.is_some();
        if is_link {
            let mut link = settings.record();
            if let Some(Solver::Multibody(handle)) = held.handle
                && let Some((multibody, index)) = self.world_mut().multibody_joints.get_mut(handle)
            {
                articulation::equip(multibody, index, &link);
            } else {
                link.motion = held.record.link.and_then(|link| link.motion);
            }
            held.record.link = Some(link);
        }
        self.joints.insert(id, held);
        is_link
    }

    /// Returns the position and velocity of a multibody link, if it is solved here.
    pub(in crate::physics) fn link_motion(&self, id: JointId) -> Option<LinkMotion> {
        let held = self.joints.get(&id).filter(|held| matches!(held.handle, Some(Solver::Multibody(_))))?;
        self.whole_record(held).link?.motion
    }

    /// Sets the velocity of a multibody link, by its degrees of freedom. Returns whether the joint is one,
    /// and held here.
    pub(in crate::physics) fn set_link_velocity(&mut self, id: JointId, velocity: [f32; 6]) -> bool {
        let Some(mut held) = self.joints.remove(&id) else { return false };
        let is_link = held.record.link.is_some();
        if let Some(Solver::Multibody(handle)) = held.handle
            && let Some((multibody, index)) = self.world_mut().multibody_joints.get_mut(handle)
        {
            articulation::set_velocity(multibody, index, &velocity);
        } else if let Some(link) = &mut held.record.link {
            let still = LinkMotion { rotation: [0.0, 0.0, 0.0, 1.0], ..LinkMotion::default() };
            link.motion.get_or_insert(still).velocity = velocity;
        }
        let ends = [held.record.a, held.record.b].map(|end| self.handle_of(end));
        self.joint_news.woken.extend(ends.into_iter().flatten());
        self.joints.insert(id, held);
        is_link
    }

    /// Returns the force and torque of this region's solver on the locked axes of a joint in the last step:
    /// newtons along the three axes of its frame, newton metres about them. Zero while the joint waits;
    /// `None` for multibody joints, whose solver has no such impulses.
    pub(in crate::physics) fn joint_load(&self, id: JointId) -> Option<[f32; 6]> {
        if self.waiting.contains_key(&id) {
            return Some([0.0; 6]);
        }
        let held = self.joints.get(&id)?;
        let handle = match held.handle {
            Some(Solver::Impulses(handle)) => handle,
            Some(Solver::Multibody(_)) => return None,
            None => return held.record.link.is_none().then_some([0.0; 6]),
        };
        let joint = self.physics().impulse_joints.get(handle)?;
        // Rapier keeps the impulse of the last solver iteration. Each iteration is a step of its own, as long
        // as those of the body that the joint moves.
        let (a, b) = (joint.body1(), joint.body2());
        let moved = if self.physics().bodies[a].is_dynamic() { a } else { b };
        let iteration_s = self.iteration_s(moved);
        // Rapier's constraints of turning are those of the quaternion between the joint's two frames, which changes by
        // half of the angle (`diff_conj1_2` in its `joint_constraint_helper`): half of the impulse is that of the torque.
        let part = |axis: usize| if axis < 3 { 1.0 } else { 0.5 };
        Some(std::array::from_fn(|axis| part(axis) * joint.impulses[axis] / iteration_s))
    }

    /// Returns the bodies that a joint held here ties.
    pub(in crate::physics) fn joint_ends(&self, id: JointId) -> Option<(RigidBodyHandle, RigidBodyHandle)> {
        let held = self.joints.get(&id)?;
        let world = self.physics();
        // Where Rapier has the joint, no id need be looked up. The joint of a body that has just gone is removed
        // before the next step.
        if let Some(Solver::Impulses(handle)) = held.handle
            && let Some(joint) = world.impulse_joints.get(handle)
            && world.bodies.contains(joint.body1())
            && world.bodies.contains(joint.body2())
        {
            return Some((joint.body1(), joint.body2()));
        }
        Some((self.handle_of(held.record.a)?, self.handle_of(held.record.b)?))
    }

    /// Returns the ids of the bodies that a joint held here ties.
    pub(in crate::physics) fn joint_bodies(&self, id: JointId) -> Option<(BodyId, BodyId)> {
        let joint = &self.joints.get(&id)?.record;
        Some((joint.a, joint.b))
    }

    /// Returns the ids of the bodies that each joint held here ties.
    pub(in crate::physics) fn ties(&self) -> impl Iterator<Item = (BodyId, BodyId)> {
        self.joints.values().map(|joint| (joint.record.a, joint.record.b))
    }

    /// Returns whether a joint is held here, or waits for one of its ends.
    pub(in crate::physics) fn has_joint(&self, id: JointId) -> bool {
        self.joints.contains_key(&id) || self.waiting.contains_key(&id)
    }

    /// Returns the records of all joints held here, waiting ones too, without what a step changes.
    pub(crate) fn joints(&self) -> impl Iterator<Item = &JointRecord> {
        self.joints.values().map(|held| &held.record).chain(self.waiting.values())
    }

    /// Returns the joints of a body, whole, waiting ones too.
    pub(in crate::physics) fn joints_of(&self, handle: RigidBodyHandle) -> impl Iterator<Item = JointRecord> {
        let slot = self.slot(handle);
        let waiting = self.waiting.values().filter(|joint| joint.a == slot.id || joint.b == slot.id).cloned();
        slot.joints.iter().filter_map(|&id| self.joint_record(id)).chain(waiting)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use rapier3d::prelude::*;

    use crate::runtime::{LocalWorld, WorldConfig};
    use crate::space::BodyId;

    thread_local! {
        pub(super) static LOOKS: Cell<usize> = const { Cell::new(0) };
    }

    /// Steps a world, and returns how many joints that are not in Rapier were looked at.
    fn step(world: &mut LocalWorld) -> usize {
        let before = LOOKS.get();
        world.step().unwrap();
        LOOKS.get() - before
    }

    #[test]
    fn joints_of_what_is_disabled_wait_without_being_looked_at_until_it_is_enabled() {
        let mut world = LocalWorld::new(WorldConfig { threads: 1, ..WorldConfig::default() }).unwrap();
        let ball = |world: &mut LocalWorld, x: f32, y: f32, enabled: bool| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, y, 0.0)).enabled(enabled);
            world.insert(body.can_sleep(false), ColliderBuilder::ball(0.1)).unwrap()
        };
        ball(&mut world, 100.0, 0.0, true);
        let pairs: Vec<_> = (0..50)
            .map(|i| {
                let [a, b] = [0.0, 1.0].map(|down| ball(&mut world, 3.0 * i as f32, -down, false));
                world.insert_joint(a, b, RopeJointBuilder::new(1.0)).unwrap();
                (a, b)
            })
            .collect();
        assert_eq!(step(&mut world), 50);
        for _ in 0..10 {
            assert_eq!(step(&mut world), 0);
        }
        let (a, b) = pairs[7];
        world.update(a, |body| body.set_enabled(true)).unwrap();
        world.update(a, |body| body.set_body_type(RigidBodyType::KinematicPositionBased, true)).unwrap();
        step(&mut world);
        assert_eq!(step(&mut world), 0, "its other end is disabled still");
        world.update(b, |body| body.set_enabled(true)).unwrap();
        for _ in 0..60 {
            step(&mut world);
        }
        let depth = |world: &LocalWorld, id: BodyId| -world.motion(id).unwrap().0.translation[1];
        assert!((depth(&world, b) - 1.0).abs() < 0.05, "it hangs: {} m", depth(&world, b));
        // Two that cannot move wait too, until one of them can.
        let (c, d) = pairs[8];
        for id in [c, d] {
            let fixes = |body: &mut RigidBody| {
                body.set_enabled(true);
                body.set_body_type(RigidBodyType::KinematicPositionBased, true);
            };
            world.update(id, fixes).unwrap();
        }
        step(&mut world);
        assert_eq!(step(&mut world), 0);
        world.update(d, |body| body.set_body_type(RigidBodyType::Dynamic, true)).unwrap();
        for _ in 0..60 {
            step(&mut world);
        }
        assert!((depth(&world, d) - 1.0).abs() < 0.05, "it hangs: {} m", depth(&world, d));
    }
}
