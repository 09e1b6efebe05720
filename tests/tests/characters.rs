//! Tests characters, which walk by themselves where they are computed: in one region, over borders, with
//! every coupling, and over the network.

use std::time::Instant;

use dcd::network::JoinRole;
use dcd::prelude::*;
use dcd::{Axis, CharacterState, Costs, Refusal, StepSettings};
use dcd_tests::served::{Served, join};

const G: f32 = 9.81;

/// Half the height of the capsule and the gap below it, metres: the height of a character's origin above what
/// it stands on.
const STANDS_M: f64 = 0.8 + 0.02;

/// Returns a world with a floor: whole, or with borders at x = 0 and z = 2, to which nothing here is
/// symmetrical.
fn world(cuts: usize, coupling: Coupling) -> World {
    let cuts = [(Axis::X, 0.0), (Axis::Z, 2.0)][..cuts].to_vec();
    let partitioning = Partitioning::Cuts(cuts);
    let step = StepSettings::default().with_coupling(coupling);
    let mut world = World::new(WorldConfig { partitioning, step, ..WorldConfig::default() }).unwrap();
    block(&mut world, [0.0, -0.5, 0.0], [40.0, 0.5, 40.0]);
    world
}

fn block(world: &mut World, at: [f64; 3], half: [f32; 3]) -> BodyId {
    let collider = ColliderBuilder::cuboid(half[0], half[1], half[2]);
    world.insert_at(WorldPose::at(at), RigidBodyBuilder::fixed(), [collider]).unwrap()
}

fn capsule() -> ColliderBuilder {
    ColliderBuilder::capsule_y(0.5, 0.3)
}

fn walker_as(world: &mut World, at: [f64; 3], character: Character) -> BodyId {
    let body = RigidBodyBuilder::kinematic_velocity_based();
    world.insert_character(WorldPose::at(at), &character, body, [capsule()]).unwrap()
}

fn walker(world: &mut World, at: [f64; 3]) -> BodyId {
    walker_as(world, at, Character::default())
}

fn go(world: &mut World, id: BodyId, velocity: [f32; 3]) {
    world.set_velocity(id, Velocity::linear(velocity)).unwrap();
}

fn run(world: &mut World, ticks: usize) {
    (0..ticks).for_each(|_| world.step().unwrap());
}

fn place(world: &World, id: BodyId) -> [f64; 3] {
    world.pose(id).unwrap().translation
}

/// Returns the world in one region, and in four with every coupling.
fn worlds() -> impl Iterator<Item = (String, World)> {
    let couplings = [Coupling::Auto, Coupling::Overlap, Coupling::Owner, Coupling::Proxy];
    let cut = couplings.into_iter().map(|coupling| (format!("{coupling:?}"), world(2, coupling)));
    std::iter::once(("whole".to_owned(), world(0, Coupling::Auto))).chain(cut)
}

#[test]
fn a_character_that_walks_over_a_border_does_not_stop_there() {
    for (name, mut world) in worlds() {
        let id = walker(&mut world, [-2.0, STANDS_M, 0.3]);
        go(&mut world, id, [3.0, 0.0, 1.5]);
        run(&mut world, 2);
        for tick in 0..90 {
            let before = place(&world, id);
            run(&mut world, 1);
            let way = [0, 2].map(|axis| place(&world, id)[axis] - before[axis]);
            let is_whole = (way[0] - 0.05).abs() < 1e-3 && (way[1] - 0.025).abs() < 1e-3;
            assert!(is_whole, "{name}: {way:?} m in tick {tick}, at {before:?}");
        }
    }
}

#[test]
fn a_character_on_level_ground_is_never_stopped() {
    let shapes = [capsule(), ColliderBuilder::cylinder(0.8, 0.3), ColliderBuilder::cuboid(0.3, 0.8, 0.3)];
    for (shape, half) in shapes.iter().flat_map(|shape| [200.0, 20.0].map(|half| (shape, half))) {
        for speed_m_s in [1.0, 3.0, 6.0] {
            let mut world = World::new(WorldConfig::default()).unwrap();
            block(&mut world, [0.0, -0.5, 0.0], [half, 0.5, 20.0]);
            let (body, at) =
                (RigidBodyBuilder::kinematic_velocity_based(), WorldPose::at([-19.0, 0.83, 0.0]));
            let id = world.insert_character(at, &Character::default(), body, [shape.clone()]).unwrap();
            go(&mut world, id, [speed_m_s, 0.0, 0.0]);
            run(&mut world, 2);
            let start = place(&world, id);
            run(&mut world, 300);
            let [way, rise, _] = std::array::from_fn(|axis| place(&world, id)[axis] - start[axis]);
            let asked_m = 5.0 * f64::from(speed_m_s);
            assert!(way > 0.998 * asked_m, "{way} of {asked_m} m on a floor of {half} m");
            assert!(rise.abs() < 0.02, "{rise} m up");
        }
    }
}

