//! Tests what a server leaves in its data folder, and how the next server goes on with it.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use dcd::runtime::{WorldEnd, end_world};

use crate::process::{LIMIT, PROGRAM, Process, Server, dcd, playground};

/// Starts a server with these options on the data folder of another server, which has ended.
fn serve(server: &Server, args: &[&str]) -> Process {
    let mut serve = dcd(&["serve", "--listen", "127.0.0.1:0", "--json", "--data"]);
    Process::start(serve.arg(server.data()).args(args))
}

/// Checks that a server begins a new world.
fn begins(mut process: Process) {
    process.line("listening ");
    process.interrupt();
    let ended = process.end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    assert!(!ended.lines.iter().any(|line| line.starts_with("going on")), "{ended:?}");
}

fn refused(server: &Server, args: &[&str], expected: &[&str]) {
    let ended = serve(server, args).end();
    assert_eq!(ended.code(), Some(2), "{args:?}: {ended:?}");
    for part in expected.iter().chain(&["--fresh"]) {
        assert!(ended.errors.contains(part), "`{part}` is missing: {ended:?}");
    }
}

/// Returns the demo's world after its server was killed, `seconds` after the world began.
fn killed(seconds: f32) -> Server {
    let mut server = Server::playground("1");
    let (_, mut node) = server.node();
    server.view();
    std::thread::sleep(std::time::Duration::from_secs_f32(seconds));
    server.process.kill();
    node.kill();
    server
}

#[test]
fn a_server_says_from_which_tick_it_goes_on_and_an_ended_world_is_forgotten() {
    let mut server = killed(4.0);
    let tick = server.restart();
    assert!(tick > 60, "it is written down every two seconds where bodies are, not at tick {tick}");
    // Another crash does not change that.
    server.process.kill();
    let now = server.restart();
    assert!(now >= tick);
    let (name, _node) = server.node();
    let view = server.view();
    assert!(view.contains(&format!("at tick {now}: {name} r1 r2")), "{view}");
    assert!(server.end_world()["tick"].as_u64().unwrap() >= tick);
    begins(serve(&server, &[playground().to_str().unwrap()]));
}

#[test]
fn every_signal_stops_the_server_and_keeps_the_world() {
    let mut server = Server::playground("1");
    let (name, _node) = server.node();
    server.view();
    let mut last = 0;
    for signal in ["-TERM", "-HUP", "-INT"] {
        server.process.signal(signal);
        let ended = server.process.end_within(crate::process::LIMIT);
        assert_eq!((ended.code(), &ended.json()["kept"]), (Some(0), &true.into()), "{signal}: {ended:?}");
        let now = server.restart();
        assert!(now >= last, "{signal}: {now} after {last}");
        last = now;
        // The node has computed on, and is back in the server's view.
        assert!(server.view().contains(&format!("{name} r1 r2")), "{signal}");
    }
    server.stop();
}

#[test]
fn a_terminal_that_is_gone_ends_no_world() {
    let mut server = Server::playground("1");
    server.process.kill();
    let mut serve = dcd(&["serve", "--listen", &server.address, "--json", "--data"]);
    serve
        .arg(server.data())
        .arg(playground())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut deaf = serve.spawn().unwrap();
    let mut line = String::new();
    BufReader::new(deaf.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.starts_with("listening "), "{line}");
    drop(deaf.stderr.take());
    // The server can print neither the view nor its summary. Nothing is kept before a tick is computed, and
    // here only a client can tell when one is.
    let (_, _node) = server.node();
    server.witness().leave();
    let hung_up = Command::new("kill").args(["-HUP", &deaf.id().to_string()]).status().unwrap();
    assert!(hung_up.success());
    assert_eq!(deaf.wait().unwrap().code(), Some(0));
    server.restart();
    server.stop();
}

