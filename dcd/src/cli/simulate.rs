//! Implements `dcd simulate`: runs whole clusters in virtual time, under faults, from seeds.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::common::{Common, print};
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::replay::RECORDING;
use crate::sim::{
    ContactScene, FaultProfile, Quantity, Row, Schedule, Tape, TrialConfig, run_trial, simulate,
};

/// Runs whole clusters in virtual time, under faults, and checks that nothing is lost, doubled or thrown about
///
/// Runs the same state machines as over the network, with simulated processes, clocks, disks and links. Each
/// run comes from one seed: a seed that fails prints what happened, and fails again.
///
/// Examples:
///   dcd simulate
///   dcd simulate --faults kill-leader --seeds 0..1000
///   dcd simulate --faults table --seeds 0..1000        (an hour: the fault table)
///   dcd simulate --faults all --seeds 17..18 --timeline
///   dcd simulate --faults kill-node --scene contact    (Rapier: bodies that touch across borders)
#[derive(clap::Args)]
#[command(verbatim_doc_comment, after_long_help = profiles())]
pub(super) struct Simulate {
    /// The seeds, from A up to but without B
    #[arg(long, value_name = "A..B", default_value = "0..100", value_parser = seeds)]
    seeds: Range<u64>,
    /// Nodes of each cluster
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    nodes: u32,
    /// Clients of each cluster, with an avatar each
    #[arg(long, value_name = "M", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=64))]
    clients: u32,
    /// The faults, see below; each gives a row of its own
    #[arg(long, value_name = "NAME", default_value = "all", value_delimiter = ',', value_parser = named)]
    faults: Vec<Profiles>,
    /// The worlds that are computed, see below; each gives a row of its own
    #[arg(long, value_name = "NAME", default_value = FLYING, value_delimiter = ',', value_parser = scenes)]
    scene: Vec<Scenes>,
    /// Print what happened even if nothing failed; for one seed only
    #[arg(long, conflicts_with = "json")]
    timeline: bool,
    /// Record the nodes of runs that fail, and those of a single seed in any case, into a folder per run, for
    /// `dcd replay`
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Print one JSON object per row
    #[arg(long)]
    json: bool,
}

/// A profile, or several by one name.
#[derive(Clone)]
struct Profiles(Vec<FaultProfile>);

/// The name of the world without contacts.
const FLYING: &str = "flying";

/// A scene, or several by one name; `None`: bodies that fly straight on.
#[derive(Clone)]
struct Scenes(Vec<Option<ContactScene>>);

impl Simulate {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let interrupt = Interrupt::listen()?;
        let config = TrialConfig { nodes: self.nodes, clients: self.clients, ..TrialConfig::default() };
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let profiles: Vec<_> = self.faults.iter().flat_map(|profiles| profiles.0.iter().copied()).collect();
        let scenes: Vec<_> = self.scene.iter().flat_map(|scenes| scenes.0.iter().copied()).collect();
        let rows: Vec<_> =
            profiles.iter().flat_map(|&profile| scenes.iter().map(move |&scene| (profile, scene))).collect();
        let count = self.seeds.end - self.seeds.start;
        if self.timeline && count > 1 {
            let range = format!("{0}..{1}", self.seeds.start, self.seeds.start + 1);
            return Err(Failure::usage(format!("--timeline is of one seed; write --seeds {range}")));
        }
        if let Some(folder) = &self.record {
            check_new(folder, &rows, &self.seeds)?;
        }
        let bar = common.progress(count * rows.len() as u64, "runs", self.json);
        // A state machine that panics is a violation, which is reported with its seed.
        std::panic::set_hook(Box::new(|_| {}));
        if !self.json {
            print(&heading())?;
        }
        let mut holds = true;
        let single = (count == 1).then_some(self.seeds.start);
        for (profile, scene) in rows {
            let config = TrialConfig { begin: scene.map_or(config.begin, ContactScene::begin), ..config };
            let began = Instant::now();
            let goes_on = || {
                bar.inc(1);
                !interrupt.asked()
            };
            let row = simulate(&config, profile, self.seeds.clone(), threads, &goes_on);
            holds &= row.holds();
            bar.suspend(|| self.show(&Told::new(&row, scene, began.elapsed()), &row))?;
            if self.timeline && row.failures.is_empty() {
                let seed = self.seeds.start;
                print(&run_trial(&config, profile, seed, &profile.schedule(seed)).timeline.to_string())?;
            }
            if let Some(folder) = &self.record {
                for (seed, schedule) in kept(&row, single) {
                    let config = TrialConfig { record: true, ..config };
                    let tapes = run_trial(&config, profile, seed, &schedule).tapes;
                    let folder = folder.join(format!("{}{seed}", prefix((profile, scene))));
                    keep(&folder, &tapes)?;
                    common.say(&format!("recorded: dcd replay {} --check", folder.display()));
                }
            }
            if interrupt.asked() {
                break;
            }
        }
        bar.finish_and_clear();
        drop(std::panic::take_hook());
        Ok(if holds { interrupt.exit_code() } else { ExitCode::FAILURE })
    }

    fn show(&self, told: &Told, row: &Row) -> Result<(), Failure> {
        if self.json {
            let text = serde_json::to_string(told)
                .map_err(|error| Failure::run(format!("cannot write JSON: {error}; leave --json out")))?;
            return print(&text);
        }
        print(&line(told))?;
        for failure in &row.failures {
            print(&format!("\n{} fails, {failure}", row.profile))?;
        }
        let promise = row.profile.promise();
        if let Some((bound, ms)) = promise.staleness.zip(row.staleness_ms)
            && !promise.is_fresh(row.staleness_ms)
        {
            let (profile, bound_ms) = (row.profile, bound.as_millis());
            print(&format!(
                "\n{profile} fails: p99 of what clients saw is {ms} ms old, where {bound_ms} is the most"
            ))?;
        }
        Ok(())
    }
}

