//! Tests kill -9 and stops of every role in the demo's world: the world goes on, and nothing is lost or
//! doubled.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use dcd::space::{BodyId, ClientId};

use crate::process::{LIMIT, Process, Server, alone, dcd};
use crate::witness::{Sight, Witness};

/// The longest time that a world with healthy nodes may stand still, on a busy machine.
const PAUSE: Duration = Duration::from_secs(1);
/// The longest time until a killed node's regions go on elsewhere.
const TAKEOVER: Duration = Duration::from_secs(3);
/// The longest time until there is a new leader.
const ELECTION: Duration = Duration::from_secs(2);
/// The longest time until a server is back, or until a process that was given up is back among the others.
const RETURN: Duration = Duration::from_secs(10);

/// The demo's world with two nodes, of which n1 leads, and a client that watches.
struct Demo {
    server: Server,
    nodes: Vec<(String, Process)>,
    witness: Witness,
}

impl Demo {
    fn start() -> Self {
        let mut server = Server::playground("2");
        let nodes = vec![server.node(), server.node()];
        assert!(server.view().contains("n1 r1, n2 r2; n1 leads"));
        let witness = server.witness();
        Self { server, nodes, witness }
    }

    fn node(&mut self, name: &str) -> &mut Process {
        &mut self.nodes.iter_mut().find(|(other, _)| other == name).unwrap().1
    }

    /// Returns the next view that has both nodes, and the time until it came.
    fn both(&mut self) -> (String, Duration) {
        let start = Instant::now();
        loop {
            let view = self.server.view();
            if view.contains("n1 r") && view.contains("n2 r") {
                return (view, start.elapsed());
            }
        }
    }

    /// Ends the world and checks that nothing is lost or doubled and that all living processes end well.
    /// Returns how many ticks each node computed speculatively.
    fn end(self, dead: &[&str]) -> BTreeMap<String, u64> {
        self.end_with(0, dead)
    }

    /// The same, with this many avatars of clients.
    fn end_with(self, avatars: u64, dead: &[&str]) -> BTreeMap<String, u64> {
        self.witness.advance(60);
        let tick = self.witness.tick();
        self.witness.leave();
        let served = self.server.stop();
        assert_eq!(served["bodies"], 155 + avatars);
        let mut speculative = BTreeMap::new();
        for (name, node) in self.nodes.into_iter().filter(|(name, _)| !dead.contains(&&**name)) {
            let ended = node.end();
            assert_eq!(ended.code(), Some(0), "{name}: {ended:?}");
            assert!(ended.json()["tick"].as_u64().unwrap() >= tick, "{name}: {ended:?}");
            speculative.insert(name, ended.json()["speculative"].as_u64().unwrap());
        }
        speculative
    }
}

#[test]
fn a_killed_leader_has_a_successor_within_two_seconds() {
    let _alone = alone();
    // The machine itself may delay an election, so there is a second attempt.
    let elected: Vec<_> = (0..2)
        .map(|_| {
            let mut demo = Demo::start();
            demo.node("n1").kill();
            let start = Instant::now();
            let view = demo.server.view();
            let elected = start.elapsed();
            assert!(view.contains("n2 r1 r2; n2 leads"), "{view}");
            println!("a new leader after {:.2} s", elected.as_secs_f64());
            demo.end(&["n1"]);
            elected
        })
        .collect();
    assert!(elected.iter().any(|elected| *elected < ELECTION), "{elected:?}");
}

#[test]
fn a_killed_server_is_back_within_ten_seconds_and_physics_never_pauses() {
    let _alone = alone();
    let mut demo = Demo::start();
    // Twice, so that a restored server is restored again.
    for _ in 0..2 {
        demo.server.process.kill();
        let tick = demo.witness.tick();
        let alone = demo.witness.watch_for(Duration::from_secs(2));
        assert!(demo.witness.tick() > tick + 60, "the nodes go on by themselves");
        let start = Instant::now();
        demo.server.restart();
        let (view, _) = demo.both();
        let back = start.elapsed();
        let joining = demo.witness.watch_for(Duration::from_secs(1));
        let stood = alone.max(joining);
        println!(
            "a server is back after {:.2} s: {view}; the world stood still for {:.2} s",
            back.as_secs_f64(),
            stood.as_secs_f64()
        );
        assert!(back < RETURN && stood < PAUSE, "{back:?} {stood:?}");
        // The server admits others as before.
        demo.server.witness().leave();
    }
    demo.end(&[]);
}

