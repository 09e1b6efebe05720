//! Tests bodies that sleep beyond a border: what comes from another region moves the same ones as in one
//! world.

use std::cell::RefCell;
use std::f32::consts::TAU;

use dcd::protocol::WorldPose;
use dcd::sim::Random;
use dcd::space::Bounds;

use super::*;

/// The shortest way of a body that was struck, and the longest of one that was not, metres.
const STRUCK_M: f64 = 0.5;
const LEFT_M: f64 = 0.1;

/// Returns the configuration of regions within 32 m of the origin. Islands move whole.
fn cut_at(coupling: Coupling, planes: &[(Axis, f64)]) -> WorldConfig {
    let step = StepSettings::default().with_coupling(coupling);
    let bounds = Bounds::around([0.0; 3], [32.0, 8.0, 32.0]);
    WorldConfig { bounds, partitioning: Partitioning::Cuts(planes.to_vec()), step, ..WorldConfig::default() }
}

fn in_regions(coupling: Coupling, regions: usize) -> WorldConfig {
    WorldConfig { partitioning: Partitioning::Regions(regions), ..cut_at(coupling, &[]) }
}

/// Returns how far each body that `lay` laid down moved, metres, while it slept and `drive` ran.
fn ways(
    config: WorldConfig,
    lay: impl Fn(&mut LocalWorld) -> Vec<BodyId>,
    drive: impl Fn(&mut LocalWorld),
) -> Vec<f64> {
    let mut world = LocalWorld::new(config).unwrap();
    insert_floor(&mut world);
    let sleepers = lay(&mut world);
    for _ in 0..240 {
        world.step().unwrap();
        if sleepers.iter().all(|&id| world.body(id).unwrap().is_sleeping()) {
            break;
        }
    }
    assert!(sleepers.iter().all(|&id| world.body(id).unwrap().is_sleeping()), "they never slept");
    let from: Vec<_> = sleepers.iter().map(|&id| at(&world, id)).collect();
    drive(&mut world);
    sleepers.iter().zip(from).map(|(&id, from)| distance(at(&world, id), from)).collect()
}

/// Returns the bodies that were struck in one world and not in the other.
fn unlike(one: &[f64], many: &[f64]) -> Vec<usize> {
    let struck_in_one = |(one, many): (&f64, &f64)| *one > STRUCK_M && *many < LEFT_M;
    let pairs = || one.iter().zip(many);
    pairs()
        .enumerate()
        .filter(|(_, (a, b))| struck_in_one((a, b)) || struck_in_one((b, a)))
        .map(|(i, _)| i)
        .collect()
}

fn one_like(config: &WorldConfig) -> WorldConfig {
    let step = StepSettings { exchanges: 1, ..config.step };
    WorldConfig { partitioning: Partitioning::Regions(1), step, ..config.clone() }
}

fn post_at(world: &mut LocalWorld, x: f32, z: f32) -> BodyId {
    world.insert(body_at(x, 1.0, z), ColliderBuilder::cuboid(0.15, 1.0, 0.15)).unwrap()
}

/// Inserts eight cars, each tied to the one before; the first is at `front`.
fn insert_train(world: &mut LocalWorld, front: Vector, motion: Vector, car: &RigidBodyBuilder, density: f32) {
    let way = motion.normalize();
    // Cars are long in x.
    let turned = if way.x > 0.5 { 0.0 } else { -0.25 * TAU };
    let mut before = None;
    for place in 0..8 {
        let body = car.clone().translation(front - way * (2.2 * place as f32)).rotation(Vector::Y * turned);
        let shape = ColliderBuilder::cuboid(1.0, 0.5, 0.6).density(density).friction(0.0);
        let car = world.insert(body.linvel(motion), shape).unwrap();
        if let Some(before) = before.replace(car) {
            let joint = SphericalJointBuilder::new()
                .local_anchor1(Vector::new(-1.1, 0.0, 0.0))
                .local_anchor2(Vector::new(1.1, 0.0, 0.0));
            world.insert_joint(before, car, joint).unwrap();
        }
    }
}

