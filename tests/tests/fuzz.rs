//! Runs every fuzz target on its seeds and on some hundred mutations of them: a quick run, on any toolchain.
//! The long runs are `a_number_of_changes_by_many_processes` below and `fuzz/run`.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use dcd_tests::fuzz::{TARGETS, Target, changed, target};

/// Runs a target on its seeds and on mutations of them, and names the inputs that fail.
fn run(name: &str) {
    let Target { form, run, seeds, quick, .. } = *target(name).expect("it is a target");
    let seeds = seeds();
    assert!(!seeds.is_empty() && seeds.iter().all(|seed| !seed.is_empty()), "{name} has seeds");
    for (index, seed) in seeds.iter().enumerate() {
        assert!(catch_unwind(|| run(seed)).is_ok(), "{name}: seed {index} fails as it is");
    }
    let (first, changes) = (asked("FUZZ_FROM").unwrap_or(0), asked("FUZZ_CHANGES").unwrap_or(quick));
    let mut failed = Vec::new();
    for number in first..first + changes {
        let of = |step: u64| &seeds[(number / step) as usize % seeds.len()];
        let input = changed(of(1), of(seeds.len() as u64), form, number);
        if catch_unwind(AssertUnwindSafe(|| run(&input))).is_err() {
            failed.push(number);
        }
    }
    assert!(failed.is_empty(), "{name}: changes {failed:?} fail");
}

/// Returns the number in an environment variable.
fn asked(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{variable} is a number")))
}

/// Writes the seeds for libFuzzer below the folder that `FUZZ_CORPUS` names.
#[test]
fn seeds_are_written_where_wanted() {
    let Some(folder) = std::env::var_os("FUZZ_CORPUS").map(std::path::PathBuf::from) else { return };
    for target in &TARGETS {
        let folder = folder.join(target.name);
        std::fs::create_dir_all(&folder).unwrap();
        for (index, seed) in (target.seeds)().into_iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{index}")), seed).unwrap();
        }
    }
}

#[test]
fn message_takes_what_nobody_sends() {
    run("message");
}

#[test]
fn states_takes_what_nobody_sends() {
    run("states");
}

#[test]
fn joining_takes_what_nobody_sends() {
    run("joining");
}

#[test]
fn scene_takes_what_nobody_sends() {
    run("scene");
}

#[test]
fn model_takes_what_nobody_sends() {
    run("model");
}

#[test]
fn snapshot_takes_what_nobody_sends() {
    run("snapshot");
}

#[test]
fn recording_takes_what_nobody_sends() {
    run("recording");
}

#[test]
fn directory_takes_what_nobody_sends() {
    run("directory");
}

#[test]
fn server_takes_what_nobody_sends() {
    run("server");
}

#[test]
fn client_takes_what_nobody_sends() {
    run("client");
}

#[test]
fn leader_takes_what_nobody_sends() {
    run("leader");
}

#[test]
fn member_takes_what_nobody_sends() {
    run("member");
}

#[test]
fn device_takes_what_nobody_sends() {
    run("device");
}

#[test]
fn rules_takes_what_nobody_sends() {
    run("rules");
}

#[test]
fn page_takes_what_nobody_sends() {
    run("page");
}

#[test]
fn config_takes_what_nobody_sends() {
    run("config");
}

/// Each target must be run by a test of its name, here and in the processes of a long run.
#[test]
fn every_target_has_a_test() {
    let text = include_str!("fuzz.rs");
    for Target { name, .. } in TARGETS {
        assert!(
            text.contains(&format!("fn {name}_takes_what_nobody_sends() {{\n    run(\"{name}\");")),
            "{name}"
        );
        let program = format!("../fuzz/fuzz_targets/{name}.rs");
        assert!(
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(program).exists(),
            "{name} has no program"
        );
    }
}

/// The mutations of one target that one process tries.
#[derive(Clone, Copy)]
struct Share {
    target: Target,
    from: u64,
    changes: u64,
}

impl Share {
    /// The number of quick runs in a share, chosen to take a minute or two.
    const QUICK_LOOKS: u64 = 100;
    /// The time after which a share counts as an endless loop.
    const LIMIT: Duration = Duration::from_secs(3600);

