//! Wakes sleepers in the tick in which something is about to strike them, or has been put into them.

use parry3d::query::ShapeCastOptions;
use rapier3d::prelude::*;

use super::{Ownership, Region, Slot};

/// The way in a step, metres, from which on what moves may push sleepers into one another.
const WAY_M: f32 = 0.005;
/// The depth, metres, from which on a sleeper does not just lie on another body.
const DEEP_M: f32 = 0.02;

impl Region {
    /// Wakes what sleeps in the way that something goes in a step of `dt_s` seconds, before contacts are found. Seen with
    /// Rapier 0.36.1: a sleeper that is woken by a contact has no other contacts in that step. A stack that is struck
    /// by a box at 13 m/s overlaps by 7 cm then, and awake by 4 mm.
    ///
    /// Takes no account of what the step itself does to velocities but for gravity, nor of what a turning body
    /// passes through within the step.
    pub(super) fn wake_what_is_about_to_be_struck(&mut self, dt_s: f32) {
        let is_immovable = |slot: &&Slot| slot.role == Ownership::Immovable;
        let count = || self.slots.iter().flatten().filter(is_immovable).count();
        let immovable = *self.immovable.get_or_insert_with(count);
        // Rapier's list lacks what came since its last step, and what it does not step; copies that were put back are on it.
        let is_unlisted = |body: &RigidBody| {
            body.is_enabled() && !body.is_sleeping() && body.effective_active_set_offset() == u32::MAX
        };
        let came = self.turnover.born_awake.iter().filter_map(|handle| self.world.bodies.get(*handle));
        let came = came.filter(|body| is_unlisted(body)).count();
        let awake = self.world.islands.num_active_bodies() + came + self.unstepped.len();
        if awake >= self.by_id.len() - immovable {
            return;
        }
        let mut struck = Vec::new();
        for handle in self.awake() {
            let Some(slot) = self.slot_at(handle) else { continue };
            let body = &self.world.bodies[handle];
            let falls = if body.is_dynamic() { body.gravity_scale() * dt_s } else { 0.0 };
            let velocity = body.linvel() + self.world.gravity * falls;
            let way_m = (velocity.length() + body.angvel().length() * slot.reach_m) * dt_s;
            if body.is_enabled() && way_m > WAY_M && way_m.is_finite() {
                self.find_struck(body, velocity, dt_s, &mut struck);
            }
        }
        struck.into_iter().for_each(|handle| self.wake(handle));
    }

    /// Adds the sleepers that a body touches on its way straight on, or as it is turned at the end of that.
    fn find_struck(&self, body: &RigidBody, velocity: Vector, dt_s: f32, struck: &mut Vec<RigidBodyHandle>) {
        let margin = self.world.integration_parameters.prediction_distance();
        let falls = Pose::from_translation((velocity - body.linvel()) * dt_s);
        let goes = falls * body.predict_position_using_velocity(dt_s) * body.position().inverse();
        let dispatcher = self.world.narrow_phase.query_dispatcher();
        for collider in self.solid_colliders(body) {
            let start = super::moved::place(body, collider);
            let end = goes * start;
            let is_struck = |other: &Collider| {
                let at = other.position();
                let options = ShapeCastOptions {
                    max_time_of_impact: dt_s,
                    target_distance: margin,
                    ..ShapeCastOptions::default()
                };
                let (onto, along) = (at.inv_mul(&start), at.rotation.inverse() * velocity);
                let cast = dispatcher.cast_shapes(&onto, along, other.shape(), collider.shape(), options);
                let turned =
                    || dispatcher.contact(&at.inv_mul(&end), other.shape(), collider.shape(), margin);
                cast.is_ok_and(|hit| hit.is_some()) || turned().is_ok_and(|hit| hit.is_some())
            };
            let way = collider.shape().compute_swept_aabb(&start, &end).loosened(margin);
            let near = self.sleepers_near(collider, way);
            struck.extend(near.filter(|(_, other)| is_struck(other)).map(|(sleeper, _)| sleeper));
        }
    }

    /// Wakes what sleeps where a body that is not dynamic has been put, or let touch it. Seen with Rapier 0.36.1: such a
    /// sleeper wakes without that contact, and stays in the other body.
    pub(super) fn wake_what_is_hit(&mut self) {
        let mut hit = Vec::new();
        for handle in std::mem::take(&mut self.obstacles) {
            let obstacle = self.world.bodies.get(handle);
            let Some(body) = obstacle.filter(|body| !body.is_dynamic() && body.is_enabled()) else {
                continue;
            };
            for collider in self.solid_colliders(body) {
                let place = super::moved::place(body, collider);
                let is_in = |other: &Collider| {
                    let met = parry3d::query::contact(
                        &place,
                        collider.shape(),
                        other.position(),
                        other.shape(),
                        0.0,
                    );
                    met.is_ok_and(|met| met.is_some_and(|met| met.dist < -DEEP_M))
                };
                let near = self.sleepers_near(collider, collider.shape().compute_aabb(&place));
                hit.extend(near.filter(|(_, other)| is_in(other)).map(|(sleeper, _)| sleeper));
            }
        }
        hit.into_iter().for_each(|handle| self.wake(handle));
    }

    fn solid_colliders<'a>(&'a self, body: &'a RigidBody) -> impl Iterator<Item = &'a Collider> {
        let colliders = body.colliders().iter().map(|&own| &self.world.colliders[own]);
        colliders.filter(|own| is_solid(own))
    }