#[test]
fn a_jointed_train_moves_the_posts_that_sleep_in_another_region() {
    let run = |config| {
        let lay =
            |world: &mut LocalWorld| (0..6).map(|i| post_at(world, 3.0 + 2.0 * i as f32, 0.1)).collect();
        let drive = |world: &mut LocalWorld| {
            insert_train(
                world,
                Vector::new(-3.0, 0.5, 0.0),
                Vector::X * 10.0,
                &RigidBodyBuilder::dynamic(),
                4.0,
            );
            steps(world, 120);
        };
        ways(config, lay, drive)
    };
    for coupling in SHARING {
        let config = cut_at(coupling, &[(Axis::X, 0.0)]);
        let (one, many) = (run(one_like(&config)), run(config));
        assert!(one.iter().all(|way| *way > STRUCK_M), "{one:?}");
        assert!(unlike(&one, &many).is_empty(), "{}: {one:.1?} and {many:.1?}", coupling.name());
    }
}

#[test]
fn a_hub_pushes_boxes_that_sleep_in_another_region_and_does_not_drive_into_them() {
    let run = |config: WorldConfig| {
        let mut deepest = 0.0f64;
        let mut world = LocalWorld::new(config).unwrap();
        insert_floor(&mut world);
        let boxes = [4.0, 7.0].map(|x| world.insert(body_at(x, 0.5, 0.0), cube()).unwrap());
        steps(&mut world, 180);
        assert!(boxes.iter().all(|&id| world.body(id).unwrap().is_sleeping()), "they never slept");
        let bus = body_at(-8.0, 1.0, 0.0).linvel(Vector::new(10.0, 0.0, 0.0));
        let bus =
            world.insert(bus, ColliderBuilder::cuboid(6.0, 0.95, 1.2).density(5.0).friction(0.0)).unwrap();
        for _ in 0..60 {
            steps(&mut world, 1);
            let front = at(&world, bus)[0] + 6.0;
            deepest = boxes.iter().map(|&id| front - (at(&world, id)[0] - 0.5)).fold(deepest, f64::max);
        }
        deepest
    };
    for coupling in SHARING {
        let config = cut_at(coupling, &[(Axis::X, 0.0)]);
        let (one, many) = (run(one_like(&config)), run(config));
        assert!(many < one + 0.1, "{}: {many} m deep, {one} in one world", coupling.name());
    }
}

/// Stands dominoes in a ring through the origin, 0.5 m apart. Returns how many fall when the one farthest
/// from the origin is pushed over.
fn fallen_of_ring(config: WorldConfig, count: usize, ticks: usize) -> usize {
    let mut world = LocalWorld::new(config).unwrap();
    insert_floor(&mut world);
    let radius = 0.5 * count as f32 / TAU;
    let ring: Vec<_> = (0..count)
        .map(|i| {
            let angle = TAU * i as f32 / count as f32;
            let (sin, cos) = angle.sin_cos();
            let pose = WorldPose {
                translation: [radius + radius * cos, 0.5, radius * sin].map(f64::from),
                rotation: [0.0, (-0.5 * angle).sin(), 0.0, (0.5 * angle).cos()],
            };
            let domino = ColliderBuilder::cuboid(0.25, 0.5, 0.05);
            world.insert_at(pose, RigidBodyBuilder::dynamic(), vec![domino]).unwrap()
        })
        .collect();
    steps(&mut world, 130);
    assert!(ring.iter().all(|&id| world.body(id).unwrap().is_sleeping()));
    world
        .update(ring[0], |body| {
            body.set_angvel(Vector::new(3.0, 0.0, 0.0), true);
            body.set_linvel(Vector::new(0.0, 0.0, 1.5), true);
        })
        .unwrap();
    steps(&mut world, ticks);
    ring.iter().filter(|&&id| at(&world, id)[1] < 0.45).count()
}

