//! Tests clients that may build: within bounds they change a world that nodes compute, as the server's
//! program does. Uses real QUIC, with nodes and clients in this process.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use dcd::network::{ConnectionChange, JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;
use dcd::protocol::{Area, BodyRecord, BuildOp, Character, Query, RayQuery, Refusal, ShapeRecord};
use dcd::runtime::ClientWorld;
use dcd::{Axis, BodyChange, Instead, Push, Role, Tick};

const LIMIT: Duration = Duration::from_secs(30);

/// Serves an empty world in two regions.
fn serve(config: ServeConfig) -> World {
    let cut =
        WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() };
    World::new(cut).unwrap().serve_copy(config).unwrap()
}

fn join(server: &World, role: JoinRole) -> JoinConfig {
    JoinConfig::new(server.address().unwrap(), server.token(role, LIMIT).unwrap())
}

fn node(server: &World) -> World {
    World::join_as_node(&join(server, JoinRole::Node)).unwrap()
}

fn connected(server: &World, role: JoinRole) -> World {
    World::connect(&join(server, role)).unwrap()
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

fn y(world: &World, id: BodyId) -> f64 {
    world.pose(id).map_or(f64::NAN, |pose| pose.translation[1])
}

#[test]
fn a_builder_changes_a_running_world_as_its_program_does_and_others_see_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { nodes: 2, ..ServeConfig::new(folder.path()) });
    let _nodes = [node(&server), node(&server)];
    let post = RigidBodyBuilder::fixed().translation(Vector::new(0.0, 6.0, -8.0));
    let post = server.insert(post, ColliderBuilder::ball(0.1)).unwrap();
    let mut builder = connected(&server, JoinRole::Builder);
    let mut client = connected(&server, JoinRole::Client);
    assert_eq!((builder.role(), client.role()), (Role::Builder, Role::Client));
    let all: &mut [&mut World] = &mut [&mut server, &mut builder, &mut client];
    until("the world runs", all, |worlds| worlds[0].tick() > Tick(0) && worlds[1].contains(post));

    let ground = RigidBodyBuilder::fixed();
    let ground = builder.insert(ground, ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let cube = RigidBodyBuilder::dynamic().translation(Vector::new(-3.0, 2.0, 0.0)).user_data(7);
    let cube = builder.insert(cube, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
    let bob = RigidBodyBuilder::dynamic().translation(Vector::new(3.0, 6.0, -8.0));
    let bob = builder.insert(bob, ColliderBuilder::ball(0.3)).unwrap();
    let rope = SphericalJointBuilder::new().local_anchor2(Vector::X * -3.0);
    let rope = builder.insert_joint(post, bob, rope).unwrap();
    assert_eq!(cube.builder(), builder.client());
    assert_eq!(
        (cube.client(), builder.user_data(cube)),
        (None, Some(7)),
        "it is there at once, and nobody's"
    );
    assert_eq!(builder.joints_of(bob), [rope]);
    let all: &mut [&mut World] = &mut [&mut server, &mut builder, &mut client];
    until("the cube has fallen on the ground", all, |worlds| {
        worlds.iter().all(|world| y(world, cube) < 1.02 && world.contains(ground))
    });
    until("the pendulum swings across the border", all, |worlds| {
        worlds[2].pose(bob).is_some_and(|pose| pose.translation[0] < -1.0)
    });

    // It is pushed, moved, and changed.
    builder.push(&Push::impulse(cube, [0.0, 12.0, 0.0])).unwrap();
    until("the cube flies", &mut [&mut server, &mut builder, &mut client], |worlds| y(worlds[2], cube) > 3.0);
    builder.update(cube, |cube| cube.set_gravity_scale(0.0, true)).unwrap();
    builder.set_pose(cube, WorldPose::at([4.0, 9.0, 4.0])).unwrap();
    builder.set_velocity(cube, Velocity::linear([-3.0, 0.0, 0.0])).unwrap();
    until("it hovers across the border", &mut [&mut server, &mut builder, &mut client], |worlds| {
        let pose = worlds[2].pose(cube).unwrap();
        pose.translation[0] < -2.0 && (pose.translation[1] - 9.0).abs() < 0.1
    });
    builder.remove_joint(rope).unwrap();
    assert_eq!(builder.joints_of(bob), []);
    until("the bob falls off", &mut [&mut server, &mut builder, &mut client], |worlds| {
        y(worlds[2], bob) < 1.0 && worlds[0].joints_of(bob).is_empty()
    });
    // A builder may also remove what the server's program made.
    builder.remove(post).unwrap();
    builder.remove(cube).unwrap();
    assert!(!builder.contains(post) && !builder.contains(cube));
    until("both are gone", &mut [&mut server, &mut builder, &mut client], |worlds| {
        worlds.iter().all(|world| !world.contains(post) && !world.contains(cube))
    });
    assert!(!builder.changes().iter().any(|change| matches!(change, BodyChange::Refused { .. })));

    // A character is an avatar, as that of any client.
    let (at, capsule) = (WorldPose::at([5.0, 1.5, 5.0]), ColliderBuilder::capsule_y(0.5, 0.3));
    let body = RigidBodyBuilder::kinematic_velocity_based();
    let person = builder.insert_character(at, &Character::default(), body, [capsule]).unwrap();
    assert_eq!(person.client(), builder.client());
    until("it is there", &mut [&mut server, &mut builder, &mut client], |worlds| worlds[2].contains(person));
    let refused = client.set_velocity(person, Velocity::default()).unwrap_err().to_string();
    assert!(refused.contains("own avatars"), "{refused}");
    let avatar = client.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.2)).unwrap();
    until("it is there", &mut [&mut server, &mut builder, &mut client], |worlds| worlds[1].contains(avatar));
    let refused = builder.remove(avatar).unwrap_err().to_string();
    assert!(refused.contains("own avatars"), "{refused}");
    let fixed = client.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.2)).unwrap_err();
    let Error::Unsupported(unsupported) = fixed else { panic!("{fixed}") };
    assert_eq!(unsupported.instead, Instead::FixedInScene);
    assert!(unsupported.to_string().contains("JoinRole::Builder"), "{unsupported}");
}

