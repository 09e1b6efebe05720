//! Tests what a leader dispatches, believes, and tells clients.

mod between_groups;
mod lying;
mod many;
mod silent;
mod waiting;
mod watching;

use super::*;
use crate::delta::{FreeMotion, Receiver};
use crate::protocol::{self, ContactKey, Heard, Member, SharedState, Touch, Velocity, WorldPose};
use crate::sim::{sim_body, sim_world};
use crate::space::GroupId;

const CLIENT: ClientId = ClientId(4);
const AVATAR: BodyId = BodyId::avatar(CLIENT, 0);

/// Returns a leader of two members that has one client with one avatar; the first tick may be dispatched.
fn leader() -> Leader {
    leader_of(&EnvironmentProperties { state_every: 1, ..sim_world(2) })
}

fn leader_of(world: &EnvironmentProperties) -> Leader {
    let member = |id| Member { node: NodeId(id), address: ([127, 0, 0, 1], 1).into(), client: None };
    let view = View {
        events: false,
        viewpoints: Vec::new(),
        group: GroupId(1),
        number: ViewNumber(1),
        tick: Tick(0),
        leader: NodeId(1),
        members: vec![member(1), member(2)],
        tree: world.tree.clone(),
        allocation: [(RegionId(1), NodeId(1)), (RegionId(2), NodeId(2))].into(),
    };
    let mut leader = Leader::new(Duration::ZERO, &view, world);
    leader.admit(CLIENT);
    leader.take_interest(CLIENT, None);
    leader.apply(vec![WorldOp::Insert {
        bodies: vec![sim_body(AVATAR, [1.0; 3])],
        shapes: vec![],
        joints: vec![],
    }]);
    both_done(&mut leader, 0, vec![], vec![]);
    leader
}

impl Leader {
    fn replication_here(&self) -> &StateReplication {
        match &self.replication {
            Replication::Here(replication) => replication,
            Replication::Elsewhere(_) => panic!("it is told here"),
        }
    }
}

fn both_done(leader: &mut Leader, tick: u64, one: Vec<Touch>, two: Vec<Touch>) {
    for (id, touches) in [(1, one), (2, two)] {
        let events =
            RegionEvents { region: RegionId(id), tick: Tick(tick), touches, ..RegionEvents::default() };
        let view = ViewNumber(1);
        let done = Done {
            view,
            tick: Tick(tick),
            rounds_wanted: id,
            holds: None,
            events: vec![events],
            answers: vec![],
            load: None,
            compute_us: 0,
            regions: vec![],
        };
        leader.done(NodeId(id), done);
    }
}

/// Returns how many bodies each message of states tells of.
fn told_of(messages: Vec<(ClientId, ToClient)>) -> Vec<(ClientId, usize)> {
    let count = |(client, message)| match message {
        ToClient::States { states, .. } => Some((client, states.len())),
        ToClient::CompactStates { part, .. } => {
            Some((client, u16::from_le_bytes([part.states[0], part.states[1]]).into()))
        }
        _ => None,
    };
    messages.into_iter().filter_map(count).collect()
}

fn input(logical_time: u64, speed: f32) -> Input {
    let velocity = Velocity { linear: [0.0, speed, 0.0], angular: [0.0; 3] };
    Input {
        body: AVATAR,
        logical_time,
        tick: Tick(0),
        velocity,
        pose: Some(WorldPose::default()),
        drive: None,
    }
}

#[test]
fn a_tick_waits_for_all_members_and_for_its_time() {
    let mut leader = leader();
    let first = leader.dispatch(Duration::ZERO).unwrap();
    assert_eq!((first.tick, first.ops.len()), (Tick(1), 2), "a body, and who looks at what");
    assert_eq!(leader.dispatch(Duration::from_secs(9)), None, "nobody is done");
    both_done(&mut leader, 1, vec![], vec![]);
    assert_eq!(leader.dispatch(Duration::from_millis(1)), None, "too early");
    let due = leader.timeout().unwrap();
    assert_eq!(due, Duration::from_secs_f32(1.0 / 60.0));
    assert_eq!(leader.dispatch(due).unwrap().tick, Tick(2));
}

