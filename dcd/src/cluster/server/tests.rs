//! Tests rules of the server that a calm simulation does not show: on versions, lost links, view changes and
//! authority.

mod asked;
mod building;
mod hostile;
mod leaving;
mod lying;
mod participants;
mod status;
mod unused;
mod verdicts;
mod vicinity;

use std::sync::Arc;

use super::*;
use crate::cluster::{Call, VoteRefusal};
use crate::protocol::{BodyCheckpoint, BodyRecord, Claim, Delay, DelayThresholds, Dispatch, Stance};
use crate::protocol::{Chunk, FromClient, Motion, Pose, ShapeRecord, ToNode, ToServer};
use crate::sim::{sim_body, sim_collider as collider, sim_world};
use crate::space::{Epoch, RegionId};

const NOW: Duration = Duration::ZERO;

/// Returns the configuration of a server for a world in which cones cannot be built.
fn config(min_nodes: usize) -> ServerConfig {
    let can_build = |_: &_, shapes: &[_]| !shapes.iter().any(|shape| matches!(shape, ShapeRecord::Cone(..)));
    ServerConfig {
        world: sim_world(2),
        incarnation: 1,
        min_nodes,
        grouping: Default::default(),
        avatar_expiry: 10 * ABSENCE,
        events: false,
        can_build,
    }
}

fn server() -> Server {
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    Server::new(config(1), Record::new(bodies, Vec::new(), Vec::new()))
}

fn hello(server: &mut Server, node: u32, version: u32) -> Vec<ServerOutput> {
    let role =
        JoinAs::Node { address: ([127, 0, 0, 1], node as u16).into(), client: None, resume: None, heard: 0 };
    tell(server, node, Message::Hello(Hello { version, role }))
}

fn tell(server: &mut Server, node: u32, message: Message) -> Vec<ServerOutput> {
    let now = server.common.now;
    server.handle(now, ServerEvent::Message { from: Peer::Node(NodeId(node)), message });
    let is_said = |output: &ServerOutput| !matches!(output, ServerOutput::Store(_));
    std::iter::from_fn(|| server.poll_output()).filter(is_said).collect()
}

#[test]
fn no_vote_lets_a_group_grow_beyond_the_size_of_its_grouping() {
    for (max_size, refusal) in [(3, Some(VoteRefusal::Full)), (4, None)] {
        let mut config = config(1);
        config.grouping.max_size = max_size;
        let mut server = Server::new(config, Record::default());
        let (group, present) = ([1, 2, 3].map(NodeId), [NodeId(4)]);
        let motion = Motion::Include(NodeId(4));
        let call = Call { caller: NodeId(1), motion, group: &group, present: &present, changing: false };
        assert_eq!(server.polls.call(Duration::from_secs(1_000), &call).err(), refusal);
    }
}

#[test]
fn a_node_of_another_version_is_told_so_and_let_go() {
    let outputs = hello(&mut server(), 1, VERSION + 1);
    let [
        ServerOutput::Send {
            message: Message::ToNode(ToNode::Shutdown { farewell: Farewell::Refused, reason }),
            ..
        },
        ServerOutput::Close { .. },
    ] = &outputs[..]
    else {
        panic!("{outputs:?}")
    };
    assert!(reason.contains("install the same dcd"), "{reason}");
}

#[test]
fn a_member_that_greets_as_another_version_or_role_amid_a_view_change_does_not_stop_the_world() {
    let client = JoinAs::Client { interest: None };
    let node = JoinAs::Node { address: ([127, 0, 0, 1], 2).into(), client: None, resume: None, heard: 0 };
    for (version, role) in [(VERSION + 1, node), (VERSION, client)] {
        let mut server = server_of_two();
        server.handle(NOW, ServerEvent::Save);
        assert!(server.is_changing());
        let mut outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
        outputs.extend(tell(&mut server, 2, Message::Hello(Hello { version, role })));
        assert!(outputs.contains(&ServerOutput::Expelled(NodeId(2))));
        let outputs = obey(&mut server, 1, outputs);
        assert!(!server.is_changing(), "{outputs:?}");
        assert_eq!(server.view().map(|view| view.members.len()), Some(1));
    }
}

