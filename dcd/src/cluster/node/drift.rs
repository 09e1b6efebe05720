//! Provisional ticks: a node that waits for others in vain computes on for its clients, on a copy of what it holds. Nothing
//! of it is ever committed: when the others are back, the copy is forgotten and the world goes on where the barrier stood.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Node, NodeOutput, Phase};
use crate::cluster::PhysicsCommand;
use crate::protocol::{Drive, Pace, SharedState, Stamp, ToClient, WorldOp};
use crate::space::{BodyId, Tick};

#[derive(Clone, Debug, Default)]
pub(super) struct Drift {
    /// Provisional ticks since the last one that counts, and when the next is due; `None`: all is well.
    running: Option<(u64, Duration)>,
    /// The newest wishes of the client in this process since then.
    wishes: BTreeMap<BodyId, Drive>,
}

impl Drift {
    pub(super) fn steer(&mut self, drive: Drive) {
        if self.running.is_some() {
            self.wishes.insert(drive.body, drive);
        }
    }

    pub(super) fn is_running(&self) -> bool {
        self.running.is_some()
    }
}

impl Node {
    /// Whether a tick is complete here and the next has not begun.
    pub(super) fn is_resting(&self) -> bool {
        matches!(self.phase, Phase::Resting)
    }

    /// When the next provisional tick is due, if all stays as it is.
    pub(super) fn drift_at(&self) -> Option<Duration> {
        let world = self.world.as_ref().filter(|world| world.pace == Pace::RealTime)?;
        let is_over = world.last_tick == Some(self.tick);
        let audience = self.config.client.is_some() || self.leader.as_ref().is_some_and(|l| l.has_clients());
        if self.busy || self.view.is_none() || is_over || !audience {
            return None;
        }
        Some(self.drift.running.map_or(self.since + self.config.patience, |(_, at)| at))
    }

    /// Computes a provisional tick if it is due.
    pub(super) fn drift(&mut self, now: Duration) {
        if self.drift_at().is_none_or(|at| now < at) {
            return;
        }
        let dt = self.world.as_ref().map_or(0.0, |world| world.dt_s);
        let (count, at) = self.drift.running.unwrap_or((0, now));
        self.drift.running = Some((count + 1, (at + Duration::from_secs_f32(dt)).max(now)));
        self.counters.provisional += 1;
        let mut wishes = std::mem::take(&mut self.drift.wishes);
        wishes.extend(self.leader.iter().flat_map(|leader| leader.wishes()).map(|drive| (drive.body, drive)));
        self.ask(PhysicsCommand::Drift(wishes.into_values().map(WorldOp::Drive).collect()));
    }

    /// Tells clients what became of the copy.
    pub(super) fn drifted(&mut self, states: Vec<SharedState>) {
        let Some((count, _)) = self.drift.running else { return };
        // As often as of ticks that count: more would crowd those out on a thin link.
        if (count - 1) % self.config.report_every != 0 {
            return;
        }
        let tick = Tick(self.tick.0 + count);
        match &mut self.leader {
            Some(leader) => leader.tell_provisional(tick, &states),
            None if self.config.client.is_some() => {
                let group = self.view.as_ref().map_or_else(Default::default, |view| view.group);
                let stamp = Stamp { group, tick, provisional: true };
                let message = ToClient::States { stamp, states };
                self.outputs.push_back(NodeOutput::Client(message));
            }
            None => {}
        }
    }

    /// The others are back.
    pub(super) fn return_from_drift(&mut self) {
        if self.drift.running.is_some() {
            self.drift = Drift::default();
            self.order(PhysicsCommand::Return);
        }
    }
}
