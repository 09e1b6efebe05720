//! Tests which messages a node refuses, keeps and drops, and what becomes of bodies on their way when the
//! view changes.

mod clients;
mod lost;
mod said_again;

use super::borders::EARLY_BORDERS;
use super::*;
use crate::protocol::{Border, Chunk, Input, ToNode, Velocity, WorldOp};
use crate::sim::{sim_body, sim_world};
use crate::space::{BodyId, Epoch, RegionId};

const NOW: Duration = Duration::ZERO;

fn drain(node: &mut Node) -> Vec<NodeOutput> {
    std::iter::from_fn(|| node.poll_output()).collect()
}

fn server(node: &mut Node, message: ToNode) {
    node.handle(NOW, NodeEvent::Message { from: Peer::Server, message: Message::ToNode(message) });
}

/// Returns node 2 of two members, led by node 1, about to exchange the first borders of view 1.
fn member() -> Node {
    member_with(None, 1, sim_world(2))
}

fn member_with(client: Option<ClientId>, state_every: u32, world: EnvironmentProperties) -> Node {
    adopted(client, state_every, world).0
}

/// Returns such a node, and what it says when the view begins.
fn adopted(
    client: Option<ClientId>,
    state_every: u32,
    world: EnvironmentProperties,
) -> (Node, Vec<NodeOutput>) {
    let address = ([127, 0, 0, 1], 1).into();
    let config = NodeConfig {
        id: NodeId(2),
        address,
        client,
        interest: None,
        checkpoint_every: 1,
        patience: Duration::from_millis(100),
    };
    let world = EnvironmentProperties { state_every, ..world };
    let world_tree = world.tree.clone();
    let mut node = Node::new(config);
    node.handle(NOW, NodeEvent::Connected(Peer::Server));
    server(&mut node, ToNode::Welcome { id: NodeId(2), incarnation: 1, world });
    server(&mut node, ToNode::WorldEnd);
    let body = sim_body(BodyId::persistent(0), [12.0, 1.0, 1.0]);
    server(&mut node, ToNode::Chunk(Chunk::Placed(vec![Placed { region: RegionId(2), body }])));
    let member = |id| Member { node: NodeId(id), address, client: None };
    let view = View {
        events: false,
        viewpoints: Vec::new(),
        group: crate::space::GroupId(1),
        number: ViewNumber(1),
        tick: Tick(0),
        leader: NodeId(1),
        members: vec![member(1), member(2)],
        tree: world_tree,
        allocation: [(RegionId(1), NodeId(1)), (RegionId(2), NodeId(2))].into(),
    };
    server(&mut node, ToNode::Adopt { view, drop: vec![] });
    let said = computed(&mut node);
    (node, said)
}

#[test]
fn the_client_in_a_members_process_hears_of_the_leader_when_its_inputs_can_be_passed_on() {
    let (_, said) = adopted(Some(ClientId(7)), 1, sim_world(2));
    let leader = |output: &NodeOutput| match output {
        NodeOutput::Client(ToClient::LeaderIs { leader: Some(member), .. }) => Some(member.node),
        _ => None,
    };
    assert_eq!(said.iter().find_map(leader), Some(NodeId(1)));
    assert_eq!(adopted(None, 1, sim_world(2)).1.iter().find_map(leader), None, "it has none");
}

fn border(node: &mut Node, view: u64, tick: u64, messages: Vec<BorderMessage>) -> Vec<NodeOutput> {
    let border = Border { view: ViewNumber(view), tick: Tick(tick), round: 0, messages };
    let from = Peer::Node(NodeId(1));
    node.handle(NOW, NodeEvent::Message { from, message: Message::Border(border) });
    drain(node)
}

fn dispatch(tick: u64, ops: Vec<WorldOp>) -> Dispatch {
    Dispatch { view: ViewNumber(1), tick: Tick(tick), rounds: 1, ops }
}

/// Has the physics answer that it has computed, or taken in what the others said.
fn computed(node: &mut Node) -> Vec<NodeOutput> {
    node.handle(
        NOW,
        NodeEvent::Physics(PhysicsEvent::Computed {
            outgoing: vec![],
            neighbours: (0..9).map(RegionId).collect(),
            removed: vec![],
        }),
    );
    drain(node)
}

