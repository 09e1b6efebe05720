//! Keeps the state of a local world between two steps in memory, to go back to: rollback, which games do
//! several times per frame.

use std::sync::Arc;

use crate::physics;
use crate::protocol::{ContactLedger, WorldEvents};
use crate::runtime::joint_strength::Strengths;
use crate::runtime::{LocalWorld, WorldError};
use crate::space::Tick;

/// A local world as it was after a tick, kept in memory by [`World::checkpoint`](crate::World::checkpoint).
///
/// A checkpoint shares each region with the world until the world changes that region. It takes memory only
/// for regions that were stepped since.
pub struct Checkpoint {
    /// The identity of the world that the checkpoint was made of.
    of: Arc<()>,
    host: physics::Checkpoint,
    ledger: ContactLedger,
    events: WorldEvents,
    next_body: u32,
    next_joint: u64,
    strengths: Strengths,
}

impl Checkpoint {
    /// Returns the tick after which the checkpoint was made.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.host.tick()
    }
}

impl std::fmt::Debug for Checkpoint {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("Checkpoint").field("tick", &self.tick()).finish_non_exhaustive()
    }
}

impl LocalWorld {
    /// Returns the present state of the world, to go back to by [`LocalWorld::rewind`].
    pub fn checkpoint(&mut self) -> Checkpoint {
        Checkpoint {
            of: Arc::clone(&self.identity),
            host: self.host.checkpoint(),
            ledger: self.ledger.clone(),
            events: self.events.clone(),
            next_body: self.next_body,
            next_joint: self.next_joint,
            strengths: self.strengths.clone(),
        }
    }

