//! Tests what clients that may build can do, and what neither they nor others can make a server do in this
//! way.

mod costs;

use super::*;
use crate::protocol::{
    Alteration, BodyKind, BodyRecord, BodyTraits, BuildOp, Character, ContactOffset, Costs, Input,
    JointRecord, LinkRecord, Push, Velocity, WorldOp,
};
use crate::space::JointId;

const BUILDER: ClientId = ClientId(7);
const OTHER: ClientId = ClientId(8);

/// Returns a server whose world runs, with one client that may build, and one that may not.
fn built_in() -> Server {
    run(server())
}

fn run(mut server: Server) -> Server {
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    server.handle(NOW, ServerEvent::MayBuild(BUILDER));
    for client in [BUILDER, OTHER] {
        let hello = Message::Hello(Hello { version: VERSION, role: JoinAs::Client { interest: None } });
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(client), message: hello });
    }
    while server.poll_output().is_some() {}
    server
}

#[test]
fn nobody_has_found_contacts_of_what_is_built_or_was_put_elsewhere() {
    let mut server = server();
    let id = BodyId::persistent(100);
    let lay = Some(ContactOffset { moved_m: [0.5, 0.0, 0.0], turned: [0.0; 3] });
    let mut body = sim_body(id, [1.0; 3]);
    body.state.contact_offset = lay;
    let insert = BuildOp::Insert { bodies: vec![body], shapes: Vec::new(), joints: Vec::new() };
    server.handle(NOW, ServerEvent::Program(vec![insert]));
    assert_eq!(server.record().body(id).unwrap().state.contact_offset, None);
    let mut body = sim_body(id, [1.0; 3]);
    body.state.contact_offset = lay;
    let mut server = Server::new(config(1), Record::new(vec![body.clone()], Vec::new(), Vec::new()));
    let input = Input {
        body: id,
        velocity: Velocity::default(),
        logical_time: 1,
        tick: Tick(0),
        pose: None,
        drive: None,
    };
    for (pose, kept) in [(None, lay), (Some(body.state.pose), None)] {
        server.handle(NOW, ServerEvent::Program(vec![BuildOp::Move(Input { pose, ..input })]));
        assert_eq!(
            server.record().body(id).unwrap().state.contact_offset,
            kept,
            "nobody computes the world yet"
        );
    }
}

#[test]
fn what_is_tied_and_too_long_for_a_message_comes_in_chunks() {
    let mut server = built_in();
    let ids = 100..40_100;
    let bodies: Vec<_> =
        ids.clone().map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0])).collect();
    let joints: Vec<_> = ids.clone().skip(1).map(|i| vicinity::joint(i, i - 1, i)).collect();
    let insert = BuildOp::Insert { bodies, shapes: Vec::new(), joints };
    server.handle(NOW, ServerEvent::Program(vec![insert]));
    let outputs = std::iter::from_fn(|| server.poll_output()).collect();
    let (mut placed, mut tied) = (0, 0);
    for output in obey(&mut server, 1, outputs) {
        let ServerOutput::Send { to: Peer::Node(_), message } = output else { continue };
        match crate::protocol::decode(&crate::protocol::encode(&message)).expect("it can be read") {
            Message::ToNode(ToNode::Chunk(Chunk::Placed(part))) => placed += part.len(),
            Message::ToNode(ToNode::Chunk(Chunk::Joints(part))) => tied += part.len(),
            _ => {}
        }
    }
    assert!(placed >= ids.len() && tied == ids.len() - 1, "{placed} {tied}");
}

fn asks(
    server: &mut Server,
    from: Peer,
    client: ClientId,
    number: u64,
    ops: Vec<BuildOp>,
) -> Vec<ServerOutput> {
    let message = Message::FromClient(client, FromClient::Build { number, ops });
    server.handle(server.common.now, ServerEvent::Message { from, message });
    std::iter::from_fn(|| server.poll_output()).collect()
}

/// Returns why the builder is refused this operation, if it is.
fn refusal(server: &mut Server, op: BuildOp) -> Option<Refusal> {
    let outputs = asks(server, Peer::Client(BUILDER), BUILDER, 1, vec![op]);
    let answered = |output: &ServerOutput| {
        matches!(output, ServerOutput::Send { to, message: Message::ToClient(_, ToClient::Built(1)) }
            if *to == Peer::Client(BUILDER))
    };
    assert!(outputs.iter().any(answered), "{outputs:?}");
    refusals(&outputs).first().copied()
}

