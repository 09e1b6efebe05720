//! Runs a simulated cluster event by event: takes the next event in time, gives it to its process, and
//! carries out the outputs.

use std::time::Duration;

use super::network::{Arrival, Delivery};
use super::world::{NodeProcess, Sim, name};
use super::{Random, Sample, Scope, Violation, records};
use crate::cluster::directory::Directory;
use crate::cluster::{
    Client, ClientEvent, ClientOutput, NodeEvent, NodeOutput, Peer, PhysicsCommand, PhysicsEvent, Server,
    ServerEvent, ServerOutput,
};
use crate::playback::ViewTime;
use crate::protocol::{
    BodyRecord, Chunk, DATAGRAM_BYTES, Finding, Message, ToClient, ToNode, ToServer, View, ViewNumber,
    decode, encode,
};
use crate::recording::{RecordedServer, digests_of, tick_of};
use crate::space::{BodyId, ClientId, GroupId, NodeId, Tick};

/// The most events at one instant. With more, a run is taken to go in circles.
const MOST_AT_ONCE: u32 = 100_000;

impl Sim {
    /// Executes the next event if there is one by `until`; otherwise the time becomes `until`. Returns
    /// whether there was one.
    pub(super) fn step(&mut self, until: Duration) -> bool {
        let network = self.network.next_time();
        let host = self.hosts.iter().filter_map(|(&peer, host)| Some((host.wake()?, peer))).min();
        let next = network.into_iter().chain(host.map(|(time, _)| time)).min();
        let Some(next) = next.filter(|&next| next <= until) else {
            self.now = self.now.max(until);
            return false;
        };
        if next > self.now {
            (self.now, self.at_once) = (next, 0);
        }
        self.events += 1;
        self.at_once += 1;
        assert!(self.at_once < MOST_AT_ONCE, "time stands still at {:?}: {host:?}", self.now);
        match host {
            Some((time, peer)) if network.is_none_or(|network| time < network) => self.wake(peer),
            _ => {
                self.network.step();
                self.deliver_all();
            }
        }
        true
    }

    pub(super) fn deliver_all(&mut self) {
        while let Some(delivery) = self.network.take() {
            self.deliver(delivery);
        }
    }

    /// Hands a process an arrival, or keeps it until the process can handle it.
    pub(super) fn deliver(&mut self, delivery: Delivery) {
        let now = self.now;
        let Some(host) = self.hosts.get_mut(&delivery.to) else { return };
        if host.is_occupied(now) {
            host.mailbox.push_back(delivery);
        } else {
            host.busy_until = now + host.cost;
            self.arrive(delivery);
        }
    }

    /// Lets a process act by itself: it reads its mailbox, or handles its timer.
    fn wake(&mut self, peer: Peer) {
        let now = self.now;
        let Some(host) = self.hosts.get_mut(&peer) else { return };
        host.busy_until = now + host.cost;
        let is_due = host.timer.is_some_and(|timer| timer <= now);
        if !host.mailbox.is_empty() && (!is_due || self.random.chance(0.5)) {
            if let Some(delivery) = host.mailbox.pop_front() {
                self.arrive(delivery);
            }
            return;
        }
        let local = host.clock.read(now);
        match peer {
            Peer::Server => {
                if let Some(server) = &mut self.server {
                    server.handle_timeout(local);
                }
                self.drain_server();
            }
            Peer::Node(node) => {
                if let Some(process) = self.nodes.get_mut(&node) {
                    process.recorder.iter_mut().for_each(|recorder| recorder.node_timeout(local));
                    process.machine.handle_timeout(local);
                }
                self.drain_node(node);
            }
            Peer::Client(id) => {
                if let Some(client) = self.clients.get_mut(&id) {
                    client.handle_timeout(local);
                }
                self.drain_client(id);
            }
        }
        self.set_timer(peer);
    }

