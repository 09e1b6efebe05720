//! Adapts the probabilities of symbols to those seen. Cumulative frequencies move a part of the way towards
//! each symbol (Giesen, "Mixing discrete probability distributions", 2015), farther for the first symbols.

use std::borrow::Borrow;
use std::num::NonZeroU16;

use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};

/// The number of bits of a probability.
pub(super) const PRECISION: usize = 15;

const ONE: u16 = 1 << PRECISION;

/// The exponent of the smallest move: after the first symbols a model moves by 1/2^5 towards each.
const SLOWEST: u32 = 5;

/// A model of one of `N` symbols, 0 to `N` - 1.
#[derive(Clone, Debug)]
pub(super) struct Adaptive<const N: usize> {
    /// The cumulative frequency below each symbol; strictly growing, from 0.
    below: [u16; N],
    seen: u32,
}

impl<const N: usize> Adaptive<N> {
    pub(super) fn new() -> Self {
        Self { below: std::array::from_fn(|i| (i * usize::from(ONE) / N) as u16), seen: 0 }
    }

    /// Returns a model that expects symbols near `usual`: each step farther away half as often, down to a
    /// small rest.
    pub(super) fn about(usual: usize) -> Self {
        let weight = |symbol: usize| 1 << 9 >> symbol.abs_diff(usual).min(8);
        let all: usize = (0..N).map(weight).sum();
        let free = usize::from(ONE) - N;
        let (mut below, mut sum) = ([0; N], 0);
        for (symbol, below) in below.iter_mut().enumerate() {
            *below = (symbol + sum * free / all) as u16;
            sum += weight(symbol);
        }
        Self { below, seen: 2 }
    }

    /// Returns how many bits a symbol takes.
    pub(super) fn bits(&self, symbol: usize) -> f64 {
        PRECISION as f64 - f64::from(self.share(symbol).get()).log2()
    }

    /// Makes a symbol that has come more probable, and the others less so. None becomes impossible.
    pub(super) fn see(&mut self, symbol: usize) {
        let rate = (1 + self.seen / 2).min(SLOWEST);
        self.seen += 1;
        for (i, below) in self.below.iter_mut().enumerate().skip(1) {
            // The goal: all probability for the symbol, except the least that each other one keeps.
            let goal = if i <= symbol { i as i32 } else { i32::from(ONE) - (N - i) as i32 };
            *below = (i32::from(*below) + ((goal - i32::from(*below)) >> rate)) as u16;
        }
    }

    fn above(&self, symbol: usize) -> u16 {
        self.below.get(symbol + 1).copied().unwrap_or(ONE)
    }

    fn share(&self, symbol: usize) -> NonZeroU16 {
        NonZeroU16::new(self.above(symbol) - self.below[symbol]).expect("frequencies grow strictly")
    }
}

impl<const N: usize> EntropyModel<PRECISION> for Adaptive<N> {
    type Symbol = usize;
    type Probability = u16;
}

impl<const N: usize> EncoderModel<PRECISION> for Adaptive<N> {
    fn left_cumulative_and_probability(&self, symbol: impl Borrow<usize>) -> Option<(u16, NonZeroU16)> {
        let symbol = *symbol.borrow();
        (symbol < N).then(|| (self.below[symbol], self.share(symbol)))
    }
}

impl<const N: usize> DecoderModel<PRECISION> for Adaptive<N> {
    fn quantile_function(&self, quantile: u16) -> (usize, u16, NonZeroU16) {
        let symbol = self.below.partition_point(|&below| below <= quantile) - 1;
        (symbol, self.below[symbol], self.share(symbol))
    }
}

/// A model of `count` bits, whose values are all equally probable.
#[derive(Clone, Copy)]
pub(super) struct Bits {
    pub count: u32,
}

impl Bits {
    /// The most bits that are coded at a time.
    pub(super) const MOST: u32 = 12;

    fn step(self) -> u32 {
        PRECISION as u32 - self.count
    }
}

impl EntropyModel<PRECISION> for Bits {
    type Symbol = u16;
    type Probability = u16;
}

impl EncoderModel<PRECISION> for Bits {
    fn left_cumulative_and_probability(&self, symbol: impl Borrow<u16>) -> Option<(u16, NonZeroU16)> {
        let symbol = *symbol.borrow();
        let share = NonZeroU16::new(1 << self.step())?;
        (symbol >> self.count == 0).then_some((symbol << self.step(), share))
    }
}

impl DecoderModel<PRECISION> for Bits {
    fn quantile_function(&self, quantile: u16) -> (u16, u16, NonZeroU16) {
        let symbol = quantile >> self.step();
        (symbol, symbol << self.step(), NonZeroU16::new(1 << self.step()).expect("at most 12 bits"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_symbol_becomes_impossible_and_frequent_ones_become_cheap() {
        let mut model = Adaptive::<65>::new();
        let mut other = 1usize;
        for i in 0..10_000 {
            other = (other * 75 + 74) % 65;
            model.see(if i % 10 == 0 { other } else { 7 });
            let all: u32 = (0..65).map(|symbol| u32::from(model.share(symbol).get())).sum();
            assert_eq!(all, u32::from(ONE));
        }
        assert!(model.share(7).get() > ONE / 2, "{}", model.share(7));
        for quantile in 0..ONE {
            let (symbol, below, share) = model.quantile_function(quantile);
            assert!(symbol < 65 && below <= quantile && quantile - below < share.get());
            assert_eq!(model.left_cumulative_and_probability(symbol), Some((below, share)));
        }
    }
}
