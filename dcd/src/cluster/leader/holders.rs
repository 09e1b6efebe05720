//! Tracks which members hold which avatars, so that an avatar's inputs are sent to those members only (thesis
//! 3.3.8).

use std::collections::{BTreeMap, BTreeSet};

use crate::space::{BodyId, NodeId};

/// The most pairs of an avatar and a former holder that are kept: a member may name whatever it likes.
const MOST_FORMER: usize = 1 << 14;

/// The avatars that each member says it holds. An avatar that no member has named yet concerns all.
#[derive(Clone, Debug, Default)]
pub(super) struct Holders {
    by_node: BTreeMap<NodeId, BTreeSet<BodyId>>,
    known: BTreeMap<BodyId, u32>,
    /// Pairs of an avatar and a member that held it until lately, and is sent its input once more.
    former: BTreeSet<(BodyId, NodeId)>,
}

impl Holders {
    pub(super) fn now_holds(&mut self, node: NodeId, bodies: Vec<BodyId>) {
        let now: BTreeSet<_> = bodies.into_iter().filter(|id| id.client().is_some()).collect();
        for &id in &now {
            *self.known.entry(id).or_default() += 1;
            self.former.remove(&(id, node));
        }
        for id in self.by_node.insert(node, now).unwrap_or_default() {
            let holders = self.known.entry(id).or_default();
            *holders = holders.saturating_sub(1);
            if !self.by_node[&node].contains(&id) {
                self.former.insert((id, node));
            }
        }
        while self.former.len() > MOST_FORMER {
            self.former.pop_first();
        }
        self.known.retain(|_, holders| *holders > 0);
    }

    pub(super) fn concerns(&mut self, node: NodeId, body: BodyId) -> bool {
        let holds = self.by_node.get(&node).is_some_and(|held| held.contains(&body));
        holds || !self.known.contains_key(&body) || self.former.remove(&(body, node))
    }

    pub(super) fn forget(&mut self, body: BodyId) {
        self.known.remove(&body);
        self.former.retain(|&(id, _)| id != body);
        for held in self.by_node.values_mut() {
            held.remove(&body);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::ClientId;

    const AVATAR: BodyId = BodyId::avatar(ClientId(1), 0);

    #[test]
    fn who_holds_an_avatar_hears_of_it_and_who_let_go_of_it_once_more() {
        let (a, b, c) = (NodeId(1), NodeId(2), NodeId(3));
        let mut holders = Holders::default();
        assert!([a, b, c].iter().all(|&node| holders.concerns(node, AVATAR)), "nobody spoke of it yet");
        holders.now_holds(a, vec![AVATAR]);
        holders.now_holds(b, vec![AVATAR]);
        holders.now_holds(c, vec![]);
        assert_eq!([a, b, c].map(|node| holders.concerns(node, AVATAR)), [true, true, false]);
        holders.now_holds(a, vec![]);
        assert_eq!([a, b, c].map(|node| holders.concerns(node, AVATAR)), [true, true, false], "a once more");
        assert_eq!([a, b, c].map(|node| holders.concerns(node, AVATAR)), [false, true, false]);
        holders.now_holds(b, vec![]);
        assert!(holders.concerns(c, AVATAR), "whoever may hold it, it is not known");
    }

    #[test]
    fn a_member_that_names_ever_others_does_not_fill_the_leader() {
        let mut holders = Holders::default();
        for round in 0..20 {
            let named = (0..5_000).map(|index| BodyId::avatar(ClientId(1 + round), index));
            holders.now_holds(NodeId(1), named.chain([BodyId::persistent(round)]).collect());
        }
        assert_eq!(holders.former.len(), MOST_FORMER);
        assert_eq!(holders.by_node[&NodeId(1)].len(), 5_000, "avatars alone");
    }
}
