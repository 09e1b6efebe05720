//! Keeps the shapes of the world that a client is told of, until the server says that no body has them any
//! more.

use std::collections::{BTreeMap, BTreeSet};

use super::Client;
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord};

impl Client {
    pub(super) fn learn(&mut self, shapes: Vec<ShapeRecord>) {
        for shape in shapes {
            let hash = shape.hash();
            self.unspoken_shapes.remove(&hash);
            self.shapes.insert(hash, shape);
        }
    }

    /// Forgets shapes that are gone from the world, except those of bodies that the client knows.
    pub(super) fn forget_shapes(&mut self, gone: &BTreeSet<ShapeHash>) {
        if gone.is_empty() {
            return;
        }
        let used = named(self.bodies.values().map(|view| &view.body), |hash| self.shapes.get(hash));
        let is_gone = |(hash, _): &(ShapeHash, _)| gone.contains(hash) && !used.contains(hash);
        let (gone, left): (BTreeMap<_, _>, _) =
            std::mem::take(&mut self.shapes).into_iter().partition(is_gone);
        self.shapes = left;
        self.building.keep_named(gone, &self.shapes);
    }
}

/// Returns the shapes that bodies name, and the parts of those that `find` returns.
pub(super) fn named<'a, 'b>(
    bodies: impl Iterator<Item = &'b BodyRecord>,
    find: impl Fn(&ShapeHash) -> Option<&'a ShapeRecord>,
) -> BTreeSet<ShapeHash> {
    let colliders = bodies.flat_map(|body| &body.traits.colliders);
    let mut named: BTreeSet<_> = colliders.map(|collider| collider.shape).collect();
    let parts: Vec<_> = named.iter().filter_map(find).flat_map(ShapeRecord::parts).collect();
    named.extend(parts);
    named
}
