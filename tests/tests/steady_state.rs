//! What a step may cost in the steady state: nothing is allocated per body.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use dcd::runtime::{DcdWorld, Partitioning, WorldConfig};
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

#[test]
fn a_step_allocates_nothing_per_body() {
    let allocations = |n: usize, regions: usize| {
        let scene = Scene::named("pile", &Params::new().with("n", n)).unwrap();
        let config =
            WorldConfig { partitioning: Partitioning::Regions(regions), ..WorldConfig::for_scene(&scene) };
        let mut world = DcdWorld::from_scene(&scene, config).unwrap();
        let ours = allocations_per_step(|| world.step().unwrap());
        assert!(regions == 1 || world.stats().replicas > 50, "the border must have traffic");
        let mut bare = scene.bare_world();
        (ours, allocations_per_step(|| bare.step()))
    };
    for regions in [1, 2, 8] {
        let (small, small_bare) = allocations(500, regions);
        let (large, large_bare) = allocations(2_000, regions);
        println!(
            "{regions} regions: {small} and {large} allocations a step, bare {small_bare} and {large_bare}"
        );
        // Four times the bodies: what Rapier allocates in each region, and a fixed number for the exchange.
        let fixed = 8 + 4 * regions as u64;
        assert!(small <= regions as u64 * small_bare.max(1) + fixed, "{small} allocations with 500 bodies");
        assert!(large <= regions as u64 * large_bare.max(1) + fixed, "{large} allocations with 2000 bodies");
    }
}