#[test]
fn a_box_that_stands_does_not_sink_into_large_ground() {
    let mut world = World::new(WorldConfig::default()).unwrap();
    block(&mut world, [0.0, -0.5, 0.0], [60.0, 0.5, 60.0]);
    let (body, at) = (RigidBodyBuilder::kinematic_velocity_based(), WorldPose::at([-8.0, 1.0, -8.0]));
    let shape = ColliderBuilder::cuboid(0.3, 0.9, 0.3);
    let id = world.insert_character(at, &Character::default(), body, [shape]).unwrap();
    for tick in 0..300 {
        run(&mut world, 1);
        let height = place(&world, id)[1];
        assert!(height > 0.899, "{} m deep in tick {tick}", 0.9 - height);
        assert!(tick < 60 || height < 0.93, "{} m up in tick {tick}", height - 0.9);
    }
}

#[test]
fn of_two_that_walk_against_each_other_neither_pushes_the_other() {
    for first in [-1.0, 1.0] {
        let mut world = World::new(WorldConfig::default()).unwrap();
        block(&mut world, [0.0, -0.5, 0.0], [20.0, 0.5, 20.0]);
        let ids = [first, -first].map(|side: f64| {
            let (body, at) =
                (RigidBodyBuilder::kinematic_velocity_based(), WorldPose::at([2.0 * side, 0.95, 0.0]));
            let shape = ColliderBuilder::cuboid(0.3, 0.9, 0.3);
            let id = world.insert_character(at, &Character::default(), body, [shape]).unwrap();
            go(&mut world, id, [-2.0 * side as f32, 0.0, 0.0]);
            id
        });
        run(&mut world, 180);
        let [a, b] = ids.map(|id| place(&world, id)[0]);
        assert!((a + b).abs() < 0.1, "{a} and {b} m, the first from {first}");
        assert!((a - b).abs() > 0.55, "{a} and {b} m: one is in the other");
        assert!((a - b).abs() < 0.7, "{a} and {b} m: they have not met");
    }
}

#[test]
fn what_is_shoved_against_a_wall_or_another_goes_into_neither() {
    for side in [-1.0, 1.0] {
        let mut world = World::new(WorldConfig::default()).unwrap();
        block(&mut world, [0.0, -0.5, 0.0], [20.0, 0.5, 20.0]);
        block(&mut world, [4.5 * side, 2.0, 0.0], [0.5, 2.0, 9.0]);
        let pusher = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 1.5 * side as f32);
        let shape = ColliderBuilder::cuboid(0.3, 0.9, 0.3);
        world
            .insert_at(WorldPose::at([0.0, 1.2, 0.0]), pusher, [ColliderBuilder::cuboid(0.5, 1.0, 2.0)])
            .unwrap();
        let ids = [1.2, 2.2].map(|x| {
            let body = RigidBodyBuilder::kinematic_velocity_based();
            let at = WorldPose::at([x * side, 0.95, 0.0]);
            world.insert_character(at, &Character::default(), body, [shape.clone()]).unwrap()
        });
        // Long enough to shove both on, and later to press the outer one to the wall.
        let mut least = f64::INFINITY;
        for tick in 0..200 {
            run(&mut world, 1);
            let [inner, outer] = ids.map(|id| place(&world, id)[0] * side);
            if tick < 60 {
                least = least.min(outer - inner - 0.6);
            }
            assert!(outer < 4.0 - 0.3 + 1e-3, "it is at {outer} m in tick {tick}, in the wall");
        }
        assert!(least > -0.05, "the shoved one is {} m in the other", -least);
    }
}

