//! Plays a client against a world of the same physics, tick by tick, with a delay each way.

mod changes;
mod inputs;
mod smooth;

use rapier3d::prelude::*;

use super::*;
use crate::cluster::{ClientEvent, ClientOutput, Peer};
use crate::physics::ShapeLibrary;
use crate::protocol::{
    Chunk, FromClient, LinkRecord, Member, Message, SharedState, Stamp, StepRecord, ToClient, Velocity,
    ViewNumber, WorldPose,
};
use crate::sim::sim_world;
use crate::space::{ClientId, GroupId, NodeId};

const DT_S: f64 = 1.0 / 60.0;
const ME: ClientId = ClientId(1);
const AVATAR: BodyId = BodyId::avatar(ME, 0);
const LEADER: Peer = Peer::Node(NodeId(1));

const LINK: LinkRecord = LinkRecord {
    kinematic: false,
    damping: None,
    armature: [0.0; 6],
    friction: [0.0; 6],
    springs: [[0.0; 2]; 6],
    motion: None,
};

/// A world, and a client that hears of it `delay` ticks later and is heard as much later.
struct Game {
    world: RegionHost,
    client: Client,
    predictor: Predictor,
    delay: u64,
    /// If set: states are rounded to steps, arrive up to so many ticks later, and one batch in twenty is
    /// lost.
    jitter: Option<u64>,
    /// Says whether nothing is told.
    silent: bool,
    /// The number of ticks for which the world has stood still.
    stood: f64,
    to_client: VecDeque<(u64, ToClient)>,
    to_world: VecDeque<(u64, Input)>,
    waiting: Vec<Input>,
    applied: (u64, i8),
    /// The place where the avatar was after each tick, and the one where it was predicted to be.
    truth: BTreeMap<u64, f64>,
    predicted: BTreeMap<u64, f64>,
    time: ViewTime,
}

fn environment() -> EnvironmentProperties {
    let world = sim_world(1);
    let step = StepRecord { gravity: [0.0, -9.81, 0.0], ..world.step };
    EnvironmentProperties { step, ..world }
}

fn cube(half: f32) -> [ColliderBuilder; 1] {
    [ColliderBuilder::cuboid(half, half, half)]
}

impl Game {
    /// Creates a game with a floor, an avatar at x = -4 that is a kinematic box, and what `describe` makes.
    fn of(
        delay: u64,
        describe: impl FnOnce(&mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>),
    ) -> Self {
        Self::with_avatar(delay, (RigidBodyBuilder::kinematic_velocity_based(), cube(0.5)), describe)
    }

