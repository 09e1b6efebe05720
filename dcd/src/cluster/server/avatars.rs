//! Avatars on record: they come with their client, wait while it is away, and return as they were (thesis 4.3.2.10).

use super::{Life, Server, ServerOutput};
use crate::cluster::Peer;
use crate::protocol::{BodyRecord, Drive, FromClient, Message, Refusal, ShapeRecord, ToClient, WorldOp};
use crate::space::{BodyId, ClientId, Epoch, Tick};

/// The most avatars of one client.
pub const MAX_AVATARS: usize = 1_024;

impl Server {
    pub(super) fn hear_client(&mut self, client: ClientId, message: FromClient) {
        let refused = match message {
            FromClient::Drive(drive) if drive.body.client() != Some(client) => {
                Some((drive.body, Refusal::NotYours))
            }
            FromClient::Drive(drive) => {
                self.pass_on(client, drive);
                None
            }
            FromClient::Spawn { body, shapes } => {
                let id = body.id;
                let refusal = if id.client() != Some(client) {
                    Some(Refusal::NotYours)
                } else if self.record.body(id).is_some() {
                    Some(Refusal::Exists)
                } else if self.record.avatars(client).len() >= MAX_AVATARS {
                    Some(Refusal::TooMany)
                } else if !self.record.knows_shapes_of(&body, &shapes) {
                    Some(Refusal::Shape)
                } else {
                    None
                };
                if refusal.is_none() {
                    let shapes = self.record.learn(shapes);
                    // A stranger's epoch counts for nothing: epochs are ours to give.
                    self.record.insert(BodyRecord { epoch: Epoch(0), ..body });
                    self.introduce(id, shapes);
                }
                refusal.map(|refusal| (id, refusal))
            }
            FromClient::Despawn(id) if id.client() != Some(client) => Some((id, Refusal::NotYours)),
            FromClient::Despawn(id) if self.record.body(id).is_none() => Some((id, Refusal::Unknown)),
            FromClient::Despawn(id) => {
                self.retire(id, false);
                None
            }
            FromClient::Leave => {
                self.part(client);
                None
            }
        };
        if let Some((body, reason)) = refused {
            self.send_client(client, ToClient::Rejected { body: Some(body), reason });
        }
    }

    /// A client that knows no leader, or whose node is still joining, speaks through the server.
    fn pass_on(&mut self, client: ClientId, drive: Drive) {
        match (&self.view, &self.change) {
            (Some(view), None) => {
                let to = Peer::Node(view.leader);
                let message = Message::FromClient(client, FromClient::Drive(drive));
                self.outputs.push_back(ServerOutput::Send { to, message });
            }
            // Nobody computes the world: the record is all there is to move.
            (None, _) => {
                if let Some(body) = self.record.body_mut(drive.body) {
                    body.state.velocity = drive.velocity;
                    body.state.pose = drive.pose.unwrap_or(body.state.pose);
                }
            }
            // The next wish will find a leader.
            (Some(_), Some(_)) => self.stale += 1,
        }
    }

    /// A client is gone; its avatars wait.
    pub(super) fn part(&mut self, client: ClientId) {
        if self.clients.remove(&client) {
            for (id, _) in self.record.avatars(client) {
                self.retire(id, true);
            }
        }
    }

    /// A client is here; its avatars return.
    pub(super) fn bring_back(&mut self, client: ClientId) {
        for (id, life) in self.record.avatars(client) {
            match life {
                Life::Parked => self.revive(id),
                Life::Removing { park: true, .. } => {
                    self.record.set_life(id, Life::Removing { park: true, back: true });
                }
                _ => {}
            }
        }
    }

    /// The owner has removed a body.
    pub(super) fn removed(&mut self, tick: Tick, body: BodyRecord) {
        let id = body.id;
        if let Some(Life::Removing { park, back }) = self.record.life(id) {
            self.record.freshen(tick, body);
            self.rest(id, park, back);
        }
    }

    /// A body that no node holds any more is parked, brought back or forgotten.
    pub(super) fn rest(&mut self, id: BodyId, park: bool, back: bool) {
        match (park, back) {
            (false, _) => self.record.remove(id),
            (true, false) => self.record.set_life(id, Life::Parked),
            (true, true) => self.revive(id),
        }
    }

    fn revive(&mut self, id: BodyId) {
        self.record.renew(id, None, self.tick);
        self.record.set_life(id, Life::Waiting);
        self.introduce(id, Vec::new());
    }

    /// Tells clients and nodes of a waiting body.
    fn introduce(&mut self, id: BodyId, shapes: Vec<ShapeRecord>) {
        let Some(body) = self.record.body(id).cloned() else { return };
        self.send_clients(ToClient::Inserted { body: body.clone(), shapes: shapes.clone() });
        if self.view.is_some() && self.change.is_none() {
            self.record.set_life(id, Life::Live);
            self.arriving.insert(id);
            self.apply(vec![WorldOp::Insert { body, shapes, joints: Vec::new() }]);
        }
    }

    /// Takes a body out of the world, for good or until its client returns.
    fn retire(&mut self, id: BodyId, park: bool) {
        match self.record.life(id) {
            Some(Life::Live) if self.view.is_some() => {
                self.record.set_life(id, Life::Removing { park, back: false });
                self.apply(vec![WorldOp::Remove(id)]);
            }
            Some(Life::Removing { park: parking, .. }) => {
                self.record.set_life(id, Life::Removing { park: parking && park, back: false });
            }
            Some(Life::Parked) if park => return,
            // Nobody computes it: its life ends, or rests, on record alone.
            Some(Life::Live | Life::Waiting | Life::Parked) => self.rest(id, park, false),
            None => return,
        }
        self.send_clients(ToClient::Removed(id));
    }
}
