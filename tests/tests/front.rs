//! Tests the one front of every role, `dcd::World`: the same program in a local world and in a served one,
//! and the same refusals.

use std::time::Duration;

use dcd::prelude::*;
use dcd::{Instead, Unsupported};

const LIMIT: Duration = Duration::from_secs(60);

fn playground() -> Scene {
    Scene::open("tower", &Params::default()).unwrap()
}

/// A server, a node and a client in this process, over real links.
struct Served {
    client: World,
    node: World,
    server: World,
    _data: tempfile::TempDir,
}

fn served() -> Served {
    let scene = playground();
    let data = tempfile::tempdir().unwrap();
    let server =
        World::serve(&scene, &WorldConfig::for_scene(&scene), ServeConfig::new(data.path())).unwrap();
    let join = |role| JoinConfig::new(server.address().unwrap(), server.token(role, LIMIT).unwrap());
    let node = World::join_as_node(&join(JoinRole::Node)).unwrap();
    let client = World::connect(&join(JoinRole::Client)).unwrap();
    Served { client, node, server, _data: data }
}

/// Runs the README's program, from the line after the one that makes the world.
fn until_the_cube_rests(mut world: World) -> Result<f64, Box<dyn std::error::Error>> {
    let cube = world.insert(
        RigidBodyBuilder::dynamic().translation(Vector::new(4.0, 3.0, 0.0)),
        ColliderBuilder::cuboid(0.5, 0.5, 0.5),
    )?;
    while !world.body(cube).is_none_or(|cube| cube.sleeping) {
        world.poll(std::time::Duration::from_secs(1)); // a local world does not wait
        world.step()?;
    }
    println!("it rests at {:?}", world.pose(cube).ok_or("it was refused")?.translation);
    Ok(world.pose(cube).expect("it was there").translation[1])
}

/// Connects to a served world, by the line of the README. It is only compiled, since nobody listens there.
#[expect(dead_code, unused_mut)]
fn in_a_served_world() -> Result<World, Box<dyn std::error::Error>> {
    let mut world = World::connect(&JoinConfig::new("192.0.2.7:7420".parse()?, "dcd1-..."))?;
    Ok(world)
}

#[test]
fn the_program_of_the_readme_is_short_and_is_the_one_that_runs_here() {
    let readme = include_str!("../../README.md");
    let (_, program) = readme.split_once("```rust\n").expect("it has a program");
    let (program, _) = program.split_once("```").expect("it ends");
    assert!(program.lines().count() <= 25, "{program}");
    let imports: Vec<_> = program.lines().filter(|line| line.starts_with("use ")).collect();
    assert_eq!(imports, ["use dcd::prelude::*;"]);
    assert_eq!(program.matches("dcd::").count(), 1, "the prelude is enough");
    // The README's doctest runs the local world, the tests below both.
    let here = include_str!("front.rs");
    let (before, after) = program.split_once("    let cube").expect("it inserts a cube");
    let after = after.strip_suffix("    Ok(())\n}\n").expect("it ends well");
    assert!(here.contains(&format!("    let cube{after}")), "{after}");
    let served =
        before.lines().find_map(|line| line.strip_prefix("    // ")).expect("it names the other line");
    assert!(here.lines().any(|line| line.trim_start() == served), "{served}");
}

#[test]
fn a_program_runs_in_a_local_world_and_in_a_served_one() {
    let scene = playground();
    let local = World::from_scene(&scene, WorldConfig::for_scene(&scene)).unwrap();
    let there = until_the_cube_rests(local).unwrap();
    let Served { client, node: _node, server: _server, _data } = served();
    let here = until_the_cube_rests(client).unwrap();
    assert!((there - here).abs() < 0.01, "it rests at {there} m and at {here} m");
}

fn refused<T>(result: Result<T, Error>) -> Unsupported {
    match result.err().expect("it is refused") {
        Error::Unsupported(refusal) => refusal,
        other => panic!("{other}"),
    }
}

