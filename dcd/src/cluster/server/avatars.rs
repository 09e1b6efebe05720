//! Keeps avatars on record. They come with their client, are parked while it is away, and return as they were
//! (thesis 4.3.2.10). Every group has its own record of them.

use super::builders::are_used;
use super::common::Common;
use super::group::Group;
use super::{Server, ServerOutput, budget};
use crate::cluster::avatar_limits::AvatarLimits;
use crate::cluster::{Key, Life, Peer};
use crate::protocol::{
    BodyRecord, BodyState, Drive, FromClient, Gait, Input, Message, Refusal, ShapeRecord, ToClient, WorldOp,
};
use crate::space::{BodyId, ClientId, Epoch, Tick};

/// The most avatars of one client.
pub const MAX_AVATARS: usize = 1_024;
/// The most bytes of shapes new to the world that one client brings with avatars. It counts over all visits
/// of the client while a server runs, until shapes are forgotten. As many bytes may come at once, and as many
/// per minute, since all clients are told of the shapes. Each shape counts 256 bytes more than its record
/// has.
pub const MAX_SHAPE_BYTES: usize = 1 << 20;
/// The most bodies whose user data is remembered once they are gone.
const DEPARTED: usize = 65_536;

impl Server {
    pub(super) fn hear_client(&mut self, client: ClientId, message: FromClient) {
        let limits = AvatarLimits::of(&self.common.config.world);
        let record = &self.groups[&self.main].record;
        let refused = match message {
            FromClient::Input(input) if input.body.client() != Some(client) => {
                Some((input.body, Refusal::NotYours))
            }
            FromClient::Input(input) => match limits.allow(&input.velocity) {
                Ok(()) => {
                    self.pass_on(client, input);
                    None
                }
                Err(refusal) => Some((input.body, refusal)),
            },
            FromClient::Spawn { body, shapes } => {
                let id = body.id;
                let allowance = self.common.allowances.entry(client).or_default();
                let unknown = record.unknown(&shapes);
                let refusal = if id.client() != Some(client) {
                    Some(Refusal::NotYours)
                } else if record.body(id).is_some() {
                    Some(Refusal::Exists)
                } else if record.avatars(client).len() >= MAX_AVATARS
                    || allowance.shapes.bytes_with(&unknown) > MAX_SHAPE_BYTES
                    || !allowance.spawn(self.common.now)
                {
                    Some(Refusal::TooMany)
                } else if let Err(refusal) = limits.allow(&body.state.velocity) {
                    Some(refusal)
                } else if body.traits.vehicle.as_ref().is_some_and(|vehicle| !limits.allow_vehicle(vehicle)) {
                    Some(Refusal::TooFast)
                } else if !are_used(&shapes, std::slice::from_ref(&body), record.shapes_with(&shapes))
                    || !record.admits(&body, &shapes, self.common.config.can_build)
                {
                    Some(Refusal::Shape)
                } else {
                    let refusal = budget::refusal(record, client, &body, &shapes);
                    let mut is_too_soon = || !allowance.bring(self.common.now, &unknown);
                    refusal.or_else(|| is_too_soon().then_some(Refusal::TooMany))
                };
                if refusal.is_none() {
                    allowance.shapes.add(&unknown);
                    for group in self.groups.values_mut() {
                        let shapes = group.record.learn(shapes.clone());
                        self.common.fading.have_come(&shapes);
                        // The server gives epochs, clients push nothing, a character wants its velocity, and
                        // nobody has found contacts of a new body.
                        let wanted = body.state.velocity.linear;
                        let gait = body.traits.character.map(|_| Gait { wanted, ..Gait::default() });
                        let drive = body.traits.vehicle.as_ref().map(|_| Drive::default());
                        let state = BodyState {
                            force: [0.0; 3],
                            torque: [0.0; 3],
                            gait,
                            drive,
                            contact_offset: None,
                            ..body.state
                        };
                        group.record.insert(BodyRecord { epoch: Epoch(0), state, ..body.clone() });
                        group.introduce(&mut self.common, id, shapes);
                    }
                }
                refusal.map(|refusal| (id, refusal))
            }
            FromClient::Despawn(id) if id.client() != Some(client) => Some((id, Refusal::NotYours)),
            FromClient::Despawn(id) if record.body(id).is_none() => Some((id, Refusal::Unknown)),
            FromClient::Despawn(id) => {
                for group in self.groups.values_mut() {
                    group.retire(&mut self.common, id, false);
                }
                None
            }
            FromClient::Leave => {
                self.part(client);
                None
            }
            FromClient::Introduce(ids) => {
                self.introduce(client, ids);
                None
            }
            FromClient::Interest(area) => {
                if let Some(reason) = self.widen(client, area) {
                    self.common.send_client(client, ToClient::Rejected { body: None, reason });
                }
                None
            }
            // The first three come from a participant without a leader. It sends its question again to the
            // next leader, and has something else to acknowledge by then. `Server::hear_builder` handles what
            // is built.
            FromClient::Ask(_) | FromClient::Heard(_) | FromClient::Untold | FromClient::Build { .. } => None,
        };
        if let Some((body, reason)) = refused {
            self.common.send_client(client, ToClient::Rejected { body: Some(body), reason });
        }
    }