/// Waits until a process has ended that is no child of this one.
#[cfg(target_os = "linux")]
fn gone(id: &str) {
    let deadline = Instant::now() + LIMIT;
    // A zombie has ended, too.
    let runs = || {
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
        !status.is_empty() && !status.contains("State:\tZ")
    };
    while runs() {
        assert!(Instant::now() < deadline, "process {id} does not end");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A server that goes on with a stored world at a terminal of its own, provided by `script`, in which Ctrl-C
/// has been pressed.
#[cfg(target_os = "linux")]
struct AtTerminal {
    terminal: std::process::Child,
    keys: std::process::ChildStdin,
    id: String,
}

#[cfg(target_os = "linux")]
impl AtTerminal {
    fn interrupted(server: &Server) -> Self {
        let (data, scene) = (server.data(), playground());
        let line = format!(
            "echo process $$; exec env --default-signal=HUP,INT {PROGRAM} serve {} --listen {} --data {}",
            scene.display(),
            server.address,
            data.display()
        );
        let mut script = Command::new("script");
        script.args(["--quiet", "--return", "--command", &line, "/dev/null"]);
        let mut terminal = script
            .env("SHELL", "/bin/sh")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("`script` of util-linux is there");
        let mut lines = BufReader::new(terminal.stdout.take().unwrap()).lines().map_while(Result::ok);
        let mut line =
            |part: &str| lines.find(|line| line.contains(part)).unwrap_or_else(|| panic!("no `{part}`"));
        let id = line("process ").trim().rsplit(' ').next().unwrap().to_owned();
        line("going on with the world at tick ");
        let mut keys = terminal.stdin.take().unwrap();
        keys.write_all(b"\x03").unwrap();
        line("Ctrl-C again ends it");
        // Reads the further output, so that a full pipe does not block the server.
        std::thread::spawn(move || lines.for_each(drop));
        // A second Ctrl-C within 200 ms counts as the same press; within two seconds, as another.
        std::thread::sleep(Duration::from_millis(400));
        Self { terminal, keys, id }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_terminal_that_is_closed_after_ctrl_c_ends_no_world() {
    let mut server = killed(3.0);
    let mut at = AtTerminal::interrupted(&server);
    at.terminal.kill().unwrap();
    at.terminal.wait().unwrap();
    gone(&at.id);
    server.restart();
    server.end_unheard();
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_pressed_again_ends_the_world() {
    let server = killed(3.0);
    let mut at = AtTerminal::interrupted(&server);
    at.keys.write_all(b"\x03").unwrap();
    // Not 130, as there is something to report: no node was there that could say what is lost.
    assert_eq!(at.terminal.wait().unwrap().code(), Some(3));
    gone(&at.id);
    // There is no stored world any more, so the next server begins one.
    begins(serve(&server, &[playground().to_str().unwrap()]));
}

/// As `nohup` starts it.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_that_the_server_was_started_to_ignore_stays_ignored() {
    let mut server = Server::playground("1");
    server.process.kill();
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$0\" \"$@\""]).arg(PROGRAM);
    shell
        .args(["serve", "--listen", &server.address, "--json", "--data"])
        .arg(server.data())
        .arg(playground());
    server.process = Process::start(&mut shell);
    server.process.line("listening ");
    server.process.signal("-HUP");
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.process.id())).unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    assert_eq!(u64::from_str_radix(ignored.trim(), 16).unwrap() & 1, 1, "{status}");
    let (_, _node) = server.node();
    server.view();
    server.process.signal("-TERM");
    let ended = server.process.end_within(LIMIT);
    assert_eq!((ended.code(), &ended.json()["kept"]), (Some(0), &true.into()), "{ended:?}");
    server.restart();
    server.stop();
}

#[test]
fn an_end_that_no_server_has_heard_of_is_withdrawn() {
    let mut server = Server::playground("1");
    let (_, _node) = server.node();
    server.view();
    server.process.signal("-STOP");
    let ended = end_world(&server.data(), Duration::from_millis(300)).unwrap();
    assert_eq!(ended, WorldEnd::Unheard);
    assert!(!server.data().join("end-request").exists());
    server.process.signal("-CONT");
    let witness = server.witness();
    witness.advance(60);
    witness.leave();
    server.stop();
}

#[test]
fn a_world_without_a_server_is_ended_by_its_folder_and_nothing_is_no_world() {
    let server = killed(0.0);
    let end = || Process::start(dcd(&["end", "--data"]).arg(server.data())).end();
    let first = end();
    assert_eq!(first.code(), Some(0), "{first:?}");
    assert!(first.lines[0].contains("no server ran"), "{first:?}");
    let again = end();
    assert_eq!(again.code(), Some(2), "{again:?}");
    assert!(again.errors.contains("keeps no world") && again.errors.contains("--data"), "{again:?}");
    begins(serve(&server, &[playground().to_str().unwrap()]));
    let nowhere = Process::start(&mut dcd(&["end", "--data", "/nonexistent/dcd"])).end();
    assert_eq!(nowhere.code(), Some(2), "{nowhere:?}");
    assert!(!std::path::Path::new("/nonexistent").exists());
}

