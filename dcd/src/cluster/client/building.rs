//! Sends what a client builds to the server, and keeps it until that is on record there. A server that comes
//! back is sent again what it may not have written down, with shapes that the world has forgotten meanwhile.

use std::collections::{BTreeMap, BTreeSet};

use super::shapes::named;
use super::{Client, ClientOutput};
use crate::protocol::{
    Alteration, BUILD_BYTES, BuildOp, Costs, FromClient, MAX_BUILD_OPS, Refusal, ShapeHash, ShapeRecord,
    encoded_len, split,
};

/// The most bytes that may wait for the server's word.
const MAX_WAITING_BYTES: usize = 8 << 20;
/// The most bytes of shapes that are brought again with operations after the first that names them.
const MAX_BROUGHT_BYTES: usize = 1 << 20;

/// The operations that a client has asked to be built and that have no answer, in order.
#[derive(Clone, Debug, Default)]
pub(super) struct Building {
    /// The number of requests of the user, and of messages that they took.
    requests: u64,
    messages: u64,
    waiting: BTreeMap<u64, Waiting>,
    /// Shapes that waiting operations name, that were not sent with them, and that the world has forgotten
    /// since.
    forgotten: BTreeMap<ShapeHash, ShapeRecord>,
    /// The indices of the next body and the next joint, as the server said.
    pub(super) next: (u32, u32),
}

/// A message that the server has not answered.
#[derive(Clone, Debug)]
struct Waiting {
    /// The user's request that it belongs to.
    request: u64,
    bytes: usize,
    ops: Vec<BuildOp>,
}

impl Building {
    /// Takes the server's word on a message.
    pub(super) fn answered(&mut self, number: u64) {
        self.waiting.remove(&number);
        if self.waiting.is_empty() {
            self.forgotten.clear();
        }
    }

    /// Forgets what the server has not answered, since the world is another.
    pub(super) fn clear(&mut self) {
        self.waiting.clear();
        self.forgotten.clear();
    }

    /// Takes in shapes that the world has forgotten, and keeps those that waiting operations name. `known`
    /// are the other shapes.
    pub(super) fn keep_named(
        &mut self,
        gone: BTreeMap<ShapeHash, ShapeRecord>,
        known: &BTreeMap<ShapeHash, ShapeRecord>,
    ) {
        self.forgotten.extend(gone);
        let ops = self.waiting.values().flat_map(|waiting| &waiting.ops);
        let named: BTreeSet<_> = ops.flat_map(|op| self.named_by(op, known)).collect();
        self.forgotten.retain(|hash, _| named.contains(hash));
    }

    fn named_by(&self, op: &BuildOp, known: &BTreeMap<ShapeHash, ShapeRecord>) -> BTreeSet<ShapeHash> {
        let BuildOp::Insert { bodies, shapes, .. } = op else { return BTreeSet::new() };
        let brought: BTreeMap<_, _> = shapes.iter().map(|shape| (shape.hash(), shape)).collect();
        named(bodies.iter(), |hash| {
            let other = || known.get(hash).or_else(|| self.forgotten.get(hash));
            brought.get(hash).copied().or_else(other)
        })
    }

    /// Adds to an operation the shapes that it lacks since the world has forgotten them, as far as they fit
    /// into a message. Shapes that were `brought` with an operation before are brought again while that takes
    /// little: that operation may be refused.
    fn bring_along(
        &self,
        mut op: BuildOp,
        known: &BTreeMap<ShapeHash, ShapeRecord>,
        brought: &mut (BTreeSet<ShapeHash>, usize),
    ) -> BuildOp {
        let mut lacking = self.named_by(&op, known);
        if let BuildOp::Insert { shapes, .. } = &mut op {
            shapes.iter().for_each(|shape| _ = lacking.remove(&shape.hash()));
            lacking.retain(|hash| !known.contains_key(hash));
            let forgotten = lacking.iter().filter_map(|hash| self.forgotten.get(hash));
            let back = forgotten.filter(|shape| {
                let bytes = encoded_len(*shape);
                let comes = bytes <= BUILD_BYTES
                    && (brought.0.insert(shape.hash()) || brought.1 + bytes <= MAX_BROUGHT_BYTES);
                brought.1 += if comes { bytes } else { 0 };
                comes
            });
            shapes.extend(back.cloned());
            // Parts come before compounds.
            shapes.sort_by_key(ShapeRecord::is_compound);
        }
        op
    }
}

/// Returns the operations packed into messages, in order, and those that fit into none.
fn packed(ops: impl IntoIterator<Item = BuildOp>) -> (Vec<Vec<BuildOp>>, Vec<BuildOp>) {
    let parts = ops.into_iter().flat_map(|op| op.in_parts(BUILD_BYTES));
    let (fitting, too_long): (Vec<_>, Vec<_>) = parts.partition(|op| encoded_len(op) <= BUILD_BYTES);
    let mut messages = Vec::new();
    for mut ops in split(fitting, BUILD_BYTES) {
        while !ops.is_empty() {
            let later = ops.split_off(ops.len().min(MAX_BUILD_OPS));
            messages.push(std::mem::replace(&mut ops, later));
        }
    }
    (messages, too_long)
}

