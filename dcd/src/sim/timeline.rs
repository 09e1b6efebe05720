//! Records the events of a run for people: faults, views, elections, evictions, broken links.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

/// The most entries kept; the oldest go first.
const KEPT: usize = 400;

/// A bounded log of events.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timeline {
    entries: VecDeque<(Duration, String)>,
    dropped: u64,
}

impl Timeline {
    pub(super) fn note(&mut self, now: Duration, what: String) {
        if self.entries.len() == KEPT {
            self.entries.pop_front();
            self.dropped += 1;
        }
        self.entries.push_back((now, what));
    }

    /// Returns the events with their times, oldest first.
    pub fn entries(&self) -> impl Iterator<Item = (Duration, &str)> {
        self.entries.iter().map(|(time, what)| (*time, what.as_str()))
    }
}

impl fmt::Display for Timeline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.dropped > 0 {
            writeln!(f, "  ... {} earlier entries", self.dropped)?;
        }
        for (time, what) in self.entries() {
            writeln!(f, "  {:9.3} s  {what}", time.as_secs_f64())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_entries_are_kept_and_the_others_counted() {
        let mut timeline = Timeline::default();
        for i in 0..KEPT as u64 + 3 {
            timeline.note(Duration::from_millis(i), format!("entry {i}"));
        }
        let text = timeline.to_string();
        assert!(text.starts_with("  ... 3 earlier entries\n      0.003 s  entry 3\n"), "{text}");
        assert_eq!(timeline.entries().count(), KEPT);
    }
}
