//! Tests a partitioned world beside one Rapier world: whatever is asked of both, they say the same, and whatever is done to both,
//! the same comes of it.

mod asking;
mod hostile;
mod operations;
mod property;
mod queries;
mod scenery;
mod twin;

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

/// So many cases, the same in every run.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(20),
        failure_persistence: None,
        max_shrink_iters: 4_000,
        ..ProptestConfig::default()
    }
}
