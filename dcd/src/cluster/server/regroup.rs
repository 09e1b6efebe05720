//! Who is in which group: at the start by delay, later by joining, votes, and by who cannot reach whom (thesis 3.3.7–3.3.9).

use std::time::Duration;

use super::group::Group;
use super::{Server, ServerOutput};
use crate::protocol::{Motion, ToClient};
use crate::space::{ClientId, GroupId, NodeId};

impl Server {
    /// Gives nodes without a group one.
    pub(super) fn assign(&mut self) {
        if !self.common.begun && !self.common.may_begin() {
            return;
        }
        let homeless = self.common.nodes.iter().filter(|(_, entry)| entry.loaded && entry.group.is_none());
        for node in homeless.map(|(&node, _)| node).collect::<Vec<_>>() {
            self.put(node, self.main);
        }
    }

    /// A node that others cannot reach computes the world alone.
    pub(super) fn begin_apart(&mut self, node: NodeId) {
        let id = self.new_group();
        self.put(node, id);
    }

    /// A group without members.
    fn new_group(&mut self) -> GroupId {
        self.last_group.0 += 1;
        self.common.world_changed = true;
        let (id, main) = (self.last_group, self.main());
        let group = Group::new(id, main.record.copied(false), main.tick);
        self.groups.insert(id, group);
        id
    }

    fn put(&mut self, node: NodeId, group: GroupId) {
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            entry.group = Some(group);
            entry.in_group_since = self.common.now;
        }
    }

    /// Groups that nobody is in, or is to be in, are no more; the largest of the others becomes the main one if need be.
    pub(super) fn tidy(&mut self) {
        let is_empty = |group: &Group| {
            group.change.is_none()
                && (group.view.is_none() || group.held && group.serving(&self.common).is_empty())
                && !self.common.nodes.values().any(|entry| entry.group == Some(group.id))
        };
        let lives = |group: &Group| group.view.is_some() && !group.held;
        let empty: Vec<_> =
            self.groups.values().filter(|group| is_empty(group)).map(|group| group.id).collect();
        for id in empty {
            if id == self.main {
                let size = |group: &Group| group.view.as_ref().map_or(0, |view| view.members.len());
                let heirs = self.groups.values().filter(|group| group.id != id && lives(group));
                let heir = heirs.max_by_key(|group| (size(group), std::cmp::Reverse(group.id)));
                let Some(heir) = heir.map(|group| group.id) else { continue };
                self.main = heir;
                self.common.world_changed = true;
                self.main_mut().record.mark_all();
            }
            self.groups.remove(&id);
            self.common.groups_changed.insert(id);
            self.common.outputs.push_back(ServerOutput::Dissolved(id));
        }
        self.settle_clients();
    }

    /// The group that a client is to play with: that of its own node, the one it has, or the main one.
    pub(super) fn group_for(&self, client: ClientId) -> GroupId {
        let own = self.common.nodes.iter().find(|(_, entry)| entry.member.client == Some(client));
        let own = own.and_then(|(&node, _)| self.group_of(node));
        let present = self.common.clients.get(&client).map(|entry| entry.group);
        own.or(present.filter(|group| self.groups.contains_key(group))).unwrap_or(self.main)
    }

    fn settle_clients(&mut self) {
        for client in self.common.clients.keys().copied().collect::<Vec<_>>() {
            let group = self.group_for(client);
            let Some(entry) = self.common.clients.get_mut(&client) else { continue };
            if entry.group != group {
                entry.group = group;
                if entry.linked {
                    let leader: ToClient = self.groups[&group].leader_is();
                    self.common.send_client(client, leader);
                }
            }
        }
    }

    pub(super) fn regrouping_at(&self) -> Option<Duration> {
        None
    }

    pub(super) fn handle_regrouping(&mut self) {}

    pub(super) fn call(&mut self, _node: NodeId, _motion: Motion) {}

    pub(super) fn cast(&mut self, _node: NodeId, _poll: u64, _delay_ms: Option<f32>) {}
}
