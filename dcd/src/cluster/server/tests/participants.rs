//! Tests what a participant cannot do to the others of its group: send them away, keep them out, or stop them
//! again and again.

use super::*;
use crate::protocol::{Dispatch, Input, Velocity, WorldOp, WorldPose};

/// Returns a server whose main group has these members, all of which reach one another. Those in `players`
/// are participants.
fn server_of(nodes: u32, players: &[u32]) -> Server {
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let mut server = Server::new(config(nodes as usize), Record::new(bodies, Vec::new(), Vec::new()));
    for node in 1..=nodes {
        comes(&mut server, node, players.contains(&node), None);
        tell(&mut server, node, Message::ToServer(ToServer::Loaded));
    }
    assert_eq!(members(&server), (1..=nodes).collect::<Vec<_>>());
    for (node, other) in (1..=nodes).flat_map(|node| (1..=nodes).map(move |other| (node, other))) {
        reaches(&mut server, node, other);
    }
    server
}

fn comes(server: &mut Server, node: u32, plays: bool, resume: Option<ViewNumber>) -> Vec<ServerOutput> {
    let client = plays.then_some(ClientId(node));
    let role = JoinAs::Node { address: ([127, 0, 0, 1], node as u16).into(), client, resume, heard: 0 };
    tell(server, node, Message::Hello(Hello { version: VERSION, role }))
}

fn members(server: &Server) -> Vec<u32> {
    let view = server.main().view.as_ref();
    view.into_iter().flat_map(|view| &view.members).map(|member| member.node.0).collect()
}

/// Lets time pass while nodes answer in this way. Returns all outputs of the server.
fn live(
    server: &mut Server,
    for_s: u64,
    mut answer: impl FnMut(&Server, NodeId, ToNode) -> Option<ToServer>,
) -> Vec<ServerOutput> {
    let end = server.common.now + Duration::from_secs(for_s);
    let mut said = Vec::new();
    while server.common.now < end {
        server.handle_timeout(server.common.now + BEAT);
        let outputs = std::iter::from_fn(|| server.poll_output()).collect();
        said.extend(obey_by(server, outputs, &mut answer));
    }
    said
}

/// Has members accuse others, while all that are asked answer. Returns the members of the main group
/// afterwards.
fn accuse(server: &mut Server, words: &[(u32, u32)]) -> Vec<u32> {
    let view = server.main().view.as_ref().expect("it has begun").number;
    for &(node, other) in words {
        tell(server, node, Message::ToServer(ToServer::LinkLost { view, node: NodeId(other) }));
    }
    server.handle_timeout(server.common.now + Duration::from_millis(50));
    let outputs = std::iter::from_fn(|| server.poll_output()).collect();
    obey_by(server, outputs, |server, _, message| answer(server, message));
    members(server)
}

#[test]
fn a_participant_that_accuses_all_others_goes_itself() {
    assert_eq!(accuse(&mut server_of(3, &[3]), &[(3, 1), (3, 2)]), [1, 2]);
    assert_eq!(accuse(&mut server_of(4, &[3, 4]), &[(3, 1), (3, 2), (3, 4)]), [1, 2, 4]);
    // It accuses one after the other.
    let mut server = server_of(4, &[4]);
    assert_eq!(accuse(&mut server, &[(4, 1)]), [2, 3, 4], "it may not reach that one");
    server.handle_timeout(server.common.now + BEAT);
    assert_eq!(accuse(&mut server, &[(4, 2)]), [2, 3]);
    assert!(server.common.failures.contains_key(&NodeId(4)));
    // It accuses the last dedicated node.
    assert_eq!(accuse(&mut server_of(3, &[2, 3]), &[(3, 1)]), [1, 2]);
}

