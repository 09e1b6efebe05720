//! Tests what a leader dispatches, believes, and tells clients.

mod between_groups;
mod contacts;
mod heartbeats;
mod inputs;
mod lagging;
mod lying;
mod many;
mod silent;
mod turns;
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

/// Opens the next tick, and returns the logical times of the inputs that it takes.
fn taken(leader: &mut Leader) -> Vec<u64> {
    let tick = leader.opened().0.0;
    both_done(leader, tick, vec![], vec![]);
    let ops = leader.dispatch(Duration::from_secs(tick)).unwrap().ops;
    let time = |op| if let WorldOp::Input(input) = op { Some(input.logical_time) } else { None };
    ops.into_iter().filter_map(time).collect()
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
