//! Prints the summaries of processes of a cluster as JSON objects and as tables.

use serde::Serialize;

use super::common::print;
use super::failure::Failure;
use crate::runtime::measure::StepTimes;
use crate::runtime::{NodeSummary, ServerSummary};
use crate::space::Tick;

/// A summary that is shown to people as a table and to programs as a JSON object.
pub(super) trait Summary: Serialize {
    /// Returns names and values, in order.
    fn rows(&self) -> Vec<(&'static str, String)>;

    /// Prints it; the JSON object is one line.
    fn show(&self, json: bool) -> Result<(), Failure> {
        if json {
            let text = serde_json::to_string(self)
                .map_err(|error| Failure::run(format!("cannot write JSON: {error}; leave --json out")))?;
            return print(&text);
        }
        let lines: Vec<_> = self.rows().iter().map(|(name, value)| format!("{name:<14}{value}")).collect();
        print(&lines.join("\n"))
    }
}

/// The summary that `dcd serve` prints at its end.
#[derive(Serialize)]
pub(super) struct Served {
    pub tick: u64,
    pub bodies: usize,
    pub regions: usize,
    pub nodes: usize,
    pub views: u64,
    pub repartitions: u64,
    pub lost: usize,
    pub doubled: usize,
    pub audited: bool,
    pub state_hash: Option<String>,
    pub bytes: u64,
    pub seconds: f64,
    pub kept: bool,
}

impl Served {
    /// Creates it. It has a state hash only if the world ended at `last_tick`, of which the state is known.
    pub(super) fn new(summary: &ServerSummary, last_tick: Option<Tick>) -> Self {
        let is_whole = last_tick == Some(summary.tick);
        Self {
            tick: summary.tick.0,
            bodies: summary.bodies,
            regions: summary.regions,
            nodes: summary.nodes,
            views: summary.views,
            repartitions: summary.repartitions,
            lost: summary.lost,
            doubled: summary.doubled,
            audited: !summary.unaudited,
            state_hash: summary.state_hash.filter(|_| is_whole).map(|hash| format!("{hash:016x}")),
            bytes: summary.bytes,
            seconds: summary.seconds,
            kept: summary.kept,
        }
    }
}

impl Summary for Served {
    fn rows(&self) -> Vec<(&'static str, String)> {
        let mut rows = vec![
            ("ticks", format!("{} of the world, {:.1} s of this server", self.tick, self.seconds)),
            ("bodies", format!("{} in {} regions", self.bodies, self.regions)),
            ("nodes", format!("{} at the end, {} memberships", self.nodes, self.views)),
            ("balance", format!("regions changed {} times", self.repartitions)),
            ("lost", self.lost.to_string()),
            ("doubled", self.doubled.to_string()),
            ("traffic", format!("{} bytes in and out", self.bytes)),
        ];
        rows.extend(self.state_hash.clone().map(|hash| ("state", hash)));
        rows
    }
}

/// The summary that `dcd node` prints at its end.
#[derive(Serialize)]
pub(super) struct Computed {
    pub node: String,
    pub tick: u64,
    pub bodies: u32,
    pub regions: usize,
    pub tick_ms: StepTimes,
    pub transfers: u64,
    pub ghosts_mean: f64,
    pub exchanges_mean: f64,
    pub disagreement_max_m_s: f32,
    pub speculative: u64,
    pub bytes: u64,
    pub bytes_per_s: f64,
    pub seconds: f64,
}

impl From<&NodeSummary> for Computed {
    fn from(summary: &NodeSummary) -> Self {
        let times = summary.compute_us.iter().map(|&us| std::time::Duration::from_micros(us.into()));
        let ticks = summary.compute_us.len().max(1) as f64;
        Self {
            node: summary.node.to_string(),
            tick: summary.tick.0,
            bodies: summary.bodies,
            regions: summary.regions,
            tick_ms: StepTimes::of(&times.collect::<Vec<_>>()),
            transfers: summary.transfers,
            ghosts_mean: summary.ghosts_sum as f64 / ticks,
            exchanges_mean: summary.exchanges_sum as f64 / ticks,
            disagreement_max_m_s: summary.disagreement_max_m_s,
            speculative: summary.speculative,
            bytes: summary.bytes,
            bytes_per_s: summary.bytes as f64 / summary.seconds.max(f64::MIN_POSITIVE),
            seconds: summary.seconds,
        }
    }
}

impl Summary for Computed {
    fn rows(&self) -> Vec<(&'static str, String)> {
        let ms = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
        let times = &self.tick_ms;
        vec![
            ("node", self.node.clone()),
            ("last tick", format!("{} after {:.1} s", self.tick, self.seconds)),
            ("owned", format!("{} bodies in {} regions", self.bodies, self.regions)),
            (
                "tick",
                format!(
                    "{} ms mean, {} median, {} at 99 %, {} longest (from the 31st)",
                    ms(times.mean),
                    ms(times.p50),
                    ms(times.p99),
                    ms(times.max)
                ),
            ),
            ("transfers", format!("{} bodies came from other regions", self.transfers)),
            ("ghosts", format!("{:.1} mean", self.ghosts_mean)),
            (
                "exchanges",
                format!(
                    "{:.2} a tick; copies disagree by {:.6} m/s at most",
                    self.exchanges_mean, self.disagreement_max_m_s
                ),
            ),
            ("speculative", format!("{} ticks, while others were waited for", self.speculative)),
            ("traffic", format!("{} bytes in and out, {:.0} a second", self.bytes, self.bytes_per_s)),
        ]
    }
}
