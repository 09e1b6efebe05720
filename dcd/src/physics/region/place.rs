//! Changes a region's cell, rank and floating origin (the anchor), as the tree follows the load and the
//! anchor follows the bodies. Finds which immovable bodies the region must hold, and measures its load.

use rapier3d::prelude::*;

use super::{BodyRef, COVER_M, Ownership, Region, StepTime, floating_origin};
use crate::physics::convert;
use crate::physics::partition::HUB_REACH_M;
use crate::physics::rank_remap::RankRemap;
use crate::protocol::WorldPose;
use crate::space::{BodyId, Bounds, Cell, RegionSet};

/// The distance outside the cell, metres, up to which a sleeping body stays here.
const LEFT_BEHIND_M: f64 = 2.0 * HUB_REACH_M as f64;

impl Region {
    /// Sets the cell after a plane has moved. The coupling then checks all bodies here anew.
    pub(in crate::physics) fn set_cell(&mut self, cell: Cell) {
        self.cell = cell;
        self.passed_over = true;
        self.stirred = true;
        self.due.fill(0);
    }

    /// Translates all ranks after a rank remap. The region's own id may have changed too.
    pub(in crate::physics) fn remap_ranks(&mut self, ranks: &RankRemap) {
        self.rank = ranks.rank(self.rank);
        self.id = ranks.leaves[self.rank];
        self.events.region = self.id;
        for slot in self.slots.iter_mut().flatten() {
            slot.holders = ranks.set(slot.holders);
            slot.led_by = slot.led_by.and_then(|rank| ranks.to[rank]);
            if let Ownership::Ghost { owner } = &mut slot.role {
                *owner = ranks.rank(*owner);
            }
            if let Some(mass_split) = slot.mass_split.as_deref_mut() {
                mass_split.among = ranks.set(mass_split.among);
            }
        }
    }

    /// Returns whether the region holds anything that can move.
    pub(in crate::physics) fn holds_movable(&self) -> bool {
        self.slots.iter().flatten().any(|slot| slot.role != Ownership::Immovable)
    }

    /// Returns whether the region has yet to report that contacts ended.
    pub(in crate::physics) fn owes_word(&self) -> bool {
        self.listener.owes_word()
    }

    /// Returns the sleeping bodies that lie far outside the cell, in id order: once after a plane has passed over
    /// them, and while this region is being emptied. Bodies nearer to the cell stay here.
    pub(in crate::physics) fn left_behind(&mut self, is_emptied: bool) -> Vec<RigidBodyHandle> {
        if !std::mem::take(&mut self.passed_over) && !is_emptied {
            return Vec::new();
        }
        let mut resting = self.own_resting();
        resting.retain(|&handle| {
            let is_far = self.cell.excess_m(self.centre_of(handle)) > LEFT_BEHIND_M;
            is_far && self.world.bodies[handle].is_sleeping()
        });
        resting
    }

    /// Forgets that regions in `emptied` lead bodies that sleep here: nothing would tell otherwise, and those regions
    /// would go on to be asked for.
    pub(in crate::physics) fn forget_leaders(&mut self, emptied: RegionSet) {
        let sleeps = |link: &BodyRef| self.world.bodies[link.handle].is_sleeping();
        let asleep: Vec<_> = self.held_elsewhere().filter(sleeps).collect();
        for link in asleep {
            let led_by = &mut self.slot_mut(link.handle).led_by;
            *led_by = led_by.filter(|rank| !emptied.contains(*rank));
        }
    }

    /// Returns the region's own bodies that sleep or are disabled, in id order.
    pub(in crate::physics) fn own_resting(&self) -> Vec<RigidBodyHandle> {
        let owned = self.slots.iter().flatten().filter(|slot| slot.role == Ownership::Owner);
        let mut resting: Vec<_> =
            owned.map(|slot| BodyRef { id: slot.id, handle: self.by_id[&slot.id] }).collect();
        resting.retain(|link| {
            #[cfg(test)]
            super::awake::LOOKS.set(super::awake::LOOKS.get() + 1);
            let body = &self.world.bodies[link.handle];
            body.is_sleeping() || !body.is_enabled()
        });
        resting.sort_unstable_by_key(|link| link.id);
        resting.into_iter().map(|link| link.handle).collect()
    }

    /// Returns the load as a count: the region's own awake bodies, and their contacts. Ghosts are left out:
    /// their number depends on where planes are, so planes that were moved by it would swing.
    pub(in crate::physics) fn activity(&self) -> f64 {
        let counts = |handle: RigidBodyHandle| {
            let owned = self.slot_at(handle).is_some_and(|slot| slot.role == Ownership::Owner);
            owned && !self.world.bodies[handle].is_sleeping()
        };
        let owner = |collider| self.world.colliders.get(collider).and_then(Collider::parent);
        let contacts = |collider: &ColliderHandle| {
            // A pair of two awake bodies counts once, at its first collider.
            let is_first = |pair: &ContactPair| {
                pair.collider1 == *collider || !owner(pair.collider1).is_some_and(counts)
            };
            let pairs = self.world.narrow_phase.contact_pairs_with(*collider).inspect(|_| {
                #[cfg(test)]
                super::awake::PAIRS.set(super::awake::PAIRS.get() + 1);
            });
            pairs.filter(|pair| pair.has_any_active_contact() && is_first(pair)).count()
        };
        let colliders = self.own_awake().into_iter().flat_map(|handle| self.world.bodies[handle].colliders());
        let bodies = self.world.islands.active_bodies().filter(|&handle| counts(handle)).count();
        (bodies + colliders.map(contacts).sum::<usize>()) as f64
    }

