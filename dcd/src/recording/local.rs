//! Replays a local world: repeats what its program did to it between ticks, and steps it.

use std::collections::{BTreeMap, VecDeque};

use bincode::{Decode, Encode};

use super::entries::Entries;
use super::entry::Digests;
use super::replayed::{Disturbance, Flip, Replayed, Settled, Who};
use super::{Cut, Maker, Readout, RecordingError, digests_of};
use crate::fidelity::Pace;
use crate::protocol::{
    BodyRecord, Drive, HookAnswer, HookCall, JointRecord, Push, ShapeRecord, Velocity, WorldPose,
};
use crate::space::{BodyId, JointId, RegionId, Tick, Viewpoint};

/// The number of ticks whose operations are kept.
const TICKS: u64 = 4;

/// An operation of a program on its local world. What the program's own code changed of a Rapier value is
/// recorded by its effect: every copy of the value as it was afterwards, in Rapier's serde form.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Operation {
    /// A part of a snapshot.
    Seed(Vec<u8>),
    /// The world is restored from the snapshot whose parts came before.
    Restore,
    /// Bodies are inserted.
    Insert {
        /// The bodies.
        bodies: Vec<BodyRecord>,
        /// Their shapes, as far as these are new.
        shapes: Vec<ShapeRecord>,
    },
    /// A body is removed.
    Remove(BodyId),
    /// A joint is inserted.
    InsertJoint(Box<JointRecord>),
    /// A joint is removed.
    RemoveJoint(JointId),
    /// A body was changed.
    Update {
        /// The body.
        body: BodyId,
        /// Its copies in the order in which they were changed.
        copies: Vec<Vec<u8>>,
    },
    /// A joint was changed.
    UpdateJoint {
        /// The joint.
        joint: JointId,
        /// Its copies in the order in which they were changed.
        copies: Vec<Vec<u8>>,
    },
    /// A body is pushed.
    Push(Push),
    /// A body is moved at once.
    SetPose(BodyId, WorldPose),
    /// A kinematic body gets a target.
    SetNextPose(BodyId, WorldPose),
    /// A body gets a velocity.
    SetVelocity(BodyId, Velocity),
    /// A vehicle is driven differently.
    Drive(BodyId, Drive),
    /// A plane of the partition moves to this coordinate, metres.
    MovePlane(RegionId, f64),
    /// The world is looked at from these viewpoints.
    Look(Vec<Viewpoint>),
    /// In the step that follows, the program's contact hooks give these answers, which differ from those
    /// without hooks.
    Answers(Vec<(HookCall, HookAnswer)>),
    /// From the step that follows on, regions are computed at these paces: in a world with a time budget.
    Paces(BTreeMap<RegionId, Pace>),
}

impl Operation {
    /// Returns in words what the operation does to a body, if it concerns the body.
    fn on(&self, id: BodyId) -> Option<String> {
        let (concerns, words) = match self {
            Self::Insert { bodies, .. } => {
                (bodies.iter().any(|body| body.id == id), "inserted by the program".to_owned())
            }
            Self::Update { body, .. } => (*body == id, "changed in place by the program".to_owned()),
            Self::InsertJoint(joint) => ([joint.a, joint.b].contains(&id), format!("tied by {}", joint.id)),
            Self::Push(push) => (push.body == id, format!("pushed: {push:?}")),
            Self::SetPose(body, pose) => (*body == id, format!("moved to {:?}", pose.translation)),
            Self::SetNextPose(body, pose) => (*body == id, format!("sent to {:?}", pose.translation)),
            Self::SetVelocity(body, velocity) => {
                (*body == id, format!("given a velocity of {:?} m/s", velocity.linear))
            }
            Self::Drive(body, _) => (*body == id, "driven otherwise".to_owned()),
            Self::Answers(answers) => (
                answers.iter().any(|(call, _)| [call.first.0, call.second.0].contains(&id)),
                "of which contacts were changed by the program's hooks".to_owned(),
            ),
            Self::Restore => (true, "restored with the whole world".to_owned()),
            Self::Seed(_)
            | Self::Remove(_)
            | Self::RemoveJoint(_)
            | Self::UpdateJoint { .. }
            | Self::MovePlane(..)
            | Self::Look(_)
            | Self::Paces(_) => (false, String::new()),
        };
        concerns.then_some(words)
    }
}

