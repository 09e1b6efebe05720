//! Feeds every decoder and every state machine with bytes that no honest process sends. None may panic, loop
//! for ever, or send what an honest process would refuse.
//!
//! Each [`Target`] is one function of bytes. `tests/tests/fuzz.rs` runs all targets for seconds, on seeds and
//! on mutations of seeds that follow from one number. `fuzz/` runs each target for as long as one likes, by
//! libFuzzer, with the same seeds and the same mutations.

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

/// A part of dcd that takes in what other processes send.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The name of the target's program in `fuzz/`.
    pub name: &'static str,
    /// The structure of the target's bytes.
    pub form: Form,
    /// The number of mutated seeds in a quick run, chosen to take some seconds. A long run multiplies the
    /// number of each target by the same factor.
    pub quick: u64,
    /// Runs the target on one input. Panics where it finds a fault.
    pub run: fn(&[u8]),
    /// Returns inputs as honest processes send them.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// The structure of a target's bytes. Mutations keep to it, since otherwise most inputs would end at the
/// first check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A single value.
    Value,
    /// A text.
    Text,
    /// A sequence of events, each with bytes of its own.
    Script,
}

/// All targets.
pub const TARGETS: [Target; 16] = [
    target_of("message", Form::Value, 100_000, decoders::message, seeds::messages),
    target_of("states", Form::Script, 2_000, decoders::states, seeds::states),
    target_of("joining", Form::Value, 20_000, decoders::joining, seeds::joining),
    target_of("scene", Form::Text, 500, decoders::scene, seeds::scenes),
    target_of("model", Form::Text, 500, decoders::model, seeds::models),
    target_of("page", Form::Value, 20_000, decoders::page, seeds::pages),
    target_of("config", Form::Text, 300, decoders::config, seeds::configs),
    target_of("snapshot", Form::Value, 500, decoders::snapshot, seeds::snapshots),
    target_of("recording", Form::Value, 200, decoders::recording, seeds::recordings),
    target_of("directory", Form::Script, 2_000, machines::directory, seeds::directories),
    target_of("server", Form::Script, 1_000, machines::server, seeds::servers),
    target_of("client", Form::Script, 2_000, machines::client, seeds::clients),
    target_of("leader", Form::Script, 1_000, nodes::leader, seeds::leaders),
    target_of("member", Form::Script, 1_000, nodes::member, seeds::members),
    target_of("device", Form::Script, 200, devices::device, seeds::devices),
    target_of("rules", Form::Value, 5_000, rules::rules, seeds::rules),
];

const fn target_of(
    name: &'static str,
    form: Form,
    quick: u64,
    run: fn(&[u8]),
    seeds: fn() -> Vec<Vec<u8>>,
) -> Target {
    Target { name, form, quick, run, seeds }
}

/// Returns the target of this name.
#[must_use]
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}
