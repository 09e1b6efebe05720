//! Simulates, in tests, processes that compute the regions of a world together: hosts that exchange their
//! messages in memory.

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
    /// Deals the regions of a world to `count` processes in turn.
    pub(crate) fn of(scene: &Scene, settings: StepSettings, regions: usize, count: usize) -> Self {
        Self::cut(scene, settings, DistributionTree::halved(scene.bounds, regions).unwrap(), count)
    }

    /// Deals the leaves of a tree to `count` processes in turn.
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

    /// Changes the tree everywhere. The process at place `newborn`, modulo their number, computes new
    /// regions.
    pub(crate) fn repartition(&mut self, changes: &[TreeChange], newborn: usize) {
        let newborn = newborn % self.0.len();
        for (place, host) in self.0.iter_mut().enumerate() {
            host.repartition(changes, place == newborn).unwrap();
            host.move_left_behind();
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

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::space::{Axis, Bounds};

    /// Processes exchange nothing between what a user does and the tick: a fast body waits for one tick.
    #[test]
    fn what_is_set_off_or_inserted_by_processes_passes_nothing_beyond_a_border() {
        for (plate, inserted) in [
            (RigidBodyBuilder::dynamic(), false),
            (RigidBodyBuilder::dynamic(), true),
            (RigidBodyBuilder::kinematic_velocity_based(), false),
            (RigidBodyBuilder::kinematic_velocity_based(), true),
        ] {
            // In slabs: from the first, bullets fly into the second or the third.
            let cuts = [0.0, 1.0, 3.0].map(|at| (Axis::X, at));
            let tree = DistributionTree::cut_by(Bounds::around([0.0; 3], [100.0; 3]), &cuts).unwrap();
            let mut scene = Scene::empty("bullets");
            let at = |i: usize| [0.2 + 0.1 * i as f64, 4.0 * i as f64 - 32.0, 0.0];
            for i in 0..16 {
                scene.push(WorldPose::at(at(i)), plate.clone(), ColliderBuilder::cuboid(0.02, 1.0, 1.0));
            }
            let start = |i: usize| WorldPose::at([-0.3, at(i)[1], 0.0]);
            let bullet = || RigidBodyBuilder::dynamic().ccd_enabled(true);
            let ball = || ColliderBuilder::ball(0.1).density(20.0);
            if !inserted {
                (0..16).for_each(|i| _ = scene.push(start(i), bullet(), ball()));
            }
            let settings = StepSettings { gravity: [0.0; 3], ..StepSettings::default() };
            let mut world = Processes::cut(&scene, settings, tree, 2);
            (0..12).for_each(|_| world.step());
            let ids: Vec<_> = (16..32).map(BodyId::persistent).collect();
            for (i, &id) in ids.iter().enumerate() {
                for host in &mut world.0 {
                    if inserted {
                        let flying = bullet().linvel(Vector::X * 200.0).build();
                        let record = host.shapes_mut().describe(id, start(i), &flying, &[ball()]).unwrap();
                        host.meet_all();
                        host.insert(vec![record], &[]).unwrap();
                    } else {
                        let velocity = Velocity { linear: [200.0, 0.0, 0.0], angular: [0.0; 3] };
                        host.steer(id, &velocity);
                    }
                }
            }
            let x_of = |world: &Processes, id| {
                world.states().iter().find(|(body, ..)| *body == id).unwrap().2.translation[0]
            };
            world.step();
            assert!(ids.iter().all(|&id| x_of(&world, id) < -0.29), "who has not been heard of waits");
            (0..10).for_each(|_| world.step());
            let passed =
                (0..16).filter(|&i| x_of(&world, BodyId::persistent(i as u32)) + 0.02 < x_of(&world, ids[i]));
            assert_eq!(passed.count(), 0, "{:?}, inserted: {inserted}", plate.body_type);
        }
    }
}
