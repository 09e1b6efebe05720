//! Defines the interface to the physics of a simulated node, and the samples that are read from it.

use std::fmt;
use std::time::Duration;

use crate::protocol::{BodyState, Claim, ShapeHash, View, ViewNumber, WorldPose};
use crate::recording::Physics;
use crate::space::{BodyId, Epoch, GroupId, NodeId, Tick};

/// The physics of one simulated node: the [`StandIn`](super::StandIn), or the real physics.
pub trait Engine: Physics + fmt::Debug {
    /// Returns every owned body, in id order.
    fn claims(&self) -> Vec<Claim>;
    /// Returns every ghost with the epoch of its owner as known here, and its pose here.
    fn ghosts(&self) -> Vec<(BodyId, Epoch, WorldPose)>;
    /// Returns the state of an owned body.
    fn state(&self, id: BodyId) -> Option<BodyState>;
    /// Returns the number of rounds of the last tick; 0 if a rebuild took its place.
    fn rounds(&self) -> u32;
    /// Returns the number of rounds that the regions here want for the next tick.
    fn rounds_wanted(&self) -> u32;

    /// Measures the owned bodies after a tick. The stand-in has no forces, so it measures nothing.
    fn mechanics(&self) -> Mechanics {
        Mechanics::default()
    }

    /// Returns the hashes of the shapes that it has. The stand-in has none.
    #[doc(hidden)]
    fn shapes(&self) -> Vec<ShapeHash> {
        Vec::new()
    }

    /// Returns whether it is the stand-in. A replay must compute with the same physics.
    fn is_stand_in(&self) -> bool {
        true
    }
}

/// The energy and the contacts of the bodies that a node owns, after a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mechanics {
    /// The kinetic and potential energy, joules.
    pub energy_j: f64,
    /// The deepest overlap of two bodies, metres.
    pub deepest_m: f64,
}

impl Mechanics {
    /// Combines these with the measurements of another node of the same group.
    pub(super) fn and(self, other: Self) -> Self {
        Self { energy_j: self.energy_j + other.energy_j, deepest_m: self.deepest_m.max(other.deepest_m) }
    }
}

/// The bodies that a node held when it had completed a tick.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The time at which the node had completed the tick.
    pub time: Duration,
    /// The group of the node.
    pub group: GroupId,
    /// The view in which the tick was completed.
    pub view: ViewNumber,
    /// The number of members of the view.
    pub members: usize,
    /// The node.
    pub node: NodeId,
    /// The tick.
    pub tick: Tick,
    /// The states of the bodies that it owned.
    pub owned: Vec<(BodyId, BodyState)>,
    /// The poses of its ghosts.
    pub ghosts: Vec<(BodyId, WorldPose)>,
    /// The energy and contacts of the bodies that it owned.
    pub mechanics: Mechanics,
}

impl Sample {
    pub(super) fn of(time: Duration, node: NodeId, view: &View, tick: Tick, physics: &dyn Engine) -> Self {
        let claims = physics.claims().into_iter();
        let owned = claims.filter_map(|claim| Some((claim.id, physics.state(claim.id)?))).collect();
        let ghosts = physics.ghosts().into_iter().map(|(id, _, pose)| (id, pose)).collect();
        let (group, members, view) = (view.group, view.members.len(), view.number);
        let mechanics = physics.mechanics();
        Self { time, group, view, members, node, tick, owned, ghosts, mechanics }
    }
}
