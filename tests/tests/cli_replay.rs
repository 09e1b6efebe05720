//! Tests `dcd run --record`, `dcd replay`, `dcd diff` and `dcd simulate --record` as real processes.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

fn dcd(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dcd-under-test"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .env_remove("RUST_LOG")
        .output()
        .expect("the binary was built for this test")
}

fn said(folder: &Path, line: &str, code: i32) -> String {
    let output = dcd(folder, line);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
    String::from_utf8(if code == 2 { output.stderr } else { output.stdout }).unwrap()
}

fn json(folder: &Path, line: &str, code: i32) -> Value {
    serde_json::from_str(&said(folder, &format!("{line} --json"), code)).unwrap()
}

#[test]
fn a_world_is_recorded_and_replayed_and_a_flipped_bit_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for scene in [
        "pile --set n=80 --regions 3",
        "ragdolls --set count=6 --regions 2 --coupling overlap",
        "convoy --set cars=8 --set road=400 --regions 2",
    ] {
        let _ = std::fs::remove_file(folder.join("a.dcdr"));
        let plain = json(folder, &format!("run {scene} --seconds 2"), 0);
        let recorded = json(folder, &format!("run {scene} --seconds 2 --record a.dcdr"), 0);
        assert_eq!(plain["state_hash"], recorded["state_hash"], "{scene}: nothing changes by being recorded");
        let replayed = json(folder, "replay a.dcdr --check", 0);
        let digests = 120 * recorded["regions"].as_u64().unwrap();
        assert_eq!(
            replayed,
            serde_json::json!({"ticks": 120, "matches": digests, "mismatch": null}),
            "{scene}"
        );
        assert_eq!(json(folder, "replay a.dcdr --until 30 --threads 2", 0)["ticks"], 30, "{scene}");

        let dump = said(folder, "replay a.dcdr --dump 50", 0);
        let columns = "body,node,region,translation.x,translation.y,translation.z,rotation.i,rotation.j,rotation.k,rotation.w,\
            linvel.x,linvel.y,linvel.z,angvel.x,angvel.y,angvel.z";
        assert_eq!(dump.lines().next().unwrap(), columns);
        assert_eq!(dump.lines().count() as u64, 1 + recorded["bodies"].as_u64().unwrap(), "{scene}");
        let row: Vec<_> = dump.lines().nth(3).unwrap().split(',').collect();
        let found = json(folder, &format!("replay a.dcdr --check --flip 50:{}:352", row[0]), 1);
        let found = &found["mismatch"];
        assert_eq!(
            (&found["node"], &found["tick"], &found["body"]),
            (&Value::Null, &50.into(), &row[0].into())
        );
        assert_eq!((&found["region"].to_string()[..], &found["field"]), (&row[2][1..], &"linvel.y".into()));
        assert_eq!(found["recorded"].as_f64().unwrap(), row[11].parse::<f64>().unwrap(), "{found}");
    }
}

#[test]
fn the_first_difference_of_two_recordings_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    said(folder, "run drum --set n=60 --seconds 1 --record a.dcdr", 0);
    said(folder, "run drum --set n=60 --seconds 1 --threads 2 --record b.dcdr", 0);
    said(folder, "run drum --set n=61 --seconds 1 --record c.dcdr", 0);
    assert_eq!(json(folder, "diff a.dcdr b.dcdr", 0), serde_json::json!({"ticks": 60, "difference": null}));
    let found = json(folder, "diff a.dcdr c.dcdr", 1);
    assert_eq!(found["difference"]["tick"], 1, "{found}");
    let words = said(folder, "diff a.dcdr c.dcdr", 1);
    assert!(words.starts_with("they differ from tick 1") && words.contains("in the second"), "{words}");
    let words = said(folder, "diff a.dcdr b.dcdr", 0);
    assert_eq!(words.trim_end(), "alike in all ticks that both have, up to tick 60");
    // A recording cut off before its first tick is not alike with anything.
    let whole = std::fs::read(folder.join("a.dcdr")).unwrap();
    std::fs::write(folder.join("begun.dcdr"), &whole[..200]).unwrap();
    let nothing = dcd(folder, "diff a.dcdr begun.dcdr");
    assert_eq!(nothing.status.code(), Some(1), "{nothing:?}");
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("nothing was compared"), "{nothing:?}");
    assert!(nothing.stdout.is_empty(), "{nothing:?}");
    for line in ["replay begun.dcdr --check", "replay begun.dcdr"] {
        let nothing = dcd(folder, line);
        assert_eq!(nothing.status.code(), Some(1), "{line}: {nothing:?}");
        let words = String::from_utf8_lossy(&nothing.stderr);
        assert!(words.contains("no tick is on record") && !words.contains("name one"), "{line}: {words}");
    }
}

