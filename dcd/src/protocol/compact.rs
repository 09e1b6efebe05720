//! Codes the states of bodies for clients in few bytes: each number is quantised, predicted from the body before it in the same
//! datagram, and what is left is coded by a range coder (the crate `constriction`) under models that adapt from body to body.
//!
//! A datagram needs no other to be read, so that a lost one costs what it said and nothing else. Who computes a body keeps full
//! precision; a client shows what it was told: positions within 0.25 mm, turns within 1.3 mrad, speeds within 1 mm/s and 2 mrad/s.

mod model;
mod quantise;

use constriction::stream::queue::{DefaultRangeDecoder, DefaultRangeEncoder};
use constriction::stream::{Decode, Encode};

use self::model::{Adaptive, Bits, PRECISION};
use self::quantise::Quantised;
use super::{CodecError, SharedState};

/// No part has more bodies, however few bits they take.
const MAX_BODIES: usize = 1_024;

/// The most bytes of one body's code: all numbers at their longest, under models that expect something else.
const LONGEST_BYTES: usize = 180;

/// The bytes of the count, and of the coder's last words.
const FRAME_BYTES: usize = 2 + 8;

/// The widest numbers, in bits: a difference of two numbers of 64 bits.
const WIDTHS: usize = 65;

/// The models of one datagram: each begins with no opinion.
struct Models {
    same: [Adaptive<2>; 3],
    id: Number,
    owner: Number,
    epoch: Number,
    place: [Number; 3],
    largest: Adaptive<4>,
    turn: [Number; 3],
    velocity: [Number; 3],
    spin: [Number; 3],
}

/// The models of a signed number: how many bits its magnitude has, its sign, and the bit below the highest.
struct Number {
    width: Adaptive<WIDTHS>,
    sign: Adaptive<2>,
    second: Adaptive<2>,
}

impl Number {
    fn new() -> Self {
        Self { width: Adaptive::new(), sign: Adaptive::new(), second: Adaptive::new() }
    }
}

impl Models {
    fn new() -> Self {
        let three = || std::array::from_fn(|_| Number::new());
        Self {
            same: std::array::from_fn(|_| Adaptive::new()),
            id: Number::new(),
            owner: Number::new(),
            epoch: Number::new(),
            place: three(),
            largest: Adaptive::new(),
            turn: three(),
            velocity: three(),
            spin: three(),
        }
    }

    /// Codes a body after another, with a coder that writes or reads; returns the body, as read or as it was given.
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        before: &Quantised,
        body: &Quantised,
    ) -> Result<Quantised, CodecError> {
        let [sleeps, owned, aged] = &mut self.same;
        let mut read = *before;
        let ahead = body.id.wrapping_sub(before.id);
        read.id = before.id.wrapping_add(coder.number(&mut self.id, ahead)?);
        read.sleeping = coder.symbol(sleeps, usize::from(body.sleeping))? == 1;
        if coder.symbol(owned, usize::from(body.owner == before.owner))? == 0 {
            read.owner = coder.number(&mut self.owner, body.owner)?;
        }
        if coder.symbol(aged, usize::from(body.epoch == before.epoch))? == 0 {
            let later = body.epoch.wrapping_sub(before.epoch);
            read.epoch = before.epoch.wrapping_add(coder.number(&mut self.epoch, later)?);
        }
        for axis in 0..3 {
            let way = body.place[axis].wrapping_sub(before.place[axis]);
            read.place[axis] = before.place[axis].wrapping_add(coder.number(&mut self.place[axis], way)?);
        }
        read.largest = coder.symbol(&mut self.largest, body.largest)?;
        for axis in 0..3 {
            read.turn[axis] = coder.number(&mut self.turn[axis], body.turn[axis])?;
        }
        (read.velocity, read.spin) = ([0; 3], [0; 3]);
        if !read.sleeping {
            for axis in 0..3 {
                read.velocity[axis] = coder.number(&mut self.velocity[axis], body.velocity[axis])?;
                read.spin[axis] = coder.number(&mut self.spin[axis], body.spin[axis])?;
            }
        }
        Ok(read)
    }
}

