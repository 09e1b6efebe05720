//! Checks that the dashboard, the alerts and the manual ask for what servers and nodes tell Prometheus.

use std::collections::BTreeSet;

/// The labels that Prometheus gives to all that it scrapes, by its configuration.
const OF_TARGETS: [&str; 3] = ["world", "instance", "job"];

/// Checks that the manual lists exactly the metrics of these series, and that each query of the dashboard and
/// of the alerts finds some of them.
pub(crate) fn check<'a>(told: impl Iterator<Item = &'a String>) {
    let manual = include_str!("../../../dcd/manual/operating.md");
    let board: serde_json::Value =
        serde_json::from_str(include_str!("../../../packaging/grafana/dcd.json")).unwrap();
    let panels = board["panels"].as_array().unwrap().iter();
    let targets = panels.filter_map(|panel| panel["targets"].as_array()).flatten();
    let of = |target: &serde_json::Value, key: &str| target[key].as_str().unwrap_or_default().to_owned();
    let mut asked: Vec<_> = targets.map(|target| (of(target, "expr"), of(target, "legendFormat"))).collect();
    assert!(asked.len() > 20, "the board has {} queries", asked.len());
    let alerts = include_str!("../../../packaging/prometheus/alerts.yml");
    let rules =
        manual.split("```yaml\n").find(|block| block.starts_with("groups:")).expect("the manual has rules");
    assert_eq!(rules.split("```").next(), Some(alerts), "the rules of the manual are those of packaging");
    let alerts = alerts.lines().filter_map(|line| line.trim_start().strip_prefix("expr: "));
    asked.extend(alerts.map(|alert| (alert.to_owned(), String::new())));
    let series: Vec<_> = told.map(|text| Series::of(text)).collect();
    for (query, legend) in &asked {
        // `up` comes from Prometheus itself.
        if !query.starts_with("up{") {
            finds(query, legend, &series).unwrap_or_else(|error| panic!("`{query}`, `{legend}`: {error}"));
        }
    }
    let tables = manual.lines().filter(|line| line.starts_with("| `") && !line.starts_with("| `/"));
    let cells = tables.filter_map(|line| line.split('|').nth(1));
    let names = cells.flat_map(|cell| cell.split('`').filter(|name| name.contains('_')));
    let named: BTreeSet<_> = names.map(|name| name.split('{').next().unwrap()).collect();
    let family = |name| {
        ["_bucket", "_sum", "_count"].iter().find_map(|end| str::strip_suffix(name, end)).unwrap_or(name)
    };
    let told: BTreeSet<_> = series.iter().map(|series| family(series.name)).collect();
    assert_eq!(told, named);
}

/// A name with labels and their values: of a series, or of what a query asks for.
struct Series<'a> {
    name: &'a str,
    labels: Vec<(&'a str, &'a str)>,
}

impl<'a> Series<'a> {
    /// Reads the text form, such as `dcd_queue_bytes{queue="quic"}`.
    fn of(text: &'a str) -> Self {
        let (name, labels) = text.split_once('{').unwrap_or((text, ""));
        let labels = labels.trim_end_matches('}').split(',').filter_map(|label| label.split_once('='));
        Self { name, labels: labels.map(|(label, value)| (label.trim(), value.trim())).collect() }
    }

    fn has(&self, label: &str) -> bool {
        OF_TARGETS.contains(&label) || self.labels.iter().any(|(name, _)| *name == label)
    }

    fn matches(&self, asked: &Series<'_>) -> bool {
        let is_met = |wanted: &(&str, &str)| OF_TARGETS.contains(&wanted.0) || self.labels.contains(wanted);
        self.name == asked.name && asked.labels.iter().all(is_met)
    }
}

/// Checks that each series that a query asks for is told, with the labels by which the query sums up and which
/// its legend shows.
fn finds(query: &str, legend: &str, told: &[Series<'_>]) -> Result<(), String> {
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut asked = Vec::new();
    for (at, _) in query.match_indices("dcd_").chain(query.match_indices("process_")) {
        let rest = &query[at..];
        let name_ends = rest.find(|c| !is_of_name(c)).unwrap_or(rest.len());
        let ends =
            if rest[name_ends..].starts_with('{') { rest.find('}').ok_or("no `}`")? } else { name_ends };
        asked.push(Series::of(&rest[..ends]));
    }
    let sums: Vec<_> = query.split(" by (").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    let by: Vec<_> = sums.iter().flat_map(|labels| labels.split(", ")).collect();
    let shown: Vec<_> = legend.split("{{").skip(1).filter_map(|rest| rest.split("}}").next()).collect();
    if asked.is_empty() {
        return Err("it asks for nothing".to_owned());
    }
    for asked in &asked {
        let found: Vec<_> = told.iter().filter(|series| series.matches(asked)).collect();
        if found.is_empty() {
            return Err(format!("nobody tells {} with {:?}", asked.name, asked.labels));
        }
        let lacks = |label: &&&str| !found.iter().all(|series| series.has(label));
        if let Some(label) = by.iter().chain(&shown).find(lacks) {
            return Err(format!("{} has no label {label}", asked.name));
        }
    }
    match shown.iter().find(|label| !sums.is_empty() && !by.contains(label)) {
        Some(label) => Err(format!("the sum has no label {label}")),
        None => Ok(()),
    }
}

#[test]
fn a_query_that_finds_nothing_is_found() {
    let told = ["dcd_a_total{direction=\"in\"}", "dcd_b_bucket{le=\"1\"}", "dcd_c"].map(Series::of);
    let judge = |query: &str, legend: &str| finds(query, legend, &told);
    let good = [
        ("sum by (direction) (rate(dcd_a_total{world=~\"$world\", direction=\"in\"}[5m]))", "{{direction}}"),
        ("histogram_quantile(0.5, sum by (instance, le) (rate(dcd_b_bucket{world=~\"$world\"}[5m])))", ""),
        ("dcd_c / clamp_min(dcd_c, 1)", "{{instance}}"),
    ];
    for (query, legend) in good {
        assert_eq!(judge(query, legend), Ok(()));
    }
    let bad = [
        ("dcd_d", ""),
        ("dcd_a_total{direction=\"out\"}", ""),
        ("dcd_c{direction=\"in\"}", ""),
        ("sum by (direction) (dcd_c)", ""),
        ("dcd_a_total", "{{queue}}"),
        ("sum by (direction) (dcd_a_total)", "{{instance}}"),
        ("vector(1)", ""),
    ];
    for (query, legend) in bad {
        assert!(judge(query, legend).is_err(), "{query}");
    }
}
