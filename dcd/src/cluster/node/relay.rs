//! Tells some of the leader's clients the states of bodies in its place (a relay), by the same replication as
//! a leader's, which the leader feeds. All else goes on between the leader and its clients.

use std::collections::BTreeSet;
use std::time::Duration;

use super::Node;
use crate::cluster::leader::Leader;
use crate::cluster::state_replication::Replication;
use crate::cluster::{Peer, ReplicationEvent, StateReplication};
use crate::protocol::{Heard, Message, ToRelay, ViewNumber};
use crate::space::{ClientId, NodeId};

/// The state of a node as a relay. It lasts as long as the view.
#[derive(Clone, Debug, Default)]
pub(super) struct Relay {
    /// The clients of whose links' beginnings and ends the leader wants to hear.
    expected: BTreeSet<ClientId>,
    /// The clients that the relay tells.
    told: BTreeSet<ClientId>,
    /// The replication, once the relay is to tell clients. If it runs elsewhere, its events go with those of
    /// a leader.
    replication: Option<Replication>,
}

impl Relay {
    /// Counts clients that are told here from now on (those with a turn), or no more.
    fn count(&mut self, clients: &[(ClientId, Option<u32>)]) {
        for (client, turn) in clients {
            match turn {
                Some(_) => self.told.insert(*client),
                None => self.told.remove(client),
            };
        }
    }
}

impl Node {
    /// Takes in a message of the leader to its relay.
    pub(super) fn hear_as_relay(&mut self, now: Duration, from: NodeId, message: ToRelay) {
        let (view, begins) = match &message {
            ToRelay::Expect { view, .. } | ToRelay::Guess { view, .. } => (*view, false),
            ToRelay::News(news) => (news.view, news.begins),
        };
        if !self.is_led_by(from, view) {
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
            message => {
                if begins {
                    self.begin_relaying(now);
                }
                if let ToRelay::News(news) = &message {
                    self.relay.count(&news.clients);
                }
                self.relay_event(ReplicationEvent::ByLeader(message));
            }
        }
    }

    fn is_led_by(&self, node: NodeId, number: ViewNumber) -> bool {
        let present = self.view.as_ref().filter(|view| view.number == number);
        present.is_some_and(|view| view.leader == node && node != self.config.id)
    }

    fn begin_relaying(&mut self, now: Duration) {
        let (Some(view), Some(world)) = (&self.view, &self.world) else { return };
        let new = StateReplication::new(now, view, world, &Default::default());
        let mut replication = Replication::Here(Box::new(new));
        if let Some(events) = &mut self.replication {
            replication = replication.moved_elsewhere();
            events.extend(replication.take_events());
        }
        self.relay.replication = Some(replication);
        self.relay.told.clear();
    }

    /// Returns how many clients this node tells of the world, and how many relays tell in its place while it
    /// leads.
    pub fn clients_told(&self) -> (usize, usize) {
        self.leader.as_ref().map_or((self.relay.told.len(), 0), Leader::clients_told)
    }

    /// Gives the relay's replication an event, and sends what follows from it.
    fn relay_event(&mut self, event: ReplicationEvent) {
        let Some(replication) = &mut self.relay.replication else { return };
        let (messages, for_leader) = replication.handle(event);
        if let Some(events) = &mut self.replication {
            events.extend(replication.take_events());
        }
        for (client, message) in messages {
            let to = Peer::Client(client);
            if self.links.contains(&to) {
                self.send(to, Message::ToClient(client, message));
            }
        }
        for (leader, message) in for_leader {
            self.send(Peer::Node(leader), message);
        }
    }

    /// Takes in what a client of the relay has acknowledged.
    pub(super) fn heard_as_relay(&mut self, client: ClientId, heard: Heard) {
        let now = self.tick;
        self.relay_event(ReplicationEvent::Heard { client, heard, now });
    }

    /// Tells the leader that a client's link is there or gone, if the leader expects to hear of it.
    pub(super) fn tell_of_link(&mut self, client: ClientId, up: bool) {
        if !self.relay.expected.contains(&client) {
            return;
        }
        let Some(view) = &self.view else { return };
        let (to, view) = (Peer::Node(view.leader), view.number);
        self.send(to, Message::Linked { view, client, up });
    }

    /// Ends the relay, since the view ends.
    pub(super) fn end_relaying(&mut self) {
        if std::mem::take(&mut self.relay).replication.is_some()
            && let Some(events) = &mut self.replication
        {
            events.push(ReplicationEvent::End);
        }
    }
}