#[test]
fn what_a_role_cannot_do_is_refused_by_name_and_says_what_to_do_instead() {
    let Served { mut client, mut node, mut server, _data } = served();
    let id = BodyId::persistent(0);

    let refusal = refused(client.update(id, |body| body.wake_up(true)));
    assert_eq!((refusal.role, refusal.instead), (Role::Client, Instead::DriveAvatars));
    assert_eq!(
        refusal.to_string(),
        "a client cannot change a body in place: it drives its own avatars by set_velocity and set_pose"
    );
    assert_eq!(refused(client.set_pose(id, WorldPose::default())).instead, Instead::MakeAvatars);
    assert_eq!(refused(client.remove(id)).instead, Instead::MakeAvatars);
    let (body, capsule) =
        (RigidBodyBuilder::kinematic_velocity_based(), ColliderBuilder::capsule_y(0.5, 0.3));
    let walker =
        client.insert_character(WorldPose::at([0.0, 9.0, 0.0]), &Character::default(), body, [capsule]);
    let refusal = refused(client.set_pose(walker.unwrap(), WorldPose::default()));
    assert_eq!(refusal.instead, Instead::Walk);
    assert!(!refusal.to_string().contains("set_pose"), "it does not name what it refuses: {refusal}");
    assert_eq!(
        refused(client.insert_joint(id, id, FixedJointBuilder::new())).instead,
        Instead::JointsInScene
    );
    assert_eq!(refused(client.queries().map(drop)).instead, Instead::SubmitQuery);
    assert_eq!(refused(client.save(Vec::new())).instead, Instead::ServerKeeps);
    assert_eq!(refused(client.state_hash()).instead, Instead::CompareLocal);
    assert_eq!(refused(client.validate()).instead, Instead::LookLocal);
    assert_eq!(refused(client.token(JoinRole::Node, LIMIT)).instead, Instead::AskServer);
    assert_eq!(refused(client.address()).instead, Instead::AskListener);
    let ball = || ColliderBuilder::ball(0.5);
    assert_eq!(refused(client.insert(RigidBodyBuilder::fixed(), ball())).instead, Instead::FixedInScene);
    let lift = RigidBodyBuilder::kinematic_position_based();
    assert_eq!(refused(client.insert(lift, ball())).instead, Instead::KinematicByVelocity);
    let mut drowsy = RigidBodyBuilder::dynamic().build();
    drowsy.activation_mut().time_until_sleep = 9.0;
    assert_eq!(refused(client.insert(drowsy, ball())).instead, Instead::UsualSleep);
    client.insert(RigidBodyBuilder::dynamic().can_sleep(false), ball()).unwrap();

    assert_eq!((node.movable_count(), node.body(id)), (0, None));
    let refusal = refused(node.insert(RigidBodyBuilder::dynamic(), ball()));
    assert_eq!((refusal.role, refusal.instead), (Role::Node, Instead::JoinAsClient));
    assert_eq!(refused(node.suspend()).instead, Instead::ServerKeeps);
    assert_eq!(refused(server.queries().map(drop)).instead, Instead::SubmitQuery);
    assert_eq!(refused(node.queries().map(drop)).instead, Instead::ComputeAlone);
    // A server can change what moves, but this body is fixed.
    let changes =
        [(&mut server, Role::Server, Instead::InsertAnew), (&mut node, Role::Node, Instead::JoinAsClient)];
    for (world, role, instead) in changes {
        assert_eq!(world.role(), role);
        assert_eq!(refused(world.update(id, |body| body.wake_up(true))).instead, instead);
        assert_eq!(refused(world.set_interest(None)).instead, Instead::JoinAsClient);
        assert_eq!(refused(world.state_hash()).instead, Instead::ComputeAlone);
        assert_eq!(refused(world.validate()).instead, Instead::ComputeAlone);
    }

    let mut local = World::new(WorldConfig::default()).unwrap();
    assert_eq!(refused(local.token(JoinRole::Node, LIMIT)).instead, Instead::Serve);
    assert_eq!(refused(local.address()).instead, Instead::Serve);
    assert_eq!((local.connections(), local.poll(LIMIT), local.is_lost()), (Vec::new(), true, false));
    local.set_interest(None).unwrap();
}

/// The numbers of drawn shapes, boxes, texts and lines, and of white points.
#[derive(Debug, Default, PartialEq)]
struct Counted {
    shapes: usize,
    boxes: usize,
    texts: usize,
    lines: usize,
    white: usize,
}

impl dcd::DebugDraw for Counted {
    fn point(&mut self, _at: [f64; 3], _size_px: f32, colour: [u8; 4]) {
        self.white += usize::from(colour == [0xff; 4]);
    }

