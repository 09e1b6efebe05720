//! Tests that errors name their cause and a remedy, and that nothing hangs.

use std::net::{TcpListener, UdpSocket};
use std::time::{Duration, Instant};

use crate::process::{LIMIT, Process, Server, dcd};

/// Returns the error output of a command that must fail.
fn error(args: &[&str], code: i32) -> String {
    let ended = Process::start(&mut dcd(args)).end();
    assert_eq!(ended.code(), Some(code), "{args:?}: {ended:?}");
    assert!(ended.errors.contains("error: "), "{args:?}: {ended:?}");
    ended.errors
}

fn has(said: &str, parts: &[&str]) {
    for part in parts {
        assert!(said.contains(part), "`{part}` is missing in: {said}");
    }
}

#[test]
fn a_server_that_cannot_start_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    has(&error(&["serve", "towr", "--data", data], 2), &["no scene `towr`", "did you mean `tower`?"]);
    has(&error(&["serve", "nowhere.toml", "--data", data], 2), &["cannot read scene file nowhere.toml"]);
    has(&error(&["serve", "tower", "--cut", "y=99", "--data", data], 2), &["plane y=99 cuts no region"]);
    has(&error(&["serve", "tower", "--listen", "here", "--data", data], 2), &["here:7420"]);
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let said = error(&["serve", "tower", "--listen", &address, "--data", data], 1);
    has(&said, &[&address, "in use by another process", "port 0"]);
    let page = TcpListener::bind("127.0.0.1:0").unwrap();
    let metrics = page.local_addr().unwrap().to_string();
    let stands_by = ["serve", "tower", "--directory", "etcd://127.0.0.1:9/w", "--listen", "127.0.0.1:0"];
    let stands_by = [&stands_by[..], &["--metrics", &metrics, "--data", data]].concat();
    has(&error(&stands_by, 2), &[&metrics, "stand by for one another", "of its own"]);
    let level = folder.path().join("level.dcd");
    let level = level.to_str().unwrap();
    let saved = Process::start(&mut dcd(&["run", "tower", "--seconds", "0.1", "--save", level])).end();
    assert_eq!(saved.code(), Some(0), "{saved:?}");
    let said = error(&["serve", level, "--lag", "4", "--listen", "127.0.0.1:0", "--data", data], 2);
    has(
        &said,
        &["this snapshot goes on by", "leave --lag out", "serve the scene anew with --coupling owner"],
    );
    assert!(!said.contains("add --coupling owner"), "{said}");
    let fresh = folder.path().join("fresh");
    error(&["serve", "tower", "--listen", &address, "--data", fresh.to_str().unwrap()], 1);
    assert!(!fresh.exists(), "a server that cannot listen leaves no folder behind");
    let server = Server::start(&["tower"]);
    let data = server.data();
    let [answer, asker, part] = ["answer-1", "asker-1", "part"].map(|name| data.join(name));
    // Who asked waits still, which its lock says.
    let waits = std::fs::File::create(&part).unwrap();
    waits.lock().unwrap();
    std::fs::rename(&part, &asker).unwrap();
    std::fs::write(&answer, "done\nsaved").unwrap();
    let said = error(&["serve", "tower", "--listen", "127.0.0.1:0", "--data", data.to_str().unwrap()], 1);
    has(&said, &["another server is running with the data folder", "choose another folder"]);
    assert!(answer.exists(), "what the running server has answered is not forgotten");
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let new = ["token", "--role", "node", "--new", "--data", file.to_str().unwrap()];
    has(&error(&new, 2), &["cannot use", "file"]);
    let typo = folder.path().join("typo");
    let said = error(&["token", "--role", "node", "--data", typo.to_str().unwrap()], 2);
    has(&said, &["no server has used", "typo", "--data", "--new"]);
    assert!(!typo.exists(), "and none is made for it");
    for wrong in
        [&["--role", "server"][..], &["--role", "node", "--valid", "10"], &["--role", "node", "--count", "0"]]
    {
        error(&[&["token"], wrong].concat(), 2);
    }
    has(&error(&["token", "--role", "server"], 2), &["node, client, participant or builder"]);
}

#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_looked_into_is_not_taken_for_an_empty_one() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("loop");
    // Stands for a folder of another user, whose content cannot be read.
    std::os::unix::fs::symlink(&data, &data).unwrap();
    for args in [
        &["end"][..],
        &["token", "--role", "node"],
        &["status"],
        &["save", "x.dcd"],
        &["restore", "x.dcd"],
        &["backup", "copy"],
        &["drain", "n1"],
    ] {
        let ended = Process::start(dcd(args).arg("--data").arg(&data)).end();
        assert!(ended.code() != Some(0) && ended.errors.contains("cannot use"), "{args:?}: {ended:?}");
        assert!(ended.errors.contains("ask as the user that the server runs as"), "{args:?}: {ended:?}");
        for wrong in ["keeps no world", "no server runs", "no server has used", "no server serves"] {
            assert!(!ended.errors.contains(wrong), "{args:?}: {ended:?}");
        }
    }
}

