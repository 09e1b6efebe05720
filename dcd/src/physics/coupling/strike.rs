//! Settles contacts of bodies that different regions hold, so that what one body loses the other gains.
//!
//! Each body follows the copy of one region (`leader`). Two bodies that touch may follow different regions,
//! at the corner of three regions, and each of these finds another impulse. A body that nobody expected is
//! held by its owner alone, so that the region which the other body follows knows nothing of it.
//!
//! So all regions that hold both bodies tell the impulse that they found to the holders of both, and one of
//! these impulses counts for both bodies: that of the region which sees most of what touches, and of equals
//! that which owns most of it. Each body gets it in place of the impulse that its own leader found, if that found any.
//!
//! A whole body may strike a split body. The regions that hold both each find the impulse anew, and the whole
//! body gets one of these impulses; so each copy of the split body counts one share (`counted`). Each region
//! solves for a lighter body than there is, so that the impact is softer than it should be. Where a copy lies
//! so that its region sees the impact a step before the others do, its share is too small. Bodies that are
//! about to touch a split island are split before, so that this is rare.
//!
//! Bodies that are not dynamic need no such justice: one region tells its impulse to the regions that did not
//! see it. The copy of a new holder is told in the same way what happened in the exchange in which it was
//! sent.
//!
//! Rapier tells a normal impulse exactly, but the friction of an impact and the place where it acts only
//! roughly (`impulse`). So the impulse of a body's only contact is taken from how the body moved. Impulses of
//! joints are not told.

use std::cmp::Reverse;

use rapier3d::prelude::*;

use super::island::Islands;
use super::shared::{Dealt, Shared, SharedBodies};
use crate::physics::convert;
use crate::physics::impulse::{pair_impulse_ns, solved_points};
use crate::physics::region::Region;
use crate::protocol::{CopyState, Impulse, Strike, Velocity};
use crate::space::RegionSet;

/// The most bodies striking one body that a region tells of, and that others believe, in one exchange.
const MOST: usize = 512;
/// The gain of speed, m/s, below which a copy with a part of the mass counts as loaded, not as struck.
const IMPACT_M_S: f32 = 0.5;

/// Notes the impulses on a copy here in the last step from bodies that are not held by the same regions, and
/// the impulse that is owed.
pub(super) fn note(region: &Region, islands: &Islands, handle: RigidBodyHandle, shared: &mut Shared) {
    let Shared { members, strikes, owed, .. } = shared;
    let (own, id) = (region.rank(), region.slot(handle).id);
    strikes.extend(owed.take().map(|strike| (own, strike)));
    if region.mass_split(handle).is_some_and(|split| split.is_broken()) {
        return;
    }
    region.for_each_pair(handle, |other, pair| {
        let held_by = region.slot(other).holders.union(RegionSet::only(own));
        let is_sound = !region.mass_split(other).is_some_and(|split| split.is_broken());
        let Some(pair) = pair.filter(|_| held_by != *members && is_sound) else { return };
        let is_dynamic = region.physics().bodies[other].is_dynamic();
        let tells = held_by.intersection(*members).iter().next() == Some(own);
        if !is_dynamic && (!tells || members.without(held_by).is_empty()) {
            return;
        }
        let impulse = impulse_on(region, handle, pair);
        if impulse == Impulse::default() || !impulse.is_finite() {
            return;
        }
        let by = is_dynamic.then(|| region.slot(other).id);
        let seen = islands.seen(handle).max(islands.seen(other));
        let size = islands.size(handle).max(islands.size(other));
        // One body may have several pairs, in several substeps.
        let same =
            |(rank, strike): &(usize, Strike)| (*rank, strike.by, strike.held_by) == (own, by, held_by);
        match strikes.iter().position(same) {
            Some(place) => {
                let strike = &mut strikes[place].1;
                strike.impulse = strike.impulse.plus(&impulse);
                (strike.seen, strike.size) = (strike.seen.max(seen), strike.size.max(size));
            }
            None if strikes.len() < MOST => {
                strikes.push((own, Strike { id, by, seen, size, held_by, impulse }))
            }
            None => {}
        }
    });
}

