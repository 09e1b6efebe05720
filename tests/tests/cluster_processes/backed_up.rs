//! Tests `dcd backup`: a copy of a running server's data folder can go on in the server's place.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::process::{Ended, Process, Server, dcd, playground};

fn back_up(data: &Path, folder: &Path) -> Ended {
    Process::start(dcd(&["backup", "--data"]).args([data, folder])).end()
}

/// Returns the command so that it can write to no file. (The limit is on the size of files, since no test may
/// mount a disk that is full.)
fn under_a_full_disk(command: &mut Command) -> Command {
    let mut limited = Command::new("sh");
    limited.args(["-c", "trap '' XFSZ; ulimit -f 0; exec \"$@\"", "sh"]);
    limited.arg(command.get_program()).args(command.get_args());
    limited
}

#[test]
fn a_server_with_a_backup_in_place_of_its_folder_goes_on_with_the_same_world_and_the_same_processes() {
    let mut server = Server::start(&[playground().to_str().unwrap(), "--nodes", "2", "--regions", "2"]);
    let (folder, address) = (server.folder.path().to_owned(), server.address.clone());
    let file = |name: &str| folder.join(name);
    let (first, second) = (file("first"), file("second"));
    let kept = [first.to_str().unwrap(), second.to_str().unwrap()].map(|path| ["--identity", path]);
    let used = server.token("node");
    let join = |more: &[&str]| Process::start(dcd(&["node", "--json", "--server", &address]).args(more));
    let unkept = join(&["--token", &used, "--identity", file("no/identity").to_str().unwrap()]).end();
    assert!(unkept.code() == Some(2) && unkept.errors.contains("no/identity"), "no use is spent: {unkept:?}");
    let mut no_room = under_a_full_disk(&mut dcd(&[
        "node",
        "--json",
        "--server",
        &address,
        "--token",
        &used,
        "--identity",
        kept[0][1],
    ]));
    let no_room = Process::start(&mut no_room).end();
    assert!(
        no_room.code() == Some(2) && no_room.errors.contains("File too large"),
        "no use is spent: {no_room:?}"
    );
    assert!(!file("first").exists() && !file("first.draft").exists(), "nothing is left");
    let mut spent = join(&["--token", &used, "--identity", kept[0][1]]);
    assert_eq!(spent.line("joined as "), "n1");
    let (name, other) = server.node_with(&kept[1]);
    assert_eq!(name, "n2");
    server.view();
    let witness = server.witness();
    witness.advance(150);
    let (data, copy) = (server.data(), file("copy"));
    let copied = back_up(&data, &copy);
    assert_eq!(copied.code(), Some(0), "{copied:?}");
    assert!(copied.lines[0].contains("with 156 movable bodies"), "{copied:?}");
    assert!(copied.lines[0].contains(&format!("with --data {}", copy.display())), "{copied:?}");
    let inside = back_up(&data, &data.join("kept/monday"));
    assert!(inside.code() == Some(2) && inside.errors.contains("choose a folder elsewhere"), "{inside:?}");
    for (place, said) in [(&copy, "it is there already"), (&file("no/folder"), "no/folder")] {
        let refused = back_up(&data, place);
        let errors = &refused.errors;
        assert!(refused.code() == Some(2) && errors.contains(said), "{refused:?}");
        assert!(errors.contains("name a folder") && !errors.contains("start again"), "{refused:?}");
    }
    // A node joins after the backup.
    let (late, later) = server.node();
    assert_eq!(late, "n3");
    witness.advance(30);
    let before = witness.tick();

    // The machine is lost.
    drop((witness, spent, other, later));
    server.process.kill();
    fs::remove_dir_all(&data).unwrap();
    let rest = back_up(&copy, &file("another"));
    assert!(rest.code() == Some(2) && rest.errors.contains("copy the folder as it is"), "{rest:?}");
    fs::rename(&copy, &data).unwrap();
    let tick = server.restart();
    assert!((1..=before).contains(&tick), "{tick} {before}");
    let names = kept.map(|kept| {
        let mut node = join(&kept);
        (node.line("joined as "), node)
    });
    assert_eq!(names.each_ref().map(|(name, _)| name.as_str()), ["n1", "n2"]);
    let stranger = join(&["--token", &used]).end();
    assert!(stranger.code() == Some(2) && stranger.errors.contains("used"), "{stranger:?}");
    let (late, _later) = server.node();
    assert_eq!(late, "n1048579", "a name that was given after the backup is not given again");
    let mut status = dcd(&["status", "--server", &address, "--data"]);
    let told = Process::start(status.arg(&data)).end();
    assert!(told.lines.iter().any(|line| line.starts_with("n1048579 ")), "{told:?}");
    let witness = server.witness();
    witness.advance(30);
    witness.leave();
    let summary = server.end_world();
    // An avatar is removed when its client is given up.
    assert!((155..=156).contains(&summary["bodies"].as_u64().unwrap()), "{summary}");
}

#[test]
fn a_token_lets_as_many_nodes_in_as_it_is_made_for_over_a_restart_of_the_server_too() {
    let mut server = Server::playground("1");
    let minted =
        Process::start(dcd(&["token", "--role", "node", "--uses", "3", "--data"]).arg(server.data())).end();
    let token = minted.lines[0].clone();
    let address = server.address.clone();
    let join = || Process::start(&mut dcd(&["node", "--json", "--server", &address, "--token", &token]));
    let (mut one, mut two) = (join(), join());
    let names = [one.line("joined as "), two.line("joined as ")];
    assert_ne!(names[0], names[1]);
    server.view();
    server.process.kill();
    server.restart();
    let mut three = join();
    assert_eq!(three.line("joined as "), "n3");
    let four = join().end();
    assert!(four.code() == Some(2) && four.errors.contains("by as many processes as it lets in"), "{four:?}");
    let none =
        Process::start(dcd(&["token", "--role", "node", "--uses", "0", "--data"]).arg(server.data())).end();
    assert_eq!(none.code(), Some(2), "{none:?}");
    server.end_world();
}
