//! Compares what a client knows of bodies with what its group computes.

use super::Sim;
use super::world::NodeProcess;
use crate::cluster::deviation_m;
use crate::protocol::WorldPose;
use crate::space::{BodyId, ClientId, GroupId};

/// The error within which clients are told where a resting body is, metres: they are told of it once.
const REST_M: f64 = 0.002;

impl Sim {
    /// Returns in words which movable body a client that hears of the whole world does not know as it is: the
    /// client does not see it, or has a state that is more than `ticks` old and of another place.
    pub(super) fn lacks_body(&self, client: ClientId, ticks: u64) -> Option<String> {
        let machine = self.clients.get(&client)?;
        let group = machine.group()?;
        let (_, tick) = self.checker.progress(group)?;
        self.checker.bodies(group).find_map(|id| {
            let Some(view) = machine.body(id) else { return Some(format!("{client} does not see {id}")) };
            let told = view.settled_tick();
            let is_there = || {
                let at = self.place_in(group, id);
                at.is_none_or(|at| deviation_m(&view.body.state.pose, &at) <= REST_M)
            };
            let is_known = told.0 + ticks >= tick.0 || is_there();
            (!is_known).then(|| format!("{client} sees {id} as of {told}, while it is {tick}"))
        })
    }

    /// Returns the pose of a body at its owner in a group.
    fn place_in(&self, group: GroupId, id: BodyId) -> Option<WorldPose> {
        let is_member =
            |process: &&NodeProcess| process.machine.view().is_some_and(|view| view.group == group);
        let state = self.nodes.values().filter(is_member).find_map(|process| process.physics.state(id));
        state.map(|state| state.pose)
    }
}