/// Returns the impulse of a pair on one of its bodies in the last step; zero on a body that dominates the
/// other.
fn impulse_on(region: &Region, handle: RigidBodyHandle, pair: &ContactPair) -> Impulse {
    let world = region.physics();
    let is_second = world.colliders[pair.collider2].parent() == Some(handle);
    let dominates = |manifold: &ContactManifold| {
        let over = manifold.data.relative_dominance;
        if is_second { over < 0 } else { over > 0 }
    };
    if !pair.has_any_active_contact() || pair.solver_manifolds().iter().any(dominates) {
        return Impulse::default();
    }
    let impulse = impulse_of(region, pair);
    let impulse = if is_second { impulse } else { -impulse };
    Impulse { linear: impulse.to_array(), angular: arm(pair, is_second).cross(impulse).to_array() }
}

/// Returns the impulse of a pair on its second body. Friction is exact where it is known from how one of the two
/// moved: nothing else touched that one.
fn impulse_of(region: &Region, pair: &ContactPair) -> Vector {
    let world = region.physics();
    let found = |collider: ColliderHandle| {
        let body = world.colliders[collider].parent().filter(|&body| region.is_touched_once(body))?;
        region.push_in_step(body, world.integration_parameters.dt)
    };
    let found = [found(pair.collider1).map(|push| push.map(|push| push.map(|v| -v))), found(pair.collider2)];
    let told = pair_impulse_ns(world, pair);
    let along = |i: usize| found.iter().flatten().find_map(|push| push[i]).unwrap_or(told[i] as f32);
    Vector::from_array(std::array::from_fn(along))
}

/// Returns the lever arm of an impulse on a body: from its centre of mass to the mean of the points that
/// touch, weighed by their impulses.
fn arm(pair: &ContactPair, is_second: bool) -> Vector {
    let points = pair.solver_manifolds().iter().flat_map(solved_points);
    let (sum, weight) = points.fold((Vector::ZERO, 0.0), |(sum, weight), data| {
        let arm = if is_second { data.solver_dp2 } else { data.solver_dp1 };
        (sum + arm * data.impulse, weight + data.impulse)
    });
    if weight > 0.0 { sum / weight } else { Vector::ZERO }
}

/// Notes how this exchange changed a copy's velocity, if the copy has been sent to new members as it was
/// before: these are to be told.
pub(super) fn owe(region: &Region, all: &mut SharedBodies, handle: RigidBodyHandle, members: RegionSet) {
    let body = &region.physics().bodies[handle];
    let Some(shared) = all.get_mut(handle).filter(|shared| !shared.is_split() && body.is_dynamic()) else {
        return;
    };
    let held_by = members.intersection(shared.members);
    let sent = &shared.own.velocity;
    let (linear, angular) =
        (body.linvel() - convert::vector(sent.linear), body.angvel() - convert::vector(sent.angular));
    if held_by == members || (linear, angular) == (Vector::ZERO, Vector::ZERO) {
        return;
    }
    let local = &body.mass_properties().local_mprops;
    let rotation = *body.rotation() * local.principal_inertia_local_frame;
    let angular = rotation * (local.principal_inertia() * (rotation.inverse() * angular));
    let impulse = Impulse { linear: (linear / local.inv_mass).to_array(), angular: angular.to_array() };
    let owed = Strike { id: shared.own.id, by: None, seen: 0, size: 0, held_by, impulse };
    shared.owed = owed.impulse.is_finite().then_some(owed);
}

/// Stores the impulses on copies that another region tells, as all holders of the copies do. All impulses on
/// one body come together.
pub(super) fn hear(region: &Region, shared: &mut SharedBodies, strikes: &[Strike], sender: usize) {
    for of_one in strikes.chunk_by(|a, b| a.id == b.id) {
        let shared = region.handle_of(of_one[0].id).and_then(|handle| shared.get_mut(handle));
        if let Some(shared) = shared.filter(|shared| shared.members.contains(sender)) {
            shared.strikes.extend(of_one.iter().take(MOST).map(|strike| (sender, *strike)));
        }
    }
}

/// Returns the velocity of a leader's copy with the impulses that the leader did not see, or found otherwise
/// than the region that counts; `None` if there are none. All regions add them up in the same order, to the
/// same bits.
pub(super) fn struck(
    body: &RigidBody,
    copy: &CopyState,
    leader: usize,
    strikes: &mut [(usize, Strike)],
) -> Option<Velocity> {
    strikes.sort_by_key(|(rank, strike)| (strike.by, *rank, strike.held_by));
    let by_one = strikes.chunk_by(|(_, a), (_, b)| a.by == b.by);
    let missed = by_one.flat_map(|told| missed(told, leader));
    let sum = missed.reduce(|sum, impulse| sum.plus(&impulse))?;
    pushed(body, Rotation::from_array(copy.pose.rotation), &copy.velocity, &sum)
}

