//! Tests that a restored world goes on to the same bits, and that damaged snapshots are refused.

use proptest::prelude::*;
use rapier3d::prelude::*;

use super::*;
use crate::physics::{Coupling, LinkSettings, StepSettings};
use crate::protocol::{Velocity, WorldPose};
use crate::runtime::{Partitioning, WorldConfig};
use crate::scene::{Params, Scene, library};
use crate::space::{Axis, BodyId, JointId};

fn saved(world: &LocalWorld) -> Vec<u8> {
    let mut bytes = Vec::new();
    world.save(&mut bytes).unwrap();
    bytes
}

fn restored(bytes: &[u8], threads: usize) -> LocalWorld {
    LocalWorld::restore(bytes, threads).unwrap()
}

/// Returns whether a scene has no height fields. Parry keeps a hash map for contacts with them, whose order
/// differs each time.
fn has_stable_bytes(scene: &Scene) -> bool {
    scene.bodies.iter().flat_map(|body| &body.colliders).all(|c| c.shape.as_heightfield().is_none())
}

/// Steps a world and one that is restored from it side by side. Equal bytes say more than equal poses: they
/// hold all that a world keeps, even what shows only much later.
fn continues_alike(world: &mut LocalWorld, ticks: u64, bytes: bool, what: &str) {
    let first = saved(world);
    let mut again = restored(&first, 3);
    assert!(!bytes || saved(&again) == first, "{what}: what is restored is not what was saved");
    for tick in 1..=ticks {
        world.step().unwrap();
        again.step().unwrap();
        let when = format!("{what}: {tick} ticks later");
        assert_eq!(world.state_hash(), again.state_hash(), "{when}");
        assert_eq!(world.events(), again.events(), "{when}");
        assert_eq!(world.handovers(), again.handovers(), "{when}");
        assert_eq!(world.stats().disagreement_m_s, again.stats().disagreement_m_s, "{when}");
    }
    assert!(!bytes || saved(world) == saved(&again), "{what}: they move alike and keep unlike things");
}

/// Steps a world from a checkpoint, goes back to it, and steps the world again. The same must happen, and the
/// same must be kept in the end.
fn goes_back_alike(world: &mut LocalWorld, ticks: u64, bytes: bool, what: &str) {
    let first = saved(world);
    let checkpoint = world.checkpoint();
    let pass = |world: &mut LocalWorld| {
        let step = |_| {
            world.step().unwrap();
            (world.state_hash(), world.events().clone(), world.handovers().to_vec())
        };
        (0..ticks).map(step).collect::<Vec<_>>()
    };
    let once = pass(world);
    let last = saved(world);
    world.rewind(&checkpoint).unwrap();
    assert!(!bytes || saved(world) == first, "{what}: it went back to something else");
    assert!(pass(world) == once, "{what}: it goes on otherwise");
    assert!(!bytes || saved(world) == last, "{what}: it moves alike and keeps unlike things");
}

/// Returns scenes of every kind: stacks, rain, elastic gas, joints, height fields, hulls, sleep, kinematic
/// bodies.
fn zoo() -> Vec<Scene> {
    let small = |name| match name {
        "pile" => "n=150",
        "heap" => "n=100",
        "terrain" | "dve" => "n=60",
        "gas" => "n=80",
        "convoy" => "cars=3 road=100",
        "vault" => "arches=2",
        "conveyor" => "n=48 belts=4",
        "drum" | "sweep" | "domino_ring" => "n=60",
        "net" => "edge=8",
        "ragdolls" => "count=8",
        "town" => "n=600 cars=2",
        _ => "",
    };
    let mut scenes: Vec<_> = library()
        .iter()
        .map(|info| {
            let set: Vec<_> = small(info.name).split_whitespace().map(str::to_owned).collect();
            Scene::named(info.name, &Params::from_args(&set).unwrap()).unwrap()
        })
        .collect();
    for file in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes")).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            scenes.push(Scene::open(path.to_str().unwrap(), &Params::new()).unwrap());
        }
    }
    scenes
}

