//! Gives the nodes of a simulated cluster Rapier, the physics of real nodes.

use std::fmt;

use rapier3d::prelude::RigidBodyHandle;

use super::physics::WORK_US;
use super::{Engine, Mechanics};
use crate::cluster::{PhysicsCommand, PhysicsEvent};
use crate::physics::{Measured, Ownership, Region, RegionHost};
use crate::protocol::{BodyState, Claim, ShapeHash, WorldPose};
use crate::recording::{BodyBits, Physics, Readout};
use crate::runtime::PhysicsDevice;
use crate::space::{BodyId, Epoch, RegionId};

/// The physics of a real node.
pub struct RapierEngine {
    device: PhysicsDevice,
    rounds: u32,
}

impl RapierEngine {
    /// Creates the physics of one more node, without a world.
    pub fn boxed() -> Box<dyn Engine> {
        Box::new(Self { device: PhysicsDevice::new(1), rounds: 0 })
    }
}

impl RapierEngine {
    /// Returns every movable body here with its role. It reads the regions, unlike the host's own map by id:
    /// in the middle of a tick, bodies that regions have handed over are nobody's yet.
    fn held(&self) -> impl Iterator<Item = ((BodyId, &Region, RigidBodyHandle), Ownership)> {
        let regions = self.device.host().into_iter().flat_map(|host| host.regions());
        regions
            .flat_map(|region| region.bodies().map(move |(id, role, handle, _)| ((id, region, handle), role)))
    }
}

impl fmt::Debug for RapierEngine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RapierEngine").field("rounds", &self.rounds).finish_non_exhaustive()
    }
}

impl Physics for RapierEngine {
    fn execute(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, String> {
        match &command {
            PhysicsCommand::Step { rounds, .. } => self.rounds = *rounds,
            PhysicsCommand::World(_) | PhysicsCommand::Rebuild { .. } => self.rounds = 0,
            _ => {}
        }
        let mut event = self.device.execute(command)?;
        // Times of this machine are left out, since a seed must always give the same run.
        if let Some(PhysicsEvent::Settled { stats, load, regions, .. }) = &mut event {
            stats.compute_us = 0;
            regions.iter_mut().for_each(|state| state.set_times_ms([state.awake as f32 * 1e-3; 3]));
            let regions = load.iter_mut().flat_map(|load| &mut load.regions);
            regions.for_each(|region| region.step_us = region.activity * WORK_US);
        }
        Ok(event)
    }
}

impl Readout for RapierEngine {
    fn regions(&self) -> Vec<RegionId> {
        self.device.regions()
    }

    fn bodies(&self, region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_> {
        self.device.bodies(region)
    }

    fn set(&mut self, body: BodyId, bits: &BodyBits) -> bool {
        self.device.set(body, bits)
    }

    fn touching(&self, body: BodyId) -> Vec<BodyId> {
        self.device.touching(body)
    }
}

impl Engine for RapierEngine {
    fn claims(&self) -> Vec<Claim> {
        let claim = |(id, region, handle): (BodyId, &Region, RigidBodyHandle)| Claim {
            id,
            epoch: region.epoch_of(handle),
            region: region.id(),
        };
        let mut claims: Vec<_> =
            self.held().filter(|held| held.1 == Ownership::Owner).map(|held| claim(held.0)).collect();
        claims.sort_by_key(|claim| claim.id);
        claims
    }

    fn ghosts(&self) -> Vec<(BodyId, Epoch, WorldPose)> {
        let ghosts = self.held().filter(|held| matches!(held.1, Ownership::Ghost { .. }));
        ghosts
            .map(|((id, region, handle), _)| (id, region.epoch_of(handle), region.world_pose(handle)))
            .collect()
    }

    fn state(&self, id: BodyId) -> Option<BodyState> {
        let regions = self.device.host().into_iter().flat_map(|host| host.regions());
        let mut held = regions.filter_map(|region| Some((region, region.handle_of(id)?)));
        let owner = held.find(|(region, handle)| {
            region.role_of(*handle).is_some_and(|(_, role)| role == Ownership::Owner)
        });
        owner.map(|(region, handle)| region.body_state(handle))
    }

    fn rounds(&self) -> u32 {
        self.rounds
    }

    fn rounds_wanted(&self) -> u32 {
        self.device.host().map_or(1, |host| host.rounds_wanted() as u32)
    }

    fn mechanics(&self) -> Mechanics {
        self.device.host().map(mechanics_of).unwrap_or_default()
    }

    fn shapes(&self) -> Vec<ShapeHash> {
        self.device.host().map_or_else(Vec::new, |host| host.shapes().hashes().collect())
    }

    fn is_stand_in(&self) -> bool {
        false
    }
}

/// Measures the bodies that the regions of a host own.
pub(super) fn mechanics_of(host: &RegionHost) -> Mechanics {
    Mechanics { energy_j: host.energy_j(), deepest_m: host.contacts().max_penetration_m }
}