fn settle(node: &mut Node) -> Vec<NodeOutput> {
    let settled = PhysicsEvent::Settled {
        rounds_wanted: 1,
        stats: Default::default(),
        holds: vec![],
        events: vec![],
        answers: vec![],
        report: vec![],
        checkpoint: vec![],
        load: None,
        regions: vec![],
    };
    node.handle(NOW, NodeEvent::Physics(settled));
    drain(node)
}

#[test]
fn a_round_goes_to_the_physics_when_the_last_member_has_spoken() {
    let outputs = border(&mut member(), 1, 0, vec![]);
    assert!(
        matches!(outputs[..], [NodeOutput::Physics(PhysicsCommand::Accept { tick: Tick(0), .. })]),
        "{outputs:?}"
    );
}

#[test]
fn a_message_of_an_earlier_view_does_not_count() {
    let mut node = member();
    assert_eq!(border(&mut node, 0, 0, vec![]), []);
    assert_eq!(node.counters().stale, 1);
}

#[test]
fn early_messages_are_kept_up_to_a_bound() {
    let mut node = member();
    for tick in 1..=10 {
        border(&mut node, 1, tick, vec![]);
    }
    assert_eq!(node.counters().overflow, 10 - EARLY_BORDERS as u64);
}

#[test]
fn a_member_speaks_for_its_own_regions_only() {
    let mut node = member();
    let forged = BorderMessage { from: RegionId(2), to: RegionId(2), ..BorderMessage::default() };
    let outputs = border(&mut node, 1, 0, vec![forged]);
    let [NodeOutput::Physics(PhysicsCommand::Accept { incoming, .. })] = &outputs[..] else {
        panic!("{outputs:?}")
    };
    assert!(incoming.is_empty());
    assert_eq!(node.counters().refused, 1);
}

#[test]
fn a_message_that_names_regions_which_are_not_there_is_refused() {
    let mut node = member();
    let mut holders = crate::space::RegionSet::EMPTY;
    holders.insert(2);
    let body = sim_body(BodyId::persistent(3), [9.0, 1.0, 1.0]);
    let transfers = vec![crate::protocol::Transfer { body, holders, whole: false }];
    let forged = BorderMessage { from: RegionId(1), to: RegionId(2), transfers, ..BorderMessage::default() };
    let outputs = border(&mut node, 1, 0, vec![forged]);
    assert!(
        matches!(&outputs[..], [NodeOutput::Physics(PhysicsCommand::Accept { incoming, .. })] if incoming.is_empty()),
        "{outputs:?}"
    );
    assert_eq!(node.counters().refused, 1);
}

#[test]
fn a_message_that_names_an_epoch_which_cannot_be_is_refused() {
    let (one, two) = (Epoch::placed_in(1), Epoch::placed_in(2));
    let says = |node: &mut Node, tick, epoch: Epoch| {
        let mut said = handing_over(tick, &[OTHER]);
        said.transfers[0].body.epoch = epoch;
        let before = node.counters().refused;
        border(node, 1, tick, vec![said]);
        node.counters().refused == before
    };
    for (epoch, counts) in [
        (one, true),
        (one.next(), true),
        (one.next().next(), false),
        (two, false),
        (Epoch::placed_in(1 << 38), false),
    ] {
        assert_eq!(says(&mut member(), 0, epoch), counts, "{epoch}");
    }
    let mut member = member();
    assert!(says(&mut member, 0, one));
    settle(&mut member);
    let mut body = sim_body(BodyId::persistent(5), [9.0, 1.0, 1.0]);
    body.epoch = two;
    begin(&mut member, 1, vec![WorldOp::Insert { bodies: vec![body], shapes: vec![], joints: vec![] }]);
    assert!(says(&mut member, 1, two.next()), "placed in a later view of another group");
}

#[test]
fn guesses_are_told_as_often_as_ticks_that_count() {
    let mut node = member_with(Some(ClientId(1)), 3, sim_world(2));
    let mut told = Vec::new();
    for _ in 0..7 {
        node.handle_timeout(node.poll_timeout().expect("a guess is due").max(Duration::from_millis(100)));
        let speculated = NodeEvent::Physics(PhysicsEvent::Speculated(vec![]));
        assert!(matches!(drain(&mut node).last(), Some(NodeOutput::Physics(PhysicsCommand::Speculate(_)))));
        node.handle(NOW, speculated);
        told.extend(drain(&mut node).into_iter().filter_map(|output| match output {
            NodeOutput::Client(ToClient::States { stamp, .. }) => Some((stamp.tick.0, stamp.speculative)),
            _ => None,
        }));
    }
    assert_eq!(told, [(1, true), (4, true), (7, true)]);
}