#[test]
fn a_client_that_greets_as_another_version_or_role_is_gone_with_its_avatars() {
    let client = JoinAs::Client { interest: None };
    let node = JoinAs::Node { address: ([127, 0, 0, 1], 2).into(), client: None, resume: None, heard: 0 };
    for (version, role) in [(VERSION + 1, client), (VERSION, node)] {
        let mut server = server();
        let (from, id) = (Peer::Client(ClientId(7)), BodyId::avatar(ClientId(7), 0));
        let says = |server: &mut Server, message| server.handle(NOW, ServerEvent::Message { from, message });
        says(&mut server, Message::Hello(Hello { version: VERSION, role: client }));
        let spawn = FromClient::Spawn { body: sim_body(id, [1.0; 3]), shapes: Vec::new() };
        says(&mut server, Message::FromClient(ClientId(7), spawn));
        assert_eq!(server.record().present().filter(|body| body.id == id).count(), 1);
        says(&mut server, Message::Hello(Hello { version, role }));
        assert_eq!(server.linked_clients().count(), 0);
        assert_eq!(server.record().present().filter(|body| body.id == id).count(), 0);
    }
}

#[test]
fn the_world_begins_when_enough_nodes_have_loaded_it() {
    let mut server = server();
    hello(&mut server, 1, VERSION);
    assert!(server.view().is_none(), "not loaded yet");
    let outputs = tell(&mut server, 1, Message::ToServer(ToServer::Loaded));
    assert!(
        outputs
            .iter()
            .any(|output| matches!(output, ServerOutput::Began { view, .. } if view.leader == NodeId(1)))
    );
    let placed = outputs.iter().find_map(|output| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Chunk(Chunk::Placed(placed))), .. } => {
            Some(placed)
        }
        _ => None,
    });
    let placed = placed.expect("bodies without an owner are placed");
    assert_eq!(placed.len(), 3);
    let epoch = Epoch::placed_in(server.view().unwrap().number.0);
    assert!(placed.iter().all(|placed| placed.body.epoch == epoch), "beyond all of earlier views");
}

/// Returns the survey of a member that owns these bodies.
fn survey(server: &Server, view: ViewNumber, tick: u64, claims: Vec<Claim>) -> ToServer {
    let tree = server.common.config.world.tree.clone();
    let allocation = tree.leaves().map(|region| (region, NodeId(1))).collect();
    ToServer::Survey { view, tick: Tick(tick), division: Some((tree, allocation)), claims }
}

/// Answers for a node that computes nothing, until it is asked no more. Returns all outputs of the server.
fn obey(server: &mut Server, node: u32, outputs: Vec<ServerOutput>) -> Vec<ServerOutput> {
    obey_by(server, outputs, |server, to, message| {
        let is_meant = to == NodeId(node);
        is_meant.then(|| answer(server, message)).flatten()
    })
}

/// Returns the answer of a node that computes nothing.
fn answer(server: &Server, message: ToNode) -> Option<ToServer> {
    match message {
        ToNode::WorldEnd => Some(ToServer::Loaded),
        ToNode::Settle { view } => {
            Some(ToServer::Settling { view, dispatches: Vec::new(), undone: Vec::new(), last: true })
        }
        ToNode::Finish { view, .. } => Some(survey(server, view, 0, Vec::new())),
        ToNode::Fetch { view, .. } => Some(ToServer::Found { view, bodies: Vec::new(), last: true }),
        _ => None,
    }
}

/// Has nodes answer in this way until they are asked no more. Returns all outputs of the server.
fn obey_by(
    server: &mut Server,
    mut outputs: Vec<ServerOutput>,
    mut answer: impl FnMut(&Server, NodeId, ToNode) -> Option<ToServer>,
) -> Vec<ServerOutput> {
    let mut seen = 0;
    while let Some(output) = outputs.get(seen).cloned() {
        seen += 1;
        let ServerOutput::Send { to: Peer::Node(to), message: Message::ToNode(message) } = output else {
            continue;
        };
        if let Some(answer) = answer(server, to, message) {
            outputs.extend(tell(server, to.0, Message::ToServer(answer)));
        }
    }
    outputs
}

