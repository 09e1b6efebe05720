//! Tests that members exchange border messages with members whose regions are near, not with all.

use super::*;
use crate::cluster::Record;
use crate::space::{Bounds, DistributionTree};

/// Returns how many border messages a member sends per tick, in a strip in which each of `members` has a
/// region.
fn borders_per_tick(members: u32) -> f64 {
    let mut world = sim_world(1);
    let bounds = Bounds::new([0.0; 3], [20.0 * f64::from(members), 8.0, 8.0]);
    world.tree = DistributionTree::halved(bounds, members as usize).unwrap();
    let mut random = Random::new(3);
    let bodies = (0..10 * members).map(|i| {
        let at = bounds.max.map(|max| max * random.unit());
        let mut body = sim_body(BodyId::persistent(i), at);
        // Some fly through a region within a second.
        body.state.velocity.linear[0] = ((random.unit() - 0.5) * 40.0) as f32;
        body
    });
    let record = Record::new(bodies.collect(), Vec::new(), Vec::new());
    let mut sim = Sim::with_world(config(1, members), world, record, || Box::<StandIn>::default());
    sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == members as usize))
        .unwrap();
    sim.run_for(Duration::from_secs(1)).unwrap();
    let sent = |sim: &Sim| sim.sent().get(&Scope::Borders).map_or(0, |sent| sent.messages);
    let before = (sent(&sim), sim.tick().0);
    sim.run_for(Duration::from_secs(5)).unwrap();
    assert_eq!(sim.checker().owned(), 10 * members as usize);
    (sent(&sim) - before.0) as f64 / (sim.tick().0 - before.1) as f64 / f64::from(members)
}

#[test]
fn what_a_member_sends_grows_with_its_borders_and_not_with_the_group() {
    let sent = [4, 8, 16, 32].map(borders_per_tick);
    println!("{sent:.2?} border messages of a member in a tick of about two rounds");
    // In a strip it is two in each round, and all in every eighth tick.
    assert!(sent[3] < 13.0 && sent[3] < 2.5 * sent[1], "{sent:?}");
}