/// Values that no process accepts are refused at the call: sent to other processes, they would break the link
/// again and again.
#[test]
fn what_cannot_be_is_refused_at_the_call_in_every_role() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path().join("data")));
    let mut node = node(&server);
    let mut client = connected(&server, JoinRole::Client);
    let avatar = client.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.2)).unwrap();
    until("it is there", &mut [&mut server, &mut node, &mut client], |worlds| worlds[2].contains(avatar));
    let nowhere = WorldPose { rotation: [0.0; 4], ..WorldPose::at([1.0; 3]) };
    let ray = |direction| RayQuery::new([0.0; 3], direction);
    let aimless = || Query::rays([ray([0.0; 3])]);
    let many = || Query::rays(vec![ray([1.0, 0.0, 0.0]); 1_025]);
    let area = |radius_m| Some(Area { centre: [0.0; 3], radius_m });
    let refusals = [
        client.set_pose(avatar, nowhere).unwrap_err(),
        client.set_velocity(avatar, Velocity::linear([f32::NAN, 0.0, 0.0])).unwrap_err(),
        client.insert_at(nowhere, RigidBodyBuilder::dynamic(), [ColliderBuilder::ball(0.2)]).unwrap_err(),
        client.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.2).friction(-1.0)).unwrap_err(),
        client.submit(aimless()).unwrap_err(),
        client.submit(many()).unwrap_err(),
        client.set_interest(area(0.0)).unwrap_err(),
        client.set_interest(area(f64::NAN)).unwrap_err(),
        server.submit(aimless()).unwrap_err(),
        server.submit(many()).unwrap_err(),
    ];
    for refused in refusals {
        assert!(!refused.to_string().is_empty(), "{refused:?}");
    }
    client.remove(avatar).unwrap();
    assert!(client.remove(avatar).unwrap_err().to_string().contains(&avatar.to_string()));
    // All links still hold.
    let tick = client.tick();
    let mut broken = 0;
    until("time goes on", &mut [&mut server, &mut node, &mut client], |worlds| {
        let events = worlds.iter().flat_map(|world| world.connection_events());
        broken += events.filter(|event| !matches!(event.change, ConnectionChange::Came)).count();
        worlds[2].tick().0 > tick.0 + 60
    });
    assert_eq!(broken, 0);
}

