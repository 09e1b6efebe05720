//! Finds the bodies and joints that the regions here hold, with their records and states.

use std::collections::BTreeSet;

use rapier3d::prelude::RigidBodyHandle;

use super::RegionHost;
use crate::physics::owner_index::Home;
use crate::physics::region::{Ownership, Region};
use crate::protocol::{BodyRecord, JointRecord, Velocity, WorldPose};
use crate::space::{BodyId, JointId, RegionId};

impl RegionHost {
    /// Returns the owner's copy of a movable body, if its region is computed here.
    #[inline]
    pub fn owned(&self, id: BodyId) -> Option<(&Region, RigidBodyHandle)> {
        let home = self.owner_index.home(id)?;
        Some((self.region_at(home.rank)?, home.handle))
    }

    /// Returns an immovable body by id.
    pub fn immovable(&self, id: BodyId) -> Option<&BodyRecord> {
        self.statics.body(id)
    }

    /// Returns the whole record of a body, as its owner has it if the owner is here, else as a ghost has it.
    pub fn record(&self, id: BodyId) -> Option<BodyRecord> {
        if let Some(body) = self.statics.body(id) {
            return Some(body.clone());
        }
        if let Some((region, handle)) = self.owned(id) {
            return Some(region.body_record(handle));
        }
        self.regions().find_map(|region| Some(region.body_record(region.handle_of(id)?)))
    }

    /// Returns the whole records of one body's joints, in order of insertion.
    pub fn joints_of(&self, id: BodyId) -> impl Iterator<Item = JointRecord> {
        let mut holders = self.places_of(id).map(|place| &self.sides[place].region);
        let held = holders.find_map(|region| Some((region, region.handle_of(id)?)));
        held.into_iter().flat_map(|(region, handle)| region.joints_of(handle))
    }

    /// Returns the pose and velocity of every movable body owned here, in id order, with its region.
    pub fn states(&self) -> impl Iterator<Item = (BodyId, RegionId, WorldPose, Velocity)> {
        self.owned_bodies().map(|(id, region, handle)| {
            let (pose, velocity) = region.motion(handle);
            (id, region.id(), pose, velocity)
        })
    }

    /// Returns every movable body owned here, in id order, with its region and Rapier's handle there.
    pub fn owned_bodies(&self) -> impl Iterator<Item = (BodyId, &Region, RigidBodyHandle)> {
        self.owner_index.homes().filter_map(|(id, home)| Some((id, self.region_at(home.rank)?, home.handle)))
    }

    /// Returns the movable bodies owned here that do not sleep, in id order.
    pub(crate) fn awake_bodies(&self) -> Vec<BodyId> {
        let awake = self.regions().flat_map(|region| region.awake().map(move |handle| (region, handle)));
        let owned = awake.filter_map(|(region, handle)| {
            let (id, _) = region.role_of(handle)?;
            let here = Home { rank: region.rank(), handle };
            (self.owner_index.home(id) == Some(here)).then_some(id)
        });
        let mut owned: Vec<_> = owned.collect();
        owned.sort_unstable();
        // A region may list one more than once.
        owned.dedup();
        owned
    }

    /// Returns the copies of movable bodies here that do not sleep, whoever owns them, some more than once.
    pub(crate) fn awake_copies(&self) -> impl Iterator<Item = (BodyId, Ownership, &Region, RigidBodyHandle)> {
        let awake = self.regions().flat_map(|region| region.awake().map(move |handle| (region, handle)));
        awake.filter_map(|(region, handle)| {
            let (id, role) = region.role_of(handle)?;
            (role != Ownership::Immovable).then_some((id, role, region, handle))
        })
    }

    /// Returns the joints here of bodies that do not sleep, some more than once.
    pub(crate) fn awake_joints(&self) -> impl Iterator<Item = JointId> {
        self.regions().flat_map(Region::awake_joints)
    }

    /// Returns every movable body held here, owned or ghost, in id order.
    pub fn held_bodies(&self) -> BTreeSet<BodyId> {
        let held = self.regions().flat_map(Region::bodies);
        held.map(|(id, ..)| id).filter(|&id| self.statics.body(id).is_none()).collect()
    }

    /// Returns every immovable body of the world, in id order.
    pub fn scenery(&self) -> impl Iterator<Item = &BodyRecord> {
        self.statics.bodies()
    }

    /// Returns how many movable bodies are owned here.
    pub fn owned_count(&self) -> usize {
        self.owner_index.len()
    }
}
