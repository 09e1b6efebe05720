//! Removes bodies that cannot be changed in place and inserts them anew with their joints: those that get
//! other colliders, and those that go from fixed to movable or back.

use std::collections::BTreeMap;
use std::sync::Arc;

use rapier3d::prelude::*;

use super::place::KINEMATIC_ROOT;
use super::{HostError, RegionHost};
use crate::physics::{ShapeError, record};
use crate::protocol::{BodyKind, BodyRecord, BodyTraits, WorldPose};
use crate::space::BodyId;

impl RegionHost {
    /// Settles a change that a user has made in every copy of a body, which `was` this before: its type, its
    /// mass, and the place of an immovable body, if it was `moved`. A change that is refused is taken back;
    /// contacts of the body then begin anew.
    pub(super) fn settle(&mut self, was: BodyRecord, moved: Option<WorldPose>) -> Result<(), HostError> {
        let settled = self.check_mass(was.id, &was.traits).and_then(|()| self.place_changed(was.id, moved));
        if settled.is_err() {
            self.change_copies(was.id, |body| {
                body.set_body_type(record::body_type(was.traits.kind), true);
                record::set_traits(body, &was.traits);
                body.user_data = was.user_data;
            });
            // If something that is tied to it is not finite, it stays where the change has put it.
            let _ = self.replace(was);
        }
        settled
    }

    /// Refuses a change that takes all its mass from a body.
    fn check_mass(&self, id: BodyId, was: &BodyTraits) -> Result<(), HostError> {
        let changed =
            self.traits(id).filter(|now| (now.kind, &now.extra_mass) != (was.kind, &was.extra_mass));
        if changed.is_some_and(|now| record::hangs(now, &self.shapes)) {
            return Err(ShapeError::Massless.into());
        }
        Ok(())
    }

    /// Places anew a body that has become movable or immovable, or an immovable one that was moved. Refuses
    /// to change the type of a link of a multibody.
    fn place_changed(&mut self, id: BodyId, moved: Option<WorldPose>) -> Result<(), HostError> {
        let known = self.statics.body(id);
        let copy = self
            .owned(id)
            .or_else(|| self.regions().find_map(|region| Some((region, region.handle_of(id)?))));
        let Some((region, handle)) = copy else { return Ok(()) };
        let kind = region.slot(handle).traits.kind;
        self.check_kind(id, kind)?;
        if (kind == BodyKind::Fixed) == known.is_some() {
            return moved.map_or(Ok(()), |pose| self.teleport(id, pose).map(drop));
        }
        let mut record = region.body_record(handle);
        if let Some(known) = known {
            // The pose of a copy is coarser, being in region space.
            record.state.pose = moved.unwrap_or(known.state.pose);
        }
        (record.state.sleeping, record.state.still_s) = (false, 0.0);
        self.replace(record)
    }

    /// Adds a collider to a body. Returns whether it is held here.
    pub fn insert_collider(&mut self, id: BodyId, collider: &ColliderBuilder) -> Result<bool, HostError> {
        let collider = record::collider_record(collider, &mut self.shapes)?;
        let Some(mut body) = self.record(id) else { return Ok(false) };
        Arc::make_mut(&mut body.traits).colliders.push(collider);
        if record::hangs(&body.traits, &self.shapes) {
            return Err(ShapeError::Massless.into());
        }
        self.replace(body)?;
        Ok(true)
    }

    /// Removes a collider from a body; those after it move up. Returns whether there was one.
    pub fn remove_collider(&mut self, id: BodyId, index: usize) -> Result<bool, HostError> {
        let Some(mut body) = self.record(id).filter(|body| index < body.traits.colliders.len()) else {
            return Ok(false);
        };
        Arc::make_mut(&mut body.traits).colliders.remove(index);
        if record::hangs(&body.traits, &self.shapes) {
            return Err(ShapeError::Massless.into());
        }
        self.replace(body)?;
        Ok(true)
    }

    /// Removes a body and all that joints tie to it, and inserts them anew with the body as recorded.
    /// Contacts of all of these begin anew.
    pub(super) fn replace(&mut self, body: BodyRecord) -> Result<(), HostError> {
        let (mut bodies, mut ties) = (BTreeMap::new(), BTreeMap::new());
        for joint in self.all_joints_of(body.id).into_values() {
            self.gather_assembly(joint.a, &mut bodies, &mut ties);
            self.gather_assembly(joint.b, &mut bodies, &mut ties);
            ties.insert(joint.id, joint);
        }
        bodies.insert(body.id, body);
        self.reinsert(bodies.into_values().collect(), &ties.into_values().collect::<Vec<_>>())
    }

    /// Refuses any type but dynamic for a link of a multibody, as Rapier would end the program in its next
    /// step. Refuses kinematic types for the root of one.
    pub(in crate::physics) fn check_kind(&self, id: BodyId, kind: BodyKind) -> Result<(), HostError> {
        if kind == BodyKind::Dynamic {
            return Ok(());
        }
        for joint in self.joints_of(id).filter(|joint| joint.link.is_some()) {
            let cause = match joint.b == id {
                true => "it must be dynamic as long as it is a link; remove the joint first",
                false if kind == BodyKind::Fixed => continue,
                false => KINEMATIC_ROOT,
            };
            return Err(HostError::MultibodyJoint { joint: joint.id, body: joint.b, cause });
        }
        Ok(())
    }
}
