//! Checks trials with several groups: places processes at sites, and checks that groups form and agree as
//! they should.

use std::collections::BTreeMap;
use std::time::Duration;

use super::Trial;
use crate::cluster::{Peer, Server};
use crate::sim::{Apart, Deviating};
use crate::space::{BodyId, ClientId, GroupId, NodeId};

/// The longest time that a body may be farther than the threshold from its place in its authoritative group,
/// or that a leader may be wrong about which group that is. It is longer than the time until such an error is
/// heard of and corrected.
const APART: Duration = Duration::from_secs(3);
/// The largest time that groups may be apart when all is calm: the delay from one to another, and the lead of
/// the main group.
const OUT_OF_STEP: Duration = Duration::from_millis(200);

impl Trial<'_> {
    /// Returns how many nodes there are to be.
    pub(super) fn wanted_nodes(&self) -> u32 {
        match self.sites {
            1 => self.population.unwrap_or(self.config.nodes),
            sites => sites * self.config.nodes.max(self.config.clients),
        }
    }

    /// Begins a node where one is missing, in one process with a client if one is missing.
    pub(super) fn begin_node(&mut self) -> NodeId {
        let site = |peer| self.sim.network.conditions.site(peer);
        let is_missing = |client: &&ClientId| self.sites > 1 && !self.sim.clients.contains_key(client);
        if let Some(&client) = self.clients.iter().find(is_missing) {
            return self.begin_participant(Some(client), site(Peer::Client(client))).0;
        }
        let nodes_at =
            |at: &u32| self.sim.nodes.keys().filter(|&&node| site(Peer::Node(node)) == *at).count();
        let fewest = (0..self.sites).min_by_key(nodes_at).unwrap_or_default();
        let node = self.sim.start_node();
        self.sim.place(Peer::Node(node), fewest);
        node
    }

    /// Begins a node with a client in its process.
    pub(super) fn begin_participant(&mut self, again: Option<ClientId>, site: u32) -> (NodeId, ClientId) {
        let (node, client) = self.sim.start_participant(again);
        self.spawned.remove(&client);
        self.inputs.remove(&client);
        for peer in [Peer::Node(node), Peer::Client(client)] {
            self.sim.place(peer, site);
        }
        (node, client)
    }

    /// Notes which bodies are near enough to their places in the authoritative group, and which leaders know
    /// which group that is.
    pub(super) fn compare_groups(&mut self) {
        let Some(server) = self.sim.server.as_ref().filter(|_| self.sites > 1) else { return };
        let leader = |node: NodeId| self.sim.nodes.get(&node).and_then(|process| process.machine.leader());
        let knows = |group: GroupId, node: NodeId, body: BodyId| {
            let is_authoritative = leader(node).is_some_and(|leader| leader.is_authoritative(body));
            ((group, body), is_authoritative == (group == server.authoritative(body)))
        };
        let bodies = || server.record().present().map(|body| body.id);
        let all =
            server.views().flat_map(|(group, view)| bodies().map(move |body| (group, view.leader, body)));
        self.known_at.note(self.sim.now, all.map(|(group, node, body)| knows(group, node, body)));
        let threshold_m = f64::from(self.sim.config.thresholds.between_groups_m);
        if let Some(Deviating { bodies, avatars, .. }) = self.comparer.compare(&mut self.sim).pop() {
            let near = |apart: &Apart| ((apart.group, apart.body), apart.by_m <= threshold_m);
            self.agreed_at.note(self.sim.now, bodies.iter().chain(&avatars).map(near));
        }
    }

    /// Returns in words why there is not one group at each site.
    pub(super) fn lacks_groups(&self, server: &Server) -> Option<String> {
        let site = |node| self.sim.network.conditions.site(Peer::Node(node));
        for (group, view) in server.views() {
            let mut sites = view.members.iter().map(|member| site(member.node));
            let first = sites.next();
            if sites.any(|site| Some(site) != first) {
                return Some(format!("members of {group} are far from one another"));
            }
        }
        let groups = server.views().count();
        (groups as u32 != self.sites).then(|| format!("there are {groups} groups at {} sites", self.sites))
    }

    /// Returns in words why groups are out of step, have different bodies or places of bodies, or do not know
    /// which group is authoritative.
    pub(super) fn lacks_agreement(&self, server: &Server) -> Option<String> {
        let main = server.main_group();
        let tick = |group| self.sim.checker.progress(group).map_or(0, |(_, tick)| tick.0);
        let most = (OUT_OF_STEP.as_secs_f32() / self.sim.config.dt_s) as u64;
        for (group, _) in server.views() {
            if tick(group).abs_diff(tick(main)) > most {
                return Some(format!("{group} has completed t{}, and {main} t{}", tick(group), tick(main)));
            }
            if self.sim.checker.bodies(group).ne(self.sim.checker.bodies(main)) {
                return Some(format!("{group} has other bodies than {main}"));
            }
        }
        if let Some((group, body, since)) = self.known_at.lost(self.sim.now) {
            return Some(format!(
                "since {since:.1?} {group} has not known which group is authoritative for {body}"
            ));
        }
        let (group, body, since) = self.agreed_at.lost(self.sim.now)?;
        Some(format!("since {since:.1?} {group} has had {body} elsewhere"))
    }
}

/// The times at which something was last true of each body in a group.
#[derive(Clone, Debug, Default)]
pub(super) struct Lately(BTreeMap<(GroupId, BodyId), Duration>);

impl Lately {
    /// Notes for which bodies it is true now. It counts as true so far for a new body. Bodies that are not
    /// named are forgotten.
    fn note(&mut self, now: Duration, all: impl Iterator<Item = ((GroupId, BodyId), bool)>) {
        let before = std::mem::take(&mut self.0);
        let last =
            |(key, holds): (_, bool)| (key, before.get(&key).copied().filter(|_| !holds).unwrap_or(now));
        self.0 = all.map(last).collect();
    }

    /// Returns a body for which it has not been true for too long, and since when.
    fn lost(&self, now: Duration) -> Option<(GroupId, BodyId, Duration)> {
        let lost = self.0.iter().find(|(_, at)| **at + APART < now);
        lost.map(|(&(group, body), &at)| (group, body, at))
    }
}
