//! Tests what clients and nodes cannot make a server do. Each refusal is named or counted, and others go on.

use super::*;
use crate::protocol::{ContactOffset, WorldOp};

#[test]
fn a_client_that_keeps_inventing_shapes_is_refused_and_others_are_not() {
    let mut server = server();
    let spawned = |server: &mut Server, client, shape: &ShapeRecord| {
        let id = BodyId::avatar(client, 0);
        let mut body = sim_body(id, [1.0; 3]);
        Arc::make_mut(&mut body.traits).colliders.push(collider(shape));
        let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
        let spawn = Message::FromClient(client, FromClient::Spawn { body, shapes: vec![shape.clone()] });
        let despawn = Message::FromClient(client, FromClient::Despawn(id));
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: spawn });
        let is_there = server.record().body(id).is_some();
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: despawn });
        let leave = Message::FromClient(client, FromClient::Leave);
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: leave });
        is_there
    };
    // Some 100 kB each, and no two equal.
    let hull = |n: usize| {
        let point =
            |i: usize| [n as f32 / 4.0 + 1.0 / (i + 1) as f32, (i % 97) as f32 / 2.0, (i % 89) as f32 / 2.0];
        ShapeRecord::ConvexPolyhedron((0..8_500).map(point).collect(), Vec::new())
    };
    let came = (0..20).take_while(|&n| spawned(&mut server, ClientId(7), &hull(n))).count();
    assert!((5..15).contains(&came), "{came} came within a MiB");
    assert!(!spawned(&mut server, ClientId(7), &hull(99)), "though it left and came back");
    assert!(spawned(&mut server, ClientId(7), &hull(0)), "what is known costs nothing");
    assert!(spawned(&mut server, ClientId(8), &hull(99)), "others are not its judge");
}

#[test]
fn an_avatar_comes_no_faster_than_the_world_allows_and_nothing_pushes_it() {
    let mut server = server();
    let client = ClientId(7);
    let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    let limit = sim_world(2).avatar_speed_limit;
    for (index, speed) in [(0, 0.99 * limit), (1, 1.01 * limit)] {
        let mut body = sim_body(BodyId::avatar(client, index), [1.0; 3]);
        body.state.velocity.linear[2] = -speed;
        (body.state.force, body.state.torque) = ([1e9; 3], [1e9; 3]);
        body.state.contact_offset = Some(ContactOffset { moved_m: [0.5, 0.0, 0.0], turned: [0.0; 3] });
        let spawn = Message::FromClient(client, FromClient::Spawn { body, shapes: Vec::new() });
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: spawn });
    }
    let state = server.record().body(BodyId::avatar(client, 0)).unwrap().state;
    assert_eq!((state.velocity.linear[2], state.force, state.torque), (-0.99 * limit, [0.0; 3], [0.0; 3]));
    assert_eq!(state.contact_offset, None, "nobody has found its contacts");
    assert!(server.record().body(BodyId::avatar(client, 1)).is_none());
}

