//! Tests server, nodes and clients over real QUIC on loopback, each on threads of this process.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

use dcd::Fidelity;
use dcd::net::JoinRole;
use dcd::physics::{Coupling, StepSettings};
use dcd::protocol::{BodyKind, DelayThresholds, Pace, Thresholds, Velocity, View, WorldPose};
use dcd::recording::Replay;
use dcd::runtime::{
    ClientWorld, GroupConfig, JoinConfig, LocalWorld, Member, MemberConfig, Origin, Partitioning,
    ServeConfig, ServerProcess, Stats, WorldConfig, open_recording, replayed_regions,
};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, Tick};
use rapier3d::prelude::*;

const LIMIT: Duration = Duration::from_secs(60);

fn serve(
    scene: &Scene,
    regions: usize,
    nodes: usize,
    pace: Pace,
    last_tick: Option<u64>,
) -> (ServerProcess, tempfile::TempDir) {
    let world = WorldConfig { partitioning: Partitioning::Regions(regions), ..WorldConfig::for_scene(scene) };
    serve_world(scene, world, nodes, pace, last_tick)
}

fn serve_world(
    scene: &Scene,
    world: WorldConfig,
    nodes: usize,
    pace: Pace,
    last_tick: Option<u64>,
) -> (ServerProcess, tempfile::TempDir) {
    serve_origin(Origin::Scene(scene, &world), nodes, pace, last_tick, GroupConfig::default())
}

fn serve_origin(
    origin: Origin<'_>,
    nodes: usize,
    pace: Pace,
    last_tick: Option<u64>,
    groups: GroupConfig,
) -> (ServerProcess, tempfile::TempDir) {
    let data = tempfile::tempdir().unwrap();
    let server = ServerProcess::start(
        origin,
        ServeConfig {
            nodes,
            pace,
            last_tick: last_tick.map(Tick),
            groups,
            // Avatars of these tests may jump anywhere.
            avatar_speed_limit: 1e4,
            ..ServeConfig::new(data.path().to_owned())
        },
    )
    .unwrap();
    (server, data)
}

fn start_node(server: &ServerProcess) -> Member {
    start_node_recorded_to(server, None)
}

fn start_node_recorded_to(server: &ServerProcess, record: Option<PathBuf>) -> Member {
    let token = server.token(JoinRole::Node, LIMIT).unwrap();
    let identity = JoinConfig::new(server.address, token).join(JoinRole::Node).unwrap();
    Member::start(MemberConfig { record, ..MemberConfig::new(server.address, identity) }).unwrap()
}

fn connect(server: &ServerProcess) -> ClientWorld {
    let token = server.token(JoinRole::Client, LIMIT).unwrap();
    ClientWorld::connect(&JoinConfig::new(server.address, token)).unwrap()
}

fn rain() -> Scene {
    Scene::named("terrain", &Params::new().with("n", 300)).unwrap()
}

#[test]
fn a_networked_world_equals_a_local_one_bit_for_bit() {
    let scene = rain();
    for (regions, nodes) in [(2, 2), (8, 3)] {
        let (server, _data) = serve(&scene, regions, nodes, Pace::Unpaced, Some(200));
        let members: Vec<_> = (0..nodes).map(|_| start_node(&server)).collect();
        assert!(server.wait(LIMIT, |_, _| false), "the world must end by itself");
        let summary = server.stop().unwrap();
        let transfers: u64 = members.into_iter().map(|member| member.finish().unwrap().transfers).sum();
        assert_eq!((summary.tick, summary.lost, summary.doubled), (Tick(200), 0, 0));
        let config =
            WorldConfig { partitioning: Partitioning::Regions(regions), ..WorldConfig::for_scene(&scene) };
        let mut local = LocalWorld::from_scene(&scene, config).unwrap();
        for _ in 0..200 {
            local.step().unwrap();
        }
        assert!(transfers > 0, "the test needs traffic");
        assert_eq!(transfers, local.stats().transfers);
        assert_eq!(summary.state_hash, Some(local.state_hash()), "{regions} regions on {nodes} nodes");
    }
}

