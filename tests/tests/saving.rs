//! Tests that a server saves the world that its nodes compute, and goes back to it. Uses real QUIC, with
//! nodes and clients in this process.

use std::time::{Duration, Instant};

use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;
use dcd::protocol::Pace;
use dcd::{Axis, BodyChange, Instead, StepSettings, Tick, Unsupported};

const LIMIT: Duration = Duration::from_secs(30);
const G: f32 = 9.81;

fn cut() -> WorldConfig {
    WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() }
}

fn join(server: &World, role: JoinRole) -> JoinConfig {
    JoinConfig::new(server.address().unwrap(), server.token(role, LIMIT).unwrap())
}

fn node(server: &World) -> World {
    World::join_as_node(&join(server, JoinRole::Node)).unwrap()
}

/// Returns a world with ground, a heap that collapses over the border, and a pendulum of two balls that
/// swings across it; and the first box and the two balls.
fn game() -> (World, [BodyId; 3]) {
    let mut world = World::new(cut()).unwrap();
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let mut boxes = (0..24).map(|i| {
        let at = Vector::new((i % 3) as f32 * 1.1 - 1.2, 1.2 + (i / 3) as f32 * 1.1, 0.07 * i as f32);
        let body = RigidBodyBuilder::dynamic().translation(at);
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.4, 0.5)).unwrap()
    });
    let first = boxes.next().unwrap();
    boxes.for_each(drop);
    let mut ball = |body: RigidBodyBuilder, x: f32| {
        let body = body.translation(Vector::new(x, 6.0, -8.0));
        world.insert(body, ColliderBuilder::ball(0.3)).unwrap()
    };
    let post = ball(RigidBodyBuilder::fixed(), 0.0);
    let [bob, weight] = [3.0, 4.0].map(|x| ball(RigidBodyBuilder::dynamic(), x));
    let rope = |length: f32| SphericalJointBuilder::new().local_anchor2(Vector::X * -length);
    world.insert_joint(post, bob, rope(3.0)).unwrap();
    world.insert_joint(bob, weight, rope(1.0)).unwrap();
    (world, [first, bob, weight])
}

