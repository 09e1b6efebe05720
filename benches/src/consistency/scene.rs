//! Sets up three groups of four nodes, far from one another, that compute the same gas, with a wandering
//! avatar in each.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use dcd::cluster::{ClientEvent, Peer, Record};
use dcd::physics::ShapeLibrary;
use dcd::protocol::{
    BodyKind, DelayThresholds, EnvironmentProperties, SyncProtocol, Thresholds, Velocity, WorldPose,
};
use dcd::rapier3d::prelude::*;
use dcd::scene::{Params, Scene};
use dcd::sim::{NetworkConditions, Path, Random, RapierEngine, Sim, SimConfig, sim_world};
use dcd::space::{BodyId, Bounds, ClientId, DistributionTree, NodeId};

pub(super) const GROUPS: u32 = 3;
pub(super) const MEMBERS: u32 = 4;
const BALLS: u32 = 60;
/// The speed of every ball at the start.
const SPEED_M_S: f64 = 1.0;
/// The speed of an avatar, which pushes balls.
const AVATAR_SPEED_M_S: f64 = 1.5;
/// The time between two turns of a user.
const TURN: Duration = Duration::from_millis(500);
/// The delay between groups. The server lies in the middle between them, so that what one group tells another
/// by way of the server takes as long as a direct packet.
const BETWEEN_US: u64 = 60_000;
const INSIDE_US: u64 = 1_000;

/// One setting of the scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    pub(super) name: &'static str,
    pub(super) between_groups_m: f32,
    pub(super) protocol: SyncProtocol,
    /// The restitution of balls and walls: 1 keeps all energy, including what corrections bring in.
    pub(super) restitution: f32,
}

/// A threshold that no deviation reaches: bodies are never corrected.
const NEVER_M: f32 = 1e6;

const IN_STEP: SyncProtocol = SyncProtocol::Synchronised;
const LATE: SyncProtocol = SyncProtocol::Unsynchronised { lag_ticks: 6 };

const fn setting(
    name: &'static str,
    between_groups_m: f32,
    protocol: SyncProtocol,
    restitution: f32,
) -> Setting {
    Setting { name, between_groups_m, protocol, restitution }
}

pub(super) const SETTINGS: [Setting; 5] = [
    setting("corrected", 0.1, IN_STEP, 0.7),
    setting("not corrected", NEVER_M, IN_STEP, 0.7),
    setting("corrected, unsynchronised", 0.1, LATE, 0.7),
    setting("corrected, elastic", 0.1, IN_STEP, 1.0),
    setting("not corrected, elastic", NEVER_M, IN_STEP, 1.0),
];

/// The running scene, with groups formed and avatars in it.
pub(super) struct Running {
    pub(super) sim: Sim,
    bounds: Bounds,
    random: Random,
    avatars: Vec<(ClientId, BodyId, [f64; 3])>,
    turns_at: Duration,
}

impl Running {
    /// Waits until groups have formed by themselves, and brings an avatar into each.
    pub(super) fn new(setting: &Setting, seed: u64) -> Result<Self, Box<dyn Error>> {
        let params =
            Params::new().with("n", BALLS).with("fill", 0.01).with("speed", SPEED_M_S).with("seed", seed);
        let scene = Scene::named("gas", &params)?;
        let mut shapes = ShapeLibrary::default();
        let (mut bodies, joints) = scene.records(&mut shapes)?;
        for body in &mut bodies {
            let traits = Arc::make_mut(&mut body.traits);
            traits.colliders.iter_mut().for_each(|collider| collider.restitution = setting.restitution);
        }
        let inside = bodies.iter().filter(|body| body.traits.kind != BodyKind::Fixed);
        let inside = inside.map(|body| Bounds::around(body.state.pose.translation, [0.3; 3]));
        let bounds = inside.reduce(|a, b| a.union(&b)).expect("a gas has balls");
        let world = EnvironmentProperties {
            step: dcd::protocol::StepRecord { gravity: scene.gravity, ..sim_world(1).step },
            tree: DistributionTree::halved(bounds, 8)?,
            ..sim_world(1)
        };
        let record = Record::new(bodies, shapes.records(), joints);
        let delay = DelayThresholds { inclusion_ms: 20.0, rejection_ms: 40.0, deviation_ms: 20.0 };
        let config = SimConfig {
            seed,
            nodes: GROUPS * (MEMBERS - 1),
            network: network(),
            physics: Path { base_us: 500, jitter_us: 500 },
            thresholds: Thresholds {
                delay: Some(delay),
                between_groups_m: setting.between_groups_m,
                ..Thresholds::default()
            },
            protocol: setting.protocol,
            ..SimConfig::default()
        };
        let mut sim = Sim::with_world(config, world, record, RapierEngine::boxed);
        let clients: Vec<_> = (0..GROUPS).map(|_| sim.start_participant(None).1).collect();
        let is_formed = |sim: &Sim| {
            sim.server().views().filter(|(_, view)| view.members.len() == MEMBERS as usize).count()
                == GROUPS as usize
        };
        let is_ready =
            |sim: &Sim| is_formed(sim) && clients.iter().all(|&client| sim.client(client).leader().is_some());
        sim.run_until(is_ready)?;
        let mut running =
            Self { turns_at: sim.now(), sim, bounds, random: Random::new(seed ^ 0xA7), avatars: Vec::new() };
        for client in clients {
            running.bring(client)?;
        }
        Ok(running)
    }

