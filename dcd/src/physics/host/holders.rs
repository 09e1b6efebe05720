//! Finds the regions that hold a body without a look into each region of the world: the body's owner knows
//! them.

use super::RegionHost;
use crate::space::{BodyId, RegionSet};

impl RegionHost {
    /// Returns the places in `sides` of the regions that may hold a body, ascending. To be called between two
    /// ticks.
    pub(super) fn places_of(&self, id: BodyId) -> impl Iterator<Item = usize> + use<> {
        let count = self.sides.len();
        let places = self.holders_of(id).unwrap_or(RegionSet::ALL);
        places.iter().take_while(move |&place| place < count)
    }

    /// Returns whether a body is held here. An immovable body counts even if no region here is near it.
    pub(super) fn held(&self, id: BodyId) -> bool {
        if self.statics.body(id).is_some() {
            return true;
        }
        let looked_for = || self.regions().any(|region| region.holds(id));
        if !self.owners_know_holders() {
            return looked_for();
        }
        let held = self.owner_index.home(id).is_some();
        debug_assert_eq!(held, looked_for(), "{id} is held where it has an owner");
        held
    }

    /// Returns the regions that may hold a movable body, as its owner knows them, by rank. Where all regions
    /// are computed here, a rank is a place in `sides`. `None` if the owner may not know.
    fn holders_of(&self, id: BodyId) -> Option<RegionSet> {
        if self.sides.len() == 1 || !self.owners_know_holders() {
            return None;
        }
        let home = self.owner_index.home(id)?;
        let mut holders = self.sides[home.rank].region.slot(home.handle).holders;
        holders.insert(home.rank);
        debug_assert!(
            self.regions().all(|region| holders.contains(region.rank()) || !region.holds(id)),
            "the owner of {id} knows who holds it"
        );
        Some(holders)
    }

    /// Returns whether owners know all holders of their bodies, as [`RegionHost::validate`] checks. A region
    /// that has ticks to catch up may hold a body that its owner has taken back.
    fn owners_know_holders(&self) -> bool {
        self.sides.len() == self.partition.len() && self.governor.is_none() && !self.holders_unsure
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::physics::region::LOOKS;
    use crate::physics::{Coupling, Partition, RegionHost, StepSettings, joint_record};
    use crate::protocol::{Push, Velocity, WorldPose};
    use crate::space::{BodyId, Bounds, DistributionTree, JointId};

    #[test]
    fn a_call_on_a_body_looks_for_it_where_it_is_held_alone() {
        let bounds = Bounds::around([0.0; 3], [64.0; 3]);
        let partition = Partition::new(DistributionTree::halved(bounds, 64).unwrap(), None);
        let leaves = partition.leaves().to_vec();
        let settings =
            StepSettings { island_limit: 0, ..StepSettings::default().with_coupling(Coupling::Overlap) };
        let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
        let [alone, shared, new] = [0, 1, 2].map(BodyId::persistent);
        let record = |host: &mut RegionHost, id, at| {
            let (body, ball) = (RigidBodyBuilder::dynamic().gravity_scale(0.0), ColliderBuilder::ball(0.5));
            host.shapes_mut().describe(id, WorldPose::at(at), &body.build(), &[ball]).unwrap()
        };
        // Two bodies that touch across the planes at 0 have ghosts there.
        let bodies =
            [(alone, [7.0; 3]), (shared, [-0.2, 7.0, 7.0]), (BodyId::persistent(3), [0.6, 7.0, 7.0])];
        let bodies = bodies.map(|(id, at)| record(&mut host, id, at)).to_vec();
        host.insert(bodies, &[]).unwrap();
        (0..3).for_each(|_| host.step().unwrap());
        let holders = |host: &RegionHost, id| host.regions().filter(|region| region.holds(id)).count();
        let held_by = holders(&host, shared);
        assert!(host.regions().len() == 64 && (2..8).contains(&held_by), "{held_by}");
        assert_eq!(holders(&host, alone), 1);
        for (body, most) in [(alone, 1), (shared, held_by)] {
            let mut looks = |what: &str, call: &mut dyn FnMut(&mut RegionHost) -> bool| {
                let before = LOOKS.get();
                assert!(call(&mut host), "{what}");
                assert!(LOOKS.get() - before <= most, "{what}: {} looks of {most}", LOOKS.get() - before);
            };
            looks("steer", &mut |host| host.steer(body, &Velocity::linear([1.0, 0.0, 0.0])));
            looks("push", &mut |host| host.push(&Push::impulse(body, [0.0, 0.0, 0.1])));
            looks("move", &mut |host| {
                let pose = host.owned(body).map(|(region, handle)| region.world_pose(handle)).unwrap();
                host.move_copies(body, pose)
            });
            looks("ask", &mut |host| host.held(body) && !host.held(BodyId::persistent(9)));
        }
        let record = record(&mut host, new, [9.0; 3]);
        let before = LOOKS.get();
        host.insert(vec![record], &[]).unwrap();
        assert!(host.remove(new) && host.remove(shared));
        assert_eq!(LOOKS.get() - before, 0, "what is removed is looked for by its removal alone");
        assert!(host.regions().all(|region| !region.holds(new) && !region.holds(shared)));
    }

    #[test]
    fn a_joint_in_a_world_of_one_region_costs_the_same_however_long_the_chain_is() {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [100.0; 3]), 1).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let mut host = RegionHost::new(partition, StepSettings::default(), 1, &leaves).unwrap();
        let links: Vec<_> = (0..50).map(BodyId::persistent).collect();
        let bodies = links.iter().zip(0_u8..).map(|(&id, place)| {
            let at = WorldPose::at([f64::from(place), 0.0, 0.0]);
            let body = RigidBodyBuilder::dynamic().build();
            host.shapes_mut().describe(id, at, &body, &[ColliderBuilder::ball(0.3)]).unwrap()
        });
        let bodies = bodies.collect();
        host.insert(bodies, &[]).unwrap();
        let looks = links.windows(2).zip(0..).map(|(pair, id)| {
            let joint = SphericalJointBuilder::new().local_anchor2(-Vector::X).build();
            let before = LOOKS.get();
            host.tie(joint_record(JointId(id), pair[0], pair[1], &joint.data)).unwrap();
            LOOKS.get() - before
        });
        let looks: Vec<_> = looks.collect();
        assert!(looks.iter().all(|&count| count == looks[0]), "{looks:?}");
    }
}
