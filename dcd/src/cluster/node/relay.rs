//! Tells some of the leader's clients the states of bodies in its place (a relay): by the same replication as a leader has, which the leader
//! feeds. All else goes on between the leader and its clients.

use std::collections::BTreeSet;
use std::time::Duration;

use super::Node;
use crate::cluster::leader::Leader;
use crate::cluster::state_replication::Replication;
use crate::cluster::{Peer, ReplicationEvent, StateReplication, TickNews};
use crate::protocol::{Heard, Message, RelayNews, ToRelay};
use crate::space::{ClientId, NodeId};

/// What a node does as a relay. It lasts as long as the view.
#[derive(Clone, Debug, Default)]
pub(super) struct Relay {
    /// Clients that the leader wants to hear of when their links begin and end.
    expected: BTreeSet<ClientId>,
    /// Clients that it tells.
    told: BTreeSet<ClientId>,
    /// While it tells clients; if that is done elsewhere, without events: those go with a leader's.
    replication: Option<Replication>,
    /// The parts of a tick that have come so far.
    begun: Option<TickNews>,
}

impl Node {
    /// Takes in what the leader says to it as a relay.
    pub(super) fn hear_as_relay(&mut self, now: Duration, from: NodeId, message: ToRelay) {
        let (ToRelay::Expect { view, .. } | ToRelay::Guess { view, .. }) = &message else {
            let ToRelay::News(news) = message else { unreachable!("it is one of three") };
            return match self.is_led_by(from, news.view) {
                true => self.hear_news(now, *news),
                false => self.counters.stale += 1,
            };
        };
        if !self.is_led_by(from, *view) {
            self.counters.stale += 1;
            return;
        }
        match message {
            ToRelay::Expect { clients, .. } => {
                for client in clients {
                    self.relay.expected.insert(client);
                    if self.links.contains(&Peer::Client(client)) {
                        self.tell_of_link(client, true);
                    }
                }
            }
            ToRelay::Guess { tick, states, .. } => {
                let silent = BTreeSet::new();
                self.relay_event(ReplicationEvent::Speculative { tick, states, silent });
            }
            ToRelay::News(_) => unreachable!("taken care of above"),
        }
    }

    fn is_led_by(&self, node: NodeId, number: crate::protocol::ViewNumber) -> bool {
        let present = self.view.as_ref().filter(|view| view.number == number);
        present.is_some_and(|view| view.leader == node && node != self.config.id)
    }

    fn hear_news(&mut self, now: Duration, mut news: RelayNews) {
        if news.begins {
            self.begin_relaying(now);
        }
        for (client, turn) in std::mem::take(&mut news.clients) {
            match turn {
                Some(_) => self.relay.told.insert(client),
                None => self.relay.told.remove(&client),
            };
            self.relay_event(match turn {
                Some(turn) => ReplicationEvent::Admit { client, turn, told_elsewhere: true, area: None },
                None => ReplicationEvent::Dismiss(client),
            });
        }
        let more = news.more;
        match &mut self.relay.begun {
            Some(begun) => begun.extend(news.states),
            begun => *begun = Some(TickNews::of_relay(news)),
        }
        if !more && let Some(tick) = self.relay.begun.take() {
            self.relay_event(ReplicationEvent::Tick(tick));
        }
    }

    fn begin_relaying(&mut self, now: Duration) {
        let (Some(view), Some(world)) = (&self.view, &self.world) else { return };
        let new = StateReplication::new(now, view, world, &Default::default());
        let mut replication = Replication::Here(Box::new(new));
        if let Some(events) = &mut self.replication {
            replication = replication.moved_elsewhere();
            events.extend(replication.take_events());
        }
        (self.relay.replication, self.relay.begun) = (Some(replication), None);
        self.relay.told.clear();
    }

    /// Returns how many clients this node tells of the world, and how many others tell in its place while it leads.
    pub fn clients_told(&self) -> (usize, usize) {
        self.leader.as_ref().map_or((self.relay.told.len(), 0), Leader::clients_told)
    }

    /// Gives its replication an event, and sends what follows from it.
    fn relay_event(&mut self, event: ReplicationEvent) {
        let Some(replication) = &mut self.relay.replication else { return };
        let (messages, _) = replication.handle(event);
        if let Some(events) = &mut self.replication {
            events.extend(replication.take_events());
        }
        for (client, message) in messages {
            let to = Peer::Client(client);
            if self.links.contains(&to) {
                self.send(to, Message::ToClient(client, message));
            }
        }
    }

    /// Takes in what a client of its own has acknowledged.
    pub(super) fn heard_as_relay(&mut self, client: ClientId, heard: Heard) {
        let now = self.tick;
        self.relay_event(ReplicationEvent::Heard { client, heard, now });
    }

    /// Tells the leader that a client's link is there, or gone, if it expects to hear of it.
    pub(super) fn tell_of_link(&mut self, client: ClientId, up: bool) {
        if !self.relay.expected.contains(&client) {
            return;
        }
        let Some(view) = &self.view else { return };
        let (to, view) = (Peer::Node(view.leader), view.number);
        self.send(to, Message::Linked { view, client, up });
    }

    /// Tells no clients any more: the view ends.
    pub(super) fn end_relaying(&mut self) {
        if std::mem::take(&mut self.relay).replication.is_some()
            && let Some(events) = &mut self.replication
        {
            events.push(ReplicationEvent::End);
        }
    }
}
