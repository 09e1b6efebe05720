//! Fills the fault tables: every kind of faults, many seeds each, on whole clusters in virtual time. First
//! with bodies that fly straight on, then over Rapier with scenes whose bodies touch across borders. The
//! results are the same on every machine; the time that they take is not.

mod contact;

use std::error::Error;
use std::ops::Range;
use std::process::ExitCode;
use std::thread::available_parallelism;

use clap::Args;
use dcd::sim::{self, FaultProfile, TrialConfig, simulate};
use indicatif::{ProgressBar, ProgressStyle};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::output::{Output, Sheet, Shown};
use crate::page;
use crate::results::Measured;

const SHOWN: Shown<Row> = Shown { name: "faults", table, picture: None };

/// The numbers of seeds.
#[derive(Args)]
pub(crate) struct Faults {
    #[command(flatten)]
    output: Output,
    /// Only these faults; rows of others stay in the files.
    #[arg(long, value_delimiter = ',', value_name = "FAULTS")]
    faults: Vec<FaultProfile>,
    /// Seeds per row.
    #[arg(long, default_value_t = 1_000, conflicts_with = "quick")]
    seeds: u64,
    /// Seeds per row of each scene whose bodies touch.
    #[arg(long, default_value_t = 200, conflicts_with = "quick")]
    contact_seeds: u64,
}

/// All seeds under one kind of faults.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    faults: String,
    seeds: u64,
    violations: u64,
    worst_recovery_ms: u64,
    worst_pause_ms: u64,
    worst_rewind_ms: u64,
    p99_stale_ms: Option<u32>,
    transfers: u64,
    evictions: u64,
    elections: u64,
    messages: u64,
    mb: u64,
}

impl Faults {
    pub(crate) fn run(self) -> Result<ExitCode, Box<dyn Error>> {
        // By the first seed of many profiles nothing is killed or cut off, by the second something is.
        let [seeds, contact_seeds] = match self.output.quick {
            true => [1..2, 1..2],
            false => [0..self.seeds, 0..self.contact_seeds],
        };
        // A state machine that panics is a violation, which is reported with its seed.
        std::panic::set_hook(Box::new(|_| {}));
        let profiles = if self.faults.is_empty() { &FaultProfile::TABLE } else { &self.faults[..] };
        let rows = self.output.fill(&SHOWN, |rows| {
            self.begin(rows)?;
            measure_all(rows, profiles, seeds)
        })?;
        let contact = self.output.fill(&contact::SHOWN, |rows| {
            self.begin(rows)?;
            contact::measure(rows, profiles, contact_seeds)
        })?;
        drop(std::panic::take_hook());
        let holds = rows.iter().all(|row| row.row.holds()) && contact.iter().all(|row| row.row.holds());
        Ok(if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }

    /// Begins with the rows that are not measured anew.
    fn begin<R: Serialize + DeserializeOwned>(&self, rows: &mut Sheet<R>) -> Result<(), Box<dyn Error>> {
        if self.faults.is_empty() { Ok(()) } else { rows.recall() }
    }
}

fn measure_all(
    rows: &mut Sheet<Row>,
    profiles: &[FaultProfile],
    seeds: Range<u64>,
) -> Result<(), Box<dyn Error>> {
    let bar = bar(profiles.len() as u64 * (seeds.end - seeds.start))?;
    for &profile in profiles {
        bar.set_message(profile.name());
        let row = Row::of(&measure(&TrialConfig::default(), profile, seeds.clone(), &bar));
        let row = rows.measured(row);
        rows.replace(|old| old.faults == profile.name(), [row])?;
    }
    bar.finish_and_clear();
    Ok(())
}

fn bar(runs: u64) -> Result<ProgressBar, Box<dyn Error>> {
    Ok(ProgressBar::new(runs)
        .with_style(ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} runs, {eta}")?))
}

fn measure(config: &TrialConfig, profile: FaultProfile, seeds: Range<u64>, bar: &ProgressBar) -> sim::Row {
    let threads = available_parallelism().map_or(1, usize::from);
    let goes_on = || {
        bar.inc(1);
        true
    };
    let row = simulate(config, profile, seeds, threads, &goes_on);
    for failure in &row.failures {
        bar.suspend(|| eprintln!("{} fails, {failure}", profile.name()));
    }
    row
}

impl Row {
    fn of(row: &sim::Row) -> Self {
        Self {
            faults: row.profile.name().to_owned(),
            seeds: row.seeds,
            violations: row.violations,
            worst_recovery_ms: row.worst_recovery.as_millis() as u64,
            worst_pause_ms: row.worst_pause.as_millis() as u64,
            worst_rewind_ms: row.worst_rewind.as_millis() as u64,
            p99_stale_ms: row.staleness_ms,
            transfers: row.tally.transfers,
            evictions: row.tally.evictions,
            elections: row.tally.elections,
            messages: row.traffic.messages,
            mb: row.traffic.bytes / 1_000_000,
        }
    }

    /// Returns whether nothing was violated, and clients saw nothing older than promised.
    fn holds(&self) -> bool {
        let is_fresh = |profile: FaultProfile| profile.promise().is_fresh(self.p99_stale_ms);
        self.violations == 0 && self.faults.parse().is_ok_and(is_fresh)
    }
}

fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "faults",
        "seeds",
        "violations",
        "worst recovery, s",
        "worst pause, s",
        "worst rewind, s",
        "staleness, p99 ms",
        "transfers",
        "evictions",
        "elections",
    ];
    let seconds = |ms: u64| format!("{:.1}", ms as f64 / 1_000.0);
    let cells = |Measured { row, .. }: &Measured<Row>| {
        vec![
            row.faults.clone(),
            row.seeds.to_string(),
            row.violations.to_string(),
            seconds(row.worst_recovery_ms),
            seconds(row.worst_pause_ms),
            seconds(row.worst_rewind_ms),
            row.p99_stale_ms.map_or("–".to_owned(), |ms| ms.to_string()),
            row.transfers.to_string(),
            row.evictions.to_string(),
            row.elections.to_string(),
        ]
    };
    page::table(&head, rows.iter().map(cells))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_holds_only_if_what_clients_saw_is_as_young_as_promised() {
        let config = TrialConfig::default();
        let row = simulate(&config, FaultProfile::Loss5, 0..1, 1, &|| false);
        let of = |staleness_ms| Row::of(&sim::Row { staleness_ms, ..row.clone() }).holds();
        assert!(of(None) && of(Some(249)) && !of(Some(250)));
        assert!(!Row { violations: 1, ..Row::of(&row) }.holds());
    }
}
