//! Tests what a server believes of a member that lies: of its own regions what is possible, of everything
//! else nothing.

use super::hostile::server_of_two;
use super::*;
use crate::cluster::Key;
use crate::cluster::record::StoredBody;
use crate::protocol::{Dispatch, WorldOp, decode_value};
use crate::space::Allocation;

const BODY: BodyId = BodyId::persistent(0);

/// Returns a server with two members that compute a region each, and the ids of the leader and of the liar.
fn server_and_members() -> (Server, u32, u32) {
    let (server, _) = server_of_two();
    let view = server.view().expect("it has begun");
    let leader = view.leader.0;
    let other = view.members.iter().map(|member| member.node.0).find(|node| *node != leader);
    (server, leader, other.expect("there are two"))
}

/// Returns the region that a node computes.
fn region_of(server: &Server, node: u32) -> RegionId {
    let allocation = &server.view().expect("it has begun").allocation;
    allocation.iter().find(|(_, of)| of.0 == node).map(|(&region, _)| region).expect("each has one")
}

/// Begins a view change. Returns the number of the view to come.
fn change(server: &mut Server) -> ViewNumber {
    server.main_mut().unsure = true;
    server.finish(0);
    while server.poll_output().is_some() {}
    server.common.number
}

fn settle(server: &mut Server, node: u32, view: ViewNumber, dispatches: Vec<Dispatch>) -> Vec<ServerOutput> {
    tell(
        server,
        node,
        Message::ToServer(ToServer::Settling { view, dispatches, undone: Vec::new(), last: true }),
    )
}

/// Returns the dispatches that a node is told to finish.
fn to_finish(outputs: &[ServerOutput], node: u32) -> Vec<Dispatch> {
    let of = |output: &ServerOutput| match output {
        ServerOutput::Send { to, message: Message::ToNode(ToNode::Finish { dispatches, .. }) }
            if *to == Peer::Node(NodeId(node)) =>
        {
            Some(dispatches.clone())
        }
        _ => None,
    };
    outputs.iter().find_map(of).expect("it is told to finish")
}

/// Returns the survey of an honest member after this tick.
fn honest(server: &Server, view: ViewNumber, tick: u64, claims: Vec<Claim>) -> Message {
    let present = server.view().expect("it has begun");
    let division = Some((present.tree.clone(), present.allocation.clone()));
    Message::ToServer(ToServer::Survey { view, tick: Tick(tick), division, claims })
}

/// Has all members say that they hold none of the bodies that are fetched, so that the view begins.
fn find_nothing(server: &mut Server, view: ViewNumber) {
    for node in [1, 2] {
        let found = ToServer::Found { view, bodies: Vec::new(), last: true };
        tell(server, node, Message::ToServer(found));
    }
}

#[test]
fn a_member_cannot_have_done_what_the_leader_never_dispatched() {
    let (mut server, leader, liar) = server_and_members();
    let present = server.view().unwrap().number;
    let view = change(&mut server);
    let dispatch = |tick, ops| Dispatch { view: present, tick: Tick(tick), rounds: 1, ops };
    let truth = vec![dispatch(1, Vec::new())];
    let lie = vec![dispatch(1, vec![WorldOp::Remove(BODY)]), dispatch(1 << 40, Vec::new())];
    let before = server.stale();
    settle(&mut server, liar, view, lie);
    let outputs = settle(&mut server, leader, view, truth.clone());
    assert_eq!(to_finish(&outputs, leader), truth);
    assert_eq!(to_finish(&outputs, liar), truth);
    assert_eq!(server.stale(), before + 1);
}

#[test]
fn the_tick_of_the_world_is_not_one_members_to_say() {
    let (mut server, leader, liar) = server_and_members();
    let present = server.view().unwrap().number;
    let checkpoint = |tick| {
        let bodies = Vec::new();
        Message::ToServer(ToServer::Checkpoint { view: present, tick: Tick(tick), division: 0, bodies })
    };
    tell(&mut server, liar, checkpoint(1 << 40));
    assert_eq!(server.tick(), Tick(0));
    tell(&mut server, leader, checkpoint(9));
    assert_eq!(server.tick(), Tick(9));
    let view = change(&mut server);
    let last = Dispatch { view: present, tick: Tick(10), rounds: 1, ops: Vec::new() };
    settle(&mut server, liar, view, Vec::new());
    settle(&mut server, leader, view, vec![last]);
    let before = server.stale();
    let lie = honest(&server, view, 1 << 40, Vec::new());
    tell(&mut server, liar, lie);
    let truth = honest(&server, view, 10, Vec::new());
    tell(&mut server, leader, truth);
    find_nothing(&mut server, view);
    assert_eq!(server.view().unwrap().tick, Tick(10));
    assert_eq!(server.stale(), before + 1);
}

