//! Defines [`World`], one interface for every role that a process can have in a world (local, client, participant, server, node),
//! with the same methods and the same refusals.
//!
//! A role is a variant of `Inner`: the world that this process computes alone ([`LocalWorld`]), or one that others compute
//! (`remote::Remote`: `served` for clients and participants, `hosted` for servers and nodes).

#[cfg(feature = "net")]
mod author;
mod bodies;
mod control;
#[cfg(feature = "net")]
mod departed;
mod drawing;
mod error;
mod fidelity;
mod forces;
#[cfg(feature = "net")]
mod heard;
#[cfg(feature = "net")]
mod hosted;
#[cfg(feature = "net")]
mod join;
mod joints;
#[cfg(feature = "net")]
mod network;
mod observe;
mod queries;
mod recording;
mod remote;
mod role;
mod rollback;
#[cfg(feature = "net")]
mod seen;
#[cfg(feature = "net")]
mod served;
mod shapes;
mod showing;
mod snapshot;
mod view;

use std::sync::Mutex;
use std::time::Duration;

use crate::drawing::Canvas;
use crate::physics::{ShapeLibrary, StepSettings};
use crate::runtime::{LocalWorld, WorldConfig};
use crate::scene::Scene;
use crate::space::Tick;
pub use error::Error;
#[cfg(feature = "net")]
pub use network::Arrivals;
use queries::Answers;
use remote::Remote;
pub use role::{Instead, Role, Unsupported};
use showing::LastStep;
pub use view::{Body, BodyChange, MovableBody, Owner, RegionInfo};

/// One rigid-body world, computed by this process or by others.
///
/// A local world is computed by this process alone, by one Rapier world per region. A client, a participant, a server and a node
/// are processes of a served world ([`World::connect`], [`World::participate`], [`World::serve`], [`World::join_as_node`]). All
/// have the same methods; what a role cannot do is refused by [`Unsupported`], which says what to do instead.
///
/// ```
/// use dcd::prelude::*;
///
/// let mut world = World::new(WorldConfig::default())?;
/// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
/// let ball = world.insert(
///     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 5.0, 0.0)),
///     ColliderBuilder::ball(0.5),
/// )?;
/// for _ in 0..120 {
///     world.step()?;
/// }
/// assert!((world.pose(ball).unwrap().translation[1] - 1.0).abs() < 0.05);
/// # Ok::<(), dcd::Error>(())
/// ```
pub struct World {
    inner: Inner,
    answers: Answers,
    last_step: LastStep,
    canvas: Canvas,
    /// Shapes of a world that others compute, built for who looks at them.
    built: Mutex<ShapeLibrary>,
}

enum Inner {
    Local(Box<LocalWorld>),
    #[cfg_attr(not(feature = "net"), expect(dead_code, reason = "others are reached over the network"))]
    Remote(Box<dyn Remote>),
}

impl std::fmt::Debug for World {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("World")
            .field("role", &self.role())
            .field("tick", &self.tick())
            .finish_non_exhaustive()
    }
}

impl From<LocalWorld> for World {
    fn from(world: LocalWorld) -> Self {
        Self::with(Inner::Local(Box::new(world)))
    }
}

impl World {
    fn with(inner: Inner) -> Self {
        Self {
            inner,
            answers: Answers::default(),
            last_step: LastStep::default(),
            canvas: Canvas::default(),
            built: Mutex::default(),
        }
    }

    /// Makes an empty local world.
    pub fn new(config: WorldConfig) -> Result<Self, Error> {
        Ok(LocalWorld::new(config)?.into())
    }