#[test]
fn the_files_that_stay_when_a_world_has_ended_are_those_that_help_names() {
    let mut server = Server::playground("1");
    let (_, _node) = server.node();
    server.view();
    server.end_world();
    let files = std::fs::read_dir(server.data()).unwrap();
    let mut files: Vec<_> = files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    files.retain(|file| !file.ends_with(".lock"));
    files.sort();
    assert_eq!(files, ["authority.pem", "joins.log", "world.redb"]);
    let help = Process::start(&mut dcd(&["serve", "--help"])).end().lines.concat();
    assert!(files.iter().all(|file| help.contains(file)), "{help}");
}

#[test]
fn a_world_whose_record_of_joins_is_lost_gives_no_name_twice_and_says_so() {
    let mut server = Server::playground("1");
    let (name, _node) = server.node();
    assert_eq!(name, "n1");
    server.view();
    server.process.kill();
    std::fs::remove_file(server.data().join("joins.log")).unwrap();
    server.restart();
    let (name, _other) = server.node();
    assert_eq!(name, "n2");
    server.process.interrupt();
    let ended = server.process.end_within(LIMIT);
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    assert!(ended.errors.contains("joins.log") && ended.errors.contains("from a backup"), "{ended:?}");
}

#[test]
fn another_world_than_the_stored_one_is_refused() {
    let server = killed(0.0);
    let scene = playground();
    let scene = scene.to_str().unwrap();
    let other = ["another world that has not ended", "the same scene with the same options", "`dcd end`"];
    let differs = |parts| [&other[..], &[parts]].concat();
    refused(&server, &["tower"], &differs("it differs in bodies"));
    refused(&server, &[scene, "--regions", "4"], &differs("(it differs in regions (--regions, --cut)"));
    // A scene of the same size, cut the same way.
    let same_size = server.folder.path().join("other.toml");
    let text = std::fs::read_to_string(scene).unwrap();
    let changed = text.replacen("density = 4.0", "density = 5.0", 1);
    assert_ne!(text, changed, "the test needs a number to change");
    std::fs::write(&same_size, changed).unwrap();
    refused(&server, &[same_size.to_str().unwrap()], &other);
    begins(serve(&server, &["tower", "--fresh"]));
}

#[test]
fn a_fresh_world_takes_the_place_of_a_stored_one_and_is_stored_itself() {
    let mut server = killed(2.5);
    let scene = playground();
    let mut fresh = serve(&server, &[scene.to_str().unwrap(), "--fresh"]);
    server.address = fresh.line("listening ");
    server.process = fresh;
    let (_, mut node) = server.node();
    let view = server.view();
    assert!(view.contains("at tick 0: "), "{view}");
    let number: u64 = view.split(' ').next().unwrap().parse().unwrap();
    assert!(number > 1_000, "its views are after all those of the world before it: {view}");
    server.process.kill();
    node.kill();
    assert!(server.restart() < 60);
}

#[test]
fn a_damaged_world_is_refused_and_can_be_begun_anew() {
    let server = killed(0.0);
    let path = server.data().join("world.redb");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    refused(&server, &[playground().to_str().unwrap()], &["world.redb is damaged", "restore it from a copy"]);
    begins(serve(&server, &[playground().to_str().unwrap(), "--fresh"]));
    begins(serve(&server, &[playground().to_str().unwrap()]));
}

#[test]
fn a_node_and_a_participant_say_where_they_listen() {
    let server = Server::playground("1");
    let (_, mut node) = server.node();
    let address: std::net::SocketAddr = node.line("listening ").parse().unwrap();
    assert!(address.ip().is_loopback() && address.port() > 0);
    let free = dcd_tests::proxy::free_address().to_string();
    let token = server.token("participant");
    let args = ["client", "--avatars", "0", "--server", &server.address, "--token", &token];
    let mut client = Process::start(dcd(&args).args(["--compute", "--listen", &free, "--advertise", &free]));
    client.line("joined as ");
    assert_eq!(client.line("listening "), free);
    for option in ["--listen", "--advertise"] {
        let ended = Process::start(dcd(&args).args([option, &free])).end();
        assert_eq!(ended.code(), Some(2), "{ended:?}");
        assert!(ended.errors.contains("--compute"), "{ended:?}");
    }
}