#[test]
fn it_falls_onto_a_half_space_as_onto_a_box_and_walks_there() {
    let half_space = ColliderBuilder::new(SharedShape::halfspace(Vector::Y));
    let slab = ColliderBuilder::cuboid(40.0, 0.5, 40.0).translation(Vector::new(0.0, -0.5, 0.0));
    for cuts in [0, 1] {
        let [on_half_space, on_slab] = [&half_space, &slab].map(|ground| {
            let partitioning = Partitioning::Cuts([(Axis::X, 0.0)][..cuts].to_vec());
            let mut world = World::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            world.insert(RigidBodyBuilder::fixed(), ground.clone()).unwrap();
            let id = walker(&mut world, [-2.0, STANDS_M + 3.0, 0.3]);
            run(&mut world, 120);
            let [_, stands, _] = place(&world, id);
            assert!((stands - STANDS_M).abs() < 0.05, "{cuts} cuts: it stands at {stands}");
            go(&mut world, id, [2.0, 0.0, 0.0]);
            for tick in 0..120 {
                run(&mut world, 1);
                let [x, y, _] = place(&world, id);
                assert!((y - STANDS_M).abs() < 0.05, "{cuts} cuts: it is at {x} {y} in tick {tick}");
            }
            let [x, ..] = place(&world, id);
            assert!((x - 2.0).abs() < 0.1, "{cuts} cuts: it has come to {x}");
            let state = world.character_state(id).unwrap();
            assert!(state.grounded && is_on(&state, BodyId::persistent(0), 0.0), "{cuts} cuts: {state:?}");
            stands
        });
        let apart_m = (on_half_space - on_slab).abs();
        assert!(apart_m < 0.02, "{cuts} cuts: {on_half_space} on the half-space, {on_slab} on the box");
    }
}

#[test]
fn it_walks_over_borders_and_stops_at_walls() {
    for (name, mut world) in worlds() {
        block(&mut world, [4.5, 1.0, 0.0], [0.5, 1.0, 40.0]);
        let id = walker(&mut world, [-4.0, 1.0, 0.3]);
        let first = world.owner(id).region;
        go(&mut world, id, [3.0, 0.0, 0.0]);
        run(&mut world, 120);
        let halfway = place(&world, id);
        assert!((halfway[0] - 1.95).abs() < 0.15, "{name}: {halfway:?}");
        run(&mut world, 120);
        let [x, y, z] = place(&world, id);
        assert!(
            (x - 3.68).abs() < 0.02 && (y - STANDS_M).abs() < 0.05 && (z - 0.3).abs() < 0.01,
            "{name}: {x} {y} {z}"
        );
        assert!(world.velocity(id).unwrap().linear[0].abs() < 0.05, "{name}: it moves as it can");
        // Walking obliquely, it slides along the wall.
        go(&mut world, id, [2.0, 0.0, 2.0]);
        run(&mut world, 120);
        let [x, _, z] = place(&world, id);
        assert!(x < 3.72 && z > 3.5, "{name}: {x} {z}");
        assert_eq!(world.owner(id).region != first, name != "whole", "{name}");
        assert!(world.validate().unwrap().is_empty());
    }
}

/// Returns whether a character's ground is this body, and as steep, in degrees.
fn is_on(state: &CharacterState, body: BodyId, degrees: f32) -> bool {
    let ground = state.ground.filter(|ground| ground.collider == body.into());
    ground.is_some_and(|ground| (ground.slope_rad.to_degrees() - degrees).abs() < 0.1)
}

#[test]
fn it_climbs_steps_and_slopes_as_far_as_it_can() {
    for (name, mut world) in worlds() {
        // A stair with steps of 0.25 m across the border, a block of 0.5 m, a ramp of 30° and one of 60°.
        for step in 0..4 {
            let y = 0.125 * f64::from(step + 1);
            block(&mut world, [0.2 + 0.5 * f64::from(step), y, 0.3], [0.25, y as f32, 1.0]);
        }
        block(&mut world, [0.5, 0.25, -6.0], [0.5, 0.25, 1.0]);
        let mut slabs = Vec::new();
        for (z, degrees) in [(6.0, 30.0f32), (12.0, 60.0)] {
            let (sin, cos) = (0.5 * degrees.to_radians()).sin_cos();
            let pose = WorldPose { translation: [0.0, 0.0, z], rotation: [0.0, 0.0, sin, cos] };
            let slab = ColliderBuilder::cuboid(3.0, 0.05, 1.0);
            slabs.push(world.insert_at(pose, RigidBodyBuilder::fixed(), [slab]).unwrap());
        }
        let slider = walker(&mut world, [1.0, 3.1, 12.0]);
        let rows = [0.3, -6.0, 6.0, 12.0].map(|z| walker(&mut world, [-3.5, 1.0, z]));
        let mut highest = [0.0f64; 4];
        let (mut slid, mut held, mut climbed) = (0, 0, 0);
        for tick in 0..400 {
            if tick < 30 {
                let state = world.character_state(slider).unwrap();
                held += usize::from(state.grounded);
                slid += usize::from(state.sliding && is_on(&state, slabs[1], 60.0));
            }
            let state = world.character_state(rows[2]).unwrap();
            climbed += usize::from(state.grounded && !state.sliding && is_on(&state, slabs[0], 30.0));
            if tick == 30 {
                world.remove(slider).unwrap();
                rows.iter().for_each(|&id| go(&mut world, id, [2.0, 0.0, 0.0]));
            }
            run(&mut world, 1);
            for (highest, &id) in highest.iter_mut().zip(&rows) {
                *highest = highest.max(place(&world, id)[1]);
            }
        }
        let [stair, block, ramp, cliff] = highest.map(|y| y - STANDS_M);
        assert!((stair - 1.0).abs() < 0.1, "{name}: a stair of one metre, {stair}");
        assert!(slid >= 5 && climbed >= 20, "{name}: for {slid} ticks down 60, for {climbed} up 30 degrees");
        // The slope may stop it for some ticks as it lands.
        assert!(held <= 3, "{name}: nobody stands on 60 degrees, for {held} ticks");
        assert!(block < 0.2, "{name}: half a metre is too high, {block}");
        assert!(ramp > 1.0, "{name}: 30 degrees, {ramp}");
        assert!(cliff < 0.3, "{name}: 60 degrees, {cliff}");
    }
}

