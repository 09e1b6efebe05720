//! Groups bodies tied by joints into assemblies, by union-find. An assembly is owned by one region, and moves
//! whole.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::RigidBodyHandle;
use serde::{Deserialize, Serialize};

use super::Region;
use super::slot::BodyRef;
use crate::protocol::BodyKind;
use crate::space::{BodyId, Groups};

/// A group of bodies of one region that joints tie together, in id order.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Assembly {
    pub members: Vec<BodyRef>,
    /// Says whether it contains a multibody; such an assembly is never shared.
    pub articulated: bool,
}

/// The assemblies of a region, and which of them must be found anew.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Assemblies {
    /// In no order. Assemblies that are gone are empty until their places are used again.
    pub all: Vec<Assembly>,
    /// Places of assemblies that are gone.
    free: Vec<u32>,
    /// The assemblies, and in `retied` the bodies of none, whose joints have changed since the last update. A
    /// world of one region has no use for assemblies, and finds none.
    stale: BTreeSet<u32>,
    retied: BTreeMap<BodyId, RigidBodyHandle>,
}

impl Region {
    /// Notes that a body has gained or lost a joint, and may belong to another assembly.
    pub(super) fn note_retied(&mut self, handle: RigidBodyHandle) {
        let slot = self.slot(handle);
        match slot.assembly {
            Some(place) => {
                self.assemblies.stale.insert(place);
            }
            None => {
                self.assemblies.retied.insert(slot.id, handle);
            }
        }
    }

    /// Forgets a body that is removed and belongs to no assembly.
    pub(super) fn forget_retied(&mut self, id: BodyId) {
        self.assemblies.retied.remove(&id);
    }

    /// Finds assemblies anew where joints came or went. Only bodies that are tied to theirs are looked at.
    pub(in crate::physics) fn update_assemblies(&mut self) {
        let Assemblies { all, free, stale, retied } = &mut self.assemblies;
        let (retied, places) = (std::mem::take(retied), std::mem::take(stale));
        let mut bodies: Vec<_> = retied.into_iter().map(|(id, handle)| BodyRef { id, handle }).collect();
        for &place in &places {
            bodies.append(&mut std::mem::take(&mut all[place as usize]).members);
        }
        free.extend(places.iter().rev());
        let movable = |region: &Self, id: BodyId| {
            let handle = region.handle_of(id)?;
            (region.slot(handle).traits.kind != BodyKind::Fixed).then_some(BodyRef { id, handle })
        };
        let mut ties = Vec::new();
        for link in bodies {
            if self.handle_of(link.id) != Some(link.handle) {
                continue;
            }
            self.slot_mut(link.handle).assembly = None;
            if movable(self, link.id).is_none() {
                continue;
            }
            for joint in self.slot(link.handle).joints.iter().filter_map(|joint| self.joints.get(joint)) {
                match [joint.record.a, joint.record.b].map(|end| movable(self, end)) {
                    [Some(a), Some(b)] => ties.push((a, b)),
                    // A body tied to something immovable is an assembly of one: its joint must travel with
                    // it.
                    _ => ties.push((link, link)),
                }
            }
        }
        for mut assembly in connect(ties) {
            let joints = assembly.members.iter().flat_map(|link| &self.slot(link.handle).joints);
            let mut joints = joints.filter_map(|joint| self.joints.get(joint));
            assembly.articulated = joints.any(|joint| joint.record.link.is_some());
            let Assemblies { all, free, .. } = &mut self.assemblies;
            let place = free.pop().unwrap_or_else(|| {
                all.push(Assembly::default());
                (all.len() - 1) as u32
            });
            for link in &assembly.members {
                self.slot_mut(link.handle).assembly = Some(place);
            }
            self.assemblies.all[place as usize] = assembly;
        }
    }
}

