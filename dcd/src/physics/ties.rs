//! The joints of a region. A joint whose ends several regions hold is solved in each of them: the forces of its motors and
//! springs are shared out among these regions, as masses are. What locks or limits an axis needs no share.

use rapier3d::prelude::*;

use super::joints;
use super::region::{Region, Role};
use crate::protocol::JointRecord;
use crate::space::{BodyId, JointId, RegionSet};

/// A joint as its user knows it, and what became of it in a region.
pub(super) struct HeldJoint {
    pub record: JointRecord,
    handle: ImpulseJointHandle,
    /// Regions that solve it.
    parts: usize,
}

impl Region {
    /// Ties two bodies, if the joint is not there yet: as soon as both are held here.
    pub(super) fn insert_joint(&mut self, joint: &JointRecord) {
        if self.joints.contains_key(&joint.id) {
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
        // The set's own insertion lets sleepers sleep; the world's wakes them.
        let handle = self.world_mut().impulse_joints.insert(a, b, joints::joint_of(joint), false);
        self.joints.insert(joint.id, HeldJoint { record: joint.clone(), handle, parts: 1 });
        for end in [a, b] {
            self.slot_mut(end).joints.push(joint.id);
        }
        self.assemblies_stale = true;
        self.share_joint(joint.id);
    }

    /// A body is no more: nothing waits for it.
    pub(super) fn forget_ties(&mut self, id: BodyId) {
        self.waiting.retain(|_, joint| joint.a != id && joint.b != id);
    }

    /// Unties two bodies and wakes them.
    pub(super) fn remove_joint(&mut self, id: JointId) {
        self.waiting.remove(&id);
        let Some(joint) = self.joints.remove(&id) else { return };
        self.world_mut().impulse_joints.remove(joint.handle, true);
        for end in [joint.record.a, joint.record.b] {
            if let Some(end) = self.handle_of(end) {
                self.slot_mut(end).joints.retain(|&other| other != id);
            }
        }
        self.assemblies_stale = true;
    }

    /// Lets a user change a joint in place, whole; wakes what it ties. Returns whether it is held here, or waits.
    pub(super) fn change_joint(&mut self, id: JointId, change: impl FnOnce(&mut GenericJoint)) -> bool {
        if let Some(record) = self.waiting.get_mut(&id) {
            let mut joint = joints::joint_of(record);
            change(&mut joint);
            *record = joints::joint_record(id, record.a, record.b, &joint);
            return true;
        }
        let Some(mut held) = self.joints.remove(&id) else { return false };
        let joint = self.world_mut().impulse_joints.get_mut(held.handle, true).expect("a joint held here");
        joints::share_out(&mut joint.data, &held.record, 1);
        change(&mut joint.data);
        held.record = joints::joint_record(id, held.record.a, held.record.b, &joint.data);
        joints::share_out(&mut joint.data, &held.record, held.parts);
        self.joints.insert(id, held);
        true
    }

    /// Who holds the ends of a joint has changed: shares its forces out anew.
    pub(super) fn share_joint(&mut self, id: JointId) {
        let Some(mut held) = self.joints.remove(&id) else { return };
        let both = self.holders_of(held.record.a).intersection(self.holders_of(held.record.b));
        let parts = both.len().max(1);
        if parts != held.parts {
            held.parts = parts;
            let joint = self.world_mut().impulse_joints.get_mut(held.handle, false);
            joints::share_out(&mut joint.expect("a joint held here").data, &held.record, parts);
        }
        self.joints.insert(id, held);
    }

    /// All regions that share the mass of a body; what is immovable is everywhere.
    fn holders_of(&self, id: BodyId) -> RegionSet {
        let own = RegionSet::only(self.rank());
        let Some(handle) = self.handle_of(id) else { return own };
        let slot = self.slot(handle);
        match slot.role {
            Role::Immovable => RegionSet::from_bits(u64::MAX),
            _ => slot.shared.as_ref().map_or(own, |shared| shared.members.without(shared.shadows)),
        }
    }

    /// A joint held here, whole: with the impulses of the last step.
    pub(super) fn joint_record(&self, id: JointId) -> Option<JointRecord> {
        let held = self.joints.get(&id)?;
        let joint = self.physics().impulse_joints.get(held.handle)?;
        let (mut record, parts) = (held.record.clone(), held.parts as f32);
        for (limit, now) in record.limits.iter_mut().zip(&joint.data.limits) {
            limit.impulse = now.impulse * parts;
        }
        for (motor, now) in record.motors.iter_mut().zip(&joint.data.motors) {
            motor.impulse = now.impulse * parts;
        }
        Some(record)
    }

    /// What this region's solver pressed on the locked axes of a joint in the last step: newtons along the three axes of
    /// its frame, newton metres about them; nothing while the joint waits.
    pub(super) fn joint_load(&self, id: JointId) -> Option<[f32; 6]> {
        if self.waiting.contains_key(&id) {
            return Some([0.0; 6]);
        }
        let joint = self.physics().impulse_joints.get(self.joints.get(&id)?.handle)?;
        // Rapier keeps the impulse of the last solver iteration, each of which is a step of its own.
        let settings = &self.physics().integration_parameters;
        let dt_s = settings.dt / settings.num_solver_iterations as f32;
        Some(std::array::from_fn(|axis| joint.impulses[axis] / dt_s))
    }

    /// The bodies that a joint held here ties.
    pub(super) fn joint_ends(&self, id: JointId) -> Option<(RigidBodyHandle, RigidBodyHandle)> {
        let joint = &self.joints.get(&id)?.record;
        Some((self.handle_of(joint.a)?, self.handle_of(joint.b)?))
    }

    /// Whether a joint is held here, or waits for one of its ends.
    pub(super) fn has_joint(&self, id: JointId) -> bool {
        self.joints.contains_key(&id) || self.waiting.contains_key(&id)
    }

    /// The joints that a body hangs on, whole.
    pub(super) fn joints_of(&self, handle: RigidBodyHandle) -> impl Iterator<Item = JointRecord> {
        let slot = self.slot(handle);
        let waiting = self.waiting.values().filter(|joint| joint.a == slot.id || joint.b == slot.id).cloned();
        slot.joints.iter().filter_map(|&id| self.joint_record(id)).chain(waiting)
    }
}
