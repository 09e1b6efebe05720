//! Gives a node with real physics, computed by Rapier, events that no honest member of its group sends.

use std::sync::OnceLock;

use dcd::NodeId;
use dcd::cluster::{Node, Peer};
use dcd::runtime::PhysicsDevice;

use super::nodes::{node_config, play};
use super::script::Event;
use super::seeds;

/// Runs a node that computes boxes across the borders of its regions. A node believes its server, so events
/// of the server are skipped.
pub(super) fn device(script: &[u8]) {
    static BEGINNING: OnceLock<Vec<u8>> = OnceLock::new();
    let (mut node, mut physics) = (Node::new(node_config(NodeId(2))), PhysicsDevice::new(1));
    let begin = BEGINNING.get_or_init(seeds::beginning_of_device);
    play(&mut node, &mut physics, begin, |_| false);
    assert!(node.view().is_some(), "it is a member");
    play(&mut node, &mut physics, script, is_of_server);
}

fn is_of_server(event: &Event<'_>) -> bool {
    event.peer() == Peer::Server
}
