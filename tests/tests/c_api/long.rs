//! Tests what takes too long for every run: random calls, and data races of threads:
//! `cargo test -p dcd-tests --test c_api long -- --ignored`.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::programs::{SANITIZED, checker};
use crate::toolchain::{build, build_with, forget_cargo, root, run_well};

#[test]
#[ignore = "ten minutes"]
fn random_calls_find_no_bug_in_ten_minutes() {
    let dir = tempfile::tempdir().unwrap();
    let program = build(&checker("random_calls.c"), dir.path(), &SANITIZED);
    let start = Instant::now();
    // Seeds that other tests do not use.
    for seed in 1_000_u64.. {
        let said = run_well(Command::new(&program).args([seed.to_string(), "50000".to_owned()]));
        println!("{:>4} s, seed {seed}: {}", start.elapsed().as_secs(), said.trim());
        if start.elapsed() > Duration::from_secs(600) {
            break;
        }
    }
}

/// Builds everything again under ThreadSanitizer, including Rust's standard library: with an uninstrumented
/// one, ThreadSanitizer would report races that do not exist.
#[test]
#[ignore = "builds all crates anew; needs a nightly Rust with the component rust-src"]
fn threads_race_nowhere() {
    let dir = tempfile::tempdir().unwrap();
    let target = "x86_64-unknown-linux-gnu";
    let mut cargo = Command::new("cargo");
    cargo.current_dir(root()).env("RUSTFLAGS", "-Zsanitizer=thread").env("RUSTUP_TOOLCHAIN", "nightly");
    cargo.args(["build", "--package", "dcd-ffi", "-Zbuild-std", "--target", target, "--target-dir"]);
    let built = root().join("target/race");
    assert!(forget_cargo(&mut cargo).arg(&built).status().unwrap().success(), "it does not build");
    let library = built.join(target).join("debug/libdcd_ffi.a");
    let lacking = checker("races.c");
    // ThreadSanitizer does not see a memcpy that the compiler inlines.
    let flags = ["-fsanitize=thread", "-O1", "-fno-builtin", lacking.to_str().unwrap()];
    let program = build_with(&checker("misuse.c"), dir.path(), &flags, &library);
    run_well(Command::new(program).current_dir(dir.path()));
}
