//! Takes in clients' inputs for their avatars: of each the newest counts, if it is within the world's limits.

use std::collections::BTreeMap;

use crate::cluster::MAX_AVATARS;
use crate::cluster::avatar_limits::AvatarLimits;
use crate::protocol::{EnvironmentProperties, Input, Refusal};
use crate::space::{BodyId, ClientId, Tick};

/// How long an input waits for its avatar to appear, in ticks.
const EARLY_TICKS: u64 = 60;

/// The inputs that the next tick takes, and the avatars that they may be for.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    limits: AvatarLimits,
    avatars: BTreeMap<BodyId, Avatar>,
    next: BTreeMap<(BodyId, bool), Input>,
    /// Newest inputs for avatars not heard of yet, and since when they wait.
    early: BTreeMap<BodyId, (Input, Tick)>,
}

/// An avatar in the world.
#[derive(Clone, Copy, Debug)]
struct Avatar {
    /// The logical time of its newest input.
    newest: Option<u64>,
    /// As last heard of, or where it jumps to.
    place: [f64; 3],
    /// How far it could jump after this tick, metres.
    jump_m: f64,
    since: Tick,
}

impl Inputs {
    pub(super) fn new(world: &EnvironmentProperties) -> Self {
        let limits = AvatarLimits::of(world);
        Self { limits, avatars: BTreeMap::new(), next: BTreeMap::new(), early: BTreeMap::new() }
    }

    /// Notes where an avatar is after this tick.
    pub(super) fn see(&mut self, avatar: BodyId, place: [f64; 3], tick: Tick) {
        let new = Avatar { newest: None, place, jump_m: self.limits.longest_jump_m(), since: tick };
        self.avatars.entry(avatar).or_insert(new).place = place;
    }

    pub(super) fn forget(&mut self, avatar: BodyId) {
        self.avatars.remove(&avatar);
        self.next.retain(|(id, _), _| *id != avatar);
    }

    /// Accepts an input for the next tick if the avatar is the client's own, and the input is newer than the last one and within the
    /// world's limits.
    pub(super) fn accept(&mut self, client: ClientId, input: Input, now: Tick) -> Result<(), Refusal> {
        if input.body.client() != Some(client) {
            return Err(Refusal::NotYours);
        }
        // The server's program says 0, and may do more.
        if input.logical_time == 0 {
            return Err(Refusal::Late);
        }
        self.limits.allow(&input.velocity)?;
        if self.avatars.contains_key(&input.body) {
            return self.take(input, now);
        }
        // A new leader, or one whom the input reached before the server's word, may yet hear of the avatar.
        let range = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        if self.early.range(range).count() >= MAX_AVATARS {
            return Err(Refusal::TooMany);
        }
        let (known, _) = self.early.entry(input.body).or_insert((input, now));
        if known.logical_time < input.logical_time {
            *known = input;
        }
        Ok(())
    }

    fn take(&mut self, input: Input, now: Tick) -> Result<(), Refusal> {
        let avatar = self.avatars.get_mut(&input.body).ok_or(Refusal::Unknown)?;
        // Sent again because it might have been lost.
        if avatar.newest == Some(input.logical_time) {
            return Ok(());
        }
        if avatar.newest > Some(input.logical_time) {
            return Err(Refusal::Late);
        }
        if let Some(pose) = input.pose {
            let way = (0..3).map(|k| (pose.translation[k] - avatar.place[k]).powi(2));
            let way_m = way.sum::<f64>().sqrt();
            let reach_m = self.limits.reach_m(avatar.jump_m, now.0.saturating_sub(avatar.since.0));
            if way_m > reach_m {
                return Err(Refusal::TooFar);
            }
            (avatar.jump_m, avatar.since) = (reach_m - way_m, now);
            avatar.place = pose.translation;
        }
        avatar.newest = Some(input.logical_time);
        self.next.insert(input.slot(), input);
        Ok(())
    }

    /// Takes inputs for avatars that have appeared in; returns those to be refused, as they waited too long or ask for too much.
    pub(super) fn sort_early(&mut self, now: Tick) -> Vec<(BodyId, Refusal)> {
        let mut refused = Vec::new();
        for (id, (input, since)) in std::mem::take(&mut self.early) {
            if self.avatars.contains_key(&id) {
                match self.take(input, now) {
                    // A later input may have come since the avatar appeared.
                    Ok(()) | Err(Refusal::Late) => {}
                    Err(refusal) => refused.push((id, refusal)),
                }
            } else if now.0 - since.0 < EARLY_TICKS {
                self.early.insert(id, (input, since));
            } else {
                refused.push((id, Refusal::Unknown));
            }
        }
        refused
    }

    /// Takes the inputs of the next tick, in id order.
    pub(super) fn take_next(&mut self) -> impl Iterator<Item = Input> + use<> {
        std::mem::take(&mut self.next).into_values()
    }

    /// Returns the inputs of the next tick.
    pub(super) fn next(&self) -> impl Iterator<Item = Input> {
        self.next.values().copied()
    }

    /// Returns all inputs that no tick has taken, of each avatar in the order in which they were made.
    pub(super) fn into_untaken(self) -> impl Iterator<Item = Input> {
        let early = self.early.into_values().map(|(input, _)| input);
        let mut untaken: Vec<_> = self.next.into_values().chain(early).collect();
        untaken.sort_by_key(|input| (input.body, input.logical_time));
        untaken.into_iter()
    }
}