#[test]
fn operations_that_no_message_has_room_for_wait_for_the_next_tick_in_order() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let corners = vec![[0.5; 3]; 100_000];
    let op = |i: u32| WorldOp::Insert {
        bodies: vec![sim_body(BodyId::persistent(100 + i), [1.0; 3])],
        shapes: vec![crate::protocol::ShapeRecord::ConvexPolyhedron(corners.clone(), Vec::new())],
        joints: vec![],
    };
    let ops: Vec<_> = (0..30).map(op).collect();
    leader.apply(ops.clone());
    let mut told = Vec::new();
    for tick in 1..20 {
        both_done(&mut leader, tick, vec![], vec![]);
        let dispatch = leader.dispatch(Duration::from_secs(tick)).unwrap();
        assert!(encoded_len(&dispatch) < crate::protocol::MAX_MESSAGE_BYTES / 2);
        told.extend(dispatch.ops);
    }
    assert_eq!(told.len(), ops.len());
    assert!(told == ops, "none is lost, and none overtaken");
}

#[test]
fn a_tick_takes_as_many_rounds_as_a_member_wanted_after_the_one_before() {
    let mut leader = leader();
    assert_eq!(leader.dispatch(Duration::ZERO).unwrap().rounds, 2, "the members want 1 and 2");
    for (id, rounds_wanted) in [(1, 3), (2, 1)] {
        let view = ViewNumber(1);
        leader.done(
            NodeId(id),
            Done {
                view,
                tick: Tick(1),
                rounds_wanted,
                holds: None,
                events: vec![],
                answers: vec![],
                load: None,
                compute_us: 0,
                regions: vec![],
            },
        );
    }
    assert_eq!(leader.dispatch(Duration::from_secs(1)).unwrap().rounds, 3);
    both_done(&mut leader, 2, vec![], vec![]);
    assert_eq!(leader.dispatch(Duration::from_secs(2)).unwrap().rounds, 2, "what was is forgotten");
}

#[test]
fn only_the_newest_input_of_an_avatar_is_dispatched() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    assert_eq!(leader.accept_input(CLIENT, input(5, 1.0)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, input(7, 2.0)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, input(6, 3.0)), Err(Refusal::Late));
    assert_eq!(leader.accept_input(CLIENT, input(8, 20.5)), Err(Refusal::TooFast));
    assert_eq!(leader.accept_input(ClientId(5), input(9, 1.0)), Err(Refusal::NotYours));
    both_done(&mut leader, 1, vec![], vec![]);
    let ops = leader.dispatch(Duration::from_secs(1)).unwrap().ops;
    assert_eq!(ops, [WorldOp::Input(input(7, 2.0))]);
}

/// Opens the next tick, and returns the logical times of the inputs that it takes.
fn taken(leader: &mut Leader) -> Vec<u64> {
    let tick = leader.opened().0.0;
    both_done(leader, tick, vec![], vec![]);
    let ops = leader.dispatch(Duration::from_secs(tick)).unwrap().ops;
    let time = |op| if let WorldOp::Input(input) = op { Some(input.logical_time) } else { None };
    ops.into_iter().filter_map(time).collect()
}

#[test]
fn an_input_that_names_a_tick_waits_for_it_and_the_client_is_told_how_early_it_came() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let named = |time, tick| Input { tick: Tick(tick), pose: None, ..input(time, 1.0) };
    let stamp = |leader: &Leader| leader.applied.get(&CLIENT).copied().unwrap_or_default();
    assert_eq!(leader.accept_input(CLIENT, named(5, 4)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, named(6, 4)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, named(5, 4)), Ok(()), "said twice, and overtaken: nobody minds");
    assert_eq!(leader.accept_input(CLIENT, named(7, 5)), Ok(()));
    let speculative: Vec<_> = leader.inputs().collect();
    assert_eq!(speculative, [], "it is not due");
    assert_eq!((taken(&mut leader), taken(&mut leader)), (vec![], vec![]), "ticks 2 and 3");
    assert_eq!(stamp(&leader), (0, 0));
    assert_eq!((taken(&mut leader), stamp(&leader)), (vec![6], (6, 2)), "the newest of tick 4");
    assert_eq!((taken(&mut leader), stamp(&leader)), (vec![7], (7, 3)));
    // One input is too late, by a tick, and one names a tick that nobody could mean.
    assert_eq!(leader.accept_input(CLIENT, named(8, 5)), Ok(()));
    assert_eq!((taken(&mut leader), stamp(&leader)), (vec![8], (8, -1)));
    assert_eq!(leader.accept_input(CLIENT, named(9, u64::MAX)), Ok(()));
    assert_eq!(taken(&mut leader), [9]);
    // A later request for an earlier tick counts.
    assert_eq!(leader.accept_input(CLIENT, named(10, 20)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, named(11, 10)), Ok(()));
    let all: Vec<_> = (0..20).flat_map(|_| taken(&mut leader)).collect();
    assert_eq!(all, [11]);
}

