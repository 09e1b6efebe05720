//! Tests dcd as its users get it: installed into a prefix and found there by CMake, pkg-config and by hand,
//! or built along with the user's project. Also runs the page that describes this, word for word.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use crate::toolchain::{NATIVE_LIBS, forget_cargo, is_installed, profile, root, run_well, target_dir};

/// The output of the consumer's game in both languages.
const SAID: &str = "dcd 0.1.0, fell to -4.9 m\n";

/// Options that make CMake call cargo as `cargo test --workspace` does, so that nothing is compiled twice.
fn of_this_test() -> [String; 3] {
    let target = target_dir();
    [
        format!("-DDCD_CARGO_PROFILE={}", profile()),
        "-DDCD_CARGO_FLAGS=--quiet;--workspace;--lib;--bins;--tests".to_owned(),
        format!("-DDCD_CARGO_TARGET_DIR={}", target.display()),
    ]
}

/// Configures one of our CMake projects and builds all of it.
pub(crate) fn cmake_build(source: &str, build: &Path, flags: &[&str]) {
    let mut configure = Command::new("cmake");
    configure.arg("-S").arg(root().join(source)).arg("-B").arg(build).args(flags).args(of_this_test());
    run_well(&mut configure);
    run_well(forget_cargo(Command::new("cmake").arg("--build").arg(build)));
}

fn check_cmake_games(build: &Path) {
    for game in ["c_static", "c_shared", "cpp_static", "cpp_shared"] {
        assert_eq!(run_well(&mut Command::new(build.join(game))), SAID, "{game}");
    }
}

