//! Runs the loop of a process: takes in events of the network and inputs of the user, lets time pass for the
//! state machines, and carries out what they ask for.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::{debug, info, warn};

use super::absence::Absence;
use super::recorded_node::RecordedNode;
use super::{Input, Onlooker, Presence, Shared};
use crate::cluster::{
    Client, ClientEvent, ClientOutput, NodeEvent, NodeOutput, Peer, PhysicsCommand, PhysicsEvent, WORLD_ENDED,
};
use crate::net::{NetTotals, PeerName};
use crate::protocol::{Farewell, Message, ToClient};
use crate::recording::tick_of;
use crate::runtime::ending::{Cause, Ending, Reason};
use crate::runtime::fan_out::{FanOut, Told};
use crate::runtime::inbox::{INPUTS, Inbox};
use crate::runtime::links::{LinkEvent, Links};
use crate::runtime::log::LogSpan;
use crate::runtime::metrics::NodeGauge;
use crate::runtime::{Connections, PhysicsDevice, ProcessError};
use crate::space::Tick;

/// How often sending is tried again after a link had no room.
const RETRY: Duration = Duration::from_millis(2);
/// Up to when a process that has not reached its server yet calls it again if nobody answers. The last call
/// takes up to [`HANDSHAKE_TIMEOUT`](crate::protocol::link::HANDSHAKE_TIMEOUT) more, so that whoever waits
/// ten seconds for the world hears why there is none.
const FIRST_LINK: Duration = Duration::from_secs(5);
/// How long a leaving node waits for the server. A server that lives takes the node's share over within a
/// second.
const RELEASE: Duration = Duration::from_secs(5);
/// The most further inputs taken in after the one that ended a wait, so that acknowledgements of many clients
/// do not cost a turn of the loop each.
const AT_ONCE: usize = 16;
/// How often the network's counters are read for the user.
const COUNT: Duration = Duration::from_millis(100);
/// The most events of each kind that are kept for a user who does not fetch them: more than there are bodies,
/// since all may come at once.
const EVENTS: usize = 1 << 20;
/// The number of tick times kept for the summary: four hours at 60 per second.
const TIMES: usize = 1 << 20;

/// The loop of a process, with all that only the loop changes.
pub(super) struct Loop {
    /// The address at which the server was last linked, or the first one. Errors name it.
    server: SocketAddr,
    /// All addresses at which the server may be.
    servers: Vec<SocketAddr>,
    start: Instant,
    /// Tells the clients of a node that leads. What is left to tell is told before links end.
    pub(super) fan_out: Option<FanOut>,
    /// Messages that the fan-out does not send itself.
    pub(super) told: Arc<Mutex<Vec<Told>>>,
    links: Links,
    node: Option<RecordedNode>,
    device: PhysicsDevice,
    pub(super) shared: Arc<Shared>,
    pub(super) connections: Connections,
    pub(super) onlooker: Option<Onlooker>,
    /// Writes the metrics of the node, if they are asked for.
    pub(super) gauge: Option<NodeGauge>,
    /// The time at which the process leaves without the server's release, after its user asked to leave.
    release_by: Option<Duration>,
    /// How long the server, or a client's leader, is waited for; `None`: without end.
    give_up: Option<Duration>,
    /// Says whether outputs may be left to carry out.
    has_more: bool,
    /// Set while the server is out of reach.
    lost: Option<Absence>,
    /// Set while a client does not hear its leader.
    unheard: Option<Absence>,
    /// The address of the leader that the client does not hear.
    unheard_leader: Option<SocketAddr>,
    /// Says whether the server was ever reached. One that never was is called until [`FIRST_LINK`].
    joined: bool,
    /// The time at which the network's counters are read next.
    count_at: Duration,
    end: Option<Result<(), ProcessError>>,
    /// Why the loop ends, where `end` does not say it.
    reason: Option<Reason>,
}

impl Loop {
    pub(super) fn new(
        servers: Vec<SocketAddr>,
        give_up: Option<Duration>,
        links: Links,
        node: Option<RecordedNode>,
        device: PhysicsDevice,
        shared: Arc<Shared>,
        connections: Connections,
    ) -> Self {
        Self {
            server: servers[0],
            servers,
            start: shared.start,
            links,
            node,
            device,
            shared,
            connections,
            fan_out: None,
            told: Arc::default(),
            onlooker: None,
            gauge: None,
            release_by: None,
            give_up,
            has_more: false,
            lost: None,
            unheard: None,
            unheard_leader: None,
            joined: false,
            count_at: Duration::ZERO,
            end: None,
            reason: None,
        }
    }

