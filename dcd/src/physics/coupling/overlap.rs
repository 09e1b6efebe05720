//! Split-mass overlap: bodies within some contact hops of a border live in both regions, each copy with its share of the
//! mass, so every region can solve the contacts at the border by itself. After each micro-step the regions agree on the
//! copies' means, which conserves momentum exactly; a memory of what pressed on each copy evens out the edges of the
//! overlap, where a body has all its neighbours in one region and only some in another.
//!
//! Kin to mass splitting (Tonge, Benevolenski, Voroshilov 2012) and to consensus ADMM (Boyd et al. 2011).

use super::{Ground, Moment, agree, held, membership, share, sight};
use crate::physics::ShapeError;
use crate::physics::partition::Partition;
use crate::physics::region::{Link, Region, Role};
use crate::protocol::{BorderMessage, CopyState};
use crate::space::RegionSet;

/// Says how the copies here moved, and after the last step of a tick who shall hold what.
pub(super) fn gather(region: &mut Region, moment: Moment<'_>) {
    region.outbox.clear(moment.tick);
    if moment.last {
        membership::survey(region, moment);
    }
    for index in 0..region.shared.len() + region.replicas.len() {
        tell_copy(region, share::held(region, index), moment);
    }
    for message in region.outbox.begun() {
        // Owned and replicated bodies come one after the other.
        message.copies.sort_unstable_by_key(|copy| copy.id);
    }
    if moment.last {
        let islands = std::mem::take(&mut region.border.islands);
        islands.tell(region);
        region.border.islands = islands;
        membership::decide(region, moment);
        let steps = region.border.pace.tell(region.rank());
        if steps > 0 {
            region.outbox.tell_all(|message| message.steps = steps);
        }
    }
}

/// Takes in the others' copies and what owners decided.
pub(super) fn apply<'a>(
    region: &mut Region,
    inbox: impl Iterator<Item = &'a BorderMessage> + Clone,
    ground: Ground<'_>,
    moment: Moment<'_>,
) -> Result<(), ShapeError> {
    held::cover_hubs(region, ground)?;
    cover_far(region, ground)?;
    // Before a tick nobody tells of islands.
    let tells = moment.last && moment.round > 0;
    if tells {
        region.border.islands.forget_told();
    }
    for message in inbox.clone() {
        let sender = rank_of(ground.partition, message);
        held::arrive(region, message, sender, ground, true)?;
        hear(region, &message.copies, sender);
        sight::see(region, sender, message);
        if tells {
            region.border.islands.hear(sender, message);
        }
        region.border.pace.hear(sender, message.steps);
    }
    // Before a tick nobody has told where copies are: what was heard last is from before the user's changes.
    if moment.round > 0 {
        let mut border = std::mem::take(&mut region.border);
        agree::agree(region, &border.pace, moment, &mut border.disagreement);
        border.pace.judge(&border.disagreement, moment);
        region.border = border;
    }
    membership::commit(region, inbox.flat_map(|message| &message.members));
    if moment.last {
        region.border.sights.meet();
        region.border.pace.turn();
    }
    Ok(())
}

/// An island that is computed whole may reach far out of the cell.
fn cover_far(region: &mut Region, ground: Ground<'_>) -> Result<(), ShapeError> {
    for index in 0..region.border.sights.near.len() {
        let bounds = region.border.sights.near[index].swept;
        if !region.cell().contains_box(&bounds) {
            ground.statics.cover_box(region, &bounds, ground.shapes)?;
        }
    }
    Ok(())
}

fn rank_of(partition: &Partition, message: &BorderMessage) -> usize {
    partition.rank_of(message.from).expect("messages come from regions of this tree")
}

/// Sends a copy to all who hold the body; what a shadow of a split body became, to the owner alone; once only when it falls asleep.
fn tell_copy(region: &mut Region, link: Link, moment: Moment<'_>) {
    let Some(shared) = region.slot(link.handle).shared.as_deref() else { return };
    if !moment.is_due(region.border.pace.exchanges_among(shared.members)) {
        return;
    }
    let Some(mut shared) = region.slot_mut(link.handle).shared.take() else { return };
    let asleep = region.physics().bodies[link.handle].is_sleeping();
    let told = region.slot(link.handle).told_asleep;
    if !(asleep && told) {
        let islands = &region.border.islands;
        let (part, seen, size) =
            (islands.part(link.handle), islands.seen(link.handle), islands.size(link.handle));
        share::read(region, link.handle, &mut shared, moment.settings.dt_s);
        let knows = shared.followed || region.slot(link.handle).role == Role::Owner;
        shared.own = CopyState { part, seen: if knows { seen } else { 0 }, size, ..shared.own };
        region.slot_mut(link.handle).told_asleep = asleep;
        let hearers = match region.slot(link.handle).role {
            Role::Replica { owner } if shared.is_split() && shared.shadows.contains(region.rank()) => {
                RegionSet::only(owner)
            }
            _ => shared.members.without(RegionSet::only(region.rank())),
        };
        for rank in hearers.iter() {
            region.outbox.to(rank).copies.push(shared.own);
        }
    }
    region.slot_mut(link.handle).shared = Some(shared);
}

/// Keeps the others' copies; both lists are in id order, so there is no look-up a body.
fn hear(region: &mut Region, copies: &[CopyState], sender: usize) {
    let (mut in_shared, mut in_replicas) = (0, 0);
    for copy in copies {
        let handle =
            [(true, &mut in_shared), (false, &mut in_replicas)].into_iter().find_map(|(owned, at)| {
                let list = if owned { &region.shared } else { &region.replicas };
                while list.get(*at).is_some_and(|link| link.id < copy.id) {
                    *at += 1;
                }
                list.get(*at).filter(|link| link.id == copy.id).map(|link| link.handle)
            });
        let Some(handle) = handle else { continue };
        let slot = region.slot_mut(handle);
        debug_assert!(slot.role != Role::Immovable);
        let Some(shared) = slot.shared.as_deref_mut() else { continue };
        match shared.heard.binary_search_by_key(&sender, |(rank, _)| *rank) {
            Ok(place) => shared.heard[place].1 = *copy,
            Err(place) => shared.heard.insert(place, (sender, *copy)),
        }
    }
}