#[test]
fn it_falls_and_jumps_by_gravity() {
    for (name, mut world) in worlds() {
        let id = walker(&mut world, [-0.4, 5.0, 0.3]);
        // Half a second, and the first tick, in which it looks around.
        run(&mut world, 31);
        let fallen = 5.0 - place(&world, id)[1];
        let expected = f64::from(0.5 * G * 0.5 * 0.5);
        assert!(
            (fallen - expected).abs() < 0.06,
            "{name}: {fallen} m in half a second, {expected} by gravity"
        );
        let falls = world.character_state(id).unwrap();
        assert!(!falls.grounded && !falls.sliding && falls.ground.is_none(), "{name}: {falls:?}");
        run(&mut world, 120);
        assert!((place(&world, id)[1] - STANDS_M).abs() < 0.06, "{name}: {}", place(&world, id)[1]);
        let stands = world.character_state(id).unwrap();
        assert!(stands.grounded && is_on(&stands, BodyId::persistent(0), 0.0), "{name}: {stands:?}");
        go(&mut world, id, [1.0, 5.0, 0.0]);
        run(&mut world, 1);
        go(&mut world, id, [1.0, 0.0, 0.0]);
        let mut highest = 0.0f64;
        for tick in 0..90 {
            run(&mut world, 1);
            let rises = world.character_state(id).unwrap();
            assert!(tick != 5 || !rises.grounded && rises.ground.is_none(), "{name}: {rises:?}");
            highest = highest.max(place(&world, id)[1] - STANDS_M);
        }
        let expected = f64::from(5.0 * 5.0 / (2.0 * G));
        assert!((highest - expected).abs() < 0.1, "{name}: {highest} m, {expected} by gravity");
        assert!((place(&world, id)[1] - STANDS_M).abs() < 0.06, "{name}: it is down again");
        // Under a ceiling the jump ends early, and it falls at once.
        let [x, _, z] = place(&world, id);
        block(&mut world, [x, 2.5, z], [2.0, 0.5, 2.0]);
        go(&mut world, id, [0.0, 5.0, 0.0]);
        run(&mut world, 1);
        go(&mut world, id, [0.0; 3]);
        run(&mut world, 40);
        assert!((place(&world, id)[1] - STANDS_M).abs() < 0.06, "{name}: {}", place(&world, id)[1]);
    }
}

#[test]
fn without_gravity_it_flies_as_it_wants_and_collides() {
    let mut world = world(2, Coupling::Auto);
    let body = RigidBodyBuilder::kinematic_velocity_based().gravity_scale(0.0);
    let at = WorldPose::at([-3.0, 3.0, 0.3]);
    let id = world.insert_character(at, &Character::default(), body, [capsule()]).unwrap();
    go(&mut world, id, [2.0, 1.0, 0.0]);
    run(&mut world, 121);
    let [x, y, _] = place(&world, id);
    assert!((x - 1.0).abs() < 0.05 && (y - 5.0).abs() < 0.05, "{x} {y}");
    go(&mut world, id, [0.0, -5.0, 0.0]);
    run(&mut world, 120);
    assert!((place(&world, id)[1] - STANDS_M).abs() < 0.06);
}

