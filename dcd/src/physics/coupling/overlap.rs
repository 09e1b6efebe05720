//! Implements the overlap coupling by mass splitting. Bodies within some contact hops of a border live in
//! both regions, each copy with a part of the mass, so that every region can solve the contacts at the border
//! by itself. After each substep the copies are set to their consensus, the mean, which conserves momentum
//! exactly. A memory of the forces on each copy evens out the edges of the overlap, where a body has all its
//! neighbours in one region and only some in another. The couplings `island` and `auto` use it too.
//!
//! Kin to mass splitting (Tonge, Benevolenski, Voroshilov 2012) and to consensus ADMM (Boyd et al. 2011).

use super::island::Island;
use super::{Border, Ground, Moment, Side, consensus, ghosts, ownership, predicted_contacts, shared, strike};
use crate::physics::ShapeError;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BorderMessage, CopyState};
use crate::space::RegionSet;

/// Sends the states of the copies here, and after the last step of a tick the new memberships.
pub(super) fn gather(side: &mut Side, moment: Moment<'_>) {
    side.outbox.clear(moment.tick);
    if moment.last {
        ownership::survey(side, moment);
    }
    // Copies are sent in id order.
    let mut told = (0, 0);
    while let Some(link) = side.region.next_held_elsewhere(&mut told) {
        tell_copy(side, link, moment);
    }
    if moment.last {
        side.border.islands.tell(&side.region, &mut side.outbox);
        ownership::decide(side, moment);
        let (steps, unaware) = side.border.pace.tell(side.region.rank(), side.border.neighbours.now());
        for rank in unaware.iter() {
            side.outbox.to(rank).steps = steps;
        }
    }
}

/// Applies the others' copies, the consensus, and the owners' decisions on membership.
pub(super) fn apply<'a>(
    side: &mut Side,
    inbox: impl Iterator<Item = &'a BorderMessage> + Clone,
    ground: Ground<'_>,
    moment: Moment<'_>,
) -> Result<(), ShapeError> {
    let Side { region, border, .. } = side;
    ghosts::cover_hubs(region, ground)?;
    cover_far(region, border, ground)?;
    // In the exchange before a tick no islands are sent.
    let tells = moment.last && moment.round > 0;
    if tells {
        border.islands.forget_told();
    }
    for message in inbox.clone() {
        let sender = ground.rank_of(message);
        ghosts::arrive(region, border, message, sender, ground, true)?;
        hear(region, border, &message.copies, sender);
        strike::hear(region, &mut border.shared, &message.strikes, sender);
        predicted_contacts::see(region, border, sender, message);
        if tells {
            border.islands.hear(sender, message);
        }
        border.pace.hear(sender, message.steps);
    }
    // In the exchange before a tick no copies are sent: those received last are from before the user's changes.
    if moment.round > 0 {
        consensus::agree(region, border, moment);
        border.pace.judge(&border.disagreement, moment);
    }
    ownership::commit(region, border, inbox.flat_map(|message| &message.members));
    if moment.last {
        border.predicted.meet();
        border.pace.turn();
    }
    Ok(())
}

/// Inserts the immovable bodies under bodies that lie outside the cell: an island that is computed whole may
/// reach far.
fn cover_far(region: &mut Region, border: &Border, ground: Ground<'_>) -> Result<(), ShapeError> {
    for near in &border.predicted.near {
        if !region.cell().contains_box(&near.swept) {
            ground.statics.cover_box(region, &near.swept, ground.shapes)?;
        }
    }
    Ok(())
}

/// Sends a copy to all regions that hold the body; a warm-up ghost of a split body only to the owner. A copy
/// that sleeps is sent once, when it falls asleep.
fn tell_copy(side: &mut Side, link: BodyRef, moment: Moment<'_>) {
    let Side { region, border, outbox, .. } = side;
    let Border { shared, pace, islands, .. } = border;
    let Some(shared) = shared.get_mut(link.handle) else { return };
    let asleep = region.physics().bodies[link.handle].is_sleeping();
    if asleep || shared.is_split() {
        shared.owed = None;
    }
    match shared.is_split() {
        _ if asleep => {}
        true => strike::note_shares(region, link.handle, shared),
        false => strike::note(region, islands, link.handle, shared),
    }
    if !moment.is_due(pace.exchanges_among(shared.members)) {
        return;
    }
    let slot = region.slot_mut(link.handle);
    if std::mem::replace(&mut slot.told_asleep, asleep) && asleep {
        shared.strikes.clear();
        return;
    }
    let role = slot.role;
    let (part, seen, size) =
        (islands.part(link.handle), islands.seen(link.handle), islands.size(link.handle));
    let (island, held_by) = islands.of(link.handle).map_or((link.id, shared.members), Island::view);
    let grounded = islands.is_grounded(link.handle);
    let rests_with = consensus::rests_with(region, link.handle, shared);
    let mut copy = shared::read(region, link.handle, shared, moment.settings.dt_s);
    // A displaced copy is not where the body is: no region may use it.
    copy.sound &= !shared.displaced;
    let dealt = std::mem::take(&mut shared.dealt);
    let velocity = match copy.sound {
        true => strike::counted(region, link.handle, &dealt, &copy.velocity),
        false => copy.velocity,
    };
    shared.own = CopyState { velocity, part, seen, size, island, held_by, grounded, rests_with, ..copy };
    let hearers = match role {
        Ownership::Ghost { owner } if shared.is_split() && shared.warming.contains(region.rank()) => {
            RegionSet::only(owner)
        }
        _ => shared.members.without(RegionSet::only(region.rank())),
    };
    for rank in hearers.iter() {
        let message = outbox.to(rank);
        message.copies.push(shared.own);
        message.strikes.extend(shared.strikes.iter().map(|(_, strike)| strike));
    }
}

/// Stores the other regions' copies. All lists are in id order, so that no body needs a look-up.
fn hear(region: &Region, border: &mut Border, copies: &[CopyState], sender: usize) {
    let (mut in_shared, mut in_ghosts) = (0, 0);
    for copy in copies {
        let lists = [(region.shared(), &mut in_shared), (region.ghosts(), &mut in_ghosts)];
        let handle = lists.into_iter().find_map(|(list, at)| {
            while list.get(*at).is_some_and(|link| link.id < copy.id) {
                *at += 1;
            }
            list.get(*at).filter(|link| link.id == copy.id).map(|link| link.handle)
        });
        let Some(shared) = handle.and_then(|handle| border.shared.get_mut(handle)) else { continue };
        match shared.heard.binary_search_by_key(&sender, |(rank, _)| *rank) {
            Ok(place) => shared.heard[place].1 = *copy,
            Err(place) => shared.heard.insert(place, (sender, *copy)),
        }
    }
}
