//! Pushes bodies by explosions, water and wind, and lists the bodies inside a sensor.

use super::role::Instead;
use super::{Error, World};
use crate::physics::{ColliderId, Explosion, Fluid};
use crate::protocol::Push;
use crate::runtime::{LocalWorld, WorldError};
use crate::space::BodyId;

const PUSH_ALL: &str = "push all bodies of a place";

/// Explosions, fluids and triggers. They find bodies by queries: in all regions, each body once.
impl World {
    /// Pushes all dynamic bodies near a place away from it, at once and once only, and wakes them. Returns
    /// their number. Each solid collider of a body within reach is pushed at its nearest point, in proportion
    /// to its silhouette. The explosion makes no body faster than the world's speed limit. Local worlds only.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let at = RigidBodyBuilder::dynamic().translation(Vector::new(2.0, 0.0, 0.0));
    /// let ball = world.insert(at, ColliderBuilder::ball(0.5).mass(2.0))?;
    /// let blast = dcd::Explosion { radius_m: 3.0, impulse_ns_m2: 40.0, ..dcd::Explosion::default() };
    /// assert_eq!(world.explode(&blast)?, 1);
    /// let silhouette_m2 = std::f32::consts::PI * 0.25;
    /// assert!((world.velocity(ball).unwrap().linear[0] - 40.0 * silhouette_m2 / 2.0).abs() < 1e-3);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn explode(&mut self, explosion: &Explosion) -> Result<usize, Error> {
        let world = self.local_mut(PUSH_ALL, Instead::PushByAvatars)?;
        refuse(explosion.fault(), explosion)?;
        let pushes = world.host().pushes_of_explosion(explosion)?;
        push_all(world, &pushes)
    }

    /// Pushes the dynamic bodies that are in water or wind, as these do within one step, and wakes them.
    /// Returns their number. Call it before each step. Local worlds only.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let raft = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(1.0, 0.5, 1.0).density(700.0))?;
    /// let lake = dcd::Fluid { surface_m: 2.0, ..dcd::Fluid::default() };
    /// let wind = dcd::Fluid {
    ///     surface_m: f64::INFINITY,
    ///     density_kg_m3: 1.2,
    ///     velocity_m_s: [8.0, 0.0, 0.0],
    ///     ..dcd::Fluid::default()
    /// };
    /// for _ in 0..600 {
    ///     world.flow(&lake)?;
    ///     world.flow(&wind)?;
    ///     world.step()?;
    /// }
    /// let at = world.pose(raft).unwrap().translation;
    /// assert!((at[1] - 1.8).abs() < 0.02, "seven tenths of it are below the surface");
    /// assert!(at[0] > 0.1, "the wind drives it");
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn flow(&mut self, fluid: &Fluid) -> Result<usize, Error> {
        let world = self.local_mut(PUSH_ALL, Instead::PushByAvatars)?;
        refuse(fluid.fault(), fluid)?;
        let pushes = world.host().pushes_of_fluid(fluid)?;
        push_all(world, &pushes)
    }

    /// Returns the movable bodies that overlap a sensor as the world is now, in id order, asleep or not, in
    /// any region. A [`BodyId`] stands for the body's first collider. Collision groups count. Fixed bodies
    /// and other sensors are not listed. No events need be active. A collider that is no sensor is an error.
    /// Local worlds only.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let gate = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(1.0, 1.0, 1.0).sensor(true))?;
    /// let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// assert_eq!(world.inside(gate)?, [ball]);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn inside(&self, sensor: impl Into<ColliderId>) -> Result<Vec<BodyId>, Error> {
        let world = self.local("list who is inside a sensor", Instead::SubmitQuery)?;
        let sensor = sensor.into();
        if !world.contains(sensor.body) {
            return Err(WorldError::NoBody(sensor.body).into());
        }
        let refused = || {
            let range = "a collider of the body that is a sensor (ColliderBuilder::sensor)";
            WorldError::Setting { what: "collider", value: format!("{sensor:?}"), range }
        };
        Ok(world.queries().inside(sensor)?.ok_or_else(refused)?)
    }
}

