//! Tests what servers and nodes tell systemd, through a socket as systemd would provide it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};

use crate::process::{LIMIT, Process, dcd, playground, token};

/// The end of the socket that systemd has.
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

    /// Starts a process that must report twice per 0.4 s that it is alive.
    fn start(&self, args: &[&str]) -> Process {
        let mut command = dcd(args);
        Process::start(command.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", "400000"))
    }

    /// Waits for a line with this prefix, and returns the rest of it.
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
    // It has no group before the other node comes.
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

/// Starts an HTTP server that answers as an etcd which keeps the first key that it is given, and then accepts
/// no more writes. It ends with the test's process.
fn etcd_without_a_leader() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        let mut kept: Option<(Value, Value)> = None;
        for stream in listener.incoming() {
            let mut reader = BufReader::new(stream.unwrap());
            let head: Vec<_> =
                reader.by_ref().lines().map_while(Result::ok).take_while(|line| !line.is_empty()).collect();
            let length = head.iter().find_map(|line| {
                let (name, value) = line.split_once(':')?;
                name.eq_ignore_ascii_case("content-length").then(|| value.trim().parse::<u64>().ok())?
            });
            let mut body = Vec::new();
            let _ = reader.by_ref().take(length.unwrap_or(0)).read_to_end(&mut body);
            let asked: Value = serde_json::from_slice(&body).unwrap_or_default();
            let put = &asked["success"][0]["request_put"];
            let (status, answer) = match &kept {
                None if put.is_object() => {
                    kept = Some((put["key"].clone(), put["value"].clone()));
                    (200, json!({ "succeeded": true }))
                }
                _ if asked["success"].is_array() => (503, json!({ "error": "no leader" })),
                Some((key, value)) if asked["key"] == *key => {
                    let found =
                        json!({ "key": key, "value": value, "create_revision": "2", "mod_revision": "2" });
                    (200, json!({ "kvs": [found] }))
                }
                _ => (200, json!({})),
            };
            let (answer, mut stream) = (answer.to_string(), reader.into_inner());
            let length = answer.len();
            let _ = write!(
                stream,
                "HTTP/1.1 {status} -\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{answer}"
            );
        }
    });
    address
}

#[test]
fn a_server_that_waits_for_etcd_says_so_and_is_not_ready_for_systemd_which_is_to_be_patient() {
    let folder = tempfile::tempdir().unwrap();
    let mut systemd = Supervisor::at(&folder.path().join("server"));
    let data = folder.path().join("data");
    let place = format!("etcd://{}/w", etcd_without_a_leader());
    let serve = [
        "serve",
        "tower",
        "--listen",
        "127.0.0.1:0",
        "--directory",
        &place,
        "--data",
        data.to_str().unwrap(),
    ];
    let mut server = systemd.start(&serve);
    let why = server.line("waiting for etcd: ");
    assert!(why.contains("takes no writes"), "{why}");
    systemd.line("EXTEND_TIMEOUT_USEC=");
    for _ in 0..3 {
        systemd.line("WATCHDOG=1");
    }
    assert!(!systemd.has_heard("READY=1"), "{:?}", systemd.heard);
    server.interrupt();
    assert_eq!(server.end().code(), Some(0));
}
