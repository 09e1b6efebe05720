//! Computes speculative ticks: a node that waits for others in vain computes on for its clients, on a copy of
//! what it holds. Nothing of that is ever committed. When the others are back, the copy is discarded and the
//! world goes on where the barrier stood.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Node, NodeOutput, Phase};
use crate::cluster::PhysicsCommand;
use crate::protocol::{Input, Pace, SharedState, Stamp, ToClient, WorldOp};
use crate::space::{BodyId, Tick};

#[derive(Clone, Debug, Default)]
pub(super) struct Speculation {
    /// The number of speculative ticks since the last tick that counts, and when the next is due. `None`: the
    /// node does not speculate.
    running: Option<(u64, Duration)>,
    /// The newest inputs of the client in this process since then.
    inputs: BTreeMap<BodyId, Input>,
}

impl Speculation {
    pub(super) fn steer(&mut self, input: Input) {
        if self.running.is_some() {
            self.inputs.insert(input.body, input);
        }
    }

    pub(super) fn is_running(&self) -> bool {
        self.running.is_some()
    }
}

impl Node {
    /// Returns whether a tick is complete here and the next has not begun.
    pub(super) fn is_resting(&self) -> bool {
        matches!(self.phase, Phase::Resting)
    }

    /// Returns when the next speculative tick is due, if all stays as it is.
    pub(super) fn speculation_due(&self) -> Option<Duration> {
        let world = self.world.as_ref().filter(|world| world.pace == Pace::RealTime)?;
        let is_over = world.last_tick == Some(self.tick);
        let audience = self.config.client.is_some() || self.leader.as_ref().is_some_and(|l| l.has_clients());
        if self.busy || self.view.is_none() || is_over || !audience {
            return None;
        }
        Some(self.speculation.running.map_or(self.since.saturating_add(self.config.patience), |(_, at)| at))
    }

    /// Computes a speculative tick if it is due.
    pub(super) fn speculate(&mut self, now: Duration) {
        if self.speculation_due().is_none_or(|at| now < at) {
            return;
        }
        let dt = self.world.as_ref().map_or(0.0, |world| world.step.dt_s);
        let (count, at) = self.speculation.running.unwrap_or((0, now));
        self.speculation.running = Some((count + 1, (at + Duration::from_secs_f32(dt)).max(now)));
        self.counters.speculative += 1;
        let mut inputs = std::mem::take(&mut self.speculation.inputs);
        inputs.extend(self.leader.iter().flat_map(|leader| leader.inputs()).map(|input| (input.body, input)));
        self.ask(PhysicsCommand::Speculate(inputs.into_values().map(WorldOp::Input).collect()));
    }

    /// Sends clients the states of a speculative tick.
    pub(super) fn speculated(&mut self, states: Vec<SharedState>) {
        let Some((count, _)) = self.speculation.running else { return };
        // States are sent as rarely as those of ticks that count: more would crowd those out on a thin link.
        if !(count - 1).is_multiple_of(self.state_every()) {
            return;
        }
        let tick = Tick(self.tick.0 + count);
        match &mut self.leader {
            Some(leader) => leader.tell_speculative(tick, states),
            None if self.config.client.is_some() => {
                let group = self.view.as_ref().map_or_else(Default::default, |view| view.group);
                let stamp = Stamp::untimed(group, tick, true);
                let message = ToClient::States { stamp, states };
                self.outputs.push_back(NodeOutput::Client(message));
            }
            None => {}
        }
    }

    /// Ends speculation and discards the copy.
    pub(super) fn end_speculation(&mut self) {
        if self.speculation.running.is_some() {
            self.speculation = Speculation::default();
            self.order(PhysicsCommand::Return);
        }
    }
}
