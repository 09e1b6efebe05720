//! Tests what a client that joins with an area of interest is told of a large world.

use super::*;
use crate::cluster::Key;
use crate::protocol::{
    Alteration, Area, BodyKind, BodyRecord, BuildOp, JointLimit, JointMotor, JointRecord, MAX_INTRODUCED,
};
use crate::space::JointId;

const CLIENT: ClientId = ClientId(7);
/// The number of bodies along an edge of the world, and the distance between two, metres.
const EDGE: u32 = 100;
const APART_M: f64 = 10.0;
const MIDDLE: [f64; 3] = [500.0, 1.0, 500.0];

/// Returns a body of a large world. Every tenth is fixed.
fn body(index: u32, shape: &ShapeRecord) -> BodyRecord {
    let place = [f64::from(index % EDGE) * APART_M, 1.0, f64::from(index / EDGE) * APART_M];
    let mut body = sim_body(BodyId::persistent(index), place);
    let traits = Arc::make_mut(&mut body.traits);
    traits.colliders.push(collider(shape));
    if index.is_multiple_of(10) {
        traits.kind = BodyKind::Fixed;
    }
    body
}

/// Returns the shape of a body: the ground for the first, else a ball for each tenth of the world.
fn shape(index: u32) -> ShapeRecord {
    match index {
        // The ground.
        0 => ShapeRecord::Cuboid([1e3, 0.1, 1e3]),
        _ => ShapeRecord::Ball(0.5 + (index / (10 * EDGE)) as f32 / 100.0),
    }
}

fn large_world() -> Server {
    let bodies: Vec<_> = (0..EDGE * EDGE).map(|index| body(index, &shape(index))).collect();
    let shapes = (0..EDGE * EDGE).map(shape).collect();
    let joints = (0..EDGE * EDGE - 1)
        .filter(|index| index.is_multiple_of(7))
        .map(|index| joint(index, index, index + 1));
    Server::new(config(1), Record::new(bodies, shapes, joints.collect()))
}

/// Returns a joint that does nothing.
pub(super) fn joint(id: u32, a: u32, b: u32) -> JointRecord {
    let frame = Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    let motor = JointMotor {
        target_vel: 0.0,
        target_pos: 0.0,
        stiffness: 0.0,
        damping: 0.0,
        max_force: 0.0,
        impulse: 0.0,
        acceleration_based: false,
    };
    JointRecord {
        id: JointId(id.into()),
        a: BodyId::persistent(a),
        b: BodyId::persistent(b),
        frame_a: frame,
        frame_b: frame,
        locked_axes: 0,
        limit_axes: 0,
        motor_axes: 0,
        coupled_axes: 0,
        limits: [JointLimit { min: 0.0, max: 0.0, impulse: 0.0 }; 6],
        motors: [motor; 6],
        softness: [0.0; 2],
        contacts_enabled: true,
        enabled: true,
        user_data: 0,
        link: None,
    }
}

/// What a client has been told. The order is checked: nothing twice, a shape before bodies that have it,
/// bodies before their joints.
#[derive(Default)]
struct Told {
    bodies: BTreeMap<BodyId, BodyRecord>,
    shapes: BTreeSet<ShapeHash>,
    joints: BTreeMap<JointId, [BodyId; 2]>,
}

impl Told {
    fn hear(&mut self, outputs: impl IntoIterator<Item = ServerOutput>) {
        for output in outputs {
            let ServerOutput::Send { message: Message::ToClient(CLIENT, message), .. } = output else {
                continue;
            };
            match message {
                ToClient::Chunk(Chunk::Shapes(shapes)) => self.learn(shapes),
                ToClient::Chunk(Chunk::Bodies(bodies)) => bodies.into_iter().for_each(|body| self.meet(body)),
                ToClient::Chunk(Chunk::Joints(joints)) => self.tie(joints),
                ToClient::Inserted { body, shapes, joints } => {
                    self.learn(shapes);
                    self.meet(body);
                    self.tie(joints);
                }
                ToClient::Removed(id) => {
                    assert!(self.bodies.remove(&id).is_some(), "it never knew {id}");
                    self.joints.retain(|_, ends| !ends.contains(&id));
                }
                _ => {}
            }
        }
    }