#[test]
fn a_client_cannot_have_inputs_wait_without_end() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let avatar = |index| BodyId::avatar(CLIENT, index);
    let bodies = (0..2_000).map(|index| sim_body(avatar(index), [1.0; 3])).collect();
    leader.apply(vec![WorldOp::Insert { bodies, shapes: vec![], joints: vec![] }]);
    taken(&mut leader);
    for index in 0..2_000 {
        let named =
            Input { body: avatar(index), tick: Tick(60), pose: None, ..input(u64::from(index) + 1, 1.0) };
        assert_eq!(leader.accept_input(CLIENT, named), Ok(()));
    }
    assert_eq!(taken(&mut leader).len(), 2_000 - 1_024, "those that have no room do not wait");
    leader.apply(vec![WorldOp::Remove(avatar(0))]);
    let rest: Vec<_> = (0..60).flat_map(|_| taken(&mut leader)).collect();
    assert_eq!(rest.len(), 1_023);
}

#[test]
fn an_avatar_jumps_no_farther_than_it_could_have_moved() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let limit = f64::from(sim_world(2).avatar_speed_limit);
    let mut time = 0;
    let mut jump = |leader: &mut Leader, x: f64| {
        time += 1;
        let pose = Some(WorldPose::at([1.0 + x, 1.0, 1.0]));
        leader.accept_input(CLIENT, Input { pose, ..input(time, 0.0) })
    };
    assert_eq!(jump(&mut leader, 1.01 * limit), Err(Refusal::TooFar), "more than in a second");
    assert_eq!(jump(&mut leader, 0.9 * limit), Ok(()));
    assert_eq!(jump(&mut leader, 1.8 * limit), Err(Refusal::TooFar), "the second one is not earned");
    let ticks = (0.9 / f64::from(sim_world(2).step.dt_s)).ceil() as u64;
    for tick in 1..=ticks {
        both_done(&mut leader, tick, vec![], vec![]);
        leader.dispatch(Duration::from_secs(tick)).unwrap();
    }
    assert_eq!(jump(&mut leader, 1.8 * limit), Ok(()), "now it is");
    let spin = Input { velocity: Velocity { linear: [0.0; 3], angular: [0.0, 0.0, 1e3] }, ..input(99, 0.0) };
    assert_eq!(leader.accept_input(CLIENT, spin), Err(Refusal::TooFast));
}

#[test]
fn an_input_that_waited_for_its_avatar_does_not_undo_a_later_one() {
    let mut leader = leader();
    assert_eq!(leader.accept_input(CLIENT, input(5, 1.0)), Ok(()), "the avatar has not appeared yet");
    let (id, epoch) = (AVATAR, crate::space::Epoch(0));
    let state = SharedState {
        id,
        owner: RegionId(1),
        epoch,
        pose: WorldPose::default(),
        velocity: Velocity::default(),
        sleeping: false,
    };
    leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(0), states: vec![state] });
    assert_eq!(leader.accept_input(CLIENT, input(6, 2.0)), Ok(()));
    let ops = leader.dispatch(Duration::ZERO).unwrap().ops;
    let inputs: Vec<_> = ops.iter().filter(|op| matches!(op, WorldOp::Input(_))).collect();
    assert_eq!(inputs, [&WorldOp::Input(input(6, 2.0))]);
}