/// Lets time pass until the server sends something. Returns that.
fn wait(server: &mut Server) -> Vec<ServerOutput> {
    loop {
        let due = server.poll_timeout().expect("something is waited for");
        server.handle_timeout(due.max(server.common.now));
        let said = std::iter::from_fn(|| server.poll_output());
        let said: Vec<_> = said.filter(|output| !matches!(output, ServerOutput::Store(_))).collect();
        if !said.is_empty() {
            return said;
        }
    }
}

#[test]
fn a_node_is_let_go_of_by_one_group_before_another_takes_it() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let is =
        |delay_ms, node| Message::ToServer(ToServer::Delays(vec![Delay { node: NodeId(node), delay_ms }]));
    let outputs = hello(&mut server, 2, VERSION);
    tell(&mut server, 1, is(None, 2));
    obey(&mut server, 2, outputs);
    let sizes = |server: &Server| server.views().map(|(_, view)| view.members.len()).collect::<Vec<_>>();
    assert_eq!(sizes(&server), [1], "its links may be on their way");
    let outputs = wait(&mut server);
    obey(&mut server, 2, outputs);
    assert_eq!(sizes(&server), [1, 1], "they cannot reach one another");
    tell(&mut server, 1, is(Some(1.0), 2));
    tell(&mut server, 2, is(Some(1.0), 1));
    let outputs = wait(&mut server);
    assert!(server.is_changing(), "it is looked who reaches whom");
    let to_one = obey(&mut server, 1, outputs.clone());
    assert_eq!(sizes(&server), [1, 1], "it computes another group's world still");
    let outputs = obey(&mut server, 2, outputs);
    obey(&mut server, 1, outputs);
    assert_eq!(sizes(&server), [2], "{to_one:?}");
    server.handle(server.common.now, ServerEvent::Stop);
    let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
    let mut outputs = obey(&mut server, 1, outputs);
    outputs = obey(&mut server, 2, outputs);
    assert_eq!(obey(&mut server, 1, outputs).last(), Some(&ServerOutput::Ended));
}

#[test]
fn what_a_group_was_believed_about_that_is_no_more_the_main_one_is_told_of() {
    let mut server = server();
    for node in 1..=3 {
        let outputs = hello(&mut server, node, VERSION);
        for other in 1..node {
            let delays = vec![Delay { node: NodeId(node), delay_ms: None }];
            tell(&mut server, other, Message::ToServer(ToServer::Delays(delays)));
        }
        obey(&mut server, node, outputs);
        if node > 1 {
            let outputs = wait(&mut server);
            obey(&mut server, node, outputs);
        }
    }
    let views: Vec<_> = server.views().map(|(group, view)| (group, view.number)).collect();
    assert_eq!(views.len(), 3, "none of them reaches another");
    let body = BodyId::persistent(0);
    let touched = ToServer::Touched { view: views[2].1, bodies: vec![(body, 1)] };
    tell(&mut server, 3, Message::ToServer(touched));
    assert_eq!(server.authoritative(body), views[2].0);
    let outputs = tell(&mut server, 3, Message::ToServer(ToServer::Leave));
    let outputs = obey(&mut server, 3, outputs);
    let told = |output: &ServerOutput| match output {
        ServerOutput::Send { to, message: Message::ToNode(ToNode::Authority { stances, .. }) } => {
            Some((*to, stances.clone()))
        }
        _ => None,
    };
    let told: Vec<_> = outputs.iter().filter_map(told).collect();
    let stance = |yours| vec![Stance { body, number: 2, yours }];
    assert_eq!(told, [(Peer::Node(NodeId(1)), stance(true)), (Peer::Node(NodeId(2)), stance(false))]);
}

#[test]
fn who_is_back_first_when_all_links_broke_waits_for_those_near_it() {
    let mut server = server_of_two();
    let delay = DelayThresholds { inclusion_ms: 30.0, rejection_ms: 60.0, deviation_ms: 30.0 };
    server.common.config.world.thresholds.delay = Some(delay);
    for node in [1, 2] {
        server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(node))));
    }
    hello(&mut server, 3, VERSION);
    tell(&mut server, 3, Message::ToServer(ToServer::Loaded));
    let group = |server: &Server| server.common.nodes[&NodeId(3)].group;
    assert_eq!(group(&server), None, "the others are missed, but not for long");
    for ms in (0..2_100).step_by(50) {
        server.handle_timeout(Duration::from_millis(ms));
    }
    assert_eq!(group(&server), Some(server.main_group()));
}

