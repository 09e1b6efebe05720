//! Finds the bodies owned here that are near the border, and lets all others rest: those that are far from any
//! border are checked again only after some ticks.

use rapier3d::prelude::*;

use super::near::Near;
use super::{AHEAD_TICKS, MARGIN_M, PredictedContacts};
use crate::physics::convert;
use crate::physics::coupling::Moment;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::space::Bounds;

/// The most ticks after which a body far from any border is checked again.
pub(in crate::physics::coupling) const LONGEST_REST: u32 = 8;
/// The gain of speed between checks, m/s, up to which a body is still checked in time.
pub(in crate::physics::coupling) const SURPRISE_M_S: f32 = 10.0;
/// The mark of a body that is far from any border.
const FAR: u32 = u32::MAX;

/// Checks bodies owned here, all that are due: keeps a list of those near the border, and lets the others rest.
pub(in crate::physics::coupling) fn look(
    region: &mut Region,
    predicted: &mut PredictedContacts,
    moment: Moment<'_>,
    handles: &[RigidBodyHandle],
) {
    look_at(region, predicted, moment, handles);
    let own = handles.iter().filter(|&&handle| region.slot(handle).role == Ownership::Owner);
    let moving = own.map(|&handle| (handle, region.physics().bodies[handle].linvel()));
    let flying = &mut predicted.flying;
    flying.clear();
    flying.extend(moving.filter(|(_, velocity)| velocity.length() > SURPRISE_M_S));
    flying.sort_unstable_by_key(|(handle, _)| handle.into_raw_parts());
}

/// Checks some bodies owned here, before the others.
pub(in crate::physics::coupling) fn look_at(
    region: &mut Region,
    predicted: &mut PredictedContacts,
    moment: Moment<'_>,
    handles: &[RigidBodyHandle],
) {
    predicted.tick_s = moment.settings.dt_s;
    predicted.ahead_s = ahead_ticks(moment) * moment.settings.dt_s;
    let now = moment.tick.0 as u32;
    predicted.find_inner(region);
    let rests = moment.team.spread(handles, |&handle| {
        (region.slot(handle).role == Ownership::Owner).then(|| predicted.rest_of(region, handle))
    });
    let mut close = Vec::new();
    // By Rapier's body index: the place in `close` plus one.
    let mut places = vec![0; region.index_bound()];
    for (&handle, rest) in handles.iter().zip(rests) {
        let (Some(rest), place) = (rest, &mut places[index_of(handle)]) else { continue };
        if rest > 0 {
            region.rest_until(handle, now + rest);
            *place = FAR;
        } else if *place == 0 {
            close.push(BodyRef { id: region.slot(handle).id, handle });
            *place = close.len() as u32;
        }
    }
    let ahead_s = predicted.ahead_s;
    let mut found: Vec<_> = moment.team.spread(&close, |&link| Some(Near::of(region, link, ahead_s)));
    // By Rapier's handle, not by id, so that nothing is hashed.
    let own = |near: &Near| region.role_of(near.link.handle) == Some((near.link.id, Ownership::Owner));
    let PredictedContacts { near, seen, sudden, flying, tick_s, .. } = predicted;
    let jumps = |link: BodyRef, by: Vector| by.length() * *tick_s > region.leap_m(link.handle);
    sudden.clear();
    near.retain_mut(|known| {
        let place = if own(known) { places[index_of(known.link.handle)] } else { FAR };
        if let Some(anew) = place.checked_sub(1).and_then(|place| found.get_mut(place as usize)?.take()) {
            if jumps(anew.link, anew.velocity - known.velocity) {
                sudden.push(anew.link);
            }
            *known = anew;
        }
        place != FAR
    });
    let mut newcomers: Vec<_> = found.into_iter().flatten().collect();
    // A body that comes so near and was slow before was sped up.
    let before = |near: &&Near| {
        let key = near.link.handle.into_raw_parts();
        let place = flying.binary_search_by_key(&key, |(handle, _)| handle.into_raw_parts());
        place.map_or(Vector::ZERO, |place| flying[place].1)
    };
    let is_sudden = |near: &&Near| {
        near.velocity.length() > SURPRISE_M_S && jumps(near.link, near.velocity - before(near))
    };
    sudden.extend(newcomers.iter().filter(is_sudden).map(|near| near.link));
    if !newcomers.is_empty() {
        newcomers.sort_unstable_by_key(|near| near.link.id);
        near.append(&mut newcomers);
        // The two ordered lists are merged.
        near.sort_by_key(|near| near.link.id);
    }
    // Of many regions, most have no body that reaches out of its cell.
    let extents: Vec<_> = seen.iter().filter_map(|nearby| nearby.extent).collect();
    near.retain_mut(|near| {
        near.awake = !region.physics().bodies[near.link.handle].is_sleeping();
        // A sleeping body that no other region's bodies reach concerns none, until it wakes or their extent
        // reaches it.
        near.awake
            || !region.cell().contains_box(&near.swept)
            || extents.iter().any(|extent| extent.touches(&near.swept))
    });
}