#[test]
fn a_world_of_this_process_is_served_as_it_is() {
    let scene = Scene::named("ragdolls", &Params::new().with("count", 4)).unwrap();
    let config = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
    let mut local = LocalWorld::from_scene(&scene, config).unwrap();
    let made = local.insert_at(
        WorldPose::at([0.3, 6.0, 0.1]),
        RigidBodyBuilder::dynamic().user_data(77),
        vec![ColliderBuilder::ball(0.4)],
    );
    let origin = Origin::World(&local);
    let (server, _data) = serve_origin(origin, 2, Pace::Unpaced, Some(120), GroupConfig::default());
    let members = [start_node(&server), start_node(&server)];
    let client = connect(&server);
    assert_eq!(client.body(made.unwrap()).unwrap().body.user_data, 77);
    assert!(server.wait(LIMIT, |_, _| false), "the world must end by itself");
    let summary = server.stop().unwrap();
    let transfers: u64 = members.into_iter().map(|member| member.finish().unwrap().transfers).sum();
    for _ in 0..120 {
        local.step().unwrap();
    }
    assert_eq!((summary.state_hash, transfers), (Some(local.state_hash()), local.stats().transfers));
}

/// A batch of moving bodies exceeds the queue of a link. No body may be silent for long, whatever its number.
#[test]
fn a_client_of_thousands_of_moving_bodies_hears_of_each() {
    const BODIES: u32 = 4_000;
    let mut local = LocalWorld::new(WorldConfig {
        step: StepSettings { gravity: [0.0; 3], ..StepSettings::default() },
        ..WorldConfig::default()
    })
    .unwrap();
    for i in 0..BODIES {
        let at = [f64::from(i % 40) * 2.0 - 40.0, f64::from(i / 40 % 10) * 2.0, f64::from(i / 400) * 2.0];
        let body = RigidBodyBuilder::dynamic().linvel(Vector::new(0.3, 0.1, 0.2)).can_sleep(false);
        local.insert_at(WorldPose::at(at), body, [ColliderBuilder::ball(0.2)]).unwrap();
    }
    let (server, _data) =
        serve_origin(Origin::World(&local), 1, Pace::RealTime, None, GroupConfig::default());
    let client = connect(&server);
    let _node = start_node(&server);
    let (mut silent, mut checked) = (0, 0);
    while checked < 60 {
        let seen = client.updates();
        assert!(client.wait_update(seen, LIMIT), "the world goes on");
        let tick = client.tick().0;
        if tick > 120 {
            checked += 1;
            let mut bodies = 0;
            client.with_bodies(|view| {
                silent = silent.max(tick.saturating_sub(view.tick.0));
                bodies += 1;
                None::<()>
            });
            assert_eq!(bodies, BODIES);
        }
    }
    println!("none was silent for more than {silent} ticks");
    // A batch comes every third tick, and three batches cover all bodies. Some datagrams may be lost.
    assert!(silent <= 30, "one was silent for {silent} ticks");
}

/// A world that has already run goes on with its bodies' poses and velocities.
#[test]
fn a_world_that_has_run_goes_on_at_nodes() {
    let scene = Scene::named("terrain", &Params::new().with("n", 60)).unwrap();
    let config = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
    let mut local = LocalWorld::from_scene(&scene, config).unwrap();
    for _ in 0..90 {
        local.step().unwrap();
    }
    let before: Vec<_> = local.host().states().map(|(id, _, pose, velocity)| (id, pose, velocity)).collect();
    let (server, _data) =
        serve_origin(Origin::World(&local), 1, Pace::Unpaced, Some(200), GroupConfig::default());
    let client = connect(&server);
    let served = client.with_bodies(|view| {
        let body = &view.body;
        (body.traits.kind != BodyKind::Fixed).then_some((body.id, body.state.pose, body.state.velocity))
    });
    assert_eq!(served, before);
    let node = start_node(&server);
    assert!(server.wait(LIMIT, |_, _| false), "the world must end by itself");
    let summary = server.stop().unwrap();
    node.finish().unwrap();
    assert_eq!((summary.tick, summary.bodies, summary.lost), (Tick(200), 60, 0));
}