    fn line(&mut self, _from: [f64; 3], _to: [f64; 3], _colour: [u8; 4]) {
        self.lines += 1;
    }

    fn aabb(&mut self, _bounds: &Bounds, _colour: [u8; 4]) {
        self.boxes += 1;
    }

    fn shape(&mut self, _: BodyId, _: &dcd::DebugShape<'_>, _: &WorldPose, _: [u8; 4]) {
        self.shapes += 1;
    }

    fn text(&mut self, _at: [f64; 3], _text: &str, _colour: [u8; 4]) {
        self.texts += 1;
    }
}

#[test]
fn every_role_draws_what_it_sees_and_a_node_refuses() {
    use dcd::{DebugDrawFlags as Flag, DebugDrawSettings};
    let Served { mut client, mut node, mut server, _data: folder } = served();
    let avatar = RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(4.0, 9.0, 0.0));
    let avatar = client.insert(avatar, ColliderBuilder::ball(0.5)).unwrap();
    let settings = DebugDrawSettings { what: Flag::ALL, ..DebugDrawSettings::default() };
    let draw = |world: &mut World| {
        let mut counted = Counted::default();
        world.debug_draw(&mut counted, &settings).map(|()| counted)
    };
    let start = std::time::Instant::now();
    while client.body(avatar).is_none_or(|body| body.owner.is_none()) || client.movable_count() < 11 {
        assert!(start.elapsed() < LIMIT, "the world comes");
        client.poll(Duration::from_millis(10));
        client.step().unwrap();
        server.step().unwrap();
    }
    let fixed = playground().bodies.len() - 10;
    let told = draw(&mut client).unwrap();
    assert_eq!((told.shapes, told.texts, told.white), (11 + fixed, 11, 1), "{told:?}");
    assert_eq!(told.boxes, client.region_count(), "borders, and no boxes of what others compute");
    let time = client.view_time();
    let mut shown = Counted::default();
    client.debug_draw(&mut shown, &DebugDrawSettings { time: Some(time), ..settings }).unwrap();
    assert_eq!(shown.shapes, told.shapes);

    let kept = draw(&mut server).unwrap();
    assert_eq!((kept.shapes, kept.texts, kept.white), (11 + fixed, 11, 0), "{kept:?}");
    let refusal = draw(&mut node).unwrap_err();
    assert!(refusal.to_string().starts_with("a node cannot be drawn"), "{refusal}");
    assert!(node.save_gltf(folder.path().join("node.glb")).is_err());
    for (name, world) in [("client.glb", &client), ("server.glb", &server)] {
        let file = folder.path().join(name);
        world.save_gltf(&file).unwrap();
        assert!(std::fs::metadata(file).unwrap().len() > 1000);
    }
    let mut local = World::from_scene(&playground(), WorldConfig::for_scene(&playground())).unwrap();
    for _ in 0..10 {
        local.step().unwrap();
    }
    let all = draw(&mut local).unwrap();
    assert_eq!((all.shapes, all.boxes), (10 + fixed, 10 + 10 + 1), "boxes, swept boxes, the world's");
    assert!(all.lines > 0, "contacts press");
}

#[test]
fn parameters_that_do_not_reach_nodes_are_refused() {
    let scene = playground();
    let mut config = WorldConfig::for_scene(&scene);
    config.step.integration.warmstart_coefficient = 0.5;
    let data = tempfile::tempdir().unwrap();
    let refused = World::serve(&scene, &config, ServeConfig::new(data.path())).expect_err("it is refused");
    assert!(refused.to_string().starts_with("step.integration is changed: a served world"), "{refused}");
    assert!(!data.path().join("authority.pem").exists(), "nothing is left behind");
}

#[test]
fn a_world_is_stepped_by_one_thread_at_least() {
    for threads in [0, 1025] {
        let made = World::new(WorldConfig { threads, ..WorldConfig::default() }).map(drop);
        let restored = World::restore(&[][..], threads).map(drop);
        for refused in [made, restored].map(|result| result.expect_err("it is refused").to_string()) {
            assert!(
                refused.contains(&format!("{threads}")) && refused.contains("1 to 1024 threads"),
                "{refused}"
            );
        }
    }
}

