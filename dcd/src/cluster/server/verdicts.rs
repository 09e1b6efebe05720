//! Draws the participants whose regions a dedicated leader computes once more, and acts on what it finds out.

use std::collections::{BTreeMap, BTreeSet};

use bincode::{Decode, Encode};

use super::common::Common;
use super::{Server, ServerOutput};
use crate::protocol::{Farewell, Finding, Hindrance, Member, Verified, View, ViewNumber};
use crate::space::{BodyId, NodeId, Tick, mixed};

/// The share of participants that are verified, and the seed that draws them. A dedicated leader computes
/// their regions once more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode)]
pub struct Verification {
    /// The share of participants that are verified, 0 to 1. Each is drawn when it begins to compute, or
    /// begins anew under another leader. With 0 nobody is verified, and nothing is sent for it.
    pub share: f64,
    /// The seed of the draws. Whoever knows it knows which participants are verified.
    pub seed: u64,
}

impl Verification {
    /// Returns whether a participant that begins to compute in a view is verified.
    fn draws(&self, view: ViewNumber, node: NodeId) -> bool {
        let drawn = mixed(self.seed ^ mixed(view.0 ^ mixed(self.seed ^ u64::from(node.0))));
        // The upper bits, as many as an f64 holds exactly.
        ((drawn >> 11) as f64) / ((1_u64 << 53) as f64) < self.share
    }
}

/// The participants of a group that are verified.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawn {
    /// The leader that verifies them.
    by: Option<NodeId>,
    /// The participants, each with the view since which it is verified.
    nodes: BTreeMap<NodeId, ViewNumber>,
}

impl Drawn {
    /// Returns the members of a view to come that begin it with nothing of what they computed before. These
    /// are all participants, if a dedicated node leads that does not know what they have. It can verify no
    /// others, and no participant may know whether it was drawn.
    pub(super) fn anew(
        &self,
        common: &Common,
        members: &[Member],
        leader: NodeId,
        stayed: impl Fn(NodeId) -> bool,
    ) -> BTreeSet<NodeId> {
        let knows_them = self.by == Some(leader) && stayed(leader);
        let dedicated = members.iter().any(|member| member.node == leader && member.client.is_none());
        if !dedicated || knows_them || !can_verify(common) {
            return BTreeSet::new();
        }
        let participants = members.iter().filter(|member| member.client.is_some());
        participants.map(|member| member.node).filter(|node| stayed(*node)).collect()
    }

    /// Draws the participants that are verified in a view to come, among those that begin it with nothing.
    /// Those that were verified before go on, under the same leader. Returns what members are told of it,
    /// also where nobody is drawn, as nobody may know that. Returns `None` where nobody can be verified.
    pub(super) fn draw(
        &mut self,
        common: &mut Common,
        view: &View,
        goes_on: impl Fn(NodeId) -> bool,
        drops: &BTreeMap<NodeId, Vec<BodyId>>,
    ) -> Option<Vec<Verified>> {
        let Self { by, nodes } = self;
        let participants = view.members.iter().filter(|member| member.client.is_some());
        let participants: Vec<_> = participants.map(|member| member.node).collect();
        nodes.retain(|node, _| participants.contains(node) && goes_on(*node));
        let Some(leader) = view.led_by().filter(|leader| leader.client.is_none() && can_verify(common))
        else {
            *by = None;
            for (node, _) in std::mem::take(nodes) {
                let (tick, finding) = (view.tick, Finding::GivenUp(Hindrance::Unled));
                common.outputs.push_back(ServerOutput::Verdict { node, tick, finding });
            }
            return None;
        };
        *by = Some(leader.node);
        if participants.is_empty() {
            return None;
        }
        let verification = common.config.grouping.verification;
        for node in participants {
            if !goes_on(node) && verification.draws(view.number, node) {
                nodes.insert(node, view.number);
            }
        }
        let verified = nodes.iter().map(|(&node, &since)| {
            let drop = drops.get(&node).cloned().unwrap_or_default();
            Verified { node, anew: since == view.number, drop }
        });
        Some(verified.collect())
    }

    /// Returns whether this node verifies a participant in the view. Forgets the participant if, by the
    /// finding, it is no longer verified.
    fn hears(&mut self, by: NodeId, view: ViewNumber, node: NodeId, finding: Finding) -> bool {
        let is_meant = self.by == Some(by) && self.nodes.get(&node).is_some_and(|since| *since <= view);
        if is_meant && !matches!(finding, Finding::Contradicts(_)) {
            self.nodes.remove(&node);
        }
        is_meant
    }
}

fn can_verify(common: &Common) -> bool {
    common.config.grouping.verification.share > 0.0 && common.config.world.protocol.lag_ticks() == 0
}

/// Returns what one member is told of the verified participants: nothing of itself. Only the leader is told
/// what they let go of.
pub(super) fn told_to(node: NodeId, view: &View, verified: &[Verified]) -> Vec<Verified> {
    let others = verified.iter().filter(|one| one.node != node);
    let told = others.map(|one| match node == view.leader {
        true => one.clone(),
        false => Verified { drop: Vec::new(), ..*one },
    });
    told.collect()
}

impl Server {
    /// Takes in what a leader has found out about a participant. A participant that computes otherwise than
    /// it should has to leave at once, and what it computed does not count.
    pub(super) fn verdict(
        &mut self,
        from: NodeId,
        view: ViewNumber,
        tick: Tick,
        node: NodeId,
        finding: Finding,
    ) {
        let group = self.group_of(from).and_then(|id| self.groups.get_mut(&id));
        if !group.is_some_and(|group| group.drawn.hears(from, view, node, finding)) {
            self.common.stale += 1;
            return;
        }
        self.common.outputs.push_back(ServerOutput::Verdict { node, tick, finding });
        let Finding::Deviates(region) = finding else { return };
        let Some(entry) = self.common.nodes.get_mut(&node) else { return };
        let reason =
            format!("what it computed of {region} in tick {} does not follow from what it was told", tick.0);
        (entry.leaving, entry.unwanted) = (true, Some((Farewell::SentAway, reason)));
        let client = entry.member.client;
        client.into_iter().for_each(|client| self.part(client));
        self.begin_anew(node);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_are_drawn_as_are_asked_for_and_others_with_another_seed() {
        let drawn = |share, seed| {
            let verification = Verification { share, seed };
            let all = (0..100).flat_map(|view| (0..100).map(move |node| (ViewNumber(view), NodeId(node))));
            all.filter(|(view, node)| verification.draws(*view, *node)).collect::<Vec<_>>()
        };
        assert_eq!((drawn(0.0, 1).len(), drawn(1.0, 1).len()), (0, 10_000));
        assert!((70..130).contains(&drawn(0.01, 1).len()), "{}", drawn(0.01, 1).len());
        let (one, other) = (drawn(0.5, 1), drawn(0.5, 2));
        let both = one.iter().filter(|pair| other.contains(pair)).count();
        assert!((2_300..2_700).contains(&both), "{both} of both");
    }
}
