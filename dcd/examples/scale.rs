//! Shows how to cut a world, and what that costs: a pile of boxes in 1 to 8 regions, on one thread and on all.
//!
//! `cargo run --release -p dcd --example scale`

use std::error::Error;
use std::time::Instant;

use dcd::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::open("pile", &Params::from_args(["n=4000"])?)?;
    let cores = std::thread::available_parallelism()?.get();
    println!("{:>8} {:>8} {:>10} {:>9}  state", "regions", "threads", "ms a step", "ghosts");
    for regions in [1, 2, 4, 8] {
        for threads in [1, cores] {
            let config = WorldConfig {
                partitioning: Partitioning::Regions(regions),
                threads,
                ..WorldConfig::for_scene(&scene)
            };
            let mut world = World::from_scene(&scene, config)?;
            let start = Instant::now();
            for _ in 0..120 {
                world.step()?;
            }
            let ms = start.elapsed().as_secs_f64() * 1e3 / 120.0;
            // The state does not depend on the number of threads.
            let (ghosts, state) = (world.stats().ghosts, world.state_hash()?);
            println!("{regions:>8} {threads:>8} {ms:>10.2} {ghosts:>9}  {state:016x}");
        }
    }
    Ok(())
}
