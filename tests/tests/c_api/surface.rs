//! Tests the C programs that each check one part of the API: plain, under the sanitizers and under valgrind.

use std::process::Command;

use crate::programs::{SANITIZED, checker, under_valgrind};
use crate::toolchain::{build, run_well};

fn run_both_ways(name: &str) {
    let dir = tempfile::tempdir().unwrap();
    for flags in [&[][..], &SANITIZED] {
        let said = run_well(&mut Command::new(build(&checker(name), dir.path(), flags)));
        assert!(said.contains(" checks, 0 failures"), "{said}");
    }
}

#[test]
fn contacts_and_hits_say_where_how_hard_and_on_what() {
    run_both_ways("touching.c");
}

#[test]
fn joints_that_bear_too_much_are_told_of() {
    run_both_ways("breaking.c");
}

#[test]
fn a_world_is_computed_by_the_programs_own_threads() {
    run_both_ways("jobs.c");
}

#[test]
fn a_program_is_asked_about_contacts() {
    run_both_ways("asked.c");
}

#[test]
fn a_world_is_stepped_otherwise_from_the_next_step_on() {
    run_both_ways("settings.c");
}

#[test]
fn bodies_are_pushed_by_explosions_water_and_wind_and_triggers_list_who_is_inside() {
    run_both_ways("pushing.c");
}

#[test]
fn bodies_and_shapes_are_read_back_as_they_were_made() {
    run_both_ways("looking.c");
}

#[test]
fn valgrind_finds_nothing_in_them() {
    let dir = tempfile::tempdir().unwrap();
    // `jobs` and `settings` would take minutes under valgrind.
    for name in ["touching", "breaking", "asked", "pushing", "looking", "drawing"] {
        let program = build(&checker(&format!("{name}.c")), dir.path(), &[]);
        let Some(mut valgrind) = under_valgrind(&program) else { return };
        // Only `drawing` takes a file to draw to.
        let said = run_well(valgrind.arg(dir.path().join("drawn.glb")));
        assert!(said.contains(" checks, 0 failures"), "{name}: {said}");
    }
}
