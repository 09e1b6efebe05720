//! Reports bodies, events, regions and statistics of a local world, and gives access to queries.

use std::time::Duration;

use rapier3d::prelude::RigidBody;

use super::LocalWorld;
use crate::physics::{Handover, Ownership, Queries, Region};
use crate::protocol::{StateHasher, Velocity, WorldEvents, WorldPose};
use crate::runtime::{Choice, Stats};
use crate::space::{BodyId, RegionId, Tick};

impl LocalWorld {
    /// Returns the number of ticks done.
    pub fn tick(&self) -> Tick {
        self.host.tick()
    }

    /// Returns the owner's copy of a movable body, or any copy of an immovable one. Its position is in region
    /// space. Under mass splitting the copy has only its part of the body's mass and of the forces on it.
    /// [`LocalWorld::mass_kg`] returns the whole mass, and [`LocalWorld::update`] shows the whole body.
    pub fn body(&self, body: BodyId) -> Option<&RigidBody> {
        if let Some((region, handle)) = self.host.owned(body) {
            return region.physics().bodies.get(handle);
        }
        self.host.regions().find_map(|region| region.physics().bodies.get(region.handle_of(body)?))
    }

    /// Returns whether the world has a body.
    #[inline]
    pub fn contains(&self, body: BodyId) -> bool {
        self.host.owned(body).is_some() || self.host.immovable(body).is_some()
    }

    /// Returns the pose of a body in world space.
    #[inline]
    pub fn pose(&self, body: BodyId) -> Option<WorldPose> {
        match self.host.owned(body) {
            Some((region, handle)) => Some(region.world_pose(handle)),
            None => self.host.immovable(body).map(|record| record.state.pose),
        }
    }

    /// Returns the mass of a body in kilograms, whole even if several regions share it; 0 for a fixed body.
    pub fn mass_kg(&self, body: BodyId) -> Option<f32> {
        if self.body(body)?.is_fixed() { Some(0.0) } else { self.host.mass_kg(body) }
    }

    /// Returns the velocity of a body; zero for an immovable one.
    #[inline]
    pub fn velocity(&self, body: BodyId) -> Option<Velocity> {
        match self.host.owned(body) {
            Some((region, handle)) => Some(region.velocity(handle)),
            None => self.host.immovable(body).map(|record| record.state.velocity),
        }
    }

    /// Returns [`LocalWorld::pose`] and [`LocalWorld::velocity`] of a body in one look-up.
    #[inline]
    pub fn motion(&self, body: BodyId) -> Option<(WorldPose, Velocity)> {
        match self.host.owned(body) {
            Some((region, handle)) => Some(region.motion(handle)),
            None => self.host.immovable(body).map(|record| (record.state.pose, record.state.velocity)),
        }
    }

    /// Returns the region that has authority over a movable body.
    pub fn owner_of(&self, body: BodyId) -> Option<RegionId> {
        self.host.owned(body).map(|(region, _)| region.id())
    }

    /// Returns the contacts that began, ended or exceeded their force threshold in the last step, for
    /// colliders with Rapier's `ActiveEvents`.
    pub fn events(&self) -> &WorldEvents {
        &self.events
    }

    /// Returns the bodies that changed owner in the last step, in id order.
    pub fn handovers(&self) -> &[Handover] {
        self.host.handovers()
    }

    /// Returns the interface for rays, shape casts, projections and overlaps, over all regions.
    pub fn queries(&self) -> Queries<'_> {
        self.host.queries()
    }

    /// Returns the id, owner, pose and velocity of every movable body, in id order.
    pub fn states(&self) -> impl Iterator<Item = (BodyId, RegionId, WorldPose, Velocity)> {
        self.host.states()
    }

    /// Returns a hash of the state of all movable bodies: equal for equal worlds, whatever the number of
    /// threads.
    pub fn state_hash(&self) -> u64 {
        let mut hasher = StateHasher::default();
        for (id, _, pose, velocity) in self.states() {
            hasher.add(id, &pose, &velocity);
        }
        hasher.finish()
    }

    /// Returns the wall time of the last step.
    pub fn last_step(&self) -> Duration {
        self.last_step
    }

    /// Returns statistics of the world so far.
    pub fn stats(&self) -> Stats {
        Stats {
            ticks: self.host.tick().0,
            bodies: self.host.owned_count(),
            ghosts: self.host.regions().map(Region::ghost_count).sum(),
            transfers: self.host.transfers(),
            last_step: self.last_step,
            quarantined: self.host.regions().map(|region| region.quarantined().len()).sum(),
            exchanges: self.host.exchanges_done(),
            disagreement_m_s: self.host.disagreement_m_s(),
        }
    }

    /// Returns how the world is computed (regions, threads, coupling), and the reason for that.
    ///
    /// ```
    /// # use dcd::runtime::{LocalWorld, Why, WorldConfig};
    /// let world = LocalWorld::new(WorldConfig { threads: 2, ..WorldConfig::default() })?;
    /// let chosen = world.chosen();
    /// assert_eq!((chosen.regions, chosen.threads, chosen.why), (1, 2, Why::Exact));
    /// # Ok::<(), dcd::runtime::WorldError>(())
    /// ```
    pub fn chosen(&self) -> Choice {
        Choice {
            regions: self.regions().len(),
            threads: self.host.threads(),
            coupling: self.host.settings().coupling,
            why: self.why,
        }
    }

    /// Returns the regions in rank order, with their Rapier worlds.
    pub fn regions(&self) -> impl ExactSizeIterator<Item = &Region> + Clone {
        self.host.regions()
    }

    /// Returns how many regions have authority over a body. It is 1 for every movable body, or something is
    /// wrong.
    pub fn owners_of(&self, body: BodyId) -> usize {
        let owns = |region: &&Region| {
            region
                .handle_of(body)
                .and_then(|handle| region.role_of(handle))
                .is_some_and(|(_, role)| role == Ownership::Owner)
        };
        self.regions().filter(owns).count()
    }
}