/// Writes or reads symbols: one description of the format serves both.
trait Coder {
    /// Codes a symbol: writes this one, or reads another.
    fn symbol<const N: usize>(&mut self, model: &mut Adaptive<N>, symbol: usize)
    -> Result<usize, CodecError>;

    /// Codes so many bits that no model knows anything about.
    fn bits(&mut self, count: u32, bits: u64) -> Result<u64, CodecError>;

    /// Codes a number: its width, its sign, and the bits below the highest.
    fn number(&mut self, models: &mut Number, number: i64) -> Result<i64, CodecError> {
        let magnitude = number.unsigned_abs();
        let width = self.symbol(&mut models.width, (u64::BITS - magnitude.leading_zeros()) as usize)? as u32;
        if width == 0 {
            return Ok(0);
        }
        let negative = self.symbol(&mut models.sign, usize::from(number < 0))? == 1;
        let mut read = 1u64;
        let mut left = width - 1;
        if left > 0 {
            left -= 1;
            let second = self.symbol(&mut models.second, (magnitude >> left & 1) as usize)?;
            read = 2 | second as u64;
        }
        while left > 0 {
            let count = left.min(Bits::MOST);
            left -= count;
            read = read << count | self.bits(count, magnitude >> left & ((1 << count) - 1))?;
        }
        let read = read as i64;
        Ok(if negative { read.wrapping_neg() } else { read })
    }
}

struct Writer(DefaultRangeEncoder);

impl Coder for Writer {
    fn symbol<const N: usize>(
        &mut self,
        model: &mut Adaptive<N>,
        symbol: usize,
    ) -> Result<usize, CodecError> {
        Encode::<PRECISION>::encode_symbol(&mut self.0, symbol, &*model).map_err(|_| CodecError::Compact)?;
        model.see(symbol);
        Ok(symbol)
    }

    fn bits(&mut self, count: u32, bits: u64) -> Result<u64, CodecError> {
        let model = Bits { count };
        Encode::<PRECISION>::encode_symbol(&mut self.0, bits as u16, model)
            .map_err(|_| CodecError::Compact)?;
        Ok(bits)
    }
}

struct Reader(DefaultRangeDecoder);

impl Coder for Reader {
    fn symbol<const N: usize>(&mut self, model: &mut Adaptive<N>, _: usize) -> Result<usize, CodecError> {
        let symbol =
            Decode::<PRECISION>::decode_symbol(&mut self.0, &*model).map_err(|_| CodecError::Compact)?;
        model.see(symbol);
        Ok(symbol)
    }

    fn bits(&mut self, count: u32, _: u64) -> Result<u64, CodecError> {
        let model = Bits { count };
        let bits = Decode::<PRECISION>::decode_symbol(&mut self.0, model).map_err(|_| CodecError::Compact)?;
        Ok(bits.into())
    }
}

/// Packs states, in order, into as few parts as fit this many bytes each.
///
/// # Panics
/// When not even one body fits.
pub(super) fn pack(states: impl IntoIterator<Item = SharedState>, limit: usize) -> Vec<Vec<u8>> {
    assert!(limit >= FRAME_BYTES + LONGEST_BYTES, "a part of {limit} bytes cannot hold a body");
    let mut states = states.into_iter().peekable();
    let mut parts = Vec::new();
    while states.peek().is_some() {
        let (mut writer, mut models) = (Writer(DefaultRangeEncoder::new()), Models::new());
        let (mut before, mut count) = (Quantised::default(), 0u16);
        while let Some(state) = states.peek() {
            let body = Quantised::of(state);
            before = models.code(&mut writer, &before, &body).expect("memory takes all");
            count += 1;
            states.next();
            let room = limit.saturating_sub(2 + writer.0.num_bits() / 8);
            if usize::from(count) == MAX_BODIES || room < LONGEST_BYTES {
                break;
            }
        }
        let words = writer.0.into_compressed().expect("memory takes all");
        let mut part = count.to_le_bytes().to_vec();
        part.extend(words.into_iter().flat_map(u32::to_le_bytes));
        parts.push(part);
    }
    parts
}