#[test]
fn what_was_said_of_a_node_that_came_anew_is_forgotten() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    tell(
        &mut server,
        1,
        Message::ToServer(ToServer::Delays(vec![Delay { node: NodeId(2), delay_ms: None }])),
    );
    let mut outputs = hello(&mut server, 2, VERSION);
    outputs.extend(reaches(&mut server, 2, 1));
    let outputs = obey(&mut server, 2, outputs);
    obey(&mut server, 1, outputs);
    assert_eq!(server.view().map(|view| view.members.len()), Some(2));
    assert_eq!(server.views().count(), 1);
}

#[test]
fn a_member_that_the_server_misses_too_goes_at_once() {
    let mut server = server();
    for node in [1, 2] {
        let mut outputs = hello(&mut server, node, VERSION);
        outputs.extend(reaches(&mut server, node, 3 - node));
        let outputs = obey(&mut server, node, outputs);
        obey(&mut server, 1, outputs);
    }
    let view = server.view().expect("it has begun").number;
    server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(2))));
    tell(&mut server, 1, Message::ToServer(ToServer::LinkLost { view, node: NodeId(2) }));
    assert_eq!(server.poll_timeout(), Some(NOW));
    server.handle_timeout(NOW);
    let said = std::iter::from_fn(|| server.poll_output()).collect::<Vec<_>>();
    assert!(said.contains(&ServerOutput::Expelled(NodeId(2))), "{said:?}");
}

#[test]
fn strangers_and_earlier_views_are_counted_and_change_nothing() {
    let mut server = server();
    hello(&mut server, 1, VERSION);
    tell(&mut server, 1, Message::ToServer(ToServer::Loaded));
    let present = server.view().unwrap().number;
    let body = sim_body(BodyId::persistent(0), [5.0; 3]);
    let before = server.record().body(body.id).unwrap().epoch;
    let (id, region, epoch) = (body.id, RegionId(1), before.next());
    let checkpoint = BodyCheckpoint { id, region, epoch, state: body.state };
    let old =
        ToServer::Checkpoint { view: ViewNumber(0), tick: Tick(9), division: 0, bodies: vec![checkpoint] };
    tell(&mut server, 1, Message::ToServer(old));
    assert_eq!((server.stale(), server.record().body(body.id).unwrap().epoch), (1, before));
    let new = ToServer::Checkpoint { view: present, tick: Tick(9), division: 0, bodies: vec![checkpoint] };
    tell(&mut server, 2, Message::ToServer(new.clone()));
    assert_eq!(server.record().body(body.id).unwrap().epoch, before, "node 2 is nobody");
    tell(&mut server, 1, Message::ToServer(new));
    assert_eq!(server.record().body(body.id).unwrap().epoch, epoch);
}

#[test]
fn a_node_that_dies_in_the_last_audit_is_taken_over_before_it() {
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let mut server = Server::new(config(2), Record::new(bodies, Vec::new(), Vec::new()));
    for node in [1, 2] {
        hello(&mut server, node, VERSION);
        tell(&mut server, node, Message::ToServer(ToServer::Loaded));
    }
    assert_eq!(server.view().unwrap().members.len(), 2);
    server.handle(NOW, ServerEvent::Stop);
    server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(2))));
    while server.poll_output().is_some() {}
    wait(&mut server);
    let answer = |server: &mut Server, claims| {
        let view = server.common.number;
        tell(
            server,
            1,
            Message::ToServer(ToServer::Settling {
                view,
                dispatches: Vec::new(),
                undone: Vec::new(),
                last: true,
            }),
        );
        let survey = survey(server, view, 0, claims);
        tell(server, 1, Message::ToServer(survey))
    };
    answer(&mut server, Vec::new());
    // The node owns nothing and holds no copy, so everything comes from the record.
    let view = server.common.number;
    let found = ToServer::Found { view, bodies: Vec::new(), last: true };
    let outputs = tell(&mut server, 1, Message::ToServer(found));
    let began = outputs
        .iter()
        .any(|output| matches!(output, ServerOutput::Began { view, .. } if view.members.len() == 1));
    assert!(began, "{outputs:?}");
    let region = server.common.config.world.tree.leaves().next().unwrap();
    let claim = |i| Claim { id: BodyId::persistent(i), epoch: Epoch(0), region };
    let outputs = answer(&mut server, (0..3).map(claim).collect());
    assert!(outputs.contains(&ServerOutput::Audited(Audit::default())), "{outputs:?}");
    assert_eq!(outputs.last(), Some(&ServerOutput::Ended));
    server.handle(server.common.now, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    assert_eq!(server.poll_output(), None, "it ends once");
}