#[test]
fn of_two_inputs_for_an_avatar_not_heard_of_yet_the_newer_counts_whichever_came_first() {
    let mut leader = leader();
    let early = BodyId::avatar(CLIENT, 7);
    for time in [6, 5] {
        let input = Input { body: early, ..input(time, time as f32) };
        assert_eq!(leader.accept_input(CLIENT, input), Ok(()));
    }
    let told = leader.into_legacy().0;
    let inputs: Vec<_> = told.into_iter().filter(|(_, told)| matches!(told, FromClient::Input(_))).collect();
    assert_eq!(inputs, [(CLIENT, FromClient::Input(Input { body: early, ..input(6, 6.0) }))]);
}

#[test]
fn an_interest_counts_from_the_tick_on_is_handed_on_and_goes_with_the_link() {
    let mut leader = leader();
    let body = BodyId::persistent(1);
    let told_at = |leader: &mut Leader, tick: u64, x: f64| {
        leader.dispatch(Duration::from_millis(20 * tick)).unwrap();
        let pose = WorldPose::at([x, 0.0, 0.0]);
        let (epoch, velocity) = (crate::space::Epoch(0), Velocity::default());
        let states =
            vec![SharedState { id: body, owner: RegionId(1), epoch, pose, velocity, sleeping: false }];
        leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        leader.take_messages();
        both_done(leader, tick, vec![], vec![]);
        told_of(leader.take_messages())
    };
    let area = Area { centre: [0.0; 3], radius_m: 10.0 };
    let other = ClientId(5);
    leader.admit(other);
    assert_eq!(told_at(&mut leader, 1, 50.0), [(CLIENT, 1), (other, 0)], "but that time goes on");
    leader.take_interest(other, None);
    assert_eq!(told_at(&mut leader, 2, 50.5), [(other, 1), (CLIENT, 1)], "all of it");
    leader.take_interest(CLIENT, Some(area));
    leader.take_interest(ClientId(6), Some(area));
    assert_eq!(told_at(&mut leader, 3, 51.0), [(other, 1)]);
    assert_eq!(told_at(&mut leader, 4, 5.0), [(CLIENT, 1), (other, 1)]);
    let handed_on = leader.clone().into_legacy().0;
    let interests = [(CLIENT, FromClient::Interest(Some(area))), (other, FromClient::Interest(None))];
    assert_eq!(handed_on, interests);
    leader.take_interest(CLIENT, None);
    assert_eq!(told_at(&mut leader, 5, 60.0), [(CLIENT, 1), (other, 1)]);
    leader.take_interest(CLIENT, Some(area));
    told_at(&mut leader, 6, 70.0);
    leader.admit(CLIENT);
    assert_eq!(told_at(&mut leader, 7, 71.0), [(other, 1)], "it has not said it again yet");
    let handed_on = leader.clone().into_legacy().0;
    assert_eq!(handed_on, [(other, FromClient::Interest(None))], "nor is it known to another");
}

#[test]
fn a_client_whose_interest_is_not_known_is_asked_for_it_now_and_then() {
    let mut leader = leader();
    let silent = ClientId(5);
    leader.admit(silent);
    let mut asked = Vec::new();
    for tick in 1..=100 {
        leader.dispatch(Duration::from_secs(tick)).unwrap();
        both_done(&mut leader, tick, vec![], vec![]);
        for (client, message) in leader.take_messages() {
            let ToClient::LeaderIs { leader: Some(member), allocation, .. } = message else { continue };
            assert_eq!((client, member.node, allocation.len()), (silent, NodeId(1), 2));
            asked.push(tick);
        }
        if tick == 75 {
            leader.take_interest(silent, None);
        }
    }
    assert_eq!(asked, [1, 31, 61]);
}

