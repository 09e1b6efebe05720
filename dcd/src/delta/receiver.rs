//! Reads the states of bodies that a [`Sender`](super::Sender) wrote, and acknowledges the datagrams that
//! have come.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::coder::{Field, Models, Reader};
use super::free_motion::FreeMotion;
use super::quantise::Quantised;
use super::sender::MAX_BODIES;
use crate::protocol::{CodecError, Heard, MAX_HEARD, Part, SharedState};
use crate::space::{BodyId, Tick};

/// How long an acknowledgement waits for more datagrams that it could name.
const GATHER: Duration = Duration::from_millis(10);

/// The most states of a body that are kept; a sender refers to fewer.
const KEPT: usize = 64;

/// The number of batches for which a body's states are kept once a newer state was referred to, since
/// datagrams overtake one another.
const OVERTAKEN: u32 = 16;

/// The ticks after which nothing refers to a body that is gone any more.
const FORGOTTEN_TICKS: u64 = 600;

/// The receiving end of one leader's states.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    motion: Option<FreeMotion>,
    series: Option<u32>,
    bodies: BTreeMap<BodyId, Known>,
    /// The bodies that are gone, with the newest tick heard of then. Those of them that have come back since
    /// are not in `gone`.
    going: VecDeque<(u64, BodyId)>,
    gone: BTreeMap<BodyId, u64>,
    /// The datagrams that have come and are not acknowledged yet, as runs: the first number, and how many.
    come: Vec<(u32, u32)>,
    due: Option<Duration>,
    lost: bool,
    /// The newest batch that could be read, and its tick.
    newest: Option<(u32, u64)>,
    tally: Tally,
}

/// The states that were told of a body.
#[derive(Clone, Debug, Default)]
struct Known {
    versions: VecDeque<Version>,
    /// A batch that was referred to, and the batch that did so. States older than the first are soon
    /// forgotten.
    referred: Option<(u32, u32)>,
    bits: f64,
}

#[derive(Clone, Copy, Debug)]
struct Version {
    batch: u32,
    tick: u64,
    state: Quantised,
}

/// A state that came in a datagram.
struct Read {
    state: SharedState,
    /// The batch that it was told against; its own batch if it was told against nothing.
    reference: u32,
    quantised: Quantised,
    bits: f64,
}

/// The cost of states so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// The number of datagrams of states.
    pub datagrams: u64,
    /// The number of states of bodies in them.
    pub states: u64,
    /// How many of these were told against nothing.
    pub wholes: u64,
    /// How many of these were as predicted.
    pub predicted: u64,
    /// The bits spent on each [`Field`], in order.
    pub bits: [f64; Field::ALL.len()],
}

impl Receiver {
    /// Sets how bodies move freely in the world whose states come. A change resets the receiver.
    pub fn set_motion(&mut self, motion: FreeMotion) {
        if self.motion.replace(motion) != Some(motion) {
            self.reset();
        }
    }

    /// Forgets everything that was told, since another leader has other series.
    pub fn reset(&mut self) {
        let (motion, tally) = (self.motion, self.tally);
        *self = Self { motion, tally, ..Self::default() };
    }

    /// Forgets a body that is gone, after some time: states that were sent before may still be on their way.
    pub fn forget(&mut self, id: BodyId) {
        let tick = self.newest.map_or(0, |(_, tick)| tick);
        self.going.push_back((tick, id));
        self.gone.insert(id, tick);
    }

    /// Keeps a body that appears, perhaps again.
    pub fn remember(&mut self, id: BodyId) {
        self.gone.remove(&id);
    }

    fn sweep(&mut self, tick: Tick) {
        while let Some(&(since, id)) = self.going.front()
            && since + FORGOTTEN_TICKS < tick.0
        {
            self.going.pop_front();
            if self.gone.get(&id) == Some(&since) {
                self.gone.remove(&id);
                self.bodies.remove(&id);
            }
        }
    }

    /// Returns the series that is being read.
    pub(crate) fn series(&self) -> Option<u32> {
        self.series
    }

    /// Returns what states have cost so far.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Returns the bytes that the states of bodies took, the costliest bodies first, without bodies that are
    /// gone.
    pub fn costliest(&self, count: usize) -> Vec<(BodyId, f64)> {
        let mut bodies: Vec<_> = self.bodies.iter().map(|(id, known)| (*id, known.bits / 8.0)).collect();
        bodies.sort_by(|a, b| b.1.total_cmp(&a.1));
        bodies.truncate(count);
        bodies
    }

