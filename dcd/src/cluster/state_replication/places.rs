//! Finds bodies by where they are, so that an area that moves costs no look at those that are elsewhere.

use std::collections::HashMap;

use super::news;
use crate::protocol::Area;
use crate::space::BodyId;

/// The size of a cell, metres: of the order of small areas of interest.
const CELL_M: f64 = 16.0;

/// Bodies by the cells of a grid. It does not keep their places: who changes one says where the body was.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    cells: HashMap<[i64; 3], Vec<BodyId>>,
}

impl FromIterator<(BodyId, [f64; 3])> for Places {
    fn from_iter<T: IntoIterator<Item = (BodyId, [f64; 3])>>(bodies: T) -> Self {
        let mut places = Self::default();
        bodies.into_iter().for_each(|(id, at)| places.put(id, None, at));
        places
    }
}

impl Places {
    /// Puts a body to a place. It was `before` at another, or at none.
    pub(super) fn put(&mut self, id: BodyId, before: Option<[f64; 3]>, at: [f64; 3]) {
        if before.map(cell) != Some(cell(at)) {
            before.into_iter().for_each(|before| self.remove(id, before));
            self.cells.entry(cell(at)).or_default().push(id);
        }
    }

    /// Removes a body, which is at this place.
    pub(super) fn remove(&mut self, id: BodyId, at: [f64; 3]) {
        let Some(bodies) = self.cells.get_mut(&cell(at)) else { return };
        if let Some(place) = bodies.iter().position(|body| *body == id) {
            bodies.swap_remove(place);
        }
        if bodies.is_empty() {
            self.cells.remove(&cell(at));
        }
    }

    /// Returns at least all bodies that are where they enter an area, in no order.
    pub(super) fn near(&self, area: &Area) -> Vec<BodyId> {
        let (low, high) = area.entered_from();
        let (low, high) = (cell(low), cell(high));
        let across = |axis: usize| high[axis].saturating_sub(low[axis]).saturating_add(1);
        // Looking through all cells is quicker than looking for more than there are.
        if across(0).saturating_mul(across(1)).saturating_mul(across(2)) > self.cells.len() as i64 {
            let is_near = |cell: &[i64; 3]| (0..3).all(|axis| (low[axis]..=high[axis]).contains(&cell[axis]));
            let found = self.cells.iter().filter(|(cell, _)| is_near(cell));
            return found.flat_map(|(_, bodies)| bodies).copied().collect();
        }
        let plane = |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z]));
        let found = (low[0]..=high[0]).flat_map(plane).filter_map(|cell| self.cells.get(&cell));
        found.flatten().copied().collect()
    }
}

fn cell(at: [f64; 3]) -> [i64; 3] {
    news::cell(at, CELL_M)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;
    use crate::sim::Random;

    /// Bodies come, move, jump and go at random, and areas are of all sizes.
    #[test]
    fn whoever_enters_an_area_is_found_there() {
        let mut random = Random::new(7);
        let (mut places, mut bodies) = (Places::default(), BTreeMap::new());
        let (mut found, mut looked) = (0, 0);
        for _ in 0..4_000 {
            let id = BodyId::persistent(random.below(200) as u32);
            let anywhere = |random: &mut Random| [0; 3].map(|_| 400.0 * (random.unit() - 0.5));
            if random.below(4) == 0 {
                bodies.remove(&id).into_iter().for_each(|at| places.remove(id, at));
            } else {
                let at = anywhere(&mut random);
                places.put(id, bodies.insert(id, at), at);
            }
            let area = Area { centre: anywhere(&mut random), radius_m: 2.0_f64.powf(8.0 * random.unit()) };
            let near: BTreeSet<_> = places.near(&area).into_iter().collect();
            let enters = bodies.iter().filter(|(_, at)| area.enters(**at)).map(|(id, _)| *id);
            let missed: Vec<_> = enters.filter(|id| !near.contains(id)).collect();
            assert!(missed.is_empty(), "{missed:?} in {area:?}");
            assert!(near.iter().all(|id| bodies.contains_key(id)), "what is gone is not found");
            (found, looked) = (found + near.len(), looked + bodies.len());
        }
        assert!(found < looked / 2, "{found} of {looked}");
        bodies.into_iter().for_each(|(id, at)| places.remove(id, at));
        assert!(places.cells.is_empty());
    }
}
