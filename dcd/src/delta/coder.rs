//! Defines the format of states in a datagram. One description serves the writer and the reader.

use std::sync::LazyLock;

use constriction::stream::queue::{DefaultRangeDecoder, DefaultRangeEncoder};
use constriction::stream::{Decode, Encode};

use super::free_motion::GUESSES;
use super::model::{Adaptive, Bits, PRECISION};
use super::quantise::Quantised;
use crate::protocol::CodecError;
use crate::space::BodyId;

/// The part of a state that a bit of a datagram belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Field {
    /// The body's id.
    Id,
    /// The reference: the batch whose state it is told against, and how it is predicted from that.
    Reference,
    /// The owner, the epoch, and whether the body sleeps.
    Owner,
    /// The position.
    Place,
    /// The rotation.
    Turn,
    /// The velocity.
    Velocity,
    /// The angular velocity.
    Spin,
}

impl Field {
    /// All fields, in order.
    pub const ALL: [Self; 7] =
        [Self::Id, Self::Reference, Self::Owner, Self::Place, Self::Turn, Self::Velocity, Self::Spin];

    /// Returns the name of the field.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Id => "id",
            Self::Reference => "reference",
            Self::Owner => "owner",
            Self::Place => "place",
            Self::Turn => "turn",
            Self::Velocity => "velocity",
            Self::Spin => "spin",
        }
    }
}

/// The most bits of a number: a difference of two numbers of 64 bits.
const WIDEST: usize = 64;
/// The width in bits from which on a width is written as it is, since it is so rare.
const WIDE: usize = 23;
/// The width in bits above which numbers are rare. Widths from here on share their models.
const RARE: usize = 15;
/// The number of models that are kept apart by how many bits the numbers before took.
const CONTEXTS: usize = 8;

/// The models of one datagram. Each datagram begins with the same ones.
#[derive(Clone, Debug)]
pub(super) struct Models {
    id: Number,
    is_told_against: Adaptive<2>,
    batches: Number,
    /// How many batches ago the state was that the last body was told against.
    usual_batches: u32,
    /// Which guess holds, or that none does: one model for each outcome of the body before.
    holds: [Adaptive<{ GUESSES + 1 }>; GUESSES + 1],
    guess: Adaptive<GUESSES>,
    sleeps: [Adaptive<2>; 2],
    is_owned: Adaptive<2>,
    owner: Number,
    is_aged: Adaptive<2>,
    epoch: Number,
    is_left_out: Adaptive<2>,
    left_out: Adaptive<4>,
    /// The models of differences from what was predicted: place, turn, velocity and spin.
    errors: [Triple; 4],
    /// The models of numbers of bodies of which nothing was known: place, turn, velocity and spin.
    wholes: [Triple; 4],
    /// The outcome of the body before: the guess that held, or that none did.
    before: usize,
    /// Says whether a guess holds only for a body that equals it, and not for one within a step or so.
    is_exact: bool,
}

/// The models of a single number: of its width in bits, its sign, and the bit below the highest.
#[derive(Clone, Debug)]
pub(super) struct Number {
    width: Adaptive<{ WIDE + 1 }>,
    sign: Adaptive<2>,
    second: [Adaptive<2>; RARE + 1],
}

/// The models of three numbers of about the same size: of the width in bits of the largest, and of the
/// highest two bits of each.
#[derive(Clone, Debug)]
pub(super) struct Triple {
    width: [Adaptive<{ WIDE + 1 }>; CONTEXTS],
    high: [Adaptive<4>; RARE + 1],
}

impl Number {
    /// Returns the models of numbers of about `usual` bits.
    pub(super) fn new(usual: usize) -> Self {
        let second = std::array::from_fn(|_| Adaptive::new());
        Self { width: Adaptive::about(usual), sign: Adaptive::new(), second }
    }
}

impl Triple {
    /// Returns the models of numbers of about `usual` bits in each context.
    fn new(usual: impl Fn(usize) -> usize) -> Self {
        Self {
            width: std::array::from_fn(|context| Adaptive::about(usual(context))),
            high: std::array::from_fn(|_| Adaptive::new()),
        }
    }
}

impl Models {
    /// Returns the models that a datagram begins with.
    pub(super) fn new() -> Self {
        static FIRST: LazyLock<Models> = LazyLock::new(Models::first);
        FIRST.clone()
    }

    /// Returns the models for an end that is told each number exactly.
    pub(super) fn exact() -> Self {
        Self { is_exact: true, ..Self::new() }
    }

