//! Chooses what a client is told next, within the bytes that its link carries and that it asked for: of more bodies than there is room
//! for those first that it has most wrong, seen from its avatars, and for longest.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use super::news::Latest;
use crate::delta::{FreeMotion, Sender};
use crate::protocol::{Heard, Part, STATES_BYTES, SharedState, link};
use crate::space::{BodyId, ClientId, Tick};

/// The most bytes of a batch: all of its datagrams wait in the queue of a link at once. What is beyond would push out the first ones.
const MOST_BYTES: usize = link::DATAGRAM_QUEUE_BYTES * 5 / 8;

/// The fewest bytes that a batch may have come down to, and those of one for a client that is silent.
const LEAST_BYTES: usize = 1_000;

/// What may wait for the link when a batch follows, bytes. If nothing ever waited, QUIC would not learn what the link carries, and
/// would send ever more slowly what there is; at twice as much the oldest are dropped.
const WAITING_BYTES: usize = link::DATAGRAM_QUEUE_BYTES / 2;

/// What a datagram costs beside its states: headers of UDP, QUIC and the message.
const DATAGRAM_COST: usize = 90;

/// The bytes of a batch for a client that has not acknowledged anything yet, and may be going to ask for few.
const FIRST_BYTES: usize = 4_000;

/// A client that has acknowledged nothing for so long, though there was something to, is gone, or cut off.
const SILENCE: Duration = Duration::from_secs(1);

/// The ticks between two batches to a client that is silent.
const PROBE_TICKS: u64 = 15;

/// The seconds whose bytes a client that was told little may be sent at once, beside those since its last turn.
const SAVED_S: f64 = 0.1;

/// The most seconds since its last turn that count.
const TURN_S: f64 = 0.5;

/// The most seconds for whose bytes a client waits that was sent too many.
const OWED_S: f64 = 1.0;

/// The bytes that a batch waits for if there is more to tell than fits: of a smaller one headers would be most.
const WORTH_BYTES: f64 = 400.0;

/// What a body counts though it is where the client has it, metres: so that all have their turn.
const LEAST_ERROR_M: f64 = 0.002;

/// The error of a body that the client was never told of, metres.
const UNTOLD_ERROR_M: f64 = 10.0;

/// Bodies nearer to an avatar than this are equally near, metres: it touches them, or could.
const NEAR_M: f64 = 2.0;

/// The batches of bodies that moved which are kept for clients that have not had their turn yet.
const BATCHES: usize = 32;

/// The bodies that moved lately, as members reported them.
#[derive(Clone, Debug, Default)]
pub(super) struct Batches {
    /// The number of the next one.
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

    /// Returns the batches from this one on; `None` if some are no longer known.
    fn since(&self, number: u64) -> Option<impl Iterator<Item = BodyId> + '_> {
        let missed = usize::try_from(self.next - number).ok()?;
        let first = self.batches.len().checked_sub(missed)?;
        Some(self.batches.range(first..).flatten().copied())
    }
}

/// The link to a client, beginning with what it has been told.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    client: ClientId,
    sender: Sender,
    /// Bodies that it is still to be told of, beside those of batches from this one on, if it hears all.
    waiting: BTreeSet<BodyId>,
    caught_up: u64,
    /// The bytes of a batch that the link carries until the next one.
    carried: usize,
    /// The bytes a second that the client asked for; 0: as many as the link carries.
    asked: u32,
    /// What may be sent at once of what the client asked for, and the tick at which that was so.
    allowed: (f64, Tick),
    /// What a body has taken lately, bytes.
    body_bytes: f64,
    /// When it had its last turn.
    turn: Tick,
    /// Whether it has acknowledged anything, and since when it has not though there was something to.
    is_heard: bool,
    silent_since: Option<Duration>,
    /// When it is sent something though it is silent.
    probe_at: Tick,
}

impl Channel {
    /// Returns that of a client that knows nothing of what is sent in this series.
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

    /// Notes how many bytes of the batches before still waited for the link when one was sent: batches become smaller while that is
    /// much, and larger again while it is not.
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

    /// Returns whether the client asked for few bytes.
    pub(super) fn is_limited(&self) -> bool {
        self.asked > 0
    }

    /// Returns when it had its last turn.
    pub(super) fn turn(&self) -> Tick {
        self.turn
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        self.sender.forget(id);
        self.waiting.remove(&id);
    }

    /// Returns whether anything waits to be told, or to be told again.
    pub(super) fn waits(&mut self, now: Tick) -> bool {
        self.waiting.extend(self.sender.overdue(now));
        !self.waiting.is_empty()
    }

    /// Returns whether the client has acknowledged nothing for long; what waits to be is then taken for lost.
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

    /// Notes bodies that the client is to be told of.
    pub(super) fn wait_for(&mut self, bodies: impl IntoIterator<Item = BodyId>) {
        self.waiting.extend(bodies);
    }

    /// Notes those that moved since this was called last.
    pub(super) fn catch_up<I: Iterator<Item = BodyId>>(
        &mut self,
        batches: &Batches,
        all: impl FnOnce() -> I,
    ) {
        // To sort them all at once is quicker than to put in one by one.
        let waiting = std::mem::take(&mut self.waiting).into_iter();
        self.waiting = match batches.since(self.caught_up) {
            Some(bodies) => waiting.chain(bodies).collect(),
            None => waiting.chain(all()).collect(),
        };
        self.caught_up = batches.next();
    }

    /// Returns the bodies to tell of now, in id order, at most so many of those that wait; and how many were compared for that.
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
        // What is gone does not wait.
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

    /// Returns all that wait.
    pub(super) fn choose_all(&mut self, latest: &Latest) -> Vec<SharedState> {
        let waiting = std::mem::take(&mut self.waiting);
        waiting.iter().filter_map(|id| latest.get(id)).map(|(state, _)| *state).collect()
    }

    /// Returns how much it matters that the client is told of a body: its error as seen from the nearest avatar, and the ticks since it
    /// was told last.
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

    /// Returns the bytes that are held for the client, those of each body and the rest.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> (usize, usize) {
        let (bodies, rest) = self.sender.bytes();
        (bodies, rest + self.waiting.len() * size_of::<BodyId>())
    }

    /// Codes the states that were chosen, as they were after a tick; those that a leader has told its relay as it has coded them, with the
    /// component that was left out of their rotation.
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
            // Rather too few than too many.
            self.body_bytes = each.max(self.body_bytes + (each - self.body_bytes) / 8.0);
            self.allowed.0 -= (bytes + parts.len() * DATAGRAM_COST) as f64;
        }
        parts
    }
}
