//! Throws groups of bodies of unlike regions at one another, as they are found in games, and looks from outside whether anything went through
//! anything: at all shapes where they are in the end, not at what regions know of their contacts.

use std::collections::BTreeSet;

use dcd::physics::LinkSettings;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::space::{Axis, BodyId, mixed};
use rapier3d::parry::query;
use rapier3d::prelude::*;

const TICKS: usize = 90;

/// Draws numbers, the same for each seed.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, from: f32, to: f32) -> f32 {
        self.0 += 1;
        from + (to - from) * (mixed(self.0) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn of(&mut self, count: usize) -> usize {
        self.0 += 1;
        (mixed(self.0) % count as u64) as usize
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Group {
    /// So many cubes in a block.
    Heap(usize),
    /// Cubes tied one to the next by joints.
    Train(usize),
    /// Cubes as links of a multibody.
    Robot(usize),
    Ball,
    /// A plate that no contact moves.
    Pusher,
    /// A block at rest.
    Sleepers(usize),
}

const GROUPS: [Group; 14] = [
    Group::Heap(1),
    Group::Heap(8),
    Group::Heap(64),
    Group::Heap(300),
    Group::Heap(400),
    Group::Train(3),
    Group::Train(12),
    Group::Train(300),
    Group::Robot(4),
    Group::Ball,
    Group::Pusher,
    Group::Sleepers(8),
    Group::Sleepers(64),
    Group::Sleepers(300),
];

/// Inserts a group around this place; it moves along x at this speed.
fn insert(
    world: &mut LocalWorld,
    tied: &mut BTreeSet<(BodyId, BodyId)>,
    group: Group,
    at: Vector,
    speed: f32,
) {
    let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1.0).friction(0.0);
    let body = |place: Vector| RigidBodyBuilder::dynamic().translation(place).linvel(Vector::X * speed);
    match group {
        Group::Heap(count) | Group::Sleepers(count) => {
            let side = (count as f32).cbrt().ceil() as usize;
            let sleeps = matches!(group, Group::Sleepers(_));
            for i in 0..count {
                let place =
                    Vector::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32);
                let middle = Vector::new(1.0, 0.0, 1.0) * (side as f32 - 1.0) / 2.0;
                let place = at + place - middle + Vector::Y * 0.5;
                let body =
                    if sleeps { body(place).linvel(Vector::ZERO) } else { body(place).can_sleep(false) };
                world.insert(body, cube()).unwrap();
            }
        }
        Group::Train(count) | Group::Robot(count) => {
            let mut before: Option<BodyId> = None;
            for i in 0..count {
                let along = (i as f32 - (count as f32 - 1.0) / 2.0) * 1.1;
                let place = at + Vector::new(0.0, 0.5, along);
                let id = world.insert(body(place).can_sleep(false), cube()).unwrap();
                if let Some(before) = before {
                    let joint = SphericalJointBuilder::new()
                        .local_anchor1(Vector::Z * 0.55)
                        .local_anchor2(Vector::Z * -0.55)
                        .contacts_enabled(false);
                    if matches!(group, Group::Robot(_)) {
                        world.insert_multibody_joint(before, id, joint, LinkSettings::default()).unwrap();
                    } else {
                        world.insert_joint(before, id, joint).unwrap();
                    }
                    tied.insert((before, id));
                }
                before = Some(id);
            }
        }
        Group::Ball => {
            world
                .insert(body(at + Vector::Y).can_sleep(false), ColliderBuilder::ball(0.9).density(2.0))
                .unwrap();
        }
        Group::Pusher => {
            let body = RigidBodyBuilder::kinematic_velocity_based().translation(at + Vector::Y * 1.5);
            let plate = ColliderBuilder::cuboid(0.5, 1.5, 3.0).density(1.0).friction(0.0);
            world.insert(body.linvel(Vector::X * speed), plate).unwrap();
        }
    }
}