#[test]
fn a_client_that_brings_avatars_without_end_or_asks_for_the_world_again_and_again_is_held_back() {
    let mut server = server();
    let (client, other) = (ClientId(7), ClientId(8));
    let tell = |server: &mut Server, at_ms: u64, client: ClientId, message: Message| {
        let now = NOW + Duration::from_millis(at_ms);
        server.handle(now, ServerEvent::Message { from: Peer::Client(client), message });
        let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
        let is_refused = |output: &ServerOutput| match output {
            ServerOutput::Send { to, message: Message::ToClient(_, ToClient::Rejected { reason, .. }) } => {
                assert_eq!((*to, *reason), (Peer::Client(client), Refusal::TooMany));
                true
            }
            _ => false,
        };
        let is_closed = |output: &ServerOutput| matches!(output, ServerOutput::Close { peer, .. } if *peer == Peer::Client(client));
        (outputs.iter().any(is_refused), outputs.iter().any(is_closed))
    };
    let hello = || Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    tell(&mut server, 0, client, hello());
    tell(&mut server, 0, other, hello());
    let spawn_and_despawn = |server: &mut Server, at_ms: u64, client: ClientId| {
        let id = BodyId::avatar(client, 0);
        let body = sim_body(id, [1.0; 3]);
        let spawn = FromClient::Spawn { body, shapes: Vec::new() };
        let (refused, _) = tell(server, at_ms, client, Message::FromClient(client, spawn));
        if !refused {
            tell(server, at_ms, client, Message::FromClient(client, FromClient::Despawn(id)));
        }
        !refused
    };
    let came = (0..3_000).filter(|_| spawn_and_despawn(&mut server, 0, client)).count();
    assert!((MAX_AVATARS..3_000).contains(&came), "{came} came at once");
    assert!(spawn_and_despawn(&mut server, 0, other), "others are not its judge");
    let later = (0..1_000).filter(|_| spawn_and_despawn(&mut server, 1_000, client)).count();
    assert!((1..300).contains(&later), "{later} more came within a second");
    let welcomed =
        (0..100).take_while(|_| tell(&mut server, 1_000, other, hello()) == (false, false)).count();
    assert!((10..100).contains(&welcomed), "told the whole world {welcomed} times");
    assert_eq!(tell(&mut server, 1_000, other, hello()), (true, true));
    assert_eq!(tell(&mut server, 3_000, other, hello()), (false, false), "it may come again");
}

#[test]
fn an_avatar_that_costs_too_much_is_refused_with_what_there_is_too_much_of() {
    use crate::protocol::Costs;
    let mut server = server();
    for client in (1..5).map(ClientId) {
        let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    }
    let mut next = 0;
    let mut spawned = |client: u32, at: [f64; 3], shapes: Vec<ShapeRecord>, iterations: u32| {
        let client = ClientId(client);
        let mut body = sim_body(BodyId::avatar(client, next), at);
        next += 1;
        let traits = Arc::make_mut(&mut body.traits);
        traits.colliders.extend(shapes.last().map(collider));
        traits.extra_pgs_iterations = iterations;
        let message = Message::FromClient(client, FromClient::Spawn { body, shapes });
        while server.poll_output().is_some() {}
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message });
        std::iter::from_fn(|| server.poll_output()).find_map(|output| match output {
            ServerOutput::Send {
                message: Message::ToClient(_, ToClient::Rejected { reason: Refusal::Costly(what), .. }),
                ..
            } => Some(what),
            _ => None,
        })
    };
    let ball = |radius| vec![ShapeRecord::Ball(radius)];
    assert_eq!(spawned(1, [0.0; 3], ball(0.5), 8), None);
    assert_eq!(spawned(1, [0.0; 3], ball(0.5), 9), Some(Costs::Iterations));
    assert_eq!(spawned(1, [0.0; 3], ball(101.0), 0), Some(Costs::Size));
    // One shape hangs far out on the body.
    let far = Pose { translation: [99.0, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0] };
    let compound = ShapeRecord::Compound(vec![(far, ball(2.0)[0].hash())]);
    assert_eq!(spawned(1, [0.0; 3], vec![ball(2.0)[0].clone(), compound], 0), Some(Costs::Size));

    let hull = |n: usize| {
        let point = |i: usize| [n as f32 + 1.0 / (i + 1) as f32, (i % 47) as f32, (i % 43) as f32];
        vec![ShapeRecord::ConvexPolyhedron((0..2_000).map(point).collect(), Vec::new())]
    };
    let came =
        (0..20).take_while(|&n| spawned(2, [n as f64 * 500.0, 0.0, 0.0], hull(0), 0).is_none()).count();
    assert_eq!(came, 10);
    assert_eq!(spawned(2, [1e4; 3], hull(0), 0), Some(Costs::Corners));
    assert_eq!(spawned(3, [1e4; 3], hull(0), 0), None, "others are not its judge");

    let came = (0..100).take_while(|_| spawned(4, [0.0; 3], ball(0.5), 0).is_none()).count();
    assert_eq!(came, 65);
    assert_eq!(spawned(4, [0.0; 3], ball(0.5), 0), Some(Costs::Overlaps));
    assert_eq!(spawned(4, [2.0, 0.0, 0.0], ball(0.5), 0), None, "beside them there is room");
}

