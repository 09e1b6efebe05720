//! Tests that a world that a server's program builds and changes has the bits of a local one.

use std::collections::BTreeSet;
use std::path::Path;

use dcd::protocol::Pace;
use dcd::runtime::open_recording;
use dcd::{Push, Tick};

use super::*;

/// Inserts balls that touch across the border, and a box that is thrown over it into the boxes of [`build`].
fn disturb(world: &mut World, bodies: &mut Vec<BodyId>) {
    for i in 0..5 {
        let ball = RigidBodyBuilder::dynamic().translation(Vector::new(i as f32 * 0.79 - 2.0, 0.9, -4.0));
        bodies.push(world.insert(ball, ColliderBuilder::ball(0.4)).unwrap());
    }
    let thrown = RigidBodyBuilder::dynamic()
        .translation(Vector::new(5.0, 1.2, 0.3))
        .linvel(Vector::new(-15.0, 4.0, 1.0))
        .angvel(Vector::new(2.0, 5.0, 20.0));
    bodies.push(world.insert(thrown, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap());
}

fn bits(world: &World, bodies: &[BodyId]) -> Vec<[u64; 3]> {
    bodies.iter().map(|&id| world.pose(id).unwrap().translation.map(f64::to_bits)).collect()
}

#[test]
fn what_is_built_before_the_first_tick_is_a_local_world_to_the_bit() {
    const TICKS: u64 = 150;
    let mut local = World::new(cut()).unwrap();
    let mut expected = build(&mut local);
    disturb(&mut local, &mut expected);
    (0..TICKS).for_each(|_| local.step().unwrap());

    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig {
        nodes: 2,
        pace: Pace::Unpaced,
        last_tick: Some(Tick(TICKS)),
        ..ServeConfig::new(folder.path())
    };
    let mut server = serve(config);
    let mut bodies = build(&mut server);
    disturb(&mut server, &mut bodies);
    assert_eq!(bodies, expected, "ids are counted as in a local world");
    server.step().unwrap();
    let _nodes = [node(&server), node(&server)];
    let deadline = Instant::now() + LIMIT;
    while server.step().is_ok() {
        assert!(Instant::now() < deadline, "it ends by itself");
        server.poll(Duration::from_millis(5));
    }
    assert_eq!(server.tick(), Tick(TICKS));
    assert_eq!(bits(&server, &bodies), bits(&local, &bodies));
}

/// The acts of a program on a running world, each at a tick of its own.
#[derive(Clone, Copy, Debug)]
enum Deed {
    Drop,
    Push,
    Throw,
    Hit,
    Remove,
}

/// Does a deed to the ball that it drops, which is the last body, or to a box or the pendulum of [`build`].
/// Returns the body concerned.
fn act(world: &mut World, bodies: &mut Vec<BodyId>, deed: Deed) -> BodyId {
    let [post, weight, last] = [bodies[21], bodies[23], bodies[bodies.len() - 1]];
    match deed {
        // On the border.
        Deed::Drop => {
            let ball = RigidBodyBuilder::dynamic().translation(Vector::new(-0.3, 3.0, 9.0));
            bodies.push(world.insert(ball, ColliderBuilder::ball(0.6)).unwrap());
            bodies[bodies.len() - 1]
        }
        Deed::Push => {
            world.push(&Push::impulse(weight, [-0.1, 0.2, 0.1]).at([0.1, 2.3, -7.9])).unwrap();
            weight
        }
        // To the other side of the border.
        Deed::Throw => {
            world.set_velocity(last, Velocity::linear([3.0, 4.0, -0.5])).unwrap();
            last
        }
        // A box of the right side against those of the left side.
        Deed::Hit => {
            world.push(&Push::impulse(bodies[5], [-9.0, 6.0, 1.0]).at([2.6, 1.4, 0.2])).unwrap();
            bodies[5]
        }
        // The pendulum falls off.
        Deed::Remove => {
            world.remove(post).unwrap();
            post
        }
    }
}

/// Returns the tick in which a node did each deed that the program told it, by the node's recording. Each
/// tick computed again from the recording must have the same bits.
fn ticks_of(recording: &Path, told: &[(Deed, BodyId)]) -> Vec<Tick> {
    let mut replayed = open_recording(recording, 1, None).unwrap();
    let mut done = vec![BTreeSet::new(); told.len()];
    while let Some(settled) = replayed.advance().unwrap() {
        assert_eq!(settled.replayed, settled.recorded, "{}", settled.tick);
        for (done, &(deed, body)) in done.iter_mut().zip(told) {
            let word = match deed {
                Deed::Drop => "inserted",
                Deed::Push | Deed::Hit => "pushed",
                Deed::Throw => "input 0 ",
                Deed::Remove => "removed",
            };
            done.extend(replayed.acted_on(body).iter().filter_map(|act| {
                let (tick, what) = act.strip_prefix("tick ")?.split_once(": ")?;
                what.starts_with(word).then(|| Tick(tick.parse().unwrap()))
            }));
        }
    }
    done.iter().zip(told).for_each(|(done, told)| assert_eq!(done.len(), 1, "{told:?}: {done:?}"));
    done.into_iter().flatten().collect()
}

#[test]
fn what_a_running_world_is_told_leaves_the_bits_of_a_local_world_that_is_told_it_at_the_same_ticks() {
    const TICKS: u64 = 240;
    let folder = tempfile::tempdir().unwrap();
    let config = ServeConfig {
        nodes: 2,
        last_tick: Some(Tick(TICKS)),
        ..ServeConfig::new(folder.path().join("data"))
    };
    let mut server = serve(config);
    let mut bodies = build(&mut server);
    server.step().unwrap();
    let recording = folder.path().join("node.dcdr");
    let recorded = JoinConfig { record: Some(recording.clone()), ..join(&server, JoinRole::Node) };
    let nodes = [World::join_as_node(&recorded).unwrap(), node(&server)];
    let plan = [(30, Deed::Drop), (60, Deed::Push), (80, Deed::Hit), (100, Deed::Throw), (120, Deed::Remove)];
    let mut plan = plan.into_iter().peekable();
    let mut told = Vec::new();
    let deadline = Instant::now() + LIMIT;
    while server.step().is_ok() {
        assert!(Instant::now() < deadline, "it ends by itself");
        if let Some((_, deed)) = plan.next_if(|&(tick, _)| server.tick() >= Tick(tick)) {
            told.push((deed, act(&mut server, &mut bodies, deed)));
        }
        server.poll(Duration::from_millis(5));
    }
    assert_eq!((server.tick(), told.len()), (Tick(TICKS), 5));
    drop(nodes);

    let ticks = ticks_of(&recording, &told);
    println!("told at {ticks:?}");
    let mut local = World::new(cut()).unwrap();
    let mut all = build(&mut local);
    for tick in 1..=TICKS {
        for (&(deed, body), _) in told.iter().zip(&ticks).filter(|(_, at)| at.0 == tick) {
            assert_eq!(act(&mut local, &mut all, deed), body, "ids are counted as in a local world");
        }
        local.step().unwrap();
    }
    all.retain(|&id| id != told[4].1);
    assert_eq!(bits(&server, &all), bits(&local, &all));
    assert!(!server.contains(told[4].1) && !local.contains(told[4].1));
}
