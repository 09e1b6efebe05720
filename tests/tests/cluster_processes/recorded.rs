//! Tests recordings of real processes: what they computed is computed again, even by a process that was
//! killed.

use crate::process::{Process, Server, alone, dcd, playground};

#[test]
fn a_cluster_of_which_a_node_was_killed_is_replayed_to_the_recorded_digests() {
    let _by_itself = alone();
    let recordings = tempfile::tempdir().unwrap();
    let file = |name: &str| recordings.path().join(name).to_str().unwrap().to_owned();
    let scene = playground();
    let server_file = file("server.dcdr");
    let args = [scene.to_str().unwrap(), "--nodes", "2", "--record", &server_file];
    let mut server = Server::start(&args);
    let node =
        |server: &Server, who, name| server.node_with(&["--identity", &file(who), "--record", &file(name)]);
    let mut nodes = [node(&server, "a", "a.dcdr"), node(&server, "b", "b.dcdr")];
    server.view();
    let witness = server.witness();
    witness.advance(60);
    nodes[0].1.kill();
    server.view();
    witness.advance(30);
    // With the killed node's identity, so that two files are of the same node.
    let third = node(&server, "a", "c.dcdr");
    assert_eq!(third.0, nodes[0].0);
    server.view();
    witness.advance(30);
    witness.leave();
    let tick = server.end_world()["tick"].as_u64().unwrap();
    for (_, node) in [third, nodes.into_iter().last().unwrap()] {
        assert_eq!(node.end().code(), Some(0));
    }

    let folder = recordings.path().to_str().unwrap();
    let replay = |args: &[&str]| Process::start(dcd(&["replay", folder, "--json"]).args(args)).end();
    let whole = replay(&["--check"]);
    assert_eq!((whole.code(), &whole.json()["mismatch"]), (Some(0), &serde_json::Value::Null), "{whole:?}");
    assert_eq!(whole.json()["ticks"], tick, "{whole:?}");
    assert!(whole.json()["matches"].as_u64().unwrap() > tick, "{whole:?}");

    let alone = Process::start(&mut dcd(&["replay", &server_file, "--check", "--json"])).end();
    assert_eq!((alone.code(), &alone.json()["mismatch"]), (Some(0), &serde_json::Value::Null), "{alone:?}");
    assert!(alone.json()["matches"].as_u64().unwrap() > 5, "{alone:?}");

    let diff = |with: &str| Process::start(&mut dcd(&["diff", folder, with, "--json"])).end();
    let itself = diff(folder);
    assert_eq!(itself.json(), serde_json::json!({"ticks": tick, "difference": null}), "{itself:?}");
    let bodiless = diff(&server_file);
    assert_eq!(bodiless.code(), Some(1), "{bodiless:?}");
    assert!(bodiless.errors.contains("recording of a server, which has no bodies"), "{bodiless:?}");
    let dumped = Process::start(&mut dcd(&["replay", &server_file, "--dump", "70"])).end();
    assert!(dumped.code() == Some(1) && dumped.lines.is_empty(), "{dumped:?}");
    assert!(dumped.errors.contains("recording of a server, which has no bodies"), "{dumped:?}");

    let now = Process::start(&mut dcd(&["replay", folder, "--dump", &(tick - 1).to_string()])).end();
    let ids: Vec<_> = now.lines.iter().map(|line| line.split(',').next().unwrap()).collect();
    let once: std::collections::BTreeSet<_> = ids.iter().collect();
    assert!(ids.len() > 150 && once.len() == ids.len(), "each body once: {ids:?}");
    let dump = Process::start(&mut dcd(&["replay", folder, "--dump", "70"])).end();
    let body = dump.lines[1].split(',').next().unwrap().to_owned();
    let disturbed = replay(&["--check", "--flip", &format!("70:{body}:330")]);
    let found = &disturbed.json()["mismatch"];
    assert_eq!(disturbed.code(), Some(1), "{disturbed:?}");
    assert_eq!((&found["tick"], &found["body"]), (&70.into(), &body.as_str().into()), "{disturbed:?}");
    assert_eq!(found["field"], "linvel.x", "{disturbed:?}");
    assert_ne!(found["recorded"], found["replayed"], "{disturbed:?}");
}

#[test]
fn a_world_of_processes_does_not_differ_from_a_local_one() {
    let scene = ["terrain", "--set", "n=200", "--regions", "2"];
    let server = Server::start(&[&scene[..], &["--nodes", "2", "--unpaced", "--ticks", "120"]].concat());
    let folder = tempfile::tempdir().unwrap();
    let served = folder.path().join("served");
    std::fs::create_dir(&served).unwrap();
    let file = |name: &str| served.join(name).to_str().unwrap().to_owned();
    let nodes = ["a.dcdr", "b.dcdr"].map(|name| server.node_with(&["--record", &file(name)]));
    assert_eq!(server.process.end().code(), Some(0));
    nodes.into_iter().for_each(|(_, node)| assert_eq!(node.end().code(), Some(0)));
    let local = folder.path().join("local.dcdr");
    let run = |local: &std::path::Path, more: &[&str]| {
        let mut command = dcd(&["run", "--seconds", "2"]);
        Process::start(command.args(scene).args(more).arg("--record").arg(local)).end().code()
    };
    assert_eq!(run(&local, &[]), Some(0));
    let diff = |a: &std::path::Path, b: &std::path::Path| {
        Process::start(dcd(&["diff", "--json"]).arg(a).arg(b)).end()
    };
    let alike = diff(&served, &local);
    assert_eq!((alike.code(), &alike.json()["difference"]), (Some(0), &serde_json::Value::Null), "{alike:?}");
    assert_eq!(alike.json()["ticks"], 120);

    let other = folder.path().join("other.dcdr");
    assert_eq!(run(&other, &["--set", "seed=2"]), Some(0));
    let unlike = diff(&local, &other);
    assert_eq!((unlike.code(), &unlike.json()["difference"]["tick"]), (Some(1), &1.into()), "{unlike:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_server_whose_recording_is_not_whole_says_so_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let args = [
        "serve",
        "tower",
        "--record",
        "/dev/full",
        "--until-stdin-ends",
        "--listen",
        "127.0.0.1:0",
        "--data",
    ];
    let ended = Process::start(dcd(&args).arg(folder.path())).end();
    assert_eq!(ended.code(), Some(3), "{ended:?}");
    assert!(ended.errors.contains("/dev/full"), "{ended:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_recording_that_is_not_whole_costs_no_summary_and_starts_nobody_again() {
    let unrecorded = ["--record", "/dev/full"];
    let ends = |args: &[&str]| Server::start(&[&["tower", "--unpaced"], args, &unrecorded].concat());
    let server = ends(&["--ticks", "30"]);
    let (_, node) = server.node_with(&unrecorded);
    let served = server.process.end();
    assert_eq!((served.code(), &served.json()["tick"]), (Some(3), &30.into()), "{served:?}");
    assert!(served.errors.contains("the recording is not whole: cannot record to /dev/full"), "{served:?}");
    let node = node.end();
    assert_eq!((node.code(), &node.json()["node"]), (Some(3), &"n1".into()), "{node:?}");

    let mut server = ends(&[]);
    let (_, _node) = server.node();
    server.view();
    server.process.signal("-TERM");
    let served = server.process.end();
    assert_eq!((served.code(), &served.json()["kept"]), (Some(1), &true.into()), "{served:?}");
    assert!(served.errors.contains("the same command goes on with it"), "{served:?}");
}
