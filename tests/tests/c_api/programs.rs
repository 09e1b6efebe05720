//! Tests that the C examples print what they should and that misuse gets its codes: plain, under the
//! sanitizers, and under valgrind.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::toolchain::{STRICT, build, compiler, is_installed, root, run_well};

fn example(name: &str) -> PathBuf {
    root().join("examples-c").join(name)
}

pub(crate) fn checker(name: &str) -> PathBuf {
    root().join("tests/tests/c_api").join(name)
}

/// Flags for a program that stops at the first finding of AddressSanitizer, LeakSanitizer or
/// UndefinedBehaviorSanitizer.
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
        // One region computes all boxes of an island, including those from the other region.
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
    // 300 frames of 1/75 s, six of them three times as long, in steps of 1/60 s.
    assert_eq!(steps, 249, "{said}");
    assert!(began >= 16 && ended < began, "16 balls fall on the ground and some bounce: {said}");
    assert!(transfers > 0, "balls roll across the borders: {said}");
    assert!(said.contains("ball 0 is 0.25 m above something"), "{said}");
}

/// Returns the first program of the README, and its changes to join a server.
pub(crate) fn program_of_the_readme() -> [String; 2] {
    let page = std::fs::read_to_string(root().join("README.md")).unwrap();
    let mut blocks = page.split("```c\n").skip(1).map(|block| block.split("```").next().unwrap().to_owned());
    std::array::from_fn(|_| blocks.next().expect("the page has both"))
}

#[test]
fn the_program_of_the_readme_says_where_its_ball_lies() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("readme.c");
    std::fs::write(&file, &program_of_the_readme()[0]).unwrap();
    let said = run_well(&mut Command::new(build(&file, dir.path(), &[])));
    assert_eq!(said, "the ball is at 1.00 m\n");
}

#[test]
fn the_programs_of_the_page_for_engines_draw_between_steps_and_float_a_raft() {
    let page = std::fs::read_to_string(root().join("dcd/manual/engines.md")).unwrap();
    let programs: Vec<_> =
        page.split("```c\n").skip(1).map(|block| block.split("```").next().unwrap()).collect();
    let said = [
        (0..3).map(|i| format!("thing {i} is drawn at x = {}.0 m, fallen\n", 2 * i)).collect(),
        "the raft floats at y = 2.0 m\n".to_owned(),
    ];
    assert_eq!(programs.len(), said.len(), "each block is a whole program");
    for (program, said) in programs.iter().zip(said) {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("engine.c");
        std::fs::write(&file, program).unwrap();
        assert_eq!(run_well(&mut Command::new(build(&file, dir.path(), &[]))), said);
    }
}

/// Returns the numbers of a line, in order.
pub(crate) fn numbers(line: &str) -> Vec<f64> {
    line.split(|c: char| !(c.is_ascii_digit() || c == '.')).filter_map(|n| n.parse().ok()).collect()
}

#[test]
fn ragdolls_cross_borders_in_one_piece() {
    let said = run_example("ragdolls.c", &[]);
    let [dolls, over, transfers, gap_mm] = numbers(&said)[..] else { panic!("{said}") };
    assert_eq!(dolls, 16.0);
    assert!(over >= 4.0, "they tumble down: {said}");
    // All ten parts of a doll change owner together.
    assert!(transfers >= 30.0 && transfers % 10.0 == 0.0, "{said}");
    assert!(gap_mm < 100.0, "a joint came apart: {said}");
}

#[test]
fn stress_moves_and_reads_all_of_its_bodies() {
    let dir = tempfile::tempdir().unwrap();
    let said = run_well(Command::new(build(&example("stress.c"), dir.path(), &[])).args(["2000", "30", "2"]));
    let last = said.lines().last().expect("it says something");
    let [bodies, steps, transfers, highest] = numbers(last)[..] else { panic!("{said}") };
    assert_eq!((bodies, steps), (2000.0, 30.0), "{said}");
    assert!(transfers > 0.0 && (0.25..3.0).contains(&highest), "{said}");
}

#[test]
fn engine_draws_frames_in_the_colours_of_four_regions() {
    let dir = tempfile::tempdir().unwrap();
    let program = build(&example("engine.cpp"), dir.path(), &["-fno-exceptions"]);
    let said = run_well(Command::new(program).arg(dir.path()).arg("1"));
    let [frames, steps, transfers] = numbers(&said)[..] else { panic!("{said}") };
    assert!((30.0..=31.0).contains(&frames) && (59.0..=62.0).contains(&steps) && transfers > 0.0, "{said}");
    let file = std::fs::File::open(dir.path().join("frame0029.png")).unwrap();
    let mut frame = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG file");
    assert_eq!((frame.info().width, frame.info().height), (320, 320));
    let mut pixels = vec![0; 320 * 320 * 3];
    frame.next_frame(&mut pixels).expect("its whole picture");
    let count = |is: fn([i32; 3]) -> bool| {
        let colour = |pixel: &[u8]| [0, 1, 2].map(|part| i32::from(pixel[part]));
        pixels.chunks(3).filter(|pixel| is(colour(pixel))).count()
    };
    let ground = count(|colour| colour == [24, 26, 30]);
    assert!((60_000..100_000).contains(&ground), "the ground shows between the things: {ground}");
    let red = count(|[r, g, b]| r > g + 50 && r > b + 50);
    let green = count(|[r, g, b]| g > r + 20 && g > b + 20);
    let blue = count(|[r, g, b]| b > r + 40 && b > g + 20);
    let yellow = count(|[r, g, b]| r > b + 40 && g > b + 40);
    for region in [red, green, blue, yellow] {
        assert!(region > 300, "each of four regions shows: {red} {green} {blue} {yellow}");
    }
}

