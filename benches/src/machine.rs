//! Records where and when something was measured: a figure without its machine says nothing.

use std::process::Command;
use std::thread::available_parallelism;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

/// The machine and commit of a measurement. It stands in every row of every CSV, so that rows of several runs
/// may share a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Machine {
    /// Model of the processor.
    pub(crate) cpu: String,
    /// Cores that this process may use.
    pub(crate) cores: usize,
    /// Day of the run, UTC, as 2026-11-20.
    pub(crate) date: String,
    /// Commit of the sources, with `-dirty` when they differ from it.
    pub(crate) commit: String,
}

impl Machine {
    /// Returns this machine, now.
    pub(crate) fn here() -> Self {
        Self {
            cpu: cpu_model().unwrap_or_else(|| "unknown processor".to_owned()),
            cores: available_parallelism().map_or(1, usize::from),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string()[..10].to_owned(),
            commit: commit().unwrap_or_else(|| "unknown".to_owned()),
        }
    }

    /// Returns the text for captions.
    pub(crate) fn caption(&self) -> String {
        let Self { cpu, cores, date, commit } = self;
        format!("{cpu}, {cores} cores, {date}, commit {commit}")
    }
}

/// Returns the model of the processor. Linux tells it in a file; other systems have no common name for it.
fn cpu_model() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Returns the commit. Changes of results do not make it dirty: else the second of two runs would seem to be
/// of other sources than the first.
fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        Command::new("git").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().ok()
    };
    let head = git(&["rev-parse", "--short", "HEAD"])?;
    let changes = git(&["status", "--porcelain", "--", ":(top)", ":(top,exclude)benches/results"])?;
    let dirty = if changes.stdout.is_empty() { "" } else { "-dirty" };
    head.status.success().then(|| format!("{}{dirty}", String::from_utf8_lossy(&head.stdout).trim()))
}