/// Runs a world on nodes and in this process, and compares the results and the exchanges.
#[track_caller]
fn equals_a_local_world(scene: &Scene, config: &WorldConfig, nodes: usize, ticks: u64) -> Stats {
    let (server, _data) = serve_world(scene, config.clone(), nodes, Pace::Unpaced, Some(ticks));
    let members: Vec<_> = (0..nodes).map(|_| start_node(&server)).collect();
    assert!(server.wait(LIMIT, |_, _| false), "the world must end by itself");
    let summary = server.stop().unwrap();
    let members: Vec<_> = members.into_iter().map(|member| member.finish().unwrap()).collect();
    assert_eq!((summary.tick, summary.lost, summary.doubled), (Tick(ticks), 0, 0));
    let mut local = LocalWorld::from_scene(scene, config.clone()).unwrap();
    let (mut exchanges, mut disagreement) = (0, 0.0f32);
    for _ in 0..ticks {
        local.step().unwrap();
        exchanges += local.stats().exchanges as u64;
        disagreement = disagreement.max(local.stats().disagreement_m_s);
    }
    let what = format!("{} by {} on {nodes} nodes", scene.name, config.step.coupling.name());
    assert_eq!(summary.state_hash, Some(local.state_hash()), "{what}");
    assert_eq!(members.iter().map(|member| member.transfers).sum::<u64>(), local.stats().transfers, "{what}");
    for member in &members {
        assert_eq!(member.exchanges_sum, exchanges, "{what}: all take the same rounds");
    }
    let told = members.iter().map(|member| member.disagreement_max_m_s).fold(0.0, f32::max);
    assert_eq!(told, disagreement, "{what}");
    let mut stats = local.stats();
    (stats.exchanges, stats.disagreement_m_s) = (exchanges as usize, disagreement);
    stats
}

/// Cars drive through districts out of sight, some of which sleep. What the viewpoint sees is computed in
/// full.
#[test]
fn a_served_town_that_is_computed_less_where_nobody_looks_equals_a_local_one() {
    let scene = Scene::named("town", &Params::new().with("n", 900).with("cars", 4)).unwrap();
    let config = WorldConfig { fidelity: Fidelity::AUTO, ..WorldConfig::for_scene(&scene) };
    let stats = equals_a_local_world(&scene, &config, 3, 240);
    assert!(stats.transfers > 0, "the test needs traffic");
    let mut local = LocalWorld::from_scene(&scene, config).unwrap();
    (0..240).for_each(|_| local.step().unwrap());
    let report = local.fidelity_report().unwrap();
    assert!(report.levels[2] > 8 && report.audits > 0, "{report:?}");
}

/// The leader decides which regions stay behind, whichever node computes them. Each node's recording must
/// contain that.
#[test]
fn a_recorded_town_that_was_served_and_computed_less_where_nobody_looks_is_replayed_bit_for_bit() {
    const TICKS: u64 = 240;
    let scene = Scene::named("town", &Params::new().with("n", 900).with("cars", 4)).unwrap();
    let world = WorldConfig { fidelity: Fidelity::AUTO, ..WorldConfig::for_scene(&scene) };
    let (server, _data) = serve_world(&scene, world, 2, Pace::Unpaced, Some(TICKS));
    let folder = tempfile::tempdir().unwrap();
    let files = ["a.dcdr", "b.dcdr"].map(|name| folder.path().join(name));
    let members = files.each_ref().map(|file| start_node_recorded_to(&server, Some(file.clone())));
    assert!(server.wait(LIMIT, |_, _| false), "the world must end by itself");
    assert_eq!(server.stop().unwrap().tick, Tick(TICKS));
    members.into_iter().for_each(|member| drop(member.finish().unwrap()));
    let open = |file: &PathBuf| (file.display().to_string(), open_recording(file, 1, None).unwrap());
    let mut replay = Replay::new(files.iter().map(open).collect()).unwrap();
    let mut late = 0;
    while replay.advance(Tick(u64::MAX)).unwrap() {
        let hosts = replay.members().filter_map(replayed_regions);
        let ticks = hosts.flat_map(|host| host.regions().map(|region| host.behind(region.id())));
        late += ticks.filter(|ticks| *ticks > 0).count();
    }
    assert_eq!(replay.mismatch(), None);
    // The initial state has digests, too.
    assert_eq!((replay.ticks(), replay.matches()), (TICKS, 24 * (TICKS + 1)));
    assert!(late > 1_000, "{late}");
}

