//! Tests random operations on a partitioned world and on one Rapier world in parallel.

use dcd::physics::Coupling;
use proptest::prelude::*;

use super::asking::{Query, question};
use super::config;
use super::scenery::{Thing, place, thing};
use super::twin::Twin;

/// An operation on both worlds. Bodies and joints are numbered among the existing ones, modulo their count.
#[derive(Clone, Debug)]
pub(crate) enum Operation {
    Insert(Thing),
    Remove(usize),
    Tie { a: usize, b: usize, kind: u8 },
    Untie(usize),
    Motor(usize, f32),
    Force(usize, [f32; 3]),
    ForgetForces(usize),
    Impulse(usize, [f32; 3]),
    Velocity(usize, [f32; 3], [f32; 3]),
    Teleport(usize, [f32; 3]),
    SendTo(usize, [f32; 3]),
    Kind(usize, bool),
    Enable(usize, bool),
    Sleep(usize),
    Groups(usize, u32, u32),
    Sensor(usize, bool),
    Collider(usize, bool),
    Ask(Query),
    Step(usize),
}

fn operation() -> impl Strategy<Value = Operation> {
    use Operation::*;
    let body = || 0usize..24;
    let push = || prop::array::uniform3(-20.0f32..20.0);
    prop_oneof![
        6 => thing().prop_map(Insert),
        2 => body().prop_map(Remove),
        2 => (body(), body(), 0u8..6).prop_map(|(a, b, kind)| Tie { a, b, kind }),
        1 => body().prop_map(Untie),
        1 => (body(), -3.0f32..3.0).prop_map(|(joint, speed)| Motor(joint, speed)),
        1 => (body(), push()).prop_map(|(body, force)| Force(body, force)),
        1 => body().prop_map(ForgetForces),
        1 => (body(), push()).prop_map(|(body, impulse)| Impulse(body, impulse)),
        1 => (body(), push(), push()).prop_map(|(body, v, w)| Velocity(body, v, w.map(|w| w * 0.2))),
        2 => (body(), place()).prop_map(|(body, to)| Teleport(body, to)),
        1 => (body(), place()).prop_map(|(body, to)| SendTo(body, to)),
        1 => (body(), any::<bool>()).prop_map(|(body, dynamic)| Kind(body, dynamic)),
        1 => (body(), any::<bool>()).prop_map(|(body, on)| Enable(body, on)),
        1 => body().prop_map(Sleep),
        1 => (body(), 0u32..8, 0u32..8).prop_map(|(body, member, meets)| Groups(body, member, meets)),
        1 => (body(), any::<bool>()).prop_map(|(body, sensor)| Sensor(body, sensor)),
        1 => (body(), any::<bool>()).prop_map(|(body, on)| Collider(body, on)),
        4 => question().prop_map(Ask),
        6 => (1usize..9).prop_map(Step),
    ]
}

fn setting() -> impl Strategy<Value = (usize, Coupling, bool)> {
    let regions = prop::sample::select(vec![1usize, 2, 4, 8]);
    (regions, prop::sample::select(Coupling::ALL.to_vec()), any::<bool>())
}

fn play(
    (regions, coupling, gravity): (usize, Coupling, bool),
    operations: &[Operation],
) -> Result<(), TestCaseError> {
    let mut twin = Twin::new(regions, coupling, gravity);
    for (index, operation) in operations.iter().enumerate() {
        let done = twin.apply(operation).and_then(|()| twin.check());
        done.map_err(|error| match error {
            TestCaseError::Fail(why) => TestCaseError::fail(format!("after operation {index}: {why}")),
            reject => reject,
        })?;
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn what_is_done_to_a_partitioned_world_comes_out_as_in_one_world(
        setting in setting(),
        operations in prop::collection::vec(operation(), 1..40),
    ) {
        play(setting, &operations)?;
    }
}

proptest! {
    #![proptest_config(config(10_000))]

    /// Takes some minutes: `cargo test --release -p dcd-tests --test one_world -- --ignored`.
    #[test]
    #[ignore = "slow"]
    fn ten_thousand_sequences_come_out_as_in_one_world(
        setting in setting(),
        operations in prop::collection::vec(operation(), 1..40),
    ) {
        play(setting, &operations)?;
    }
}