    /// Asks a machine when it wants to be called next.
    pub(super) fn set_timer(&mut self, peer: Peer) {
        let local = match peer {
            Peer::Server => self.server.as_ref().and_then(|server| server.poll_timeout()),
            Peer::Client(id) => self.clients.get(&id).and_then(|client| client.poll_timeout()),
            Peer::Node(node) => self.nodes.get(&node).and_then(|process| process.machine.poll_timeout()),
        };
        if let Some(host) = self.hosts.get_mut(&peer) {
            host.timer = local.map(|local| host.clock.due(local));
        }
    }

    fn local(&self, peer: Peer) -> Duration {
        self.hosts.get(&peer).map_or(self.now, |host| host.clock.read(self.now))
    }

    fn arrive(&mut self, delivery: Delivery) {
        self.network.read(&delivery);
        let Delivery { to, link, arrival } = delivery;
        if link.is_some_and(|link| matches!(arrival, Arrival::Frame(..)) && !self.network.is_heard(to, link))
        {
            return;
        }
        if let Arrival::Disconnected(peer) = &arrival {
            let peer = *peer;
            self.note(|| format!("{} loses its link to {}", name(to), name(peer)));
        }
        let open = |bytes: Vec<u8>| decode(&bytes).expect("our own messages are valid");
        match to {
            Peer::Server => {
                let event = match arrival {
                    Arrival::Disconnected(peer) | Arrival::Unanswered(peer) => {
                        ServerEvent::Disconnected(peer)
                    }
                    Arrival::Frame(from, bytes, _) => ServerEvent::Message { from, message: open(bytes) },
                    Arrival::Connected(Peer::Client(client)) if self.builders.contains(&client) => {
                        ServerEvent::MayBuild(client)
                    }
                    Arrival::Connected(_) | Arrival::Physics(_) => return,
                };
                self.server_event(event);
            }
            Peer::Node(node) => {
                let event = match arrival {
                    Arrival::Connected(peer) => NodeEvent::Connected(peer),
                    Arrival::Disconnected(peer) | Arrival::Unanswered(peer) => NodeEvent::Disconnected(peer),
                    Arrival::Frame(from, bytes, _) => NodeEvent::Message { from, message: open(bytes) },
                    Arrival::Physics(event) => NodeEvent::Physics(*event),
                };
                self.node_event(node, event);
            }
            Peer::Client(client) => {
                let event = match arrival {
                    Arrival::Connected(peer) => ClientEvent::Connected(peer),
                    Arrival::Disconnected(peer) | Arrival::Unanswered(peer) => {
                        ClientEvent::Disconnected(peer)
                    }
                    Arrival::Frame(from, bytes, _) => ClientEvent::Message { from, message: open(bytes) },
                    Arrival::Physics(_) => return,
                };
                self.client_event(client, event);
            }
        }
    }

    pub(super) fn server_event(&mut self, event: ServerEvent) {
        let local = self.local(Peer::Server);
        let Some(server) = &mut self.server else { return };
        let witness = Witness::of(server, &event);
        server.handle(local, event);
        let seen = witness.map_or(Ok(()), |witness| witness.compare(server));
        self.violation = self.violation.take().or(seen.err());
        self.drain_server();
        self.set_timer(Peer::Server);
    }

    pub(super) fn node_event(&mut self, node: NodeId, event: NodeEvent) {
        let local = self.local(Peer::Node(node));
        if let Some(process) = self.nodes.get_mut(&node) {
            process.recorder.iter_mut().for_each(|recorder| recorder.node_event(local, &event));
            process.machine.handle(local, event);
            self.drain_node(node);
            self.set_timer(Peer::Node(node));
        }
    }

    pub(super) fn client_event(&mut self, id: ClientId, event: ClientEvent) {
        let local = self.local(Peer::Client(id));
        let Some(client) = self.clients.get_mut(&id) else { return };
        client.handle(local, event);
        let told = self.checker.told(client);
        self.violation = self.violation.take().or(told.err());
        self.drain_client(id);
        self.set_timer(Peer::Client(id));
    }

    /// Returns the ticks that a live client would show now.
    pub fn view_time(&mut self, id: ClientId) -> Option<ViewTime> {
        let local = self.local(Peer::Client(id));
        let time = self.clients.get_mut(&id)?.view_time(local);
        self.set_timer(Peer::Client(id));
        time
    }