fn distance_m(world: &World, a: BodyId, b: BodyId) -> f64 {
    let [a, b] = [a, b].map(|id| world.pose(id).unwrap().translation);
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn place(world: &World, id: BodyId) -> [f64; 3] {
    world.pose(id).unwrap().translation
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

fn refused<T: std::fmt::Debug>(result: Result<T, dcd::Error>) -> Unsupported {
    match result {
        Err(dcd::Error::Unsupported(refusal)) => refusal,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_copy_is_served_without_its_source() {
    let (mut local, _) = game();
    let folder = tempfile::tempdir().unwrap();
    let serve = local.copy_to_serve().unwrap();
    // The source goes on, and ends, before the copy is served.
    local.step().unwrap();
    let bodies = local.movable_bodies().count();
    drop(local);
    let mut server = serve(ServeConfig { nodes: 1, ..ServeConfig::new(folder.path()) }).unwrap();
    let _node = node(&server);
    until("it is computed", &mut [&mut server], |worlds| worlds[0].tick() > Tick(5));
    assert_eq!(server.movable_bodies().count(), bodies);
}

#[test]
fn a_save_is_the_world_after_one_tick_to_the_bit() {
    let (mut local, _) = game();
    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig { nodes: 2, pace: Pace::Unpaced, ..ServeConfig::new(folder.path()) };
    let mut server = local.serve_copy(config).unwrap();
    let _nodes = [node(&server), node(&server)];
    until("the heap collapses", &mut [&mut server], |worlds| worlds[0].tick() > Tick(40));
    let mut bytes = Vec::new();
    server.save(&mut bytes).unwrap();
    let saved = World::restore(&bytes[..], 1).unwrap();
    assert!(saved.tick() > Tick(40) && saved.region_count() == 2, "{:?}", saved.tick());
    while local.tick() < saved.tick() {
        local.step().unwrap();
    }
    assert_eq!(saved.state_hash().unwrap(), local.state_hash().unwrap());
    let tick = server.tick();
    until("it goes on", &mut [&mut server], |worlds| worlds[0].tick() > Tick(tick.0 + 60));
}

#[test]
fn a_game_goes_back_for_its_clients_with_all_that_came_and_went() {
    let (local, [first, bob, weight]) = game();
    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig { nodes: 2, ..ServeConfig::new(folder.path()) };
    let mut server = local.serve_copy(config).unwrap();
    let _nodes = [node(&server), node(&server)];
    let mut client = World::connect(&join(&server, JoinRole::Client)).unwrap();
    let ball = || ColliderBuilder::ball(0.4);
    let early = client.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 12.0), ball()).unwrap();
    until("the pendulum swings by", &mut [&mut server, &mut client], |worlds| {
        let is_past = |world: &World| world.pose(weight).is_some_and(|pose| pose.translation[0] < -1.0);
        is_past(worlds[1]) && worlds[1].contains(early)
    });
    let path = folder.path().join("half.dcd");
    server.save_file(&path).unwrap();
    let mut saved = World::restore_file(&path, 1).unwrap();
    let stood = place(&saved, early);
    assert!((distance_m(&saved, bob, weight) - 1.0).abs() < 0.01, "the rope was saved at one moment");
    assert_eq!((saved.joints_of(weight).len(), saved.contains(early)), (1, true));

    // Meanwhile, bodies come and go.
    let late = client.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 15.0), ball()).unwrap();
    let new = server.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 20.0), ball()).unwrap();
    server.remove(first).unwrap();
    server.remove(weight).unwrap();
    client.set_velocity(early, Velocity::linear([0.0, 0.0, 6.0])).unwrap();
    until("the game is another", &mut [&mut server, &mut client], |worlds| {
        let client = &worlds[1];
        client.contains(new) && client.contains(late) && !client.contains(weight) && !client.contains(first)
    });
    server.insert(RigidBodyBuilder::dynamic(), ball()).unwrap();
    server.reload_file(&path).unwrap();
    assert_eq!(place(&server, first), place(&saved, first));
    assert!(!server.contains(new), "it came later");
    assert!(server.contains(late), "it is its client's");
    assert_eq!(place(&server, early), stood);
    until("the client is where it was", &mut [&mut server, &mut client], |worlds| {
        let client = &worlds[1];
        client.contains(weight) && client.contains(first) && !client.contains(new) && client.contains(late)
    });
    // It goes on as a local world does from there, but without what Rapier remembers of contacts.
    for _ in 0..120 {
        saved.step().unwrap();
    }
    let is_there = |world: &World, id| {
        let (now, then) = (place(world, id), place(&saved, id));
        (0..3).all(|i| (now[i] - then[i]).abs() < 0.3)
    };
    until("it goes on", &mut [&mut server, &mut client], |worlds| {
        is_there(worlds[1], first) && (distance_m(worlds[1], bob, weight) - 1.0).abs() < 0.05
    });
    let next = server.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 20.0), ball()).unwrap();
    assert!(next.index() > new.index(), "{next} is no id that was given");
    until("the program goes on, too", &mut [&mut server, &mut client], |worlds| worlds[1].contains(next));
    client.set_velocity(late, Velocity::linear([4.0, 0.0, 0.0])).unwrap();
    let x = place(&client, late)[0];
    until("and the avatar obeys", &mut [&mut server, &mut client], |worlds| {
        place(worlds[1], late)[0] > x + 1.0
    });
}

