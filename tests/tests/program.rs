//! Tests the program of a server, which builds, moves and clears away what is in its world: real QUIC, nodes and clients in this
//! process.

use std::time::{Duration, Instant};

use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;
use dcd::protocol::Pace;
use dcd::{Axis, Instead, Push, Tick};

const LIMIT: Duration = Duration::from_secs(30);

fn cut() -> WorldConfig {
    WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() }
}

/// An empty world in two regions.
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

/// Steps both until it is so.
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

/// Ground, twenty boxes on both sides of the border, and a pendulum that swings across it.
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

fn bits(world: &World, bodies: &[BodyId]) -> Vec<[u64; 3]> {
    bodies.iter().map(|&id| world.pose(id).unwrap().translation.map(f64::to_bits)).collect()
}

#[test]
fn what_is_built_before_the_first_tick_is_a_local_world_to_the_bit() {
    const TICKS: u64 = 150;
    let mut local = World::new(cut()).unwrap();
    let expected = build(&mut local);
    (0..TICKS).for_each(|_| local.step().unwrap());

    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig {
        nodes: 2,
        pace: Pace::Unpaced,
        last_tick: Some(Tick(TICKS)),
        ..ServeConfig::new(folder.path())
    };
    let mut server = serve(config);
    let bodies = build(&mut server);
    assert_eq!(bodies, expected, "ids are counted as in a local world");
    server.step().unwrap();
    let _nodes = [node(&server), node(&server)];
    let deadline = Instant::now() + LIMIT;
    while server.step().is_ok() {
        assert!(Instant::now() < deadline, "it ends by itself");
        server.poll(Duration::from_millis(5));
    }
    assert_eq!(server.tick(), Tick(TICKS));
    assert_eq!(bits(&server, &bodies), bits(&local, &bodies));
}

#[test]
fn a_program_builds_a_game_in_an_empty_world_that_runs_and_clients_see_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { nodes: 2, ..ServeConfig::new(folder.path()) });
    let _nodes = [node(&server), node(&server)];
    let mut client = client(&server);
    until("the world runs", &mut [&mut server], |worlds| worlds[0].tick() > Tick(0));

    let bodies = build(&mut server);
    let [first, ground, weight] = [bodies[1], bodies[0], bodies[23]];
    assert!(server.contains(first) && server.joints_of(weight).len() == 1, "what was done is seen at once");
    until("the client sees all", &mut [&mut server, &mut client], |worlds| {
        bodies.iter().all(|&id| worlds[1].contains(id))
    });
    until("boxes have fallen on the ground", &mut [&mut server, &mut client], |worlds| {
        worlds.iter().all(|world| world.pose(first).is_some_and(|pose| pose.translation[1] < 1.02))
    });
    let swings = |world: &World| world.pose(weight).is_some_and(|pose| pose.translation[0] < -1.0);
    until("the pendulum crosses the border in one piece", &mut [&mut server, &mut client], |worlds| {
        swings(worlds[1])
    });

    // A platform that carries a box from one region into the other.
    let platform = RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(-6.0, 1.0, 9.0));
    let platform = server.insert(platform, ColliderBuilder::cuboid(2.0, 0.25, 2.0)).unwrap();
    let cargo = RigidBodyBuilder::dynamic().translation(Vector::new(-6.0, 1.76, 9.0));
    let cargo = server.insert(cargo, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
    server.step().unwrap();
    server.set_velocity(platform, Velocity::linear([3.0, 0.0, 0.0])).unwrap();
    until("the cargo is carried across", &mut [&mut server, &mut client], |worlds| {
        worlds[1].pose(cargo).is_some_and(|pose| pose.translation[0] > 3.0)
    });
    let height = client.pose(cargo).unwrap().translation[1];
    assert!((height - 1.75).abs() < 0.05, "it rides, at {height}");

    server.set_pose(first, WorldPose::at([8.0, 30.0, 8.0])).unwrap();
    until("a box is up in the air", &mut [&mut server, &mut client], |worlds| {
        worlds[1].pose(first).is_some_and(|pose| pose.translation[1] > 20.0)
    });

    // Thrown from one region into the other, and spun by a push beside its centre.
    let thrown = bodies[21 - 1];
    let place = server.pose(thrown).unwrap().translation;
    server.push(&Push::impulse(thrown, [-8.0, 8.0, 0.0]).at([place[0], place[1], place[2] + 0.25])).unwrap();
    until("a box flies and spins", &mut [&mut server, &mut client], |worlds| {
        let body = worlds[1].body(thrown).unwrap();
        body.velocity.linear[0] < -2.0 && body.velocity.angular.iter().any(|v| v.abs() > 0.5)
    });
    server.push(&Push::force(thrown, [0.0, 30.0, 0.0], [0.0; 3])).unwrap();
    until("a force lifts it on and on", &mut [&mut server, &mut client], |worlds| {
        worlds[1].pose(thrown).is_some_and(|pose| pose.translation[1] > 12.0)
    });
    server.push(&Push::force(thrown, [0.0; 3], [0.0; 3])).unwrap();

    let cut = server.joints_of(weight)[0];
    server.remove_joint(cut).unwrap();
    until("the weight falls off", &mut [&mut server, &mut client], |worlds| {
        worlds[1].pose(weight).is_some_and(|pose| pose.translation[1] < 1.0)
    });
    server.remove(platform).unwrap();
    server.remove(ground).unwrap();
    assert!(!server.contains(ground) && !server.contains(platform));
    until("nothing holds the boxes any more", &mut [&mut server, &mut client], |worlds| {
        let falls =
            bodies[2..21].iter().all(|&id| worlds[1].pose(id).is_some_and(|pose| pose.translation[1] < -5.0));
        falls && !worlds[1].contains(ground) && !worlds[1].contains(platform)
    });
}

