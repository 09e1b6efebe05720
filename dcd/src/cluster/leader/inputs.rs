//! Takes in clients' inputs for their avatars, within the world's limits, and keeps them until the ticks that
//! they name. Among the inputs of one avatar for one tick the newest counts.

use std::collections::BTreeMap;

use crate::cluster::MAX_AVATARS;
use crate::cluster::avatar_limits::AvatarLimits;
use crate::protocol::{EnvironmentProperties, Input, Refusal};
use crate::space::{BodyId, ClientId, Tick};

/// The time that an input waits for its avatar to appear, ticks.
const EARLY_TICKS: u64 = 60;

/// How far ahead an input may name its tick, ticks. An input that names a later one goes into the next tick.
const AHEAD_TICKS: u64 = 60;

/// The most inputs of a client that wait for the ticks that they name. Further ones go into the next tick.
const WAITING: usize = 1_024;

/// The inputs that the next ticks take, and the avatars that they may be for.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    limits: AvatarLimits,
    avatars: BTreeMap<BodyId, Avatar>,
    /// The number of each client's inputs that wait for the ticks that they name.
    counts: BTreeMap<ClientId, usize>,
    /// The newest inputs of each kind for avatars not heard of yet, and since when they wait.
    early: BTreeMap<(BodyId, bool), (Input, Tick)>,
    /// The logical times of the newest inputs of each kind that were done before the view.
    done: BTreeMap<(BodyId, bool), u64>,
    /// The clients that have sent such inputs again since the last tick, and up to which logical time.
    said_again: BTreeMap<ClientId, u64>,
}

/// An input for a tick, and how many ticks before the one that it names it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Taken {
    pub(super) input: Input,
    pub(super) early: i8,
}

/// An avatar in the world.
#[derive(Clone, Debug)]
struct Avatar {
    /// The logical times of its newest inputs of each kind; 0: none.
    newest: [u64; 2],
    /// Its inputs, by the tick that is to take them and by kind.
    waiting: BTreeMap<(Tick, bool), Taken>,
    /// The place where it was last heard of, or to which it jumps.
    place: [f64; 3],
    /// How far it could jump after the tick `since`, metres.
    jump_m: f64,
    since: Tick,
}

impl Inputs {
    pub(super) fn new(world: &EnvironmentProperties) -> Self {
        let limits = AvatarLimits::of(world);
        Self {
            limits,
            avatars: BTreeMap::new(),
            counts: BTreeMap::new(),
            early: BTreeMap::new(),
            done: BTreeMap::new(),
            said_again: BTreeMap::new(),
        }
    }

    /// Passes over inputs that were done before the view, if the avatar lives on in it.
    pub(super) fn pass_over(&mut self, done: BTreeMap<(BodyId, bool), u64>) {
        self.done = done;
    }

    /// Returns the clients that have, since the last call, sent inputs again that were done before the view,
    /// and up to which logical time.
    pub(super) fn take_said_again(&mut self) -> BTreeMap<ClientId, u64> {
        std::mem::take(&mut self.said_again)
    }

    /// Notes where an avatar is after this tick. `lives_on`: it goes on as it was in the view before. An
    /// avatar that was placed anew may be as it was before its last inputs.
    pub(super) fn see(&mut self, avatar: BodyId, place: [f64; 3], tick: Tick, lives_on: bool) {
        let jump_m = self.limits.longest_jump_m();
        let done = |kind| self.done.get(&(avatar, kind)).copied().filter(|_| lives_on).unwrap_or_default();
        let newest = [done(false), done(true)];
        let new = || Avatar { newest, waiting: BTreeMap::new(), place, jump_m, since: tick };
        self.avatars.entry(avatar).or_insert_with(new).place = place;
    }

    /// Returns the places of the avatars.
    pub(super) fn places(&self) -> impl Iterator<Item = [f64; 3]> {
        self.avatars.values().map(|avatar| avatar.place)
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        if let Some(avatar) = self.avatars.remove(&id) {
            uncount(&mut self.counts, id, avatar.waiting.len());
        }
    }

    /// Accepts an input for the tick that it names, or else for the next one. The avatar must be the client's
    /// own, and the input newer than the last one and within the world's limits. An input that names its tick
    /// and comes out of order, or twice, is passed over without a refusal.
    pub(super) fn accept(&mut self, client: ClientId, input: Input, now: Tick) -> Result<(), Refusal> {
        if input.body.client() != Some(client) {
            return Err(Refusal::NotYours);
        }
        // The server's program uses 0, and may do more.
        if input.logical_time == 0 {
            return Err(Refusal::Late);
        }
        self.limits.allow(&input.velocity)?;
        if self.avatars.contains_key(&input.body) {
            return self.admit(input, now);
        }
        // A leader may yet hear of the avatar, if it is new, or if the input reached it before the server's
        // word.
        let range = (BodyId::avatar(client, 0), false)..=(BodyId::avatar(client, u32::MAX), true);
        if self.early.range(range).count() >= 2 * MAX_AVATARS {
            return Err(Refusal::TooMany);
        }
        let (known, _) = self.early.entry(input.slot()).or_insert((input, now));
        if known.logical_time < input.logical_time {
            *known = input.after(known);
        }
        Ok(())
    }

