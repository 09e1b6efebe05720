//! Tests what `packaging/` has for operators: systemd units, and the option files that they name.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::{Process, dcd, token};

fn packaging() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../packaging")
}

/// Reads a file of `packaging/` as it would be installed below `root`, but with the program under test, ports
/// of the system's choice and the repository's scenes.
fn installed(file: &str, root: &Path) -> String {
    let text = fs::read_to_string(packaging().join(file)).unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../dcd/scenes");
    let text = ["0.0.0.0:7420", "0.0.0.0:7421", "127.0.0.1:9420", "127.0.0.1:9421"]
        .iter()
        .fold(text, |text, address| text.replace(address, "127.0.0.1:0"));
    text.replace("/usr/local/bin/dcd", env!("CARGO_BIN_EXE_dcd-under-test"))
        .replace("/usr/local/share/dcd", scenes.to_str().unwrap())
        .replace("/etc/", &format!("{}/etc/", root.display()))
        .replace("/var/lib/", &format!("{}/var/lib/", root.display()))
}

/// Returns the arguments with which a unit starts the program.
fn started(unit: &str) -> Vec<String> {
    let line =
        unit.lines().find_map(|line| line.strip_prefix("ExecStart=")).expect("a unit starts something");
    line.split(' ').skip(1).map(str::to_owned).collect()
}

#[test]
fn the_units_start_a_server_and_nodes_with_the_options_in_their_files() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    for folder in ["etc/dcd", "var/lib/dcd-node"] {
        fs::create_dir_all(root.join(folder)).unwrap();
    }
    let options = |file: &str, server: &str| {
        let text = installed(file, root).replace("192.0.2.7:7420", server);
        fs::write(root.join("etc/dcd").join(file), text).unwrap();
    };
    options("server.toml", "");
    let unit = installed("systemd/dcd-server.service", root);
    for line in ["RestartPreventExitStatus=3", "PrivateTmp=no"] {
        assert!(unit.lines().any(|known| known == line), "{line}");
    }
    let args = started(&unit);
    let mut server = Process::start(&mut dcd(&args.iter().map(String::as_str).collect::<Vec<_>>()));
    let address = server.line("listening ");
    server.line("metrics http://127.0.0.1:");
    options("node.toml", &address);
    let data = root.join("var/lib/dcd");
    fs::write(root.join("etc/dcd/node-token"), token(&data, "node")).unwrap();
    let unit = installed("systemd/dcd-node.service", root);
    assert!(unit.lines().any(|known| known == "RestartPreventExitStatus=3"));
    let args = started(&unit);
    let mut node = Process::start(&mut dcd(&args.iter().map(String::as_str).collect::<Vec<_>>()));
    assert_eq!(node.line("joined as "), "n1");
    assert!(server.line("view ").contains("n1 leads"));
    assert!(root.join("var/lib/dcd-node/identity").exists());
    node.interrupt();
    assert_eq!(node.end().code(), Some(130), "SuccessExitStatus");
    fs::remove_file(root.join("etc/dcd/node-token")).unwrap();
    let mut again = Process::start(&mut dcd(&args.iter().map(String::as_str).collect::<Vec<_>>()));
    assert_eq!(again.line("joined as "), "n1", "by its identity");
    server.interrupt();
    let ended = server.end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    let is_object =
        |line: &str| serde_json::from_str::<serde_json::Value>(line).is_ok_and(|line| line.is_object());
    assert!(ended.errors.lines().all(is_object), "its log is JSON: {ended:?}");
}

#[test]
fn systemd_finds_nothing_wrong_with_the_units() {
    let folder = tempfile::tempdir().unwrap();
    let units = ["dcd-server.service", "dcd-node.service"].map(|name| {
        let path = folder.path().join(name);
        fs::write(&path, installed(&format!("systemd/{name}"), Path::new(""))).unwrap();
        path
    });
    let Ok(verified) = Command::new("systemd-analyze").args(["verify", "--man=no"]).args(&units).output()
    else {
        println!("systemd-analyze is missing: units are not verified");
        return;
    };
    let said = String::from_utf8_lossy(&verified.stderr);
    assert!(verified.status.success() && said.is_empty(), "{said}");
}

#[test]
fn the_container_has_what_it_names() {
    let file = fs::read_to_string(packaging().join("container/Containerfile")).unwrap();
    let mut copied = 0;
    for line in file.lines().filter_map(|line| line.strip_prefix("COPY ")) {
        let mut words: Vec<_> = line.split(' ').collect();
        words.pop();
        if words[0].starts_with("--from") || words == ["packaging/vendor"] {
            continue;
        }
        for word in words {
            assert!(packaging().join("..").join(word).exists(), "{word}");
            copied += 1;
        }
    }
    assert!(copied > 6, "{copied}");
    // The build context of the image contains just what the image copies.
    let sent = fs::read_to_string(packaging().join("../.dockerignore")).unwrap();
    let sent: BTreeSet<_> = sent.lines().filter_map(|line| line.strip_prefix('!')).collect();
    let wanted =
        file.lines().filter_map(|line| line.strip_prefix("COPY ")).filter(|line| !line.starts_with("--from"));
    // The scenes in the image are below the folder `dcd`.
    let wanted =
        wanted.flat_map(|line| line.split(' ').rev().skip(1)).filter(|word| !word.starts_with("dcd/"));
    assert_eq!(sent, wanted.collect());
    let manifest = fs::read_to_string(packaging().join("../Cargo.toml")).unwrap();
    let members = manifest.lines().find_map(|line| line.strip_prefix("members = ")).unwrap();
    for member in members.split('"').skip(1).step_by(2) {
        assert!(file.contains(&format!("COPY {member} {member}\n")), "{member}");
    }
}
