//! Computes the consensus of the regions that hold a body. Its copies get their mean velocity, and are drawn
//! to their mean pose or put there. Each copy is pushed by a force that evens out unequal contact forces on
//! the copies: in some regions, some of the body's neighbours are missing.
//!
//! The mean of copies that each have 1/n of the mass conserves momentum exactly. It is formed from the same
//! numbers in the same order everywhere, so that all members get the same bits. A body whose mass is not
//! split follows the copy of one region instead.

use rapier3d::prelude::*;

use super::auto::{self, Disagreement};
use super::launch::{stopped_um, way_m};
use super::shared::Shared;
use super::{Border, Moment, strike};
use crate::physics::convert;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{CopyState, Velocity, WorldPose};
use crate::space::RegionSet;

/// Speeds and displacements below which a ghost's pose is left alone: a pose written every step would never
/// let it sleep.
pub(super) const STILL_M_S: f32 = 0.05;
pub(super) const STILL_RAD_S: f32 = 0.1;
pub(super) const MOVED_M: f32 = 2e-3;
pub(super) const TURNED_RAD: f32 = 2e-3;
/// The distance from their mean up to which copies with a part of the mass are left alone. Friction may hold
/// them there, and drawing what is held would wind up the memory of forces until it slips.
const SLACK_M: f32 = 1e-3;
const SLACK_RAD: f32 = 1e-3;
/// The number of ticks in which copies farther from the mean are drawn to it, by their velocities.
const DRAW_TICKS: f32 = 16.0;
/// Distances and speeds above which copies are put at the mean: no load has parted them, and a later
/// correction would be seen.
const FAR_M: f32 = 0.01;
const FAR_RAD: f32 = 0.05;
const MOTION_M_S: f32 = 0.5;
const MOTION_RAD_S: f32 = 1.0;
/// The part of a body's speed up to which lasting disagreement counts as none: beside the body's motion
/// nobody sees it.
const IN_MOTION: f32 = 0.1;
/// The speeds of another copy, or of the consensus, above which a sleeping copy is woken.
pub(super) const WAKE_M_S: f32 = 0.05;
pub(super) const WAKE_RAD_S: f32 = 0.05;

/// Applies the consensus to every body held here and elsewhere that is exchanged in this round. Notes, for
/// each other region, how far the velocities of the copies of split bodies held by both were from their
/// means; `None` where there is no such body.
pub(super) fn agree(region: &mut Region, border: &mut Border, moment: Moment<'_>) {
    let Border { shared: all, pace, disagreement, leaders, .. } = border;
    disagreement.fill(None);
    let own = RegionSet::only(region.rank());
    let whole = region.held_elsewhere().filter(|link| {
        let shared = all.get(link.handle);
        shared.is_some_and(|shared| !shared.is_split() && moment.is_due(pace.exchanges_among(shared.members)))
    });
    leaders.find(region, all, whole, moment.settings.dt_s);
    for place in 0..region.held_elsewhere_count() {
        let link = region.held_elsewhere_at(place);
        let Some(shared) = all.get_mut(link.handle) else { continue };
        let exchanges = pace.exchanges_among(shared.members);
        let is_due = moment.is_due(exchanges);
        if is_due && shared.is_split() {
            shared.strikes.clear();
            let worst = agree_on(region, link, shared, exchanges, moment);
            for rank in shared.members.without(own).iter() {
                disagreement[rank] = Some(disagreement[rank].map_or(worst, |most| most.max(worst)));
            }
        } else if is_due {
            follow(region, link, shared, leaders.of(link.handle), moment.settings.dt_s);
        }
    }
}

