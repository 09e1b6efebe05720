//! Reads a sensor across the border of two regions: which balls enter and leave a gate, and how hard they land.
//!
//! `cargo run --release -p dcd --example sensor`

use std::error::Error;

use dcd::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let cut = Partitioning::Cuts(vec![(dcd::Axis::X, 0.0)]);
    let mut world = World::new(WorldConfig { partitioning: cut, ..WorldConfig::default() })?;
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 5.0))?;
    // A gate that detects bodies without pushing them. It reports balls that do not ask for events themselves, but not the
    // ground, which is fixed like the gate.
    let gate = world.insert(
        RigidBodyBuilder::fixed().translation(Vector::new(0.0, 1.5, 0.0)),
        ColliderBuilder::cuboid(0.5, 1.0, 2.0).sensor(true).active_events(ActiveEvents::COLLISION_EVENTS),
    )?;
    for (x, speed) in [(-6.0, 6.0), (6.0, -3.0)] {
        let body =
            RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.0, x / 6.0)).linvel(Vector::X * speed);
        let ball = ColliderBuilder::ball(0.4).active_events(ActiveEvents::CONTACT_FORCE_EVENTS);
        world.insert(body, ball.contact_force_event_threshold(100.0))?;
    }

    let mut entered = 0;
    for _ in 0..240 {
        world.step()?;
        let events = world.events();
        for touch in &events.touches {
            let Some(ball) = touch.key.other(gate) else { continue };
            let verb = if touch.began { "enters" } else { "leaves" };
            println!("tick {:3}: {ball} {verb} the gate", world.tick().0);
            entered += usize::from(touch.began);
        }
        for force in &events.forces {
            println!(
                "tick {:3}: {} and {} press with {:.0} N",
                world.tick().0,
                force.key.a,
                force.key.b,
                force.magnitude_n
            );
        }
    }
    assert_eq!(entered, 2);
    Ok(())
}