#[cfg(unix)]
#[test]
fn who_dials_a_server_that_says_nothing_ends_at_once_when_it_is_told_to() {
    let folder = tempfile::tempdir().unwrap();
    let token = |role: &str| {
        let mut token = dcd(&["token", "--new", "--role", role, "--data"]);
        Process::start(token.arg(folder.path())).end().lines[0].clone()
    };
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    silent.set_read_timeout(Some(LIMIT)).unwrap();
    let address = silent.local_addr().unwrap().to_string();
    for (command, role, signal) in
        [("node", "node", "-INT"), ("client", "client", "-TERM"), ("status", "client", "-HUP")]
    {
        let token = token(role);
        let mut dials = Process::start(&mut dcd(&[command, "--server", &address, "--token", &token]));
        silent.recv(&mut [0; 2_048]).unwrap();
        dials.signal(signal);
        let asked = Instant::now();
        let ended = dials.end_within(LIMIT);
        assert_eq!(ended.code(), Some(130), "{command}: {ended:?}");
        // It would dial for ten seconds.
        assert!(asked.elapsed() < Duration::from_secs(8), "{command}: {:?}", asked.elapsed());
        // What it sent until then is not taken for the next one's.
        silent.set_nonblocking(true).unwrap();
        while silent.recv(&mut [0; 2_048]).is_ok() {}
        silent.set_nonblocking(false).unwrap();
    }
}

#[test]
fn a_process_that_is_not_let_in_says_why() {
    let server = Server::start(&["tower"]);
    let join =
        |kind: &str, token: &str, code| error(&[kind, "--server", &server.address, "--token", token], code);
    let good = server.token("node");
    has(&join("client", &good, 2), &["token is for a node", "dcd token --role client"]);
    has(&join("node", &server.token("client"), 2), &["token is for a client", "dcd token --role node"]);
    has(&join("node", &server.token("builder"), 2), &["token is for a builder", "dcd token --role node"]);
    let other = if good.ends_with('a') { "b" } else { "a" };
    let mistyped = format!("{}{other}", &good[..good.len() - 1]);
    has(&join("node", &mistyped, 2), &["mistyped or cut off", "copy the whole line"]);
    for kind in ["node", "client"] {
        let identity = server.folder.path().join("nobody");
        let args = [kind, "--server", &server.address, "--identity", identity.to_str().unwrap()];
        has(&error(&args, 2), &["no token is given", "--token-file"]);
    }
    has(&join("node", "hello", 2), &["no dcd token", "dcd1-"]);
    let mut elsewhere = dcd(&["token", "--new", "--role", "node", "--data"]);
    let foreign = Process::start(elsewhere.arg(server.folder.path().join("other"))).end().lines[0].clone();
    has(&join("node", &foreign, 2), &["check the address", "token"]);
    // A token can be used once.
    let mut node = Process::start(&mut dcd(&["node", "--server", &server.address, "--token", &good]));
    node.line("joined as ");
    has(&join("node", &good, 2), &["has been used already", "dcd token"]);
    let mut short = dcd(&["token", "--role", "client", "--valid", "1s", "--data"]);
    let short = Process::start(short.arg(server.data())).end().lines[0].clone();
    // Times are compared in whole seconds: a token valid for a second may last for two.
    std::thread::sleep(Duration::from_millis(2_100));
    has(&join("client", &short, 2), &["has expired", "dcd token"]);
    let fast = ["client", "--server", &server.address, "--token", &server.token("client"), "--speed", "99"];
    has(&error(&fast, 2), &["20 m/s at most", "--speed"]);
}

#[test]
fn many_tokens_are_one_a_line_and_each_lets_one_in() {
    let server = Server::start(&["tower"]);
    let mut command = dcd(&["token", "--role", "client", "--count", "3", "--data"]);
    let ended = Process::start(command.arg(server.data())).end();
    assert_eq!((ended.code(), ended.lines.len()), (Some(0), 3), "{ended:?}");
    for (i, token) in ended.lines.iter().enumerate() {
        let args =
            ["client", "--avatars", "0", "--seconds", "0.1", "--server", &server.address, "--token", token];
        let mut client = Process::start(&mut dcd(&args));
        assert_eq!(client.line("joined as "), format!("c{}", i + 1));
        assert_eq!(client.end().code(), Some(0));
    }
}

