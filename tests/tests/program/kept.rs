//! Tests that what a server's program made and changed outlives the nodes and the server.

use dcd::{Instead, Tick};

use super::*;

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
    assert!(server.step().unwrap_err().to_string().contains("the world is kept"));
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
fn a_servers_program_changes_what_bodies_and_joints_are_and_whoever_computes_them_next_knows() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let first = node(&server);
    let mut client = client(&server);
    until("the world runs", &mut [&mut server, &mut client], |worlds| worlds[0].tick() > Tick(0));
    let bodies = build(&mut server);
    let [ground, falling, weight] = [bodies[0], bodies[1], bodies[23]];
    server.update(falling, |body| body.set_gravity_scale(-1.0, true)).unwrap();
    until("it falls upwards", &mut [&mut server, &mut client], |worlds| {
        worlds[1].pose(falling).is_some_and(|pose| pose.translation[1] > 8.0)
    });
    let lies = bodies[2];
    server.update_collider(lies, |collider| collider.set_sensor(true)).unwrap();
    server.step().unwrap();
    // This builds on a change of the step before, whether the server has that on record yet or not.
    server.update(lies, |body| body.user_data = 77).unwrap();
    assert_eq!(server.body(lies).unwrap().user_data, 77, "what was done is seen at once");
    until("a sensor falls through the ground", &mut [&mut server, &mut client], |worlds| {
        worlds[1].body(lies).is_some_and(|body| body.pose.translation[1] < -3.0 && body.user_data == 77)
    });
    let rope = server.joints_of(weight)[0];
    server.update_joint(rope, |joint| joint.set_enabled(false)).unwrap();
    assert!(!server.joint(rope).unwrap().enabled);
    until("the weight falls off", &mut [&mut server, &mut client], |worlds| {
        worlds[1].pose(weight).is_some_and(|pose| pose.translation[1] < 1.0)
    });

    // A refused change has no effect, and its error says what to do.
    let refused = |result: Result<(), Error>| match result {
        Err(Error::Unsupported(refused)) => refused.instead,
        other => panic!("{other:?}"),
    };
    let moving = server.update(lies, |body| body.set_linvel(Vector::Y, true));
    assert_eq!(refused(moving), Instead::MoveByName);
    let fixing = server.update(lies, |body| body.set_body_type(RigidBodyType::Fixed, true));
    assert_eq!(refused(fixing), Instead::InsertAnew);
    assert_eq!(refused(server.update(ground, |body| body.user_data = 1)), Instead::InsertAnew);
    let shape = server.update_collider(lies, |collider| collider.set_shape(SharedShape::ball(1.0)));
    assert_eq!(refused(shape), Instead::InsertAnew);
    let text = |result: Result<(), Error>| result.unwrap_err().to_string();
    assert!(
        text(server.update(lies, |body| body.set_gravity_scale(f32::NAN, true))).contains("gravity_scale")
    );
    assert!(text(server.update_collider((lies, 3), |_| {})).contains("collider"));
    assert_eq!(refused(client.update(lies, |_| {})), Instead::DriveAvatars);

    // A node that dies takes none of this with it, whether it knew of the change or not; nor does a server
    // that begins again.
    let last = bodies[3];
    drop(first);
    server.update(last, |body| body.set_gravity_scale(-0.5, true)).unwrap();
    server.step().unwrap();
    let second = node(&server);
    until("another box falls upwards", &mut [&mut server], |worlds| {
        worlds[0].pose(last).is_some_and(|pose| pose.translation[1] > 8.0)
    });
    drop(second);
    server.suspend().unwrap();
    drop((server, client));
    let mut server = serve(ServeConfig::new(folder.path()));
    assert_eq!(server.body(lies).unwrap().user_data, 77);
    assert!(!server.joint(rope).unwrap().enabled);
    let height = server.pose(last).unwrap().translation[1];
    let _third = node(&server);
    until("it falls upwards still", &mut [&mut server], |worlds| {
        worlds[0].pose(last).is_some_and(|pose| pose.translation[1] > height + 5.0)
    });
}