fn world_of(scene: &Scene, coupling: Coupling, partitioning: Partitioning) -> LocalWorld {
    let config = WorldConfig::for_scene(scene);
    let step = config.step.with_coupling(coupling);
    LocalWorld::from_scene(scene, WorldConfig { partitioning, step, ..config }).unwrap()
}

/// Guards against a forgotten field, by all scenes, couplings, cuts and moments.
#[test]
fn a_restored_world_goes_on_to_the_same_bits() {
    for scene in zoo() {
        for coupling in Coupling::ALL {
            // One region agrees with nobody, by any coupling.
            let counts: &[usize] = if coupling == Coupling::Auto { &[1, 5] } else { &[5] };
            for &regions in counts {
                let mut world = world_of(&scene, coupling, Partitioning::Regions(regions));
                for tick in [0u64, 1, 30, 75] {
                    while world.tick().0 < tick {
                        world.step().unwrap();
                    }
                    let what = format!("{}, {regions} by {}, tick {tick}", scene.name, coupling.name());
                    continues_alike(&mut world, 12, has_stable_bytes(&scene), &what);
                }
            }
        }
    }
}

#[test]
fn a_world_that_went_back_goes_on_to_the_same_bits() {
    for scene in zoo() {
        for coupling in Coupling::ALL {
            let mut world = world_of(&scene, coupling, Partitioning::Regions(5));
            (0..30).for_each(|_| world.step().unwrap());
            let what = format!("{} by {}", scene.name, coupling.name());
            goes_back_alike(&mut world, 12, has_stable_bytes(&scene), &what);
        }
    }
}

/// Makes a world with bodies of every kind on a floor that is cut twice, some of them joined, all with
/// contact events.
fn busy(coupling: Coupling) -> (LocalWorld, Vec<BodyId>, Vec<JointId>) {
    let step = StepSettings::default().with_coupling(coupling);
    let cuts = Partitioning::Cuts(vec![(Axis::X, 0.0), (Axis::Z, 0.3)]);
    let mut world =
        LocalWorld::new(WorldConfig { partitioning: cuts, step, ..WorldConfig::default() }).unwrap();
    let told = ActiveEvents::COLLISION_EVENTS | ActiveEvents::CONTACT_FORCE_EVENTS;
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(30.0, 0.5, 30.0)).unwrap();
    let mut bodies = Vec::new();
    for i in 0..24 {
        let at =
            Vector::new((i % 6) as f32 * 0.9 - 2.3, 1.0 + (i / 12) as f32 * 1.05, (i / 6 % 2) as f32 * 0.9);
        let kind = match i % 8 {
            6 => RigidBodyBuilder::kinematic_position_based(),
            7 => RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::new(0.3, 0.0, 0.1)),
            _ => RigidBodyBuilder::dynamic(),
        };
        let collider = ColliderBuilder::cuboid(0.4, 0.45, 0.4).active_events(told);
        bodies.push(world.insert(kind.translation(at), collider).unwrap());
    }
    let tie = |world: &mut LocalWorld, a: usize, b: usize| {
        let joint = SphericalJointBuilder::new()
            .local_anchor1(Vector::new(0.45, 0.0, 0.0))
            .local_anchor2(Vector::new(-0.45, 0.0, 0.0));
        world.insert_joint(bodies[a], bodies[b], joint).unwrap()
    };
    let joints = [(0, 1), (1, 2), (2, 3), (12, 13), (15, 16)].map(|(a, b)| tie(&mut world, a, b)).to_vec();
    (world, bodies, joints)
}