fn agree_on(
    region: &mut Region,
    link: BodyRef,
    shared: &mut Shared,
    exchanges: usize,
    moment: Moment<'_>,
) -> Disagreement {
    region.slot_mut(link.handle).led_by = None;
    if shared.heard.is_empty() {
        return Disagreement::default();
    }
    let own_rank = region.rank();
    let body = &region.physics().bodies[link.handle];
    let counts = !shared.warming.contains(own_rank);
    if body.is_sleeping() && shared.heard.iter().all(|(_, copy)| copy.sleeping) {
        shared.lasting = Vector::ZERO;
        return Disagreement::default();
    }
    if !body.is_dynamic() {
        // A kinematic body is where its owner says.
        if let Ownership::Ghost { owner } = region.slot(link.handle).role
            && let Some(&(_, copy)) = shared.heard.iter().find(|(rank, _)| *rank == owner)
        {
            write(region, link, &copy.pose, &copy.velocity);
        }
        return Disagreement::default();
    }
    let own = (counts && !is_broken(region, link)).then_some((own_rank, shared.own));
    let at = shared.heard.partition_point(|(rank, _)| *rank < own_rank);
    let (before, after) = shared.heard.split_at(at);
    let warming = shared.warming;
    let copies = || {
        let all = before.iter().chain(own.iter()).chain(after);
        all.filter(|(rank, copy)| copy.sound && !warming.contains(*rank)).map(|(_, copy)| copy)
    };
    if copies().next().is_none() {
        region.give_up_copies(link.handle);
        return Disagreement::default();
    }
    let (pose, velocity) = mean(copies);
    // Copies with a part of the mass differ by as much as slower ones are stopped by.
    let (reach_m, tick_s) = (region.slot(link.handle).reach_m, moment.settings.dt_s);
    // The other regions may not hold what one copy met.
    let stopped = |copy: &CopyState| {
        let behind_um = |ahead: &CopyState| stopped_um(ahead, copy, reach_m, tick_s);
        copies().map(behind_um).max().unwrap_or(0)
    };
    let is_fast = copies().any(|copy| way_m(copy, tick_s) > reach_m);
    let last = copies().filter(|_| is_fast).max_by_key(|copy| stopped(copy));
    let pose = last.filter(|copy| stopped(copy) > 0).map_or(pose, |copy| copy.pose);
    let count = copies().count() as f32;
    let alike = copies().all(|copy| copy.partners == shared.own.partners);
    region.mend_copy(link.handle);
    if alike || !counts {
        region.push(link.handle, Vector::ZERO, Vector::ZERO);
    } else {
        let sum = |of: fn(&CopyState) -> [f32; 3]| {
            copies().fold(Vector::ZERO, |sum, copy| sum + Vector::from_array(of(copy)))
        };
        let push = sum(|copy| copy.force_n) / count - Vector::from_array(shared.own.force_n);
        let twist = sum(|copy| copy.torque_nm) / count - Vector::from_array(shared.own.torque_nm);
        region.push(link.handle, push, twist);
    }
    let z = Vector::from_array(velocity.linear);
    let off = |copy: &CopyState| (Vector::from_array(copy.velocity.linear) - z).length();
    let most_m_s = copies().map(off).fold(0.0, f32::max);
    let first = copies().next().map_or(Vector::ZERO, |copy| Vector::from_array(copy.velocity.linear) - z);
    auto::average(&mut shared.lasting, first, exchanges);
    let following = shared.heard.iter().filter(|(rank, _)| warming.contains(*rank));
    let strayed_m_s = following.map(|(_, copy)| off(copy)).fold(0.0, f32::max);
    shared.strayed_m_s = strayed_m_s;
    let apart = Apart::of(copies(), &pose);
    let owner = match region.slot(link.handle).role {
        Ownership::Ghost { owner } => owner,
        _ => own_rank,
    };
    let owners = own.iter().chain(&shared.heard).find(|(rank, _)| *rank == owner).map(|(_, copy)| copy);
    let flies = copies().all(|copy| copy.partners == 0) && !region.is_jointed(link.handle);
    match owners.filter(|copy| flies && copy.sound && !apart.is_far()) {
        // No load parts these copies any more. Others see the body where its owner has it; so has every region that may own
        // it next.
        Some(owners) => write(region, link, &owners.pose, &velocity),
        None => draw(region, link, &pose, &velocity, apart, moment.settings.dt_s),
    }
    region.restart_copy(link.handle);
    let lasting_m_s = (shared.lasting.length() - IN_MOTION * z.length()).max(0.0);
    Disagreement { most_m_s, lasting_m_s }
}