fn refusals(outputs: &[ServerOutput]) -> Vec<Refusal> {
    let reason = |output: &ServerOutput| match output {
        ServerOutput::Send { message: Message::ToClient(_, ToClient::Rejected { reason, .. }), .. } => {
            Some(*reason)
        }
        _ => None,
    };
    outputs.iter().filter_map(reason).collect()
}

fn is_closed(outputs: &[ServerOutput], client: ClientId) -> bool {
    let is = |output: &ServerOutput| matches!(output, ServerOutput::Close { peer, .. } if *peer == Peer::Client(client));
    outputs.iter().any(is)
}

fn body(index: u32) -> BodyRecord {
    sim_body(BodyId::built(BUILDER, index), [f64::from(index) * 3.0, 1.0, 1.0])
}

fn insert(body: BodyRecord) -> BuildOp {
    BuildOp::Insert { bodies: vec![body], shapes: Vec::new(), joints: Vec::new() }
}

fn with(mut body: BodyRecord, change: impl FnOnce(&mut BodyTraits)) -> BodyRecord {
    change(Arc::make_mut(&mut body.traits));
    body
}

fn go(body: BodyId, speed: f32) -> BuildOp {
    let velocity = Velocity::linear([speed, 0.0, 0.0]);
    BuildOp::Move(Input { body, logical_time: 9, tick: Tick(1 << 50), velocity, pose: None, drive: None })
}

fn tied(index: u32, a: BodyId, b: BodyId) -> JointRecord {
    JointRecord { id: JointId::built(BUILDER, index), a, b, ..vicinity::joint(0, 0, 1) }
}

#[test]
fn a_client_that_may_build_changes_the_world_as_its_program_does_and_it_stays() {
    let mut server = built_in();
    let [first, second] = [body(0), body(1)];
    let (a, b) = (first.id, second.id);
    let joints = vec![tied(0, a, b)];
    let op = BuildOp::Insert { bodies: vec![first, second], shapes: Vec::new(), joints };
    let ops = vec![op.clone(), go(a, 2.0), BuildOp::Push(Push::impulse(b, [1.0; 3]))];
    let outputs = asks(&mut server, Peer::Client(BUILDER), BUILDER, 5, ops);
    assert_eq!(refusals(&outputs), []);
    let position = |is: &dyn Fn(&ServerOutput) -> bool| outputs.iter().position(is).expect("it is there");
    let stored = position(&|output| matches!(output, ServerOutput::Store(batch) if batch.durable));
    let told = position(&|output| {
        matches!(output, ServerOutput::Send { message: Message::ToNode(ToNode::Apply { .. }), .. })
    });
    let answered = position(&|output| {
        matches!(output, ServerOutput::Send { message: Message::ToClient(_, ToClient::Built(5)), .. })
    });
    assert!(stored < told && told < answered, "on record before anybody hears of it");
    let inputs = outputs.iter().filter_map(|output| match output {
        ServerOutput::Send { message: Message::ToNode(ToNode::Apply { ops, .. }), .. } => {
            ops.iter().find_map(|op| if let WorldOp::Input(input) = op { Some(*input) } else { None })
        }
        _ => None,
    });
    let inputs: Vec<_> = inputs.map(|input| (input.logical_time, input.tick)).collect();
    assert_eq!(inputs, [(0, Tick(0))], "it is at once, whatever it says");
    let next_ids = server.next_ids();
    assert_eq!(next_ids, (3, 0), "the program numbers apart");
    assert_eq!(server.next_built(BUILDER), (2, 1));

    assert_eq!(refusal(&mut server, op), None, "who did not hear that it was done asks again");
    let leave = Message::FromClient(BUILDER, FromClient::Leave);
    server.handle(NOW, ServerEvent::Message { from: Peer::Client(BUILDER), message: leave });
    assert!([a, b].into_iter().all(|id| server.record().life(id) == Some(crate::cluster::Life::Live)));
    assert!(server.record().joint(JointId::built(BUILDER, 0)).is_some());
}