    fn first() -> Self {
        Self {
            id: Number::new(1),
            is_told_against: Adaptive::new(),
            batches: Number::new(0),
            usual_batches: 3,
            holds: std::array::from_fn(|_| Adaptive::new()),
            guess: Adaptive::new(),
            sleeps: std::array::from_fn(|_| Adaptive::new()),
            is_owned: Adaptive::new(),
            owner: Number::new(2),
            is_aged: Adaptive::new(),
            epoch: Number::new(2),
            is_left_out: Adaptive::new(),
            left_out: Adaptive::new(),
            errors: std::array::from_fn(|_| Triple::new(|context| context)),
            wholes: [13, 11, 10, 10].map(|usual| Triple::new(|_| usual)),
            before: GUESSES,
            is_exact: false,
        }
    }

    /// Codes the id of a body that follows another.
    pub(super) fn id<C: Coder>(
        &mut self,
        coder: &mut C,
        before: BodyId,
        id: BodyId,
    ) -> Result<BodyId, CodecError> {
        coder.field(Field::Id);
        let gap = id.bits().wrapping_sub(before.bits()) as i64;
        let gap = coder.number(&mut self.id, gap)?;
        Ok(BodyId::from_bits(before.bits().wrapping_add(gap as u64)))
    }

    /// Codes how many batches ago the state was that a body is told against; 0 for a body that is told
    /// against nothing.
    pub(super) fn batches<C: Coder>(&mut self, coder: &mut C, batches: u32) -> Result<u32, CodecError> {
        coder.field(Field::Reference);
        if coder.symbol(&mut self.is_told_against, usize::from(batches > 0))? == 0 {
            return Ok(0);
        }
        let usual = i64::from(self.usual_batches);
        let batches = usual.wrapping_add(coder.number(&mut self.batches, i64::from(batches) - usual)?);
        self.usual_batches =
            u32::try_from(batches).ok().filter(|&batches| batches > 0).ok_or(CodecError::Compact)?;
        Ok(self.usual_batches)
    }

    /// Codes a body against the guesses of what became of an earlier state of it. Returns the body as the
    /// reader gets it.
    pub(super) fn changed<C: Coder>(
        &mut self,
        coder: &mut C,
        guesses: &[Quantised; GUESSES],
        body: &Quantised,
    ) -> Result<Quantised, CodecError> {
        coder.field(Field::Reference);
        let stands = |guess: &Quantised| if self.is_exact { body == guess } else { body.is_near(guess) };
        let holds = if C::WRITES { guesses.iter().position(stands) } else { None };
        let holds = coder.symbol(&mut self.holds[self.before], holds.unwrap_or(GUESSES))?;
        self.before = holds;
        if let Some(guess) = guesses.get(holds) {
            return Ok(*guess);
        }
        let best = if C::WRITES { best(guesses, body) } else { 0 };
        let expected = &guesses[coder.symbol(&mut self.guess, best)?];
        let mut read = *expected;
        self.owner(coder, expected, body, &mut read)?;
        let mut context = 0;
        let errors = |a: [i64; 3], b: [i64; 3]| std::array::from_fn(|i| a[i].wrapping_sub(b[i]));
        let sums = |a: [i64; 3], b: [i64; 3]| std::array::from_fn(|i| a[i].wrapping_add(b[i]));
        let [place, turn, velocity, spin] = &mut self.errors;
        coder.field(Field::Place);
        let way = errors(body.place, expected.place);
        read.place = sums(expected.place, coder.triple(place, &mut context, way)?);
        coder.field(Field::Turn);
        if coder.symbol(&mut self.is_left_out, usize::from(body.left_out == expected.left_out))? == 1 {
            let turned = errors(wide(body.turn), wide(expected.turn));
            read.turn = narrow(sums(wide(expected.turn), coder.triple(turn, &mut context, turned)?))?;
        } else {
            read.left_out = coder.symbol(&mut self.left_out, body.left_out.into())? as u8;
            read.turn = narrow(coder.triple(&mut self.wholes[1], &mut 0, wide(body.turn))?)?;
        }
        if read.sleeping {
            (read.velocity, read.spin) = ([0; 3], [0; 3]);
            return Ok(read);
        }
        coder.field(Field::Velocity);
        let faster = errors(wide(body.velocity), wide(expected.velocity));
        read.velocity = narrow(sums(wide(expected.velocity), coder.triple(velocity, &mut context, faster)?))?;
        coder.field(Field::Spin);
        let faster = errors(wide(body.spin), wide(expected.spin));
        read.spin = narrow(sums(wide(expected.spin), coder.triple(spin, &mut context, faster)?))?;
        Ok(read)
    }

