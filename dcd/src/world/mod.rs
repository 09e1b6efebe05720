//! Defines [`World`], one interface for every role of a process in a world (local, client, builder,
//! participant, server, node). The methods are the same in all roles, and so are the errors for what a role
//! cannot do, of methods that return a `Result`.
//!
//! `Inner` has two variants: the world that this process computes alone ([`LocalWorld`]), and one that other
//! processes compute (`remote::Remote`: `served` for clients, builders and participants, `hosted` for servers
//! and nodes).

#[cfg(feature = "net")]
mod author;
mod bodies;
mod control;
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
/// This process alone computes a local world, by one Rapier world per region. A client, a participant, a
/// server and a node are processes of a served world ([`World::connect`], [`World::participate`],
/// [`World::serve`], [`World::join_as_node`]). All have the same methods. A method that returns a `Result` and
/// does not suit the role returns [`Unsupported`], which says what to do instead. The documentation of other
/// methods says what they return in which role.
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
    /// Rapier's shapes, built from records of a world that other processes compute. Filled on demand.
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

    /// Makes an empty local world, or returns an error if a setting of `config` is out of range.
    pub fn new(config: WorldConfig) -> Result<Self, Error> {
        Ok(LocalWorld::new(config)?.into())
    }

    /// Makes a local world with everything that a scene holds. Body `i` of the scene becomes
    /// `BodyId::persistent(i)`. [`WorldConfig::for_scene`] returns the configuration that the scene asks for.
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
    /// A served world advances by itself. There the call sends the inputs of avatars, or what a server's
    /// program or a builder did to the world. It takes in what has arrived since the last call, and returns
    /// without waiting. Between two calls only the caller changes anything. Once the world has ended, or the
    /// server has been out of reach for too long, every call returns an error; the last known state can still
    /// be read.
    pub fn step(&mut self) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => {
                self.last_step.keep(world);
                Ok(world.step()?)
            }
            Inner::Remote(world) => world.step(),
        }
    }

    /// Waits until something arrives that the next step would take in, or until the world ends, but not
    /// longer than `timeout`. Returns false if the time ran out. Nothing arrives at a local world: it returns
    /// true at once, so that one loop suits all roles.
    pub fn poll(&self, timeout: Duration) -> bool {
        match &self.inner {
            Inner::Local(_) => true,
            Inner::Remote(world) => world.poll(timeout),
        }
    }

    /// Returns the number of ticks done; in a served world, the newest tick that this process has received.
    #[must_use]
    pub fn tick(&self) -> Tick {
        match &self.inner {
            Inner::Local(world) => world.tick(),
            Inner::Remote(world) => world.tick(),
        }
    }

    /// Returns the length of a tick in seconds; 0 for a node, whose settings come from its server.
    #[must_use]
    pub fn dt_s(&self) -> f32 {
        match &self.inner {
            Inner::Local(world) => world.host().settings().dt_s,
            Inner::Remote(world) => world.dt_s(),
        }
    }

    /// Returns gravity, m/s²; 0 for a node, whose settings come from its server.
    #[must_use]
    pub fn gravity(&self) -> [f32; 3] {
        match &self.inner {
            Inner::Local(world) => world.host().settings().gravity,
            Inner::Remote(world) => world.gravity(),
        }
    }

    /// Returns the speed limit of dynamic bodies, m/s; 0 for a node, whose settings come from its server. A
    /// body that forces and contacts make faster is slowed to the limit. A dynamic body that is faster cannot
    /// be inserted, nor can one be set to a higher speed.
    #[must_use]
    pub fn speed_limit_m_s(&self) -> f32 {
        match &self.inner {
            Inner::Local(world) => world.host().settings().speed_limit_m_s(),
            Inner::Remote(world) => world.speed_limit_m_s(),
        }
    }

    /// Returns the settings by which the world is stepped. A node, whose settings come from its server,
    /// returns an error.
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

    /// Sets the settings by which the world is stepped, from the next step on. Local worlds only: a served
    /// world keeps the settings with which it was made.
    ///
    /// A change of gravity wakes sleeping bodies. The coupling, `exchanges`, `depth` and `island_limit` must
    /// stay as they are, otherwise the call returns an error; `tolerance_m_s` may change.
    pub fn set_settings(&mut self, settings: StepSettings) -> Result<(), Error> {
        Ok(self.local_mut("be stepped otherwise", Instead::SettingsAtBirth)?.set_settings(settings)?)
    }

    /// Returns the local world, or the error that this role cannot do `what`. For clients and participants
    /// the error names `instead` as the remedy.
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
