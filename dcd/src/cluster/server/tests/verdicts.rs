//! Tests whose word counts about participants that are verified, and which members are told what of them.

use super::*;
use crate::protocol::{Finding, Hindrance, Verified};

/// Returns a server with three nodes, and what these were told as their view began. The last two are
/// participants, and both are verified.
fn verifying() -> (Server, Vec<ServerOutput>) {
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let mut config = config(3);
    config.grouping.verification = Verification { share: 1.0, seed: 7 };
    let mut server = Server::new(config, Record::new(bodies, Vec::new(), Vec::new()));
    let mut outputs = Vec::new();
    for node in 1..=3 {
        let client = (node > 1).then_some(ClientId(node));
        let role =
            JoinAs::Node { address: ([127, 0, 0, 1], node as u16).into(), client, resume: None, heard: 0 };
        tell(&mut server, node, Message::Hello(Hello { version: VERSION, role }));
        outputs = tell(&mut server, node, Message::ToServer(ToServer::Loaded));
    }
    (server, outputs)
}

fn members(server: &Server) -> Vec<u32> {
    let view = server.main().view.as_ref();
    view.into_iter().flat_map(|view| &view.members).map(|member| member.node.0).collect()
}

#[test]
fn the_leader_is_told_of_all_who_are_verified_and_nobody_of_itself() {
    let (_, outputs) = verifying();
    let told = |to: u32| {
        let mut told = outputs.iter().filter_map(|output| match output {
            ServerOutput::Send {
                to: Peer::Node(node),
                message: Message::ToNode(ToNode::Verify { nodes, .. }),
            } => (node.0 == to).then(|| nodes.clone()),
            _ => None,
        });
        told.next().expect("it is told")
    };
    let verified = |node| Verified { node: NodeId(node), anew: true, drop: Vec::new() };
    assert_eq!(told(1), [verified(2), verified(3)]);
    assert_eq!(told(2), [verified(3)]);
    assert_eq!(told(3), [verified(2)]);
}

#[test]
fn a_participant_goes_by_the_word_of_a_dedicated_leader_that_verifies_it_and_by_no_other() {
    let (mut server, _) = verifying();
    let view = server.view().unwrap().number;
    let verdict = |view, node| {
        let finding = Finding::Deviates(RegionId(1));
        Message::ToServer(ToServer::Verdict { view, tick: Tick(4), node: NodeId(node), finding })
    };
    let before = server.stale();
    // Verdicts on the other participant, on the sender itself, and on nodes that the leader does not verify.
    for (from, node) in [(2, 3), (3, 3), (1, 1), (1, 9)] {
        assert_eq!(tell(&mut server, from, verdict(view, node)), []);
    }
    // A verdict on a time before the participant came.
    assert_eq!(tell(&mut server, 1, verdict(ViewNumber(0), 2)), []);
    assert_eq!((server.stale() - before, members(&server)), (5, vec![1, 2, 3]));
    let outputs = tell(&mut server, 1, verdict(view, 2));
    let (node, tick, finding) = (NodeId(2), Tick(4), Finding::Deviates(RegionId(1)));
    assert!(outputs.contains(&ServerOutput::Verdict { node, tick, finding }));
    let is_sent_away = |output: &ServerOutput| {
        matches!(
            output,
            ServerOutput::Close { peer: Peer::Node(NodeId(2)), farewell: Farewell::SentAway, .. }
        )
    };
    assert!(outputs.iter().any(is_sent_away), "{outputs:?}");
    obey_by(&mut server, outputs, |server, _, message| answer(server, message));
    assert_eq!(members(&server), [1, 3], "nobody waits for it");
    assert_eq!(tell(&mut server, 1, verdict(view, 2)), [], "once");
}

#[test]
fn two_who_contradict_each_other_and_one_who_cannot_be_verified_stay() {
    let (mut server, _) = verifying();
    let view = server.view().unwrap().number;
    let (node, tick) = (NodeId(2), Tick(4));
    let given_up = Finding::GivenUp(Hindrance::Unknown);
    for finding in [Finding::Contradicts(NodeId(3)), given_up] {
        let verdict = Message::ToServer(ToServer::Verdict { view, tick, node, finding });
        assert_eq!(tell(&mut server, 1, verdict.clone()), [ServerOutput::Verdict { node, tick, finding }]);
        let is_over = finding == given_up;
        assert_eq!(tell(&mut server, 1, verdict).is_empty(), is_over, "{finding:?}");
    }
    assert_eq!(members(&server), [1, 2, 3]);
}
