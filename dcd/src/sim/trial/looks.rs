//! Looks at a trial at intervals: checks memberships, clocks, queues and timely recovery, measures staleness
//! and pauses, and replaces nodes that have ended.

use std::time::Duration;

use super::{Action, CALM, CALM_APART, LOOK, SLOWER, Trial};
use crate::cluster::{Peer, Server};
use crate::protocol::{BodyKind, BodyRecord, View};
use crate::sim::Violation;
use crate::sim::fixtures::as_fast;
use crate::space::{BodyId, ClientId, GroupId};

/// The longest time that members of a group may be cut off from one another: until their links end, they have
/// complained, and the server has acted.
const APART: Duration = Duration::from_secs(6);
/// The longest time until a client sees its avatar follow an input, when all is calm.
const OBEYED: Duration = Duration::from_millis(500);
/// The age above which a client's state of a moving body is too old when all is calm, ticks.
const FRESH_TICKS: u64 = 60;
/// The time after which clocks are known, because some pings have been answered.
const CLOCKS_KNOWN: Duration = Duration::from_secs(10);

/// A histogram of ages, in bins of a millisecond. The last bin is for all older ages.
#[derive(Clone, Debug)]
pub struct Staleness {
    bins: Vec<u32>,
}

/// The least number of bodies that are shared out evenly.
const FREE_BODIES: usize = 25;
/// The number of bodies that a slow node may own beyond its part by speed when all is calm. That part is one or
/// two bodies of forty, which come and go, and bodies are whole.
const SURPLUS: f64 = 1.0;
/// The number of the last looks, five seconds' worth, over which the surplus of a slow node is averaged.
const SURPLUS_OVER: usize = 100;

impl Default for Staleness {
    fn default() -> Self {
        Self { bins: vec![0; 4_096] }
    }
}

impl Staleness {
    fn add(&mut self, age: Duration) {
        let bin = (age.as_millis() as usize).min(self.bins.len() - 1);
        self.bins[bin] += 1;
    }

    /// Adds the ages of another run.
    pub fn merge(&mut self, other: &Self) {
        self.bins.iter_mut().zip(&other.bins).for_each(|(bin, other)| *bin += other);
    }

    /// Returns the age that this share of the looks does not exceed, milliseconds; `None` if nothing was
    /// looked at.
    pub fn quantile_ms(&self, share: f64) -> Option<u32> {
        let total: u64 = self.bins.iter().map(|&bin| u64::from(bin)).sum();
        let mut left = (total as f64 * share).ceil() as u64;
        let reaches = |&bin: &u32| {
            left = left.saturating_sub(bin.into());
            left == 0
        };
        (total > 0).then(|| self.bins.iter().position(reaches).map_or(u32::MAX, |bin| bin as u32))
    }
}

