//! Tests the operator's steps of the manual's page *operating*, one after the other in one world: two servers
//! over etcd and three nodes, with the option files of `packaging/`; status, drain, upgrades of a node and of
//! the active server, and kill -9 of both.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use dcd_tests::etcd::EtcdCluster;
use dcd_tests::proxy::free_address;
use serde_json::Value;

use crate::process::{LIMIT, Process, alone, dcd};
use crate::witness::Witness;

/// The longest time that a world which loses no node may stand still, on a busy machine.
const PAUSE: Duration = Duration::from_secs(1);
/// The longest time until a killed node's regions go on elsewhere.
const TAKEOVER: Duration = Duration::from_secs(3);
/// The number of bodies: those of the scene, and the watching client's avatar.
const BODIES: u64 = 155 + 1;

/// The folders of the machines, one per machine, as the manual sets them up.
struct Machines {
    root: tempfile::TempDir,
    servers: [String; 2],
}

impl Machines {
    /// Writes the options of two servers of one world: the shipped options, with one region per node.
    fn new(etcd: &EtcdCluster) -> Self {
        let machines = Self {
            root: tempfile::tempdir().unwrap(),
            servers: [(); 2].map(|()| free_address().to_string()),
        };
        for (number, address) in machines.servers.iter().enumerate() {
            let named = [
                ("/usr/local/share/dcd", packaging("../dcd/scenes")),
                ("0.0.0.0:7420", address.clone()),
                ("127.0.0.1:9420", "127.0.0.1:0".to_owned()),
                ("/var/lib/dcd", text(&machines.data(number))),
                ("# directory = \"etcd://10.0.0.1:2379,10.0.0.2:2379,10.0.0.3:2379/playground\"", {
                    format!("directory = \"{}\"", etcd.place("playground"))
                }),
            ];
            machines.install("server.toml", number, &named);
        }
        machines
    }

    /// Writes the options of a node, and its token.
    fn add_node(&self, number: usize, token: &str) {
        let both = self.servers.each_ref().map(|address| format!("\"{address}\"")).join(", ");
        let (token_file, state) = (self.folder(number).join("node-token"), self.folder(number));
        let named = [
            ("\"192.0.2.7:7420\"", both),
            ("/etc/dcd/node-token", text(&token_file)),
            ("/var/lib/dcd-node", text(&state)),
            ("0.0.0.0:7421", "127.0.0.1:0".to_owned()),
            ("127.0.0.1:9421", "127.0.0.1:0".to_owned()),
        ];
        self.install("node.toml", number, &named);
        fs::write(token_file, token).unwrap();
    }

    fn install(&self, file: &str, number: usize, named: &[(&str, String)]) {
        let shipped = fs::read_to_string(packaging(file)).unwrap();
        let mut text = named.iter().fold(shipped, |text, (from, to)| {
            assert!(text.contains(from), "{file} has no {from}");
            text.replace(from, to)
        });
        if file == "server.toml" {
            text += "regions = 3\n";
        }
        fs::create_dir_all(self.folder(number)).unwrap();
        fs::write(self.folder(number).join(file), text).unwrap();
    }

    fn folder(&self, number: usize) -> PathBuf {
        self.root.path().join(number.to_string())
    }

    fn data(&self, number: usize) -> PathBuf {
        self.folder(number).join("data")
    }

    fn both(&self) -> String {
        self.servers.join(",")
    }

    fn server(&self, number: usize) -> Process {
        let mut command = dcd(&["serve", "--json", "--config"]);
        Process::start(command.arg(self.folder(number).join("server.toml")))
    }

    /// Starts a node, always with the same command. Returns its name and process.
    fn node(&self, number: usize) -> (String, Process) {
        let mut command = dcd(&["node", "--json", "--threads", "1", "--config"]);
        let mut node = Process::start(command.arg(self.folder(number).join("node.toml")));
        (node.line("joined as "), node)
    }

    /// Runs a command on a server's machine, and returns the lines that it prints.
    fn ask(&self, server: usize, args: &[&str]) -> Vec<String> {
        let ended = Process::start(dcd(args).arg("--data").arg(self.data(server))).end();
        assert_eq!(ended.code(), Some(0), "{args:?}: {ended:?}");
        ended.lines
    }

    fn status(&self, server: usize) -> Value {
        let lines = self.ask(server, &["status", "--json", "--server", &self.both()]);
        serde_json::from_str(lines.last().unwrap()).unwrap()
    }

