//! dcd as others get it: installed into a prefix, found there by CMake, by pkg-config and by hand, or built along with them.

use std::path::Path;
use std::process::Command;

use crate::toolchain::{NATIVE_LIBS, forget_cargo, is_installed, library_dir, profile, root, run_well};

/// What the consumer's game says, in either language.
const SAID: &str = "dcd 0.1.0, fell to -4.9 m\n";

/// Has CMake ask cargo for the library that the other tests use, so that nothing is compiled twice, and builds all.
fn cmake_build(source: &str, build: &Path, flags: &[&str]) {
    let target = library_dir().parent().expect("profiles lie in the target directory");
    let mut configure = Command::new("cmake");
    configure.arg("-S").arg(root().join(source)).arg("-B").arg(build).args(flags);
    configure.arg(format!("-DDCD_CARGO_PROFILE={}", profile()));
    configure.arg("-DDCD_CARGO_FLAGS=--quiet;--package;dcd-tests");
    configure.arg(format!("-DDCD_CARGO_TARGET_DIR={}", target.display()));
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
    // Nothing of it may lead back to where it was built or installed first.
    std::fs::remove_dir_all(&build).unwrap();
    let prefix = folder.path().join("prefix");
    std::fs::rename(first, &prefix).unwrap();

    let games = folder.path().join("games");
    cmake_build("tests/consumer", &games, &[&format!("-DCMAKE_PREFIX_PATH={}", prefix.display())]);
    check_cmake_games(&games);
    let needed = run_well(Command::new("readelf").arg("--dynamic").arg(games.join("c_shared")));
    assert!(needed.contains("[libdcd.so.0.1]"), "{needed}");

    by_hand(&prefix);
    if is_installed("pkg-config") {
        by_pkg_config(&prefix);
    } else {
        eprintln!("pkg-config is not installed: not checked");
    }
}

/// Compiles the consumer's game in both languages, with these flags, and runs it.
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
    // In place of the network, this repository.
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
