//! Notes which bodies a client knows otherwise than before, so that who keeps a copy of them need not copy all.

use std::collections::BTreeSet;

use super::Client;
use crate::space::BodyId;

impl Client {
    /// Takes which bodies are new, otherwise, or gone since this was called last; `None`: any may be.
    pub fn take_changed(&mut self) -> Option<BTreeSet<BodyId>> {
        self.changed.replace(BTreeSet::new())
    }

    /// Notes that a body is new, otherwise, or gone. Of more than half of all bodies a list saves nothing; and nobody may ever take it.
    pub(super) fn note_change(&mut self, id: BodyId) {
        if let Some(changed) = &mut self.changed {
            changed.insert(id);
            if changed.len() > self.bodies.len() / 2 {
                self.changed = None;
            }
        }
    }
}
