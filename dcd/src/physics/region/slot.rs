//! Defines the slot of a body in a region: ownership, holders, epoch and all other state that Rapier does not
//! keep.

use std::sync::Arc;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::mass_splitting::MassSplit;
use crate::physics::outline::Outline;
use crate::protocol::BodyTraits;
use crate::space::{BodyId, Epoch, JointId, RegionSet};

/// The ownership of a body, as a region that holds it knows it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Ownership {
    /// The body never moves. Every region near it holds it, and no region sends it.
    Immovable,
    /// This region owns the body: its copy is authoritative.
    Owner,
    /// The region of this rank owns the body; this region holds a ghost.
    Ghost {
        /// Rank of the owner.
        owner: usize,
    },
}

/// A body by its id and by Rapier's handle.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::physics) struct BodyRef {
    pub id: BodyId,
    pub handle: RigidBodyHandle,
}

/// What a region keeps of one body that it holds, besides Rapier's state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::physics) struct Slot {
    pub id: BodyId,
    pub epoch: Epoch,
    pub role: Ownership,
    /// The other regions that hold the body. The owner keeps this set; in couplings with consensus each ghost
    /// does too.
    pub holders: RegionSet,
    pub traits: Arc<BodyTraits>,
    /// Radius of a ball around the centre of mass that contains all colliders, in metres.
    pub reach_m: f32,
    /// Bounds of the body's hulls, from which its AABB is computed.
    pub outline: Outline,
    /// The joints that tie the body, in order of insertion.
    pub joints: Vec<JointId>,
    /// Index into the region's assemblies, if joints tie the body.
    pub assembly: Option<u32>,
    /// Rank of the leading region, whose copy all holders of the body followed in the last exchange; none
    /// while its mass is split, or while one region alone holds it.
    pub led_by: Option<usize>,
    /// Says, at the owner, whether the other holders know that the body sleeps.
    pub told_asleep: bool,
    /// The pose, at a ghost, in which the owner's copy fell asleep, in region space.
    pub asleep_at: Option<Pose>,
    /// Says, at a ghost, whether the owner has announced the body since membership changed last.
    pub confirmed: bool,
    /// How the body's mass and its user's force are split, while several regions hold it.
    pub mass_split: Option<Box<MassSplit>>,
    /// Says whether the body's island was small enough to be computed whole when it last came near a border.
    pub whole: bool,
    /// Ticks for which the size of the island has contradicted `whole`.
    pub doubt: u16,
    /// The first and the last tick, at the owner, in which the body was due to move to another region.
    pub away: (u32, u32),
}
