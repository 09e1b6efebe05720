//! Tests what a step may cost in the steady state: nothing is allocated per body.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use dcd::physics::Coupling;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};

/// Counts what this thread allocates; tests run on threads of their own.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations of one step, the fewest of 20, after 60 steps of a pile that does not sleep.
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

/// Allocations of one step by this coupling and of the bare world's, and the replicas held.
fn allocations(coupling: Coupling, n: usize, regions: usize) -> (u64, u64, usize) {
    let scene = Scene::named("pile", &Params::new().with("n", n)).unwrap();
    let config = WorldConfig::for_scene(&scene);
    let step = config.step.with_coupling(coupling);
    let config = WorldConfig { partitioning: Partitioning::Regions(regions), step, ..config };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    let ours = allocations_per_step(|| world.step().unwrap());
    let mut bare = scene.bare_world();
    bare.clear_thread_pool();
    (ours, allocations_per_step(|| bare.step()), world.stats().replicas)
}

#[test]
fn a_step_allocates_nothing_per_body() {
    // A pool of one thread: both worlds step on the thread whose allocations are counted.
    let pool = rapier3d::rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(compare);
}

fn compare() {
    for regions in [1, 2, 8] {
        // Four times the bodies: what Rapier allocates in each region, and a fixed number for the exchange; the same again for what
        // Rapier's parallel solver makes of bodies that an exchange has written.
        let fixed = 8 + 8 * regions as u64;
        for n in [500, 2_000] {
            let (owner, bare, replicas) = allocations(Coupling::Owner, n, regions);
            assert!(regions == 1 || replicas > 50, "the border must have traffic");
            let most = regions as u64 * bare.max(1) + fixed;
            assert!(owner <= most, "{n} bodies in {regions} regions: {owner} allocations by owner");
            // Towers are of ten: those that are replicated by `owner` are islands near a border, each with a few lists.
            let islands = replicas as u64 / 10;
            let (auto, ..) = allocations(Coupling::Auto, n, regions);
            let most = most + fixed + 5 * islands;
            assert!(auto <= most, "{n} bodies in {regions} regions: {auto} allocations by auto");
            println!("{n} bodies in {regions} regions: {owner} and {auto} allocations a step, bare {bare}");
        }
    }
}