/// Joins bodies tied in pairs into assemblies, ordered by their lowest ids.
fn connect(ties: impl IntoIterator<Item = (BodyRef, BodyRef)>) -> Vec<Assembly> {
    let mut links: BTreeMap<BodyId, BodyRef> = BTreeMap::new();
    let mut groups = Groups::default();
    for (a, b) in ties {
        links.insert(a.id, a);
        links.insert(b.id, b);
        groups.join(a.id, b.id);
    }
    let mut by_root: BTreeMap<BodyId, Assembly> = BTreeMap::new();
    for (id, link) in links {
        by_root.entry(groups.root(id)).or_default().members.push(link);
    }
    by_root.into_values().collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use rapier3d::prelude::*;

    use super::super::LOOKS;
    use crate::physics::RegionHost;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::BodyId;

    /// Returns the assembly of each body, named by the lowest id in it.
    fn groups(host: &RegionHost) -> BTreeMap<BodyId, BodyId> {
        let mut groups = BTreeMap::new();
        for region in host.regions() {
            for (place, assembly) in region.assemblies().iter().enumerate() {
                for link in &assembly.members {
                    assert_eq!(region.slot(link.handle).assembly, Some(place as u32));
                    groups.insert(link.id, assembly.members[0].id);
                }
            }
        }
        groups
    }

    #[test]
    fn a_world_of_one_region_remembers_no_joint_that_came_and_went() {
        let mut world = LocalWorld::new(WorldConfig { threads: 1, ..WorldConfig::default() }).unwrap();
        let ball = |world: &mut LocalWorld| {
            world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.1)).unwrap()
        };
        let post = ball(&mut world);
        for _ in 0..50 {
            let bob = ball(&mut world);
            world.insert_joint(post, bob, RopeJointBuilder::new(1.0)).unwrap();
            world.step().unwrap();
            world.remove(bob).unwrap();
        }
        let region = world.host().regions().next().unwrap();
        assert!(region.assemblies.retied.len() + region.assemblies.stale.len() <= 1);
    }

    #[test]
    fn a_joint_that_comes_or_goes_has_only_what_it_ties_looked_at() {
        const ROPES: usize = 100;
        let config =
            WorldConfig { threads: 1, partitioning: Partitioning::Regions(2), ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let ball = |world: &mut LocalWorld, body: RigidBodyBuilder, x: usize, z: usize| {
            let at = Vector::new(3.0 * x as f32 - 150.0, 0.0, z as f32);
            let body = body.translation(at).gravity_scale(0.0).can_sleep(false);
            world.insert(body, ColliderBuilder::ball(0.1)).unwrap()
        };
        let ropes: Vec<[BodyId; 3]> = (0..ROPES)
            .map(|x| {
                let balls = [0, 1, 2].map(|z| ball(&mut world, RigidBodyBuilder::dynamic(), x, z));
                world.insert_joint(balls[0], balls[1], RopeJointBuilder::new(1.0)).unwrap();
                world.insert_joint(balls[1], balls[2], RopeJointBuilder::new(1.0)).unwrap();
                balls
            })
            .collect();
        let post = ball(&mut world, RigidBodyBuilder::fixed(), 1, 5);
        world.step().unwrap();
        let looks = |world: &mut LocalWorld, change: &dyn Fn(&mut LocalWorld)| {
            let of_step = |world: &mut LocalWorld| {
                let before = LOOKS.get();
                world.step().unwrap();
                LOOKS.get() - before
            };
            let usual = of_step(world);
            change(world);
            of_step(world).saturating_sub(usual)
        };
        let (one, other) = (ropes[10], ropes[11]);
        let together = |world: &LocalWorld, a: BodyId, b: BodyId| {
            let groups = groups(world.host());
            groups.contains_key(&a) && groups.get(&a) == groups.get(&b)
        };
        assert!(together(&world, one[0], one[2]) && !together(&world, one[0], other[0]));
        let tie = |a, b| {
            move |world: &mut LocalWorld| {
                world.insert_joint(a, b, RopeJointBuilder::new(3.0)).unwrap();
            }
        };
        let few = looks(&mut world, &tie(one[2], other[0]));
        assert!(few < ROPES, "{few} looks for a joint more");
        assert!(together(&world, one[0], other[2]));
        let first = world.joints_of(other[0])[1];
        let few = looks(&mut world, &|world| world.remove_joint(first).unwrap());
        assert!(few < ROPES, "{few} looks for a joint less");
        assert!(!together(&world, one[0], other[2]) && together(&world, other[0], other[2]));
        // A body tied to something immovable is a group of its own, and once it is gone there is none.
        world.remove(one[1]).unwrap();
        tie(one[0], post)(&mut world);
        world.step().unwrap();
        assert!(!groups(world.host()).contains_key(&one[2]) && !groups(world.host()).contains_key(&post));
        assert!(groups(world.host()).contains_key(&one[0]));
        world.remove(one[0]).unwrap();
        tie(one[2], other[1])(&mut world);
        world.step().unwrap();
        assert!(together(&world, one[2], other[0]));
        assert_eq!(groups(world.host()).len(), 3 * ROPES - 2);
    }
}
