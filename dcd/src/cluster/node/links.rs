//! Maintains the links of a node: each pair of nodes has one, dialled by the lower id (thesis 4.3.2.10). A
//! link that breaks is dialled again, and what may have been lost is sent again. Only when it does not come
//! back does the node complain to the server.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use super::{Node, NodeOutput, Phase};
use crate::cluster::{Leader, Peer};
use crate::protocol::link::HANDSHAKE_TIMEOUT;
use crate::protocol::{Border, Delay, Hello, JoinAs, Member, Message, Pong, ToServer, VERSION};
use crate::space::NodeId;

/// The number of rounds sent again when a link is back, beside those of the ticks that members may be apart:
/// nobody is farther behind.
const SAID_AGAIN: usize = 2;
/// How long a link may be down before the node complains to the server.
const COMPLAIN_AFTER: Duration = Duration::from_millis(350);
/// The same for a link that never was up.
const NEVER_UP: Duration = HANDSHAKE_TIMEOUT.saturating_mul(2);
/// How long a member that is linked may keep the others waiting, beside twenty times what a tick takes.
const STALL: Duration = Duration::from_millis(2_500);
/// The time between complaints, and between attempts to dial the server or another member.
const AGAIN: Duration = Duration::from_millis(250);
/// The time between attempts to dial a node of another group.
const AGAIN_INTER_GROUP: Duration = Duration::from_secs(1);
/// How often changed delays are reported to the server.
const DELAYS: Duration = Duration::from_secs(1);

#[derive(Clone, Debug)]
struct Link {
    member: Member,
    up: bool,
    down_since: Duration,
    /// The time at which to dial it. `None` while it is up, while an attempt is under way, or when the other
    /// node dials.
    dial_at: Option<Duration>,
    complain_at: Duration,
    /// The delay that the server was last told; `None`: nothing yet.
    told_ms: Option<Option<f32>>,
    said: VecDeque<Border>,
}

/// The links of a node to the server and to other nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    server_up: bool,
    dial_server_at: Option<Duration>,
    nodes: BTreeMap<NodeId, Link>,
    delays_at: Option<Duration>,
}

impl Links {
    pub(super) fn timeout(&self, others: &BTreeSet<NodeId>) -> Option<Duration> {
        let dials = self.nodes.values().filter_map(|link| link.dial_at);
        let down = |(node, link): (&NodeId, &Link)| {
            (self.server_up && !link.up && others.contains(node)).then_some(link.complain_at)
        };
        dials.chain(self.nodes.iter().filter_map(down)).chain(self.dial_server_at).chain(self.delays_at).min()
    }

    /// Keeps a border message to a member, to send it again when its link breaks.
    pub(super) fn keep(&mut self, to: NodeId, border: &Border, lag: u64) {
        if let Some(link) = self.nodes.get_mut(&to) {
            link.said.push_back(border.clone());
            if link.said.len() > SAID_AGAIN + lag as usize {
                link.said.pop_front();
            }
        }
    }

    /// Forgets which delays the server knows, so that they are reported anew.
    pub(super) fn tell_again(&mut self) {
        self.nodes.values_mut().for_each(|link| link.told_ms = None);
    }

    pub(super) fn is_up(&self, node: NodeId) -> bool {
        self.nodes.get(&node).is_some_and(|link| link.up)
    }

    pub(super) fn server_up(&self) -> bool {
        self.server_up
    }
}

impl Node {
    /// Greets the server over a new link: says who this node is, and which view it computes.
    pub(super) fn greet_server(&mut self, now: Duration) {
        self.link.server_up = true;
        self.link.dial_server_at = None;
        self.link.delays_at = Some(now + DELAYS);
        self.link.tell_again();
        self.placed.clear();
        self.joints.clear();
        let resume = self.view.as_ref().map(|view| view.number);
        let heard = self.leader.as_ref().map_or(0, Leader::moves_heard);
        let role = JoinAs::Node { address: self.config.address, client: self.config.client, resume, heard };
        self.send(Peer::Server, Message::Hello(Hello { version: VERSION, role }));
        if self.leader.is_some() {
            // The server may have begun anew, or what it was told may have been lost with the link.
            self.tell_division(self.tick.next());
        }
        if self.leaving {
            self.send_server(ToServer::Leave);
        }
        self.pinger.add(now, Peer::Server);
    }

    /// Schedules the next dial of the server, whose link is gone or could not be made. The group computes on
    /// without it.
    pub(super) fn miss_server(&mut self, now: Duration) {
        self.link.dial_server_at = Some(if self.link.server_up { now } else { now + AGAIN });
        self.link.server_up = false;
        // When the server is back it begins a change that is under way anew. Until then the group goes on as
        // it was.
        if self.change.as_ref().is_some_and(|change| change.adopt.is_none()) {
            self.drop_change();
        }
    }