    /// Goes back to a checkpoint of this world. The present threads and hooks are kept. After an error
    /// nothing has changed.
    pub fn rewind(&mut self, to: &Checkpoint) -> Result<(), WorldError> {
        if !Arc::ptr_eq(&self.identity, &to.of) {
            return Err(WorldError::OtherWorld);
        }
        self.host.restore(&to.host)?;
        self.ledger.clone_from(&to.ledger);
        self.events.clone_from(&to.events);
        self.strengths.clone_from(&to.strengths);
        (self.next_body, self.next_joint) = (to.next_body, to.next_joint);
        self.tape_spoilt();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::fidelity::Fidelity;
    use crate::protocol::WorldPose;
    use crate::runtime::{Partitioning, WorldConfig};
    use crate::scene::{Params, Scene};
    use crate::space::{Axis, Balance, BodyId, Viewpoint};

    fn world_of(scene: &str, regions: usize, fidelity: Fidelity, threads: usize) -> LocalWorld {
        let mut args = scene.split(' ');
        let name = args.next().unwrap();
        let params = Params::from_args(args.map(str::to_owned).collect::<Vec<_>>()).unwrap();
        let scene = Scene::named(name, &params).unwrap();
        let partitioning = Partitioning::Regions(regions);
        let config = WorldConfig { partitioning, fidelity, threads, ..WorldConfig::for_scene(&scene) };
        LocalWorld::from_scene(&scene, config).unwrap()
    }

    /// Does a second of what a game may do, and returns the state of the world after each tick.
    fn play(world: &mut LocalWorld) -> Vec<(u64, WorldEvents, usize)> {
        let mut ids = Vec::new();
        let seen = (0..60_u32).map(|tick| {
            match tick {
                5 | 25 => {
                    let ball = RigidBodyBuilder::dynamic().translation(Vector::new(0.3, 6.0, 0.2));
                    ids.push(world.insert(ball, ColliderBuilder::ball(0.4)).unwrap());
                }
                15 => drop(world.remove(BodyId::persistent(7))),
                30 => drop(world.insert_joint(ids[0], ids[1], RopeJointBuilder::new(2.0)).unwrap()),
                35 => world.set_pose(ids[0], WorldPose::at([-2.0, 5.0, 0.0])).unwrap(),
                45 => world.remove(ids[1]).unwrap(),
                _ => {}
            }
            let view = Viewpoint { at: [f64::from(tick) - 30.0, 2.0, 0.0], radius_m: 5.0 };
            world.set_viewpoints(&[view]).unwrap();
            world.step().unwrap();
            (world.state_hash(), world.events().clone(), world.stats().ghosts)
        });
        seen.collect()
    }

    #[test]
    fn whatever_a_game_did_it_does_again_to_the_same_bits() {
        for scene in ["pile n=300", "ragdolls count=8", "town n=600 cars=2", "chain"] {
            for (regions, threads) in [(1, 1), (4, 2)] {
                for fidelity in [Fidelity::Off, Fidelity::AUTO] {
                    let what = format!("{scene}, {regions} regions, {fidelity:?}");
                    let mut world = world_of(scene, regions, fidelity, threads);
                    (0..40).for_each(|_| world.step().unwrap());
                    let before = world.checkpoint();
                    let once = play(&mut world);
                    let between = world.checkpoint();
                    let twice = play(&mut world);
                    for _ in 0..2 {
                        world.rewind(&before).unwrap();
                        assert_eq!(world.tick(), before.tick());
                        assert!(play(&mut world) == once, "{what}");
                    }
                    world.rewind(&between).unwrap();
                    assert!(play(&mut world) == twice, "{what}, from the later one");
                }
            }
        }
    }

    #[test]
    fn regions_that_came_or_went_since_are_as_they_were() {
        let mut world = world_of("pile n=400", 1, Fidelity::Off, 2);
        let before = world.checkpoint();
        world
            .set_balance(Some(Balance {
                split_above: 200.0,
                merge_below: 50.0,
                most_regions: 4,
                ..Balance::default()
            }))
            .unwrap();
        (0..200).for_each(|_| world.step().unwrap());
        let cut = world.regions().len();
        assert!(cut > 1);
        let after = world.checkpoint();
        world.rewind(&before).unwrap();
        assert_eq!((world.regions().len(), world.host().balance().is_some()), (1, false));
        (0..10).for_each(|_| world.step().unwrap());
        world.rewind(&after).unwrap();
        assert_eq!(world.regions().len(), cut);
        world.step().unwrap();
    }

    #[test]
    fn a_checkpoint_is_of_one_world_and_outlives_its_replacement() {
        let [mut one, mut other] = [(); 2].map(|()| world_of("chain", 1, Fidelity::Off, 1));
        let checkpoint = one.checkpoint();
        let error = other.rewind(&checkpoint).unwrap_err();
        assert!(matches!(error, WorldError::OtherWorld), "{error}");
        let mut saved = Vec::new();
        other.step().unwrap();
        other.save(&mut saved).unwrap();
        one.reload(&saved[..]).unwrap();
        one.rewind(&checkpoint).unwrap();
        assert_eq!(one.tick(), Tick(0));
    }

    /// Only regions that are stepped are copied. A region at rest is shared by all checkpoints.
    #[test]
    fn a_region_at_rest_is_never_copied() {
        let cuts = [-10.0, 0.0, 10.0].map(|at| (Axis::X, at)).to_vec();
        let partitioning = Partitioning::Cuts(cuts);
        let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
        let ids = [-20.0, -5.0, 5.0, 20.0].map(|x| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::X * x).sleeping(true);
            world.insert(body, ColliderBuilder::ball(0.5)).unwrap()
        });
        (0..4).for_each(|_| world.step().unwrap());
        let copied = |world: &LocalWorld, checkpoint: &Checkpoint| {
            world
                .host
                .regions()
                .zip(checkpoint.host.regions())
                .filter(|(now, then)| !now.shares(then))
                .count()
        };
        let checkpoint = world.checkpoint();
        assert_eq!(copied(&world, &checkpoint), 0);
        (0..5).for_each(|_| world.step().unwrap());
        assert_eq!(copied(&world, &checkpoint), 0);
        world.update(ids[0], |body| body.wake_up(true)).unwrap();
        world.step().unwrap();
        assert_eq!(copied(&world, &checkpoint), 1);
    }
}
