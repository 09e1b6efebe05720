//! Computes a whole world in this process: all regions, on the threads of one machine.

mod bodies;
mod joints;
mod motion;
mod observe;
mod settings;

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::choice::Why;
use super::config::{Partitioning, WorldConfig, WorldError, check_speed};
use super::joint_strength::Strengths;
use super::tape::Tape;
use crate::physics::{HostError, Partition, RegionHost};
use crate::protocol::{ContactLedger, WorldEvents};
use crate::scene::Scene;
use crate::space::DistributionTree;

/// A rigid-body world that this process computes, with one Rapier world per region.
///
/// ```
/// use dcd::runtime::{LocalWorld, WorldConfig};
/// use rapier3d::prelude::*;
///
/// let mut world = LocalWorld::new(WorldConfig { threads: 2, ..WorldConfig::default() })?;
/// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
/// let ball = world.insert(
///     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 5.0, 0.0)),
///     ColliderBuilder::ball(0.5),
/// )?;
/// for _ in 0..120 {
///     world.step()?;
/// }
/// assert!((world.pose(ball).unwrap().translation[1] - 1.0).abs() < 0.05);
/// # Ok::<(), dcd::runtime::WorldError>(())
/// ```
pub struct LocalWorld {
    pub(super) host: RegionHost,
    pub(super) ledger: ContactLedger,
    pub(super) events: WorldEvents,
    pub(super) next_body: u32,
    pub(super) next_joint: u64,
    pub(super) last_step: Duration,
    pub(super) why: Why,
    pub(super) strengths: Strengths,
    pub(super) tape: Option<Box<Tape>>,
    /// An identity by which the world knows its own checkpoints.
    pub(super) identity: Arc<()>,
}

impl LocalWorld {
    /// Makes an empty world.
    pub fn new(config: WorldConfig) -> Result<Self, WorldError> {
        let tree = config.tree()?;
        Self::with_tree(config, tree)
    }

    fn with_tree(config: WorldConfig, tree: DistributionTree) -> Result<Self, WorldError> {
        config.check()?;
        let why = match config.partitioning {
            Partitioning::Regions(_) | Partitioning::RegionsAcross(..) | Partitioning::Cuts(_) => Why::Asked,
            Partitioning::Auto if tree.leaf_count() > 1 => Why::Spread,
            Partitioning::Auto if config.balance.is_some() => Why::Balance,
            Partitioning::Auto => Why::Exact,
        };
        let partition = Partition::new(tree, config.halo_m);
        let leaves = partition.leaves().to_vec();
        let mut host = RegionHost::new(partition, config.step, config.threads, &leaves)?;
        host.set_balance(config.balance);
        host.set_fidelity(config.fidelity);
        Ok(Self {
            host,
            ledger: ContactLedger::default(),
            events: WorldEvents::default(),
            next_body: 0,
            next_joint: 0,
            last_step: Duration::ZERO,
            why,
            strengths: Strengths::default(),
            tape: None,
            identity: Arc::default(),
        })
    }

    /// Makes a world with everything that a scene holds. The scene's body `i` becomes
    /// `BodyId::persistent(i)`.
    pub fn from_scene(scene: &Scene, config: WorldConfig) -> Result<Self, WorldError> {
        let tree = config.tree_of(scene)?;
        let mut world = Self::with_tree(config, tree)?;
        let (bodies, joints) = scene.records(world.host.shapes_mut()).map_err(HostError::from)?;
        world.next_body = bodies.len() as u32;
        world.next_joint = joints.len() as u64;
        let limit_m_s = world.host.settings().speed_limit_m_s();
        bodies.iter().try_for_each(|body| check_speed(body, limit_m_s))?;
        world.host.insert(bodies, &joints)?;
        world.host.set_viewpoints(scene.viewpoints.clone());
        Ok(world)
    }

    /// Advances the world by one tick.
    pub fn step(&mut self) -> Result<(), WorldError> {
        self.tape_seed();
        let stepped = self.advance();
        if stepped.is_err() {
            self.tape_spoilt();
        }
        stepped
    }

    fn advance(&mut self) -> Result<(), WorldError> {
        let start = Instant::now();
        let early = self.host.take_early_forces();
        self.host.place_beginning()?;
        self.host.step()?;
        self.host.note_tick_time(start.elapsed().as_secs_f64() * 1e3);
        self.ledger.merge(self.host.events(), &mut self.events);
        self.events.add_early(early);
        self.host.clear_events();
        self.strengths.look(&self.host);
        self.last_step = start.elapsed();
        // Regions that follow the times of steps are cut differently in each run. So what they computed is
        // recorded before they are cut, and the new cut as a snapshot. A replay repeats all else by itself.
        let follows_times = self.follows_times();
        let tree = (follows_times && self.is_recorded()).then(|| self.host.partition().tree().clone());
        if follows_times {
            self.tape_step();
        }
        let start = Instant::now();
        for (from, to) in self.host.rebalance()? {
            self.ledger.rename(from, to);
        }
        self.last_step += start.elapsed();
        if !follows_times {
            self.tape_step();
        } else if tree.is_some_and(|tree| tree != *self.host.partition().tree()) {
            self.tape_spoilt();
        }
        Ok(())
    }

    /// Does what may be refused though regions were brought to the present for it: only a snapshot can record
    /// that.
    fn or_spoil<R>(
        &mut self,
        change: impl FnOnce(&mut Self) -> Result<R, WorldError>,
    ) -> Result<R, WorldError> {
        let done = change(self);
        if done.is_err() {
            self.tape_spoilt();
        }
        done
    }

    /// Returns the host that computes the regions.
    pub fn host(&self) -> &RegionHost {
        &self.host
    }

    pub(super) fn host_mut(&mut self) -> &mut RegionHost {
        &mut self.host
    }
}
