//! Keeps the shapes of the world that a client is told of, until the server says that no body has them any more.

use std::collections::BTreeSet;

use super::Client;
use crate::protocol::{ShapeHash, ShapeRecord};

impl Client {
    pub(super) fn learn(&mut self, shapes: Vec<ShapeRecord>) {
        for shape in shapes {
            let hash = shape.hash();
            self.unspoken_shapes.remove(&hash);
            self.shapes.insert(hash, shape);
        }
    }

    /// Forgets shapes that are gone from the world, but those of bodies that it knows.
    pub(super) fn forget_shapes(&mut self, gone: &BTreeSet<ShapeHash>) {
        if gone.is_empty() {
            return;
        }
        let colliders = self.bodies.values().flat_map(|view| &view.body.traits.colliders);
        let mut used: BTreeSet<_> = colliders.map(|collider| collider.shape).collect();
        let known = used.iter().filter_map(|hash| self.shapes.get(hash));
        let parts: Vec<_> = known.flat_map(ShapeRecord::parts).collect();
        used.extend(parts);
        self.shapes.retain(|hash, _| used.contains(hash) || !gone.contains(hash));
    }
}
