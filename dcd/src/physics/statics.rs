//! Keeps the immovable bodies of the world: known to the whole process, held by each region that they touch (thesis 3.3.4).

use std::collections::BTreeMap;
use std::sync::Arc;

use rapier3d::prelude::RigidBodyHandle;
use serde::{Deserialize, Serialize};

use super::record;
use super::region::{Ownership, Region};
use super::shapes::{ShapeError, ShapeLibrary};
use crate::protocol::{BodyRecord, BodyTraits, JointRecord, WorldPose};
use crate::space::{BodyId, Bounds, RegionSet};

/// Every immovable body of the world, with its bounds, by id; shared with checkpoints until a body comes,
/// goes or changes.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Statics {
    bodies: Arc<BTreeMap<BodyId, (BodyRecord, Bounds)>>,
}

impl Statics {
    /// Adds a body; regions that it touches must still [`Statics::insert_near`] it.
    pub(super) fn add(&mut self, body: BodyRecord, shapes: &ShapeLibrary) -> Result<(), ShapeError> {
        let bounds = record::bounds_of(&body, shapes)?;
        Arc::make_mut(&mut self.bodies).insert(body.id, (body, bounds));
        Ok(())
    }

    /// Removes a body. Returns whether it was here.
    pub(super) fn remove(&mut self, id: BodyId) -> bool {
        self.bodies.contains_key(&id) && Arc::make_mut(&mut self.bodies).remove(&id).is_some()
    }

    /// Returns an immovable body by id.
    pub(super) fn body(&self, id: BodyId) -> Option<&BodyRecord> {
        self.bodies.get(&id).map(|(body, _)| body)
    }

    /// Returns where an immovable body is.
    pub(super) fn pose(&self, id: BodyId) -> Option<WorldPose> {
        self.body(id).map(|body| body.state.pose)
    }

    /// Records a user's change of a body in place, so that regions that come to hold it later have it too.
    pub(super) fn set_traits(&mut self, id: BodyId, traits: &Arc<BodyTraits>, user_data: u128) {
        if self.bodies.contains_key(&id)
            && let Some((body, _)) = Arc::make_mut(&mut self.bodies).get_mut(&id)
        {
            (body.traits, body.user_data) = (traits.clone(), user_data);
        }
    }

    /// Returns all immovable bodies, in id order.
    pub(super) fn bodies(&self) -> impl Iterator<Item = &BodyRecord> {
        self.bodies.values().map(|(body, _)| body)
    }

    /// Inserts a body into a region if it touches what the region covers.
    pub(super) fn insert_near(
        &self,
        id: BodyId,
        region: &mut Region,
        shapes: &ShapeLibrary,
    ) -> Result<(), ShapeError> {
        let Some((body, bounds)) = self.bodies.get(&id) else { return Ok(()) };
        if region.covers(bounds) { insert(region, body, shapes) } else { Ok(()) }
    }

    /// Inserts the immovable bodies under and around a body into its region, however far it reaches out of the cell.
    pub(super) fn cover(
        &self,
        region: &mut Region,
        handle: RigidBodyHandle,
        shapes: &ShapeLibrary,
    ) -> Result<(), ShapeError> {
        const MARGIN_M: f64 = 0.1;
        if region.surely_covers(handle, MARGIN_M) {
            return Ok(());
        }
        self.cover_box(region, &region.world_bounds(handle).grown(MARGIN_M), shapes)
    }

    /// Inserts all immovable bodies that touch a box into the region.
    pub(super) fn cover_box(
        &self,
        region: &mut Region,
        bounds: &Bounds,
        shapes: &ShapeLibrary,
    ) -> Result<(), ShapeError> {
        let Some(wider) = region.widen_cover(bounds) else { return Ok(()) };
        for (body, bounds) in self.bodies.values() {
            if wider.touches(bounds) {
                insert(region, body, shapes)?;
            }
        }
        Ok(())
    }

    /// Updates the immovable bodies of a region whose cell has changed: inserts those there, and removes
    /// those far from all that the region holds.
    pub(super) fn recover(&self, region: &mut Region, shapes: &ShapeLibrary) -> Result<(), ShapeError> {
        let needed = region.renew_cover();
        for (body, bounds) in self.bodies.values() {
            if needed.touches(bounds) {
                insert(region, body, shapes)?;
            } else if region.handle_of(body.id).is_some_and(|handle| !region.is_jointed(handle)) {
                region.remove(body.id);
            }
        }
        Ok(())
    }

    /// Inserts the immovable end of a joint, if any, into the region.
    pub(super) fn ensure(
        &self,
        region: &mut Region,
        joint: &JointRecord,
        shapes: &ShapeLibrary,
    ) -> Result<(), ShapeError> {
        for id in [joint.a, joint.b] {
            if let Some(body) = self.body(id) {
                insert(region, body, shapes)?;
            }
        }
        Ok(())
    }
}

fn insert(region: &mut Region, body: &BodyRecord, shapes: &ShapeLibrary) -> Result<(), ShapeError> {
    if region.handle_of(body.id).is_none() {
        region.insert(body.clone(), Ownership::Immovable, RegionSet::EMPTY, shapes)?;
    }
    Ok(())
}