#[test]
fn what_cannot_be_replayed_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    said(folder, "run tower --seconds 0.5 --record a.dcdr", 0);
    std::fs::copy(folder.join("a.dcdr"), folder.join("b.dcdr")).unwrap();
    std::fs::write(folder.join("text.dcdr"), "not a recording").unwrap();
    std::fs::create_dir(folder.join("empty")).unwrap();
    std::fs::create_dir(folder.join("begun")).unwrap();
    std::fs::write(folder.join("begun/node.dcdr"), "").unwrap();
    let whole = std::fs::read(folder.join("a.dcdr")).unwrap();
    let mut damaged = whole.clone();
    damaged[whole.len() / 2] ^= 1;
    std::fs::write(folder.join("damaged.dcdr"), damaged).unwrap();
    for (line, words) in [
        ("replay missing.dcdr", "cannot be read"),
        ("replay text.dcdr", "not a recording of dcd"),
        ("replay empty", "has no *.dcdr"),
        ("replay begun", "has no *.dcdr"),
        ("replay a.dcdr a.dcdr", "a.dcdr is given twice"),
        ("replay a.dcdr b.dcdr", "a local world has one recording"),
        ("replay a.dcdr --dump 31", "the recording ends after tick 30"),
        ("replay a.dcdr --flip 1", "write tick, body"),
        ("replay a.dcdr --flip 20:7777", "nothing was flipped"),
        ("replay a.dcdr --flip 20:5:40", "nothing was flipped"),
        ("run tower --regions 0 --record c.dcdr", "--record takes a world of regions"),
        ("run tower --record missing/b.dcdr", "cannot be read"),
    ] {
        let said = said(folder, line, 2);
        assert!(said.contains(words), "{line}: {said}");
    }
    let damaged = dcd(folder, "replay damaged.dcdr --check");
    assert_eq!(damaged.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&damaged.stderr).contains("is damaged"), "{damaged:?}");
    // A damaged length is reported as damage, not as an end.
    let mut longer = whole.clone();
    longer[13] ^= 4;
    std::fs::write(folder.join("longer.dcdr"), longer).unwrap();
    let longer = dcd(folder, "replay longer.dcdr --check");
    assert!(String::from_utf8_lossy(&longer.stderr).contains("is damaged"), "{longer:?}");
    // A recording without a tick proves nothing.
    std::fs::write(folder.join("begun.dcdr"), &whole[..200.min(whole.len())]).unwrap();
    assert_ne!(dcd(folder, "replay begun.dcdr --check").status.code(), Some(0));
    // A recording that cannot be written is an error.
    if cfg!(target_os = "linux") {
        let full = dcd(folder, "run tower --seconds 0.5 --record /dev/full");
        assert_eq!(full.status.code(), Some(1), "{full:?}");
        assert!(String::from_utf8_lossy(&full.stderr).contains("the recording is not whole"), "{full:?}");
    }
    // A recording cut off by a crash has no end. What is missing is said even to who wants to hear little.
    for (missing, line, words) in [
        (3, "replay cut.dcdr --check -q", "cut.dcdr is cut off after tick 30"),
        (3, "diff cut.dcdr a.dcdr -q", "cut.dcdr is cut off after tick 30"),
        (16, "replay cut.dcdr --check", "cut.dcdr has no end"),
        (16, "replay cut.dcdr --check -q", ""),
    ] {
        std::fs::write(folder.join("cut.dcdr"), &whole[..whole.len() - missing]).unwrap();
        let cut = dcd(folder, line);
        let said = String::from_utf8_lossy(&cut.stderr);
        assert_eq!(cut.status.code(), Some(0), "{line}: {said}");
        assert!(said.contains(words) && said.is_empty() == words.is_empty(), "{line}: {said}");
    }
}

#[test]
fn a_film_of_what_is_not_on_record_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    said(folder, "run tower --seconds 1 --record a.dcdr", 0);
    for (line, words) in [
        (
            "replay a.dcdr --gltf a.glb --gltf-seconds 50..60",
            "--gltf-seconds 50..60 begins when the replay of 1.0 s is over",
        ),
        (
            "replay a.dcdr --until 30 --gltf a.glb --gltf-seconds 0.6..1",
            "begins when the replay of 0.5 s is over",
        ),
    ] {
        let said = said(folder, line, 2);
        assert!(said.contains(words), "{line}: {said}");
        assert!(!folder.join("a.glb").exists(), "{line}");
    }
    // The recording stays as it is.
    let refused = said(folder, "replay ./a.dcdr --gltf a.dcdr", 2);
    assert!(refused.contains("--gltf a.dcdr is a recording that is to be replayed"), "{refused}");
    for (end, is_cut) in [("9", true), ("1", false)] {
        let film = dcd(folder, &format!("replay a.dcdr --gltf a.glb --gltf-seconds 0.6..{end}"));
        let notes = String::from_utf8_lossy(&film.stderr);
        assert!(film.status.success(), "{notes}");
        let note = format!("--gltf-seconds 0.6..{end}: the film ends at 1.0 s");
        assert_eq!(notes.contains(&note), is_cut, "{notes}");
    }
    assert!(folder.join("a.glb").exists());
}

