//! Moves multibodies to the regions that compute them. A multibody is never shared: it moves in one piece, at
//! the cost of the warm start of its contacts. No two regions can hold both of two multibodies that meet, so
//! multibodies that may touch go together, or stay.

use std::collections::BTreeMap;

use super::island::Island;
use super::{Border, Moment, predicted_contacts};
use crate::physics::region::{Assembly, BodyRef, Ownership, Region};
use crate::space::{Bounds, PlaceGroups, RegionSet};

/// A multibody owned here, with all that is tied to it.
struct Articulated<'a> {
    assembly: &'a Assembly,
    /// The lowest rank of a region whose multibody it is about to meet. `None` also while its island spans
    /// regions: then it does not go for its own sake, but goes with others of its group, since a contact that
    /// begins anew is the lesser evil.
    meets: Option<usize>,
    /// The rank of the region that would compute it if it met no other multibody.
    home: usize,
}

/// Returns the members of multibodies that move elsewhere, with the ranks of the regions that they move to.
pub(super) fn leaving(region: &Region, border: &mut Border, moment: Moment<'_>) -> Vec<(BodyRef, usize)> {
    let own = region.rank();
    let is_owned = |assembly: &&Assembly| region.slot(assembly.members[0].handle).role == Ownership::Owner;
    let owned = region.assemblies().iter().filter(|assembly| assembly.articulated).filter(is_owned);
    let mut all: Vec<_> = owned.map(|assembly| Articulated::find(region, border, moment, assembly)).collect();
    // The place of an assembly in the list depends on which were there before.
    all.sort_unstable_by_key(|one| one.assembly.members[0].id);
    if all.iter().all(|one| one.home == own && one.meets.is_none()) {
        return Vec::new();
    }
    let mut groups = near_each_other(region, moment, &all);
    // By the first of a group: the lowest rank of a region whose multibodies some of it meet, and the region
    // where all of it would go otherwise.
    let mut wishes: BTreeMap<usize, (Option<usize>, usize)> = BTreeMap::new();
    for (place, one) in all.iter().enumerate() {
        let (meets, home) = wishes.entry(groups.root(place)).or_insert((None, one.home));
        *meets = meets.iter().copied().chain(one.meets).min();
        *home = if *home == one.home { one.home } else { own };
    }
    let mut leaving = Vec::new();
    for (place, one) in all.iter().enumerate() {
        // Of two multibodies that meet, only the one whose region is of higher rank goes.
        let goal = match wishes[&groups.root(place)] {
            (Some(meets), _) => meets.min(own),
            (None, home) => home,
        };
        if goal != own && !border.neighbours.reached(own, RegionSet::only(goal)).is_empty() {
            leaving.extend(one.assembly.members.iter().map(|&link| (link, goal)));
        }
    }
    leaving.sort_unstable_by_key(|(link, _)| link.id);
    leaving
}

impl<'a> Articulated<'a> {
    fn find(region: &Region, border: &Border, moment: Moment<'_>, assembly: &'a Assembly) -> Self {
        let lead = assembly.members[0].handle;
        let island = border.islands.of(lead).filter(|island| !island.big);
        let meetings = assembly.members.iter().flat_map(|link| border.predicted.meetings_of(link.id));
        let meets = meetings.filter(|meeting| meeting.articulated).map(|meeting| meeting.rank).min();
        let home = match island {
            // A sleeping multibody stays, unless an awake one comes.
            _ if region.physics().bodies[lead].is_sleeping() => region.rank(),
            Some(island) if island.ready => island.target,
            Some(_) => region.rank(),
            None => moment.home_of(region, lead),
        };
        Self { assembly, meets: meets.filter(|_| !island.is_some_and(Island::spans)), home }
    }
}

/// Groups multibodies that may touch, directly or through others, in the ticks for which contacts are
/// predicted.
fn near_each_other(region: &Region, moment: Moment<'_>, all: &[Articulated<'_>]) -> PlaceGroups {
    let mut swept: Vec<_> =
        all.iter().map(|one| swept_bounds(region, moment, one.assembly)).enumerate().collect();
    swept.sort_by(|(_, a), (_, b)| a.min[0].total_cmp(&b.min[0]));
    let mut groups = PlaceGroups::new(all.len());
    for (next, (place, bounds)) in swept.iter().enumerate() {
        let beside = swept[next + 1..].iter().take_while(|(_, other)| other.min[0] <= bounds.max[0]);
        for (other, _) in beside.filter(|(_, other)| other.touches(bounds)) {
            groups.join(*place, *other);
        }
    }
    groups
}

/// Returns a box around all that an assembly may reach in the ticks for which contacts are predicted.
fn swept_bounds(region: &Region, moment: Moment<'_>, assembly: &Assembly) -> Bounds {
    let swept = assembly
        .members
        .iter()
        .map(|link| predicted_contacts::swept_bounds(region, link.handle, moment.settings.dt_s));
    swept.reduce(|all, one| all.union(&one)).expect("an assembly has members")
}