/// Returns the speed of a box of 40 kg on ice after a character of 80 kg walked into it at 2 m/s, and the
/// character's x.
fn pushed(world: &mut World, character: Character) -> (f32, f64) {
    let ice = ColliderBuilder::cuboid(0.5, 0.5, 0.5)
        .friction(0.0)
        .friction_combine_rule(CoefficientCombineRule::Min);
    // It lies across the border, and the region beyond owns it.
    let at = WorldPose::at([0.3, 0.5, 0.3]);
    let ball = world.insert_at(at, RigidBodyBuilder::dynamic(), [ice.mass(40.0)]).unwrap();
    let id = walker_as(world, [-1.5, 1.0, 0.3], character);
    run(world, 30);
    go(world, id, [2.0, 0.0, 0.0]);
    run(world, 60);
    (world.velocity(ball).unwrap().linear[0], place(world, id)[0])
}

#[test]
fn it_pushes_by_its_mass_wherever_the_body_is_owned() {
    // Under `proxy` the ghost is kinematic, which is a wall for the character's region.
    for (name, mut world) in worlds().filter(|(name, _)| name != "Proxy") {
        let (faster, _) = pushed(&mut world, Character::default());
        assert!((1.7..2.2).contains(&faster), "{name}: it ends as fast as what pushes it, {faster}");
    }
    for (name, mut world) in worlds() {
        let (speed, x) =
            pushed(&mut world, Character { mass_kg: 0.0, step_height_m: 0.0, ..Character::default() });
        assert!(speed.abs() < 0.01, "{name}: nothing is pushed, {speed}");
        assert!(x < -0.5, "{name}: it stops before it, {x}");
    }
}

#[test]
fn it_weighs_on_what_it_stands_on() {
    for (name, mut world) in worlds().filter(|(name, _)| name != "Proxy") {
        // A plank on a post, with a weight at one end. The character steps on the other end.
        block(&mut world, [0.2, 0.4, 0.3], [0.1, 0.4, 0.5]);
        let plank = ColliderBuilder::cuboid(2.0, 0.05, 0.5).mass(20.0);
        let weight =
            ColliderBuilder::cuboid(0.1, 0.1, 0.1).mass(10.0).translation(Vector::new(1.8, 0.15, 0.0));
        let body = RigidBodyBuilder::dynamic();
        let plank = world.insert_at(WorldPose::at([0.2, 0.85, 0.3]), body, [plank, weight]).unwrap();
        run(&mut world, 90);
        let tilt = |world: &World| world.pose(plank).unwrap().rotation[2];
        assert!(tilt(&world) < -0.1, "{name}: the load is down, {}", tilt(&world));
        let id = walker(&mut world, [-1.4, 2.6, 0.3]);
        run(&mut world, 120);
        assert!(tilt(&world) > 0.1, "{name}: the character is, {}", tilt(&world));
        assert!(place(&world, id)[1] > 0.7, "{name}: it is not below the floor");
    }
}

#[test]
fn it_rides_on_what_moves() {
    for (name, mut world) in worlds() {
        let platform = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::new(1.5, 0.0, 0.0));
        let deck = ColliderBuilder::cuboid(1.0, 0.25, 1.0);
        let platform = world.insert_at(WorldPose::at([-2.0, 1.0, 0.3]), platform, [deck]).unwrap();
        let id = walker(&mut world, [-2.0, 1.25 + STANDS_M, 0.3]);
        run(&mut world, 10);
        let off = |world: &World| place(world, id)[0] - place(world, platform)[0];
        let before = off(&world);
        run(&mut world, 150);
        assert!(place(&world, platform)[0] > 1.5, "the test needs it to cross the border");
        let state = world.character_state(id).unwrap();
        assert!(state.grounded && is_on(&state, platform, 0.0), "{name}: {state:?}");
        let slipped = off(&world) - before;
        assert!(slipped.abs() < 0.15, "{name}: it slipped by {slipped} m");
        assert!((place(&world, id)[1] - 1.25 - STANDS_M).abs() < 0.06, "{name}");
    }
}

/// A long platform goes over a border some metres before what stands at its back, or after what stands at its front.
#[test]
fn whoever_rides_on_a_long_platform_goes_along_over_borders() {
    for (name, mut world) in worlds() {
        let platform = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::new(6.0, 0.0, 0.0));
        let deck = ColliderBuilder::cuboid(3.0, 0.25, 1.0);
        let platform = world.insert_at(WorldPose::at([-6.0, 1.0, 0.3]), platform, [deck]).unwrap();
        let riders = [-2.0, 0.0, 2.0].map(|x| walker(&mut world, [x - 6.0, 1.25 + STANDS_M, 0.3]));
        run(&mut world, 10);
        let off = |world: &World| riders.map(|id| place(world, id)[0] - place(world, platform)[0]);
        let before = off(&world);
        run(&mut world, 120);
        assert!(place(&world, platform)[0] > 5.0, "the test needs it to cross the border");
        for (after, before) in off(&world).into_iter().zip(before) {
            let slipped = after - before;
            assert!(slipped.abs() < 0.02, "{name}: it slipped by {slipped} m at {before} m");
        }
    }
}

