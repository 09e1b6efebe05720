//! Tests `dcd run --save` and `dcd run FILE.dcd` as real processes.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn dcd(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dcd-under-test"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .env_remove("RUST_LOG")
        .output()
        .expect("the binary was built for this test")
}

fn report(folder: &Path, line: &str) -> Value {
    let output = dcd(folder, &format!("{line} --json"));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}: {stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refusal(folder: &Path, line: &str) -> String {
    let output = dcd(folder, line);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{line}: {stderr}");
    assert!(output.stdout.is_empty(), "{line}");
    stderr
}

#[test]
fn two_seconds_and_two_more_are_four() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for scene in [
        "pile --set n=80 --regions 3",
        "tower --set sleep=0 --cut y=5 --coupling overlap",
        "chain --regions 2 --coupling owner",
        "gas --set n=60 --regions 8",
    ] {
        let whole = report(folder, &format!("run {scene} --seconds 4"));
        let first = report(folder, &format!("run {scene} --seconds 2 --save half.dcd"));
        assert_ne!(first["state_hash"], whole["state_hash"], "{scene}");
        let second = report(folder, "run half.dcd --seconds 2 --threads 2 --save half.dcd");
        for key in ["state_hash", "transfers", "contacts", "regions", "bodies", "coupling", "exchanges"] {
            assert_eq!(second[key], whole[key], "{scene}: {key}");
        }
        assert_eq!((second["lost"].as_u64(), second["doubled"].as_u64()), (Some(0), Some(0)), "{scene}");
        // The file that the run began from was replaced.
        let last = report(folder, "run half.dcd --seconds 0.1");
        assert_ne!(last["state_hash"], whole["state_hash"], "{scene}");
    }
    let left: Vec<_> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name()).collect();
    assert_eq!(left, ["half.dcd"], "nothing half written stays");
}

#[test]
fn people_hear_what_was_saved_and_restored() {
    let folder = tempfile::tempdir().unwrap();
    let said = |line: &str| String::from_utf8(dcd(folder.path(), line).stderr).unwrap();
    assert!(said("run tower --seconds 0.1 --save t.dcd").starts_with("saved t.dcd: 0."));
    assert!(said("run t.dcd --seconds 0.1").starts_with("restored t.dcd: 0."));
    assert_eq!(said("run t.dcd --seconds 0.1 --quiet"), "");
}

#[test]
fn options_that_contradict_a_snapshot_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    report(folder.path(), "run tower --seconds 0.1 --save t.dcd");
    for option in [
        "--set n=3",
        "--regions 2",
        "--cut y=5",
        "--coupling owner",
        "--exchanges 2",
        "--depth 3",
        "--island-limit 3",
        "--tolerance 0.1",
        "--preset draft",
    ] {
        let said = refusal(folder.path(), &format!("run t.dcd {option}"));
        let name = option.split_whitespace().next().unwrap();
        assert!(
            said.contains("t.dcd is a snapshot") && said.contains(&format!("leave {name} out")),
            "{said}"
        );
    }
    let said = refusal(folder.path(), "run tower --regions 0 --save t.dcd");
    assert!(said.contains("--save") && said.contains("--regions 0"), "{said}");
}

#[test]
fn snapshots_that_are_none_or_cannot_be_are_named_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.dcd");
    report(folder.path(), "run tower --seconds 0.1 --save t.dcd");
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    assert!(refusal(folder.path(), "run t.dcd").contains("is damaged within the block that begins at byte"));
    std::fs::write(&path, &bytes[..middle]).unwrap();
    assert!(refusal(folder.path(), "run t.dcd").contains(&format!("is cut off after {middle} bytes")));
    std::fs::write(&path, "[world]\n").unwrap();
    assert!(refusal(folder.path(), "run t.dcd").contains("not a snapshot of dcd"));
    assert!(refusal(folder.path(), "run nowhere.dcd").contains("cannot go on with nowhere.dcd"));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("t.dcd", folder.path().join("link.dcd")).unwrap();
        report(folder.path(), "run tower --seconds 0.1 --save link.dcd");
        assert!(std::fs::symlink_metadata(folder.path().join("link.dcd")).unwrap().is_symlink());
        assert!(
            std::fs::read(&path).unwrap().starts_with(&bytes[..8]),
            "the file that it leads to is written"
        );
        let said = refusal(folder.path(), "run tower --seconds 1e9 --save /dev/null");
        assert!(said.contains("it is a device or a pipe"), "{said}");
    }
    // If the error came late, a run this long would never end.
    let said = refusal(folder.path(), "run tower --seconds 1e9 --save no/such.dcd");
    assert!(said.contains("no/such.dcd") && said.contains("give --save a file in a folder"), "{said}");
}
