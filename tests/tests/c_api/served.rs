//! Tests C programs in a world that a server and nodes of this process serve and compute.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use dcd::net::JoinRole;
use dcd::runtime::{
    Delivery, JoinConfig, Member, MemberConfig, Origin, Partitioning, ServeConfig, ServerProcess, WorldConfig,
};
use dcd::scene::{Params, Scene};

use crate::programs::{SANITIZED, numbers, program_of_the_readme};
use crate::toolchain::{build, root, run_well};

const LIMIT: Duration = Duration::from_secs(60);

pub(crate) struct Cluster {
    pub(crate) server: ServerProcess,
    nodes: Vec<Member>,
    folder: tempfile::TempDir,
}

impl Cluster {
    /// Starts a pile of boxes in two regions.
    fn start(nodes: usize) -> Self {
        let scene = Scene::named("pile", &Params::new().with("n", 100)).unwrap();
        let world = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
        Self::of(&scene, &world, nodes)
    }

    pub(crate) fn of(scene: &Scene, world: &WorldConfig, nodes: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let server = ServerProcess::start(
            Origin::Scene(scene, world),
            ServeConfig { nodes, ..ServeConfig::new(folder.path().join("server")) },
        )
        .unwrap();
        let nodes = (0..nodes)
            .map(|_| {
                let token = server.token(JoinRole::Node, LIMIT).unwrap();
                let identity = JoinConfig::new(server.address, token).join(JoinRole::Node).unwrap();
                Member::start(MemberConfig::new(server.address, identity)).unwrap()
            })
            .collect();
        Self { server, nodes, folder }
    }

    pub(crate) fn token(&self, role: JoinRole) -> String {
        self.server.token(role, LIMIT).unwrap()
    }

    /// Returns a C program that counts its own checks. Its second argument is the server's address.
    fn program(&self, mode: &str) -> Command {
        self.program_with(mode, &[])
    }

    fn program_with(&self, mode: &str, flags: &[&str]) -> Command {
        let source = root().join("tests/tests/c_api/client.c");
        let mut program = Command::new(build(&source, self.folder.path(), flags));
        program.arg(mode).arg(self.server.address.to_string());
        program
    }

    /// Stops all processes, and checks that no body was lost or doubled.
    pub(crate) fn stop(self) {
        let summary = self.server.stop().unwrap();
        assert_eq!((summary.lost, summary.doubled), (0, 0));
        for node in self.nodes {
            node.finish().unwrap();
        }
    }
}

#[test]
fn join_drives_an_avatar_through_towers_and_hears_of_contacts() {
    let cluster = Cluster::start(2);
    let program = build(&root().join("examples-c/join.c"), cluster.folder.path(), &[]);
    let mut join = Command::new(program);
    join.arg(cluster.server.address.to_string()).arg(cluster.token(JoinRole::Client));
    let said = run_well(join.args(["2", "-12", "1", "0.75", "10", "0", "0"]));
    let last = said.lines().last().expect("it says something");
    let value = |name: &str| -> f64 {
        let rest = last.split(&format!("{name}=")).nth(1).unwrap_or_else(|| panic!("{said}"));
        rest.split(' ').next().and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{said}"))
    };
    assert!(last.starts_with("join: updates="), "{said}");
    assert!(value("updates") > 5.0 && value("contacts") > 0.0, "{said}");
    assert!((5.0..25.0).contains(&value("moved_m")), "{said}");
    assert_eq!(value("bodies"), 101.0, "{said}");
    cluster.stop();
}

#[test]
fn a_game_loop_written_for_a_local_world_joins_a_served_one() {
    let cluster = Cluster::start(2);
    let program = build(&root().join("examples-c/game_loop.c"), cluster.folder.path(), &[]);
    let mut game = Command::new(program);
    let said = run_well(game.arg(cluster.server.address.to_string()).arg(cluster.token(JoinRole::Client)));
    let last = said.lines().last().expect("it says something");
    let numbers: Vec<u32> =
        last.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect();
    let [300, 249, began, ..] = numbers[..] else { panic!("{said}") };
    assert!(began >= 16, "16 balls fall on the ground: {said}");
    cluster.stop();
}

#[test]
fn the_program_of_the_readme_joins_a_served_world_by_another_call() {
    let cluster = Cluster::start(1);
    let [local, joins] = program_of_the_readme();
    // The served scene already has a ground.
    let (before, rest) = local.split_once("    DcdWorldDef def").expect("it makes a world");
    let (_, rest) = rest.split_once("_INIT;\n").expect("the definition has a line");
    let (declared, rest) = rest.split_once("    def.regions").expect("it sets the definition");
    let (_, rest) = rest.split_once("    ball.pose").expect("it makes the ball last");
    let joins = joins.replace("192.0.2.7:7420", &cluster.server.address.to_string());
    let joins = joins.replace("dcd1-...", &cluster.token(JoinRole::Client));
    let declared = declared.replace("ground = DCD_BODY_DEF_INIT, ", "");
    let source = format!("{before}{declared}{joins}    ball.pose{rest}");
    let source = source.replace("    const float half[3] = { 50.0f, 0.5f, 50.0f };\n", "");
    let file = cluster.folder.path().join("readme.c");
    std::fs::write(&file, source).unwrap();
    let said = run_well(&mut Command::new(build(&file, cluster.folder.path(), &[])));
    assert!(said.starts_with("the ball is at "), "{said}");
    cluster.stop();
}

