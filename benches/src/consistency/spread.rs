//! Reduces the deviations of one tick, or of all, to the mean, the 99th percentile and the largest.

/// The mean, 99th percentile and largest of some values; zeros if there are none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    pub(super) mean_m: f64,
    pub(super) p99_m: f64,
    pub(super) max_m: f64,
}

impl Spread {
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<_> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let Some(&max_m) = values.last() else { return Self::default() };
        let rank = (values.len() * 99).div_ceil(100) - 1;
        Self { mean_m: values.iter().sum::<f64>() / values.len() as f64, p99_m: values[rank], max_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_a_hundred_may_be_above_the_99th_percentile() {
        let spread = Spread::of((1..=200).rev().map(f64::from));
        assert_eq!((spread.mean_m, spread.p99_m, spread.max_m), (100.5, 198.0, 200.0));
        assert_eq!(Spread::of([]).max_m, 0.0);
    }
}
