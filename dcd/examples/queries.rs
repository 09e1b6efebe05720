//! Makes queries across the border of two regions: a ray, all bodies on its way, and a moving shape.
//!
//! `cargo run --release -p dcd --example queries`

use std::error::Error;

use dcd::prelude::*;
use dcd::rapier3d::parry::query::ShapeCastOptions;

fn main() -> Result<(), Box<dyn Error>> {
    let cut = Partitioning::Cuts(vec![(dcd::Axis::X, 0.0)]);
    let mut world = World::new(WorldConfig { partitioning: cut, ..WorldConfig::default() })?;
    let wall = world.insert(
        RigidBodyBuilder::fixed().translation(Vector::new(8.0, 2.0, 0.0)),
        ColliderBuilder::cuboid(0.2, 2.0, 4.0),
    )?;
    for x in [-6.0, -3.0, 3.0] {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.0, 0.0));
        world.insert(body, ColliderBuilder::ball(0.5))?;
    }
    let queries = world.queries()?;

    // A ray from one region into the other; its filter excludes dynamic bodies.
    let ray = WorldRay::new([-10.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    let solid = BodyFilter { flags: QueryFilterFlags::EXCLUDE_DYNAMIC, ..BodyFilter::default() };
    let hit = queries.cast_ray(&ray, &solid)?.ok_or("the wall is there")?;
    println!("the ray meets {} after {:.2} m", hit.body, hit.distance_m);
    assert_eq!(hit.body, wall);
    println!("on its way are {} bodies", queries.intersect_ray(&ray, &BodyFilter::default())?.len());

    // A box that moves along the same way.
    let (start, velocity) = (WorldPose::at([-10.0, 1.0, 0.0]), [1.0, 0.0, 0.0]);
    let shape = Cuboid::new(Vector::splat(0.4));
    let met =
        queries.cast_shape(&shape, &start, velocity, ShapeCastOptions::default(), &BodyFilter::default())?;
    let met = met.ok_or("a ball is there")?;
    println!("a box at 1 m/s meets {} after {:.2} s", met.body, met.time_of_impact);
    Ok(())
}