#[test]
fn a_world_that_ends_when_its_last_node_is_not_heard_of_says_so() {
    for (nodes, unanswered) in [(0, false), (1, true)] {
        let mut server = server();
        for node in 1..=nodes {
            hello(&mut server, node, VERSION);
            tell(&mut server, node, Message::ToServer(ToServer::Loaded));
            assert!(server.view().is_some());
            server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(node))));
            wait(&mut server);
        }
        server.handle(server.common.now, ServerEvent::Stop);
        let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
        let found = Audit { unanswered, ..Audit::default() };
        assert!(outputs.contains(&ServerOutput::Audited(found)), "{nodes} nodes: {outputs:?}");
        assert_eq!(outputs.last(), Some(&ServerOutput::Ended));
    }
}

/// Has a node say that it reaches another.
fn reaches(server: &mut Server, node: u32, other: u32) -> Vec<ServerOutput> {
    let delays = vec![Delay { node: NodeId(other), delay_ms: Some(1.0) }];
    tell(server, node, Message::ToServer(ToServer::Delays(delays)))
}

#[test]
fn who_is_not_reached_is_no_member_and_does_not_stop_the_world() {
    for (says, members) in [(Some(1.0), 2), (None, 1)] {
        let mut server = server();
        for node in [1, 2] {
            let outputs = hello(&mut server, node, VERSION);
            let outputs = obey(&mut server, node, outputs);
            obey(&mut server, 1, outputs);
        }
        let members_of = |server: &Server| server.view().unwrap().members.len();
        assert_eq!(members_of(&server), 1, "nobody has reached it yet");
        let delays = vec![Delay { node: NodeId(2), delay_ms: says }];
        let outputs = tell(&mut server, 1, Message::ToServer(ToServer::Delays(delays)));
        obey(&mut server, 1, outputs);
        let mut said = Vec::new();
        for tenth in 1..=30 {
            server.handle_timeout(Duration::from_millis(100 * tenth));
            said.extend(std::iter::from_fn(|| server.poll_output()));
        }
        assert_eq!(members_of(&server), members, "{said:?}");
        assert_eq!(said.contains(&ServerOutput::Unreached(NodeId(2))), members == 1, "{said:?}");
    }
}

/// Returns a server whose nodes 1 and 2 compute the world.
fn server_of_two() -> Server {
    let mut server = server();
    for node in [1, 2] {
        let mut outputs = hello(&mut server, node, VERSION);
        outputs.extend(reaches(&mut server, node, 3 - node));
        let outputs = obey(&mut server, node, outputs);
        obey(&mut server, 1, outputs);
    }
    assert_eq!(server.view().map(|view| view.members.len()), Some(2));
    server
}

fn expelled(server: &mut Server) -> Vec<NodeId> {
    let said = std::iter::from_fn(|| server.poll_output());
    said.filter_map(|output| match output {
        ServerOutput::Expelled(node) => Some(node),
        _ => None,
    })
    .collect()
}

#[test]
fn the_time_in_which_the_server_was_stopped_does_not_count_unless_it_is_always_late() {
    let mut server = server_of_two();
    server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(2))));
    let resumed = Duration::from_secs(30);
    server.handle_timeout(resumed);
    assert_eq!(expelled(&mut server), [], "its word may be there, unheard");
    let due = server.poll_timeout().expect("it is waited for");
    assert!(resumed < due && due <= resumed + BEAT, "{due:?}");
    server.handle_timeout(resumed + ABSENCE);
    assert_eq!(expelled(&mut server), [NodeId(2)], "late twice is slow");

    let mut server = server_of_two();
    server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(2))));
    let mut at = NOW;
    while expelled(&mut server).is_empty() {
        at = server.poll_timeout().expect("it is waited for");
        server.handle_timeout(at);
    }
    assert_eq!(at, ABSENCE);
}

