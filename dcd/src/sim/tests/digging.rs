//! Tests that a world whose terrain is dug for long forgets shapes that are gone, at all nodes and clients,
//! and never shapes that are there.

use rapier3d::prelude::{Array2, ColliderBuilder, RigidBody, RigidBodyBuilder, Vector};

use super::*;
use crate::cluster::{Record, ServerEvent};
use crate::physics::ShapeLibrary;
use crate::protocol::{BodyRecord, BuildOp, EnvironmentProperties, Input, ShapeHash, ShapeRecord, WorldPose};

/// The number of points along an edge of the terrain, which then has a quarter of a megabyte.
const EDGE: usize = 260;
const RADIUS_M: f32 = 0.5;

/// Returns a terrain at height 1 with a pit of this depth in one corner.
fn terrain(shapes: &mut ShapeLibrary, index: u32, depth_m: f32) -> (BodyRecord, ShapeRecord) {
    let mut heights = Array2::new(EDGE, EDGE, vec![0.0; EDGE * EDGE]);
    heights[(0, 0)] = -depth_m;
    let field = ColliderBuilder::heightfield(heights, Vector::new(15.0, 1.0, 7.0));
    described(shapes, index, [8.0, 1.0, 4.0], &RigidBodyBuilder::fixed().build(), field)
}

fn ball(shapes: &mut ShapeLibrary, index: u32, x: f64, radius_m: f32) -> (BodyRecord, ShapeRecord) {
    let body = RigidBodyBuilder::dynamic().can_sleep(false).build();
    described(shapes, index, [x, 1.0 + f64::from(radius_m), 4.0], &body, ColliderBuilder::ball(radius_m))
}

fn described(
    shapes: &mut ShapeLibrary,
    index: u32,
    at: [f64; 3],
    body: &RigidBody,
    collider: ColliderBuilder,
) -> (BodyRecord, ShapeRecord) {
    let id = BodyId::persistent(index);
    let record = shapes.describe(id, WorldPose::at(at), body, &[collider]).unwrap();
    let shape = shapes.record_of(record.traits.colliders[0].shape).unwrap().clone();
    (record, shape)
}

fn insert((body, shape): (BodyRecord, ShapeRecord)) -> BuildOp {
    BuildOp::Insert { bodies: vec![body], shapes: vec![shape], joints: Vec::new() }
}

/// Returns the shapes that each node knows.
fn known(sim: &Sim) -> Vec<Vec<ShapeHash>> {
    sim.nodes.values().map(|node| node.physics.shapes()).collect()
}

#[test]
fn a_terrain_that_is_dug_forty_times_fills_no_memory_and_has_no_hole() {
    let mut library = ShapeLibrary::default();
    let (ground, first) = terrain(&mut library, 100, 0.0);
    let balls = [(0, 3.0, RADIUS_M), (1, 13.0, 0.4)];
    let balls = balls.map(|(index, x, radius_m)| ball(&mut library, index, x, radius_m));
    let bodies = balls.iter().map(|(body, _)| body.clone()).chain([ground]).collect();
    let mut world = sim_world(2);
    world.step.gravity = [0.0, -9.81, 0.0];
    let world = EnvironmentProperties { halo_m: None, ..world };
    let record = Record::new(bodies, library.records(), Vec::new());
    let mut sim = Sim::with_world(config(1, 2), world, record, RapierEngine::boxed);
    let client = sim.start_client(None);
    sim.run_until(|sim| sim.client(client).is_joined() && sim.tick() > Tick(30)).unwrap();
    let is_on_ground = |sim: &Sim| {
        let states = sim.states();
        [(0, RADIUS_M), (1, 0.4)].into_iter().all(|(index, radius_m)| {
            let y = states[&BodyId::persistent(index)].pose.translation[1];
            (y - 1.0 - f64::from(radius_m)).abs() < 0.02
        })
    };
    assert!(is_on_ground(&sim));
    for dug in 1..=40 {
        // The new terrain comes, and the terrain before it goes.
        let next = terrain(&mut library, 100 + dug, 0.1 * dug as f32);
        sim.order(ServerEvent::Program(vec![insert(next), BuildOp::Remove(BodyId::persistent(99 + dug))]));
        if dug == 25 {
            sim.start_node();
        }
        sim.run_for(Duration::from_secs(1)).unwrap();
        assert!(is_on_ground(&sim), "a hole, dug {dug} times");
    }
    assert_eq!(sim.nodes().count(), 3);
    assert!(sim.server().view().is_some_and(|view| view.members.len() == 3), "the third came late");
    sim.run_for(Duration::from_secs(12)).unwrap();
    let hash = first.hash();
    let on_record = sim.server().record().shapes_by_hash();
    assert!(on_record.len() < 20 && !on_record.contains_key(&hash), "{} on record", on_record.len());
    let heard = sim.client(client).shapes();
    assert!(heard.len() < 20 && !heard.contains_key(&hash), "{} at the client", heard.len());
    for shapes in known(&sim) {
        assert!(shapes.len() < 20 && !shapes.contains(&hash), "{} at a node", shapes.len());
        assert!(
            balls.iter().all(|(_, ball)| shapes.contains(&ball.hash())),
            "bodies have it, here or elsewhere"
        );
    }

    // A ball goes to the region of a node that never had it, over terrain that was forgotten and is there
    // again.
    let (mut again, shape) = terrain(&mut library, 200, 0.0);
    again.id = BodyId::persistent(200);
    assert_eq!(shape.hash(), hash);
    let input = Input {
        body: BodyId::persistent(1),
        logical_time: 0,
        tick: Tick(0),
        velocity: Velocity { linear: [-4.0, 0.0, 0.0], angular: [0.0, 0.0, 10.0] },
        pose: None,
        drive: None,
    };
    sim.order(ServerEvent::Program(vec![insert((again, shape)), BuildOp::Remove(BodyId::persistent(140))]));
    sim.order(ServerEvent::Program(vec![BuildOp::Move(input)]));
    let x = |sim: &Sim| sim.state(BodyId::persistent(1)).map(|state| state.pose.translation[0]);
    sim.run_until(|sim| x(sim).is_some_and(|x| x < 7.0)).unwrap();
    assert!(is_on_ground(&sim));
    assert!(known(&sim).iter().all(|shapes| shapes.contains(&hash)));
    assert!(sim.client(client).shapes().contains_key(&hash));
}