/// An entry of the recording of a local world.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) enum LocalEntry {
    Did(Operation),
    Stepped(Digests),
}

/// A local world on which a replay repeats operations.
pub trait LocalPhysics: Readout {
    /// Repeats an operation. Instead of [`Operation::Seed`] and [`Operation::Restore`], a replay calls
    /// [`LocalPhysics::restore`].
    fn repeat(&mut self, operation: Operation) -> Result<(), String>;
    /// Restores the world from a snapshot.
    fn restore(&mut self, snapshot: &[u8]) -> Result<(), String>;
    /// Steps the world, and returns the tick that it has completed.
    fn step(&mut self) -> Result<Tick, String>;
}

/// The replay of a local world.
pub(super) struct LocalReplay {
    entries: Entries,
    world: Box<dyn LocalPhysics>,
    snapshot: Vec<u8>,
    tick: Tick,
    disturbance: Disturbance,
    acts: VecDeque<(Tick, Operation)>,
}

impl LocalReplay {
    pub(super) fn new(entries: Entries, world: Box<dyn LocalPhysics>) -> Self {
        let (snapshot, acts) = (Vec::new(), VecDeque::new());
        Self { entries, world, snapshot, tick: Tick(0), disturbance: Disturbance::default(), acts }
    }

    fn repeat(&mut self, operation: Operation) -> Result<(), RecordingError> {
        match operation {
            Operation::Seed(part) => self.snapshot.extend_from_slice(&part),
            Operation::Restore => {
                let snapshot = std::mem::take(&mut self.snapshot);
                self.world.restore(&snapshot).map_err(RecordingError::Physics)?;
                self.acts.push_back((self.tick.next(), Operation::Restore));
            }
            other => {
                self.acts.push_back((self.tick.next(), other.clone()));
                self.world.repeat(other).map_err(RecordingError::Physics)?;
            }
        }
        Ok(())
    }
}

impl Replayed for LocalReplay {
    fn who(&self) -> Who {
        Who::Local
    }

    fn maker(&self) -> &Maker {
        self.entries.maker()
    }

    fn cut(&self) -> Option<Cut> {
        self.entries.cut()
    }

    fn hash(&self) -> [u8; 8] {
        self.entries.hash()
    }

    fn readout(&self) -> &dyn Readout {
        &*self.world
    }

    fn flip(&mut self, flip: Flip) {
        self.disturbance.set(flip);
    }

    fn has_flipped(&self) -> bool {
        self.disturbance.is_done()
    }

    fn acted_on(&self, body: BodyId) -> Vec<String> {
        let acts = self.acts.iter();
        acts.filter_map(|(tick, act)| Some(format!("before tick {}: {}", tick.0, act.on(body)?))).collect()
    }

    fn advance(&mut self) -> Result<Option<Settled>, RecordingError> {
        while let Some(entry) = self.entries.next()? {
            let digests = match entry {
                LocalEntry::Did(operation) => {
                    self.repeat(operation)?;
                    continue;
                }
                LocalEntry::Stepped(digests) => digests,
            };
            let (tick, recorded) = self.entries.digests(digests);
            self.tick = self.world.step().map_err(RecordingError::Physics)?;
            if self.tick != tick {
                return Err(RecordingError::Astray { tick: tick.0 });
            }
            self.disturbance.happen(tick, &mut *self.world);
            while self.acts.front().is_some_and(|(of, _)| of.0 + TICKS <= tick.0) {
                self.acts.pop_front();
            }
            return Ok(Some(Settled { tick, recorded, replayed: digests_of(&*self.world) }));
        }
        Ok(None)
    }
}
