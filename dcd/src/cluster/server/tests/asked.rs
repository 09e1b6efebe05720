//! Tests what the server does when clients ask for changes of avatars, and its program for changes of bodies.

use super::*;
use crate::cluster::Key;
use crate::cluster::directory::{Entry, Revision};
use crate::cluster::server::steered::WRITE_EVERY;
use crate::cluster::server::stored::StoredGroup;
use crate::fidelity::Fidelity;
use crate::protocol::{
    Alteration, BodyKind, BodyState, BuildOp, Input, Push, Velocity, WorldOp, WorldPose, decode_value,
    encode_value,
};
use crate::space::{JointId, Viewpoint};

/// Returns the operations that leaders are told.
fn applied(outputs: Vec<ServerOutput>) -> Vec<WorldOp> {
    let ops = outputs.into_iter().filter_map(|output| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Apply { ops, .. }), .. } => Some(ops),
        _ => None,
    });
    ops.flatten().collect()
}

#[test]
fn an_avatar_of_a_shape_that_nodes_cannot_have_is_refused_and_not_on_record() {
    let mut server = server();
    let client = ClientId(7);
    let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    let spawned = |server: &mut Server, index, of: &ShapeRecord, shapes: Vec<ShapeRecord>| {
        let mut body = sim_body(BodyId::avatar(client, index), [1.0; 3]);
        Arc::make_mut(&mut body.traits).colliders.push(collider(of));
        let message = Message::FromClient(client, FromClient::Spawn { body, shapes });
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message });
        let refused = |output: ServerOutput| {
            let ServerOutput::Send { message: Message::ToClient(_, message), .. } = output else {
                return false;
            };
            matches!(message, ToClient::Rejected { reason: Refusal::Shape, .. })
        };
        let refused = std::iter::from_fn(|| server.poll_output()).any(refused);
        assert_ne!(refused, server.record().body(BodyId::avatar(client, index)).is_some());
        !refused
    };
    let [ball, cone] = [ShapeRecord::Ball(0.5), ShapeRecord::Cone(0.5, 0.5)];
    let voxels = ShapeRecord::Voxels([1.0; 3], vec![[0; 3]]);
    let compound = |part: &ShapeRecord| ShapeRecord::Compound(vec![(collider(part).pose, part.hash())]);
    assert!(!spawned(&mut server, 0, &ball, vec![]), "nobody has sent it");
    assert!(spawned(&mut server, 0, &ball, vec![ball.clone()]));
    assert!(spawned(&mut server, 1, &ball, vec![]), "it is on record");
    assert!(spawned(&mut server, 2, &compound(&ball), vec![compound(&ball)]), "and so is its part");
    assert!(!spawned(&mut server, 3, &cone, vec![cone.clone()]), "it cannot be built");
    assert!(!spawned(&mut server, 3, &ball, vec![cone.clone()]), "nor what else comes along");
    assert!(!spawned(&mut server, 3, &cone, vec![]), "it was not kept");
    assert!(!spawned(&mut server, 3, &voxels, vec![voxels.clone()]), "an avatar cannot be of voxels");
    let hidden = vec![voxels.clone(), compound(&voxels)];
    assert!(!spawned(&mut server, 3, &compound(&voxels), hidden), "nor a part of it");
}

#[test]
fn avatars_wait_for_their_client_and_not_for_ever() {
    let mut server = server();
    let hello = || Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
    let says = |server: &mut Server, now, client: u32, message| {
        server.handle(now, ServerEvent::Message { from: Peer::Client(ClientId(client)), message });
    };
    let avatar = |client: u32| BodyId::avatar(ClientId(client), 0);
    let comes = |server: &mut Server, client: u32| {
        says(server, NOW, client, hello());
        let spawn = FromClient::Spawn { body: sim_body(avatar(client), [1.0; 3]), shapes: Vec::new() };
        says(server, NOW, client, Message::FromClient(ClientId(client), spawn));
        says(server, NOW, client, Message::FromClient(ClientId(client), FromClient::Leave));
    };
    let (stays_away, returns, leaves_again) = (1, 2, 3);
    [stays_away, returns, leaves_again].into_iter().for_each(|client| comes(&mut server, client));
    let waits = |server: &Server, client| server.record().body(avatar(client)).is_some();
    let expiry = config(1).avatar_expiry;
    says(&mut server, expiry / 2, returns, hello());
    says(&mut server, expiry / 2, leaves_again, hello());
    says(
        &mut server,
        expiry / 2,
        leaves_again,
        Message::FromClient(ClientId(leaves_again), FromClient::Leave),
    );
    // Any event makes the server look.
    says(&mut server, expiry - Duration::from_millis(1), 9, hello());
    assert!([stays_away, returns, leaves_again].into_iter().all(|client| waits(&server, client)));
    says(&mut server, expiry, 9, hello());
    assert!(!waits(&server, stays_away) && waits(&server, returns) && waits(&server, leaves_again));
    says(&mut server, expiry + expiry / 2, 9, hello());
    assert!(waits(&server, returns) && !waits(&server, leaves_again));
}

