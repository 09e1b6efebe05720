//! Removes bodies that cannot be changed in place and inserts them anew with their joints: other colliders, or fixed to movable
//! and back.

use std::collections::BTreeMap;
use std::sync::Arc;

use rapier3d::prelude::*;

use super::{HostError, RegionHost};
use crate::physics::record;
use crate::protocol::{BodyKind, BodyRecord};
use crate::space::{BodyId, JointId};

impl RegionHost {
    /// Applies a user's change of a body's type: a body that can move has an owner, an immovable one has none. A link of a
    /// multibody keeps its type.
    pub fn settle_kind(&mut self, id: BodyId) -> Result<(), HostError> {
        let known = self.statics.body(id);
        let copy = self
            .owned(id)
            .or_else(|| self.regions().find_map(|region| Some((region, region.handle_of(id)?))));
        let Some((region, handle)) = copy else { return Ok(()) };
        let mut record = region.body_record(handle);
        if (record.traits.kind == BodyKind::Fixed) == known.is_some() {
            return Ok(());
        }
        if let Some(known) = known {
            // A copy is where its region space has it, which is coarser.
            record.state.pose = known.state.pose;
        }
        if let Some(joint) = self.link_of(id) {
            self.update(id, |body| body.set_body_type(RigidBodyType::Dynamic, true));
            let cause = "it cannot become fixed while it is a link; remove the joint first";
            return Err(HostError::MultibodyJoint { joint, body: id, cause });
        }
        (record.state.sleeping, record.state.still_s) = (false, 0.0);
        self.replace(record)
    }

    /// Adds a collider to a body. Returns whether it is held here.
    pub fn insert_collider(&mut self, id: BodyId, collider: &ColliderBuilder) -> Result<bool, HostError> {
        let collider = record::collider_record(collider, &mut self.shapes)?;
        let Some(mut body) = self.record(id) else { return Ok(false) };
        Arc::make_mut(&mut body.traits).colliders.push(collider);
        self.replace(body)?;
        Ok(true)
    }

    /// Removes a collider from a body; those after it move up. Returns whether there was one.
    pub fn remove_collider(&mut self, id: BodyId, index: usize) -> Result<bool, HostError> {
        let Some(mut body) = self.record(id).filter(|body| index < body.traits.colliders.len()) else {
            return Ok(false);
        };
        Arc::make_mut(&mut body.traits).colliders.remove(index);
        self.replace(body)?;
        Ok(true)
    }

    /// Removes a body and all that joints tie to it, and inserts them anew with the body as recorded; contacts of all these begin
    /// anew.
    pub(super) fn replace(&mut self, body: BodyRecord) -> Result<(), HostError> {
        if !body.state.pose.is_valid() || !body.state.velocity.is_finite() {
            return Err(HostError::NotFinite(body.id));
        }
        let (mut bodies, mut ties) = (BTreeMap::new(), BTreeMap::new());
        for joint in self.all_joints_of(body.id).into_values() {
            self.gather_assembly(joint.a, &mut bodies, &mut ties);
            self.gather_assembly(joint.b, &mut bodies, &mut ties);
            ties.insert(joint.id, joint);
        }
        bodies.insert(body.id, body);
        for &id in bodies.keys() {
            self.remove(id);
        }
        self.insert(bodies.into_values().collect(), &ties.into_values().collect::<Vec<_>>())
    }

    /// Returns the joint by which a body is a link of a multibody.
    fn link_of(&self, id: BodyId) -> Option<JointId> {
        let mut links = self.joints_of(id).filter(|joint| joint.link.is_some() && joint.b == id);
        links.next().map(|joint| joint.id)
    }
}
