//! Tests that a process that is sent away is gone, and that nothing is kept of bodies that are gone.

use super::*;
use crate::cluster::Key;
use crate::protocol::{Alteration, BodyKind, BuildOp};

const PLAYER: ClientId = ClientId(5);
const WHY: &str = "cheating";

/// Returns whether the player is welcomed as a client.
fn greets(server: &mut Server) -> bool {
    let message = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(PLAYER), message });
    let said = std::iter::from_fn(|| server.poll_output());
    said.filter(|output| matches!(output, ServerOutput::Send { to: Peer::Client(_), .. })).count() > 0
}

/// Returns a server of two nodes. The second is a participant that is sent away and has regions to hand over.
fn server_that_sends_away() -> Server {
    let mut server = server_of_two();
    server.common.nodes.get_mut(&NodeId(2)).unwrap().member.client = Some(PLAYER);
    assert!(greets(&mut server));
    let (node, client) = (Some(NodeId(2)), Some(PLAYER));
    server.handle(NOW, ServerEvent::SendAway { node, client, reason: WHY.to_owned() });
    assert!(server.is_changing());
    server
}

#[test]
fn who_is_sent_away_is_no_player_again_by_a_greeting_on_the_link_that_it_has() {
    let mut server = server_that_sends_away();
    assert!(!greets(&mut server));
    assert_eq!(server.linked_clients().count(), 0);
}

#[test]
fn who_is_sent_away_is_no_node_again_by_a_greeting_on_the_link_that_it_has() {
    let mut server = server_that_sends_away();
    let outputs = hello(&mut server, 2, VERSION);
    assert!(!welcomed(&outputs, 2));
    let (peer, reason) = (Peer::Node(NodeId(2)), WHY.to_owned());
    assert!(outputs.contains(&ServerOutput::Close { peer, farewell: Farewell::SentAway, reason }));
    obey(&mut server, 1, outputs);
    assert_eq!(server.linked_nodes().collect::<Vec<_>>(), [NodeId(1)]);
    assert_eq!(server.view().map(|view| view.members.len()), Some(1));
}

#[test]
fn nothing_is_kept_of_bodies_that_are_gone() {
    let [one, wall] = [0, 2].map(BodyId::persistent);
    let mut bodies: Vec<_> =
        (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    Arc::make_mut(&mut bodies[2].traits).kind = BodyKind::Fixed;
    let joints = vec![vicinity::joint(1, 0, 1), vicinity::joint(2, 1, 2)];
    let mut server = Server::new(config(1), Record::new(bodies, Vec::new(), joints.clone()));
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let brief = sim_body(BodyId::persistent(7), [3.0; 3]);
    let insert = BuildOp::Insert { bodies: vec![brief.clone()], shapes: Vec::new(), joints: Vec::new() };
    let alter = joints.into_iter().map(|joint| BuildOp::Alter(Alteration::Joint(Box::new(joint))));
    server.handle(NOW, ServerEvent::Program(alter.chain([insert]).collect()));
    assert_eq!((server.main().retold.keys().len(), server.main().arriving.len()), (2, 1));
    let gone = [one, brief.id].map(|id| server.record().body(id).unwrap().clone());
    let remove = [one, brief.id, wall].map(BuildOp::Remove);
    server.handle(NOW, ServerEvent::Program(remove.to_vec()));
    let view = server.view().unwrap().number;
    let removed = ToServer::Removed { view, tick: Tick(1), bodies: gone.to_vec() };
    tell(&mut server, 1, Message::ToServer(removed));
    let kept = (server.main().retold.keys(), server.main().arriving.len());
    assert_eq!(kept, ([Key::GoneScenery(wall)].into(), 0));
}