    /// Returns the tick that the world is at, by its leader's own clock. The fraction is the time since the
    /// tick was opened.
    pub fn world_tick(&self) -> Option<f64> {
        let (&id, (tick, opened, dt)) =
            self.nodes.iter().find_map(|(id, process)| Some((id, process.machine.opened()?)))?;
        let since = self.local(Peer::Node(id)).saturating_sub(opened);
        Some(tick.0 as f64 + since.as_secs_f64() / dt.as_secs_f64())
    }

    fn drain_client(&mut self, id: ClientId) {
        while let Some(output) = self.clients.get_mut(&id).and_then(Client::poll_output) {
            match output {
                ClientOutput::Send { to, message } => self.send(Peer::Client(id), to, message),
                ClientOutput::Connect(member) => {
                    self.network.dial(self.now, Peer::Client(id), Peer::Node(member.node));
                }
                ClientOutput::Disconnect(node) => {
                    self.network.close(self.now, Peer::Client(id), Peer::Node(node));
                }
                ClientOutput::Node(message) => {
                    let with_client = |(_, process): &(&NodeId, &NodeProcess)| process.client == Some(id);
                    if let Some((&node, _)) = self.nodes.iter().find(with_client) {
                        self.node_event(node, NodeEvent::Client(message));
                    }
                }
                ClientOutput::Redial => self.network.dial(self.now, Peer::Client(id), Peer::Server),
                other => self.told.push((id, other)),
            }
        }
    }

    fn send(&mut self, from: Peer, to: Peer, mut message: Message) {
        match &mut message {
            Message::Border(border) => {
                if self.liar.is_some_and(|(a, b)| (Peer::Node(a), Peer::Node(b)) == (from, to)) {
                    let states = border.messages.iter_mut().flat_map(|message| &mut message.states);
                    states.for_each(|state| state.velocity.linear[1] += 1.0);
                }
                for transfers in border.messages.iter_mut().map(|message| &mut message.transfers) {
                    while self.drop_transfers > 0 && transfers.pop().is_some() {
                        self.drop_transfers -= 1;
                    }
                    self.tally.transfers += transfers.len() as u64;
                    if let Some(spoilt) = self.spoilt {
                        let dt_s = self.config.dt_s;
                        transfers
                            .iter_mut()
                            .for_each(|transfer| spoilt.spoil(&mut transfer.body.state, dt_s));
                    }
                }
                if let (Peer::Node(from), Peer::Node(to)) = (from, to) {
                    self.checker.sends(from, to, border);
                }
            }
            Message::ToNode(ToNode::Finish { survivors, .. }) => self.finishes(to, survivors),
            Message::ToNode(ToNode::Chunk(Chunk::Placed(placed))) => {
                if let Some(spoilt) = self.spoilt {
                    placed.iter_mut().for_each(|placed| spoilt.spoil_recovered(&mut placed.body.state));
                }
            }
            _ => {}
        }
        let bytes = encode(&message);
        let sent = self.sent.entry(Scope::of(&message)).or_default();
        (sent.messages, sent.bytes) = (sent.messages + 1, sent.bytes + bytes.len() as u64);
        if let Message::ToClient(_, ToClient::States { .. } | ToClient::CompactStates { .. }) = message {
            assert!(bytes.len() <= DATAGRAM_BYTES, "a datagram of {} bytes", bytes.len());
        }
        self.network.send(self.now, from, to, message.lane(), bytes);
    }

    /// Notes that a member is told to complete its last tick, perhaps without other members.
    fn finishes(&mut self, to: Peer, survivors: &[NodeId]) {
        let Peer::Node(node) = to else { return };
        let Some(view) = self.nodes.get(&node).and_then(|process| process.machine.view()) else { return };
        if view.members.iter().any(|member| !survivors.contains(&member.node)) {
            self.checker.crippled(view.number);
        }
    }