/// A raft that nothing else touches floats over borders, with somebody who stands before or behind its middle.
#[test]
fn whoever_stands_on_a_raft_goes_along_over_borders() {
    let mut slips = Vec::new();
    for speed in [1.0, 3.0, 6.0] {
        for place_m in [-0.6, -0.35, -0.1, 0.0, 0.2, 0.45, 0.6] {
            for (name, mut world) in worlds() {
                let raft = RigidBodyBuilder::dynamic()
                    .linvel(Vector::X * speed)
                    .gravity_scale(0.0)
                    .locked_axes(LockedAxes::ROTATION_LOCKED | LockedAxes::TRANSLATION_LOCKED_Y);
                let deck = ColliderBuilder::cuboid(1.0, 0.25, 1.0).mass(1000.0);
                let raft = world.insert_at(WorldPose::at([-3.0, 1.0, 0.3]), raft, [deck]).unwrap();
                let id = walker(&mut world, [place_m - 3.0, 1.25 + STANDS_M, 0.3]);
                run(&mut world, 10);
                let off = |world: &World| place(world, id)[0] - place(world, raft)[0];
                let before = off(&world);
                let mut most: f64 = 0.0;
                for _ in 0..(360.0 / speed) as usize {
                    run(&mut world, 1);
                    most = most.max((off(&world) - before).abs());
                }
                assert!(place(&world, raft)[0] > 1.5, "the test needs it to cross the border");
                if most > 0.02 {
                    slips.push(format!("{name}, {speed} m/s, {place_m} m from the middle: by {most} m"));
                }
            }
        }
    }
    assert!(slips.is_empty(), "{} {slips:#?}", slips.len());
}

/// It shoves a long box aside that lies across the border, on which it walks along.
#[test]
fn it_keeps_its_distance_from_what_it_shoves_over_a_border() {
    let narrowest_m = |mut world: World| {
        let at = WorldPose::at([-1.5, 0.4, 0.8]);
        let beam = ColliderBuilder::cuboid(3.0, 0.4, 0.4).density(60.0).friction(0.3);
        let beam = world.insert_at(at, RigidBodyBuilder::dynamic(), [beam]).unwrap();
        let id = walker(&mut world, [-1.6, STANDS_M, 0.0]);
        run(&mut world, 30);
        go(&mut world, id, [1.5, 0.0, 0.6]);
        let mut narrowest_m = f64::INFINITY;
        for _ in 0..200 {
            run(&mut world, 1);
            let pose = world.pose(beam).unwrap();
            let turn = pose.rotation;
            let yaw = 2.0 * f64::from(turn[1]).atan2(f64::from(turn[3]));
            let off: [f64; 3] = std::array::from_fn(|axis| place(&world, id)[axis] - pose.translation[axis]);
            // Along and across the beam.
            let (along, across) =
                (off[0] * yaw.cos() - off[2] * yaw.sin(), off[0] * yaw.sin() + off[2] * yaw.cos());
            if along.abs() < 3.0 {
                narrowest_m = narrowest_m.min(-across - 0.4 - 0.3);
            }
        }
        narrowest_m
    };
    let one_m = narrowest_m(world(0, Coupling::Auto));
    assert!((0.01..0.03).contains(&one_m), "in one region {one_m} m");
    for cuts in [1, 2] {
        let cut_m = narrowest_m(world(cuts, Coupling::Auto));
        assert!(cut_m > one_m - 0.004, "{cuts} borders: {cut_m} m, in one region {one_m} m");
    }
}

