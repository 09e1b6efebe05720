//! Puts bodies into given states, as clients need that predict a world and are told otherwise.

use super::Region;
use crate::physics::convert;
use crate::protocol::BodyState;
use crate::space::BodyId;

impl Region {
    /// Puts a body held here into a state, as if it had reached that state by itself.
    pub(in crate::physics) fn put(&mut self, id: BodyId, state: &BodyState) {
        let Some(handle) = self.handle_of(id) else { return };
        let pose = convert::region_from_world(self.anchor, &state.pose);
        self.change(handle, |body| {
            body.set_position(pose, false);
            if state.sleeping {
                body.sleep();
                return;
            }
            body.wake_up(false);
            body.set_linvel(convert::vector(state.velocity.linear), false);
            body.set_angvel(convert::vector(state.velocity.angular), false);
            body.activation_mut().time_since_can_sleep = state.still_s;
        });
        self.set_gait(id, state.gait);
        self.set_drive(id, state.drive);
    }
}