#[test]
fn a_ring_of_sleeping_dominoes_falls_through_the_corner_of_four_regions() {
    for coupling in SHARING {
        for regions in [2, 4, 5] {
            let fallen = fallen_of_ring(in_regions(coupling, regions), 48, 420);
            // The last one may lean on the first.
            assert!(fallen >= 47, "{} in {regions} regions: {fallen}", coupling.name());
        }
    }
}

#[test]
fn a_slow_lift_raises_what_sleeps_on_its_half_in_another_region() {
    let run = |config: WorldConfig| {
        let mut world = LocalWorld::new(config).unwrap();
        let lift = RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(-0.5, 0.0, 0.0));
        let lift = world.insert(lift, ColliderBuilder::cuboid(3.0, 0.25, 1.0)).unwrap();
        let boxes = [1.0, 2.1].map(|x| world.insert(body_at(x, 0.75, 0.0), cube()).unwrap());
        steps(&mut world, 240);
        assert!(boxes.iter().all(|&id| world.body(id).unwrap().is_sleeping()), "they never slept");
        let up = dcd::protocol::Velocity { linear: [0.0, 0.2, 0.0], angular: [0.0; 3] };
        world.set_velocity(lift, up).unwrap();
        let mut lowest = f64::INFINITY;
        for _ in 0..180 {
            steps(&mut world, 1);
            let top = at(&world, lift)[1] + 0.75;
            lowest = boxes.iter().map(|&id| at(&world, id)[1] - top).fold(lowest, f64::min);
        }
        lowest
    };
    for coupling in SHARING {
        let config = cut_at(coupling, &[(Axis::X, 0.0)]);
        let (one, many) = (run(one_like(&config)), run(config));
        assert!(
            many > one - 2e-3,
            "{}: boxes sink {many} m into the lift, {one} in one world",
            coupling.name()
        );
    }
}

/// A seeded generator of numbers between two others.
struct Dice(Random);

impl Dice {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.0.bits() >> 40) as f32 / (1 << 24) as f32
    }

    fn below(&mut self, count: u32) -> u32 {
        self.between(0.0, count as f32) as u32
    }
}

/// Inserts boxes, posts and stacks, one in each square of 4 m.
fn scatter(world: &mut LocalWorld, dice: &mut Dice) -> Vec<BodyId> {
    let mut all = Vec::new();
    for square in 0..49 {
        let x = 4.0 * (square % 7 - 3) as f32 + dice.between(-1.2, 1.2);
        let z = 4.0 * (square / 7 - 3) as f32 + dice.between(-1.2, 1.2);
        match dice.below(4) {
            0 => all.push(post_at(world, x, z)),
            1 => all.extend((0..3).map(|i| world.insert(body_at(x, 0.5 + i as f32, z), cube()).unwrap())),
            _ => all.push(world.insert(body_at(x, 0.5, z), cube()).unwrap()),
        }
    }
    all
}

/// A lane along x or z, in which a thing is driven without being turned aside.
struct Lane {
    along_x: bool,
    side: f32,
    half_width: f32,
}

impl Lane {
    fn contains(&self, place: [f64; 3]) -> bool {
        let off = if self.along_x { place[2] } else { place[0] };
        (off - f64::from(self.side)).abs() < f64::from(self.half_width)
    }
}

