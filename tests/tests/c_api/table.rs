//! Tests the page's table of which role can do what against the library, function by function.

use std::collections::BTreeMap;
use std::process::Command;

use crate::programs::checker;
use crate::toolchain::{build, root, run_well};

const ROLES: [&str; 6] = ["local", "client", "participant", "builder", "server", "node"];

/// Returns every function of the header that takes a world.
fn functions() -> Vec<String> {
    let header = std::fs::read_to_string(root().join("include/dcd.h")).unwrap();
    let before = header.split("(DcdWorld world").map(|text| text.rsplit(' ').next().unwrap().to_owned());
    let mut functions: Vec<_> = before.filter(|word| word.starts_with("dcd_")).collect();
    functions.sort();
    functions.dedup();
    assert!(functions.len() > 80, "the header is read wrongly: {functions:?}");
    functions
}

/// Returns the rows of the table: names of functions, in which `*` stands for any text, and the entry of each
/// role.
fn rows() -> Vec<(Vec<String>, Vec<String>)> {
    let page = std::fs::read_to_string(root().join("examples-c/README.md")).unwrap();
    let section = page.split("\n## ").find(|part| part.starts_with("Who can do what")).unwrap();
    let lines = section.lines().filter(|line| line.starts_with("| `"));
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    let row = |line| {
        let mut cells: Vec<String> = cells(line);
        let names = cells.remove(0);
        (names.split('`').skip(1).step_by(2).map(str::to_owned).collect(), cells)
    };
    lines.map(row).collect()
}

fn is_meant(pattern: &str, function: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == function,
        Some((before, after)) => {
            let rest = function.strip_prefix(before);
            rest.and_then(|rest| rest.strip_suffix(after)).is_some_and(|middle| !middle.is_empty())
        }
    }
}

#[test]
fn the_table_of_who_can_do_what_is_true() {
    let folder = tempfile::tempdir().unwrap();
    let program = build(&checker("table.c"), folder.path(), &[]);
    let said = run_well(Command::new(program).arg(folder.path().join("server")));
    assert!(said.contains(" checks, 0 failures"), "{said}");
    let tried: BTreeMap<_, Vec<_>> = said
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(function, verdicts)| (function, verdicts.split(' ').collect()))
        .collect();
    let rows = rows();
    let mut wrong = Vec::new();
    for function in functions() {
        let of = |patterns: &[String]| patterns.iter().any(|pattern| is_meant(pattern, &function));
        let meant: Vec<_> = rows.iter().filter(|(patterns, _)| of(patterns)).collect();
        match (&meant[..], tried.get(&*function)) {
            ([(_, told)], Some(tried)) if told == tried => {}
            (rows, tried) => {
                let told: Vec<_> = rows.iter().map(|(_, told)| told).collect();
                wrong.push(format!("{function}: the page says {told:?}, table.c {tried:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "of {ROLES:?}:\n{}", wrong.join("\n"));
}
