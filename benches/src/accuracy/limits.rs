//! Lists the named limits: failures whose cause is known and stands in the results. There are at most three
//! causes.

/// A known cause of failures, and where it shows.
pub(crate) struct Limit {
    /// The name of the experiment.
    pub experiment: &'static str,
    /// The beginning of the labels of its cases; empty for all cases.
    pub case: &'static str,
    /// The methods that have this limit.
    pub methods: &'static [&'static str],
    /// The largest error that is excused, in gates: beyond it something else is wrong.
    pub most: f64,
    /// The cause, in words.
    pub cause: &'static str,
}

/// All limits. Three causes at most: more would mean a method that does not work.
pub(crate) const LIMITS: &[Limit] = &[
    Limit { experiment: "cradle", case: "", methods: OVERLAP, most: 1_000.0, cause: EDGE_IMPACT },
    Limit { experiment: "gas", case: "", methods: OVERLAP, most: 200.0, cause: EDGE_IMPACT },
    Limit { experiment: "spheres_1000", case: "0.5 s", methods: OVERLAP, most: 1_000.0, cause: EDGE_IMPACT },
    Limit { experiment: "delayed", case: SKIPPED_GAS, methods: OVERLAP, most: 200.0, cause: EDGE_IMPACT },
    Limit { experiment: "spheres_1000", case: "0.5 s", methods: WHOLE, most: 10.0, cause: CROWD },
    Limit { experiment: "delayed", case: SKIPPED_GAS, methods: ISLAND, most: 10.0, cause: CROWD },
];

const OVERLAP: &[&str] = &["overlap"];

const ISLAND: &[&str] = &["island"];

/// The methods that solve contacts with whole copies of the bodies.
const WHOLE: &[&str] = &["island", "auto"];

const SKIPPED_GAS: &str = "one in ten skipped by all: gas";

/// Two equal balls collide, and only one of them lives in both regions. Each ball then gets 2/3 of the change
/// of velocity that it should: the copy with half of the mass is hit in one region, its twin in the other is
/// not, and the mean of both counts.
const EDGE_IMPACT: &str = "a body at the edge of the overlap is hit with a part of its mass";

/// Each of two regions sees a part of an island that the other does not see yet. The impulse that one of them
/// finds is told to the other, so that nothing is lost. By then, however, the body is where it would be
/// without that impulse. Of the small crowd of `--quick` that is more than the order of contacts matters.
const CROWD: &str = "a contact that begins in a crowd may be seen by one of two regions alone";

/// Returns the cause by which this case of this experiment is known to be off by so many gates, if there is
/// one. Methods that are there only for comparison are not excused.
pub(crate) fn cause(experiment: &str, case: &str, method: &str, gates: f64) -> Option<&'static str> {
    LIMITS
        .iter()
        .filter(|limit| limit.methods.contains(&method))
        .find(|limit| limit.experiment == experiment && case.starts_with(limit.case) && gates <= limit.most)
        .map(|limit| limit.cause)
}

#[cfg(test)]
mod tests {
    use super::super::scene::Size;
    use super::super::scenes::experiments;
    use super::*;

    #[test]
    fn a_limit_of_couplings_that_share_mass_excuses_no_other() {
        assert_eq!(cause("cradle", "1 m/s", "overlap", 9.0), Some(EDGE_IMPACT));
        assert_eq!(cause("cradle", "1 m/s", "auto", 9.0), None, "an island of five is exact");
        assert_eq!(cause("gas", "216 balls", "overlap", 9.0), Some(EDGE_IMPACT));
        assert_eq!(cause("gas", "216 balls", "auto", 9.0), None, "by statistics it is right");
        assert_eq!(cause("spheres_1000", "0.5 s", "overlap", 9.0), Some(EDGE_IMPACT));
        assert_eq!(cause("spheres_1000", "0.5 s", "auto", 9.0), Some(CROWD));
        assert_eq!(cause("spheres_1000", "0.5 s", "auto", 11.0), None);
        assert_eq!(cause("delayed", SKIPPED_GAS, "auto", 9.0), None);
        assert_eq!(cause("delayed", SKIPPED_GAS, "island", 9.0), Some(CROWD));
        assert_eq!(cause("gas", "216 balls", "owner", 9.0), None);
        assert_eq!(cause("spheres_1000", "4 s", "auto", 9.0), None);
    }

    #[test]
    fn a_limit_excuses_no_error_that_is_far_beyond_what_it_explains() {
        assert_eq!(cause("spheres_1000", "0.5 s", "overlap", 1e6), None);
        assert_eq!(cause("spheres_1000", "0.5 s", "overlap", f64::NAN), None, "no number is no measure");
    }

    #[test]
    fn at_most_three_causes_are_known_and_each_names_what_there_is() {
        let mut causes: Vec<_> = LIMITS.iter().map(|limit| limit.cause).collect();
        causes.sort_unstable();
        causes.dedup();
        assert!(causes.len() <= 3, "{causes:?}");
        for limit in LIMITS {
            let experiments = experiments();
            let experiment =
                experiments.iter().find(|one| one.name == limit.experiment).expect(limit.experiment);
            let mut cases = (experiment.cases)(Size::Quick);
            cases.extend((experiment.cases)(Size::Full));
            assert!(cases.iter().any(|case| case.label.starts_with(limit.case)), "{}", limit.case);
        }
    }
}