#[test]
fn who_has_patience_for_ever_never_guesses() {
    let mut node = member_with(Some(ClientId(1)), 3, sim_world(2));
    (node.config.patience, node.since) = (Duration::MAX, Duration::from_secs(1));
    node.handle_timeout(Duration::from_secs(1_000));
    let guesses = |output: &NodeOutput| matches!(output, NodeOutput::Physics(PhysicsCommand::Speculate(_)));
    assert!(!drain(&mut node).iter().any(guesses));
}

#[test]
fn only_the_leader_dispatches_and_nothing_starts_while_the_view_changes() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    let dispatch = |from, tick| NodeEvent::Message {
        from: Peer::Node(NodeId(from)),
        message: Message::Dispatch(dispatch(tick, vec![])),
    };
    node.handle(NOW, dispatch(3, 1));
    node.handle(NOW, dispatch(1, 2));
    assert_eq!((drain(&mut node), node.counters().stale), (vec![], 2));
    server(&mut node, ToNode::Settle { view: ViewNumber(2) });
    drain(&mut node);
    node.handle(NOW, dispatch(1, 1));
    node.handle(NOW, dispatch(1, 3));
    assert_eq!((drain(&mut node), node.counters().stale), (vec![], 3));
    // Nothing comes of the change, so what the leader said meanwhile counts.
    node.handle(NOW, NodeEvent::Disconnected(Peer::Server));
    let outputs = drain(&mut node);
    assert!(
        matches!(outputs[..], [NodeOutput::Physics(PhysicsCommand::Step { tick: Tick(1), .. })]),
        "{outputs:?}"
    );
}

#[test]
fn a_client_linked_to_a_node_cannot_speak_for_another() {
    let mut node = member();
    let input = Input {
        body: BodyId::default(),
        logical_time: 1,
        tick: Tick(0),
        velocity: Velocity::default(),
        pose: None,
        drive: None,
    };
    let message = Message::FromClient(ClientId(2), FromClient::Input(input));
    node.handle(NOW, NodeEvent::Message { from: Peer::Client(ClientId(1)), message });
    assert_eq!(node.counters().refused, 1);
}

#[test]
fn who_was_told_to_finish_a_tick_tells_of_it_when_the_view_changes_again() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    server(&mut node, ToNode::Settle { view: ViewNumber(2) });
    let (dispatches, survivors) = (vec![dispatch(1, vec![])], vec![NodeId(1), NodeId(2)]);
    server(
        &mut node,
        ToNode::Finish { view: ViewNumber(2), dispatches: dispatches.clone(), survivors, last: true },
    );
    drain(&mut node);
    server(&mut node, ToNode::Settle { view: ViewNumber(3) });
    let settling = ToServer::Settling { view: ViewNumber(3), dispatches, undone: Vec::new(), last: true };
    assert_eq!(
        drain(&mut node),
        [NodeOutput::Send { to: Peer::Server, message: Message::ToServer(settling) }]
    );
}

#[test]
fn the_newest_tick_is_told_even_when_completed_as_others_may_not_have_heard_of_it() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    for tick in [1, 2] {
        begin(&mut node, tick, vec![]);
        border(&mut node, 1, tick, vec![]);
        settle(&mut node);
    }
    server(&mut node, ToNode::Settle { view: ViewNumber(2) });
    let settling = ToServer::Settling {
        view: ViewNumber(2),
        dispatches: vec![dispatch(2, vec![])],
        undone: Vec::new(),
        last: true,
    };
    assert_eq!(
        drain(&mut node),
        [NodeOutput::Send { to: Peer::Server, message: Message::ToServer(settling) }]
    );
}