/// Drives in four things from outside, or from between the squares, which cross borders. Returns their lanes.
fn drive_in(world: &mut LocalWorld, dice: &mut Dice) -> Vec<Lane> {
    let along_x = dice.below(2) == 0;
    let mut lanes = Vec::new();
    for lane in 0..4 {
        let side = 8.0 * lane as f32 - 12.0 + dice.between(-1.0, 1.0);
        let dynamic = RigidBodyBuilder::dynamic().lock_rotations();
        let kinematic = RigidBodyBuilder::kinematic_velocity_based();
        let place = |along: f32, y: f32| {
            if along_x { Vector::new(along, y, side) } else { Vector::new(side, y, along) }
        };
        let way = if along_x { Vector::X } else { Vector::Z };
        let (body, shape, half, from, y, speed) = match dice.below(5) {
            3 => {
                insert_train(world, place(-17.0, 0.5), way * 10.0, &dynamic, 500.0);
                lanes.push(Lane { along_x, side, half_width: 0.8 });
                continue;
            }
            0 => {
                (dynamic, ColliderBuilder::ball(0.45).density(2e3), 0.45, -17.0, 0.5, dice.between(6.0, 12.0))
            }
            1 => {
                let bus = ColliderBuilder::cuboid(5.0, 0.75, 1.0).density(200.0);
                (dynamic, bus, 1.0, -21.0, 0.8, dice.between(4.0, 10.0))
            }
            2 => (kinematic, ColliderBuilder::cuboid(0.2, 0.5, 1.5), 1.5, -16.0, 0.6, dice.between(2.0, 5.0)),
            // The way is free half way between two squares.
            _ => (kinematic, ColliderBuilder::cuboid(0.2, 0.5, 1.5), 1.5, -2.0, 0.6, 0.45),
        };
        let turned = if along_x { 0.0 } else { -0.25 * TAU };
        let body = body.translation(place(from, y)).rotation(Vector::Y * turned).linvel(way * speed);
        world.insert(body, shape.friction(0.0)).unwrap();
        lanes.push(Lane { along_x, side, half_width: half + 0.2 });
    }
    lanes
}

/// Returns how far scattered sleepers move when things are driven in, and which of them lie in a lane.
fn driven(config: WorldConfig, seed: u64) -> (Vec<f64>, Vec<bool>) {
    let (from, lanes) = (RefCell::new(Vec::new()), RefCell::new(Vec::new()));
    let lay = |world: &mut LocalWorld| {
        let sleepers = scatter(world, &mut Dice(Random::new(seed)));
        from.replace(sleepers.iter().map(|&id| at(world, id)).collect());
        sleepers
    };
    let drive = |world: &mut LocalWorld| {
        lanes.replace(drive_in(world, &mut Dice(Random::new(seed + 100))));
        steps(world, 300);
    };
    let ways = ways(config, lay, drive);
    let in_lane = |place: &[f64; 3]| lanes.borrow().iter().any(|lane| lane.contains(*place));
    let in_lanes = from.borrow().iter().map(in_lane).collect();
    (ways, in_lanes)
}

#[test]
fn whatever_is_driven_across_borders_moves_the_sleepers_that_it_moves_in_one_world() {
    let partitioned =
        [(Coupling::Overlap, 3), (Coupling::Island, 4), (Coupling::Auto, 2), (Coupling::Auto, 8)];
    let (mut struck, mut unlike_by) = (0, [0; 4]);
    for seed in 0..6 {
        let (one, in_lane) = driven(one_like(&in_regions(Coupling::Auto, 1)), seed);
        struck += (0..one.len()).filter(|&i| in_lane[i] && one[i] > STRUCK_M).count();
        for (place, (coupling, regions)) in partitioned.into_iter().enumerate() {
            let (many, _) = driven(in_regions(coupling, regions), seed);
            // What flies out of a lane may hit others or miss them, so only bodies in lanes count.
            let inside: Vec<_> = unlike(&one, &many).into_iter().filter(|&i| in_lane[i]).collect();
            unlike_by[place] += inside.len();
        }
    }
    // In one world too, what flew out of one lane may hit or miss what lies in another.
    assert!(struck > 60, "{struck}");
    for ((coupling, regions), unlike) in partitioned.into_iter().zip(unlike_by) {
        assert!(50 * unlike <= struck, "{} in {regions}: {unlike} of {struck}", coupling.name());
    }
}