    /// Codes a body of which the reader knows nothing, relative to the body before it in the datagram.
    pub(super) fn whole<C: Coder>(
        &mut self,
        coder: &mut C,
        before: &Quantised,
        body: &Quantised,
    ) -> Result<Quantised, CodecError> {
        let mut read = *before;
        self.before = GUESSES;
        self.owner(coder, before, body, &mut read)?;
        let [place, turn, velocity, spin] = &mut self.wholes;
        coder.field(Field::Place);
        let way = std::array::from_fn(|i| body.place[i].wrapping_sub(before.place[i]));
        let way = coder.triple(place, &mut 0, way)?;
        read.place = std::array::from_fn(|i| before.place[i].wrapping_add(way[i]));
        coder.field(Field::Turn);
        read.left_out = coder.symbol(&mut self.left_out, body.left_out.into())? as u8;
        read.turn = narrow(coder.triple(turn, &mut 0, wide(body.turn))?)?;
        (read.velocity, read.spin) = ([0; 3], [0; 3]);
        if !read.sleeping {
            coder.field(Field::Velocity);
            read.velocity = narrow(coder.triple(velocity, &mut 0, wide(body.velocity))?)?;
            coder.field(Field::Spin);
            read.spin = narrow(coder.triple(spin, &mut 0, wide(body.spin))?)?;
        }
        Ok(read)
    }

    /// Codes what rarely changes: whether the body sleeps, its owner and its epoch.
    fn owner<C: Coder>(
        &mut self,
        coder: &mut C,
        before: &Quantised,
        body: &Quantised,
        read: &mut Quantised,
    ) -> Result<(), CodecError> {
        coder.field(Field::Owner);
        let sleeps = &mut self.sleeps[usize::from(before.sleeping)];
        read.sleeping = coder.symbol(sleeps, body.sleeping.into())? == 1;
        if coder.symbol(&mut self.is_owned, usize::from(body.owner == before.owner))? == 0 {
            let owner = coder.number(&mut self.owner, body.owner.into())?;
            read.owner = u32::try_from(owner).map_err(|_| CodecError::Compact)?;
        }
        if coder.symbol(&mut self.is_aged, usize::from(body.epoch == before.epoch))? == 0 {
            let later = body.epoch.wrapping_sub(before.epoch) as i64;
            read.epoch = before.epoch.wrapping_add(coder.number(&mut self.epoch, later)? as u64);
        }
        Ok(())
    }
}

/// Returns the guess from which a body differs by the fewest bits.
fn best(guesses: &[Quantised; GUESSES], body: &Quantised) -> usize {
    let bits = |a: i64, b: i64| u64::BITS - a.abs_diff(b).leading_zeros();
    let cost = |guess: &Quantised| -> u32 {
        (0..3)
            .map(|i| {
                bits(body.place[i], guess.place[i])
                    + bits(body.velocity[i].into(), guess.velocity[i].into())
                    + bits(body.turn[i].into(), guess.turn[i].into())
                    + bits(body.spin[i].into(), guess.spin[i].into())
            })
            .sum()
    };
    (0..GUESSES).min_by_key(|&guess| cost(&guesses[guess])).expect("there are some")
}

fn wide<T: Into<i64>>(numbers: [T; 3]) -> [i64; 3] {
    numbers.map(Into::into)
}

fn narrow<T: TryFrom<i64> + Copy + Default>(numbers: [i64; 3]) -> Result<[T; 3], CodecError> {
    let mut narrow = [T::default(); 3];
    for (narrow, number) in narrow.iter_mut().zip(numbers) {
        *narrow = T::try_from(number).map_err(|_| CodecError::Compact)?;
    }
    Ok(narrow)
}

/// A writer or a reader of symbols. Each method writes the value that it is given, or ignores it and reads
/// another; it returns the value that was coded.
pub(super) trait Coder {
    /// Says whether this is a writer.
    const WRITES: bool;

    /// Notes that what follows belongs to this field.
    fn field(&mut self, field: Field);

    /// Codes a symbol.
    fn symbol<const N: usize>(&mut self, model: &mut Adaptive<N>, symbol: usize)
    -> Result<usize, CodecError>;

    /// Codes `count` bits, at most [`Bits::MOST`], without a model.
    fn bits(&mut self, count: u32, bits: u64) -> Result<u64, CodecError>;

    /// Codes any number of bits without a model.
    fn many_bits(&mut self, mut left: u32, bits: u64) -> Result<u64, CodecError> {
        let mut read = 0;
        while left > 0 {
            let count = left.min(Bits::MOST);
            left -= count;
            read = read << count | self.bits(count, bits >> left & ((1 << count) - 1))?;
        }
        Ok(read)
    }

