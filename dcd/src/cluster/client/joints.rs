//! Keeps the joints of the bodies that a client was told of: one is found by its id, and those of a body by the body's, however many
//! there are.

use std::collections::{BTreeMap, BTreeSet};

use crate::protocol::JointRecord;
use crate::space::{BodyId, JointId};

/// Joints by id.
#[derive(Clone, Debug, Default)]
pub(super) struct Joints {
    joints: BTreeMap<JointId, JointRecord>,
    /// Which joints hold which bodies.
    ends: BTreeSet<(BodyId, JointId)>,
}

impl Joints {
    pub(super) fn get(&self, id: JointId) -> Option<&JointRecord> {
        self.joints.get(&id)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &JointRecord> + Clone {
        self.joints.values()
    }

    pub(super) fn insert(&mut self, joint: JointRecord) {
        self.remove(joint.id);
        self.ends.extend([joint.a, joint.b].map(|body| (body, joint.id)));
        self.joints.insert(joint.id, joint);
    }

    pub(super) fn extend(&mut self, joints: Vec<JointRecord>) {
        joints.into_iter().for_each(|joint| self.insert(joint));
    }

    /// Changes a joint that is known.
    pub(super) fn alter(&mut self, joint: JointRecord) {
        if self.joints.contains_key(&joint.id) {
            self.insert(joint);
        }
    }

    pub(super) fn remove(&mut self, id: JointId) {
        if let Some(joint) = self.joints.remove(&id) {
            self.ends.remove(&(joint.a, id));
            self.ends.remove(&(joint.b, id));
        }
    }

    /// Removes the joints of a body.
    pub(super) fn remove_of(&mut self, body: BodyId) {
        let of_it = self.ends.range((body, JointId(0))..=(body, JointId(u64::MAX)));
        of_it.map(|&(_, id)| id).collect::<Vec<_>>().into_iter().for_each(|id| self.remove(id));
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_go_with_their_bodies_and_leave_nothing_behind() {
        let rope = rapier3d::prelude::RopeJointBuilder::new(1.0).build().into();
        let tie = |id, [a, b]: [u32; 2]| {
            crate::physics::joint_record(JointId(id), BodyId::persistent(a), BodyId::persistent(b), &rope)
        };
        let mut joints = Joints::default();
        joints.extend(vec![tie(9, [0, 1]), tie(3, [1, 2]), tie(7, [2, 3])]);
        let ids = |joints: &Joints| joints.iter().map(|joint| joint.id.0).collect::<Vec<_>>();
        assert_eq!(ids(&joints), [3, 7, 9]);
        joints.alter(JointRecord { user_data: 5, ..tie(9, [0, 1]) });
        joints.alter(tie(8, [0, 3]));
        assert_eq!(joints.get(JointId(9)).map(|joint| joint.user_data), Some(5));
        joints.remove_of(BodyId::persistent(1));
        assert_eq!(ids(&joints), [7], "what was altered and not known is not there either");
        joints.remove(JointId(7));
        assert!(joints.iter().next().is_none() && joints.ends.is_empty());
    }
}