#[test]
fn an_mmo_client_draws_its_avatar_ahead_of_what_it_hears() {
    let cluster = Cluster::start(2);
    let program = build(&root().join("examples-c/mmo_client.c"), cluster.folder.path(), &SANITIZED);
    let mut client = Command::new(program);
    client.arg(cluster.server.address.to_string()).arg(cluster.token(JoinRole::Client));
    let connections = cluster.server.connections().clone();
    let host = std::thread::spawn(move || {
        let mut seen = 0;
        while connections.wait(seen, LIMIT) {
            seen = connections.arrivals();
            if let Some(greeting) = connections.take_messages().pop() {
                assert_eq!(greeting.bytes, b"hello");
                return connections.send(greeting.from, b"welcome", Delivery::Message).unwrap();
            }
        }
        panic!("the client does not greet");
    });
    let said = run_well(client.arg("3"));
    host.join().unwrap();
    assert!(said.contains("the server says: welcome"), "{said}");
    let last = said.lines().last().expect("it says something");
    let numbers = numbers(last);
    let [steps, moved_m, ahead_m, ticks, _, corrections, largest_m] = numbers[..] else { panic!("{said}") };
    assert_eq!(steps, 180.0, "{said}");
    assert!((8.5..9.5).contains(&moved_m), "3 s at 3 m/s, from the first frame on: {said}");
    assert!(ahead_m > 0.05, "the world hears of each step, of 0.05 m, later: {said}");
    assert!((150.0..600.0).contains(&ticks), "{said}");
    assert!(corrections < 0.1 * ticks && largest_m < 0.5, "prediction and world agree: {said}");
    cluster.stop();
}

fn check(said: &str) {
    assert!(said.contains(" checks, 0 failures"), "{said}");
}

#[test]
fn a_client_can_do_what_the_header_says_and_names_its_role_for_the_rest() {
    let cluster = Cluster::start(2);
    check(&run_well(cluster.program("play").arg(cluster.token(JoinRole::Client))));
    cluster.stop();
}

#[test]
fn sanitizers_find_nothing_in_a_client() {
    let cluster = Cluster::start(1);
    check(&run_well(cluster.program_with("play", &SANITIZED).arg(cluster.token(JoinRole::Client))));
    cluster.stop();
}

#[test]
fn a_participant_plays_like_a_client_and_hands_its_share_over() {
    let cluster = Cluster::start(1);
    check(&run_well(cluster.program("participate").arg(cluster.token(JoinRole::Participant))));
    assert!(cluster.server.wait(LIMIT, |summary, _| summary.nodes == 1));
    cluster.stop();
}

#[test]
fn a_client_with_an_interest_hears_of_a_part_of_the_world() {
    for nodes in [1, 2] {
        let cluster = Cluster::start(nodes);
        let mut program = cluster.program("interest");
        check(&run_well(program.args([cluster.token(JoinRole::Client), cluster.token(JoinRole::Client)])));
        cluster.stop();
    }
}

#[test]
fn an_avatar_left_behind_is_found_again() {
    let cluster = Cluster::start(2);
    let mut program = cluster.program("return");
    program.args([cluster.token(JoinRole::Client), cluster.token(JoinRole::Client)]);
    check(&run_well(program.arg(cluster.folder.path().join("me"))));
    cluster.stop();
}

#[test]
fn a_lost_server_is_said_by_every_step() {
    let cluster = Cluster::start(1);
    let mut program = cluster.program("lose");
    let mut child = program.arg(cluster.token(JoinRole::Client)).stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    assert_eq!(line, "ready\n");
    cluster.stop();
    let mut rest = String::new();
    // The program ends by itself, since it limits its steps.
    said.read_to_string(&mut rest).unwrap();
    assert!(child.wait().unwrap().success(), "{rest}");
    check(&rest);
}

/// A process that is killed when dropped, as by a crash.
struct Victim(Child);

