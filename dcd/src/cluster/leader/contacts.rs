//! Sends contacts to the clients whose avatars touch, and to the server's program.

use std::collections::{BTreeMap, BTreeSet};

use super::Leader;
use crate::protocol::{ContactForce, ContactKey, ToClient, ToServer, Touch, WorldEvents};
use crate::space::ClientId;

impl Leader {
    /// Sends contacts to the clients whose avatars touch, and to the server's program. A pair that two
    /// regions hold is seen by both: its contact begins with the first and ends with the last of them.
    pub(super) fn forward_contacts(&mut self) {
        let mut seen = WorldEvents::default();
        self.contacts.merge(std::mem::take(&mut self.events).values(), &mut seen);
        self.claim(&seen.touches);
        if self.events_to_server && !(seen.touches.is_empty() && seen.forces.is_empty()) {
            let (view, tick, events) = (self.view, self.tick, seen.clone());
            self.server_messages.push(ToServer::Contacts { view, tick, events });
        }
        let mut touches: BTreeMap<ClientId, Vec<Touch>> = BTreeMap::new();
        let mut forces: BTreeMap<ClientId, Vec<ContactForce>> = BTreeMap::new();
        for touch in seen.touches {
            for client in hosts(touch.key) {
                touches.entry(client).or_default().push(touch);
            }
        }
        for force in seen.forces {
            for client in hosts(force.key) {
                forces.entry(client).or_default().push(force);
            }
        }
        let concerned: BTreeSet<_> = touches.keys().chain(forces.keys()).copied().collect();
        for client in concerned.into_iter().filter(|client| self.clients.contains_key(client)) {
            let message = ToClient::Contacts {
                tick: self.tick,
                touches: touches.remove(&client).unwrap_or_default(),
                forces: forces.remove(&client).unwrap_or_default(),
            };
            self.messages.push((client, message));
        }
    }
}

/// Returns the clients whose avatars touch, each once.
fn hosts(key: ContactKey) -> BTreeSet<ClientId> {
    key.a.client().into_iter().chain(key.b.client()).collect()
}
