//! Keeps a client's area of interest: leader and server are told of it, and bodies beyond it may be elsewhere
//! than where they are known to be.

use super::{BodyView, Client};
use crate::protocol::{Area, BodyKind, BodyRecord, FromClient, WorldPose};
use crate::space::{BodyId, ClientId};

/// The area in which the leader sends a client everything that moves.
pub(super) struct Hearing {
    client: ClientId,
    /// Its area of interest, and areas around its avatars; `None`: everywhere.
    areas: Option<Vec<Area>>,
}

impl Hearing {
    /// Returns whether the client is sent a body at this pose whenever that moves.
    pub(super) fn follows(&self, id: BodyId, pose: &WorldPose) -> bool {
        let Some(areas) = &self.areas else { return true };
        id.client() == Some(self.client) || areas.iter().any(|area| area.covers(pose.translation))
    }

    /// Returns whether a body may be elsewhere than where it is known to be.
    pub(super) fn misses(&self, body: &BodyRecord) -> bool {
        body.traits.kind != BodyKind::Fixed && !self.follows(body.id, &body.state.pose)
    }
}

impl Client {
    /// Returns the area in which the leader sends the client everything that moves.
    pub(super) fn hearing(&self) -> Hearing {
        let around = |view: &BodyView| Area::around_avatar(view.body.state.pose.translation);
        let areas =
            self.area.map(|area| std::iter::once(area).chain(self.own_avatars().map(around)).collect());
        Hearing { client: self.id, areas }
    }

    /// Sends the area of interest, unless the one sent before stands for it.
    pub(super) fn turn_to(&mut self, area: Option<Area>) {
        let is_known = match (&self.area, &area) {
            (Some(known), Some(area)) => known.stands_for(area),
            (known, area) => known.is_none() && area.is_none(),
        };
        if is_known {
            return;
        }
        self.area = area;
        // A body that comes into the area counts as outside until it is heard of.
        let hearing = self.hearing();
        for BodyView { body, outside, .. } in self.bodies.values_mut() {
            *outside |= hearing.misses(body);
            if let Some(showing) = self.showing.as_mut().filter(|_| *outside) {
                showing.stand(body.id);
            }
        }
        self.changed = None;
        self.send_interest();
        if let Some(message) = self.surroundings.turn_to(area) {
            self.ask_server(message);
        }
    }

    /// Sends the area of interest to the leader. The next leader is sent it anew.
    pub(super) fn send_interest(&mut self) {
        self.tell_leader(FromClient::Interest(self.area));
    }
}
