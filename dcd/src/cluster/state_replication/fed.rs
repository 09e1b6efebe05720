//! Reads, at a relay, what its leader sends it. States refer to those before, so everything is read, in
//! order.

use std::collections::BTreeSet;

use tracing::warn;

use super::news::Latest;
use super::{MAX_TURNS, ReplicationEvent, StateReplication, TickNews};
use crate::delta::{FreeMotion, OrderedReceiver};
use crate::protocol::{CodecError, Message, SharedState, ToRelay, encoded_len};
use crate::space::{BodyId, ClientId, Tick};

/// The bytes that the relay may have read without telling the leader: a small part of what the leader waits
/// for.
const UNSAID: usize = 4 << 10;

/// The state of a relay's reading.
#[derive(Clone, Debug)]
pub(super) struct Fed {
    receiver: OrderedReceiver,
    /// The parts of a tick that have come so far.
    begun: Option<TickNews>,
    /// The number of the last news that were read.
    last: u64,
    /// The number of the last message that was read, and the bytes that were read and of which the leader has
    /// not heard.
    read: u64,
    unsaid: usize,
    /// Says whether something could not be read. Then nothing that follows can be, until the relay begins anew.
    is_lost: bool,
}

impl Fed {
    pub(super) fn new(motion: FreeMotion) -> Self {
        Self {
            receiver: OrderedReceiver::new(motion),
            begun: None,
            last: 0,
            read: 0,
            unsaid: 0,
            is_lost: false,
        }
    }

    /// Returns which component of a body's rotation the leader left out.
    pub(super) fn left_out(&self, id: BodyId) -> Option<u8> {
        self.receiver.left_out(id)
    }

    fn has_read(&mut self, number: u64, bytes: usize) {
        (self.read, self.unsaid) = (number, self.unsaid + bytes);
    }

    fn read(&mut self, message: ToRelay) -> Result<Vec<ReplicationEvent>, CodecError> {
        match message {
            ToRelay::Expect { .. } => Ok(Vec::new()),
            ToRelay::News(mut news) => {
                let bytes = encoded_len(&*news);
                if std::mem::replace(&mut self.last, news.number) != news.follows {
                    return Err(CodecError::Compact);
                }
                if news.clients.iter().any(|(_, turn)| turn.is_some_and(|turn| turn >= MAX_TURNS)) {
                    return Err(CodecError::Compact);
                }
                let turn = |(client, turn)| match turn {
                    Some(turn) => ReplicationEvent::Admit { client, turn, told_elsewhere: true, area: None },
                    None => ReplicationEvent::Dismiss(client),
                };
                let mut events: Vec<_> = std::mem::take(&mut news.clients).into_iter().map(turn).collect();
                news.gone.iter().for_each(|&id| self.receiver.forget(id));
                let states = self.receiver.read(news.tick, &news.states)?;
                let by_body = |(tick, state): (Tick, SharedState)| (state.id, (state, tick));
                let moved: Latest = states.into_iter().map(by_body).collect();
                let (number, is_whole) = (news.number, !news.more);
                match &mut self.begun {
                    Some(begun) => begun.extend(moved),
                    begun => *begun = Some(TickNews::of_relay(*news, moved)),
                }
                self.has_read(number, bytes);
                if is_whole {
                    events.extend(self.begun.take().map(ReplicationEvent::Tick));
                }
                Ok(events)
            }
            ToRelay::Guess { follows, .. } if follows != self.last => Err(CodecError::Compact),
            ToRelay::Guess { number, tick, states, .. } => {
                // The leader hears of it at once: it sends few guesses, and some may never be read.
                self.has_read(number, UNSAID + states.len());
                let states = self.receiver.read_guesses(tick, &states)?;
                Ok(vec![ReplicationEvent::Speculative { tick, states, silent: BTreeSet::new() }])
            }
        }
    }
}

impl StateReplication {
    /// Reads a message of the leader to its relay, and returns the events that follow. A relay that sends
    /// clients states less often than it reads messages reads all of them first, and handles several ticks as
    /// one.
    pub(crate) fn read(&mut self, message: ToRelay) -> Vec<ReplicationEvent> {
        let given: Vec<_> = match &message {
            ToRelay::News(news) => {
                news.clients.iter().filter(|(_, turn)| turn.is_some()).map(|(client, _)| *client).collect()
            }
            _ => Vec::new(),
        };
        if self.fed.is_lost {
            self.give_back(given);
            return Vec::new();
        }
        self.fed.read(message).unwrap_or_else(|error| {
            warn!(%error, "what the leader tells its relay cannot be read: the leader is to tell the clients itself");
            self.fed.is_lost = true;
            let told: Vec<_> = self.clients.keys().copied().collect();
            self.give_back(given.into_iter().chain(told.iter().copied()));
            told.into_iter().map(ReplicationEvent::Dismiss).collect()
        })
    }

    /// Gives clients back to the leader, as if their links were gone.
    fn give_back(&mut self, clients: impl IntoIterator<Item = ClientId>) {
        let Some(leader) = &self.introduction else { return };
        let (to, view) = (leader.node, self.view);
        let back = clients.into_iter().map(|client| (to, Message::Linked { view, client, up: false }));
        self.member_messages.extend(back);
    }

    /// Tells the leader what has been read, if that is some kilobytes.
    pub(super) fn acknowledge_feed(&mut self) {
        let Some(leader) = self.introduction.as_ref().filter(|_| self.fed.unsaid > UNSAID) else { return };
        self.fed.unsaid = 0;
        self.member_messages.push((leader.node, Message::Fed { view: self.view, number: self.fed.read }));
    }
}
