//! Places all bodies of a host anew, once it is settled which regions the host computes: when a world begins,
//! and when membership changes.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::place::check_state;
use super::{HostError, RegionHost};
use crate::physics::articulation;
use crate::physics::coupling::{Moment, Side};
use crate::physics::placement::{self, Placement};
use crate::physics::region::Region;
use crate::protocol::{BodyKind, BodyRecord, JointRecord};
use crate::space::{BodyId, DistributionTree, RegionId, Tick};

impl RegionHost {
    /// Places all bodies with which a world of several regions begins as one scene, in whatever parts and
    /// order they came. The world then has the bits of one that was given all at once, or that is sent to
    /// nodes.
    pub(crate) fn place_beginning(&mut self) -> Result<(), HostError> {
        if self.tick != Tick(0) || self.is_placed || self.partition.len() == 1 {
            return Ok(());
        }
        let bodies: Vec<_> = self.owned_bodies().map(|(id, ..)| id).collect();
        let bodies: Vec<_> = bodies.into_iter().filter_map(|id| self.record(id)).collect();
        // The next step quarantines what is not finite.
        if bodies.iter().any(|body| check_state(body).is_err()) {
            return Ok(());
        }
        let ties = bodies.iter().flat_map(|body| self.joints_of(body.id)).map(|joint| (joint.id, joint));
        let joints: Vec<_> = ties.collect::<BTreeMap<_, _>>().into_values().collect();
        let targets = self.targets_of(&bodies);
        let (tree, regions) = (self.partition.tree().clone(), self.partition.leaves().to_vec());
        regions.iter().for_each(|&region| self.remove_region(region));
        // The regions given here do not count: placement chooses them by all bodies.
        let placed = bodies.into_iter().map(|body| (regions[0], body)).collect();
        self.rebuild(&tree, &regions, placed, &joints, &[])?;
        self.drop_unconfirmed();
        self.send_all(targets)
    }

    /// Sets the tree and the regions that are computed here, as when membership changes. Kept regions keep
    /// their bodies. `placed` bodies, each with its region, which may be elsewhere, replace what is held of
    /// them; `dropped` bodies go. All regions forget which others hold ghosts, so the exchange that follows
    /// must announce every shared body again: [`RegionHost::announce`], [`RegionHost::exchange`],
    /// [`RegionHost::drop_unconfirmed`].
    ///
    /// # Panics
    /// If a region is kept and the tree has other leaves than before: members of one view change their trees
    /// alike.
    pub fn rebuild(
        &mut self,
        tree: &DistributionTree,
        hosted: &[RegionId],
        placed: Vec<(RegionId, BodyRecord)>,
        joints: &[JointRecord],
        dropped: &[BodyId],
    ) -> Result<(), HostError> {
        for region in self.regions().map(Region::id).collect::<Vec<_>>() {
            if !hosted.contains(&region) {
                self.remove_region(region);
            }
        }
        self.replant(tree)?;
        self.meet_all();
        let mut placed = placed;
        // Immovable bodies are sent on joining, and stay.
        placed
            .retain(|(_, body)| body.traits.kind != BodyKind::Fixed || self.statics.body(body.id).is_none());
        for id in placed.iter().map(|(_, body)| body.id).chain(dropped.iter().copied()) {
            for side in &mut self.sides {
                side.region.remove(id);
            }
            self.owner_index.remove(id);
        }
        for &id in dropped {
            self.statics.remove(id);
        }
        let steps = self.settings.coupling.first_steps(self.settings.exchanges);
        (self.rounds, self.settled) = (steps, false);
        self.holders_unsure = true;
        self.forgive();
        for side in &mut self.sides {
            side.forget_holders(self.partition.len(), steps);
        }
        for &id in hosted {
            if !self.regions().any(|region| region.id() == id) {
                self.add_region(id);
            }
        }
        self.threads.suit(self.sides.len())?;
        // New regions get immovable bodies in the same pass, so that all is inserted in id order, as in a new
        // world.
        placed.extend(self.statics.bodies().map(|body| (RegionId(0), body.clone())));
        placed.sort_by_key(|(_, body)| body.id);
        let mut owners: Vec<_> =
            placed.iter().map(|(region, _)| self.partition.rank_of(*region).unwrap_or(usize::MAX)).collect();
        let mut bodies: Vec<_> = placed.into_iter().map(|(_, body)| body).collect();
        let mut whole = vec![false; bodies.len()];
        let placement = Placement::of(&bodies, joints, &self.shapes, &self.settings)?;
        let mut joints = joints.to_vec();
        if self.tick == Tick(0) {
            // The whole scene, sent to every node: each places it as a world in one process would.
            owners = placement.owners(&bodies, &self.partition);
            whole = placement.whole(&bodies, &owners);
            if bodies.iter().any(placement::lies) {
                placement::note_standing(&mut bodies, &joints);
            }
        } else {
            owners = placement.together(owners);
            // The server records where bodies are, but not the motion of joints, which follows from that.
            articulation::set_motions(&mut joints, |id| {
                let place = bodies.binary_search_by_key(&id, |body| body.id).ok()?;
                Some(&bodies[place].state)
            });
            placement::note_standing(&mut bodies, &joints);
        }
        self.insert_placed(bodies, &owners, &whole, &joints)
    }

