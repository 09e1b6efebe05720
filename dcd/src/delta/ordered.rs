//! Writes states for an end that gets all of them in order (a relay): each body against its state before, so
//! that nothing need be acknowledged.
//!
//! Numbers are told exactly as they are on the grid, and the relay knows which component of a rotation was
//! left out. So it comes to the same numbers when it tells clients of the state, and adds no error to what a
//! client is told directly.

use std::collections::BTreeMap;

use super::coder::{Coder, Models, Number, Reader, Writer};
use super::free_motion::FreeMotion;
use super::quantise::Quantised;
use crate::protocol::{Check, CodecError, SharedState};
use crate::space::{BodyId, Tick};

/// The most bodies of a part, and the number of bytes after which no other body follows. So a reader never
/// holds more of a part at once.
const MOST_BODIES: usize = 4_096;
const MOST_BYTES: usize = 64 << 10;

/// The most bodies that a receiver keeps; each takes some 200 bytes there.
const MOST_KNOWN: usize = 1 << 22;

/// The state that a body was told to have, with its tick.
#[derive(Clone, Copy, Debug)]
struct Version {
    tick: u64,
    state: Quantised,
}

/// The knowledge that both ends of the link share.
#[derive(Clone, Debug)]
struct Known {
    motion: FreeMotion,
    models: OrderedModels,
    bodies: BTreeMap<BodyId, Version>,
}

/// The models of a link, which continue from part to part.
#[derive(Clone, Debug)]
struct OrderedModels {
    states: Models,
    /// The model of how many ticks a state is older than the one before it in the part.
    older: Number,
}

/// The writing end of the link. Time is counted in ticks of the world.
#[derive(Clone, Debug)]
pub(crate) struct OrderedSender(Known);

/// The reading end of the link. After an error it can no longer read later parts.
#[derive(Clone, Debug)]
pub(crate) struct OrderedReceiver(Known);

impl OrderedSender {
    /// Returns a sender whose other end knows nothing.
    pub(crate) fn new(motion: FreeMotion) -> Self {
        Self(Known::new(motion))
    }

    /// Writes states, in id order, each as it was after its tick, into as few parts as possible, which must
    /// be read in order; without states, into one empty part. `now` is the newest tick.
    pub(crate) fn write(&mut self, now: Tick, states: &[(Tick, SharedState)]) -> Vec<Vec<u8>> {
        let mut states = states.iter().peekable();
        let mut parts = Vec::new();
        while states.peek().is_some() || parts.is_empty() {
            let mut part = PartWriter::new(now);
            while let Some((tick, state)) = states.next_if(|_| part.has_room()) {
                let state = part.write(&self.0.motion, &mut self.0.models, &self.0.bodies, *tick, state);
                self.0.bodies.insert(part.id, Version { tick: tick.0, state });
            }
            parts.push(part.into_bytes());
        }
        parts
    }

    /// Writes guesses of a tick, in id order: the first of them, as many as fit into one part. No later part
    /// refers to them.
    pub(crate) fn write_guesses(&self, tick: Tick, states: impl Iterator<Item = SharedState>) -> Vec<u8> {
        let (mut part, mut models) = (PartWriter::new(tick), self.0.models.clone());
        for state in states {
            if !part.has_room() {
                break;
            }
            part.write(&self.0.motion, &mut models, &self.0.bodies, tick, &state);
        }
        part.into_bytes()
    }

    /// Forgets a body that is gone, before the next part is written.
    pub(crate) fn forget(&mut self, id: BodyId) {
        self.0.bodies.remove(&id);
    }
}

impl OrderedReceiver {
    /// Returns a receiver that knows nothing.
    pub(crate) fn new(motion: FreeMotion) -> Self {
        Self(Known::new(motion))
    }

    /// Reads the states of a part that was written in the tick `now`, each with its own tick.
    pub(crate) fn read(&mut self, now: Tick, part: &[u8]) -> Result<Vec<(Tick, SharedState)>, CodecError> {
        let Known { motion, models, bodies } = &mut self.0;
        let read = read(motion, models, bodies, now, part)?;
        let is_new = |(id, ..): &&(BodyId, _, _)| !bodies.contains_key(id);
        if bodies.len() + read.iter().filter(is_new).count() > MOST_KNOWN {
            return Err(CodecError::Compact);
        }
        bodies.extend(read.iter().map(|&(id, version, _)| (id, version)));
        Ok(read.into_iter().map(|(_, version, state)| (Tick(version.tick), state)).collect())
    }

    /// Reads guesses, and keeps none of them.
    pub(crate) fn read_guesses(&self, tick: Tick, part: &[u8]) -> Result<Vec<SharedState>, CodecError> {
        let Known { motion, models, bodies } = &self.0;
        let read = read(motion, &mut models.clone(), bodies, tick, part)?;
        Ok(read.into_iter().map(|(.., state)| state).collect())
    }

