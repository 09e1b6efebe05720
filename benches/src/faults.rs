//! Fills the fault tables: every row of faults, many seeds each, whole clusters in virtual time, first with bodies that fly straight
//! on, then over Rapier with scenes whose bodies touch across borders. What they say is the same on every machine; how long it takes
//! is not.

mod contact;

use std::error::Error;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread::available_parallelism;

use clap::Args;
use dcd::sim::{self, ContactScene, FaultProfile, TrialConfig, simulate};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use crate::machine::Machine;
use crate::page;
use crate::results::{self, Measured};

const FILE: &str = "faults.csv";

/// How many seeds are run.
#[derive(Args)]
pub(crate) struct Faults {
    /// Two seeds a row, and five of each scene whose bodies touch.
    #[arg(long)]
    quick: bool,
    /// Seeds a row.
    #[arg(long, default_value_t = 1_000, conflicts_with = "quick")]
    seeds: u64,
    /// Seeds a row of each scene whose bodies touch.
    #[arg(long, default_value_t = 200, conflicts_with = "quick")]
    contact_seeds: u64,
    /// Where the results go [default: benches/results; with `--quick` a temporary folder].
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Draws the table from the file, without measuring.
    #[arg(long)]
    draw: bool,
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
        let folder = results::folder(self.out.as_deref(), self.quick)?;
        if !self.draw {
            self.measure(&folder)?;
        }
        let rows = results::read_csv(&folder.join(FILE))?;
        let table = table(&rows);
        println!("{table}");
        page::put(&folder, "faults", &table)?;
        let (contact, holds_in_contact) = contact::table(&folder)?;
        println!("{contact}");
        page::put(&folder, "faults-contact", &contact)?;
        let holds = holds_in_contact && rows.iter().all(|row| row.row.violations == 0);
        Ok(if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }

    fn measure(&self, folder: &Path) -> Result<(), Box<dyn Error>> {
        let machine = Machine::here();
        let (seeds, contact_seeds) = if self.quick { (2, 5) } else { (self.seeds, self.contact_seeds) };
        let (seeds, rows) = (0..seeds, FaultProfile::TABLE.len() as u64);
        let runs = rows * (seeds.end + ContactScene::ALL.len() as u64 * contact_seeds);
        let bar = ProgressBar::new(runs)
            .with_style(ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} runs, {eta}")?);
        // A machine that panics is a violation, which is reported with its seed.
        std::panic::set_hook(Box::new(|_| {}));
        let mut rows = Vec::new();
        for profile in FaultProfile::TABLE {
            bar.set_message(profile.name());
            let row = Row::of(&measure(&TrialConfig::default(), profile, seeds.clone(), &bar));
            rows.push(Measured { row, machine: machine.clone() });
            // Whoever stops it keeps the rows that are done.
            results::write_csv(&folder.join(FILE), &rows)?;
        }
        contact::measure(folder, 0..contact_seeds, &machine, &bar)?;
        drop(std::panic::take_hook());
        bar.finish_and_clear();
        Ok(())
    }
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
