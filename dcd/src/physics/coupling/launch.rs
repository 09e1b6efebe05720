//! Shares a body that suddenly flies off with the regions that it flies into in the next ticks, before it gets
//! there: nobody has predicted what it meets. The body follows the copy that is stopped first (`consensus`).
//!
//! A world that exchanges messages before a tick announces a body that its user sped up like a body that its
//! user inserted. Regions of several processes have no such exchange: there the body stays where it is for
//! that tick, and is shared at its end. A body that a collision sped up is shared at the end of that tick
//! everywhere.

use std::collections::BTreeSet;

use rapier3d::prelude::*;

use super::neighbours::{are_beside, ticks_to_meeting};
use super::predicted_contacts::AHEAD_TICKS;
use super::{Moment, Side};
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::CopyState;
use crate::space::{Bounds, RegionSet};

/// The distance, metres, by which a copy of a body in flight must be behind another to count as stopped.
const STOPPED_M: f32 = 0.01;

/// The number of ticks in which a body that begins to fly may meet what nobody has predicted.
pub(super) const UNSEEN_TICKS: f32 = AHEAD_TICKS + 1.0;

/// Returns whether a body moves by more than its own radius in a tick: it may jump over what it would hit.
pub(super) fn is_fast(region: &Region, handle: RigidBodyHandle, velocity: Vector, tick_s: f32) -> bool {
    let way_m = velocity.length() * tick_s;
    way_m > region.slot(handle).reach_m && way_m.is_finite()
}

/// Returns a body and all that joints tie to it; nothing where no joint does. These are shared alike, or
/// regions would not follow the same copy of all of them.
pub(super) fn together(region: &Region, link: BodyRef) -> &[BodyRef] {
    let assembly = region.slot(link.handle).assembly;
    assembly.map_or(&[], |place| &region.assemblies()[place as usize].members)
}

/// Returns the regions that a body, or what joints tie it to, comes to within a time, within a margin.
pub(super) fn on_its_way(
    region: &Region,
    partition: &Partition,
    link: BodyRef,
    ahead_s: f32,
    margin_m: f64,
) -> RegionSet {
    let all = together(region, link).iter().chain(std::iter::once(&link));
    let of = |link: &BodyRef| way_of(region, partition, link.handle, ahead_s, margin_m);
    all.map(of).fold(RegionSet::EMPTY, RegionSet::union)
}

/// Returns whether a body flies so far that its next owner would not be told in time of what it comes to: a
/// region hears of others that are not beside it only from the next meeting of all regions on. The present
/// owner has asked for them at the last one.
pub(super) fn outruns(region: &Region, moment: Moment<'_>, link: BodyRef, owner: usize) -> bool {
    let (partition, dt_s) = (moment.partition, moment.settings.dt_s);
    let body = region.physics().bodies.get(link.handle);
    if !body.is_some_and(|body| is_fast(region, link.handle, body.linvel(), dt_s)) {
        return false;
    }
    // It arrives in the next tick, and is compared with what is there in the one after.
    let ticks = ticks_to_meeting(moment.tick) as f32 + UNSEEN_TICKS;
    let way = way_of(region, partition, link.handle, ticks * dt_s, partition.halo_m());
    way.iter().any(|rank| !are_beside(partition, owner, rank))
}

fn way_of(
    region: &Region,
    partition: &Partition,
    handle: RigidBodyHandle,
    ahead_s: f32,
    margin_m: f64,
) -> RegionSet {
    let bounds = match region.slot(handle).reach_m.is_finite() {
        true => region.world_bounds(handle),
        false => Bounds::around([0.0; 3], [f64::INFINITY; 3]),
    };
    let velocity = region.physics().bodies[handle].linvel().to_array();
    partition.touching(&bounds.swept(velocity, ahead_s.into()).grown(margin_m))
}