/// Returns how many ticks ahead contacts are predicted. They are more where a region may be behind the
/// present time: its bodies are swept from where they were some ticks ago, and it cannot hold a body before
/// it has caught up.
fn ahead_ticks(moment: Moment<'_>) -> f32 {
    AHEAD_TICKS + f32::from(moment.coarsest - 1)
}

impl PredictedContacts {
    /// Finds the part of the region where bodies concern no other region: its cell without what the other
    /// regions' bodies reach into.
    fn find_inner(&mut self, region: &Region) {
        let cell = region.cell();
        let mut inner = Bounds::new(cell.min, cell.max);
        for extent in self.seen.iter().filter_map(|nearby| nearby.extent) {
            cut(&mut inner, &extent);
        }
        let inner = inner.grown(-MARGIN_M);
        self.inner = (
            convert::region_point(region.anchor(), inner.min),
            convert::region_point(region.anchor(), inner.max),
        );
    }

    /// Returns for how many ticks a body surely stays in that part, if nothing speeds it up by more than
    /// [`SURPRISE_M_S`]; at most [`LONGEST_REST`]. A body that is hit harder is fast then, and checked at
    /// once.
    fn rest_of(&self, region: &Region, handle: RigidBodyHandle) -> u32 {
        let body = &region.physics().bodies[handle];
        let centre = body.center_of_mass();
        let gap = (centre - self.inner.0).min(self.inner.1 - centre).min_element();
        let speed = body.linvel().length() + SURPRISE_M_S;
        let gap = gap - region.slot(handle).reach_m - self.ahead_s * body.linvel().length();
        ((gap / (speed * self.tick_s)).max(0.0) as u32).min(LONGEST_REST)
    }
}

/// Keeps `inner` clear of a box, by moving the face that has the shortest way to go.
fn cut(inner: &mut Bounds, away: &Bounds) {
    if !inner.touches(away) {
        return;
    }
    let (mut least, mut face) = (f64::INFINITY, None);
    for axis in 0..3 {
        let (low, high) = (away.max[axis] - inner.min[axis], inner.max[axis] - away.min[axis]);
        for (distance, upper) in [(low, false), (high, true)] {
            if distance < least {
                (least, face) = (distance, Some((axis, upper)));
            }
        }
    }
    match face {
        Some((axis, true)) => inner.max[axis] = away.min[axis],
        Some((axis, false)) => inner.min[axis] = away.max[axis],
        // It spans an unbounded cell: no part of the cell is out of its reach.
        None => *inner = Bounds::new([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]),
    }
}

fn index_of(handle: RigidBodyHandle) -> usize {
    handle.into_raw_parts().0 as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_reach_into_is_no_longer_inner() {
        let mut inner = Bounds::new([f64::NEG_INFINITY, 0.0, 0.0], [10.0; 3]);
        cut(&mut inner, &Bounds::new([8.0, 2.0, 2.0], [11.0, 4.0, 4.0]));
        assert_eq!((inner.min[0], inner.max), (f64::NEG_INFINITY, [8.0, 10.0, 10.0]));
        cut(&mut inner, &Bounds::new([20.0; 3], [21.0; 3]));
        assert_eq!(inner.max, [8.0, 10.0, 10.0]);
    }
}
