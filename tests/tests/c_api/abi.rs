//! Tests that a program compiled with the baseline `dcd.h` runs with the present library.
//!
//! The baseline is `dcd-ffi/abi/dcd.h`, the header without its comments. The test fails if a function, type
//! or constant of the baseline is gone or different. Where libabigail is installed (`abidiff` of package
//! abigail-tools), it also compares what a compiler makes of both headers. Additions break nothing. After a
//! change that is meant to break programs, and after each release, renew the baseline:
//! `UPDATE=1 cargo test -p dcd-tests --test c_api abi`.
//!
//! `abidiff` reads types from debugging information. Rust's debugging information names Rust's types, so
//! `abidiff` is given libraries that a C compiler makes of the headers, with an empty body for every
//! function. Other tests check that the real library has these functions and layouts: by the exported
//! symbols, and by the header's own asserts.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::library::declarations;
use crate::toolchain::{is_installed, root, run, run_well};

/// Builds a shared library whose interface is that of a header.
fn library_of(header: &str, folder: &Path, name: &str) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("dcd.h"), header).unwrap();
    let bodies: String =
        declarations(header).iter().map(|function| format!("{function} {{ for (;;); }}\n")).collect();
    let source = folder.join("stubs.c");
    std::fs::write(&source, format!("#include \"dcd.h\"\n{bodies}")).unwrap();
    let library = folder.join("libdcd.so");
    let mut cc = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()));
    run_well(cc.args(["-std=c11", "-shared", "-fPIC", "-g"]).arg(source).arg("-o").arg(&library));
    library
}

/// Returns the changes between two headers that break programs, or nothing. Additions break no program.
fn broken(old: &str, new: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let libraries = [library_of(old, folder.path(), "old"), library_of(new, folder.path(), "new")];
    let outcome = run(Command::new("abidiff").arg("--no-added-syms").args(libraries));
    // The bits 1 and 2 say that it could not compare.
    let code = outcome.status.code().expect("it is not killed");
    assert_eq!(code & 3, 0, "{}{}", outcome.stdout, outcome.stderr);
    if code == 0 { String::new() } else { outcome.stdout }
}

fn header() -> String {
    std::fs::read_to_string(root().join("include/dcd.h")).unwrap()
}

fn baseline() -> PathBuf {
    root().join("dcd-ffi/abi/dcd.h")
}

/// Returns a header without comments, empty lines and its own asserts.
fn bare(header: &str) -> String {
    let mut text = String::new();
    let mut rest = header;
    while let Some((before, comment)) = rest.split_once("/*") {
        text += before;
        rest = comment.split_once("*/").expect("a comment ends").1;
    }
    text += rest;
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default().trim_end());
    lines
        .filter(|line| !line.trim().is_empty() && !line.starts_with("DCD_ASSERT_("))
        .map(|line| line.to_owned() + "\n")
        .collect()
}

/// Returns what programs are compiled with, each item on one line: functions, types, and constants except
/// those of the version.
fn promises(bare: &str) -> BTreeSet<String> {
    let (directives, code): (Vec<_>, Vec<_>) = bare.lines().partition(|line| line.starts_with('#'));
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let constants = directives.into_iter().filter(|line| line.starts_with("#define DCD_"));
    let constants = constants.filter(|line| {
        // The initial values of structs are compiled into programs. They may change for programs compiled
        // later.
        !["DCD_VERSION", "_INIT", "DCD_API", "\\"].iter().any(|exempt| line.contains(exempt))
    });
    let code = code.join("\n").replace("extern \"C\" {", "");
    let mut items: BTreeSet<_> = constants.map(one_line).collect();
    let (mut item, mut depth) = (String::new(), 0_usize);
    for c in code.chars() {
        match c {
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if c == ';' && depth == 0 {
            items.insert(one_line(&std::mem::take(&mut item)));
        } else {
            item.push(c);
        }
    }
    items
}

/// Returns the part of a version within which programs need not be compiled again: "0.1", "1".
fn compatible(header: &str) -> String {
    let part = |name: &str| {
        let line = header.lines().find_map(|line| line.strip_prefix(&format!("#define DCD_VERSION_{name} ")));
        line.expect("a header says its version").trim_end_matches('u').to_owned()
    };
    let major = part("MAJOR");
    if major == "0" { format!("0.{}", part("MINOR")) } else { major }
}

#[test]
fn programs_of_the_baseline_go_on() {
    let now = bare(&header());
    if std::env::var_os("UPDATE").is_some() {
        std::fs::create_dir_all(baseline().parent().unwrap()).unwrap();
        std::fs::write(baseline(), &now).unwrap();
    }
    let old = std::fs::read_to_string(baseline()).expect("the baseline is in the repository");
    let remedy = "leave what is there as it is, or, if programs may break: UPDATE=1 cargo test -p dcd-tests --test c_api abi";
    assert_eq!(compatible(&old), compatible(&now), "another version needs a baseline of its own; {remedy}");
    let (promised, kept) = (promises(&old), promises(&now));
    assert!(promised.len() > 400, "the baseline is read wrongly: {} items", promised.len());
    let gone: Vec<_> = promised.difference(&kept).collect();
    assert!(gone.is_empty(), "gone or changed since the baseline; {remedy}\n{gone:#?}");
    if !is_installed("abidiff") {
        eprintln!("abidiff is not installed: what compilers make of the headers is not compared");
        return;
    }
    let broken = broken(&old, &now);
    assert!(broken.is_empty(), "against the baseline; {remedy}\n{broken}");
}

#[test]
fn what_is_promised_is_missed_when_it_changes_and_what_is_added_is_not() {
    let now = bare(&header());
    let gone = |from: &str, to: &str| {
        let changed = now.replacen(from, to, 1);
        assert_ne!(changed, now, "the header has {from}");
        promises(&now).difference(&promises(&changed)).count()
    };
    assert_eq!(
        gone("DCD_API DcdStatus dcd_step(", "DCD_API void dcd_more(void);\nDCD_API DcdStatus dcd_step("),
        0
    );
    assert_eq!(gone("bool dcd_world_is_valid(DcdWorld world)", "bool dcd_world_is_valid(DcdBodyId body)"), 1);
    assert_eq!(gone("    float gravity[3];", "    float pull[3];"), 1);
    assert_eq!(gone("#define DCD_QUERY_LEAVE 2", "#define DCD_QUERY_LEAVE 4"), 1);
    assert_eq!(gone("typedef uint32_t DcdRole;", "typedef uint64_t DcdRole;"), 1);
}

#[test]
fn a_function_more_breaks_nothing_and_any_other_change_is_found() {
    if !is_installed("abidiff") {
        eprintln!("abidiff is not installed: nothing checked");
        return;
    }
    let now = header();
    assert_eq!(broken(&now, &now), "");
    let step = "DCD_API DcdStatus dcd_step(";
    let more = now.replacen(step, &format!("DCD_API void dcd_more(void);\n{step}"), 1);
    assert_ne!(more, now, "the header has that function on a line of its own");
    assert_eq!(broken(&now, &more), "");
    assert!(broken(&more, &now).contains("dcd_more"));
    let narrow = now.replacen("bool dcd_world_is_valid(", "uint32_t dcd_world_is_valid(", 1);
    assert!(broken(&now, &narrow).contains("dcd_world_is_valid"));
    // The type has the same size, so that the header's own asserts still hold.
    let swapped = now.replacen("    float gravity[3];", "    uint32_t gravity[3];", 1);
    assert!(broken(&now, &swapped).contains("gravity"));
}
