//! Routes messages between clients, leader and server through a node.

use super::{Node, NodeOutput};
use crate::cluster::{Leader, Peer, ReplicationEvent};
use crate::protocol::{FromClient, Message, ToClient, WorldOp};
use crate::space::{BodyId, ClientId};

/// The most messages kept from clients that hear of their new leader before it does.
const EARLY_INPUTS: usize = 1_024;
/// The most of these messages that are kept from one node that is no member yet.
const EARLY_OF_ONE: usize = 256;

impl Node {
    /// Passes on a message of the client in this process. While this node leads, it is the leader that takes
    /// it in.
    pub(super) fn own_client(&mut self, message: FromClient) {
        let Some(client) = self.config.client else { return };
        match &message {
            FromClient::Input(input) => self.speculation.steer(*input),
            FromClient::Interest(_) => self.interest = Some(message.clone()),
            _ => {}
        }
        let leader = self.view.as_ref().map(|view| view.leader);
        match leader {
            Some(leader) if leader == self.config.id => self.lead_client(client, message),
            Some(leader) => self.send(Peer::Node(leader), Message::FromClient(client, message)),
            // The leader to come will be sent it.
            None if matches!(message, FromClient::Interest(_) | FromClient::Heard(_)) => {}
            None => self.send(Peer::Server, Message::FromClient(client, message)),
        }
    }

    /// Sends the interest of the client in this process again: it may have been lost with the link to the
    /// leader.
    pub(super) fn repeat_interest(&mut self) {
        if let Some(message) = self.interest.clone() {
            self.own_client(message);
        }
    }

    /// Takes in a client's message, over its own link or over that of the node in its process.
    pub(super) fn hear_client(&mut self, from: Peer, client: ClientId, message: FromClient) {
        let speaks_for = match from {
            Peer::Client(linked) => linked == client,
            Peer::Node(node) => self.view.as_ref().is_some_and(|view| {
                view.members.iter().any(|member| member.node == node && member.client == Some(client))
            }),
            Peer::Server => true,
        };
        let changes = self.view.is_none() || self.change.is_some();
        let early = &self.early_words;
        let has_room = |node| {
            let of_it = early.iter().filter(|(of, ..)| *of == node).count();
            early.len() < EARLY_INPUTS && of_it < EARLY_OF_ONE
        };
        match from {
            _ if !is_for_leader(&message) => self.counters.refused += 1,
            _ if speaks_for => self.lead_client(client, message),
            // The node may be a member of the coming view, which has begun there.
            Peer::Node(node) if changes && has_room(node) => self.early_words.push((node, client, message)),
            _ => self.counters.refused += 1,
        }
    }

    fn lead_client(&mut self, client: ClientId, message: FromClient) {
        match (&mut self.leader, message) {
            (Some(leader), FromClient::Input(input)) => {
                if let Err(reason) = leader.accept_input(client, input) {
                    self.tell_client(client, ToClient::Rejected { body: Some(input.body), reason });
                }
            }
            (Some(leader), FromClient::Interest(area)) => leader.take_interest(client, area),
            (Some(leader), FromClient::Ask(question)) => leader.ask(client, question),
            (Some(leader), FromClient::Heard(heard)) => leader.heard(client, heard),
            (Some(leader), FromClient::Untold) => leader.untold(client),
            // This acknowledges what this node told it as a relay, or what another leader told it.
            (None, FromClient::Heard(heard)) => self.heard_as_relay(client, heard),
            (None, FromClient::Untold) => {}
            // The client may hear of its new leader before the leader does.
            (None, message) if self.inputs.len() < EARLY_INPUTS => self.inputs.push((client, message)),
            (None, _) => self.counters.overflow += 1,
            (Some(_), _) => self.counters.refused += 1,
        }
    }

