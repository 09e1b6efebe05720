//! Tests that a world that nodes compute is saved as it is after one tick, and goes back to that save.

use std::collections::BTreeMap;

use super::*;
use crate::cluster::{SavedWorld, ServerEvent};
use crate::protocol::{Area, BodyState, BuildOp};

/// Saves the world. Returns the save, and what the owners had when it was saved.
fn saved(sim: &mut Sim) -> (SavedWorld, BTreeMap<BodyId, BodyState>) {
    sim.order(ServerEvent::Save);
    sim.run_until(|sim| sim.saved().is_some()).unwrap();
    // No node has heard yet that the world goes on.
    (sim.saved().unwrap().clone(), sim.states())
}

fn replace(sim: &mut Sim, saved: &SavedWorld) {
    sim.order(ServerEvent::Replace(Box::new(saved.clone())));
}

/// Lets the server's program insert a body, and waits until it is there.
fn insert(sim: &mut Sim, id: BodyId) {
    let bodies = vec![sim_body(id, [5.0, 5.0, 5.0])];
    sim.order(ServerEvent::Program(vec![BuildOp::Insert { bodies, shapes: Vec::new(), joints: Vec::new() }]));
    sim.run_until(|sim| sim.state(id).is_some()).unwrap();
}

/// Returns the saved states by body, without the speeds that are asked of bodies.
fn of(saved: &SavedWorld) -> BTreeMap<BodyId, BodyState> {
    saved.bodies.iter().map(|body| (body.id, body.state)).collect()
}

#[test]
fn a_save_has_every_body_as_its_owner_has_it_after_one_tick() {
    for seed in 0..4 {
        let mut sim = running(seed, 3);
        sim.run_to(Tick(50)).unwrap();
        let (saved, owned) = saved(&mut sim);
        assert_eq!(saved.bodies.len(), 40, "seed {seed}");
        assert_eq!(of(&saved), owned, "seed {seed}");
        assert!(sim.nodes().all(|node| node.tick() == saved.tick), "seed {seed}");
        let views = sim.tally().views;
        sim.run_to(Tick(saved.tick.0 + 50)).unwrap();
        assert_eq!((sim.tally().views, sim.tally().evictions), (views, 0), "seed {seed}: it went on");
    }
}

#[test]
fn a_world_goes_back_with_all_that_came_and_went() {
    let mut sim = running(3, 3);
    let client = sim.start_client(None);
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    let [early, late] = [0, 1].map(|index| BodyId::avatar(client, index));
    let spawn = |sim: &mut Sim, id, x| {
        sim.submit(client, ClientEvent::Spawn { body: sim_body(id, [x, 4.0, 4.0]), shapes: Vec::new() });
        sim.run_until(|sim| sim.state(id).is_some() && sim.client(client).body(id).is_some()).unwrap();
    };
    spawn(&mut sim, early, 3.0);
    let (gone, new) = (BodyId::persistent(40), BodyId::persistent(41));
    insert(&mut sim, gone);
    let (saved, _) = saved(&mut sim);
    let velocity = Velocity { linear: [2.0, 0.0, 0.0], angular: [0.0; 3] };
    sim.submit(client, ClientEvent::Input { body: early, tick: Tick(0), velocity, pose: None });
    spawn(&mut sim, late, 9.0);
    insert(&mut sim, new);
    sim.order(ServerEvent::Program(vec![BuildOp::Remove(gone)]));
    let knows = |sim: &Sim, id| sim.client(client).body(id).is_some();
    sim.run_until(|sim| knows(sim, new) && !knows(sim, gone) && sim.state(new).is_some()).unwrap();
    sim.run_for(Duration::from_secs(3)).unwrap();
    let before = sim.tick();

    replace(&mut sim, &saved);
    let known = sim.server().record();
    for body in &saved.bodies {
        assert_eq!(known.body(body.id).map(|body| body.state), Some(body.state), "{}", body.id);
    }
    assert!(known.body(late).is_some(), "an avatar is its client's");
    assert_eq!((known.body(new).is_some(), sim.server().next_ids()), (false, (42, 0)));
    sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 3)).unwrap();
    sim.run_until(|sim| sim.states().len() == 43 && sim.tick() > before).unwrap();
    sim.run_until(|sim| knows(sim, gone) && !knows(sim, new) && knows(sim, late)).unwrap();
    // What the client is shown goes on from there: the avatar stood then.
    sim.run_for(Duration::from_secs(1)).unwrap();
    let x = |id| sim.client(client).body(id).unwrap().body.state.pose.translation[0];
    assert!((x(early) - 3.0).abs() < 0.05, "what was asked of it since is not meant for then: {}", x(early));
    assert_eq!(sim.tally().evictions, 0);
}