    fn bring(&mut self, client: ClientId) -> Result<(), Box<dyn Error>> {
        let id = BodyId::avatar(client, 0);
        let ball = ColliderBuilder::ball(0.3)
            .density(4.0)
            .restitution(1.0)
            .friction(0.0)
            .active_events(ActiveEvents::COLLISION_EVENTS);
        let builder = RigidBodyBuilder::dynamic().can_sleep(false);
        let place = self.somewhere();
        let mut shapes = ShapeLibrary::default();
        let body = shapes.describe(id, WorldPose::at(place), &builder.build(), &[ball])?;
        self.sim.submit(client, ClientEvent::Spawn { body, shapes: shapes.records() });
        self.sim.run_until(|sim| sim.client(client).body(id).is_some())?;
        self.avatars.push((client, id, place));
        Ok(())
    }

    /// Runs for a time, with users that move their avatars from place to place.
    pub(super) fn run_for(&mut self, time: Duration) -> Result<(), Box<dyn Error>> {
        let end = self.sim.now() + time;
        while self.sim.now() < end {
            if self.turns_at <= self.sim.now() {
                self.turn();
                self.turns_at = self.sim.now() + TURN;
            }
            let next = self.turns_at.min(end);
            self.sim.run_for(next - self.sim.now())?;
        }
        Ok(())
    }

    fn turn(&mut self) {
        for at in 0..self.avatars.len() {
            let (client, body, goal) = self.avatars[at];
            let Some(seen) = self.sim.client(client).body(body) else { continue };
            let place = seen.body.state.pose.translation;
            let way: [f64; 3] = std::array::from_fn(|i| goal[i] - place[i]);
            let distance_m = way.iter().map(|way| way * way).sum::<f64>().sqrt();
            if distance_m < 1.0 {
                self.avatars[at].2 = self.somewhere();
            }
            let linear = way.map(|way| (way / distance_m.max(0.1) * AVATAR_SPEED_M_S) as f32);
            let velocity = Velocity { linear, angular: [0.0; 3] };
            self.sim.submit(client, ClientEvent::Input { body, tick: dcd::Tick(0), velocity, pose: None });
        }
    }

    /// Returns a place in the inner part of the box.
    fn somewhere(&mut self) -> [f64; 3] {
        let Bounds { min, max } = self.bounds;
        std::array::from_fn(|i| min[i] + (max[i] - min[i]) * (0.15 + 0.7 * self.random.unit()))
    }
}

fn network() -> NetworkConditions {
    let around = |us: u64| Path { base_us: us - us / 20, jitter_us: us / 10 };
    let node = |node: u32| {
        let dedicated = GROUPS * (MEMBERS - 1);
        let site = if node <= dedicated { (node - 1) / (MEMBERS - 1) } else { node - dedicated - 1 };
        (Peer::Node(NodeId(node)), site)
    };
    let client = |client: u32| (Peer::Client(ClientId(client)), client - 1);
    NetworkConditions {
        far: around(BETWEEN_US),
        server: Some(around(BETWEEN_US / 2)),
        sites: (1..=GROUPS * MEMBERS).map(node).chain((1..=GROUPS).map(client)).collect(),
        ..NetworkConditions::calm(around(INSIDE_US))
    }
}
