//! Counts the owners of every body, to check that each has exactly one.

use super::View;
use crate::space::BodyId;

/// The owned bodies of a world, each as often as it is owned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Census {
    /// In id order.
    owned: Vec<BodyId>,
}

impl Census {
    pub(super) fn of(views: &[View<'_>]) -> Self {
        let mut owned: Vec<_> = views.iter().flat_map(|view| view.owned().map(|(id, _)| id)).collect();
        owned.sort_unstable();
        Self { owned }
    }

    /// Returns how many of these bodies have no owner.
    pub fn lost(&self, of: &[BodyId]) -> usize {
        of.iter().filter(|id| self.owned.binary_search(id).is_err()).count()
    }

    /// Returns how many bodies have more than one owner.
    pub fn doubled(&self) -> usize {
        self.owned.chunk_by(|a, b| a == b).filter(|same| same.len() > 1).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_without_an_owner_is_lost_and_one_with_two_is_doubled_once() {
        let id = BodyId::persistent;
        let census = Census { owned: [1, 3, 3, 3, 4].map(id).to_vec() };
        assert_eq!(census.lost(&[1, 2, 3, 4, 5].map(id)), 2);
        assert_eq!(census.doubled(), 1);
    }
}
