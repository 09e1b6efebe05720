//! Tests what the server tells operators who ask for the status of the world.

use super::*;
use crate::protocol::Status;

fn ask(server: &mut Server, now: Duration, from: Peer) -> Option<Status> {
    server.handle(now, ServerEvent::Message { from, message: Message::AskStatus });
    let told = std::iter::from_fn(|| server.poll_output()).filter_map(|output| match output {
        ServerOutput::Send { to, message: Message::Status(status) } if to == from => Some(status),
        _ => None,
    });
    let mut told: Vec<_> = told.collect();
    assert!(told.len() <= 1, "one question has one answer");
    told.pop()
}

#[test]
fn who_floods_with_questions_for_the_status_is_answered_ten_times_per_second_and_keeps_nobody_else_from_it() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let [floods, other] = [ClientId(7), ClientId(8)].map(Peer::Client);
    let start = server.common.now;
    let mut answers = 0;
    for i in 0..1_000 {
        answers += u32::from(ask(&mut server, start + Duration::from_millis(i), floods).is_some());
    }
    assert_eq!(answers, 10);
    assert!(server.stale() >= 990);
    let now = start + Duration::from_secs(1);
    let status = ask(&mut server, now, other).expect("it asks for the first time");
    assert_eq!((status.nodes.len(), status.groups.len(), status.clients), (1, 1, 0), "they play no part");
    let group = &status.groups[0];
    assert_eq!((group.leader, group.regions.is_empty()), (Some(NodeId(1)), false));
    assert_eq!(group.regions.iter().map(|region| region.bodies).sum::<u32>(), status.bodies);
    // Nothing is kept of a peer whose link is gone.
    server.handle(now, ServerEvent::Disconnected(other));
    assert!(ask(&mut server, now, other).is_some());
}

#[test]
fn who_has_left_counts_in_no_delay() {
    let mut server = server();
    for node in [1, 2, 3] {
        let outputs = hello(&mut server, node, VERSION);
        obey(&mut server, node, outputs);
    }
    let delays = [(2, Some(300.0)), (3, None)].map(|(node, delay_ms)| Delay { node: NodeId(node), delay_ms });
    tell(&mut server, 1, Message::ToServer(ToServer::Delays(delays.to_vec())));
    let of_first = |server: &Server| {
        let node = &server.status().nodes[0];
        (node.node, node.delay_ms, node.unreached)
    };
    let now = server.common.now;
    assert_eq!(of_first(&server), (NodeId(1), Some(300.0), 1));
    for node in [2, 3] {
        server.handle(now, ServerEvent::Disconnected(Peer::Node(NodeId(node))));
    }
    // A node that was a member may come back for a while.
    let later = now + 2 * ABSENCE;
    server.handle_timeout(later);
    while server.poll_output().is_some() {}
    assert_eq!(of_first(&server), (NodeId(1), None, 0));
}