#[test]
fn what_is_told_of_a_view_change_goes_in_parts_that_each_are_a_message() {
    let mut node = member_out_of_step();
    let field = |x| {
        crate::protocol::ShapeRecord::HeightField(vec![x; 2_250_000], 1_500, 1_500, [1.0; 3], 0, Vec::new())
    };
    let brings = |x| WorldOp::Insert { bodies: vec![], shapes: vec![field(x)], joints: vec![] };
    for (tick, x) in [(3, 1.0), (4, 2.0)] {
        let message = Message::Dispatch(dispatch(tick, vec![brings(x)]));
        node.handle(NOW, NodeEvent::Message { from: Peer::Node(NodeId(1)), message });
    }
    let before: Vec<_> = node.dispatches.iter().cloned().collect();
    assert_eq!(before.iter().rev().map(|dispatch| dispatch.tick.0).take(2).collect::<Vec<_>>(), [4, 3]);
    drain(&mut node);
    let view = ViewNumber(2);
    server(&mut node, ToNode::Settle { view });
    let (mut told, mut ends) = (Vec::new(), Vec::new());
    for output in drain(&mut node) {
        let NodeOutput::Send { to: Peer::Server, message } = output else { continue };
        let message = crate::protocol::decode(&crate::protocol::encode(&message)).unwrap();
        let Message::ToServer(ToServer::Settling { dispatches, last, .. }) = message else { continue };
        told.extend(dispatches);
        ends.push(last);
    }
    assert!(told == before, "all of them, in order");
    assert_eq!(ends.iter().filter(|last| **last).count(), 1);
    assert!(ends.len() > 1 && ends.ends_with(&[true]), "{ends:?}");
    // The node is told in parts, too, what it is to complete.
    let survivors = vec![NodeId(1), NodeId(2)];
    let mut parts = told.into_iter().map(|one| vec![one]).peekable();
    while let Some(dispatches) = parts.next() {
        assert!(!node.change.as_ref().is_some_and(|change| change.finish));
        let (survivors, last) = (survivors.clone(), parts.peek().is_none());
        server(&mut node, ToNode::Finish { view, dispatches, survivors, last });
    }
    assert!(node.change.as_ref().is_some_and(|change| change.finish));
    assert!(node.dispatches == before);
}

const DRIVEN: BodyId = BodyId::avatar(ClientId(1), 0);
const REMOVED: BodyId = BodyId::avatar(ClientId(2), 0);
const OTHER: BodyId = BodyId::persistent(7);
const FAST: Velocity = Velocity { linear: [5.0, 0.0, 0.0], angular: [0.0; 3] };

fn handing_over(tick: u64, ids: &[BodyId]) -> BorderMessage {
    let transfer = |&id: &BodyId| crate::protocol::Transfer {
        body: sim_body(id, [9.0, 1.0, 1.0]),
        holders: crate::space::RegionSet::EMPTY,
        whole: false,
    };
    let (from, to, transfers) = (RegionId(1), RegionId(2), ids.iter().map(transfer).collect());
    BorderMessage { from, to, tick: Tick(tick), transfers, ..BorderMessage::default() }
}

/// Returns the same member of a world whose members are two ticks apart, after the second tick. Two avatars
/// are on their way to it since the first tick: the second tick drives one and removes the other. Another
/// body is on its way since the second tick.
fn member_out_of_step() -> Node {
    let protocol = crate::protocol::SyncProtocol::Unsynchronised { lag_ticks: 2 };
    let mut node = member_with(None, 1, EnvironmentProperties { protocol, ..sim_world(2) });
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    border(&mut node, 1, 1, vec![handing_over(1, &[DRIVEN, REMOVED])]);
    border(&mut node, 1, 2, vec![handing_over(2, &[OTHER])]);
    let input =
        Input { body: DRIVEN, logical_time: 1, tick: Tick(0), velocity: FAST, pose: None, drive: None };
    complete(&mut node, 1, vec![]);
    complete(&mut node, 2, vec![WorldOp::Input(input), WorldOp::Remove(REMOVED)]);
    node
}

#[test]
fn who_is_ahead_of_its_leader_says_all_again_that_a_broken_link_may_have_lost() {
    let mut node = member_out_of_step();
    let leader = Peer::Node(NodeId(1));
    let number = 7;
    begin(&mut node, 3, vec![]);
    let settled = PhysicsEvent::Settled {
        rounds_wanted: 1,
        stats: Default::default(),
        holds: vec![DRIVEN],
        events: vec![],
        answers: vec![crate::protocol::Answer {
            client: ClientId(1),
            number,
            found: crate::protocol::QueryResult::Rays(vec![None]),
        }],
        report: vec![],
        checkpoint: vec![],
        load: None,
        regions: vec![],
    };
    node.handle(NOW, NodeEvent::Physics(settled));
    complete(&mut node, 4, vec![]);
    drain(&mut node);
    node.handle(NOW, NodeEvent::Disconnected(leader));
    node.handle(NOW, NodeEvent::Connected(leader));
    let said = drain(&mut node).into_iter().filter_map(|output| match output {
        NodeOutput::Send { message: Message::Done(done), .. } => Some(done),
        _ => None,
    });
    let said: Vec<_> = said.collect();
    assert_eq!(said.iter().map(|done| done.tick.0).collect::<Vec<_>>(), [2, 3, 4]);
    assert_eq!(said[1].holds, Some(vec![DRIVEN]));
    assert_eq!(said[1].answers.iter().map(|answer| answer.number).collect::<Vec<_>>(), [number]);
}

