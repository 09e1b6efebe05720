//! Between groups (thesis 3.3.8): which one is believed about a body, and who is told what the others see.

use super::Server;
use crate::protocol::{SharedState, ViewNumber};
use crate::space::{BodyId, NodeId, Tick};

/// Which groups are believed about bodies that the main one is not believed about.
#[derive(Clone, Debug, Default)]
pub(super) struct Arbiter {}

impl Server {
    pub(super) fn abroad(
        &mut self,
        _node: NodeId,
        _view: ViewNumber,
        _tick: Tick,
        _states: Vec<SharedState>,
    ) {
    }

    pub(super) fn touched(&mut self, _node: NodeId, _view: ViewNumber, _bodies: Vec<(BodyId, u32)>) {}
}
