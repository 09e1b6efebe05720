//! Defines what a server tells operators of its world: groups, regions and their owners, nodes, and how much there is of each.

use std::net::SocketAddr;

use bincode::{Decode, Encode};

use super::ViewNumber;
use crate::fidelity::FidelityReport;
use crate::space::{Bounds, ClientId, GroupId, NodeId, RegionId, Tick};

/// A world as its server knows it at one moment. Bodies are counted by its record, at most half a second old.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Status {
    /// The newest tick that a member of the main group is known to have completed.
    pub tick: Tick,
    /// The length of a tick, seconds.
    pub dt_s: f32,
    /// Movable bodies.
    pub bodies: u32,
    /// Clients that are linked.
    pub clients: u32,
    /// The group whose record is the world's.
    pub main: GroupId,
    /// In id order.
    pub groups: Vec<GroupStatus>,
    /// In id order.
    pub nodes: Vec<NodeStatus>,
}

/// A group, and how it has cut the world.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct GroupStatus {
    /// Its id.
    pub group: GroupId,
    /// Its membership.
    pub view: ViewNumber,
    /// The newest tick that a member is known to have completed.
    pub tick: Tick,
    /// The leader; `None`: no node is heard of that computes it.
    pub leader: Option<NodeId>,
    /// Whether its membership changes: ticks wait for that.
    pub is_changing: bool,
    /// Clients that play with it.
    pub clients: u32,
    /// In id order.
    pub regions: Vec<RegionStatus>,
    /// What it saves and costs that not all is computed in full, as its leader said last.
    pub fidelity: Option<FidelityReport>,
}

/// A region, and its owner.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct RegionStatus {
    /// Its id.
    pub region: RegionId,
    /// The node that computes it.
    pub owner: NodeId,
    /// Movable bodies that it owns; those of which no node has told yet in this view are counted where they are.
    pub bodies: u32,
    /// Its cell, within the bounds of the world.
    pub bounds: Bounds,
}

/// A node that has joined.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct NodeStatus {
    /// Its id.
    pub node: NodeId,
    /// Where others reach it.
    pub address: SocketAddr,
    /// The client in the same process, if it is a participant.
    pub client: Option<ClientId>,
    /// The group that it is, or is to be, a member of.
    pub group: Option<GroupId>,
    /// Whether the server has a link with it.
    pub is_linked: bool,
    /// Whether it has the world, and can be given regions.
    pub is_loaded: bool,
    /// Whether it is about to leave.
    pub is_leaving: bool,
    /// The longest round trip to other nodes, as it measures them, ms.
    pub delay_ms: Option<f32>,
    /// Other nodes that it does not reach.
    pub unreached: u32,
}
