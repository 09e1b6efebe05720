//! Sets a user's contact hooks in a local world, and the threads that compute the world.

use std::sync::Arc;

use super::config::WorldError;
use super::local::LocalWorld;
use crate::physics::{ContactHooks, Tasks};

impl LocalWorld {
    /// Sets the contact hooks that are called from now on; `None` removes them. They are called for colliders
    /// with Rapier's `ActiveHooks`. These flags travel with the colliders, but the hooks do not: a served
    /// world has none, and a restored world has none until they are set again.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use dcd::physics::{ContactHooks, HookedPair};
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use dcd::space::BodyId;
    /// # use rapier3d::prelude::*;
    /// struct Ghost(BodyId);
    /// impl ContactHooks for Ghost {
    ///     fn filter_contact_pair(&self, pair: &HookedPair<'_>) -> Option<SolverFlags> {
    ///         let met = [pair.first.body, pair.second.body].contains(&self.0);
    ///         (!met).then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    ///     }
    /// }
    /// let mut world = LocalWorld::new(WorldConfig::default())?;
    /// let floor = ColliderBuilder::cuboid(9.0, 0.5, 9.0).active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS);
    /// world.insert(RigidBodyBuilder::fixed(), floor)?;
    /// let ghost = world.insert(
    ///     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 2.0, 0.0)),
    ///     ColliderBuilder::ball(0.5),
    /// )?;
    /// world.set_hooks(Some(Arc::new(Ghost(ghost))));
    /// for _ in 0..120 {
    ///     world.step()?;
    /// }
    /// assert!(world.pose(ghost).unwrap().translation[1] < -5.0);
    /// # Ok::<(), dcd::runtime::WorldError>(())
    /// ```
    pub fn set_hooks(&mut self, hooks: Option<Arc<dyn ContactHooks>>) {
        let hooks = match &mut self.tape {
            Some(tape) => tape.listen_to(hooks),
            None => hooks,
        };
        self.host.set_hooks(hooks);
    }

    /// See [`World::set_tasks`](crate::World::set_tasks).
    pub(crate) fn set_tasks(&mut self, tasks: Option<Arc<dyn Tasks>>) -> Result<(), WorldError> {
        Ok(self.host.set_tasks(tasks)?)
    }
}
