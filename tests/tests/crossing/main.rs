//! Tests what crosses borders: a body that several regions share must behave as in one world.

mod bare;
mod bodies;
mod changes;
mod contacts;
mod heap;
mod hooks;
mod joints;
mod kinematic;
mod shapes;
mod sleep;
mod sleepers;
mod table;
mod unlike;
mod user;

use dcd::physics::{Coupling, StepSettings};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::space::{Axis, BodyId};
use rapier3d::prelude::*;

/// The couplings that split masses.
const SHARING: [Coupling; 3] = [Coupling::Overlap, Coupling::Island, Coupling::Auto];

/// Returns the configuration of one region, which steps once per tick.
fn one_world() -> WorldConfig {
    let step = StepSettings { exchanges: 1, ..StepSettings::default() };
    WorldConfig { partitioning: Partitioning::Regions(1), step, ..WorldConfig::default() }
}

/// Returns the configuration of regions that meet at these planes. No island moves whole, so bodies at a
/// border are shared.
fn cut(coupling: Coupling, planes: &[(Axis, f64)]) -> WorldConfig {
    let step = StepSettings { island_limit: 0, ..StepSettings::default().with_coupling(coupling) };
    WorldConfig { partitioning: Partitioning::Cuts(planes.to_vec()), step, ..WorldConfig::default() }
}

/// Returns the configuration of two regions that meet at x = 0.
fn halves(coupling: Coupling) -> WorldConfig {
    cut(coupling, &[(Axis::X, 0.0)])
}

fn weightless(mut config: WorldConfig) -> WorldConfig {
    config.step.gravity = [0.0; 3];
    config
}

fn body_at(x: f32, y: f32, z: f32) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(Vector::new(x, y, z))
}

fn fixed_at(y: f32) -> RigidBodyBuilder {
    RigidBodyBuilder::fixed().translation(Vector::new(0.0, y, 0.0))
}

/// Returns a cube 1 m wide, of 1 kg.
fn cube() -> ColliderBuilder {
    ColliderBuilder::cuboid(0.5, 0.5, 0.5)
}

fn insert_floor(world: &mut LocalWorld) -> BodyId {
    let body = RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0));
    world.insert(body, ColliderBuilder::cuboid(60.0, 0.5, 60.0)).unwrap()
}

/// Steps, and checks that every movable body has one owner.
fn steps(world: &mut LocalWorld, count: usize) {
    for _ in 0..count {
        world.step().unwrap();
        for (id, ..) in world.states().collect::<Vec<_>>() {
            assert_eq!(world.owners_of(id), 1, "{id} at {}", world.tick());
        }
    }
}

/// Returns the number of regions that divide a body's mass.
fn parts(world: &LocalWorld, id: BodyId) -> usize {
    let (region, handle) = world.host().owned(id).unwrap();
    region.share_of(handle)
}

fn at(world: &LocalWorld, id: BodyId) -> [f64; 3] {
    world.pose(id).unwrap().translation
}

fn speed(world: &LocalWorld, id: BodyId) -> [f32; 3] {
    world.velocity(id).unwrap().linear
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Runs the same in one world and with this configuration. Returns the greatest distance of a body's two
/// places at the end, metres.
fn deviation(config: WorldConfig, run: impl Fn(&mut LocalWorld)) -> f64 {
    let one = WorldConfig {
        partitioning: Partitioning::Regions(1),
        step: StepSettings { exchanges: 1, ..config.step },
        ..config.clone()
    };
    let [one, many] = [one, config].map(|config| {
        let mut world = LocalWorld::new(config).unwrap();
        run(&mut world);
        world.states().map(|(id, _, pose, _)| (id, pose.translation)).collect::<Vec<_>>()
    });
    assert_eq!(one.len(), many.len());
    one.iter().zip(&many).map(|(a, b)| distance(a.1, b.1)).fold(0.0, f64::max)
}
