//! Asks the server for avatars, and for their end, again and again until the outcome is known.

use super::{Client, ClientOutput};
use crate::cluster::Peer;
use crate::protocol::{
    BUILD_BYTES, BodyRecord, Costs, FromClient, Message, Refusal, ShapeRecord, encoded_len,
};
use crate::space::BodyId;

impl Client {
    /// Asks for an avatar. Nothing longer than a frame is read from a client without a node.
    pub(super) fn spawn(&mut self, body: BodyRecord, shapes: Vec<ShapeRecord>) {
        let id = body.id;
        let message = FromClient::Spawn { body, shapes };
        match self.node.is_some() || encoded_len(&message) <= BUILD_BYTES {
            true => self.want(message),
            false => {
                let reason = Refusal::Costly(Costs::Bytes);
                self.outputs.push_back(ClientOutput::Rejected { body: Some(id), reason });
            }
        }
    }

    /// Sends a message to the server. Everything that lasts goes there: the server's record outlives every
    /// leader.
    pub(super) fn ask_server(&mut self, message: FromClient) {
        self.send(Peer::Server, Message::FromClient(self.id, message));
    }

    /// Sends the leader a message, if there is a way to it.
    pub(super) fn tell_leader(&mut self, input: FromClient) {
        match &self.leader {
            Some(_) if self.node.is_some() => self.outputs.push_back(ClientOutput::Node(input)),
            Some(member) if self.linked => {
                let to = Peer::Node(member.node);
                self.send(to, Message::FromClient(self.id, input));
            }
            _ => {}
        }
    }

    /// Sends a request to the server, again until it is answered. While the world is told over a new link,
    /// the request is sent once the world has arrived.
    pub(super) fn want(&mut self, message: FromClient) {
        self.unanswered.push(message.clone());
        if !self.relinked {
            self.ask_server(message);
        }
    }

    /// Forgets the request about an avatar that this answers: the avatar is in the world or gone (no
    /// refusal), or the request was refused. Returns whether there was one.
    pub(super) fn answered(&mut self, id: BodyId, refusal: Option<Refusal>) -> bool {
        // Other refusals concern inputs, not a removal.
        let is_known = matches!(refusal, None | Some(Refusal::NotYours | Refusal::Unknown));
        let is_of = |message: &FromClient| match message {
            FromClient::Spawn { body, .. } => body.id == id,
            FromClient::Despawn(body) => *body == id && is_known,
            _ => false,
        };
        let at = self.unanswered.iter().position(is_of);
        at.map(|at| self.unanswered.remove(at)).is_some()
    }

    pub(super) fn has_asked_for(&self, id: BodyId) -> bool {
        self.unanswered
            .iter()
            .any(|message| matches!(message, FromClient::Spawn { body, .. } if body.id == id))
    }

    /// Sends unanswered requests again when the world has arrived, perhaps anew, unless it shows that they
    /// were done.
    pub(super) fn say_again(&mut self) {
        for message in std::mem::take(&mut self.unanswered) {
            let is_done = match &message {
                FromClient::Spawn { body, .. } => self.bodies.contains_key(&body.id),
                // An avatar that is asked for again is to be removed again.
                FromClient::Despawn(id) => !self.bodies.contains_key(id) && !self.has_asked_for(*id),
                _ => true,
            };
            match (is_done, &message) {
                (false, _) => self.want(message),
                (true, FromClient::Despawn(id)) => self.outputs.push_back(ClientOutput::Removed(*id)),
                _ => {}
            }
        }
    }
}
