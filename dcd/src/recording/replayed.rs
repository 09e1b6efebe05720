//! Defines the replay of one process, be it a local world, a node or a server.

use std::fmt;

use super::physics::bits_of;
use super::{Cut, Maker, Readout, RecordingError};
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// A tick that a process has completed, in the recording and in its replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// The tick; a view change repeats the last one.
    pub tick: Tick,
    /// The recorded digests of the process's regions after that tick.
    pub recorded: Vec<(RegionId, u64)>,
    /// The replayed digests.
    pub replayed: Vec<(RegionId, u64)>,
}

/// A deliberate change of a replay: one bit of the state of a body after a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flip {
    /// The tick after which the bit is flipped.
    pub tick: Tick,
    /// The body.
    pub body: BodyId,
    /// The index of the bit, of the 512 of the body's state.
    pub bit: usize,
}

/// The process that was recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Who {
    /// A local world.
    Local,
    /// A node.
    Node(NodeId),
    /// A server.
    Server,
}

impl Who {
    /// Returns the id of the node, if it is one.
    pub fn node(self) -> Option<NodeId> {
        if let Self::Node(node) = self { Some(node) } else { None }
    }
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Local => write!(f, "the local world"),
            Self::Node(node) => write!(f, "node {node}"),
            Self::Server => write!(f, "the server"),
        }
    }
}

/// The replay of one process.
pub trait Replayed {
    /// Returns which process this is.
    fn who(&self) -> Who;
    /// Returns the build and machine that made the recording.
    fn maker(&self) -> &Maker;
    /// Returns where the file ended, once it has ended as that of a process that was killed.
    fn cut(&self) -> Option<Cut>;
    /// Returns the hash of the file as far as it was read, which nothing but a copy of it has too.
    fn hash(&self) -> [u8; 8];
    /// Returns what tells the served world from others, as soon as the process has heard of it.
    fn world(&self) -> Option<u64> {
        None
    }
    /// Returns the tick of the world when the process began, if its first digest does not say so: a node's is
    /// that of the state with which it begins, a server's that of a later tick.
    fn began(&self) -> Option<Tick> {
        None
    }
    /// Returns the process's regions as they are now.
    fn readout(&self) -> &dyn Readout;
    /// Sets the flip to be made.
    fn flip(&mut self, flip: Flip);
    /// Returns whether the flip has been made.
    fn has_flipped(&self) -> bool;
    /// Returns in words what acted on a body in the last ticks.
    fn acted_on(&self, body: BodyId) -> Vec<String>;
    /// Goes on to the end of the next tick; returns `None` at the end of the recording.
    fn advance(&mut self) -> Result<Option<Settled>, RecordingError>;
}

/// A flip to be made, and whether it has been made.
#[derive(Debug, Default)]
pub(super) struct Disturbance {
    flip: Option<Flip>,
    done: bool,
}

impl Disturbance {
    pub(super) fn set(&mut self, flip: Flip) {
        (self.flip, self.done) = (Some(flip), false);
    }

    pub(super) fn is_done(&self) -> bool {
        self.done
    }

    /// Makes the flip after its tick, once, if the body is owned here and has that bit.
    pub(super) fn happen(&mut self, tick: Tick, regions: &mut (impl Readout + ?Sized)) {
        let Some(Flip { body, bit, .. }) = self.flip.filter(|flip| flip.tick == tick && !self.done) else {
            return;
        };
        if let Some((_, before)) = bits_of(regions, body) {
            regions.set(body, &before.flipped(bit));
            self.done = bits_of(regions, body).is_some_and(|(_, after)| after != before);
        }
    }
}