/// The planes that cut a world.
type Planes = Vec<(Axis, f64)>;

/// Returns scenes that press across borders, with the cuts and the number of nodes for it: a tower of boxes,
/// a row of touching balls, a heap.
fn pressed_borders() -> [(Scene, Planes, usize); 3] {
    let tower = Scene::named("tower", &Params::new().with("sleep", 0)).unwrap();
    let row = r#"
        [world]
        name = "row"
        gravity = [0, 0, 0]
        bounds = { min = [-10, -2, -2], max = [10, 2, 2] }
        [[body]]
        position = [-6, 0, 0]
        velocity = [4, 0, 0]
        [[body.collider]]
        shape = "sphere"
        radius = 0.5
        restitution = 1
        [[grid]]
        count = [6, 1, 1]
        spacing = [1, 1, 1]
        [grid.body]
        position = [-2.6, 0, 0]
        [[grid.body.collider]]
        shape = "sphere"
        radius = 0.5
        restitution = 1
    "#;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("row.toml");
    std::fs::write(&path, row).unwrap();
    let row = Scene::load(&path, &Params::new()).unwrap();
    let heap = Scene::named("heap", &Params::new().with("n", 60)).unwrap();
    let (x, y, z) = (Axis::X, Axis::Y, Axis::Z);
    [(tower, vec![(y, 5.0)], 2), (row, vec![(x, -1.1), (x, 1.4)], 3), (heap, vec![(x, 0.3), (z, 0.2)], 3)]
}

fn borders_equal_a_local_world(coupling: Coupling, exchanges: usize) {
    for (scene, cuts, nodes) in pressed_borders() {
        let config = WorldConfig::for_scene(&scene);
        let step = StepSettings { exchanges, ..config.step.with_coupling(coupling) };
        let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), step, ..config };
        let stats = equals_a_local_world(&scene, &config, nodes, 120);
        if coupling == Coupling::Overlap {
            assert!(stats.disagreement_m_s > 0.0, "{}: the test needs a border that is pressed", scene.name);
        }
    }
}

#[test]
fn regions_that_exchange_twice_a_tick_agree_over_the_network_as_in_one_process() {
    borders_equal_a_local_world(Coupling::Overlap, 2);
}

#[test]
fn islands_move_over_the_network_as_in_one_process() {
    borders_equal_a_local_world(Coupling::Island, 2);
}

#[test]
fn the_owner_s_word_counts_over_the_network_as_in_one_process() {
    borders_equal_a_local_world(Coupling::Owner, 1);
}

#[test]
fn rounds_vary_over_the_network_as_in_one_process() {
    borders_equal_a_local_world(Coupling::Auto, 4);
    // Without small islands and with little tolerance, borders take more and more exchanges.
    let (scene, cuts, nodes) = pressed_borders().into_iter().next().unwrap();
    let config = WorldConfig::for_scene(&scene);
    let step = StepSettings { island_limit: 0, tolerance_m_s: 1e-4, ..config.step };
    let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), step, ..config };
    let stats = equals_a_local_world(&scene, &config, nodes, 90);
    assert!(stats.exchanges > 90 && stats.exchanges < 4 * 90, "{} exchanges", stats.exchanges);
}

/// A world with automatic cuts has one region per node as nodes come and go, without an additional view for
/// each cut.
#[test]
fn every_node_that_comes_gets_a_region_and_what_one_leaves_is_merged() {
    let scene = rain();
    let (server, _data) = serve_world(&scene, WorldConfig::for_scene(&scene), 1, Pace::RealTime, None);
    let mut members = Vec::new();
    let is_dealt = |view: Option<&View>, nodes: usize| {
        view.is_some_and(|view| {
            let owners: BTreeSet<_> = view.allocation.values().collect();
            view.members.len() == nodes && owners.len() == nodes && view.allocation.len() == nodes
        })
    };
    for nodes in [1, 2, 3, 4] {
        members.push(start_node(&server));
        let dealt = server.wait(LIMIT, |_, view| is_dealt(view, nodes));
        assert!(dealt, "{nodes} nodes: {:?}", server.view());
    }
    let views = server.summary().views;
    // Balls fall on one another, so that the load moves about.
    let tick = server.summary().tick.0;
    assert!(server.wait(LIMIT, |summary, _| summary.tick.0 > tick + 120));
    assert_eq!(server.summary().views, views, "planes move within a view");
    for nodes in [3, 2, 1] {
        let gone = members.pop().unwrap();
        gone.leave();
        gone.finish().unwrap();
        let dealt = server.wait(LIMIT, |_, view| is_dealt(view, nodes));
        assert!(dealt, "{nodes} nodes: {:?}", server.view());
    }
    let summary = server.stop().unwrap();
    assert_eq!((summary.bodies, summary.lost, summary.doubled), (300, 0, 0));
    assert!(summary.repartitions >= 6, "{summary:?}");
}

