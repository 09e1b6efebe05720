//! Keeps joints (those on record at the server, or those that a client was told of) and finds the joints of
//! one body without a look at all others.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;

use bincode::de::Decoder;
use bincode::enc::Encoder;
use bincode::error::{DecodeError, EncodeError};
use bincode::{Decode, Encode};

use crate::protocol::JointRecord;
use crate::space::{BodyId, JointId};

/// Joints in id order, indexed by their bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct Joints {
    all: BTreeMap<JointId, JointRecord>,
    of_bodies: BTreeMap<BodyId, BTreeSet<JointId>>,
}

impl Joints {
    /// Adds a joint, in place of any of the same id.
    pub(crate) fn insert(&mut self, joint: JointRecord) {
        self.remove(joint.id);
        for body in [joint.a, joint.b] {
            self.of_bodies.entry(body).or_default().insert(joint.id);
        }
        self.all.insert(joint.id, joint);
    }

    pub(crate) fn extend(&mut self, joints: Vec<JointRecord>) {
        joints.into_iter().for_each(|joint| self.insert(joint));
    }

    /// Replaces a joint that is known; does nothing for one that is not.
    pub(crate) fn alter(&mut self, joint: JointRecord) {
        if self.all.contains_key(&joint.id) {
            self.insert(joint);
        }
    }

    /// Forgets the joints of a body.
    pub(crate) fn remove_of(&mut self, body: BodyId) {
        let of_it: Vec<_> = self.of(body).map(|joint| joint.id).collect();
        of_it.into_iter().for_each(|id| _ = self.remove(id));
    }

    /// Forgets a joint, and returns it if there was one.
    pub(crate) fn remove(&mut self, id: JointId) -> Option<JointRecord> {
        let joint = self.all.remove(&id)?;
        for body in [joint.a, joint.b] {
            if let Some(own) = self.of_bodies.get_mut(&body) {
                own.remove(&id);
                if own.is_empty() {
                    self.of_bodies.remove(&body);
                }
            }
        }
        Some(joint)
    }

    /// Returns the joints of a body, in id order.
    pub(crate) fn of(&self, body: BodyId) -> impl Iterator<Item = &JointRecord> {
        let own = self.of_bodies.get(&body).into_iter().flatten();
        own.filter_map(|id| self.all.get(id))
    }
}

impl Deref for Joints {
    type Target = BTreeMap<JointId, JointRecord>;

    fn deref(&self) -> &Self::Target {
        &self.all
    }
}

impl FromIterator<JointRecord> for Joints {
    fn from_iter<I: IntoIterator<Item = JointRecord>>(joints: I) -> Self {
        let mut known = Self::default();
        joints.into_iter().for_each(|joint| known.insert(joint));
        known
    }
}

impl Encode for Joints {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> Result<(), EncodeError> {
        self.all.encode(encoder)
    }
}

impl<Context> Decode<Context> for Joints {
    fn decode<D: Decoder<Context = Context>>(decoder: &mut D) -> Result<Self, DecodeError> {
        let all: BTreeMap<JointId, JointRecord> = Decode::decode(decoder)?;
        Ok(all.into_values().collect())
    }
}

bincode::impl_borrow_decode!(Joints);

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
        let ids = |joints: &Joints| joints.values().map(|joint| joint.id.0).collect::<Vec<_>>();
        assert_eq!(ids(&joints), [3, 7, 9]);
        joints.alter(JointRecord { user_data: 5, ..tie(9, [0, 1]) });
        joints.alter(tie(8, [0, 3]));
        assert_eq!(joints.get(&JointId(9)).map(|joint| joint.user_data), Some(5));
        joints.remove_of(BodyId::persistent(1));
        assert_eq!(ids(&joints), [7], "what was altered and not known is not there either");
        joints.remove(JointId(7));
        assert!(joints.is_empty() && joints.of_bodies.is_empty());
    }
}
