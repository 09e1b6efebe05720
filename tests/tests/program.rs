//! Tests a server's program, which builds, moves and removes what is in its world. Uses real QUIC, with nodes
//! and clients in this process.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;
use dcd::protocol::Pace;
use dcd::query::{Query, QueryResult, RayQuery};
use dcd::runtime::open_recording;
use dcd::{Axis, Fidelity, Instead, Push, Tick, Viewpoint};
use rapier3d::parry::utils::Array2;

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

/// Inserts balls that touch across the border, and a box that is thrown over it into the boxes of [`build`].
fn disturb(world: &mut World, bodies: &mut Vec<BodyId>) {
    for i in 0..5 {
        let ball = RigidBodyBuilder::dynamic().translation(Vector::new(i as f32 * 0.79 - 2.0, 0.9, -4.0));
        bodies.push(world.insert(ball, ColliderBuilder::ball(0.4)).unwrap());
    }
    let thrown = RigidBodyBuilder::dynamic()
        .translation(Vector::new(5.0, 1.2, 0.3))
        .linvel(Vector::new(-15.0, 4.0, 1.0))
        .angvel(Vector::new(2.0, 5.0, 20.0));
    bodies.push(world.insert(thrown, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap());
}

fn bits(world: &World, bodies: &[BodyId]) -> Vec<[u64; 3]> {
    bodies.iter().map(|&id| world.pose(id).unwrap().translation.map(f64::to_bits)).collect()
}

#[test]
fn what_is_built_before_the_first_tick_is_a_local_world_to_the_bit() {
    const TICKS: u64 = 150;
    let mut local = World::new(cut()).unwrap();
    let mut expected = build(&mut local);
    disturb(&mut local, &mut expected);
    (0..TICKS).for_each(|_| local.step().unwrap());

    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig {
        nodes: 2,
        pace: Pace::Unpaced,
        last_tick: Some(Tick(TICKS)),
        ..ServeConfig::new(folder.path())
    };
    let mut server = serve(config);
    let mut bodies = build(&mut server);
    disturb(&mut server, &mut bodies);
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

/// What a program does to a running world, each at a tick of its own.
#[derive(Clone, Copy, Debug)]
enum Deed {
    Drop,
    Push,
    Throw,
    Hit,
    Remove,
}

/// Does a deed to the ball that it drops, which is the last body, or to a box or the pendulum of [`build`].
/// Returns the body concerned.
fn act(world: &mut World, bodies: &mut Vec<BodyId>, deed: Deed) -> BodyId {
    let [post, weight, last] = [bodies[21], bodies[23], bodies[bodies.len() - 1]];
    match deed {
        // On the border.
        Deed::Drop => {
            let ball = RigidBodyBuilder::dynamic().translation(Vector::new(-0.3, 3.0, 9.0));
            bodies.push(world.insert(ball, ColliderBuilder::ball(0.6)).unwrap());
            bodies[bodies.len() - 1]
        }
        Deed::Push => {
            world.push(&Push::impulse(weight, [-0.1, 0.2, 0.1]).at([0.1, 2.3, -7.9])).unwrap();
            weight
        }
        // To the other side of the border.
        Deed::Throw => {
            world.set_velocity(last, Velocity::linear([3.0, 4.0, -0.5])).unwrap();
            last
        }
        // A box of the right side against those of the left side.
        Deed::Hit => {
            world.push(&Push::impulse(bodies[5], [-9.0, 6.0, 1.0]).at([2.6, 1.4, 0.2])).unwrap();
            bodies[5]
        }
        // The pendulum falls off.
        Deed::Remove => {
            world.remove(post).unwrap();
            post
        }
    }
}

/// Returns the tick in which a node did each deed that the program told it, by the node's recording. Each
/// tick computed again from the recording must have the same bits.
fn ticks_of(recording: &Path, told: &[(Deed, BodyId)]) -> Vec<Tick> {
    let mut replayed = open_recording(recording, 1).unwrap();
    let mut done = vec![BTreeSet::new(); told.len()];
    while let Some(settled) = replayed.advance().unwrap() {
        assert_eq!(settled.replayed, settled.recorded, "{}", settled.tick);
        for (done, &(deed, body)) in done.iter_mut().zip(told) {
            let word = match deed {
                Deed::Drop => "inserted",
                Deed::Push | Deed::Hit => "pushed",
                Deed::Throw => "input 0 ",
                Deed::Remove => "removed",
            };
            done.extend(replayed.acted_on(body).iter().filter_map(|act| {
                let (tick, what) = act.strip_prefix("tick ")?.split_once(": ")?;
                what.starts_with(word).then(|| Tick(tick.parse().unwrap()))
            }));
        }
    }
    done.iter().zip(told).for_each(|(done, told)| assert_eq!(done.len(), 1, "{told:?}: {done:?}"));
    done.into_iter().flatten().collect()
}

#[test]
fn what_a_running_world_is_told_leaves_the_bits_of_a_local_world_that_is_told_it_at_the_same_ticks() {
    const TICKS: u64 = 240;
    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig {
        nodes: 2,
        last_tick: Some(Tick(TICKS)),
        ..ServeConfig::new(folder.path().join("data"))
    };
    let mut server = serve(config);
    let mut bodies = build(&mut server);
    server.step().unwrap();
    let recording = folder.path().join("node.dcdr");
    let recorded = JoinConfig { record: Some(recording.clone()), ..join(&server, JoinRole::Node) };
    let nodes = [World::join_as_node(&recorded).unwrap(), node(&server)];
    let plan = [(30, Deed::Drop), (60, Deed::Push), (80, Deed::Hit), (100, Deed::Throw), (120, Deed::Remove)];
    let mut plan = plan.into_iter().peekable();
    let mut told = Vec::new();
    let deadline = Instant::now() + LIMIT;
    while server.step().is_ok() {
        assert!(Instant::now() < deadline, "it ends by itself");
        if let Some((_, deed)) = plan.next_if(|&(tick, _)| server.tick() >= Tick(tick)) {
            told.push((deed, act(&mut server, &mut bodies, deed)));
        }
        server.poll(Duration::from_millis(5));
    }
    assert_eq!((server.tick(), told.len()), (Tick(TICKS), 5));
    drop(nodes);

    let ticks = ticks_of(&recording, &told);
    println!("told at {ticks:?}");
    let mut local = World::new(cut()).unwrap();
    let mut all = build(&mut local);
    for tick in 1..=TICKS {
        for (&(deed, body), _) in told.iter().zip(&ticks).filter(|(_, at)| at.0 == tick) {
            assert_eq!(act(&mut local, &mut all, deed), body, "ids are counted as in a local world");
        }
        local.step().unwrap();
    }
    all.retain(|&id| id != told[4].1);
    assert_eq!(bits(&server, &all), bits(&local, &all));
    assert!(!server.contains(told[4].1) && !local.contains(told[4].1));
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
fn clients_are_told_states_as_often_as_the_server_says() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { state_every: 10, ..ServeConfig::new(folder.path()) });
    // A tenth of a metre per tick, so that its place tells the tick.
    let train = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 6.0);
    let train = server.insert(train, ColliderBuilder::ball(0.5)).unwrap();
    server.step().unwrap();
    let _node = node(&server);
    let mut client = client(&server);
    let mut told: Vec<i64> = Vec::new();
    until("twenty states", &mut [&mut client], |worlds| {
        if let Some(pose) = worlds[0].pose(train) {
            told.push((pose.translation[0] * 10.0).round() as i64);
            told.dedup();
        }
        told.len() >= 20
    });
    // The first states, on joining, are of the world's present tick.
    assert!(told[4..].iter().all(|tick| tick % 10 == 0), "{told:?}");
    let config = ServeConfig { state_every: 31, ..ServeConfig::new(folder.path().join("other")) };
    let refused = World::new(cut()).unwrap().serve_copy(config).unwrap_err().to_string();
    assert!(refused.contains("state_every is 31"), "{refused}");
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

/// Waits for the answer to a query.
fn answered(world: &mut World, number: u64) -> QueryResult {
    let deadline = Instant::now() + LIMIT;
    loop {
        if let Some(answer) = world.answer(number).unwrap() {
            return answer;
        }
        assert!(Instant::now() < deadline, "the query is not answered within {LIMIT:?}");
        world.poll(Duration::from_millis(5));
        world.step().unwrap();
    }
}

/// Inserts walls on both sides of the border. Returns queries about them: rays, and an overlap with a ball.
fn walls_and_queries(world: &mut World) -> Vec<Query> {
    for x in [-6.0, 4.0, 9.0] {
        let wall = RigidBodyBuilder::fixed().translation(Vector::new(x, 2.0, 0.0));
        world.insert(wall, ColliderBuilder::cuboid(0.5, 2.0, 3.0)).unwrap();
    }
    let ray = |x: f64, towards: f32| RayQuery::new([x, 1.0, 0.0], [towards, 0.0, 0.0]).up_to(50.0);
    let reach = Query::intersect_shape(&SharedShape::ball(5.5), WorldPose::at([-1.0, 2.0, 0.0])).unwrap();
    vec![Query::rays([ray(0.0, 1.0), ray(0.0, -1.0), ray(20.0, -1.0), ray(20.0, 1.0)]), reach]
}

#[test]
fn a_servers_program_asks_by_rays_and_shapes_and_is_answered_as_by_a_local_world() {
    let mut local = World::new(cut()).unwrap();
    let queries = walls_and_queries(&mut local);
    local.step().unwrap();
    let mut ask = |query| {
        let number = local.submit(query).unwrap();
        answered(&mut local, number)
    };
    let expected: Vec<_> = queries.into_iter().map(&mut ask).collect();
    let QueryResult::Rays(hits) = &expected[0] else { panic!("rays were asked for") };
    assert_eq!(hits.iter().filter(|hit| hit.is_some()).count(), 3);

    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { nodes: 2, ..ServeConfig::new(folder.path()) });
    // Nobody computes the world yet. Bodies made before a query are there for those who answer it.
    let queries = walls_and_queries(&mut server);
    let early: Vec<_> = queries.iter().map(|query| server.submit(query.clone()).unwrap()).collect();
    let gone = server.submit(queries[0].clone()).unwrap();
    server.forget(gone);
    let mut first = node(&server);
    let _second = node(&server);
    let answers = |server: &mut World, numbers: Vec<u64>| {
        numbers.into_iter().map(|number| answered(server, number)).collect::<Vec<_>>()
    };
    assert_eq!(answers(&mut server, early.clone()), expected);
    assert_eq!(server.answer(early[0]).unwrap(), None, "an answer is given once");
    let block = RigidBodyBuilder::fixed().translation(Vector::new(2.0, 1.0, 0.0));
    let block = server.insert(block, ColliderBuilder::ball(0.5)).unwrap();
    let number = server.submit(queries[0].clone()).unwrap();
    let QueryResult::Rays(hits) = answered(&mut server, number) else { panic!("rays were asked for") };
    assert_eq!(hits[0].map(|hit| hit.body), Some(block), "what was inserted before it is there");
    // The leader answers. The first node to join leads, and leaves.
    first.step().unwrap();
    drop(first);
    server.remove(block).unwrap();
    server.step().unwrap();
    let again: Vec<_> = queries.into_iter().map(|query| server.submit(query).unwrap()).collect();
    assert_eq!(answers(&mut server, again), expected);
    assert_eq!(server.answer(gone).unwrap(), None, "it was cancelled");
}