/// Returns how deep the two are in each other that are deepest, of all that are not tied together, metres.
fn deepest_m(world: &LocalWorld, tied: &BTreeSet<(BodyId, BodyId)>) -> f32 {
    let mut shapes = Vec::new();
    for region in world.regions() {
        for (id, role, _, body) in region.bodies() {
            if role != dcd::physics::Ownership::Owner {
                continue;
            }
            let pose = world.pose(id).unwrap();
            let at = Vector::from_array(pose.translation.map(|v| v as f32));
            let pose = Pose::from_parts(at, Rotation::from_array(pose.rotation));
            for &collider in body.colliders() {
                let shape = region.physics().colliders[collider].shared_shape().clone();
                shapes.push((id, body.is_dynamic(), pose, shape.compute_aabb(&pose), shape));
            }
        }
    }
    shapes.sort_by(|a, b| a.3.mins.x.total_cmp(&b.3.mins.x));
    let mut deepest: f32 = 0.0;
    for (i, (a, moves, at, bounds, shape)) in shapes.iter().enumerate() {
        let near = shapes[i + 1..].iter().take_while(|other| other.3.mins.x < bounds.maxs.x);
        for (b, other_moves, other_at, other_bounds, other) in near {
            let tied = tied.contains(&(*a.min(b), *a.max(b)));
            if (*moves || *other_moves) && !tied && bounds.intersects(other_bounds) {
                let contact = query::contact(at, &**shape, other_at, &**other, 0.0).unwrap();
                deepest = deepest.max(-contact.map_or(0.0, |contact| contact.dist));
            }
        }
    }
    deepest
}

fn clash(seed: u64, partitioning: Partitioning, ticks: usize) -> (Vec<Group>, f32) {
    let mut dice = Dice(seed << 20);
    let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
    let weightless = dice.of(3) == 0;
    if weightless {
        config.step.gravity = [0.0; 3];
    }
    let mut world = LocalWorld::new(config).unwrap();
    if !weightless {
        let floor = ColliderBuilder::cuboid(60.0, 0.5, 200.0).translation(Vector::Y * -0.5).friction(0.3);
        world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
    }
    let (left, right) = (GROUPS[dice.of(GROUPS.len())], GROUPS[dice.of(GROUPS.len())]);
    let speed = dice.roll(1.0, 6.0);
    let gap = dice.roll(0.2, 3.0);
    let aside = dice.roll(-0.4, 0.4);
    let half = |group| match group {
        Group::Heap(count) | Group::Sleepers(count) => (count as f32).cbrt().ceil() / 2.0,
        Group::Ball => 0.9,
        _ => 0.5,
    };
    let mut tied = BTreeSet::new();
    insert(&mut world, &mut tied, left, Vector::new(-half(left) - gap, 0.0, aside), speed);
    insert(&mut world, &mut tied, right, Vector::new(half(right) + gap, 0.0, 0.0), -speed);
    let mut deepest: f32 = 0.0;
    for tick in 0..ticks {
        world.step().unwrap();
        if tick % 5 == 4 {
            deepest = deepest.max(deepest_m(&world, &tied));
        }
    }
    (vec![left, right], deepest)
}

/// Returns a line of how deep the deepest were in one region and in several, and whether that is much more in any of those.
fn compared(seed: u64) -> (String, bool) {
    let (groups, alone) = clash(seed, Partitioning::Regions(1), TICKS);
    let mut line = format!("{seed} {groups:?}: {alone:.3} m;");
    let mut is_deeper = false;
    for cuts in [
        vec![(Axis::X, 0.0)],
        vec![(Axis::X, -0.7)],
        vec![(Axis::X, 0.0), (Axis::Z, 0.1)],
        vec![(Axis::X, -2.0), (Axis::X, 0.5), (Axis::X, 3.0)],
    ] {
        let (_, cut) = clash(seed, Partitioning::Cuts(cuts), TICKS);
        is_deeper |= cut > 2.0 * alone + 0.05;
        line += &format!(" {cut:.3}");
    }
    (line, is_deeper)
}

#[test]
fn nothing_goes_through_what_another_region_has() {
    for seed in [0, 4, 5, 8, 18, 31, 66, 152, 156, 175, 199, 219] {
        let (line, is_deeper) = compared(seed);
        assert!(!is_deeper, "{line}");
    }
}

/// Prints all, and how many of them are deeper in each other than in one region: three of these, as fast ones are seen a tick late.
#[test]
#[ignore = "takes minutes"]
fn three_hundred_clashes() {
    let deeper = (0..300).filter(|&seed| {
        let (line, is_deeper) = compared(seed);
        println!("{line}{}", if is_deeper { " deeper" } else { "" });
        is_deeper
    });
    let deeper = deeper.count();
    assert!(deeper <= 4, "{deeper} of 300");
}