    fn admit(&mut self, input: Input, now: Tick) -> Result<(), Refusal> {
        let avatar = self.avatars.get_mut(&input.body).ok_or(Refusal::Unknown)?;
        let (_, kind) = input.slot();
        let newest = &mut avatar.newest[usize::from(kind)];
        // It was sent again because it might have been lost.
        if *newest == input.logical_time {
            if self.done.get(&input.slot()) == Some(newest) {
                let client = input.body.client().unwrap_or(ClientId::NOBODY);
                let newest = self.said_again.entry(client).or_default();
                *newest = input.logical_time.max(*newest);
            }
            return Ok(());
        }
        let next = now.next();
        let names_tick = input.tick != Tick(0);
        if *newest > input.logical_time {
            // Inputs are sent twice, since packets are lost, so one may come before an earlier one.
            return if names_tick { Ok(()) } else { Err(Refusal::Late) };
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
        *newest = input.logical_time;
        let client = input.body.client().unwrap_or(ClientId::NOBODY);
        let count = self.counts.get(&client).copied().unwrap_or(0);
        let waits = names_tick && input.tick.0 <= next.0 + AHEAD_TICKS && count < WAITING;
        let tick = if waits { input.tick.max(next) } else { next };
        let early = if names_tick { input.tick.0 as i64 - next.0 as i64 } else { 0 };
        let early = early.clamp(i8::MIN.into(), i8::MAX.into()) as i8;
        // Inputs that were to be taken with this one or after it are older. Where one of them jumped, that
        // jump was allowed.
        let older = avatar.waiting.range((tick, false)..).map(|(&key, _)| key);
        let older: Vec<_> = older.filter(|&(_, of)| of == kind).collect();
        let older = older.iter().filter_map(|key| avatar.waiting.remove(key));
        let older: Vec<_> = older.map(|taken| taken.input).collect();
        uncount(&mut self.counts, input.body, older.len());
        let jump = older.iter().max_by_key(|one| (one.pose.is_some(), one.logical_time));
        let input = jump.map_or(input, |jump| input.after(jump));
        avatar.waiting.insert((tick, kind), Taken { input, early });
        *self.counts.entry(client).or_default() += 1;
        Ok(())
    }

    /// Takes inputs for avatars that have appeared in. Returns those to be refused, as they waited too long
    /// or ask for too much.
    pub(super) fn sort_early(&mut self, now: Tick) -> Vec<(BodyId, Refusal)> {
        let mut refused = Vec::new();
        let mut early: Vec<_> = std::mem::take(&mut self.early).into_values().collect();
        early.sort_by_key(|(input, _)| (input.body, input.logical_time));
        for (input, since) in early {
            let id = input.body;
            if self.avatars.contains_key(&id) {
                match self.admit(input, now) {
                    // A later input may have come since the avatar appeared.
                    Ok(()) | Err(Refusal::Late) => {}
                    Err(refusal) => {
                        refused.push((id, refusal));
                        // What was asked after a jump that is too far still counts.
                        if refusal == Refusal::TooFar {
                            let _ = self.admit(Input { pose: None, ..input }, now);
                        }
                    }
                }
            } else if now.0 - since.0 < EARLY_TICKS {
                self.early.insert(input.slot(), (input, since));
            } else {
                refused.push((id, Refusal::Unknown));
            }
        }
        refused
    }

    /// Takes the inputs of a tick, in id order: the newest of each kind for each avatar.
    pub(super) fn take(&mut self, tick: Tick) -> Vec<Taken> {
        let mut due = Vec::new();
        for (id, avatar) in &mut self.avatars {
            let later = avatar.waiting.split_off(&(tick.next(), false));
            let now = std::mem::replace(&mut avatar.waiting, later);
            uncount(&mut self.counts, *id, now.len());
            let newest: BTreeMap<_, _> = now.into_iter().map(|((_, kind), taken)| (kind, taken)).collect();
            due.extend(newest.into_values());
        }
        due
    }

    /// Returns the inputs that are due by a tick.
    pub(super) fn due(&self, tick: Tick) -> impl Iterator<Item = Input> {
        let waiting = self.avatars.values().flat_map(move |avatar| avatar.waiting.range(..=(tick, true)));
        waiting.map(|(_, taken)| taken.input)
    }

    /// Returns all inputs that no tick has taken, those of each avatar in the order in which they were made.
    pub(super) fn into_untaken(self) -> impl Iterator<Item = Input> {
        let early = self.early.into_values().map(|(input, _)| input);
        let waiting = self.avatars.into_values().flat_map(|avatar| avatar.waiting.into_values());
        let mut untaken: Vec<_> = waiting.map(|taken| taken.input).chain(early).collect();
        untaken.sort_by_key(|input| (input.body, input.logical_time));
        untaken.into_iter()
    }
}

/// Notes that this many inputs of a client's avatar wait no more.
fn uncount(counts: &mut BTreeMap<ClientId, usize>, avatar: BodyId, gone: usize) {
    let client = avatar.client().unwrap_or(ClientId::NOBODY);
    if let Some(count) = counts.get_mut(&client) {
        *count -= gone;
        if *count == 0 {
            counts.remove(&client);
        }
    }
}