fn is_broken(region: &Region, link: BodyRef) -> bool {
    region.mass_split(link.handle).is_some_and(|mass_split| mass_split.is_broken())
}

/// Gives the copy of a body that is not split the state that it has in the leading region. That region solved
/// the contacts of everything that touches together, so that what one body loses another gains. The impulses
/// of contacts that the leader did not see are added. Where nothing touches the body its owner leads, unless
/// another copy was stopped on its way by something that the owner does not hold.
fn follow(region: &mut Region, link: BodyRef, shared: &mut Shared, leader: Option<usize>, tick_s: f32) {
    let mut strikes = std::mem::take(&mut shared.strikes);
    let own_rank = region.rank();
    let body = &region.physics().bodies[link.handle];
    let all_sleep = body.is_sleeping() && shared.heard.iter().all(|(_, copy)| copy.sleeping);
    if shared.heard.is_empty() || all_sleep && !shared.displaced {
        shared.led_awake &= !all_sleep;
        return;
    }
    let owner = shared.members.without(shared.warming).iter().next();
    let own = (!is_broken(region, link)).then_some((own_rank, &shared.own));
    let heard = || shared.heard.iter().map(|(rank, copy)| (*rank, copy));
    let copies = || heard().chain(own).filter(|(_, copy)| copy.sound);
    let leap_m = region.leap_m(link.handle);
    let owners = copies().find(|(rank, _)| Some(*rank) == owner).filter(|_| body.is_dynamic());
    // Rapier lets the leader's copy fall asleep once all that touches it has been still for long enough. Another copy may
    // never be: what holds it up is not there. But a region with something that the leader does not hold may know better.
    let fell_asleep = |rank: &usize| {
        let is_known = |copy: &CopyState| {
            let holds_all = shared.led_awake && copy.held_by.contains(*rank);
            copy.sleeping || holds_all || copy.rests_with.contains(*rank)
        };
        copies().any(|(other, copy)| other == *rank && copy.sleeping)
            && copies().all(|(_, copy)| is_known(copy))
    };
    let laid_by = region.slot(link.handle).led_by.filter(fell_asleep);
    // Contacts move only dynamic bodies; a kinematic body is where its owner says.
    let rank_of = |&(rank, copy): &(usize, &CopyState)| {
        let seen = if copy.sleeping || !body.is_dynamic() { 0 } else { copy.seen };
        let (leads, owns) = (Some(rank) == leader && seen > 0, Some(rank) == owner);
        let stopped_um = owners.map_or(0, |(_, owners)| stopped_um(owners, copy, leap_m, tick_s));
        let lays = Some(rank) == laid_by;
        (lays, leads, seen, stopped_um, owns && seen <= 1, copy.size, std::cmp::Reverse(rank))
    };
    let Some((rank, copy)) = copies().max_by_key(rank_of) else {
        // A copy that has just come has yet to hear where it is.
        if !shared.displaced {
            region.give_up_copies(link.handle);
        }
        return;
    };
    let z = Vector::from_array(copy.velocity.linear);
    let off = |(_, other): (usize, &CopyState)| (Vector::from_array(other.velocity.linear) - z).length();
    let strayed_m_s = copies().map(off).fold(0.0, f32::max);
    let copy = *copy;
    shared.strayed_m_s = strayed_m_s;
    let struck = strike::struck(body, &copy, rank, &mut strikes).filter(|_| body.is_dynamic());
    let velocities = copies().map(|(_, copy)| &copy.velocity);
    let is_grounded = copies().any(|(_, copy)| copy.grounded);
    let struck = struck.map(|struck| match is_grounded {
        true => strike::bounded(&copy.velocity, &struck, velocities),
        false => struck,
    });
    shared.led_awake = !copy.sleeping;
    region.slot_mut(link.handle).led_by = Some(rank);
    region.push(link.handle, Vector::ZERO, Vector::ZERO);
    region.restart_copy(link.handle);
    region.mend_copy(link.handle);
    if rank != own_rank || struck.is_some() {
        if std::mem::take(&mut shared.displaced) {
            let pose = convert::region_from_world(region.anchor(), &copy.pose);
            region.put_copy_back(link.handle, pose, copy.still_s);
        }
        if laid_by.is_some() && struck.is_none() {
            let pose = convert::region_from_world(region.anchor(), &copy.pose);
            region.lay_copy(link.handle, pose, copy.still_s);
        } else {
            write(region, link, &copy.pose, &struck.unwrap_or(copy.velocity));
            region.set_still(link.handle, copy.still_s);
        }
    }
}

