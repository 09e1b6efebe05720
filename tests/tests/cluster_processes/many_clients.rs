//! Tests that clients which hang, or read nothing, slow down neither the world nor other clients.

use std::time::{Duration, Instant};

use dcd::runtime::ClientWorld;

use crate::process::{LIMIT, Process, Server, alone, dcd};
use crate::witness::joining;

const STRETCH: Duration = Duration::from_secs(4);
/// The number of clients that are stopped.
const STOPPED: usize = 6;

/// Returns how many ticks the world advances in a time, and how often the client is told of states.
fn watch(client: &ClientWorld, time: Duration) -> (u64, u64) {
    let (tick, updates, start) = (client.tick().0, client.updates(), Instant::now());
    while start.elapsed() < time {
        client.wait_update(client.updates(), time.saturating_sub(start.elapsed()));
        client.check().unwrap();
    }
    (client.tick().0 - tick, client.updates() - updates)
}

#[test]
fn clients_that_are_stopped_keep_neither_the_world_nor_other_clients_waiting() {
    let _alone = alone();
    // All cubes move all the time, and each client is told of all of them.
    let server = Server::start(&["dve", "--set", "n=400", "--nodes", "2"]);
    let _nodes = [server.node(), server.node()];
    let crowd: Vec<_> = (0..STOPPED)
        .map(|_| {
            let token = server.token("client");
            let args = ["client", "--server", &server.address, "--token", &token, "--avatars", "0"];
            let mut client = Process::start(&mut dcd(&args));
            client.line("joined as ");
            client
        })
        .collect();
    let client = ClientWorld::connect(&joining(&server.address, server.token("client"))).unwrap();
    assert!(client.wait_update(0, LIMIT));
    watch(&client, Duration::from_secs(1));
    let before = watch(&client, STRETCH);
    crowd.iter().for_each(|client| client.signal("-STOP"));
    let while_stopped = watch(&client, STRETCH);
    crowd.iter().for_each(|client| client.signal("-CONT"));
    let after = watch(&client, STRETCH);
    println!(
        "ticks and updates in {STRETCH:?}: {before:?} before, {while_stopped:?} meanwhile, {after:?} after"
    );
    // Waiting for a client would take seconds. How much a busy machine slows the rest is measured elsewhere
    // (`dcd-benches fan-out`, `floods`).
    let (ticks, updates) = before;
    for (later_ticks, later_updates) in [while_stopped, after] {
        assert!(2 * later_ticks >= ticks && 2 * later_updates >= updates);
    }
    drop((client, crowd));
    server.stop();
}
