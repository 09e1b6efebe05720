//! Tests kill -9 of nodes: what the other nodes do, and how long the world stands still.

use std::time::Duration;

use crate::process::{Server, alone};

/// The longest time until a killed node's regions go on elsewhere.
const TAKEOVER: Duration = Duration::from_secs(3);

#[test]
fn a_killed_node_is_taken_over_within_three_seconds_and_nothing_is_lost() {
    let _alone = alone();
    for victim in ["n1", "n2"] {
        let mut server = Server::playground("2");
        let mut nodes = [server.node(), server.node()];
        assert!(server.view().contains("n1 r1, n2 r2; n1 leads"));
        let witness = server.witness();
        let (_, node) = nodes.iter_mut().find(|(name, _)| name == victim).unwrap();
        node.kill();
        let stood = witness.advance(60);
        let survivor = if victim == "n1" { "n2" } else { "n1" };
        let view = server.view();
        assert!(view.contains(&format!("{survivor} r1 r2; {survivor} leads")), "{view}");
        println!("{victim} killed: the world stood still for {:.2} s", stood.as_secs_f64());
        assert!(stood < TAKEOVER, "{victim}: {stood:?}");
        // The avatar is still in the world.
        assert!(witness.world.body(witness.avatar).is_some());
        witness.leave();
        let served = server.stop();
        assert_eq!((&served["views"], &served["nodes"]), (&2.into(), &1.into()));
    }
}

#[test]
fn a_new_node_shares_the_world_again_after_a_death() {
    let _alone = alone();
    let mut server = Server::playground("2");
    let (_first, mut second) = (server.node(), server.node());
    server.view();
    let witness = server.witness();
    second.1.kill();
    witness.advance(30);
    assert!(server.view().contains("r1 r2"));
    let third = server.node();
    let view = server.view();
    assert!(!view.contains("r1 r2") && view.contains(&format!("{} r", third.0)), "{view}");
    let stood = witness.advance(60);
    println!("a node joined: the world stood still for {:.2} s", stood.as_secs_f64());
    assert!(stood < Duration::from_secs(1), "{stood:?}");
    witness.leave();
    server.stop();
}

#[test]
fn the_server_holds_the_world_when_all_nodes_die_and_the_next_node_goes_on() {
    let _alone = alone();
    let mut server = Server::playground("2");
    let mut nodes = [server.node(), server.node()];
    server.view();
    let witness = server.witness();
    let tick = witness.tick();
    nodes.iter_mut().for_each(|(_, node)| node.kill());
    while !server.view().starts_with("none") {}
    let _next = server.node();
    assert!(server.view().contains("r1 r2"));
    witness.advance(60);
    assert!(witness.tick() > tick);
    witness.leave();
    server.stop();
}
