//! Tests what a node hears of clients, and what it tells the one in its process.

use super::*;

/// Returns a request of a client to the server, which may be long.
fn lasting() -> FromClient {
    FromClient::Spawn { body: sim_body(BodyId::avatar(ClientId(5), 0), [1.0; 3]), shapes: Vec::new() }
}

fn says(node: &mut Node, from: Peer, message: FromClient) {
    let message = Message::FromClient(ClientId(5), message);
    node.handle(NOW, NodeEvent::Message { from, message });
}

#[test]
fn a_node_that_is_no_member_yet_fills_no_memory_while_the_view_changes() {
    let mut node = member();
    server(&mut node, ToNode::Settle { view: ViewNumber(2) });
    for _ in 0..2_000 {
        says(&mut node, Peer::Node(NodeId(3)), lasting());
    }
    assert_eq!((node.early_words.len(), node.counters().refused), (0, 2_000));
}

#[test]
fn a_node_that_is_no_member_yet_leaves_room_for_what_others_say_of_their_clients() {
    let mut node = member();
    server(&mut node, ToNode::Settle { view: ViewNumber(2) });
    let [one, other] = [3, 4].map(|id| Peer::Node(NodeId(id)));
    for _ in 0..2_000 {
        says(&mut node, one, FromClient::Interest(None));
    }
    let kept = node.early_words.len();
    assert!((1..1_000).contains(&kept), "{kept}");
    says(&mut node, other, FromClient::Interest(None));
    assert_eq!(node.early_words.len(), kept + 1, "others are not its judge");
}

#[test]
fn what_lasts_goes_to_the_server_by_the_clients_own_link_alone() {
    let mut node = member();
    let client = Peer::Client(ClientId(5));
    node.handle(NOW, NodeEvent::Connected(client));
    drain(&mut node);
    says(&mut node, client, lasting());
    assert_eq!((drain(&mut node), node.counters().refused), (vec![], 1));
}

#[test]
fn the_client_in_a_members_process_says_again_what_may_be_lost_with_the_link_to_the_leader() {
    let mut node = member_with(Some(ClientId(7)), 1, sim_world(2));
    drain(&mut node);
    let leader = Peer::Node(NodeId(1));
    node.handle(NOW, NodeEvent::Disconnected(leader));
    node.handle(NOW, NodeEvent::Connected(leader));
    let is_told = |output: &NodeOutput| matches!(output, NodeOutput::Client(ToClient::LeaderIs { .. }));
    assert!(drain(&mut node).iter().any(is_told));
}

#[test]
fn a_leader_does_no_jump_again_that_it_has_done_as_a_member_and_one_of_an_avatar_that_is_gone() {
    let jump = |client: u32| Input {
        body: BodyId::avatar(ClientId(client), 0),
        logical_time: 7,
        tick: Tick(0),
        velocity: Velocity::default(),
        pose: Some(Default::default()),
        drive: None,
    };
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    let [stays, goes] = [1, 2].map(jump);
    begin(&mut node, 1, vec![WorldOp::Input(stays), WorldOp::Input(goes)]);
    border(&mut node, 1, 1, vec![]);
    settle(&mut node);
    begin(&mut node, 2, vec![WorldOp::Remove(goes.body)]);
    border(&mut node, 1, 2, vec![]);
    settle(&mut node);
    change_view(&mut node, 2);
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Surveyed(vec![])));
    let present = node.view().unwrap().clone();
    let view = View { number: ViewNumber(2), tick: Tick(2), leader: NodeId(2), ..present };
    server(&mut node, ToNode::Adopt { view, drop: vec![] });
    let state = |input: Input| crate::protocol::SharedState {
        id: input.body,
        owner: RegionId(1),
        epoch: crate::space::Epoch(1),
        pose: Default::default(),
        velocity: Velocity::default(),
        sleeping: false,
    };
    let states = [stays, goes].map(state).to_vec();
    let report = Message::Report(crate::protocol::Report { view: ViewNumber(2), tick: Tick(2), states });
    node.handle(NOW, NodeEvent::Message { from: Peer::Node(NodeId(1)), message: report });
    for input in [stays, goes] {
        let from = Peer::Client(input.body.client().unwrap());
        let message = Message::FromClient(input.body.client().unwrap(), FromClient::Input(input));
        node.handle(NOW, NodeEvent::Message { from, message });
    }
    let due: Vec<_> = node.leader().unwrap().inputs().collect();
    assert_eq!((due, node.counters().refused), (vec![goes], 0));
}