#[test]
fn members_begin_a_view_together_even_if_they_need_not_keep_in_step_later() {
    let protocol = crate::protocol::SyncProtocol::Unsynchronised { lag_ticks: 2 };
    let world = EnvironmentProperties { protocol, ..sim_world(2) };
    let (mut node, said) = adopted(None, 1, world);
    let accepts = |outputs: &[NodeOutput]| {
        outputs.iter().any(|output| matches!(output, NodeOutput::Physics(PhysicsCommand::Accept { .. })))
    };
    assert!(!accepts(&said), "the other has not begun");
    assert!(accepts(&border(&mut node, 1, 0, vec![])));
    settle(&mut node);
    assert!(accepts(&begin(&mut node, 1, vec![])), "from here on it need not wait");
}

fn begin(node: &mut Node, tick: u64, ops: Vec<WorldOp>) -> Vec<NodeOutput> {
    let message = Message::Dispatch(dispatch(tick, ops));
    node.handle(NOW, NodeEvent::Message { from: Peer::Node(NodeId(1)), message });
    computed(node)
}

fn complete(node: &mut Node, tick: u64, ops: Vec<WorldOp>) {
    begin(node, tick, ops);
    settle(node);
}

/// Has all members stop, and finish what they have begun.
fn change_view(node: &mut Node, number: u64) -> Vec<NodeOutput> {
    let view = ViewNumber(number);
    server(node, ToNode::Settle { view });
    let outputs = drain(node);
    let [NodeOutput::Send { message: Message::ToServer(ToServer::Settling { dispatches, .. }), .. }] =
        &outputs[..]
    else {
        panic!("{outputs:?}")
    };
    let (dispatches, survivors) = (dispatches.clone(), vec![NodeId(1), NodeId(2)]);
    server(node, ToNode::Finish { view, dispatches, survivors, last: true });
    drain(node)
}

/// Returns the bodies, and their velocities, in the others' border messages that the physics is given.
fn arriving(outputs: &[NodeOutput]) -> Vec<(BodyId, Velocity)> {
    let incoming = match outputs.last() {
        Some(NodeOutput::Physics(PhysicsCommand::Accept { incoming, .. })) => incoming,
        Some(NodeOutput::Physics(PhysicsCommand::Drain { incoming, .. })) => incoming,
        _ => panic!("{outputs:?}"),
    };
    let transfers = incoming.iter().flat_map(|message| &message.transfers);
    transfers.map(|transfer| (transfer.body.id, transfer.body.state.velocity)).collect()
}

/// Returns the bodies that the server is told are removed.
fn removed(outputs: &[NodeOutput]) -> Vec<BodyId> {
    let of = |output: &NodeOutput| match output {
        NodeOutput::Send { message: Message::ToServer(ToServer::Removed { bodies, .. }), .. } => {
            bodies.iter().map(|body| body.id).collect()
        }
        _ => Vec::new(),
    };
    outputs.iter().flat_map(of).collect()
}

#[test]
fn what_happens_to_bodies_on_their_way_counts_when_they_arrive() {
    let outputs = begin(&mut member_out_of_step(), 3, vec![]);
    assert_eq!((arriving(&outputs), removed(&outputs)), (vec![(DRIVEN, FAST)], vec![REMOVED]));
}

#[test]
fn when_the_view_changes_all_that_is_on_its_way_arrives_and_once() {
    let mut node = member_out_of_step();
    let outputs = change_view(&mut node, 2);
    let all = vec![(DRIVEN, FAST), (OTHER, Velocity::default())];
    assert_eq!((arriving(&outputs), removed(&outputs)), (all, vec![REMOVED]));
    // The server dies, and the group goes on as it was.
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Drained));
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Surveyed(vec![])));
    node.handle(NOW, NodeEvent::Disconnected(Peer::Server));
    drain(&mut node);
    let outputs = begin(&mut node, 3, vec![]);
    assert_eq!((arriving(&outputs), removed(&outputs)), (vec![], vec![]));
    settle(&mut node);
    border(&mut node, 1, 3, vec![]);
    let outputs = change_view(&mut node, 3);
    assert!(matches!(outputs[..], [NodeOutput::Physics(PhysicsCommand::Survey)]), "{outputs:?}");
}