/// Unpacks a part that [`pack`] made; of one that a stranger made it returns some states, or an error.
pub(super) fn unpack(part: &[u8]) -> Result<Vec<SharedState>, CodecError> {
    let (count, words) = part.split_first_chunk::<2>().ok_or(CodecError::Compact)?;
    let (words, rest) = words.as_chunks::<4>();
    let count = usize::from(u16::from_le_bytes(*count));
    if !rest.is_empty() || count > MAX_BODIES {
        return Err(CodecError::Compact);
    }
    let words: Vec<_> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
    let Ok(decoder) = DefaultRangeDecoder::from_compressed(words);
    let (mut reader, mut models) = (Reader(decoder), Models::new());
    let mut before = Quantised::default();
    let mut states = Vec::with_capacity(count);
    for _ in 0..count {
        before = models.code(&mut reader, &before, &Quantised::default())?;
        states.push(before.state()?);
    }
    Ok(states)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Check, Velocity, WorldPose};
    use crate::space::{BodyId, ClientId, Epoch, RegionId};

    const LIMIT: usize = 1_060;

    struct Random(u64);

    impl Random {
        fn next(&mut self) -> u64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            self.0 ^ self.0 >> 29
        }

        /// From -1 to 1.
        fn unit(&mut self) -> f64 {
            (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// Bodies as in a heap that is stirred: near each other, some asleep.
    fn heap(count: u32, random: &mut Random) -> Vec<SharedState> {
        (0..count)
            .map(|i| {
                let turn: [f32; 4] = std::array::from_fn(|_| random.unit() as f32);
                let norm = turn.iter().map(|v| v * v).sum::<f32>().sqrt();
                SharedState {
                    id: BodyId::persistent(3 * i),
                    owner: RegionId(3 + i / 100),
                    epoch: Epoch::placed_in(5),
                    pose: WorldPose {
                        translation: std::array::from_fn(|_| 20.0 * random.unit()),
                        rotation: turn.map(|v| v / norm),
                    },
                    velocity: Velocity {
                        linear: std::array::from_fn(|_| 3.0 * random.unit() as f32),
                        angular: std::array::from_fn(|_| 5.0 * random.unit() as f32),
                    },
                    sleeping: i % 10 == 0,
                }
            })
            .collect()
    }

    fn unpacked(parts: &[Vec<u8>]) -> Vec<SharedState> {
        parts.iter().flat_map(|part| unpack(part).unwrap()).collect()
    }

    #[test]
    fn states_come_back_within_the_errors_that_are_promised() {
        let states = heap(2_000, &mut Random(1));
        let told = unpacked(&pack(states.clone(), LIMIT));
        assert_eq!(told.len(), states.len());
        for (is, told) in states.iter().zip(&told) {
            let same = |state: &SharedState| (state.id, state.owner, state.epoch, state.sleeping);
            assert_eq!(same(is), same(told));
            for axis in 0..3 {
                let off_m = is.pose.translation[axis] - told.pose.translation[axis];
                assert!(off_m.abs() <= 0.000_25, "{off_m}");
                let off_m_s = is.velocity.linear[axis] - told.velocity.linear[axis];
                assert!(is.sleeping || off_m_s.abs() <= 0.001, "{off_m_s}");
                let off_rad_s = is.velocity.angular[axis] - told.velocity.angular[axis];
                assert!(is.sleeping || off_rad_s.abs() <= 0.002, "{off_rad_s}");
            }
            let dot = (0..4).map(|i| f64::from(is.pose.rotation[i]) * f64::from(told.pose.rotation[i]));
            let off_rad = 2.0 * dot.sum::<f64>().abs().min(1.0).acos();
            assert!(off_rad <= 0.001_3, "{off_rad}");
        }
        // What was told once is told so again, but that the larger of two components of a rotation may be the other.
        for (again, told) in unpacked(&pack(told.clone(), LIMIT)).iter().zip(&told) {
            assert_eq!((again.pose.translation, again.velocity), (told.pose.translation, told.velocity));
        }
    }

    #[test]
    fn a_moving_body_takes_a_third_of_its_bytes_and_a_resting_one_a_fifth() {
        let bytes = |states: &[SharedState]| {
            let parts = pack(states.to_vec(), LIMIT);
            assert!(parts.iter().all(|part| part.len() <= LIMIT));
            parts.iter().map(Vec::len).sum::<usize>() as f64 / states.len() as f64
        };
        let whole = |states: &[SharedState]| {
            states.iter().map(super::super::encoded_len).sum::<usize>() as f64 / states.len() as f64
        };
        let moving: Vec<_> = heap(901, &mut Random(2)).into_iter().filter(|state| !state.sleeping).collect();
        let resting: Vec<_> = moving.iter().map(|state| SharedState { sleeping: true, ..*state }).collect();
        let upright = |state: &SharedState| SharedState {
            pose: WorldPose::at(state.pose.translation),
            velocity: Velocity { angular: [0.0; 3], ..state.velocity },
            ..*state
        };
        let upright: Vec<_> = moving.iter().map(upright).collect();
        let [moving, resting, upright] =
            [&moving, &resting, &upright].map(|states| (bytes(states), whole(states)));
        println!("moving {moving:?}, resting {resting:?}, sliding {upright:?} bytes a body");
        assert!(moving.0 < 0.34 * moving.1 && resting.0 < 0.2 * resting.1 && upright.0 < 0.22 * upright.1);
    }

    #[test]
    fn thousands_that_rest_alike_are_told_of() {
        let upright = SharedState { pose: WorldPose::at([3.0, 0.5, 7.0]), ..heap(1, &mut Random(4))[0] };
        let rest = |i| SharedState { id: BodyId::persistent(i), sleeping: true, ..upright };
        let states: Vec<_> = (0..5_000).map(rest).collect();
        let parts = pack(states.clone(), LIMIT);
        assert_eq!(unpacked(&parts).len(), states.len());
        assert!(parts.iter().map(Vec::len).sum::<usize>() < states.len() / 4, "they take next to nothing");
    }

    #[test]
    fn the_strangest_states_fit() {
        let far = |sign: f64| SharedState {
            id: BodyId::avatar(ClientId(u32::MAX), u32::MAX),
            owner: RegionId(u32::MAX),
            epoch: Epoch(u64::MAX),
            pose: WorldPose { translation: [1e9 * sign; 3], rotation: [0.5, -0.5, 0.5, -0.5] },
            velocity: Velocity { linear: [f32::MAX * sign as f32; 3], angular: [f32::MIN_POSITIVE; 3] },
            sleeping: false,
        };
        let near = SharedState { id: BodyId::persistent(0), owner: RegionId(0), epoch: Epoch(0), ..far(0.0) };
        // The models have come to expect nothing new when it comes.
        let alike = (0..900).map(|_| near);
        let states: Vec<_> = alike.chain((0..100).flat_map(|_| [far(1.0), near, far(-1.0)])).collect();
        let parts = pack(states.clone(), LIMIT);
        assert!(parts.iter().all(|part| part.len() <= LIMIT), "{:?}", parts.iter().map(Vec::len).max());
        for (is, told) in states.iter().zip(unpacked(&parts)) {
            assert_eq!(
                (is.id, is.owner, is.epoch, is.pose.translation),
                (told.id, told.owner, told.epoch, told.pose.translation)
            );
        }
    }

    #[test]
    fn strangers_bytes_are_states_or_an_error() {
        let mut random = Random(3);
        let honest = pack(heap(60, &mut random), LIMIT).swap_remove(0);
        let (mut read, mut refused) = (0, 0);
        for round in 0..20_000 {
            let mut part: Vec<u8> = match round % 3 {
                0 => (0..random.next() % 200).map(|_| random.next() as u8).collect(),
                _ => honest.clone(),
            };
            if round % 3 == 2 {
                part.truncate((random.next() % (honest.len() as u64 + 1)) as usize);
            }
            for _ in 0..random.next() % 4 {
                let at = (random.next() % part.len().max(1) as u64) as usize;
                if let Some(byte) = part.get_mut(at) {
                    *byte = random.next() as u8;
                }
            }
            match unpack(&part) {
                Ok(states) => {
                    assert!(states.iter().all(|state| state.check().is_ok()));
                    read += 1;
                }
                Err(_) => refused += 1,
            }
        }
        assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
    }
}