/// Runs a program that counts its own checks and may write files in its folder.
fn run_checker(name: &str, dir: &Path, file: &Path) {
    let said = run_well(Command::new(build(&checker(name), dir, &[])).arg(file).current_dir(dir));
    assert!(said.contains(" checks, 0 failures"), "{said}");
}

#[test]
fn functions_do_what_the_header_says_and_the_command_line_goes_on_with_a_snapshot() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("saved.dcd");
    run_checker("behaviour.c", dir.path(), &file);
    let mut run = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
    let said = run_well(run.arg("run").arg(file).args(["--seconds", "0.1", "--json"]));
    assert!(said.contains("\"bodies\":60"), "{said}");
    // How many of ten ticks are kept of the last millisecond depends on the machine.
    for (name, ticks) in [("whole", 30..=30), ("last", 1..=10)] {
        let recording = dir.path().join(format!("saved.dcd.{name}.dcdr"));
        let mut replay = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
        let said = run_well(replay.arg("replay").arg(recording).args(["--check", "--json"]));
        let told: serde_json::Value = serde_json::from_str(&said).expect("JSON");
        let count = told["ticks"].as_u64().expect("a number");
        assert!(ticks.contains(&count) && told["mismatch"].is_null(), "{name}: {said}");
        assert_eq!(told["matches"], 2 * count, "{name}: a digest for each of two regions: {said}");
    }
}

#[test]
fn misuse_gets_its_documented_codes() {
    let dir = tempfile::tempdir().unwrap();
    run_checker("misuse.c", dir.path(), &dir.path().join("nothing"));
}

#[test]
fn a_renderer_draws_a_world_by_its_own_functions() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("drawn.glb");
    for flags in [&[][..], &SANITIZED] {
        let said = run_well(Command::new(build(&checker("drawing.c"), dir.path(), flags)).arg(&file));
        assert!(said.contains(" checks, 0 failures"), "{said}");
    }
    let (document, _) = gltf::Gltf::open(&file).map(|file| (file.document, file.blob)).expect("a glTF file");
    let names: Vec<_> = document.nodes().filter_map(|node| node.name().map(str::to_owned)).collect();
    assert_eq!(names, ["b1", "b2", "b3", "b0", "world"], "what moves, and what is fixed");
}

/// Builds `wrapper.cpp` without exceptions, and `throwing.cpp` into the same program.
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
        let said = run_well(Command::new(build_wrapper(dir.path(), &[dialect])).arg(dir.path()));
        assert!(said.contains(" checks, 0 failures"), "{said}");
    }
}

#[test]
fn sanitizers_find_nothing_in_the_programs() {
    let dir = tempfile::tempdir().unwrap();
    run_well(Command::new(build_wrapper(dir.path(), &SANITIZED)).arg(dir.path()));
    for source in [checker("misuse.c"), checker("behaviour.c"), example("hello.c"), example("game_loop.c")] {
        run_well(Command::new(build(&source, dir.path(), &SANITIZED)).current_dir(dir.path()));
    }
    let short = [("stress.c", ["500", "10"]), ("ragdolls.c", ["4", "2"]), ("engine.cpp", [".", "0.2"])];
    for (name, arguments) in short {
        let program = build(&example(name), dir.path(), &SANITIZED);
        run_well(Command::new(program).args(arguments).current_dir(dir.path()));
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

/// Returns a program to run under valgrind, which fails on errors and lost memory; `None` where valgrind is
/// not installed.
pub(crate) fn under_valgrind(program: &Path) -> Option<Command> {
    if !is_installed("valgrind") {
        eprintln!("valgrind is not installed: nothing checked");
        return None;
    }
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"]);
    valgrind.arg(format!("--suppressions={}", root().join("dcd-ffi/valgrind.supp").display()));
    valgrind.arg(program);
    Some(valgrind)
}

#[test]
fn valgrind_finds_nothing_in_the_programs() {
    let dir = tempfile::tempdir().unwrap();
    for source in [checker("misuse.c"), checker("behaviour.c"), example("hello.c")] {
        let Some(mut valgrind) = under_valgrind(&build(&source, dir.path(), &[])) else { return };
        run_well(valgrind.current_dir(dir.path()));
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