#[test]
fn who_began_anew_and_is_still_taken_for_a_member_is_surveyed_without_a_view() {
    let mut node = member();
    server(&mut node, ToNode::Welcome { id: NodeId(2), incarnation: 1, world: sim_world(2) });
    let (view, survivors) = (ViewNumber(2), vec![NodeId(1), NodeId(2)]);
    server(&mut node, ToNode::Settle { view });
    server(&mut node, ToNode::Finish { view, dispatches: vec![], survivors, last: true });
    drain(&mut node);
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Surveyed(vec![])));
    let said = drain(&mut node);
    let is_survey = |output: &NodeOutput| {
        matches!(
            output,
            NodeOutput::Send { message: Message::ToServer(ToServer::Survey { division: None, .. }), .. }
        )
    };
    assert!(said.iter().any(is_survey), "{said:?}");
}

#[test]
fn border_messages_go_to_members_with_neighbours_and_only_theirs_are_waited_for() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    let from = Peer::Node(NodeId(1));
    node.handle(NOW, NodeEvent::Message { from, message: Message::Dispatch(dispatch(1, vec![])) });
    drain(&mut node);
    let alone = PhysicsEvent::Computed { outgoing: vec![], neighbours: vec![], removed: vec![] };
    node.handle(NOW, NodeEvent::Physics(alone));
    let said = drain(&mut node);
    let is_border =
        |output: &NodeOutput| matches!(output, NodeOutput::Send { message: Message::Border(_), .. });
    assert!(!said.iter().any(is_border), "{said:?}");
    let goes_on = |output: &NodeOutput| matches!(output, NodeOutput::Physics(PhysicsCommand::Accept { .. }));
    assert!(said.iter().any(goes_on), "nobody is waited for: {said:?}");
}

#[test]
fn the_interest_of_a_participant_that_begins_the_view_before_its_leader_is_not_lost() {
    let (mut node, client) = (member(), ClientId(5));
    let area = crate::protocol::Area { centre: [0.0; 3], radius_m: 3.0 };
    let interest = || NodeEvent::Message {
        from: Peer::Node(NodeId(3)),
        message: Message::FromClient(client, FromClient::Interest(Some(area))),
    };
    node.handle(NOW, interest());
    assert_eq!(node.counters().refused, 1, "it is no member, and none is to come");
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    let view = ViewNumber(2);
    server(&mut node, ToNode::Settle { view });
    node.handle(NOW, interest());
    let survivors = vec![NodeId(1), NodeId(2)];
    server(&mut node, ToNode::Finish { view, dispatches: vec![], survivors, last: true });
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Surveyed(vec![])));
    let member = |id, client| Member { node: NodeId(id), address: ([127, 0, 0, 1], 1).into(), client };
    let present = node.view().unwrap().clone();
    let members = vec![member(1, None), member(2, None), member(3, Some(client))];
    let view = View { number: view, leader: NodeId(2), members, ..present };
    server(&mut node, ToNode::Adopt { view, drop: vec![] });
    assert_eq!(node.counters().refused, 1);
    let handed_on = node.leader.clone().unwrap().into_legacy().0;
    assert_eq!(handed_on, [(client, FromClient::Interest(Some(area)))]);
}

#[test]
fn a_leader_that_stops_tells_what_it_had_not_passed_on() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    change_view(&mut node, 2);
    node.handle(NOW, NodeEvent::Physics(PhysicsEvent::Surveyed(vec![])));
    let view = View { number: ViewNumber(2), leader: NodeId(2), ..node.view().unwrap().clone() };
    server(&mut node, ToNode::Adopt { view, drop: vec![] });
    let push = WorldOp::Push(crate::protocol::Push::impulse(OTHER, [1.0; 3]));
    let ops = vec![push.clone(), WorldOp::Remove(OTHER)];
    server(&mut node, ToNode::Apply { view: ViewNumber(2), first: 0, ops });
    drain(&mut node);
    server(&mut node, ToNode::Settle { view: ViewNumber(3) });
    let said = drain(&mut node);
    let told = said.iter().filter_map(|output| match output {
        NodeOutput::Send { message: Message::ToServer(ToServer::Settling { undone, .. }), .. } => {
            Some(undone)
        }
        _ => None,
    });
    assert_eq!(told.flatten().collect::<Vec<_>>(), [&push], "{said:?}");
}