#[test]
fn who_accuses_the_last_dedicated_node_alone_is_not_to_blame_where_that_hangs() {
    // How many of its eight faults the participant may still have.
    let left = |server: &Server| {
        let mut account = server.common.failures.get(&NodeId(3)).copied().unwrap_or_default();
        (0..9).filter(|_| account.ask(server.common.now, 1.0, 8.0, 0.0)).count()
    };
    for (hangs, faults) in [(0, 1), (1, 0)] {
        let mut server = server_of(3, &[2, 3]);
        let view = server.main().view.as_ref().unwrap().number;
        tell(&mut server, 3, Message::ToServer(ToServer::LinkLost { view, node: NodeId(1) }));
        live(&mut server, 7, all_but(hangs));
        assert_eq!(left(&server), 8 - faults, "{hangs}");
    }
    // A failure that was not counted, as the participant had none left, is not given back.
    let mut server = server_of(3, &[2, 3]);
    (0..8).for_each(|_| assert!(server.common.has_failed(NodeId(3))));
    let view = server.main().view.as_ref().unwrap().number;
    tell(&mut server, 3, Message::ToServer(ToServer::LinkLost { view, node: NodeId(1) }));
    live(&mut server, 7, all_but(1));
    assert_eq!((left(&server), server.main().view.as_ref().is_some_and(|now| now.number > view)), (0, true));
}

#[test]
fn who_is_accused_by_a_participant_alone_may_have_done_nothing() {
    let mut server = server_of(4, &[3, 4]);
    assert_eq!(accuse(&mut server, &[(4, 3)]), [1, 2, 4]);
    assert!(server.common.failures.is_empty());
    let mut server = server_of(4, &[3, 4]);
    assert_eq!(accuse(&mut server, &[(4, 3), (1, 3)]), [1, 2, 4]);
    assert!(server.common.failures.keys().eq([&NodeId(3)]));
}

#[test]
fn a_word_that_is_shared_or_a_dedicated_nodes_or_the_leaders_counts_as_ever() {
    assert_eq!(accuse(&mut server_of(4, &[4]), &[(4, 1), (4, 2), (3, 1), (3, 2)]), [3, 4]);
    assert_eq!(accuse(&mut server_of(4, &[4]), &[(3, 1), (3, 2)]), [3, 4]);
    assert_eq!(accuse(&mut server_of(3, &[1, 2, 3]), &[(1, 2), (1, 3)]), [1], "others wait for its word");
    // Two members that each miss the other: the participant goes, whatever its number.
    assert_eq!(accuse(&mut server_of(3, &[2]), &[(2, 3), (3, 2)]), [1, 3]);
}

#[test]
fn one_participant_does_not_keep_a_dedicated_node_out_for_good() {
    let mut server = server_of(2, &[2]);
    let mut outputs = comes(&mut server, 3, false, None);
    outputs.extend(reaches(&mut server, 3, 1));
    let no = vec![Delay { node: NodeId(3), delay_ms: None }];
    outputs.extend(tell(&mut server, 2, Message::ToServer(ToServer::Delays(no))));
    let honest = |server: &Server, _: NodeId, message: ToNode| answer(server, message);
    obey_by(&mut server, outputs, honest);
    live(&mut server, 9, honest);
    assert_eq!(members(&server), [1, 2], "its links may be on their way");
    let said = live(&mut server, 9, honest);
    assert!(said.contains(&ServerOutput::Unreached(NodeId(2))), "an operator is told who cannot reach whom");
    assert_eq!(members(&server), [1, 3]);
    live(&mut server, 30, honest);
    assert_eq!((members(&server), server.views().count()), (vec![1, 3], 2), "there it stays");
    reaches(&mut server, 2, 3);
    live(&mut server, 9, honest);
    assert_eq!(members(&server), [1, 2, 3]);
}

/// Returns the answers of all nodes but this one, which loads the world and answers nothing else.
fn all_but(silent: u32) -> impl Fn(&Server, NodeId, ToNode) -> Option<ToServer> {
    move |server, node, message| match message {
        ToNode::WorldEnd => Some(ToServer::Loaded),
        message => (node != NodeId(silent)).then(|| answer(server, message)).flatten(),
    }
}

#[test]
fn a_member_that_comes_back_again_and_again_does_not_keep_a_view_change_from_its_end() {
    let mut server = server_of(3, &[]);
    let present = server.main().view.as_ref().unwrap().number;
    server.main_mut().unsure = true;
    for _ in 0..6 {
        live(&mut server, 1, all_but(3));
        let outputs =
            if members(&server).len() == 3 { comes(&mut server, 3, false, Some(present)) } else { vec![] };
        obey_by(&mut server, outputs, all_but(3));
    }
    assert!(!members(&server).contains(&3) || server.main().view.as_ref().unwrap().number > present);
    assert!(server.main().change.is_none());
}

