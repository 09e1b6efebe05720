//! Assemblies: bodies tied by joints, owned and moved whole.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::slot::Link;
use crate::space::BodyId;

/// Bodies of one region that joints tie together, in id order.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Assembly {
    pub members: Vec<Link>,
    /// Whether it has a multibody: then it is never shared.
    pub articulated: bool,
}

/// Joins bodies tied in pairs into assemblies, ordered by their lowest ids.
pub(super) fn connect(ties: impl IntoIterator<Item = (Link, Link)>) -> Vec<Assembly> {
    let mut links: BTreeMap<BodyId, Link> = BTreeMap::new();
    let mut groups = Groups::default();
    for (a, b) in ties {
        links.insert(a.id, a);
        links.insert(b.id, b);
        groups.join(a.id, b.id);
    }
    let mut by_root: BTreeMap<BodyId, Assembly> = BTreeMap::new();
    for (id, link) in links {
        by_root.entry(groups.root(id)).or_default().members.push(link);
    }
    by_root.into_values().collect()
}

/// Union-find over body ids; the root of a group is its lowest id.
#[derive(Debug, Default)]
pub(in crate::physics) struct Groups {
    parents: BTreeMap<BodyId, BodyId>,
}

impl Groups {
    /// Puts both bodies into one group.
    pub(in crate::physics) fn join(&mut self, a: BodyId, b: BodyId) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            self.parents.insert(a.max(b), a.min(b));
        }
    }

    /// The lowest id of the body's group.
    pub(in crate::physics) fn root(&mut self, id: BodyId) -> BodyId {
        let mut root = id;
        while let Some(&parent) = self.parents.get(&root) {
            root = parent;
        }
        let mut at = id;
        while let Some(parent) = self.parents.get_mut(&at) {
            at = std::mem::replace(parent, root);
        }
        root
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_make_groups_with_the_lowest_id_as_root() {
        let id = BodyId::persistent;
        let mut groups = Groups::default();
        groups.join(id(5), id(4));
        groups.join(id(9), id(8));
        groups.join(id(4), id(9));
        groups.join(id(1), id(2));
        let roots: Vec<_> = [5, 4, 9, 8, 1, 2, 7].map(|i| groups.root(id(i)).index()).to_vec();
        assert_eq!(roots, [4, 4, 4, 4, 1, 1, 7]);
    }
}
