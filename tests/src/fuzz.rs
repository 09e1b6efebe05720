//! Feeds every decoder, and every state machine, with bytes that no honest process sends: none may panic, loop for ever, or say
//! what an honest process would refuse.
//!
//! Each [`Target`] is one function of bytes. `tests/tests/fuzz.rs` runs all of them for seconds, on seeds and on changes of seeds
//! that come of one number; `fuzz/` runs each for as long as one likes, by libFuzzer, with the same seeds and the same changes.

mod cluster;
mod decoders;
mod devices;
mod machines;
mod mutation;
mod nodes;
mod rules;
mod script;
mod seeds;

pub use mutation::changed;

/// A part of dcd that takes what others send.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The name of its program in `fuzz/`.
    pub name: &'static str,
    /// What its bytes are.
    pub form: Form,
    /// Runs it; panics where it finds a fault.
    pub run: fn(&[u8]),
    /// Returns inputs as honest processes send them.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// What the bytes of a target are: changes keep to that, for else most would end at the first check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One value.
    Value,
    /// One text.
    Text,
    /// Events one after the other, each with bytes of its own.
    Script,
}

/// All targets.
pub const TARGETS: [Target; 14] = [
    Target { name: "message", form: Form::Value, run: decoders::message, seeds: seeds::messages },
    Target { name: "states", form: Form::Script, run: decoders::states, seeds: seeds::states },
    Target { name: "joining", form: Form::Value, run: decoders::joining, seeds: seeds::joining },
    Target { name: "scene", form: Form::Text, run: decoders::scene, seeds: seeds::scenes },
    Target { name: "model", form: Form::Text, run: decoders::model, seeds: seeds::models },
    Target { name: "snapshot", form: Form::Value, run: decoders::snapshot, seeds: seeds::snapshots },
    Target { name: "recording", form: Form::Value, run: decoders::recording, seeds: seeds::recordings },
    Target { name: "directory", form: Form::Script, run: machines::directory, seeds: seeds::directories },
    Target { name: "server", form: Form::Script, run: machines::server, seeds: seeds::servers },
    Target { name: "client", form: Form::Script, run: machines::client, seeds: seeds::clients },
    Target { name: "leader", form: Form::Script, run: nodes::leader, seeds: seeds::leaders },
    Target { name: "member", form: Form::Script, run: nodes::member, seeds: seeds::members },
    Target { name: "device", form: Form::Script, run: devices::device, seeds: seeds::devices },
    Target { name: "rules", form: Form::Value, run: rules::rules, seeds: seeds::rules },
];

/// Returns the target of this name.
#[must_use]
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}