#[test]
fn what_users_changed_since_the_last_step_is_not_lost() {
    for coupling in Coupling::ALL {
        let (mut world, mut bodies, mut joints) = busy(coupling);
        for round in 0..40u32 {
            for _ in 0..round % 5 {
                world.step().unwrap();
            }
            let body = bodies[round as usize * 7 % bodies.len()];
            let other = bodies[(round as usize * 7 + 5) % bodies.len()];
            let what = match round % 10 {
                0 => {
                    let joint = joints.remove(round as usize % joints.len());
                    world.remove_joint(joint).unwrap();
                    "a joint removed"
                }
                1 => {
                    let rope = SphericalJointBuilder::new().local_anchor1(Vector::new(0.0, 1.0, 0.0));
                    joints.push(world.insert_joint(body, other, rope).unwrap());
                    "a joint inserted"
                }
                2 => {
                    let enabled = round % 4 == 0;
                    world.update_joint(joints[0], |joint| joint.set_enabled(enabled)).unwrap();
                    "a joint changed"
                }
                3 => {
                    world.remove(bodies.swap_remove(3)).unwrap();
                    joints.retain(|joint| world.joint_load(*joint).is_some());
                    "a body removed"
                }
                4 => {
                    let ball = RigidBodyBuilder::dynamic().translation(Vector::new(0.1, 4.0, 0.2));
                    bodies.push(world.insert(ball, ColliderBuilder::ball(0.3)).unwrap());
                    "a body inserted"
                }
                5 => {
                    let at = WorldPose::at([f64::from(round) * 0.01, 2.0, 0.3]);
                    for &body in &bodies {
                        world.set_next_pose(body, at).unwrap();
                    }
                    "kinematic targets"
                }
                6 => {
                    world.set_pose(body, WorldPose::at([-0.2, 5.0, 0.1])).unwrap();
                    "a body put elsewhere"
                }
                7 => {
                    let velocity = Velocity { linear: [0.0, 3.0, 0.0], angular: [1.0; 3] };
                    world.set_velocity(body, velocity).unwrap();
                    world.update(other, |body| body.add_force(Vector::new(9.0, 0.0, 0.0), true)).unwrap();
                    "a force"
                }
                8 => {
                    world.update(body, |body| body.set_enabled(!body.is_enabled())).unwrap();
                    "a body enabled or not"
                }
                _ => {
                    world.update(body, |body| body.sleep()).unwrap();
                    world.update_collider(other, 0, |collider| collider.set_friction(0.1)).unwrap();
                    "a body put to sleep"
                }
            };
            let what = format!("{}, round {round}, {what}", coupling.name());
            continues_alike(&mut world, 3, true, &what);
            goes_back_alike(&mut world, 3, true, &what);
        }
    }
}

/// Rapier overlooks a contact whose forces were asked for in a step in which another contact ends. It is
/// reminded after the step.
#[test]
fn forces_that_were_asked_for_since_the_last_step_are_told_after_going_on() {
    for leaves in [0, 1, 2] {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(9.0, 0.5, 9.0)).unwrap();
        let balls = [-3.0, 0.0, 3.0].map(|x| {
            let ball = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.0, 0.0)).can_sleep(false);
            world.insert(ball, ColliderBuilder::ball(0.5)).unwrap()
        });
        (0..30).for_each(|_| world.step().unwrap());
        for ball in balls {
            let ask = |collider: &mut Collider| {
                collider.set_active_events(ActiveEvents::CONTACT_FORCE_EVENTS);
                collider.set_contact_force_event_threshold(0.1);
            };
            world.update_collider(ball, 0, ask).unwrap();
        }
        world.set_pose(balls[leaves], WorldPose::at([0.0, 20.0, 0.0])).unwrap();
        continues_alike(&mut world, 5, true, &format!("ball {leaves} leaves"));
        assert_eq!(world.events().forces.len(), 2, "of both that rest");
    }
}