    /// Divides a number of mutations among targets in the proportion of quick runs, and each target's into
    /// shares. The shares alternate between targets, so all targets come soon.
    fn of(total: u64, from: u64) -> Vec<Self> {
        let quick: u64 = TARGETS.iter().map(|target| target.quick).sum();
        let of_target = |target: Target| {
            let end = from + (u128::from(total) * u128::from(target.quick)).div_ceil(quick.into()) as u64;
            let step = (Self::QUICK_LOOKS * target.quick) as usize;
            let share = move |from: u64| Self { target, from, changes: (end - from).min(step as u64) };
            (from..end).step_by(step).map(share).enumerate()
        };
        let mut shares: Vec<_> = TARGETS.into_iter().flat_map(of_target).collect();
        shares.sort_by_key(|(turn, _)| *turn);
        shares.into_iter().map(|(_, share)| share).collect()
    }

    /// Tries the share in a process of its own, which its inputs may also end. Returns the end of that
    /// process's output if it fails.
    fn try_all(&self) -> Result<(), String> {
        let Self { target, from, changes } = self;
        let log = tempfile::tempfile().unwrap();
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", &format!("{}_takes_what_nobody_sends", target.name), "--nocapture"])
            .env("FUZZ_FROM", from.to_string())
            .env("FUZZ_CHANGES", changes.to_string())
            .stdin(Stdio::null())
            .stdout(log.try_clone().unwrap())
            .stderr(log.try_clone().unwrap())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        let ended = loop {
            match process.try_wait().unwrap() {
                Some(status) if status.success() => return Ok(()),
                Some(status) => break status.to_string(),
                None if begun.elapsed() > Self::LIMIT => {
                    let _ = process.kill();
                    let _ = process.wait();
                    break format!("not done after {:?}", Self::LIMIT);
                }
                None => std::thread::sleep(Duration::from_millis(20)),
            }
        };
        let said = said(log).unwrap_or_default();
        Err(format!("{}, {changes} changes from {from} on: {ended}\n{said}", target.name))
    }
}

/// Returns the end of a process's output.
fn said(mut log: std::fs::File) -> std::io::Result<String> {
    use std::io::{Read, Seek, SeekFrom};
    let length = log.seek(SeekFrom::End(0))?;
    log.seek(SeekFrom::Start(length.saturating_sub(2_000)))?;
    let mut bytes = Vec::new();
    log.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Tries `FUZZ_CHANGES` mutations of all targets together, from number `FUZZ_FROM` on, by `FUZZ_PROCESSES`
/// processes at a time (default: one per core). Prints the progress after each share.
#[test]
#[ignore = "takes as long as one likes: forty minutes for 100,000,000 changes"]
fn a_number_of_changes_by_many_processes() {
    let cores = || std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
    let total = asked("FUZZ_CHANGES").unwrap_or(100_000_000);
    let shares = Share::of(total, asked("FUZZ_FROM").unwrap_or(0));
    let (all, queue) =
        (shares.iter().map(|share| share.changes).sum::<u64>(), Mutex::new(VecDeque::from(shares)));
    let (start, done) = (Instant::now(), Mutex::new((0, Vec::new())));
    std::thread::scope(|scope| {
        for _ in 0..asked("FUZZ_PROCESSES").unwrap_or_else(cores) {
            scope.spawn(|| {
                while let Some(share) = { queue.lock().unwrap().pop_front() } {
                    let failed = share.try_all().err();
                    let (changes, failures) = &mut *done.lock().unwrap();
                    *changes += share.changes;
                    failed.iter().for_each(|failure| println!("{failure}"));
                    failures.extend(failed);
                    let hours = start.elapsed().as_secs_f64() / 3600.0;
                    let left = hours * (all - *changes) as f64 / *changes as f64;
                    println!(
                        "{changes} of {all} changes in {hours:.2} h, {} shares failed; some {left:.2} h left",
                        failures.len()
                    );
                }
            });
        }
    });
    let (_, failures) = done.into_inner().unwrap();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn shares_are_all_changes_once() {
    for (total, from) in [(100_000_000, 7), (1, 0), (12_345, 1 << 40)] {
        let shares = Share::of(total, from);
        for target in TARGETS {
            let mut next = from;
            for share in shares.iter().filter(|share| share.target.name == target.name) {
                assert!(share.from == next && share.changes > 0, "{} from {next} on", target.name);
                next += share.changes;
            }
            assert!(next > from, "{} has a share", target.name);
        }
        let all: u64 = shares.iter().map(|share| share.changes).sum();
        assert!((total..total + TARGETS.len() as u64).contains(&all), "{all} of {total}");
    }
}
