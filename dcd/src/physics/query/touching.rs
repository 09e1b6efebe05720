//! Finds the points at which a shape touches colliders, with their normals.

use parry3d::bounding_volume::BoundingVolume;
use parry3d::query::{DefaultQueryDispatcher, PersistentQueryDispatcher};
use rapier3d::geometry::ContactManifold;
use rapier3d::prelude::*;

use super::{BodyFilter, ColliderId, Queries, QueryError, check};
use crate::physics::convert;
use crate::protocol::WorldPose;
use crate::space::Bounds;

/// A point on the surface of a collider that a shape touches.
#[derive(Clone, Copy, Debug)]
pub(in crate::physics) struct Touching {
    pub collider: ColliderId,
    /// In world space, metres.
    pub point: [f64; 3],
    /// The unit normal, out of the collider.
    pub normal: Vector,
}

impl Queries<'_> {
    /// Calls `meet` with every point at which a shape at a pose is at most `reach_m` away from a collider, in no
    /// particular order. Several regions may name the same point of an immovable body.
    pub(in crate::physics) fn visit_touching(
        &self,
        shape: &dyn Shape,
        pose: &WorldPose,
        reach_m: f32,
        filter: &BodyFilter<'_>,
        mut meet: impl FnMut(Touching),
    ) -> Result<(), QueryError> {
        check::pose(pose, "shape's pose")?;
        let turn = Pose::from_rotation(convert::rotation(pose.rotation));
        let around = shape.compute_aabb(&turn).loosened(reach_m);
        let world = |v: Vector| convert::world_point(pose.translation, v);
        let near = Bounds { min: world(around.mins), max: world(around.maxs) };
        let mut manifolds: Vec<ContactManifold> = Vec::new();
        self.ask(filter, Some(&near), |answerer| {
            let anchor = answerer.region.anchor();
            let place = convert::region_from_world(anchor, pose);
            let near = shape.compute_aabb(&place).loosened(reach_m);
            for (handle, other) in answerer.pipeline.intersect_aabb_conservative(near) {
                manifolds.clear();
                let apart = place.inv_mul(other.position());
                // Custom shapes, which have no manifolds, do not travel and are not held here.
                let _ = DefaultQueryDispatcher.contact_manifolds(
                    &apart,
                    shape,
                    other.shape(),
                    reach_m,
                    &mut manifolds,
                    &mut None,
                );
                if manifolds.iter().all(|manifold| manifold.points.is_empty()) {
                    continue;
                }
                let Some(collider) = answerer.name(handle, near) else { continue };
                for manifold in &manifolds {
                    let own = manifold.subshape_pos1().map_or(place, |part| place * *part);
                    let theirs =
                        *other.position() * manifold.subshape_pos2().copied().unwrap_or(Pose::IDENTITY);
                    let normal = -(own.rotation * manifold.local_n1);
                    for contact in manifold.points.iter().filter(|contact| contact.dist <= reach_m) {
                        let point = convert::world_point(anchor, theirs * contact.local_p2);
                        meet(Touching { collider, point, normal });
                    }
                }
            }
        });
        Ok(())
    }
}