/// Returns the name of the folder for the recordings of a run, without its seed.
fn prefix((profile, scene): (FaultProfile, Option<ContactScene>)) -> String {
    let scene = scene.map(|scene| format!("-{scene}")).unwrap_or_default();
    format!("{profile}{scene}-")
}

/// Refuses a folder that has recordings of one of these runs: mixed, the recordings of two runs would be of
/// neither.
fn check_new(
    record: &Path,
    rows: &[(FaultProfile, Option<ContactScene>)],
    seeds: &Range<u64>,
) -> Result<(), Failure> {
    let prefixes: Vec<_> = rows.iter().copied().map(prefix).collect();
    let is_of = |name: &str| {
        let seed = |prefix: &String| name.strip_prefix(prefix)?.parse().ok();
        prefixes.iter().filter_map(seed).any(|seed: u64| seeds.contains(&seed))
    };
    // A folder that does not exist or cannot be read is reported when it is written to.
    let entries = fs::read_dir(record).into_iter().flatten().flatten();
    match entries
        .map(|entry| entry.path())
        .find(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_of))
    {
        Some(path) => Err(Failure::usage(format!(
            "{} is there already, perhaps the recording of what went wrong; move it, or record to another folder",
            path.display()
        ))),
        None => Ok(()),
    }
}

/// Returns the runs that are to be recorded: those that failed, as they were printed, and a single one in any case.
fn kept(row: &Row, single: Option<u64>) -> Vec<(u64, Schedule)> {
    let failed = row.failures.iter().map(|failure| (failure.seed, failure.schedule.clone()));
    let is_new = |seed: &u64| row.failures.iter().all(|failure| failure.seed != *seed);
    let single = single.filter(is_new).map(|seed| (seed, row.profile.schedule(seed)));
    failed.chain(single).collect()
}

/// Writes the recordings of a run.
fn keep(folder: &Path, tapes: &BTreeMap<String, Tape>) -> Result<(), Failure> {
    let write = || {
        fs::create_dir_all(folder)?;
        tapes
            .iter()
            .try_for_each(|(name, tape)| fs::write(folder.join(format!("{name}.{RECORDING}")), tape.bytes()))
    };
    write().map_err(|error| {
        let folder = folder.display();
        Failure::run(format!(
            "cannot write to {folder}: {error}; check the path, its permissions and the disk"
        ))
    })
}