#[test]
fn bodies_can_be_tied_whatever_was_asked_between_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let ball = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 2.0, 0.0)).gravity_scale(0.0);
    let below = || Query::rays([RayQuery::new([5.0, 9.0, 0.0], [0.0, -1.0, 0.0]).up_to(9.0)]);
    let a = server.insert(ball(5.0), ColliderBuilder::ball(0.5)).unwrap();
    let (asked, gone) = (server.submit(below()).unwrap(), server.submit(below()).unwrap());
    server.forget(gone);
    let b = server.insert(ball(7.0), ColliderBuilder::ball(0.5)).unwrap();
    let bar = SphericalJointBuilder::new().local_anchor2(Vector::X * -2.0);
    let joint = server.insert_joint(a, b, bar).unwrap();
    server.step().unwrap();
    assert!(server.joint(joint).is_some());
    let _node = node(&server);
    let QueryResult::Rays(hits) = answered(&mut server, asked) else { panic!("rays were asked for") };
    assert_eq!(hits[0].map(|hit| hit.body), Some(a), "what was made before the question is there for it");
    assert_eq!(server.answer(gone).unwrap(), None, "it was cancelled");
    // If nothing was done since, a query does not wait for a step.
    let again = server.submit(below()).unwrap();
    let deadline = Instant::now() + LIMIT;
    while server.answer(again).unwrap().is_none() {
        assert!(Instant::now() < deadline, "the query is not answered within {LIMIT:?}");
        server.poll(Duration::from_millis(5));
    }
}