#[test]
fn a_body_keeps_what_it_was_built_with() {
    let mut world = World::new(WorldConfig::default()).unwrap();
    let mut body = RigidBodyBuilder::dynamic().translation(Vector::new(1.0, 2.0, 3.0)).user_data(7).build();
    body.activation_mut().time_until_sleep = 9.0;
    let id = world.insert(body, ColliderBuilder::ball(0.5).density(2.0)).unwrap();
    let record = world.record(id).unwrap();
    assert_eq!((record.traits.sleep_after_s, record.user_data), (9.0, 7));
    let body = world.body(id).unwrap();
    assert_eq!((body.pose.translation, body.kind), ([1.0, 2.0, 3.0], BodyKind::Dynamic));
    let sphere_kg = 4.0 / 3.0 * std::f32::consts::PI * 0.125 * 2.0;
    assert!((body.mass_kg.unwrap() - sphere_kg).abs() < 1e-4, "{body:?}");
}

#[test]
fn what_is_submitted_to_a_local_world_is_answered_at_once_and_once() {
    use dcd::query::{Place, Query, QueryResult};
    let mut world = World::new(WorldConfig::default()).unwrap();
    let id = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.5)).unwrap();
    let question = Query::overlaps([Place::Point([0.1, 0.0, 0.0])]);
    let (first, second) = (world.submit(question.clone()).unwrap(), world.submit(question).unwrap());
    let Some(QueryResult::Overlaps(lists)) = world.answer(first).unwrap() else { panic!("it is answered") };
    assert_eq!(lists[0].iter().map(|found| found.body).collect::<Vec<_>>(), [id]);
    assert_eq!(world.answer(first).unwrap(), None);
    world.forget(second);
    assert_eq!(world.answer(second).unwrap(), None);
}

#[test]
fn what_a_ray_hits_and_what_touches_have_ids_that_changes_take() {
    let mut world = World::new(WorldConfig::default()).unwrap();
    let ground = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(5.0, 0.5, 5.0)).unwrap();
    let lid = ColliderBuilder::cuboid(1.0, 0.1, 1.0).translation(Vector::Y * 2.0);
    let lid = world.insert_collider(ground, lid).unwrap();
    assert_eq!(lid, (ground, 1).into());
    let down = WorldRay::new([0.0, 9.0, 0.0], [0.0, -1.0, 0.0]);
    let hit = |world: &World| {
        let hit = world.queries().unwrap().cast_ray(&down, &BodyFilter::default()).unwrap().unwrap();
        hit.collider_id()
    };
    assert_eq!(hit(&world), lid);
    world.update_collider(hit(&world), |collider| collider.set_enabled(false)).unwrap();
    assert_eq!(hit(&world), ground.into());

    let events = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
    let at = RigidBodyBuilder::dynamic().translation(Vector::new(3.0, 0.9, 0.0));
    let ball = world.insert(at, events).unwrap();
    world.step().unwrap();
    let key = world.events().touches[0].key;
    assert_eq!(key.colliders(), [ground.into(), ball.into()]);
    world.remove_collider(lid).unwrap();
    assert_eq!(world.collider_count(ground), 1);
}

/// Returns the names of these types. It compiles only if all of them have these traits.
macro_rules! with_traits {
    ($bound:path, $extra:path; $($name:ty),* $(,)?) => {{
        fn has<T: $bound + $extra>() {}
        $(has::<$name>();)*
        vec![$(stringify!($name)),*]
    }};
}

