//! Writes the states of bodies for one client, against the states that it has acknowledged.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::coder::{Models, Writer};
use super::free_motion::FreeMotion;
use super::quantise::Quantised;
use crate::protocol::{Heard, Part, SharedState};
use crate::space::{BodyId, Tick};

/// The most bodies in a datagram, however few bits they take.
pub(super) const MAX_BODIES: usize = 1_024;

/// The most bytes that the code of one body takes: all numbers at their longest, under models that expect
/// something else.
const LONGEST_BYTES: usize = 180;

/// The bytes of the count and of the coder's last words.
const FRAME_BYTES: usize = 2 + 8;

/// The number of datagrams of which it is known whether they were acknowledged. Older ones are taken for
/// lost.
const REMEMBERED: usize = 2_048;

/// The number of datagrams to a client that was given up whose acknowledgements still count: those of many
/// seconds, since it is told little.
const PROBES: usize = 64;

/// The most states of a body that are kept while they wait to be acknowledged: the newest, and some before
/// it. Other states are told too, but none is told against them.
const KEPT: usize = 4;

/// The number of datagrams that acknowledgements may name per tick, besides some that were saved up, and what
/// each message counts besides those: many times what an honest client says.
const HEARD_PER_TICK: usize = 256;
const HEARD_COST: usize = 16;

/// The ticks for which a body's newest state waits to be acknowledged before it is sent again: at least this
/// many, and twice as many as acknowledgements took.
const PATIENCE_TICKS: f64 = 6.0;

/// The interval at which what waits to be acknowledged is looked through, ticks.
const LOOK_TICKS: u64 = 3;

/// The ticks for which a sender that began anew does not begin anew again.
const RESTART_TICKS: u64 = 30;

/// The number of series that a sender has. Those of the next sender begin where these end.
pub(crate) const RESTARTS: u32 = 64;

/// The sender for one client. Time is counted in ticks of the world.
#[derive(Clone, Debug)]
pub struct Sender {
    motion: FreeMotion,
    series: u32,
    batch: u32,
    /// The number of the next datagram.
    number: u32,
    /// The newest datagrams, up to the one before the next.
    flights: VecDeque<Flight>,
    bodies: BTreeMap<BodyId, History>,
    /// The bodies whose newest state is not acknowledged, and the tick at which they are looked through next.
    unheard: BTreeSet<BodyId>,
    look_at: u64,
    /// How long acknowledgements take, ticks; `None` before the first.
    delay_ticks: Option<f64>,
    /// How many datagrams acknowledgements may name, and the tick for which that holds.
    allowed: (usize, u64),
    /// Says whether anything was sent since the client last acknowledged anything new.
    waits: bool,
    /// The tick at which it last began anew, referring to nothing told before.
    began: u64,
}

#[derive(Clone, Copy, Debug)]
struct Flight {
    sent: u64,
    heard: bool,
}

/// The states of a body that a client may have.
#[derive(Clone, Debug, Default)]
struct History {
    /// The newest state that the client is known to have.
    known: Option<Version>,
    /// Later states, the newest last; at most [`KEPT`].
    sent: Vec<Version>,
}

#[derive(Clone, Copy, Debug)]
struct Version {
    batch: u32,
    number: u32,
    tick: u64,
    state: Quantised,
    /// Says whether the client shows the body falling from there.
    falls: bool,
}

impl History {
    /// Keeps the newest state. As many of those before it stay as are spread over the time that an
    /// acknowledgement takes: the oldest is acknowledged first, and until then the others would only fill
    /// memory.
    fn keep(&mut self, newest: Version, delay_ticks: f64, is_lost: impl Fn(&Version) -> bool) {
        while self.sent.first().is_some_and(&is_lost) {
            self.sent.remove(0);
        }
        if let [.., before, last] = self.sent[..] {
            let apart = last.tick.saturating_sub(before.tick) as f64;
            if self.sent.len() == KEPT || apart < delay_ticks / (KEPT - 1) as f64 {
                self.sent.pop();
            }
        }
        self.sent.reserve_exact(1);
        self.sent.push(newest);
    }