#[test]
fn what_was_placed_in_a_view_that_nobody_came_to_compute_is_placed_again_from_where_it_is() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let id = BodyId::persistent(0);
    let mut body = server.record().body(id).expect("it is on record").clone();
    body.state.pose.translation[1] = 2.0;
    let region = server.common.config.world.tree.leaf_at(body.state.pose.translation);
    let claims: Vec<_> =
        (0..3).map(|i| Claim { id: BodyId::persistent(i), epoch: body.epoch, region }).collect();
    // As if a view had been written down, and nobody had been told of it.
    server.main_mut().record.renew(id, ViewNumber(100));
    server.common.number = ViewNumber(101);
    server.main_mut().unsure = true;
    server.finish(0);
    while server.poll_output().is_some() {}
    let view = server.common.number;
    tell(
        &mut server,
        1,
        Message::ToServer(ToServer::Settling {
            view,
            dispatches: Vec::new(),
            undone: Vec::new(),
            last: true,
        }),
    );
    let survey = survey(&server, view, 9, claims);
    let outputs = tell(&mut server, 1, Message::ToServer(survey));
    let fetch = Message::ToNode(ToNode::Fetch { view, bodies: vec![id] });
    assert!(
        outputs
            .iter()
            .any(|output| matches!(output, ServerOutput::Send { message, .. } if *message == fetch))
    );
    let found = ToServer::Found { view, bodies: vec![body.clone()], last: true };
    let outputs = tell(&mut server, 1, Message::ToServer(found));
    let placed = outputs.iter().find_map(|output| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Chunk(Chunk::Placed(placed))), .. } => {
            Some(placed)
        }
        _ => None,
    });
    let placed = placed.expect("it is placed anew");
    assert_eq!(placed.len(), 1);
    assert_eq!(placed[0].body.state.pose, body.state.pose);
    assert!(placed[0].body.epoch > Epoch::placed_in(100), "beyond what clients may have been told");
}

#[test]
fn what_nobody_owns_any_more_comes_back_beside_what_joints_tie_it_to() {
    let bodies: Vec<_> = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let [tied, lost, loose] = [0, 1, 2].map(|i: usize| bodies[i].clone());
    let mut server = Server::new(config(1), Record::new(bodies, Vec::new(), vec![vicinity::joint(1, 0, 1)]));
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let epoch = server.record().body(tied.id).expect("it is on record").epoch;
    let mut moved = BodyRecord { epoch, ..tied };
    moved.state.pose.translation[1] += 2.0;
    let region = server.common.config.world.tree.leaf_at(moved.state.pose.translation);
    let former = server.view().expect("it has begun").number;
    server.main_mut().unsure = true;
    server.finish(0);
    while server.poll_output().is_some() {}
    let view = server.common.number;
    let dispatches = vec![Dispatch { view: former, tick: Tick(9), rounds: 1, ops: Vec::new() }];
    let settled = ToServer::Settling { view, dispatches, undone: Vec::new(), last: true };
    tell(&mut server, 1, Message::ToServer(settled));
    let claims = [moved.id, loose.id].map(|id| Claim { id, epoch, region });
    let survey = survey(&server, view, 9, claims.to_vec());
    let outputs = tell(&mut server, 1, Message::ToServer(survey));
    let fetch = Message::ToNode(ToNode::Fetch { view, bodies: vec![moved.id, lost.id] });
    let is_fetch =
        |output: &ServerOutput| matches!(output, ServerOutput::Send { message, .. } if *message == fetch);
    assert!(outputs.iter().any(is_fetch), "{outputs:?}");
    let found = ToServer::Found { view, bodies: vec![moved], last: true };
    let outputs = tell(&mut server, 1, Message::ToServer(found));
    let placed = outputs.iter().find_map(|output| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Chunk(Chunk::Placed(placed))), .. } => {
            Some(placed)
        }
        _ => None,
    });
    let [placed] = &placed.expect("it is placed anew")[..] else { panic!("{placed:?}") };
    assert_eq!((placed.body.id, placed.body.state.pose.translation), (lost.id, [1.0, 3.0, 1.0]));
}