/// Returns the regions in which a whole body may sleep although its copy here is awake ([`CopyState::rests_with`]). What
/// they do not hold and hardly moves is no reason to be awake: it moves because what it leans on lacks a support here.
pub(super) fn rests_with(region: &Region, handle: RigidBodyHandle, shared: &Shared) -> RegionSet {
    let bodies = &region.physics().bodies;
    let is_ready = |body: &RigidBody| {
        let activation = body.activation();
        body.is_dynamic() && activation.time_since_can_sleep >= activation.time_until_sleep
    };
    if shared.is_split() || !is_ready(&bodies[handle]) {
        return RegionSet::EMPTY;
    }
    let rests = |body: &RigidBody| {
        let is_still = body.activation().time_since_can_sleep > 0.0;
        body.is_sleeping() || if body.is_dynamic() { is_still } else { !body.is_moving() }
    };
    let mut regions = shared.members.without(RegionSet::only(region.rank()));
    region.for_each_contact(handle, |other, touches| {
        if touches && !rests(&bodies[other]) {
            regions = regions.intersection(region.slot(other).holders);
        }
    });
    regions
}

/// Returns the mean pose and velocity of copies: the arithmetic mean of positions and velocities, and the
/// normalised mean of quaternions on one hemisphere. For copies as close as these, that is the exponential of
/// the mean logarithm to third order.
fn mean<'a, I: Iterator<Item = &'a CopyState>>(copies: impl Fn() -> I) -> (WorldPose, Velocity) {
    let first = *copies().next().expect("a body has copies");
    if copies().all(|copy| copy.pose == first.pose && copy.velocity == first.velocity) {
        return (first.pose, first.velocity);
    }
    let count = copies().count() as f64;
    let (mut translation, mut rotation) = ([0.0f64; 3], [0.0f64; 4]);
    let (mut linear, mut angular) = ([0.0f64; 3], [0.0f64; 3]);
    let q0 = first.pose.rotation.map(f64::from);
    for copy in copies() {
        let q = copy.pose.rotation.map(f64::from);
        let sign = (0..4).map(|i| q[i] * q0[i]).sum::<f64>().signum();
        for i in 0..3 {
            translation[i] += copy.pose.translation[i];
            linear[i] += f64::from(copy.velocity.linear[i]);
            angular[i] += f64::from(copy.velocity.angular[i]);
        }
        for i in 0..4 {
            rotation[i] += sign * q[i];
        }
    }
    let norm = rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let pose = WorldPose {
        translation: translation.map(|v| v / count),
        rotation: rotation.map(|v| (v / norm) as f32),
    };
    (
        pose,
        Velocity { linear: linear.map(|v| (v / count) as f32), angular: angular.map(|v| (v / count) as f32) },
    )
}

/// The greatest distance of any copy with a part of the mass from the mean.
#[derive(Clone, Copy)]
struct Apart {
    by_m: f32,
    by_rad: f32,
}

