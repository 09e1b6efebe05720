//! Keeps a local world in memory and goes back to it, as often as every frame: rollback.

use super::{Error, Instead, World};
use crate::runtime::Checkpoint;

/// Rollback of local worlds.
impl World {
    /// Returns the world as it is now, kept in memory, to go back to by [`World::rewind`]: for rollback, where a game computes some
    /// ticks again with inputs that came late. Other programs cannot read it; [`World::save`] writes what they can.
    ///
    /// Nothing of Rapier's is copied here: the next step copies the regions that it changes, each on its own thread, and none that
    /// rests. So a checkpoint costs as much as one copy of what moves, and as much memory, for as long as it is kept.
    ///
    /// ```
    /// use dcd::prelude::*;
    ///
    /// let mut world = World::new(WorldConfig::default())?;
    /// let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// let before = world.checkpoint()?;
    /// world.step()?;
    /// let first = world.state_hash()?;
    /// world.rewind(&before)?;
    /// assert_eq!(world.pose(ball).unwrap().translation, [0.0; 3]);
    /// world.step()?; // with other inputs, in a game
    /// assert_eq!(world.state_hash()?, first);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn checkpoint(&mut self) -> Result<Checkpoint, Error> {
        Ok(self.local_mut("be kept in memory to go back to", Instead::ComputeAlone)?.checkpoint())
    }

    /// Goes back to a checkpoint of this world, as often as wanted, and goes on from there to the same bits: with the bodies, joints,
    /// regions, settings and events of then. Threads and hooks stay as they are now. A recording of the world goes on, from a
    /// snapshot. After an error nothing has changed.
    ///
    /// Ids given since then are given again, in the same order, so that who computes a tick again gives the same ones. What was
    /// inserted since is gone, and its id may name another body later.
    pub fn rewind(&mut self, to: &Checkpoint) -> Result<(), Error> {
        self.local_mut("go back to a checkpoint", Instead::ComputeAlone)?.rewind(to)?;
        self.last_step.go_back();
        Ok(())
    }
}
