//! Throws groups of bodies of different regions at one another, as games do, and checks that no body went
//! through another. It looks at all shapes where they are in the end, not at what regions know of their
//! contacts.

use std::collections::BTreeSet;

use dcd::physics::LinkSettings;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::space::{Axis, BodyId, mixed};
use rapier3d::parry::query;
use rapier3d::prelude::*;

const TICKS: usize = 90;

/// A generator of numbers, the same for each seed.
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
    /// A block of this many cubes.
    Heap(usize),
    /// Cubes tied in a row by joints.
    Train(usize),
    /// Cubes that are links of a multibody.
    Robot(usize),
    /// This many robots of four cubes beside each other, along x.
    Robots(usize),
    /// A robot of four cubes, at rest.
    SleepingRobot,
    Ball,
    /// A kinematic plate, which no contact moves.
    Pusher,
    /// A block of this many cubes, at rest.
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

/// Inserts a group around this place. It moves along x at this speed; where gravity is along x, gravity draws
/// it that way, since multibodies begin at rest.
fn insert(
    world: &mut LocalWorld,
    tied: &mut BTreeSet<(BodyId, BodyId)>,
    group: Group,
    at: Vector,
    speed: f32,
) {
    let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1.0).friction(0.0);
    let is_drawn = world.host().settings().gravity[0] != 0.0;
    let scale = if is_drawn { speed.signum() } else { 1.0 };
    let body = |place: Vector| {
        RigidBodyBuilder::dynamic().translation(place).linvel(Vector::X * speed).gravity_scale(scale)
    };
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
        Group::Robots(count) => {
            for i in 0..count {
                let aside = (i as f32 - (count as f32 - 1.0) / 2.0) * 1.1;
                insert(world, tied, Group::Robot(4), at + Vector::X * aside, speed);
            }
        }
        Group::Train(_) | Group::Robot(_) | Group::SleepingRobot => {
            let (count, sleeps) = match group {
                Group::Train(count) | Group::Robot(count) => (count, false),
                _ => (4, true),
            };
            let body = |place| match sleeps {
                true => body(place).linvel(Vector::ZERO).sleeping(true),
                false => body(place).can_sleep(false),
            };
            let mut before: Option<BodyId> = None;
            for i in 0..count {
                let along = (i as f32 - (count as f32 - 1.0) / 2.0) * 1.1;
                let place = at + Vector::new(0.0, 0.5, along);
                let id = world.insert(body(place), cube()).unwrap();
                if let Some(before) = before {
                    let joint = SphericalJointBuilder::new()
                        .local_anchor1(Vector::Z * 0.55)
                        .local_anchor2(Vector::Z * -0.55)
                        .contacts_enabled(false);
                    if !matches!(group, Group::Train(_)) {
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

/// Returns the depth of the deepest overlap of two bodies that are not tied together, metres.
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

/// Two groups that are thrown at each other, and how.
#[derive(Clone, Copy, Debug)]
struct Throw {
    left: Group,
    right: Group,
    /// The gravity; `None` is the default, downwards.
    gravity: Option<[f32; 3]>,
    speed: f32,
    gap: f32,
    aside: f32,
}

impl Throw {
    fn of(seed: u64) -> Self {
        let mut dice = Dice(seed << 20);
        let gravity = (dice.of(3) == 0).then_some([0.0; 3]);
        let (left, right) = (GROUPS[dice.of(GROUPS.len())], GROUPS[dice.of(GROUPS.len())]);
        let speed = dice.roll(1.0, 6.0);
        let gap = dice.roll(0.2, 3.0);
        Self { left, right, gravity, speed, gap, aside: dice.roll(-0.4, 0.4) }
    }

    /// Returns the depth of the deepest overlap over all ticks, metres.
    fn deepest_m(self, partitioning: Partitioning) -> f32 {
        let Self { left, right, gravity, speed, gap, aside } = self;
        let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
        config.step.gravity = gravity.unwrap_or(config.step.gravity);
        let mut world = LocalWorld::new(config).unwrap();
        if gravity.is_none() {
            let floor = ColliderBuilder::cuboid(60.0, 0.5, 200.0).translation(Vector::Y * -0.5).friction(0.3);
            world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
        }
        let half = |group| match group {
            Group::Heap(count) | Group::Sleepers(count) => (count as f32).cbrt().ceil() / 2.0,
            Group::Robots(count) => count as f32 * 0.55,
            Group::Ball => 0.9,
            _ => 0.5,
        };
        let mut tied = BTreeSet::new();
        insert(&mut world, &mut tied, left, Vector::new(-half(left) - gap, 0.0, aside), speed);
        insert(&mut world, &mut tied, right, Vector::new(half(right) + gap, 0.0, 0.0), -speed);
        let mut deepest: f32 = 0.0;
        for tick in 0..TICKS {
            world.step().unwrap();
            if tick % 5 == 4 {
                deepest = deepest.max(deepest_m(&world, &tied));
            }
        }
        deepest
    }

    /// Returns a line with the deepest overlaps in one region and in several, and whether one in several
    /// regions is much deeper.
    fn compared(self) -> (String, bool) {
        let alone = self.deepest_m(Partitioning::Regions(1));
        let mut line = format!("{:?} {:?}: {alone:.3} m;", self.left, self.right);
        let mut is_deeper = false;
        for cuts in [
            vec![(Axis::X, 0.0)],
            vec![(Axis::X, -0.7)],
            vec![(Axis::X, 0.0), (Axis::Z, 0.1)],
            vec![(Axis::X, -2.0), (Axis::X, 0.5), (Axis::X, 3.0)],
        ] {
            let cut = self.deepest_m(Partitioning::Cuts(cuts));
            is_deeper |= cut > 2.0 * alone + 0.05;
            line += &format!(" {cut:.3}");
        }
        (line, is_deeper)
    }
}

#[test]
fn nothing_goes_through_what_another_region_has() {
    for seed in [0, 4, 5, 8, 18, 31, 66, 147, 152, 156, 175, 199, 219] {
        let (line, is_deeper) = Throw::of(seed).compared();
        assert!(!is_deeper, "{seed} {line}");
    }
}

/// No two regions can hold the same multibody, so multibodies that may touch must all be in one region: also
/// more than two of them, of which some touch none of the other region's, and one that sleeps.
#[test]
fn multibodies_beside_one_another_and_asleep_are_met() {
    use self::Group::{Robot, Robots, SleepingRobot};
    for (left, right) in [
        (Robot(4), Robots(2)),
        (Robots(2), Robot(4)),
        (Robots(3), Robots(3)),
        (Robot(4), SleepingRobot),
        (SleepingRobot, Robot(4)),
        (SleepingRobot, Robots(2)),
    ] {
        for (pull, gap) in [(4.0, 0.4), (10.0, 0.2), (20.0, 1.0)] {
            let gravity = Some([pull, 0.0, 0.0]);
            let throw = Throw { left, right, gravity, speed: 1.0, gap, aside: 0.2 };
            let (line, is_deeper) = throw.compared();
            assert!(!is_deeper, "at {pull} m/s²: {line}");
        }
    }
}

/// Prints all throws, and counts those whose overlap is deeper than in one region. Measured: one, a train of
/// 300 against a heap of 400.
#[test]
#[ignore = "takes minutes"]
fn three_hundred_clashes() {
    let deeper = (0..300).filter(|&seed| {
        let (line, is_deeper) = Throw::of(seed).compared();
        println!("{seed} {line}{}", if is_deeper { " deeper" } else { "" });
        is_deeper
    });
    let deeper = deeper.count();
    assert!(deeper <= 2, "{deeper} of 300");
}
