//! Tests what servers and nodes tell systemd, at the socket that it would give them.

use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::Instant;

use crate::process::{LIMIT, Process, dcd, playground, token};

/// The end that systemd has.
struct Supervisor {
    socket: UnixDatagram,
    path: String,
    heard: Vec<String>,
}

impl Supervisor {
    fn at(path: &Path) -> Self {
        let socket = UnixDatagram::bind(path).unwrap();
        socket.set_read_timeout(Some(LIMIT)).unwrap();
        Self { socket, path: path.to_str().unwrap().to_owned(), heard: Vec::new() }
    }

    /// Starts a process that is to say twice per 0.4 s that it lives.
    fn start(&self, args: &[&str]) -> Process {
        let mut command = dcd(args);
        Process::start(command.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", "400000"))
    }

    /// Waits for a line that begins so, and returns the rest of it.
    fn line(&mut self, prefix: &str) -> String {
        let deadline = Instant::now() + LIMIT;
        let mut bytes = [0; 4096];
        while Instant::now() < deadline {
            let length = self.socket.recv(&mut bytes).expect("it says something");
            let lines: Vec<_> =
                std::str::from_utf8(&bytes[..length]).unwrap().lines().map(str::to_owned).collect();
            let found = lines.iter().find_map(|line| line.strip_prefix(prefix)).map(str::to_owned);
            self.heard.extend(lines);
            if let Some(rest) = found {
                return rest;
            }
        }
        panic!("no line `{prefix}…`: {:?}", self.heard);
    }

    fn has_heard(&self, line: &str) -> bool {
        self.heard.iter().any(|heard| heard == line)
    }
}

#[test]
fn systemd_hears_when_a_server_and_its_nodes_are_ready_that_they_live_and_that_they_stop() {
    let folder = tempfile::tempdir().unwrap();
    let [of_server, of_node] = ["server", "node"].map(|name| folder.path().join(name));
    let (mut of_server, mut of_node) = (Supervisor::at(&of_server), Supervisor::at(&of_node));
    let data = folder.path().join("data");
    let shown = data.to_str().unwrap();
    let scene = playground();
    let serve =
        ["serve", scene.to_str().unwrap(), "--nodes", "2", "--listen", "127.0.0.1:0", "--data", shown];
    let mut server = of_server.start(&serve);
    let address = server.line("listening ");
    of_server.line("READY=1");
    for _ in 0..3 {
        of_server.line("WATCHDOG=1");
    }
    let join = |token: &str| ["node", "--server", &address, "--token", token].map(str::to_owned);
    let args = join(&token(&data, "node"));
    let mut node = of_node.start(&args.each_ref().map(String::as_str));
    node.line("joined as ");
    of_node.line("READY=1");
    // It has no group before the other one comes.
    for _ in 0..5 {
        of_node.line("WATCHDOG=1");
    }
    assert!(of_node.has_heard("STATUS=n1 waits for its group"), "{:?}", of_node.heard);
    let args = join(&token(&data, "node"));
    let _other = Process::start(&mut dcd(&args.each_ref().map(String::as_str)));
    assert!(of_node.line("STATUS=n1 at tick ").contains(" bodies, 1 regions"));
    while !of_server.line("STATUS=tick ").ends_with("155 bodies, 2 nodes") {}

    node.interrupt();
    of_node.line("STOPPING=1");
    assert_eq!(node.end().code(), Some(130));
    server.interrupt();
    of_server.line("STOPPING=1");
    assert_eq!(server.end().code(), Some(0));
}
