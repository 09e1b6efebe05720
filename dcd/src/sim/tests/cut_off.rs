//! Tests what a client knows of a world from which it was cut off for a while.

use super::*;

/// The ticks within which a client hears of each body: members report every third tick, and a report is on
/// its way for three ticks.
const FRESH_TICKS: u64 = 15;

/// The round trip is 100 ms. The link outlives the cut.
#[test]
fn a_client_that_was_cut_off_for_seconds_is_told_of_all_that_moves_again() {
    for seed in 0..5 {
        let network = NetworkConditions::calm(Path { base_us: 50_000, jitter_us: 0 });
        let mut sim = Sim::new(SimConfig { network, bodies: 100, ..config(seed, 1) });
        let client = sim.start_client(None);
        sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
        sim.run_for(Duration::from_secs(2)).unwrap();
        assert_eq!(sim.lacks_body(client, FRESH_TICKS), None, "seed {seed}, before the cut");
        let cut = Duration::from_secs(2);
        for cut in Cut::between(Peer::Client(client), Peer::Node(NodeId(1)), sim.now() + cut) {
            sim.cut(cut);
        }
        sim.run_for(cut).unwrap();
        assert!(sim.lacks_body(client, 90).is_some(), "seed {seed}: it heard nothing meanwhile");
        sim.run_for(Duration::from_secs(3)).unwrap();
        assert_eq!(sim.lacks_body(client, FRESH_TICKS), None, "seed {seed}:\n{}", sim.timeline());
        assert!(!sim.timeline().to_string().contains("loses its link"), "seed {seed}:\n{}", sim.timeline());
    }
}
