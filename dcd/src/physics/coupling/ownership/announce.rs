//! Sends bodies that were inserted, or that a collision sped up, to the regions that they come near, before
//! these regions could have seen them.

use std::collections::BTreeSet;

use rapier3d::prelude::RigidBodyHandle;

use super::Decision;
use super::membership::tell;
use crate::physics::convert;
use crate::physics::coupling::{Moment, Side, launch, predicted_contacts};
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::space::{BodyId, RegionSet};

/// The most bodies that are sent with one that a collision sped up, since they touch it or joints tie them to
/// it: more would be too much to send at every blow.
const MOST_IN_TOUCH: usize = 64;

/// Sends the bodies inserted since the last step to the regions that must hold them: all whose cell they come
/// near, and if they are fast, all whose bodies reach to their way.
pub(in crate::physics::coupling) fn announce(side: &mut Side, moment: Moment<'_>) {
    side.outbox.clear(moment.tick);
    side.region.update_assemblies();
    side.border.decisions.clear();
    let fresh = share_fresh(side, moment);
    let Side { region, border, outbox, .. } = side;
    predicted_contacts::look_at(region, &mut border.predicted, moment, &fresh);
    predicted_contacts::show(region, &mut border.predicted, &mut border.neighbours, outbox, moment);
}

/// Sends the bodies inserted here to all regions that they come near, since they may touch anything at once.
/// Bodies of islands that are computed whole go to no new region, unless they are fast; after membership has
/// changed they go to the regions that held copies of them, which follow as before. A body whose holders are at different times, as
/// a joint may cause, waits until they are at the same time. Returns all bodies inserted here.
pub(super) fn share_fresh(side: &mut Side, moment: Moment<'_>) -> Vec<RigidBodyHandle> {
    let fresh = side.region.take_fresh();
    let mut known = BTreeSet::new();
    for &link in &fresh {
        share_in_touch(side, moment, link, &mut known);
    }
    for &link in &fresh {
        if may_share(&side.region, link) && known.insert(link.id) {
            share(side, moment, link, RegionSet::EMPTY);
        }
    }
    fresh.into_iter().map(|link| link.handle).collect()
}

/// Sends the bodies that a collision sped up in this step to the regions that they fly into in the next ones.
pub(super) fn share_sudden(side: &mut Side, moment: Moment<'_>) {
    let sudden = std::mem::take(&mut side.border.predicted.sudden);
    if sudden.is_empty() {
        return;
    }
    let mut known: BTreeSet<_> = side.border.decisions.iter().map(|decision| decision.link.id).collect();
    for link in sudden {
        share_in_touch(side, moment, link, &mut known);
    }
}

/// Sends a body that flies off to the regions on its way, with all that hangs together with it: they follow
/// the copy that is stopped there only if all of that is there (`leader`). `known` bodies have been sent.
fn share_in_touch(side: &mut Side, moment: Moment<'_>, link: BodyRef, known: &mut BTreeSet<BodyId>) {
    let Side { region, border, .. } = side;
    if known.contains(&link.id)
        || launch::together(region, link).len() > MOST_IN_TOUCH
        || !launch::flies_off(region, border, moment, link, launch::UNSEEN_TICKS, 0.0)
    {
        return;
    }
    let assembly = |link: &BodyRef| region.slot(link.handle).assembly;
    let all = match region.in_touch(link, MOST_IN_TOUCH) {
        Some(all) => all,
        None if assembly(&link).is_some() => return,
        None => vec![link],
    };
    let ahead_s = launch::UNSEEN_TICKS * moment.settings.dt_s;
    let margin_m = moment.partition.halo_m();
    // The way of one body of an assembly is that of all of it.
    let counts = |other: &&BodyRef| {
        other.id == link.id || assembly(other).is_none() || assembly(other) != assembly(&link)
    };
    let way = |link: &BodyRef| launch::on_its_way(region, border, moment.partition, *link, ahead_s, margin_m);
    let near = all.iter().filter(counts).map(way).fold(RegionSet::EMPTY, RegionSet::union);
    for link in all {
        if may_share(&side.region, link) && known.insert(link.id) {
            side.region.slot_mut(link.handle).whole = false;
            share(side, moment, link, near);
        }
    }
}