#[test]
fn it_is_lifted_and_shoved_and_not_passed_through() {
    for (name, mut world) in worlds() {
        let kinematic = |velocity| RigidBodyBuilder::kinematic_velocity_based().linvel(velocity);
        let lift = kinematic(Vector::new(0.0, 1.0, 0.0));
        let deck = ColliderBuilder::cuboid(1.0, 0.25, 1.0);
        let lift = world.insert_at(WorldPose::at([0.2, 0.25, 0.3]), lift, [deck]).unwrap();
        let rider = walker(&mut world, [0.1, 0.5 + STANDS_M, 0.3]);
        // A wall moves at 1 m/s, through the border, towards a character that stands there.
        let door = kinematic(Vector::new(1.0, 0.0, 0.0));
        let wall = ColliderBuilder::cuboid(0.1, 1.5, 1.0);
        let door = world.insert_at(WorldPose::at([-1.5, 1.5, -4.0]), door, [wall]).unwrap();
        let bystander = walker(&mut world, [-0.8, 1.0, -4.0]);
        run(&mut world, 120);
        let above = place(&world, rider)[1] - place(&world, lift)[1] - 0.25;
        assert!((above - STANDS_M).abs() < 0.06, "{name}: {above} m above the lift");
        let ahead = place(&world, bystander)[0] - place(&world, door)[0] - 0.1 - 0.3;
        assert!(ahead > -0.02 && ahead < 0.1, "{name}: {ahead} m ahead of the door");
    }
}

/// A generator of pseudo-random numbers from 0 to 1.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

#[test]
fn a_crowd_among_boxes_stays_in_its_room_and_apart() {
    for (name, mut world) in worlds() {
        for (x, z) in [(8.0, 0.0), (-8.0, 0.0), (0.0, 8.0), (0.0, -8.0)] {
            let half = if z == 0.0 { [0.5, 4.0, 9.0] } else { [9.0, 4.0, 0.5] };
            block(&mut world, [x, 4.0, z], half);
        }
        let mut dice = Dice(7);
        let mut scattered =
            |y: f64| [f64::from(dice.roll() * 14.0 - 7.0), y, f64::from(dice.roll() * 14.0 - 7.0)];
        for _ in 0..40 {
            let crate_ = ColliderBuilder::cuboid(0.3, 0.3, 0.3).density(100.0);
            world.insert_at(WorldPose::at(scattered(2.5)), RigidBodyBuilder::dynamic(), [crate_]).unwrap();
        }
        let crowd: Vec<_> = (0..24).map(|_| walker(&mut world, scattered(5.0))).collect();
        let mut dice = Dice(11);
        let (mut nearest, mut lowest) = (f64::INFINITY, f64::INFINITY);
        let mut start = Instant::now();
        for tick in 0..900 {
            if tick == 100 {
                start = Instant::now();
            }
            for &id in &crowd {
                if dice.roll() < 0.02 {
                    let jump = if dice.roll() < 0.2 { 4.0 } else { 0.0 };
                    go(&mut world, id, [dice.roll() * 6.0 - 3.0, jump, dice.roll() * 6.0 - 3.0]);
                }
            }
            run(&mut world, 1);
            let places: Vec<_> = crowd.iter().map(|&id| place(&world, id)).collect();
            for (i, a) in places.iter().enumerate() {
                assert!(a[0].abs() < 7.25 && a[2].abs() < 7.25, "{name}: {a:?} at tick {tick} is in a wall");
                lowest = lowest.min(a[1]);
                for b in places[..i].iter().filter(|b| (b[1] - a[1]).abs() < 0.5 && tick > 120) {
                    nearest = nearest.min((a[0] - b[0]).hypot(a[2] - b[2]));
                }
            }
        }
        println!("{name}: nearest {nearest} lowest {lowest} {:?} a tick", start.elapsed() / 800);
        assert!(lowest > 0.7, "{name}: one is {lowest} m above the floor");
        assert!(nearest > 0.4, "{name}: two are {nearest} m apart");
        assert!(world.validate().unwrap().is_empty(), "{name}: {:?}", world.validate().unwrap());
    }
}

#[test]
fn a_restored_one_walks_on_to_the_same_bits() {
    let mut original = world(2, Coupling::Auto);
    block(&mut original, [2.0, 0.1, 0.3], [1.0, 0.1, 1.0]);
    let id = walker(&mut original, [-1.0, 3.0, 0.3]);
    go(&mut original, id, [1.5, 0.0, 0.0]);
    run(&mut original, 20);
    let mut bytes = Vec::new();
    original.save(&mut bytes).unwrap();
    let mut restored = World::restore(bytes.as_slice(), 1).unwrap();
    run(&mut original, 100);
    run(&mut restored, 100);
    assert!(place(&original, id)[0] > 1.2);
    assert_eq!(original.state_hash().unwrap(), restored.state_hash().unwrap());
}

