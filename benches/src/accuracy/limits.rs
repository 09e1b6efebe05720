//! The named limits: what fails for a cause that is known and stands in the results. At most three.

/// A cause, and where it shows.
pub(crate) struct Limit {
    /// Name of the experiment.
    pub experiment: &'static str,
    /// Labels of its cases that begin like this; empty for all.
    pub case: &'static str,
    /// Why.
    pub cause: &'static str,
}

/// Three at most: more would be a method that does not work.
pub(crate) const LIMITS: &[Limit] = &[];

/// Why this case of this experiment is known to fail, if it is.
pub(crate) fn cause(experiment: &str, case: &str) -> Option<&'static str> {
    LIMITS
        .iter()
        .find(|limit| limit.experiment == experiment && case.starts_with(limit.case))
        .map(|limit| limit.cause)
}

#[cfg(test)]
mod tests {
    use super::super::scene::Size;
    use super::super::scenes::experiments;
    use super::*;

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
