//! Sends bodies that were inserted, or that a collision sped up, to the regions that they come near, before
//! these regions could have seen them.

use rapier3d::prelude::RigidBodyHandle;

use super::Decision;
use super::membership::tell;
use crate::physics::coupling::{Moment, Side, launch, predicted_contacts};
use crate::physics::region::{BodyRef, Ownership};
use crate::space::RegionSet;

/// Sends the bodies inserted since the last step to the regions that must hold them: all whose cell they come
/// near, and if they are fast, all whose bodies reach to their way.
pub(in crate::physics::coupling) fn announce(side: &mut Side, moment: Moment<'_>) {
    side.outbox.clear(moment.tick);
    side.region.update_assemblies();
    side.border.decisions.clear();
    let fresh = share_fresh(side, moment);
    let Side { region, border, outbox, .. } = side;
    predicted_contacts::look(region, &mut border.predicted, moment, &fresh);
    predicted_contacts::show(region, &mut border.predicted, &mut border.neighbours, outbox, moment);
}

/// Sends the bodies inserted here to all regions that they come near, since they may touch anything at once.
/// Bodies of islands that are computed whole go to no new region, unless they are fast; after membership has
/// changed they go to the regions that held copies of them, which follow as before. A body whose holders are at different times, as
/// a joint may cause, waits until they are at the same time. Returns all bodies inserted here.
pub(super) fn share_fresh(side: &mut Side, moment: Moment<'_>) -> Vec<RigidBodyHandle> {
    let fresh = side.region.take_fresh();
    for &link in &fresh {
        let region = &side.region;
        if region.slot(link.handle).role == Ownership::Owner && !region.is_articulated(link.handle) {
            share(side, moment, link);
        }
    }
    fresh.into_iter().map(|link| link.handle).collect()
}

/// Sends the bodies that a collision sped up in this step to the regions that they fly into in the next ones.
pub(super) fn share_sudden(side: &mut Side, moment: Moment<'_>) {
    for link in std::mem::take(&mut side.border.predicted.sudden) {
        let is_decided = side.border.decisions.iter().any(|decision| decision.link.id == link.id);
        // Too much of an assembly would be sent at every blow.
        let is_tied = side.region.slot(link.handle).assembly.is_some();
        if !is_decided
            && !is_tied
            && launch::flies_off(&side.region, &side.border, moment, link, launch::UNSEEN_TICKS, 0.0)
        {
            side.region.slot_mut(link.handle).whole = false;
            share(side, moment, link);
        }
    }
}

/// Sends a body to all regions that it comes near in the next tick, or in the next ticks if it is fast.
fn share(side: &mut Side, moment: Moment<'_>, link: BodyRef) {
    let Side { region, border, outbox, .. } = side;
    let (own, handle) = (RegionSet::only(region.rank()), link.handle);
    let (whole, partition) = (region.slot(handle).whole, moment.partition);
    let is_fast = |link: &BodyRef| {
        let velocity = region.physics().bodies[link.handle].linvel();
        launch::is_fast(region, link.handle, velocity, moment.settings.dt_s)
    };
    let is_fast = is_fast(&link) || launch::together(region, link).iter().any(is_fast);
    let ahead_s = if is_fast { launch::UNSEEN_TICKS } else { 1.0 } * moment.settings.dt_s;
    // That its island lies in one region was found in the last tick. What is fast may be out of it in the next.
    let margin_m = partition.halo_m();
    let near = match (whole, is_fast) {
        (_, true) => launch::on_its_way(region, border, partition, link, ahead_s, margin_m),
        (false, false) => launch::cells_on_its_way(region, partition, link, ahead_s, margin_m),
        (true, false) => RegionSet::EMPTY,
    };
    let reached = border.neighbours.reached(region.rank(), near);
    let holders = reached.union(region.slot(handle).holders).without(own);
    // A region that is behind takes in no body, and does not apply its own decisions.
    if !holders.is_empty() && border.neighbours.are_behind(holders.union(own)) {
        border.neighbours.wait_for(holders);
        region.keep_fresh(link);
    } else if !holders.is_empty() {
        let members = holders.union(own);
        // A copy with a part of the mass that does not meet what the others meet would carry the body past
        // it. Whole copies follow the one that was stopped. Nor would what strikes a sleeper in all of these
        // regions, whole, find more than a part of it there: it stays as it is until it wakes.
        let follows = moment.settings.coupling.moves_islands() && moment.settings.island_limit > 0;
        let asleep = region.physics().bodies[handle].is_sleeping();
        let warming = if whole || follows && (is_fast || asleep) { holders } else { RegionSet::EMPTY };
        tell(region, outbox, handle, holders, holders, members, warming, region.rank(), None);
        border.decisions.push(Decision { link, members, warming });
    } else if is_fast && reached != near {
        // All regions on its way are met in the next tick.
        region.keep_fresh(link);
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    /// A ball that comes in flight hits a box that was inserted asleep over a border.
    #[test]
    fn a_sleeper_that_two_regions_hold_is_struck_with_all_of_its_mass() {
        for (from_m, speed) in [(-1.0, 100.0), (-2.0, 100.0), (-3.0, 200.0), (-1.0, 50.0), (-0.8, 20.0)] {
            let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
            let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
            config.step.gravity = [0.0; 3];
            let mut world = LocalWorld::new(config).unwrap();
            let sleeper = RigidBodyBuilder::dynamic().translation(Vector::X * 0.3).sleeping(true);
            let sleeper = world.insert(sleeper, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(1.0)).unwrap();
            for _ in 0..10 {
                world.step().unwrap();
            }
            let ball = RigidBodyBuilder::dynamic().translation(Vector::X * from_m).linvel(Vector::X * speed);
            let ball = world.insert(ball.ccd_enabled(true), ColliderBuilder::ball(0.2).mass(1.0)).unwrap();
            for _ in 0..30 {
                world.step().unwrap();
            }
            let [of_sleeper, of_ball] = [sleeper, ball].map(|id| world.velocity(id).unwrap().linear[0]);
            assert!(of_sleeper > 0.4 * speed, "from {from_m} m at {speed} m/s: struck to {of_sleeper} m/s");
            let momentum = of_sleeper + of_ball;
            assert!((momentum - speed).abs() < 0.01 * speed, "from {from_m} m at {speed} m/s: {momentum}");
        }
    }
}
