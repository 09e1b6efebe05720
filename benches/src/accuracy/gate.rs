//! Decides whether a reading passes.
//!
//! - **Error.** It is at most that of one bare world and a tenth more, plus what rounding alone may add
//!   (`floor`: 0.1 mm for lengths, 1e-4 m/s for speeds, 1e-4 for plain numbers); or it is at most the scene's
//!   own threshold.
//! - **Bodies.** Every body has exactly one owner at every look, and none was quarantined.
//! - **Momentum and weight.** Free systems keep their momentum to 1e-5 of Σ m|v|. What rests presses on the
//!   ground with its weight to 1 %. Where one bare world misses that, its own miss and a tenth more is
//!   allowed.

use super::reading::Reading;
use super::scene::Case;

const MOMENTUM: f64 = 1e-5;
const GROUND_FORCE: f64 = 0.01;

/// The gate's verdict on a reading.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Verdict {
    /// The largest error that passes, in the unit of the case.
    pub limit: f64,
    /// The faults, in words; empty when the reading passes.
    pub failures: Vec<String>,
    /// Says whether something besides the error is wrong, which no limit excuses.
    pub broken: bool,
}

impl Verdict {
    /// Returns whether nothing is wrong.
    pub(crate) fn pass(&self) -> bool {
        self.failures.is_empty()
    }
}

/// Judges a reading against that of one bare world.
pub(crate) fn judge(case: &Case, reading: &Reading, r1: &Reading) -> Verdict {
    let limit = (case.slack * reading.r1_error + case.floor).max(reading.threshold);
    let is_off = reading.error > limit;
    let mut failures = Vec::new();
    let mut fail = |failed: bool, words: String| failures.extend(failed.then_some(words));
    fail(is_off, format!("error {:.3e} {} > {limit:.3e}", reading.error, case.unit));
    fail(reading.lost > 0, format!("{} bodies lost", reading.lost));
    fail(reading.doubled > 0, format!("{} bodies with several owners", reading.doubled));
    fail(reading.quarantined > 0, format!("{} bodies quarantined", reading.quarantined));
    for (what, own, r1, allowed) in [
        ("momentum", reading.momentum_error, r1.momentum_error, MOMENTUM),
        ("ground force", reading.ground_error, r1.ground_error, GROUND_FORCE),
    ] {
        let allowed = allowed.max(case.slack * r1.unwrap_or(0.0));
        let own = own.unwrap_or(0.0);
        fail(own > allowed, format!("{what} off by {own:.1e} of the whole"));
    }
    if let Some(pairs) = case.pairs {
        fail(reading.pairs != pairs, format!("{} pairs touch instead of {pairs}", reading.pairs));
    }
    let broken = failures.len() > usize::from(is_off);
    Verdict { limit, failures, broken }
}

#[cfg(test)]
mod tests {
    use dcd::scene::{Params, Scene};

    use super::*;

    fn case() -> Case {
        let scene = Scene::named("tower", &Params::new()).unwrap();
        Case::new("any", scene, 1.0, |_| Vec::new(), |_, _| 0.0)
    }

    fn reading(error: f64, r1_error: f64) -> Reading {
        Reading::plain(error, r1_error)
    }

    fn passes(case: &Case, reading: &Reading) -> bool {
        judge(case, reading, &self::reading(0.0, 0.0)).pass()
    }

    #[test]
    fn an_error_may_exceed_that_of_one_world_by_a_tenth_and_rounding() {
        assert!(passes(&case(), &reading(0.1100, 0.1)));
        assert!(!passes(&case(), &reading(0.1102, 0.1)));
        assert!(passes(&case(), &reading(0.9e-4, 0.0)));
    }

    #[test]
    fn a_threshold_passes_whatever_one_world_does_and_gives_way_where_one_world_misses_it() {
        let with = |error, r1_error| Reading { threshold: 0.01, ..reading(error, r1_error) };
        assert!(passes(&case(), &with(0.0099, 0.0)));
        assert!(!passes(&case(), &with(0.0101, 0.0)));
        assert!(passes(&case(), &with(0.021, 0.02)));
    }

    #[test]
    fn bodies_momentum_and_weight_count_beside_the_error() {
        let good = reading(0.0, 0.0);
        for bad in [
            Reading { lost: 1, ..good.clone() },
            Reading { doubled: 1, ..good.clone() },
            Reading { quarantined: 1, ..good.clone() },
            Reading { momentum_error: Some(2e-5), ..good.clone() },
            Reading { ground_error: Some(0.011), ..good.clone() },
        ] {
            let verdict = judge(&case(), &bad, &reading(0.0, 0.0));
            assert!(!verdict.pass() && verdict.broken, "{bad:?}");
        }
        assert!(!judge(&case(), &reading(0.5, 0.1), &good).broken, "it is off, and nothing else");
        let near = Reading { momentum_error: Some(0.9e-5), ground_error: Some(0.009), ..good.clone() };
        assert!(passes(&case(), &near));
        assert!(!passes(&Case { pairs: Some(2), ..case() }, &good));
    }

    #[test]
    fn where_one_world_misses_its_weight_its_own_miss_is_allowed() {
        let r1 = Reading { ground_error: Some(0.1), ..reading(0.0, 0.0) };
        let of = |error| Reading { ground_error: Some(error), ..reading(0.0, 0.0) };
        assert!(judge(&case(), &of(0.109), &r1).pass());
        assert!(!judge(&case(), &of(0.111), &r1).pass());
    }
}
