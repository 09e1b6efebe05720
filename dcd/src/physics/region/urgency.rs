//! Tells whether a region must be stepped in every tick for now. A step of several ticks would count what its user
//! has just changed for too many ticks, end inside of what a fast body flies at, leave behind whoever rides on
//! what moves, pass by a sensor, or tell a hit's force as if it had lasted for all of the step.

use parry3d::bounding_volume::BoundingVolume;
use rapier3d::prelude::*;

use super::Region;
use super::moved::place;
use super::refine::FORESEEN_M;
use crate::fidelity::ATTENDED_TICKS;
use crate::protocol::{BodyTraits, ColliderRecord};

/// The distance, metres, up to which a character near a kinematic body that moves is taken for its rider.
const RIDER_GAP_M: f32 = 0.5;
/// The margin, metres, by which the boxes of fast bodies are grown: forces bend their way, and copies of shared
/// bodies are moved after a step.
const MARGIN_M: f32 = 0.1;
/// The way towards something in a step, metres, from which on it matters what is met.
const NOTED_M: f32 = 0.05;
/// The restitution from which on a body that falls keeps less of its bounce in a step of several ticks: gravity pulls it
/// for all of the step.
const BOUNCY: f32 = 0.5;

/// Returns whether a body is met more finely than others: it senses, tells forces of contacts, or bounces.
pub(super) fn is_delicate(traits: &BodyTraits) -> bool {
    let tells =
        |events: u32| ActiveEvents::from_bits_truncate(events).contains(ActiveEvents::CONTACT_FORCE_EVENTS);
    let is_delicate = |own: &ColliderRecord| own.sensor || tells(own.events) || own.restitution >= BOUNCY;
    traits.colliders.iter().any(is_delicate)
}

impl Region {
    /// Notes that its user changes something here.
    pub(in crate::physics) fn attend(&mut self) {
        self.attended = ATTENDED_TICKS;
    }

    /// Returns whether its user has changed something here in the last ticks.
    pub(in crate::physics) fn is_attended(&self) -> bool {
        self.attended > 0
    }

    /// Counts a tick since its user changed something here.
    pub(in crate::physics) fn count_attended(&mut self) {
        self.attended = self.attended.saturating_sub(1);
    }

    /// Forgets that its user has changed something here.
    pub(in crate::physics) fn forget_attended(&mut self) {
        self.attended = 0;
    }

    /// Returns whether a step of this length could miss a contact, lose a rider, or tell a meeting wrong: a body that
    /// goes farther in it than it foresees ([`Region::foresee`]) may come to another one, a character is near a kinematic
    /// body that moves, a vehicle drives, or a body may come to a sensor or to something whose hits are noted.
    pub(in crate::physics) fn is_rushed(&self, step_s: f32) -> bool {
        let has_riders = !self.characters.is_empty() && self.has_kinematic();
        let has_drivers = !self.vehicles.is_empty();
        self.awake().any(|handle| {
            let body = &self.world.bodies[handle];
            let way_m = body.linvel().length() * step_s;
            if way_m > FORESEEN_M {
                // Rapier's tree does not have what came since the last step.
                body.is_enabled() && (!self.touched.is_empty() || self.may_hit(handle, step_s))
            } else {
                has_riders && self.may_carry(handle)
                    || way_m > NOTED_M
                        && (has_drivers && self.slot(handle).traits.vehicle.is_some()
                            || self.delicate > 0 && self.may_disturb(handle, step_s))
            }
        })
    }

    /// Returns whether a body may come to another one in a step of this length that is no faster itself. The
    /// faster of two asks for both.
    fn may_hit(&self, handle: RigidBodyHandle, step_s: f32) -> bool {
        let bodies = &self.world.bodies;
        self.may_meet(handle, step_s, FORESEEN_M, |own, _, found, _| {
            let is_solid = |collider: ColliderHandle| !self.world.colliders[collider].is_sensor();
            let moves = |collider: ColliderHandle| {
                self.world.colliders[collider].parent().is_some_and(|parent| bodies[parent].is_dynamic())
            };
            is_solid(own) && is_solid(found) && (moves(own) || moves(found))
        }) || self.delicate > 0 && self.may_disturb(handle, step_s)
    }