/// Marks for announcement the bodies that their user has sped up since the last step and that fly into other
/// regions soon. Returns whether one of them flies to regions that this one hears of only from the next
/// meeting of all on.
pub(super) fn expect(side: &mut Side, moment: Moment<'_>) -> bool {
    let region = &mut side.region;
    let launched = region.take_launched();
    if launched.is_empty() {
        return false;
    }
    let is_here = |link: &BodyRef| region.role_of(link.handle) == Some((link.id, Ownership::Owner));
    let outruns = |link: &BodyRef| is_here(link) && outruns(region, moment, *link, region.rank());
    let any_outruns = launched.iter().any(outruns);
    // Some of the tied bodies may be gone.
    region.update_assemblies();
    let mut known: BTreeSet<_> = region.fresh().map(|link| link.id).collect();
    for link in launched {
        if !flies_off(region, moment, link, UNSEEN_TICKS, moment.partition.halo_m()) {
            continue;
        }
        let tied = together(region, link).to_vec();
        for link in tied.into_iter().chain([link]).filter(|link| known.insert(link.id)) {
            // Its island, or what that island comes to meet, may not lie in one region.
            region.slot_mut(link.handle).whole = false;
            region.keep_fresh(link);
        }
    }
    any_outruns
}

/// Holds in place for a tick the bodies that fly into other regions and that nobody has been told of.
pub(super) fn hold(side: &mut Side, moment: Moment<'_>) {
    // Other processes do not know of these, and cannot meet for them.
    expect(side, moment);
    let Side { region, border, .. } = side;
    border.held_back.clear();
    if region.fresh().next().is_none() {
        return;
    }
    region.update_assemblies();
    let is_held = |link: &BodyRef| {
        // A body that a joint ties to it would not wait.
        flies_off(region, moment, *link, 1.0, moment.partition.halo_m())
            && region.joints_of(link.handle).next().is_none()
    };
    let held: Vec<_> = region.fresh().filter(is_held).collect();
    for BodyRef { handle, .. } in held {
        let body = &mut region.world_mut().bodies[handle];
        border.held_back.push((handle, body.linvel()));
        body.set_linvel(Vector::ZERO, false);
    }
}

/// Gives the bodies held in place by [`hold`] their velocity back.
pub(super) fn release(side: &mut Side) {
    let Side { region, border, .. } = side;
    for (handle, velocity) in std::mem::take(&mut border.held_back) {
        if let Some(body) = region.world_mut().bodies.get_mut(handle) {
            let velocity = body.linvel() + velocity;
            body.set_linvel(velocity, true);
        }
    }
}

/// Returns whether a body owned here, which no other region holds, flies within some ticks to within a margin
/// of other regions.
pub(super) fn flies_off(
    region: &Region,
    moment: Moment<'_>,
    link: BodyRef,
    ticks: f32,
    margin_m: f64,
) -> bool {
    let BodyRef { id, handle } = link;
    let (held, tick_s) = (region.physics().bodies.get(handle), moment.settings.dt_s);
    let Some(body) = held.filter(|_| region.role_of(handle) == Some((id, Ownership::Owner))) else {
        return false;
    };
    body.is_dynamic()
        && !region.is_articulated(handle)
        && region.slot(handle).holders.is_empty()
        && is_fast(region, handle, body.linvel(), tick_s)
        && on_its_way(region, moment.partition, link, ticks * tick_s, margin_m)
            != RegionSet::only(region.rank())
}

/// Returns how far, in micrometres, a copy of a fast body is behind another one because it was stopped on its
/// way in the last tick. Rapier stops a flying body where it is about to hit something, and lets it touch
/// that in the next step. Returns 0 for copies that are side by side, farther apart than a tick takes them,
/// or slow.
pub(super) fn stopped_um(ahead: &CopyState, copy: &CopyState, reach_m: f32, tick_s: f32) -> i64 {
    let way_m = way_m(ahead, tick_s);
    if way_m <= reach_m {
        return 0;
    }
    let motion = Vector::from_array(ahead.velocity.linear);
    let apart = |i: usize| (ahead.pose.translation[i] - copy.pose.translation[i]) as f32;
    let behind_m = Vector::from_array(std::array::from_fn(apart)).dot(motion.normalize_or_zero());
    if (STOPPED_M..=1.01 * way_m).contains(&behind_m) { (behind_m * 1e6) as i64 } else { 0 }
}