#[test]
fn clients_with_an_interest_hear_of_the_world_that_is_back() {
    let mut sim = Sim::new(SimConfig { bodies: 0, ..config(5, 3) });
    sim.run_to(Tick(5)).unwrap();
    let ids: Vec<_> = (0..6).map(BodyId::persistent).collect();
    let bodies = ids.iter().map(|&id| sim_body(id, [1.0 + 2.5 * f64::from(id.index()), 4.0, 4.0])).collect();
    sim.order(ServerEvent::Program(vec![BuildOp::Insert { bodies, shapes: Vec::new(), joints: Vec::new() }]));
    sim.run_until(|sim| sim.states().len() == 6).unwrap();
    let client = sim.start_client_in(Area { centre: [1.0, 4.0, 4.0], radius_m: 2.0 });
    let (_, participant) = sim.start_participant(None);
    sim.run_until(|sim| [client, participant].iter().all(|&id| sim.client(id).is_joined())).unwrap();
    let (saved, _) = saved(&mut sim);
    let known = |sim: &Sim, client| sim.client(client).bodies().count();
    let before = [client, participant].map(|id| known(&sim, id));
    assert!(before[0] >= 1 && before[1] == 6, "{before:?}");
    sim.order(ServerEvent::Program(ids.iter().map(|&id| BuildOp::Remove(id)).collect()));
    sim.run_until(|sim| known(sim, client) + known(sim, participant) == 0).unwrap();
    replace(&mut sim, &saved);
    sim.run_until(|sim| known(sim, client) >= before[0] && known(sim, participant) == 6).unwrap();
    sim.run_until(|sim| sim.states().len() == 6).unwrap();
    // These bodies stand still.
    assert_eq!(sim.states(), of(&saved), "nodes hold what was saved");
}

#[test]
fn a_save_waits_for_members_that_are_not_heard() {
    let mut sim = running(2, 3);
    sim.crash(Peer::Server);
    sim.run_for(Duration::from_millis(200)).unwrap();
    sim.restart_server();
    sim.order(ServerEvent::Save);
    assert!(sim.saved().is_none(), "the record is older than what nodes compute");
    sim.run_until(|sim| sim.saved().is_some()).unwrap();
    let saved = sim.saved().unwrap();
    assert!(sim.nodes().all(|node| node.tick() == saved.tick));
    assert_eq!(of(saved), sim.states());
}

#[test]
fn a_server_that_dies_after_going_back_goes_on_from_there() {
    for (seed, outputs) in (0..8).map(|seed| (seed, 1 + 3 * seed as u32)) {
        let mut sim = running(seed, 3);
        let gone = BodyId::persistent(40);
        insert(&mut sim, gone);
        let (saved, _) = saved(&mut sim);
        sim.order(ServerEvent::Program(vec![BuildOp::Remove(gone)]));
        sim.run_for(Duration::from_secs(1)).unwrap();
        sim.crash_after_store(outputs);
        replace(&mut sim, &saved);
        if sim.has_server() {
            sim.crash_after_store = None;
            sim.crash(Peer::Server);
        }
        sim.run_for(Duration::from_millis(500)).unwrap();
        sim.restart_server();
        let all = |sim: &Sim| sim.states().len() == 41 && sim.server().view().is_some();
        sim.run_until(|sim| all(sim) && sim.state(gone).is_some()).unwrap();
        sim.run_for(Duration::from_secs(2)).unwrap();
        // A body may be on its way between two nodes.
        sim.run_until(|sim| all(sim) && sim.state(gone).is_some()).unwrap();
    }
}
