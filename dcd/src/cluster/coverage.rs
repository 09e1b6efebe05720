//! Knows which part of the world clients look at, as a set of cells: those near their areas of interest, and
//! near their avatars.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use crate::protocol::{Area, SharedState};
use crate::space::{BodyId, ClientId};

/// The size of the cells of level 0, metres. Cells of each further level are twice as large.
const CELL_M: f64 = 8.0;

/// The most cells along one axis of an area: an area is covered by cells of the lowest level at which it is
/// no more of them across.
const ACROSS: f64 = 8.0;

/// The distance beyond an area within which bodies count for a relay, metres. A client that another process
/// told before is thus told of what may just have left its area.
pub(in crate::cluster) const AROUND_M: f64 = 32.0;

/// The same for members' reports, metres: a body that comes in between two reports is thus reported some
/// metres before.
const REPORTED_AROUND_M: f64 = 4.0;

/// The cells around an avatar that are covered, for relays: their level, and how many there are on each side of the
/// avatar's own. They reach as far as an area around the avatar does.
const RELAYED_AVATARS: (i64, i64) = (2, 1);
/// The same for members' reports.
const REPORTED_AVATARS: (i64, i64) = (0, 2);

/// The largest radius of an area, metres. A client with a larger one counts as looking at everything.
const MOST_M: f64 = 1_000.0;

/// The most cells that are covered in all. A client whose area has no room counts as looking at everything.
const MOST_CELLS: usize = 1 << 20;

/// A cell: its level, and its place along x, y and z in cells of that level.
pub(crate) type Cell = [i64; 4];

/// A block of cells of one level, by two opposite corners.
type Block = [Cell; 2];

/// The part of the world that clients look at.
#[derive(Clone, Debug)]
pub(in crate::cluster) struct Coverage {
    around_m: f64,
    /// The level of the cells around avatars, and how many there are on each side.
    avatar_cells: (i64, i64),
    /// Clients that look at everything.
    all: BTreeSet<ClientId>,
    /// The cells near the area of each other client.
    areas: BTreeMap<ClientId, Block>,
    avatars: BTreeMap<BodyId, Cell>,
    /// How many of these areas, and of the blocks around avatars, each cell is in.
    cells: HashMap<Cell, u32>,
    levels: BTreeMap<i64, usize>,
    /// Cells that have come to be covered since [`Self::settle`] was last called.
    grown: HashSet<Cell>,
}

impl Coverage {
    /// Returns the coverage of a relay, with nobody looking.
    pub(in crate::cluster) fn of_relay() -> Self {
        Self::new(AROUND_M, RELAYED_AVATARS)
    }

    /// Returns the coverage of members' reports, with nobody looking.
    pub(in crate::cluster) fn of_reports() -> Self {
        Self::new(REPORTED_AROUND_M, REPORTED_AVATARS)
    }

    fn new(around_m: f64, avatar_cells: (i64, i64)) -> Self {
        Self {
            around_m,
            avatar_cells,
            all: BTreeSet::new(),
            areas: BTreeMap::new(),
            avatars: BTreeMap::new(),
            cells: HashMap::new(),
            levels: BTreeMap::new(),
            grown: HashSet::new(),
        }
    }

