use dcd::cluster::*;
use dcd::protocol::*;
use dcd::sim::*;
use dcd::space::*;
use std::time::Duration;
fn main() {
    let delay = DelayThresholds { inclusion_ms: 30.0, rejection_ms: 60.0, deviation_ms: 30.0 };
    let args: Vec<f64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let (rate, thr, report) = (args[0], args[1], args[2] as u64);
    let network = NetworkConditions {
        far: Path { base_us: 58_000, jitter_us: 4_000 },
        server: Some(Path { base_us: 29_000, jitter_us: 2000 }),
        ..NetworkConditions::calm(Path::up_to(1_000))
    };
    let mut sim = Sim::new(SimConfig {
        seed: 1,
        nodes: 12,
        dt_s: 1.0 / rate as f32,
        network,
        report_every: report,
        checkpoint_every: 12,
        thresholds: Thresholds { delay: Some(delay), between_groups_m: thr as f32, ..Thresholds::default() },
        ..SimConfig::default()
    });
    for n in 1..=12 {
        sim.place(Peer::Node(NodeId(n)), n % 3);
    }
    sim.run_for(Duration::from_secs(5)).unwrap();
    sim.sample_every(6);
    let mut c = Comparer::new(3);
    let mut all = vec![];
    let mut apart = vec![];
    for _ in 0..600 {
        sim.run_for(Duration::from_millis(100)).unwrap();
        for d in c.compare(&mut sim) {
            apart.push(d.apart.as_secs_f64());
            all.extend(d.bodies.iter().map(|a| a.by_m));
        }
    }
    all.sort_by(f64::total_cmp);
    let q = |q: f64| all[((all.len() - 1) as f64 * q) as usize];
    println!(
        "{} samples p50 {:.3} p90 {:.3} p99 {:.3} max {:.3}; within {:.3}; apart max {:.3} s",
        all.len(),
        q(0.5),
        q(0.9),
        q(0.99),
        q(1.0),
        all.iter().filter(|&&d| d <= thr).count() as f64 / all.len() as f64,
        apart.iter().copied().fold(0.0, f64::max)
    );
    for n in sim.nodes() {
        if let Some(l) = n.leader() {
            let _ = l;
            print!("{} t{} ", n.id(), n.tick());
        }
    }
    println!("{:?}", sim.tally());
}
