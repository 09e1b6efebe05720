//! Sorts the bodies that moved in a tick by where they are, so that a client with a small area costs no look
//! at those that move elsewhere.

use std::collections::BTreeMap;

use crate::protocol::{Area, SharedState};
use crate::space::{BodyId, Tick};

/// The newest state of each body, with its tick.
pub(in crate::cluster) type Latest = BTreeMap<BodyId, (SharedState, Tick)>;
/// Bodies that moved since states were last sent, each with where it was before, if that was sent.
pub(super) type Moved = BTreeMap<BodyId, Option<[f64; 3]>>;

/// A body that moved, as it is now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub(super) state: SharedState,
    /// The place where it was before, if that was sent.
    pub(super) before: Option<[f64; 3]>,
}

/// The bodies that moved, as they are now.
#[derive(Clone, Debug, Default)]
pub(super) struct News {
    /// The changes, in id order.
    changes: Vec<Change>,
    /// Bodies that did not move the time before.
    begun: Vec<BodyId>,
    /// The cell of a grid that each change is in, with the index of the change, sorted.
    cells: Vec<([i64; 3], u32)>,
    cell_m: f64,
}

impl News {
    /// Returns the news of these bodies. `former` are those that moved the time before. Areas that are looked
    /// for have about the given radius.
    pub(super) fn of(moved: &Moved, former: &[BodyId], latest: &Latest, radius_m: f64) -> Self {
        let change = |(id, &before): (&BodyId, _)| Some(Change { state: latest.get(id)?.0, before });
        let changes: Vec<_> = moved.iter().filter_map(change).collect();
        let is_new = |id: &&BodyId| former.binary_search(id).is_err();
        let begun = moved.keys().filter(is_new).copied().collect();
        let cell_m = radius_m.max(1.0);
        let mut cells: Vec<_> = (0..)
            .zip(&changes)
            .map(|(at, change)| (cell(change.state.pose.translation, cell_m), at))
            .collect();
        cells.sort_unstable();
        Self { changes, begun, cells, cell_m }
    }

    /// Returns all changes, in id order.
    pub(super) fn all(&self) -> &[Change] {
        &self.changes
    }

    /// Returns the bodies that did not move the time before.
    pub(super) fn begun(&self) -> &[BodyId] {
        &self.begun
    }

    /// Returns the change of a body, if it moved.
    pub(super) fn of_body(&self, id: BodyId) -> Option<&Change> {
        let at = self.changes.binary_search_by_key(&id, |change| change.state.id).ok()?;
        Some(&self.changes[at])
    }

    /// Calls `look` with the changes of at least all bodies that have come to where they enter an area.
    pub(super) fn near(&self, area: &Area, mut look: impl FnMut(&Change)) {
        let (low, high) = area.entered_from();
        let (low, high) = (cell(low, self.cell_m), cell(high, self.cell_m));
        let across = |axis: usize| high[axis].saturating_sub(low[axis]).saturating_add(1);
        // Looking at all changes is quicker than looking for many cells.
        if across(0).saturating_mul(across(1)) > self.cells.len() as i64 {
            self.changes.iter().for_each(look);
            return;
        }
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                let from = self.cells.partition_point(|(cell, _)| *cell < [x, y, low[2]]);
                let row = self.cells[from..].iter().take_while(|(cell, _)| *cell <= [x, y, high[2]]);
                row.for_each(|&(_, at)| look(&self.changes[at as usize]));
            }
        }
    }
}

/// Returns the cell of a grid that a place is in.
pub(super) fn cell(at: [f64; 3], cell_m: f64) -> [i64; 3] {
    at.map(|value| (value / cell_m).floor() as i64)
}
