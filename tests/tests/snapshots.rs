//! Tests, by stored texts, what people and programs rely on: help texts, keys, and the bytes of a message. A
//! change here is a change for them; review it with `cargo insta review` or `INSTA_UPDATE=always`.

use std::process::Command;

use dcd::protocol::{self, FromClient, Input, Message, Velocity, WorldPose};
use dcd::space::{BodyId, ClientId, Tick};

fn dcd(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_dcd-under-test")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_scenes_of_the_library_and_their_parameters() {
    insta::assert_snapshot!(dcd(&["scenes"]));
}

#[test]
fn the_keys_of_a_run() {
    let json = dcd(&["run", "tower", "--seconds", "1", "--json"]);
    let report: serde_json::Value = serde_json::from_str(json.lines().last().unwrap()).unwrap();
    let keys: Vec<_> = report.as_object().unwrap().keys().cloned().collect();
    insta::assert_snapshot!(keys.join(" "));
}

#[test]
fn the_bytes_of_a_message() {
    let client = ClientId(7);
    let input = Input {
        body: BodyId::avatar(client, 2),
        logical_time: 300,
        tick: Tick(1_000),
        velocity: Velocity { linear: [1.0, 0.0, -2.0], angular: [0.0, 0.5, 0.0] },
        pose: Some(WorldPose::at([100_000.5, 0.0, -1.0])),
        drive: None,
    };
    let bytes = protocol::encode(&Message::FromClient(client, FromClient::Input(input)));
    let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    insta::assert_snapshot!(format!("version {}: {}", protocol::VERSION, hex.join("")));
}
