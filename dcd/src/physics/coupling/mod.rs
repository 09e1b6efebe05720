//! How regions that hold the same body agree on it: the one place where regions meet.
//!
//! After each (micro-)step every region *gathers* what it has to say into one [`BorderMessage`] a neighbour, and then
//! *applies* the messages of its neighbours in rank order. Values go in and come out; who carries them (memory, a
//! simulator, QUIC) is not known here.

mod held;
mod holders;
mod owner;

pub(super) use holders::Change;
use serde::{Deserialize, Serialize};

use super::partition::Partition;
use super::region::Region;
use super::shapes::ShapeLibrary;
use super::statics::Statics;
use crate::protocol::BorderMessage;
use crate::space::Tick;

/// The methods, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Coupling {
    /// Replicas are dynamic copies, overwritten by their owner after each step. Cheap and tolerant of delay; it does not
    /// conserve momentum across a border.
    #[default]
    Owner,
}

impl Coupling {
    /// All methods.
    pub const ALL: [Self; 1] = [Self::Owner];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Owner => "owner",
        }
    }

    /// Fills `region.outbox` with what neighbours must hold of the bodies inserted since the last step.
    pub(super) fn announce(self, region: &mut Region, partition: &Partition, tick: Tick, dt_s: f32) {
        holders::announce(region, partition, tick, dt_s);
    }

    /// Fills `region.outbox` after a step.
    pub(super) fn gather(self, region: &mut Region, partition: &Partition, tick: Tick, dt_s: f32) {
        if partition.len() == 1 {
            region.fresh.clear();
            return;
        }
        match self {
            Self::Owner => owner::gather(region, partition, tick, dt_s),
        }
    }

    /// Takes in what the neighbours said, in rank order.
    pub(super) fn apply<'a>(
        self,
        region: &mut Region,
        inbox: impl Iterator<Item = &'a BorderMessage>,
        ground: Ground<'_>,
    ) -> Result<(), super::ShapeError> {
        match self {
            Self::Owner => owner::apply(region, inbox, ground),
        }
    }
}

/// What every region of a process may look things up in.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub partition: &'a Partition,
    pub shapes: &'a ShapeLibrary,
    pub statics: &'a Statics,
}
