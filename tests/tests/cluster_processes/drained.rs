//! Tests `dcd drain`: an operator removes nodes from a running world.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::process::{Ended, LIMIT, Process, Server, alone, dcd, playground};

/// The longest time that the world may stand still while regions are handed over, on a machine that is busy
/// with other tests. Meanwhile the server also writes to the disk. On an idle machine it is three or four
/// ticks; a node that is given up stops the world for longer than this.
const STANDS: Duration = Duration::from_secs(1);

fn drain(data: &Path, node: &str) -> Ended {
    Process::start(dcd(&["drain", node, "--data"]).arg(data)).end()
}

#[test]
fn all_processes_are_replaced_one_after_the_other_while_the_world_runs() {
    let mut server = Server::start(&[playground().to_str().unwrap(), "--nodes", "3", "--regions", "3"]);
    let data = server.data();
    let folder = server.folder.path().to_owned();
    let kept = |number: usize| {
        let path = folder.join(format!("identity-{number}"));
        ["--identity".to_owned(), path.to_str().unwrap().to_owned()]
    };
    let start =
        |server: &Server, number: usize| server.node_with(&kept(number).each_ref().map(String::as_str));
    let mut nodes = [1, 2, 3].map(|number| start(&server, number));
    server.view();
    let witness = server.witness();
    witness.advance(30);
    for (number, (name, node)) in nodes.iter_mut().enumerate() {
        assert_eq!(drain(&data, name).code(), Some(0));
        assert_eq!(node.end_within(LIMIT).code(), Some(0));
        let again = start(&server, number + 1);
        assert_eq!(&again.0, name);
        *node = again.1;
        while !server.view().contains(&format!("{name} r")) {}
        witness.advance(10);
    }
    // The nodes compute on meanwhile.
    server.process.interrupt();
    assert_eq!(server.process.end_within(LIMIT).code(), Some(0));
    server.restart();
    witness.advance(60);
    witness.leave();
    let summary = server.end_world();
    assert_eq!(summary["nodes"], 3, "{summary}");
}

#[test]
fn a_drained_node_hands_its_regions_over_while_the_world_runs_and_comes_back_under_its_name() {
    let _by_itself = alone();
    let mut server = Server::start(&[playground().to_str().unwrap(), "--nodes", "3", "--regions", "3"]);
    let data = server.data();
    let identity = server.folder.path().join("identity");
    let kept = ["--identity", identity.to_str().unwrap()];
    let (name, goes) = server.node_with(&kept);
    let stay = [server.node(), server.node()];
    assert!(server.view().contains("n3 r"), "all compute");
    let witness = server.witness();
    witness.advance(30);

    let stood = std::thread::scope(|scope| {
        let drained = scope.spawn(|| drain(&data, &name));
        let stood = witness.watch_until(|| drained.is_finished());
        let drained = drained.join().unwrap();
        assert_eq!(drained.code(), Some(0), "{drained:?}");
        assert_eq!(
            drained.lines,
            [format!("{name} is drained: other nodes have its regions, and it has ended")]
        );
        stood
    });
    println!("the world stood still for {stood:?} at most");
    assert!(stood < STANDS, "{stood:?}");
    let ended = goes.end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    assert!(ended.errors.contains("it was drained: other nodes have its regions"), "{ended:?}");
    let view = server.view();
    assert!(!view.contains(&format!("{name} r")) && view.contains("n2 r") && view.contains("n3 r"), "{view}");
    witness.advance(30);

    let gone = drain(&data, &name);
    assert!(gone.code() == Some(2) && gone.errors.contains("has left the world already"), "{gone:?}");
    // Stands for a request of root under the umask 077, which the server cannot read. The tests may run as
    // root themselves, so the content is unreadable instead.
    let asker = std::fs::File::create(data.join("asker-0")).unwrap();
    asker.lock().unwrap();
    std::fs::write(data.join("request-0"), [0xff]).unwrap();
    let answer = data.join("answer-0");
    let asked = Instant::now();
    witness.watch_until(|| answer.exists() || asked.elapsed() > LIMIT);
    let answer = std::fs::read_to_string(answer).unwrap();
    assert!(answer.starts_with("failed\nthe server cannot read the request"), "{answer}");
    let stranger = drain(&data, "n9");
    assert!(stranger.code() == Some(2) && stranger.errors.contains("never was"), "{stranger:?}");
    let nothing = drain(&data, "rock");
    assert!(nothing.code() == Some(2) && nothing.errors.contains("write its name"), "{nothing:?}");

    let (again, back) = server.node_with(&kept);
    assert_eq!(again, name, "it is let in again");
    assert!(server.view().contains(&format!("{name} r")));
    let (hangs, hanging) = server.node();
    while !server.view().contains(&format!("{hangs} r")) {}
    hanging.signal("-STOP");
    let lost = drain(&data, &hangs);
    assert!(lost.code() == Some(1) && lost.errors.contains("was lost before it had handed"), "{lost:?}");
    drop(hanging);
    for (name, node) in stay {
        assert_eq!(drain(&data, &name).code(), Some(0));
        assert_eq!(node.end().code(), Some(0));
    }
    let last = drain(&data, &name);
    assert!(
        last.code() == Some(2) && last.errors.contains("is the last node: start another one"),
        "{last:?}"
    );
    witness.advance(30);
    witness.leave();
    server.end_world();
    assert_eq!(back.end().code(), Some(0));
    let dead = drain(&data, &name);
    assert!(dead.code() == Some(2) && dead.errors.contains("no server runs"), "{dead:?}");
}