    /// Applies acknowledgements. Returns whether the newest state is acknowledged.
    fn settle(&mut self, flights: &Flights<'_>) -> bool {
        if let Some(at) = self.sent.iter().rposition(|version| flights.is_heard(version.number)) {
            self.known = self.sent.drain(..=at).next_back();
        }
        self.sent.is_empty()
    }
}

/// The datagrams of which it is known whether they were acknowledged.
struct Flights<'a> {
    next: u32,
    flights: &'a VecDeque<Flight>,
}

impl Flights<'_> {
    /// Returns when a datagram was sent; 0 if that was too long ago.
    fn sent_at(&self, number: u32) -> u64 {
        let before = self.next.wrapping_sub(number) as usize;
        self.flights
            .len()
            .checked_sub(before)
            .and_then(|at| self.flights.get(at))
            .map_or(0, |flight| flight.sent)
    }

    fn is_heard(&self, number: u32) -> bool {
        let before = self.next.wrapping_sub(number) as usize;
        let at = self.flights.len().checked_sub(before);
        at.and_then(|at| self.flights.get(at)).is_some_and(|flight| flight.heard)
    }
}

impl Sender {
    /// Returns a sender that knows nothing of its client. A later series has a higher number.
    pub fn new(motion: FreeMotion, series: u32) -> Self {
        Self {
            motion,
            series,
            batch: 0,
            number: 0,
            flights: VecDeque::new(),
            bodies: BTreeMap::new(),
            unheard: BTreeSet::new(),
            look_at: 0,
            delay_ticks: None,
            allowed: (REMEMBERED, 0),
            waits: false,
            began: 0,
        }
    }

    /// Returns the number of the present series.
    pub fn series(&self) -> u32 {
        self.series
    }

    /// Writes a batch of states of one tick, in id order, into as few parts of at most `limit` bytes as
    /// possible. Later states do not refer to guesses.
    ///
    /// # Panics
    /// When `limit` is too small for one body.
    pub fn pack(
        &mut self,
        now: Tick,
        tick: Tick,
        states: &[SharedState],
        guesses: bool,
        limit: usize,
    ) -> Vec<Part> {
        self.pack_again(now, tick, states, guesses, limit, |_| None)
    }

    /// Does the same as [`Self::pack`] with states of which some come from the same grid, as an
    /// [`OrderedReceiver`](super::OrderedReceiver) has read them. `left_out` returns which component of the
    /// rotation was left out of such a body.
    pub(crate) fn pack_again(
        &mut self,
        now: Tick,
        tick: Tick,
        states: &[SharedState],
        guesses: bool,
        limit: usize,
        left_out: impl Fn(BodyId) -> Option<u8>,
    ) -> Vec<Part> {
        assert!(limit >= FRAME_BYTES + LONGEST_BYTES, "a part of {limit} bytes cannot hold a body");
        self.batch = self.batch.wrapping_add(1);
        let mut states = states.iter().peekable();
        let mut parts = Vec::new();
        while states.peek().is_some() {
            let number = self.number;
            if !guesses {
                self.number = self.number.wrapping_add(1);
                if self.flights.len() == REMEMBERED {
                    self.flights.pop_front();
                }
                self.flights.push_back(Flight { sent: now.0, heard: false });
                self.waits = true;
            }
            let (mut writer, mut models, mut count) = (Writer::new(), Models::new(), 0u16);
            let (mut id, mut before) = (BodyId::default(), Quantised::default());
            while let Some(state) = states.peek() {
                let told = (now, tick, number, guesses);
                let left_out = left_out(state.id);
                before = self.write(&mut writer, &mut models, (id, &before), (state, left_out), told);
                id = state.id;
                count += 1;
                states.next();
                let room = limit.saturating_sub(2 + writer.len());
                if usize::from(count) == MAX_BODIES || room < LONGEST_BYTES {
                    break;
                }
            }
            let mut states = count.to_le_bytes().to_vec();
            states.extend(writer.into_bytes());
            parts.push(Part { series: self.series, batch: self.batch, number, states });
        }
        parts
    }