#[test]
fn members_that_all_come_back_again_and_again_are_members_still() {
    let mut server = server_of(2, &[]);
    let present = server.main().view.as_ref().unwrap().number;
    server.main_mut().unsure = true;
    server.finish(0);
    for node in [1, 2].repeat(9) {
        let outputs = comes(&mut server, node, false, Some(present));
        assert!(
            !outputs.contains(&ServerOutput::Expelled(NodeId(node))),
            "it is the server's link that breaks"
        );
    }
}

#[test]
fn a_participant_that_stops_the_others_again_and_again_computes_apart_from_them() {
    // The participant greets, or says that it has no world, and then says nothing; or it hangs in a tick.
    for way in 0..3 {
        let mut server = server_of(3, &[3]);
        let stops = |server: &mut Server| {
            if members(server).len() < 3 || server.main().change.is_some() {
                return;
            }
            let view = server.main().view.as_ref().unwrap().number;
            let outputs = match way {
                0 => comes(server, 3, true, Some(view)),
                1 => tell(server, 3, Message::ToServer(ToServer::Loaded)),
                _ => [1, 2]
                    .into_iter()
                    .flat_map(|node| {
                        tell(server, node, Message::ToServer(ToServer::LinkLost { view, node: NodeId(3) }))
                    })
                    .collect(),
            };
            obey_by(server, outputs, all_but(3));
        };
        let stopped = |server: &mut Server, for_s: u64| {
            (0..for_s)
                .filter(|_| {
                    stops(server);
                    live(server, 1, all_but(3));
                    members(server).len() == 3 || server.main().change.is_some()
                })
                .count()
        };
        let first = stopped(&mut server, 120);
        assert!(first > 0, "{way}");
        assert_eq!(stopped(&mut server, 150), 0, "{way}");
        assert!(server.linked_nodes().any(|node| node == NodeId(3)), "{way}: it may still compute apart");
        // After some time it may try again.
        assert!(stopped(&mut server, 300) > 0, "{way}");
    }
}

#[test]
fn a_participant_that_was_told_alone_of_a_jump_begins_anew_at_once() {
    let mut server = server_of(3, &[3]);
    let present = server.main().view.clone().unwrap();
    assert_eq!(present.leader, NodeId(1));
    server.handle(server.common.now, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    let outputs = std::iter::repeat_with(|| wait(&mut server))
        .find(|outputs| outputs.contains(&ServerOutput::Expelled(NodeId(1))))
        .expect("it is given up");
    let jump = WorldOp::Input(Input {
        body: BodyId::persistent(1),
        logical_time: 0,
        tick: Tick(0),
        velocity: Velocity::default(),
        pose: Some(WorldPose::at([9.0; 3])),
        drive: None,
    });
    let outputs = obey_by(&mut server, outputs, |server, node, message| match message {
        ToNode::Settle { view } if node == NodeId(3) => {
            let (tick, ops) = (present.tick.next(), vec![jump.clone()]);
            let dispatches = vec![Dispatch { view: present.number, tick, rounds: 1, ops }];
            Some(ToServer::Settling { view, dispatches, undone: Vec::new(), last: true })
        }
        message => answer(server, message),
    });
    assert!(outputs.contains(&ServerOutput::Expelled(NodeId(3))), "all meet in that tick by its word alone");
    assert!(server.common.failures.is_empty() && server.main().change.is_none());
    assert_eq!(members(&server), [2, 3]);
}

#[test]
fn a_member_that_says_that_it_has_loaded_a_world_without_end_is_sent_no_world_without_end() {
    let mut server = server_of(2, &[2]);
    let mut said = Vec::new();
    for _ in 0..200 {
        let outputs = tell(&mut server, 2, Message::ToServer(ToServer::Loaded));
        said.extend(obey_by(&mut server, outputs, |server, _, message| answer(server, message)));
    }
    let welcomes = said.iter().filter(|output| {
        matches!(output, ServerOutput::Send { message: Message::ToNode(ToNode::Welcome { .. }), .. })
    });
    assert!(welcomes.count() < 40);
    let is_closed =
        |output: &ServerOutput| matches!(output, ServerOutput::Close { peer: Peer::Node(NodeId(2)), .. });
    assert!(said.iter().any(is_closed));
    assert!(server.linked_nodes().eq([NodeId(1)]));
    assert_eq!(members(&server), [1]);
}
