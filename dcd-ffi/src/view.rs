//! What roles say of bodies and regions, before it becomes C's.

use dcd::protocol::{Velocity, WorldPose};
use dcd::space::{BodyId, NodeId, RegionId};

use crate::body::DcdBodyType;

/// A body as far as C asks about it.
pub(crate) struct BodyView {
    pub pose: WorldPose,
    pub velocity: Velocity,
    pub kind: DcdBodyType,
    pub sleeping: bool,
    /// 0 for an immovable body, and where it is not known.
    pub mass_kg: f32,
    pub user_data: u64,
    /// `None` for an immovable body.
    pub owner: Option<RegionId>,
    /// Whether the interest set does not reach it.
    pub outside: bool,
}

/// A movable body after a step.
pub(crate) struct StateRow {
    pub id: BodyId,
    pub region: RegionId,
    pub pose: WorldPose,
    pub velocity: Velocity,
    pub user_data: u64,
    pub sleeping: bool,
    /// Whether the interest set does not reach it.
    pub outside: bool,
}

/// Who has authority over a body.
pub(crate) struct OwnerView {
    /// `None` for an immovable body.
    pub region: Option<RegionId>,
    /// As far as known.
    pub node: Option<NodeId>,
    /// Whether nobody has told yet who owns it: then the region is the one that it is in.
    pub by_place: bool,
    /// How many regions hold it; 0 where that is not known.
    pub holders: usize,
    /// Whether this process computes the region.
    pub here: bool,
    /// Whether what is known of the body was heard from others.
    pub heard: bool,
}

/// A region of the world.
pub(crate) struct RegionView {
    pub id: RegionId,
    /// `None` where one process computes all, and where it is not known.
    pub node: Option<NodeId>,
    pub owned: usize,
    pub replicas: usize,
    pub min: [f64; 3],
    pub max: [f64; 3],
}
