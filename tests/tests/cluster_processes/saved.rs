//! Tests `dcd save`, `dcd restore` and `dcd serve FILE.dcd` on running servers.

use std::path::Path;

use crate::process::{Ended, Process, Server, dcd, playground};

fn on(server: &Server, verb: &str, file: &Path) -> Ended {
    Process::start(dcd(&[verb, "--data"]).arg(server.data()).arg(file)).end()
}

#[test]
fn an_operator_saves_a_running_world_goes_back_to_it_and_serves_it_elsewhere() {
    let mut server = Server::playground("2");
    let nodes = [server.node(), server.node()];
    server.view();
    let witness = server.witness();
    let file = server.folder.path().join("half.dcd");
    let saved = on(&server, "save", &file);
    assert_eq!(saved.code(), Some(0), "{saved:?}");
    assert!(saved.lines[0].starts_with("saved ") && saved.lines[0].contains("movable bodies"), "{saved:?}");

    witness.advance(90);
    let at = |id| witness.world.body(id).map(|view| view.body.state.pose.translation);
    let before = at(witness.avatar).unwrap();
    let restored = on(&server, "restore", &file);
    assert_eq!(restored.code(), Some(0), "{restored:?}");
    assert!(restored.lines[0].starts_with("the world goes on with "), "{restored:?}");
    witness.advance(30);
    // It moved sideways for 1.5 s after the save, and for half a second since the restore.
    let after = at(witness.avatar).unwrap();
    assert!(after[2] < before[2] - 0.2, "the avatar is where it was: {before:?}, {after:?}");

    // The saved file runs alone, and on another server.
    let alone = Process::start(dcd(&["run", "--seconds", "0.5", "--json"]).arg(&file)).end();
    assert_eq!((alone.code(), alone.json()["lost"].as_u64()), (Some(0), Some(0)), "{alone:?}");
    let other = Server::start(&[file.to_str().unwrap(), "--nodes", "1"]);
    let (_, node) = other.node();
    let watcher = other.witness();
    watcher.advance(10);
    drop(watcher);
    let summary = other.stop();
    drop(node);
    assert!(summary["bodies"].as_u64() > Some(20), "{summary}");

    let gone = on(&server, "restore", Path::new("nothing.dcd"));
    assert_eq!(gone.code(), Some(2), "{gone:?}");
    assert!(gone.errors.contains("nothing.dcd") && gone.errors.contains("No such file"), "{gone:?}");
    let foreign = on(&server, "restore", &playground());
    assert!(foreign.code() == Some(2) && foreign.errors.contains("not a snapshot"), "{foreign:?}");
    // A pipe that nobody reads from or writes to.
    let pipe = server.folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for verb in ["save", "restore"] {
        let refused = on(&server, verb, &pipe);
        assert!(refused.code() == Some(2) && refused.errors.contains("not a regular file"), "{refused:?}");
    }
    let own = on(&server, "save", &server.data().join("authority.pem"));
    assert!(own.code() == Some(2) && own.errors.contains("must not replace"), "{own:?}");
    let nowhere = on(&server, "save", &server.folder.path().join("no/folder/x.dcd"));
    assert!(nowhere.code() == Some(2) && nowhere.errors.contains("x.dcd"), "{nowhere:?}");
    drop(witness);
    let left: Vec<_> =
        std::fs::read_dir(server.data()).unwrap().map(|file| file.unwrap().file_name()).collect();
    let is_left = |name: &std::ffi::OsString| {
        let name = name.to_string_lossy();
        ["request-", "answer-", "asker-"].iter().any(|kind| name.contains(kind))
    };
    assert!(!left.iter().any(is_left), "{left:?}");
    server.end_world();
    drop(nodes);
    let dead = on(&server, "save", &file);
    assert!(dead.code() == Some(2) && dead.errors.contains("no server runs"), "{dead:?}");
    let ordered = Process::start(dcd(&["serve", "--regions", "2"]).arg(&file)).end();
    assert!(ordered.code() == Some(2) && ordered.errors.contains("leave --regions out"), "{ordered:?}");
}
