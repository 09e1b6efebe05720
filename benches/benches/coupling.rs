//! Measures what a border costs: a step of two regions that share 0, 100 or 1,000 bodies, beside one bare
//! Rapier world with the same 4,000 boxes. Each half of the step is timed alone too: the half that steps and
//! gathers, and the half that applies and comes to consensus.
//!
//! Run it by `cargo bench -p dcd-benches`. It uses one thread, so that only work is counted.

use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dcd::physics::{Coupling, Partition, RegionHost, StepSettings};
use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::space::{Axis, BodyId, Bounds, DistributionTree};

const BODIES: usize = 4_000;
const SHARED: [usize; 3] = [0, 100, 1_000];
const METHODS: [Coupling; 2] = [Coupling::Owner, Coupling::Overlap];
/// The ticks until contacts have their warm start.
const SETTLING_TICKS: usize = 60;

/// Returns the places of pairs of unit boxes that stand side by side on a floor. `shared` of the boxes stand
/// in pairs across x = 0, so that the regions left and right of it share them. The others stand too far from
/// it.
fn boxes(shared: usize) -> impl Iterator<Item = [f64; 3]> {
    const PITCH_M: f64 = 1.5;
    const ROWS: usize = 100;
    (0..BODIES / 2).flat_map(move |pair| {
        let (x, z) = if pair < shared / 2 {
            (0.0, pair as f64)
        } else {
            let side = if pair % 2 == 0 { -1.0 } else { 1.0 };
            (side * (20.0 + 2.0 * PITCH_M * (pair / 2 / ROWS) as f64), (pair / 2 % ROWS) as f64)
        };
        [-0.5, 0.5].map(|dx| [x + dx, 0.5, z * PITCH_M])
    })
}

fn floor() -> ColliderBuilder {
    ColliderBuilder::cuboid(2_000.0, 1.0, 2_000.0)
}

fn unit_box() -> (RigidBodyBuilder, ColliderBuilder) {
    // A sleeping box would cost nothing.
    (RigidBodyBuilder::dynamic().can_sleep(false), ColliderBuilder::cuboid(0.5, 0.5, 0.5))
}

fn bare() -> PhysicsWorld {
    let mut world = PhysicsWorld { gravity: Vector::new(0.0, -9.81, 0.0), ..PhysicsWorld::new() };
    // By default the world would step on all cores.
    world.configure_thread_pool(1).expect("the system has one more thread");
    world.insert(RigidBodyBuilder::fixed().translation(Vector::new(0.0, -1.0, 0.0)), floor());
    for place in boxes(0) {
        let (body, collider) = unit_box();
        world.insert(body.translation(Vector::from(place.map(|v| v as f32))), collider);
    }
    (0..SETTLING_TICKS).for_each(|_| world.step());
    world
}

fn regions(method: Coupling, shared: usize) -> RegionHost {
    let bounds = Bounds::new([-200.0, 0.0, 0.0], [200.0, 10.0, 1_000.0]);
    let tree = DistributionTree::cut_by(bounds, &[(Axis::X, 0.0)]).expect("the plane cuts the world");
    let leaves: Vec<_> = tree.leaves().collect();
    let mut settings = StepSettings::default().with_coupling(method);
    // One exchange per tick: several exchanges cost as much as several steps.
    settings.exchanges = 1;
    let mut host = RegionHost::new(Partition::new(tree, None), settings, 1, &leaves).expect("one thread");
    let fixed = (WorldPose::at([0.0, -1.0, 0.0]), RigidBodyBuilder::fixed(), floor());
    let movable = boxes(shared).map(|place| {
        let (body, collider) = unit_box();
        (WorldPose::at(place), body, collider)
    });
    let records: Vec<_> = std::iter::once(fixed)
        .chain(movable)
        .enumerate()
        .map(|(index, (pose, body, collider))| {
            let id = BodyId::persistent(index as u32);
            host.shapes_mut().describe(id, pose, &body.build(), &[collider]).expect("boxes can be held")
        })
        .collect();
    host.insert(records, &[]).expect("every body has one id");
    (0..SETTLING_TICKS).for_each(|_| host.step().expect("all regions are here"));
    let ghosts: usize = host.regions().map(|region| region.ghost_count()).sum();
    assert_eq!(ghosts, shared, "copies held by {} beside their owners", method.name());
    host
}

fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    let mut world = bare();
    group.bench_function("bare", |bencher| bencher.iter(|| world.step()));
    for method in METHODS {
        for shared in SHARED {
            let mut host = regions(method, shared);
            group.bench_function(BenchmarkId::new(method.name(), shared), |bencher| {
                bencher.iter(|| host.step().expect("all regions are here"));
            });
        }
    }
    group.finish();
}

/// Measures each half of a step alone.
fn halves(criterion: &mut Criterion) {
    for (name, of) in [("step and gather", 0), ("agree and apply", 1)] {
        let mut group = criterion.benchmark_group(name);
        for method in METHODS {
            for shared in SHARED {
                let mut host = regions(method, shared);
                group.bench_function(BenchmarkId::new(method.name(), shared), |bencher| {
                    bencher.iter_custom(|ticks| (0..ticks).map(|_| tick(&mut host)[of]).sum());
                });
            }
        }
        group.finish();
    }
}

/// Runs a tick and returns how long each half took.
fn tick(host: &mut RegionHost) -> [Duration; 2] {
    let start = Instant::now();
    host.compute();
    let computed = Instant::now();
    host.exchange().expect("all regions are here");
    let exchanged = Instant::now();
    host.end_tick();
    [computed - start, exchanged - computed]
}

criterion_group! {
    name = coupling;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(3));
    targets = step, halves
}
criterion_main!(coupling);