fn refuse(fault: Option<(&'static str, &'static str)>, given: &impl std::fmt::Debug) -> Result<(), Error> {
    match fault {
        None => Ok(()),
        Some((what, range)) => Err(WorldError::Setting { what, value: format!("{given:?}"), range }.into()),
    }
}

fn push_all(world: &mut LocalWorld, pushes: &[Push]) -> Result<usize, Error> {
    for push in pushes {
        world.push(push)?;
    }
    Ok(pushes.len())
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::StepSettings;
    use crate::protocol::{Character, Velocity, WorldPose};
    use crate::runtime::WorldConfig;

    /// Returns a world with the highest speed limit, and a box and a light ball in it.
    fn fast_world() -> (World, [BodyId; 2]) {
        let step = StepSettings::default().with_speed_limit(1e6);
        let mut world = World::new(WorldConfig { step, ..WorldConfig::default() }).unwrap();
        let cube = ColliderBuilder::cuboid(1.0, 1.0, 1.0).density(1000.0);
        let ball = ColliderBuilder::ball(0.5).mass(1e-5);
        let bodies = [(0.0, cube), (4.0, ball)].map(|(x, collider)| {
            world.insert_at(WorldPose::at([x, -2.0, 0.3]), RigidBodyBuilder::dynamic(), [collider]).unwrap()
        });
        (world, bodies)
    }

    #[test]
    fn water_wind_and_explosions_of_any_strength_make_nothing_faster_than_its_bound() {
        let (mut world, bodies) = fast_world();
        let storm = Fluid {
            surface_m: f64::INFINITY,
            density_kg_m3: 1e6,
            velocity_m_s: [1e6, 0.0, 0.0],
            drag: 1e6,
            lift: 1e6,
            damping_per_s: 1e6,
            ..Fluid::default()
        };
        let blast = Explosion { impulse_ns_m2: 1e34, radius_m: 1e6, ..Explosion::default() };
        for i in 0..20 {
            world.flow(&storm).unwrap();
            world.explode(&blast).unwrap();
            for body in bodies {
                let Velocity { linear, angular } = world.velocity(body).unwrap();
                let [speed, spin] = [linear, angular].map(|v| Vector::from(v).length());
                assert!(
                    (9e5..=1e6).contains(&speed) && spin <= 1e6,
                    "{body} in {i}: {speed} m/s {spin} rad/s"
                );
            }
            world.set_pose(bodies[0], WorldPose::at([0.0, -2.0, 0.3])).unwrap();
            world.set_pose(bodies[1], WorldPose::at([4.0, -2.0, 0.3])).unwrap();
        }
    }

    #[test]
    fn a_push_that_is_too_much_is_refused_in_words() {
        let (mut world, [body, _]) = fast_world();
        let mut refused = |push: Push| world.push(&push).unwrap_err().to_string();
        let too_much = "it would make the body faster than 1e6 m/s or 1e6 rad/s; push it less";
        assert_eq!(
            refused(Push::impulse(body, [3e30, 0.0, 0.0])),
            format!(
                "push is an impulse of [3e30, 0.0, 0.0] N s and [0.0, 0.0, 0.0] N m s on {body}: {too_much}"
            )
        );
        assert_eq!(
            refused(Push::force(body, [0.0; 3], [0.0, 1e30, 0.0])),
            format!("push is a force of [0.0, 0.0, 0.0] N and [0.0, 1e30, 0.0] N m on {body}: {too_much}")
        );
        assert!(refused(Push::impulse(body, [f32::NAN; 3])).ends_with(": give finite numbers"));
    }

    #[test]
    fn a_character_without_volume_is_refused() {
        let (mut world, _) = fast_world();
        let heights = Array2::new(2, 2, vec![0.0; 4]);
        let flat = [
            ColliderBuilder::heightfield(heights, Vector::splat(4.0)),
            ColliderBuilder::segment(Vector::ZERO, Vector::Y),
            ColliderBuilder::new(SharedShape::halfspace(Vector::Y)),
        ];
        for shape in flat {
            let body = RigidBodyBuilder::kinematic_velocity_based();
            let at = WorldPose::at([9.0, 9.0, 9.0]);
            let refused = world.insert_character(at, &Character::default(), body, [shape]).unwrap_err();
            assert!(refused.to_string().contains("one with volume, such as a capsule"), "{refused}");
        }
    }
}