#[test]
fn a_character_takes_no_giants_steps_and_begins_as_its_velocity_says() {
    use crate::protocol::{BodyKind, Character, Controller, Costs, Gait};
    let mut server = server();
    let client = ClientId(1);
    let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    let mut next = 0;
    let mut spawned = |character: Character| {
        let id = BodyId::avatar(client, next);
        next += 1;
        let ball = ShapeRecord::Ball(0.5);
        let mut body = sim_body(id, [f64::from(next), 0.0, 0.0]);
        let traits = Arc::make_mut(&mut body.traits);
        traits.kind = BodyKind::KinematicVelocity;
        traits.colliders.push(collider(&ball));
        body.state.velocity.linear = [1.0, 0.0, 0.0];
        let mut body = body.with_controller(Some(Controller::Character(&character)));
        // No program of ours sends this.
        body.state.gait = Some(Gait { wanted: [1e30, 0.0, 0.0], rise_m_s: 1e30, grounded: true });
        let message = Message::FromClient(client, FromClient::Spawn { body, shapes: vec![ball] });
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message });
        server.record().body(id).map(|body| body.state.gait)
    };
    let usual = Character::default();
    let fresh = Gait { wanted: [1.0, 0.0, 0.0], ..Gait::default() };
    assert_eq!(spawned(usual), Some(Some(fresh)));
    assert_eq!(spawned(Character { step_height_m: 90.0, ..usual }), None);
    assert_eq!(spawned(Character { step_depth_m: 1.1, ..usual }), None);
    assert_eq!(spawned(Character { snap_m: 1.1, ..usual }), None);
    assert_eq!(spawned(Character { gap_m: 0.2, ..usual }), None);
    assert_eq!(spawned(Character { mass_kg: 2e4, ..usual }), None);
    assert!((1..40).take_while(|_| spawned(usual).is_some()).count() == 31, "32 with the first");
    let refused = std::iter::from_fn(|| server.poll_output()).filter_map(|output| match output {
        ServerOutput::Send {
            message: Message::ToClient(_, ToClient::Rejected { reason: Refusal::Costly(what), .. }),
            ..
        } => Some(what),
        _ => None,
    });
    let refused: Vec<_> = refused.collect();
    assert_eq!(refused[..5], [Costs::Strides; 5]);
    assert_eq!(refused[5], Costs::Characters);
}

#[test]
fn only_the_leader_that_a_client_plays_with_speaks_for_it() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let client = ClientId(7);
    let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    // Node 2 leads another group.
    let mut other = Group::new(GroupId(2), server.record().clone(), Tick(0));
    other.view = server.view().map(|view| View { group: GroupId(2), leader: NodeId(2), ..view.clone() });
    server.groups.insert(GroupId(2), other);
    let id = BodyId::avatar(client, 0);
    let spawn = FromClient::Spawn { body: sim_body(id, [1.0; 3]), shapes: Vec::new() };
    let before = server.stale();
    tell(&mut server, 2, Message::FromClient(client, spawn.clone()));
    assert!(server.record().body(id).is_none());
    assert_eq!(server.stale(), before + 1);
    tell(&mut server, 1, Message::FromClient(client, spawn));
    assert!(server.record().body(id).is_some());
}

/// Returns a server with two members that compute a region each, and the number of their view.
pub(super) fn server_of_two() -> (Server, ViewNumber) {
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let mut server = Server::new(config(2), Record::new(bodies, Vec::new(), Vec::new()));
    for node in [1, 2] {
        hello(&mut server, node, VERSION);
        tell(&mut server, node, Message::ToServer(ToServer::Loaded));
    }
    let view = server.view().expect("it has begun");
    assert_eq!(view.allocation.len(), 2);
    let number = view.number;
    (server, number)
}

