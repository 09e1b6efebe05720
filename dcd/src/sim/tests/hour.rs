//! Tests how often a node moves between groups in an hour in which its delay goes up and down, with the real
//! state machines. Tests of the rules alone are harder (`cluster/votes/flapping.rs`).

use std::f64::consts::TAU;
use std::time::Duration;

use crate::cluster::Peer;
use crate::protocol::{DelayThresholds, Thresholds};
use crate::sim::{NetworkConditions, Path, Random, Sim, SimConfig};
use crate::space::NodeId;

const SECOND: Duration = Duration::from_secs(1);
const NODES: u32 = 4;

/// The drift of the last node's round trip around 30 ms, which is midway between the thresholds.
#[derive(Clone, Copy, Debug)]
struct Drift {
    period_s: f64,
    amplitude_ms: f64,
    noise_ms: f64,
}

impl Drift {
    fn at(&self, second: u64, random: &mut Random) -> Path {
        let phase = TAU * second as f64 / self.period_s;
        let noise_ms = self.noise_ms * (2.0 * random.unit() - 1.0);
        let trip_ms = (30.0 + self.amplitude_ms * phase.sin() + noise_ms).max(1.0);
        Path { base_us: (trip_ms * 500.0) as u64, jitter_us: 0 }
    }

    /// Returns the nodes that went from one group to another, once for each time.
    fn moves(&self, seed: u64) -> Vec<NodeId> {
        let near = Path { base_us: 200, jitter_us: 200 };
        let delay = DelayThresholds { inclusion_ms: 20.0, rejection_ms: 40.0, deviation_ms: 30.0 };
        let mut sim = Sim::new(SimConfig {
            seed,
            nodes: NODES,
            bodies: 4,
            regions: 4,
            speed_m_s: 1.0,
            // Few ticks, because only delays count here.
            dt_s: 0.25,
            checkpoint_every: 2,
            network: NetworkConditions { server: Some(near), ..NetworkConditions::calm(near) },
            thresholds: Thresholds { delay: Some(delay), ..Thresholds::default() },
            ..SimConfig::default()
        });
        sim.place(Peer::Node(NodeId(NODES)), 1);
        let mut random = Random::new(seed);
        let mut moves = Vec::new();
        let group_of = |sim: &Sim, node| {
            sim.server()
                .views()
                .find(|(_, view)| view.members.iter().any(|member| member.node == node))
                .map(|(group, _)| group)
        };
        let mut groups = [None; NODES as usize];
        for second in 0..3_600 {
            sim.network.conditions.far = self.at(second, &mut random);
            sim.run_for(SECOND).unwrap();
            for (at, group) in groups.iter_mut().enumerate() {
                let node = NodeId(at as u32 + 1);
                let now = group_of(&sim, node).or(*group);
                if group.is_some() && *group != now {
                    moves.push(node);
                }
                *group = now;
            }
        }
        assert!(sim.checker().last().0 > 3 * 3_600, "the world goes on: {}", sim.checker().last());
        moves
    }
}

#[test]
fn a_delay_that_drifts_for_an_hour_moves_a_node_a_handful_of_times() {
    for (seed, period_s) in [(1, 400.0), (3, 1_800.0)] {
        let drift = Drift { period_s, amplitude_ms: 28.0, noise_ms: 10.0 };
        let moves = drift.moves(seed);
        assert!((2..=6).contains(&moves.len()), "{drift:?}: {moves:?}");
        assert!(moves.iter().all(|&node| node == NodeId(NODES)), "{drift:?}: {moves:?}");
    }
}