#[test]
fn a_client_drives_an_avatar_through_a_served_world_and_continues_after_a_pause() {
    let scene = Scene::named("pile", &Params::new().with("n", 100)).unwrap();
    let (server, data) = serve(&scene, 2, 2, Pace::RealTime, None);
    let members: Vec<_> = (0..2).map(|_| start_node(&server)).collect();
    let mut config = JoinConfig::new(server.address, server.token(JoinRole::Client, LIMIT).unwrap());
    config.identity = Some(data.path().join("me"));
    let mut client = ClientWorld::connect(&config).unwrap();
    let ball = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
    let body = RigidBodyBuilder::kinematic_velocity_based();
    let avatar = client.spawn(WorldPose::at([-12.0, 1.0, 0.75]), &body.build(), &[ball]).unwrap();
    assert!(client.wait_body(avatar, LIMIT), "{:?}", client.take_events());
    let east = Velocity { linear: [10.0, 0.0, 0.0], angular: [0.0; 3] };
    let mut touches = Vec::new();
    while client.body(avatar).unwrap().body.state.pose.translation[0] < 0.0 {
        client.send_input(avatar, east, None).unwrap();
        let seen = client.updates();
        assert!(client.wait_update(seen, LIMIT));
        let events = client.take_events();
        assert!(events.refusals.is_empty(), "{:?}", events.refusals);
        touches.extend(events.touches);
    }
    assert!(touches.iter().any(|(_, touch)| touch.began), "the avatar must have run into towers");
    let too_fast = Velocity { linear: [100.0, 0.0, 0.0], angular: [0.0; 3] };
    client.send_input(avatar, too_fast, None).unwrap();
    let id = client.id();
    client.leave().unwrap();

    config.token = server.token(JoinRole::Client, LIMIT).unwrap();
    let client = ClientWorld::connect(&config).unwrap();
    assert_eq!(client.id(), id, "who returns keeps the name");
    assert!(client.wait_body(avatar, LIMIT));
    let x = client.body(avatar).unwrap().body.state.pose.translation[0];
    assert!(x > -1.0, "the avatar continues where it was, not at {x}");
    let summary = server.stop().unwrap();
    assert_eq!((summary.lost, summary.doubled), (0, 0));
    for member in members {
        member.finish().unwrap();
    }
}

#[test]
fn a_participant_computes_and_plays_in_one_process() {
    let scene = Scene::named("pile", &Params::new().with("n", 100)).unwrap();
    let (server, _data) = serve(&scene, 2, 2, Pace::RealTime, None);
    let node = start_node(&server);
    let token = server.token(JoinRole::Participant, LIMIT).unwrap();
    let mut player = ClientWorld::participate(&JoinConfig::new(server.address, token)).unwrap();
    let body = RigidBodyBuilder::dynamic();
    let avatar =
        player.spawn(WorldPose::at([0.0, 30.0, 0.0]), &body.build(), &[ColliderBuilder::ball(0.5)]).unwrap();
    assert!(player.wait_body(avatar, LIMIT), "{:?}", player.take_events());
    let start = player.body(avatar).unwrap().body.state.pose.translation[1];
    while player.body(avatar).unwrap().body.state.pose.translation[1] > start - 1.0 {
        let seen = player.updates();
        assert!(player.wait_update(seen, LIMIT));
    }
    assert!(player.summary().tick.0 > 10 && player.summary().regions == 1);
    player.leave().unwrap();
    // The world goes on with the remaining node.
    assert!(server.wait(LIMIT, |summary, _| summary.nodes == 1));
    let before = node.tick();
    assert!(server.wait(LIMIT, |_, _| node.tick().0 > before.0 + 10));
    let summary = server.stop().unwrap();
    assert_eq!((summary.lost, summary.doubled), (0, 0));
    assert_eq!(node.finish().unwrap().regions, 2);
}