    /// Takes over a tree that has the same leaves as before, or any tree if no region is computed here.
    fn replant(&mut self, tree: &DistributionTree) -> Result<(), HostError> {
        if tree == self.partition.tree() {
            return Ok(());
        }
        let has_same_leaves = tree.leaves().eq(self.partition.leaves().iter().copied());
        assert!(has_same_leaves || self.sides.is_empty(), "members of a view have the same tree");
        Arc::make_mut(&mut self.partition).set_tree(tree.clone());
        self.place_of = vec![None; self.partition.len()];
        self.index();
        self.refit(tree.clone())
    }

    /// Announces bodies inserted since the last step to the regions that must hold them. The next exchange
    /// carries the announcements.
    pub fn announce(&mut self) {
        self.meet_all();
        self.meet(true);
        let settings = self.settings;
        let moment = Moment::new(&self.partition, &settings, self.tick, self.rounds, 0, self.coarsest());
        let all = self.sides.iter_mut().collect();
        self.threads.share_out(all, |side| settings.coupling.announce(side, moment));
        // A region that rested in the tick before may have been stirred since: it must act on its own
        // announcements.
        for side in self.sides.iter_mut().filter(|side| !side.is_idle()) {
            side.region.begin_tick(false);
        }
    }

    /// Removes ghosts that no owner has announced since [`RegionHost::rebuild`].
    pub fn drop_unconfirmed(&mut self) {
        for Side { region, .. } in &mut self.sides {
            for link in region.ghosts().to_vec() {
                if !region.slot(link.handle).confirmed {
                    region.remove(link.id);
                }
            }
        }
        self.holders_unsure = false;
    }

    /// Removes a region with all that it holds.
    fn remove_region(&mut self, id: RegionId) {
        if let Some(place) = self.partition.rank_of(id).and_then(|rank| self.place_of[rank]) {
            self.sides.remove(place);
            self.index();
        }
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::{Coupling, LinkSettings, Partition, StepSettings, joint_record};
    use crate::protocol::{LinkMotion, LinkRecord, Velocity, WorldPose};
    use crate::space::{Bounds, JointId};

    #[test]
    fn a_link_that_is_placed_anew_goes_on_from_where_its_bodies_are() {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [8.0; 3]), 1).unwrap();
        let leaves: Vec<_> = tree.leaves().collect();
        let partition = Partition::new(tree.clone(), None);
        let step = StepSettings { gravity: [0.0; 3], ..StepSettings::default() };
        let mut host = RegionHost::new(partition, step.with_coupling(Coupling::Owner), 1, &[]).unwrap();
        let turned = Rotation::from_rotation_z(1.0);
        let reach = turned * Vector::X;
        let at = |way: Vector| way.to_array().map(f64::from);
        let poses =
            [WorldPose::at([0.0; 3]), WorldPose { rotation: turned.to_array(), ..WorldPose::at(at(reach)) }];
        let cube = ColliderBuilder::cuboid(0.1, 0.1, 0.1);
        let kinds = [RigidBodyBuilder::fixed(), RigidBodyBuilder::dynamic()];
        let mut bodies = Vec::new();
        for ((index, kind), pose) in (0..).zip(kinds).zip(poses) {
            let body = kind.can_sleep(false).build();
            let id = BodyId::persistent(index);
            bodies.push(host.shapes_mut().describe(id, pose, &body, std::slice::from_ref(&cube)).unwrap());
        }
        let linear = (Vector::Z * 0.5).cross(reach).to_array();
        bodies[1].state.velocity = Velocity { linear, angular: [0.0, 0.0, 0.5] };
        let hinge: GenericJoint = RevoluteJointBuilder::new(Vector::Z).local_anchor2(-Vector::X).into();
        let begun =
            LinkMotion { rotation: [0.0, 0.0, 0.0, 1.0], velocity: [9.0; 6], ..LinkMotion::default() };
        let link = LinkSettings { damping: Some([0.0; 6]), ..LinkSettings::default() }.record();
        let link = Some(LinkRecord { motion: Some(begun), ..link });
        let hinge = joint_record(JointId(1), bodies[0].id, bodies[1].id, &hinge);
        let placed: Vec<_> = bodies.iter().map(|body| (leaves[0], body.clone())).collect();
        host.set_tick(Tick(100));
        host.rebuild(&tree, &leaves, placed, &[JointRecord { link, ..hinge }], &[]).unwrap();
        host.announce();
        host.exchange().unwrap();
        (0..60).for_each(|_| host.step().unwrap());
        let pose = host.record(bodies[1].id).unwrap().state.pose;
        let there = Rotation::from_rotation_z(1.5) * Vector::X;
        let apart = (0..3).map(|i| (pose.translation[i] - at(there)[i]).abs()).fold(0.0, f64::max);
        assert!(apart < 5e-3, "{pose:?} instead of {there}");
    }
}