#[test]
fn what_a_builder_made_outlives_it_its_nodes_and_the_server_and_it_goes_on_under_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let config = || ServeConfig::new(folder.path().join("data"));
    let mut server = serve(config());
    let mut first = node(&server);
    let identity = folder.path().join("builder.pem");
    let rejoin = |server: &World| {
        let config = JoinConfig { identity: Some(identity.clone()), ..join(server, JoinRole::Builder) };
        World::connect(&config).unwrap()
    };
    let mut builder = rejoin(&server);
    let ground = builder.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let place = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 2.0, 0.0));
    let mut boxes = Vec::new();
    for i in 0..300 {
        let at = place((i % 20) as f32 - 10.0).translation(Vector::new(
            (i % 20) as f32 - 10.0,
            1.0,
            (i / 20) as f32 - 8.0,
        ));
        boxes.push(builder.insert(at, ColliderBuilder::cuboid(0.25, 0.25, 0.25)).unwrap());
    }
    let last = *boxes.last().unwrap();
    until("all lie", &mut [&mut builder, &mut server, &mut first], |worlds| {
        worlds.iter().take(2).all(|world| boxes.iter().all(|&id| y(world, id) < 0.8))
    });
    drop(builder);
    drop(first);
    server.suspend().unwrap();
    drop(server);

    let mut server = serve(config());
    assert!(boxes.iter().all(|&id| server.contains(id)) && server.contains(ground));
    let mut second = node(&server);
    let mut client = connected(&server, JoinRole::Client);
    let mut builder = rejoin(&server);
    let new = builder.insert(place(0.0), ColliderBuilder::ball(0.25)).unwrap();
    assert_eq!((new.builder(), new.index()), (last.builder(), last.index() + 1), "no name comes twice");
    builder.remove(last).unwrap();
    let tick = server.tick();
    until("others see it", &mut [&mut server, &mut second, &mut builder, &mut client], |worlds| {
        worlds[3].contains(new) && !worlds[3].contains(last) && worlds[0].tick() > tick
    });
    assert!(boxes[..299].iter().all(|&id| client.contains(id)));
    let refused = JoinConfig { identity: Some(identity.clone()), ..join(&server, JoinRole::Client) };
    let refused = World::connect(&refused).unwrap_err().to_string();
    assert!(refused.contains("builder"), "a client's token is no builder's: {refused}");
}

#[test]
fn a_builder_sees_a_world_that_another_replaced_or_changed_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let _node = node(&server);
    let floats = || RigidBodyBuilder::dynamic().gravity_scale(0.0);
    let post = server.insert(floats(), ColliderBuilder::ball(0.1)).unwrap();
    let mut builder = connected(&server, JoinRole::Builder);
    let mut client = connected(&server, JoinRole::Client);
    let all: &mut [&mut World] = &mut [&mut server, &mut builder, &mut client];
    until("the world runs", all, |worlds| worlds[0].tick() > Tick(0) && worlds[1].contains(post));
    let mut saved = Vec::new();
    server.save(&mut saved).unwrap();

    // Both change the same body one after the other, and the last change counts for both.
    let damping = |world: &World| world.record(post).unwrap().traits.linear_damping;
    builder.update(post, |post| post.set_linear_damping(0.25)).unwrap();
    until("it is done", &mut [&mut server, &mut builder], |worlds| damping(worlds[0]) == 0.25);
    server.update(post, |post| post.set_linear_damping(0.5)).unwrap();
    until("it is done", &mut [&mut server, &mut builder], |worlds| damping(worlds[1]) == 0.5);
    builder.update(post, |post| post.set_linear_damping(0.75)).unwrap();
    until("it is done", &mut [&mut server, &mut builder], |worlds| damping(worlds[0]) == 0.75);

    builder.remove(post).unwrap();
    builder.step().unwrap();
    until("it is gone", &mut [&mut server, &mut client], |worlds| {
        worlds.iter().all(|world| !world.contains(post))
    });
    server.reload(&saved[..]).unwrap();
    until("it is back", &mut [&mut client, &mut server], |worlds| worlds[0].contains(post));
    until("the builder sees it", &mut [&mut builder, &mut server], |worlds| worlds[0].contains(post));
    let new = builder.insert(floats(), ColliderBuilder::ball(0.1)).unwrap();
    until("it builds on", &mut [&mut builder, &mut client], |worlds| worlds[1].contains(new));
}