/// Bodies fall, roll, come to rest and cross the border between a node and a participant.
#[test]
fn what_a_participant_computes_is_computed_once_more_to_the_same_bits() {
    let scene = rain();
    let world = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
    let data = tempfile::tempdir().unwrap();
    let config = ServeConfig { nodes: 2, verify: 1.0, pace: Pace::RealTime, ..ServeConfig::new(data.path()) };
    let server = ServerProcess::start(Origin::Scene(&scene, &world), config.clone()).unwrap();
    let node = start_node(&server);
    let token = server.token(JoinRole::Participant, LIMIT).unwrap();
    let player = ClientWorld::participate(&JoinConfig::new(server.address, token)).unwrap();
    assert!(server.wait(LIMIT, |summary, _| summary.tick >= Tick(300) && node.summary().verified >= 295));
    assert_eq!(server.view().unwrap().members.len(), 2, "it is right, and stays");
    assert!(player.summary().transfers > 0, "the test needs traffic");
    server.stop().unwrap();
    node.finish().unwrap();
    // With `lag_ticks` it is not known who sent what in which tick. A share above 1 is refused, too.
    let groups = GroupConfig { lag_ticks: 6, ..GroupConfig::default() };
    for wrong in [ServeConfig { groups, ..config.clone() }, ServeConfig { verify: 1.5, ..config }] {
        let error = ServerProcess::start(Origin::Scene(&scene, &world), wrong).err().unwrap().to_string();
        assert!(error.contains("verify is 1"), "{error}");
    }
}

/// Members are at most six ticks ahead of one another: all their messages arrive late. No body is lost on the
/// way, and nobody is taken for one that hangs, though two clients join with them.
#[test]
fn members_that_are_not_in_step_lose_and_double_nothing_and_evict_nobody() {
    let scene = rain();
    let mut world = WorldConfig { partitioning: Partitioning::Regions(8), ..WorldConfig::for_scene(&scene) };
    world.step = world.step.with_coupling(Coupling::Owner);
    let groups = GroupConfig { lag_ticks: 6, ..GroupConfig::default() };
    let (server, _data) =
        serve_origin(Origin::Scene(&scene, &world), 3, Pace::Unpaced, Some(400), groups.clone());
    let clients = [-4.0, 4.0].map(|x| {
        let mut client = connect(&server);
        let ball = ColliderBuilder::ball(0.5);
        client.spawn(WorldPose::at([x, 20.0, 0.0]), &RigidBodyBuilder::dynamic().build(), &[ball]).unwrap();
        client
    });
    let members: Vec<_> = (0..3).map(|_| start_node(&server)).collect();
    assert!(server.wait(LIMIT, |_, _| false), "the world must end by itself");
    let summary = server.stop().unwrap();
    assert_eq!((summary.views, summary.nodes), (1, 3), "whoever is evicted or comes back begins a view");
    assert!(clients.iter().all(|client| client.updates() > 0), "both have seen the world");
    let transfers: u64 = members.into_iter().map(|member| member.finish().unwrap().transfers).sum();
    assert_eq!((summary.tick, summary.lost, summary.doubled), (Tick(400), 0, 0));
    assert!(transfers > 20, "the test needs traffic: {transfers}");
    // Members that are not in step cannot agree on means.
    world.step = world.step.with_coupling(Coupling::Overlap);
    let data = tempfile::tempdir().unwrap();
    let config = ServeConfig { pace: Pace::Unpaced, groups, ..ServeConfig::new(data.path().to_owned()) };
    let error = ServerProcess::start(Origin::Scene(&scene, &world), config).err().unwrap().to_string();
    assert!(error.contains("overlap") && error.contains("--coupling owner"), "{error}");
}