    fn learn(&mut self, shapes: Vec<ShapeRecord>) {
        assert!(shapes.iter().all(|shape| self.shapes.insert(shape.hash())), "a shape is told once");
    }

    fn meet(&mut self, body: BodyRecord) {
        assert!(body.traits.colliders.iter().all(|collider| self.shapes.contains(&collider.shape)));
        assert!(self.bodies.insert(body.id, body).is_none(), "a body is told once");
    }

    fn tie(&mut self, joints: Vec<JointRecord>) {
        for joint in joints {
            assert!(self.bodies.contains_key(&joint.a) && self.bodies.contains_key(&joint.b));
            let known = self.joints.insert(joint.id, [joint.a, joint.b]);
            assert!(known.is_none(), "a joint is told once");
        }
    }

    fn movable(&self) -> usize {
        self.bodies.values().filter(|body| body.traits.kind != BodyKind::Fixed).count()
    }
}

fn say(server: &mut Server, told: &mut Told, message: Message) {
    let now = server.common.now;
    server.handle(now, ServerEvent::Message { from: Peer::Client(CLIENT), message });
    told.hear(std::iter::from_fn(|| server.poll_output()));
}

fn program(server: &mut Server, told: &mut Told, op: BuildOp) {
    let now = server.common.now;
    server.handle(now, ServerEvent::Program(vec![op]));
    told.hear(std::iter::from_fn(|| server.poll_output()));
}

fn join(server: &mut Server, interest: Option<Area>) -> Told {
    let mut told = Told::default();
    let hello = Hello { version: VERSION, role: JoinAs::Client { interest } };
    say(server, &mut told, Message::Hello(hello));
    told
}

fn from_client(message: FromClient) -> Message {
    Message::FromClient(CLIENT, message)
}

fn area(centre: [f64; 3], radius_m: f64) -> Area {
    Area { centre, radius_m }
}

#[test]
fn a_client_that_joins_with_an_interest_is_told_what_is_near_and_less_than_a_twentieth_of_a_large_world() {
    let mut server = large_world();
    let all = join(&mut server, None);
    assert_eq!(all.bodies.len(), (EDGE * EDGE) as usize);
    let interest = area(MIDDLE, 50.0);
    let told = join(&mut server, Some(interest));
    for (id, body) in &all.bodies {
        let at = body.state.pose.translation;
        let (is_told, is_near) = (told.bodies.contains_key(id), interest.covers(at));
        assert!(is_told || !is_near, "{id} at {at:?}");
        assert!(!is_told || id.index() == 0 || interest.with_surroundings().enters(at), "{id} at {at:?}");
    }
    assert!(told.bodies.contains_key(&BodyId::persistent(0)), "the ground reaches everywhere");
    assert!(told.bodies.len() < all.bodies.len() / 20, "{} bodies", told.bodies.len());
    assert!(told.joints.len() > 1 && told.joints.len() < all.joints.len() / 20);
    assert!(told.shapes.len() < all.shapes.len());
}

#[test]
fn scenery_follows_the_area_and_everything_can_be_asked_for_later() {
    let mut server = large_world();
    let mut told = join(&mut server, Some(area(MIDDLE, 50.0)));
    let (before, movable) = (told.bodies.len(), told.movable());
    let there = area([200.0, 1.0, 200.0], 60.0);
    say(&mut server, &mut told, from_client(FromClient::Interest(Some(there))));
    assert!(told.bodies.len() > before);
    assert_eq!(told.movable(), movable, "those its leader tells it of");
    let fixed = BodyId::persistent(2020);
    assert!(told.bodies.contains_key(&fixed));
    say(&mut server, &mut told, from_client(FromClient::Interest(Some(there))));
    // The client asks about bodies that it heard of. One of these does not exist, and it knows one already.
    let strangers = [1515, 1516, 2020, 999_999].map(BodyId::persistent);
    say(&mut server, &mut told, from_client(FromClient::Introduce(strangers.to_vec())));
    assert_eq!(told.movable(), movable + 2);
    say(&mut server, &mut told, from_client(FromClient::Interest(None)));
    assert_eq!(told.bodies.len(), (EDGE * EDGE) as usize);
    assert_eq!(told.joints.len(), server.record().joints().count());
}

