//! Forgets shapes that no body has any more: terrain that is dug, or the hulls of avatars that are gone, would fill the memory of all. The
//! record and clients forget them first, nodes some seconds later: what names one may be on its way until then, and brings it back.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::Server;
use super::common::Common;
use super::group::Group;
use crate::protocol::link::CLIENT_IDLE_TIMEOUT;
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord, ToClient, WorldOp, encoded_len, split};

/// So many bytes of shapes come before all bodies are looked through for those that nobody has.
const ROOM: usize = 4 << 20;
/// So many for each body at least: looking through many takes long.
const ROOM_PER_BODY: usize = 16;
/// What keeping a shape takes beside its record, bytes.
const KEPT_BYTES: usize = 256;
/// How long something that names a shape may be on its way: a link that is silent for longer is gone.
const UNDERWAY: Duration = CLIENT_IDLE_TIMEOUT;
/// The most bytes of names in one message.
const NAMED_BYTES: usize = 1 << 18;

/// Shapes that no body has.
#[derive(Clone, Debug, Default)]
pub(super) struct Unused {
    /// Bytes of shapes that have come since all bodies were last looked through.
    come: usize,
    /// Shapes that the record and clients have forgotten and nodes have not. None of them is on record.
    fading: BTreeMap<ShapeHash, Fading>,
}

#[derive(Clone, Debug)]
struct Fading {
    since: Duration,
    bytes: usize,
    shape: ShapeRecord,
}

impl Unused {
    /// Returns whether nothing is being forgotten.
    #[cfg(test)]
    pub(super) fn is_at_rest(&self) -> bool {
        self.fading.is_empty()
    }

    /// Notes shapes that have come on record.
    pub(super) fn have_come(&mut self, new: &[ShapeRecord]) {
        for shape in new {
            self.come = self.come.saturating_add(KEPT_BYTES + encoded_len(shape));
            if !self.fading.is_empty() {
                self.fading.remove(&shape.hash());
            }
        }
    }

    /// Adds to the shapes that come with new bodies those that these have, that are being forgotten and that are no longer than this: who
    /// asked for the bodies may not have heard of that.
    pub(super) fn bring_back(&self, bodies: &[BodyRecord], shapes: &mut Vec<ShapeRecord>, bytes: usize) {
        if self.fading.is_empty() {
            return;
        }
        let brought: BTreeMap<_, _> = shapes.iter().map(|shape| (shape.hash(), shape)).collect();
        let fading =
            |hash: &ShapeHash| self.fading.get(hash).filter(|it| it.bytes <= bytes).map(|it| &it.shape);
        let colliders = bodies.iter().flat_map(|body| &body.traits.colliders);
        let mut named: BTreeSet<_> = colliders.map(|collider| collider.shape).collect();
        let known = named.iter().filter_map(|hash| brought.get(hash).copied().or_else(|| fading(hash)));
        let parts: Vec<_> = known.flat_map(ShapeRecord::parts).collect();
        named.extend(parts);
        let back = named.iter().filter(|hash| !brought.contains_key(hash)).filter_map(fading);
        let back: Vec<_> = back.cloned().collect();
        shapes.extend(back);
        // Parts come before compounds.
        shapes.sort_by_key(ShapeRecord::is_compound);
    }
}

impl Server {
    /// Forgets shapes that no body has, now and then.
    pub(super) fn forget_shapes(&mut self) {
        if self.common.unused.come >= ROOM.max(ROOM_PER_BODY * self.main().record.len()) {
            self.look_through_shapes();
        }
        self.let_nodes_forget();
    }

    /// Takes the shapes off the record that no body of any group has, and lets clients forget them.
    pub(super) fn look_through_shapes(&mut self) {
        let used: BTreeSet<_> = self.groups.values().flat_map(|group| group.record.used_shapes()).collect();
        let mut gone = BTreeMap::new();
        for group in self.groups.values_mut() {
            gone.extend(group.record.keep_shapes(&used));
        }
        let Common { unused, nodes, clients, now, .. } = &mut self.common;
        unused.come = 0;
        // Another world may have brought some back.
        unused.fading.retain(|hash, _| !used.contains(hash));
        nodes.values_mut().for_each(|entry| entry.shapes.retain(|hash| !gone.contains_key(hash)));
        let mut told = Vec::new();
        for (&client, entry) in clients {
            let known: Vec<_> = match &mut entry.vicinity {
                Some(vicinity) => vicinity.forget_shapes(&gone),
                None => gone.keys().copied().collect(),
            };
            // Who is away is told all of the world on returning.
            if entry.linked {
                told.extend(split(known, NAMED_BYTES).into_iter().map(|part| (client, part)));
            }
        }
        unused.fading.extend(gone.into_iter().map(|(hash, shape)| {
            let bytes = encoded_len(&shape);
            (hash, Fading { since: *now, bytes, shape })
        }));
        told.into_iter()
            .for_each(|(client, part)| self.common.send_client(client, ToClient::ShapesGone(part)));
    }

    /// Lets the nodes forget what the record has forgotten long enough ago, once all of them can be told: who is not forgets nothing until it
    /// begins anew.
    fn let_nodes_forget(&mut self) {
        let (now, fading) = (self.common.now, &self.common.unused.fading);
        let is_due = |it: &Fading| it.since + UNDERWAY <= now;
        if !fading.values().any(is_due) || !self.groups.values().all(|group| group.can_hear(&self.common)) {
            return;
        }
        let due: BTreeSet<_> = fading.iter().filter(|(_, it)| is_due(it)).map(|(hash, _)| *hash).collect();
        self.common.unused.fading.retain(|_, it| !is_due(it));
        for allowance in self.common.allowances.values_mut() {
            allowance.shapes.forget(&due);
            allowance.building.shapes.forget(&due);
        }
        for part in split(due, NAMED_BYTES) {
            for group in self.groups.values() {
                group.apply(&mut self.common, vec![WorldOp::ForgetShapes(part.clone())]);
            }
        }
    }
}

impl Group {
    /// Returns whether all who compute its world hear what is to be done to it, in order.
    fn can_hear(&self, common: &Common) -> bool {
        let is_linked = |leader| common.nodes.get(&leader).is_some_and(|entry| entry.linked);
        match &self.view {
            Some(view) => self.change.is_none() && !self.held && is_linked(view.leader),
            None => true,
        }
    }
}
