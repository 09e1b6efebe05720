//! Tests what the regions of a member hear of members that are lost.

use super::*;

/// Returns who is told to be gone, and in which tick, in what the physics is given.
fn gone(outputs: &[NodeOutput]) -> Vec<(RegionId, Tick)> {
    let incoming = |output: &NodeOutput| match output {
        NodeOutput::Physics(PhysicsCommand::Accept { incoming, .. }) => incoming.clone(),
        _ => Vec::new(),
    };
    let messages = outputs.iter().flat_map(incoming);
    messages.filter(|message| message.gone).map(|message| (message.from, message.tick)).collect()
}

#[test]
fn regions_hear_in_each_tick_who_is_gone_with_whom_they_would_have_exchanged() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    begin(&mut node, 1, vec![]);
    server(&mut node, ToNode::Settle { view: ViewNumber(2) });
    let dispatches = (1..4).map(|tick| dispatch(tick, vec![])).collect();
    drain(&mut node);
    // The other is lost in the middle of an exchange.
    server(
        &mut node,
        ToNode::Finish { view: ViewNumber(2), dispatches, survivors: vec![NodeId(2)], last: true },
    );
    assert_eq!(gone(&drain(&mut node)), [(RegionId(1), Tick(1))]);
    // It is lost before the next, and nothing is shared with it in the one after.
    settle(&mut node);
    assert_eq!(gone(&computed(&mut node)), [(RegionId(1), Tick(2))]);
    settle(&mut node);
    let alone = PhysicsEvent::Computed { outgoing: vec![], neighbours: vec![], removed: vec![] };
    node.handle(NOW, NodeEvent::Physics(alone));
    let said = drain(&mut node);
    let goes_on = |output: &NodeOutput| matches!(output, NodeOutput::Physics(PhysicsCommand::Accept { .. }));
    assert!(said.iter().any(goes_on) && gone(&said).is_empty(), "{said:?}");
    // A peer cannot say so of itself.
    let message =
        BorderMessage { from: RegionId(1), to: RegionId(2), gone: true, ..BorderMessage::default() };
    assert!(gone(&border(&mut member(), 1, 0, vec![message])).is_empty());
}