    /// Returns which component was left out of the rotation in a body's newest state.
    pub(crate) fn left_out(&self, id: BodyId) -> Option<u8> {
        self.0.bodies.get(&id).map(|version| version.state.left_out)
    }

    /// Forgets a body that is gone, before the next part is read.
    pub(crate) fn forget(&mut self, id: BodyId) {
        self.0.bodies.remove(&id);
    }
}

impl Known {
    fn new(motion: FreeMotion) -> Self {
        let models = OrderedModels { states: Models::exact(), older: Number::new(0) };
        Self { motion, models, bodies: BTreeMap::new() }
    }
}

/// A part that is being written.
struct PartWriter {
    writer: Writer,
    count: u16,
    id: BodyId,
    before: Quantised,
    /// The tick of the body before; at first the tick in which the part is written.
    tick: u64,
}

impl PartWriter {
    fn new(now: Tick) -> Self {
        let (id, before) = (BodyId::default(), Quantised::default());
        Self { writer: Writer::new(), count: 0, id, before, tick: now.0 }
    }

    fn has_room(&self) -> bool {
        usize::from(self.count) < MOST_BODIES && self.writer.len() < MOST_BYTES
    }

    fn write(
        &mut self,
        motion: &FreeMotion,
        models: &mut OrderedModels,
        bodies: &BTreeMap<BodyId, Version>,
        tick: Tick,
        state: &SharedState,
    ) -> Quantised {
        assert!(self.count == 0 || self.id < state.id, "{} follows {}", state.id, self.id);
        let known = bodies.get(&state.id).filter(|known| known.tick <= tick.0);
        let body = Quantised::of(state, known.map(|known| known.state.left_out));
        let older = self.tick.wrapping_sub(tick.0) as i64;
        let OrderedModels { states: models, older: ages } = models;
        let written = models.id(&mut self.writer, self.id, state.id).and_then(|_| {
            self.writer.number(ages, older)?;
            models.batches(&mut self.writer, u32::from(known.is_some()))?;
            match known {
                Some(known) => {
                    let guesses = motion.guesses(&known.state, tick.0 - known.tick);
                    models.changed(&mut self.writer, &guesses, &body)
                }
                None => models.whole(&mut self.writer, &self.before, &body),
            }
        });
        let written = written.expect("memory takes all");
        debug_assert_eq!(written, body, "what is told is exact");
        (self.id, self.before, self.tick) = (state.id, written, tick.0);
        self.count += 1;
        written
    }

    fn into_bytes(self) -> Vec<u8> {
        if self.count == 0 {
            return Vec::new();
        }
        let mut bytes = self.count.to_le_bytes().to_vec();
        bytes.extend(self.writer.into_bytes());
        bytes
    }
}

