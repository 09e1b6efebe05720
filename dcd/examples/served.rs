//! Runs a game loop in a served world: a server, two nodes and a client, here in one process, over real QUIC links. On separate
//! machines each part is the same few lines.
//!
//! `cargo run --release -p dcd --example served`

use std::error::Error;
use std::time::{Duration, Instant};

use dcd::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::open("pile", &Params::from_args(["n=200"])?)?;
    let cut = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
    let data = tempfile::tempdir()?;
    let server = World::serve(&scene, &cut, ServeConfig { nodes: 2, ..ServeConfig::new(data.path()) })?;

    // A token lets one process in, once.
    let admit = |role| -> Result<JoinConfig, dcd::Error> {
        Ok(JoinConfig::new(server.address()?, server.token(role, Duration::from_secs(60))?))
    };
    let _nodes =
        [World::join_as_node(&admit(JoinRole::Node)?)?, World::join_as_node(&admit(JoinRole::Node)?)?];
    let mut game = World::connect(&admit(JoinRole::Client)?)?;

    let player = game.insert(
        RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(-30.0, 1.0, 0.0)),
        ColliderBuilder::ball(1.0),
    )?;
    let mut seconds = 0;
    let until = Instant::now() + Duration::from_secs(5);
    while Instant::now() < until {
        // Input: drive to the right, through whatever is there.
        game.set_velocity(player, Velocity { linear: [12.0, 0.0, 0.0], angular: [0.0; 3] })?;
        game.poll(Duration::from_millis(100));
        game.step()?;
        // Drawing, once per frame: the player ahead of the world, all else as it was a moment ago.
        let time = game.view_time();
        let highest = game.movable_bodies_at(&time).map(|body| body.pose.translation[1]).fold(0.0, f64::max);
        if game.tick().0 / 60 > seconds {
            seconds = game.tick().0 / 60;
            println!(
                "tick {:>4}: shown as of {:.1}, the highest body at {highest:.2} m",
                game.tick().0,
                time.shown
            );
        }
        for change in game.changes() {
            println!("tick {:>4}: {change:?}", game.tick().0);
        }
        for handover in game.handovers() {
            println!(
                "tick {:>4}: {} went from {} to {}",
                game.tick().0,
                handover.body,
                handover.from,
                handover.to
            );
        }
    }
    let awake = game.movable_bodies().filter(|body| !body.sleeping).count();
    println!(
        "{awake} of {} bodies are awake; {} KiB came",
        game.movable_count(),
        game.traffic().bytes_in / 1024
    );
    Ok(())
}