#[test]
fn what_comes_and_goes_is_told_to_those_near_it() {
    let mut server = large_world();
    let mut told = join(&mut server, Some(area(MIDDLE, 50.0)));
    let insert = |server: &mut Server, told: &mut Told, index: u32, place: [f64; 3]| {
        let mut new = body(index, &ShapeRecord::Cuboid([0.5; 3]));
        new.state.pose.translation = place;
        let shapes = vec![ShapeRecord::Cuboid([0.5; 3])];
        program(server, told, BuildOp::Insert { bodies: vec![new], shapes, joints: Vec::new() });
    };
    let (near, far) = (20_001, 20_002);
    insert(&mut server, &mut told, far, [10.0, 1.0, 10.0]);
    assert!(!told.bodies.contains_key(&BodyId::persistent(far)));
    insert(&mut server, &mut told, near, MIDDLE);
    assert!(told.bodies.contains_key(&BodyId::persistent(near)), "with its shape, which was new before");
    for index in [near, far] {
        program(&mut server, &mut told, BuildOp::Remove(BodyId::persistent(index)));
    }
    assert!(!told.bodies.contains_key(&BodyId::persistent(near)));
}

#[test]
fn a_joint_whose_id_comes_again_is_told_again() {
    let mut server = large_world();
    let mut told = join(&mut server, Some(area(MIDDLE, 50.0)));
    let shape = ShapeRecord::Cuboid([0.5; 3]);
    let pair = [20_001, 20_002].map(|index| {
        let mut new = body(index, &shape);
        new.state.pose.translation = MIDDLE;
        new
    });
    for _ in 0..2 {
        let (bodies, joints) = (pair.to_vec(), vec![joint(20_000, 20_001, 20_002)]);
        program(&mut server, &mut told, BuildOp::Insert { bodies, shapes: vec![shape.clone()], joints });
        assert!(told.joints.contains_key(&JointId(20_000)));
        pair.iter().for_each(|body| program(&mut server, &mut told, BuildOp::Remove(body.id)));
        assert!(!told.joints.contains_key(&JointId(20_000)));
    }
}

#[test]
fn a_client_that_searches_the_world_without_end_is_refused() {
    let mut server = large_world();
    let mut told = join(&mut server, Some(area(MIDDLE, 5.0)));
    let mut refused = 0;
    for turn in 0..1_000 {
        let there = area([f64::from(turn % 2) * 100.0, 1.0, 0.0], 5.0);
        let message = from_client(FromClient::Interest(Some(there)));
        server.handle(NOW, ServerEvent::Message { from: Peer::Client(CLIENT), message });
        let outputs: Vec<_> = std::iter::from_fn(|| server.poll_output()).collect();
        let is_refusal = |output: &&ServerOutput| {
            matches!(
                output,
                ServerOutput::Send {
                    message: Message::ToClient(_, ToClient::Rejected { reason: Refusal::TooMany, .. }),
                    ..
                }
            )
        };
        refused += outputs.iter().filter(is_refusal).count();
        told.hear(outputs);
    }
    assert!((500..1_000).contains(&refused), "{refused} refused");
    use crate::protocol::Check;
    let many = (0..=MAX_INTRODUCED as u32).map(BodyId::persistent).collect();
    assert!(FromClient::Introduce(many).check().is_err());
}