#[test]
fn who_may_not_build_is_told_so_and_cut_off_if_it_goes_on() {
    let mut server = built_in();
    let own = sim_body(BodyId::built(OTHER, 0), [1.0; 3]);
    for op in [insert(own), BuildOp::Remove(BodyId::persistent(0)), go(BodyId::persistent(0), 1.0)] {
        let outputs = asks(&mut server, Peer::Client(OTHER), OTHER, 1, vec![op]);
        assert_eq!(refusals(&outputs), [Refusal::MayNotBuild]);
        assert!(!is_closed(&outputs, OTHER));
    }
    assert_eq!(server.record().len(), 3);
    let flood = |server: &mut Server| {
        (0..200).position(|_| {
            is_closed(
                &asks(server, Peer::Client(OTHER), OTHER, 1, vec![go(BodyId::persistent(0), 1.0)]),
                OTHER,
            )
        })
    };
    let cut_off = flood(&mut server).expect("it is cut off");
    assert!((30..100).contains(&cut_off), "after {cut_off}");
    assert_eq!(refusal(&mut server, insert(body(0))), None, "others are not its judge");
}

#[test]
fn nobody_builds_in_the_name_of_another() {
    let mut server = built_in();
    let before = server.stale();
    // The leader of the client's group, which otherwise speaks for it, and another client.
    for from in [Peer::Node(NodeId(1)), Peer::Client(OTHER)] {
        assert_eq!(asks(&mut server, from, BUILDER, 1, vec![insert(body(0))]), []);
    }
    assert_eq!((server.stale(), server.record().len()), (before + 2, 3));
}

#[test]
fn a_builder_leaves_avatars_and_names_of_others_and_what_no_program_changes() {
    use Refusal::{Exists, NotToBeBuilt, Shape, Unknown};
    let mut server = built_in();
    let avatar = BodyId::avatar(OTHER, 0);
    let spawn = FromClient::Spawn { body: sim_body(avatar, [1.0; 3]), shapes: Vec::new() };
    server.handle(
        NOW,
        ServerEvent::Message { from: Peer::Client(OTHER), message: Message::FromClient(OTHER, spawn) },
    );
    let fixed = with(body(9), |traits| traits.kind = BodyKind::Fixed);
    let ground = fixed.id;
    assert_eq!(refusal(&mut server, insert(fixed)), None);
    assert_eq!(refusal(&mut server, insert(body(1))), None);
    let own = body(1);
    let hinge = tied(5, body(5).id, ground);
    let hinged = BuildOp::Insert { bodies: vec![body(5)], shapes: Vec::new(), joints: vec![hinge.clone()] };
    assert_eq!(refusal(&mut server, hinged), None, "tied to the ground");
    let alter = |traits: BodyTraits| {
        BuildOp::Alter(Alteration::Body { body: own.id, traits: Arc::new(traits), user_data: 0, wakes: true })
    };
    let ball = ShapeRecord::Ball(0.5);
    let shaped = with(own.clone(), |traits| traits.colliders.push(collider(&ball)));
    let moved = |joint: JointRecord| BuildOp::Insert {
        bodies: vec![body(2)],
        shapes: Vec::new(),
        joints: vec![joint],
    };
    let fast = |mut body: BodyRecord| {
        body.state.velocity.linear = [1e6, 0.0, 0.0];
        body
    };
    let mesh = ShapeRecord::TriMesh(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], 0);
    let meshed = |body: BodyRecord| {
        let body = with(body, |traits| traits.colliders.push(collider(&mesh)));
        BuildOp::Insert { bodies: vec![body], shapes: vec![mesh.clone()], joints: Vec::new() }
    };
    let cone = ShapeRecord::Cone(1.0, 1.0);
    let flat = BuildOp::Insert {
        bodies: vec![with(body(3), |traits| traits.colliders.push(collider(&cone)))],
        shapes: vec![cone.clone()],
        joints: Vec::new(),
    };
    let walking = |body: BodyRecord| {
        with(body, |traits| {
            traits.kind = BodyKind::KinematicVelocity;
            traits.character = Some(Character::default());
        })
    };
    let cases = [
        ("an avatar goes", BuildOp::Remove(avatar), NotToBeBuilt),
        ("an avatar is moved", go(avatar, 1.0), NotToBeBuilt),
        ("an avatar is pushed", BuildOp::Push(Push::impulse(avatar, [1.0; 3])), NotToBeBuilt),
        ("nobody is moved", go(BodyId::persistent(99), 1.0), Unknown),
        ("a name of the program", insert(sim_body(BodyId::persistent(77), [1.0; 3])), NotToBeBuilt),
        ("a name of another", insert(sim_body(BodyId::built(OTHER, 0), [1.0; 3])), NotToBeBuilt),
        ("an avatar's name", insert(sim_body(BodyId::avatar(BUILDER, 0), [1.0; 3])), NotToBeBuilt),
        ("the ground moves", go(ground, 1.0), NotToBeBuilt),
        ("the ground is pushed", BuildOp::Push(Push::impulse(ground, [1.0; 3])), NotToBeBuilt),
        ("what walks is the world's", insert(walking(body(2))), NotToBeBuilt),
        ("what is there begins to walk", alter((*walking(own.clone()).traits).clone()), NotToBeBuilt),
        ("faster than the world", insert(fast(body(2))), NotToBeBuilt),
        ("set faster than the world", go(own.id, 1e6), NotToBeBuilt),
        ("other shapes", alter((*shaped.traits).clone()), NotToBeBuilt),
        (
            "what moves is fixed",
            alter((*with(own.clone(), |t| t.kind = BodyKind::Fixed).traits).clone()),
            NotToBeBuilt,
        ),
        ("an unknown shape", insert(with(body(2), |traits| traits.colliders.push(collider(&ball)))), Shape),
        ("a shape that cannot be built", flat, Shape),
        ("a mesh that moves", meshed(body(2)), Shape),
        ("tied to what is computed", moved(tied(0, body(2).id, own.id)), NotToBeBuilt),
        ("tied to nothing", moved(tied(0, body(2).id, BodyId::persistent(99))), Unknown),
        ("another joint of this name", moved(tied(5, body(2).id, ground)), Exists),
        (
            "a joint ties others than before",
            BuildOp::Alter(Alteration::Joint(Box::new(JointRecord { a: own.id, ..hinge }))),
            NotToBeBuilt,
        ),
        (
            "a joint of the program",
            moved(JointRecord { id: JointId(0), ..tied(0, body(2).id, ground) }),
            NotToBeBuilt,
        ),
    ];
    let bodies = server.record().len();
    for (what, op, reason) in cases {
        assert_eq!(refusal(&mut server, op), Some(reason), "{what}");
        // Time forgives operations that no program asks for.
        server.common.now += Duration::from_secs(1);
    }
    assert_eq!(server.record().len(), bodies);
    let still = with(body(2), |traits| traits.kind = BodyKind::Fixed);
    assert_eq!(refusal(&mut server, meshed(still)), None, "a mesh that stands");
    assert_eq!(refusal(&mut server, go(BodyId::persistent(0), 1.0)), None, "whoever made it");
    assert_eq!(refusal(&mut server, BuildOp::Remove(BodyId::persistent(0))), None, "whoever made it");
}