    pub(super) fn drain_server(&mut self) {
        while let Some(output) = self.server.as_mut().and_then(RecordedServer::poll_output) {
            match &mut self.crash_after_store {
                Some(0) => {
                    self.crash_after_store = None;
                    self.server_crashed = true;
                    return self.crash(Peer::Server);
                }
                Some(left) if self.has_stored => *left -= 1,
                _ => {}
            }
            match output {
                ServerOutput::Store(batch) => {
                    self.has_stored |= batch.durable;
                    self.disk.commit(&batch, &[]).expect("memory can be written");
                }
                ServerOutput::Send { to, message } => self.send(Peer::Server, to, message),
                ServerOutput::Close { peer, .. } => self.network.close(self.now, Peer::Server, peer),
                ServerOutput::Began { group, view } => self.began(group, &view),
                ServerOutput::Repartitioned { group, view } => self.note(|| {
                    let (regions, owners) = (view.allocation.len(), view.allocation.values());
                    let nodes = owners.collect::<std::collections::BTreeSet<_>>().len();
                    format!("{group} has {regions} regions at {nodes} nodes")
                }),
                ServerOutput::Held { group, tick } => {
                    self.note(|| format!("the record holds the world of {group} after {tick}"));
                }
                ServerOutput::Dissolved(group) => {
                    self.leaders.remove(&group);
                    self.note(|| format!("{group} is no more"));
                }
                ServerOutput::Expelled(node) | ServerOutput::Moved(node) => {
                    self.tally.evictions += 1;
                    // A member that was alone is parted from nobody.
                    if self.company.get(&node).is_some_and(|&size| size > 1) {
                        self.expelled.push(node);
                    }
                    self.note(|| format!("{node} is expelled"));
                }
                ServerOutput::Unreached(node) => self.note(|| format!("{node} is not reached by all")),
                ServerOutput::Verdict { node, tick, finding } => {
                    self.findings.push((node, tick, finding));
                    let is_honest = self.flipped.is_none() && self.liar.is_none();
                    if is_honest && !matches!(finding, Finding::GivenUp(_)) {
                        self.violation.get_or_insert(Violation::Accused { node, tick });
                    }
                    self.note(|| format!("{node} is judged by {tick}: {finding:?}"));
                }
                ServerOutput::Saved(saved) => {
                    self.note(|| format!("the world is saved after {}", saved.tick));
                    self.saved = Some(saved);
                }
                ServerOutput::Audited(_)
                | ServerOutput::Answered { .. }
                | ServerOutput::Contacts(_)
                | ServerOutput::Ended
                | ServerOutput::Suspended => {}
            }
        }
        self.has_stored = false;
    }

    fn began(&mut self, group: GroupId, view: &View) {
        self.tally.views += 1;
        if self.leaders.insert(group, view.leader).is_some_and(|former| former != view.leader) {
            self.tally.elections += 1;
        }
        self.checker.began(group, view.number);
        self.company.extend(view.members.iter().map(|member| (member.node, view.members.len())));
        self.note(|| {
            let members: Vec<_> = view.members.iter().map(|member| member.node.to_string()).collect();
            let (number, tick, leader) = (view.number.0, view.tick, view.leader);
            format!("{group} begins view {number} after {tick}, led by {leader}: {}", members.join(" "))
        });
    }

    /// Disturbs a node that has completed a tick, if that is asked for, and records what it has computed.
    fn computed(&mut self, id: NodeId, tick: Tick) {
        let local = self.local(Peer::Node(id));
        let Some(process) = self.nodes.get_mut(&id) else { return };
        if self.flip_at.is_some_and(|(node, from)| node == id && from <= tick) && self.flipped.is_none() {
            // Its own source of randomness leaves the rest of the run as it would be without.
            let mut random = Random::new(self.config.seed ^ tick.0);
            self.flipped = records::flip(&mut *process.physics, id, tick, &mut random);
        }
        if let Some(recorder) = &mut process.recorder {
            recorder.settled(local, tick, &digests_of(&*process.physics));
        }
    }