    /// Returns the dynamic bodies that sleep within some bounds, each with a collider that may touch another one.
    fn sleepers_near(
        &self,
        collider: &Collider,
        bounds: Aabb,
    ) -> impl Iterator<Item = (RigidBodyHandle, &Collider)> {
        let groups = collider.collision_groups();
        let near = self.world.intersect_aabb_conservative(bounds, QueryFilter::only_dynamic());
        let near = near.filter(move |(_, other)| is_solid(other) && groups.test(other.collision_groups()));
        near.filter_map(move |(_, other)| {
            let sleeper = other.parent().filter(|parent| self.world.bodies[*parent].is_sleeping())?;
            Some((sleeper, other))
        })
    }
}

fn is_solid(collider: &Collider) -> bool {
    !collider.is_sensor() && collider.is_enabled()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::WorldPose;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    /// Returns how deep the upper two boxes of a stack overlap after a box has struck it at 13 m/s, metres.
    fn overlap(sleeps: bool, cuts: Vec<(Axis, f64)>) -> f64 {
        let partitioning = Partitioning::Cuts(cuts);
        let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
        let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
        world.insert(ground, ColliderBuilder::cuboid(9.0, 0.5, 9.0)).unwrap();
        let stack = [0.5, 1.5, 2.5].map(|y| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::Y * y).can_sleep(sleeps);
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(500.0)).unwrap()
        });
        for _ in 0..200 {
            world.step().unwrap();
        }
        let above = Vector::new(0.1, 4.3, 0.05);
        let falls = RigidBodyBuilder::dynamic().translation(above).linvel(Vector::Y * -13.0);
        world.insert(falls, ColliderBuilder::cuboid(0.25, 0.25, 0.25).density(2000.0)).unwrap();
        let mut deepest = 0.0_f64;
        for _ in 0..10 {
            world.step().unwrap();
            let [_, middle, top] = stack.map(|id| world.pose(id).unwrap().translation[1]);
            deepest = deepest.max(1.0 - (top - middle));
        }
        deepest
    }

    #[test]
    fn sleepers_that_are_struck_hold_one_another_as_they_would_awake() {
        let awake = overlap(false, Vec::new());
        assert!((0.002..0.01).contains(&awake), "it strikes: {awake} m");
        for cuts in [vec![], vec![(Axis::Y, 3.3)], vec![(Axis::X, 0.0)]] {
            let asleep = overlap(true, cuts.clone());
            assert!(asleep < 1.2 * awake, "{asleep} m, awake {awake} m; {cuts:?}");
        }
    }

    /// Returns how deep the first two of five boxes in a row overlap after the tip of a turning bar has struck it at
    /// 13 m/s, metres.
    fn overlap_beside_bar(sleeps: bool) -> f64 {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
        world.insert(ground, ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
        let row = [0.0, 1.0, 2.0, 3.0, 4.0].map(|x| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.5, 0.0)).can_sleep(sleeps);
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(500.0)).unwrap()
        });
        for _ in 0..200 {
            world.step().unwrap();
        }
        let pivot = RigidBodyBuilder::dynamic()
            .translation(Vector::new(-0.75, 0.5, 3.0))
            .rotation(Vector::Y * 0.4)
            .enabled_translations(false, false, false)
            .gravity_scale(0.0)
            .angvel(Vector::Y * -4.3);
        world.insert(pivot, ColliderBuilder::cuboid(0.1, 0.2, 3.0).density(2000.0)).unwrap();
        let mut deepest = 0.0_f64;
        for _ in 0..30 {
            world.step().unwrap();
            let x = [row[0], row[1]].map(|id| world.pose(id).unwrap().translation[0]);
            deepest = deepest.max(1.0 - (x[1] - x[0]));
        }
        deepest
    }

    #[test]
    fn sleepers_that_a_turning_bar_strikes_hold_one_another_as_they_would_awake() {
        let (awake, asleep) = (overlap_beside_bar(false), overlap_beside_bar(true));
        assert!((0.001..0.03).contains(&awake), "it strikes: {awake} m");
        assert!(asleep < 1.2 * awake, "{asleep} m, awake {awake} m");
    }

    #[test]
    fn a_sleeper_into_which_its_program_puts_a_body_is_pushed_out() {
        for (kind, cut) in [
            (RigidBodyType::Fixed, None),
            (RigidBodyType::KinematicPositionBased, None),
            (RigidBodyType::KinematicPositionBased, Some(0.3)),
        ] {
            let cuts = cut.map(|at| (Axis::X, at)).into_iter().collect();
            let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
            let mut world = LocalWorld::new(config).unwrap();
            let cuboid = |x: f32, y: f32| ColliderBuilder::cuboid(x, y, x);
            world.insert(RigidBodyBuilder::fixed().translation(-Vector::Y), cuboid(50.0, 1.0)).unwrap();
            let at = |x: f32| Vector::new(x, 0.5, 0.0);
            let sleeper =
                world.insert(RigidBodyBuilder::dynamic().translation(at(0.0)), cuboid(0.5, 0.5)).unwrap();
            let wall =
                world.insert(RigidBodyBuilder::new(kind).translation(at(1.1)), cuboid(0.5, 0.5)).unwrap();
            (0..200).for_each(|_| world.step().unwrap());
            assert!(world.body(sleeper).unwrap().is_sleeping());
            world.set_pose(wall, WorldPose::at([0.84, 0.5, 0.0])).unwrap();
            (0..60).for_each(|_| world.step().unwrap());
            let x = world.pose(sleeper).unwrap().translation[0];
            assert!(x < -0.12, "{kind:?}, cut at {cut:?}: {x} m");
        }
    }
}
