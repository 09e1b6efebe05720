//! Finds when bodies and islands that are due to move to another region may go: once that region holds them
//! with their contacts, or when they have waited long enough.

use rapier3d::prelude::RigidBodyHandle;

use super::is_among;
use crate::physics::coupling::island::Island;
use crate::physics::coupling::shared::SharedBodies;
use crate::physics::coupling::{Border, Moment};
use crate::physics::region::{BodyRef, Region, Slot};

/// Ticks for which the region to which a body moves holds it before owning it, if the body touches something.
pub(super) const SETTLE_TICKS: u32 = 8;
/// The velocity, m/s, by which a warm-up ghost may at most stray from its body when the body moves: then the
/// body's load has found its way through the contacts there. After [`FOLLOW_TICKS`] the body moves anyway.
const STRAY_M_S: f32 = 1e-3;
const FOLLOW_TICKS: u32 = 120;
/// Ticks after which a body that is due to move moves as it is: its holders may change with every swing of a
/// rope, and it would never settle.
const LONGEST_AWAY_TICKS: u32 = 60;
/// The speed, m/s, above which a body of a large island moves without being held there first, once it has
/// been due for [`SETTLE_TICKS`]: the warm start of its contacts is of impacts, and worth nothing in the next
/// tick.
pub(super) const LIVELY_M_S: f32 = 1.0;

/// Notes that a body is due to move to another region. Returns for how many ticks it has been due before.
pub(super) fn note_away(region: &mut Region, link: BodyRef, owner: usize, moment: Moment<'_>) -> u32 {
    if owner == region.rank() {
        return 0;
    }
    let now = moment.tick.0 as u32;
    let slot = region.slot_mut(link.handle);
    let before = away_ticks(slot, moment);
    slot.away = (now - before, now);
    before
}

/// Returns for how many ticks a body has been due to move, up to the last step of its region.
fn away_ticks(slot: &Slot, moment: Moment<'_>) -> u32 {
    let ((first, last), now) = (slot.away, moment.tick.0 as u32);
    if last < now && last + u32::from(moment.coarsest) >= now { now - first } else { 0 }
}

/// Returns whether the region that is to own a body holds it, with its contacts.
pub(super) fn is_ready(
    region: &Region,
    all: &SharedBodies,
    island: Option<&Island>,
    handle: RigidBodyHandle,
    owner: usize,
    pressed: bool,
    moment: Moment<'_>,
) -> bool {
    // A multibody moves in one piece, when all else is ready.
    if region.is_articulated(handle) {
        return true;
    }
    let slot = region.slot(handle);
    let settled = all.get(handle).is_some_and(|shared| {
        let strays = shared.warming.contains(owner) && shared.strayed_m_s > STRAY_M_S;
        // A body that only bounces off another region's has parted from it before it would move.
        let lasts = !island.is_some_and(Island::spans) || shared.joined >= SETTLE_TICKS;
        let follows = shared.settled >= if strays { FOLLOW_TICKS } else { SETTLE_TICKS };
        lasts && follows || away_ticks(slot, moment) >= LONGEST_AWAY_TICKS
    });
    slot.holders.contains(owner) && (settled || !pressed)
}

/// Finds which islands are ready to move. A small island moves when all of it is ready. Bodies that keep
/// joining a large island would delay it for ever: there each body moves when it is ready, and bodies tied by
/// joints move together.
pub(super) fn find_ready(region: &Region, border: &mut Border, moment: Moment<'_>) {
    let Border { islands, ready_assemblies, shared, parting, .. } = border;
    let own = region.rank();
    ready_assemblies.clear();
    ready_assemblies.resize(region.assemblies().len(), true);
    for island in islands.found.iter_mut().filter(|island| !island.big && island.target != own) {
        let ready = |link: &BodyRef| {
            is_ready(region, shared, Some(island), link.handle, island.target, island.pressed, moment)
        };
        if island.large {
            for link in &island.members {
                if let Some(assembly) = region.slot(link.handle).assembly {
                    ready_assemblies[assembly as usize] &= ready(link);
                }
            }
        }
        let waits = |link: &BodyRef| {
            away_ticks(region.slot(link.handle), moment) < 2 * SETTLE_TICKS && is_among(parting, link.handle)
        };
        island.ready = island.members.iter().all(|link| ready(link) && !waits(link));
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::partition::OWNER_HYSTERESIS_M;
    use crate::physics::region::Ownership;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::{Axis, BodyId};

    /// A train of eight wagons, which moves when seven are out. The last one is still far within the region
    /// that they leave.
    #[test]
    fn what_goes_along_is_not_waited_for_as_what_stays_is() {
        let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
        let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        let mut world = LocalWorld::new(config).unwrap();
        let wagon = |i: i32| {
            let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(Vector::X * 2.0);
            body.translation(Vector::X * (-1.0 - 1.04 * i as f32))
        };
        let ids: Vec<_> =
            (0..8).map(|i| world.insert(wagon(i), ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()).collect();
        for pair in ids.windows(2) {
            let hook =
                SphericalJointBuilder::new().local_anchor1(Vector::X * -0.52).local_anchor2(Vector::X * 0.52);
            world.insert_joint(pair[0], pair[1], hook).unwrap();
        }
        let (mut out_at, mut moved_at) = (None, None);
        for tick in 0..400 {
            world.step().unwrap();
            let is_out = |id: &&BodyId| world.pose(**id).unwrap().translation[0] > OWNER_HYSTERESIS_M;
            out_at = out_at.or((ids.iter().filter(is_out).count() >= 7).then_some(tick));
            let moved = world.regions().any(|region| {
                let owned = region.bodies().filter(|(_, role, ..)| *role == Ownership::Owner);
                region.cell().min[0] == 0.0 && owned.count() == 8
            });
            moved_at = moved_at.or(moved.then_some(tick));
        }
        let (out_at, moved_at) = (out_at.unwrap(), moved_at.unwrap());
        let waited = moved_at - out_at;
        assert!((0..=SETTLE_TICKS as i32).contains(&waited), "it waited for {waited} ticks");
    }
}
