//! Tests nodes that a supervisor starts again with the same command, as with `Restart=always` of a systemd
//! unit.

use crate::process::{Process, Server, alone, dcd};

#[test]
fn a_node_that_is_started_again_by_the_same_command_is_who_it_was() {
    let _by_itself = alone();
    let mut server = Server::playground("2");
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (token, identity) = (file("token"), file("identity"));
    std::fs::write(&token, server.token("node") + "\n").unwrap();
    let address = server.address.clone();
    let command = |more: &[&str]| {
        let mut command = dcd(&["node", "--json", "--threads", "1", "--server", &address]);
        Process::start(command.args(more))
    };
    let kept = ["--token-file", &token, "--identity", &identity];
    let mut node = command(&kept);
    let name = node.line("joined as ");
    let (_, _other) = server.node();
    server.view();
    let witness = server.witness();
    witness.advance(10);
    node.kill();
    server.view();
    // The token is used up, but not needed.
    let mut again = command(&kept);
    assert_eq!(again.line("joined as "), name);
    server.view();
    witness.advance(10);
    again.kill();
    server.view();
    let mut third = command(&["--identity", &identity]);
    assert_eq!(third.line("joined as "), name);
    server.view();
    witness.advance(10);

    let stranger = command(&["--token-file", &token]).end();
    assert!(stranger.code() != Some(0) && stranger.errors.contains("used"), "{stranger:?}");
    let nobody = command(&["--identity", &file("none")]).end();
    assert!(nobody.code() != Some(0) && nobody.errors.contains("token"), "{nobody:?}");
    std::fs::write(&token, "one two").unwrap();
    let two = command(&["--token-file", &token]).end();
    assert!(two.code() == Some(2) && two.errors.contains("does not have one token"), "{two:?}");
    witness.leave();
    server.end_world();
}
