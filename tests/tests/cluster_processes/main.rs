//! Tests server, nodes and clients as real processes: what they compute, how they end, how they die.
#![cfg(unix)]

mod backed_up;
mod balanced;
mod board;
mod configured;
mod demo;
mod drained;
mod failover;
mod faults;
mod logs;
mod many_clients;
mod metrics;
mod moved_clock;
mod notified;
mod packaged;
mod process;
mod recorded;
mod refused;
mod relays;
mod restarted;
mod resting;
mod saved;
mod status;
mod stored;
mod takeover;
mod versions;
mod walk;
mod weather;
mod witness;
mod wrong;

use std::time::{Duration, Instant};

use dcd::prelude::{ColliderBuilder, RigidBodyBuilder, World};
use dcd::protocol::WorldPose;
use dcd::runtime::{ClientWorld, JoinConfig};
use process::{Process, Server, dcd};

#[test]
fn a_world_of_processes_equals_a_local_one_bit_for_bit() {
    let scene = ["terrain", "--set", "n=300", "--regions", "2"];
    let server = Server::start(&[&scene[..], &["--nodes", "2", "--unpaced", "--ticks", "200"]].concat());
    let nodes = [server.node(), server.node()];
    let served = server.process.end();
    assert_eq!(served.code(), Some(0), "{served:?}");
    let mut transfers = 0;
    for (_, node) in nodes {
        let ended = node.end();
        assert_eq!((ended.code(), ended.json()["tick"].as_u64()), (Some(0), Some(200)), "{ended:?}");
        transfers += ended.json()["transfers"].as_u64().unwrap();
    }
    let local = Process::start(dcd(&["run", "--json", "--seconds", "3.3333333"]).args(scene)).end().json();
    let served = served.json();
    assert_eq!((&served["tick"], &local["ticks"]), (&200.into(), &200.into()));
    assert_eq!((&served["lost"], &served["doubled"]), (&0.into(), &0.into()));
    assert!(transfers > 0, "the test needs traffic");
    assert_eq!(transfers, local["transfers"]);
    assert_eq!(served["state_hash"], local["state_hash"]);
}

#[test]
fn a_client_of_many_avatars_wanders_and_everybody_tells_what_happened() {
    let mut server = Server::playground("2");
    let nodes = [server.node(), server.node()];
    assert!(server.view().starts_with("1 at tick 0: n1 r1, n2 r2; n1 leads"));
    let token = server.token("client");
    let args = ["client", "--json", "--avatars", "5", "--seconds", "2", "--server", &server.address];
    let mut client = Process::start(dcd(&args).args(["--token", &token]));
    assert_eq!(client.line("joined as "), "c1");
    let ended = client.end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    let played = ended.json();
    assert_eq!((&played["avatars"], &played["refusals"]), (&5.into(), &0.into()), "{played}");
    assert!(played["updates"].as_u64().unwrap() > 10, "{played}");
    assert!(played["moved_m"].as_f64().unwrap() > 2.0, "{played}");
    let served = server.stop();
    assert_eq!(
        (&served["nodes"], &served["regions"], &served["bodies"]),
        (&2.into(), &2.into(), &155.into())
    );
    for (name, node) in nodes {
        let ended = node.end();
        assert_eq!(ended.code(), Some(0), "a world that ends is no failure of its nodes: {ended:?}");
        let computed = ended.json();
        assert_eq!((computed["node"].as_str(), &computed["regions"]), (Some(&*name), &1.into()));
        for key in ["tick", "bodies", "bytes", "bytes_per_s", "seconds"] {
            assert!(computed[key].as_f64().unwrap() > 0.0, "{key}: {computed}");
        }
        for key in ["mean", "p50", "p99", "max"] {
            assert!(computed["tick_ms"][key].as_f64().unwrap() > 0.0, "{key}: {computed}");
        }
    }
}

#[test]
fn a_token_for_a_builder_lets_a_client_build_and_one_for_a_client_does_not() {
    let server = Server::playground("1");
    let _node = server.node();
    let config = |role| JoinConfig::new(server.address.parse().unwrap(), server.token(role));
    let [mut builder, mut client] = ["builder", "client"].map(|role| World::connect(&config(role)).unwrap());
    let insert = |world: &mut World| world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.5));
    let refused = insert(&mut client).unwrap_err().to_string();
    assert!(refused.contains("a token that lets it build"), "{refused}");
    let ball = insert(&mut builder).unwrap();
    builder.step().unwrap();
    let witness = ClientWorld::connect(&config("client")).unwrap();
    assert!(witness.wait_body(ball, process::LIMIT));
}