#[test]
fn joints_of_a_body_are_found_and_go_with_it_whatever_became_of_others() {
    let bodies = (0..4).map(|i| sim_body(BodyId::persistent(i), [1.0; 3])).collect();
    let mut record = Record::new(bodies, Vec::new(), vec![joint(3, 0, 1), joint(1, 1, 2)]);
    record.tie(joint(2, 0, 2));
    let of = |record: &Record, body| -> Vec<_> {
        record.joints_of(BodyId::persistent(body)).map(|joint| joint.id.0).collect()
    };
    assert_eq!([0, 1, 2, 3].map(|body| of(&record, body)), [vec![2, 3], vec![1, 3], vec![1, 2], vec![]]);
    assert!(record.alter(&Alteration::Joint(Box::new(joint(3, 0, 3)))));
    assert_eq!([1, 3].map(|body| of(&record, body)), [vec![1], vec![3]]);
    let config = bincode::config::standard();
    let bytes = bincode::encode_to_vec(&record, config).unwrap();
    let (mut again, _): (Record, _) = bincode::decode_from_slice(&bytes, config).unwrap();
    again.forget_changes();
    again.remove(BodyId::persistent(0));
    let written = again.take_changes().into_iter().map(|(key, value)| (key, value.is_some()));
    let expected = [Key::Body(BodyId::persistent(0)), Key::Joint(JointId(2)), Key::Joint(JointId(3))];
    assert!(written.eq(expected.map(|key| (key, false))));
    assert_eq!([1, 2, 3].map(|body| of(&again, body)), [vec![1], vec![1], vec![]]);
}

#[test]
fn who_comes_to_hear_of_everything_is_told_the_shapes_too_that_no_body_has_at_that_time() {
    let mut server = large_world();
    let mut told = join(&mut server, Some(area(MIDDLE, 50.0)));
    let shape = ShapeRecord::Cuboid([0.5; 3]);
    let insert = |index, shapes| {
        let mut new = body(index, &shape);
        new.state.pose.translation = [10.0, 1.0, 10.0];
        BuildOp::Insert { bodies: vec![new], shapes, joints: Vec::new() }
    };
    let [before, after] = [20_001, 20_002].map(BodyId::persistent);
    program(&mut server, &mut told, insert(before.index(), vec![shape.clone()]));
    program(&mut server, &mut told, BuildOp::Remove(before));
    assert!(server.record().shape(shape.hash()).is_some() && !told.shapes.contains(&shape.hash()));
    say(&mut server, &mut told, from_client(FromClient::Interest(None)));
    assert_eq!(told.bodies.len(), (EDGE * EDGE) as usize);
    // The shape is on record, and does not come with the body.
    program(&mut server, &mut told, insert(after.index(), Vec::new()));
    assert!(told.bodies.contains_key(&after));
}

#[test]
fn the_end_of_a_body_is_told_to_who_knows_it_in_each_of_two_groups() {
    let mut server = server();
    let outputs = hello(&mut server, 1, VERSION);
    obey(&mut server, 1, outputs);
    let outputs = hello(&mut server, 2, VERSION);
    let delays = vec![Delay { node: NodeId(2), delay_ms: None }];
    tell(&mut server, 1, Message::ToServer(ToServer::Delays(delays)));
    obey(&mut server, 2, outputs);
    let outputs = wait(&mut server);
    obey(&mut server, 2, outputs);
    server.common.nodes.get_mut(&NodeId(2)).unwrap().member.client = Some(CLIENT);
    let mut told = join(&mut server, Some(area([1.0; 3], 50.0)));
    let group = server.common.clients[&CLIENT].group;
    assert!(group > server.main && server.groups.len() == 2, "the main one is the first to tell");
    let id = BodyId::persistent(0);
    assert!(told.bodies.contains_key(&id));
    program(&mut server, &mut told, BuildOp::Remove(id));
    assert!(!told.bodies.contains_key(&id));
}
