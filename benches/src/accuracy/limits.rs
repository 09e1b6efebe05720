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
