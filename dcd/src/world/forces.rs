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
