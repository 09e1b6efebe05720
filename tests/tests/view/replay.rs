//! Tests the viewer of `dcd replay`, which goes to any tick of a recording, and the glTF files that it
//! writes.

use std::path::Path;

use crate::process::{GO, PAST, PAUSE, Page, Process, SEE, SPEED, STEP, Seen};

/// Records a pile for two seconds, and returns the file of the recording.
fn recorded(folder: &Path) -> String {
    let file = folder.join("pile.dcdr").to_str().unwrap().to_owned();
    let scene = ["run", "pile", "--set", "n=100", "--regions", "3", "--seconds", "2", "--json"];
    Process::start(&[&scene[..], &["--record", &file]].concat()).line("{\"scene\"");
    file
}

/// Goes to a tick of the recording.
fn go(page: &mut Page, tick: u64) {
    page.ask(GO, tick);
    page.until("it comes to the tick", |seen| seen.tick == tick as f64 && !seen.going);
}

#[test]
fn a_recording_goes_to_any_tick_forwards_and_backwards() {
    let folder = tempfile::tempdir().unwrap();
    let mut process = Process::start(&["replay", &recorded(folder.path()), "--view", "--threads", "1"]);
    let mut page = Page::open(&process.line("view ")).unwrap();
    page.until("it is shown", |seen| seen.tick >= 1.0);
    page.ask(PAUSE, 1);
    assert!(page.seen.controls && page.seen.fixed >= 1);
    assert_eq!(page.seen.recorded, Some([1.0, 120.0]));
    go(&mut page, 90);
    let (at_90, regions) = (page.seen.rows.clone(), page.seen.regions);
    assert_eq!((at_90.len(), regions), (100, 3));
    go(&mut page, 20);
    let at_20 = page.seen.rows.clone();
    assert_ne!(at_20, at_90);
    // Pictures of later ticks are not kept, since they would be of another time than their ticks.
    assert_eq!((page.seen.oldest, page.seen.newest), (20.0, 20.0));
    page.ask(STEP, 3);
    page.until("it stepped", |seen| seen.tick == 23.0);
    page.look(PAST, 20);
    assert_eq!(page.seen.rows, at_20);
    go(&mut page, 90);
    assert_eq!(page.seen.rows, at_90, "the same to the bit");
    // Beyond the end it goes to the end, and stays there.
    page.ask(GO, 5000);
    page.until("it comes to the end", |seen| seen.tick == 120.0);
    page.ask(PAUSE, 0);
    page.until("it pauses at the end", |seen| seen.paused);
    page.ask(GO, 0);
    page.until("it comes to the beginning", |seen| seen.tick == 1.0);
    page.ask(SPEED, 0.0f64.to_bits());
    page.ask(PAUSE, 0);
    page.until("it goes on by itself", |seen| seen.tick == 120.0 && seen.paused);
    assert_eq!(process.interrupt(), Some(130));
}

#[test]
fn a_replay_that_is_checked_pauses_where_it_parts_from_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let mut process = Process::start(&["replay", &file, "--view", "--check", "--flip", "50:7"]);
    let mut page = Page::open(&process.line("view ")).unwrap();
    // The picture of a tick is encoded beside the computation, so a pause is told of before it.
    page.until("it parts and shows where", |seen| seen.paused && seen.newest >= 50.0);
    page.look(SEE, 0);
    assert_eq!((page.seen.newest, page.seen.going), (50.0, false));
    assert!(process.line("147 digests are as recorded, up to tick 50: ").contains("body b7, linvel.x"));
}

#[test]
fn nodes_are_seen_as_one_world_when_they_are_replayed() {
    let data = tempfile::tempdir().unwrap();
    let path = |name: &str| data.path().join(name).to_str().unwrap().to_owned();
    std::fs::create_dir(data.path().join("run")).unwrap();
    let world = ["serve", "wall", "--set", "width=40", "--regions", "2", "--nodes", "2", "--ticks", "90"];
    let place = ["--listen", "127.0.0.1:0", "--unpaced", "--data", &path("server"), "--json"];
    let mut server = Process::start(&[&world[..], &place].concat());
    let address = server.line("listening ");
    let nodes: Vec<_> = ["run/a.dcdr", "run/b.dcdr"]
        .into_iter()
        .map(|file| {
            let token = Process::start(&["token", "--data", &path("server"), "--role", "node"]).line("dcd1-");
            let token = format!("dcd1-{token}");
            Process::start(&["node", "--server", &address, "--token", &token, "--record", &path(file)])
        })
        .collect();
    server.line("{\"tick\":90");
    nodes.into_iter().for_each(|node| assert_eq!(node.ended(), Some(0)));

    let film = path("wall.glb");
    let stretch = ["--gltf", &film, "--gltf-seconds", "0.5..1.5", "--check", "--json"];
    let mut replay = Process::start(&[&["replay", &path("run")], &stretch[..]].concat());
    assert!(replay.line("{\"ticks\":90,").ends_with("\"mismatch\":null}"));
    let film = gltf::Gltf::open(&film).unwrap();
    let root = film.default_scene().unwrap().nodes().next().unwrap();
    let extras = |node: &gltf::Node<'_>| -> serde_json::Value {
        serde_json::from_str(node.extras().as_ref().unwrap().get()).unwrap()
    };
    let owners: Vec<_> = root.children().filter_map(|node| extras(&node)["region"].as_u64()).collect();
    assert_eq!((film.animations().count(), owners.len()), (1, 324));
    assert!((100..224).contains(&owners.iter().filter(|&&region| region == owners[0]).count()), "{owners:?}");

    let mut process = Process::start(&["replay", &path("run"), "--view"]);
    let mut page = Page::open(&process.line("view ")).unwrap();
    page.until("it is shown", |seen| seen.tick >= 1.0);
    go(&mut page, 60);
    let Seen { rows, regions, ghosts, nodes, .. } = &page.seen;
    let owners: std::collections::BTreeSet<u8> = rows.iter().map(|row| row.owner).collect();
    assert_eq!((rows.len(), *regions, owners.len()), (324, 2, 2), "each body once");
    assert!(*ghosts > 4 && nodes.len() == 2 && nodes[0] != nodes[1], "{ghosts} ghosts, {nodes:?}");
    let mut one = Process::start(&["replay", &path("run/a.dcdr"), "--view"]);
    let mut page = Page::open(&one.line("view ")).unwrap();
    page.until("one node by itself shows its guests", |seen| seen.rows.len() > 100 && seen.regions == 2);
    assert!(page.seen.rows.len() < 324);
}

#[test]
fn what_cannot_be_seen_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().to_str().unwrap();
    Process::start(&["simulate", "--seeds", "3..4", "--faults", "kill-node", "--record", runs]).ended();
    let simulated = folder.path().join("kill-node-3");
    let mut replay = Process::start(&["replay", simulated.to_str().unwrap(), "--view"]);
    assert!(replay.line("error: ").contains("clusters are points"));
    let both = ["replay", simulated.to_str().unwrap(), "--view", "--json"];
    assert!(Process::start(&both).line("error: ").contains("cannot be used with"));
}
