//! Reads what the bodies of a world look like, in every role: which bodies there are, their shapes, size and
//! mass.

use std::sync::{MutexGuard, PoisonError};

use rapier3d::prelude::SharedShape;

use super::{Inner, World};
use crate::physics::{BodyExtent, ColliderId, ShapeLibrary};
use crate::protocol::ShapeHash;
use crate::space::BodyId;

/// The most built shapes kept of a world that others compute; above it, all are dropped and built anew.
const MOST_BUILT: usize = 4096;

/// Shapes and extents of bodies.
impl World {
    /// Returns the ids of all bodies, fixed ones too, in order. In a served world these are the bodies that
    /// this process has heard of; a node returns none.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let ground = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
    /// let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5).density(1000.0))?;
    /// for id in world.bodies() {
    ///     for index in 0..world.collider_count(id) {
    ///         println!("{id} is a {:?}", world.shape((id, index)).unwrap().shape_type());
    ///     }
    /// }
    /// assert_eq!(world.bodies(), [ground, ball]);
    /// assert_eq!(world.shape(ball).unwrap().as_ball().unwrap().radius, 0.5);
    /// assert_eq!(world.extent(ground).unwrap().aabb.size(), [100.0, 1.0, 100.0]);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    #[must_use]
    pub fn bodies(&self) -> Vec<BodyId> {
        let mut all: Vec<_> = match &self.inner {
            Inner::Local(world) => {
                let host = world.host();
                let movable = host.owned_bodies().map(|(id, ..)| id);
                host.scenery().map(|body| body.id).chain(movable).collect()
            }
            Inner::Remote(world) => {
                let mut all: Vec<_> = world.movable_bodies().map(|body| body.id).collect();
                world.for_each_fixed(&mut |id, _| all.push(id));
                // Avatars on their way into the world, too.
                all.extend(world.own_avatars().into_iter().filter(|&id| world.contains(id)));
                all
            }
        };
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Returns the shape of a collider of a body; `None` if this process does not know it. A [`BodyId`]
    /// stands for the body's first collider. [`World::record`] says where the collider sits on its body.
    #[must_use]
    pub fn shape(&self, collider: impl Into<ColliderId>) -> Option<SharedShape> {
        let ColliderId { body, index } = collider.into();
        let hash = self.record(body)?.traits.colliders.get(index)?.shape;
        match &self.inner {
            Inner::Local(world) => world.host().shapes().shape(hash).ok(),
            Inner::Remote(_) => self.built([hash])?.shape(hash).ok(),
        }
    }

    /// Returns whether this process knows the shape: a body has it, or had it a while ago.
    #[doc(hidden)]
    #[must_use]
    pub fn knows_shape(&self, shape: ShapeHash) -> bool {
        match &self.inner {
            Inner::Local(world) => world.host().shapes().record_of(shape).is_some(),
            Inner::Remote(world) => world.shape(shape).is_some(),
        }
    }

    /// Returns the box, mass, centre of mass and inertia of a body; `None` if this process does not know the
    /// body. They follow from the body's shapes and record, so that a client has them too.
    #[must_use]
    pub fn extent(&self, id: BodyId) -> Option<BodyExtent> {
        let known = self.record(id)?;
        match &self.inner {
            Inner::Local(world) => BodyExtent::of(&known, world.host().shapes()).ok(),
            Inner::Remote(_) => {
                let shapes = self.built(known.traits.colliders.iter().map(|collider| collider.shape))?;
                BodyExtent::of(&known, &shapes).ok()
            }
        }
    }

    /// Builds shapes of a world that others compute, and returns all built shapes; `None` if a shape is not
    /// known.
    fn built(&self, hashes: impl IntoIterator<Item = ShapeHash>) -> Option<MutexGuard<'_, ShapeLibrary>> {
        let world = self.remote()?;
        // Each shape is added whole or not at all.
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        if built.len() > MOST_BUILT {
            *built = ShapeLibrary::default();
        }
        for hash in hashes {
            if built.record_of(hash).is_some() {
                continue;
            }
            let shape = world.shape(hash)?;
            for part in shape.parts() {
                built.add(world.shape(part)?).ok()?;
            }
            built.add(shape).ok()?;
        }
        Some(built)
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::World;
    use crate::physics::RegionHost;
    use crate::runtime::{Partitioning, WorldConfig};
    use crate::space::Axis;

    #[test]
    fn extents_are_those_of_whole_bodies_whatever_regions_hold_them() {
        let config = WorldConfig {
            partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]),
            threads: 1,
            ..WorldConfig::default()
        };
        let mut world = World::new(config).unwrap();
        let floor = ColliderBuilder::cuboid(20.0, 0.5, 20.0).translation(Vector::new(0.0, -0.5, 0.0));
        let floor = world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
        let cube = |at: f32| RigidBodyBuilder::dynamic().translation(Vector::new(at, 0.5, 0.0));
        let shape = || ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0);
        let bodies = [-0.4, 0.7].map(|at| world.insert(cube(at), shape()).unwrap());
        for _ in 0..10 {
            world.step().unwrap();
        }
        let holders: usize = bodies.map(|id| world.owner(id).holders).iter().sum();
        assert!(holders > 2, "something is shared");
        assert_eq!(world.bodies(), [floor, bodies[0], bodies[1]]);
        let host: &RegionHost = world.alone().unwrap().host();
        for id in bodies {
            let (extent, body) = (world.extent(id).unwrap(), world.body(id).unwrap());
            assert!((extent.mass_kg - body.mass_kg.unwrap()).abs() < 0.01, "{extent:?}");
            let (region, handle) = host.owned(id).unwrap();
            let bounds = region.world_bounds(handle);
            assert!(extent.aabb.grown(1e-5).contains(&bounds) && bounds.grown(1e-5).contains(&extent.aabb));
        }
        assert_eq!(
            (world.extent(floor).unwrap().mass_kg, world.body(floor).unwrap().mass_kg),
            (0.0, Some(0.0))
        );
        assert!(world.shape((floor, 1)).is_none() && world.shape(floor).is_some());
    }
}