#[test]
fn what_the_program_does_while_no_leader_hears_it_is_told_to_the_next_but_for_impulses() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let body = BodyId::persistent(0);
    let to = |speed| Input {
        body,
        logical_time: 0,
        tick: Tick(0),
        velocity: Velocity::linear([speed, 0.0, 0.0]),
        pose: None,
        drive: None,
    };
    let does = |server: &mut Server, op| {
        let now = server.common.now;
        server.handle(now, ServerEvent::Program(vec![op]));
        applied(std::iter::from_fn(|| server.poll_output()).collect())
    };
    assert_eq!(does(&mut server, BuildOp::Move(to(1.0))), [WorldOp::Input(to(1.0))]);
    server.handle(server.common.now, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    let force = |up| Push::force(body, [0.0, up, 0.0], [0.0; 3]);
    for i in 0..1_000 {
        assert_eq!(does(&mut server, BuildOp::Move(to(i as f32))), []);
        assert_eq!(does(&mut server, BuildOp::Push(force(i as f32))), []);
        assert_eq!(does(&mut server, BuildOp::Push(Push::impulse(body, [1.0; 3]))), []);
    }
    let gone = Input { body: BodyId::persistent(1), ..to(2.0) };
    does(&mut server, BuildOp::Move(gone));
    does(&mut server, BuildOp::Remove(gone.body));
    let outputs = hello(&mut server, 1, VERSION);
    let outputs = obey(&mut server, 1, outputs);
    // The node has begun anew, and is given the bodies with the velocities that they were to have.
    assert_eq!(server.record().body(body).unwrap().state.velocity.linear, [999.0, 0.0, 0.0]);
    assert_eq!(applied(outputs), [WorldOp::Push(force(999.0))]);
}

#[test]
fn what_the_program_did_into_a_dead_link_its_leader_is_told_again_before_it_is_to_stop() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let present = server.view().expect("it has begun").number;
    let body = BodyId::persistent(0);
    let to = |speed, pose: Option<f64>| {
        let velocity = Velocity::linear([speed, 0.0, 0.0]);
        let pose = pose.map(|x| WorldPose::at([x, 0.0, 0.0]));
        Input { body, logical_time: 0, tick: Tick(0), velocity, pose, drive: None }
    };
    let moves = [to(1.0, None), to(2.0, Some(5.0)), to(3.0, None)].map(BuildOp::Move).to_vec();
    let ops = [moves, vec![BuildOp::Push(Push::impulse(body, [1.0; 3]))]].concat();
    server.handle(NOW, ServerEvent::Program(ops));
    assert_eq!(applied(std::iter::from_fn(|| server.poll_output()).collect()).len(), 4);
    for (heard, lost) in
        [(0, vec![to(3.0, Some(5.0))]), (1, vec![to(3.0, Some(5.0))]), (2, vec![to(3.0, None)]), (4, vec![])]
    {
        let mut server = server.clone();
        let role =
            JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume: Some(present), heard };
        let outputs = tell(&mut server, 1, Message::Hello(Hello { version: VERSION, role }));
        let to_node = |output: &ServerOutput| match output {
            ServerOutput::Send { message: Message::ToNode(message), .. } => Some(message.clone()),
            _ => None,
        };
        let told: Vec<_> = outputs.iter().filter_map(to_node).collect();
        let settles = told.iter().position(|message| matches!(message, ToNode::Settle { .. }));
        let applies = told.iter().position(|message| matches!(message, ToNode::Apply { .. }));
        assert!(settles.is_some() && applies < settles, "{told:?}");
        let first = told.iter().find_map(|message| match message {
            ToNode::Apply { first, .. } => Some(*first),
            _ => None,
        });
        assert_eq!(first, (!lost.is_empty()).then_some(heard));
        assert_eq!(applied(outputs), lost.into_iter().map(WorldOp::Input).collect::<Vec<_>>());
    }
}