    /// Takes in the roster of nodes to be linked with. With `forget_others`, ends the links to nodes that are
    /// neither on it nor members.
    pub(super) fn know(&mut self, now: Duration, roster: &[Member], forget_others: bool) {
        let me = self.config.id;
        for member in roster.iter().filter(|member| member.node != me) {
            let link = self.link.nodes.entry(member.node).or_insert_with(|| Link {
                member: member.clone(),
                up: self.links.contains(&Peer::Node(member.node)),
                down_since: now,
                dial_at: (me < member.node).then_some(now),
                complain_at: now + NEVER_UP,
                told_ms: None,
                said: VecDeque::new(),
            });
            if link.up {
                link.dial_at = None;
            } else if self.others.contains(&member.node) {
                // A link to a node of another group could wait; one to a member cannot.
                link.dial_at = link.dial_at.map(|at| at.min(now));
                link.complain_at = link.complain_at.max(now + COMPLAIN_AFTER);
            }
            if !link.up && me < member.node && link.member.address != member.address {
                // The attempt under way goes to the former address.
                link.dial_at = Some(now);
            }
            link.member = member.clone();
        }
        if forget_others {
            let others = &self.others;
            let is_known = |node: &NodeId| others.contains(node) || roster.iter().any(|m| m.node == *node);
            let gone: Vec<_> = self.link.nodes.keys().filter(|node| !is_known(node)).copied().collect();
            for node in gone {
                self.link.nodes.remove(&node);
                // The end that closes a link hears no more of it.
                self.links.remove(&Peer::Node(node));
                self.pinger.remove(Peer::Node(node));
                if let Some(watch) = &mut self.watch {
                    watch.forget(node);
                }
                self.outputs.push_back(NodeOutput::Disconnect(node));
            }
        }
    }

    pub(super) fn link_up(&mut self, now: Duration, node: NodeId) {
        self.pinger.add(now, Peer::Node(node));
        let Some(link) = self.link.nodes.get_mut(&node) else { return };
        link.up = true;
        link.dial_at = None;
        if let Some(leader) = &mut self.leader {
            leader.relay_back(node);
        }
        // Messages on their way may be lost. The receiver passes over those that it knows.
        let again: Vec<_> = link.said.iter().cloned().map(Message::Border).collect();
        for message in again {
            self.send(Peer::Node(node), message);
        }
        if !self.others.contains(&node) {
            return;
        }
        if let Some(leader) = &mut self.leader {
            let again: Vec<_> =
                self.dispatches.iter().map(|dispatch| leader.for_member(node, dispatch)).collect();
            for dispatch in again {
                self.send(Peer::Node(node), Message::Dispatch(dispatch));
            }
        }
        if self.view.as_ref().is_some_and(|view| view.leader == node) {
            self.reports.begin_anew();
            for message in self.witness.told() {
                self.send(Peer::Node(node), message);
            }
            for done in self.done.clone() {
                self.send(Peer::Node(node), Message::Done(done));
            }
            self.repeat_interest();
            // Its inputs may have been lost with the link, too.
            self.tell_own_client();
        }
    }

    pub(super) fn link_down(&mut self, now: Duration, node: NodeId) {
        let (me, is_member) = (self.config.id, self.others.contains(&node));
        if let Some(leader) = &mut self.leader {
            leader.relay_lost(node);
        }
        let Some(link) = self.link.nodes.get_mut(&node) else { return };
        if std::mem::replace(&mut link.up, false) {
            link.down_since = now;
            link.complain_at = now + COMPLAIN_AFTER;
            link.dial_at = (me < node).then_some(now);
        } else {
            let again = if is_member { AGAIN } else { AGAIN_INTER_GROUP };
            link.dial_at = (me < node).then_some(now + again);
        }
    }

    /// Takes in a complete round trip. The delay may be a reason to call for a vote.
    pub(super) fn hear_pong(&mut self, now: Duration, from: Peer, pong: Pong) {
        self.pinger.pong(now, from, pong);
        let Peer::Node(node) = from else { return };
        let (Some(middle), Some(latest)) = (self.pinger.delay_us(from), self.pinger.latest_us(from)) else {
            return;
        };
        if self.link.nodes.get(&node).is_some_and(|link| link.told_ms.is_none()) {
            self.link.delays_at = self.link.delays_at.map(|at| at.min(now));
        }
        let same_group = self.others.contains(&node);
        // What is unlike the round trips before may be a stall, and pings come often then: it is no strike yet.
        let is_odd = self.pinger.is_unsettled(from);
        let Some(watch) = self.watch.as_mut().filter(|_| self.view.is_some() && !is_odd) else { return };
        let motion = watch.observe(now, node, same_group, middle / 1e3, latest as f64 / 1e3);
        if let Some(motion) = motion.filter(|_| self.link.server_up) {
            self.send_server(ToServer::Call(motion));
        }
    }

