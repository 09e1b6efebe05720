//! Tests a server's program, which builds, moves and removes what is in its world. Uses real QUIC, with nodes
//! and clients in this process.

mod building;
mod contacts;
mod kept;
mod queries;
mod same_bits;
mod settings;

use std::time::{Duration, Instant};

use dcd::Axis;
use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;

const LIMIT: Duration = Duration::from_secs(30);

fn cut() -> WorldConfig {
    WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() }
}

/// Serves an empty world in two regions.
fn serve(config: ServeConfig) -> World {
    World::new(cut()).unwrap().serve_copy(config).unwrap()
}

fn join(server: &World, role: JoinRole) -> JoinConfig {
    JoinConfig::new(server.address().unwrap(), server.token(role, LIMIT).unwrap())
}

fn node(server: &World) -> World {
    World::join_as_node(&join(server, JoinRole::Node)).unwrap()
}

fn client(server: &World) -> World {
    World::connect(&join(server, JoinRole::Client)).unwrap()
}

/// Steps all worlds until the condition holds.
fn until(what: &str, worlds: &mut [&mut World], mut is_so: impl FnMut(&[&mut World]) -> bool) {
    let deadline = Instant::now() + LIMIT;
    while !is_so(worlds) {
        assert!(Instant::now() < deadline, "not within {LIMIT:?}: {what}");
        worlds[0].poll(Duration::from_millis(5));
        for world in worlds.iter_mut() {
            world.step().unwrap();
        }
    }
}

/// Inserts ground, twenty boxes on both sides of the border, and a pendulum that swings across it. Returns
/// the bodies.
fn build(world: &mut World) -> Vec<BodyId> {
    let ground = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let mut bodies = vec![ground];
    for i in 0..20 {
        let at = Vector::new((i % 5) as f32 * 1.3 - 2.7, 1.1 + (i / 5) as f32 * 1.2, 0.1 * i as f32);
        let body = RigidBodyBuilder::dynamic().translation(at);
        bodies.push(world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap());
    }
    let post = RigidBodyBuilder::fixed().translation(Vector::new(0.0, 6.0, -8.0));
    let post = world.insert(post, ColliderBuilder::ball(0.1)).unwrap();
    let bob = RigidBodyBuilder::dynamic().translation(Vector::new(3.0, 6.0, -8.0));
    let bob = world.insert(bob, ColliderBuilder::ball(0.3)).unwrap();
    let weight = RigidBodyBuilder::dynamic().translation(Vector::new(4.0, 6.0, -8.0));
    let weight = world.insert(weight, ColliderBuilder::ball(0.3)).unwrap();
    let rope = |length: f32| SphericalJointBuilder::new().local_anchor2(Vector::X * -length);
    world.insert_joint(post, bob, rope(3.0)).unwrap();
    world.insert_joint(bob, weight, rope(1.0)).unwrap();
    bodies.extend([post, bob, weight]);
    bodies
}
