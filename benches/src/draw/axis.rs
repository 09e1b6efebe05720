//! Scales a logarithmic axis.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// A logarithmic axis, from the value at its start to the larger one at its end, both above zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Decades {
    start: f64,
    end: f64,
}

impl Decades {
    /// Returns an axis around all values above zero, with a small margin; a decade when there are none.
    pub(super) fn around(values: impl IntoIterator<Item = f64>) -> Self {
        let values = values.into_iter().filter(|value| value.is_finite() && *value > 0.0);
        let (least, most) =
            values.fold((f64::INFINITY, 0.0f64), |(least, most), value| (least.min(value), most.max(value)));
        if most == 0.0 {
            return Self { start: 0.1, end: 1.0 };
        }
        // At least half a decade, so that noise does not look like a difference.
        let air = (0.08 * (most / least).log10()).max(0.25 - 0.5 * (most / least).log10()).max(0.05);
        Self { start: least / 10f64.powf(air), end: most * 10f64.powf(air) }
    }

    /// Returns the whole decades between two values.
    pub(super) fn points_within((least, most): (f64, f64)) -> Vec<f64> {
        let decades = least.log10().floor() as i32..=most.log10().ceil() as i32;
        let within = |value: &f64| (least * 0.999..=most * 1.001).contains(value);
        decades.map(|decade| 10f64.powi(decade)).filter(within).collect()
    }

    fn share(&self, value: f64) -> f64 {
        let (start, end) = (self.start.log10(), self.end.log10());
        ((value.max(f64::MIN_POSITIVE).log10() - start) / (end - start)).clamp(0.0, 1.0)
    }
}

impl Ranged for Decades {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        from + (f64::from(to - from) * self.share(*value)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let (least, most) = (self.start, self.end);
        let points = |digits: &[f64], every: i32| -> Vec<f64> {
            let decades = least.log10().floor() as i32..=most.log10().ceil() as i32;
            decades
                .filter(|decade| decade.rem_euclid(every) == 0)
                .flat_map(|decade| digits.iter().map(move |digit| digit * 10f64.powi(decade)))
                .filter(|value| (least..=most).contains(value))
                .collect()
        };
        let choices: [(&[f64], i32); 6] =
            [(&[1.0, 2.0, 5.0], 1), (&[1.0, 3.0], 1), (&[1.0], 1), (&[1.0], 2), (&[1.0], 3), (&[1.0], 6)];
        let fitting = choices.iter().map(|(digits, every)| points(digits, *every));
        fitting.into_iter().find(|points| points.len() <= hint.max_num_points()).unwrap_or_default()
    }

    fn range(&self) -> Range<f64> {
        self.start..self.end
    }
}

impl ValueFormatter<f64> for Decades {
    fn format_ext(&self, value: &f64) -> String {
        power(*value)
    }
}

/// Formats 0.001 to 1000 as they are, and others as powers of ten.
pub(super) fn power(value: f64) -> String {
    if (0.000_999..1_000.5).contains(&value) {
        let text = format!("{value:.4}");
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    format!("{value:.0e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_its_decades_evenly_and_what_is_outside_at_its_ends() {
        let axis = Decades { start: 0.001, end: 1.0 };
        assert_eq!([1.0, 0.1, 0.001, 0.0].map(|v| axis.map(&v, (300, 0))), [0, 100, 300, 300]);
        assert_eq!(axis.key_points(5), [0.001, 0.01, 0.1, 1.0]);
    }

    #[test]
    fn an_axis_holds_all_its_values_and_never_less_than_half_a_decade() {
        let axis = Decades::around([0.0, 2.0, 2.0, f64::INFINITY]);
        assert!((axis.end / axis.start).log10() >= 0.499, "{axis:?}");
        let wide = Decades::around([1e-6, 1e3]);
        assert!(wide.start < 1e-6 && wide.end > 1e3);
        assert_eq!([0.001, 0.5, 20.0, 1e-6, 1e6].map(power), ["0.001", "0.5", "20", "1e-6", "1e6"]);
    }
}
