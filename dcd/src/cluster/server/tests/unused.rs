//! Tests that all forget shapes that no body has any more, and that nobody lacks a shape that is named again.

use super::*;
use crate::cluster::{Key, Life};
use crate::protocol::{BodyKind, BodyRecord, BuildOp, ShapeHash, WorldOp};

const CLIENT: ClientId = ClientId(7);
/// More pieces of terrain than the server keeps unused, including those that replace them.
const MANY: u32 = 12;

/// Returns a piece of terrain, half a megabyte.
fn terrain(number: u32) -> ShapeRecord {
    let line = (0..40_000).map(|i| [i as f32, number as f32, 0.0]).collect();
    ShapeRecord::Polyline(line, Vec::new())
}

fn fixed(id: BodyId, shape: &ShapeRecord) -> BodyRecord {
    let mut body = sim_body(id, [1.0; 3]);
    let traits = Arc::make_mut(&mut body.traits);
    (traits.kind, traits.colliders) = (BodyKind::Fixed, vec![collider(shape)]);
    body
}

fn handled(server: &mut Server, now: Duration, event: ServerEvent) -> Vec<ServerOutput> {
    server.handle(now, event);
    std::iter::from_fn(|| server.poll_output()).collect()
}

fn program(server: &mut Server, ops: Vec<BuildOp>) -> Vec<ServerOutput> {
    let now = server.common.now;
    handled(server, now, ServerEvent::Program(ops))
}

fn insert(id: BodyId, shape: &ShapeRecord, shapes: Vec<ShapeRecord>) -> BuildOp {
    BuildOp::Insert { bodies: vec![fixed(id, shape)], shapes, joints: Vec::new() }
}

/// Replaces the terrain piece by piece, by the pieces of these numbers.
fn dig(server: &mut Server, pieces: std::ops::Range<u32>) -> Vec<ServerOutput> {
    let mut outputs = Vec::new();
    for number in pieces {
        let (id, piece) = (BodyId::persistent(100 + number), terrain(number));
        let mut ops = vec![insert(id, &piece, vec![piece.clone()])];
        ops.extend(number.checked_sub(1).map(|before| BuildOp::Remove(BodyId::persistent(100 + before))));
        outputs.extend(program(server, ops));
    }
    outputs
}

fn says(server: &mut Server, now: Duration, message: Message) -> Vec<ServerOutput> {
    handled(server, now, ServerEvent::Message { from: Peer::Client(CLIENT), message })
}

fn joins(server: &mut Server) {
    let role = JoinAs::Client { interest: None };
    says(server, NOW, Message::Hello(Hello { version: VERSION, role }));
}

/// Returns the shapes that clients are told are gone.
fn told_gone(outputs: &[ServerOutput]) -> Vec<ShapeHash> {
    let gone = outputs.iter().filter_map(|output| match output {
        ServerOutput::Send { message: Message::ToClient(_, ToClient::ShapesGone(gone)), .. } => Some(gone),
        _ => None,
    });
    gone.flatten().copied().collect()
}

/// Returns the shapes that the leader is told to forget, and those that it is told to know.
fn told_nodes(outputs: &[ServerOutput]) -> (Vec<ShapeHash>, Vec<ShapeHash>) {
    let (mut forgotten, mut known) = (Vec::new(), Vec::new());
    for output in outputs {
        if let ServerOutput::Send { message: Message::ToNode(ToNode::Apply { ops, .. }), .. } = output {
            for op in ops {
                match op {
                    WorldOp::ForgetShapes(gone) => forgotten.extend(gone),
                    WorldOp::Insert { shapes, .. } => known.extend(shapes.iter().map(ShapeRecord::hash)),
                    _ => {}
                }
            }
        }
    }
    (forgotten, known)
}

/// Returns a server whose world is computed by a node, with a client in it.
fn played() -> Server {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    joins(&mut server);
    server
}

/// Lets as much time pass as a message may be on its way.
fn pass(server: &mut Server) -> Vec<ServerOutput> {
    let now = server.common.now + Duration::from_secs(10);
    // In small steps: a pause during which the server was stopped would not count.
    let mut outputs = Vec::new();
    while server.common.now < now {
        let next = server.common.now + Duration::from_millis(20);
        outputs.extend(handled(server, next + server.stopped, ServerEvent::MayBuild(ClientId(99))));
    }
    outputs
}