/// A row of the fault table, for programs.
#[derive(Serialize)]
struct Told {
    faults: &'static str,
    scene: &'static str,
    seeds: u64,
    violations: u64,
    worst_recovery_ms: u64,
    worst_pause_ms: u64,
    worst_rewind_ms: u64,
    staleness_p99_ms: Option<u32>,
    transfers: u64,
    evictions: u64,
    elections: u64,
    messages: u64,
    bytes: u64,
    /// The worst value of each quantity of bodies that touch, as a share of its gate.
    of_gate: BTreeMap<&'static str, f64>,
    #[serde(skip)]
    greatest: Option<f64>,
    simulated_s: f64,
    wall_s: f64,
    holds: bool,
    failures: Vec<ToldFailure>,
}

/// A seed that failed.
#[derive(Serialize)]
struct ToldFailure {
    seed: u64,
    violation: String,
    faults: Vec<String>,
    timeline: Vec<(f64, String)>,
}

impl Told {
    fn new(row: &Row, scene: Option<ContactScene>, wall: Duration) -> Self {
        let failures = row.failures.iter().map(|failure| ToldFailure {
            seed: failure.seed,
            violation: failure.violation.to_string(),
            faults: failure.schedule.faults.iter().map(ToString::to_string).collect(),
            timeline: failure
                .timeline
                .entries()
                .map(|(time, what)| (time.as_secs_f64(), what.to_owned()))
                .collect(),
        });
        Self {
            faults: row.profile.name(),
            scene: scene.map_or(FLYING, ContactScene::name),
            seeds: row.seeds,
            violations: row.violations,
            worst_recovery_ms: row.worst_recovery.as_millis() as u64,
            worst_pause_ms: row.worst_pause.as_millis() as u64,
            worst_rewind_ms: row.worst_rewind.as_millis() as u64,
            staleness_p99_ms: row.staleness_ms,
            transfers: row.tally.transfers,
            evictions: row.tally.evictions,
            elections: row.tally.elections,
            messages: row.traffic.messages,
            bytes: row.traffic.bytes,
            of_gate: Quantity::ALL
                .into_iter()
                .filter(|_| scene.is_some())
                .map(|quantity| (quantity.name(), row.strain.of(quantity)))
                .collect(),
            greatest: scene.map(|_| row.strain.greatest()),
            simulated_s: row.simulated.as_secs_f64(),
            wall_s: wall.as_secs_f64(),
            holds: row.holds(),
            failures: failures.collect(),
        }
    }
}

fn heading() -> String {
    format!(
        "{:<13}{:>7}{:>6}{:>11}{:>13}{:>10}{:>11}{:>11}{:>10}{:>10}{:>10}{:>11}{:>8}{:>9}{:>8}",
        "faults",
        "scene",
        "seeds",
        "violations",
        "recovery ms",
        "pause ms",
        "rewind ms",
        "stale ms",
        "transfers",
        "evictions",
        "elections",
        "messages",
        "MB",
        "of gate",
        "wall s"
    )
}

fn line(row: &Told) -> String {
    format!(
        "{:<13}{:>7}{:>6}{:>11}{:>13}{:>10}{:>11}{:>11}{:>10}{:>10}{:>10}{:>11}{:>8}{:>9}{:>8.1}",
        row.faults,
        row.scene,
        row.seeds,
        row.violations,
        row.worst_recovery_ms,
        row.worst_pause_ms,
        row.worst_rewind_ms,
        row.staleness_p99_ms.map_or("-".to_owned(), |ms| ms.to_string()),
        row.transfers,
        row.evictions,
        row.elections,
        row.messages,
        row.bytes / 1_000_000,
        row.greatest.map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share)),
        row.wall_s
    )
}

fn seeds(text: &str) -> Result<Range<u64>, String> {
    let wrong = || "write a range of seeds, as 0..1000 or 17..18".to_owned();
    let (from, to) = text.split_once("..").ok_or_else(wrong)?;
    let (from, to) = (from.parse().map_err(|_| wrong())?, to.parse().map_err(|_| wrong())?);
    if from < to { Ok(from..to) } else { Err(wrong()) }
}