/// Reads a part. The caller keeps what is to be kept.
fn read(
    motion: &FreeMotion,
    models: &mut OrderedModels,
    bodies: &BTreeMap<BodyId, Version>,
    now: Tick,
    part: &[u8],
) -> Result<Vec<(BodyId, Version, SharedState)>, CodecError> {
    if part.is_empty() {
        return Ok(Vec::new());
    }
    let (count, bytes) = part.split_first_chunk::<2>().ok_or(CodecError::Compact)?;
    let count = usize::from(u16::from_le_bytes(*count));
    if count > MOST_BODIES {
        return Err(CodecError::Compact);
    }
    let mut reader = Reader::new(bytes)?;
    let OrderedModels { states: models, older: ages } = models;
    let (mut id, mut before, mut tick) = (BodyId::default(), Quantised::default(), now.0);
    let mut states = Vec::with_capacity(count);
    for place in 0..count {
        let last = id;
        id = models.id(&mut reader, last, BodyId::default())?;
        if place > 0 && id <= last {
            return Err(CodecError::Compact);
        }
        tick = tick.wrapping_sub(reader.number(ages, 0)? as u64);
        Tick(tick).check()?;
        before = match models.batches(&mut reader, 0)? {
            0 => models.whole(&mut reader, &before, &Quantised::default())?,
            1 => {
                let known = bodies.get(&id).filter(|known| known.tick <= tick).ok_or(CodecError::Compact)?;
                let guesses = motion.guesses(&known.state, tick - known.tick);
                models.changed(&mut reader, &guesses, &Quantised::default())?
            }
            _ => return Err(CodecError::Compact),
        };
        states.push((id, Version { tick, state: before }, before.state(id)?));
    }
    Ok(states)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Velocity, WorldPose};
    use crate::sim::{Random, sim_world};
    use crate::space::{Epoch, RegionId};

    fn ends() -> (OrderedSender, OrderedReceiver) {
        let motion = FreeMotion::of(&sim_world(2).step);
        (OrderedSender::new(motion), OrderedReceiver::new(motion))
    }

    fn unit(random: &mut Random) -> f64 {
        2.0 * random.unit() - 1.0
    }

    /// Returns bodies that are turned about any axis, some of them fast, far away, or asleep.
    fn bodies(count: u32, random: &mut Random) -> Vec<(Tick, SharedState)> {
        let state = |index: u32| {
            let size = 10.0_f64.powi(random.below(9) as i32 - 2);
            let turn: [f64; 4] = std::array::from_fn(|_| unit(random).powi(3));
            let norm = turn.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-9);
            let rotation = turn.map(|v| (v / norm) as f32);
            let pose = WorldPose { translation: [0; 3].map(|_| size * unit(random)), rotation };
            let velocity = Velocity {
                linear: [0; 3].map(|_| (size * unit(random)) as f32),
                angular: [0; 3].map(|_| (size * unit(random)) as f32),
            };
            let (id, owner, epoch) = (BodyId::persistent(index), RegionId(index / 9), Epoch::placed_in(3));
            SharedState { id, owner, epoch, pose, velocity, sleeping: random.below(8) == 0 }
        };
        (0..count).map(state).map(|state| (Tick(7), state)).collect()
    }

    /// A relay tells clients what it has read, so quantising that again must give the same numbers.
    #[test]
    fn what_was_read_is_quantised_to_the_same_numbers() {
        let mut random = Random::new(3);
        let (mut sender, mut receiver) = ends();
        for tick in 7..40 {
            let mut states = bodies(300, &mut random);
            // Some stay as they are, and some are told as they were a while ago.
            states.retain(|_| random.below(3) > 0);
            states.iter_mut().for_each(|(of, _)| *of = Tick(tick - random.below(2) * random.below(4)));
            for part in sender.write(Tick(tick), &states) {
                for (of, state) in receiver.read(Tick(tick), &part).unwrap() {
                    let known = receiver.0.bodies[&state.id];
                    assert_eq!(known.tick, of.0);
                    assert_eq!(Quantised::again(&state, known.state.left_out), known.state, "{state:?}");
                }
            }
            for (of, state) in &states {
                let known = receiver.0.bodies[&state.id];
                assert_eq!(*of, Tick(known.tick));
                assert_eq!(Quantised::of(state, Some(known.state.left_out)), known.state, "{state:?}");
            }
        }
    }

    #[test]
    fn any_number_of_bodies_and_none_are_told_and_guesses_leave_nothing_behind() {
        let mut random = Random::new(4);
        let (mut sender, mut receiver) = ends();
        for (tick, count) in [(8, 0), (9, 10_000), (10, 3), (11, 0), (12, 5_000)] {
            let guesses = bodies(count.min(100), &mut random).into_iter().map(|(_, state)| state);
            let guesses: Vec<_> = guesses.collect();
            let part = sender.write_guesses(Tick(tick), guesses.iter().copied());
            let read = receiver.read_guesses(Tick(tick), &part).unwrap();
            assert!(read.iter().map(|state| state.id).eq(guesses.iter().map(|state| state.id)));
            let states = bodies(count, &mut random);
            let parts = sender.write(Tick(tick), &states);
            assert!(parts.len() > count as usize / MOST_BODIES, "{} parts", parts.len());
            let read: Vec<_> =
                parts.iter().flat_map(|part| receiver.read(Tick(tick), part).unwrap()).collect();
            assert!(read.iter().map(|(_, state)| state.id).eq(states.iter().map(|(_, state)| state.id)));
            states.iter().step_by(2).for_each(|(_, state)| {
                sender.forget(state.id);
                receiver.forget(state.id);
            });
        }
    }

    /// Changes written parts at random. Some must still be read, and all others refused.
    #[test]
    fn bytes_of_strangers_are_states_or_an_error() {
        let mut random = Random::new(5);
        let (mut read, mut refused) = (0, 0);
        for round in 0..3_000 {
            let (mut sender, mut receiver) = ends();
            for part in sender.write(Tick(7), &bodies(40, &mut random)) {
                receiver.read(Tick(7), &part).unwrap();
            }
            let mut part = sender.write(Tick(8), &bodies(40, &mut random)).remove(0);
            if round % 3 == 0 {
                part.truncate(random.below(part.len() as u64) as usize);
            }
            for _ in 0..random.below(4) {
                let at = random.below(part.len().max(1) as u64) as usize;
                if let Some(byte) = part.get_mut(at) {
                    *byte = random.bits() as u8;
                }
            }
            let guesses = receiver.read_guesses(Tick(8), &part);
            let states = receiver.read(Tick(8), &part);
            assert_eq!(guesses.is_ok(), states.is_ok());
            match states {
                Ok(states) => {
                    let is_fine =
                        |(tick, state): &(Tick, SharedState)| tick.check().is_ok() && state.check().is_ok();
                    assert!(states.len() <= MOST_BODIES && states.iter().all(is_fine));
                    read += 1;
                }
                Err(_) => refused += 1,
            }
        }
        assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
    }
}