    fn drain_node(&mut self, id: NodeId) {
        while let Some(process) = self.nodes.get_mut(&id) {
            let Some(output) = process.machine.poll_output() else { return };
            match output {
                NodeOutput::Send { to, message } => self.send(Peer::Node(id), to, message),
                NodeOutput::Redial => self.network.dial(self.now, Peer::Node(id), Peer::Server),
                NodeOutput::Connect(member) => {
                    self.network.dial(self.now, Peer::Node(id), Peer::Node(member.node));
                }
                NodeOutput::Disconnect(node) => {
                    self.network.close(self.now, Peer::Node(id), Peer::Node(node));
                }
                NodeOutput::Physics(command) => {
                    if matches!(command, PhysicsCommand::World(_)) {
                        self.checker.forget_node(id);
                    }
                    let tick = tick_of(&command);
                    let answer = process.physics.execute(command).expect("what is simulated fits");
                    if let (Some(tick), Some(PhysicsEvent::Settled { .. })) = (tick, &answer) {
                        self.computed(id, tick);
                    }
                    let Some(process) = self.nodes.get_mut(&id) else { return };
                    if let Some(mut event) = answer {
                        let times =
                            self.slow_node.filter(|(slow, _)| *slow == id).map_or(1.0, |(_, times)| times);
                        if let PhysicsEvent::Settled { load: Some(load), .. } = &mut event {
                            load.regions.iter_mut().for_each(|region| region.step_us *= times);
                        }
                        let takes = self.config.physics.draw(&mut self.random).mul_f64(times);
                        let (until, takes) = match &event {
                            PhysicsEvent::Verified { run, .. } => {
                                let until = process.verified_until.entry(*run).or_default();
                                (until, takes.mul_f64(self.slow_verifier))
                            }
                            _ => (&mut process.physics_until, takes),
                        };
                        let time = self.now.max(*until) + takes;
                        *until = time;
                        self.network.physics(time, id, event);
                    }
                }
                NodeOutput::Settled(tick) => {
                    let view = process.machine.view().expect("only members complete ticks");
                    if self.sample_every.is_some_and(|every| tick.0.is_multiple_of(every)) {
                        self.samples.push(Sample::of(self.now, id, view, tick, &*process.physics));
                    }
                    if let Some(watch) = &mut self.watch {
                        let sample = Sample::of(self.now, id, view, tick, &*process.physics);
                        self.violation = self.violation.take().or(watch.settled(sample).err());
                    }
                    let before = self.checker.checked();
                    let checked = self.checker.settled(id, view, tick, &*process.physics);
                    self.violation = self.violation.take().or(checked.err());
                    if self.checker.checked() > before
                        && let Some(group) = self.checker.group_of(view.number)
                    {
                        self.checked_at.insert(group, self.now);
                    }
                }
                NodeOutput::Client(message) => {
                    if let Some(client) = process.client {
                        self.client_event(client, ClientEvent::Node(message));
                    }
                }
                NodeOutput::Stopped { reason, .. } => {
                    self.note(|| format!("{id} ends: {reason}"));
                    self.end(Peer::Node(id));
                }
            }
        }
    }
}

/// The record of bodies that a stale message must not change.
struct Witness {
    node: NodeId,
    view: ViewNumber,
    before: Vec<(BodyId, Option<BodyRecord>)>,
}

impl Witness {
    /// Notes the bodies of a checkpoint whose view is not, or no longer, one of the server's.
    fn of(server: &Server, event: &ServerEvent) -> Option<Self> {
        let ServerEvent::Message { from: Peer::Node(node), message: Message::ToServer(message) } = event
        else {
            return None;
        };
        let ToServer::Checkpoint { view, bodies, .. } = message else { return None };
        if server.views().any(|(_, present)| present.number == *view) {
            return None;
        }
        let of = |id| (id, server.record().body(id).cloned());
        Some(Self { node: *node, view: *view, before: bodies.iter().map(|body| of(body.id)).collect() })
    }

    fn compare(self, server: &Server) -> Result<(), Violation> {
        let (node, view) = (self.node, self.view);
        let is_changed = |(id, before): &(BodyId, Option<BodyRecord>)| {
            let after = server.record().body(*id);
            after.zip(before.as_ref()).is_some_and(|(after, before)| after.state != before.state)
        };
        match self.before.iter().find(|entry| is_changed(entry)) {
            Some(&(body, _)) => Err(Violation::StaleCommit { node, view, body }),
            None => Ok(()),
        }
    }
}