    fn with_avatar(
        delay: u64,
        (avatar, collider): (RigidBodyBuilder, [ColliderBuilder; 1]),
        describe: impl FnOnce(&mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>),
    ) -> Self {
        let environment = environment();
        let tree = environment.tree.clone();
        let regions: Vec<_> = tree.leaves().collect();
        let mut world =
            RegionHost::new(Partition::new(tree, None), environment.step.into(), 1, &regions).unwrap();
        let shapes = world.shapes_mut();
        let (mut bodies, joints) = describe(shapes);
        let floor = [ColliderBuilder::cuboid(100.0, 0.5, 100.0)];
        let fixed = RigidBodyBuilder::fixed().build();
        bodies.push(
            shapes.describe(BodyId::persistent(1_000_000), WorldPose::at([0.0; 3]), &fixed, &floor).unwrap(),
        );
        let at = WorldPose::at([-4.0, 1.2, 0.0]);
        bodies.push(shapes.describe(AVATAR, at, &avatar.build(), &collider).unwrap());
        world.insert(bodies.clone(), &joints).unwrap();
        let mut client = Client::new(ME, None, None);
        let welcome = ToClient::Welcome {
            id: ME,
            logical_time: 1,
            next_built: (0, 0),
            incarnation: 1,
            world: environment.clone(),
        };
        let leader = Member { node: NodeId(1), address: ([127, 0, 0, 1], 1).into(), client: None };
        let told = [
            welcome,
            ToClient::Chunk(Chunk::Shapes(world.shapes().records())),
            ToClient::Chunk(Chunk::Bodies(bodies)),
            ToClient::Chunk(Chunk::Joints(joints)),
            ToClient::WorldEnd,
            ToClient::LeaderIs {
                group: GroupId(1),
                view: ViewNumber(1),
                leader: Some(leader),
                tree: None,
                allocation: Default::default(),
            },
        ];
        client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Server));
        for message in told {
            let message = Message::ToClient(ME, message);
            client.handle(Duration::ZERO, ClientEvent::Message { from: Peer::Server, message });
        }
        client.handle(Duration::ZERO, ClientEvent::Connected(LEADER));
        Self {
            world,
            client,
            predictor: Predictor::new(ME, &environment).unwrap(),
            delay,
            jitter: None,
            silent: false,
            stood: 0.0,
            to_client: VecDeque::new(),
            to_world: VecDeque::new(),
            waiting: Vec::new(),
            applied: (0, 0),
            truth: BTreeMap::new(),
            predicted: BTreeMap::new(),
            time: ViewTime::new(0.0, 0.0),
        }
    }

    /// Computes a tick of the world, and tells the client of every third.
    fn tick(&mut self) {
        let next = self.world.tick().next();
        while let Some((_, input)) = pop_if(&mut self.to_world, |at| at < next.0) {
            // As the leader does: inputs of the same slot that name later ticks are older.
            self.waiting.retain(|old| old.slot() != input.slot() || old.tick <= input.tick);
            self.waiting.push(input);
            let early = input.tick.0 as i64 - next.0 as i64;
            self.applied = self.applied.max((input.logical_time, early as i8));
        }
        let due: Vec<_> = self.waiting.extract_if(.., |input| input.tick <= next).collect();
        due.iter().for_each(|input| self.world.obey(input));
        // As the leader does, which tells of the inputs that a tick has applied.
        let newest = due.iter().map(|input| input.logical_time).max();
        if let Some(newest) = newest {
            self.applied.0 = newest;
        }
        self.world.step().unwrap();
        let (region, handle) = self.world.owned(AVATAR).unwrap();
        self.truth.insert(next.0, region.motion(handle).0.translation[0]);
        if next.0.is_multiple_of(3) && !self.silent {
            let states = self.world.owned_bodies().map(|(_, region, handle)| region.shared_state(handle));
            let mut states: Vec<SharedState> = states.collect();
            if self.jitter.is_some() {
                states.iter_mut().for_each(round);
            }
            let opened_us = (1e6 * (next.0 as f64 + self.stood) * DT_S) as u64;
            let stamp = Stamp {
                opened_us,
                applied: self.applied.0,
                early: self.applied.1,
                ..Stamp::untimed(GroupId(1), next, false)
            };
            let at = self.arrival(next.0, self.to_client.back().map(|(at, _)| *at));
            if self.jitter.is_none() || !next.0.is_multiple_of(60) {
                self.to_client.push_back((at, ToClient::States { stamp, states }));
            }
        }
    }

    /// Returns when a message that is sent now arrives: not before those sent earlier.
    fn arrival(&self, now: u64, before: Option<u64>) -> u64 {
        let late = self.jitter.map_or(0, |jitter| now * 7 % 11 * jitter / 10);
        (now + self.delay + late).max(before.unwrap_or(0))
    }

    /// Shows a frame, in which the client asks for `speed`, if for any.
    fn frame(&mut self, speed: Option<f32>) {
        let at = self.world.tick().0;
        let now = Duration::from_secs_f64((at as f64 + self.stood + 0.4) * DT_S);
        while let Some((_, message)) = pop_if(&mut self.to_client, |due| due <= at) {
            let message = Message::ToClient(ME, message);
            self.client.handle(now, ClientEvent::Message { from: LEADER, message });
        }
        if let (Some(speed), Some(tick)) = (speed, self.client.name_tick(now)) {
            let velocity = Velocity::linear([speed, 0.0, 0.0]);
            self.predictor.input(Input {
                body: AVATAR,
                logical_time: 1,
                tick,
                velocity,
                pose: None,
                drive: None,
            });
            self.client.handle(now, ClientEvent::Input { body: AVATAR, tick, velocity, pose: None });
        }
        while let Some(output) = self.client.poll_output() {
            if let ClientOutput::Send { message: Message::FromClient(_, FromClient::Input(input)), .. } =
                output
            {
                let at = self.arrival(at, self.to_world.back().map(|(at, _)| *at));
                self.to_world.push_back((at, input));
            }
        }
        let Some(time) = self.client.view_time(now) else { return };
        let Some(predicted) = self.client.predicted_tick(now) else { return };
        self.time = time.predicting(predicted);
        self.predictor.listen(&self.client, predicted);
        self.predictor.advance(&self.time);
        let whole = predicted.floor();
        if let Some(motion) = self.predictor.at(AVATAR, whole) {
            self.predicted.insert(whole as u64, motion.pose.translation[0]);
        }
    }

    fn play(&mut self, ticks: u64, ask: impl Fn(u64) -> Option<f32>) {
        for i in 0..ticks {
            self.tick();
            self.frame(ask(i));
        }
    }

    /// Returns the largest distance between where the avatar was predicted and where it came to be, metres.
    fn worst_m(&self) -> f64 {
        let off = |(tick, x): (&u64, &f64)| self.truth.get(tick).map(|truth| (truth - x).abs());
        self.predicted.iter().filter_map(off).fold(0.0, f64::max)
    }
}