    /// Returns whether a body may pass by or through a sensor in a step of this length, or hit something where hits are
    /// noted.
    fn may_disturb(&self, handle: RigidBodyHandle, step_s: f32) -> bool {
        let PhysicsWorld { bodies, colliders, narrow_phase, gravity, .. } = &*self.world;
        self.may_meet(handle, step_s, NOTED_M, |own, bounds, found, way_m| {
            let both = [own, found].map(|collider| &colliders[collider]);
            if both.iter().any(|collider| collider.is_sensor()) {
                let thin = |bounds: &Aabb| bounds.extents().min_element();
                return way_m > 0.5 * (thin(bounds) + thin(&both[1].compute_aabb()))
                    && narrow_phase.intersection_pair(own, found) != Some(true);
            }
            let body = |collider: &Collider| collider.parent().and_then(|parent| bodies.get(parent));
            let dynamic =
                || both.iter().filter_map(|collider| body(collider)).filter(|body| body.is_dynamic());
            let falls = || dynamic().any(|body| *gravity * body.gravity_scale() != Vector::ZERO);
            let is_told = both
                .iter()
                .any(|collider| collider.active_events().contains(ActiveEvents::CONTACT_FORCE_EVENTS));
            let bounces = both.iter().any(|collider| collider.restitution() >= BOUNCY);
            if dynamic().next().is_none() || !(is_told || bounces && falls()) {
                return false;
            }
            // What touches already comes nearer by its speed along the normal alone.
            let Some(pair) =
                narrow_phase.contact_pair(own, found).filter(|pair| pair.has_any_active_contact())
            else {
                return true;
            };
            let velocity = |collider: ColliderHandle| {
                body(&colliders[collider]).map_or(Vector::ZERO, |body| body.linvel())
            };
            let nearing = velocity(pair.collider1) - velocity(pair.collider2);
            pair.manifolds().iter().any(|manifold| nearing.dot(manifold.data.normal) * step_s > NOTED_M)
        })
    }

    /// Returns whether a body may come in a step of this length to a collider that is more than `least_m` nearer then, and
    /// that counts: `counts` is given a collider of the body with its bounds, the other one, and by how much they near.
    fn may_meet(
        &self,
        handle: RigidBodyHandle,
        step_s: f32,
        least_m: f32,
        counts: impl Fn(ColliderHandle, &Aabb, ColliderHandle, f32) -> bool,
    ) -> bool {
        let (bodies, colliders) = (&self.world.bodies, &self.world.colliders);
        let body = &bodies[handle];
        let way = body.linvel() * step_s;
        let filter = QueryFilter::default().exclude_rigid_body(handle);
        let queries = self.world.query_pipeline_with_filter(filter);
        let is_tied = |other| {
            let assembly = self.slot(handle).assembly;
            assembly.is_some() && assembly == self.slot(other).assembly
        };
        body.colliders().iter().any(|&own| {
            let collider = &colliders[own];
            if !collider.is_enabled() {
                return false;
            }
            let bounds = collider.shape().compute_aabb(&place(body, collider)).loosened(MARGIN_M);
            let around = bounds.merged(&bounds.translated(way)).loosened(way.length());
            queries.intersect_aabb_conservative(around).any(|(other, found)| {
                let Some(parent) = found.parent().filter(|&parent| !is_tied(parent)) else { return false };
                let apart = bodies[parent].linvel() * step_s - way;
                let at = found.compute_aabb();
                collider.collision_groups().test(found.collision_groups())
                    && apart.length() > least_m
                    && (bounds.intersects(&at) || bounds.intersects_moving_aabb(&at, apart))
                    && counts(own, &bounds, other, apart.length())
            })
        })
    }

