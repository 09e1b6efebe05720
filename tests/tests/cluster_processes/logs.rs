//! Tests the log of processes in the form that programs read (JSON).

use serde_json::Value;

use crate::process::{Process, Server, dcd};

#[test]
fn each_line_of_a_json_log_is_an_object_that_says_who_wrote_it() {
    let mut server = Server::start(&["pile"]);
    let token = server.token("node");
    let args = ["node", "-v", "--log-format", "json", "--server", &server.address, "--token", &token];
    let mut node = Process::start(dcd(&args).arg("--view"));
    assert_eq!(node.line("joined as "), "n1");
    server.view();
    // Messages for people, and failures, are lines of their own, whatever the filter.
    let told = |more: [&str; 2]| {
        let mut node = dcd(&["node", "--log-format", "json", "--server", &server.address]);
        Process::start(node.args(more).env("RUST_LOG", "off"))
    };
    let mut leaves = told(["--token", &server.token("node")]);
    leaves.line("joined as ");
    leaves.interrupt();
    for (ended, code, level, said) in [
        (leaves.end(), 130, "INFO", "leaving: regions are handed over first"),
        (told(["--token-file", "nowhere"]).end(), 2, "ERROR", "write a token of `dcd token` to it"),
    ] {
        let line: Value = serde_json::from_str(&ended.errors).unwrap();
        assert_eq!((ended.code(), line["level"].as_str()), (Some(code), Some(level)), "{ended:?}");
        assert!(line["message"].as_str().unwrap().contains(said), "{ended:?}");
    }
    server.stop();
    let ended = node.end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    let lines: Vec<Value> = ended.errors.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let text = |line: &Value, key: &str| line[key].as_str().map(str::to_owned);
    for line in &lines {
        assert!(
            ["timestamp", "level", "target", "message"].iter().all(|key| text(line, key).is_some()),
            "{line}"
        );
    }
    let shown = |line: &Value| text(line, "message").is_some_and(|text| text.starts_with("view http://"));
    assert!(lines.iter().any(shown), "{ended:?}");
    let stops = lines.iter().find(|line| text(line, "message").is_some_and(|text| text == "the node stops"));
    let stops = stops.unwrap_or_else(|| panic!("{ended:?}"));
    assert_eq!(
        (text(&stops["span"], "role"), text(&stops["span"], "node")),
        (Some("node".into()), Some("n1".into()))
    );
    // The line says where the world was: it had already begun.
    assert!(stops["span"]["tick"].as_u64() > Some(0) && stops["span"]["view"].as_u64() >= Some(1), "{stops}");
}

#[test]
fn an_empty_filter_is_none_and_one_that_cannot_be_read_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let run = |filter: &str| {
        let args = ["run", "tower", "--seconds", "0.1", "-v"];
        Process::start(dcd(&args).current_dir(folder.path()).env("RUST_LOG", filter)).end()
    };
    for empty in ["", " "] {
        let ended = run(empty);
        assert!(ended.errors.contains("stepping") && !ended.errors.contains("RUST_LOG"), "{ended:?}");
    }
    let wrong = run("dcd=inof");
    assert!(
        wrong.errors.contains("stepping") && wrong.errors.contains("RUST_LOG cannot be read"),
        "{wrong:?}"
    );
    assert_eq!(run("off").errors, "");
}
