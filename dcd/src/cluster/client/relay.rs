//! Follows the member that tells a client the states of bodies in its leader's place (a relay), over a link
//! of its own. Everything else goes over the link to the leader, which tells the client itself when that link
//! fails.

use std::time::Duration;

use super::{AGAIN, Client, ClientOutput};
use crate::cluster::Peer;
use crate::protocol::{FromClient, Member, Message, Part, ToClient};
use crate::space::NodeId;

/// The time after which a relay that was silent, or could not be reached, is dialled again.
const LATER: Duration = Duration::from_secs(10);

/// The relay, as the leader has named it.
#[derive(Clone, Debug, Default)]
pub(super) struct Relay {
    member: Option<Member>,
    pub(super) linked: bool,
    dial_at: Option<Duration>,
    /// Says whether the newest states came from it: they are acknowledged to it.
    tells: bool,
    /// Says whether it is silent, and has been asked whether it is there.
    asked: bool,
}

impl Relay {
    /// Returns whether a peer is the relay.
    pub(super) fn is(&self, peer: Peer) -> bool {
        self.member.as_ref().is_some_and(|member| peer == Peer::Node(member.node))
    }

    /// Returns the relay, if the newest states came from it and its link stands.
    pub(super) fn teller(&self) -> Option<NodeId> {
        self.member.as_ref().filter(|_| self.linked && self.tells).map(|member| member.node)
    }

    /// Returns when the relay is dialled again.
    pub(super) fn timeout(&self) -> Option<Duration> {
        self.dial_at
    }

    /// Notes that the relay has answered.
    pub(super) fn answered(&mut self) {
        self.asked = false;
    }
}

/// Returns whether a relay may send a client this.
pub(super) fn is_of_relay(message: &ToClient) -> bool {
    matches!(message, ToClient::States { .. } | ToClient::CompactStates { .. })
}

impl Client {
    /// Returns the member that tells the client states in the leader's place, if one does.
    #[doc(hidden)]
    pub fn told_by(&self) -> Option<NodeId> {
        self.relay.teller()
    }

    /// Acknowledges states, if that is due.
    pub(super) fn acknowledge(&mut self, now: Duration) {
        if let Some(heard) = self.receiver.due(now, self.bytes_per_s) {
            let heard = FromClient::Heard(heard);
            match self.relay.teller() {
                Some(relay) => self.send(Peer::Node(relay), Message::FromClient(self.id, heard)),
                None => self.tell_leader(heard),
            }
        }
    }

    /// Returns whether a peer tells the client states: the relay, or else the leader.
    pub(super) fn is_teller(&self, peer: Peer) -> bool {
        match self.relay.teller() {
            Some(relay) => peer == Peer::Node(relay),
            None => self.is_leader(peer),
        }
    }

    /// Takes in which relay, if any, tells the client states from now on.
    pub(super) fn turn_to_relay(&mut self, relay: Option<Member>) {
        let is_leader = |member: &Member| self.is_leader(Peer::Node(member.node));
        let relay = relay.filter(|member| self.node.is_none() && !is_leader(member));
        // A relay that is linked is named again in each view.
        if self.relay.member == relay && (self.relay.linked || self.relay.dial_at.is_some()) {
            return;
        }
        self.leave_relay();
        self.relay.member = relay.clone();
        self.outputs.extend(relay.map(ClientOutput::Connect));
    }

    /// Ends the link to the relay, if there is one.
    pub(super) fn leave_relay(&mut self) {
        let former = std::mem::take(&mut self.relay);
        self.outputs.extend(former.member.map(|member| ClientOutput::Disconnect(member.node)));
    }

    /// Keeps the relay's link as that to the leader, if the relay has become the leader; ends it otherwise.
    /// Returns whether the leader is linked so.
    pub(super) fn relay_leads(&mut self, leader: Option<&Member>) -> bool {
        if self.relay.member.is_none() || self.relay.member.as_ref() != leader {
            self.leave_relay();
            return false;
        }
        std::mem::take(&mut self.relay).linked
    }

    pub(super) fn relay_connected(&mut self) {
        (self.relay.linked, self.relay.dial_at) = (true, None);
    }

    /// Takes in that the relay's link is gone, or could not be made. The leader is told so even if the relay
    /// has told nothing: the relay may have an older link of the client's, and have said that it is there.
    pub(super) fn relay_disconnected(&mut self, now: Duration) {
        // The client has left it, and dials it later.
        if self.relay.dial_at.is_some() {
            return;
        }
        if self.relay.teller().is_some() {
            self.vigil.rest();
        }
        self.tell_leader(FromClient::Untold);
        let was_linked = std::mem::take(&mut self.relay.linked);
        (self.relay.tells, self.relay.asked) = (false, false);
        self.relay.dial_at = Some(now + if was_linked { AGAIN } else { LATER });
    }

    /// Notes who has told a part, if the part is of the newest series: leaders and relays take turns, and a
    /// later turn has later series.
    pub(super) fn note_teller(&mut self, from: Option<Peer>, part: &Part) {
        if self.receiver.series() == Some(part.series) {
            self.relay.tells = from.is_some_and(|from| self.relay.is(from));
        }
    }

    /// Gives a relay up for a while if it is silent though it was asked, or never told anything: the leader
    /// is to tell the client itself. Returns the relay if it is to be asked.
    pub(super) fn doubt_relay(&mut self, now: Duration) -> Option<Peer> {
        let teller = self.relay.teller();
        if let Some(relay) = teller
            && !std::mem::replace(&mut self.relay.asked, true)
        {
            return Some(Peer::Node(relay));
        }
        let member = self.relay.member.clone()?;
        if self.relay.linked {
            self.outputs.push_back(ClientOutput::Disconnect(member.node));
            self.relay = Relay { member: Some(member), dial_at: Some(now + LATER), ..Relay::default() };
        }
        self.tell_leader(FromClient::Untold);
        None
    }

    /// Dials the relay again, if that is due.
    pub(super) fn tend_relay(&mut self, now: Duration) {
        if self.relay.dial_at.take_if(|at| *at <= now).is_some() {
            self.outputs.extend(self.relay.member.clone().map(ClientOutput::Connect));
        }
    }
}
