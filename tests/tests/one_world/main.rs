//! Tests a partitioned world beside one Rapier world: the same queries have the same answers in both, and the
//! same changes the same effects.

mod asking;
mod hostile;
mod operations;
mod property;
mod queries;
mod scenery;
mod twin;

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

/// Returns a configuration with this many cases, the same in every run.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(20),
        failure_persistence: None,
        max_shrink_iters: 4_000,
        ..ProptestConfig::default()
    }
}
