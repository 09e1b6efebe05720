//! Chooses which bodies a client is sent next, within the bytes that its link carries and that it asked for.
//! If there are more bodies than room, those come first that the client has most wrong, seen from its
//! avatars, and for longest.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use super::news::Latest;
use crate::delta::{FreeMotion, Sender};
use crate::protocol::{Heard, Part, STATES_BYTES, SharedState, link};
use crate::space::{BodyId, ClientId, Tick};

/// The most bytes of a batch. All of its datagrams wait in the queue of a link at once; more would push out
/// the first ones.
const MOST_BYTES: usize = link::DATAGRAM_QUEUE_BYTES * 5 / 8;

/// The fewest bytes to which a batch may have come down, and the bytes of a batch for a client that is
/// silent.
const LEAST_BYTES: usize = 1_000;

/// The bytes that may wait for the link when a batch follows. If nothing ever waited, QUIC would not learn
/// what the link carries, and would send ever more slowly. At twice as many bytes the oldest datagrams are
/// dropped.
const WAITING_BYTES: usize = link::DATAGRAM_QUEUE_BYTES / 2;

/// The bytes that a datagram costs beside its states: headers of UDP, QUIC and the message.
const DATAGRAM_COST: usize = 90;

/// The bytes of a batch for a client that has not acknowledged anything yet, and may be about to ask for few.
const FIRST_BYTES: usize = 4_000;

/// The time after which a client counts as silent: it has acknowledged nothing, though there was something to
/// acknowledge, and is gone or cut off.
const SILENCE: Duration = Duration::from_secs(1);

/// The number of ticks between two batches to a client that is silent.
const PROBE_TICKS: u64 = 15;

/// The seconds whose bytes a client that was sent little may be sent at once, beside those earned since its
/// last batch.
const SAVED_S: f64 = 0.1;

/// The most seconds since its last batch that earn bytes.
const TURN_S: f64 = 0.5;

/// The most seconds of bytes that a client waits for after it was sent too many.
const OWED_S: f64 = 1.0;

/// The bytes for which a batch waits if there is more to send than fits. In a smaller batch headers would be
/// the most part.
const WORTH_BYTES: f64 = 400.0;

/// The error that every body counts with at least, metres, even if it is where the client has it: so every
/// body has its turn.
const LEAST_ERROR_M: f64 = 0.002;

/// The error that a body counts with of which the client was never told, metres.
const UNTOLD_ERROR_M: f64 = 10.0;

/// The distance from an avatar below which bodies count as equally near, metres: they touch it, or could.
const NEAR_M: f64 = 2.0;

/// The number of batches of moved bodies that are kept for clients that were not sent them yet.
const BATCHES: usize = 32;

/// The bodies that moved lately, in batches as members reported them.
#[derive(Clone, Debug, Default)]
pub(super) struct Batches {
    /// The number of the next batch.
    next: u64,
    batches: VecDeque<Vec<BodyId>>,
}

impl Batches {
    pub(super) fn push(&mut self, bodies: Vec<BodyId>) {
        self.next += 1;
        self.batches.push_back(bodies);
        if self.batches.len() > BATCHES {
            self.batches.pop_front();
        }
    }

    /// Returns the number of the next batch.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// Returns the bodies of the batches from this number on; `None` if some are no longer known.
    fn since(&self, number: u64) -> Option<impl Iterator<Item = BodyId> + '_> {
        let missed = usize::try_from(self.next - number).ok()?;
        let first = self.batches.len().checked_sub(missed)?;
        Some(self.batches.range(first..).flatten().copied())
    }
}

/// What one client has been sent and has acknowledged, and how much it may be sent.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    client: ClientId,
    sender: Sender,
    /// The bodies that the client is still to be sent. If it has no area, it is also to be sent those of all
    /// batches from number `caught_up` on.
    waiting: BTreeSet<BodyId>,
    caught_up: u64,
    /// The bytes of a batch that the link carries until the next one.
    carried: usize,
    /// The bytes per second that the client asked for; 0: as many as the link carries.
    asked: u32,
    /// The bytes that may be sent at once within what the client asked for, and the tick at which that was
    /// so.
    allowed: (f64, Tick),
    /// The bytes that a body has taken lately.
    body_bytes: f64,
    /// The tick in which a batch was last chosen for it.
    turn: Tick,
    /// Says whether the client has ever acknowledged anything; and since when it has not, though there was
    /// something to acknowledge.
    is_heard: bool,
    silent_since: Option<Duration>,
    /// The tick in which it is next sent something though it is silent.
    probe_at: Tick,
}