/// Returns the velocity of a leader's copy after impulses that it did not find, but along the change no faster
/// than the fastest copy. What lies between a heavy body and the ground would be flung away otherwise, and the
/// heavy body would be stopped by each region anew: what the ground answers is in none of these impulses.
pub(super) fn bounded<'a>(
    copy: &Velocity,
    struck: &Velocity,
    copies: impl Iterator<Item = &'a Velocity> + Clone,
) -> Velocity {
    let bound = |of: fn(&Velocity) -> [f32; 3]| {
        let (from, to) = (convert::vector(of(copy)), convert::vector(of(struck)));
        let along = (to - from).normalize_or_zero();
        let gains = copies.clone().map(|copy| (convert::vector(of(copy)) - from).dot(along));
        (from + along * gains.fold(0.0, f32::max).min((to - from).length())).to_array()
    };
    Velocity { linear: bound(|velocity| velocity.linear), angular: bound(|velocity| velocity.angular) }
}

/// Returns the velocity of a body after an impulse; `None` if it is not finite.
fn pushed(body: &RigidBody, rotation: Rotation, velocity: &Velocity, by: &Impulse) -> Option<Velocity> {
    // Only these masses know of locked axes.
    let mut mass = body.mass_properties().clone();
    mass.update_world_mass_properties(body.body_type(), &Pose::from_parts(Vector::ZERO, rotation));
    let linear = convert::vector(velocity.linear) + convert::vector(by.linear) * mass.effective_inv_mass;
    let angular =
        convert::vector(velocity.angular) + mass.effective_world_inv_inertia * convert::vector(by.angular);
    let is_finite = linear.is_finite() && angular.is_finite();
    is_finite.then(|| Velocity { linear: linear.to_array(), angular: angular.to_array() })
}

/// Notes the impulses of whole bodies in the last step on a copy with a part of its body's mass, where other
/// regions whose copies count hold the whole body too. Each of these regions finds the same impulse, and one
/// share of it counts.
pub(super) fn note_shares(region: &Region, handle: RigidBodyHandle, shared: &mut Shared) {
    let own = RegionSet::only(region.rank());
    let counting = shared.members.without(shared.warming);
    if !counting.contains(region.rank()) || !region.physics().bodies[handle].is_dynamic() {
        return;
    }
    let Dealt { all, beyond } = &mut shared.dealt;
    region.for_each_pair(handle, |other, pair| {
        let slot = region.slot(other);
        let is_whole = slot.mass_split.as_deref().is_none_or(|split| !split.is_split());
        let Some(pair) = pair.filter(|_| is_whole && !slot.holders.is_empty()) else { return };
        let times = slot.holders.union(own).intersection(counting).len();
        let world = region.physics();
        let yields = world.bodies[other].is_dynamic()
            && world.bodies[other].mass_properties().effective_inv_mass != Vector::ZERO
            && pair.solver_manifolds().iter().all(|manifold| manifold.data.relative_dominance == 0);
        if times > 1 && yields {
            let impulse = impulse_on(region, handle, pair);
            *all = all.plus(&impulse);
            *beyond = beyond.plus(&impulse.scaled(1.0 - 1.0 / times as f32));
        }
    });
}

/// Returns the velocity with which such a copy counts: after an impact, without what is beyond its share.
/// What other bodies took from the copy in the same steps is not taken again: a body that the ground holds
/// has not moved, and what rests on it is no impact.
pub(super) fn counted(
    region: &Region,
    handle: RigidBodyHandle,
    dealt: &Dealt,
    velocity: &Velocity,
) -> Velocity {
    let body = &region.physics().bodies[handle];
    let began = region.mass_split(handle).and_then(|split| split.began_with());
    let Some(began) = began.filter(|_| dealt.beyond != Impulse::default()) else { return *velocity };
    let rotation = *body.rotation();
    let still = Velocity::default();
    let change = |impulse: &Impulse| {
        pushed(body, rotation, &still, impulse).map_or(Vector::ZERO, |v| convert::vector(v.linear))
    };
    let struck = change(&dealt.all);
    let gained_m_s = (body.linvel() - began).dot(struck.normalize_or_zero());
    if gained_m_s < IMPACT_M_S {
        return *velocity;
    }
    let part = (gained_m_s / struck.length()).min(1.0);
    pushed(body, rotation, velocity, &dealt.beyond.scaled(-part)).unwrap_or(*velocity)
}

