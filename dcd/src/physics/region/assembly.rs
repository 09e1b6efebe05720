//! Groups bodies tied by joints into assemblies, by union-find. An assembly is owned by one region, and moves whole.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::slot::BodyRef;
use crate::space::{BodyId, Groups};

/// A group of bodies of one region that joints tie together, in id order.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Assembly {
    pub members: Vec<BodyRef>,
    /// Whether it has a multibody: then it is never shared.
    pub articulated: bool,
}

/// Joins bodies tied in pairs into assemblies, ordered by their lowest ids.
pub(super) fn connect(ties: impl IntoIterator<Item = (BodyRef, BodyRef)>) -> Vec<Assembly> {
    let mut links: BTreeMap<BodyId, BodyRef> = BTreeMap::new();
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
