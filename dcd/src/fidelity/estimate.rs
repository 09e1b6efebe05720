//! Estimates a mean from the last samples, with its 95 % confidence interval.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// The number of samples that are remembered.
const MEMORY: usize = 256;

/// The last samples of a quantity, each with a weight: how much it stands for.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Estimate {
    samples: VecDeque<(f32, f32)>,
}

impl Estimate {
    pub(super) fn add(&mut self, sample: f32, weight: f32) {
        if self.samples.len() == MEMORY {
            self.samples.pop_front();
        }
        self.samples.push_back((sample, weight));
    }

    pub(super) fn count(&self) -> usize {
        self.samples.len()
    }

    /// Returns the mean of the samples; 0 without any.
    pub(super) fn mean(&self) -> f32 {
        if self.samples.is_empty() { 0.0 } else { mean(self.weighted()) as f32 }
    }

    fn weighted(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        self.samples.iter().map(|&(sample, weight)| (sample.into(), weight.into()))
    }

    /// Returns the ends of the 95 % confidence interval of the mean. It is Johnson's modified t (1978), which
    /// allows for the skewness of the samples, since errors are often small and seldom large. With weights,
    /// the effective number of samples counts: as many as samples of one weight would be (Kish 1965).
    ///
    /// The upper end assumes one more sample, of three times the largest, since the largest are too rare to
    /// be among few. The lower end assumes one more sample of zero. Before there are two samples, the
    /// interval is all that is not negative.
    pub(super) fn interval(&self) -> [f32; 2] {
        if self.count() < 2 {
            return [0.0, f32::INFINITY];
        }
        let samples = || self.weighted();
        let weight = samples().map(|(_, weight)| weight).sum::<f64>() / self.count() as f64;
        let unseen = (UNSEEN * samples().map(|(sample, _)| sample).fold(0.0, f64::max)).max(LEAST_UNSEEN_M_S);
        let (below, reach_below) = johnson(samples().chain([(0.0, weight)]));
        let (above, reach_above) = johnson(samples().chain([(unseen, weight)]));
        [((below - reach_below).max(0.0)) as f32, (above + reach_above) as f32]
    }
}

/// The size of the sample that is assumed though it was not seen, as a multiple of the largest that was seen,
/// and its least size.
const UNSEEN: f64 = 3.0;
const LEAST_UNSEEN_M_S: f64 = 0.1;

/// Returns the mean of weighted samples.
fn mean(samples: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (sum, weights) = samples
        .fold((0.0, 0.0), |(sum, weights), (sample, weight)| (sum + sample * weight, weights + weight));
    sum / weights
}

/// Returns the middle of the confidence interval of the mean of weighted samples, and how far it reaches to
/// both sides.
fn johnson(samples: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let mean = mean(samples.clone());
    let weights = |power: i32| samples.clone().map(|(_, weight)| weight.powi(power)).sum::<f64>();
    let moment = |power: i32| {
        let terms = samples.clone().map(|(sample, weight)| (weight * (sample - mean)).powi(power));
        terms.sum::<f64>() / weights(1).powi(power)
    };
    let n = weights(1).powi(2) / weights(2);
    // The variance of the mean.
    let variance = moment(2) * n / (n - 1.0);
    if variance == 0.0 {
        return (mean, 0.0);
    }
    (mean + moment(3) / (6.0 * variance), student_975(n - 1.0) * variance.sqrt())
}

/// Returns the 97.5 % quantile of Student's t with `freedom` degrees of freedom (Cornish and Fisher's
/// expansion; within 0.5 % from 4 on).
fn student_975(freedom: f64) -> f64 {
    const Z: f64 = 1.959_964;
    if freedom < 3.0 {
        return if freedom < 2.0 { 12.706 } else { 4.303 };
    }
    let z2 = Z * Z;
    let first = Z * (z2 + 1.0) / 4.0;
    let second = Z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / 96.0;
    let third = Z * (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / 384.0;
    Z + first / freedom + second / freedom.powi(2) + third / freedom.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, t) in [
            (1.0, 12.706),
            (2.0, 4.303),
            (3.0, 3.182),
            (5.0, 2.571),
            (10.0, 2.228),
            (30.0, 2.042),
            (255.0, 1.969),
        ] {
            assert!((student_975(freedom) / t - 1.0).abs() < 0.01, "{freedom}: {}", student_975(freedom));
        }
    }

    #[test]
    fn an_interval_narrows_with_the_samples_and_forgets_old_ones() {
        let mut estimate = Estimate::default();
        assert_eq!(estimate.interval(), [0.0, f32::INFINITY]);
        let mut widths = Vec::new();
        for i in 0..256 {
            estimate.add([1.0, 2.0, 3.0][i % 3], 7.0);
            if [8, 32, 128].contains(&(i + 1)) {
                let [low, high] = estimate.interval();
                assert!(low < 2.0 && 2.0 < high, "{low} to {high}");
                widths.push(high - low);
            }
        }
        assert!(widths.windows(2).all(|two| two[1] < 0.6 * two[0]), "{widths:?}");
        (0..256).for_each(|_| estimate.add(5.0, 7.0));
        let [low, high] = estimate.interval();
        assert_eq!(estimate.mean(), 5.0);
        assert!((4.9..5.0).contains(&low), "{low}: one sample in 256 may have been 0");
        assert!((5.0..5.3).contains(&high), "{high}: one sample in 256 may have been 15");
    }

    #[test]
    fn few_samples_that_stand_for_much_count_as_what_they_stand_for() {
        let mut estimate = Estimate::default();
        (0..40).for_each(|_| estimate.add(1.0, 1.0));
        let narrow = estimate.interval();
        (0..10).for_each(|_| estimate.add(2.0, 16.0));
        assert_eq!(estimate.mean(), 1.8);
        let [low, high] = estimate.interval();
        assert!(low < 1.8 && 1.8 < high && high - low > 2.0 * (narrow[1] - narrow[0]), "{low} to {high}");
    }
}
