//! Measures what the thesis of 2006 could not: how far groups are from one another over time, how far ghosts
//! are from their owners inside a group, and what it costs on the wire to keep groups together. Whole
//! clusters run in virtual time, with real physics.

mod picture;
mod scene;
mod spread;

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Duration;

use clap::Args;
use dcd::protocol::SyncProtocol;
use dcd::sim::{Apart, Comparer, Deviating, Scope, Sent};
use serde::{Deserialize, Serialize};

use self::scene::{GROUPS, Running, SETTINGS, Setting};
use self::spread::Spread;
use crate::output::{Output, Sheet, Shown};

/// The rows of every simulated second, which have a picture and no table.
const SECONDS: Shown<Row> =
    Shown { name: "consistency", table: |_| String::new(), picture: Some(picture::picture) };
const RUNS: Shown<Summary> = Shown { name: "consistency-runs", table: picture::table, picture: None };
/// The time until groups have begun and avatars move.
const SETTLING: Duration = Duration::from_secs(5);
const SECOND: Duration = Duration::from_secs(1);
const TICKS_A_SECOND: u64 = 60;

/// The output and the seed of the runs.
#[derive(Args)]
pub(crate) struct Consistency {
    #[command(flatten)]
    output: Output,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// One simulated second of one setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    setting: String,
    second: u64,
    bodies_mean_m: f64,
    bodies_p99_m: f64,
    bodies_max_m: f64,
    avatars_mean_m: f64,
    avatars_max_m: f64,
    ghosts_mean_m: f64,
    ghosts_max_m: f64,
    /// The number of persistent bodies for which a group other than the main one is authoritative.
    claimed: usize,
    /// The time between the first and the last group's completion of the same tick, milliseconds.
    apart_ms: f64,
    between_bytes_s: u64,
    inside_bytes_s: u64,
    server_bytes_s: u64,
    client_bytes_s: u64,
}

/// The summary of one setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Summary {
    setting: String,
    seconds: u64,
    threshold_m: f32,
    lag_ticks: u64,
    bodies_mean_m: f64,
    bodies_p99_m: f64,
    bodies_max_m: f64,
    avatars_mean_m: f64,
    avatars_p99_m: f64,
    avatars_max_m: f64,
    ghosts_mean_m: f64,
    ghosts_p99_m: f64,
    ghosts_max_m: f64,
    between_bytes_s: u64,
    inside_bytes_s: u64,
}

impl Consistency {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let mut seconds = Vec::new();
        self.output.fill(&RUNS, |runs| self.measure(runs, &mut seconds))?;
        self.output.fill(&SECONDS, |rows| seconds.into_iter().try_for_each(|row| rows.push(row))).map(drop)
    }

    fn measure(&self, runs: &mut Sheet<Summary>, rows: &mut Vec<Row>) -> Result<(), Box<dyn Error>> {
        let seconds = if self.output.quick { 60 } else { 600 };
        for setting in &SETTINGS {
            eprintln!("{}: {seconds} simulated seconds", setting.name);
            let (of_setting, summary) = measure(setting, seconds, self.seed)?;
            rows.extend(of_setting);
            runs.push(summary)?;
        }
        Ok(())
    }
}

fn measure(setting: &Setting, seconds: u64, seed: u64) -> Result<(Vec<Row>, Summary), Box<dyn Error>> {
    let mut running = Running::new(setting, seed)?;
    running.run_for(SETTLING)?;
    running.sim.sample_every(TICKS_A_SECOND);
    let (mut comparer, mut rows, mut all) = (Comparer::new(GROUPS as usize), Vec::new(), Vec::new());
    let mut before = running.sim.sent().clone();
    for second in 1..=seconds {
        running.run_for(SECOND)?;
        let sent = running.sim.sent().clone();
        for deviating in comparer.compare(&mut running.sim) {
            rows.push(row(setting, second, &deviating, &before, &sent));
            all.push(deviating);
        }
        before = sent;
    }
    if rows.len() < seconds as usize / 2 {
        return Err(format!(
            "{}: only {} of {seconds} seconds could be compared:\n{}",
            setting.name,
            rows.len(),
            running.sim.timeline()
        )
        .into());
    }
    let summary = summary(setting, seconds, &rows, &all);
    Ok((rows, summary))
}

