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
use super::{Border, Moment, Side};
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::CopyState;
use crate::space::{Bounds, RegionSet};

/// The distance, metres, by which a copy of a body in flight must be behind another to count as stopped.
const STOPPED_M: f32 = 0.01;

/// The number of ticks in which a body that begins to fly may meet what nobody has predicted.
pub(super) const UNSEEN_TICKS: f32 = AHEAD_TICKS + 1.0;

/// Returns a body and all that joints tie to it; nothing where no joint does. These are shared alike, or
/// regions would not follow the same copy of all of them.
pub(super) fn together(region: &Region, link: BodyRef) -> &[BodyRef] {
    let assembly = region.slot(link.handle).assembly;
    assembly.map_or(&[], |place| &region.assemblies()[place as usize].members)
}

/// Returns the regions to whose cells a body, or what joints tie it to, comes within a time, within a margin, and those
/// whose bodies reach out of their cells to its way, as far as they have said so here. One that is behind the present
/// time takes in no body, and is not waited for.
pub(super) fn on_its_way(
    region: &Region,
    border: &Border,
    partition: &Partition,
    link: BodyRef,
    ahead_s: f32,
    margin_m: f64,
) -> RegionSet {
    let behind = border.neighbours.behind();
    let found = |way: Bounds| partition.touching(&way).union(border.predicted.reaching(&way).without(behind));
    ways_of(region, link, ahead_s, margin_m).map(found).fold(RegionSet::EMPTY, RegionSet::union)
}

/// Returns boxes around the ways of a body and of all that joints tie to it.
fn ways_of(region: &Region, link: BodyRef, ahead_s: f32, margin_m: f64) -> impl Iterator<Item = Bounds> {
    let all = together(region, link).iter().copied().chain([link]);
    all.map(move |link| way_of(region, link.handle, ahead_s, margin_m))
}

/// Returns whether a body flies so far that its next owner would not be told in time of what it comes to: a
/// region hears of others that are not beside it only from the next meeting of all regions on. The present
/// owner has asked for them at the last one.
pub(super) fn outruns(region: &Region, moment: Moment<'_>, link: BodyRef, owner: usize) -> bool {
    let (partition, dt_s) = (moment.partition, moment.settings.dt_s);
    if !region.physics().bodies.contains(link.handle) || !region.flies(link.handle, dt_s) {
        return false;
    }
    // It arrives in the next tick, and is compared with what is there in the one after.
    let ticks = ticks_to_meeting(moment.tick) as f32 + UNSEEN_TICKS;
    let way = way_of(region, link.handle, ticks * dt_s, partition.halo_m());
    partition.touching(&way).iter().any(|rank| !are_beside(partition, owner, rank))
}

fn way_of(region: &Region, handle: RigidBodyHandle, ahead_s: f32, margin_m: f64) -> Bounds {
    let bounds = match region.slot(handle).reach_m.is_finite() {
        true => region.world_bounds(handle),
        false => Bounds::around([0.0; 3], [f64::INFINITY; 3]),
    };
    let velocity = region.physics().bodies[handle].linvel().to_array();
    bounds.swept(velocity, ahead_s.into()).grown(margin_m)
}

