//! Defines what the replay of one process can do, whatever it was.

use std::fmt;

use super::physics::bits_of;
use super::{Maker, Readout, RecordingError};
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// A tick that a process has completed, in the recording and again.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// The tick; a view change repeats the last one.
    pub tick: Tick,
    /// The digests of its regions then.
    pub recorded: Vec<(RegionId, u64)>,
    /// The same, replayed.
    pub replayed: Vec<(RegionId, u64)>,
}

/// A change of a replay on purpose: of the state of a body after a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flip {
    /// After which tick.
    pub tick: Tick,
    /// Which body.
    pub body: BodyId,
    /// Which of the 512 bits of its state.
    pub bit: usize,
}

/// Who was recorded.
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
    /// Returns which node it is, if it is one.
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
    /// Returns who it is.
    fn who(&self) -> Who;
    /// Returns who made the recording.
    fn maker(&self) -> &Maker;
    /// Returns whether the file has no end, as that of a killed process.
    fn was_cut_off(&self) -> bool;
    /// Returns its regions as they are now.
    fn readout(&self) -> &dyn Readout;
    /// Disturbs the replay.
    fn flip(&mut self, flip: Flip);
    /// Returns whether the flip has been made.
    fn has_flipped(&self) -> bool;
    /// Returns what acted on a body in the last ticks.
    fn acted_on(&self, body: BodyId) -> Vec<String>;
    /// Goes on to the end of a tick; `None` at the end of the recording.
    fn advance(&mut self) -> Result<Option<Settled>, RecordingError>;
}

/// A flip that is to be made, or has been.
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

    /// Makes the flip after its tick, once, if the body is owned there and has that bit.
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