/// Returns how far a copy flies in a tick, metres.
pub(super) fn way_m(copy: &CopyState, tick_s: f32) -> f32 {
    Vector::from_array(copy.velocity.linear).length() * tick_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    /// A bullet flies through several narrow regions between two meetings of all regions, and meets a loose
    /// plate that only its own region has.
    #[test]
    fn a_bullet_is_stopped_by_what_lies_several_narrow_regions_away() {
        let mut passed = Vec::new();
        for width_m in [4.0, 9.0, 10.0, 15.0] {
            let planes: Vec<_> = (1..12).map(|i| f64::from(i) * width_m).collect();
            for speed in [150.0, 210.0, 300.0, 330.0, 400.0] {
                for start in 0..9 {
                    let plate_m = 6.0 * width_m + 0.06;
                    let (bullet, plate) = shoot(&planes, plate_m, speed, start);
                    if bullet > plate {
                        passed.push(format!("{speed} m/s, regions of {width_m} m, off in tick {start}"));
                    }
                }
            }
        }
        assert!(passed.is_empty(), "{passed:#?}");
    }

    /// A bullet crosses the only border in the first, second, ... tick after it was set off.
    #[test]
    fn a_bullet_is_stopped_behind_a_border_in_whatever_tick_it_crosses_that() {
        let mut passed = Vec::new();
        for speed in [60.0, 80.0, 100.0, 150.0, 200.0] {
            for i in 0..40 {
                let border_m = 0.3 + 0.3 * f64::from(i);
                for (behind_m, start) in [(0.1, 3), (0.5, 4), (1.1, 20)] {
                    let (bullet, plate) = shoot(&[border_m], border_m + behind_m, speed, start);
                    if bullet > plate {
                        passed.push(format!("{speed} m/s, {border_m} m before, plate {behind_m} m behind"));
                    }
                }
            }
        }
        assert!(passed.is_empty(), "{passed:#?}");
    }

    /// Shoots a bullet at a plate, from x = 0 in tick `start`. Returns where both are a second later.
    fn shoot(planes: &[f64], plate_m: f64, speed: f32, start: u8) -> (f64, f64) {
        let mut cuts = Vec::new();
        middle_first(planes, &mut cuts);
        let mut config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        config.bounds = Bounds::around([90.0, 0.0, 0.0], [110.0; 3]);
        let mut world = LocalWorld::new(config).unwrap();
        let plate = RigidBodyBuilder::dynamic().translation(Vector::X * plate_m as f32);
        let plate = world.insert(plate, ColliderBuilder::cuboid(0.01, 5.0, 5.0)).unwrap();
        // It waits, so that it flies off in any tick between two meetings.
        let bullet = RigidBodyBuilder::dynamic().ccd_enabled(true).can_sleep(false);
        let bullet = world.insert(bullet, ColliderBuilder::ball(0.1)).unwrap();
        for _ in 0..start {
            world.step().unwrap();
        }
        world.update(bullet, |body| body.set_linvel(Vector::X * speed, true)).unwrap();
        for _ in 0..60 {
            world.step().unwrap();
        }
        let x_of = |id| world.pose(id).unwrap().translation[0];
        (x_of(bullet), x_of(plate))
    }

    /// Orders planes from the middle on, so that the tree is not too deep.
    fn middle_first(places: &[f64], planes: &mut Vec<(Axis, f64)>) {
        if let Some(&middle) = places.get(places.len() / 2) {
            planes.push((Axis::X, middle));
            middle_first(&places[..places.len() / 2], planes);
            middle_first(&places[places.len() / 2 + 1..], planes);
        }
    }
}