#[test]
fn a_server_knows_whose_contact_has_ended_whoever_removed_the_body() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let _node = node(&server);
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let mut builder = connected(&server, JoinRole::Builder);
    let mut client = connected(&server, JoinRole::Client);
    until("the world runs", &mut [&mut server], |worlds| worlds[0].tick() > Tick(0));
    let insert = |world: &mut World, x: f32, user_data: u128| {
        let cube = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.1, 0.0)).user_data(user_data);
        let collider = ColliderBuilder::cuboid(0.5, 0.5, 0.5).active_events(ActiveEvents::COLLISION_EVENTS);
        world.insert(cube, collider).unwrap()
    };
    let cubes = [insert(&mut server, -6.0, 10), insert(&mut builder, 3.0, 20), insert(&mut client, 6.0, 30)];
    let told = |server: &World, began: bool| {
        let touches = server.events().touches.iter().filter(|touch| touch.began == began);
        touches.flat_map(|touch| [touch.key.a, touch.key.b]).collect::<Vec<_>>()
    };
    let mut began = BTreeSet::new();
    until("all touch the ground", &mut [&mut server, &mut builder, &mut client], |worlds| {
        began.extend(told(worlds[0], true));
        cubes.iter().all(|cube| began.contains(cube))
    });
    server.remove(cubes[0]).unwrap();
    builder.remove(cubes[1]).unwrap();
    client.remove(cubes[2]).unwrap();
    let mut ended = BTreeSet::new();
    until("their contacts have ended", &mut [&mut server, &mut builder, &mut client], |worlds| {
        let gone = told(worlds[0], false).into_iter().filter(|id| cubes.contains(id));
        for cube in gone.filter(|&id| !worlds[0].contains(id)) {
            assert!(worlds[0].user_data(cube).is_some_and(|data| data > 0), "{cube}");
            ended.insert(cube);
        }
        ended.len() == 3
    });
    let tick = server.tick();
    until("they are off the record", &mut [&mut server], |worlds| worlds[0].tick().0 > tick.0 + 30);
    assert_eq!(cubes.map(|cube| server.user_data(cube)), [10, 20, 30].map(Some));
}

/// Joins without the checks that keep a client from asking for what it may not.
fn hostile(server: &World, role: JoinRole) -> ClientWorld {
    ClientWorld::connect(&join(server, role)).unwrap()
}

/// Waits for a refusal, or for the end of the link.
fn refusal(client: &ClientWorld) -> Result<Refusal, String> {
    let deadline = Instant::now() + LIMIT;
    loop {
        if let Some((_, refusal)) = client.take_events().refusals.pop() {
            return Ok(refusal);
        }
        client.check().map_err(|error| error.to_string())?;
        assert!(Instant::now() < deadline, "no answer within {LIMIT:?}");
        client.wait_update(client.updates(), Duration::from_millis(5));
    }
}

/// Sends requests until the server cuts the link.
fn flood(client: &ClientWorld, ops: &[BuildOp]) -> String {
    let deadline = Instant::now() + LIMIT;
    while Instant::now() < deadline {
        if let Err(error) = client.check().and_then(|()| client.build(ops.to_vec())) {
            // The link ends a moment before its reason is known.
            return client.check().err().unwrap_or(error).to_string();
        }
        client.take_events();
    }
    panic!("it is not cut off within {LIMIT:?}")
}

