//! Tests that who is sent away is gone.

use super::*;

const PLAYER: ClientId = ClientId(5);
const WHY: &str = "cheating";

/// Returns whether the player is welcomed as a client.
fn greets(server: &mut Server) -> bool {
    let message = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(PLAYER), message });
    let said = std::iter::from_fn(|| server.poll_output());
    said.filter(|output| matches!(output, ServerOutput::Send { to: Peer::Client(_), .. })).count() > 0
}

/// Returns a server of two nodes, of which the second, a participant, is sent away and has regions to hand over.
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
