//! Tests that relays, nodes other than the leader, tell clients of a world, and that nothing is lost when a
//! relay is killed.

use std::time::{Duration, Instant};

use dcd::runtime::ClientWorld;
use dcd::space::NodeId;

use crate::process::{LIMIT, Server};
use crate::witness::joining;

const CUBES: usize = 200;

/// Returns the relay of each client that is not told by the leader.
fn relays(clients: &[ClientWorld]) -> Vec<NodeId> {
    clients.iter().filter_map(ClientWorld::told_by).collect()
}

/// Waits until a condition holds.
fn wait(clients: &[ClientWorld], mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(
            begun.elapsed() < LIMIT,
            "told by {:?}",
            clients.iter().map(ClientWorld::told_by).collect::<Vec<_>>()
        );
        clients[0].wait_update(clients[0].updates(), Duration::from_millis(100));
        clients.iter().for_each(|client| client.check().unwrap());
    }
}

/// Waits until each client has heard of each cube since its present tick. All cubes move all the time.
fn all_hear(clients: &[ClientWorld]) {
    let from: Vec<_> = clients.iter().map(ClientWorld::tick).collect();
    for (client, from) in clients.iter().zip(from) {
        wait(clients, || {
            let heard = client.with_bodies(|view| (view.settled_tick() > from).then_some(()));
            heard.len() >= CUBES
        });
    }
}

#[test]
fn clients_are_told_by_other_nodes_and_by_the_leader_when_one_of_these_is_killed() {
    let mut server = Server::start(&["dve", "--set", "n=200", "--nodes", "3", "--relays", "1"]);
    let mut nodes = [server.node(), server.node(), server.node()];
    assert!(server.view().contains("n1 leads"));
    let join = |_| ClientWorld::connect(&joining(&server.address, server.token("client"))).unwrap();
    let clients: Vec<_> = (0..4).map(join).collect();
    wait(&clients, || relays(&clients).len() == 3);
    assert!(!relays(&clients).contains(&NodeId(1)));
    all_hear(&clients);
    let killed = relays(&clients)[0];
    nodes[killed.0 as usize - 1].1.kill();
    // The remaining relay and the leader go on.
    wait(&clients, || !relays(&clients).contains(&killed) && relays(&clients).len() == 3);
    all_hear(&clients);
    nodes[if killed.0 == 2 { 2 } else { 1 }].1.kill();
    wait(&clients, || relays(&clients).is_empty());
    all_hear(&clients);
    for client in &clients {
        assert!(client.with_bodies(|_| Some(())).len() >= CUBES);
    }
    drop(clients);
    server.stop();
}