fn pop_if<T>(queue: &mut VecDeque<(u64, T)>, is_due: impl Fn(u64) -> bool) -> Option<(u64, T)> {
    if is_due(queue.front()?.0) { queue.pop_front() } else { None }
}

/// Rounds a state to the steps in which clients are told states.
fn round(state: &mut SharedState) {
    let steps = |v: f64, step: f64| (v / step).round() * step;
    state.pose.translation = state.pose.translation.map(|v| steps(v, 1.5e-3));
    let turn = state.pose.rotation.map(|v| steps(f64::from(v), 2e-3));
    let length = turn.iter().map(|v| v * v).sum::<f64>().sqrt();
    state.pose.rotation = turn.map(|v| (v / length) as f32);
    state.velocity.linear = state.velocity.linear.map(|v| steps(f64::from(v), 0.01) as f32);
    state.velocity.angular = state.velocity.angular.map(|v| steps(f64::from(v), 0.02) as f32);
}

fn stack(shapes: &mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>) {
    let body = RigidBodyBuilder::dynamic().build();
    let at = |i: u32| WorldPose::at([0.0, 1.0 + f64::from(i), 0.0]);
    (
        (0..10).map(|i| shapes.describe(BodyId::persistent(i), at(i), &body, &cube(0.5)).unwrap()).collect(),
        Vec::new(),
    )
}

/// Returns the speed that a player might ask for: to and fro, with pauses.
fn to_and_fro(i: u64) -> Option<f32> {
    Some([0.0, 2.0, 2.0, -1.0, 1.5][(i / 40) as usize % 5])
}

#[test]
fn an_input_acts_in_its_frame_and_the_world_does_the_same_some_time_later() {
    for delay in [0, 6, 12] {
        let mut game = Game::of(delay, stack);
        game.play(60, |_| Some(0.0));
        game.predicted.clear();
        game.play(240, to_and_fro);
        let shown = game.predictor.at(AVATAR, game.time.predicted).unwrap();
        assert!((shown.velocity.linear[0] - to_and_fro(239).unwrap()).abs() < 1e-3, "{shown:?}");
        assert!(game.time.predicted > game.time.now + delay as f64, "{:?}", game.time);
        assert!(game.predicted.len() > 230 && game.worst_m() < 1e-4, "{} m off", game.worst_m());
        // The stack is predicted exactly too: it is computed alike, from states told exactly.
        let prediction = game.predictor.stats();
        assert!(prediction.bodies == 11 && prediction.corrections == 0, "{prediction:?}");
    }
}

/// Runs at 100 ms each way, with up to as much jitter.
#[test]
fn a_stack_that_is_pushed_is_predicted_within_centimetres_over_a_bad_network() {
    for jitter in [0, 2, 6] {
        let mut game = Game::of(6, stack);
        game.jitter = Some(jitter);
        game.play(120, |_| Some(0.0));
        let before = game.predictor.stats();
        game.play(300, to_and_fro);
        let after = game.predictor.stats();
        let corrected = (after.corrections - before.corrections) as f64 / (after.ticks - before.ticks) as f64;
        println!("jitter of {jitter} ticks: {corrected}, {after:?}");
        assert!(corrected <= 0.05 && after.largest_correction_m < 0.2, "{jitter}: {corrected}, {after:?}");
    }
}

