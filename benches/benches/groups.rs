//! Measures how long the server takes to group 1,000 nodes: with delays by distance, as on a network; with
//! one clique; and with graphs on which a search for cliques has the most to do. Each grouping must stay
//! below 200 ms.
//!
//! Run it by `cargo bench -p dcd-benches --bench groups`.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dcd::cluster::{GroupPolicy, GroupRules, Hint, HintUse, form_groups};
use dcd::sim::Random;
use dcd::space::NodeId;

const NODES: usize = 1_000;

/// The delays between nodes in milliseconds, row by row.
struct Delays(Vec<f64>);

impl Delays {
    fn by(mut delay_ms: impl FnMut(usize, usize) -> f64) -> Self {
        Self((0..NODES * NODES).map(|at| delay_ms(at / NODES, at % NODES)).collect())
    }

    fn get(&self, a: NodeId, b: NodeId) -> Option<f64> {
        Some(self.0[a.0 as usize * NODES + b.0 as usize])
    }
}

/// Returns the delays of nodes strewn over a square of 100 ms, with 10 % of jitter.
fn strewn() -> Delays {
    let mut random = Random::new(1);
    let places: Vec<[f64; 2]> = (0..NODES).map(|_| [0, 1].map(|_| 100.0 * random.unit())).collect();
    Delays::by(|a, b| {
        let [x, y] = [0, 1].map(|axis| places[a][axis] - places[b][axis]);
        x.hypot(y) * (0.95 + 0.1 * random.unit())
    })
}

/// Returns the delays of pairs: 1 ms if `near` accepts the pair, given the lower and the higher index, and
/// 100 ms otherwise.
fn pairs(mut near: impl FnMut(usize, usize) -> bool) -> Delays {
    let mut rows = vec![vec![100.0; NODES]; NODES];
    for (a, b) in (0..NODES).flat_map(|a| (a + 1..NODES).map(move |b| (a, b))) {
        if near(a, b) {
            (rows[a][b], rows[b][a]) = (1.0, 1.0);
        }
    }
    Delays(rows.concat())
}

/// Returns delays by which each pair is near with this probability.
fn chance(density: f64) -> Delays {
    let mut random = Random::new(2);
    pairs(|_, _| random.unit() < density)
}

fn groups(criterion: &mut Criterion) {
    let strewn = strewn();
    let cases = [
        ("strewn, 20 of 100 ms", &strewn, 20.0),
        ("strewn, 5 of 100 ms", &strewn, 5.0),
        ("one clique", &pairs(|_, _| true), 10.0),
        ("nobody near", &pairs(|_, _| false), 10.0),
        ("pairs", &pairs(|a, b| a / 2 == b / 2), 10.0),
        ("all but triples (Moon-Moser)", &pairs(|a, b| a / 3 != b / 3), 10.0),
        ("all but rings of five", &pairs(|a, b| a / 5 != b / 5 || ![1, 4].contains(&(b - a))), 10.0),
        ("two sides", &pairs(|a, b| a < 100 && b >= 100), 10.0),
        ("chance 1 %", &chance(0.01), 10.0),
        ("chance 50 %", &chance(0.5), 10.0),
        ("chance 90 %", &chance(0.9), 10.0),
        ("chance 99 %", &chance(0.99), 10.0),
    ];
    let nodes: Vec<_> = (0..NODES as u32).map(NodeId).collect();
    // Networks of ten nodes and towns of a hundred.
    let hints = [10, 100].map(|size| Hint {
        keys: nodes.iter().map(|&node| (node, u64::from(node.0 / size))).collect(),
        usage: HintUse::Seed,
    });
    let every = [
        ("largest", GroupPolicy::Largest, NODES, &[][..]),
        ("largest to 16", GroupPolicy::Largest, 16, &[]),
        ("powers of two", GroupPolicy::PowersOfTwo, NODES, &[]),
        ("largest to 16, seeds", GroupPolicy::Largest, 16, &hints),
    ];
    for (name, policy, max_size, hints) in every {
        let mut group = criterion.benchmark_group(name);
        for &(case, delays, threshold_ms) in &cases {
            let rules = GroupRules { threshold_ms: Some(threshold_ms), max_size, policy };
            group.bench_function(BenchmarkId::from_parameter(case), |bencher| {
                bencher.iter(|| form_groups(&nodes, |a, b| delays.get(a, b), &rules, hints));
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = grouping;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_secs(1));
    targets = groups
}
criterion_main!(grouping);
