//! Finds and builds the C program of the demo.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use super::process::Process;
use crate::cli::common::Common;
use crate::cli::failure::Failure;
use crate::cli::interrupt::Interrupt;

/// The longest time for a first build on a slow machine.
const BUILD: Duration = Duration::from_secs(1800);
const SOURCE: &str = "examples-c/join.c";

/// System libraries that a static library of Rust needs (`cargo rustc -p dcd-ffi -- --print native-static-libs`).
const SYSTEM_LIBRARIES: &[&str] = if cfg!(target_os = "linux") {
    &["-lgcc_s", "-lutil", "-lrt", "-lpthread", "-lm", "-ldl", "-lc"]
} else {
    &["-lm"]
};

/// Returns the folder of dcd's sources: the one from which this binary was built, else one around the current
/// folder.
pub(super) fn workspace() -> Result<PathBuf, Failure> {
    let is_it = |folder: &&Path| folder.join(SOURCE).is_file() && folder.join("include/dcd.h").is_file();
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
    if let Some(folder) = built_from.filter(is_it) {
        return Ok(folder.to_owned());
    }
    let here = std::env::current_dir().unwrap_or_default();
    here.ancestors().find(is_it).map(Path::to_owned).ok_or_else(|| {
        Failure::run(format!(
            "cannot find {SOURCE} around {}; run the demo in a clone of dcd, as `cargo demo`",
            here.display()
        ))
    })
}

/// Builds the C library, unless one is given, and the program against it.
pub(super) fn build(
    workspace: &Path,
    folder: &Path,
    library: Option<&Path>,
    common: &Common,
    interrupt: Interrupt,
) -> Result<PathBuf, Failure> {
    let library = match library {
        Some(library) => library.to_owned(),
        None => build_library(workspace, common, interrupt)?,
    };
    let program = folder.join(format!("join{}", std::env::consts::EXE_SUFFIX));
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    common.say(&format!("compiling {SOURCE} with {}", compiler.display()));
    let mut compiling = Command::new(compiler);
    compiling.args(["-std=c11", "-O2", "-I"]).arg(workspace.join("include")).arg(workspace.join(SOURCE));
    compiling.arg(library).args(SYSTEM_LIBRARIES).arg("-o").arg(&program);
    Process::start("the C compiler", &mut compiling, !common.is_quiet())?.succeed(BUILD, interrupt)?;
    Ok(program)
}

/// Builds the C library in the profile that this binary was built in.
fn build_library(workspace: &Path, common: &Common, interrupt: Interrupt) -> Result<PathBuf, Failure> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut building = Command::new(cargo);
    building.current_dir(workspace);
    // With `dcd` itself and its command line, so that features are those of the running binary and no dependency is built twice.
    building.args(["build", "--package", "dcd-ffi", "--package", "dcd", "--lib", "--features", "dcd/cli"]);
    building.args(["--message-format", "json-render-diagnostics"]);
    // `cargo run` gives its child variables about the package that it runs. Build scripts that depend on them
    // would run anew.
    for (name, _) in std::env::vars_os() {
        let told = name.to_str().is_some_and(|name| {
            ["CARGO_PKG_", "CARGO_MANIFEST_"].iter().any(|prefix| name.starts_with(prefix))
        });
        if told {
            building.env_remove(&name);
        }
    }
    if !cfg!(debug_assertions) {
        building.arg("--release");
    }
    if let Some(target) = std::env::current_exe().ok().as_deref().and_then(target_of) {
        building.arg("--target-dir").arg(target);
    }
    common.say("building the C library: cargo build --package dcd-ffi --package dcd");
    let said = Process::start("cargo build", &mut building, !common.is_quiet())?.succeed(BUILD, interrupt)?;
    said.iter().rev().find_map(|line| static_library(line)).ok_or_else(|| {
        Failure::run("cargo built no static library of dcd-ffi; check its crate-type in dcd-ffi/Cargo.toml")
    })
}

/// Returns cargo's target folder, if this binary lies in one.
fn target_of(binary: &Path) -> Option<PathBuf> {
    let target = binary.ancestors().skip(2).take(2).find(|folder| folder.join("CACHEDIR.TAG").is_file());
    target.map(Path::to_owned)
}

/// Returns the library's file from the message in which cargo names it.
fn static_library(message: &str) -> Option<PathBuf> {
    let message: serde_json::Value = serde_json::from_str(message).ok()?;
    if message["reason"] != "compiler-artifact" || message["target"]["name"] != "dcd_ffi" {
        return None;
    }
    let files = message["filenames"].as_array()?.iter().filter_map(serde_json::Value::as_str);
    files.map(Path::new).find(|file| file.extension().is_some_and(|end| end == "a")).map(Path::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_found_in_what_cargo_says() {
        let other = r#"{"reason":"compiler-artifact","target":{"name":"dcd"},"filenames":["/t/libdcd.a"]}"#;
        assert_eq!(static_library(other), None);
        let ours =
            r#"{"reason":"compiler-artifact","target":{"name":"dcd_ffi"},"filenames":["/t/x.so","/t/x.a"]}"#;
        assert_eq!(static_library(ours), Some("/t/x.a".into()));
        assert_eq!(static_library("no json"), None);
    }
}