    /// Codes the width of a number in bits.
    fn width(&mut self, model: &mut Adaptive<{ WIDE + 1 }>, width: usize) -> Result<usize, CodecError> {
        let symbol = self.symbol(model, width.min(WIDE))?;
        if symbol < WIDE {
            return Ok(symbol);
        }
        let width = self.bits(7, width as u64)? as usize;
        if (WIDE..=WIDEST).contains(&width) { Ok(width) } else { Err(CodecError::Compact) }
    }

    /// Codes a number: its width, its sign, and the bits below the highest.
    fn number(&mut self, models: &mut Number, number: i64) -> Result<i64, CodecError> {
        let magnitude = number.unsigned_abs();
        let width = self.width(&mut models.width, width(magnitude))? as u32;
        if width == 0 {
            return Ok(0);
        }
        let negative = self.symbol(&mut models.sign, usize::from(number < 0))? == 1;
        let mut read = 1;
        let mut left = width - 1;
        if left > 0 {
            left -= 1;
            let second = &mut models.second[(width as usize).min(RARE)];
            read = 2 | self.symbol(second, (magnitude >> left & 1) as usize)? as u64;
        }
        let read = (read << left | self.many_bits(left, magnitude & ((1 << left) - 1))?) as i64;
        Ok(if negative { read.wrapping_neg() } else { read })
    }

    /// Codes three numbers: the width of the largest, and of each number its highest two bits, the others,
    /// and its sign.
    fn triple(
        &mut self,
        models: &mut Triple,
        context: &mut usize,
        numbers: [i64; 3],
    ) -> Result<[i64; 3], CodecError> {
        let widest = numbers.iter().map(|number| width(number.unsigned_abs())).max().unwrap_or(0);
        let widest = self.width(&mut models.width[*context], widest)?;
        *context = widest.min(CONTEXTS - 1);
        let mut read = [0; 3];
        if widest == 0 {
            return Ok(read);
        }
        let low = widest.saturating_sub(2) as u32;
        let high = &mut models.high[widest.min(RARE)];
        for (read, number) in read.iter_mut().zip(numbers) {
            let magnitude = number.unsigned_abs();
            let top = self.symbol(high, (magnitude >> low) as usize & 3)? as u64;
            let magnitude = top << low | self.many_bits(low, magnitude & ((1 << low) - 1))?;
            if magnitude != 0 {
                let negative = self.bits(1, u64::from(number < 0))? == 1;
                *read = if negative { (magnitude as i64).wrapping_neg() } else { magnitude as i64 };
            }
        }
        Ok(read)
    }
}

/// Returns the width of a magnitude in bits.
fn width(magnitude: u64) -> usize {
    (u64::BITS - magnitude.leading_zeros()) as usize
}

/// A writer of the states of a datagram.
pub(super) struct Writer(DefaultRangeEncoder);

impl Writer {
    pub(super) fn new() -> Self {
        Self(DefaultRangeEncoder::new())
    }

    /// Returns the bytes so far.
    pub(super) fn len(&self) -> usize {
        self.0.num_bits().div_ceil(8)
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        let words = self.0.into_compressed().expect("memory takes all");
        words.into_iter().flat_map(u32::to_le_bytes).collect()
    }
}

impl Coder for Writer {
    const WRITES: bool = true;

    fn field(&mut self, _: Field) {}

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

/// A reader of the states of a datagram, which counts the bits of each field.
pub(super) struct Reader {
    decoder: DefaultRangeDecoder,
    field: usize,
    pub bits: [f64; Field::ALL.len()],
}

impl Reader {
    pub(super) fn new(bytes: &[u8]) -> Result<Self, CodecError> {
        let (words, rest) = bytes.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(CodecError::Compact);
        }
        let words: Vec<_> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let Ok(decoder) = DefaultRangeDecoder::from_compressed(words);
        Ok(Self { decoder, field: 0, bits: [0.0; Field::ALL.len()] })
    }
}

impl Coder for Reader {
    const WRITES: bool = false;

    fn field(&mut self, field: Field) {
        self.field = field as usize;
    }

    fn symbol<const N: usize>(&mut self, model: &mut Adaptive<N>, _: usize) -> Result<usize, CodecError> {
        let symbol = Decode::<PRECISION>::decode_symbol(&mut self.decoder, &*model)
            .map_err(|_| CodecError::Compact)?;
        self.bits[self.field] += model.bits(symbol);
        model.see(symbol);
        Ok(symbol)
    }

    fn bits(&mut self, count: u32, _: u64) -> Result<u64, CodecError> {
        let model = Bits { count };
        let bits =
            Decode::<PRECISION>::decode_symbol(&mut self.decoder, model).map_err(|_| CodecError::Compact)?;
        self.bits[self.field] += f64::from(count);
        Ok(bits.into())
    }
}
