//! Inserts and removes bodies of a local world, and changes them and their colliders in place.

use std::sync::Arc;

use rapier3d::prelude::*;

use super::LocalWorld;
use crate::physics::HostError;
use crate::protocol::{BodyRecord, BodyState, BodyTraits, Controller, ShapeHash, WorldPose};
use crate::recording::Operation;
use crate::runtime::WorldError;
use crate::runtime::config::check_speed;
use crate::runtime::tape::Copies;
use crate::space::{BodyId, Epoch};

impl LocalWorld {
    /// Inserts a body with one collider, at the body's own position: in world space, exact near the origin.
    pub fn insert(
        &mut self,
        body: impl Into<RigidBody>,
        collider: ColliderBuilder,
    ) -> Result<BodyId, WorldError> {
        let body = body.into();
        let pose = WorldPose {
            translation: body.translation().to_array().map(f64::from),
            rotation: body.rotation().to_array(),
        };
        self.insert_at(pose, body, [collider])
    }

    /// Inserts a body with any number of colliders at a pose of world space, which replaces the body's own
    /// position.
    pub fn insert_at(
        &mut self,
        pose: WorldPose,
        body: impl Into<RigidBody>,
        colliders: impl AsRef<[ColliderBuilder]>,
    ) -> Result<BodyId, WorldError> {
        self.insert_as(None, pose, &body.into(), colliders.as_ref())
    }

    /// Inserts a body, which may be a character or a vehicle.
    pub(crate) fn insert_as(
        &mut self,
        controller: Option<Controller<'_>>,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<BodyId, WorldError> {
        let id = BodyId::persistent(self.next_body);
        let record = self.host.shapes_mut().describe(id, pose, body, colliders).map_err(HostError::from)?;
        self.insert_record(record.with_controller(controller))
    }

    /// Inserts a body with one collider from the parts of its record; `traits` makes its traits from the hash
    /// of its shape.
    pub(crate) fn insert_recorded(
        &mut self,
        state: BodyState,
        user_data: u128,
        shape: &SharedShape,
        traits: impl FnOnce(ShapeHash) -> Arc<BodyTraits>,
    ) -> Result<BodyId, WorldError> {
        let id = BodyId::persistent(self.next_body);
        let shapes = self.host.shapes_mut();
        let traits = shapes.intern(shape).map(traits).and_then(|traits| shapes.share(traits));
        let traits = traits.map_err(HostError::from)?;
        self.insert_record(BodyRecord { id, epoch: Epoch(0), state, traits, user_data })
    }

    /// Inserts a body whose id is the next one.
    fn insert_record(&mut self, record: BodyRecord) -> Result<BodyId, WorldError> {
        let id = record.id;
        let next = self.next_body.checked_add(1).ok_or(WorldError::Full)?;
        check_speed(&record, self.host.settings().speed_limit_m_s())?;
        let taped = self.tape.is_some().then(|| vec![record.clone()]);
        self.host.attend_new(&record)?;
        self.or_spoil(|world| Ok(world.host.insert_one(record)?))?;
        if let Some(record) = taped {
            self.tape_bodies(record);
        }
        self.next_body = next;
        Ok(id)
    }

    /// Removes a body with its colliders and joints.
    pub fn remove(&mut self, body: BodyId) -> Result<(), WorldError> {
        self.host.attend(body)?;
        let done = self.host.remove(body);
        self.host.forget_unused_shapes();
        self.tape(done, || Operation::Remove(body));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Takes back the bodies that were inserted last, since the last step, as if they had never been there.
    /// Their ids are used again.
    pub(crate) fn take_back(&mut self, bodies: &[BodyId]) -> Result<(), WorldError> {
        bodies.iter().try_for_each(|&body| self.remove(body))?;
        self.next_body = bodies.first().map_or(self.next_body, |first| first.index());
        Ok(())
    }

    /// Changes a body in place by Rapier's own setters, forces and impulses.
    pub fn update<R>(
        &mut self,
        body: BodyId,
        mut change: impl FnMut(&mut RigidBody) -> R,
    ) -> Result<R, WorldError> {
        self.host.attend(body)?;
        let mut copies = Copies::new(self.tape.is_some());
        let changed = self.host.update(body, |body| {
            let result = change(body);
            copies.note(body);
            result
        });
        match &changed {
            Ok(Some(_)) => self.tape_update(body, copies),
            Ok(None) => {}
            Err(_) => self.tape_spoilt(),
        }
        changed?.ok_or(WorldError::NoBody(body))
    }

    /// Adds a collider to a body, as the last of its list.
    pub fn insert_collider(&mut self, body: BodyId, collider: ColliderBuilder) -> Result<(), WorldError> {
        self.tape_spoilt();
        self.host.attend(body)?;
        if self.host.insert_collider(body, &collider)? { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Removes a collider from a body. The colliders after it move up by one.
    pub fn remove_collider(&mut self, body: BodyId, index: usize) -> Result<(), WorldError> {
        let count = self.body(body).ok_or(WorldError::NoBody(body))?.colliders().len();
        self.tape_spoilt();
        self.host.attend(body)?;
        if self.host.remove_collider(body, index)? {
            self.host.forget_unused_shapes();
            return Ok(());
        }
        Err(WorldError::NoCollider { body, index, count })
    }

    /// Changes a collider of a body in place, in all copies, by Rapier's own setters.
    pub fn update_collider<R>(
        &mut self,
        body: BodyId,
        index: usize,
        change: impl FnMut(&mut Collider) -> R,
    ) -> Result<R, WorldError> {
        let count = self.body(body).ok_or(WorldError::NoBody(body))?.colliders().len();
        self.tape_spoilt();
        self.host.attend(body)?;
        let changed = self.host.update_collider(body, index, change);
        self.host.forget_unused_shapes();
        changed?.ok_or(WorldError::NoCollider { body, index, count })
    }
}