#[test]
fn a_servers_program_hears_each_contact_once_that_a_body_asks_for() {
    let hears = |events: bool| {
        let folder = tempfile::tempdir().unwrap();
        let mut server = serve(ServeConfig { nodes: 2, events, ..ServeConfig::new(folder.path()) });
        let _nodes = [node(&server), node(&server)];
        until("the world runs", &mut [&mut server], |worlds| worlds[0].tick() > Tick(0));
        let ground =
            server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
        let ball = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 2.0, 0.0));
        let quiet = server.insert(ball(3.0), ColliderBuilder::ball(0.5)).unwrap();
        let asks = ColliderBuilder::ball(0.5)
            .active_events(ActiveEvents::COLLISION_EVENTS | ActiveEvents::CONTACT_FORCE_EVENTS)
            .contact_force_event_threshold(1.0);
        // On the border, so that both regions see it.
        let loud = server.insert(ball(0.0), asks).unwrap();
        let (mut began, mut forces) = (Vec::new(), Vec::new());
        until("both lie on the ground", &mut [&mut server], |worlds| {
            began
                .extend(worlds[0].events().touches.iter().filter(|touch| touch.began).map(|touch| touch.key));
            forces.extend(worlds[0].events().forces.iter().map(|force| force.key));
            let lies = |id| worlds[0].pose(id).is_some_and(|pose| pose.translation[1] < 1.02);
            // A contact is told at once, the record half a second later.
            lies(quiet)
                && lies(loud)
                && worlds[0].velocity(loud).is_some_and(|now| now.linear[1].abs() < 0.01)
        });
        let is_of = |key: &dcd::protocol::ContactKey| [key.a, key.b] == [ground, loud];
        assert!(began.iter().chain(&forces).all(is_of), "{began:?}");
        (began.len(), forces.is_empty())
    };
    assert_eq!(hears(true), (1, false));
    assert_eq!(hears(false), (0, true), "it does not listen");
}

