//! Follows the leader of a client's group: over which link the client is told of the world, and which ticks
//! that is of.

use super::{Client, ClientOutput};
use crate::cluster::Peer;
use crate::protocol::{Member, Stamp};

/// The ticks by which the first states of a leader must be older than what was told before for the leader to
/// have gone back: no message is as late.
const GOES_BACK_TICKS: u64 = 60;

impl Client {
    /// Takes in the tick of states that have come. Where the nodes that had computed most of a group are
    /// lost, the group goes back to what the others, or its record, had. Ticks are then counted anew from the
    /// first that its next leader tells.
    pub(super) fn hear_tick(&mut self, stamp: &Stamp) {
        if !stamp.speculative {
            let is_first = std::mem::take(&mut self.is_leader_new);
            if is_first && stamp.tick.0 + GOES_BACK_TICKS < self.settled.0 {
                (self.tick, self.settled) = (stamp.tick, stamp.tick);
                self.showing.iter_mut().for_each(|showing| showing.recount());
            }
            self.settled = self.settled.max(stamp.tick);
        }
        self.tick = self.tick.max(stamp.tick);
    }

    /// Follows a leader from now on, over a link of its own.
    pub(super) fn follow(&mut self, leader: Option<Member>) {
        // A leader that was started again elsewhere is another, whatever its link seems to be.
        let place = |member: &Member| (member.node, member.address);
        let (former, next) = (self.leader.as_ref().map(place), leader.as_ref().map(place));
        self.leader = leader.clone();
        let former_node = former.map(|(node, _)| node);
        if former != next {
            self.receiver.reset();
            self.vigil.rest();
            self.is_leader_new = true;
            self.showing.iter_mut().for_each(|showing| showing.change_leader(former_node));
        }
        if self.node.is_some() || (former == next && self.linked) {
            return;
        }
        self.linked = false;
        if former != next {
            self.outputs.extend(former_node.map(ClientOutput::Disconnect));
            if self.relay_leads(leader.as_ref())
                && let Some(leader) = &leader
            {
                self.linked = true;
                let (now, peer) = (self.now, Peer::Node(leader.node));
                self.showing.iter_mut().for_each(|showing| showing.connected(now, peer));
                return;
            }
        }
        self.outputs.extend(leader.map(ClientOutput::Connect));
    }
}