impl Channel {
    /// Returns the channel of a client that knows nothing of what is sent in this series.
    pub(super) fn new(client: ClientId, motion: FreeMotion, series: u32, caught_up: u64) -> Self {
        Self {
            client,
            sender: Sender::new(motion, series),
            waiting: BTreeSet::new(),
            caught_up,
            carried: MOST_BYTES,
            asked: 0,
            allowed: (0.0, Tick(0)),
            body_bytes: 20.0,
            turn: Tick(0),
            is_heard: false,
            silent_since: None,
            probe_at: Tick(0),
        }
    }

    /// Notes how many bytes of earlier batches still waited for the link when one was sent. Batches become
    /// smaller while these are many, and larger again while they are not.
    pub(super) fn adapt(&mut self, waiting_bytes: usize) {
        self.carried = match waiting_bytes > WAITING_BYTES {
            true => (self.carried * 3 / 4).max(LEAST_BYTES),
            false => (self.carried + self.carried / 16).min(MOST_BYTES),
        };
    }

    /// Takes in what the client has acknowledged.
    pub(super) fn hear(&mut self, now: Tick, heard: &Heard) {
        if self.asked != heard.bytes_per_s {
            (self.asked, self.allowed) = (heard.bytes_per_s, (0.0, now));
        }
        self.is_heard = true;
        if self.sender.hear(now, heard) {
            self.silent_since = None;
        }
        if heard.lost {
            self.waiting.extend(self.sender.restart(now, heard.series));
        }
    }

    /// Returns whether the client asked for a limited rate.
    pub(super) fn is_limited(&self) -> bool {
        self.asked > 0
    }

    /// Returns the tick in which a batch was last chosen for the client.
    pub(super) fn turn(&self) -> Tick {
        self.turn
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        self.sender.forget(id);
        self.waiting.remove(&id);
    }

    /// Returns whether anything waits to be sent, or to be sent again.
    pub(super) fn waits(&mut self, now: Tick) -> bool {
        self.waiting.extend(self.sender.overdue(now));
        !self.waiting.is_empty()
    }

    /// Returns whether the client has acknowledged nothing for long. What waits to be acknowledged then
    /// counts as lost.
    fn is_silent(&mut self, clock: Duration) -> bool {
        if !self.sender.waits() {
            self.silent_since = None;
            return false;
        }
        let is_silent = *self.silent_since.get_or_insert(clock) + SILENCE < clock;
        if is_silent {
            self.sender.give_up();
        }
        is_silent
    }

    /// Returns the bytes that a batch may take now.
    fn room(&mut self, now: Tick, clock: Duration, dt_s: f64) -> usize {
        let most = if self.is_silent(clock) {
            if now < self.probe_at {
                return 0;
            }
            self.probe_at = Tick(now.0 + PROBE_TICKS);
            LEAST_BYTES
        } else if self.is_heard {
            self.carried
        } else {
            self.carried.min(FIRST_BYTES)
        };
        if self.asked == 0 {
            return most;
        }
        let (saved, since) = self.allowed;
        let rate = f64::from(self.asked);
        let earned_s = (dt_s * now.0.saturating_sub(since.0) as f64).min(TURN_S);
        let allowed = saved.min(WORTH_BYTES.max(rate * SAVED_S)) + rate * earned_s;
        self.allowed = (allowed.max(-rate * OWED_S), now);
        most.min(allowed.max(0.0) as usize)
    }

    /// Notes bodies that the client is to be sent.
    pub(super) fn wait_for(&mut self, bodies: impl IntoIterator<Item = BodyId>) {
        self.waiting.extend(bodies);
    }

    /// Notes the bodies that moved since the last call; `all` bodies, if some of their batches are no longer
    /// known.
    pub(super) fn catch_up<I: Iterator<Item = BodyId>>(
        &mut self,
        batches: &Batches,
        all: impl FnOnce() -> I,
    ) {
        // Sorting them all at once is quicker than inserting them one by one.
        let waiting = std::mem::take(&mut self.waiting).into_iter();
        self.waiting = match batches.since(self.caught_up) {
            Some(bodies) => waiting.chain(bodies).collect(),
            None => waiting.chain(all()).collect(),
        };
        self.caught_up = batches.next();
    }