    /// Runs until the process has left, its world has ended, or an error occurs.
    pub(super) fn run(&mut self, inputs: &Inbox<Input>, mut log: LogSpan) {
        while self.end.is_none() {
            let (view, tick) = self.reached();
            let _log = log.enter(view, tick);
            let now = self.start.elapsed();
            let due = self.poll_timeout();
            let mut wait = due.map_or(Duration::from_millis(500), |due| due.saturating_sub(now));
            if self.links.flush(Instant::now()) {
                wait = wait.min(RETRY);
            }
            let has_more = std::mem::take(&mut self.has_more);
            match inputs.recv_timeout(if has_more { Duration::ZERO } else { wait }) {
                Ok(input) => {
                    self.take(input);
                    inputs.try_iter().take(AT_ONCE).for_each(|input| self.take(input));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if has_more {
                inputs.try_iter().take(INPUTS).for_each(|input| self.take(input));
            }
            let now = self.start.elapsed();
            if let Some(node) = &mut self.node {
                node.handle_timeout(now);
            }
            let mut state = self.shared.lock();
            state.turned = Instant::now();
            if let Some(client) = &mut state.client
                && client.poll_timeout().is_some_and(|due| due <= now)
            {
                client.handle_timeout(now);
            }
            drop(state);
            self.pump();
            for event in self.links.take_given_up() {
                self.link_event(event);
                self.pump();
            }
            self.look_for_server(now);
            self.look_for_leader(now);
            self.gauge.iter().for_each(|gauge| gauge.turned(Instant::now()));
            if self.count_at <= now {
                self.count_at = now + COUNT;
                self.count(self.links.totals());
            }
            if self.end.is_none() && self.release_by.is_some_and(|by| by <= now) {
                self.end = Some(Err(ProcessError::NotReleased { server: self.server, waited: RELEASE }));
            }
        }
        self.count(self.links.totals_now());
        let recorded = self.node.as_mut().map_or(Ok(()), RecordedNode::finish);
        let end = self.end.take().unwrap_or(Ok(())).and(recorded);
        let farewell = self.reason.as_ref().map(|reason| reason.text.clone());
        let reason = self.reason.take().unwrap_or_else(|| Reason::of_end(&end));
        let mut state = self.shared.lock();
        state.summary.seconds = self.start.elapsed().as_secs_f64();
        (state.end, state.farewell) = (Some(end), farewell);
        drop(state);
        self.shared.changed.notify_all();
        self.connections.end(reason);
    }

    /// Returns the node's view, and the last tick that is complete as far as known.
    fn reached(&self) -> (Option<u64>, Tick) {
        if let Some(node) = self.node.as_ref().map(RecordedNode::node) {
            return (node.view().map(|view| view.number.0), node.tick());
        }
        (None, self.shared.lock().client.as_ref().map_or(Tick(0), Client::tick))
    }

    /// Records the traffic of all links. This is not done after each tick, since it sums over as many links
    /// as there are clients.
    fn count(&self, traffic: NetTotals) {
        let totals = self.links.all_totals(traffic);
        let mut state = self.shared.lock();
        (state.traffic, state.received) = (totals.net.traffic, totals.received);
        state.summary.bytes = state.traffic.bytes_in + state.traffic.bytes_out;
        drop(state);
        if let (Some(gauge), Some(node)) = (&self.gauge, &self.node) {
            gauge.counted(node.node(), totals);
        }
    }

    /// Ends a process whose server is out of reach for too long. A process that waits without end reports
    /// that each minute.
    fn look_for_server(&mut self, now: Duration) {
        let Some(lost) = &mut self.lost else { return };
        if lost.is_to_be_told(now) {
            let (servers, waited_s) = (&self.servers, lost.lasted(now).as_secs());
            warn!(
                ?servers,
                waited_s,
                reason = lost.reason(),
                "still waiting for the server, and going on without it"
            );
        }
        if self.end.is_none()
            && let Some(waited) = lost.is_over(now)
        {
            let reason = lost.reason().to_owned();
            self.end = Some(Err(ProcessError::GivenUp { server: self.server, waited, reason }));
        }
    }

    /// Ends a client whose server names a leader that the client cannot reach for too long.
    fn look_for_leader(&mut self, now: Duration) {
        let leader =
            self.shared.lock().client.as_ref().and_then(Client::unheard_leader).map(|leader| leader.address);
        let Some(leader) = leader else {
            self.unheard = None;
            return;
        };
        // A new leader is waited for anew.
        if self.unheard_leader.replace(leader) != Some(leader) {
            self.unheard = None;
        }
        let limit = self.give_up;
        let unheard = self
            .unheard
            .get_or_insert_with(|| Absence::new(now, limit, "nothing is heard from it".to_owned()));
        if unheard.is_to_be_told(now) {
            let (waited_s, reason) = (unheard.lasted(now).as_secs(), unheard.reason());
            warn!(%leader, waited_s, reason, "still waiting for the node that tells of the world");
        }
        if self.end.is_none()
            && let Some(waited) = unheard.is_over(now)
        {
            let reason = unheard.reason().to_owned();
            self.end = Some(Err(ProcessError::LeaderUnreachable { leader, waited, reason }));
        }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let node = self.node.as_ref().and_then(RecordedNode::poll_timeout);
        let client = self.shared.lock().client.as_ref().and_then(Client::poll_timeout);
        let waits = [&self.lost, &self.unheard].into_iter().flatten();
        let end = waits.filter_map(Absence::poll_timeout);
        node.into_iter().chain(client).chain(end).min()
    }

    fn take(&mut self, input: Input) {
        if matches!(&input, Input::Net(held) if held.is_end()) {
            // What came over a link counts before the link's end.
            self.pump();
        }
        if self.end.is_some() {
            return;
        }
        match input {
            Input::Net(held) => {
                for event in self.links.translate(held.into_event()) {
                    self.link_event(event);
                }
            }
            Input::Client(event) => self.client(event),
            Input::Verified(event) => self.verified(event),
            Input::Wake => {}
            Input::Leave => {
                self.client(ClientEvent::Leave);
                match &mut self.node {
                    // Nobody has heard of it yet.
                    _ if !self.joined && self.lost.is_some() => self.end = Some(Ok(())),
                    Some(node) => {
                        let now = self.start.elapsed();
                        self.release_by.get_or_insert(now + RELEASE);
                        node.handle(now, NodeEvent::Leave);
                    }
                    None => {
                        self.pump();
                        self.end = Some(Ok(()));
                    }
                }
            }
        }
    }

    fn link_event(&mut self, event: LinkEvent) {
        let now = self.start.elapsed();
        match event {
            LinkEvent::Connected(peer, _) => {
                if peer == Peer::Server {
                    let was_joined = std::mem::replace(&mut self.joined, true);
                    let former = self.server;
                    let known = self.connections.list();
                    self.server = known
                        .into_iter()
                        .find(|known| known.who == PeerName::Server)
                        .map_or(former, |known| known.address);
                    if self.lost.take().is_some() && was_joined {
                        let server = self.server;
                        match server == former {
                            true => info!(%server, "the server is back"),
                            false => info!(%server, %former, "another server has taken over"),
                        }
                    }
                }
                if let Some(node) = &mut self.node {
                    node.handle(now, NodeEvent::Connected(peer));
                }
                if self.node.is_none() || peer == Peer::Server {
                    self.client(ClientEvent::Connected(peer));
                }
            }
            LinkEvent::Disconnected { peer, ending, is_unanswered, text: reason } => {
                if peer == Peer::Server {
                    let server = self.server;
                    let calls_again = self.joined || (is_unanswered && now < FIRST_LINK);
                    let end = match ending {
                        Some(Ending::Superseded) => Some(ProcessError::Superseded { server }),
                        Some(Ending::SentAway) => {
                            Some(ProcessError::SentAway { server, reason: reason.clone() })
                        }
                        Some(Ending::WorldEnded) => return self.world_ended(),
                        Some(Ending::Left) => return self.released(reason),
                        Some(Ending::Refused) => {
                            Some(ProcessError::ServerGone { server, reason: reason.clone() })
                        }
                        _ if !calls_again => {
                            Some(ProcessError::ServerGone { server, reason: reason.clone() })
                        }
                        _ => None,
                    };
                    if let Some(end) = end {
                        self.end = Some(Err(end));
                        return;
                    }
                    match &mut self.lost {
                        Some(lost) => lost.goes_on(reason),
                        None if !self.joined => {
                            warn!(%server, reason, "the server does not answer; calling it again");
                            self.lost = Some(Absence::new(now, None, reason));
                        }
                        None => {
                            warn!(%server, reason, "the server is out of reach; going on without it, and dialling it again");
                            self.lost = Some(Absence::new(now, self.give_up, reason));
                        }
                    }
                } else if let Some(unheard) = self.unheard.as_mut().filter(|_| self.node.is_none()) {
                    if unheard.reason() != reason {
                        warn!(
                            ?peer,
                            reason, "the node that tells of the world is out of reach; dialling it again"
                        );
                    }
                    unheard.goes_on(reason);
                } else {
                    debug!(?peer, reason, "a link is gone");
                }
                if let Some(node) = &mut self.node {
                    node.handle(now, NodeEvent::Disconnected(peer));
                }
                if self.node.is_none() || peer == Peer::Server {
                    self.client(ClientEvent::Disconnected(peer));
                }
            }
            LinkEvent::Message { from, message } => {
                let to_client =
                    self.node.is_none() || (from == Peer::Server && matches!(message, Message::ToClient(..)));
                match &mut self.node {
                    Some(node) if !to_client => node.handle(now, NodeEvent::Message { from, message }),
                    _ => self.client(ClientEvent::Message { from, message }),
                }
            }
        }
    }

    /// Sends a client, or a relay, what the fan-out does not send itself.
    fn tell(&mut self, Told { to, message }: Told) {
        let here = self.node.as_ref().map(|node| Peer::Node(node.node().id()));
        match message {
            Message::ToClient(_, message) if Some(to) == here => self.client(ClientEvent::Node(message)),
            // A peer without a link is dismissed soon.
            message if self.links.is_linked(to) => self.links.send(to, &message),
            _ => {}
        }
    }

    fn client(&mut self, event: ClientEvent) {
        let is_heard = matches!(event, ClientEvent::Message { .. } | ClientEvent::Node(_));
        let mut state = self.shared.lock();
        if is_update(&event) {
            state.updates += 1;
        }
        if let Some(client) = &mut state.client {
            client.handle(self.start.elapsed(), event);
        }
        drop(state);
        self.shared.changed.notify_all();
        if is_heard {
            self.connections.ring();
        }
    }

    /// Carries out the outputs of the state machines, until there are none or a tick is complete. A node that
    /// waits for nobody would otherwise never hear others.
    fn pump(&mut self) {
        let told = std::mem::take(&mut *self.told.lock().unwrap_or_else(PoisonError::into_inner));
        told.into_iter().for_each(|told| self.tell(told));
        self.carry_out();
        if let (Some(node), Some(fan_out)) = (&mut self.node, &self.fan_out)
            && !fan_out.handle(node.take_replication_events())
        {
            self.end.get_or_insert(Err(ProcessError::Fault));
        }
    }

    fn carry_out(&mut self) {
        self.has_more = false;
        while self.end.is_none() {
            let of_node =
                if self.has_more { None } else { self.node.as_mut().and_then(RecordedNode::poll_output) };
            if let Some(output) = of_node {
                self.has_more = matches!(output, NodeOutput::Settled(_));
                self.node_output(output);
                continue;
            }
            let output = self.shared.lock().client.as_mut().and_then(Client::poll_output);
            match output {
                Some(output) => self.client_output(output),
                None => return,
            }
        }
    }

    fn node_output(&mut self, output: NodeOutput) {
        match output {
            NodeOutput::Send { to, message } => {
                self.links.send(to, &message);
            }
            NodeOutput::Redial => self.redial(),
            NodeOutput::Connect(member) => self.links.dial(Peer::Node(member.node), &[member.address]),
            NodeOutput::Disconnect(node) => self.links.end(Peer::Node(node), Ending::NotAMember),
            NodeOutput::Physics(command) => self.compute(command),
            NodeOutput::Client(message) => self.client(ClientEvent::Node(message)),
            NodeOutput::Settled(tick) => {
                let mut state = self.shared.lock();
                state.summary.tick = tick;
                state.summary.seconds = self.start.elapsed().as_secs_f64();
                drop(state);
                self.shared.changed.notify_all();
            }
            NodeOutput::Stopped { farewell, reason } => {
                info!(reason, "the node stops");
                let server = self.server;
                match farewell {
                    Farewell::SentAway | Farewell::Refused => {
                        self.end = Some(Err(ProcessError::Evicted { server, reason }));
                    }
                    Farewell::Ended => self.world_ended(),
                    Farewell::Left => self.released(reason),
                }
            }
        }
    }

    /// Ends the process since the world has ended for all. That is no failure for a node without a client;
    /// clients must learn of it.
    fn world_ended(&mut self) {
        let (server, reason) = (self.server, WORLD_ENDED.to_owned());
        let plays = self.shared.lock().client.is_some();
        self.end = Some(if plays { Err(ProcessError::ServerGone { server, reason }) } else { Ok(()) });
        self.reason = Some(Reason::new(Cause::WorldEnded, WORLD_ENDED));
    }

    /// Ends the process in order, after others have taken the node's share. A user who has not asked to leave
    /// is told the reason.
    fn released(&mut self, reason: String) {
        self.end = Some(Ok(()));
        if self.release_by.is_none() {
            self.reason = Some(Reason::new(Cause::SentAway, reason));
        }
    }

    fn redial(&mut self) {
        self.links.dial(Peer::Server, &self.servers);
    }

    fn compute(&mut self, command: PhysicsCommand) {
        let tick = tick_of(&command);
        self.gauge.iter_mut().for_each(|gauge| gauge.begins(Instant::now(), &command));
        match self.device.run(command) {
            Ok(None) => {}
            Ok(Some(event)) => {
                if let PhysicsEvent::Settled { stats, .. } = &event {
                    if let (Some(node), Some(tick)) = (&mut self.node, tick) {
                        node.computed(self.start.elapsed(), tick, &self.device);
                    }
                    let summary = &mut self.shared.lock().summary;
                    summary.bodies = stats.bodies;
                    summary.regions = self.device.host().map_or(0, |host| host.regions().len());
                    summary.transfers += u64::from(stats.transfers);
                    summary.ghosts_sum += u64::from(stats.ghosts);
                    summary.exchanges_sum += u64::from(stats.exchanges);
                    summary.disagreement_max_m_s = summary.disagreement_max_m_s.max(stats.disagreement_m_s);
                    summary.last_us = stats.compute_us;
                    if summary.compute_us.len() < TIMES {
                        summary.compute_us.push(stats.compute_us);
                    }
                    if let (Some(onlooker), Some(host)) = (&mut self.onlooker, self.device.host()) {
                        onlooker(host, stats);
                    }
                }
                if let Some(gauge) = &mut self.gauge {
                    match (&event, &self.node, tick) {
                        (PhysicsEvent::Computed { .. }, ..) => gauge.computed(Instant::now()),
                        (PhysicsEvent::Settled { stats, .. }, Some(node), Some(tick)) => {
                            let regions = self.device.host().map_or(0, |host| host.regions().len());
                            gauge.settled(Instant::now(), tick, stats, regions, node.node());
                        }
                        _ => {}
                    }
                }
                if let PhysicsEvent::Speculated(_) = &event {
                    self.shared.lock().summary.speculative += 1;
                }
                if let Some(node) = &mut self.node {
                    node.handle(self.start.elapsed(), NodeEvent::Physics(event));
                }
            }
            Err(error) => self.end = Some(Err(error.into())),
        }
    }

    /// Takes in a result of the repeated computation of what another member computes.
    fn verified(&mut self, event: PhysicsEvent) {
        if let PhysicsEvent::Verified { event: Some(event), .. } = &event
            && let PhysicsEvent::Settled { .. } = **event
        {
            self.shared.lock().summary.verified += 1;
        }
        if let Some(node) = &mut self.node {
            node.handle(self.start.elapsed(), NodeEvent::Physics(event));
        }
    }

    fn client_output(&mut self, output: ClientOutput) {
        let mut state = self.shared.lock();
        match output {
            // All of a world may go and come again at once.
            ClientOutput::Inserted(id) => keep(2 * EVENTS, &mut state.changes, Presence::Appeared(id)),
            ClientOutput::Removed(id) => keep(2 * EVENTS, &mut state.changes, Presence::Disappeared(id)),
            ClientOutput::Rejected { body, reason } => keep(EVENTS, &mut state.refusals, (body, reason)),
            ClientOutput::Joined | ClientOutput::Lost => {}
            ClientOutput::WorldEnded => {
                drop(state);
                self.world_ended();
            }
            ClientOutput::Send { to, message } => self.links.send(to, &message),
            // A participant's node dials for both.
            ClientOutput::Redial if self.node.is_some() => {}
            ClientOutput::Redial => {
                drop(state);
                self.redial();
            }
            ClientOutput::Connect(member) => self.links.dial(Peer::Node(member.node), &[member.address]),
            ClientOutput::Disconnect(node) => self.links.end(Peer::Node(node), Ending::NotTheLeader),
            ClientOutput::Node(message) => {
                drop(state);
                if let Some(node) = &mut self.node {
                    node.handle(self.start.elapsed(), NodeEvent::Client(message));
                }
            }
        }
    }
}

/// Keeps an event for the user. Beyond `most` the oldest go first.
fn keep<T>(most: usize, events: &mut VecDeque<T>, event: T) {
    if events.len() == most {
        events.pop_front();
    }
    events.push_back(event);
}

fn is_update(event: &ClientEvent) -> bool {
    match event {
        ClientEvent::Message { message: Message::ToClient(_, ToClient::States { states, .. }), .. }
        | ClientEvent::Node(ToClient::States { states, .. }) => !states.is_empty(),
        ClientEvent::Message { message: Message::ToClient(_, ToClient::CompactStates { .. }), .. }
        | ClientEvent::Node(ToClient::CompactStates { .. }) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::net::{Authority, Identity, JoinRole, Limits, Net, NetConfig, NetEvent, NetEvents};
    use crate::runtime::{JoinConfig, Member, MemberConfig};

    const PATIENCE: Duration = Duration::from_secs(20);

    /// Starts the network of a server, which lets a process in.
    fn let_in(role: JoinRole) -> (Net, NetEvents, Identity, tempfile::TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
        let net = NetConfig {
            listen: "127.0.0.1:0".parse().unwrap(),
            identity: authority.server_identity().unwrap(),
            authority: Some(authority.clone()),
            renewed_by: Vec::new(),
            limits: Limits::default(),
        };
        let (net, events) = Net::start(net).unwrap();
        let now = std::time::SystemTime::now();
        let token = authority.issue_token(role, Duration::from_secs(60), now).unwrap();
        let join = JoinConfig::new(net.local_addr(), token.to_string());
        let identity = join.join(role).unwrap();
        (net, events, identity, folder)
    }

    /// Starts the network of a server, and a process that joins it.
    fn joined(role: JoinRole) -> (Net, NetEvents, Member, tempfile::TempDir) {
        let (net, events, identity, folder) = let_in(role);
        let member = Member::start(MemberConfig::new(net.local_addr(), identity)).unwrap();
        (net, events, member, folder)
    }

    #[test]
    fn who_is_sent_away_while_its_link_is_broken_is_told_when_it_dials_again() {
        for role in [JoinRole::Client, JoinRole::Node] {
            let (net, events, member, _folder) = joined(role);
            let NetEvent::Connected { peer, .. } = events.recv_timeout(PATIENCE).unwrap() else { panic!() };
            net.bar(member.who, "it cheats".to_owned());
            net.close(peer, Ending::TooSlow.code(), "as if it broke");
            assert!(member.wait_over(PATIENCE), "it dials on");
            let error = member.finish().unwrap_err();
            let is_told = matches!(&error, ProcessError::SentAway { reason, .. } if reason == "it cheats");
            assert!(is_told, "{error:?}");
        }
    }

    #[test]
    fn whose_first_call_gets_no_answer_calls_again() {
        for role in [JoinRole::Client, JoinRole::Node] {
            let (_net, _events, identity, _folder) = let_in(role);
            let deaf = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
            deaf.set_read_timeout(Some(PATIENCE)).unwrap();
            let member = Member::start(MemberConfig::new(deaf.local_addr().unwrap(), identity)).unwrap();
            let call = || {
                let mut packet = [0; 2_048];
                let length = deaf.recv(&mut packet).expect("no more calls");
                // RFC 8999, 5.1: a byte of flags, four of the version, the length of the receiver's id, the
                // id. A caller makes one up for each call.
                packet[6..length][..usize::from(packet[5])].to_vec()
            };
            let first = call();
            while call() == first {}
            assert!(!member.wait_over(Duration::ZERO), "{role:?}");
        }
    }

    #[test]
    fn of_events_that_nobody_takes_the_newest_are_kept() {
        let mut events = VecDeque::new();
        (0..EVENTS + 3).for_each(|event| keep(EVENTS, &mut events, event));
        assert_eq!((events.len(), events.front()), (EVENTS, Some(&3)));
    }

    #[test]
    fn a_server_that_lives_but_never_answers_does_not_keep_a_node() {
        let (_net, _events, node, _folder) = joined(JoinRole::Node);
        node.leave();
        assert!(node.wait_over(2 * RELEASE), "it must not wait for ever");
        let error = node.finish().unwrap_err();
        assert!(matches!(error, ProcessError::NotReleased { waited: RELEASE, .. }), "{error}");
    }
}
