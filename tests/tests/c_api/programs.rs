//! The examples say what they should, and misuse gets its codes: bare, under the sanitizers, and under valgrind.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::toolchain::{STRICT, build, compiler, is_installed, root, run_well};

fn example(name: &str) -> PathBuf {
    root().join("examples-c").join(name)
}

fn checker(name: &str) -> PathBuf {
    root().join("tests/tests/c_api").join(name)
}

/// A program that stops at the first finding of AddressSanitizer, LeakSanitizer or UndefinedBehaviorSanitizer.
pub(crate) const SANITIZED: [&str; 3] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-O1"];

fn run_example(name: &str, flags: &[&str]) -> String {
    let dir = tempfile::tempdir().unwrap();
    run_well(&mut Command::new(build(&example(name), dir.path(), flags)))
}

#[test]
fn hello_stacks_its_boxes_where_two_regions_meet() {
    let said = run_example("hello.c", &[]);
    for i in 0..5 {
        let line =
            said.lines().find(|line| line.starts_with(&format!("box {i}: "))).expect("each box has a line");
        let y: f64 =
            line.split(" = ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
        assert!((y - (f64::from(i) + 0.5)).abs() < 0.02, "{said}");
        // Boxes of both regions that touch are computed by one of them.
        assert!(line.contains(" m, 1000 kg, region 1") && line.ends_with("asleep"), "{said}");
    }
    assert!(said.contains("ticks        240\n"), "{said}");
}

#[test]
fn game_loop_sees_contacts_and_transfers_and_draws_between_steps() {
    let said = run_example("game_loop.c", &[]);
    let last = said.lines().last().expect("it says something");
    let numbers: Vec<u32> =
        last.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect();
    let [frames, steps, began, ended, transfers] = numbers[..] else { panic!("{said}") };
    assert_eq!(frames, 300);
    // 300 frames of 1/75 s and six of three times that, in steps of 1/60 s.
    assert_eq!(steps, 249, "{said}");
    assert!(began >= 16 && ended < began, "16 balls fall on the ground and some bounce: {said}");
    assert!(transfers > 0, "balls roll across the borders: {said}");
    assert!(said.contains("ball 0 is 0.25 m above something"), "{said}");
}

/// Runs a program that counts its own checks.
fn run_checker(name: &str) {
    let dir = tempfile::tempdir().unwrap();
    let said = run_well(&mut Command::new(build(&checker(name), dir.path(), &[])));
    assert!(said.contains(" checks, 0 failures"), "{said}");
}

#[test]
fn functions_do_what_the_header_says() {
    run_checker("behaviour.c");
}

#[test]
fn misuse_gets_its_documented_codes() {
    run_checker("misuse.c");
}

/// `wrapper.cpp`, which goes without exceptions, with `throwing.cpp` in the same program.
fn build_wrapper(out: &Path, flags: &[&str]) -> PathBuf {
    let thrower = out.join("throwing.o");
    let mut cxx = compiler("CXX", "c++");
    cxx.arg("-std=c++17").args(STRICT).args(flags).arg("-c").arg(checker("throwing.cpp"));
    run_well(cxx.arg("-o").arg(&thrower));
    let thrower = thrower.display().to_string();
    build(&checker("wrapper.cpp"), out, &[&["-fno-exceptions", &thrower], flags].concat())
}

#[test]
fn the_cpp_header_does_what_it_says() {
    for dialect in ["-std=c++17", "-std=c++20"] {
        let dir = tempfile::tempdir().unwrap();
        let said = run_well(&mut Command::new(build_wrapper(dir.path(), &[dialect])));
        assert!(said.contains(" checks, 0 failures"), "{said}");
    }
}

#[test]
fn sanitizers_find_nothing_in_the_programs() {
    let dir = tempfile::tempdir().unwrap();
    run_well(&mut Command::new(build_wrapper(dir.path(), &SANITIZED)));
    for source in [checker("misuse.c"), checker("behaviour.c"), example("hello.c"), example("game_loop.c")] {
        run_well(&mut Command::new(build(&source, dir.path(), &SANITIZED)));
    }
}

#[test]
fn random_calls_find_no_bug() {
    let dir = tempfile::tempdir().unwrap();
    let program = build(&checker("random_calls.c"), dir.path(), &SANITIZED);
    for seed in 1..=8 {
        run_well(Command::new(&program).args([seed.to_string(), "5000".to_owned()]));
    }
}

#[test]
fn valgrind_finds_nothing_in_the_programs() {
    if !is_installed("valgrind") {
        eprintln!("valgrind is not installed: nothing checked");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    for source in [checker("misuse.c"), checker("behaviour.c"), example("hello.c")] {
        let mut valgrind = Command::new("valgrind");
        valgrind.args([
            "--quiet",
            "--error-exitcode=9",
            "--leak-check=full",
            "--errors-for-leak-kinds=definite",
        ]);
        valgrind.arg(format!("--suppressions={}", root().join("tests/tests/c_api/valgrind.supp").display()));
        run_well(valgrind.arg(build(&source, dir.path(), &[])));
    }
}

#[test]
fn the_makefile_builds_the_examples() {
    if !is_installed("make") {
        eprintln!("make is not installed: nothing checked");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let mut make = Command::new("make");
    make.current_dir(root().join("examples-c"));
    make.arg(format!("LIB={}", crate::toolchain::library_dir().join("libdcd_ffi.a").display()));
    make.arg(format!("BUILD={}", dir.path().join("made").display()));
    run_well(&mut make);
    assert!(run_well(&mut Command::new(dir.path().join("made/hello"))).contains("box 4"));
}
