//! Welcomes clients, and tells each of them of the world.

use std::collections::BTreeSet;

use super::Server;
use super::common::{ClientEntry, NodeEntry};
use super::vicinity::Vicinity;
use crate::cluster::Peer;
use crate::protocol::{Area, Chunk, Farewell, Refusal, ToClient, chunks};
use crate::space::ClientId;

impl Server {
    /// Welcomes a client that greets, and replaces what was known of it.
    pub(super) fn welcome_client(&mut self, client: ClientId, interest: Option<Area>) {
        let is_sent_away = |entry: &NodeEntry| {
            entry.member.client == Some(client) && matches!(entry.unwanted, Some((Farewell::SentAway, _)))
        };
        // The client is told why over the link that it shares with its node, once that node has handed its
        // regions over.
        if self.common.nodes.values().any(is_sent_away) {
            self.common.stale += 1;
            return;
        }
        if !self.common.allowances.entry(client).or_default().welcome(self.common.now) {
            self.common.send_client(client, ToClient::Rejected { body: None, reason: Refusal::TooMany });
            self.common.close(Peer::Client(client), Farewell::Refused, Refusal::TooMany.to_string());
            return self.part(client);
        }
        let group = self.group_for(client);
        // Not linked yet: the client is told of the whole world below, and of no part of it before.
        let entry = ClientEntry { linked: false, absent_until: None, group, vicinity: None };
        let _ = self.common.clients.insert(client, entry);
        // First, so that the world that the client is told of has its avatars in it: new avatars must not
        // take their ids.
        self.bring_back(client);
        let Some(group) = self.groups.get(&group) else { return };
        let known = interest.map(|interest| Vicinity::joining(client, interest, &group.record));
        self.tell_world(client, known);
    }

    /// Tells a client of the world anew, in place of the one that it knew.
    pub(super) fn tell_world_again(&mut self, client: ClientId) {
        let Some(entry) = self.common.clients.get_mut(&client) else { return };
        let (group, vicinity) = (entry.group, entry.vicinity.take());
        entry.linked = false;
        let Some(group) = self.groups.get(&group) else { return };
        let known = vicinity.map(|vicinity| vicinity.again(client, &group.record));
        self.tell_world(client, known);
    }

    /// Tells a client of the world: of the `known` part, or of everything.
    pub(super) fn tell_world(&mut self, client: ClientId, known: Option<(Vicinity, Vec<Chunk>)>) {
        let Some(entry) = self.common.clients.get(&client) else { return };
        let Some(group) = self.groups.get(&entry.group) else { return };
        let record = &group.record;
        let (vicinity, parts) = match known {
            Some((vicinity, parts)) => (Some(vicinity), parts),
            None => {
                let mut parts = record.shape_chunks(&mut BTreeSet::new());
                let bodies = record.present().chain(record.returning(client)).cloned();
                parts.extend(chunks(bodies, Chunk::Bodies));
                parts.extend(record.joint_chunks(|_| true));
                (None, parts)
            }
        };
        let leader = group.leader_is();
        let world = self.common.config.world.clone();
        // Room for 2^28 inputs per stay, and for 2^16 stays per view.
        self.welcomes = (self.welcomes + 1) & 0xffff;
        if self.welcomes == 0 {
            self.common.number = self.common.number.next();
            self.common.world_changed = true;
        }
        let logical_time = self.common.number.0 << 44 | self.welcomes << 28;
        let next_built = self.next_built(client);
        let incarnation = self.common.config.incarnation;
        let welcome = ToClient::Welcome { id: client, logical_time, next_built, incarnation, world };
        self.common.send_client(client, welcome);
        for chunk in parts {
            self.common.send_client(client, ToClient::Chunk(chunk));
        }
        self.common.send_client(client, ToClient::WorldEnd);
        self.common.send_client(client, leader);
        if let Some(entry) = self.common.clients.get_mut(&client) {
            (entry.linked, entry.vicinity) = (true, vicinity);
        }
    }
}