    /// Returns the states to send now, in id order, at most `most` of those that wait; and how many bodies
    /// were compared for that.
    pub(super) fn choose(
        &mut self,
        (now, clock, dt_s): (Tick, Duration, f64),
        latest: &Latest,
        most: usize,
    ) -> (Vec<SharedState>, usize) {
        self.turn = now;
        let room = self.room(now, clock, dt_s) as f64;
        let datagrams = (room / (STATES_BYTES + DATAGRAM_COST) as f64).ceil();
        let count = ((room - datagrams * DATAGRAM_COST as f64) / self.body_bytes).max(0.0) as usize;
        let count = count.min(most);
        if self.waiting.len() <= count {
            return (self.choose_all(latest), 0);
        }
        if count == 0 || room < WORTH_BYTES.min(self.carried as f64) {
            return (Vec::new(), 0);
        }
        // Bodies that are gone do not wait.
        self.waiting.retain(|id| latest.contains_key(id));
        let compared = self.waiting.len();
        let own = BodyId::avatar(self.client, 0)..=BodyId::avatar(self.client, u32::MAX);
        let avatars: Vec<_> = latest.range(own).map(|(_, (state, _))| state.pose.translation).collect();
        let mut ranked: Vec<_> = self
            .waiting
            .iter()
            .filter_map(|id| latest.get(id))
            .map(|&(state, tick)| (self.urgency(now, &state, tick, &avatars), state))
            .collect();
        if count < ranked.len() {
            ranked.select_nth_unstable_by(count - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.id.cmp(&b.1.id)));
            ranked.truncate(count);
        }
        let mut told: Vec<_> = ranked.into_iter().map(|(_, state)| state).collect();
        told.sort_unstable_by_key(|state| state.id);
        for state in &told {
            self.waiting.remove(&state.id);
        }
        (told, compared)
    }

    /// Returns the states of all bodies that wait.
    pub(super) fn choose_all(&mut self, latest: &Latest) -> Vec<SharedState> {
        let waiting = std::mem::take(&mut self.waiting);
        waiting.iter().filter_map(|id| latest.get(id)).map(|(state, _)| *state).collect()
    }

    /// Returns how urgent it is to send a body: its error at the client, as seen from the client's nearest
    /// avatar, times the ticks since it was last sent. Own avatars come before all.
    fn urgency(&self, now: Tick, state: &SharedState, tick: Tick, avatars: &[[f64; 3]]) -> f64 {
        if state.id.client() == Some(self.client) {
            return f64::INFINITY;
        }
        let away = |at: &[f64; 3]| {
            (0..3).map(|axis| (at[axis] - state.pose.translation[axis]).powi(2)).sum::<f64>().sqrt()
        };
        let nearest = avatars.iter().map(away).reduce(f64::min).unwrap_or(0.0);
        let (error, since) = self.sender.error_m(now, state, tick).unwrap_or((UNTOLD_ERROR_M, Tick(0)));
        let age = now.0.saturating_sub(since.0).min(1_000) as f64;
        (LEAST_ERROR_M + error) * (1.0 + age) / (NEAR_M + nearest)
    }

    /// Returns the bytes that are held for the client: those of bodies, and the rest.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> (usize, usize) {
        let (bodies, rest) = self.sender.bytes();
        (bodies, rest + self.waiting.len() * size_of::<BodyId>())
    }

    /// Codes the states that were chosen, as they were after a tick. At a relay, `left_out` tells which
    /// component of a body's rotation the leader has left out, so that the relay's coding comes to the same
    /// numbers.
    pub(super) fn pack(
        &mut self,
        (now, tick): (Tick, Tick),
        states: &[SharedState],
        guesses: bool,
        left_out: impl Fn(BodyId) -> Option<u8>,
    ) -> Vec<Part> {
        let parts = self.sender.pack_again(now, tick, states, guesses, STATES_BYTES, left_out);
        let bytes: usize = parts.iter().map(|part| part.states.len()).sum();
        if !guesses && !states.is_empty() {
            let each = bytes as f64 / states.len() as f64;
            // The next batch is to have too few bodies rather than too many.
            self.body_bytes = each.max(self.body_bytes + (each - self.body_bytes) / 8.0);
            self.allowed.0 -= (bytes + parts.len() * DATAGRAM_COST) as f64;
        }
        parts
    }
}
