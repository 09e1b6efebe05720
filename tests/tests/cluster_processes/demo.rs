//! Tests `dcd demo`: it runs a server, nodes and a C program, and leaves no process behind.

use std::collections::BTreeSet;
use std::io::Write;
use std::net::UdpSocket;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::process::{LIMIT, Process, dcd};

#[test]
fn the_demo_shows_the_whole_chain_with_a_c_program() {
    // The library that cargo built with this test. The demo itself would have it built with other features of
    // all crates, which takes minutes.
    let library = std::env::current_exe().unwrap().with_file_name("libdcd_ffi.a");
    let mut demo = dcd(&["demo", "--json", "--seconds", "6", "--kill", "--kill-server", "--c-library"]);
    let ended = Process::start(demo.arg(library)).end_within(4 * LIMIT);
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    let result = ended.json();
    let keys: BTreeSet<_> = result.as_object().unwrap().keys().map(String::as_str).collect();
    let contract =
        "nodes regions bodies ticks tick_ms transfers ghosts_mean lost doubled client_updates client_contacts
                    avatar_moved_m bytes_per_s";
    assert_eq!(keys, contract.split_whitespace().collect());
    assert_eq!(
        (&result["nodes"], &result["regions"], &result["bodies"]),
        (&2.into(), &2.into(), &155.into())
    );
    assert_eq!((&result["lost"], &result["doubled"]), (&0.into(), &0.into()));
    let above = |value: &Value, least: f64| assert!(value.as_f64().unwrap() > least, "{result}");
    above(&result["client_contacts"], 0.0);
    above(&result["client_updates"], 20.0);
    above(&result["avatar_moved_m"], 5.0);
    above(&result["ticks"], 60.0);
    above(&result["tick_ms"]["p50"], 0.0);
    above(&result["bytes_per_s"], 0.0);
    for told in ["the server is back after", "going on with the world at tick", "taken over after"] {
        assert!(ended.errors.contains(told), "{ended:?}");
    }
}

/// Writes a script that stands in for the C program.
fn script(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("program.sh");
    let mut file = std::fs::OpenOptions::new().write(true).create_new(true).mode(0o755).open(&path).unwrap();
    write!(file, "#!/bin/sh\n{text}\n").unwrap();
    path
}

/// Starts a demo whose program does not end, with its own temporary folder. Returns it with the program's
/// process id and the server's address.
fn endless(folder: &Path) -> (std::process::Child, String, String) {
    let told = folder.join("told");
    let program =
        script(folder, &format!("echo $$ $1 > {0}.new; mv {0}.new {0}; exec sleep 600", told.display()));
    std::fs::create_dir(folder.join("tmp")).unwrap();
    let demo = dcd(&["demo", "--seconds", "500", "--client-program"])
        .arg(program)
        .env("TMPDIR", folder.join("tmp"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + LIMIT;
    while !told.exists() {
        assert!(Instant::now() < deadline, "the program was not started");
        std::thread::sleep(Duration::from_millis(10));
    }
    let words = std::fs::read_to_string(told).unwrap();
    let (id, address) = words.trim().split_once(' ').unwrap();
    (demo, id.to_owned(), address.to_owned())
}

fn soon(what: &str, mut is_so: impl FnMut() -> bool) {
    let deadline = Instant::now() + LIMIT;
    while !is_so() {
        assert!(Instant::now() < deadline, "not so in time: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn lives(id: &str) -> bool {
    Command::new("kill").args(["-0", id]).stderr(Stdio::null()).status().unwrap().success()
}

/// Returns the processes that any thread of a process has started.
fn children(of: u32) -> Vec<String> {
    let tasks = std::fs::read_dir(format!("/proc/{of}/task")).unwrap();
    let of_task = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("children")).unwrap();
    let ids: Vec<_> = tasks.map(|task| of_task(task.unwrap())).collect();
    ids.iter().flat_map(|ids| ids.split_whitespace()).map(str::to_owned).collect()
}

/// Returns whether a process runs. A process that has ended stays as a zombie until its parent, or who took
/// it over, waits for it.
fn runs(id: &str) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    stat.rsplit_once(") ").is_some_and(|(_, state)| !state.starts_with(['Z', 'X']))
}

#[test]
fn ctrl_c_ends_the_demo_with_all_its_processes_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let (mut demo, program, address) = endless(folder.path());
    assert!(Command::new("kill").args(["-INT", &demo.id().to_string()]).status().unwrap().success());
    soon("the demo ends", || demo.try_wait().unwrap().is_some());
    assert_eq!(demo.wait().unwrap().code(), Some(130));
    assert!(!lives(&program));
    UdpSocket::bind(&address).expect("the server has ended");
    assert_eq!(std::fs::read_dir(folder.path().join("tmp")).unwrap().count(), 0);
}

#[test]
fn a_killed_demo_leaves_no_server_and_no_node_behind() {
    let folder = tempfile::tempdir().unwrap();
    let (mut demo, program, address) = endless(folder.path());
    let children: Vec<_> = children(demo.id()).into_iter().filter(|id| *id != program).collect();
    assert!(children.len() >= 3, "a server and two nodes: {children:?}");
    demo.kill().unwrap();
    demo.wait().unwrap();
    soon("the server ends", || UdpSocket::bind(&address).is_ok());
    soon("the nodes end", || !children.iter().any(|id| runs(id)));
    let _ = Command::new("kill").args(["-KILL", &program]).status();
}

#[test]
fn a_program_that_fails_or_meets_nothing_fails_the_demo() {
    for (text, expected) in [
        ("echo trouble >&2; exit 3", "the C program failed (exit status: 3); its last words:\n  trouble"),
        ("echo join: updates=1 contacts=0 moved_m=1.0 bodies=1", "heard of no contact"),
        ("echo hello", "did not say what it heard"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let program = script(folder.path(), text);
        let mut demo = dcd(&["demo", "--seconds", "1", "--client-program"]);
        let ended = Process::start(demo.arg(program)).end_within(4 * LIMIT);
        assert_eq!(ended.code(), Some(1), "{ended:?}");
        assert!(ended.errors.contains(expected), "{ended:?}");
    }
    let ended = Process::start(&mut dcd(&["demo", "--kill", "--nodes", "1"])).end();
    assert_eq!(ended.code(), Some(2));
    assert!(ended.errors.contains("give --nodes 2 or more"), "{ended:?}");
}