#[test]
fn contacts_that_end_with_a_body_say_whose_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { nodes: 1, ..ServeConfig::new(folder.path()) });
    let _node = node(&server);
    until("the world runs", &mut [&mut server], |worlds| worlds[0].tick() > Tick(0));
    let mut client = client(&server);
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let ball = |world: &mut World, x: f32, user_data| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.2, 0.0)).user_data(user_data);
        let asks = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
        world.insert(body, asks).unwrap()
    };
    let ids = [ball(&mut server, 3.0, 7), ball(&mut client, -3.0, 9)];
    let both = |what: &str, server: &mut World, client: &mut World, began: bool| {
        let mut told = [None; 2];
        until(what, &mut [server, client], |worlds| {
            for ((told, world), id) in told.iter_mut().zip(worlds).zip(ids) {
                let is_meant = |touch: &dcd::protocol::Touch| {
                    touch.began == began && [touch.key.a, touch.key.b].contains(&id)
                };
                if world.events().touches.iter().any(is_meant) {
                    *told = world.user_data(id);
                }
            }
            told.iter().all(Option::is_some)
        });
        told
    };
    assert_eq!(both("both lie on the ground", &mut server, &mut client, true), [Some(7), Some(9)]);
    server.remove(ids[0]).unwrap();
    client.remove(ids[1]).unwrap();
    assert_eq!(both("both are gone", &mut server, &mut client, false), [Some(7), Some(9)]);
    assert!(!server.contains(ids[0]) && !client.contains(ids[1]));
}