    /// Reads the states of a datagram, as they were after a tick. Returns none if the datagram is of an
    /// earlier series. Guesses are not kept.
    pub fn take_in(
        &mut self,
        now: Duration,
        tick: Tick,
        part: &Part,
        guesses: bool,
    ) -> Result<Vec<SharedState>, CodecError> {
        let Some(motion) = self.motion else { return Ok(Vec::new()) };
        match self.series {
            Some(series) if (part.series.wrapping_sub(series) as i32) < 0 => return Ok(Vec::new()),
            Some(series) if part.series == series => {}
            _ => {
                self.reset();
                self.series = Some(part.series);
            }
        }
        let read = self.read(&motion, tick, part);
        match &read {
            // A datagram that was overtaken long ago may refer to what is forgotten.
            Err(_) if self.newest.is_some_and(|(batch, _)| part.batch.wrapping_sub(batch) as i32 <= 0) => {}
            Err(_) => {
                self.lost = true;
                self.due = Some(now);
            }
            Ok(_) if guesses => {}
            Ok(states) => {
                if self.newest.is_none_or(|(batch, _)| part.batch.wrapping_sub(batch) as i32 > 0) {
                    self.newest = Some((part.batch, tick.0));
                }
                self.keep(tick, part.batch, states);
                self.sweep(tick);
                self.acknowledge(part.number);
                self.due.get_or_insert(now + GATHER);
            }
        }
        Ok(read?.into_iter().map(|read| read.state).collect())
    }

    fn read(&mut self, motion: &FreeMotion, tick: Tick, part: &Part) -> Result<Vec<Read>, CodecError> {
        let (count, bytes) = part.states.split_first_chunk::<2>().ok_or(CodecError::Compact)?;
        let count = usize::from(u16::from_le_bytes(*count));
        if count > MAX_BODIES {
            return Err(CodecError::Compact);
        }
        let (mut reader, mut models) = (Reader::new(bytes)?, Models::new());
        let (mut id, mut before) = (BodyId::default(), Quantised::default());
        let mut states = Vec::with_capacity(count);
        let (mut wholes, mut predicted) = (0, 0);
        let all = |reader: &Reader| reader.bits.iter().sum::<f64>();
        for _ in 0..count {
            let bits = all(&reader);
            id = models.id(&mut reader, id, BodyId::default())?;
            let batches = models.batches(&mut reader, 0)?;
            let batch = part.batch.wrapping_sub(batches);
            before = if batches == 0 {
                wholes += 1;
                models.whole(&mut reader, &before, &Quantised::default())?
            } else {
                let known = self.bodies.get(&id).ok_or(CodecError::Compact)?;
                let known = known.versions.iter().find(|version| version.batch == batch);
                let known = known.filter(|known| known.tick <= tick.0).ok_or(CodecError::Compact)?;
                let ticks = tick.0 - known.tick;
                let guesses = motion.guesses(&known.state, ticks);
                let read = models.changed(&mut reader, &guesses, &Quantised::default())?;
                predicted += u64::from(guesses.contains(&read));
                read
            };
            let bits = all(&reader) - bits;
            states.push(Read { state: before.state(id)?, reference: batch, quantised: before, bits });
        }
        self.tally.datagrams += 1;
        self.tally.states += count as u64;
        self.tally.wholes += wholes;
        self.tally.predicted += predicted;
        for (all, bits) in self.tally.bits.iter_mut().zip(reader.bits) {
            *all += bits;
        }
        Ok(states)
    }

    /// Keeps states that later ones may refer to, and forgets those that are older than what these refer to.
    fn keep(&mut self, tick: Tick, batch: u32, states: &[Read]) {
        for read @ Read { state, reference, quantised, .. } in states {
            let Known { versions, referred, bits } = self.bodies.entry(state.id).or_default();
            *bits += read.bits;
            let later = |a: u32, b: u32| a.wrapping_sub(b) as i32;
            match *referred {
                Some((floor, by)) if later(batch, by) > OVERTAKEN as i32 => {
                    versions.retain(|version| later(version.batch, floor) >= 0);
                    *referred = (*reference != batch).then_some((*reference, batch));
                }
                // A state that is told against nothing says nothing of what is acknowledged.
                None if *reference != batch => *referred = Some((*reference, batch)),
                _ => {}
            }
            if versions.len() == KEPT {
                versions.pop_front();
            }
            versions.push_back(Version { batch, tick: tick.0, state: *quantised });
        }
    }

    fn acknowledge(&mut self, number: u32) {
        match self.come.last_mut() {
            Some((first, count)) if first.wrapping_add(*count) == number => *count += 1,
            _ => self.come.push((number, 1)),
        }
        if self.come.len() > MAX_HEARD {
            self.come.remove(0);
        }
    }

    /// Makes an acknowledgement due now, perhaps an empty one, if there is a sender to acknowledge to.
    pub fn speak(&mut self, now: Duration) {
        self.due = self.series.map(|_| now);
    }

    /// Returns when an acknowledgement is due.
    pub fn timeout(&self) -> Option<Duration> {
        self.due
    }

    /// Returns the acknowledgement, if one is due.
    pub fn due(&mut self, now: Duration, bytes_per_s: u32) -> Option<Heard> {
        self.due.take_if(|due| *due <= now)?;
        let datagrams = std::mem::take(&mut self.come);
        let lost = std::mem::take(&mut self.lost);
        Some(Heard { series: self.series?, datagrams, lost, bytes_per_s })
    }
}
