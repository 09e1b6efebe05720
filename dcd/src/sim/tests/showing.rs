//! Tests what a client knows of the world's time, with clocks that differ and drift.

use super::*;
use crate::sim::{NetworkConditions, Path, Skew};

/// Runs for ten seconds and looks every 5 ms. Returns the largest error of the client's clock once the client
/// knows it, its own bound on that, both in milliseconds, and the largest step of what is shown between two
/// looks, in ticks.
fn watch(seed: u64, path: Path) -> (f64, f64, f64) {
    let skew = Some(Skew { offset: Duration::from_secs(10), drift_ppm: 200 });
    let network = NetworkConditions::calm(path);
    let mut sim = Sim::new(SimConfig { skew, network, ..config(seed, 2) });
    let client = sim.start_client(None);
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    let (mut error, mut bound, mut step, mut shown): (f64, f64, f64, Option<f64>) = (0.0, 0.0, 0.0, None);
    for look in 0..2_000 {
        sim.run_for(Duration::from_millis(5)).unwrap();
        let (Some(time), Some(world)) = (sim.view_time(client), sim.world_tick()) else { continue };
        // By then the first pings have been answered.
        if look > 400 {
            let tick_ms = 1e3 / 60.0;
            error = error.max((time.now - world).abs() * tick_ms);
            bound = bound.max(time.clock_error_s.expect("pings were answered") * 1e3);
            step = step.max(time.shown - shown.unwrap_or(time.shown));
            assert!(shown.is_none_or(|shown| shown < time.shown), "seed {seed}: it goes on");
            assert!(time.shown < time.now);
        }
        shown = Some(time.shown);
    }
    (error, bound, step)
}

#[test]
fn the_tick_of_the_world_is_known_within_two_milliseconds_on_a_local_network() {
    for seed in 0..10 {
        let (error_ms, bound_ms, step) = watch(seed, Path::up_to(600));
        assert!(error_ms < 2.0, "seed {seed}: {error_ms} ms");
        assert!(bound_ms < 6.0, "seed {seed}: it says {bound_ms} ms");
        assert!(step < 0.45, "seed {seed}: {step} ticks within 5 ms");
    }
}
