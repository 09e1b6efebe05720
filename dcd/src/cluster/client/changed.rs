//! Notes which bodies have changed at a client, so that a user who keeps a copy of them need not copy all.

use std::collections::BTreeSet;

use super::Client;
use crate::space::BodyId;

impl Client {
    /// Takes the set of bodies that are new, changed or gone since the last call; `None`: any may be.
    pub fn take_changed(&mut self) -> Option<BTreeSet<BodyId>> {
        self.changed.replace(BTreeSet::new())
    }

    /// Notes that a body is new, changed or gone. A list of more than half of all bodies would save nothing,
    /// and nobody may ever take it.
    pub(super) fn note_change(&mut self, id: BodyId) {
        if let Some(changed) = &mut self.changed {
            changed.insert(id);
            if changed.len() > self.bodies.len() / 2 {
                self.changed = None;
            }
        }
    }
}