/// A delay threshold that no pair of nodes can meet puts each node in a group of its own, and each computes
/// the whole world.
#[test]
fn nodes_far_from_one_another_compute_the_world_each_and_agree() {
    let scene = Scene::named("pile", &Params::new().with("n", 60)).unwrap();
    let delay = DelayThresholds { inclusion_ms: 1e-4, rejection_ms: 1e4, deviation_ms: 0.0 };
    let thresholds = Thresholds { delay: Some(delay), ..Thresholds::default() };
    let groups = GroupConfig { thresholds, ..GroupConfig::default() };
    let world = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
    let (server, _data) = serve_origin(Origin::Scene(&scene, &world), 2, Pace::RealTime, None, groups);
    let members = [start_node(&server), start_node(&server)];
    assert!(server.wait(LIMIT, |_, _| members.iter().all(|node| node.tick().0 > 60)));
    let client = connect(&server);
    let seen = client.updates();
    assert!(client.wait_update(seen, LIMIT));
    let summary = server.stop().unwrap();
    assert_eq!((summary.nodes, summary.lost, summary.doubled), (1, 0, 0), "one in the main group");
    for member in members {
        let done = member.finish().unwrap();
        assert_eq!((done.regions, done.bodies as usize), (2, 60), "{done:?}");
    }
}

#[test]
fn what_is_wrong_on_entering_is_said() {
    let scene = Scene::named("tower", &Params::new()).unwrap();
    let (server, data) = serve(&scene, 1, 1, Pace::RealTime, None);
    let token = server.token(JoinRole::Node, LIMIT).unwrap();
    let config = JoinConfig::new(server.address, &token);
    let error = ClientWorld::connect(&config).err().unwrap().to_string();
    assert!(error.contains("node") && error.contains("client"), "{error}");
    config.join(JoinRole::Node).unwrap();
    let error = config.join(JoinRole::Node).err().unwrap().to_string();
    assert!(error.contains("used"), "{error}");
    let error = JoinConfig::new(server.address, "no token").join(JoinRole::Node).err().unwrap().to_string();
    assert!(error.contains("token"), "{error}");
    let twice = ServeConfig { listen: server.address, ..ServeConfig::new(data.path().join("other")) };
    let world = WorldConfig::for_scene(&scene);
    let error = ServerProcess::start(Origin::Scene(&scene, &world), twice).err().unwrap().to_string();
    assert!(error.contains("port") || error.contains("in use"), "{error}");
    // Without a node there is a world, but nobody computes it. The client is told the scene all the same.
    let client = connect(&server);
    assert_eq!(client.with_bodies(|body| Some(body.body.id)).len(), scene.bodies.len());
    drop(server);
    assert!(client.wait_update(u64::MAX - 1, LIMIT) || client.check().is_err());
}

#[test]
fn a_node_that_is_alone_and_waits_for_no_clock_hears_that_the_world_ends() {
    let (server, _data) = serve(&rain(), 1, 1, Pace::Unpaced, None);
    let node = start_node(&server);
    assert!(server.wait(LIMIT, |summary, _| summary.tick >= Tick(300)));
    let last = server.summary().tick;
    let summary = server.stop().unwrap();
    assert_eq!((summary.lost, summary.doubled, summary.unaudited), (0, 0, false));
    let told = node.finish().unwrap().tick;
    assert!(told >= last && told.0 < last.0 + 3_000, "{told:?} after {last:?}");
}

#[test]
fn a_participant_that_is_alone_and_waits_for_no_clock_sees_what_it_computes() {
    let (server, _data) = serve(&rain(), 1, 1, Pace::Unpaced, None);
    let token = server.token(JoinRole::Participant, LIMIT).unwrap();
    let player = ClientWorld::participate(&JoinConfig::new(server.address, token)).unwrap();
    let seen = player.updates();
    assert!(player.wait_update(seen, LIMIT), "{:?}", player.check());
    assert!(player.tick() > Tick(0));
    server.stop().unwrap();
}

