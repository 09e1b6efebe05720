//! Forgets shapes that no body has any more. Terrain that was dug, or hulls of avatars that are gone, would
//! fill the memory of all processes. The record and clients forget a shape first, nodes some seconds later: a
//! message that names it may be on its way until then, and brings it back.

use std::collections::{BTreeMap, BTreeSet};

use super::Server;
use super::common::Common;
use super::group::Group;
use crate::protocol::{ShapeHash, ToClient, View, WorldOp, split};

/// The most bytes of names in one message.
const NAMED_BYTES: usize = 1 << 18;

impl Server {
    /// Forgets shapes that no body has, now and then.
    pub(super) fn forget_shapes(&mut self) {
        if self.common.fading.is_crowded(self.main().record.len()) {
            self.look_through_shapes();
        }
        let ended = self.common.fading.end(self.common.now);
        if !ended.is_empty() {
            for allowance in self.common.allowances.values_mut() {
                allowance.shapes.forget(&ended);
                allowance.building.shapes.forget(&ended);
            }
        }
        self.let_nodes_forget();
    }

    /// Removes the shapes that no body of any group has from the record, and makes clients forget them.
    pub(super) fn look_through_shapes(&mut self) {
        let used: BTreeSet<_> = self.groups.values().flat_map(|group| group.record.used_shapes()).collect();
        let mut gone = BTreeMap::new();
        for group in self.groups.values_mut() {
            gone.extend(group.record.keep_shapes(&used));
        }
        let Common { fading, nodes, clients, now, .. } = &mut self.common;
        nodes.values_mut().for_each(|entry| entry.shapes.retain(|hash| !gone.contains_key(hash)));
        let mut told = Vec::new();
        for (&client, entry) in clients {
            let known: Vec<_> = match &mut entry.vicinity {
                Some(vicinity) => vicinity.forget_shapes(&gone),
                None => gone.keys().copied().collect(),
            };
            // A client that is away is told the whole world on its return.
            if entry.linked {
                told.extend(split(known, NAMED_BYTES).into_iter().map(|part| (client, part)));
            }
        }
        fading.begin(*now, gone, &used);
        told.into_iter()
            .for_each(|(client, part)| self.common.send_client(client, ToClient::ShapesGone(part)));
    }

    /// Makes nodes forget shapes that nobody can ask for any more, once all nodes that compute can be told.
    /// Nobody computes a group that is held, and nodes that come to do so begin anew.
    fn let_nodes_forget(&mut self) {
        if !self.common.fading.owes() || self.groups.values().any(|group| group.will_hear(&self.common)) {
            return;
        }
        let owed: Vec<ShapeHash> = self.common.fading.take_owed().into_iter().collect();
        for part in split(owed, NAMED_BYTES) {
            for group in self.groups.values().filter(|group| !group.held) {
                group.apply(&mut self.common, vec![WorldOp::ForgetShapes(part.clone())]);
            }
        }
    }
}

impl Group {
    /// Returns whether the nodes that compute the group's world cannot be told now what to do to it, but will
    /// be.
    fn will_hear(&self, common: &Common) -> bool {
        let is_linked = |leader| common.nodes.get(&leader).is_some_and(|entry| entry.linked);
        let hears = |view: &View| self.change.is_none() && is_linked(view.leader);
        !self.held && self.view.as_ref().is_some_and(|view| !hears(view))
    }
}
