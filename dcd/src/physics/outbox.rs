//! Collects the messages that one region sends to others in one exchange. Most regions send nothing to most others, so only
//! messages in use are kept.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::protocol::BorderMessage;
use crate::space::{RegionId, Tick};

/// The messages of one region: one to each region that it has something to send to.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Outbox {
    from: RegionId,
    /// All regions by rank.
    leaves: Arc<[RegionId]>,
    tick: Tick,
    /// The messages by rank of the receiver; the empty ones are kept for their memory.
    messages: Vec<(usize, BorderMessage)>,
}

impl Outbox {
    pub(super) fn new(from: RegionId, leaves: Arc<[RegionId]>) -> Self {
        Self { from, leaves, ..Self::default() }
    }

    /// Begins a new exchange, with empty messages.
    pub(super) fn clear(&mut self, tick: Tick) {
        self.tick = tick;
        for (_, message) in &mut self.messages {
            message.clear();
            message.tick = tick;
        }
    }

    /// Returns the message to the region of this rank; begins it if there is none.
    pub(super) fn to(&mut self, rank: usize) -> &mut BorderMessage {
        let place = self.messages.partition_point(|(other, _)| *other < rank);
        if self.messages.get(place).is_none_or(|(other, _)| *other != rank) {
            let to = self.leaves[rank];
            let message = BorderMessage { from: self.from, to, tick: self.tick, ..BorderMessage::default() };
            self.messages.insert(place, (rank, message));
        }
        &mut self.messages[place].1
    }

    /// Returns the messages that are not empty, with the ranks of their receivers.
    pub(super) fn letters(&self) -> impl Iterator<Item = (usize, &BorderMessage)> {
        self.messages
            .iter()
            .filter(|(_, message)| !message.is_empty())
            .map(|(rank, message)| (*rank, message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::BodyId;

    #[test]
    fn only_what_is_said_is_sent_and_each_exchange_begins_anew() {
        let leaves: Arc<[_]> = (0..9).map(RegionId).collect();
        let mut outbox = Outbox::new(RegionId(2), leaves);
        outbox.clear(Tick(4));
        outbox.to(7).drops.push(BodyId::persistent(1));
        outbox.to(3).wakes.push(BodyId::persistent(1));
        outbox.to(5);
        let sent = |outbox: &Outbox| {
            outbox.letters().map(|(rank, message)| (rank, message.to, message.tick)).collect::<Vec<_>>()
        };
        assert_eq!(sent(&outbox), [(3, RegionId(3), Tick(4)), (7, RegionId(7), Tick(4))]);
        outbox.clear(Tick(5));
        assert!(sent(&outbox).is_empty());
    }
}
