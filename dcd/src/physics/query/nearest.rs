//! Finds the collider in a Rapier BVH that a ray hits first. Collider and hit are those that Rapier itself
//! finds, to the bit, at half the cost.

use parry3d::partitioning::BvhNode;
use parry3d::shape::TypedCompositeShape;
use rapier3d::prelude::*;

/// Returns the first hit of a ray, as `QueryPipeline::cast_ray_and_get_normal` does. That function computes
/// anew for each box of the BVH what is the same for the whole ray.
pub(super) fn nearest(
    pipeline: &QueryPipeline<'_>,
    ray: &Ray,
    reach: f32,
    solid: bool,
) -> Option<(ColliderHandle, RayIntersection)> {
    let slabs = Slabs::of(ray);
    let (leaf, hit) = pipeline.bvh.find_best(
        reach,
        |node, nearest| slabs.enters(node, nearest),
        |leaf, nearest| {
            pipeline.map_typed_part_at(leaf, |pose, shape, _| match pose {
                Some(pose) => shape.cast_ray_and_get_normal(pose, ray, nearest, solid),
                None => shape.cast_local_ray_and_get_normal(ray, nearest, solid),
            })?
        },
    )?;
    let (_, handle) = pipeline.colliders.get_unknown_gen(leaf)?;
    Some((handle, hit))
}

/// A ray in the form in which it is tested against the boxes of a BVH.
struct Slabs {
    origin: [f32; 3],
    inverse: [f32; 3],
}

impl Slabs {
    fn of(ray: &Ray) -> Self {
        // A ray that does not move along an axis is always between the two sides of a box, or always outside
        // of them, whatever the sign of its zero.
        let inverse = |along: f32| if along == 0.0 { f32::INFINITY } else { 1.0 / along };
        Self { origin: ray.origin.to_array(), inverse: ray.dir.to_array().map(inverse) }
    }

    /// Returns where the ray enters a box, as `BvhNode::cast_ray` does: 0 from inside, `f32::MAX` if it does
    /// not enter before `nearest`.
    #[inline]
    fn enters(&self, node: &BvhNode, nearest: f32) -> f32 {
        let (mins, maxs) = (node.mins().to_array(), node.maxs().to_array());
        let (mut enter, mut leave) = (0.0, nearest);
        for i in 0..3 {
            let low = (mins[i] - self.origin[i]) * self.inverse[i];
            let high = (maxs[i] - self.origin[i]) * self.inverse[i];
            // Each choice is one instruction. None takes the NaN of a ray that moves along the side of a box.
            let (near, far) = (if low > high { high } else { low }, if low > high { low } else { high });
            enter = if near > enter { near } else { enter };
            leave = if far < leave { far } else { leave };
        }
        if enter > leave { f32::MAX } else { enter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a world of boxes and balls that touch one another on a lattice, and an infinite floor. Rays
    /// along the lattice run in the sides of the boxes' AABBs.
    fn world() -> PhysicsWorld {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::ZERO;
        for i in 0..343 {
            let at = Vector::new((i % 7) as f32, (i / 7 % 7) as f32, (i / 49) as f32);
            let collider = match i % 5 {
                0 => ColliderBuilder::ball(0.5),
                1 => ColliderBuilder::cuboid(0.25, 0.5, 0.5).sensor(true),
                _ => ColliderBuilder::cuboid(0.5, 0.5, 0.5),
            };
            world.insert(RigidBodyBuilder::dynamic().translation(at), collider);
        }
        let at = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.5, 0.5));
        let pair = [-0.4, 0.4].map(|x| (Pose::from_translation(Vector::X * x), SharedShape::ball(0.5)));
        world.insert(at(-1.4), ColliderBuilder::compound(pair.to_vec()));
        let corners = vec![Vector::ZERO, Vector::new(0.0, 2.0, 0.0), Vector::new(0.0, 0.0, 2.0)];
        world.insert(at(8.0), ColliderBuilder::trimesh(corners, vec![[0, 1, 2]]).unwrap());
        world.insert(at(-2.6), ColliderBuilder::cuboid(0.5, 4.0, 4.0).enabled(false));
        let floor = ColliderBuilder::new(SharedShape::halfspace(Vector::Y));
        world.insert(RigidBodyBuilder::fixed().translation(Vector::new(0.0, -20.0, 0.0)), floor);
        world.step();
        world
    }

    /// Returns rays from corners and sides of the boxes, from inside them and from anywhere, along axes in
    /// both directions, along planes, and aslant.
    fn rays() -> impl Iterator<Item = Ray> {
        let ways = [0.0, -0.0, 1.0, -1.0, 0.6, 1e-39, -1e-39, 3e-5];
        let origins = [-2.0, -0.51, -0.5, 0.0, 0.5, 1.49, 3.25, 6.51, 30.0];
        (0..8 * 8 * 8_usize).flat_map(move |way| {
            (0..9 * 9 * 9_usize).step_by(7).map(move |from| {
                let origin = [from % 9, from / 9 % 9, from / 81].map(|i| origins[i]);
                let direction = [way % 8, way / 8 % 8, way / 64].map(|i| ways[i]);
                Ray::new(Vector::from_array(origin), Vector::from_array(direction))
            })
        })
    }

    #[test]
    fn what_a_ray_meets_first_is_to_the_bit_what_rapier_finds() {
        let world = world();
        let solids = |_: ColliderHandle, collider: &Collider| !collider.is_sensor();
        let bits = |hit: Option<(ColliderHandle, RayIntersection)>| {
            hit.map(|(handle, hit)| {
                let normal = hit.normal.to_array().map(f32::to_bits);
                (handle, hit.time_of_impact.to_bits(), normal, hit.feature, hit.subshape)
            })
        };
        let mut met = 0;
        for (i, ray) in rays().enumerate() {
            let filter = if i % 3 == 0 { QueryFilter::new().predicate(&solids) } else { QueryFilter::new() };
            let pipeline = world.query_pipeline_with_filter(filter);
            for (reach, solid) in [(f32::MAX, true), (4.0, false)] {
                let found = bits(nearest(&pipeline, &ray, reach, solid));
                let by_rapier = bits(pipeline.cast_ray_and_get_normal(&ray, reach, solid));
                assert_eq!(found, by_rapier, "{ray:?}, up to {reach}");
                met += usize::from(found.is_some());
            }
        }
        assert!(met > 10_000, "{met}");
    }

    #[test]
    fn boxes_are_entered_where_parry_has_them_entered() {
        let world = world();
        let bvh = world.query_pipeline().bvh;
        let mut boxes = 0;
        for ray in rays().step_by(5) {
            let slabs = Slabs::of(&ray);
            for nearest in [f32::MAX, 3.0] {
                let same = |node: &BvhNode| slabs.enters(node, nearest) == node.cast_ray(&ray, nearest);
                let differs = |node: &BvhNode| panic!("{ray:?} enters {node:?} elsewhere, up to {nearest}");
                boxes += bvh.leaves(|node| same(node) || differs(node)).count();
            }
        }
        assert!(boxes > 1_000_000, "{boxes}");
    }
}