fn back(server: &mut Server, node: u32, view: ViewNumber) -> Vec<ServerOutput> {
    let address = ([127, 0, 0, 1], node as u16).into();
    let role = JoinAs::Node { address, client: None, resume: Some(view), heard: 0 };
    tell(server, node, Message::Hello(Hello { version: VERSION, role }))
}

/// Returns a restarted server whose last stored view is one without node 2, with the numbers of the view
/// before it and of that view.
fn restarted() -> (Server, ViewNumber, ViewNumber) {
    let mut server = server_of_two();
    let former = server.view().expect("it has begun").clone();
    let mut view = former.clone();
    view.number = former.number.next();
    view.members.retain(|member| member.node == NodeId(1));
    view.allocation.values_mut().for_each(|node| *node = NodeId(1));
    let numbers = (former.number, view.number);
    server.common.number = view.number;
    let (id, tick, record) = (server.main, server.tick(), server.record().clone());
    server.common.nodes.clear();
    server.expect_back(id, record, tick, view, Some(former));
    (server, numbers.0, numbers.1)
}

fn welcomed(outputs: &[ServerOutput], node: u32) -> bool {
    outputs.iter().any(|output| {
        matches!(output, ServerOutput::Send { to, message: Message::ToNode(ToNode::Welcome { .. }) }
            if *to == Peer::Node(NodeId(node)))
    })
}

#[test]
fn who_was_to_go_with_a_view_does_not_decide_whether_it_was_heard_of() {
    let (mut server, former, present) = restarted();
    assert!(!welcomed(&back(&mut server, 2, former), 2), "it may be a member still");
    let outputs = back(&mut server, 1, present);
    assert!(welcomed(&outputs, 2), "node 1 has heard of the view, and node 2 begins anew: {outputs:?}");
    assert!(!welcomed(&outputs, 1));

    let (mut server, former, _) = restarted();
    back(&mut server, 2, former);
    let outputs = back(&mut server, 1, former);
    assert!(!welcomed(&outputs, 1) && !welcomed(&outputs, 2), "nobody has heard of it: {outputs:?}");
    let asked = |node| {
        outputs.iter().any(|output| {
            matches!(output, ServerOutput::Send { to, message: Message::ToNode(ToNode::Settle { .. }) }
                if *to == Peer::Node(NodeId(node)))
        })
    };
    assert!(asked(1) && asked(2), "both are members: {outputs:?}");
}

#[test]
fn who_began_anew_is_no_member_of_a_former_view_that_goes_on() {
    let (mut server, former, _) = restarted();
    assert!(welcomed(&back(&mut server, 2, ViewNumber(77)), 2), "it was elsewhere");
    let outputs = back(&mut server, 1, former);
    let asked = |node| {
        outputs.iter().any(|output| {
            matches!(output, ServerOutput::Send { to, message: Message::ToNode(ToNode::Settle { .. }) }
                if *to == Peer::Node(NodeId(node)))
        })
    };
    assert!(asked(1) && !asked(2), "{outputs:?}");
}

#[test]
fn who_was_loading_the_world_when_it_was_taken_for_a_member_begins_anew() {
    let mut server = server_of_two();
    while server.poll_output().is_some() {}
    let outputs = tell(&mut server, 2, Message::ToServer(ToServer::Loaded));
    assert!(outputs.contains(&ServerOutput::Expelled(NodeId(2))) && welcomed(&outputs, 2), "{outputs:?}");
    let outputs = tell(&mut server, 2, Message::ToServer(ToServer::Loaded));
    assert!(!welcomed(&outputs, 2), "{outputs:?}");
}

#[test]
fn who_is_sent_a_second_world_before_it_has_the_first_loads_no_third() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    server.handle(NOW, ServerEvent::Save);
    let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
    let outputs = obey(&mut server, 1, outputs);
    let saved = outputs.into_iter().find_map(|output| match output {
        ServerOutput::Saved(saved) => Some(saved),
        _ => None,
    });
    let saved = saved.expect("it is saved");
    server.handle(NOW, ServerEvent::Replace(saved.clone()));
    server.handle(NOW, ServerEvent::Replace(saved));
    let replaced: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
    let outputs = obey(&mut server, 1, replaced);
    let count = |is: fn(&ServerOutput) -> bool| outputs.iter().filter(|output| is(output)).count();
    assert_eq!(count(|output| matches!(output, ServerOutput::Began { .. })), 1);
    assert_eq!(count(|output| matches!(output, ServerOutput::Expelled(_))), 0);
    assert!(server.view().is_some());
}