#[test]
fn what_a_leader_that_goes_had_not_passed_on_the_next_one_does() {
    let body = BodyId::persistent(0);
    let push = |body, x| WorldOp::Push(Push::impulse(body, [x, 0.0, 0.0]));
    let mut server = server_of_two();
    let outputs = tell(&mut server, 1, Message::ToServer(ToServer::Leave));
    let outputs = obey_by(&mut server, outputs, |server, to, message| match message {
        ToNode::Settle { view } => {
            let gone = push(BodyId::persistent(9), 1.0);
            let undone = vec![push(body, to.0 as f32), WorldOp::Remove(body), gone];
            Some(ToServer::Settling { view, dispatches: Vec::new(), undone, last: true })
        }
        message => answer(server, message),
    });
    assert_eq!(server.view().unwrap().leader, NodeId(2));
    let applied = outputs.into_iter().filter_map(|output| match output {
        ServerOutput::Send { to, message: Message::ToNode(ToNode::Apply { ops, .. }) } => Some((to, ops)),
        _ => None,
    });
    // Only the leader's word counts, and only for bodies that are there.
    assert_eq!(applied.collect::<Vec<_>>(), [(Peer::Node(NodeId(2)), vec![push(body, 1.0)])]);
}

#[test]
fn what_a_leader_handed_over_before_it_died_in_the_same_change_the_next_one_does() {
    let body = BodyId::persistent(0);
    let push = |x| WorldOp::Push(Push::impulse(body, [x, 0.0, 0.0]));
    let mut server = server_of_two();
    tell(&mut server, 1, Message::ToServer(ToServer::Leave));
    assert!(server.is_changing());
    for (x, last) in [(1.0, false), (2.0, true)] {
        let (view, undone) = (server.common.number, vec![push(x)]);
        let part = ToServer::Settling { view, dispatches: Vec::new(), undone, last };
        tell(&mut server, 1, Message::ToServer(part));
    }
    server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    let outputs = std::iter::repeat_with(|| wait(&mut server))
        .find(|outputs| outputs.contains(&ServerOutput::Expelled(NodeId(1))))
        .expect("it is given up");
    let outputs = obey(&mut server, 2, outputs);
    assert_eq!(server.view().map(|view| view.leader), Some(NodeId(2)));
    assert_eq!(applied(outputs), [push(1.0), push(2.0)]);
}

#[test]
fn what_a_leader_handed_over_is_not_lost_as_another_node_dies_before_it() {
    let push = |x| WorldOp::Push(Push::impulse(BodyId::persistent(0), [x, 0.0, 0.0]));
    let bodies = vec![sim_body(BodyId::persistent(0), [1.0; 3])];
    let mut server = Server::new(config(3), Record::new(bodies, Vec::new(), Vec::new()));
    for node in 1..=3 {
        hello(&mut server, node, VERSION);
        tell(&mut server, node, Message::ToServer(ToServer::Loaded));
    }
    assert_eq!(server.view().map(|view| view.members.len()), Some(3));
    let settles = |server: &mut Server, x, last| {
        let (view, undone) = (server.common.number, vec![push(x)]);
        let part = ToServer::Settling { view, dispatches: Vec::new(), undone, last };
        tell(server, 1, Message::ToServer(part));
    };
    let dies = |server: &mut Server, node| {
        server.handle(server.common.now, ServerEvent::Disconnected(Peer::Node(NodeId(node))));
        std::iter::repeat_with(|| wait(server))
            .find(|outputs| outputs.contains(&ServerOutput::Expelled(NodeId(node))))
            .expect("it is given up")
    };
    server.handle(server.common.now, ServerEvent::Save);
    settles(&mut server, 1.0, true);
    dies(&mut server, 3);
    let mut again = server.clone();
    let outputs = dies(&mut server, 1);
    assert_eq!(applied(obey(&mut server, 2, outputs)), [push(1.0)]);
    // If the leader has begun to say it again, that counts.
    settles(&mut again, 2.0, false);
    settles(&mut again, 3.0, true);
    let outputs = dies(&mut again, 1);
    assert_eq!(applied(obey(&mut again, 2, outputs)), [push(2.0), push(3.0)]);
}

