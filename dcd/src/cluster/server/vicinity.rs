//! Keeps what a client with an area of interest has been sent of the world: what is near it when it joins,
//! what comes near later, and the shapes and joints of these bodies.

use std::collections::{BTreeMap, BTreeSet};

use super::Server;
use crate::cluster::{Life, Record};
use crate::protocol::{
    Area, BodyKind, BodyRecord, Chunk, JointRecord, Refusal, ShapeHash, ShapeRecord, ToClient, chunks,
};
use crate::space::{BodyId, ClientId};

/// The part of the world that one client has been sent.
#[derive(Clone, Debug)]
pub(super) struct Vicinity {
    /// The area in which the client is told of bodies inserted later, and of all scenery that reaches into
    /// it.
    area: Area,
    bodies: BTreeSet<BodyId>,
    shapes: BTreeSet<ShapeHash>,
}

impl Vicinity {
    /// Returns the vicinity of a client that joins with this area of interest, and the part of the world in
    /// it. Scenery comes from a wider area, so that the client need not ask for more soon. The client's own
    /// avatars and what is near them are included.
    pub(super) fn joining(client: ClientId, interest: Area, record: &Record) -> (Self, Vec<Chunk>) {
        Self::of(client, interest, interest.with_surroundings(), record)
    }

    /// Returns the vicinity anew for a world in which everything may differ, and the part of that world in
    /// it.
    pub(super) fn again(self, client: ClientId, record: &Record) -> (Self, Vec<Chunk>) {
        Self::of(client, self.area, self.area, record)
    }

    fn of(client: ClientId, interest: Area, area: Area, record: &Record) -> (Self, Vec<Chunk>) {
        let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        let avatars = record.avatars(client).into_iter().filter_map(|(id, _)| record.body(id));
        let avatars: Vec<_> = avatars.map(|body| Area::around_avatar(body.state.pose.translation)).collect();
        let is_near = |body: &&BodyRecord| match body.traits.kind {
            BodyKind::Fixed => is_in(body, &area, record),
            _ => {
                let at = body.state.pose.translation;
                own.contains(&body.id) || interest.enters(at) || avatars.iter().any(|area| area.enters(at))
            }
        };
        let ids =
            record.present().chain(record.returning(client)).filter(is_near).map(|body| body.id).collect();
        let mut vicinity = Self { area, bodies: BTreeSet::new(), shapes: BTreeSet::new() };
        let (bodies, shapes, joints) = vicinity.meet(&ids, record);
        let mut parts = chunks(shapes.into_iter().cloned(), Chunk::Shapes);
        parts.extend(chunks(bodies.into_iter().cloned(), Chunk::Bodies));
        parts.extend(chunks(joints.into_iter().cloned(), Chunk::Joints));
        (vicinity, parts)
    }

    /// Moves the area. Returns messages about scenery in it that the client does not know.
    fn turn_to(&mut self, area: Area, record: &Record) -> Vec<ToClient> {
        self.area = area;
        let is_new = |body: &&BodyRecord| {
            body.traits.kind == BodyKind::Fixed
                && !self.bodies.contains(&body.id)
                && is_in(body, &area, record)
        };
        let ids = record.present().filter(is_new).map(|body| body.id).collect();
        self.introduce(&ids, record)
    }

    /// Returns the messages that tell the client of a body that is new to the world, if it is near or the
    /// client's own.
    pub(super) fn announce(&mut self, client: ClientId, id: BodyId, record: &Record) -> Vec<ToClient> {
        let is_near = record.body(id).is_some_and(|body| is_in(body, &self.area, record));
        if !is_near && id.client() != Some(client) {
            return Vec::new();
        }
        // A body of this id may have been there before.
        self.bodies.remove(&id);
        self.introduce(&[id].into(), record)
    }

    /// Forgets a body that is gone. Returns whether the client knew it.
    pub(super) fn forget(&mut self, id: BodyId) -> bool {
        self.bodies.remove(&id)
    }

    /// Forgets shapes that are gone. Returns those that the client knew.
    pub(super) fn forget_shapes(&mut self, gone: &BTreeMap<ShapeHash, ShapeRecord>) -> Vec<ShapeHash> {
        let known: Vec<_> = self.shapes.iter().filter(|hash| gone.contains_key(hash)).copied().collect();
        self.shapes.retain(|hash| !gone.contains_key(hash));
        known
    }