    /// Waits until `dcd status` shows exactly these nodes at work, and all bodies. Returns the longest time
    /// that the world stood still meanwhile.
    fn are_at_work(&self, server: usize, names: &[&str], witness: &Witness) -> Duration {
        let is_so = || {
            let status = self.status(server);
            let nodes = status["nodes"].as_array().unwrap();
            let works = |node: &Value| {
                let has_regions = !node["regions"].as_array().unwrap().is_empty();
                has_regions && names.contains(&node["node"].as_str().unwrap())
            };
            let so = nodes.len() == names.len() && nodes.iter().all(works) && status["bodies"] == BODIES;
            (so, status)
        };
        std::thread::scope(|scope| {
            let waits = scope.spawn(|| {
                let start = Instant::now();
                while let (false, status) = is_so() {
                    assert!(start.elapsed() < LIMIT, "{names:?} are not at work: {status}");
                }
            });
            let stood = witness.watch_until(|| waits.is_finished());
            waits.join().unwrap();
            stood
        })
    }
}

fn packaging(path: &str) -> String {
    text(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../packaging").join(path))
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

#[test]
fn an_operator_with_the_manual_drains_upgrades_and_loses_nodes_and_servers_and_no_body() {
    let _alone = alone();
    let Some(etcd) = EtcdCluster::start(3) else { return };
    let machines = Machines::new(&etcd);
    // Setup.
    let mut first = machines.server(0);
    first.line("listening ");
    let mut second = machines.server(1);
    second.line("standing by for ");
    let token = machines.ask(0, &["token", "--role", "node", "--uses", "3", "--valid", "1d"]).remove(0);
    let mut nodes: Vec<_> = (2..5)
        .map(|number| {
            machines.add_node(number, &token);
            machines.node(number)
        })
        .collect();
    let client = machines.ask(0, &["token", "--role", "client"]).remove(0);
    let witness = Witness::join(&machines.both(), client);
    let names: Vec<_> = nodes.iter().map(|(name, _)| name.clone()).collect();
    let all: Vec<_> = names.iter().map(String::as_str).collect();
    machines.are_at_work(0, &all, &witness);
    // A node is drained and started again, as for an upgrade.
    let drained = std::thread::scope(|scope| {
        let drain = scope.spawn(|| machines.ask(0, &["drain", all[1]]));
        let stood = witness.watch_until(|| drain.is_finished());
        drain.join().unwrap();
        stood
    });
    assert_eq!(nodes[1].1.end_within(LIMIT).code(), Some(0));
    let without = machines.are_at_work(0, &[all[0], all[2]], &witness);
    nodes[1] = machines.node(3);
    assert_eq!(nodes[1].0, all[1], "its identity says who it is, by a token that is used");
    let upgraded = machines.are_at_work(0, &all, &witness);
    // A node dies, and its unit starts it again.
    nodes[2].1.kill();
    let killed = machines.are_at_work(0, &all[..2], &witness);
    nodes[2] = machines.node(4);
    assert_eq!(nodes[2].0, all[2]);
    let back = machines.are_at_work(0, &all, &witness);
    // The active server dies, and its unit starts it again: it stands by.
    first.kill();
    let gone = Instant::now();
    let took_over = witness.watch_until(|| {
        assert!(gone.elapsed() < LIMIT, "no server takes over");
        second.heard().iter().any(|line| line.starts_with("going on with the world at tick "))
    });
    let taken_over = gone.elapsed();
    let server_killed = took_over.max(machines.are_at_work(1, &all, &witness));
    let mut first = machines.server(0);
    first.line("standing by for ");
    // The other server is upgraded in turn: it hands over.
    second.interrupt();
    assert_eq!(second.end().code(), Some(0));
    first.line("going on with the world at tick ");
    let handed_over = machines.are_at_work(0, &all, &witness);
    let mut second = machines.server(1);
    second.line("standing by for ");
    println!(
        "the world stood still for {drained:.2?} in the drain, {:.2?} as the node came back, {killed:.2?} and {back:.2?} for the killed \
         one, {server_killed:.2?} for the killed server, after {taken_over:.2?}, {handed_over:.2?} for the one that handed over",
        without.max(upgraded)
    );
    for stood in [drained, without, upgraded, back, server_killed, handed_over] {
        assert!(stood < PAUSE, "{stood:?}");
    }
    assert!(killed < TAKEOVER, "{killed:?}");
    // A new client is admitted as before.
    let token = machines.ask(0, &["token", "--role", "client"]).remove(0);
    let args = ["client", "--seconds", "0.5", "--server", &machines.both(), "--token", &token];
    assert_eq!(Process::start(&mut dcd(&args)).end().code(), Some(0));
    witness.leave();
    machines.ask(0, &["end"]);
    let served = first.end();
    let summary = served.json();
    assert_eq!((&summary["lost"], &summary["doubled"]), (&0.into(), &0.into()), "{served:?}");
    assert_eq!(summary["bodies"], BODIES - 1, "{served:?}");
    assert_eq!(second.end().code(), Some(3), "nobody begins the world anew");
    for (name, node) in nodes {
        assert_eq!(node.end().code(), Some(0), "{name}");
    }
}