/// Returns a server of two nodes that have fallen silent after their leader handed a push over, with that
/// push and the view's number.
fn fallen_silent() -> (Server, WorldOp, ViewNumber) {
    let push = WorldOp::Push(Push::impulse(BodyId::persistent(0), [1.0, 0.0, 0.0]));
    let mut server = server_of_two();
    let present = server.view().unwrap().number;
    server.handle(NOW, ServerEvent::Save);
    let (view, undone) = (server.common.number, vec![push.clone()]);
    let settling = ToServer::Settling { view, dispatches: Vec::new(), undone, last: true };
    tell(&mut server, 1, Message::ToServer(settling));
    for node in [1, 2] {
        server.handle(NOW, ServerEvent::Disconnected(Peer::Node(NodeId(node))));
    }
    while !server.main().held {
        server.handle_timeout(server.poll_timeout().expect("they are given up"));
    }
    (server, push, present)
}

/// Returns what the leader of the view after this one is told to do. One node is alone in that view.
fn told_next(
    server: &mut Server,
    present: ViewNumber,
    node: u32,
    outputs: Vec<ServerOutput>,
) -> Vec<WorldOp> {
    let mut outputs = obey(server, node, outputs);
    while server.view().is_none_or(|view| view.number == present) {
        outputs = wait(server);
        outputs = obey(server, node, outputs);
    }
    applied(outputs)
}

#[test]
fn what_a_leader_handed_over_before_all_fell_silent_is_done_by_who_takes_over() {
    let (mut server, push, present) = fallen_silent();
    let outputs = hello(&mut server, 3, VERSION);
    assert_eq!(told_next(&mut server, present, 3, outputs), [push]);
}

#[test]
fn what_a_leader_handed_over_before_all_fell_silent_is_not_done_again_by_who_went_on_with_it() {
    let (mut server, _, present) = fallen_silent();
    let outputs = back(&mut server, 2, present);
    assert_eq!(told_next(&mut server, present, 2, outputs), []);
}

#[test]
fn what_a_leader_was_told_as_its_view_began_the_next_is_told_too_where_it_may_not_have_done_it() {
    let joint = vicinity::joint(1, 0, 1);
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let mut server = Server::new(config(1), Record::new(bodies, Vec::new(), vec![joint]));
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let alteration = Alteration::Body {
        body: BodyId::persistent(2),
        traits: sim_body(BodyId::persistent(2), [2.0; 3]).traits,
        user_data: 0,
        wakes: true,
    };
    let told = [WorldOp::RemoveJoint(JointId(1)), WorldOp::Alter(alteration.clone())];
    server.handle(NOW, ServerEvent::Save);
    let ops = vec![BuildOp::RemoveJoint(JointId(1)), BuildOp::Alter(alteration)];
    server.handle(NOW, ServerEvent::Program(ops));
    let began: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
    assert_eq!(applied(obey(&mut server, 1, began)), told, "the change is over");
    let again = |server: &mut Server| {
        server.main_mut().unsure = true;
        server.finish(0);
        let began: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
        applied(obey(server, 1, began))
    };
    assert_eq!(again(&mut server), told, "it has opened no tick");
    // The leader says how far it is, soon and late.
    let says = |server: &mut Server, tick| {
        let view = server.view().expect("it goes on").number;
        let bodies = Vec::new();
        let said = ToServer::Checkpoint { view, tick: Tick(tick), division: 0, bodies };
        tell(server, 1, Message::ToServer(said));
    };
    says(&mut server, 9);
    assert_eq!(again(&mut server).len(), 2, "it may not have heard it by then");
    server.common.now += Duration::from_secs(6);
    says(&mut server, 10);
    assert_eq!(again(&mut server).len(), 2, "it may have waited for this tick ever since");
    server.common.now += Duration::from_secs(6);
    says(&mut server, 600);
    says(&mut server, 602);
    let left = again(&mut server);
    assert!(matches!(left[..], [WorldOp::Alter(Alteration::Body { wakes: false, .. })]), "{left:?}");
}

