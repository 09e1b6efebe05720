//! Tells operators the status of the world when they ask: which nodes are members of which group, and which
//! node computes which regions.

use std::collections::BTreeMap;
use std::time::Duration;

use super::common::NodeEntry;
use super::group::Group;
use super::{Server, ServerOutput};
use crate::cluster::Peer;
use crate::fidelity::FidelityReport;
use crate::protocol::{BodyKind, GroupStatus, Message, NodeStatus, RegionStatus, Status, View};
use crate::space::{NodeId, RegionId};

/// The least time between two answers to one peer. A question that comes sooner is not answered.
const APART: Duration = Duration::from_millis(100);
/// How long an answer serves other peers that ask: making one counts all bodies.
const FRESH: Duration = Duration::from_millis(250);

/// The latest answers.
#[derive(Clone, Debug, Default)]
pub(super) struct Statuses {
    /// The time at which each linked peer was last answered.
    told: BTreeMap<Peer, Duration>,
    newest: Option<(Duration, Status)>,
}

impl Statuses {
    /// Forgets a peer whose link is gone.
    pub(super) fn forget(&mut self, peer: Peer) {
        self.told.remove(&peer);
    }
}

impl Server {
    /// Answers a peer that asks for the status of the world. The peer need not have joined the world.
    pub(super) fn tell_status(&mut self, to: Peer) {
        let now = self.common.now;
        if self.statuses.told.get(&to).is_some_and(|&told| now < told + APART) {
            self.common.stale += 1;
            return;
        }
        self.statuses.told.insert(to, now);
        let fresh = self.statuses.newest.take().filter(|&(at, _)| now < at + FRESH);
        let (at, mut status) = fresh.unwrap_or_else(|| (now, self.status()));
        self.statuses.newest = Some((at, status.clone()));
        status.heard_ms = status.heard_ms.saturating_add(millis(now - at));
        self.common.outputs.push_back(ServerOutput::Send { to, message: Message::Status(status) });
    }

    /// Returns what the main group saves and costs by not computing everything in full, as its leader last
    /// reported.
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        self.main().fidelity
    }

    /// Returns the status that operators are told.
    pub(super) fn status(&self) -> Status {
        let node = |(&node, entry): (&NodeId, &NodeEntry)| NodeStatus {
            node,
            address: entry.member.address,
            client: entry.member.client,
            group: entry.group,
            is_linked: entry.linked,
            is_loaded: entry.loaded,
            is_leaving: entry.leaving,
            delay_ms: entry.delays.values().flatten().copied().reduce(f32::max),
            unreached: entry.delays.values().filter(|delay| delay.is_none()).count() as u32,
        };
        let group = |group: &Group| {
            let view = group.view.as_ref();
            let clients = self.common.clients.values();
            GroupStatus {
                group: group.id,
                view: view.map(|view| view.number).unwrap_or_default(),
                tick: group.tick,
                leader: view.filter(|_| !group.held).map(|view| view.leader),
                is_changing: group.change.is_some(),
                clients: clients.filter(|entry| entry.linked && entry.group == group.id).count() as u32,
                regions: view.map(|view| regions(group, view)).unwrap_or_default(),
                fidelity: group.fidelity,
            }
        };
        Status {
            tick: self.tick(),
            heard_ms: millis(self.common.now.saturating_sub(self.main().heard_at)),
            dt_s: self.common.config.world.step.dt_s,
            bodies: self.record().present().filter(|body| body.traits.kind != BodyKind::Fixed).count() as u32,
            clients: self.linked_clients().count() as u32,
            main: self.main,
            groups: self.groups.values().map(group).collect(),
            nodes: self.common.nodes.iter().map(node).collect(),
        }
    }
}

fn millis(time: Duration) -> u32 {
    u32::try_from(time.as_millis()).unwrap_or(u32::MAX)
}

fn regions(group: &Group, view: &View) -> Vec<RegionStatus> {
    let mut bodies: BTreeMap<RegionId, u32> = BTreeMap::new();
    for body in group.record.present().filter(|body| body.traits.kind != BodyKind::Fixed) {
        // Right after a view change, no member has reported its bodies yet.
        let told = group.owners.get(&body.id).filter(|region| view.allocation.contains_key(region));
        let region = told.copied().unwrap_or_else(|| view.tree.leaf_at(body.state.pose.translation));
        *bodies.entry(region).or_default() += 1;
    }
    let status = |(&region, &owner): (&RegionId, &NodeId)| RegionStatus {
        region,
        owner,
        bodies: bodies.get(&region).copied().unwrap_or_default(),
        bounds: view.tree.part(region),
    };
    view.allocation.iter().map(status).collect()
}