    fn write(
        &mut self,
        writer: &mut Writer,
        models: &mut Models,
        (id, before): (BodyId, &Quantised),
        (state, left_out): (&SharedState, Option<u8>),
        (now, tick, number, guesses): (Tick, Tick, u32, bool),
    ) -> Quantised {
        let delay_ticks = self.delay_ticks.unwrap_or(0.0);
        let lost_before = self.delay_ticks.map_or(0, |_| now.0.saturating_sub(self.patience()));
        let history = self.bodies.entry(state.id).or_default();
        let flights = Flights { next: self.number, flights: &self.flights };
        history.settle(&flights);
        let known = history.known.filter(|known| known.batch != self.batch && known.tick <= tick.0);
        let body = match left_out {
            Some(left_out) => Quantised::again(state, left_out),
            None => Quantised::of(state, known.map(|known| known.state.left_out)),
        };
        let batches = known.map_or(0, |known| self.batch.wrapping_sub(known.batch));
        let read = models.id(writer, id, state.id).and_then(|_| {
            models.batches(writer, batches)?;
            match known {
                Some(known) => {
                    let ticks = tick.0 - known.tick;
                    models.changed(writer, &self.motion.guesses(&known.state, ticks), &body)
                }
                None => models.whole(writer, before, &body),
            }
        });
        let read = read.expect("memory takes all");
        if !guesses {
            let before = history.sent.last().or(history.known.as_ref()).filter(|before| before.tick < tick.0);
            let falls = before.is_some_and(|it| self.motion.falls(&it.state, &read, tick.0 - it.tick));
            let newest = Version { batch: self.batch, number, tick: tick.0, state: read, falls };
            history.keep(newest, delay_ticks, |kept| flights.sent_at(kept.number) < lost_before);
            self.unheard.insert(state.id);
        }
        read
    }

    /// Applies what the client has acknowledged. Returns whether any of it is new.
    pub fn hear(&mut self, now: Tick, heard: &Heard) -> bool {
        if heard.series != self.series {
            return false;
        }
        let numbers =
            heard.datagrams.iter().flat_map(|&(first, count)| (0..count).map(move |i| first.wrapping_add(i)));
        let mut newest = None;
        for number in numbers.take(self.allowance(now)) {
            self.allowed.0 -= 1;
            let before = self.number.wrapping_sub(number) as usize;
            let Some(at) = self.flights.len().checked_sub(before) else { continue };
            if let Some(flight) = self.flights.get_mut(at).filter(|flight| !flight.heard) {
                flight.heard = true;
                newest = Some(flight.sent);
            }
        }
        let Some(sent) = newest else { return false };
        self.waits = false;
        let took = now.0.saturating_sub(sent) as f64;
        let delay_ticks = self.delay_ticks.get_or_insert(took);
        *delay_ticks += (took - *delay_ticks) / 8.0;
        true
    }

    /// Returns how many datagrams an acknowledgement may name now. What a flood names beyond that counts as
    /// unheard, and costs nothing.
    fn allowance(&mut self, now: Tick) -> usize {
        let (saved, since) = self.allowed;
        let ticks = usize::try_from(now.0.saturating_sub(since)).unwrap_or(usize::MAX);
        let earned = ticks.saturating_mul(HEARD_PER_TICK);
        let allowed = saved.saturating_add(earned).min(REMEMBERED).saturating_sub(HEARD_COST);
        self.allowed = (allowed, now.0);
        allowed
    }