#[test]
fn a_member_is_believed_of_its_own_regions_only() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    let state = |id: u32, owner: u32| SharedState {
        id: BodyId::persistent(id),
        owner: RegionId(owner),
        epoch: crate::space::Epoch(0),
        pose: WorldPose::default(),
        velocity: Velocity::default(),
        sleeping: false,
    };
    let states = vec![state(1, 1), state(2, 2), state(3, 7)];
    let report = Report { view: ViewNumber(1), tick: Tick(1), states };
    assert_eq!(leader.report(NodeId(2), report), 2);
    let known: Vec<_> = leader.latest.keys().copied().collect();
    assert_eq!(known, [BodyId::persistent(2)]);
    // No member is ahead of its leader: clients would count time from there, and the true owner's word of the
    // body would count no more.
    let to_come = Report { view: ViewNumber(1), tick: Tick(1 << 40), states: vec![state(2, 2)] };
    assert_eq!(leader.report(NodeId(2), to_come), 1);
    assert_eq!(leader.latest[&BodyId::persistent(2)].1, Tick(1));
    let key = ContactKey { a: BodyId::persistent(3), b: AVATAR, collider_a: 0, collider_b: 0 };
    let touch = Touch { key, began: true, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 };
    // Node 2 says so about region 1.
    let events =
        RegionEvents { region: RegionId(1), tick: Tick(1), touches: vec![touch], ..RegionEvents::default() };
    let done = Done {
        view: ViewNumber(1),
        tick: Tick(1),
        rounds_wanted: 1,
        holds: None,
        events: vec![events],
        answers: vec![],
        load: None,
        compute_us: 0,
        regions: vec![],
    };
    leader.take_messages();
    leader.done(NodeId(2), done.clone());
    leader.done(NodeId(1), Done { events: vec![], ..done });
    let told = leader.take_messages();
    assert!(told.iter().all(|(_, said)| !matches!(said, ToClient::Contacts { .. })), "{told:?}");
}

/// Returns a leader whose members may be twelve ticks apart. It has opened five ticks, with these operations,
/// and none is completed.
fn lagging(ops: [Vec<WorldOp>; 5]) -> Leader {
    let protocol = protocol::SyncProtocol::Unsynchronised { lag_ticks: 12 };
    let mut leader = leader_of(&EnvironmentProperties { protocol, ..sim_world(2) });
    leader.take_messages();
    for (tick, ops) in (1..).zip(ops) {
        leader.apply(ops);
        leader.dispatch(Duration::from_secs(tick)).unwrap();
    }
    leader
}

/// Takes in that node 1 has the avatar at `x` after a tick.
fn report_avatar(leader: &mut Leader, tick: u64, x: f64) {
    let (owner, epoch) = (RegionId(1), crate::space::Epoch(0));
    let (pose, velocity) = (WorldPose::at([x, 0.0, 0.0]), Velocity::default());
    let states = vec![SharedState { id: AVATAR, owner, epoch, pose, velocity, sleeping: false }];
    let refused = leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
    assert_eq!(refused, 0);
}

#[test]
fn what_is_removed_does_not_come_back_by_members_that_are_behind() {
    let mut leader = lagging([vec![], vec![], vec![], vec![], vec![WorldOp::Remove(AVATAR)]]);
    for tick in 1..=5 {
        if tick < 5 {
            report_avatar(&mut leader, tick, 1.0);
        }
        both_done(&mut leader, tick, vec![], vec![]);
    }
    let told: usize = told_of(leader.take_messages()).iter().map(|(_, count)| count).sum();
    assert_eq!((told, leader.replication_here().bytes_of(CLIENT).0), (0, 0), "no client hears of it");
    assert!(leader.latest.is_empty() && leader.gone.is_empty(), "nothing is kept of it");
    assert_eq!(leader.accept_input(CLIENT, input(1, 1.0)), Ok(()));
    assert!(taken(&mut leader).is_empty(), "its inputs wait for it to appear");
}

#[test]
fn what_came_again_under_its_id_is_not_where_the_former_was() {
    let again = WorldOp::Insert { bodies: vec![sim_body(AVATAR, [9.0; 3])], shapes: vec![], joints: vec![] };
    let mut leader = lagging([vec![], vec![], vec![WorldOp::Remove(AVATAR)], vec![again], vec![]]);
    report_avatar(&mut leader, 2, 1.0);
    assert!(leader.latest.is_empty());
    report_avatar(&mut leader, 4, 9.0);
    assert_eq!(leader.latest[&AVATAR].0.pose.translation[0], 9.0);
}

