//! Runs every fuzz target on its seeds and on some hundred changes of them: a quick look, on any toolchain. The long one is
//! `fuzz/run`.

use std::panic::{AssertUnwindSafe, catch_unwind};

use dcd_tests::fuzz::{TARGETS, Target, changed, target};

/// Runs seeds, and some changes of them; names those that fail.
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

/// The number that a variable of the environment has.
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

/// As each target is tried by a test of its name, here and in the processes of a long look.
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