/// The entries that a server has written down.
type Stored = BTreeMap<Key, Option<Vec<u8>>>;

/// Has a server take an event in, and writes down what it stores. Returns its other outputs.
fn handled(server: &mut Server, event: ServerEvent, stored: &mut Stored) -> Vec<ServerOutput> {
    server.handle(NOW, event);
    let mut said = Vec::new();
    for output in std::iter::from_fn(|| server.poll_output()) {
        match output {
            ServerOutput::Store(batch) => stored.extend(batch.writes),
            output => said.push(output),
        }
    }
    said
}

fn restarted(stored: Stored) -> Server {
    restarted_with(config(1), stored).expect("it is whole")
}

fn restarted_with(config: ServerConfig, stored: Stored) -> Result<Server, RestoreError> {
    let entry = |(key, value): (Key, Option<Vec<u8>>)| {
        Some(Entry { key, revision: Revision::default(), value: value? })
    };
    Server::restore(config, stored.into_iter().filter_map(entry).collect())
}

/// How a world is computed and told may differ when it is served again. Nodes that went on meanwhile are
/// welcomed with the world as it is served now.
#[test]
fn a_stored_world_is_served_again_with_other_relays_fidelity_and_viewpoints() {
    let (mut server, mut stored) = (server(), Stored::new());
    let join = |resume| {
        let role = JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume, heard: 0 };
        let message = Message::Hello(Hello { version: VERSION, role });
        ServerEvent::Message { from: Peer::Node(NodeId(1)), message }
    };
    let loaded = Message::ToServer(ToServer::Loaded);
    let loaded = ServerEvent::Message { from: Peer::Node(NodeId(1)), message: loaded };
    handled(&mut server, join(None), &mut stored);
    handled(&mut server, loaded, &mut stored);
    let view = server.view().expect("it has begun").number;
    let main = server.main;
    let welcome = |said: Vec<ServerOutput>| {
        said.into_iter().find_map(|output| match output {
            ServerOutput::Send { message: Message::ToNode(ToNode::Welcome { world, .. }), .. } => Some(world),
            _ => None,
        })
    };

    let mut same = restarted(stored.clone());
    assert_eq!(welcome(handled(&mut same, join(Some(view)), &mut stored.clone())), None, "it goes on");

    let mut other = config(1);
    other.world.relays_above = Some(7);
    other.world.fidelity = Fidelity::AUTO;
    other.world.viewpoints = vec![Viewpoint { at: [1.0; 3], radius_m: 5.0 }];
    let served = other.world.clone();
    let mut server = restarted_with(other.clone(), stored.clone()).expect("it is the same world");
    let said = handled(&mut server, join(Some(view)), &mut stored);
    assert_eq!(welcome(said), Some(served));
    assert_eq!(stored[&Key::Group(main)], None, "its nodes are not waited for");
    let mut again = restarted_with(other.clone(), stored.clone()).expect("what is served now is stored");
    let said = handled(&mut again, ServerEvent::Save, &mut stored);
    assert_eq!(welcome(said), None);

    other.world.state_every += 1;
    assert!(matches!(restarted_with(other, stored), Err(RestoreError::OtherWorld)));
}

/// Groups may be minutes apart. What the main one has computed is what the world goes on from.
#[test]
fn another_group_that_is_ahead_takes_the_main_one_nowhere_when_the_server_is_started_again() {
    let (mut server, mut stored) = (server(), Stored::new());
    let role = JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume: None, heard: 0 };
    for message in [Message::Hello(Hello { version: VERSION, role }), Message::ToServer(ToServer::Loaded)] {
        handled(&mut server, ServerEvent::Message { from: Peer::Node(NodeId(1)), message }, &mut stored);
    }
    let main = server.main;
    let of_main = stored[&Key::Group(main)].as_ref().expect("it has a view");
    let mut ahead: StoredGroup = decode_value(of_main).unwrap();
    ahead.view.tick = Tick(9_000);
    stored.insert(Key::Group(GroupId(main.0 + 1)), Some(encode_value(&ahead)));
    assert_eq!(restarted(stored).tick(), server.tick());
}

