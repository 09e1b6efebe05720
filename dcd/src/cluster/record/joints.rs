//! Keeps the joints on record, and finds those of one body without a look at all others.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;

use bincode::de::Decoder;
use bincode::enc::Encoder;
use bincode::error::{DecodeError, EncodeError};
use bincode::{Decode, Encode};

use crate::protocol::JointRecord;
use crate::space::{BodyId, JointId};

/// Joints, in id order.
#[derive(Clone, Debug, Default)]
pub(super) struct Joints {
    all: BTreeMap<JointId, JointRecord>,
    of_bodies: BTreeMap<BodyId, BTreeSet<JointId>>,
}

impl Joints {
    /// Adds a joint, in place of the one of its id.
    pub(super) fn insert(&mut self, joint: JointRecord) {
        self.remove(joint.id);
        for body in [joint.a, joint.b] {
            self.of_bodies.entry(body).or_default().insert(joint.id);
        }
        self.all.insert(joint.id, joint);
    }

    /// Forgets a joint; returns it, if there was one.
    pub(super) fn remove(&mut self, id: JointId) -> Option<JointRecord> {
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
    pub(super) fn of(&self, body: BodyId) -> impl Iterator<Item = &JointRecord> {
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