    /// Makes the dials, complaints and reports that are due.
    pub(super) fn tend_links(&mut self, now: Duration) {
        if self.link.dial_server_at.take_if(|at| *at <= now).is_some() {
            self.outputs.push_back(NodeOutput::Redial);
        }
        for link in self.link.nodes.values_mut() {
            if link.dial_at.take_if(|at| *at <= now).is_some() {
                self.outputs.push_back(NodeOutput::Connect(link.member.clone()));
            }
        }
        if self.link.server_up {
            let others = &self.others;
            let due = |(node, link): &(&NodeId, &mut Link)| {
                others.contains(node) && !link.up && link.complain_at <= now
            };
            let mut lost = Vec::new();
            for (&node, link) in self.link.nodes.iter_mut().filter(due) {
                link.complain_at = now + AGAIN;
                lost.push(node);
            }
            self.complain(lost);
        }
        if self.link.delays_at.is_some_and(|at| at <= now) {
            self.link.delays_at = Some(now + DELAYS);
            self.tell_delays(now);
        }
    }

    fn complain(&mut self, of: Vec<NodeId>) {
        let view = self.number();
        for node in of {
            self.send_server(ToServer::LinkLost { view, node });
        }
    }

    /// Returns when the node is to complain of members that are linked but send nothing.
    pub(super) fn stalled_at(&self) -> Option<Duration> {
        let waits = self.view.is_some() && self.change.is_none() && self.link.server_up;
        let first = self.laggards().into_iter().map(|node| self.suspect_at(node)).min();
        first.filter(|_| waits).map(|at| at.max(self.complained_at))
    }

    /// Returns until when a member may keep this node waiting. A member that waits itself, and says so, gets
    /// more time, but not without end.
    fn suspect_at(&self, node: NodeId) -> Duration {
        let waited = self.waiting.get(&node).map_or(Duration::ZERO, |&at| at.min(self.since + 2 * STALL));
        let heard = match self.since_leader {
            Some(heard) if self.leader.is_none() && self.is_resting() => heard,
            _ => Duration::ZERO,
        };
        self.since.max(waited).max(heard) + STALL + 20 * self.tick_takes
    }

    pub(super) fn complain_of_stalled(&mut self, now: Duration) {
        if self.stalled_at().is_some_and(|at| at <= now) {
            self.complained_at = now + AGAIN;
            let mut laggards = self.laggards();
            laggards.retain(|&node| self.suspect_at(node) <= now);
            self.complain(laggards);
        }
    }

    /// Returns when the node is to say that it waits for others, if it does.
    pub(super) fn reassurance_at(&self) -> Option<Duration> {
        let misses = self.leader.as_ref().is_some_and(|leader| leader.missing().next().is_some());
        let waits = misses || matches!(self.phase, Phase::Exchanging(_));
        (waits && self.change.is_none()).then(|| self.reassure_at.max(self.since + STALL / 4))
    }

    /// Sends the other members a heartbeat, which says that this node waits and does not hang. A member that
    /// waits for this node may not be a neighbour of the one that this node waits for.
    pub(super) fn reassure(&mut self, now: Duration) {
        if self.reassurance_at().is_none_or(|at| now < at) {
            return;
        }
        self.reassure_at = now + STALL / 4;
        for node in self.others.clone() {
            self.send(Peer::Node(node), Message::Waiting(self.number()));
        }
    }

    fn tell_delays(&mut self, now: Duration) {
        let pinger = &self.pinger;
        let mut delays = Vec::new();
        for (&node, link) in &mut self.link.nodes {
            let delay_ms = match pinger.delay_us(Peer::Node(node)) {
                Some(us) if link.up => Some((us / 1e3) as f32),
                None if link.up => continue,
                _ if now < link.down_since + COMPLAIN_AFTER => continue,
                _ => None,
            };
            let is_news = match (link.told_ms, delay_ms) {
                (None, _) => true,
                (Some(Some(old)), Some(new)) => (new - old).abs() > 0.1 * old + 0.5,
                (Some(old), new) => old.is_some() != new.is_some(),
            };
            if is_news {
                link.told_ms = Some(delay_ms);
                delays.push(Delay { node, delay_ms });
            }
        }
        if !delays.is_empty() && self.link.server_up {
            self.send_server(ToServer::Delays(delays));
        }
    }
}