#[test]
fn terrain_that_is_dug_is_forgotten_by_record_store_and_clients_and_then_by_nodes() {
    let mut server = played();
    let outputs = dig(&mut server, 0..40);
    let kept = server.record().shapes_by_hash();
    assert!(kept.len() <= MANY as usize, "{} pieces", kept.len());
    assert!(kept.contains_key(&terrain(39).hash()), "somebody has it");
    let gone = told_gone(&outputs);
    assert_eq!(gone.len() + kept.len(), 40);
    assert!(gone.iter().all(|hash| !kept.contains_key(hash)));
    let is_deleted = |hash: &ShapeHash| {
        let write = (Key::Shape(*hash), None);
        outputs
            .iter()
            .any(|output| matches!(output, ServerOutput::Store(batch) if batch.writes.contains(&write)))
    };
    assert!(gone.iter().all(is_deleted));
    assert_eq!(told_nodes(&outputs).0, [], "something may be on its way");
    let (mut forgotten, mut expected) = (told_nodes(&pass(&mut server)).0, gone);
    forgotten.sort();
    expected.sort();
    assert_eq!(forgotten, expected);
    assert!(server.common.fading.is_at_rest());
    let entry = &server.common.nodes[&NodeId(1)];
    assert!(entry.shapes.iter().all(|hash| server.record().shape(*hash).is_some()));
}

#[test]
fn a_shape_that_is_named_again_comes_back_while_it_is_being_forgotten_and_after_that() {
    let mut server = played();
    let outputs = dig(&mut server, 0..MANY);
    let [again, late] = [0, 1].map(|number| terrain(number).hash());
    let gone = told_gone(&outputs);
    assert!(gone.contains(&again) && gone.contains(&late), "{} are gone", gone.len());
    // Whoever names the shape has not heard that it is gone.
    let outputs = program(&mut server, vec![insert(BodyId::persistent(200), &terrain(0), Vec::new())]);
    assert!(server.record().shape(again).is_some());
    assert_eq!(told_nodes(&outputs).1, [again]);
    let told = |outputs: &[ServerOutput], hash| {
        outputs.iter().any(|output| match output {
            ServerOutput::Send {
                message: Message::ToClient(_, ToClient::Inserted { shapes, .. }), ..
            } => shapes.iter().any(|shape| shape.hash() == hash),
            _ => false,
        })
    };
    assert!(told(&outputs, again), "the client has forgotten it");
    let forgotten = told_nodes(&pass(&mut server)).0;
    assert!(!forgotten.contains(&again) && forgotten.contains(&late));
    let outputs = program(&mut server, vec![insert(BodyId::persistent(201), &terrain(1), vec![terrain(1)])]);
    assert!(told(&outputs, late) && told_nodes(&outputs).1 == [late]);
    assert!(!told_nodes(&pass(&mut server)).0.contains(&late));
    assert!([again, late].iter().all(|hash| server.record().shape(*hash).is_some()));
}

#[test]
fn nodes_are_told_to_forget_nothing_while_membership_changes() {
    let mut server = played();
    dig(&mut server, 0..MANY);
    server.handle(server.common.now, ServerEvent::Save);
    let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
    assert!(server.is_changing());
    assert_eq!(told_nodes(&pass(&mut server)).0, []);
    let outputs = obey(&mut server, 1, outputs);
    assert!(!server.is_changing());
    assert_ne!(told_nodes(&outputs).0, [], "all of them hear it");
}

#[test]
fn what_a_parked_avatar_or_a_compound_has_stays_and_a_save_has_what_its_bodies_have() {
    let mut server = server();
    joins(&mut server);
    let part = ShapeRecord::Ball(0.25);
    let pair = ShapeRecord::Compound(vec![(collider(&part).pose, part.hash())]);
    let mut body = sim_body(BodyId::avatar(CLIENT, 0), [1.0; 3]);
    Arc::make_mut(&mut body.traits).colliders.push(collider(&pair));
    let spawn = FromClient::Spawn { body, shapes: vec![part.clone(), pair.clone()] };
    says(&mut server, NOW, Message::FromClient(CLIENT, spawn));
    says(&mut server, NOW, Message::FromClient(CLIENT, FromClient::Leave));
    assert_eq!(server.record().life(BodyId::avatar(CLIENT, 0)), Some(Life::Parked));
    dig(&mut server, 0..40);
    assert!([&part, &pair].iter().all(|shape| server.record().shape(shape.hash()).is_some()));
    let saved = handled(&mut server, NOW, ServerEvent::Save).into_iter().find_map(|output| match output {
        ServerOutput::Saved(saved) => Some(saved),
        _ => None,
    });
    let saved = saved.expect("nobody computes the world");
    assert_eq!(saved.shapes, [terrain(39)], "the avatar is not in the world");
    // Going back forgets shapes that only the world since the save has.
    dig(&mut server, 40..42);
    handled(&mut server, NOW, ServerEvent::Replace(saved));
    let kept: Vec<_> = server.record().shapes_by_hash().keys().copied().collect();
    let mut expected = [part.hash(), pair.hash(), terrain(39).hash()];
    expected.sort();
    assert_eq!(kept, expected);
}

