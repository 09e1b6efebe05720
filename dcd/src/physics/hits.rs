//! Notes when copies of bodies were hit here, by how their velocities change in a step. What their owners told before the
//! hit knows nothing of it, and would put them back to where they were about to be hit.

use rapier3d::prelude::{RigidBody, RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

use super::region::Region;
use crate::space::Tick;

/// The changes of a copy's velocity in a tick from which on it was hit: as a multiple of what gravity adds in a tick,
/// and at least so much, m/s. What lies still may lose in a tick what gravity adds.
const BY_GRAVITY: f32 = 1.25;
const LEAST_M_S: f32 = 0.1;
/// For how many times as long as states come late a copy goes on by itself while it is hit again and again.
const MOST_ALONE: u64 = 3;

/// When a copy was hit of late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Hits {
    /// The copy's velocities before the step, linear and angular.
    was: Option<(Vector, Vector)>,
    /// The first and the last tick in which it was hit, of hits that followed one another.
    span: Option<(Tick, Tick)>,
}

impl Hits {
    /// Notes how the copy moves before a step.
    pub(crate) fn look_ahead(&mut self, body: &RigidBody) {
        self.was = Some((body.linvel(), body.angvel()));
    }

    /// Notes whether the copy was hit in the step of a tick. Hits that are at most `late` ticks apart follow one another.
    pub(crate) fn look_back(
        &mut self,
        region: &Region,
        handle: RigidBodyHandle,
        tick: Tick,
        late: u64,
        dt_s: f32,
    ) {
        let Some((linear, angular)) = self.was.take() else { return };
        let body = &region.physics().bodies[handle];
        let falls_m_s = dt_s * region.physics().gravity.length() * body.gravity_scale().abs().max(1.0);
        let least = BY_GRAVITY * falls_m_s;
        let by_turning = (body.angvel() - angular).length() * region.slot(handle).reach_m;
        if (body.linvel() - linear).length().max(by_turning) > least.max(LEAST_M_S) {
            let first =
                self.span.filter(|(_, last)| last.0 + late >= tick.0).map_or(tick, |(first, _)| first);
            self.span = Some((first, tick));
        }
    }

    /// Returns whether the copy goes on as it does here: it was hit after the tick of a state that comes `late` ticks
    /// late, and has not been alone for too long.
    pub(crate) fn outdate(&self, told: Tick, late: u64) -> bool {
        self.alone_since(told, late).is_some()
    }

    /// Returns the tick since which the copy has gone on as it does here, if it is to go on so.
    pub(crate) fn alone_since(&self, told: Tick, late: u64) -> Option<Tick> {
        let (first, last) = self.span?;
        (told < last && told.0 < first.0.saturating_add(MOST_ALONE * late)).then_some(first)
    }
}