#[test]
fn a_server_tells_once_what_came_before_its_world_ended() {
    let folder = tempfile::tempdir().unwrap();
    let last_tick = Some(Tick(120));
    let config = ServeConfig { nodes: 1, pace: Pace::Unpaced, last_tick, ..ServeConfig::new(folder.path()) };
    let mut server = serve(config);
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let asks = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
    server.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 1.5), asks).unwrap();
    server.step().unwrap();
    let _node = node(&server);
    let deadline = Instant::now() + LIMIT;
    while !server.is_lost() {
        assert!(Instant::now() < deadline, "it does not end");
        server.poll(Duration::from_millis(5));
    }
    let began = |server: &World| server.events().touches.iter().filter(|touch| touch.began).count();
    assert!(server.step().is_err());
    assert_eq!(began(&server), 1);
    assert!(server.step().is_err());
    assert_eq!(began(&server), 0);
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

#[test]
fn what_a_servers_program_looks_at_is_computed_in_full_until_it_looks_away() {
    let folder = tempfile::tempdir().unwrap();
    let cuts = [-20.0, 0.0, 20.0].map(|x| (Axis::X, x));
    let config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0, 10.0, 10.0]),
        partitioning: Partitioning::Cuts(cuts.to_vec()),
        fidelity: Fidelity::Tolerance { m_s: 1e6 },
        ..WorldConfig::default()
    };
    let pace = Pace::Unpaced;
    let config = (config, ServeConfig { pace, ..ServeConfig::new(folder.path()) });
    let mut server = World::new(config.0).unwrap().serve_copy(config.1).unwrap();
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(40.0, 0.5, 10.0)).unwrap();
    for x in [-30.0, -10.0, 10.0, 30.0] {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.0, 0.0)).can_sleep(false);
        server.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
    }
    let mut node = node(&server);
    let comes_to = |server: &mut World, levels: [usize; 3]| {
        let is_so = |worlds: &[&mut World]| worlds[0].fidelity_report().is_some_and(|it| it.levels == levels);
        until("its levels", &mut [server], is_so);
    };
    comes_to(&mut server, [0, 0, 4]);
    server.set_viewpoints(&[Viewpoint { at: [-30.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    comes_to(&mut server, [1, 0, 3]);
    server.set_viewpoints(&[]).unwrap();
    comes_to(&mut server, [0, 0, 4]);
    let unfit = server.set_viewpoints(&[Viewpoint { at: [f64::NAN; 3], radius_m: 1.0 }]);
    assert!(unfit.unwrap_err().to_string().contains("finite"));
    let mut client = client(&server);
    for (world, remedy) in [(&mut node, Instead::JoinAsClient), (&mut client, Instead::SayInterest)] {
        let Err(Error::Unsupported(refused)) = world.set_viewpoints(&[]) else { panic!("it does not look") };
        assert_eq!(refused.instead, remedy);
    }
}
