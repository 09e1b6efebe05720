//! Keeps states of a local world in memory and goes back to them, as often as every frame: rollback.

use super::{Error, Instead, World};
use crate::runtime::Checkpoint;

/// Rollback of local worlds.
impl World {
    /// Returns the state of the world as it is now, kept in memory, to which [`World::rewind`] goes back: for
    /// rollback, where a game computes some ticks again with inputs that came late. Other programs cannot
    /// read it; [`World::save`] writes what they can. Local worlds only.
    ///
    /// The call itself copies no Rapier world. The next step copies each region that it changes, on the
    /// region's own thread, and no region that rests. A checkpoint thus costs the time and memory of one copy
    /// of what moves, for as long as it is kept.
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

    /// Goes back to a checkpoint of this world, as often as wanted, and goes on from there with bit-identical
    /// results. Bodies, joints, regions, settings and events are those of the checkpoint; threads and hooks
    /// stay as they are now. A recording of the world goes on, from a further snapshot. A checkpoint of
    /// another world is an error; after an error nothing has changed.
    ///
    /// Ids that were given since the checkpoint are given again, in the same order: a program that computes a
    /// tick again gets the same ids. Bodies that were inserted since are gone, and their ids may name other
    /// bodies later.
    pub fn rewind(&mut self, to: &Checkpoint) -> Result<(), Error> {
        self.local_mut("go back to a checkpoint", Instead::ComputeAlone)?.rewind(to)?;
        self.last_step.go_back();
        Ok(())
    }
}