    /// Returns the messages that introduce those of these bodies that are in the world and that the client
    /// does not know.
    fn introduce(&mut self, ids: &BTreeSet<BodyId>, record: &Record) -> Vec<ToClient> {
        let is_present = |id: &BodyId| matches!(record.life(*id), Some(Life::Live | Life::Waiting));
        let ids = ids.iter().filter(|id| is_present(id)).copied().collect();
        let (bodies, mut shapes, mut joints) = self.meet(&ids, record);
        let Some((last, others)) = bodies.split_last() else { return Vec::new() };
        let mut message = |body: &&BodyRecord, joints: Vec<JointRecord>| ToClient::Inserted {
            body: (*body).clone(),
            shapes: std::mem::take(&mut shapes).into_iter().cloned().collect(),
            joints,
        };
        // Shapes come before all bodies that have them, and joints after both of their bodies.
        let mut messages: Vec<_> = others.iter().map(|body| message(body, Vec::new())).collect();
        messages.push(message(last, std::mem::take(&mut joints).into_iter().cloned().collect()));
        messages
    }

    /// Adds bodies to those that the client knows. Returns the bodies that were new to it, the shapes that it
    /// needs for them (parts before compounds), and the joints that it can have now.
    fn meet<'a>(
        &mut self,
        ids: &BTreeSet<BodyId>,
        record: &'a Record,
    ) -> (Vec<&'a BodyRecord>, Vec<&'a ShapeRecord>, Vec<&'a JointRecord>) {
        let new: BTreeSet<_> = ids.difference(&self.bodies).copied().collect();
        let bodies: Vec<_> = new.iter().filter_map(|id| record.body(*id)).collect();
        self.bodies.extend(&new);
        let own = bodies.iter().flat_map(|body| &body.traits.colliders).map(|collider| collider.shape);
        let mut shapes = Vec::new();
        for hash in own.collect::<BTreeSet<_>>() {
            let Some(shape) = record.shape(hash) else { continue };
            let parts = shape.parts().filter_map(|part| Some((part, record.shape(part)?)));
            for (hash, shape) in parts.chain([(hash, shape)]).collect::<Vec<_>>() {
                if self.shapes.insert(hash) {
                    shapes.push(shape);
                }
            }
        }
        let is_known = |joint: &&JointRecord| [joint.a, joint.b].iter().all(|id| self.bodies.contains(id));
        let joints = new.iter().flat_map(|id| record.joints_of(*id)).filter(is_known);
        // The client comes to know a joint with the second of its bodies, and forgets it with either.
        let joints: BTreeMap<_, _> = joints.map(|joint| (joint.id, joint)).collect();
        (bodies, shapes, joints.into_values().collect())
    }
}

/// Returns whether a body reaches into an area.
fn is_in(body: &BodyRecord, area: &Area, record: &Record) -> bool {
    let reach_m = match body.traits.kind {
        BodyKind::Fixed => record.reach_m(body),
        _ => 0.0,
    };
    area.meets(body.state.pose.translation, reach_m)
}

impl Server {
    /// Moves the area in which a client that joined with an area of interest knows the scenery, and tells it
    /// what is new to it there. `None` tells it the whole world. Returns the reason if the request is
    /// refused.
    pub(super) fn widen(&mut self, client: ClientId, area: Option<Area>) -> Option<Refusal> {
        let entry = self.common.clients.get_mut(&client)?;
        let record = &self.groups.get(&entry.group)?.record;
        let mut vicinity = entry.vicinity.take()?;
        if !self.common.allowances.entry(client).or_default().look(self.common.now) {
            entry.vicinity = Some(vicinity);
            return Some(Refusal::TooMany);
        }
        let news = match area {
            Some(area) => {
                let news = vicinity.turn_to(area, record);
                entry.vicinity = Some(vicinity);
                news
            }
            None => {
                // The client counts as knowing all shapes from now on, so new bodies with one of these come
                // without it.
                let shapes = record.shape_chunks(&mut vicinity.shapes);
                let bodies = vicinity.introduce(&record.present().map(|body| body.id).collect(), record);
                shapes.into_iter().map(ToClient::Chunk).chain(bodies).collect()
            }
        };
        news.into_iter().for_each(|message| self.common.send_client(client, message));
        None
    }

    /// Tells a client of bodies that it does not know and whose states it has heard of.
    pub(super) fn introduce(&mut self, client: ClientId, ids: Vec<BodyId>) {
        let Some(entry) = self.common.clients.get_mut(&client) else { return };
        let Some(group) = self.groups.get(&entry.group) else { return };
        let Some(vicinity) = &mut entry.vicinity else { return };
        // A client that is refused asks again.
        if self.common.allowances.entry(client).or_default().spawn(self.common.now) {
            let news = vicinity.introduce(&ids.into_iter().collect(), &group.record);
            news.into_iter().for_each(|message| self.common.send_client(client, message));
        }
    }
}