#[test]
fn who_may_not_build_and_who_floods_is_cut_off_and_others_play_on() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let _node = node(&server);
    let kept = server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(9.0, 0.5, 9.0)).unwrap();
    let mover = RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(0.0, 5.0, 0.0));
    let mover = server.insert(mover, ColliderBuilder::ball(0.5)).unwrap();
    let mut honest = connected(&server, JoinRole::Builder);
    until("the world runs", &mut [&mut server, &mut honest], |worlds| {
        worlds[0].tick() > Tick(0) && worlds[1].contains(kept) && worlds[1].contains(mover)
    });

    let client = hostile(&server, JoinRole::Client);
    assert!(!client.may_build());
    client.build(vec![BuildOp::Remove(kept)]).unwrap();
    assert_eq!(refusal(&client), Ok(Refusal::MayNotBuild));
    let why = flood(&client, &[BuildOp::Remove(kept)]);
    assert!(why.contains("dcd token --role builder"), "{why}");

    let builder = hostile(&server, JoinRole::Builder);
    let push = BuildOp::Push(Push::impulse(kept, [1.0; 3]));
    let flooded = std::thread::spawn(move || flood(&builder, &vec![push; 500]));
    // Another client still sees at least a third of the world's pace, during the flood and until 60 ticks
    // have come.
    let began = honest.tick().0;
    let start = Instant::now();
    let mut lasted = Duration::ZERO;
    until("a flood ends and the world goes on", &mut [&mut server, &mut honest], |worlds| {
        if !flooded.is_finished() {
            lasted = start.elapsed();
        }
        flooded.is_finished() && worlds[1].tick().0 >= began + 60
    });
    let why = flooded.join().unwrap();
    assert!(why.contains("went on to ask"), "{why}");
    let ticks = honest.tick().0 - began;
    let ticks_per_s = ticks as f64 / start.elapsed().as_secs_f64();
    println!("{ticks} ticks, {ticks_per_s:.1} per second; it was cut off after {lasted:.2?}");
    assert!(ticks_per_s >= 20.0, "{ticks_per_s}");
    honest.set_velocity(mover, Velocity::linear([2.0, 0.0, 0.0])).unwrap();
    until("another builder is heard", &mut [&mut server, &mut honest], |worlds| {
        worlds[1].pose(mover).is_some_and(|pose| pose.translation[0] > 0.5)
    });
    assert!(server.contains(kept));
}

#[test]
fn a_builder_that_wants_too_much_is_told_what_of_each_body_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let _node = node(&server);
    let mut builder = connected(&server, JoinRole::Builder);
    let heavy = RigidBodyBuilder::dynamic().additional_solver_iterations(100);
    let heavy = builder.insert(heavy, ColliderBuilder::ball(0.5)).unwrap();
    let points: Vec<_> =
        (0..9_000).map(|i| Vector::new((i % 97) as f32, (i % 89) as f32, (i % 83) as f32)).collect();
    let indices = (0..2_998).map(|i| [i, i + 1, i + 2]).collect();
    let mesh = ColliderBuilder::trimesh(points, indices).unwrap();
    let mesh = builder.insert(RigidBodyBuilder::fixed(), mesh).unwrap();
    let mut why = Vec::new();
    until("both are refused", &mut [&mut builder, &mut server], |worlds| {
        why.extend(worlds[0].changes().iter().filter_map(|change| match change {
            BodyChange::Refused { body, why, .. } => Some((*body, why.to_string())),
            _ => None,
        }));
        why.len() >= 2
    });
    let of = |id| why.iter().find(|(body, _)| *body == Some(id)).map(|(_, why)| why.as_str()).unwrap();
    assert!(of(heavy).contains("at most 8 extra solver"), "{why:?}");
    assert!(of(mesh).contains("60 KiB"), "{why:?}");
    assert!(!builder.contains(heavy) && !builder.contains(mesh));
    let ball = builder.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).unwrap();
    until("a usual one comes", &mut [&mut builder, &mut server], |worlds| worlds[1].contains(ball));
    assert!(matches!(builder.record(ball), Some(BodyRecord { .. })));
    let shape = builder.record(ball).unwrap().traits.colliders[0].shape;
    assert_eq!(shape, ShapeRecord::Ball(0.5).hash());
}
