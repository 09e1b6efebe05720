//! Tests random scenes, cuts, couplings, changes and queries: the answers are those of one Rapier world.

use dcd::physics::Coupling;
use dcd::protocol::WorldPose;
use dcd::scene::SceneBody;
use dcd::space::BodyId;
use proptest::prelude::*;

use super::asking::{Query, questions};
use super::config;
use super::scenery::{Bare, Thing, place, scene, things, world};

/// A change after the last step: a body is moved, removed, or inserted.
#[derive(Clone, Debug)]
enum Change {
    Move(usize, [f32; 3]),
    Remove(usize),
    Insert(usize, [f32; 3]),
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let change = prop_oneof![
        (0usize..24, place()).prop_map(|(body, to)| Change::Move(body, to)),
        (0usize..24).prop_map(Change::Remove),
        (0usize..24, place()).prop_map(|(like, at)| Change::Insert(like, at)),
    ];
    prop::collection::vec(change, 0..6)
}

fn agrees(
    things: &[Thing],
    (regions, coupling, steps): (usize, Coupling, usize),
    changes: &[Change],
    questions: &[Query],
) -> Result<(), TestCaseError> {
    let scene = scene(things);
    let mut world = world(&scene, regions, coupling);
    let mut bodies: Vec<(BodyId, SceneBody)> = scene
        .bodies
        .iter()
        .enumerate()
        .map(|(i, body)| (BodyId::persistent(i as u32), body.clone()))
        .collect();
    for _ in 0..steps {
        world.step().unwrap();
    }
    for change in changes {
        match *change {
            Change::Move(which, to) => {
                let (id, _) = bodies[which % bodies.len()];
                let pose = WorldPose { translation: to.map(f64::from), ..world.pose(id).unwrap() };
                world.set_pose(id, pose).unwrap();
            }
            Change::Remove(which) if bodies.len() > 1 => {
                let (id, _) = bodies.remove(which % bodies.len());
                world.remove(id).unwrap();
            }
            Change::Remove(_) => {}
            Change::Insert(like, at) => {
                let body = bodies[like % bodies.len()].1.clone();
                let pose = WorldPose { translation: at.map(f64::from), ..body.pose };
                let id = world.insert_at(pose, body.body.clone(), body.colliders.clone()).unwrap();
                bodies.push((id, body));
            }
        }
    }
    let bare = Bare::of(&world, &bodies);
    questions.iter().try_for_each(|question| question.check(&world, &bare))
}

fn setting() -> impl Strategy<Value = (usize, Coupling, usize)> {
    let regions = prop::sample::select(vec![1usize, 2, 4, 8]);
    (regions, prop::sample::select(Coupling::ALL.to_vec()), 0usize..6)
}

proptest! {
    #![proptest_config(config(150))]

    #[test]
    fn a_partitioned_world_answers_as_one_world_does(
        things in things(),
        setting in setting(),
        changes in changes(),
        questions in questions(),
    ) {
        agrees(&things, setting, &changes, &questions)?;
    }
}

proptest! {
    #![proptest_config(config(10_000))]

    /// Takes some seconds: `cargo test --release -p dcd-tests --test one_world -- --ignored`.
    #[test]
    #[ignore = "slow"]
    fn ten_thousand_scenes_answer_as_one_world_does(
        things in things(),
        setting in setting(),
        changes in changes(),
        questions in questions(),
    ) {
        agrees(&things, setting, &changes, &questions)?;
    }
}