/// Saves two arms of multibody joints in each tick of their way across a border.
#[test]
fn a_multibody_that_changes_region_goes_on_too() {
    for coupling in Coupling::ALL {
        // Gravity acts as on a slope.
        let step =
            StepSettings { gravity: [8.0, -9.81, 0.0], ..StepSettings::default() }.with_coupling(coupling);
        let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
        let mut world =
            LocalWorld::new(WorldConfig { partitioning, step, ..WorldConfig::default() }).unwrap();
        world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(30.0, 0.5, 30.0)).unwrap();
        for z in [0.0, 0.7] {
            let links: Vec<_> = (0..4)
                .map(|i| {
                    let at = Vector::new(-2.4 + 0.5 * i as f32, 0.8, z);
                    let body = RigidBodyBuilder::dynamic().translation(at);
                    world.insert(body, ColliderBuilder::cuboid(0.2, 0.2, 0.2).friction(0.0)).unwrap()
                })
                .collect();
            for pair in links.windows(2) {
                let joint = RevoluteJointBuilder::new(Vector::Z)
                    .local_anchor1(Vector::new(0.25, 0.0, 0.0))
                    .local_anchor2(Vector::new(-0.25, 0.0, 0.0));
                world.insert_multibody_joint(pair[0], pair[1], joint, LinkSettings::default()).unwrap();
            }
        }
        for tick in 0..60 {
            let what = format!("{}, tick {tick}", coupling.name());
            continues_alike(&mut world, 1, true, &what);
            goes_back_alike(&mut world, 1, true, &what);
        }
        assert!(world.stats().transfers > 0, "{}", coupling.name());
    }
}

/// Rapier keeps its own list of changes of a multibody, which no snapshot has.
#[test]
fn a_multibody_that_has_lost_a_body_since_the_last_step_goes_on_too() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(30.0, 0.5, 30.0)).unwrap();
    let links = [0.0, -1.2, 1.2, -2.4, 2.4].map(|x| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.7, 0.0));
        world.insert(body, ColliderBuilder::cuboid(0.4, 0.2, 0.4)).unwrap()
    });
    for (above, below, side) in [(0, 1, -0.6), (0, 2, 0.6), (1, 3, -0.6), (2, 4, 0.6)] {
        let hinge = RevoluteJointBuilder::new(Vector::Y)
            .local_anchor1(Vector::X * side)
            .local_anchor2(Vector::X * -side);
        let (above, below) = (links[above], links[below]);
        world.insert_multibody_joint(above, below, hinge, LinkSettings::default()).unwrap();
    }
    (0..240).for_each(|_| world.step().unwrap());
    assert!(world.body(links[4]).unwrap().is_sleeping());
    world.remove(links[1]).unwrap();
    let push = |body: &mut RigidBody| body.apply_impulse(Vector::new(0.0, 0.0, 1.0), true);
    world.update(links[4], push).unwrap();
    continues_alike(&mut world, 300, true, "without a link");
}

/// Returns a snapshot of some hundred kilobytes: more than one block if blocks are small.
fn sample() -> Vec<u8> {
    let (mut world, ..) = busy(Coupling::Auto);
    for _ in 0..20 {
        world.step().unwrap();
    }
    saved(&world)
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let bytes = sample();
    let mut hashes = [1, 2, 7].map(|threads| {
        let mut world = restored(&bytes, threads);
        for _ in 0..30 {
            world.step().unwrap();
        }
        world.state_hash()
    });
    hashes.sort_unstable();
    assert_eq!(hashes[0], hashes[2]);
    assert!(matches!(LocalWorld::restore(&bytes[..], 1_000_000_000), Err(SnapshotError::Threads(_))));
}

#[test]
fn a_disk_that_is_full_is_said_to_be() {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let (world, ..) = busy(Coupling::Owner);
    let error = world.save(Full).unwrap_err();
    let SnapshotError::Io(cause) = &error else { panic!("{error:?}") };
    assert_eq!(cause.kind(), std::io::ErrorKind::StorageFull);
    assert!(error.to_string().contains("no storage space; check the path"), "{error}");
}

#[test]
fn what_is_not_a_snapshot_is_said_to_be_none() {
    for other in [&b""[..], b"[world]", b"\x89dcdsna", b"\x89dcdsnapshot"] {
        let error = LocalWorld::restore(other, 1).err().unwrap();
        let begins = other.len() >= 8 && LocalWorld::is_snapshot(other);
        assert!(matches!(error, SnapshotError::Foreign) != begins, "{error}");
    }
}

