//! Tests what a server's program builds, moves and removes in a world that runs, and what it cannot do.

use dcd::{Instead, Push, Tick};
use rapier3d::parry::utils::Array2;

use super::*;

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

    // A platform carries a box from one region into the other.
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

    // A box is thrown from one region into the other, and spun by a push beside its centre.
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
fn terrain_that_a_program_digs_for_long_is_forgotten_and_comes_back_when_it_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let _first = node(&server);
    let mut client = client(&server);
    let field = |depth: u8| {
        let mut heights = Array2::new(260, 260, vec![0.0; 260 * 260]);
        heights[(0, 0)] = -0.1 * f32::from(depth);
        ColliderBuilder::heightfield(heights, Vector::new(40.0, 1.0, 40.0))
    };
    let ball = RigidBodyBuilder::dynamic().translation(Vector::new(3.0, 0.5, 2.0));
    let ball = server.insert(ball, ColliderBuilder::ball(0.5)).unwrap();
    let mut ground = server.insert(RigidBodyBuilder::fixed(), field(0)).unwrap();
    let first = server.record(ground).unwrap().traits.colliders[0].shape;
    let mut second = None;
    for dug in 1..=40 {
        let next = server.insert(RigidBodyBuilder::fixed(), field(dug)).unwrap();
        server.remove(ground).unwrap();
        until("it is dug", &mut [&mut server, &mut client], |worlds| {
            worlds[1].contains(next) && !worlds[1].contains(ground)
        });
        ground = next;
        if dug == 25 {
            second = Some(node(&server));
        }
    }
    let mut second = second.expect("it came late");
    let tick = server.tick();
    until("who came late computes", &mut [&mut server, &mut second], |worlds| worlds[1].tick().0 > tick.0);
    // All terrain ever made would be 10.8 MB.
    let mut late = self::client(&server);
    until("its traffic is counted", &mut [&mut late], |worlds| worlds[0].traffic().bytes_in > 270_400);
    let told = late.traffic().bytes_in;
    assert!((270_400..6 << 20).contains(&told), "who joins late is told {told} bytes");
    let stands = |world: &World| (world.pose(ball).unwrap().translation[1] - 0.5).abs() < 0.05;
    assert!(stands(&client) && stands(&server), "there is no hole");

    let again = server.insert(RigidBodyBuilder::fixed(), field(0)).unwrap();
    server.remove(ground).unwrap();
    until("it is there again", &mut [&mut server, &mut client], |worlds| {
        worlds[1].contains(again) && !worlds[1].contains(ground)
    });
    assert_eq!(server.record(again).unwrap().traits.colliders[0].shape, first);
    assert!(client.shape(again).is_some() && server.shape(again).is_some());
    let tick = server.tick();
    until("it goes on", &mut [&mut server, &mut client], |worlds| worlds[0].tick().0 > tick.0 + 60);
    assert!(stands(&client) && stands(&server));
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
    // Only a process that computes can ask at once. A server submits its queries.
    let Err(Error::Unsupported(refused)) = server.queries().map(drop) else { panic!("it computes nothing") };
    assert_eq!(refused.instead, Instead::SubmitQuery);
}