#[test]
fn a_body_that_may_not_come_keeps_away_only_what_joints_tie_to_it() {
    let mut server = built_in();
    let costly = with(body(1), |traits| traits.extra_solver_iterations = 9);
    let bodies = vec![body(0), costly, body(2), body(3), body(4)];
    let joints = vec![tied(0, body(1).id, body(2).id), tied(1, body(3).id, body(4).id)];
    let op = BuildOp::Insert { bodies, shapes: Vec::new(), joints };
    let outputs = asks(&mut server, Peer::Client(BUILDER), BUILDER, 1, vec![op]);
    assert_eq!(
        refusals(&outputs),
        [Refusal::Costly(Costs::Iterations); 2],
        "the body, and what is tied to it"
    );
    let built: Vec<_> = server.record().built(BUILDER).map(|body| body.id).collect();
    assert_eq!(built, [0, 3, 4].map(|index| body(index).id));
    assert_eq!(server.record().joints().count(), 1);
}

#[test]
fn what_was_done_is_not_done_again_whatever_has_become_of_it() {
    let mut server = built_in();
    let joints = vec![tied(0, body(0).id, body(1).id)];
    let op = BuildOp::Insert { bodies: vec![body(0), body(1)], shapes: Vec::new(), joints };
    assert_eq!(refusal(&mut server, op.clone()), None);
    let traits = Arc::new(BodyTraits { linear_damping: 0.5, ..(*body(0).traits).clone() });
    let alter = BuildOp::Alter(Alteration::Body {
        body: body(0).id,
        traits: traits.clone(),
        user_data: 0,
        wakes: false,
    });
    let (gone, untied) = (BuildOp::Remove(body(1).id), BuildOp::RemoveJoint(JointId::built(BUILDER, 0)));
    for op in [alter, untied.clone(), gone.clone(), op, untied, gone] {
        assert_eq!(refusal(&mut server, op.clone()), None, "{op:?}");
    }
    assert_eq!(server.record().body(body(0).id).map(|body| &body.traits), Some(&traits));
    assert!(server.record().joint(JointId::built(BUILDER, 0)).is_none());
    let never = [BuildOp::Remove(BodyId::persistent(99)), BuildOp::RemoveJoint(JointId(3))];
    assert!(never.into_iter().all(|op| refusal(&mut server, op).is_none()), "it is not there, as is asked");
}