#[test]
fn before_the_server_has_named_a_world_nothing_of_one_counts() {
    let address = ([127, 0, 0, 1], 1).into();
    let patience = Duration::from_millis(100);
    let config =
        NodeConfig { id: NodeId(1), address, client: None, interest: None, checkpoint_every: 1, patience };
    let mut node = Node::new(config);
    node.handle(NOW, NodeEvent::Connected(Peer::Server));
    let world = sim_world(2);
    let view = View {
        events: false,
        viewpoints: Vec::new(),
        group: crate::space::GroupId(1),
        number: ViewNumber(1),
        tick: Tick(0),
        leader: NodeId(1),
        members: vec![Member { node: NodeId(1), address, client: None }],
        allocation: world.tree.leaves().map(|region| (region, NodeId(1))).collect(),
        tree: world.tree,
    };
    drain(&mut node);
    server(&mut node, ToNode::Chunk(Chunk::Bodies(vec![sim_body(OTHER, [1.0; 3])])));
    server(&mut node, ToNode::Adopt { view, drop: vec![] });
    assert_eq!((drain(&mut node), node.counters().refused), (vec![], 2));
}

#[test]
fn a_leader_that_opens_ticks_which_cannot_be_is_not_followed_there() {
    let mut node = member();
    border(&mut node, 1, 0, vec![]);
    settle(&mut node);
    let from = Peer::Node(NodeId(1));
    for tick in 1..100 {
        node.handle(NOW, NodeEvent::Message { from, message: Message::Dispatch(dispatch(tick, vec![])) });
    }
    assert_eq!((node.dispatches.len(), node.counters().stale), (1, 98), "nobody has completed the first");
}

/// Returns a roster of nodes 1 and 2, and of node 3 at a port, if it is there; and node 3's entry.
fn roster(port: Option<u16>) -> (Option<Member>, Message) {
    let at = |id, port| Member { node: NodeId(id), address: ([127, 0, 0, 1], port).into(), client: None };
    let third = port.map(|port| at(3, port));
    let all = [at(1, 1), at(2, 1)].into_iter().chain(third.clone()).collect();
    (third, Message::ToNode(ToNode::Roster(all)))
}

fn hears_roster(node: &mut Node, port: Option<u16>) -> Option<Member> {
    let (third, message) = roster(port);
    node.handle(NOW, NodeEvent::Message { from: Peer::Server, message });
    third
}

fn dials(node: &mut Node, to: Option<Member>) -> bool {
    node.handle_timeout(NOW);
    to.is_some_and(|to| drain(node).contains(&NodeOutput::Connect(to)))
}

#[test]
fn a_link_that_comes_up_while_its_peer_is_forgotten_is_not_closed_in_place_of_the_one_before() {
    let (mut node, peer) = (member(), Peer::Node(NodeId(3)));
    hears_roster(&mut node, Some(3));
    node.handle(NOW, NodeEvent::Connected(peer));
    drain(&mut node);
    node.handle(NOW, NodeEvent::Disconnected(peer));
    let before = roster(Some(3)).0;
    assert!(dials(&mut node, before), "again, since its link is gone");
    // Both events come in one turn: the node's outputs are carried out after both.
    hears_roster(&mut node, None);
    node.handle(NOW, NodeEvent::Connected(peer));
    if !drain(&mut node).contains(&NodeOutput::Disconnect(NodeId(3))) {
        node.handle(NOW, NodeEvent::Disconnected(peer));
    }
    let back = hears_roster(&mut node, Some(4));
    assert!(dials(&mut node, back), "it has come back elsewhere");
}

#[test]
fn who_comes_back_elsewhere_is_dialled_there_though_an_attempt_is_under_way() {
    let mut node = member();
    let first = hears_roster(&mut node, Some(3));
    assert!(dials(&mut node, first.clone()));
    hears_roster(&mut node, Some(3));
    assert!(!dials(&mut node, first), "an attempt is under way");
    let moved = hears_roster(&mut node, Some(4));
    assert!(dials(&mut node, moved));
}