#[test]
fn what_a_program_made_outlives_its_nodes_and_its_server_and_no_id_comes_twice() {
    let folder = tempfile::tempdir().unwrap();
    let config = || ServeConfig::new(folder.path());
    let mut server = serve(config());
    let mut first = node(&server);
    until("the world runs", &mut [&mut server, &mut first], |worlds| worlds[0].tick() > Tick(0));
    let bodies = build(&mut server);
    let gone = *bodies.last().unwrap();
    server.step().unwrap();
    server.remove(gone).unwrap();
    until("it is gone", &mut [&mut server, &mut first], |worlds| {
        !worlds[0].contains(gone) && worlds[0].pose(bodies[1]).is_some_and(|pose| pose.translation[1] < 1.05)
    });
    drop(first);
    let second = node(&server);
    let tick = server.tick();
    until("another node goes on", &mut [&mut server], |worlds| worlds[0].tick().0 > tick.0 + 30);
    drop(second);
    server.suspend().unwrap();
    assert!(server.step().unwrap_err().to_string().contains("its data folder keeps the world"));
    drop(server);

    let mut server = serve(config());
    assert!(bodies[..23].iter().all(|&id| server.contains(id)) && !server.contains(gone));
    let height = server.pose(bodies[1]).unwrap().translation[1];
    assert!((height - 1.0).abs() < 0.05, "it has not fallen anew: {height}");
    let ball = RigidBodyBuilder::dynamic().translation(Vector::new(9.0, 3.0, 9.0));
    let new = server.insert(ball, ColliderBuilder::ball(0.5)).unwrap();
    assert_eq!(new.index(), gone.index() + 1);
    let mut third = node(&server);
    until("the ball lands", &mut [&mut server, &mut third], |worlds| {
        worlds[0].pose(new).is_some_and(|pose| pose.translation[1] < 1.1)
    });
}

#[test]
fn what_a_program_cannot_do_is_refused_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let bodies = build(&mut server);
    let (ground, first, second) = (bodies[0], bodies[1], bodies[2]);
    let text = |error: Result<(), Error>| error.unwrap_err().to_string();
    assert!(text(server.push(&Push::impulse(first, [f32::NAN; 3]))).contains("finite"));
    assert!(text(server.push(&Push::impulse(ground, [1.0; 3]))).contains("set its velocity"));
    let far = WorldPose::at([f64::NAN, 0.0, 0.0]);
    assert!(text(server.set_pose(first, far)).contains("finite and within 1e9 m"));
    assert!(text(server.set_velocity(first, Velocity::linear([f32::INFINITY; 3]))).contains("finite"));
    assert!(text(server.set_pose(ground, WorldPose::default())).contains("remove it and insert it"));
    let greedy = RigidBodyBuilder::dynamic().additional_solver_iterations(2_000);
    assert!(text(server.insert(greedy, ColliderBuilder::ball(0.5)).map(drop)).contains("at most 1000"));
    server.step().unwrap();
    let rope = || SphericalJointBuilder::new();
    assert!(text(server.insert_joint(first, second, rope()).map(drop)).contains("before the next step"));
    server.remove(first).unwrap();
    assert!(text(server.remove(first)).contains("is not in the world"));
    assert!(text(server.set_velocity(first, Velocity::default())).contains("is not in the world"));
    // A ray is for those who compute, or for clients.
    let Err(Error::Unsupported(refused)) = server.queries().map(drop) else { panic!("it computes nothing") };
    assert_eq!(refused.instead, Instead::ComputeAlone);
}