    /// Notes a client's area of interest (`None` is everything). Returns whether that changes anything. Cells
    /// that are covered before and after do not count as grown.
    pub(in crate::cluster) fn turn(&mut self, client: ClientId, area: Option<Area>) -> bool {
        let block = area.filter(|area| area.radius_m <= MOST_M).map(|area| self.block_around(&area));
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

    /// Forgets a client and its avatars. Returns whether the client was known.
    pub(in crate::cluster) fn leave(&mut self, client: ClientId) -> bool {
        let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        for avatar in self.avatars.range(own).map(|(&id, _)| id).collect::<Vec<_>>() {
            self.forget(avatar);
        }
        let area = self.areas.remove(&client);
        area.into_iter().flat_map(cells_of).for_each(|cell| self.uncover(cell));
        self.all.remove(&client) || area.is_some()
    }

    /// Returns the cell that an avatar is in, of the level for avatars.
    pub(in crate::cluster) fn cell_of(&self, avatar: &SharedState) -> Cell {
        cell_at(self.avatar_cells.0, avatar.pose.translation)
    }

    /// Notes the cell of an avatar, if its client has an area. Returns whether that is another cell than
    /// before.
    pub(in crate::cluster) fn follow(&mut self, avatar: BodyId, cell: Cell) -> bool {
        let has_area = avatar.client().is_some_and(|client| self.areas.contains_key(&client));
        if !has_area || self.avatars.get(&avatar) == Some(&cell) {
            return false;
        }
        let former = self.avatars.insert(avatar, cell).map(|cell| self.around(cell));
        self.change(former, self.around(cell));
        true
    }

    /// Forgets a body, if it is an avatar.
    pub(in crate::cluster) fn forget(&mut self, id: BodyId) {
        if let Some(at) = self.avatars.remove(&id) {
            cells_of(self.around(at)).for_each(|cell| self.uncover(cell));
        }
    }

    /// Returns whether a client looks at anything.
    pub(in crate::cluster) fn knows(&self, client: ClientId) -> bool {
        self.all.contains(&client) || self.areas.contains_key(&client)
    }

    /// Returns the clients that have an area.
    pub(in crate::cluster) fn with_areas(&self) -> impl Iterator<Item = ClientId> {
        self.areas.keys().copied()
    }

    /// Returns whether some client looks at everything.
    pub(in crate::cluster) fn is_all(&self) -> bool {
        !self.all.is_empty()
    }

    /// Returns whether a place is near a client's area or avatar.
    pub(in crate::cluster) fn covers(&self, at: [f64; 3]) -> bool {
        let [_, x, y, z] = cell_at(0, at);
        // Each cell lies in one cell of the next level.
        self.levels.keys().any(|&level| self.cells.contains_key(&[level, x >> level, y >> level, z >> level]))
    }

    /// Returns whether any cell has come to be covered since [`Self::settle`] was last called.
    pub(in crate::cluster) fn has_grown(&self) -> bool {
        !self.grown.is_empty()
    }

    /// Returns whether a place is in a cell that has come to be covered since [`Self::settle`] was last
    /// called.
    pub(in crate::cluster) fn is_new(&self, at: [f64; 3]) -> bool {
        let [_, x, y, z] = cell_at(0, at);
        self.levels.keys().any(|&level| self.grown.contains(&[level, x >> level, y >> level, z >> level]))
    }

    /// Marks all covered cells as known. Returns whether any has come since the last call.
    pub(in crate::cluster) fn settle(&mut self) -> bool {
        !std::mem::take(&mut self.grown).is_empty()
    }

    /// Returns whether nothing is kept.
    #[cfg(test)]
    pub(in crate::cluster) fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.avatars.is_empty() && self.areas.is_empty() && self.all.is_empty()
    }

    /// Covers a block in place of another. Cells in both keep their counts.
    fn change(&mut self, former: Option<Block>, block: Block) {
        let is_new = |cell: &Cell| !former.is_some_and(|former| is_in(former, cell));
        for cell in cells_of(block).filter(is_new) {
            let count = self.cells.entry(cell).or_default();
            *count += 1;
            if *count == 1 {
                self.grown.insert(cell);
                *self.levels.entry(cell[0]).or_default() += 1;
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
                let left = self.levels.get_mut(&cell[0]).expect("it has this cell");
                *left -= 1;
                if *left == 0 {
                    self.levels.remove(&cell[0]);
                }
            }
        }
    }

    /// Returns the cells that are covered around an avatar in this cell.
    fn around(&self, [level, x, y, z]: Cell) -> Block {
        let (_, side) = self.avatar_cells;
        let to = |by: i64| [level, x.saturating_add(by), y.saturating_add(by), z.saturating_add(by)];
        [to(-side), to(side)]
    }

    /// Returns the cells around an area in which bodies count as near it.
    fn block_around(&self, area: &Area) -> Block {
        let reach_m = 1.15 * area.radius_m + 2.0 + self.around_m;
        let level = (2.0 * reach_m / (ACROSS * CELL_M)).log2().ceil().max(0.0) as i64;
        [-reach_m, reach_m].map(|to| cell_at(level, area.centre.map(|at| at + to)))
    }
}

fn cell_at(level: i64, at: [f64; 3]) -> Cell {
    let size_m = CELL_M * 2_f64.powi(level as i32);
    let [x, y, z] = at.map(|at| (at / size_m).floor() as i64);
    [level, x, y, z]
}

fn cells_of([low, high]: Block) -> impl Iterator<Item = Cell> {
    let along = move |axis: usize| low[axis]..=high[axis];
    let plane = move |x| along(2).flat_map(move |y| along(3).map(move |z| [low[0], x, y, z]));
    along(1).flat_map(plane)
}

fn is_in([low, high]: Block, cell: &Cell) -> bool {
    (0..4).all(|axis| (low[axis]..=high[axis]).contains(&cell[axis]))
}
