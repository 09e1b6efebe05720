//! Runs every fuzz target on its seeds and on some hundred changes of them: a quick look, on any toolchain. The long one is
//! `fuzz/run`.

use std::panic::{AssertUnwindSafe, catch_unwind};

use dcd_tests::fuzz::{TARGETS, Target, changed, target};

/// Runs seeds, and so many changes of them; names the seed of the first that fails.
fn run(name: &str, changes: u64) {
    let Target { form, run, seeds, .. } = *target(name).expect("it is a target");
    let seeds = seeds();
    assert!(!seeds.is_empty() && seeds.iter().all(|seed| !seed.is_empty()), "{name} has seeds");
    for (index, seed) in seeds.iter().enumerate() {
        assert!(catch_unwind(|| run(seed)).is_ok(), "{name}: seed {index} fails as it is");
    }
    let first = std::env::var("FUZZ_FROM").map_or(0, |text| text.parse().unwrap());
    let changes = std::env::var("FUZZ_CHANGES").map_or(changes, |text| text.parse().unwrap());
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
    run("message", 100_000);
}

#[test]
fn states_takes_what_nobody_sends() {
    run("states", 2_000);
}

#[test]
fn joining_takes_what_nobody_sends() {
    run("joining", 20_000);
}

#[test]
fn scene_takes_what_nobody_sends() {
    run("scene", 500);
}

#[test]
fn model_takes_what_nobody_sends() {
    run("model", 500);
}

#[test]
fn snapshot_takes_what_nobody_sends() {
    run("snapshot", 500);
}

#[test]
fn recording_takes_what_nobody_sends() {
    run("recording", 200);
}

#[test]
fn directory_takes_what_nobody_sends() {
    run("directory", 2_000);
}

#[test]
fn server_takes_what_nobody_sends() {
    run("server", 1_000);
}

#[test]
fn client_takes_what_nobody_sends() {
    run("client", 2_000);
}

#[test]
fn leader_takes_what_nobody_sends() {
    run("leader", 1_000);
}

#[test]
fn member_takes_what_nobody_sends() {
    run("member", 1_000);
}

#[test]
fn device_takes_what_nobody_sends() {
    run("device", 200);
}

#[test]
fn rules_takes_what_nobody_sends() {
    run("rules", 5_000);
}