#[test]
fn who_computes_for_another_group_by_now_is_not_taken_back_with_a_former_view() {
    let (mut server, former, _) = restarted();
    let elsewhere = Some(ViewNumber(99));
    server.common.nodes.get_mut(&NodeId(2)).expect("it is known").serving = elsewhere;
    back(&mut server, 1, former);
    assert_eq!(server.common.nodes[&NodeId(2)].serving, elsewhere);
}

#[test]
fn who_is_sent_away_goes_in_order_and_is_told_why() {
    let send_away = |server: &mut Server, node: Option<u32>, client: Option<u32>| {
        let (node, client) = (node.map(NodeId), client.map(ClientId));
        server.handle(NOW, ServerEvent::SendAway { node, client, reason: "cheating".into() });
        std::iter::from_fn(|| server.poll_output()).collect::<Vec<_>>()
    };
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let outputs = send_away(&mut server, None, Some(5));
    let close =
        |peer| ServerOutput::Close { peer, farewell: Farewell::SentAway, reason: "cheating".to_owned() };
    assert_eq!(outputs, [close(Peer::Client(ClientId(5)))]);
    let outputs = send_away(&mut server, Some(9), None);
    assert_eq!(outputs, [close(Peer::Node(NodeId(9)))], "one that has not said hello");
    let outputs = send_away(&mut server, Some(1), None);
    let is_closed = |output: &ServerOutput| matches!(output, ServerOutput::Close { .. });
    assert!(!outputs.iter().any(is_closed), "it has regions to hand over: {outputs:?}");
    let wanted = obey(&mut server, 1, outputs);
    let farewell = wanted.iter().find_map(|output| match output {
        ServerOutput::Send {
            message: Message::ToNode(ToNode::Shutdown { farewell: Farewell::SentAway, reason }),
            ..
        } => Some(reason),
        _ => None,
    });
    assert_eq!(farewell.map(String::as_str), Some("cheating"), "{wanted:?}");
}

#[test]
fn a_node_is_drained_where_another_can_take_over_and_goes_at_once_if_it_fails_to_hand_over() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    assert_eq!(server.check_drain(NodeId(1)), Err(DrainError::Last(NodeId(1))));
    assert_eq!(server.check_drain(NodeId(2)), Err(DrainError::Gone(NodeId(2))));
    let mut server = server_of_two();
    assert_eq!(server.check_drain(NodeId(1)), Ok(()));
    server.handle(NOW, ServerEvent::Drain(NodeId(1)));
    assert_eq!(server.is_draining(NodeId(1)), Ok(true), "it has regions to hand over");
    assert_eq!(server.check_drain(NodeId(2)), Err(DrainError::Last(NodeId(2))), "nobody else stays");
    // The node does not do its part.
    server.begin_anew(NodeId(1));
    assert_eq!(server.is_draining(NodeId(1)), Ok(false));
    let is_told = |output: &ServerOutput| match output {
        ServerOutput::Close { peer, farewell, .. } => {
            (*peer, *farewell) == (Peer::Node(NodeId(1)), Farewell::Left)
        }
        _ => false,
    };
    let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
    assert!(outputs.iter().any(is_told));
    assert!(outputs.contains(&ServerOutput::Expelled(NodeId(1))), "what it had is as of the last checkpoint");
    let mut server = server_of_two();
    server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    assert_eq!(server.check_drain(NodeId(1)), Err(DrainError::Unlinked(NodeId(1))));
}

#[test]
fn what_a_client_says_after_it_came_back_is_newer_than_before_however_many_came_meanwhile() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    let client = ClientId(9);
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    let mut newest = 0;
    for _ in 0..(1 << 16) + 2 {
        server.tell_world(client, None);
        while let Some(output) = server.poll_output() {
            let ServerOutput::Send { message: Message::ToClient(_, told), .. } = output else { continue };
            let ToClient::Welcome { logical_time, .. } = told else { continue };
            assert!(logical_time > newest, "{logical_time:x} after {newest:x}");
            newest = logical_time;
        }
    }
    assert!(newest > 0);
}