#[test]
fn a_killed_client_continues_where_it_was() {
    let server = Server::playground("1");
    let _node = server.node();
    let me = server.folder.path().join("me");
    let token = server.token("client");
    let mut client = dcd(&["client", "--json", "--server", &server.address, "--token", &token, "--identity"]);
    let mut client = Process::start(client.arg(&me));
    assert_eq!(client.line("joined as "), "c1");
    let server_address = server.address.parse().unwrap();
    let observer = ClientWorld::connect(&JoinConfig::new(server_address, server.token("client"))).unwrap();
    // Watches the avatar until it has moved, and after the client's death until it is removed from the world.
    let avatar = dcd::space::BodyId::avatar(dcd::space::ClientId(1), 0);
    assert!(observer.wait_body(avatar, process::LIMIT));
    let place = || observer.body(avatar).map(|body| body.body.state.pose.translation);
    let first = place().unwrap();
    let mut last = first;
    let distance =
        |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    while distance(first, last) < 1.0 {
        assert!(observer.wait_update(observer.updates(), process::LIMIT));
        last = place().unwrap();
    }
    client.kill();
    while let Some(place) = place() {
        last = place;
        assert!(observer.wait_update(observer.updates(), process::LIMIT));
    }
    let config = JoinConfig { identity: Some(me), ..JoinConfig::new(server_address, server.token("client")) };
    let mut back = ClientWorld::connect(&config).unwrap();
    assert_eq!((back.id().0, back.own_avatars()), (1, vec![avatar]));
    assert!(back.wait_body(avatar, process::LIMIT));
    let now = back.body(avatar).unwrap().body.state.pose.translation;
    // The last report before the avatar was removed is up to three ticks old.
    assert!(distance(now, last) < 1.0, "{now:?} {last:?}");
    let body = rapier3d::prelude::RigidBodyBuilder::kinematic_velocity_based();
    let ball = rapier3d::prelude::ColliderBuilder::ball(0.5);
    let second = back.spawn(WorldPose::at([0.0, 20.0, 0.0]), &body.build(), &[ball]).unwrap();
    assert_ne!(second, avatar);
    drop((back, observer));
    server.stop();
}

#[test]
fn a_node_that_is_told_to_go_hands_its_regions_over_first() {
    let mut server = Server::playground("2");
    let (_, stays) = server.node();
    let (_, goes) = server.node();
    assert!(server.view().contains("n1 r1, n2 r2"));
    goes.interrupt();
    let ended = goes.end();
    assert_eq!(ended.code(), Some(130), "{ended:?}");
    assert!(ended.errors.contains("handed over"), "{ended:?}");
    assert!(server.view().contains("n1 r1 r2; n1 leads"));
    // The last node gives the world back to the server, which keeps it for the next node.
    stays.interrupt();
    assert_eq!(stays.end().code(), Some(130));
    assert!(server.view().starts_with("none"));
    let (name, _next) = server.node();
    assert!(server.view().contains(&format!("{name} r1 r2")));
    assert_eq!(server.stop()["views"], 3);
}

#[test]
fn a_hung_node_does_not_keep_a_server_that_is_to_end() {
    let mut server = Server::playground("2");
    let (hangs, node) = (server.node(), server.node());
    server.view();
    hangs.1.signal("-STOP");
    let served = server.stop();
    assert_eq!(served["bodies"], 155);
    assert_eq!(node.1.end().code(), Some(0));
}

#[test]
fn one_press_that_all_hear_and_some_hear_twice_stops_all_in_order() {
    let mut server = Server::playground("1");
    let (_, mut node) = server.node();
    server.view();
    let token = server.token("participant");
    let args = ["client", "--compute", "--server", &server.address, "--token", &token];
    let mut participant = Process::start(&mut dcd(&args));
    participant.line("joined as ");
    server.view();
    // As a terminal sends Ctrl-C to all processes, and a parent once more to its child.
    let [first, second, last] = [node.id(), participant.id(), server.process.id()];
    let press = format!("kill -INT {first} {second} {last}; sleep 0.003; kill -INT {last}");
    let pressed = Instant::now();
    assert!(std::process::Command::new("sh").args(["-c", &press]).status().unwrap().success());
    let ended = server.process.end();
    assert_eq!((ended.code(), &ended.json()["kept"]), (Some(0), &true.into()), "{ended:?}");
    // A process slower than the server finds nobody to take its regions, and says so.
    for process in [&mut node, &mut participant] {
        let ended = process.end_within(process::LIMIT);
        let unheard = ended.code() == Some(1) && ended.errors.contains("did not take this process's share");
        assert!(ended.code() == Some(130) || unheard, "{ended:?}");
    }
    assert!(pressed.elapsed() < Duration::from_secs(10), "{:?}", pressed.elapsed());
}

#[test]
fn a_participant_whose_world_ends_is_told_so() {
    let mut server = Server::playground("1");
    let token = server.token("participant");
    let args = ["client", "--compute", "--server", &server.address, "--token", &token];
    let mut participant = Process::start(&mut dcd(&args));
    participant.line("joined as ");
    server.view();
    server.stop();
    let ended = participant.end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    assert!(ended.errors.contains("the world has ended"), "{ended:?}");
}

#[test]
fn a_server_that_is_told_to_end_tells_everybody() {
    let mut server = Server::playground("1");
    let (_, node) = server.node();
    server.view();
    let token = server.token("client");
    let mut client = Process::start(&mut dcd(&["client", "--server", &server.address, "--token", &token]));
    client.line("joined as ");
    server.stop();
    assert_eq!(node.end().code(), Some(0));
    let ended = client.end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    assert!(ended.errors.contains("the world has ended"), "{ended:?}");
    assert!(ended.lines.iter().any(|line| line.starts_with("avatars")), "{ended:?}");
}
