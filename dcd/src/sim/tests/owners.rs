//! Tests that clients are told which region owns each body.

use std::collections::BTreeMap;

use super::*;
use crate::protocol::Handover;

#[test]
fn clients_hear_who_owns_each_body_and_of_changes_in_order() {
    for seed in 0..6 {
        let mut sim = running(seed, 3);
        let client = if seed % 2 == 0 { sim.start_client(None) } else { sim.start_participant(None).1 };
        sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
        let (mut owners, mut changes) = (BTreeMap::new(), 0);
        for _ in 0..200 {
            sim.run_for(Duration::from_millis(50)).unwrap();
            for Handover { body, from, to } in sim.clients.get_mut(&client).unwrap().take_handovers() {
                let before = owners.insert(body, to);
                assert!(before.is_none_or(|before| before == from) && from != to, "seed {seed}: {body}");
                changes += 1;
            }
            let client = sim.client(client);
            for view in client.bodies() {
                let Some(owner) = view.owner else { continue };
                assert_eq!(*owners.entry(view.body.id).or_insert(owner), owner, "seed {seed}");
                let cell = client.world().unwrap().tree.cell(owner);
                let excess_m = cell.excess_m(view.body.state.pose.translation);
                assert!(excess_m < 1.0, "seed {seed}: {} is {excess_m} m outside of {owner}", view.body.id);
            }
        }
        assert_eq!(owners.len(), 40, "seed {seed}");
        assert!(changes > 10, "seed {seed}: {changes}");
        let view = sim.server().view().unwrap();
        let computed = |(&region, &node)| sim.client(client).computed_by(region) == Some(node);
        assert!(view.allocation.iter().all(computed), "seed {seed}");
    }
}