/// Has `member` say this every second. Returns whether `liar`, which keeps the others waiting, is given up
/// before long.
fn is_given_up(server: &mut Server, liar: u32, member: u32, says: &ToServer) -> bool {
    let started = server.common.now;
    let mut outputs = Vec::new();
    while server.common.now < started + Duration::from_secs(60) {
        let now = server.common.now + Duration::from_millis(250);
        server.handle_timeout(now);
        outputs.extend(std::iter::from_fn(|| server.poll_output()));
        if outputs.contains(&ServerOutput::Expelled(NodeId(liar))) {
            return true;
        }
        if now.subsec_millis() == 0 {
            tell(server, member, Message::ToServer(says.clone()));
        }
    }
    false
}

#[test]
fn a_member_that_answers_without_an_end_does_not_stop_the_world() {
    for (settles, finds) in [(true, false), (true, true), (false, false), (false, true)] {
        let (mut server, _) = server_of_two();
        server.main_mut().unsure = true;
        server.finish(0);
        while server.poll_output().is_some() {}
        let view = server.common.number;
        let part = |last| ToServer::Settling { view, dispatches: Vec::new(), undone: Vec::new(), last };
        tell(&mut server, 1, Message::ToServer(part(true)));
        let says = if settles && !finds {
            part(false)
        } else if settles {
            let undone = vec![WorldOp::Remove(BodyId::persistent(0))];
            ToServer::Settling { view, dispatches: Vec::new(), undone, last: false }
        } else {
            tell(&mut server, 2, Message::ToServer(part(true)));
            for node in [1, 2] {
                let nothing = survey(&server, view, 0, Vec::new());
                tell(&mut server, node, Message::ToServer(nothing));
            }
            tell(&mut server, 1, Message::ToServer(ToServer::Found { view, bodies: Vec::new(), last: true }));
            let body = server.record().body(BodyId::persistent(0)).unwrap().clone();
            let bodies = if finds { vec![body] } else { Vec::new() };
            ToServer::Found { view, bodies, last: false }
        };
        assert!(is_given_up(&mut server, 2, 2, &says), "{settles} {finds}");
    }
}

#[test]
fn a_member_that_owes_nothing_does_not_keep_another_from_being_given_up() {
    let (mut server, _) = server_of_two();
    server.main_mut().unsure = true;
    server.finish(0);
    let view = server.common.number;
    for node in [1, 2] {
        let part = ToServer::Settling { view, dispatches: Vec::new(), undone: Vec::new(), last: true };
        tell(&mut server, node, Message::ToServer(part));
    }
    for node in [1, 2] {
        let nothing = survey(&server, view, 0, Vec::new());
        tell(&mut server, node, Message::ToServer(nothing));
    }
    tell(&mut server, 1, Message::ToServer(ToServer::Found { view, bodies: Vec::new(), last: true }));
    let says = ToServer::Found { view, bodies: Vec::new(), last: true };
    assert!(is_given_up(&mut server, 2, 1, &says));
}

#[test]
fn a_member_that_greets_again_and_again_does_not_stop_the_world() {
    let (mut server, present) = server_of_two();
    let resume = Some(present);
    let role = JoinAs::Node { address: ([127, 0, 0, 1], 2).into(), client: None, resume, heard: 0 };
    let greets = |server: &mut Server| tell(server, 2, Message::Hello(Hello { version: VERSION, role }));
    let sent_away = |outputs: &[ServerOutput]| {
        outputs.iter().any(|output| matches!(output, ServerOutput::Close { peer: Peer::Node(NodeId(2)), .. }))
    };
    // A link that breaks once per second is made anew each time.
    for second in 0..100 {
        server.common.now = Duration::from_secs(second);
        assert!(!sent_away(&greets(&mut server)));
    }
    assert!((0..100).any(|_| sent_away(&greets(&mut server))));
    assert!(server.linked_nodes().eq([NodeId(1)]));
}

