//! Changes in place, made to every copy of a body or joint alike.

use rapier3d::prelude::*;

use super::{HostError, RegionHost};
use crate::physics::convert;
use crate::physics::region::Role;
use crate::protocol::{BodyRecord, WorldPose};
use crate::space::{BodyId, JointId};

impl RegionHost {
    /// Applies a change to every copy of a body held here, so that owner and replicas stay alike. Returns what the
    /// change returned for the owner's copy, or for the first other copy when the owner is elsewhere.
    pub fn update<R>(&mut self, id: BodyId, mut change: impl FnMut(&mut RigidBody) -> R) -> Option<R> {
        let mut result = None;
        for region in &mut self.regions {
            let Some(handle) = region.handle_of(id) else { continue };
            let role = region.slot(handle).role;
            let returned = region.change(handle, &mut change);
            if role == Role::Immovable {
                self.statics.set_traits(id, &region.slot(handle).traits);
            }
            if role == Role::Owner || result.is_none() {
                result = Some(returned);
            }
        }
        result
    }

    /// Applies a change to one collider of a body, in every copy held here; `index` counts them in order of insertion.
    /// Returns what [`RegionHost::update`] would. Shape, position and mass must stay as they are.
    pub fn update_collider<R>(
        &mut self,
        id: BodyId,
        index: usize,
        mut change: impl FnMut(&mut Collider) -> R,
    ) -> Option<R> {
        let mut result = None;
        for region in &mut self.regions {
            let Some(handle) = region.handle_of(id) else { continue };
            let role = region.slot(handle).role;
            let returned = region.update_collider(handle, index, &mut change)?;
            if role == Role::Immovable {
                self.statics.set_traits(id, &region.slot(handle).traits);
            }
            if role == Role::Owner || result.is_none() {
                result = Some(returned);
            }
        }
        result
    }

    /// Applies a change to every copy of a joint held here.
    pub fn update_joint(&mut self, id: JointId, mut change: impl FnMut(&mut GenericJoint)) -> bool {
        let mut found = false;
        for region in &mut self.regions {
            let Some(handle) = region.joint_handle(id) else { continue };
            if let Some(joint) = region.world_mut().impulse_joints.get_mut(handle, true) {
                change(&mut joint.data);
                found = true;
            }
        }
        found
    }

    /// Puts a body elsewhere, in every copy; one that comes to lie in other regions is placed anew.
    pub fn teleport(&mut self, id: BodyId, pose: WorldPose) -> Result<bool, HostError> {
        if !pose.is_valid() {
            return Err(HostError::NotFinite(id));
        }
        if let Some(body) = self.statics.body(id) {
            let mut body = body.clone();
            body.state.pose = pose;
            self.remove(id);
            self.insert(vec![body], &[])?;
            return Ok(true);
        }
        let Some(record) = self.record(id) else { return Ok(false) };
        let joints: Vec<_> = self.joints_of(id).collect();
        let moved = BodyRecord { state: crate::protocol::BodyState { pose, ..record.state }, ..record };
        let owner = self.partition.rank_at(pose.translation);
        if joints.is_empty() && owner != self.present_place(id).0 {
            self.remove(id);
            self.insert(vec![moved], &[])?;
            return Ok(true);
        }
        Ok(self.move_copies(id, pose))
    }

    /// Puts every copy held here elsewhere; the next exchange hands the body over, if it left its region. Returns whether
    /// any region here holds it.
    pub fn move_copies(&mut self, id: BodyId, pose: WorldPose) -> bool {
        let mut held = false;
        for region in &mut self.regions {
            if let Some(handle) = region.handle_of(id) {
                let pose = convert::region_from_world(region.anchor(), &pose);
                region.change(handle, |body| body.set_position(pose, true));
                held = true;
            }
        }
        held
    }
}