#[test]
fn every_public_type_can_be_printed_and_passes_between_threads() {
    trait Passes: Send + Sync {}
    impl<T: Send + Sync> Passes for T {}
    let mut known = with_traits![std::fmt::Debug, Passes;
        dcd::Axis,
        dcd::BodyChange,
        dcd::BodyKind,
        dcd::Costs,
        dcd::Coupling,
        dcd::DebugShape<'static>,
        dcd::Error,
        dcd::Inconsistency,
        dcd::Instead,
        dcd::Partitioning,
        dcd::Preset,
        dcd::Refusal,
        dcd::Role,
        dcd::Why,
        dcd::error::ConnectionError,
        dcd::error::ControlError,
        dcd::error::GltfError,
        dcd::error::HostError,
        dcd::error::ProcessError,
        dcd::error::QueryError,
        dcd::error::SceneError,
        dcd::error::ShapeError,
        dcd::error::RecordingError,
        dcd::error::SnapshotError,
        dcd::error::TreeError,
        dcd::error::WorldError,
        dcd::network::Cause,
        dcd::network::ConnectionChange,
        dcd::network::Delivery,
        dcd::network::GroupPolicy,
        dcd::network::JoinRole,
        dcd::network::Pace,
        dcd::network::PeerName,
        dcd::network::Arrivals,
        dcd::network::Connection,
        dcd::network::ConnectionEvent,
        dcd::network::ConnectionId,
        dcd::network::DelayThresholds,
        dcd::network::GroupConfig,
        dcd::network::Grouping,
        dcd::network::JoinConfig,
        dcd::network::PeerStats,
        dcd::network::Prediction,
        dcd::network::PollRules,
        dcd::network::ProgramMessage,
        dcd::network::Reason,
        dcd::network::ServeConfig,
        dcd::network::Thresholds,
        dcd::query::Place,
        dcd::query::QueryParts,
        dcd::query::QueryResult,
        dcd::query::ShapeRecord,
        dcd::query::CastAnswer,
        dcd::query::CastQuery,
        dcd::query::FilterRecord,
        dcd::query::Overlap,
        dcd::query::OverlapQuery,
        dcd::query::PartFilter,
        dcd::query::PointHit,
        dcd::query::Queries<'static>,
        dcd::query::Query,
        dcd::query::RayAnswer,
        dcd::query::RayHit,
        dcd::query::RayQuery,
        dcd::query::ShapeHash,
        dcd::query::ShapeHit,
        dcd::query::WorldMotion,
        dcd::query::WorldRay,
        dcd::Area,
        dcd::Balance,
        dcd::Body,
        dcd::BodyExtent,
        dcd::BodyId,
        dcd::BodyRecord,
        dcd::BodyState,
        dcd::BodyTraits,
        dcd::BorderView,
        dcd::Bounds,
        dcd::Cell,
        dcd::Character,
        dcd::CharacterState,
        dcd::CharacterHit,
        dcd::Checkpoint,
        dcd::Choice,
        dcd::ClientId,
        dcd::ColliderId,
        dcd::ContactForce,
        dcd::ContactKey,
        dcd::ContactPoint,
        dcd::DebugDrawFlags,
        dcd::DebugDrawSettings,
        dcd::Drive,
        dcd::Epoch,
        dcd::Explosion,
        dcd::Fidelity,
        dcd::FidelityReport,
        dcd::Fluid,
        dcd::Gait,
        dcd::Ground,
        dcd::Handover,
        dcd::HookedPair<'static>,
        dcd::JointId,
        dcd::JointOverload,
        dcd::JointRecord,
        dcd::LinkMotion,
        dcd::LinkSettings,
        dcd::MovableBody,
        dcd::NodeId,
        dcd::Profile,
        dcd::Owner,
        dcd::Params,
        dcd::Push,
        dcd::RegionId,
        dcd::RegionInfo,
        dcd::Scene,
        dcd::Stats,
        dcd::StepSettings,
        dcd::Tick,
        dcd::Touch,
        dcd::Unsupported,
        dcd::Vehicle,
        dcd::VehicleController,
        dcd::Velocity,
        dcd::ViewTime,
        dcd::Viewpoint,
        dcd::Wheel,
        dcd::WheelState,
        dcd::World,
        dcd::WorldConfig,
        dcd::WorldEvents,
        dcd::WorldPose
    ];
    // These borrow a predicate of their user's, as Rapier's filters do.
    known.extend(with_traits![std::fmt::Debug, std::any::Any; dcd::query::BodyFilter<'static>, dcd::CharacterMove<'static>]);
    let listed = include_str!("../../dcd/public-items.txt").lines().filter_map(|item| {
        let (path, name) = item.split_once("struct.").or_else(|| item.split_once("enum."))?;
        (!name.contains("::")).then(|| format!("dcd::{}{name}", path.replace('/', "::")))
    });
    let known: Vec<_> = known.iter().map(|name| name.split('<').next().unwrap()).collect();
    let missing: Vec<_> = listed.filter(|name| !known.contains(&&name[..])).collect();
    assert!(missing.is_empty(), "name them above: {missing:?}");
}
