//! Describes in words what the commands of a node did to one body in the last ticks, to explain where a
//! replay parts from its recording.

use std::collections::VecDeque;

use crate::cluster::PhysicsCommand;
use crate::protocol::{Alteration, BorderMessage, WorldOp};
use crate::space::{BodyId, Tick};

/// The number of ticks whose commands are kept.
const TICKS: u64 = 4;

/// The commands of the last ticks.
#[derive(Debug, Default)]
pub(super) struct Acts(VecDeque<(Tick, PhysicsCommand)>);

impl Acts {
    /// Notes a command before it is carried out.
    pub(super) fn note(&mut self, command: &PhysicsCommand) {
        let tick = match command {
            PhysicsCommand::Step { tick, .. }
            | PhysicsCommand::Accept { tick, .. }
            | PhysicsCommand::Rebuild { tick, .. } => *tick,
            _ => return,
        };
        self.0.push_back((tick, command.clone()));
        while self.0.front().is_some_and(|(noted, _)| noted.0 + TICKS <= tick.0) {
            self.0.pop_front();
        }
    }

    /// Returns in words what acted on a body, in order.
    pub(super) fn on(&self, body: BodyId) -> Vec<String> {
        let said = |(tick, command): &(Tick, PhysicsCommand)| {
            let words = match command {
                PhysicsCommand::Step { ops, .. } => ops.iter().filter_map(|op| of_op(op, body)).collect(),
                PhysicsCommand::Accept { incoming, .. } => {
                    incoming.iter().flat_map(|message| of_message(message, body)).collect()
                }
                PhysicsCommand::Rebuild { placed, drop, .. } => {
                    let placed = placed.iter().filter(|placed| placed.body.id == body);
                    let placed = placed.map(|placed| format!("placed in {} by the server", placed.region));
                    let dropped = drop.contains(&body).then(|| "dropped in a view change".to_owned());
                    placed.chain(dropped).collect::<Vec<_>>()
                }
                _ => Vec::new(),
            };
            words.into_iter().map(|words| format!("tick {}: {words}", tick.0)).collect::<Vec<_>>()
        };
        self.0.iter().flat_map(said).collect()
    }
}

fn of_op(op: &WorldOp, id: BodyId) -> Option<String> {
    match op {
        WorldOp::Insert { bodies, .. } => {
            bodies.iter().any(|body| body.id == id).then(|| "inserted".to_owned())
        }
        WorldOp::Remove(body) => (*body == id).then(|| "removed".to_owned()),
        WorldOp::Input(input) => (input.body == id).then(|| {
            let linear = input.velocity.linear;
            format!("input {} of its client or program, velocity {linear:?} m/s", input.logical_time)
        }),
        WorldOp::Push(push) => (push.body == id).then(|| format!("pushed: {push:?}")),
        WorldOp::Alter(Alteration::Body { body, .. }) => (*body == id).then(|| "altered".to_owned()),
        WorldOp::Alter(Alteration::Joint(joint)) => {
            [joint.a, joint.b].contains(&id).then(|| format!("joint {} altered", joint.id))
        }
        WorldOp::Correct { tick, states, stuck } => {
            let of = states.iter().find(|state| state.id == id)?;
            let [x, y, z] = of.pose.translation;
            let done = if stuck.contains(&id) { "stuck, so put to" } else { "corrected towards" };
            Some(format!("{done} ({x:.4}, {y:.4}, {z:.4}), where another group had it after {tick}"))
        }
        WorldOp::RemoveJoint(_)
        | WorldOp::ForgetShapes(_)
        | WorldOp::Repartition(_)
        | WorldOp::Ask { .. }
        | WorldOp::Schedule(_)
        | WorldOp::Watch(_) => None,
    }
}

fn of_message(message: &BorderMessage, id: BodyId) -> Vec<String> {
    let (from, to) = (message.from, message.to);
    let mut words = Vec::new();
    let mut say = |is_there: bool, what: &str| {
        if is_there {
            words.push(format!("{what} in a border message from {from} to {to}"));
        }
    };
    say(message.states.iter().any(|state| state.id == id), "its owner's state");
    say(message.copies.iter().any(|copy| copy.id == id), "a copy's state");
    say(message.ghosts.iter().any(|body| body.id == id), "a new ghost");
    say(message.transfers.iter().any(|transfer| transfer.body.id == id), "a transfer");
    say(message.drops.contains(&id), "a ghost that goes");
    say(message.wakes.contains(&id), "a wake");
    say(message.members.iter().any(|member| member.id == id), "its holders");
    words
}
