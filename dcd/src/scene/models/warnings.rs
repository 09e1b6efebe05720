//! Collects the differences between a scene and its file: one line per kind, with the names it concerns.

use std::collections::BTreeMap;

/// Kinds of differences, and the names that each concerns.
#[derive(Debug, Default)]
pub(super) struct Warnings(BTreeMap<&'static str, (&'static str, Vec<String>)>);

/// The most names that a line gives.
const SHOWN: usize = 3;

impl Warnings {
    /// Notes that `what` of `whom` is not as the file says, but as `how` says. `what` is the feature, as the
    /// table calls it.
    pub(super) fn add(&mut self, what: &'static str, whom: impl Into<String>, how: &'static str) {
        self.0.entry(what).or_insert((how, Vec::new())).1.push(whom.into());
    }

    /// Returns the lines, in order of the feature.
    pub(super) fn lines(self) -> Vec<String> {
        self.0
            .into_iter()
            .map(|(what, (how, mut whom))| {
                whom.dedup();
                let more = whom.len().saturating_sub(SHOWN);
                let mut names = whom[..whom.len() - more].join(", ");
                if more > 0 {
                    names += &format!(" and {more} more");
                }
                let of = if names.is_empty() { String::new() } else { format!(" of {names}") };
                format!("{what}{of}: {how}")
            })
            .collect()
    }
}