#[test]
fn a_server_that_is_started_again_waits_for_clients_that_say_nothing_until_their_links_break() {
    let (mut server, mut stored) = (server(), Stored::new());
    let (client, id) = (ClientId(7), BodyId::avatar(ClientId(7), 0));
    let role = JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume: None, heard: 0 };
    let spawn = FromClient::Spawn { body: sim_body(id, [1.0; 3]), shapes: Vec::new() };
    let (node, client) = (Peer::Node(NodeId(1)), Peer::Client(client));
    for (from, message) in [
        (node, Message::Hello(Hello { version: VERSION, role })),
        (node, Message::ToServer(ToServer::Loaded)),
        (client, Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } })),
        (client, Message::FromClient(ClientId(7), spawn)),
    ] {
        handled(&mut server, ServerEvent::Message { from, message }, &mut stored);
    }
    let mut server = restarted(stored);
    let is_there = |server: &Server| server.record().present().any(|body| body.id == id);
    // The client hears nothing from a server that is down, and calls again once it takes its link for dead.
    let mut now = NOW;
    while now < crate::protocol::link::CLIENT_IDLE_TIMEOUT + Duration::from_secs(1) {
        now += Duration::from_millis(250);
        server.handle_timeout(now);
        assert!(is_there(&server), "{now:?}");
    }
    (0..20).for_each(|i| server.handle_timeout(now + i * Duration::from_millis(250)));
    assert!(!is_there(&server));
}

#[test]
fn a_server_that_is_started_again_tells_what_nobody_may_have_heard_of() {
    let mut wall = sim_body(BodyId::persistent(7), [1.0; 3]);
    Arc::make_mut(&mut wall.traits).kind = BodyKind::Fixed;
    let bodies = (0..3).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0]));
    let bodies = bodies.chain([wall]).collect();
    let mut joint = vicinity::joint(2, 1, 2);
    let record = Record::new(bodies, Vec::new(), vec![vicinity::joint(1, 0, 1), joint.clone()]);
    let mut server = Server::new(config(1), record);
    let mut stored = BTreeMap::new();
    let mut does = |server: &mut Server, event| handled(server, event, &mut stored);
    let from = Peer::Node(NodeId(1));
    let role = |resume| JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume, heard: 0 };
    let greets = |resume| Message::Hello(Hello { version: VERSION, role: role(resume) });
    does(&mut server, ServerEvent::Message { from, message: greets(None) });
    does(&mut server, ServerEvent::Message { from, message: Message::ToServer(ToServer::Loaded) });
    let present = server.view().expect("it has begun").number;
    does(&mut server, ServerEvent::Save);
    let traits = sim_body(BodyId::persistent(2), [2.0; 3]).traits;
    let altered = Alteration::Body { body: BodyId::persistent(2), traits, user_data: 0, wakes: true };
    joint.frame_a.translation[0] += 1.0;
    let stretched = Alteration::Joint(Box::new(joint));
    let ops = vec![
        BuildOp::RemoveJoint(JointId(1)),
        BuildOp::Remove(BodyId::persistent(7)),
        BuildOp::Alter(altered.clone()),
        BuildOp::Alter(stretched.clone()),
    ];
    assert_eq!(applied(does(&mut server, ServerEvent::Program(ops))), [], "members are asked what they have");
    let mut server = restarted(stored);
    let outputs = tell(&mut server, 1, greets(Some(present)));
    let outputs = obey(&mut server, 1, outputs);
    let dropped = |output: &ServerOutput| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Adopt { drop, .. }), .. } => Some(drop.clone()),
        _ => None,
    };
    assert_eq!(outputs.iter().find_map(dropped), Some(vec![BodyId::persistent(7)]));
    let told = [WorldOp::RemoveJoint(JointId(1)), WorldOp::Alter(altered), WorldOp::Alter(stretched)];
    assert_eq!(applied(outputs), told);
}