impl Client {
    /// Returns the indices of the next body and the next joint that the client may build, as the server said
    /// when it joined.
    pub fn next_built(&self) -> (u32, u32) {
        self.building.next
    }

    /// Returns how many requests to build, counted from the first without a gap, the server has answered.
    pub fn answered_builds(&self) -> u64 {
        let first = self.building.waiting.values().next();
        first.map_or(self.building.requests, |waiting| waiting.request - 1)
    }

    /// Sends what is to be built. What waits for the server is sent once it has welcomed the client.
    pub(super) fn build(&mut self, ops: Vec<BuildOp>) {
        self.building.requests += 1;
        let (messages, too_long) = packed(ops);
        too_long.iter().for_each(|op| self.refuse(op, Refusal::Costly(Costs::Bytes)));
        messages.into_iter().for_each(|ops| self.send_build(ops));
    }

    fn send_build(&mut self, ops: Vec<BuildOp>) {
        let waiting: usize = self.building.waiting.values().map(|waiting| waiting.bytes).sum();
        let bytes = encoded_len(&ops);
        if waiting + bytes > MAX_WAITING_BYTES {
            return ops.iter().for_each(|op| self.refuse(op, Refusal::TooMany));
        }
        self.building.messages += 1;
        let (number, request) = (self.building.messages, self.building.requests);
        self.building.waiting.insert(number, Waiting { request, bytes, ops: ops.clone() });
        // Otherwise it is sent later, after those that wait.
        if self.server_linked && self.joined && !self.greeted {
            self.ask_server(FromClient::Build { number, ops });
        }
    }

    fn refuse(&mut self, op: &BuildOp, reason: Refusal) {
        let bodies = op.bodies();
        if bodies.is_empty() {
            self.outputs.push_back(ClientOutput::Rejected { body: None, reason });
        }
        for id in bodies {
            self.outputs.push_back(ClientOutput::Rejected { body: Some(id), reason });
        }
    }

    /// Sends what the server has not answered again, when the world has arrived, perhaps anew. Left out are
    /// insertions that the world shows as done, velocities and pushes, which were meant for another time, and
    /// all alterations of the same thing except the last.
    pub(super) fn build_again(&mut self) {
        let mut waiting = std::mem::take(&mut self.building.waiting);
        let wakes = |op: &BuildOp| match op {
            BuildOp::Alter(Alteration::Body { body, wakes: true, .. }) => Some(*body),
            _ => None,
        };
        let woken: BTreeSet<_> =
            waiting.values().flat_map(|waiting| &waiting.ops).filter_map(wakes).collect();
        let (mut bodies_altered, mut joints_altered) = (BTreeSet::new(), BTreeSet::new());
        for Waiting { ops, .. } in waiting.values_mut().rev() {
            ops.reverse();
            ops.retain_mut(|op| match op {
                BuildOp::Insert { bodies, .. } => {
                    bodies.iter().any(|body| !self.bodies.contains_key(&body.id))
                }
                // The body or joint may be where this client hears of nothing.
                BuildOp::Remove(_) | BuildOp::RemoveJoint(_) => true,
                BuildOp::Alter(Alteration::Body { body, wakes, .. }) => {
                    *wakes |= woken.contains(body);
                    bodies_altered.insert(*body)
                }
                BuildOp::Alter(Alteration::Joint(joint)) => joints_altered.insert(joint.id),
                BuildOp::Move(_) | BuildOp::Push(_) => false,
            });
            ops.reverse();
        }
        waiting.retain(|_, waiting| !waiting.ops.is_empty());
        if !self.building.forgotten.is_empty() {
            waiting = self.bring_shapes_along(waiting);
        }
        for (&number, Waiting { ops, .. }) in &waiting {
            self.ask_server(FromClient::Build { number, ops: ops.clone() });
        }
        self.building.waiting = waiting;
    }

    /// Returns what waits with the shapes that it lacks by now, in new messages: the former ones may have no
    /// room for them.
    fn bring_shapes_along(&mut self, waiting: BTreeMap<u64, Waiting>) -> BTreeMap<u64, Waiting> {
        let (mut again, mut brought) = (BTreeMap::new(), Default::default());
        for Waiting { request, ops, .. } in waiting.into_values() {
            let ops = ops.into_iter().map(|op| self.building.bring_along(op, &self.shapes, &mut brought));
            let (messages, too_long) = packed(ops);
            too_long.iter().for_each(|op| self.refuse(op, Refusal::Costly(Costs::Bytes)));
            for ops in messages {
                self.building.messages += 1;
                again.insert(self.building.messages, Waiting { request, bytes: encoded_len(&ops), ops });
            }
        }
        again
    }
}
