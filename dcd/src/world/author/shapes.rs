//! Keeps the shapes of what an author makes and changes, as long as the world may need them from the author.

use std::collections::BTreeSet;

use super::{Author, Known};
use crate::physics::{ShapeError, ShapeLibrary};
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord};
use crate::world::error::Error;

impl Author {
    /// Drops shapes that the world does not have any more and that no awaited body uses.
    pub(super) fn forget_shapes(&mut self, world: &dyn Known) {
        let own = self.awaited.values().flat_map(|body| &body.traits.colliders);
        let mut used: BTreeSet<_> = own.map(|collider| collider.shape).collect();
        used.extend(self.shapes.hashes().filter(|hash| world.has_shape(*hash)));
        self.shapes.keep(used);
        self.fitting.retain(|hash| self.shapes.record_of(*hash).is_some());
    }

    /// Returns the shapes of what the author made, but those that were dropped.
    pub(in crate::world) fn shapes(&self) -> &ShapeLibrary {
        &self.shapes
    }

    /// Returns an error if a shape of a body is too large to be sent.
    pub(super) fn check_shapes(&mut self, body: &BodyRecord) -> Result<(), Error> {
        for hash in body.traits.colliders.iter().map(|collider| collider.shape) {
            if self.fitting.contains(&hash) {
                continue;
            }
            let Some(shape) = self.shapes.record_of(hash) else { continue };
            let parts: Vec<_> = shape.parts().filter_map(|part| self.shapes.record_of(part)).collect();
            if !parts.into_iter().chain([shape]).all(ShapeRecord::can_travel) {
                return Err(ShapeError::TooLong.into());
            }
            self.fitting.insert(hash);
        }
        Ok(())
    }

    /// Adds the shapes of a body on record to the author's library, parts before compounds.
    pub(super) fn learn(&mut self, world: &dyn Known, body: &BodyRecord) -> Result<(), Error> {
        for collider in &body.traits.colliders {
            if self.shapes.record_of(collider.shape).is_some() {
                continue;
            }
            let Some(shape) = world.shape(collider.shape) else { continue };
            let parts: Vec<_> = shape.parts().filter_map(|part| world.shape(part)).collect();
            for shape in parts.into_iter().chain([shape]) {
                self.shapes.add(shape)?;
            }
        }
        Ok(())
    }

    /// Returns a shape of a body on record, or of one that the program inserted.
    pub(in crate::world) fn shape(&self, world: &dyn Known, hash: ShapeHash) -> Option<ShapeRecord> {
        let own = self.shapes.record_of(hash).cloned();
        own.or_else(|| world.shape(hash))
    }
}