#[test]
fn what_does_not_come_as_predicted_is_put_right_and_melts_away() {
    let mut game = Game::of(6, stack);
    game.play(60, |_| Some(0.0));
    // An input arrives a quarter of a second late.
    game.play(1, |_| Some(3.0));
    game.to_world.iter_mut().for_each(|(at, _)| *at += 15);
    let mut last = game.predictor.at(AVATAR, game.time.predicted).unwrap();
    for _ in 0..60 {
        game.play(1, |_| None);
        let shown = game.predictor.at(AVATAR, game.time.predicted).unwrap();
        let way_m = shown.pose.translation[0] - last.pose.translation[0];
        assert!((-0.1..0.15).contains(&way_m), "no jump: {way_m}");
        last = shown;
    }
    let prediction = game.predictor.stats();
    assert!(prediction.corrections > 0 && prediction.largest_correction_m > 0.3, "{prediction:?}");
    game.predicted.clear();
    game.play(60, |_| None);
    assert!(game.worst_m() < 1e-3, "it is where it is: {} m off", game.worst_m());
}

#[test]
fn an_avatar_answers_after_a_silence_in_which_all_rested() {
    let mut game = Game::of(6, |_| (Vec::new(), Vec::new()));
    game.play(1, |_| None);
    // A body that stands is told of as asleep.
    game.to_client.clear();
    let (region, handle) = game.world.owned(AVATAR).unwrap();
    let states = vec![SharedState { sleeping: true, ..region.shared_state(handle) }];
    let stamp = Stamp { opened_us: (2e6 * DT_S) as u64, ..Stamp::untimed(GroupId(1), Tick(2), false) };
    game.to_client.push_back((2, ToClient::States { stamp, states }));
    game.silent = true;
    game.play(400, |_| None);
    game.play(1, |_| Some(2.0));
    game.play(1, |_| None);
    let shown = game.predictor.at(AVATAR, game.time.predicted).unwrap();
    assert!((shown.velocity.linear[0] - 2.0).abs() < 1e-3, "{shown:?} at {:?}", game.time);
    game.silent = false;
    game.play(60, |_| None);
    assert!(game.worst_m() < 1e-3 && game.predictor.stats().corrections == 0, "{} m off", game.worst_m());
}

#[test]
fn what_is_near_is_predicted_with_what_is_tied_to_it_and_what_is_far_is_not() {
    let mut game = Game::of(3, |shapes| {
        let body = RigidBodyBuilder::dynamic().build();
        let mut describe = |index: u32, x: f64| {
            shapes
                .describe(BodyId::persistent(index), WorldPose::at([x, 0.8, 3.0]), &body, &cube(0.25))
                .unwrap()
        };
        // A chain from near to far, a pair that is a multibody, and a field of others.
        let mut bodies: Vec<_> = (0..30).map(|i| describe(i, f64::from(i))).collect();
        bodies.extend((30..32).map(|i| describe(i, f64::from(i) - 38.0)));
        bodies.extend((100..3_000).map(|i| describe(i, 50.0 + f64::from(i))));
        let tie = |a: u32, link| {
            let joint = FixedJointBuilder::new().local_anchor1(Vector::X).build();
            let [a, b] = [a, a + 1].map(BodyId::persistent);
            let record = crate::physics::joint_record(JointId(u64::from(a.index())), a, b, &joint.into());
            JointRecord { link, ..record }
        };
        let joints = (0..29).map(|i| tie(i, None)).chain([tie(30, Some(LINK))]).collect();
        (bodies, joints)
    });
    game.play(30, |_| Some(0.0));
    let ids: Vec<_> = game.predictor.near.keys().copied().collect();
    let chain = (0..30).map(BodyId::persistent);
    assert_eq!(ids, chain.chain([AVATAR]).collect::<Vec<_>>());
    // The avatar goes away.
    game.play(400, |_| Some(-3.0));
    assert_eq!(game.predictor.near.keys().collect::<Vec<_>>(), [&AVATAR]);
}
