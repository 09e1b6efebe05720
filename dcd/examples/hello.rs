//! Drops a cube beside a tower and steps until it rests: in a local world, or, given a server and a token, in a served one.
//!
//! `cargo run --release -p dcd --example hello [SERVER TOKEN]`

use std::error::Error;
use std::time::Duration;

use dcd::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::open("tower", &Params::default())?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut world = match &arguments[..] {
        [server, token] => World::connect(&JoinConfig::new(server.parse()?, token))?,
        _ => World::from_scene(&scene, WorldConfig::for_scene(&scene))?,
    };
    let cube = world.insert(
        RigidBodyBuilder::dynamic().translation(Vector::new(4.0, 3.0, 0.0)),
        ColliderBuilder::cuboid(0.5, 0.5, 0.5),
    )?;
    while !world.body(cube).is_none_or(|cube| cube.sleeping) {
        world.poll(Duration::from_secs(1)); // a local world does not wait
        world.step()?;
    }
    let at = world.pose(cube).ok_or("the server refused the cube")?.translation;
    println!("a {}: the cube rests at {at:.2?} after tick {}", world.role(), world.tick().0);
    Ok(())
}
