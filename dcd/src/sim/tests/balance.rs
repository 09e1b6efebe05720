//! Tests that the regions of a group follow its load.

use super::*;
use crate::cluster::Record;
use crate::space::{Balance, Bounds, DistributionTree, Load};

/// Starts a square kilometre whose bodies all move towards a corner of 80 m for a minute, computed by one
/// node.
fn crowd_that_gathers(count: u32) -> Sim {
    let mut random = Random::new(7);
    let mut place = |from: f64, to: f64| [0; 3].map(|_| from + (to - from) * random.unit());
    let bodies = (0..count).map(|i| {
        let (from, to) = (place(300.0, 900.0), place(0.0, 80.0));
        let mut body = sim_body(BodyId::persistent(i), [from[0], 4.0, from[2]]);
        body.state.velocity.linear =
            [0, 1, 2].map(|i| if i == 1 { 0.0 } else { (to[i] - from[i]) as f32 / 60.0 });
        body
    });
    let mut world = sim_world(1);
    world.tree = DistributionTree::halved(Bounds::new([0.0; 3], [1000.0, 8.0, 1000.0]), 1).unwrap();
    world.balance = Some(Balance { load: Load::Counts, ..Balance::by_nodes() });
    let record = Record::new(bodies.collect(), Vec::new(), Vec::new());
    Sim::with_world(config(1, 1), world, record, || Box::<StandIn>::default())
}

/// Runs for a time. Returns the longest time from a tick that all members have completed to the next one.
fn longest_gap(sim: &mut Sim, time: Duration) -> Duration {
    let (end, mut before, mut longest) = (sim.now() + time, sim.now(), Duration::ZERO);
    while sim.now() < end {
        sim.run_to(Tick(sim.checker().last().0 + 1)).unwrap();
        longest = longest.max(sim.now() - before);
        before = sim.now();
    }
    longest
}

/// Starts seven more nodes, and checks how evenly the crowd is shared out ten seconds after all are members.
/// Regions are cut, and bodies handed over, without a tick that is late by more than three.
fn shares_out(count: u32) {
    let mut sim = crowd_that_gathers(count);
    sim.run_to(Tick(5)).unwrap();
    let client = sim.start_client(None);
    for _ in 0..7 {
        sim.start_node();
    }
    sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 8)).unwrap();
    let mut gap = longest_gap(&mut sim, Duration::from_secs(10));
    let mut worst = 0.0_f64;
    for _ in 0..20 {
        gap = gap.max(longest_gap(&mut sim, Duration::from_millis(250)));
        let shares = sim.nodes.values().map(|process| process.physics.claims().len());
        worst = worst.max(shares.max().unwrap() as f64 * 8.0 / f64::from(count));
    }
    println!("the heaviest node has {worst:.3} times the mean; a tick came {gap:?} after the one before it");
    assert!(worst <= 1.3, "{worst}");
    assert!(gap <= Duration::from_secs(4) / 60, "{gap:?}");
    let view = sim.server().view().unwrap();
    assert_eq!(view.allocation.len(), 8);
    assert_eq!(sim.checker().owned(), count as usize);
    // A client that only watches knows the regions as they are.
    assert!(sim.client(client).tree() == Some(&view.tree), "as of the last change");
    assert!(
        view.allocation.iter().all(|(&region, &node)| sim.client(client).computed_by(region) == Some(node))
    );
}

#[test]
fn a_crowd_that_gathers_in_a_corner_is_shared_out_among_eight_nodes_within_ten_seconds() {
    shares_out(800);
}

#[test]
#[ignore = "takes two minutes"]
fn a_crowd_of_thousands_is_shared_out_as_well() {
    shares_out(5_000);
}