    /// Returns whether a body is a kinematic one that moves, with a character near it.
    fn may_carry(&self, handle: RigidBodyHandle) -> bool {
        let is_character = |handle| self.slot(handle).traits.character.is_some();
        let body = &self.world.bodies[handle];
        let moves = body.linvel() != Vector::ZERO || body.angvel() != Vector::ZERO;
        let queries = self.world.query_pipeline();
        let mut near = body.colliders().iter().flat_map(|&collider| {
            let bounds = self.world.colliders[collider].compute_aabb().loosened(RIDER_GAP_M);
            queries.intersect_aabb_conservative(bounds)
        });
        body.is_kinematic()
            && moves
            && !is_character(handle)
            && near.any(|(_, found)| found.parent().is_some_and(is_character))
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::protocol::{Character, Controller, Velocity, WorldPose};
    use crate::runtime::{LocalWorld, WorldConfig};

    /// Returns a world of one region without gravity.
    fn empty() -> LocalWorld {
        let mut config = WorldConfig::default();
        config.step.gravity = [0.0; 3];
        LocalWorld::new(config).unwrap()
    }

    /// Returns whether a step of four ticks would be rushed.
    fn is_rushed(world: &LocalWorld) -> bool {
        world.regions().any(|region| region.is_rushed(4.0 / 60.0))
    }

    #[test]
    fn what_may_come_to_something_farther_away_than_it_foresees_is_rushed() {
        let mut world = empty();
        let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
        world.insert(ground, ColliderBuilder::cuboid(50.0, 0.5, 50.0)).unwrap();
        for (height_m, velocity, is_fast) in [
            (1.5, [0.0, -20.0, 0.0], true),
            (3.5, [0.0, -20.0, 0.0], false),
            (1.5, [0.0, -14.0, 0.0], false),
            (1.5, [0.0, 20.0, 0.0], false),
            (1.5, [20.0, 0.0, 0.0], false),
            (1.5, [30.0, -18.0, 0.0], true),
        ] {
            let cube = RigidBodyBuilder::dynamic().translation(Vector::Y * height_m);
            let cube = world.insert(cube, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
            world.step().unwrap();
            world.set_velocity(cube, Velocity::linear(velocity)).unwrap();
            assert_eq!(is_rushed(&world), is_fast, "{velocity:?} m/s at {height_m} m");
            world.remove(cube).unwrap();
        }
        // The ways of two cross.
        for (x, to) in [(-1.5, [20.0, 0.0, 0.0]), (0.0, [0.0, 0.0, 19.0])] {
            let cube = RigidBodyBuilder::dynamic().translation(Vector::new(x, 9.0, x.abs() - 1.5));
            let cube = world.insert(cube, ColliderBuilder::cuboid(0.3, 0.3, 0.3)).unwrap();
            world.step().unwrap();
            world.set_velocity(cube, Velocity::linear(to)).unwrap();
        }
        assert!(is_rushed(&world));
    }

    #[test]
    fn who_is_near_a_platform_that_moves_is_taken_for_its_rider() {
        let mut world = empty();
        let platform = RigidBodyBuilder::kinematic_velocity_based();
        let platform = world.insert(platform, ColliderBuilder::cuboid(2.0, 0.2, 2.0)).unwrap();
        let body = RigidBodyBuilder::kinematic_velocity_based().build();
        let (character, capsule) = (Character::default(), [ColliderBuilder::capsule_y(0.4, 0.3)]);
        let at = WorldPose::at([0.0, 0.92, 0.0]);
        let rider = world.insert_as(Some(Controller::Character(&character)), at, &body, &capsule).unwrap();
        world.step().unwrap();
        assert!(!is_rushed(&world), "nothing moves");
        world.set_velocity(platform, Velocity::linear([0.5, 0.0, 0.0])).unwrap();
        world.step().unwrap();
        assert!(is_rushed(&world));
        world.set_pose(rider, WorldPose::at([0.0, 9.0, 0.0])).unwrap();
        world.step().unwrap();
        assert!(!is_rushed(&world), "the character is elsewhere");
    }
}