#[test]
fn a_client_may_bring_other_hulls_once_those_that_it_brought_are_forgotten() {
    let mut server = server();
    joins(&mut server);
    let comes_and_goes = |server: &mut Server, number: u32| {
        let id = BodyId::avatar(CLIENT, 0);
        let points = (0..12_000).map(|i| [i as f32 * 1e-4, number as f32, 1.0]).collect();
        let hull = ShapeRecord::ConvexPolyhedron(points, Vec::new());
        let mut body = sim_body(id, [1.0; 3]);
        Arc::make_mut(&mut body.traits).colliders.push(collider(&hull));
        let now = server.common.now + server.stopped;
        let spawn = FromClient::Spawn { body, shapes: vec![hull] };
        says(server, now, Message::FromClient(CLIENT, spawn));
        let came = server.record().body(id).is_some();
        says(server, now, Message::FromClient(CLIENT, FromClient::Despawn(id)));
        came
    };
    let came = (0..10).filter(|&number| comes_and_goes(&mut server, number)).count();
    assert!((3..10).contains(&came), "{came} hulls of 150 kB");
    assert!(comes_and_goes(&mut server, 0), "it has brought that one already");
    assert!(!comes_and_goes(&mut server, 10));
    dig(&mut server, 0..MANY);
    pass(&mut server);
    assert!(comes_and_goes(&mut server, 10));
    assert!(!comes_and_goes(&mut server, 11), "all would be told faster than before");
    pass(&mut server);
    assert!(comes_and_goes(&mut server, 11));
}

#[test]
fn what_is_dug_where_nobody_computes_the_world_is_forgotten_too() {
    let mut server = played();
    let now = server_now(&server);
    handled(&mut server, now, ServerEvent::Disconnected(Peer::Node(NodeId(1))));
    while !server.main().held {
        server.handle_timeout(server.poll_timeout().expect("it is given up"));
    }
    dig(&mut server, 0..40);
    assert!(!server.common.fading.is_at_rest());
    pass(&mut server);
    assert!(server.common.fading.is_at_rest(), "the server keeps nothing for nobody");
}

#[test]
fn an_avatar_brings_the_shapes_that_it_has_and_no_others_and_small_ones_count_by_what_they_take() {
    let mut server = server();
    joins(&mut server);
    let spawns = |server: &mut Server, number: u32, others: Vec<ShapeRecord>| {
        let id = BodyId::avatar(CLIENT, 0);
        let ball = ShapeRecord::Ball(1.0 + number as f32 * 1e-4);
        let mut body = sim_body(id, [1.0; 3]);
        Arc::make_mut(&mut body.traits).colliders.push(collider(&ball));
        let shapes = others.into_iter().chain([ball]).collect();
        let now = server_now(server);
        says(server, now, Message::FromClient(CLIENT, FromClient::Spawn { body, shapes }));
        let came = server.record().body(id).is_some();
        says(server, now, Message::FromClient(CLIENT, FromClient::Despawn(id)));
        came
    };
    assert!(!spawns(&mut server, 0, vec![ShapeRecord::Ball(0.3)]), "nobody has that");
    assert!(spawns(&mut server, 0, Vec::new()));
    // Keeping such a shape, telling it, and telling that it is gone takes more than its five bytes.
    let came = (1..6_000).filter(|&number| {
        if number % 64 == 0 {
            let next = server_now(&server) + Duration::from_millis(500);
            handled(&mut server, next, ServerEvent::MayBuild(ClientId(99)));
        }
        spawns(&mut server, number, Vec::new())
    });
    let came = came.count();
    assert!((3_500..4_500).contains(&came), "{came} came");
}

fn server_now(server: &Server) -> Duration {
    server.common.now + server.stopped
}
