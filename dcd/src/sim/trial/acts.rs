//! Executes the actions of a trial: faults and their ends, and the actions of users.

use std::time::Duration;

use super::{Action, Armed, Island, PATIENCE, Trial, calm};
use crate::cluster::{ClientEvent, Peer, ServerEvent};
use crate::protocol::Velocity;
use crate::sim::faults::{Fault, Island as Cutoff, Moment, ProcessKind, Victim, Ways};
use crate::sim::{Cut, Violation, sim_body};
use crate::space::{BodyId, ClientId, NodeId};

impl Trial<'_> {
    pub(super) fn act(&mut self, action: Action) -> Result<(), Violation> {
        match action {
            Action::Arm(planned) => {
                if matches!(planned.moment, Moment::Changing(_)) {
                    self.stir();
                }
                self.armed.push(Armed { planned, until: self.sim.now + PATIENCE, left: None });
            }
            Action::Begin(Peer::Node(_)) => {
                self.expected_nodes -= 1;
                if !self.has_nodes() {
                    self.disturbed();
                }
                let node = self.begin_node();
                self.sim.note(|| format!("{node} begins"));
            }
            Action::Begin(Peer::Server) => {
                if !self.sim.has_server() {
                    self.sim.restart_server();
                }
            }
            Action::Begin(Peer::Client(client)) => {
                if !self.sim.clients.contains_key(&client) {
                    self.sim.note(|| format!("{client} begins again"));
                    self.spawned.remove(&client);
                    self.inputs.remove(&client);
                    self.sim.start_client(Some(client));
                }
            }
            Action::Resume(peer) => {
                if self.sim.hosts.get(&peer).is_some_and(|host| host.stopped) {
                    self.sim.resume(peer);
                }
                self.relieved(peer == Peer::Server);
            }
            Action::Hasten(peer) => {
                self.sim.slow(peer, Duration::ZERO);
                self.relieved(self.hinders(peer));
            }
            Action::Healed(hindered) => {
                self.sim.note(|| "a cut is over".into());
                self.relieved(hindered);
            }
            Action::Doom => {
                if let Some(back_after) = self.doomed.take() {
                    self.sim.crash_after_store = None;
                    self.sim.crash(Peer::Server);
                    self.died(Peer::Server, back_after);
                }
            }
            Action::Populate(count) => self.populate(count),
            Action::Save if self.runs(Peer::Server) => self.sim.order(ServerEvent::Save),
            Action::Restore if self.runs(Peer::Server) => {
                if let Some(saved) = self.sim.saved.clone() {
                    self.sim.note(|| format!("the world goes back to {}", saved.tick));
                    self.sim.order(ServerEvent::Replace(saved));
                    self.disturbed();
                }
            }
            // The program stops with its server.
            Action::Save | Action::Restore => {}
            Action::Use(client) => self.use_client(client),
            Action::Look => self.look()?,
            Action::Plant => {
                self.sim.drop_transfers(self.config.lost_transfers);
                self.config.spoilt.into_iter().for_each(|how| self.sim.spoil_transfers(how));
            }
            Action::Calm if self.hindered > 0 || !self.armed.is_empty() => {
                self.plan_in(Duration::from_millis(100), Action::Calm);
            }
            Action::Calm => {
                self.sim.note(|| "all is calm".into());
                if self.sites == 1 {
                    self.sim.set_network(calm());
                }
                self.calm_since = Some(self.sim.now);
            }
        }
        Ok(())
    }

    /// Ends a fault.
    fn relieved(&mut self, hindered: bool) {
        if hindered {
            self.hindered -= 1;
        }
        self.disturbed();
    }

    /// Executes a fault.
    pub(super) fn happen(&mut self, fault: Fault) {
        match fault {
            Fault::Cut { island, ways, time } => self.cut(island, ways, time),
            Fault::Kill { victim, back_after } => self.kill(victim, back_after),
            Fault::Stop { victim, time } => {
                let Some(peer) = self.find(victim) else { return };
                if self.sim.hosts[&peer].stopped {
                    return;
                }
                self.sim.stop(peer);
                self.hindered += u32::from(peer == Peer::Server);
                self.disturbed();
                self.plan_in(time, Action::Resume(peer));
            }
            Fault::Slow { victim, cost, time } => {
                let Some(peer) = self.find(victim) else { return };
                self.sim.slow(peer, cost);
                self.hindered += u32::from(self.hinders(peer));
                self.plan_in(time, Action::Hasten(peer));
            }
        }
    }

    /// Returns the process that a victim names, if there is one.
    fn find(&self, victim: Victim) -> Option<Peer> {
        let nodes: Vec<NodeId> = self.sim.nodes.keys().copied().collect();
        let node = || Some(Peer::Node(*nodes.get(victim.pick as usize % nodes.len().max(1))?));
        match victim.role {
            ProcessKind::Server => self.sim.server.is_some().then_some(Peer::Server),
            ProcessKind::Leader => {
                let leaders = self.sim.server.iter().flat_map(|server| server.views());
                let leaders: Vec<_> = leaders
                    .map(|(_, view)| view.leader)
                    .filter(|leader| self.sim.nodes.contains_key(leader))
                    .collect();
                let leader = leaders.get(victim.pick as usize % leaders.len().max(1));
                leader.map(|&leader| Peer::Node(leader)).or_else(node)
            }
            ProcessKind::Member => node(),
            ProcessKind::Client => {
                let clients: Vec<_> = self.sim.clients.keys().copied().collect();
                Some(Peer::Client(*clients.get(victim.pick as usize % clients.len().max(1))?))
            }
        }
    }

    fn kill(&mut self, victim: Victim, back_after: Duration) {
        let Some(peer) = self.find(victim) else { return };
        let peer = match peer {
            // Half of the time the server is made to die between storing and sending.
            Peer::Server if victim.pick.is_multiple_of(2) => {
                self.sim.crash_after_store((victim.pick / 2 % 8) as u32);
                self.stir();
                self.doomed = Some(back_after);
                return self.plan_in(PATIENCE, Action::Doom);
            }
            peer => peer,
        };
        self.sim.crash(peer);
        self.died(peer, back_after);
    }

    /// Notes that a process is dead, and schedules its successor.
    pub(super) fn died(&mut self, peer: Peer, back_after: Duration) {
        self.expected_nodes += u32::from(matches!(peer, Peer::Node(_)));
        self.disturbed();
        self.plan_in(back_after, Action::Begin(peer));
    }

    fn cut(&mut self, island: Cutoff, ways: Ways, time: Duration) {
        let until = self.sim.now + time;
        let nodes: Vec<NodeId> = self.sim.nodes.keys().copied().collect();
        let at = |pick: u64, step: u64| {
            (!nodes.is_empty()).then(|| Peer::Node(nodes[(pick.wrapping_add(step)) as usize % nodes.len()]))
        };
        let peers: Island = match island {
            Cutoff::One(victim) => self.find(victim).into_iter().collect(),
            Cutoff::Nodes { pick, count, with_server } => {
                let nodes = (0..count).filter_map(|step| at(pick, step));
                nodes.chain(with_server.then_some(Peer::Server)).collect()
            }
            Cutoff::Pair(pick) => at(pick, 0).into_iter().chain(at(pick, 1)).collect(),
        };
        let cuts = match (island, peers.iter().next().zip(peers.iter().nth(1))) {
            (Cutoff::Pair(_), None) => return,
            (Cutoff::Pair(_), Some((&a, &b))) => Cut::between(a, b, until),
            _ => Cut::partition(peers.clone(), until),
        };
        let [out, into] = cuts;
        let names: Vec<_> = peers.iter().map(|&peer| crate::sim::world::name(peer)).collect();
        let from = if matches!(island, Cutoff::Pair(_)) { "each other" } else { "all others" };
        self.sim.note(|| {
            format!("{} cut off from {from} for {} ms, {ways:?}", names.join(", "), time.as_millis())
        });
        if ways != Ways::In {
            self.sim.cut(out);
        }
        if ways != Ways::Out {
            self.sim.cut(into);
        }
        let hinders = peers.iter().any(|&peer| self.hinders(peer));
        self.hindered += u32::from(hinders);
        self.plan(until, Action::Healed(hinders));
    }

    /// Sets how many nodes there are to be. Surplus nodes leave; the next look lets missing ones begin.
    fn populate(&mut self, count: u32) {
        self.population = Some(count);
        let nodes: Vec<_> = self.sim.nodes.keys().copied().collect();
        let runs = |node: &NodeId| !self.sim.hosts[&Peer::Node(*node)].stopped;
        let many = (nodes.len() as u32 + self.expected_nodes).saturating_sub(count) as usize;
        let leaving: Vec<_> = nodes.into_iter().rev().filter(runs).take(many).collect();
        for node in leaving {
            self.sim.note(|| format!("{node} is to leave"));
            self.sim.leave(node);
        }
    }

    /// Lets a node join or leave, so that a view change begins.
    fn stir(&mut self) {
        let nodes: Vec<_> = self.sim.nodes.keys().copied().collect();
        if nodes.len() as u32 + self.expected_nodes <= self.wanted_nodes() {
            let node = self.begin_node();
            self.sim.note(|| format!("{node} begins, one more"));
        } else if let Some(node) = self.random.pick(&nodes)
            && self.sim.nodes[&node].client.is_none()
            && !self.sim.hosts[&Peer::Node(node)].stopped
        {
            self.sim.note(|| format!("{node} inputs to leave"));
            self.sim.leave(node);
        }
    }

    /// Lets a user have an avatar, and move it about.
    fn use_client(&mut self, client: ClientId) {
        if self.healed_at.is_some() {
            return;
        }
        // An avatar that turns all the time is nowhere near where other groups extrapolate it. In the calm
        // users let groups catch up.
        let lets_settle = self.sites > 1 && self.calm_since.is_some();
        let (least, most) = if lets_settle { (2_000, 4_000) } else { (300, 1_200) };
        let pause = self.random.between_ms(least, most);
        self.plan_in(pause, Action::Use(client));
        let is_stopped = self.sim.hosts.get(&Peer::Client(client)).is_none_or(|host| host.stopped);
        let Some(machine) = self.sim.clients.get(&client).filter(|client| client.is_joined()) else { return };
        if is_stopped {
            return;
        }
        let avatar = BodyId::avatar(client, 0);
        if machine.body(avatar).is_none() {
            // The avatar is asked for only once, because the request is kept until it is answered.
            if self.spawned.insert(client) {
                let place = [self.random.unit() * 16.0, 4.0, 4.0];
                self.sim
                    .submit(client, ClientEvent::Spawn { body: sim_body(avatar, place), shapes: Vec::new() });
            }
            return;
        }
        let mut linear: [f32; 3] = std::array::from_fn(|_| (self.random.unit() * 10.0 - 5.0) as f32);
        if linear.iter().map(|v| v * v).sum::<f32>() < 1.0 {
            // A body that drifts on slower than 0.8 m/s falls asleep.
            linear[0] += 2.0;
        }
        let velocity = Velocity { linear, angular: [0.0; 3] };
        self.inputs.insert(client, (self.sim.now, velocity));
        self.sim.submit(
            client,
            ClientEvent::Input { body: avatar, tick: crate::space::Tick(0), velocity, pose: None },
        );
    }
}

impl Trial<'_> {
    /// Returns whether the world may wait for a process. It never waits for a client, unless the client's
    /// process computes too.
    fn hinders(&self, peer: Peer) -> bool {
        self.sites > 1 || !matches!(peer, Peer::Client(_))
    }

    /// Returns whether packets pass between two processes, both ways.
    pub(super) fn reach(&self, a: Peer, b: Peer) -> bool {
        let network = &self.sim.network;
        network.passes(self.sim.now, a, b) && network.passes(self.sim.now, b, a)
    }

    /// Returns whether any node lives and is not stopped. Without one, nothing recovers.
    pub(super) fn has_nodes(&self) -> bool {
        self.sim.nodes.keys().any(|&node| self.runs(Peer::Node(node)))
    }

    /// Returns whether a process lives and is not stopped.
    pub(super) fn runs(&self, peer: Peer) -> bool {
        self.sim.hosts.get(&peer).is_some_and(|host| !host.stopped)
    }
}