#[test]
fn a_checkpoint_counts_of_the_senders_own_regions_and_at_an_epoch_that_can_be() {
    let (mut server, view) = server_of_two();
    let id = BodyId::persistent(0);
    let x = |server: &Server| server.record().body(id).unwrap().state.pose.translation[0];
    let first = Epoch::placed_in(view.0);
    let of = |server: &Server, region| server.view().unwrap().allocation[&region];
    let say = |server: &mut Server, region: RegionId, epoch, to: f64| {
        let node = of(server, RegionId(1)).0;
        let state = sim_body(id, [to, 1.0, 1.0]).state;
        let bodies = vec![BodyCheckpoint { id, region, epoch, state }];
        let before = server.stale();
        tell(
            server,
            node,
            Message::ToServer(ToServer::Checkpoint { view, tick: Tick(9), division: 0, bodies }),
        );
        server.stale() - before
    };
    assert_eq!(say(&mut server, RegionId(2), first, 50.0), 1, "that region is another's");
    assert_eq!(say(&mut server, RegionId(7), first, 50.0), 1, "there is no such region");
    assert_eq!(say(&mut server, RegionId(1), Epoch::placed_in(view.0 + 1), 50.0), 1, "of a view to come");
    assert_eq!(
        say(&mut server, RegionId(1), Epoch(first.0 + 11), 50.0),
        1,
        "eleven transfers by the ninth tick"
    );
    assert_eq!(x(&server), 0.0);
    assert_eq!(say(&mut server, RegionId(1), Epoch(first.0 + 10), 5.0), 0);
    assert_eq!(x(&server), 5.0);
}

#[test]
fn a_checkpoint_after_a_change_of_the_tree_waits_for_the_leaders_word_of_it() {
    let (mut server, view) = server_of_two();
    let present = server.view().unwrap().clone();
    let other =
        present.members.iter().map(|member| member.node).find(|node| *node != present.leader).unwrap();
    let id = BodyId::persistent(0);
    let epoch = Epoch::placed_in(view.0);
    let state = sim_body(id, [5.0, 1.0, 1.0]).state;
    let checkpoint = |region| {
        let bodies = vec![BodyCheckpoint { id, region, epoch, state }];
        Message::ToServer(ToServer::Checkpoint { view, tick: Tick(9), division: 1, bodies })
    };
    // A region that the other member has from that division on.
    let new = RegionId(3);
    tell(&mut server, other.0, checkpoint(new));
    assert_eq!(server.record().body(id).unwrap().state.pose.translation[0], 0.0);
    let mut allocation = present.allocation.clone();
    allocation.insert(new, other);
    let (tree, tick, division) = (present.tree.clone(), Tick(9), 1);
    let word = ToServer::Repartitioned { view, tick, tree, allocation, division };
    tell(&mut server, other.0, Message::ToServer(word.clone()));
    assert_eq!(server.stale(), 1, "it does not lead");
    tell(&mut server, present.leader.0, Message::ToServer(word));
    assert_eq!(server.record().body(id).unwrap().state.pose.translation[0], 5.0);
    assert_eq!(server.stale(), 1);
}

#[test]
fn a_body_that_is_claimed_in_a_region_that_is_not_there_is_placed_by_where_it_is() {
    let (mut server, _) = server_of_two();
    server.main_mut().unsure = true;
    server.finish(0);
    while server.poll_output().is_some() {}
    let view = server.common.number;
    let id = BodyId::persistent(0);
    let body = server.record().body(id).unwrap().clone();
    let claims = vec![Claim { id, epoch: body.epoch, region: RegionId(77) }];
    for node in [1, 2] {
        tell(
            &mut server,
            node,
            Message::ToServer(ToServer::Settling {
                view,
                dispatches: Vec::new(),
                undone: Vec::new(),
                last: true,
            }),
        );
    }
    let claiming = survey(&server, view, 9, claims);
    tell(&mut server, 1, Message::ToServer(claiming));
    let nothing = survey(&server, view, 9, Vec::new());
    tell(&mut server, 2, Message::ToServer(nothing));
    let mut outputs = Vec::new();
    for node in [1, 2] {
        let found = ToServer::Found { view, bodies: Vec::new(), last: true };
        outputs.extend(tell(&mut server, node, Message::ToServer(found)));
    }
    let placed = outputs.iter().find_map(|output| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Chunk(Chunk::Placed(placed))), .. } => {
            placed.iter().find(|placed| placed.body.id == id)
        }
        _ => None,
    });
    let region = server.view().unwrap().tree.leaf_at(body.state.pose.translation);
    assert_eq!(placed.expect("it is not lost").region, region);
}
