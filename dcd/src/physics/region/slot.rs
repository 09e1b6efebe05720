//! Defines the slot of a body in a region: ownership, holders, epoch and all other state that Rapier does not keep.

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
    /// The body never moves; every region near it holds it and none sends it.
    Immovable,
    /// This region owns the body: it is authoritative for it.
    Owner,
    /// The region of this rank owns the body; this one holds a replica.
    Replica {
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

/// The state of one body held by a region, besides Rapier's.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::physics) struct Slot {
    pub id: BodyId,
    pub epoch: Epoch,
    pub role: Ownership,
    /// The other regions that hold it; kept by the owner, and by replicas in couplings with consensus.
    pub holders: RegionSet,
    pub traits: Arc<BodyTraits>,
    /// Radius of a ball around the centre of mass that holds all colliders, in metres.
    pub reach_m: f32,
    /// Bounds of its hulls, from which its AABB is computed.
    pub outline: Outline,
    /// The joints it hangs on, in order of insertion.
    pub joints: Vec<JointId>,
    /// Index into the region's assemblies, if joints tie it to others.
    pub assembly: Option<u32>,
    /// Rank of the leading region, whose copy all that hold the body followed in the last exchange; none while its mass is split, or one
    /// region alone holds it.
    pub led_by: Option<usize>,
    /// Owner: whether the holders know that it sleeps.
    pub told_asleep: bool,
    /// Replica: where the owner's copy fell asleep.
    pub asleep_at: Option<Pose>,
    /// Replica: whether its owner has announced it since membership changed last.
    pub confirmed: bool,
    /// How its mass and its user's force are split, while several regions hold it.
    pub mass_split: Option<Box<MassSplit>>,
    /// Whether its island was small enough to be computed whole, when it last came near a border.
    pub whole: bool,
    /// Ticks for which its island's size has said otherwise than `whole`.
    pub doubt: u16,
    /// Owner: the first and the last tick in which it was due to move to another region.
    pub away: (u32, u32),
}