#[test]
fn a_name_comes_again_only_once_nobody_holds_what_had_it() {
    let mut server = built_in();
    let fixed = || with(body(0), |traits| traits.kind = BodyKind::Fixed);
    assert_eq!(refusal(&mut server, insert(fixed())), None);
    assert_eq!(refusal(&mut server, BuildOp::Remove(fixed().id)), None);
    assert_eq!(refusal(&mut server, insert(body(0))), Some(Refusal::Exists), "a node may hold the fixed one");
    assert_eq!(refusal(&mut server, insert(body(1))), None);
    assert_eq!(refusal(&mut server, BuildOp::Remove(body(1).id)), None);
    assert_eq!(refusal(&mut server, insert(body(1))), Some(Refusal::Exists), "its owner has not let it go");
    let joint = tied(0, body(2).id, body(3).id);
    let joints = vec![joint.clone()];
    let op = BuildOp::Insert { bodies: vec![body(2), body(3)], shapes: Vec::new(), joints };
    assert_eq!(refusal(&mut server, op), None);
    assert_eq!(refusal(&mut server, BuildOp::RemoveJoint(joint.id)), None);
    let again = |server: &mut Server, index: u32| {
        let joints = vec![tied(0, body(index).id, body(index + 1).id)];
        let bodies = vec![body(index), body(index + 1)];
        refusal(server, BuildOp::Insert { bodies, shapes: Vec::new(), joints })
    };
    assert_eq!(again(&mut server, 4), Some(Refusal::Exists), "a leader may not have heard that it is gone");

    // The bodies are passed on with the next view.
    let view = server.view().expect("it runs").number;
    let removed = server.record().body(body(1).id).expect("it is on its way out").clone();
    server.main_mut().owners.insert(removed.id, crate::space::RegionId(1));
    tell(&mut server, 1, Message::ToServer(ToServer::Removed { view, tick: Tick(1), bodies: vec![removed] }));
    assert!(server.record().body(body(1).id).is_none());
    assert!(server.main_mut().owners.is_empty(), "nobody owns what is gone");
    assert_eq!(refusal(&mut server, insert(body(1))), None);
    server.main_mut().unsure = true;
    server.finish(0);
    let outputs = std::iter::from_fn(|| server.poll_output()).collect();
    obey(&mut server, 1, outputs);
    assert_ne!(server.view().map(|now| now.number), Some(view));
    assert_eq!(refusal(&mut server, insert(body(0))), None);
    assert_eq!(again(&mut server, 4), Some(Refusal::Exists), "nor the one after it");
    let view = server.view().expect("it runs").number;
    server.common.now += Duration::from_secs(5);
    for tick in [600, 602].map(Tick) {
        assert_eq!(again(&mut server, 4), Some(Refusal::Exists));
        let said = ToServer::Checkpoint { view, tick, division: 0, bodies: Vec::new() };
        tell(&mut server, 1, Message::ToServer(said));
    }
    assert_eq!(again(&mut server, 4), None);
}

#[test]
fn what_is_in_a_multibody_stays_dynamic() {
    let bodies = [0, 1].map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 1.0, 1.0]));
    let (armature, friction, springs) = ([0.0; 6], [0.0; 6], [[0.0; 2]; 6]);
    let link = LinkRecord { kinematic: false, damping: None, armature, friction, springs, motion: None };
    let joint = JointRecord { link: Some(link), ..vicinity::joint(0, 0, 1) };
    let record = Record::new(bodies.to_vec(), Vec::new(), vec![joint]);
    let mut server = run(Server::new(config(1), record));
    let sweep = |body: &BodyRecord| {
        let traits = with(body.clone(), |traits| traits.kind = BodyKind::KinematicVelocity).traits;
        BuildOp::Alter(Alteration::Body { body: body.id, traits, user_data: 0, wakes: true })
    };
    assert_eq!(refusal(&mut server, sweep(&bodies[1])), Some(Refusal::NotToBeBuilt));
    assert_eq!(refusal(&mut server, sweep(&bodies[0])), Some(Refusal::NotToBeBuilt), "nor its root");
}