    /// Passes on to the leader the input of a client that knows no leader, or whose node is still joining.
    fn pass_on(&mut self, client: ClientId, input: Input) {
        let group = self.common.clients.get(&client).map_or(self.main, |entry| entry.group);
        let Some(group) = self.groups.get_mut(&group) else { return };
        match (&group.view, &group.change) {
            (Some(view), None) => {
                let to = Peer::Node(view.leader);
                let message = Message::FromClient(client, FromClient::Input(input));
                self.common.outputs.push_back(ServerOutput::Send { to, message });
            }
            // Nobody computes the world, so only the record can be moved. A jump waits for a leader, which
            // knows how far it may go: the client sends its newest input again to the next leader.
            (None, _) => {
                if let Some(body) = group.record.body_mut(input.body) {
                    body.obey(&input);
                }
            }
            // The next input will find a leader.
            (Some(_), Some(_)) => self.common.stale += 1,
        }
    }

    /// Removes a client that is gone, and parks its avatars.
    pub(super) fn part(&mut self, client: ClientId) {
        if self.common.clients.remove(&client).is_some() {
            self.gone.push_back((self.common.now.saturating_add(self.common.config.avatar_expiry), client));
            for group in self.groups.values_mut() {
                for (id, _) in group.record.avatars(client) {
                    group.retire(&mut self.common, id, true);
                }
            }
        }
    }

    /// Forgets the avatars of clients that have been gone for too long. Called with every event and without a
    /// timer, as nobody waits for it.
    pub(super) fn forget_avatars(&mut self) {
        while let Some(&(_, client)) = self.gone.front().filter(|(at, _)| *at <= self.common.now) {
            self.gone.pop_front();
            let is_back = self.common.clients.contains_key(&client);
            // The client may have come and left once more meanwhile.
            if is_back || self.gone.iter().any(|(_, later)| *later == client) {
                continue;
            }
            for group in self.groups.values_mut() {
                for (id, _) in group.record.avatars(client) {
                    group.retire(&mut self.common, id, false);
                }
            }
        }
    }

    /// Brings back the avatars of a client that is here.
    pub(super) fn bring_back(&mut self, client: ClientId) {
        for group in self.groups.values_mut() {
            for (id, life) in group.record.avatars(client) {
                match life {
                    Life::Parked => group.revive(&mut self.common, id),
                    Life::Removing { park: true, .. } => {
                        group.record.set_life(id, Life::Removing { park: true, back: true });
                    }
                    _ => {}
                }
            }
        }
    }
}

impl Group {
    /// Takes in a body that its owner has removed.
    pub(super) fn removed(&mut self, common: &mut Common, tick: Tick, body: BodyRecord) {
        let id = body.id;
        if let Some(Life::Removing { park, back }) = self.record.life(id) {
            self.record.freshen(tick, body);
            self.rest(common, id, park, back);
        }
    }

    /// Parks, brings back or forgets a body that no node holds any more.
    pub(super) fn rest(&mut self, common: &mut Common, id: BodyId, park: bool, back: bool) {
        self.arriving.remove(&id);
        match (park, back) {
            (false, _) => {
                self.forget_body(common, id);
                self.owners.remove(&id);
            }
            (true, false) => self.record.set_life(id, Life::Parked),
            (true, true) => self.revive(common, id),
        }
    }

    /// Forgets a body and its joints for good, with the notes that they were altered.
    pub(super) fn forget_body(&mut self, common: &mut Common, id: BodyId) {
        if let Some(body) = self.record.body(id) {
            common.departed.insert(id, body.user_data);
            common.departed.trim(DEPARTED);
        }
        self.steered.forget(id);
        let joints = self.record.joints_of(id).map(|joint| Key::AlteredJoint(joint.id));
        let altered: Vec<_> = joints.chain([Key::AlteredBody(id), Key::WokenBody(id)]).collect();
        altered.into_iter().for_each(|key| self.retold.forget(key));
        self.record.remove(id);
    }

    fn revive(&mut self, common: &mut Common, id: BodyId) {
        self.record.renew(id, common.number);
        self.record.set_life(id, Life::Waiting);
        self.introduce(common, id, Vec::new());
    }

    /// Introduces a waiting body to clients and nodes.
    fn introduce(&mut self, common: &mut Common, id: BodyId, shapes: Vec<ShapeRecord>) {
        let Some(body) = self.record.body(id).cloned() else { return };
        let message = ToClient::Inserted { body: body.clone(), shapes: shapes.clone(), joints: Vec::new() };
        common.announce(self.id, &self.record, id, &message);
        if self.view.is_some() && self.change.is_none() && !self.held {
            self.record.set_life(id, Life::Live);
            self.arriving.insert(id);
            self.apply(common, vec![WorldOp::Insert { bodies: vec![body], shapes, joints: Vec::new() }]);
        }
    }

    /// Takes a body out of the world, for good or, with `park`, until its client returns.
    pub(super) fn retire(&mut self, common: &mut Common, id: BodyId, park: bool) {
        match self.record.life(id) {
            Some(Life::Live) if self.view.is_some() => {
                self.record.set_life(id, Life::Removing { park, back: false });
                self.apply(common, vec![WorldOp::Remove(id)]);
            }
            Some(Life::Removing { park: parking, .. }) => {
                self.record.set_life(id, Life::Removing { park: parking && park, back: false });
            }
            Some(Life::Parked) if park => return,
            // Nobody computes the body: it is forgotten or parked on record alone.
            Some(Life::Live | Life::Waiting | Life::Parked) => self.rest(common, id, park, false),
            None => return,
        }
        common.announce_end(self.id, id);
    }
}