    /// Begins anew, without reference to anything told before, for a client that does not understand what it
    /// is told; does nothing if that was done only just. The sender goes on in another series, or in the same
    /// one if none is left. Returns the bodies whose newest states the client may not have.
    pub fn restart(&mut self, now: Tick, series: u32) -> BTreeSet<BodyId> {
        let may = self.number > 0 && now.0 >= self.began + RESTART_TICKS;
        if series != self.series || !may {
            return BTreeSet::new();
        }
        let again = std::mem::take(&mut self.unheard);
        self.began = now.0;
        if self.series % RESTARTS == RESTARTS - 1 {
            self.bodies = BTreeMap::new();
        } else {
            let (began, delay_ticks, allowed) = (now.0, self.delay_ticks, self.allowed);
            *self = Self { delay_ticks, allowed, began, ..Self::new(self.motion, self.series + 1) };
        }
        again
    }

    /// Returns after how many ticks an acknowledgement should have come.
    fn patience(&self) -> u64 {
        PATIENCE_TICKS.max(2.0 * self.delay_ticks.unwrap_or(0.0)) as u64
    }

    /// Returns the bodies whose newest state was sent so long ago that its acknowledgement should have come,
    /// but has not.
    pub fn overdue(&mut self, now: Tick) -> Vec<BodyId> {
        if now.0 < self.look_at {
            return Vec::new();
        }
        self.look_at = now.0 + LOOK_TICKS;
        let flights = Flights { next: self.number, flights: &self.flights };
        let patience = self.patience();
        let mut overdue = Vec::new();
        let bodies = &mut self.bodies;
        self.unheard.retain(|id| {
            if let Some(history) = bodies.get_mut(id) {
                let newest = history.sent.last();
                if newest.is_some_and(|version| flights.sent_at(version.number) + patience > now.0) {
                    return true;
                }
                if newest.is_some() && history.settle(&flights) {
                    history.sent = Vec::new();
                    return false;
                }
            }
            overdue.push(*id);
            true
        });
        overdue
    }

    /// Returns whether anything was sent since the client last acknowledged anything new.
    pub fn waits(&self) -> bool {
        self.waits
    }

    /// Forgets everything that the client was told, except which bodies' newest states it may not have: these
    /// are told anew when it is back. The newest datagrams stay known, since their acknowledgements say that
    /// it is back.
    pub fn give_up(&mut self) {
        self.flights.drain(..self.flights.len().saturating_sub(PROBES));
        self.flights.shrink_to_fit();
        self.bodies = BTreeMap::new();
    }

    /// Returns how far a body is from where its client shows it by now, metres, and the tick of the state
    /// that the client has. What may still be on its way counts as arrived. `None` if the body was never
    /// told, or everything told of it is lost.
    pub fn error_m(&self, now: Tick, state: &SharedState, tick: Tick) -> Option<(f64, Tick)> {
        let history = self.bodies.get(&state.id)?;
        let flights = Flights { next: self.number, flights: &self.flights };
        let late = now.0.saturating_sub(self.patience());
        let has_it =
            |version: &&Version| flights.sent_at(version.number) > late || flights.is_heard(version.number);
        let version = history.sent.iter().rev().find(has_it).or(history.known.as_ref())?;
        let ticks = tick.0.saturating_sub(version.tick);
        Some((
            self.motion.error_m(&version.state, version.falls, ticks, state.pose.translation),
            Tick(version.tick),
        ))
    }

    /// Returns the bytes that are held for the client: those of the bodies, by the capacities of what is
    /// held, and those of datagrams and lists of ids. What ordered maps and sets take beside their entries is
    /// not counted.
    #[cfg(test)]
    pub(crate) fn bytes(&self) -> (usize, usize) {
        let of = |history: &History| history.sent.capacity() * size_of::<Version>();
        let bodies = self.bodies.len() * size_of::<(BodyId, History)>();
        let rest = self.flights.capacity() * size_of::<Flight>() + self.unheard.len() * size_of::<BodyId>();
        (bodies + self.bodies.values().map(of).sum::<usize>(), rest)
    }

    /// Forgets a body that is gone.
    pub fn forget(&mut self, id: BodyId) {
        self.bodies.remove(&id);
        self.unheard.remove(&id);
    }
}
