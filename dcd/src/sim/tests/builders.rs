//! Tests that what clients build is in the world exactly once, whichever process dies at whatever time.

use super::*;
use crate::protocol::{Alteration, BuildOp};

/// Returns the operation that inserts a body which does not move.
fn insert(id: BodyId) -> BuildOp {
    let place = [1.0 + f64::from(id.index()) * 0.4, 5.0, 5.0];
    BuildOp::Insert { bodies: vec![sim_body(id, place)], shapes: Vec::new(), joints: Vec::new() }
}

/// Lets a client build ten bodies in ten messages, change one and remove one, after `happens` has disturbed
/// the cluster, or has arranged for that.
fn built_while(seed: u64, happens: impl FnOnce(&mut Sim)) {
    let mut sim = running(seed, 3);
    let client = sim.start_builder();
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    let [gone, changed] = [41, 42].map(|index| BodyId::built(client, index));
    happens(&mut sim);
    for index in 0..10 {
        sim.submit(client, ClientEvent::Build(vec![insert(BodyId::built(client, 41 + index))]));
    }
    let mut traits = (*sim_body(changed, [0.0; 3]).traits).clone();
    traits.linear_damping = 0.25;
    let traits = std::sync::Arc::new(traits);
    let ops = vec![
        BuildOp::Alter(Alteration::Body { body: changed, traits, user_data: 7, wakes: false }),
        BuildOp::Remove(gone),
    ];
    sim.submit(client, ClientEvent::Build(ops));
    for _ in 0..100 {
        sim.run_for(Duration::from_millis(100)).unwrap();
        if !sim.has_server() {
            sim.restart_server();
        }
    }
    let record = sim.server().record();
    let present: Vec<_> = record.present().map(|body| body.id).collect();
    let built = present.iter().filter(|id| id.builder() == Some(client)).count();
    assert_eq!((built, present.len()), (9, 49), "seed {seed}");
    assert!(!present.contains(&gone), "seed {seed}");
    // A body between two owners at this instant soon has one; a body that nodes have lost never has.
    sim.run_until(|sim| sim.states().keys().eq(&present)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    let record = sim.server().record().body(changed).unwrap();
    assert_eq!((record.traits.linear_damping, record.user_data), (0.25, 7), "seed {seed}");
    // The client leaves, and what it built stays.
    sim.submit(client, ClientEvent::Leave);
    sim.crash(Peer::Client(client));
    sim.run_for(Duration::from_secs(3)).unwrap();
    let left = sim.server().record().present().filter(|body| body.id.builder() == Some(client)).count();
    assert_eq!(left, 9, "seed {seed}");
}

#[test]
fn what_a_client_builds_is_there_once_when_the_server_dies_meanwhile() {
    for seed in 0..24 {
        built_while(seed, |sim| sim.crash_after_store(seed as u32 % 12));
    }
}

#[test]
fn what_a_client_builds_is_there_once_when_the_server_dies_before_it_hears_of_it() {
    built_while(30, |sim| sim.crash(Peer::Server));
}

#[test]
fn what_a_client_builds_is_there_once_when_a_node_dies_meanwhile() {
    for seed in 40..48 {
        built_while(seed, |sim| {
            sim.run_events(50 * (seed % 4)).unwrap();
            sim.crash(Peer::Node(NodeId(2)));
        });
    }
}