#[test]
fn installed_it_is_found_by_cmake_by_pkg_config_and_by_hand() {
    if !is_installed("cmake") {
        eprintln!("cmake is not installed: nothing checked");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let build = folder.path().join("build");
    cmake_build("dcd-ffi", &build, &[]);
    let first = folder.path().join("first");
    run_well(Command::new("cmake").arg("--install").arg(&build).arg("--prefix").arg(&first));
    // The installed files must not refer to the build folder or to the first prefix.
    std::fs::remove_dir_all(&build).unwrap();
    let prefix = folder.path().join("prefix");
    std::fs::rename(first, &prefix).unwrap();

    let games = folder.path().join("games");
    cmake_build("tests/consumer", &games, &[&format!("-DCMAKE_PREFIX_PATH={}", prefix.display())]);
    check_cmake_games(&games);
    let needed = run_well(Command::new("readelf").arg("--dynamic").arg(games.join("c_shared")));
    assert!(needed.contains("[libdcd.so.0.1]"), "{needed}");

    assert!(prefix.join("share/dcd/valgrind.supp").is_file());
    let cache = std::fs::read_to_string(games.join("CMakeCache.txt")).unwrap();
    let named = cache.lines().find_map(|line| line.strip_prefix("VALGRIND_SUPPRESSIONS:FILEPATH="));
    assert!(named.is_some_and(|file| Path::new(file).is_file()), "find_package names it: {named:?}");

    by_hand(&prefix);
    if is_installed("pkg-config") {
        by_pkg_config(&prefix);
    } else {
        eprintln!("pkg-config is not installed: not checked");
    }
}

/// Compiles the consumer's game in both languages with these flags, and runs it.
fn compile_and_run(prefix: &Path, flags: &[String]) {
    for (variable, default, language) in [("CC", "cc", "c"), ("CXX", "c++", "cpp")] {
        let program = prefix.join("game");
        let mut compiler = Command::new(std::env::var_os(variable).unwrap_or_else(|| default.into()));
        compiler.arg(root().join("tests/consumer/game").with_extension(language)).args(flags);
        run_well(compiler.arg("-o").arg(&program));
        let mut game = Command::new(program);
        assert_eq!(run_well(game.env("LD_LIBRARY_PATH", prefix.join("lib"))), SAID, "{flags:?}");
    }
}

fn by_hand(prefix: &Path) {
    let library = prefix.join("lib");
    let include = format!("-I{}", prefix.join("include").display());
    let mut flags = vec![include.clone(), library.join("libdcd.a").display().to_string()];
    flags.extend(NATIVE_LIBS.map(str::to_owned));
    compile_and_run(prefix, &flags);
    compile_and_run(prefix, &[include, format!("-L{}", library.display()), "-ldcd".to_owned()]);
}

fn by_pkg_config(prefix: &Path) {
    let pkg_config = |arguments: &[&str]| {
        let mut command = Command::new("pkg-config");
        command.env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig")).args(arguments);
        run_well(&mut command).split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    for package in ["dcd", "dcd-static"] {
        assert_eq!(pkg_config(&["--modversion", package]), ["0.1.0"]);
        let suppressions = pkg_config(&["--variable=valgrind_suppressions", package]);
        assert!(Path::new(&suppressions[0]).is_file(), "{suppressions:?}");
        compile_and_run(prefix, &pkg_config(&["--cflags", "--libs", package]));
    }
}

#[test]
fn a_project_that_fetches_dcd_builds_it_along() {
    if !is_installed("cmake") {
        eprintln!("cmake is not installed: nothing checked");
        return;
    }
    let build = tempfile::tempdir().unwrap();
    // This repository stands in for the network.
    let fetched = format!("-DFETCHCONTENT_SOURCE_DIR_DCD={}", root().display());
    cmake_build("tests/consumer/superbuild", build.path(), &[&fetched]);
    check_cmake_games(build.path());
}

#[test]
fn cmake_builds_the_examples() {
    if !is_installed("cmake") {
        eprintln!("cmake is not installed: nothing checked");
        return;
    }
    let build = tempfile::tempdir().unwrap();
    cmake_build("examples-c", build.path(), &[]);
    assert!(run_well(&mut Command::new(build.path().join("hello"))).contains("box 4"));
}

/// Returns the commands of a section of a page as one script.
fn commands(page: &str, section: &str) -> String {
    let page = std::fs::read_to_string(root().join(page)).unwrap();
    let section =
        page.split("\n## ").find(|part| part.starts_with(section)).expect("the page has the section");
    let blocks =
        section.split("```sh\n").skip(1).map(|block| block.split("```").next().expect("a block ends"));
    blocks.collect()
}

/// Writes a script that stands in for a tool.
fn stand_in(bin: &Path, tool: &str, script: &str) {
    let path = bin.join(tool);
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn the_page_from_zero_to_a_linked_engine_does_what_it_says() {
    if !is_installed("cmake") || !is_installed("pkg-config") {
        eprintln!("cmake or pkg-config is not installed: nothing checked");
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let bin = home.path().join("bin");
    std::fs::create_dir_all(home.path().join(".cargo")).unwrap();
    std::fs::write(home.path().join(".cargo/env"), "").unwrap();
    std::fs::create_dir(&bin).unwrap();
    // Stand-ins for what needs root, the network or many minutes.
    stand_in(&bin, "sudo", "exit 0");
    stand_in(&bin, "curl", "exit 0");
    let root = root();
    let sources = format!("mkdir dcd && ln -s {0}/[!t]* {0}/tests dcd", root.display());
    run_well(Command::new("sh").args(["-c", &sources]).current_dir(home.path()));
    let cargo = std::env::var("CARGO").unwrap();
    stand_in(&bin, "cargo", &format!("[ \"$1\" = install ] || exec {cargo} \"$@\""));
    let flags = of_this_test().map(|flag| format!("'{flag}'")).join(" ");
    let cmake = run_well(Command::new("sh").args(["-c", "command -v cmake"]));
    let cmake = cmake.trim();
    stand_in(&bin, "cmake", &format!("[ \"$2\" = dcd-ffi ] && set -- \"$@\" {flags}\nexec {cmake} \"$@\""));
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_dcd-under-test"), bin.join("dcd")).unwrap();

    // A port that nobody else uses.
    let listen = dcd_tests::proxy::free_address().to_string();
    let script = commands("examples-c/README.md", "From zero").replace("127.0.0.1:7420", &listen);
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    // If the page fails, processes that it leaves running would keep our pipes open.
    let script = format!("trap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{script}");
    let mut shell = Command::new("bash");
    shell.args(["-euo", "pipefail", "-c", &script]).env("HOME", home.path()).env("PATH", path);
    let said = run_well(forget_cargo(&mut shell));
    assert!(said.contains("after a step the ball is at -0.00"), "{said}");
    assert!(said.contains(" bodies after 1"), "{said}");
    assert!(said.contains("300 frames, 249 steps, "), "{said}");
}
