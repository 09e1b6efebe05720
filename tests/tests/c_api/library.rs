//! Tests what the library files export, and which native libraries they need.

use std::collections::BTreeSet;
use std::process::Command;

use crate::toolchain::{NATIVE_LIBS, library_dir, root, run, run_well};

/// Returns the functions that a header declares, each up to its semicolon.
pub(crate) fn declarations(header: &str) -> Vec<&str> {
    // What precedes the first function is the definition of DCD_API, with directives.
    let heads = header.split("DCD_API").skip(1).filter_map(|rest| rest.split(';').next());
    heads.map(str::trim).filter(|head| !head.contains('#')).collect()
}

/// Returns the names of the functions that `dcd.h` declares.
pub(crate) fn declared() -> BTreeSet<String> {
    let header = std::fs::read_to_string(root().join("include/dcd.h")).unwrap();
    let name = |head: &str| {
        let before = head.split('(').next()?;
        Some(before.split(|c: char| !(c.is_alphanumeric() || c == '_')).next_back()?.to_owned())
    };
    declarations(&header).into_iter().filter_map(name).collect()
}

#[test]
fn the_shared_library_exports_what_the_header_declares_and_nothing_else() {
    let shared = library_dir().join("libdcd_ffi.so");
    let symbols =
        run_well(Command::new("nm").args(["--dynamic", "--defined-only", "--format=posix"]).arg(shared));
    let exported: BTreeSet<String> =
        symbols.lines().filter_map(|line| Some(line.split(' ').next()?.to_owned())).collect();
    let declared = declared();
    assert!(declared.len() > 40, "{declared:?}");
    assert_eq!(exported, declared);
}

#[test]
fn the_list_of_native_libraries_is_the_compilers_own() {
    // Every program that links shows that the list suffices. This test shows that it has nothing superfluous
    // and is the same everywhere. An empty library needs what Rust's standard library needs. The slow way,
    // which compiles dcd again:
    // cargo rustc -p dcd-ffi --crate-type staticlib -- --print native-static-libs
    let dir = tempfile::tempdir().unwrap();
    let source = dir.path().join("empty.rs");
    std::fs::write(&source, "").unwrap();
    let mut rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
    rustc.args(["--crate-type", "staticlib", "--print", "native-static-libs", "--out-dir"]).arg(dir.path());
    let outcome = run(rustc.arg(&source));
    let list = outcome
        .stderr
        .lines()
        .find_map(|line| line.split_once("native-static-libs: "))
        .expect("rustc says it");
    assert_eq!(list.1.split_whitespace().collect::<Vec<_>>(), NATIVE_LIBS);

    let makefile = std::fs::read_to_string(root().join("examples-c/Makefile")).unwrap();
    assert!(makefile.contains(&NATIVE_LIBS.join(" ")));
    let cmake = std::fs::read_to_string(root().join("dcd-ffi/CMakeLists.txt")).unwrap();
    assert!(cmake.contains(&NATIVE_LIBS.map(|library| &library[2..]).join(" ")));
}