#[test]
fn a_recording_that_begins_late_says_with_which_tick() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    said(folder, "run tower --seconds 0.5 --save half.dcd", 0);
    said(folder, "run half.dcd --seconds 0.5 --record late.dcdr", 0);
    for line in ["replay late.dcdr --dump 5", "replay late.dcdr --until 5 --flip 5:1"] {
        let said = said(folder, line, 2);
        assert!(said.contains("the recording begins with tick 3"), "{line}: {said}");
    }
    let flipped = json(folder, "replay late.dcdr --check --flip 31:1", 1);
    assert_eq!(flipped["mismatch"]["tick"], 31, "the first tick is disturbed as any other: {flipped}");
    let early = dcd(folder, "replay late.dcdr --until 5 --check");
    assert_eq!(early.status.code(), Some(1), "{early:?}");
    assert!(String::from_utf8_lossy(&early.stderr).contains("begins with tick 3"), "{early:?}");
    assert_eq!(json(folder, "replay late.dcdr --check", 0)["ticks"], 30);
    assert!(said(folder, "replay late.dcdr", 0).starts_with("30 ticks replayed"));
    assert_eq!(json(folder, "replay late.dcdr --until 40", 0)["ticks"], 10);
}

#[test]
fn an_empty_recording_in_a_folder_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::create_dir(folder.join("run")).unwrap();
    said(folder, "run tower --seconds 0.5 --record run/world.dcdr", 0);
    std::fs::write(folder.join("run/refused.dcdr"), "").unwrap();
    let replay = dcd(folder, "replay run --check");
    let stderr = String::from_utf8_lossy(&replay.stderr);
    assert_eq!(replay.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("refused.dcdr is empty"), "{stderr}");
    // Who names the file hears that it is none.
    assert!(said(folder, "replay run/refused.dcdr", 2).contains("not a recording"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_replay_that_ctrl_c_ends_says_nothing_of_what_it_has_not_seen() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    said(folder, "run pile --set n=200 --seconds 5 --record a.dcdr", 0);
    for question in ["--dump 300", "--flip 300:5", "--check --flip 300:5"] {
        let line = format!("replay a.dcdr {question}");
        let mut replay = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
        replay.args(line.split_whitespace()).current_dir(folder);
        let child = replay.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let id = child.id().to_string();
        let hears_ctrl_c = || {
            let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim();
            u64::from_str_radix(caught, 16).unwrap() & 2 != 0
        };
        let begun = Instant::now();
        while !hears_ctrl_c() {
            assert!(begun.elapsed() < Duration::from_secs(60), "{line}: it does not listen");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        let ended = child.wait_with_output().unwrap();
        let errors = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(130), "{line}: {errors}");
        assert!(errors.contains("ended by Ctrl-C"), "{line}: {errors}");
    }
}

#[test]
fn a_simulated_run_is_recorded_by_node() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    said(folder, "simulate --seeds 3..4 --faults kill-node --record runs", 0);
    let replayed = json(folder, "replay runs/kill-node-3 --check", 0);
    assert_eq!(replayed["mismatch"], Value::Null);
    assert!(replayed["ticks"].as_u64().unwrap() > 60, "{replayed}");
    let again = dcd(folder, "simulate --seeds 0..9 --faults stop,kill-node --record runs");
    assert_eq!(again.status.code(), Some(2), "{again:?}");
    let error = String::from_utf8_lossy(&again.stderr);
    assert!(error.contains("runs/kill-node-3 is there already"), "{error}");
    // Recordings of another world, or copies, are not taken for parts of this one.
    said(folder, "simulate --seeds 4..5 --faults kill-node --record runs", 0);
    let both = said(folder, "replay runs/kill-node-3 runs/kill-node-4 --check", 2);
    assert!(both.contains("are of two worlds: replay the recordings of each"), "{both}");
    let file = std::fs::read_dir(folder.join("runs/kill-node-3")).unwrap().next().unwrap().unwrap().path();
    std::fs::copy(&file, folder.join("runs/kill-node-3/zz.dcdr")).unwrap();
    let doubled = said(folder, "replay runs/kill-node-3 --check", 2);
    assert!(doubled.contains("runs/kill-node-3/zz.dcdr is a copy of runs/kill-node-3/"), "{doubled}");
}