/// Marks for announcement the bodies that their user has sped up since the last step and that fly into other
/// regions soon, and those that their user has put beside what other regions own, or has let touch it. Returns
/// whether one of them flies to regions that this one hears of only from the next meeting of all on.
pub(super) fn expect(side: &mut Side, moment: Moment<'_>) -> bool {
    let Side { region, border, .. } = side;
    let (launched, appeared) = (region.take_launched(), region.take_appeared());
    if launched.is_empty() && appeared.is_empty() {
        return false;
    }
    let is_here = |link: &BodyRef| region.role_of(link.handle) == Some((link.id, Ownership::Owner));
    let outruns = |link: &BodyRef| is_here(link) && outruns(region, moment, *link, region.rank());
    let any_outruns = launched.iter().chain(&appeared).any(outruns);
    // Some of the tied bodies may be gone.
    region.update_assemblies();
    let mut known: BTreeSet<_> = region.fresh().map(|link| link.id).collect();
    let flies = |link: &BodyRef| region.flies(link.handle, moment.settings.dt_s);
    let near = |link: &BodyRef| comes_near(region, border, moment, *link);
    let launched = launched.into_iter().filter(|link| near(link) && flies(link));
    let found: Vec<_> = launched.chain(appeared.into_iter().filter(near)).collect();
    for link in found {
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
        flies_off(region, border, moment, *link, 1.0, moment.partition.halo_m())
            && region.joints_of(link.handle).next().is_none()
            // Its ghosts would not wait either.
            && region.slot(link.handle).holders.is_empty()
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

/// Returns whether a body owned here flies within some ticks to within a margin of other regions, or of their
/// bodies, that do not hold it. A body that others hold does so only while nothing strikes it: if it were sent
/// anew then, impulses on its copies would be lost.
pub(super) fn flies_off(
    region: &Region,
    border: &Border,
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
    let holders = region.slot(handle).holders;
    let is_struck = || {
        let shared = border.shared.get(handle);
        region.is_pressed(handle)
            || shared.is_some_and(|shared| {
                shared.is_split() || !shared.strikes.is_empty() || shared.owed.is_some()
            })
    };
    if !body.is_dynamic()
        || region.is_articulated(handle)
        || !region.flies(handle, tick_s)
        || !holders.is_empty() && is_struck()
    {
        return false;
    }
    let held = holders.union(RegionSet::only(region.rank()));
    let near = on_its_way(region, border, moment.partition, link, ticks * tick_s, margin_m);
    !near.without(held).is_empty()
}

/// Returns whether a body owned here comes near regions within some ticks that do not hold it yet, or near their bodies.
/// Where it flies those that hold it count, too: they might drop it in this tick.
fn comes_near(region: &Region, border: &Border, moment: Moment<'_>, link: BodyRef) -> bool {
    let BodyRef { id, handle } = link;
    let is_here =
        region.physics().bodies.contains(handle) && region.role_of(handle) == Some((id, Ownership::Owner));
    if !is_here || region.is_articulated(handle) {
        return false;
    }
    let flies = region.flies(handle, moment.settings.dt_s);
    // What its user moves in each tick is held by whom it is about to touch.
    if !flies && !region.physics().bodies[handle].is_dynamic() {
        return false;
    }
    let own = RegionSet::only(region.rank());
    let (ahead_s, margin_m) = (UNSEEN_TICKS * moment.settings.dt_s, moment.partition.halo_m());
    let near = on_its_way(region, border, moment.partition, link, ahead_s, margin_m);
    let held = if flies { own } else { region.slot(handle).holders.union(own) };
    !near.without(held).is_empty()
}

/// Returns how far, in micrometres, a copy of a fast body is behind another one because it was stopped on its
/// way in the last tick, or in the one before. Rapier stops a flying body where it is about to hit something,
/// and lets it touch that in the next step. Returns 0 for copies that are side by side, farther apart than two
/// ticks take them, or slow. Two: a region to which a body was sent in the exchange that told of its stop begins
/// a tick's way ahead of it.
pub(super) fn stopped_um(ahead: &CopyState, copy: &CopyState, leap_m: f32, tick_s: f32) -> i64 {
    let way_m = way_m(ahead, tick_s);
    if way_m <= leap_m {
        return 0;
    }
    let motion = Vector::from_array(ahead.velocity.linear);
    let apart = |i: usize| (ahead.pose.translation[i] - copy.pose.translation[i]) as f32;
    let behind_m = Vector::from_array(std::array::from_fn(apart)).dot(motion.normalize_or_zero());
    if (STOPPED_M..=2.02 * way_m).contains(&behind_m) { (behind_m * 1e6) as i64 } else { 0 }
}

/// Returns how far a copy flies in a tick, metres.
pub(super) fn way_m(copy: &CopyState, tick_s: f32) -> f32 {
    Vector::from_array(copy.velocity.linear).length() * tick_s
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::protocol::WorldPose;
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

    /// A ball has crossed narrow regions, which still hold it, and has come into the one beside that of a block.
    #[test]
    fn a_ball_that_regions_behind_it_still_hold_is_stopped_by_what_is_before_it() {
        let planes: Vec<_> = (-4..3).map(|i| 3.0 * f64::from(i)).collect();
        let mut passed = Vec::new();
        for speed in [36.0, 50.0, 52.0, 55.0, 60.0, 80.0] {
            for phase in 0..12 {
                let start_m = -14.0 + speed / 60.0 * f64::from(phase) / 12.0;
                for block_m in [3.4, 3.6, 4.5] {
                    let (ball, block) = cross(&planes, start_m, speed as f32, block_m);
                    if ball > block {
                        passed.push(format!("{speed} m/s from {start_m} m, block at {block_m} m"));
                    }
                }
            }
        }
        assert!(passed.is_empty(), "{passed:#?}");
    }

    /// Shoots a ball over these planes at a block. Returns where both are when it should have hit.
    fn cross(planes: &[f64], start_m: f64, speed: f32, block_m: f32) -> (f64, f64) {
        let mut cuts = Vec::new();
        middle_first(planes, &mut cuts);
        let mut config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        config.bounds = Bounds::around([-3.0, 0.0, 0.0], [12.0, 4.0, 4.0]);
        let mut world = LocalWorld::new(config).unwrap();
        let block = RigidBodyBuilder::dynamic().translation(Vector::X * block_m);
        let block = world.insert(block, ColliderBuilder::cuboid(0.3, 1.0, 1.0).density(1000.0)).unwrap();
        let ball = RigidBodyBuilder::dynamic().ccd_enabled(true).translation(Vector::X * start_m as f32);
        let ball = ball.linvel(Vector::X * speed);
        let ball = world.insert(ball, ColliderBuilder::ball(0.15).density(3000.0)).unwrap();
        for _ in 0..(20.0 / f64::from(speed) * 60.0) as usize {
            world.step().unwrap();
        }
        let x_of = |id| world.pose(id).unwrap().translation[0];
        (x_of(ball), x_of(block))
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

    /// One in two hundred is handed over on its way, and what lies past the edge hears of it a tick too late.
    #[test]
    fn a_bullet_hits_past_an_edge_what_it_hits_in_one_world() {
        let unlike = unlike(300);
        assert!(unlike.len() <= 3, "{} {unlike:#?}", unlike.len());
    }

    #[test]
    #[ignore = "minutes; prints how many of 6,000 do not"]
    fn bullets_past_edges_hit_what_they_hit_in_one_world() {
        let unlike = unlike(6_000);
        println!("{} of 6,000 shots do otherwise than in one world", unlike.len());
        assert!(unlike.len() <= 60, "{unlike:#?}");
    }

    /// Bullets fly from one region into a second, past the edge where both meet a third one, at a box that the third
    /// one has and that reaches into the second. Returns those that miss it and hit it in one world, or the reverse.
    fn unlike(shots: usize) -> Vec<Shot> {
        let mut dice = ChaCha8Rng::seed_from_u64(5);
        let mut unlike = Vec::new();
        for shot in 0..shots {
            let mut roll =
                |from: f32, to: f32| from + (to - from) * (dice.next_u32() as f32 / u32::MAX as f32);
            let mut vector = |most: f32| Vector::from_array(std::array::from_fn(|_| roll(-most, most)));
            let (tilt, drift) = (vector(0.05), vector(1.0));
            let (behind_m, aside_m, path_m) = (roll(0.2, 4.0), roll(0.05, 0.3), roll(-0.6, -0.35));
            // What flies along the first axis passes the edge along the third one.
            let turned = |along: f32, across: f32, level: f32| {
                let mut turned = [0.0; 3];
                let sign = if shot % 4 < 2 { 1.0 } else { -1.0 };
                for (i, value) in [along, across, level].into_iter().enumerate() {
                    turned[(i + shot) % 3] = sign * value;
                }
                Vector::from_array(turned)
            };
            let shot = Shot {
                speed: [20.0, 40.0, 80.0, 150.0, 300.0][shot % 5],
                heading: (turned(1.0, 0.0, 0.0) + tilt).normalize(),
                target: turned(behind_m, path_m, 0.7),
                middle: turned(behind_m, aside_m, 0.7),
                half: turned(roll(0.15, 0.8), aside_m - path_m + 0.1, 0.5).abs(),
                drift: if shot % 2 == 0 { drift } else { Vector::ZERO },
                start: shot % 3,
                ticks: roll(0.5, 12.0),
                ccd: shot % 7 < 4,
            };
            if shot.hits(&[Axis::X, Axis::Y, Axis::Z]) != shot.hits(&[]) {
                unlike.push(shot);
            }
        }
        unlike
    }

    /// A bullet that flies at a box.
    #[derive(Debug)]
    struct Shot {
        speed: f32,
        heading: Vector,
        /// Where it meets the box, and the middle, half size and velocity of that.
        target: Vector,
        middle: Vector,
        half: Vector,
        drift: Vector,
        /// The tick in which the bullet is set off, and the ticks that it flies.
        start: usize,
        ticks: f32,
        ccd: bool,
    }

    impl Shot {
        /// Returns whether the bullet hits the box in a world that planes through its origin cut.
        fn hits(&self, cuts: &[Axis]) -> bool {
            let cuts = cuts.iter().map(|&axis| (axis, 0.0)).collect();
            let mut config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
            config.step.gravity = [0.0; 3];
            let mut world = LocalWorld::new(config).unwrap();
            let tick_s = 1.0 / 60.0;
            let before_s = (self.start as f32 + self.ticks) * tick_s;
            let met = RigidBodyBuilder::dynamic().linvel(self.drift);
            let met = met.translation(self.middle - self.drift * before_s);
            let outline = ColliderBuilder::cuboid(self.half.x, self.half.y, self.half.z);
            world.insert(met, outline.density(100.0)).unwrap();
            let way_m = self.half.length() + 0.3 + self.ticks * self.speed * tick_s;
            let bullet = RigidBodyBuilder::dynamic().ccd_enabled(self.ccd).can_sleep(false);
            let bullet = bullet.translation(self.target - self.heading * way_m);
            let radius_m = if self.ccd { 0.1 } else { 0.3 };
            let bullet = world.insert(bullet, ColliderBuilder::ball(radius_m)).unwrap();
            for _ in 0..self.start {
                world.step().unwrap();
            }
            let flies = self.heading * self.speed;
            world.update(bullet, |body| body.set_linvel(flies, true)).unwrap();
            for _ in 0..self.ticks as usize + 10 {
                world.step().unwrap();
            }
            let velocity = world.velocity(bullet).unwrap().linear;
            (Vector::from_array(velocity) - flies).length() > 0.01
        }
    }

    /// Orders planes from the middle on, so that the tree is not too deep.
    fn middle_first(places: &[f64], planes: &mut Vec<(Axis, f64)>) {
        if let Some(&middle) = places.get(places.len() / 2) {
            planes.push((Axis::X, middle));
            middle_first(&places[..places.len() / 2], planes);
            middle_first(&places[places.len() / 2 + 1..], planes);
        }
    }

    /// Says how a box comes to hit another one that another region owns.
    #[derive(Clone, Copy, Debug)]
    enum Set {
        Off,
        Elsewhere,
        InFrontOf,
        Enabled,
        Solid,
        Kinematic,
    }

    /// Two boxes lie side by side on a border, each owned by another region. One is set off at the other, along the border.
    /// Returns after how many ticks the other moves, and how fast, if it does.
    fn hit_along_a_border(is_cut: bool, set: Set, speed: f32, gap_m: f32, ccd: bool) -> Option<(usize, f32)> {
        let cuts = is_cut.then_some((Axis::Z, 0.0)).into_iter().collect();
        let mut config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        let mut world = LocalWorld::new(config).unwrap();
        let away = |is_so: bool| if is_so { 5.0 } else { 0.0 };
        let one_at = Vector::new(0.0, away(matches!(set, Set::Elsewhere)), 0.1);
        let other_at = Vector::new(0.6 + gap_m, away(matches!(set, Set::InFrontOf)), -0.1);
        let moves = Vector::X * speed;
        let kind = match set {
            Set::Kinematic => RigidBodyType::KinematicVelocityBased,
            _ => RigidBodyType::Dynamic,
        };
        let one = RigidBodyBuilder::new(kind).translation(one_at).ccd_enabled(ccd);
        let one = match set {
            Set::Enabled => one.enabled(false),
            Set::InFrontOf => one.translation(one_at - moves * 0.2).linvel(moves),
            _ => one,
        };
        let cube = ColliderBuilder::cuboid(0.3, 0.3, 0.3).friction(0.0);
        let air = cube.clone().collision_groups(InteractionGroups::none());
        let of_one = if matches!(set, Set::Solid) { air } else { cube.clone() };
        let one = world.insert(one, of_one).unwrap();
        let other = RigidBodyBuilder::dynamic().translation(other_at).ccd_enabled(ccd);
        let other = world.insert(other, cube).unwrap();
        (0..12).for_each(|_| world.step().unwrap());
        match set {
            Set::Elsewhere => world.set_pose(one, WorldPose::at([0.0, 0.0, 0.1])).unwrap(),
            Set::InFrontOf => {
                world.set_pose(other, WorldPose::at([0.6 + f64::from(gap_m), 0.0, -0.1])).unwrap();
            }
            Set::Enabled => world.update(one, |body| body.set_enabled(true)).unwrap(),
            Set::Solid => world
                .update_collider(one, 0, |own| own.set_collision_groups(InteractionGroups::all()))
                .unwrap(),
            Set::Off | Set::Kinematic => {}
        }
        world.update(one, |body| body.set_linvel(moves, true)).unwrap();
        (0..20).find_map(|tick| {
            world.step().unwrap();
            let speed = world.velocity(other).unwrap().linear[0];
            (speed > 0.5).then_some((tick, speed))
        })
    }

    #[test]
    fn what_is_set_off_along_a_border_hits_what_lies_beside_it_there_as_soon_as_in_one_world() {
        let mut unlike = Vec::new();
        for set in [Set::Off, Set::Elsewhere, Set::InFrontOf, Set::Enabled, Set::Solid, Set::Kinematic] {
            for speed in [8.0, 10.0, 13.0, 18.0, 23.4, 28.0] {
                for gap_m in [0.02, 0.1, 0.2, 0.3, 0.45, 0.57] {
                    for ccd in [false, true] {
                        let hit = |is_cut| hit_along_a_border(is_cut, set, speed, gap_m, ccd);
                        let (one, two) = (hit(false), hit(true));
                        let alike = |(a, b): ((usize, f32), (usize, f32))| {
                            a.0 == b.0 && (a.1 - b.1).abs() < 0.05 * a.1
                        };
                        if !one.zip(two).is_some_and(alike) {
                            unlike.push(format!(
                                "{set:?}, {speed} m/s over {gap_m} m, CCD {ccd}: {two:?}, in one region {one:?}"
                            ));
                        }
                    }
                }
            }
        }
        assert!(unlike.is_empty(), "{} {unlike:#?}", unlike.len());
    }

    /// A ball with CCD sleeps or rests close to a free plate that stands over a border, and is set off at it some ticks
    /// later. Returns whether it passes.
    fn passes_a_plate(is_cut: bool, asleep: bool, waits: usize, aside_m: f32, gap_m: f32) -> bool {
        let cuts = is_cut.then_some((Axis::Z, 0.0)).into_iter().collect();
        let mut config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        let mut world = LocalWorld::new(config).unwrap();
        let plate = RigidBodyBuilder::dynamic().translation(Vector::new(-0.23, 1.0, 0.0));
        let plate = world.insert(plate, ColliderBuilder::cuboid(0.15, 1.0, 1.0)).unwrap();
        let at = Vector::new(-0.76 - gap_m, 1.0, aside_m);
        let ball = RigidBodyBuilder::dynamic().translation(at).ccd_enabled(true).sleeping(asleep);
        let ball = world.insert(ball, ColliderBuilder::ball(0.38)).unwrap();
        (0..waits).for_each(|_| world.step().unwrap());
        world.update(ball, |body| body.set_linvel(Vector::X * 25.1, true)).unwrap();
        (0..10).for_each(|_| world.step().unwrap());
        world.pose(ball).unwrap().translation[0] > world.pose(plate).unwrap().translation[0]
    }

    #[test]
    fn a_ball_that_rested_before_a_plate_on_a_border_does_not_pass_it_whenever_it_is_set_off() {
        let mut passed = Vec::new();
        for asleep in [false, true] {
            for waits in 0..16 {
                for aside_m in [-0.3, -0.1, 0.1, 0.3] {
                    for gap_m in [0.04, 0.12, 0.2, 0.28] {
                        let passes = |is_cut| passes_a_plate(is_cut, asleep, waits, aside_m, gap_m);
                        if passes(true) && !passes(false) {
                            passed.push(format!(
                                "asleep {asleep}, after {waits}, {aside_m} m aside, {gap_m} m before"
                            ));
                        }
                    }
                }
            }
        }
        assert!(passed.is_empty(), "{} {passed:#?}", passed.len());
    }

    /// A kinematic box is made dynamic, and set off at a row of sleepers at the edge of four regions.
    #[test]
    fn a_body_that_is_made_dynamic_and_set_off_has_the_speed_that_it_was_given() {
        let mut wrong = Vec::new();
        for z in [0.3, 0.5, 0.7] {
            for x in [1.5, 1.7, 1.9] {
                for waits in [3, 10] {
                    let cuts = vec![(Axis::X, 0.0), (Axis::Z, 0.0)];
                    let mut config =
                        WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
                    config.step.gravity = [0.0; 3];
                    let mut world = LocalWorld::new(config).unwrap();
                    for i in 0..3_i16 {
                        let at = Vector::new(0.8 - 0.81 * f32::from(i), 1.0, z);
                        let sleeper = RigidBodyBuilder::dynamic().translation(at).sleeping(true);
                        world.insert(sleeper, ColliderBuilder::cuboid(0.4, 0.4, 0.4)).unwrap();
                    }
                    let at = Vector::new(x, 1.0, z);
                    let body = RigidBodyBuilder::kinematic_velocity_based().translation(at).ccd_enabled(true);
                    let id = world.insert(body, ColliderBuilder::cuboid(0.35, 0.35, 0.35)).unwrap();
                    (0..waits).for_each(|_| world.step().unwrap());
                    world.update(id, |body| body.set_body_type(RigidBodyType::Dynamic, true)).unwrap();
                    world.update(id, |body| body.set_linvel(Vector::X * -15.0, true)).unwrap();
                    world.step().unwrap();
                    let speed = world.velocity(id).unwrap().linear[0];
                    if speed < -15.01 {
                        wrong.push(format!("{x}, {z}, after {waits}: {speed} m/s"));
                    }
                }
            }
        }
        assert!(wrong.is_empty(), "{} {wrong:#?}", wrong.len());
    }
}
