//! Decides whether clients cost a world more than they may, beside the same world without clients.

use super::Row;

/// The number of clients up to which a world has gates.
pub(super) const CLIENTS: usize = 500;

/// The factors by which clients may make a tick of the world longer.
#[derive(Clone, Copy)]
pub(super) struct Gates {
    /// Of the processor time per tick of the leader's thread that computes the world.
    world: f64,
    /// Of the 99th percentile of the time between two ticks.
    between: f64,
}

const GATES: Gates = Gates { world: 1.2, between: 1.2 };

/// The cost that 500 clients may have, which miss both gates, as the page of results says: half as much again
/// as was measured. What is beyond that is another fault.
const OPEN: Gates = Gates { world: 1.9, between: 3.6 };

/// The times of a tick as multiples of those without clients.
#[derive(Clone, Copy)]
pub(super) struct Over {
    pub(super) world: f64,
    pub(super) between: f64,
}

impl Over {
    /// Returns whether each of the two is within the gate that is the goal.
    pub(super) fn holds(self) -> [bool; 2] {
        [self.world <= GATES.world, self.between <= GATES.between]
    }
}

impl Row {
    /// Returns the row of the same world without clients.
    pub(super) fn alone<'a>(&self, mut rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
        rows.find(|row| (row.clients, row.cubes, &row.scene) == (0, self.cubes, &self.scene))
    }

    /// Compares the row with that of the same world without clients.
    pub(super) fn over(&self, alone: &Row) -> Over {
        Over { world: self.world_ms / alone.world_ms, between: self.tick_p99_ms / alone.tick_p99_ms }
    }

    /// Returns in words what the clients cost beyond their gates.
    pub(super) fn missed(&self, alone: &Row) -> Vec<String> {
        if self.clients > CLIENTS {
            return Vec::new();
        }
        let is_open = self.clients == CLIENTS && self.relays_above.is_none();
        let (gates, over) = (if is_open { OPEN } else { GATES }, self.over(alone));
        let told = |what: &str, over: f64, most: f64, [now_ms, alone_ms]: [f64; 2]| {
            (over > most).then(|| {
                format!("{what} is {now_ms:.2} ms, and {alone_ms:.2} ms without clients: {most} times that is the most")
            })
        };
        let world = [self.world_ms, alone.world_ms];
        let between = [self.tick_p99_ms, alone.tick_p99_ms];
        [
            told("the world's processor time per tick", over.world, gates.world, world),
            told("the 99th percentile of the time between ticks", over.between, gates.between, between),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{committed, read_csv};

    /// Returns the numbers of clients that would miss a gate if all clients cost so many times what the
    /// committed rows say.
    fn missed(world: f64, between: f64) -> Vec<usize> {
        let rows = read_csv::<Row>(&committed().join("fan-out.csv")).unwrap();
        let rows: Vec<_> = rows.into_iter().map(|row| row.row).collect();
        let cost = |row: &Row| {
            let alone = row.alone(rows.iter()).unwrap();
            let (world_ms, tick_p99_ms) = (world * row.world_ms, between * row.tick_p99_ms);
            !Row { world_ms, tick_p99_ms, ..row.clone() }.missed(alone).is_empty()
        };
        rows.iter().filter(|row| row.clients > 0 && cost(row)).map(|row| row.clients).collect()
    }

    #[test]
    fn clients_of_the_page_keep_their_gates_and_those_that_cost_more_do_not() {
        assert!(missed(1.0, 1.0).is_empty());
        assert_eq!(missed(2.0, 1.0), [10, 100, 500]);
        assert_eq!(missed(1.0, 2.0), [10, 100, 500]);
    }

    #[test]
    fn ten_clients_may_not_cost_what_is_known_of_five_hundred() {
        assert_eq!(missed(1.3, 1.0), [10, 100]);
    }
}
