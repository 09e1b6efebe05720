//! Finds which regions should hold a body and which one should own it, whether its mass is to be split, and
//! whether it may move.

use rapier3d::prelude::RigidBodyHandle;

use super::is_among;
use super::ready::{LIVELY_M_S, is_ready};
use crate::physics::coupling::{Border, Moment, launch};
use crate::physics::region::{BodyRef, Region};
use crate::protocol::BIG_ISLAND;
use crate::space::{BodyId, RegionSet};

/// The membership and owner that a body should have, by its owner's reckoning.
#[derive(Clone, Copy)]
pub(super) struct Desired {
    /// Regions other than its present owner's that must hold it.
    pub holders: RegionSet,
    /// The regions among them within whose reach it is.
    pub reached: RegionSet,
    pub owner: usize,
    /// Says whether its island moves whole.
    pub whole: bool,
    /// Says whether its mass is split among the regions that hold it. Otherwise its owner's copy and each ghost
    /// have all of it.
    pub split: bool,
    /// Says whether something touches the body, or its island if that moves whole.
    pub pressed: bool,
    /// Says whether the region to which it moves holds it, and its island if that moves whole, with the contacts.
    pub ready: bool,
    /// Says whether it may move without having been held there first.
    pub lively: bool,
}

/// Returns the membership and owner that a body should have among the neighbours of this tick, and all
/// regions that it should have, whether they are neighbours or not.
pub(super) fn desired_membership(
    region: &Region,
    border: &Border,
    moment: Moment<'_>,
    handle: RigidBodyHandle,
) -> (Desired, RegionSet) {
    let own = RegionSet::only(region.rank());
    let body = &region.physics().bodies[handle];
    let island = border.islands.of(handle).filter(|island| !island.big);
    let goal = goal_of(region, border, moment, handle);
    let neighbours = border.neighbours.present();
    let owner = if neighbours.contains(goal) { goal } else { region.rank() };
    let pressed = island.map_or_else(|| region.is_pressed(handle), |island| island.pressed);
    let ready = match (island, region.slot(handle).assembly) {
        (Some(island), _) if !island.large || region.is_articulated(handle) => island.ready,
        (Some(_), Some(assembly)) => border.ready_assemblies[assembly as usize],
        (island, _) => is_ready(region, &border.shared, island, handle, owner, pressed, moment),
    };
    // A kinematic body is held by the regions with a predicted contact to it, and if it flies by those on its way;
    // reach does not spread from it.
    let id = region.slot(handle).id;
    let met = border
        .predicted
        .meetings_of(id)
        .fold(RegionSet::EMPTY, |set, meeting| set.union(RegionSet::only(meeting.rank)).union(meeting.goes));
    let met = match body.is_dynamic() {
        true => RegionSet::EMPTY,
        false if region.flies(handle, moment.settings.dt_s) => {
            let ahead_s = launch::UNSEEN_TICKS * moment.settings.dt_s;
            let link = BodyRef { id, handle };
            met.union(launch::on_its_way(region, border, moment.partition, link, ahead_s, 0.0))
        }
        false => met,
    };
    let all = border.reach.of(handle).union(met).without(own);
    let reached = all.intersection(neighbours);
    let wanted = all.union(RegionSet::only(goal));
    let lively = island.is_some_and(|island| island.large)
        && region.slot(handle).assembly.is_none()
        && body.linvel().length() > LIVELY_M_S;
    let there = if lively { RegionSet::EMPTY } else { RegionSet::only(owner) };
    let holders = reached.union(there).without(own);
    let split = splits(border, moment, id, handle);
    (Desired { holders, reached, owner, whole: island.is_some(), split, pressed, ready, lively }, wanted)
}

/// Returns the rank of the region that is to own a body.
pub(super) fn goal_of(
    region: &Region,
    border: &Border,
    moment: Moment<'_>,
    handle: RigidBodyHandle,
) -> usize {
    match border.islands.of(handle).filter(|island| !island.big) {
        Some(island) => island.target,
        // A sleeping body stays where it is.
        None if region.physics().bodies[handle].is_sleeping() => region.rank(),
        None => moment.home_of(region, handle),
    }
}

/// Returns whether a body's mass is to be split. With `overlap` it always is. Otherwise it is split only in
/// an island that is too large to be whole in one region, or if the body has a predicted contact to such an
/// island or to a body that sleeps split.
pub(super) fn splits(border: &Border, moment: Moment<'_>, id: BodyId, handle: RigidBodyHandle) -> bool {
    let big = |handle| border.islands.of(handle).is_some_and(|island| island.big);
    let mut meetings = border.predicted.meetings_of(id);
    !moment.settings.coupling.moves_islands()
        || big(handle)
        || meetings.any(|meeting| meeting.island == BIG_ISLAND)
        || is_among(&border.splitting, handle)
}