#[test]
fn an_avatar_that_is_sent_to_the_other_end_of_the_world_gets_there_and_all_nodes_go_on() {
    let mut scene = Scene::empty("corridor");
    scene.push_fixed_box([0.0, -0.5, 0.0], [120.0, 0.5, 5.0], &ColliderBuilder::ball(1.0));
    for i in 0..24 {
        let at = WorldPose::at([10.0 * f64::from(i) - 115.0, 1.0, 0.0]);
        scene.push(at, RigidBodyBuilder::dynamic().can_sleep(false), ColliderBuilder::ball(0.5));
    }
    scene.bounds = dcd::space::Bounds::new([-120.0, -1.0, -5.0], [120.0, 9.0, 5.0]);
    let (server, _data) = serve(&scene, 8, 4, Pace::RealTime, None);
    let nodes: Vec<_> = (0..4).map(|_| start_node(&server)).collect();
    assert!(server.wait(LIMIT, |summary, _| summary.tick >= Tick(1)));
    let mut client = connect(&server);
    let avatar = client
        .spawn(
            WorldPose::at([-100.0, 4.0, 0.0]),
            &RigidBodyBuilder::dynamic().build(),
            &[ColliderBuilder::ball(0.5)],
        )
        .unwrap();
    assert!(client.wait_body(avatar, LIMIT));
    for x in [100.0, -100.0, 30.0, -60.0, 110.0] {
        client.send_input(avatar, Velocity::default(), Some(WorldPose::at([x, 4.0, 0.0]))).unwrap();
        let is_there = |client: &ClientWorld| {
            (client.body(avatar).unwrap().body.state.pose.translation[0] - x).abs() < 2.0
        };
        let mut seen = client.updates();
        while !is_there(&client) {
            assert!(client.wait_update(seen, LIMIT), "the world goes on");
            seen = client.updates();
        }
    }
    let summary = server.stop().unwrap();
    // At most one view per node that came.
    assert!(summary.views <= 4, "{summary:?}");
    assert_eq!((summary.lost, summary.doubled), (0, 0));
    nodes.into_iter().for_each(|node| drop(node.finish().unwrap()));
}

#[test]
fn a_node_that_others_cannot_reach_stops_nobody() {
    let (server, _data) = serve(&rain(), 4, 2, Pace::RealTime, None);
    let nodes: Vec<_> = (0..2).map(|_| start_node(&server)).collect();
    assert!(server.wait(LIMIT, |summary, _| summary.tick >= Tick(60)));
    let views = server.summary().views;
    let token = server.token(JoinRole::Node, LIMIT).unwrap();
    let identity = JoinConfig::new(server.address, token).join(JoinRole::Node).unwrap();
    // Nobody listens at this address.
    let nowhere = Some(([127, 0, 0, 1], 9).into());
    let stranger =
        Member::start(MemberConfig { advertise: nowhere, ..MemberConfig::new(server.address, identity) })
            .unwrap();
    // It computes the world by itself, while the others go on with their membership.
    let alone = stranger.who.node().unwrap();
    let begins = std::time::Instant::now();
    while stranger.summary().regions < 4 {
        assert!(begins.elapsed() < LIMIT, "{alone:?} computes nothing");
        let tick = server.summary().tick.0;
        assert!(server.wait(LIMIT, |summary, _| summary.tick.0 >= tick + 6), "the world goes on");
        assert_eq!(server.summary().views, views);
        assert!(server.view().unwrap().members.iter().all(|member| member.node != alone));
    }
    // Its group is gone with it, but not the world.
    stranger.leave();
    drop(stranger.finish());
    let (tick, mut fewest) = (server.summary().tick.0, 2);
    assert!(server.wait(LIMIT, |summary, view| {
        fewest = fewest.min(summary.nodes).min(view.map_or(0, |view| view.members.len()));
        summary.tick.0 >= tick + 60
    }));
    assert_eq!(fewest, 2, "members that the server shows");
    assert_eq!(server.stop().unwrap().lost, 0);
    nodes.into_iter().for_each(|node| drop(node.finish().unwrap()));
}

#[test]
fn a_recording_of_what_went_wrong_is_not_recorded_over() {
    let data = tempfile::tempdir().unwrap();
    let record = data.path().join("before.dcdr");
    std::fs::write(&record, "what went wrong").unwrap();
    let config = ServeConfig { record: Some(record.clone()), ..ServeConfig::new(data.path().join("world")) };
    let scene = rain();
    let refused = dcd::World::serve(&scene, &WorldConfig::for_scene(&scene), config).err().unwrap();
    assert!(refused.to_string().contains("record to another file"), "{refused}");
    assert_eq!(std::fs::read_to_string(&record).unwrap(), "what went wrong");
}
