//! Tests the memory cost of a step and of a body: in the steady state nothing is allocated per body, and a
//! body takes little more than in a bare Rapier world.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use dcd::physics::Coupling;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use rapier3d::prelude::*;

/// An allocator that counts what this thread allocates. Tests run on threads of their own.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    /// The bytes in use.
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

fn count(bytes: usize, freed: usize) {
    ALLOCATIONS.with(|count| count.set(count.get() + u64::from(bytes > 0)));
    // One thread may free what another allocated.
    BYTES.with(|count| count.set(count.get().wrapping_add(bytes).wrapping_sub(freed)));
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, layout.size());
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Returns the allocations of one step: the fewest of 20, after 60 steps of a pile that does not sleep.
fn allocations_per_step(mut step: impl FnMut()) -> u64 {
    for _ in 0..60 {
        step();
    }
    let counted = (0..20).map(|_| {
        let before = ALLOCATIONS.with(Cell::get);
        step();
        ALLOCATIONS.with(Cell::get) - before
    });
    counted.min().unwrap()
}

/// Returns the allocations of one step with this coupling and of one in the bare world, and the number of
/// ghosts held.
fn allocations(coupling: Coupling, n: usize, regions: usize) -> (u64, u64, usize) {
    let scene = Scene::named("pile", &Params::new().with("n", n)).unwrap();
    let config = WorldConfig::for_scene(&scene);
    let step = config.step.with_coupling(coupling);
    let config = WorldConfig { partitioning: Partitioning::Regions(regions), step, ..config };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    let ours = allocations_per_step(|| world.step().unwrap());
    let mut bare = scene.bare_world();
    bare.clear_thread_pool();
    (ours, allocations_per_step(|| bare.step()), world.stats().ghosts)
}

#[test]
fn a_step_allocates_nothing_per_body() {
    // A pool of one thread: both worlds step on the thread whose allocations are counted.
    let pool = rapier3d::rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(compare);
}

fn compare() {
    for regions in [1, 2, 8] {
        // Four times the bodies. The limit is what Rapier allocates in each region and a fixed number for the
        // exchange, and the same again for what Rapier's parallel solver makes of bodies that an exchange has
        // written.
        let fixed = 8 + 8 * regions as u64;
        for n in [500, 2_000] {
            let (owner, bare, ghosts) = allocations(Coupling::Owner, n, regions);
            assert!(regions == 1 || ghosts > 50, "the border must have traffic");
            let most = regions as u64 * bare.max(1) + fixed;
            assert!(owner <= most, "{n} bodies in {regions} regions: {owner} allocations by owner");
            // Towers have ten boxes. Those of which `owner` holds ghosts are islands near a border, each with
            // a few lists.
            let islands = ghosts as u64 / 10;
            let (auto, ..) = allocations(Coupling::Auto, n, regions);
            let most = most + fixed + 5 * islands;
            assert!(auto <= most, "{n} bodies in {regions} regions: {auto} allocations by auto");
            println!("{n} bodies in {regions} regions: {owner} and {auto} allocations a step, bare {bare}");
        }
    }
}

/// Makes something, and returns the bytes that it takes.
fn bytes_of<W>(make: impl FnOnce() -> W) -> (usize, W) {
    let before = BYTES.with(Cell::get);
    let made = make();
    (BYTES.with(Cell::get).wrapping_sub(before), made)
}

#[test]
fn a_body_takes_little_more_memory_than_in_a_bare_world() {
    // On this thread, as above.
    let pool = rapier3d::rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        for (arrangement, gap) in [("apart", 2.0), ("touching", 0.99)] {
            let n = 4000;
            let ball = |i: usize| {
                let at = |k: usize| k as f32 * gap;
                let place = Vector::new(at(i % 60), 0.5, at(i / 60));
                // Each ball has user data of its own, as in most games, and two kinds alternate.
                let body = RigidBodyBuilder::dynamic().translation(place).user_data(i as u128);
                (body, ColliderBuilder::ball(0.5).friction([0.5, 0.6][i % 2]))
            };
            let (bare, _world) = bytes_of(|| {
                let mut bare = PhysicsWorld::new();
                bare.clear_thread_pool();
                for (body, collider) in (0..n).map(ball) {
                    bare.insert(body, collider);
                }
                (0..30).for_each(|_| bare.step());
                bare
            });
            for regions in [1, 4] {
                let partitioning = Partitioning::Regions(regions);
                let (ours, world) = bytes_of(|| {
                    let mut world =
                        LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
                    for (body, collider) in (0..n).map(ball) {
                        world.insert(body, collider).unwrap();
                    }
                    (0..30).for_each(|_| world.step().unwrap());
                    world
                });
                let copies = world.stats().ghosts;
                println!(
                    "{arrangement}, {regions} regions: {} bytes per body, {copies} copies; bare {}",
                    ours / n,
                    bare / n
                );
                // With borders there are lists of bodies that may be near them, and a copy near a border is a
                // body too.
                let most = if regions == 1 { 1.35 } else { 1.45 } * (bare * (n + copies) / n) as f64;
                assert!((ours as f64) <= most, "{ours} bytes, bare {bare}");
                let told = world.host().profile().memory_bytes as f64 / ours as f64;
                assert!((0.75..1.25).contains(&told), "it is told as {told} of that");
            }
        }
    });
}
