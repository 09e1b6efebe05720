//! Gives the nodes of a simulated cluster the physics of real ones, by Rapier.

use std::fmt;

use dcd::cluster::{PhysicsCommand, PhysicsEvent};
use dcd::physics::Ownership;
use dcd::protocol::{BodyState, Claim, WorldPose};
use dcd::recording::{BodyBits, Physics, Readout};
use dcd::runtime::PhysicsDevice;
use dcd::sim::Engine;
use dcd::space::{BodyId, Epoch, RegionId};

/// The physics of a real node.
pub(super) struct Device {
    device: PhysicsDevice,
    rounds: u32,
}

impl Device {
    pub(super) fn boxed() -> Box<dyn Engine> {
        Box::new(Self { device: PhysicsDevice::new(1), rounds: 0 })
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("rounds", &self.rounds).finish_non_exhaustive()
    }
}

impl Physics for Device {
    fn execute(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, String> {
        match &command {
            PhysicsCommand::Step { rounds, .. } => self.rounds = *rounds,
            PhysicsCommand::World(_) | PhysicsCommand::Rebuild { .. } => self.rounds = 0,
            _ => {}
        }
        let mut event = self.device.execute(command)?;
        if let Some(PhysicsEvent::Settled { stats, .. }) = &mut event {
            // The only thing that is told of the machine's own time: a seed is to give the same run.
            stats.compute_us = 0;
        }
        Ok(event)
    }
}

impl Readout for Device {
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

impl Engine for Device {
    fn claims(&self) -> Vec<Claim> {
        let host = self.device.host().into_iter();
        let mut claims: Vec<_> = host
            .flat_map(|host| host.owned_bodies())
            .map(|(id, region, handle)| Claim { id, epoch: region.epoch_of(handle), region: region.id() })
            .collect();
        claims.sort_by_key(|claim| claim.id);
        claims
    }

    fn replicas(&self) -> Vec<(BodyId, Epoch, WorldPose)> {
        let regions = self.device.host().into_iter().flat_map(|host| host.regions());
        regions
            .flat_map(|region| {
                region
                    .bodies()
                    .filter(|&(_, role, ..)| matches!(role, Ownership::Replica { .. }))
                    .map(|(id, _, handle, _)| (id, region.epoch_of(handle), region.world_pose(handle)))
            })
            .collect()
    }

    fn state(&self, id: BodyId) -> Option<BodyState> {
        self.device.host()?.owned(id).map(|(region, handle)| region.body_state(handle))
    }

    fn rounds(&self) -> u32 {
        self.rounds
    }

    fn rounds_wanted(&self) -> u32 {
        self.device.host().map_or(1, |host| host.rounds_wanted() as u32)
    }
}