#[test]
fn a_body_that_goes_and_comes_again_between_two_steps_is_told_in_that_order() {
    let (local, [first, ..]) = game();
    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig { nodes: 1, ..ServeConfig::new(folder.path()) };
    let mut server = local.serve_copy(config).unwrap();
    let _node = node(&server);
    let [mut stalls, mut watches] =
        [(); 2].map(|()| World::connect(&join(&server, JoinRole::Client)).unwrap());
    until("both see it", &mut [&mut server, &mut stalls, &mut watches], |worlds| {
        worlds.iter().all(|world| world.contains(first))
    });
    let mut saved = Vec::new();
    server.save(&mut saved).unwrap();
    server.remove(first).unwrap();
    until("it is gone", &mut [&mut server, &mut watches], |worlds| !worlds[1].contains(first));
    server.reload(&saved[..]).unwrap();
    let goes_on = server.tick().0 + 30;
    until("it is back", &mut [&mut server, &mut watches], |worlds| {
        worlds[1].contains(first) && worlds[1].tick() > Tick(goes_on)
    });
    let mut told = Vec::new();
    until("the other hears of both", &mut [&mut stalls], |worlds| {
        let of_it = |change: &&BodyChange| matches!(change, BodyChange::Appeared(id) | BodyChange::Removed { body: id, .. } if *id == first);
        told.extend(worlds[0].changes().iter().filter(of_it).copied());
        told.len() > 1
    });
    assert!(matches!(told[..], [BodyChange::Removed { .. }, BodyChange::Appeared(_)]), "{told:?}");
    assert!(stalls.contains(first));
}

#[test]
fn a_world_becomes_another_that_was_made_elsewhere() {
    let (local, _) = game();
    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig { nodes: 1, ..ServeConfig::new(folder.path()) };
    let mut server = local.serve_copy(config).unwrap();
    let _node = node(&server);
    let mut client = World::connect(&join(&server, JoinRole::Client)).unwrap();
    until("the first level runs", &mut [&mut server, &mut client], |worlds| {
        worlds.iter().all(|world| world.tick() > Tick(5))
    });
    let level = |step: StepSettings| {
        let mut level = World::new(WorldConfig { step, ..cut() }).unwrap();
        let lift = RigidBodyBuilder::fixed().translation(Vector::Y * 4.0);
        level.insert(lift, ColliderBuilder::cuboid(5.0, 0.5, 5.0)).unwrap();
        let body = RigidBodyBuilder::dynamic().translation(Vector::Y * 7.0);
        let id = level.insert(body, ColliderBuilder::cylinder(0.5, 0.5)).unwrap();
        let mut bytes = Vec::new();
        level.save(&mut bytes).unwrap();
        (id, bytes)
    };
    let step = StepSettings { gravity: [0.0, -2.0 * G, 0.0], ..StepSettings::default() };
    let refusal = server.reload(&level(step).1[..]).unwrap_err().to_string();
    assert!(refusal.contains("19.62") && refusal.contains("a world of its own"), "{refusal}");
    let tick = server.tick();
    let (id, bytes) = level(StepSettings::default());
    server.reload(&bytes[..]).unwrap();
    until("the client sees the second", &mut [&mut server, &mut client], |worlds| {
        worlds[1].movable_count() == 1 && worlds[1].pose(id).is_some_and(|at| at.translation[1] < 5.02)
    });
    assert!((place(&client, id)[1] - 5.0).abs() < 0.02, "it stands on what was ground elsewhere");
    assert!(server.tick() > tick, "ticks go on");
}

#[test]
fn who_has_no_world_to_save_says_who_has() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = game().0.serve_copy(ServeConfig::new(folder.path())).unwrap();
    // Before anybody computes the world, the record is all that there is.
    let mut bytes = Vec::new();
    server.save(&mut bytes).unwrap();
    assert_eq!(World::restore(&bytes[..], 1).unwrap().movable_count(), 26);
    let mut node = node(&server);
    let mut client = World::connect(&join(&server, JoinRole::Client)).unwrap();
    assert_eq!(refused(client.save(Vec::new())).instead, Instead::ServerKeeps);
    assert_eq!(refused(client.reload(&bytes[..])).instead, Instead::ServerKeeps);
    assert_eq!(refused(node.reload(&bytes[..])).instead, Instead::ServerKeeps);
    let damaged = server.reload(&bytes[..bytes.len() / 2]).unwrap_err().to_string();
    assert!(damaged.contains("cut off"), "{damaged}");
    server.suspend().unwrap();
    assert!(server.save(Vec::new()).unwrap_err().to_string().contains("has stopped"));
}