#[test]
fn what_cannot_walk_is_refused() {
    let mut world = world(0, Coupling::Auto);
    let at = WorldPose::at([0.0, 1.0, 0.0]);
    let mut refused =
        |character: &Character, body: RigidBodyBuilder, collider: ColliderBuilder, why: &str| {
            let error = world.insert_character(at, character, body, [collider]).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        };
    let usual = Character::default();
    let kinematic = RigidBodyBuilder::kinematic_velocity_based;
    refused(&usual, RigidBodyBuilder::dynamic(), capsule(), "kinematic_velocity_based");
    refused(&usual, kinematic(), capsule().sensor(true), "no sensors");
    refused(&Character { gap_m: 0.0, ..usual }, kinematic(), capsule(), "gap_m");
    refused(&Character { max_climb_rad: 2.0, ..usual }, kinematic(), capsule(), "max_climb_rad");
    refused(&Character { mass_kg: f32::NAN, ..usual }, kinematic(), capsule(), "mass_kg");
    refused(&Character { step_height_m: -1.0, ..usual }, kinematic(), capsule(), "step_height_m");
}

/// Serves a world with a wall, in two regions on two nodes, to a client.
fn served() -> Served {
    let mut local = world(1, Coupling::Auto);
    block(&mut local, [4.5, 1.0, 0.0], [0.5, 1.0, 40.0]);
    Served::of(&local)
}

#[test]
fn a_clients_character_walks_on_the_nodes() {
    let mut served = served();
    let id = walker(&mut served.client, [-2.5, 1.0, 0.3]);
    served.until("it stands", |client| {
        client.movable_count() == 1 && (place(client, id)[1] - STANDS_M).abs() < 0.05
    });
    let owner = served.client.owner(id).region;
    go(&mut served.client, id, [3.0, 0.0, 0.0]);
    served.until("it stands at the wall", |client| {
        let [x, ..] = place(client, id);
        assert!(x < 3.8, "it is in the wall at {x}");
        x > 3.6
    });
    served.until("it is owned beyond the border", |client| client.owner(id).region != owner);
    let beyond = WorldPose::at([7.0, 1.0, 0.3]);
    let refused = served.client.set_pose(id, beyond).unwrap_err().to_string();
    assert!(refused.contains("characters"), "{refused}");
    // The server's program may put it anywhere, and it walks on from there.
    served.server.set_pose(id, WorldPose::at([-2.0, 2.0, 0.3])).unwrap();
    served.until("it is put back", |client| place(client, id)[0] < 0.0);
    go(&mut served.client, id, [3.0, 0.0, 0.0]);
    served.until("it is at the wall again", |client| place(client, id)[0] > 3.6);
    // A jump, and no second one from the air.
    go(&mut served.client, id, [0.0, 4.0, 0.0]);
    served.until("it has jumped", |client| place(client, id)[1] > STANDS_M + 0.5);
    go(&mut served.client, id, [0.0; 3]);
    served.until("it is down again", |client| (place(client, id)[1] - STANDS_M).abs() < 0.05);
}

#[test]
fn it_walks_on_when_its_nodes_go() {
    let mut served = served();
    // The server's program says only once where the character goes.
    let id = walker(&mut served.server, [-38.0, 1.0, 0.3]);
    go(&mut served.server, id, [2.0, 0.0, 0.0]);
    served.until("it walks", |client| client.contains(id) && place(client, id)[0] > -36.0);
    for _ in 0..2 {
        let next = World::join_as_node(&join(&served.server, JoinRole::Node)).unwrap();
        served.nodes.push(next);
        let from = place(&served.client, id)[0];
        served.until("it walks while one joins", |client| place(client, id)[0] > from + 2.0);
        // One of the first two nodes computed it. A node that ends leaves its checkpoint.
        served.nodes.remove(0);
        let from = place(&served.client, id)[0];
        served.until("it walks on", |client| place(client, id)[0] > from + 4.0);
        assert!((place(&served.client, id)[1] - STANDS_M).abs() < 0.05);
    }
}

#[test]
fn a_servers_program_has_characters_too_and_a_client_only_some() {
    let mut served = served();
    let guard = walker(&mut served.server, [-2.0, 1.0, 0.3]);
    go(&mut served.server, guard, [2.0, 0.0, 0.0]);
    served
        .until("the guard is at the wall", |client| client.contains(guard) && place(client, guard)[0] > 3.6);
    for i in 0..33 {
        walker(&mut served.client, [-20.0 + f64::from(i), 1.0, -10.0]);
    }
    let mut refusals = Vec::new();
    served.until("one is refused", |client| {
        refusals.extend(client.changes().iter().filter_map(|change| match change {
            dcd::BodyChange::Refused { why, .. } => Some(*why),
            _ => None,
        }));
        !refusals.is_empty() && client.movable_count() == 33
    });
    assert_eq!(refusals, [Refusal::Costly(Costs::Characters)]);
}
