//! Keeps what a client knows of one body, and decides which states are newer.

use crate::protocol::{BodyRecord, Handover, SharedState};
use crate::space::{Epoch, RegionId, Tick};

/// A body as a client knows it.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyView {
    /// The body, with its latest state.
    pub body: BodyRecord,
    /// The tick of that state.
    pub tick: Tick,
    /// Says whether its state is of a speculative tick: a guess, until a state comes that is not.
    pub speculative: bool,
    /// Says whether it was outside the client's area of interest when it was last heard of, or has been since. It
    /// may then be elsewhere.
    pub outside: bool,
    /// The region that owned it when it was last heard of; `None` until its owner is heard of. Speculative
    /// states do not count.
    pub owner: Option<RegionId>,
    /// The epoch and tick of the newest state that is not speculative.
    pub(super) settled: (Epoch, Tick),
}

impl BodyView {
    pub(super) fn new(body: BodyRecord) -> Self {
        let settled = (body.epoch, Tick(0));
        Self { settled, body, tick: Tick(0), speculative: false, outside: false, owner: None }
    }

    /// Takes a state in, unless something newer is known. Returns whether it was news, and a change of owner.
    /// A speculative state never counts against one that is not.
    pub(super) fn learn(
        &mut self,
        state: &SharedState,
        tick: Tick,
        speculative: bool,
        outside: bool,
    ) -> (bool, Option<Handover>) {
        let is_news = match speculative {
            false => self.settled <= (state.epoch, tick),
            true => {
                self.settled.0 <= state.epoch
                    && self.settled.1 < tick
                    && !(self.speculative && tick < self.tick)
            }
        };
        if is_news {
            if !speculative {
                self.settled = (state.epoch, tick);
            }
            (self.speculative, self.tick) = (speculative, tick);
            self.body.epoch = state.epoch;
            self.body.state.pose = state.pose;
            self.body.state.velocity = state.velocity;
            self.body.state.sleeping = state.sleeping;
            self.outside = outside;
        }
        // A node that computes speculative ticks owns nothing of the others' bodies.
        let from = if is_news && !speculative { self.owner.replace(state.owner) } else { None };
        let from = from.filter(|from| *from != state.owner);
        (is_news, from.map(|from| Handover { body: state.id, from, to: state.owner }))
    }

    /// Returns the tick of the newest state that is not speculative.
    pub fn settled_tick(&self) -> Tick {
        self.settled.1
    }
}