fn named(name: &str) -> Result<Profiles, String> {
    use FaultProfile::{
        KillLeader, KillNode, KillServer, Loss1, Loss5, Loss20, OneWay, Partition1, Partition5, Partition30,
    };
    Ok(Profiles(match name {
        "table" => FaultProfile::TABLE.to_vec(),
        "loss" => vec![Loss1, Loss5, Loss20],
        "partition" => vec![Partition1, Partition5, Partition30, OneWay],
        "crash" => vec![KillNode, KillLeader, KillServer],
        name => vec![name.parse().map_err(|error| format!("{error}; or loss, partition, crash, table"))?],
    }))
}

fn scenes(name: &str) -> Result<Scenes, String> {
    Ok(Scenes(match name {
        FLYING => vec![None],
        "contact" => ContactScene::ALL.map(Some).to_vec(),
        name => vec![Some(name.parse().map_err(|error| format!("{error}; or {FLYING}, contact"))?)],
    }))
}

fn profiles() -> String {
    let rows: Vec<_> = FaultProfile::TABLE
        .iter()
        .map(|profile| format!("  {:<13} {}", profile.name(), profile.summary()))
        .collect();
    let scenes: Vec<_> =
        ContactScene::ALL.iter().map(|scene| format!("  {:<13} {}", scene.name(), scene.summary())).collect();
    format!(
        "Faults:\n{}\n  loss, partition, crash: those rows; table: every row\n\n\
         recovery ms: the longest time from a fault, or its end, until the group computed on; pause ms: the longest without a \
         tick;\nrewind ms: the most that a group went back, as none was left who had computed it; stale ms: 99 % of what clients saw of their avatars was younger. Exit code 1 if anything was violated.\n\n\
         Scenes:\n  {FLYING:<13} bodies that fly straight on, without any physics\n{}\n  contact: the last three\n\n\
         Those are computed by Rapier. Once all is well, what stands has to stand, joints to hold, bodies to overlap no more, and the world \
         to have no more energy\nthan at its beginning. A crowd has to keep its momentum at all times, and what touches nothing to fly on, \
         as without Rapier. Gates are three times what\none undisturbed world of the same bodies, cut into the same regions, shows in 20 s (of a stack \
         in 60 s), and what borders may add; of gate: how near\nthe worst came.",
        rows.join("\n"),
        scenes.join("\n")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{self, Timeline, Violation};

    #[test]
    fn seeds_are_a_range_that_holds_some() {
        assert_eq!(seeds("3..5"), Ok(3..5));
        for wrong in ["", "5", "5..5", "6..5", "a..b", "-1..3"] {
            assert!(seeds(wrong).unwrap_err().contains("0..1000"), "{wrong}");
        }
    }

    #[test]
    fn a_single_run_that_failed_is_recorded_as_it_was_printed_and_one_that_did_not_as_it_was() {
        let profile = FaultProfile::KillNode;
        let row = simulate(&TrialConfig::default(), profile, 7..8, 1, &|| false);
        let seeds = |row: &Row| -> Vec<_> {
            let faults = |(seed, schedule): (u64, Schedule)| (seed, schedule.faults.len());
            kept(row, Some(7)).into_iter().map(faults).collect()
        };
        assert_eq!(seeds(&row), [(7, 3)]);
        let shrunk = Schedule { faults: Vec::new(), ..profile.schedule(7) };
        let violation = Violation::Panicked("say".to_owned());
        let failure = sim::Failure { seed: 7, violation, schedule: shrunk, timeline: Timeline::default() };
        assert_eq!(seeds(&Row { failures: vec![failure], ..row }), [(7, 0)]);
    }

    #[test]
    fn scenes_go_by_name_or_all_together() {
        assert_eq!(scenes("stack").map(|found| found.0), Ok(vec![Some(ContactScene::Stack)]));
        assert_eq!(scenes("flying").map(|found| found.0), Ok(vec![None]));
        assert_eq!(scenes("contact").map(|found| found.0.len()), Ok(ContactScene::ALL.len()));
        assert!(scenes("heap").err().unwrap().contains("stack, chain, crowd; or flying, contact"));
    }

    #[test]
    fn faults_go_by_row_by_kind_or_all_together() {
        assert_eq!(named("stop").map(|found| found.0), Ok(vec![FaultProfile::Stop]));
        assert_eq!(named("table").map(|found| found.0.len()), Ok(FaultProfile::TABLE.len()));
        assert!(named("lightning").err().unwrap().contains("kill-leader"));
    }
}