#[test]
fn a_teleport_is_told_to_all_members_and_a_velocity_to_those_that_hold_the_avatar() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    both_done(&mut leader, 1, vec![], vec![]);
    leader.holders.now_holds(NodeId(1), vec![AVATAR]);
    for (time, pose, told) in [(1, None, 0), (2, Some(WorldPose::default()), 1)] {
        leader.accept_input(CLIENT, Input { pose, ..input(time, 1.0) }).unwrap();
        let dispatch = leader.dispatch(Duration::from_secs(time)).unwrap();
        assert_eq!(leader.for_member(NodeId(1), &dispatch).ops.len(), 1);
        assert_eq!(leader.for_member(NodeId(2), &dispatch).ops.len(), told);
        both_done(&mut leader, 1 + time, vec![], vec![]);
    }
}

#[test]
fn clients_hear_now_and_then_that_time_goes_on_though_nothing_moves() {
    let mut leader = leader();
    let mut told = Vec::new();
    leader.take_messages();
    for tick in 1..=100 {
        leader.dispatch(Duration::from_secs(tick)).unwrap();
        // A client that is sent states of moving bodies needs no heartbeat.
        let (id, epoch) = (AVATAR, crate::space::Epoch(0));
        let (pose, velocity) = (WorldPose::default(), Velocity::default());
        let states = vec![SharedState { id, owner: RegionId(1), epoch, pose, velocity, sleeping: false }];
        if tick == 40 {
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        for (client, message) in leader.take_messages() {
            let (ToClient::States { stamp, .. } | ToClient::CompactStates { stamp, .. }) = &message else {
                continue;
            };
            let tick = stamp.tick.0;
            if let ToClient::CompactStates { part, .. } = &message {
                let datagrams = vec![(part.number, 1)];
                let heard = Heard { series: part.series, datagrams, lost: false, bytes_per_s: 0 };
                leader.heard(CLIENT, heard);
            }
            told.extend(told_of(vec![(client, message)]).into_iter().map(|(_, count)| (client, tick, count)));
        }
    }
    assert_eq!(told, [(CLIENT, 30, 0), (CLIENT, 40, 1), (CLIENT, 70, 0), (CLIENT, 100, 0)]);
}

/// The world has 60 ticks per second. One body comes to rest at the 40th, and the world stops for 0.3 s at
/// the 800th.
#[test]
fn clients_hear_rarely_that_time_goes_on_where_it_goes_on_as_ever() {
    let mut leader = leader();
    let (mut told, mut now) = (Vec::new(), Duration::ZERO);
    leader.take_messages();
    for tick in 1..=1_000 {
        now += leader.dt + Duration::from_millis(if tick == 800 { 300 } else { 0 });
        leader.dispatch(now).unwrap();
        let (id, epoch, pose) = (AVATAR, crate::space::Epoch(0), WorldPose::default());
        let velocity = Velocity::default();
        let states = vec![SharedState { id, owner: RegionId(1), epoch, pose, velocity, sleeping: true }];
        if tick == 40 {
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        for (client, message) in leader.take_messages() {
            if let ToClient::CompactStates { part, .. } = &message {
                let datagrams = vec![(part.number, 1)];
                let heard = Heard { series: part.series, datagrams, lost: false, bytes_per_s: 0 };
                leader.heard(CLIENT, heard);
            }
            told.extend(told_of(vec![(client, message)]).into_iter().map(|(_, count)| (tick, count)));
        }
    }
    let ticks: Vec<_> = told.iter().map(|&(tick, _)| tick).collect();
    assert_eq!(ticks[..5], [30, 40, 70, 100, 130], "often at first: some may be lost");
    assert!(told.iter().all(|&(tick, count)| count == usize::from(tick == 40)), "{told:?}");
    let rests: Vec<_> = ticks[4..].windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!((300..=301).contains(&rests[0]) && (300..=301).contains(&rests[1]), "{rests:?}");
    assert_eq!(ticks[7], 801, "who shows the world would be ahead of it: {ticks:?}");
    assert_eq!(ticks.len(), 8);
}

/// One client acknowledges what it is told; one has also asked for few bytes.
#[test]
fn of_thousands_that_move_each_is_told_and_no_batch_is_longer_than_its_room() {
    for (bytes_per_s, ticks) in [(0, 60), (40_000, 400)] {
        let count = 6_000;
        let mut leader = leader();
        leader.take_messages();
        let mut receiver = Receiver::default();
        receiver.set_motion(FreeMotion::of(&sim_world(2).step));
        let mut told = BTreeMap::<BodyId, u64>::new();
        let (mut random, mut bytes) = (crate::sim::Random::new(3), 0);
        for tick in 1..=ticks {
            let now = Duration::from_secs(tick);
            leader.dispatch(now).unwrap();
            let mut state = |i| SharedState {
                id: BodyId::persistent(i),
                owner: RegionId(1),
                epoch: crate::space::Epoch(0),
                pose: WorldPose::at([tick as f64, random.unit(), random.unit()]),
                velocity: Velocity::default(),
                sleeping: false,
            };
            // In the end all but one are at rest.
            let states = if tick < ticks / 2 { (0..count).map(state).collect() } else { vec![state(0)] };
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
            both_done(&mut leader, tick, vec![], vec![]);
            let mut batch = 0;
            for (_, message) in leader.take_messages() {
                let ToClient::CompactStates { part, stamp } = message else { continue };
                batch += part.states.len();
                let states = receiver.take_in(now, stamp.tick, &part, false).unwrap();
                told.extend(states.iter().map(|state| (state.id, state.pose.translation[0] as u64)));
            }
            assert!(batch < protocol::link::DATAGRAM_QUEUE_BYTES, "{batch} bytes at tick {tick}");
            bytes += batch;
            let heard = receiver.due(now + Duration::from_millis(500), bytes_per_s);
            heard.into_iter().for_each(|heard| leader.heard(CLIENT, heard));
        }
        assert_eq!(told.len() as u32, count, "of {bytes_per_s} bytes a second");
        let last = told.values().min().unwrap();
        assert!(*last >= ticks / 2 - 1, "{last}: where they came to rest");
        let rate = bytes as f64 * 60.0 / ticks as f64;
        assert!(bytes_per_s == 0 || rate < 1.02 * f64::from(bytes_per_s), "{rate} bytes a second");
    }
}

/// There are more states than a tick has time for.
#[test]
fn of_many_clients_each_has_its_turn_and_no_tick_codes_more_than_it_may() {
    const BODIES: u32 = 3_000;
    const CLIENTS: u32 = 40;
    let mut leader = leader();
    let mut clients = BTreeMap::new();
    for client in (100..100 + CLIENTS).map(ClientId) {
        leader.admit(client);
        leader.take_interest(client, None);
        let mut receiver = Receiver::default();
        receiver.set_motion(FreeMotion::of(&sim_world(2).step));
        clients.insert(client, (receiver, 0));
    }
    leader.take_messages();
    let mut random = crate::sim::Random::new(5);
    let per_tick = leader.replication_here().states_per_tick();
    assert_eq!(per_tick, 2_333);
    let round = (CLIENTS * BODIES).div_ceil(per_tick as u32);
    let mut all = 0;
    for tick in 1..=4 * u64::from(round) {
        let now = Duration::from_millis(17 * tick);
        leader.dispatch(now).unwrap();
        if tick % 3 == 1 {
            let mut state = |i| SharedState {
                id: BodyId::persistent(i),
                owner: RegionId(1),
                epoch: crate::space::Epoch(0),
                pose: WorldPose::at([tick as f64, random.unit(), random.unit()]),
                velocity: Velocity::default(),
                sleeping: false,
            };
            let states = (0..BODIES).map(&mut state).collect();
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        let mut coded = 0;
        for (client, message) in leader.take_messages() {
            let ToClient::CompactStates { part, stamp } = message else { continue };
            let Some((receiver, told)) = clients.get_mut(&client) else { continue };
            coded += receiver.take_in(now, stamp.tick, &part, false).unwrap().len();
            *told = tick;
            let heard = receiver.due(now + Duration::from_millis(500), 0);
            heard.into_iter().for_each(|heard| leader.heard(client, heard));
        }
        all += coded;
        assert!(coded < per_tick + BODIES as usize, "{coded} at tick {tick}");
        assert!(all < per_tick * tick as usize + BODIES as usize, "{all} until tick {tick}");
        for (client, (_, told)) in &clients {
            assert!(*told + u64::from(round) + 4 >= tick, "{client} was told at {told}, not until {tick}");
        }
    }
    assert!(clients.values().all(|(receiver, _)| receiver.tally().states > u64::from(BODIES)));
}

#[test]
fn a_contact_seen_by_two_regions_begins_and_ends_once() {
    let mut leader = leader();
    let key = ContactKey { a: BodyId::persistent(3), b: AVATAR, collider_a: 0, collider_b: 0 };
    let touch =
        |began| vec![Touch { key, began, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }];
    let mut told = Vec::new();
    let script = [
        (touch(true), touch(true)),
        (vec![], vec![]),
        (touch(false), vec![]),
        (vec![], touch(false)),
        (touch(true), vec![]),
    ];
    leader.take_messages();
    for (tick, (one, two)) in (1..).zip(script) {
        leader.dispatch(Duration::from_secs(tick)).unwrap();
        both_done(&mut leader, tick, one, two);
        for (client, message) in leader.take_messages() {
            let ToClient::Contacts { tick, touches, .. } = message else { continue };
            told.extend(touches.iter().map(|touch| (client, tick, touch.began)));
        }
    }
    assert_eq!(told, [(CLIENT, Tick(1), true), (CLIENT, Tick(4), false), (CLIENT, Tick(5), true)]);
}

/// Returns whether each contact of which clients are told begins (or ends).
fn told_touches(leader: &mut Leader) -> Vec<bool> {
    let touches = |(_, message)| match message {
        ToClient::Contacts { touches, .. } => touches,
        _ => Vec::new(),
    };
    leader.take_messages().into_iter().flat_map(touches).map(|touch| touch.began).collect()
}

fn touch(began: bool) -> Touch {
    let key = ContactKey { a: BodyId::persistent(1), b: AVATAR, collider_a: 0, collider_b: 0 };
    Touch { key, began, sensor: true, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }
}

#[test]
fn what_a_removed_body_touched_is_told_that_this_ends() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    both_done(&mut leader, 1, vec![touch(true)], vec![]);
    assert_eq!(told_touches(&mut leader), [true]);
    leader.apply(vec![WorldOp::Remove(BodyId::persistent(1))]);
    leader.dispatch(Duration::from_secs(1)).unwrap();
    both_done(&mut leader, 2, vec![touch(false)], vec![]);
    assert_eq!(told_touches(&mut leader), [false]);
    // A contact of a body with the same id begins anew.
    leader.dispatch(Duration::from_secs(2)).unwrap();
    both_done(&mut leader, 3, vec![], vec![touch(true)]);
    assert_eq!(told_touches(&mut leader), [true]);
}

#[test]
fn who_leads_on_knows_what_touches_and_all_tell_what_the_program_asked_for() {
    for (moves, expected) in [(false, vec![false]), (true, vec![])] {
        let mut former = leader();
        former.dispatch(Duration::ZERO).unwrap();
        both_done(&mut former, 1, vec![touch(true)], vec![]);
        let body = BodyId::persistent(7);
        let push = crate::protocol::Push::impulse(body, [1.0; 3]);
        let asked = [WorldOp::Input(Input { body, ..input(0, 1.0) }), WorldOp::Push(push)];
        former.apply([&asked[..], &[WorldOp::Remove(body)]].concat());
        // All else comes from the server's record.
        assert_eq!(former.undone(), asked);
        let mut leader = leader();
        leader.inherit(former.into_legacy().1, |_| true);
        leader.dispatch(Duration::ZERO).unwrap();
        // A region that another member computes now reports all its contacts anew.
        let (one, two) = if moves { (vec![], vec![touch(false)]) } else { (vec![touch(false)], vec![]) };
        both_done(&mut leader, 1, one, two);
        assert_eq!(told_touches(&mut leader), expected);
    }
}
