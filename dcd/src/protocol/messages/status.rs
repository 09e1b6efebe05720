//! Defines what a server tells operators about its world: groups, regions and their owners, nodes, and the
//! number of each.

use std::net::SocketAddr;

use bincode::{Decode, Encode};

use super::ViewNumber;
use crate::fidelity::FidelityReport;
use crate::space::{Bounds, ClientId, GroupId, NodeId, RegionId, Tick};

/// A world as its server knows it at one moment. Bodies are counted by the server's record, which is at most
/// half a second old.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Status {
    /// The newest tick that a member of the main group is known to have completed.
    pub tick: Tick,
    /// The time since the server heard of that tick, milliseconds. It hears twice per second.
    pub heard_ms: u32,
    /// The length of a tick, seconds.
    pub dt_s: f32,
    /// The number of movable bodies.
    pub bodies: u32,
    /// The number of clients that are linked.
    pub clients: u32,
    /// The group whose record is the world's.
    pub main: GroupId,
    /// The groups, in id order.
    pub groups: Vec<GroupStatus>,
    /// The nodes, in id order.
    pub nodes: Vec<NodeStatus>,
}

/// A group, with how it has cut the world.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct GroupStatus {
    /// The id of the group.
    pub group: GroupId,
    /// The view of the group.
    pub view: ViewNumber,
    /// The newest tick that a member is known to have completed.
    pub tick: Tick,
    /// The leader; `None` if no node is heard of that computes the group.
    pub leader: Option<NodeId>,
    /// Says whether the membership is changing, so that ticks wait.
    pub is_changing: bool,
    /// The number of clients that belong to the group.
    pub clients: u32,
    /// The regions, in id order.
    pub regions: Vec<RegionStatus>,
    /// What it saves and costs that not everything is computed in full, as the leader said last.
    pub fidelity: Option<FidelityReport>,
}

/// A region and its owner.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct RegionStatus {
    /// The id of the region.
    pub region: RegionId,
    /// The node that computes it.
    pub owner: NodeId,
    /// The number of movable bodies that the region owns. Bodies that no node has told of yet in this view
    /// are counted where they are.
    pub bodies: u32,
    /// The cell of the region, within the bounds of the world.
    pub bounds: Bounds,
}

/// A node that has joined.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct NodeStatus {
    /// The id of the node.
    pub node: NodeId,
    /// The address at which others reach it.
    pub address: SocketAddr,
    /// The client in the same process, if it is a participant.
    pub client: Option<ClientId>,
    /// The group that it is a member of, or is to be.
    pub group: Option<GroupId>,
    /// Says whether the server has a link with it.
    pub is_linked: bool,
    /// Says whether it has the world, so that it can be given regions.
    pub is_loaded: bool,
    /// Says whether it is about to leave.
    pub is_leaving: bool,
    /// The longest round trip to other nodes, as it measures them, milliseconds.
    pub delay_ms: Option<f32>,
    /// The number of other nodes that it does not reach.
    pub unreached: u32,
}
