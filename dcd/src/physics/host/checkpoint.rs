//! Goes back to an earlier tick: with all that the regions held then or, for clients that predict, with
//! bodies put into other states.

use super::threads::Threads;
use super::{HostError, RegionHost};
#[cfg(test)]
use crate::physics::Region;
#[cfg(feature = "net")]
use crate::protocol::BodyState;
#[cfg(feature = "net")]
use crate::space::BodyId;
use crate::space::Tick;

/// What a host held between two ticks. Its Rapier worlds are shared with the host until the host changes
/// them.
pub(crate) struct Checkpoint(RegionHost);

impl Checkpoint {
    /// Returns the tick after which it was made.
    pub(crate) fn tick(&self) -> Tick {
        self.0.tick
    }

    /// Returns the regions as they were.
    #[cfg(test)]
    pub(crate) fn regions(&self) -> impl Iterator<Item = &Region> {
        self.0.regions()
    }
}

impl RegionHost {
    /// Returns a checkpoint of what the host holds now, after a whole tick.
    pub(crate) fn checkpoint(&mut self) -> Checkpoint {
        self.sides.iter_mut().for_each(|side| side.region.share());
        let mut kept = self.clone();
        kept.threads = Threads::default();
        kept.set_hooks(None);
        Checkpoint(kept)
    }

    /// Goes back to what a checkpoint holds, and keeps the present threads and hooks.
    pub(crate) fn restore(&mut self, to: &Checkpoint) -> Result<(), HostError> {
        let mut host = to.0.clone();
        host.serve_as(self)?;
        *self = host;
        Ok(())
    }

    /// Puts bodies held here into the states that they have after a tick, as if they had reached them by
    /// themselves, and goes on from that tick.
    #[cfg(feature = "net")]
    pub(crate) fn put<'a>(&mut self, tick: Tick, states: impl Iterator<Item = (BodyId, &'a BodyState)>) {
        self.tick = tick;
        for (id, state) in states {
            self.sides.iter_mut().for_each(|side| side.region.put(id, state));
        }
        self.sides.iter_mut().for_each(|side| side.region.find_moved());
    }
}

#[cfg(all(test, feature = "net"))]
mod tests {
    use super::*;
    use crate::physics::{Partition, StepSettings};
    use crate::protocol::{BodyState, Drive, ShapeRecord, Velocity};
    use crate::scene::{Params, Scene};
    use crate::space::{BodyId, DistributionTree};

    fn host(scene: &str) -> RegionHost {
        let scene = Scene::open(scene, &Params::default()).unwrap();
        let tree = DistributionTree::halved(scene.bounds, 1).unwrap();
        let regions: Vec<_> = tree.leaves().collect();
        let settings: StepSettings = scene.step_settings();
        let mut host = RegionHost::new(Partition::new(tree, None), settings, 1, &regions).unwrap();
        let (bodies, joints) = scene.records(host.shapes_mut()).unwrap();
        host.insert(bodies, &joints).unwrap();
        host
    }

    fn states(host: &RegionHost) -> Vec<(BodyId, BodyState)> {
        host.owned_bodies().map(|(id, region, handle)| (id, region.body_state(handle))).collect()
    }

    /// Piles, chains and bouncing balls: what contacts remember counts.
    #[test]
    fn ticks_computed_again_from_a_checkpoint_are_the_same_to_the_bit() {
        for scene in ["pile", "chain", "sweep"] {
            let mut host = host(scene);
            (0..40).for_each(|_| host.step().unwrap());
            let checkpoint = host.checkpoint();
            let push = |host: &mut RegionHost| {
                host.steer(BodyId::persistent(3), &Velocity::linear([1.0, 2.0, 0.0]));
                host.drive(BodyId::persistent(3), &Drive::default());
            };
            push(&mut host);
            (0..30).for_each(|_| host.step().unwrap());
            let once = states(&host);
            (0..7).for_each(|_| host.step().unwrap());
            assert_ne!(states(&host), once, "{scene} moves");
            for _ in 0..2 {
                host.restore(&checkpoint).unwrap();
                assert_eq!((host.tick(), checkpoint.tick()), (Tick(40), Tick(40)));
                push(&mut host);
                (0..30).for_each(|_| host.step().unwrap());
                assert!(states(&host) == once, "{scene}");
            }
        }
    }

    /// Terrain may have megabytes, and a game that rewinds keeps sixty checkpoints.
    #[test]
    fn a_checkpoint_copies_no_shape() {
        let mut host = host("pile");
        let ground = host.shapes().records()[0].hash();
        let kept = host.checkpoint();
        let shape = |host: &RegionHost| std::ptr::from_ref(host.shapes().record_of(ground).unwrap());
        assert_eq!(shape(&host), shape(&kept.0));
        host.shapes_mut().add(ShapeRecord::Ball(0.123)).unwrap();
        assert_eq!(shape(&host), shape(&kept.0), "nor does the host that has another one since");
        assert!(kept.0.shapes().len() < host.shapes().len());
        host.restore(&kept).unwrap();
        assert_eq!(shape(&host), shape(&kept.0));
    }

    #[test]
    fn bodies_are_put_into_states_awake_and_asleep() {
        let mut host = host("pile");
        let first = states(&host);
        (0..60).for_each(|_| host.step().unwrap());
        let sleeper = first[0].0;
        let state = |state: &BodyState, sleeping| BodyState { sleeping, ..*state };
        let put: Vec<_> = first.iter().map(|(id, was)| (*id, state(was, *id == sleeper))).collect();
        host.put(Tick(7), put.iter().map(|(id, state)| (*id, state)));
        assert_eq!(host.tick(), Tick(7));
        for ((id, is), (_, was)) in states(&host).iter().zip(&first) {
            assert_eq!(is.pose, was.pose);
            assert_eq!(is.sleeping, *id == sleeper, "{id}");
        }
    }
}