impl Trial<'_> {
    pub(super) fn look(&mut self) -> Result<(), Violation> {
        self.plan_in(LOOK, Action::Look);
        self.note_staleness();
        self.note_pause();
        self.note_balance();
        self.check_members()?;
        self.check_clocks()?;
        self.check_queues()?;
        self.replace_nodes();
        self.compare_groups();
        let now = self.sim.now;
        if let Some(since) = self.watch
            && self.hindered == 0
            && self.has_nodes()
            && since + self.promise.recovery < now
        {
            let lack = self.lacks_steadiness(since).unwrap_or_else(|| "no tick since".into());
            return Err(Violation::Slow { after: now - since, lack });
        }
        if self.watch.is_none() && self.hindered == 0 {
            let pause = now - self.ticked_at();
            if pause > self.promise.pause {
                let lack = "no tick since, though nothing had gone wrong".to_owned();
                return Err(Violation::Slow { after: pause, lack });
            }
        }
        let calm = if self.sites > 1 { CALM_APART } else { CALM };
        if let Some(since) = self.calm_since {
            match self.lack(since) {
                None if self.healed_at.is_none() => {
                    self.sim.note(|| "all is well".into());
                    self.healed_at = Some(now);
                }
                None => {}
                Some(lack) if since + calm < now => {
                    return Err(Violation::Unhealed { after: now - since, lack });
                }
                // Faults before the calm may still be noticed.
                Some(_) => self.healed_at = None,
            }
        }
        let is_calm = self.healed_at.is_some();
        self.sim.watch.iter_mut().for_each(|watch| watch.set_calm(is_calm));
        Ok(())
    }

    /// Returns when a tick of the main group was last checked. With one site, a tick of any group counts.
    fn ticked_at(&self) -> Duration {
        let main = self.sim.server.as_ref().filter(|_| self.sites > 1).map(|server| server.main_group());
        let of_main = main.and_then(|group| self.sim.checked_at.get(&group).copied());
        of_main.unwrap_or(self.progressed_at)
    }

    /// Returns in words what has kept the main group from computing on since a time, with all its members
    /// live. With several sites, every group that has a live member counts: a group of dead members keeps
    /// nobody waiting.
    pub(super) fn lacks_steadiness(&self, since: Duration) -> Option<String> {
        let Some(server) = &self.sim.server else { return Some("the server is dead".into()) };
        if server.view().is_none() {
            return Some("nobody computes the main group".into());
        }
        let lives = |view: &View| view.members.iter().any(|member| self.runs(Peer::Node(member.node)));
        let counts =
            |group: GroupId, view: &View| group == server.main_group() || self.sites > 1 && lives(view);
        let mut views = server.views().filter(|&(group, view)| counts(group, view));
        views.find_map(|(group, view)| self.lacks_ticks(group, view, since))
    }

    fn lacks_ticks(&self, group: GroupId, view: &View, since: Duration) -> Option<String> {
        for member in &view.members {
            if !self.runs(Peer::Node(member.node)) {
                return Some(format!("{} is dead or stopped, and a member of {group}", member.node));
            }
        }
        let number = self.sim.checker.progress(group).map(|(number, _)| number);
        let at = self.sim.checked_at.get(&group).copied().unwrap_or_default();
        if number != Some(view.number) || at < since {
            return Some(format!("{group} has completed no tick in view {}", view.number.0));
        }
        None
    }

    /// Returns in words the condition that does not hold once all is calm.
    fn lack(&self, since: Duration) -> Option<String> {
        let Some(server) = &self.sim.server else { return Some("the server is dead".into()) };
        let recently = since.max(self.sim.now.saturating_sub(Duration::from_millis(500)));
        if server.is_changing() {
            return Some("a membership changes".into());
        }
        if self.expected_nodes > 0 {
            return Some("a node is still to begin".into());
        }
        let members = |(_, view): (GroupId, &View)| view.members.clone();
        let members: Vec<_> = server.views().flat_map(members).map(|member| member.node).collect();
        if let Some(node) = self.sim.nodes.keys().find(|node| !members.contains(node)) {
            return Some(format!("{node} is a member of no group"));
        }
        let lack = self.lacks_groups(server);
        let lack =
            lack.or_else(|| server.views().find_map(|(group, view)| self.lacks_ticks(group, view, recently)));
        let lack = lack.or_else(|| self.lacks_balance(server));
        if let Some(lack) = lack.or_else(|| self.lacks_agreement(server)) {
            return Some(lack);
        }
        let movable = |body: &&BodyRecord| body.traits.kind != BodyKind::Fixed;
        let recorded = server.record().present().filter(movable).map(|body| body.id);
        if recorded.ne(self.sim.checker.bodies(server.main_group())) {
            return Some("the record lists other bodies than the world has".into());
        }
        let lack = self.clients.iter().find_map(|&client| self.lacks_avatar(server, client));
        lack.or_else(|| self.clients.iter().find_map(|&client| self.sim.lacks_body(client, FRESH_TICKS)))
    }

    /// Returns in words which node has nothing to do though regions follow the load, or too much for its
    /// speed.
    fn lacks_balance(&self, server: &Server) -> Option<String> {
        self.sim.config.balance?;
        let view = server.view()?;
        if view.allocation.len() != view.members.len() {
            return Some(format!("{} regions for {} nodes", view.allocation.len(), view.members.len()));
        }
        let idle =
            view.members.iter().find(|member| !view.allocation.values().any(|node| *node == member.node));
        if let Some(member) = idle {
            return Some(format!("{} has no region", member.node));
        }
        let (slow, surpluses) =
            self.slow_node.as_ref().filter(|(node, _)| self.sim.nodes.contains_key(node))?;
        let surplus = surpluses.iter().sum::<f64>() / surpluses.len().max(1) as f64;
        // A stack or a chain is one island, which is in one place as a whole.
        if self.sim.checker.bodies(server.main_group()).count() < FREE_BODIES {
            return None;
        }
        (surplus > SURPLUS).then(|| format!("{slow} owns {surplus:.1} bodies more than its part by speed"))
    }

    /// Notes how much a slow node has to do.
    fn note_balance(&mut self) {
        let Some((node, surpluses)) = &mut self.slow_node else { return };
        let Some(process) = self.sim.nodes.get(node) else { return };
        let part = 1.0 / ((self.sim.nodes.len() - 1) as f64 * SLOWER + 1.0);
        if surpluses.len() == SURPLUS_OVER {
            surpluses.pop_front();
        }
        let by_speed = self.sim.checker.owned() as f64 * part;
        surpluses.push_back(process.physics.claims().len() as f64 - by_speed);
    }

    fn lacks_avatar(&self, server: &Server, client: ClientId) -> Option<String> {
        let avatar = BodyId::avatar(client, 0);
        let Some(machine) = self.sim.clients.get(&client) else { return Some(format!("{client} is dead")) };
        if !machine.is_joined() {
            return Some(format!("{client} has not joined"));
        }
        let Some(view) = machine.body(avatar) else {
            return Some(format!("{client} does not see its avatar"));
        };
        if view.speculative {
            return Some(format!("what {client} sees is speculative"));
        }
        let group = machine.group().unwrap_or_else(|| server.main_group());
        let tick = self.sim.checker.progress(group).map_or(0, |(_, tick)| tick.0);
        if view.tick.0 + 30 < tick {
            return Some(format!("{client} sees its avatar as of {}, while it is t{tick}", view.tick));
        }
        match self.inputs.get(&client) {
            Some(&(at, _)) if self.sim.now < at + OBEYED => None,
            Some(&(_, input)) if !as_fast(input, view.body.state.velocity) => {
                Some(format!("the avatar of {client} does not move as it was told to"))
            }
            Some(_) => None,
            None => Some(format!("{client} has not been able to move its avatar")),
        }
    }

    /// Notes the ages of clients' states of their avatars. Speculative ticks do not count.
    fn note_staleness(&mut self) {
        // Ticks of several groups cannot be compared.
        for &client in self.clients.iter().filter(|_| self.sites == 1) {
            let avatar = BodyId::avatar(client, 0);
            let Some(machine) = self.sim.clients.get(&client).filter(|machine| machine.is_joined()) else {
                continue;
            };
            let (Some(view), Some(present)) = (machine.body(avatar), self.sim.state(avatar)) else {
                continue;
            };
            let seen = &view.body.state;
            let off = |axis: usize| (seen.pose.translation[axis] - present.pose.translation[axis]).abs();
            let faster = |axis: usize| (seen.velocity.linear[axis] - present.velocity.linear[axis]).abs();
            // States are compared up to their rounding.
            if (0..3).all(|axis| off(axis) <= 0.001 && faster(axis) <= 0.006) {
                self.staleness.add(Duration::ZERO);
            } else if let Some(&at) = self.settled_at.get(&view.settled_tick()) {
                self.staleness.add(self.sim.now - at);
            }
        }
    }

    fn note_pause(&mut self) {
        self.worst_pause = self.worst_pause.max(self.sim.now - self.progressed_at);
    }

    /// Plans a replacement for each node that has ended, as a supervisor would.
    fn replace_nodes(&mut self) {
        let missing = self.wanted_nodes().saturating_sub(self.sim.nodes.len() as u32 + self.expected_nodes);
        for _ in 0..missing {
            self.expected_nodes += 1;
            let pause = self.random.between_ms(100, 1_000);
            self.plan_in(pause, Action::Begin(Peer::Node(Default::default())));
        }
    }

    /// Checks that groups are cliques, as far as the server can know, and that no node was expelled without
    /// need.
    fn check_members(&mut self) -> Result<(), Violation> {
        if self.promise.no_eviction {
            let mut expelled = self.sim.expelled.iter().copied();
            if let Some(node) = expelled.find(|node| self.sim.nodes.contains_key(node)) {
                return Err(Violation::Expelled { node });
            }
        }
        let Some(server) = &self.sim.server else {
            self.apart.clear();
            return Ok(());
        };
        let now = self.sim.now;
        let mut apart = std::collections::BTreeMap::new();
        for (_, view) in server.views() {
            for (i, a) in view.members.iter().enumerate() {
                for b in &view.members[i + 1..] {
                    let (a, b) = (a.node, b.node);
                    let (at_a, at_b) = (Peer::Node(a), Peer::Node(b));
                    let known = self.reach(Peer::Server, at_a) || self.reach(Peer::Server, at_b);
                    if known && self.runs(at_a) && self.runs(at_b) && !self.reach(at_a, at_b) {
                        let since = self.apart.get(&(a, b)).copied().unwrap_or(now);
                        if since + APART < now {
                            return Err(Violation::NoClique { a, b, time: now - since });
                        }
                        apart.insert((a, b), since);
                    }
                }
            }
        }
        self.apart = apart;
        Ok(())
    }

    /// Checks that nodes' estimates of other clocks are within their bounds. The bound for the server's clock
    /// is tighter where it is promised.
    fn check_clocks(&self) -> Result<(), Violation> {
        let now = self.sim.now;
        let is_known = |peer| peer == Peer::Server && CLOCKS_KNOWN < now;
        for node in self.sim.nodes() {
            let own = &self.sim.hosts[&Peer::Node(node.id())];
            let local = own.clock.read(now);
            if own.stopped || !own.mailbox.is_empty() {
                continue;
            }
            for (&peer, host) in &self.sim.hosts {
                let clock = node.pinger().clock(local, peer);
                let linked = self.sim.network.is_linked(Peer::Node(node.id()), peer);
                let Some(clock) = clock.filter(|_| linked) else { continue };
                let true_us = host.clock.read(now).as_micros() as i64 - local.as_micros() as i64;
                let error_us = clock.offset_us - true_us;
                let bound_us = match self.promise.clock_error.filter(|_| is_known(peer)) {
                    Some(promised) => clock.error_us.min(promised.as_micros() as u64),
                    None => clock.error_us,
                };
                if error_us.unsigned_abs() > bound_us {
                    return Err(Violation::Clock { node: node.id(), error_us, bound_us });
                }
            }
        }
        Ok(())
    }

    fn check_queues(&self) -> Result<(), Violation> {
        let (traffic, bounds) = (self.sim.traffic(), self.sim.config.bounds);
        if self.promise.no_eviction && traffic.overflows > 0 {
            return Err(Violation::Overflow { links: traffic.overflows });
        }
        for (queue, held, bound) in [
            ("what a sender keeps", traffic.most_queued, bounds.queue_bytes),
            ("what a sender keeps for a client", traffic.most_queued_for_client, bounds.client_queue_bytes),
            ("what waits for a link", traffic.most_waiting, bounds.queue_bytes),
        ] {
            if held > bound {
                return Err(Violation::Queue { queue, held, bound });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::ClientEvent;
    use crate::protocol::{Message, ToClient};
    use crate::sim::faults::{Fault, Island, Moment, Planned, ProcessKind, Schedule, Victim, Ways};
    use crate::sim::{Bounds, FaultProfile, Sim, SimConfig, TrialConfig};

    #[test]
    fn all_is_well_only_while_clients_know_all_bodies() {
        let (config, profile) = (TrialConfig::default(), FaultProfile::None);
        let schedule = profile.schedule(1);
        let mut trial = Trial::new(&config, profile.promise(), 1, &schedule);
        trial.run().unwrap();
        let since = trial.calm_since.expect("it ends in a calm");
        assert_eq!(trial.lack(since), None);
        let (client, body) = (trial.clients[0], BodyId::persistent(3));
        let message = Message::ToClient(client, ToClient::Removed(body));
        trial.sim.submit(client, ClientEvent::Message { from: Peer::Server, message });
        assert_eq!(trial.lack(since), Some(format!("{client} does not see {body}")));
    }

    #[test]
    fn a_world_that_stands_still_without_a_fault_is_found() {
        let (config, profile) = (TrialConfig::default(), FaultProfile::None);
        let mut trial = Trial::new(&config, profile.promise(), 1, &profile.schedule(1));
        while trial.sim.now() < Duration::from_secs(5) {
            trial.step().unwrap();
        }
        let nodes: Vec<_> = trial.sim.nodes.keys().copied().collect();
        nodes.into_iter().for_each(|node| trial.sim.hang(Peer::Node(node)));
        let found = trial.run().unwrap_err();
        assert!(matches!(found, Violation::Slow { .. }), "{found}");
    }

    #[test]
    fn a_world_that_stands_still_while_a_client_is_cut_off_is_found() {
        let victim = Victim { role: ProcessKind::Client, pick: 0 };
        let fault =
            Fault::Cut { island: Island::One(victim), ways: Ways::Both, time: Duration::from_secs(30) };
        let cut = Planned { at: Duration::from_secs(3), moment: Moment::Any, fault };
        let profile = FaultProfile::None;
        let schedule =
            Schedule { faults: vec![cut], calm_at: Duration::from_secs(35), ..profile.schedule(1) };
        let config = TrialConfig::default();
        let mut trial = Trial::new(&config, profile.promise(), 1, &schedule);
        while trial.sim.now() < Duration::from_secs(5) {
            trial.step().unwrap();
        }
        let nodes: Vec<_> = trial.sim.nodes.keys().copied().collect();
        nodes.into_iter().for_each(|node| trial.sim.hang(Peer::Node(node)));
        let found = trial.run().unwrap_err();
        assert!(matches!(found, Violation::Slow { .. }), "{found}");
        assert!(trial.sim.now() < Duration::from_secs(15), "while the cut lasts: {:?}", trial.sim.now());
    }

    #[test]
    fn a_queue_that_is_too_small_is_found() {
        fn narrow(config: SimConfig) -> Sim {
            let bounds = Bounds { inbox_bytes: 256, client_queue_bytes: 256, ..config.bounds };
            Sim::new(SimConfig { bounds, ..config })
        }
        let config = TrialConfig { begin: narrow, ..TrialConfig::default() };
        let profile = FaultProfile::None;
        let found = Trial::new(&config, profile.promise(), 1, &profile.schedule(1)).run().unwrap_err();
        assert!(matches!(found, Violation::Overflow { .. }), "{found}");
    }

    #[test]
    fn a_quantile_is_the_age_that_its_share_is_not_older_than() {
        let mut ages = Staleness::default();
        assert_eq!(ages.quantile_ms(0.99), None);
        for ms in 1..=100 {
            ages.add(Duration::from_millis(ms));
        }
        assert_eq!((ages.quantile_ms(0.5), ages.quantile_ms(0.99)), (Some(50), Some(99)));
        ages.add(Duration::from_secs(60));
        assert_eq!(ages.quantile_ms(1.0), Some(4_095));
    }
}
