//! Finds which bodies of a region are within some hops, along contacts and joints, of bodies that another
//! region owns: that region must hold them too.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::island::{self, Island, Islands};
use super::shared::SharedBodies;
use crate::physics::partition::HUB_REACH_M;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::BodyKind;
use crate::space::RegionSet;

/// For each body, the regions with a body within `depth` hops of it; kept for its memory.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reach {
    /// The marks of bodies, by Rapier's body index.
    marks: Vec<RegionSet>,
    /// Bodies with a mark.
    pub reached: Vec<RigidBodyHandle>,
    #[serde(skip)]
    frontier: Vec<(RigidBodyHandle, RegionSet)>,
    #[serde(skip)]
    next: Vec<(RigidBodyHandle, RegionSet)>,
}

impl Reach {
    /// Returns the regions with a body within reach of this one, as found last.
    pub(super) fn of(&self, handle: RigidBodyHandle) -> RegionSet {
        let mark = self.marks.get(handle.into_raw_parts().0 as usize);
        mark.copied().unwrap_or_default()
    }

    /// Finds anew which bodies are within `depth` hops of bodies that other regions own, lead, or will own.
    /// The region that leads a body solves what touches it, and may be a third region beside the body's owner
    /// and this one.
    ///
    /// - `leaving`: bodies owned here that are on their way to another region, with that region's rank.
    /// - `met`: bodies owned here with a predicted contact to a body that other regions own, lead or will own,
    ///   with these regions. They are one hop away.
    pub(super) fn spread(
        &mut self,
        region: &Region,
        islands: &Islands,
        shared: &SharedBodies,
        depth: usize,
        leaving: impl Iterator<Item = (RigidBodyHandle, usize)>,
        met: impl Iterator<Item = (RigidBodyHandle, RegionSet)>,
    ) {
        let draws = |handle| islands.of(handle).is_some_and(|island| island.draws(region.rank()));
        let outweighs = |other, ghost: RigidBodyHandle| {
            let slot = region.slot(ghost);
            let Ownership::Ghost { owner } = slot.role else { return false };
            let is_anchored = islands.of(other).is_some_and(|island| island.anchored);
            if !is_anchored || region.physics().bodies[ghost].is_ccd_enabled() {
                return false;
            }
            let size = shared.get(ghost).and_then(|shared| shared.awake_size_in(owner));
            let is_led_elsewhere = slot.led_by.is_some_and(|rank| rank != owner && rank != region.rank());
            !is_led_elsewhere && size.is_some_and(|size| island::outweighs(islands.size(other), size))
        };
        for handle in self.reached.drain(..) {
            self.marks[handle.into_raw_parts().0 as usize] = RegionSet::EMPTY;
        }
        self.frontier.clear();
        for link in region.held_elsewhere() {
            let slot = region.slot(link.handle);
            let owner = match slot.role {
                Ownership::Ghost { owner } => Some(owner),
                _ => None,
            };
            let others: RegionSet = owner.into_iter().chain(slot.led_by).collect();
            self.frontier.push((link.handle, others.without(RegionSet::only(region.rank()))));
        }
        self.frontier.retain(|(_, others)| !others.is_empty());
        self.frontier.extend(leaving.map(|(handle, rank)| (handle, RegionSet::only(rank))));
        let mut met = Some(met);
        for _ in 0..depth {
            self.next.clear();
            for index in 0..self.frontier.len() {
                let (handle, set) = self.frontier[index];
                if passes_on(region, handle) {
                    region.for_each_neighbour(handle, |other| {
                        if !region.is_articulated(other) && !draws(other) && !outweighs(other, handle) {
                            self.mark(other, set);
                        }
                    });
                }
            }
            let met = met.take().into_iter().flatten();
            for (handle, regions) in met.filter(|(handle, _)| !region.is_articulated(*handle)) {
                self.mark(handle, regions);
            }
            std::mem::swap(&mut self.frontier, &mut self.next);
        }
    }

    /// Marks all of a small island with the regions that any part of it is within reach of, so that those
    /// regions see all that presses on that part. Of a large island they see less than its owner does, which
    /// leads it.
    pub(super) fn complete(&mut self, region: &Region, islands: &Islands) {
        self.next.clear();
        let small = |island: &&Island| !island.big && island.members.len() > 1 && !island.large;
        for island in islands.found.iter().filter(small) {
            let reached = |link: &BodyRef| self.of(link.handle);
            let all = island.members.iter().map(reached).fold(RegionSet::EMPTY, RegionSet::union);
            for link in island.members.iter().filter(|link| !region.is_articulated(link.handle)) {
                self.mark(link.handle, all);
            }
        }
    }

    /// Marks kinematic bodies with the regions of the bodies that they carry: all regions that hold what
    /// touches them or is tied to them by joints, even as a ghost, and those that `met` names. A kinematic body
    /// must be in a region before what it carries is owned there. What is tied to it is marked with the region of
    /// the kinematic body, which learns so where its load is.
    pub(super) fn carry(&mut self, region: &Region, met: Vec<(RigidBodyHandle, RegionSet)>) {
        if !region.has_kinematic() {
            return;
        }
        let own = RegionSet::only(region.rank());
        let (mut carriers, mut tied) = (met, Vec::new());
        for link in region.held_elsewhere() {
            let slot = region.slot(link.handle);
            if slot.traits.kind == BodyKind::Dynamic {
                region.for_each_contact(link.handle, |other, _| carriers.push((other, slot.holders)));
            } else if let Ownership::Ghost { owner } = slot.role {
                tied.extend(region.tied_to(link.handle).map(|other| (other, RegionSet::only(owner))));
            }
        }
        for (handle, set) in tied {
            if region.slot(handle).role == Ownership::Owner && !region.is_articulated(handle) {
                self.mark(handle, set);
            }
        }
        for (handle, set) in carriers {
            let slot = region.slot(handle);
            let set = set.without(own);
            if slot.role == Ownership::Owner && slot.traits.kind != BodyKind::Dynamic && !set.is_empty() {
                self.mark(handle, set);
            }
        }
    }

