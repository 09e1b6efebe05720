//! Stands in for processes that compute the regions of a world together, in tests: hosts that exchange their messages in memory.

use super::RegionHost;
use crate::physics::coupling::Side;
use crate::physics::region::Region;
use crate::physics::{Partition, StepSettings};
use crate::protocol::{Check, Velocity, WorldPose};
use crate::scene::Scene;
use crate::space::{BodyId, DistributionTree, RegionId, TreeChange};

/// Processes that compute the regions of a world together.
pub(crate) struct Processes(pub(crate) Vec<RegionHost>);

impl Processes {
    /// Deals the regions of a world to so many processes in turn.
    pub(crate) fn of(scene: &Scene, settings: StepSettings, regions: usize, count: usize) -> Self {
        Self::cut(scene, settings, DistributionTree::halved(scene.bounds, regions).unwrap(), count)
    }

    /// Deals the leaves of a tree to so many processes in turn.
    pub(crate) fn cut(scene: &Scene, settings: StepSettings, tree: DistributionTree, count: usize) -> Self {
        let leaves: Vec<_> = tree.leaves().collect();
        let host = |i: usize| {
            let own: Vec<_> = leaves.iter().skip(i).step_by(count).copied().collect();
            let mut host = RegionHost::new(Partition::new(tree.clone(), None), settings, 1, &own).unwrap();
            let (bodies, joints) = scene.records(host.shapes_mut()).unwrap();
            host.insert(bodies, &joints).unwrap();
            host.announce();
            host
        };
        let mut all = Self((0..count).map(host).collect());
        all.exchange();
        all.0.iter_mut().for_each(|host| host.clear_events());
        all
    }

    fn exchange(&mut self) {
        let said: Vec<_> = self.0.iter().flat_map(|host| host.outgoing().cloned()).collect();
        assert!(said.iter().all(|message| message.check().is_ok()), "others take in what is sent");
        let neighbours: Vec<_> = self.0.iter().map(RegionHost::neighbours).collect();
        for (host, near) in self.0.iter().zip(&neighbours) {
            let here: Vec<_> = host.regions().map(Region::id).collect();
            let sends = said.iter().filter(|message| here.contains(&message.from));
            assert!(sends.clone().all(|message| near.contains(&message.to)), "sent to neighbours");
            let hears = said.iter().filter(|message| here.contains(&message.to));
            assert!(hears.clone().all(|message| near.contains(&message.from)), "heard from neighbours");
        }
        for host in &mut self.0 {
            for message in &said {
                if host.regions().any(|region| region.id() == message.to) {
                    host.accept(message.clone());
                }
            }
            host.exchange().unwrap();
        }
    }

    pub(crate) fn step(&mut self) {
        let rounds = self.0.iter().map(RegionHost::rounds_wanted).max().unwrap();
        self.0.iter_mut().for_each(|host| host.set_rounds(rounds));
        for _ in 0..rounds {
            self.0.iter_mut().for_each(RegionHost::compute);
            self.exchange();
        }
        self.0.iter_mut().for_each(RegionHost::end_tick);
    }

    /// Changes the tree everywhere; a new region is computed by the process of this place, if there are so many.
    pub(crate) fn repartition(&mut self, changes: &[TreeChange], newborn: usize) {
        let newborn = newborn % self.0.len();
        for (place, host) in self.0.iter_mut().enumerate() {
            host.repartition(changes, place == newborn).unwrap();
            host.wake_left_behind();
        }
    }

    /// Returns the regions with their sides of borders, in no order.
    pub(in crate::physics) fn sides(&self) -> impl Iterator<Item = &Side> {
        self.0.iter().flat_map(|host| &host.sides)
    }

    pub(crate) fn states(&self) -> Vec<(BodyId, RegionId, WorldPose, Velocity)> {
        let mut states: Vec<_> = self.0.iter().flat_map(RegionHost::states).collect();
        states.sort_by_key(|(id, ..)| *id);
        states
    }
}