    /// Notes the inputs that a tick does. Whoever made them may send them again to the next leader.
    pub(super) fn note_inputs(&mut self, ops: &[WorldOp]) {
        for op in ops {
            match op {
                WorldOp::Input(input) if input.logical_time > 0 => {
                    let newest = self.done_inputs.entry(input.slot()).or_default();
                    *newest = input.logical_time.max(*newest);
                }
                WorldOp::Remove(id) => self.forget_inputs(*id),
                _ => {}
            }
        }
    }

    /// Tells the leader of a view that begins, if it is here, which inputs are done. Inputs of the dropped
    /// bodies are forgotten.
    pub(super) fn hand_inputs_on(&mut self, dropped: &[BodyId]) {
        dropped.iter().for_each(|&id| self.forget_inputs(id));
        if let Some(leader) = &mut self.leader {
            leader.pass_over(self.done_inputs.clone());
        }
    }

    fn forget_inputs(&mut self, id: BodyId) {
        [false, true].into_iter().for_each(|kind| _ = self.done_inputs.remove(&(id, kind)));
    }

    /// Handles, once a view has begun and if this node leads it, what clients sent in advance.
    pub(super) fn grant_early_inputs(&mut self) {
        for (client, message) in std::mem::take(&mut self.inputs) {
            if self.leader.is_some() {
                self.lead_client(client, message);
            }
        }
        for (node, client, message) in std::mem::take(&mut self.early_words) {
            if self.leader.is_some() {
                self.hear_client(Peer::Node(node), client, message);
            }
        }
    }

    /// Tells the client in this process who leads the view that has begun, or to whom the link is back, so
    /// that it sends again what may be lost. The client may have heard so from the server before, and have
    /// sent its inputs again to the leader of the last view.
    pub(super) fn tell_own_client(&mut self) {
        let Some(view) = self.view.as_ref().filter(|_| self.config.client.is_some()) else { return };
        let message = ToClient::LeaderIs {
            group: view.group,
            view: view.number,
            leader: view.led_by().cloned(),
            tree: Some(view.tree.clone()),
            allocation: view.allocation.clone(),
        };
        self.outputs.push_back(NodeOutput::Client(message));
    }

    /// Sends the leader's messages to clients, members and the server.
    pub(super) fn flush_leader(&mut self) {
        let messages = self.leader.as_mut().map(|leader| leader.take_messages()).unwrap_or_default();
        for (client, message) in messages {
            self.tell_client(client, message);
        }
        let for_members =
            self.leader.as_mut().map(|leader| leader.take_member_messages()).unwrap_or_default();
        for (node, message) in for_members {
            self.send(Peer::Node(node), message);
        }
        let for_server = self.leader.as_mut().map(|leader| leader.take_server_messages()).unwrap_or_default();
        for message in for_server {
            self.send_server(message);
        }
        if let (Some(events), Some(leader)) = (&mut self.replication, &mut self.leader) {
            events.extend(leader.take_replication_events());
        }
    }

    /// Ends this node's leading. Returns the leader that it was, if it was one.
    pub(super) fn end_leading(&mut self) -> Option<Leader> {
        let leader = self.leader.take();
        if let (Some(events), Some(_)) = (&mut self.replication, &leader) {
            events.push(ReplicationEvent::End);
        }
        leader
    }

    fn tell_client(&mut self, client: ClientId, message: ToClient) {
        if matches!(message, ToClient::Rejected { .. }) {
            self.counters.rejected += 1;
        }
        let Some(route) = self.leader.as_ref().and_then(|leader| leader.route(client)) else { return };
        match (route, message) {
            (Peer::Node(node), message) if node == self.config.id => {
                self.outputs.push_back(NodeOutput::Client(message));
            }
            (route, message) => self.send(route, Message::ToClient(client, message)),
        }
    }
}

/// Returns whether a client sends this to its leader. No such message is longer than a client's frame. What
/// lasts may be longer, and goes to the server, which puts it on record before it happens.
fn is_for_leader(message: &FromClient) -> bool {
    use FromClient::{Ask, Heard, Input, Interest, Untold};
    matches!(message, Input(_) | Interest(_) | Ask(_) | Heard(_) | Untold)
}
