//! Knows which part of the world clients look at, in cells: near their areas of interest, and near their avatars.

use std::collections::{BTreeMap, BTreeSet};

use crate::protocol::{Area, SharedState};
use crate::space::{BodyId, ClientId};

/// The size of a cell, metres.
const CELL_M: f64 = 32.0;

/// How far beyond an area bodies count, metres: a client that comes from another teller is told of what may just have left its area.
pub(in crate::cluster) const AROUND_M: f64 = 32.0;

/// Who has a larger area looks at everything: cells would be too many.
const MOST_M: f64 = 256.0;

/// The place of a cell, in cells along each axis.
pub(crate) type Cell = [i64; 3];

/// Cells from one corner to the opposite one.
type Block = [Cell; 2];

/// What clients look at.
#[derive(Clone, Debug, Default)]
pub(in crate::cluster) struct Coverage {
    /// Clients that look at everything.
    all: BTreeSet<ClientId>,
    /// The cells near the areas of others, and those near their avatars.
    areas: BTreeMap<ClientId, Block>,
    avatars: BTreeMap<BodyId, Cell>,
    /// In how many of these each cell is.
    cells: BTreeMap<Cell, u32>,
    /// Cells that were in none the last time.
    grown: BTreeSet<Cell>,
}

impl Coverage {
    /// Notes what a client is interested in, and returns whether that is new. What is covered before and after has not grown meanwhile: it is
    /// left at last.
    pub(in crate::cluster) fn turn(&mut self, client: ClientId, area: Option<Area>) -> bool {
        let Some(area) = area.filter(|area| area.radius_m <= MOST_M) else {
            self.leave(client);
            return self.all.insert(client);
        };
        let is_new = self.all.remove(&client);
        let block = block_around(&area);
        if self.areas.get(&client) == Some(&block) {
            return is_new;
        }
        self.cover(block);
        let former = self.areas.insert(client, block);
        former.into_iter().for_each(|block| self.uncover(block));
        true
    }

    /// Forgets a client, and its avatars. Returns whether it was known.
    pub(in crate::cluster) fn leave(&mut self, client: ClientId) -> bool {
        let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        for avatar in self.avatars.range(own).map(|(&id, _)| id).collect::<Vec<_>>() {
            self.forget(avatar);
        }
        let area = self.areas.remove(&client);
        area.into_iter().for_each(|block| self.uncover(block));
        self.all.remove(&client) || area.is_some()
    }

    /// Notes where an avatar is of a client that has an area. Returns whether it was in another cell before.
    pub(in crate::cluster) fn follow(&mut self, avatar: BodyId, at: Cell) -> bool {
        let has_area = avatar.client().is_some_and(|client| self.areas.contains_key(&client));
        if !has_area || self.avatars.get(&avatar) == Some(&at) {
            return false;
        }
        self.cover(around(at));
        let former = self.avatars.insert(avatar, at);
        former.into_iter().for_each(|at| self.uncover(around(at)));
        true
    }

    /// Forgets a body, if it is an avatar.
    pub(in crate::cluster) fn forget(&mut self, id: BodyId) {
        if let Some(at) = self.avatars.remove(&id) {
            self.uncover(around(at));
        }
    }

    /// Returns the clients that have an area.
    pub(in crate::cluster) fn with_areas(&self) -> impl Iterator<Item = ClientId> {
        self.areas.keys().copied()
    }

    /// Returns whether somebody looks at everything.
    pub(in crate::cluster) fn is_all(&self) -> bool {
        !self.all.is_empty()
    }

    /// Returns whether a cell is near a client's area, or an avatar.
    pub(in crate::cluster) fn covers(&self, cell: &Cell) -> bool {
        self.cells.contains_key(cell)
    }

    /// Returns whether there are cells that are new since they were taken last.
    pub(in crate::cluster) fn has_grown(&self) -> bool {
        !self.grown.is_empty()
    }

    /// Returns the cells that are new since the last call.
    pub(in crate::cluster) fn take_grown(&mut self) -> BTreeSet<Cell> {
        std::mem::take(&mut self.grown)
    }

    /// Returns whether nothing is kept.
    #[cfg(test)]
    pub(in crate::cluster) fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.avatars.is_empty() && self.areas.is_empty() && self.all.is_empty()
    }

    fn cover(&mut self, block: Block) {
        for cell in cells_of(block) {
            let count = self.cells.entry(cell).or_default();
            *count += 1;
            if *count == 1 {
                self.grown.insert(cell);
            }
        }
    }

    fn uncover(&mut self, block: Block) {
        for cell in cells_of(block) {
            if let Some(count) = self.cells.get_mut(&cell) {
                *count -= 1;
                if *count == 0 {
                    self.cells.remove(&cell);
                    self.grown.remove(&cell);
                }
            }
        }
    }
}

/// Returns the cell that a body is in.
pub(in crate::cluster) fn cell_of(state: &SharedState) -> Cell {
    state.pose.translation.map(|at| (at / CELL_M).floor() as i64)
}

fn cells_of([low, high]: Block) -> impl Iterator<Item = Cell> {
    let along = move |axis: usize| low[axis]..=high[axis];
    along(0).flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
}

/// Returns a cell and all that touch it.
fn around(of: Cell) -> Block {
    [of.map(|at| at.saturating_sub(1)), of.map(|at| at.saturating_add(1))]
}

/// Returns the cells in which bodies count that are near an area.
fn block_around(area: &Area) -> Block {
    let reach_m = 1.15 * area.radius_m + 2.0 + AROUND_M;
    [-reach_m, reach_m].map(|to| area.centre.map(|at| ((at + to) / CELL_M).floor() as i64))
}
