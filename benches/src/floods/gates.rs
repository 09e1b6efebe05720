//! Decides whether a flood cost more than it may, and names the floods that are known to.

use super::Row;
use super::hostile::Flood;

/// The bounds of what a flood may cost.
#[derive(Clone, Copy)]
pub(super) struct Gates {
    /// The megabytes by which a server or node may grow.
    pub(super) memory_mb: f64,
    /// The factor by which the 99th percentile of the world's tick times may grow.
    pub(super) ticks: f64,
}

pub(super) const GATES: Gates = Gates { memory_mb: 64.0, ticks: 1.2 };

/// Floods that miss a gate, as the page of results says, and what they may cost instead: half as much again
/// as was measured. What is beyond that is another fault.
const OPEN: [(Flood, Gates); 6] = [
    (Flood::Proved, Gates { ticks: 2.7, ..GATES }),
    (Flood::ProvedAtNode, Gates { ticks: 2.4, ..GATES }),
    (Flood::FinishedAtNode, Gates { ticks: 2.0, ..GATES }),
    (Flood::SlowClients, Gates { ticks: 1.8, ..GATES }),
    (Flood::Junk, Gates { ticks: 2.0, ..GATES }),
    (Flood::Pings, Gates { ticks: 1.8, ..GATES }),
];

impl Gates {
    /// Returns the gates of a flood: the usual ones, or those in `OPEN`.
    fn of(flood: Flood) -> Self {
        OPEN.iter().find(|(open, _)| *open == flood).map_or(GATES, |(_, gates)| *gates)
    }
}

impl Row {
    /// Returns in words what the flood cost beyond its gates. Ticks and joins count only where they were
    /// `timed`: measured for long enough, on a machine that did nothing else.
    pub(super) fn missed(&self, timed: bool) -> Vec<String> {
        let Gates { memory_mb, ticks } = Gates::of(self.flood);
        let mut missed = Vec::new();
        if self.grown_mb >= memory_mb {
            missed.push(format!("{:.1} MB more, of {memory_mb} MB that it may cost", self.grown_mb));
        }
        if timed && self.tick_p99_ms >= ticks * self.tick_p99_before_ms {
            let (now_ms, before_ms) = (self.tick_p99_ms, self.tick_p99_before_ms);
            missed.push(format!(
                "one tick in a hundred takes {now_ms:.2} ms or longer, and took {before_ms:.2} ms: {ticks} times that is the most"
            ));
        }
        if timed && self.joins_failed > 0 {
            missed.push(format!("{} of {} clients could not join", self.joins_failed, self.joins));
        }
        missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{committed, read_csv};

    /// Returns the floods that would miss a gate if memory and slowest ticks were so many times the committed
    /// ones.
    fn missed(memory: f64, ticks: f64) -> Vec<Flood> {
        let rows = read_csv::<Row>(&committed().join("floods.csv")).unwrap();
        let cost = |row: &mut Row| {
            row.grown_mb *= memory;
            row.tick_p99_ms *= ticks;
            !row.missed(true).is_empty()
        };
        rows.into_iter()
            .map(|row| row.row)
            .filter_map(|mut row| cost(&mut row).then_some(row.flood))
            .collect()
    }

    #[test]
    fn floods_of_the_page_keep_their_gates_and_one_that_costs_more_does_not() {
        assert_eq!(missed(1.0, 1.0), []);
        assert_eq!(missed(1.0, 2.0).len(), 14, "each flood has a gate for its ticks");
        let bigger = missed(2.0, 1.0);
        assert_eq!(bigger, [Flood::Proved, Flood::ProvedAtNode, Flood::SlowClients]);
    }
}