#[test]
fn a_snapshot_of_another_format_or_build_is_refused_with_both_names() {
    let mut foreign = Vec::new();
    header::write(FORMAT + 1, &mut foreign).unwrap();
    let error = LocalWorld::restore(&foreign[..], 1).err().unwrap().to_string();
    assert!(error.contains(&format!("format {},", FORMAT + 1)), "{error}");
    assert!(error.contains(&format!("format {FORMAT}, dcd {}", env!("CARGO_PKG_VERSION"))), "{error}");
    assert!(error.contains("restore it by the dcd that made it"), "{error}");
}

#[test]
fn every_truncation_is_refused() {
    let bytes = sample();
    let ends = (0..200).chain((200..bytes.len()).step_by(977)).chain(bytes.len() - 80..bytes.len());
    for end in ends {
        let error = LocalWorld::restore(&bytes[..end], 1).err().unwrap();
        let right = matches!(error, SnapshotError::Foreign | SnapshotError::Truncated(_));
        assert!(right, "{end} of {} bytes: {error}", bytes.len());
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(LocalWorld::restore(&longer[..], 1), Err(SnapshotError::Damaged(_))));
}

#[test]
fn blocks_that_are_swapped_or_left_out_are_noticed() {
    let blocks: Vec<_> = (0..3u8).map(|i| vec![i; 1 << 20]).collect();
    let header = [7; 32];
    let mut bytes = Vec::new();
    let mut writer = BlockWriter::new(&mut bytes, header);
    writer.write_all(&blocks.concat()).unwrap();
    writer.finish().unwrap();
    let block = (1 << 20) + 36;
    let read = |mut bytes: &[u8]| {
        let mut reader = BlockReader::new(&mut bytes, (header, 0));
        let mut read = Vec::new();
        reader.read_to_end(&mut read).map(|_| read).map_err(|_| reader.failure().unwrap())
    };
    assert!(read(&bytes).unwrap() == blocks.concat());
    let swapped = [&bytes[block..2 * block], &bytes[..block], &bytes[2 * block..]].concat();
    assert!(matches!(read(&swapped), Err(SnapshotError::Damaged(0))));
    let left_out = [&bytes[..block], &bytes[2 * block..]].concat();
    assert!(matches!(read(&left_out), Err(SnapshotError::Damaged(at)) if at == block as u64));
}

/// Detects changed fields by the length of a snapshot: if this fails, what is saved has changed. One new
/// number per release is enough.
#[test]
fn a_changed_layout_has_a_new_format_number() {
    let (mut world, ..) = busy(Coupling::Auto);
    for _ in 0..2 {
        world.step().unwrap();
    }
    assert!(world.stats().ghosts > 0);
    let written = (FORMAT, saved(&world).len() - header_len());
    assert_eq!(written, (31, 110_086), "raise FORMAT, then put the new length here");
}

/// A pipe to which nobody writes would be waited for without end.
#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_not_read() {
    for path in ["/dev/null", "/"] {
        let refused = LocalWorld::open_snapshot(Path::new(path)).map(drop).unwrap_err().to_string();
        assert!(refused.contains("not a regular file"), "{path}: {refused}");
    }
}

fn header_len() -> usize {
    let mut header = Vec::new();
    header::write(FORMAT, &mut header).unwrap();
    header.len()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_flipped_bit_is_refused(place in any::<prop::sample::Index>(), bit in 0_u8..8) {
        thread_local!(static SAMPLE: Vec<u8> = sample());
        let mut bytes = SAMPLE.with(Clone::clone);
        let place = place.index(bytes.len());
        bytes[place] ^= 1 << bit;
        prop_assert!(LocalWorld::restore(&bytes[..], 1).is_err(), "byte {place}, bit {bit}");
    }
}