#[test]
fn a_checkpoint_of_a_body_makes_no_tick_that_has_not_been() {
    let (mut server, leader, liar) = server_and_members();
    let (view, region) = (server.view().unwrap().number, region_of(&server, liar));
    let body = server.record().body(BODY).unwrap().clone();
    let own = vec![BodyCheckpoint { id: BODY, region, epoch: body.epoch, state: body.state }];
    for (node, tick, bodies) in [(leader, 9, Vec::new()), (liar, 1 << 53, own)] {
        let said = ToServer::Checkpoint { view, tick: Tick(tick), division: 0, bodies };
        tell(&mut server, node, Message::ToServer(said));
    }
    server.handle(server.common.now, ServerEvent::Suspend);
    let stored = std::iter::from_fn(|| server.poll_output()).find_map(|output| match output {
        ServerOutput::Store(batch) => batch.writes.into_iter().find(|(key, _)| *key == Key::Body(BODY)),
        _ => None,
    });
    let stored = stored.and_then(|(_, value)| value).expect("it moved");
    // A restarted server goes on from that tick.
    let tick = decode_value::<StoredBody>(&stored).unwrap().tick();
    assert!(tick > Tick(9) && tick < Tick(600), "{tick:?}");
}

#[test]
fn how_the_world_is_cut_and_who_computes_what_is_not_one_members_to_say() {
    let (mut server, leader, liar) = server_and_members();
    let present = server.view().unwrap().clone();
    let view = change(&mut server);
    [liar, leader].into_iter().for_each(|node| drop(settle(&mut server, node, view, Vec::new())));
    // The liar speaks first.
    let strangers: Allocation = present.tree.leaves().map(|region| (region, NodeId(77))).collect();
    let division = Some((present.tree.clone(), strangers));
    let lie = ToServer::Survey { view, tick: Tick(0), division, claims: Vec::new() };
    server.main_mut().saving = true;
    tell(&mut server, liar, Message::ToServer(lie));
    let truth = honest(&server, view, 0, Vec::new());
    tell(&mut server, leader, truth);
    find_nothing(&mut server, view);
    let begun = server.view().unwrap();
    assert_eq!((begun.number, &begun.allocation), (view, &present.allocation));
}

#[test]
fn a_body_is_not_claimed_for_a_region_that_another_computes() {
    let (mut server, leader, liar) = server_and_members();
    let view = change(&mut server);
    [liar, leader].into_iter().for_each(|node| drop(settle(&mut server, node, view, Vec::new())));
    let epoch = server.record().body(BODY).unwrap().epoch;
    let region = region_of(&server, leader);
    let claim = vec![Claim { id: BODY, epoch, region }];
    let before = server.stale();
    let lie = honest(&server, view, 0, claim);
    tell(&mut server, liar, lie);
    let truth = honest(&server, view, 0, Vec::new());
    tell(&mut server, leader, truth);
    assert_eq!(server.stale(), before + 1);
    // Nobody else has the body, so the state on record counts, and not the liar's.
    let mut lie = server.record().body(BODY).unwrap().clone();
    lie.state.pose.translation = [9.0; 3];
    let found = ToServer::Found { view, bodies: vec![lie], last: true };
    tell(&mut server, leader, Message::ToServer(ToServer::Found { view, bodies: Vec::new(), last: true }));
    tell(&mut server, liar, Message::ToServer(found));
    assert!(server.record().body(BODY).unwrap().epoch >= Epoch::placed_in(view.0), "placed anew");
}

#[test]
fn who_does_not_own_a_body_does_not_say_that_it_is_gone() {
    let (mut server, leader, liar) = server_and_members();
    let (view, region) = (server.view().unwrap().number, region_of(&server, leader));
    let body = server.record().body(BODY).unwrap().clone();
    let bodies = vec![BodyCheckpoint { id: BODY, region, epoch: body.epoch, state: body.state }];
    let own = ToServer::Checkpoint { view, tick: Tick(1), division: 0, bodies };
    tell(&mut server, leader, Message::ToServer(own));
    server.main_mut().record.set_life(BODY, crate::cluster::Life::Removing { park: false, back: false });
    let removed = || Message::ToServer(ToServer::Removed { view, tick: Tick(2), bodies: vec![body.clone()] });
    let before = server.stale();
    tell(&mut server, liar, removed());
    assert!(server.record().body(BODY).is_some());
    assert_eq!(server.stale(), before + 1);
    tell(&mut server, leader, removed());
    assert!(server.record().body(BODY).is_none());
}

#[test]
fn delays_to_nodes_that_are_not_there_are_not_kept() {
    let (mut server, _, liar) = server_and_members();
    let known = server.common.nodes[&NodeId(liar)].delays.len();
    let delays = (1_000..9_000).map(|node| Delay { node: NodeId(node), delay_ms: Some(1.0) }).collect();
    let before = server.stale();
    tell(&mut server, liar, Message::ToServer(ToServer::Delays(delays)));
    assert_eq!(server.common.nodes[&NodeId(liar)].delays.len(), known);
    assert_eq!(server.stale(), before + 8_000);
}

#[test]
fn a_member_that_waits_for_a_division_that_never_comes_does_not_fill_the_server() {
    let (mut server, _, liar) = server_and_members();
    let (view, region) = (server.view().unwrap().number, region_of(&server, liar));
    let body = server.record().body(BODY).unwrap().clone();
    let one = BodyCheckpoint { id: BODY, region, epoch: body.epoch, state: body.state };
    let before = server.stale();
    for _ in 0..10 {
        let bodies = vec![one; 50_000];
        let ahead = ToServer::Checkpoint { view, tick: Tick(1), division: 7, bodies };
        tell(&mut server, liar, Message::ToServer(ahead));
    }
    assert_eq!(server.stale(), before + 8, "two are kept");
}
