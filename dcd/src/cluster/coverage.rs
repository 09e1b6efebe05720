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

/// The most cells of all together: beyond, who comes looks at everything.
const MOST_CELLS: usize = 1 << 20;

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
    /// Notes what a client is interested in, and returns whether that is new. What is covered before and after has not grown meanwhile.
    pub(in crate::cluster) fn turn(&mut self, client: ClientId, area: Option<Area>) -> bool {
        let block = area.filter(|area| area.radius_m <= MOST_M).map(|area| block_around(&area));
        let has_room = |block: &Block| self.cells.len() + cells_of(*block).count() <= MOST_CELLS;
        let Some(block) = block.filter(has_room) else {
            if self.all.contains(&client) {
                return false;
            }
            self.leave(client);
            return self.all.insert(client);
        };
        let is_new = self.all.remove(&client);
        let former = self.areas.insert(client, block);
        if former == Some(block) {
            return is_new;
        }
        self.change(former, block);
        true
    }

    /// Forgets a client, and its avatars. Returns whether it was known.
    pub(in crate::cluster) fn leave(&mut self, client: ClientId) -> bool {
        let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        for avatar in self.avatars.range(own).map(|(&id, _)| id).collect::<Vec<_>>() {
            self.forget(avatar);
        }
        let area = self.areas.remove(&client);
        area.into_iter().flat_map(cells_of).for_each(|cell| self.uncover(cell));
        self.all.remove(&client) || area.is_some()
    }

    /// Notes where an avatar is of a client that has an area. Returns whether it was in another cell before.
    pub(in crate::cluster) fn follow(&mut self, avatar: BodyId, at: Cell) -> bool {
        let has_area = avatar.client().is_some_and(|client| self.areas.contains_key(&client));
        if !has_area || self.avatars.get(&avatar) == Some(&at) {
            return false;
        }
        let former = self.avatars.insert(avatar, at).map(around);
        self.change(former, around(at));
        true
    }

    /// Forgets a body, if it is an avatar.
    pub(in crate::cluster) fn forget(&mut self, id: BodyId) {
        if let Some(at) = self.avatars.remove(&id) {
            cells_of(around(at)).for_each(|cell| self.uncover(cell));
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

    /// Covers a block in place of another. Cells that both have are left alone.
    fn change(&mut self, former: Option<Block>, block: Block) {
        let is_new = |cell: &Cell| !former.is_some_and(|former| is_in(former, cell));
        for cell in cells_of(block).filter(is_new) {
            let count = self.cells.entry(cell).or_default();
            *count += 1;
            if *count == 1 {
                self.grown.insert(cell);
            }
        }
        let old = former.into_iter().flat_map(cells_of).filter(|cell| !is_in(block, cell));
        old.for_each(|cell| self.uncover(cell));
    }

    fn uncover(&mut self, cell: Cell) {
        if let Some(count) = self.cells.get_mut(&cell) {
            *count -= 1;
            if *count == 0 {
                self.cells.remove(&cell);
                self.grown.remove(&cell);
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

fn is_in([low, high]: Block, cell: &Cell) -> bool {
    (0..3).all(|axis| (low[axis]..=high[axis]).contains(&cell[axis]))
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
