//! Keeps the velocities that the server's program and builders gave to kinematic bodies. Nothing but another
//! such velocity stops a kinematic body, so that a lost one would never be made up for. The record has the
//! newest one whatever nodes last told of the body, and soon durably.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::cluster::Record;
use crate::protocol::{BodyKind, Input, Velocity};
use crate::space::BodyId;

/// The shortest time between two durable writes of such velocities: a program may give new ones in each tick.
pub(super) const WRITE_EVERY: Duration = Duration::from_millis(250);

/// The newest velocities of kinematic bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Steered {
    velocities: BTreeMap<BodyId, Velocity>,
    /// Bodies whose velocity is not written down yet.
    unwritten: BTreeSet<BodyId>,
}

impl Steered {
    /// Takes in the velocity that a body is given, if it is kinematic, onto the record too. Avatars are left
    /// out: clients give them velocities by their leader, and give these again to the next one.
    pub(super) fn note(&mut self, record: &mut Record, input: &Input) {
        let (id, velocity) = (input.body, input.velocity);
        if input.drive.is_some() || id.client().is_some() || !is_kinematic(record, id) {
            return;
        }
        if self.velocities.insert(id, velocity) != Some(velocity) {
            self.unwritten.insert(id);
            self.hold(record, id);
        }
    }

    /// Gives a body on record the velocity that it was given last, as nodes may tell of a tick before that.
    pub(super) fn hold(&self, record: &mut Record, id: BodyId) {
        let Some(&velocity) = self.velocities.get(&id) else { return };
        if let Some(body) = record.body_mut(id) {
            body.steer(velocity);
            body.state.sleeping &= velocity == Velocity::default();
        }
    }

    /// Notes that a body was altered: one that is not kinematic any more moves by itself.
    pub(super) fn is_altered(&mut self, record: &Record, id: BodyId) {
        if !is_kinematic(record, id) {
            self.forget(id);
        }
    }

    /// Forgets a body.
    pub(super) fn forget(&mut self, id: BodyId) {
        self.velocities.remove(&id);
        self.unwritten.remove(&id);
    }

    /// Returns whether any velocity is not written down yet.
    pub(super) fn has_unwritten(&self) -> bool {
        !self.unwritten.is_empty()
    }

    /// Marks the bodies whose velocities are not written down yet as to be written. Returns whether there are
    /// any.
    pub(super) fn mark_unwritten(&mut self, record: &mut Record) -> bool {
        let unwritten = std::mem::take(&mut self.unwritten);
        let any = !unwritten.is_empty();
        record.mark(unwritten);
        any
    }
}

fn is_kinematic(record: &Record, id: BodyId) -> bool {
    record.body(id).is_some_and(|body| body.traits.kind == BodyKind::KinematicVelocity)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::sim::sim_body;
    use crate::space::{ClientId, Tick};

    #[test]
    fn kinematic_bodies_of_the_worlds_own_keep_what_they_were_given_and_others_what_nodes_tell() {
        let ids = [BodyId::persistent(0), BodyId::built(ClientId(1), 0), BodyId::avatar(ClientId(1), 0)];
        let kinematic = |id| {
            let mut body = sim_body(id, [1.0; 3]);
            Arc::make_mut(&mut body.traits).kind = BodyKind::KinematicVelocity;
            body
        };
        let ball = sim_body(BodyId::persistent(1), [2.0; 3]);
        let bodies = ids.map(kinematic).into_iter().chain([ball.clone()]).collect();
        let mut record = Record::new(bodies, Vec::new(), Vec::new());
        let mut steered = Steered::default();
        let all = [ids[0], ids[1], ids[2], ball.id];
        let velocity = Velocity::linear([2.0, 0.0, 0.0]);
        for body in all {
            let input = Input { body, logical_time: 0, tick: Tick(0), velocity, pose: None, drive: None };
            steered.note(&mut record, &input);
        }
        let speeds = |record: &Record| all.map(|id| record.body(id).unwrap().state.velocity.linear[0]);
        assert_eq!(speeds(&record), [2.0, 2.0, 0.0, 0.0]);
        assert_eq!(steered.unwritten, [ids[0], ids[1]].into());
        for id in all {
            record.body_mut(id).unwrap().state.velocity = Velocity::linear([1.0, 0.0, 0.0]);
            steered.hold(&mut record, id);
        }
        assert_eq!(speeds(&record), [2.0, 2.0, 1.0, 1.0]);
        // What moves by itself now does so.
        let body = record.body_mut(ids[0]).unwrap();
        body.set_traits(ball.traits.clone(), 0);
        steered.is_altered(&record, ids[0]);
        assert_eq!(steered.velocities.keys().copied().collect::<Vec<_>>(), [ids[1]]);
    }
}