fn bytes(sent: &BTreeMap<Scope, Sent>, scope: Scope) -> u64 {
    sent.get(&scope).map_or(0, |sent| sent.bytes)
}

fn row(
    setting: &Setting,
    second: u64,
    deviating: &Deviating,
    before: &BTreeMap<Scope, Sent>,
    sent: &BTreeMap<Scope, Sent>,
) -> Row {
    let spread = |apart: &[Apart]| Spread::of(apart.iter().map(|apart| apart.by_m));
    let (bodies, avatars) = (spread(&deviating.bodies), spread(&deviating.avatars));
    let ghosts = Spread::of(deviating.ghosts.iter().copied());
    let bytes_s = |scope| bytes(sent, scope) - bytes(before, scope);
    Row {
        setting: setting.name.to_owned(),
        second,
        bodies_mean_m: bodies.mean_m,
        bodies_p99_m: bodies.p99_m,
        bodies_max_m: bodies.max_m,
        avatars_mean_m: avatars.mean_m,
        avatars_max_m: avatars.max_m,
        ghosts_mean_m: ghosts.mean_m,
        ghosts_max_m: ghosts.max_m,
        claimed: deviating.claimed,
        apart_ms: deviating.apart.as_secs_f64() * 1e3,
        between_bytes_s: bytes_s(Scope::BetweenGroups),
        inside_bytes_s: bytes_s(Scope::InsideGroups) + bytes_s(Scope::Borders),
        server_bytes_s: bytes_s(Scope::Server),
        client_bytes_s: bytes_s(Scope::Clients),
    }
}

fn summary(setting: &Setting, seconds: u64, rows: &[Row], all: &[Deviating]) -> Summary {
    let spread =
        |of: fn(&Deviating) -> &Vec<Apart>| Spread::of(all.iter().flat_map(of).map(|apart| apart.by_m));
    let bodies = spread(|deviating| &deviating.bodies);
    let avatars = spread(|deviating| &deviating.avatars);
    let ghosts = Spread::of(all.iter().flat_map(|deviating| &deviating.ghosts).copied());
    let mean = |of: fn(&Row) -> u64| rows.iter().map(of).sum::<u64>() / rows.len() as u64;
    Summary {
        setting: setting.name.to_owned(),
        seconds,
        threshold_m: setting.between_groups_m,
        lag_ticks: match setting.protocol {
            SyncProtocol::Synchronised => 0,
            SyncProtocol::Unsynchronised { lag_ticks } => lag_ticks.into(),
        },
        bodies_mean_m: bodies.mean_m,
        bodies_p99_m: bodies.p99_m,
        bodies_max_m: bodies.max_m,
        avatars_mean_m: avatars.mean_m,
        avatars_p99_m: avatars.p99_m,
        avatars_max_m: avatars.max_m,
        ghosts_mean_m: ghosts.mean_m,
        ghosts_p99_m: ghosts.p99_m,
        ghosts_max_m: ghosts.max_m,
        between_bytes_s: mean(|row| row.between_bytes_s),
        inside_bytes_s: mean(|row| row.inside_bytes_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrections_keep_groups_within_the_threshold_and_without_them_they_part() {
        let [corrected, not_corrected, ..] = SETTINGS;
        let p99_m = |setting| measure(&setting, 60, 1).unwrap().1.bodies_p99_m;
        let limit_m = f64::from(corrected.between_groups_m);
        assert!(p99_m(not_corrected) > limit_m);
        assert!(p99_m(corrected) < limit_m);
    }
}
