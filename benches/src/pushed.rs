//! Builds a scene that clients are shown: 900 cubes that lie on a plane, and an arm that sweeps through them, as long as it has not cleared
//! its circle. The count is that of Fiedler's cubes ("State Synchronization", 2015), whose player rolls through them.

use dcd::prelude::*;

/// Half the length of the arm, metres.
const REACH_M: f32 = 13.0;

pub(crate) fn config() -> WorldConfig {
    let bounds = Bounds { min: [-32.0, -4.0, -32.0], max: [32.0, 28.0, 32.0] };
    WorldConfig { partitioning: Partitioning::Regions(2), bounds, ..WorldConfig::default() }
}

pub(crate) fn world() -> Result<World, dcd::Error> {
    let mut world = World::new(config())?;
    world.insert(
        RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0)),
        ColliderBuilder::cuboid(60.0, 0.5, 60.0),
    )?;
    for i in 0..900 {
        let at = Vector::new((i % 30) as f32 - 14.5, 0.2, (i / 30) as f32 - 14.5);
        world.insert(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::cuboid(0.2, 0.2, 0.2))?;
    }
    world.insert(
        RigidBodyBuilder::kinematic_velocity_based()
            .translation(Vector::new(0.0, 0.6, 0.25))
            .angvel(Vector::new(0.0, 0.25, 0.0)),
        ColliderBuilder::cuboid(REACH_M, 0.5, 0.2),
    )?;
    Ok(world)
}
