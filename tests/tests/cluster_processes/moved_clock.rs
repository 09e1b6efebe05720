//! Tests processes whose wall clock jumps far ahead while they run, as on a machine that slept: all their
//! certificates have expired.

use std::path::PathBuf;
use std::process::Command;

use dcd_tests::proxy::free_address;
use serde_json::Value;

use crate::metrics::wait;
use crate::process::{Process, dcd, playground};

/// The processes of a world, with wall clocks that can be moved: one of the server's machine, and one of all
/// others. The monotonic clocks are not changed.
struct Moved {
    library: PathBuf,
    folder: tempfile::TempDir,
    address: String,
}

impl Moved {
    /// Prepares the clock. Returns `None` where libfaketime is not installed.
    fn new() -> Option<Self> {
        let places = std::fs::read_dir("/usr/lib").ok()?.flatten().map(|place| place.path());
        let libraries = places.map(|place| place.join("faketime/libfaketimeMT.so.1"));
        let library = libraries.into_iter().find(|library| library.exists())?;
        let moved =
            Self { library, folder: tempfile::tempdir().unwrap(), address: free_address().to_string() };
        moved.ahead("+0");
        Some(moved)
    }

    /// Sets all wall clocks ahead of the true time by this offset, such as `+25h`.
    fn ahead(&self, by: &str) {
        self.set(Machine::Server, by);
        self.set(Machine::Other, by);
    }

    fn set(&self, machine: Machine, by: &str) {
        let next = self.folder.path().join("next");
        std::fs::write(&next, by).unwrap();
        // Renamed, so that no process reads half a number.
        std::fs::rename(next, self.offset(machine)).unwrap();
    }

    fn offset(&self, machine: Machine) -> PathBuf {
        self.folder.path().join(format!("{machine:?}"))
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn dcd(&self, machine: Machine, args: &[&str]) -> Command {
        let mut command = dcd(args);
        command.env("LD_PRELOAD", &self.library).env("FAKETIME_TIMESTAMP_FILE", self.offset(machine));
        // Read the file at each call, and let no process restart its clock at its own beginning.
        command.env("FAKETIME_NO_CACHE", "1").env("FAKETIME_DONT_RESET", "1");
        command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
        command
    }

    fn serve(&self) -> Process {
        let mut command = self
            .dcd(Machine::Server, &["serve", "--json", "--nodes", "2", "--listen", &self.address, "--data"]);
        let mut server = Process::start(command.arg(self.data()).arg(playground()));
        server.line("listening ");
        server
    }

    /// Starts a process in this role, with a new token.
    fn join(&self, role: &str) -> Process {
        let mut token = self.dcd(Machine::Server, &["token", "--role", role, "--data"]);
        let told = Process::start(token.arg(self.data())).end();
        assert_eq!(told.code(), Some(0), "{told:?}");
        let args = [role, "--json", "--server", &self.address, "--token", &told.lines[0]];
        let mut process = Process::start(&mut self.dcd(Machine::Other, &args));
        process.line("joined as ");
        process
    }

    /// Returns the output of `dcd status`.
    fn status(&self) -> Value {
        let mut status =
            self.dcd(Machine::Server, &["status", "--json", "--server", &self.address, "--data"]);
        let told = Process::start(status.arg(self.data())).end();
        assert_eq!(told.code(), Some(0), "{told:?}");
        told.json()
    }

    /// Waits until this many nodes and clients are in one group whose world is past this tick. Returns the
    /// world's tick.
    fn whole(&self, nodes: usize, clients: u64, past: u64) -> u64 {
        wait(&format!("{nodes} nodes and {clients} clients are in one world past tick {past}"), || {
            let told = self.status();
            let count = |list: &str| told[list].as_array().unwrap().len();
            let is_whole = (count("groups"), count("nodes"), &told["clients"]) == (1, nodes, &clients.into());
            told["tick"].as_u64().filter(|&tick| is_whole && tick > past)
        })
    }
}

/// A machine, by its clock.
#[derive(Clone, Copy, Debug)]
enum Machine {
    Server,
    Other,
}

#[test]
fn a_server_that_is_started_again_with_its_clock_days_ahead_goes_on_with_its_nodes() {
    let Some(world) = Moved::new() else { return };
    let mut server = world.serve();
    let mut nodes = [world.join("node"), world.join("node")];
    let client = world.join("client");
    let begun = world.whole(2, 1, 0);

    server.signal("-TERM");
    assert_eq!(server.end().code(), Some(0));
    world.set(Machine::Server, "+50h");
    server = world.serve();
    let kept: u64 = server.line("going on with the world at tick ").parse().unwrap();
    assert!(kept >= begun, "{kept}, after {begun}");
    world.whole(2, 1, kept);
    assert!(nodes.iter_mut().all(Process::is_running));
    server.interrupt();
    let told = server.end().errors;
    assert!(told.contains("expired by this machine's clock"), "{told}");
    client.interrupt();
    assert_eq!(client.end().code(), Some(130));
}

#[test]
fn a_clock_that_is_moved_ahead_by_a_day_and_by_months_ends_nothing_and_keeps_nobody_out() {
    let Some(world) = Moved::new() else { return };
    let mut server = world.serve();
    let mut nodes = [world.join("node"), world.join("node")];
    let first = world.join("client");
    let begun = world.whole(2, 1, 0);

    world.ahead("+25h");
    let second = world.join("client");
    let tick = world.whole(2, 2, begun);

    // A new process reaches the earlier ones, whose certificates were made at another time.
    world.ahead("+30d");
    nodes[0].kill();
    nodes[0] = world.join("node");
    let tick = world.whole(2, 2, tick);

    // A server that is started again then goes on with its world.
    server.signal("-TERM");
    assert_eq!(server.end().code(), Some(0));
    world.ahead("+90d");
    server = world.serve();
    let kept: u64 = server.line("going on with the world at tick ").parse().unwrap();
    assert!(kept >= tick, "{kept}, after {tick}");
    world.whole(2, 2, kept);
    let third = world.join("client");
    world.whole(2, 3, kept);

    assert!(nodes.iter_mut().all(Process::is_running));
    for client in [first, second, third] {
        client.interrupt();
        let ended = client.end();
        assert_eq!((ended.code(), &ended.json()["refusals"]), (Some(130), &0.into()), "{ended:?}");
    }
}
