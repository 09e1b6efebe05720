//! Tests that a program compiled with an older `dcd.h` runs with this one, by libabigail: `abidiff` of package abigail-tools.
//!
//! It reads types from debugging information. That of Rust names Rust's types, so it is given libraries that a C compiler
//! makes of the headers: every function with an empty body. That the real library has these functions and layouts is checked
//! elsewhere: by the exported symbols, and by the header's own asserts.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::library::declarations;
use crate::toolchain::{is_installed, root, run, run_well};

/// A shared library whose interface is that of a header.
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

/// What breaks programs between two headers; empty when nothing does. What is only added breaks none.
fn broken(old: &str, new: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let libraries = [library_of(old, folder.path(), "old"), library_of(new, folder.path(), "new")];
    let outcome = run(Command::new("abidiff").arg("--no-added-syms").args(libraries));
    // 1 and 2 say that it could not compare.
    let code = outcome.status.code().expect("it is not killed");
    assert_eq!(code & 3, 0, "{}{}", outcome.stdout, outcome.stderr);
    if code == 0 { String::new() } else { outcome.stdout }
}

fn header() -> String {
    std::fs::read_to_string(root().join("include/dcd.h")).unwrap()
}

/// The newest release that this commit comes from, and its header; `None` before the first.
fn last_release() -> Option<(String, String)> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).current_dir(root()).output().ok()?;
        output.status.success().then(|| String::from_utf8(output.stdout).expect("git says text"))
    };
    let tag = git(&["describe", "--tags", "--abbrev=0", "--match=v*"])?.trim().to_owned();
    let header = git(&["show", &format!("{tag}:include/dcd.h")])?;
    Some((tag, header))
}

/// The part of a version within which programs go on without being compiled anew: "0.1" of "v0.1.2", "1" of "v1.2.3".
fn compatible(version: &str) -> String {
    let parts: Vec<_> = version.trim_start_matches('v').split('.').collect();
    if parts[0] == "0" { parts[..2].join(".") } else { parts[0].to_owned() }
}

#[test]
fn programs_of_the_last_release_go_on() {
    if !is_installed("abidiff") {
        eprintln!("abidiff is not installed: nothing checked");
        return;
    }
    let Some((tag, old)) = last_release() else {
        eprintln!("there is no release yet: nothing to compare with");
        return;
    };
    if compatible(&tag) != compatible(env!("CARGO_PKG_VERSION")) {
        eprintln!("{tag} is another version of the interface: it may break programs");
        return;
    }
    let broken = broken(&old, &header());
    assert!(
        broken.is_empty(),
        "against {tag}; raise the version, or leave what is there as it is:\n{broken}"
    );
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
    // Of the same size, so that the header's own asserts are content.
    let swapped = now.replacen("    float gravity[3];", "    uint32_t gravity[3];", 1);
    assert!(broken(&now, &swapped).contains("gravity"));
}
