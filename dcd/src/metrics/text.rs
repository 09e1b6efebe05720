//! Writes metrics in Prometheus' text format, version 0.0.4.
//!
//! A metric is written whole before the next one: `HELP`, `TYPE`, then a line per set of labels.

use std::fmt::Write;

/// A text of metrics.
#[derive(Debug, Default)]
pub(crate) struct Text(String);

/// A metric whose values are being written.
pub(crate) struct Family<'a> {
    text: &'a mut String,
    name: &'static str,
}

/// The counts of values by bucket. The number of buckets is fixed when it is made.
#[derive(Clone, Debug)]
pub(crate) struct Histogram {
    /// The upper bounds of the buckets, in increasing order.
    bounds: &'static [f64],
    /// One count for each bound, and one for the values above the last bound.
    counts: Vec<u64>,
    sum: f64,
}

impl Text {
    /// Begins a metric that only grows, from 0 at the start of the process. Its name ends with `_total`.
    pub(crate) fn counter(&mut self, name: &'static str, help: &str) -> Family<'_> {
        assert!(name.ends_with("_total"), "{name} is a counter");
        self.family(name, "counter", help)
    }

    /// Begins a metric that goes up and down.
    pub(crate) fn gauge(&mut self, name: &'static str, help: &str) -> Family<'_> {
        self.family(name, "gauge", help)
    }

    /// Writes a histogram.
    pub(crate) fn histogram(&mut self, name: &'static str, help: &str, of: &Histogram) {
        let Self(text) = self;
        write_head(text, name, "histogram", help);
        let mut count = 0;
        for (bound, more) in of.bounds.iter().chain([&f64::INFINITY]).zip(&of.counts) {
            count += more;
            let _ = writeln!(text, "{name}_bucket{{le=\"{}\"}} {count}", number(*bound));
        }
        let _ = writeln!(text, "{name}_sum {}\n{name}_count {count}", number(of.sum));
    }

    /// Returns the text.
    pub(crate) fn into_string(self) -> String {
        self.0
    }

    fn family(&mut self, name: &'static str, kind: &str, help: &str) -> Family<'_> {
        let Self(text) = self;
        write_head(text, name, kind, help);
        Family { text, name }
    }
}

impl Family<'_> {
    /// Writes the only value of a metric without labels.
    pub(crate) fn is(&mut self, value: f64) {
        let _ = writeln!(self.text, "{} {}", self.name, number(value));
    }

    /// Writes the value for these labels. Sets of labels must be few: the collector keeps each set for ever.
    pub(crate) fn of(&mut self, labels: &[(&str, &str)], value: f64) -> &mut Self {
        let labels: Vec<_> =
            labels.iter().map(|(name, value)| format!("{name}=\"{}\"", escaped(value, true))).collect();
        let _ = writeln!(self.text, "{}{{{}}} {}", self.name, labels.join(","), number(value));
        self
    }
}

impl Histogram {
    /// Returns a histogram without values.
    pub(crate) fn new(bounds: &'static [f64]) -> Self {
        assert!(bounds.is_sorted(), "bounds increase");
        Self { bounds, counts: vec![0; bounds.len() + 1], sum: 0.0 }
    }

    /// Counts a value.
    pub(crate) fn observe(&mut self, value: f64) {
        self.counts[self.bounds.partition_point(|&bound| bound < value)] += 1;
        self.sum += value;
    }
}

fn write_head(text: &mut String, name: &str, kind: &str, help: &str) {
    let _ = writeln!(text, "# HELP {name} {}\n# TYPE {name} {kind}", escaped(help, false));
}

fn escaped(text: &str, is_label: bool) -> String {
    let text = text.replace('\\', "\\\\").replace('\n', "\\n");
    if is_label { text.replace('"', "\\\"") } else { text }
}

fn number(value: f64) -> String {
    match value {
        f64::INFINITY => "+Inf".to_owned(),
        f64::NEG_INFINITY => "-Inf".to_owned(),
        value => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_are_written_as_prometheus_reads_them() {
        let mut text = Text::default();
        text.gauge("dcd_bodies", "Bodies.").is(3.0);
        let mut bytes = text.counter("dcd_bytes_total", "Bytes \\ by\nkind.");
        bytes.of(&[("kind", "a\"b\\c\nd"), ("to", "x")], 0.5).of(&[("kind", "e")], f64::INFINITY);
        let mut times = Histogram::new(&[0.001, 0.1]);
        [0.001, 0.0005, 0.05, 7.0].into_iter().for_each(|time| times.observe(time));
        text.histogram("dcd_tick_seconds", "Times.", &times);
        let expected = "# HELP dcd_bodies Bodies.\n# TYPE dcd_bodies gauge\ndcd_bodies 3\n\
            # HELP dcd_bytes_total Bytes \\\\ by\\nkind.\n# TYPE dcd_bytes_total counter\n\
            dcd_bytes_total{kind=\"a\\\"b\\\\c\\nd\",to=\"x\"} 0.5\ndcd_bytes_total{kind=\"e\"} +Inf\n\
            # HELP dcd_tick_seconds Times.\n# TYPE dcd_tick_seconds histogram\n\
            dcd_tick_seconds_bucket{le=\"0.001\"} 2\ndcd_tick_seconds_bucket{le=\"0.1\"} 3\n\
            dcd_tick_seconds_bucket{le=\"+Inf\"} 4\ndcd_tick_seconds_sum 7.0515\ndcd_tick_seconds_count 4\n";
        assert_eq!(text.into_string(), expected);
    }
}