    /// Returns the centres of mass of the region's own awake bodies, in world space.
    pub(in crate::physics) fn awake_places(&self) -> impl Iterator<Item = (BodyId, [f64; 3])> {
        self.world.islands.active_bodies().filter_map(|handle| match self.role_of(handle) {
            Some((id, Ownership::Owner)) => Some((id, self.centre_of(handle))),
            _ => None,
        })
    }

    /// Returns a body's centre of mass, in world space.
    pub(in crate::physics) fn centre_of(&self, handle: RigidBodyHandle) -> [f64; 3] {
        convert::world_point(self.anchor, self.world.bodies[handle].center_of_mass())
    }

    /// Returns how long the region's steps take.
    pub(in crate::physics) fn time(&self) -> &StepTime {
        &self.time
    }

    pub(in crate::physics) fn time_mut(&mut self) -> &mut StepTime {
        &mut self.time
    }

    /// Moves the region's floating origin (the anchor). What is held here stays where it is in world space. An
    /// immovable body, which may have been rounded far from the former anchor, is put where `immovable` says that it is.
    pub(in crate::physics) fn set_anchor(
        &mut self,
        anchor: [f64; 3],
        immovable: impl Fn(BodyId) -> Option<WorldPose>,
    ) {
        let from = std::mem::replace(&mut self.anchor, anchor);
        // Exact: anchors lie on a grid, and f32 represents the way from one to the other unless it is too
        // far.
        let shift = convert::region_point(anchor, from);
        let moved = |pose: &Pose| Pose::from_parts(pose.translation + shift, pose.rotation);
        for (_, body) in self.world_mut().bodies.iter_mut() {
            let (here, next) = (moved(body.position()), moved(body.next_position()));
            body.set_position(here, false);
            if body.is_kinematic() {
                body.set_next_kinematic_position(next);
            }
        }
        for slot in self.slots.iter_mut().flatten() {
            slot.asleep_at = slot.asleep_at.as_ref().map(moved);
        }
        self.due.fill(0);
        self.unsettle_characters();
        self.unsettle_vehicles();
        for slot in self.slots.iter().flatten().filter(|slot| slot.role == Ownership::Immovable) {
            let PhysicsWorld { bodies, colliders, .. } = &mut *self.world;
            let body = &mut bodies[self.by_id[&slot.id]];
            let here = || convert::world_from_region(anchor, body.position());
            let pose = immovable(slot.id).unwrap_or_else(here);
            body.set_position(convert::region_from_world(anchor, &pose), false);
            for &collider in body.colliders() {
                if colliders[collider].shape().as_halfspace().is_some() {
                    floating_origin::fetch_plane(&mut colliders[collider], &pose, anchor);
                }
            }
        }
        // Until the next step, Rapier's colliders stay where they were relative to the former anchor.
        for link in self.links() {
            self.touch(link.handle);
        }
    }

    /// Returns whether the covered box contains a ball around a body's origin with all its colliders in it,
    /// with a margin in metres. This is quicker to tell than whether it contains the AABB.
    pub(in crate::physics) fn surely_covers(&self, handle: RigidBodyHandle, margin_m: f64) -> bool {
        let body = &self.world.bodies[handle];
        let reach_m = self.slot(handle).reach_m + body.local_center_of_mass().length();
        let origin = convert::world_point(self.anchor, body.translation());
        self.covered.contains(&Bounds::around(origin, [f64::from(reach_m) + margin_m; 3]))
    }

    /// Widens the covered box, whose immovable bodies must be held here, to contain `bounds`. Returns the box
    /// in which to look for immovable bodies then, or `None` if `bounds` was covered already.
    pub(in crate::physics) fn widen_cover(&mut self, bounds: &Bounds) -> Option<Bounds> {
        if self.covered.contains(bounds) {
            return None;
        }
        self.covered = self.covered.union(&bounds.grown(2.0));
        Some(self.covered)
    }

    /// Computes the covered box anew, after the cell has changed, and returns it. From now on immovable
    /// bodies in it must be held here.
    pub(in crate::physics) fn renew_cover(&mut self) -> Bounds {
        let here = Bounds { min: self.cell.min, max: self.cell.max };
        let movable = self.slots.iter().flatten().filter(|slot| slot.role != Ownership::Immovable);
        let held = movable.map(|slot| self.world_bounds(self.by_id[&slot.id]).grown(2.0));
        let empty = (0..3).any(|i| here.min[i] >= here.max[i]);
        let cell = (!empty).then(|| here.grown(COVER_M));
        // An empty region covers nothing.
        let nothing = Bounds::new([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        self.covered =
            cell.into_iter().chain(held).reduce(|all, bounds| all.union(&bounds)).unwrap_or(nothing);
        self.covered
    }

    pub(in crate::physics) fn covers(&self, bounds: &Bounds) -> bool {
        self.covered.touches(bounds)
    }
}
