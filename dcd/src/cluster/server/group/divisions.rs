//! Keeps which member computes which region, now and earlier in the present view. What a member says of
//! bodies counts for its own regions only.

use std::collections::{BTreeMap, VecDeque};

use crate::protocol::ToServer;
use crate::space::{Allocation, NodeId, RegionId};

/// The number of divisions kept, of which late checkpoints may speak.
const KEPT: usize = 16;
/// The most checkpoints kept that name a division of which the leader has not told yet. Its word is on its
/// way over another link.
const WAITING: usize = 256;
/// The most bodies in these checkpoints. A member may say as much as a message holds.
const WAITING_BODIES: usize = 1 << 17;

/// The divisions of a view, numbered from 0 by how often the tree has changed in it.
#[derive(Clone, Debug, Default)]
pub(in crate::cluster::server) struct Divisions {
    known: BTreeMap<u32, Allocation>,
    waiting: VecDeque<(NodeId, ToServer)>,
}

impl Divisions {
    /// Returns the divisions of a view that begins.
    pub(super) fn of_view(allocation: Allocation) -> Self {
        Self { known: [(0, allocation)].into(), waiting: VecDeque::new() }
    }

    /// Notes a division. Returns the checkpoints that waited for it.
    pub(super) fn learn(&mut self, division: u32, allocation: Allocation) -> Vec<(NodeId, ToServer)> {
        self.known.insert(division, allocation);
        while self.known.len() > KEPT {
            self.known.pop_first();
        }
        let is_due = |(_, message): &mut (NodeId, ToServer)| match message {
            ToServer::Checkpoint { division: of, .. } => *of <= division,
            _ => true,
        };
        let mut held = Vec::from(std::mem::take(&mut self.waiting));
        let due = held.extract_if(.., is_due).collect();
        self.waiting = held.into();
        due
    }

    /// Returns whether this division is not known yet.
    pub(super) fn is_ahead(&self, division: u32) -> bool {
        self.known.last_key_value().is_none_or(|(&last, _)| last < division)
    }

    /// Keeps a checkpoint until the leader has told of its division. Returns how many checkpoints are dropped
    /// for it.
    pub(super) fn wait(&mut self, node: NodeId, message: ToServer) -> u64 {
        self.waiting.push_back((node, message));
        let mut dropped = 0;
        while self.waiting.len() > WAITING
            || self.waiting.iter().map(bodies_in).sum::<usize>() > WAITING_BODIES
        {
            self.waiting.pop_front();
            dropped += 1;
        }
        dropped
    }

    /// Returns whether a member computes a region in a division.
    pub(super) fn computes(&self, node: NodeId, region: RegionId, division: u32) -> bool {
        self.known.get(&division).is_some_and(|allocation| allocation.get(&region) == Some(&node))
    }
}

fn bodies_in((_, message): &(NodeId, ToServer)) -> usize {
    match message {
        ToServer::Checkpoint { bodies, .. } => bodies.len(),
        _ => 0,
    }
}