#[test]
fn a_server_that_is_not_there_or_goes_away_is_named() {
    let closed = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let folder = tempfile::tempdir().unwrap();
    let mut minted = dcd(&["token", "--new", "--role", "node", "--data"]);
    let unused = Process::start(minted.arg(folder.path())).end().lines[0].clone();
    let said = error(&["node", "--server", &closed, "--token", &unused], 1);
    has(&said, &[&closed, "no answer", "check that it is running"]);
    let mut server = Server::playground("2");
    let (_, mut node) = server.node_with(&["--give-up", "2"]);
    let (_, mut patient) = server.node();
    server.view();
    let token = server.token("client");
    let args = ["client", "--server", &server.address, "--give-up", "2.5", "--token", &token];
    let mut client = Process::start(&mut dcd(&args));
    client.line("joined as ");
    server.process.kill();
    let killed = Instant::now();
    // A client notices a lost link late: it may miss its node, which has given up, before the server.
    let of_server = [&*server.address, "start it again", "a new token"];
    for (process, waited, parts) in [(&mut node, "2", &of_server[..]), (&mut client, "2.5", &[])] {
        let ended = process.end_within(LIMIT);
        assert!(killed.elapsed() > Duration::from_secs_f64(waited.parse().unwrap()));
        assert_eq!(ended.code(), Some(1), "{ended:?}");
        has(&ended.errors, &[&format!("has been out of reach for {waited} s"), "--give-up"]);
        has(&ended.errors, parts);
    }
    assert!(patient.is_running(), "who is not told to give up waits for its server");
}

#[test]
fn of_two_processes_with_one_identity_the_older_is_told_what_to_do() {
    let server = Server::playground("1");
    let identity = server.folder.path().join("who");
    let node = || {
        let token = server.token("node");
        let args = ["node", "--server", &server.address, "--token", &token, "--identity"];
        let mut node = Process::start(dcd(&args).arg(&identity));
        node.line("joined as ");
        node
    };
    let mut older = node();
    let _newer = node();
    let ended = older.end_within(LIMIT);
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    has(&ended.errors, &[&server.address, "with this one's identity", "an identity file of its own"]);
}

#[test]
fn a_hung_server_does_not_keep_a_node_that_wants_to_go() {
    let mut server = Server::playground("1");
    let (_, node) = server.node();
    server.view();
    server.process.signal("-STOP");
    node.interrupt();
    let ended = node.end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    has(&ended.errors, &[&server.address, "did not take this process's share over", "it is gone without"]);
}

#[test]
fn a_client_that_cannot_reach_the_node_that_leads_is_told_so() {
    let mut server = Server::playground("1");
    let (_, _node) = server.node_with(&["--advertise", "127.0.0.1:9"]);
    server.view();
    let token = server.token("client");
    let args = ["client", "--server", &server.address, "--token", &token, "--give-up", "1"];
    let ended = Process::start(&mut dcd(&args)).end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    has(&ended.errors, &["127.0.0.1:9", "out of reach for 1 s", "--advertise", "--give-up"]);
    server.stop();
}

#[test]
fn a_process_that_cannot_start_does_not_use_up_its_token() {
    let mut server = Server::playground("1");
    let (udp, tcp) = (UdpSocket::bind("127.0.0.1:0").unwrap(), TcpListener::bind("127.0.0.1:0").unwrap());
    let (taken, page) = (udp.local_addr().unwrap().to_string(), tcp.local_addr().unwrap().to_string());
    let token = server.token("node");
    let node = ["node", "--server", &server.address, "--token", &token];
    for (option, address) in [("--listen", &taken), ("--metrics", &page), ("--view", &page)] {
        let ended = Process::start(dcd(&node).args([option, address])).end();
        assert!(matches!(ended.code(), Some(1 | 2)), "{option}: {ended:?}");
        has(&ended.errors, &[address]);
    }
    let mut joined = Process::start(dcd(&node).args(["--listen", "127.0.0.1:0", "--metrics", "127.0.0.1:0"]));
    joined.line("joined as ");
    server.view();
    let token = server.token("client");
    let client = ["client", "--server", &server.address, "--token", &token, "--seconds", "0.1"];
    let ended = Process::start(dcd(&client).args(["--view", &page])).end();
    assert_eq!(ended.code(), Some(2), "{ended:?}");
    let ended = Process::start(dcd(&client).args(["--gltf", "/nonexistent/film.glb"])).end();
    assert_eq!(ended.code(), Some(2), "{ended:?}");
    let ended = Process::start(dcd(&client).args(["--truth", &token])).end();
    assert_eq!(ended.code(), Some(2), "{ended:?}");
    has(&ended.errors, &["--truth has the token of --token"]);
    let ended = Process::start(dcd(&client).arg("--json")).end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    assert!(ended.json()["bytes_per_s"].is_null(), "it stayed too briefly: {ended:?}");
    server.stop();
}