/// A server is away for this long. Its nodes and the watching client wait, and are there when it is back.
fn is_away_for(away: Duration) {
    let _alone = alone();
    let mut demo = Demo::start();
    demo.server.process.kill();
    let tick = demo.witness.tick();
    let stood = demo.witness.watch_for(away);
    let ticks_per_s = (demo.witness.tick() - tick) as f64 / away.as_secs_f64();
    let start = Instant::now();
    let from = demo.server.restart();
    let (view, _) = demo.both();
    println!(
        "after {away:?} without a server at {ticks_per_s:.1} ticks a second (the world stood still for {stood:.2?}) it goes on \
         from tick {from}: {view} after {:.2?}",
        start.elapsed()
    );
    assert!(ticks_per_s > 30.0 && stood < PAUSE, "{ticks_per_s} {stood:?}");
    assert!(start.elapsed() < RETURN, "{:?}", start.elapsed());
    // The world is at its nodes' tick, not where the server's record ended.
    demo.witness.advance(30);
    assert!(demo.witness.tick() > tick + (away.as_secs_f64() * 30.0) as u64);
    demo.server.witness().leave();
    demo.end(&[]);
}

#[test]
#[ignore = "takes three quarters of a minute"]
fn a_server_that_is_away_for_forty_seconds_finds_its_nodes_computing() {
    is_away_for(Duration::from_secs(40));
}

#[test]
fn a_node_that_dies_while_there_is_no_server_is_taken_over_when_it_is_back() {
    let _alone = alone();
    let mut demo = Demo::start();
    demo.server.process.kill();
    demo.node("n2").kill();
    let start = Instant::now();
    demo.server.restart();
    while !demo.server.view().contains("n1 r1 r2; n1 leads") {}
    demo.witness.advance(30);
    println!("goes on after {:.2} s", start.elapsed().as_secs_f64());
    assert!(start.elapsed() < RETURN);
    demo.end(&["n2"]);
}

#[test]
fn a_world_whose_server_and_nodes_all_die_goes_on_from_the_last_checkpoint() {
    let _alone = alone();
    let mut demo = Demo::start();
    let tick = demo.witness.tick();
    demo.server.process.kill();
    demo.node("n1").kill();
    demo.node("n2").kill();
    demo.server.restart();
    let (_, _next) = demo.server.node();
    let other = demo.server.node();
    while !demo.server.view().contains(&format!("{} r", other.0)) {}
    demo.witness.advance(60);
    assert!(demo.witness.tick() > tick);
    demo.witness.leave();
    let served = demo.server.stop();
    assert_eq!(served["bodies"], 155);
}

/// A node stops, is taken over, and rejoins by itself when it resumes.
fn stop_and_resume_a_node(stop: Duration) {
    let _alone = alone();
    for name in ["n2", "n1"] {
        let mut demo = Demo::start();
        demo.node(name).signal("-STOP");
        let Sight { stood, frozen, guesses, back_m, .. } = demo.witness.see_for(stop);
        assert!(stood < TAKEOVER, "{name}: {stood:?}");
        demo.node(name).signal("-CONT");
        let (view, back) = demo.both();
        println!(
            "{name} stopped for {stop:?}: the world stood still for {stood:.2?}, the picture for {frozen:.2?} ({guesses} \
             speculative, {back_m:.2} m put back); back after {back:.2?}: {view}"
        );
        assert!(back < RETURN, "{name}: {back:?}");
        // A leader that waits for another node shows its clients speculative ticks. If the leader itself is
        // stopped, nobody does.
        assert_eq!(guesses > 0, name == "n2", "{guesses}");
        assert!(name == "n1" || frozen < stood / 2, "{frozen:?} {stood:?}");
        let speculative = demo.end(&[]);
        assert!(speculative["n1"] >= guesses && speculative["n2"] == 0, "{speculative:?}");
    }
}

/// The server stops and its nodes go on. Nothing needs repair when the server resumes.
fn stop_and_resume_the_server(stop: Duration) {
    let _alone = alone();
    let demo = Demo::start();
    demo.server.process.signal("-STOP");
    let stood = demo.witness.watch_for(stop);
    demo.server.process.signal("-CONT");
    let after = demo.witness.watch_for(Duration::from_secs(3));
    println!("the server stopped for {stop:?}: the world stood still for {stood:.2?}, then for {after:.2?}");
    assert!(stood < PAUSE && after < PAUSE, "{stood:?} {after:?}");
    demo.end(&[]);
}

/// A client stops and the world goes on. The client's avatar moves again when the client resumes.
fn stop_and_resume_a_client(stop: Duration) {
    let _alone = alone();
    let demo = Demo::start();
    let token = demo.server.token("client");
    let args = ["client", "--server", &demo.server.address, "--avatars", "2", "--token", &token];
    let mut client = Process::start(&mut dcd(&args));
    let name = client.line("joined as ");
    let number = name.strip_prefix('c').and_then(|number| number.parse().ok()).expect("a client's name");
    let avatar = BodyId::avatar(ClientId(number), 0);
    let place = || demo.witness.world.body(avatar).map(|view| view.body.state.pose.translation);
    // The avatar wanders.
    let moves = |from: [f64; 3]| {
        let gone = || place().is_some_and(|at| (0..3).any(|i| (at[i] - from[i]).abs() > 0.3));
        let start = Instant::now();
        demo.witness.watch_until(|| gone() || start.elapsed() > LIMIT);
        assert!(gone(), "the avatar stays at {from:?}");
        start.elapsed()
    };
    demo.witness.watch_until(|| place().is_some());
    moves(place().unwrap());
    client.signal("-STOP");
    let stood = demo.witness.watch_for(stop);
    client.signal("-CONT");
    let after = demo.witness.watch_for(Duration::from_secs(3));
    demo.witness.watch_until(|| place().is_some());
    let back = moves(place().unwrap());
    println!(
        "a client stopped for {stop:?}: the world stood still for {stood:.2?}, then for {after:.2?}; its avatar moved {back:.2?} later"
    );
    assert!(stood < PAUSE && after < PAUSE && back < RETURN, "{stood:?} {after:?} {back:?}");
    demo.end_with(2, &[]);
    let ended = client.end();
    assert!(ended.errors.contains("the world has ended"), "{ended:?}");
}