#[test]
fn a_kinematic_body_has_the_velocity_on_record_that_it_was_given_last_whoever_dies() {
    let id = BodyId::persistent(0);
    let mut lift = sim_body(id, [1.0; 3]);
    Arc::make_mut(&mut lift.traits).kind = BodyKind::KinematicVelocity;
    let mut server = Server::new(config(1), Record::new(vec![lift], Vec::new(), Vec::new()));
    let mut stored = Stored::new();
    let from_node = |message| ServerEvent::Message { from: Peer::Node(NodeId(1)), message };
    let role = JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume: None, heard: 0 };
    handled(&mut server, from_node(Message::Hello(Hello { version: VERSION, role })), &mut stored);
    handled(&mut server, from_node(Message::ToServer(ToServer::Loaded)), &mut stored);
    let view = server.view().expect("it has begun").number;
    let goes = |speed: f32| {
        let velocity = Velocity::linear([speed, 0.0, 0.0]);
        let input = Input { body: id, logical_time: 0, tick: Tick(0), velocity, pose: None, drive: None };
        ServerEvent::Program(vec![BuildOp::Move(input)])
    };
    let speed = |server: &Server| server.record().body(id).expect("it is there").state.velocity.linear[0];
    handled(&mut server, goes(2.0), &mut stored);
    assert_eq!(speed(&restarted(stored.clone())), 2.0, "it is written down before anybody hears of it");

    // The node tells of a tick before it heard of the next velocity.
    handled(&mut server, goes(3.0), &mut stored);
    let body = server.record().body(id).expect("it is there").clone();
    let state = BodyState { velocity: Velocity::linear([2.0, 0.0, 0.0]), ..body.state };
    let epoch = body.epoch.next();
    let checkpoint = BodyCheckpoint { id, region: RegionId(1), epoch, state };
    let told = ToServer::Checkpoint { view, tick: Tick(9), division: 0, bodies: vec![checkpoint] };
    handled(&mut server, from_node(Message::ToServer(told)), &mut stored);
    assert_eq!(server.record().body(id).expect("it is there").epoch, epoch, "it is heard");
    assert_eq!(speed(&server), 3.0, "if the node dies, another one takes the body over so");

    server.handle_timeout(WRITE_EVERY);
    for output in std::iter::from_fn(|| server.poll_output()) {
        if let ServerOutput::Store(batch) = output {
            assert!(batch.durable);
            stored.extend(batch.writes);
        }
    }
    assert_eq!(speed(&restarted(stored)), 3.0);
    server.handle(2 * WRITE_EVERY, goes(3.0));
    let is_store = |output: ServerOutput| matches!(output, ServerOutput::Store(_));
    assert!(!std::iter::from_fn(|| server.poll_output()).any(is_store), "it is written down already");
}

#[test]
fn what_is_written_down_of_a_body_goes_with_what_is_known_of_all_others() {
    let (mut server, mut stored) = (server(), Stored::new());
    let from_node = |message| ServerEvent::Message { from: Peer::Node(NodeId(1)), message };
    let role = JoinAs::Node { address: ([127, 0, 0, 1], 1).into(), client: None, resume: None, heard: 0 };
    handled(&mut server, from_node(Message::Hello(Hello { version: VERSION, role })), &mut stored);
    handled(&mut server, from_node(Message::ToServer(ToServer::Loaded)), &mut stored);
    let view = server.view().expect("it has begun").number;
    let checkpoints = (0..3).map(|index| {
        let body = server.record().body(BodyId::persistent(index)).unwrap();
        let state = BodyState { pose: WorldPose::at([f64::from(index), 5.0, 1.0]), ..body.state };
        BodyCheckpoint { id: body.id, region: RegionId(1), epoch: body.epoch, state }
    });
    let bodies = checkpoints.collect();
    let told = ToServer::Checkpoint { view, tick: Tick(9), division: 0, bodies };
    handled(&mut server, from_node(Message::ToServer(told)), &mut stored);
    // One of them is altered long before states alone would be written.
    let body = server.record().body(BodyId::persistent(1)).unwrap();
    let (body, traits, user_data) = (body.id, body.traits.clone(), 7);
    let alteration = Alteration::Body { body, traits, user_data, wakes: false };
    handled(&mut server, ServerEvent::Program(vec![BuildOp::Alter(alteration)]), &mut stored);
    let again = restarted(stored);
    let heights = [0, 1, 2]
        .map(|index| again.record().body(BodyId::persistent(index)).unwrap().state.pose.translation[1]);
    assert_eq!(heights, [5.0; 3]);
    assert_eq!(again.record().body(BodyId::persistent(1)).unwrap().user_data, 7);
}