/// Returns whether it is for this region to decide who holds a body.
fn may_share(region: &Region, link: BodyRef) -> bool {
    region.slot(link.handle).role == Ownership::Owner && !region.is_articulated(link.handle)
}

/// Sends a body to all regions that it comes near in the next tick, or in the next ticks if it is fast, and
/// to `more`.
fn share(side: &mut Side, moment: Moment<'_>, link: BodyRef, more: RegionSet) {
    let Side { region, border, outbox, .. } = side;
    let (own, handle) = (RegionSet::only(region.rank()), link.handle);
    let (whole, partition) = (region.slot(handle).whole, moment.partition);
    let flies = |link: &BodyRef| region.flies(link.handle, moment.settings.dt_s);
    let is_fast = flies(&link) || launch::together(region, link).iter().any(flies);
    let ahead_s = if is_fast { launch::UNSEEN_TICKS } else { 1.0 } * moment.settings.dt_s;
    // That its island lies in one region was found in the last tick. What is fast may be out of it in the next.
    let margin_m = partition.halo_m();
    let near = match whole && !is_fast {
        true => RegionSet::EMPTY,
        false => launch::on_its_way(region, border, partition, link, ahead_s, margin_m),
    };
    let near = near.union(more);
    let reached = border.neighbours.reached(region.rank(), near);
    let holders = reached.union(region.slot(handle).holders).without(own);
    // A region that is behind takes in no body, and does not apply its own decisions.
    if !holders.is_empty() && border.neighbours.are_behind(holders.union(own)) {
        border.neighbours.wait_for(holders);
        region.keep_fresh(link);
    } else if !holders.is_empty() {
        let members = holders.union(own);
        // What meets it in one of these regions alone would find a part of its mass there, and a copy that does
        // not meet what the others meet would carry the body past it. So whole copies follow the one that is
        // struck or stopped, where islands move whole at all.
        let follows = moment.settings.coupling.moves_islands() && moment.settings.island_limit > 0;
        let warming = if whole || follows { holders } else { RegionSet::EMPTY };
        if let Some(shared) = border.shared.get_mut(handle) {
            // What its user has changed since the last step is in the record: it is owed to nobody.
            shared.own.velocity = convert::velocity_of(&region.physics().bodies[handle]);
        }
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

    use crate::physics::settings::WHOLE;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    /// A box is inserted so that it overlaps another one beside a border.
    #[test]
    fn what_is_inserted_into_another_at_a_border_pushes_it_as_hard_as_it_is_pushed() {
        for at in [0.1, 0.3, 0.45, 0.6, 0.9, -0.3, -0.6] {
            for (can_sleep, island_limit) in
                [(true, WHOLE), (false, WHOLE), (true, 256), (false, 8), (false, 3)]
            {
                let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
                let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
                (config.step.gravity, config.step.island_limit) = ([0.0; 3], island_limit);
                let mut world = LocalWorld::new(config).unwrap();
                let mut boxes = Vec::new();
                for x in [at, at + 0.85] {
                    let body = RigidBodyBuilder::dynamic().translation(Vector::X * x).can_sleep(can_sleep);
                    boxes.push(world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap());
                    (0..60).for_each(|_| world.step().unwrap());
                }
                let [a, b] = [0, 1].map(|i| world.velocity(boxes[i]).unwrap().linear[0]);
                assert!(
                    a < -0.07 && (a + b).abs() < 1e-5,
                    "at {at} m, sleep {can_sleep}, limit {island_limit}: {a}, {b} m/s"
                );
            }
        }
    }

    /// A ball that a loose one touches from behind is set off at a box behind a border.
    #[test]
    fn a_body_that_touches_another_and_is_set_off_hits_what_lies_behind_a_border() {
        let mut missed = Vec::new();
        for speed in [60.0, 150.0, 250.0, 350.0] {
            for (from_m, settles) in
                [(-0.6, 5), (-0.6, 200), (-1.2, 5), (-2.0, 5), (-2.0, 200), (-3.0, 5), (-3.8, 5), (-5.0, 200)]
            {
                let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
                let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
                config.step.gravity = [0.0; 3];
                let mut world = LocalWorld::new(config).unwrap();
                let at = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::X * x);
                let target = world.insert(at(1.0), ColliderBuilder::cuboid(0.4, 0.5, 0.5)).unwrap();
                let ball = ColliderBuilder::ball(0.3).density(5.0);
                let first = world.insert(at(from_m).ccd_enabled(true), ball.clone()).unwrap();
                world.insert(at(from_m - 0.599), ball).unwrap();
                // Both are awake, or both sleep.
                (0..settles).for_each(|_| world.step().unwrap());
                world.update(first, |body| body.set_linvel(Vector::X * speed, true)).unwrap();
                (0..20).for_each(|_| world.step().unwrap());
                if world.velocity(target).unwrap().linear[0] < 1.0 {
                    missed.push(format!("{speed} m/s from {from_m} m"));
                }
            }
        }
        assert!(missed.is_empty(), "{missed:?}");
    }

    /// A chain at rest is struck from behind, and flies at a box behind a border.
    #[test]
    fn a_chain_that_is_struck_hits_what_lies_behind_a_border() {
        let (mut unlike, mut hits) = (Vec::new(), 0);
        for links in [2, 4] {
            for speed in [60.0, 80.0, 120.0, 160.0, 200.0] {
                for head_m in [-0.6, -1.0, -2.0, -3.0, -4.0, -5.0, -6.0] {
                    let [one, two] = [false, true].map(|is_cut| hits_box(links, speed, head_m, is_cut));
                    hits += usize::from(one);
                    if one != two {
                        unlike.push(format!("{links} links, {head_m} m, {speed} m/s"));
                    }
                }
            }
        }
        assert!(unlike.is_empty() && hits > 50, "{hits} hits in one world, {} {unlike:#?}", unlike.len());
    }

    /// Returns whether the first link of a chain hits the box.
    fn hits_box(links: usize, speed: f32, head_m: f32, is_cut: bool) -> bool {
        let cuts = is_cut.then_some((Axis::X, 0.0)).into_iter().collect();
        let mut config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        let mut world = LocalWorld::new(config).unwrap();
        let at = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::X * x);
        let outline = ColliderBuilder::cuboid(0.5, 0.5, 0.5).active_events(ActiveEvents::COLLISION_EVENTS);
        let target = world.insert(at(0.6), outline).unwrap();
        let (mut former, mut head) = (None, None);
        for link in 0..links {
            let ball = at(head_m - link as f32 * 1.7).ccd_enabled(true);
            let ball = world.insert(ball, ColliderBuilder::ball(0.5).mass(3.0)).unwrap();
            head.get_or_insert(ball);
            if let Some(former) = former.replace(ball) {
                let joint = SphericalJointBuilder::new();
                let joint = joint.local_anchor1(Vector::X * -0.85).local_anchor2(Vector::X * 0.85);
                world.insert_joint(former, ball, joint).unwrap();
            }
        }
        let striker = at(head_m - links as f32 * 1.7 - 3.0).linvel(Vector::X * speed).ccd_enabled(true);
        world.insert(striker, ColliderBuilder::ball(0.6).mass(150.0)).unwrap();
        (0..20).any(|_| {
            world.step().unwrap();
            let touches = &world.events().touches;
            touches.iter().any(|touch| touch.key.other(target).is_some_and(|other| Some(other) == head))
        })
    }

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