impl Apart {
    fn of<'a>(copies: impl Iterator<Item = &'a CopyState>, mean: &WorldPose) -> Self {
        let mut apart = Self { by_m: 0.0, by_rad: 0.0 };
        for copy in copies.filter(|copy| copy.pose != *mean) {
            // A sleeping copy stays where it is: the others would be drawn to it for ever.
            if copy.sleeping {
                return Self { by_m: 0.0, by_rad: 0.0 };
            }
            let squares = |i: usize| (copy.pose.translation[i] - mean.translation[i]).powi(2);
            apart.by_m = apart.by_m.max((0..3).map(squares).sum::<f64>().sqrt() as f32);
            let [own, mean] = [copy.pose, *mean].map(|pose| convert::rotation(pose.rotation));
            apart.by_rad = apart.by_rad.max(turned_rad(own, mean));
        }
        apart
    }

    fn is_far(self) -> bool {
        self.by_m > FAR_M || self.by_rad > FAR_RAD
    }
}

/// Gives a copy of a split body the mean velocity, and draws it to the mean pose.
///
/// The push on a copy moves it ahead of the mean or behind it, by the push times dt²/m. The work of pushes
/// lies in that distance, and comes back when the push ends. A copy that is put at the mean under its load
/// keeps the push and loses the distance, so that work is done for nothing, at every exchange anew: walls
/// trembled for ever and fell apart. The draw is in proportion for all copies, so that it leaves their
/// momentum as it is.
fn draw(
    region: &mut Region,
    link: BodyRef,
    pose: &WorldPose,
    velocity: &Velocity,
    apart: Apart,
    tick_s: f32,
) {
    let (mut linear, mut angular) = (convert::vector(velocity.linear), convert::vector(velocity.angular));
    let in_motion = linear.length() > MOTION_M_S || angular.length() > MOTION_RAD_S;
    let body = &region.physics().bodies[link.handle];
    if in_motion || apart.is_far() || body.is_sleeping() {
        return write(region, link, pose, velocity);
    }
    let pose = convert::region_from_world(region.anchor(), pose);
    let rate = |apart: f32, slack: f32| (1.0 - slack / apart) / (DRAW_TICKS * tick_s);
    if apart.by_m > SLACK_M {
        linear += (pose.translation - body.translation()) * rate(apart.by_m, SLACK_M);
    }
    if apart.by_rad > SLACK_RAD {
        angular +=
            (pose.rotation * body.rotation().inverse()).to_scaled_axis() * rate(apart.by_rad, SLACK_RAD);
    }
    if body.linvel() != linear || body.angvel() != angular {
        let body = &mut region.world_mut().bodies[link.handle];
        body.set_linvel(linear, false);
        body.set_angvel(angular, false);
    }
}

fn write(region: &mut Region, link: BodyRef, pose: &WorldPose, velocity: &Velocity) {
    let pose = convert::region_from_world(region.anchor(), pose);
    let (linear, angular) = (convert::vector(velocity.linear), convert::vector(velocity.angular));
    let body = &region.physics().bodies[link.handle];
    if *body.position() == pose && body.linvel() == linear && body.angvel() == angular {
        // Writing would make Rapier go over the body again.
        return;
    }
    let moved_m = (pose.translation - body.translation()).length();
    let turned_rad = turned_rad(pose.rotation, *body.rotation());
    let moved = moved_m >= MOVED_M || turned_rad >= TURNED_RAD;
    if body.is_sleeping() {
        if moved_m >= MOVED_M || linear.length() > WAKE_M_S || angular.length() > WAKE_RAD_S {
            region.put_copy(link.handle, pose);
            let body = &mut region.world_mut().bodies[link.handle];
            body.set_linvel(linear, false);
            body.set_angvel(angular, false);
            region.world_mut().wake_up(link.handle, true);
        }
        return;
    }
    let body = &mut region.world_mut().bodies[link.handle];
    body.set_linvel(linear, false);
    body.set_angvel(angular, false);
    if moved || linear.length() >= STILL_M_S || angular.length() >= STILL_RAD_S {
        region.put_copy(link.handle, pose);
    }
}

/// Returns the angle between two rotations, from the chord: a cosine near 1 resolves no angle below half a
/// milliradian.
pub(super) fn turned_rad(a: Rotation, b: Rotation) -> f32 {
    let chord = (a - b).length().min((a + b).length());
    4.0 * (0.5 * chord).min(1.0).asin()
}