    /// Makes a local world with everything that a scene holds: its body `i` becomes `BodyId::persistent(i)`.
    /// [`WorldConfig::for_scene`] is the configuration that the scene asks for.
    ///
    /// ```
    /// use dcd::prelude::*;
    ///
    /// let scene = Scene::open("tower", &Params::default())?;
    /// let world = World::from_scene(&scene, WorldConfig::for_scene(&scene))?;
    /// assert_eq!(world.movable_count(), 10);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn from_scene(scene: &Scene, config: WorldConfig) -> Result<Self, Error> {
        Ok(LocalWorld::from_scene(scene, config)?.into())
    }

    /// Returns the role that this process has in the world.
    #[must_use]
    pub fn role(&self) -> Role {
        match &self.inner {
            Inner::Local(_) => Role::Local,
            Inner::Remote(world) => world.role(),
        }
    }

    /// Advances a local world by one tick.
    ///
    /// A served world advances by itself: there the call sends the inputs of avatars, or what the server's program did, takes in
    /// what has come since the last call, and waits for nothing. Between two calls only the caller changes anything. Once the world has ended, or the server has
    /// been out of reach for too long, every call returns an error; the last known state can still be read.
    pub fn step(&mut self) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => {
                self.last_step.keep(world);
                Ok(world.step()?)
            }
            Inner::Remote(world) => world.step(),
        }
    }

    /// Waits until something has come that the next step would take in, or the world has ended, but not longer than `timeout`;
    /// returns whether it came. Nothing comes to a local world, which does not wait: one loop does for both.
    pub fn poll(&self, timeout: Duration) -> bool {
        match &self.inner {
            Inner::Local(_) => true,
            Inner::Remote(world) => world.poll(timeout),
        }
    }

    /// Returns how many ticks are done; in a served world the newest tick received.
    #[must_use]
    pub fn tick(&self) -> Tick {
        match &self.inner {
            Inner::Local(world) => world.tick(),
            Inner::Remote(world) => world.tick(),
        }
    }

    /// Returns the length of a tick in seconds; 0 for a node, which takes it from its server.
    #[must_use]
    pub fn dt_s(&self) -> f32 {
        match &self.inner {
            Inner::Local(world) => world.host().settings().dt_s,
            Inner::Remote(world) => world.dt_s(),
        }
    }

    /// Returns gravity, m/s²; 0 for a node, which takes it from its server.
    #[must_use]
    pub fn gravity(&self) -> [f32; 3] {
        match &self.inner {
            Inner::Local(world) => world.host().settings().gravity,
            Inner::Remote(world) => world.gravity(),
        }
    }

    /// Returns the fastest that a dynamic body moves, m/s; 0 for a node, which takes it from its server. What forces and contacts make faster
    /// is cut to it; a body that is inserted or set to be faster is refused.
    #[must_use]
    pub fn speed_limit_m_s(&self) -> f32 {
        match &self.inner {
            Inner::Local(world) => world.host().settings().speed_limit_m_s(),
            Inner::Remote(world) => world.speed_limit_m_s(),
        }
    }

    /// Returns how the world is stepped; a node takes it from its server and refuses.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// let mut world = World::new(WorldConfig::default())?;
    /// let body = RigidBodyBuilder::dynamic();
    /// let ball = world.insert(body, ColliderBuilder::ball(0.5).density(1000.0))?;
    /// let mut settings = world.settings()?;
    /// settings.gravity = [0.0, 0.0, -1.62]; // on the moon, z is up
    /// settings.solver_iterations = 8;
    /// world.set_settings(settings)?;
    /// world.step()?;
    /// assert!(world.velocity(ball).unwrap().linear[2] < 0.0);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn settings(&self) -> Result<StepSettings, Error> {
        match &self.inner {
            Inner::Local(world) => Ok(world.host().asked_settings()),
            Inner::Remote(world) => world.settings(),
        }
    }

    /// Sets how the world is stepped from the next step on. Bodies that sleep are woken if gravity changes. How regions are coupled
    /// stays as it is, but for the tolerance: what differs there is refused. Local worlds only: a served one keeps the settings with
    /// which it was made.
    pub fn set_settings(&mut self, settings: StepSettings) -> Result<(), Error> {
        Ok(self.local_mut("be stepped otherwise", Instead::SettingsAtBirth)?.set_settings(settings)?)
    }

    /// Returns the world that this process computes alone, or why its role cannot do `what`; `instead` is for clients and
    /// participants.
    #[doc(hidden)]
    pub fn local(&self, what: &'static str, instead: Instead) -> Result<&LocalWorld, Error> {
        match &self.inner {
            Inner::Local(world) => Ok(world),
            Inner::Remote(world) => Err(world.compute(what, instead)),
        }
    }

    fn local_mut(&mut self, what: &'static str, instead: Instead) -> Result<&mut LocalWorld, Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world),
            Inner::Remote(world) => Err(world.compute(what, instead)),
        }
    }

    fn remote(&self) -> Option<&dyn Remote> {
        match &self.inner {
            Inner::Local(_) => None,
            Inner::Remote(world) => Some(&**world),
        }
    }
}
