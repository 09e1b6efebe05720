//! When a reading passes.
//!
//! - Its error is at most that of one bare world and a tenth more, plus what rounding alone may add (`floor`: 0.1 mm for
//!   lengths, 1e-4 m/s for speeds, 1e-4 for plain numbers), or at most the scene's own threshold.
//! - Every body has exactly one owner at every look, none was quarantined.
//! - Free systems keep their momentum to 1e-5 of Σ m|v|, and what rests presses on the ground with its weight to 1 %; where
//!   one bare world misses that, its own miss and a tenth more is allowed.

use super::reading::Reading;
use super::scene::Case;

const SLACK: f64 = 1.1;
const MOMENTUM: f64 = 1e-5;
const GROUND_FORCE: f64 = 0.01;

/// What the gate says of a reading.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Verdict {
    /// The largest error that passes, in the unit of the case.
    pub limit: f64,
    /// What is wrong, in words; nothing when it passes.
    pub failures: Vec<String>,
}

impl Verdict {
    /// Whether nothing is wrong.
    pub(crate) fn pass(&self) -> bool {
        self.failures.is_empty()
    }
}

/// Holds a reading against that of one bare world.
pub(crate) fn judge(case: &Case, reading: &Reading, r1: &Reading) -> Verdict {
    let limit = (SLACK * reading.r1_error + case.floor).max(case.threshold.unwrap_or(0.0));
    let mut failures = Vec::new();
    let mut fail = |failed: bool, words: String| failures.extend(failed.then_some(words));
    fail(reading.error > limit, format!("error {:.3e} {} > {limit:.3e}", reading.error, case.unit));
    fail(reading.lost > 0, format!("{} bodies lost", reading.lost));
    fail(reading.doubled > 0, format!("{} bodies with several owners", reading.doubled));
    fail(reading.quarantined > 0, format!("{} bodies quarantined", reading.quarantined));
    for (what, own, r1, allowed) in [
        ("momentum", reading.momentum_error, r1.momentum_error, MOMENTUM),
        ("ground force", reading.ground_error, r1.ground_error, GROUND_FORCE),
    ] {
        let allowed = allowed.max(SLACK * r1.unwrap_or(0.0));
        let own = own.unwrap_or(0.0);
        fail(own > allowed, format!("{what} off by {own:.1e} of the whole"));
    }
    if let Some(pairs) = case.pairs {
        fail(reading.pairs != pairs, format!("{} pairs touch instead of {pairs}", reading.pairs));
    }
    Verdict { limit, failures }
}