impl Drop for Victim {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a server, and returns it with its address. A restarted server must say that it goes on with its
/// world.
fn serve(folder: &Path, listen: &str) -> (Victim, String) {
    let is_back = folder.join("world.redb").exists();
    let mut serve = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
    serve.args(["serve", "pile", "--set", "n=100", "--regions", "2", "--nodes", "2", "--listen", listen]);
    let mut server = serve.arg("--data").arg(folder).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(server.stdout.take().unwrap()).lines().map(Result::unwrap);
    let address = lines.next().and_then(|line| Some(line.strip_prefix("listening ")?.to_owned())).unwrap();
    if is_back {
        let next = lines.next().unwrap();
        assert!(next.starts_with("going on with the world at tick "), "{next}");
    }
    // Reads the server's further output, so that the server never blocks on a full pipe.
    std::thread::spawn(move || lines.for_each(drop));
    (Victim(server), address)
}

#[test]
fn a_client_plays_on_while_the_server_is_killed_and_started_again() {
    let folder = tempfile::tempdir().unwrap();
    let (server, address) = serve(folder.path(), &dcd_tests::proxy::free_address().to_string());
    let token = |role: &str| {
        let mut token = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
        run_well(token.args(["token", "--role", role, "--data"]).arg(folder.path())).trim().to_owned()
    };
    let nodes = [0, 1].map(|_| {
        let address = address.parse().unwrap();
        let identity = JoinConfig::new(address, token("node")).join(JoinRole::Node).unwrap();
        Member::start(MemberConfig::new(address, identity)).unwrap()
    });
    let mut program = Command::new(build(&root().join("tests/tests/c_api/client.c"), folder.path(), &[]));
    // A standby server does not answer, but a client dials it all the same.
    let silent = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let places = format!("{},{address}", silent.local_addr().unwrap());
    program.args(["survive", &places, &token("client")]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut program = Victim(program.spawn().unwrap());
    let mut said = BufReader::new(program.0.stdout.take().unwrap());
    let mut hears = |expected: &str| {
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        assert_eq!(line.trim(), expected);
    };
    hears("ready");
    drop(server);
    program.0.stdin.take().unwrap().write_all(b"\n").unwrap();
    hears("alone");
    let _server = serve(folder.path(), &address);
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    check(&rest);
    assert!(program.0.wait().unwrap().success(), "{rest}");
    assert!(nodes.iter().all(|node| !node.is_over()), "nodes dial the server again");
}

#[test]
fn what_is_wrong_on_entering_is_said_to_c() {
    let cluster = Cluster::start(1);
    // A bound but silent port, so that nobody else can answer there.
    let silent = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut program = cluster.program("fail");
    program.args([cluster.token(JoinRole::Client), cluster.token(JoinRole::Node)]);
    check(&run_well(program.arg(silent.local_addr().unwrap().to_string())));
    cluster.stop();
}

/// Runs a C program that serves its own world, in a folder of its own: plain and under the sanitizers.
fn run_alone(source: &str) {
    for flags in [&[][..], &SANITIZED] {
        let folder = tempfile::tempdir().unwrap();
        let program = build(&root().join("tests/tests/c_api").join(source), folder.path(), flags);
        check(&run_well(Command::new(program).arg(folder.path().join("server"))));
    }
}

#[test]
fn one_program_serves_computes_and_sees_a_world() {
    run_alone("roles.c");
}

#[test]
fn what_is_submitted_is_answered_by_all_nodes_as_by_a_world_of_ones_own() {
    run_alone("asking.c");
}

#[test]
fn a_program_builds_a_game_in_the_world_that_it_serves() {
    run_alone("building.c");
}

/// Starts a node as a process of its own.
fn node(address: &str, token: &str) -> Victim {
    let mut node = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
    node.args(["node", "--threads", "1", "--server", address, "--token", token]);
    Victim(node.stdout(Stdio::null()).spawn().unwrap())
}

#[test]
fn a_game_that_a_program_builds_goes_on_when_its_node_is_killed_and_another_comes() {
    let folder = tempfile::tempdir().unwrap();
    let mut program =
        Command::new(build(&root().join("tests/tests/c_api/killed.c"), folder.path(), &SANITIZED));
    program.arg(folder.path().join("server")).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut program = Victim(program.spawn().unwrap());
    let mut said = BufReader::new(program.0.stdout.take().unwrap());
    let mut goes_on = program.0.stdin.take().unwrap();
    let mut line = || {
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        line.trim().to_owned()
    };
    let [address, first, second] = [line(), line(), line()];
    assert_eq!(line(), "served");
    let mut killed = node(&address, &first);
    goes_on.write_all(b"\n").unwrap();
    assert_eq!(line(), "computed");
    killed.0.kill().unwrap();
    assert_eq!(killed.0.wait().unwrap().signal(), Some(9), "it computed until it was killed");
    goes_on.write_all(b"\n").unwrap();
    assert_eq!(line(), "built");
    let mut other = node(&address, &second);
    goes_on.write_all(b"\n").unwrap();
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    check(&rest);
    assert!(program.0.wait().unwrap().success(), "{rest}");
    assert!(other.0.wait().unwrap().success(), "it is told that the world has ended");
}

#[test]
fn avatars_wait_for_their_client_and_a_client_for_its_server_as_long_as_they_are_told_to() {
    run_alone("leaving.c");
}

#[test]
fn clients_that_may_build_change_a_served_world_and_others_cannot() {
    run_alone("builder.c");
}

#[test]
fn clients_see_who_computes_what_and_bodies_change_hands() {
    run_alone("topology.c");
}

#[test]
fn programs_see_their_connections_and_speak_over_them() {
    run_alone("network.c");
}