#[test]
fn a_node_or_leader_stopped_for_four_seconds_is_taken_over_and_comes_back() {
    stop_and_resume_a_node(Duration::from_secs(4));
}

#[test]
fn a_server_stopped_for_three_seconds_is_not_missed() {
    stop_and_resume_the_server(Duration::from_secs(3));
}

#[test]
fn a_client_stopped_for_three_seconds_goes_on_where_it_was() {
    stop_and_resume_a_client(Duration::from_secs(3));
}

#[test]
#[ignore = "takes a quarter of a minute"]
fn a_client_stopped_for_ten_seconds_goes_on_where_it_was() {
    stop_and_resume_a_client(Duration::from_secs(10));
}

#[test]
#[ignore = "takes half a minute"]
fn a_node_or_leader_stopped_for_ten_seconds_is_taken_over_and_comes_back() {
    stop_and_resume_a_node(Duration::from_secs(10));
}

#[test]
#[ignore = "takes a quarter of a minute"]
fn a_server_stopped_for_ten_seconds_is_not_missed() {
    stop_and_resume_the_server(Duration::from_secs(10));
}

/// Waits until this many nodes have one region each.
fn dealt(server: &mut Server, nodes: usize) {
    loop {
        let view = server.view();
        let shares =
            view.split_once(": ").and_then(|(_, rest)| rest.split_once(';')).map(|(shares, _)| shares);
        let shares: Vec<_> = shares.into_iter().flat_map(|shares| shares.split(", ")).collect();
        let has_one = |share: &&str| share.split(' ').filter(|word| word.starts_with('r')).count() == 1;
        if shares.len() == nodes && shares.iter().all(has_one) {
            return;
        }
    }
}

#[test]
fn regions_follow_processes_that_come_die_and_leave() {
    let mut server = Server::start(&["terrain", "--set", "n=200"]);
    let mut nodes = vec![server.node()];
    dealt(&mut server, 1);
    for count in [2, 3] {
        nodes.push(server.node());
        dealt(&mut server, count);
    }
    nodes.remove(1).1.kill();
    dealt(&mut server, 2);
    // Only its members can tell the server the present regions.
    server.process.kill();
    server.restart();
    dealt(&mut server, 2);
    nodes.push(server.node());
    dealt(&mut server, 3);
    // The leader leaves, and hands nothing over to its successor.
    let (_, leader) = nodes.remove(0);
    leader.interrupt();
    assert!(matches!(leader.end().code(), Some(0 | 130)));
    dealt(&mut server, 2);
    let served = server.stop();
    assert_eq!(served["bodies"], 200);
    assert!(served["repartitions"].as_u64().unwrap() > 1, "{served}");
    for (name, node) in nodes {
        assert_eq!(node.end().code(), Some(0), "{name}");
    }
}

/// The list of faults in `benches/README.md` names existing tests, and says which are ignored.
#[test]
fn the_list_of_faults_names_tests() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cluster_processes");
    let files =
        std::fs::read_dir(folder).unwrap().map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap());
    let files = files.collect::<String>();
    let is_ignored = |name: &str| {
        let tests = files.split("#[test]\n").filter_map(|test| test.split_once("fn "));
        let tests = tests.filter(|(_, test)| test.split('(').next().is_some_and(|full| full.contains(name)));
        let ignored: Vec<_> = tests.map(|(before, _)| before.contains("#[ignore")).collect();
        assert!(!ignored.is_empty(), "no test is called {name}");
        ignored.iter().all(|ignored| *ignored)
    };
    let page = include_str!("../../../benches/README.md");
    let (_, section) = page.split_once("## Faults by real processes").unwrap();
    let cells = section
        .lines()
        .filter(|line| line.starts_with("| "))
        .skip(2)
        .filter_map(|line| line.split('|').nth(3));
    let mut known = 0;
    for name in cells.flat_map(|cell| cell.split(", ")) {
        let bare = name.split('`').nth(1).unwrap_or_else(|| panic!("{name} is no name"));
        // A command is not a test.
        if bare.contains(' ') {
            continue;
        }
        assert_eq!(is_ignored(bare), name.contains("(ignored)"), "{bare}");
        known += 1;
    }
    assert!(known > 25, "{known}");
}
