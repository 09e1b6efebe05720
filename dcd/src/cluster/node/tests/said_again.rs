//! Tests what a leader does with what its server says again.

use super::*;
use crate::protocol::Push;

/// Returns a node that leads view 2.
fn leads() -> Node {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    change_view(&mut node, 2);
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Surveyed(vec![])));
    let view = View { number: ViewNumber(2), leader: NodeId(2), ..node.view().unwrap().clone() };
    server(&mut node, ToNode::Adopt { view, drop: vec![] });
    drain(&mut node);
    node
}

#[test]
fn what_a_server_says_before_it_knows_what_was_lost_is_done_once_and_in_its_place() {
    let [one, two, three] =
        [1, 2, 3].map(|index| WorldOp::Push(Push::impulse(BodyId::persistent(index), [1.0; 3])));
    let mut node = leads();
    let apply = |node: &mut Node, first, ops: &[WorldOp]| {
        server(node, ToNode::Apply { view: ViewNumber(2), first, ops: ops.to_vec() });
    };
    apply(&mut node, 0, std::slice::from_ref(&one));
    // The next operation was lost with a link, of which the server does not know yet.
    let gone = WorldOp::Remove(OTHER);
    apply(&mut node, 2, &[three.clone(), gone.clone()]);
    node.handle(NOW, NodeEvent::Disconnected(Peer::Server));
    node.handle(NOW, NodeEvent::Connected(Peer::Server));
    let heard = drain(&mut node).into_iter().find_map(|output| match output {
        NodeOutput::Send { message: Message::ToServer(_), .. } => None,
        NodeOutput::Send { message: Message::Hello(hello), .. } => Some(hello.role),
        _ => None,
    });
    let resumes =
        |role| matches!(role, crate::protocol::JoinAs::Node { resume: Some(ViewNumber(2)), heard: 1, .. });
    assert!(heard.is_some_and(resumes), "{heard:?}");
    apply(&mut node, 1, &[two.clone(), three.clone()]);
    let undone = node.leader().expect("it leads").undone();
    assert_eq!(undone, [one, two, three]);
}