/// Returns what a leader's copy lacks of the impulses that were told of one striking body, in parts.
fn missed(told: &[(usize, Strike)], leader: usize) -> impl Iterator<Item = Impulse> {
    // As leaders are chosen, so that of bodies that follow one region both keep what they have.
    let best = told.iter().max_by_key(|(rank, strike)| (strike.seen, strike.size, Reverse(*rank)));
    let counts = best.filter(|(_, strike)| strike.by.is_some()).map(|(rank, _)| *rank);
    told.iter().filter_map(move |(rank, strike)| match counts {
        None => (!strike.held_by.contains(leader)).then_some(strike.impulse),
        Some(counts) if counts == leader => None,
        Some(counts) if counts == *rank => Some(strike.impulse),
        Some(_) => (*rank == leader).then(|| strike.impulse.scaled(-1.0)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::BodyId;

    fn strike(held_by: &[usize], linear: [f32; 3]) -> Strike {
        let impulse = Impulse { linear, angular: [0.0, 0.0, 1.0] };
        let held_by = held_by.iter().copied().collect();
        Strike { id: BodyId::persistent(1), by: None, seen: 0, size: 0, held_by, impulse }
    }

    fn body(builder: RigidBodyBuilder) -> RigidBody {
        let mut world = PhysicsWorld::new();
        let handle = world.insert_body(builder);
        world.insert_collider(ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(2.0), Some(handle));
        world.step();
        world.bodies[handle].clone()
    }

    #[test]
    fn a_body_gets_what_its_leader_did_not_see_to_the_same_bits_in_whatever_order_it_was_told() {
        let body = body(RigidBodyBuilder::dynamic());
        let copy = CopyState::default();
        let all = [
            (2, strike(&[2], [1e-3, 0.0, 0.0])),
            (0, strike(&[0, 1], [8.0, 0.0, 0.0])),
            (3, strike(&[3], [1.0, 0.0, 0.0])),
        ];
        let after = |order: [usize; 3], leader| {
            struck(&body, &copy, leader, &mut order.map(|place| all[place]).to_vec())
                .map(|velocity| velocity.linear[0])
        };
        let expected = after([0, 1, 2], 2).unwrap();
        assert!((expected - 4.5).abs() < 1e-6, "{expected}: of 2 kg, without what region 2 saw");
        for order in [[2, 1, 0], [1, 2, 0], [0, 2, 1]] {
            assert_eq!(after(order, 2), Some(expected));
        }
        assert!(struck(&body, &copy, 0, &mut [(0, strike(&[0, 1], [1.0; 3]))]).is_none(), "seen");
    }

    #[test]
    fn of_what_several_regions_tell_of_one_contact_the_word_of_who_sees_most_counts_for_both_bodies() {
        let told = |seen, impulse_ns: f32| Strike {
            by: Some(BodyId::persistent(9)),
            seen,
            ..strike(&[0, 1, 2], [impulse_ns, 0.0, 0.0])
        };
        let body = body(RigidBodyBuilder::dynamic());
        let gained_ns = |leader, all: [(usize, Strike); 3]| {
            let copy = CopyState::default();
            struck(&body, &copy, leader, &mut all.to_vec()).map_or(0.0, |velocity| 2.0 * velocity.linear[0])
        };
        let all = [(0, told(2, 3.0)), (1, told(5, 8.0)), (2, told(5, 1.0))];
        assert_eq!(gained_ns(1, all), 0.0, "its copy has that already");
        assert_eq!(gained_ns(0, all), 5.0, "in place of the 3 that its own copy has");
        assert_eq!(gained_ns(2, all), 7.0, "of equals the lowest rank");
        let owns_more = (2, Strike { size: 4, ..all[2].1 });
        assert_eq!(gained_ns(2, [all[0], all[1], owns_more]), 0.0, "of equals who owns more");
        assert_eq!(gained_ns(3, all), 8.0, "it holds one of the two alone");
        let by_another = Strike { by: Some(BodyId::persistent(8)), ..told(9, 16.0) };
        assert_eq!(gained_ns(0, [all[0], all[1], (2, by_another)]), 21.0, "each contact by itself");
        assert_eq!(
            gained_ns(0, [all[0], all[1], (2, strike(&[2], [4.0, 0.0, 0.0]))]),
            9.0,
            "and what is unseen"
        );
    }

    #[test]
    fn what_strikes_does_not_move_a_body_along_locked_axes_nor_beyond_all_numbers() {
        let body = body(RigidBodyBuilder::dynamic().lock_rotations().enabled_translations(true, false, true));
        let velocity =
            struck(&body, &CopyState::default(), 0, &mut [(1, strike(&[1], [2.0, 2.0, 0.0]))]).unwrap();
        assert_eq!((velocity.linear, velocity.angular), ([1.0, 0.0, 0.0], [0.0; 3]));
        let most = [f32::MAX, 0.0, 0.0];
        let mut endless = [(1, strike(&[1], most)), (2, strike(&[2], most))];
        assert!(struck(&body, &CopyState::default(), 0, &mut endless).is_none());
    }

    /// Lets a box of 1 m strike a small box asleep on a plate asleep, at the corner of regions, in the tick after
    /// it was inserted. Returns the speeds upwards of the striking and the struck box, tick by tick.
    fn spawn_over_a_pile(regions: usize, spot: [f32; 2]) -> Vec<[f32; 2]> {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        let planes = [(Axis::X, 0.0), (Axis::Z, 0.0)];
        let partitioning = match regions {
            1 => Partitioning::Regions(1),
            _ => Partitioning::Cuts(planes.to_vec()),
        };
        let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
        let cuboid = |x, y, z| ColliderBuilder::cuboid(x, y, z).density(1000.0);
        let dynamic = |x, y, z| RigidBodyBuilder::dynamic().translation(Vector::new(x, y, z));
        world
            .insert(
                RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0)),
                ColliderBuilder::cuboid(50.0, 0.5, 50.0),
            )
            .unwrap();
        world.insert(dynamic(0.05, 0.2, 0.05), cuboid(1.0, 0.2, 1.0)).unwrap();
        let struck = world.insert(dynamic(0.01, 0.7, 0.05), cuboid(0.3, 0.3, 0.3)).unwrap();
        for _ in 0..120 {
            world.step().unwrap();
        }
        let falls = dynamic(spot[0], 1.7, spot[1]).linvel(Vector::new(0.0, -6.0, 0.0));
        let falls = world.insert(falls, cuboid(0.5, 0.5, 0.5)).unwrap();
        let speed = |world: &LocalWorld, id| world.velocity(id).unwrap().linear[1];
        let mut all = Vec::new();
        for _ in 0..12 {
            world.step().unwrap();
            all.push([speed(&world, falls), speed(&world, struck)]);
        }
        all
    }

    #[test]
    fn what_strikes_a_pile_at_a_corner_as_soon_as_it_is_there_bounces_as_in_one_region() {
        for spot in [[-0.05, -0.03], [0.06, -0.04], [-0.02, 0.07], [0.05, 0.02]] {
            let [one, four] = [1, 4].map(|regions| spawn_over_a_pile(regions, spot));
            println!("{spot:?}\n{one:?}\n{four:?}");
            let most = |all: &[[f32; 2]], i: usize| all.iter().map(|v| v[i]).fold(f32::MIN, f32::max);
            for (i, what) in ["striking", "struck"].into_iter().enumerate() {
                let (one, four) = (most(&one, i), most(&four, i));
                assert!(four < one + 1.0, "the {what} body at {spot:?}: {four} m/s, in one region {one}");
            }
        }
    }

    /// Rough boxes are shot at others that lie at the edge where four regions meet.
    #[test]
    fn a_glancing_shot_at_a_corner_loses_no_momentum_to_friction() {
        let off = off_after_shots(200);
        assert!(off.is_empty(), "{} {off:#?}", off.len());
    }

    /// Returns the shots after which the momentum is off by more than a hundredth, with the part that is.
    fn off_after_shots(shots: usize) -> Vec<(usize, f32)> {
        use rand_chacha::ChaCha8Rng;
        use rand_chacha::rand_core::{Rng, SeedableRng};

        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        let mut dice = ChaCha8Rng::seed_from_u64(7);
        let mut vector = |most: f32| {
            let mut roll = || most * (2.0 * (dice.next_u32() as f32 / u32::MAX as f32) - 1.0);
            Vector::new(roll(), roll(), roll())
        };
        let mut off = Vec::new();
        for shot in 0..shots {
            let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0), (Axis::Y, 0.0)]);
            let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
            config.step.gravity = [0.0; 3];
            let mut world = LocalWorld::new(config).unwrap();
            let heading = vector(1.0).normalize();
            let (spot, half) = (vector(0.6), vector(0.35).abs() + Vector::splat(0.1));
            let locked = [LockedAxes::empty(), LockedAxes::ROTATION_LOCKED][usize::from(shot % 4 == 0)];
            let at = |place: Vector| {
                RigidBodyBuilder::dynamic().translation(place).can_sleep(false).locked_axes(locked)
            };
            let outline = ColliderBuilder::cuboid(half.x, half.y, half.z).mass(1.0);
            let struck = world.insert(at(spot).rotation(vector(2.0)), outline).unwrap();
            let speed = [15.0, 30.0, 60.0, 120.0, 240.0][shot % 5];
            let mass = [0.2, 1.0, 5.0][shot % 3];
            let from = spot + vector(0.2) - heading * (2.0 + vector(4.0).x.abs());
            let bullet = at(from).linvel(heading * speed).ccd_enabled(shot % 7 < 4);
            let bullet = world.insert(bullet, ColliderBuilder::cuboid(0.2, 0.2, 0.2).mass(mass)).unwrap();
            for _ in 0..40 {
                world.step().unwrap();
            }
            let [of_struck, of_bullet] =
                [struck, bullet].map(|id| Vector::from_array(world.velocity(id).unwrap().linear));
            let part = ((of_struck + of_bullet * mass) / (mass * speed) - heading).length();
            if part > 0.01 {
                off.push((shot, part));
            }
        }
        off
    }

    /// A heavy raft that spans eight regions falls onto 64 light crates.
    #[test]
    fn what_lies_under_a_heavy_body_is_not_flung_away_and_does_not_throw_it() {
        use crate::physics::Measured as _;
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        let gained = |regions| {
            let partitioning = Partitioning::Regions(regions);
            let bounds = crate::space::Bounds::new([-4.6, 0.0, -4.6], [4.6, 1.8, 4.6]);
            let mut world =
                LocalWorld::new(WorldConfig { partitioning, bounds, ..WorldConfig::default() }).unwrap();
            let mut insert = |body: RigidBodyBuilder, half: [f32; 3], density: f32| {
                let [x, y, z] = half;
                world.insert(body, ColliderBuilder::cuboid(x, y, z).density(density)).unwrap()
            };
            insert(RigidBodyBuilder::fixed().translation(Vector::Y * -0.5), [9.0, 0.5, 9.0], 1.0);
            for i in 0..64 {
                let (x, z) = ((i / 8) as f32 - 3.5, (i % 8) as f32 - 3.5);
                let at = Vector::new(1.15 * x, 0.5, 1.15 * z);
                insert(RigidBodyBuilder::dynamic().translation(at), [0.4, 0.5, 0.4], 1.0);
            }
            insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 1.6), [4.6, 0.15, 4.6], 3.0);
            let (mut before, mut most) = (world.host().energy_j(), 0.0_f64);
            for _ in 0..60 {
                world.step().unwrap();
                let energy = world.host().energy_j();
                most = most.max(energy - before);
                before = energy;
            }
            most
        };
        for regions in [1, 4, 8, 16] {
            let gained_j = gained(regions);
            assert!(gained_j < 20.0, "{regions} regions: {gained_j} J in a tick");
        }
    }

    #[test]
    fn a_body_is_no_faster_after_strikes_than_any_region_found_it() {
        let velocity = |x, y| Velocity { linear: [x, y, 0.0], angular: [0.0, 0.0, x] };
        let copies = [velocity(0.0, 0.0), velocity(2.0, 5.0), velocity(1.0, -9.0)];
        let after = |struck: Velocity| bounded(&copies[0], &struck, copies.iter());
        assert_eq!(after(velocity(1.5, 0.0)), velocity(1.5, 0.0), "less than one region found");
        assert_eq!(after(velocity(8.0, 0.0)), velocity(2.0, 0.0), "as much as the fastest copy");
        assert_eq!(after(velocity(-3.0, 0.0)), velocity(0.0, 0.0), "no copy goes that way");
    }
}