#[test]
fn when_the_last_node_goes_the_record_moves_as_its_leader_was_to_pass_on() {
    let body = BodyId::persistent(0);
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let moved = |speed, pose: Option<f64>| Input {
        body,
        logical_time: 0,
        tick: Tick(0),
        velocity: Velocity::linear([speed, 0.0, 0.0]),
        pose: pose.map(|x| WorldPose::at([x, 0.0, 0.0])),
        drive: None,
    };
    let mut outputs = tell(&mut server, 1, Message::ToServer(ToServer::Leave));
    let meanwhile = BuildOp::Move(moved(2.0, None));
    server.handle(server.common.now, ServerEvent::Program(vec![meanwhile]));
    outputs.extend(std::iter::from_fn(|| server.poll_output()));
    obey_by(&mut server, outputs, |server, _, message| match message {
        ToNode::Settle { view } => {
            let undone = vec![WorldOp::Input(moved(1.0, Some(5.0)))];
            Some(ToServer::Settling { view, dispatches: Vec::new(), undone, last: true })
        }
        message => answer(server, message),
    });
    assert!(server.view().is_none());
    let state = &server.record().body(body).unwrap().state;
    assert_eq!((state.pose.translation[0], state.velocity.linear[0]), (5.0, 2.0));
}

#[test]
fn every_leader_is_told_what_the_program_has_changed() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let altered = |outputs: Vec<ServerOutput>| {
        let alteration = |op| match op {
            WorldOp::Alter(Alteration::Body { body, traits, wakes, .. }) => {
                (body, traits.gravity_scale, wakes)
            }
            op => panic!("{op:?}"),
        };
        applied(outputs).into_iter().map(alteration).collect::<Vec<_>>()
    };
    let alter = |server: &mut Server, id: BodyId, gravity_scale: f32, wakes: bool| {
        let mut traits = (*sim_body(id, [0.0; 3]).traits).clone();
        traits.gravity_scale = gravity_scale;
        let op = BuildOp::Alter(Alteration::Body { body: id, traits: Arc::new(traits), user_data: 0, wakes });
        server.handle(server.common.now, ServerEvent::Program(vec![op]));
        altered(std::iter::from_fn(|| server.poll_output()).collect())
    };
    let [woken, other, stranger] = [0, 1, 77].map(BodyId::persistent);
    assert_eq!(alter(&mut server, woken, 0.25, true), [(woken, 0.25, true)]);
    assert_eq!(alter(&mut server, stranger, 0.25, true), []);
    // The leader may not have passed it on, and nobody hears the next alteration.
    server.handle(server.common.now, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    assert_eq!(alter(&mut server, other, 0.5, false), []);
    assert_eq!(server.record().body(other).unwrap().traits.gravity_scale, 0.5);
    let outputs = hello(&mut server, 1, VERSION);
    assert_eq!(altered(obey(&mut server, 1, outputs)), [(woken, 0.25, true), (other, 0.5, false)]);
    // The leader is told again until it has surely woken the body.
    let (view, bodies) = (server.view().expect("it goes on").number, Vec::new());
    server.common.now += Duration::from_secs(5);
    for tick in [600, 602].map(Tick) {
        let said = ToServer::Checkpoint { view, tick, division: 0, bodies: Vec::clone(&bodies) };
        tell(&mut server, 1, Message::ToServer(said));
    }
    server.handle(server.common.now, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    let outputs = hello(&mut server, 1, VERSION);
    assert_eq!(altered(obey(&mut server, 1, outputs)), [(woken, 0.25, false), (other, 0.5, false)]);
}

#[test]
fn a_server_that_is_started_again_after_changes_without_end_gives_no_number_of_a_view_again() {
    let (mut server, mut stored) = (server(), Stored::new());
    for _ in 0..1500 {
        server.common.next_view_number();
        handled(&mut server, ServerEvent::Forget(0), &mut stored);
    }
    let given = server.common.number;
    assert!(restarted(stored).common.number > given);
}