    fn mark(&mut self, handle: RigidBodyHandle, set: RegionSet) {
        let index = handle.into_raw_parts().0 as usize;
        if self.marks.len() <= index {
            self.marks.resize(index + 1, RegionSet::EMPTY);
        }
        let new = set.without(self.marks[index]);
        if !new.is_empty() {
            if self.marks[index].is_empty() {
                self.reached.push(handle);
            }
            self.marks[index] = self.marks[index].union(new);
            self.next.push((handle, new));
        }
    }
}

/// Returns whether reach spreads from a body to its neighbours. A hub or a kinematic body is held wherever
/// its neighbours are, but does not bring its other neighbours along.
fn passes_on(region: &Region, handle: RigidBodyHandle) -> bool {
    let slot = region.slot(handle);
    slot.reach_m <= HUB_REACH_M && slot.traits.kind == BodyKind::Dynamic
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::physics::Measured;
    use crate::physics::host::processes::Processes;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::scene::{Params, Scene};
    use crate::space::{Axis, BodyId};

    /// A train lies across a border, and most of it in the first region, which so owns all of it. A ball hits it
    /// beyond the border. Returns for how many ticks the ball's region held any wagon, the ball's speed after
    /// that, and by how much the momentum has changed, as a part of the ball's.
    fn ball_at_train(is_tied_down: bool, ball_has_ccd: bool) -> (usize, f32, f64) {
        let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
        let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        let mut world = LocalWorld::new(config).unwrap();
        let wagon = |i: i32| {
            let is_post = is_tied_down && i == 0;
            let body = if is_post { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
            let body = body.can_sleep(false).translation(Vector::X * (-8.0 + 1.04 * i as f32));
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
        };
        let train: Vec<BodyId> = (0..12).map(wagon).collect();
        for pair in train.windows(2) {
            let hook =
                SphericalJointBuilder::new().local_anchor1(Vector::X * 0.52).local_anchor2(Vector::X * -0.52);
            world.insert_joint(pair[0], pair[1], hook).unwrap();
        }
        let falling = RigidBodyBuilder::dynamic().ccd_enabled(ball_has_ccd);
        let falling = falling.translation(Vector::new(2.2, 5.0, 0.0)).linvel(Vector::Y * -4.0);
        let ball = world.insert(falling, ColliderBuilder::ball(0.3)).unwrap();
        let before = world.host().momentum_kgms();
        let mut held = 0;
        for tick in 0..100 {
            world.step().unwrap();
            let beyond = world.regions().find(|region| region.cell().min[0] == 0.0).unwrap();
            held += usize::from(tick > 40 && beyond.bodies().any(|(id, ..)| train[1..].contains(&id)));
        }
        let after = world.host().momentum_kgms();
        let strays = (0..3).map(|i| (after[i] - before[i]).abs()).fold(0.0, f64::max);
        (held, world.velocity(ball).unwrap().linear[1], strays / before[1].abs())
    }

    #[test]
    fn a_region_whose_ball_hits_a_train_that_is_tied_down_in_another_one_holds_none_of_the_train() {
        let (held, speed_m_s, _) = ball_at_train(true, false);
        assert!(speed_m_s > -3.0, "{speed_m_s} m/s: it has hit");
        assert_eq!(held, 0, "ticks");
        // Copies that CCD does not stop would go on, and what is free keeps its momentum.
        assert!(ball_at_train(true, true).0 > 0);
        let (held, speed_m_s, strays) = ball_at_train(false, false);
        assert!(held > 0 && speed_m_s > -3.0 && strays < 1e-5, "{held} ticks, {speed_m_s} m/s, {strays}");
    }

    #[test]
    fn who_leads_a_body_holds_what_rests_on_it_where_a_heap_is_poured_over_a_corner_of_four_regions() {
        let scene = Scene::named("heap", &Params::new().with("n", 600).with("seed", 1)).unwrap();
        let mut processes = Processes::of(&scene, WorldConfig::for_scene(&scene).step, 4, 1);
        let (mut seen, mut unseen_by_leader) = (0, 0);
        for _ in 0..240 {
            processes.step();
            for side in processes.sides() {
                let region = &side.region;
                for link in region.held_elsewhere() {
                    let leader = region.slot(link.handle).led_by;
                    let Some(leader) = leader.filter(|leader| *leader != region.rank()) else { continue };
                    region.for_each_pair(link.handle, |other, pair| {
                        if pair.is_some_and(|pair| pair.total_impulse_magnitude() > 0.0) {
                            let holds = region.slot(other).holders.contains(leader);
                            seen += 1;
                            unseen_by_leader += usize::from(!holds);
                        }
                    });
                }
            }
        }
        println!("{unseen_by_leader} of {seen} contacts");
        assert!(seen > 10_000, "{seen} contacts of bodies that others lead");
        assert!(500 * unseen_by_leader < seen, "{unseen_by_leader} of {seen} contacts");
    }
}
