//! Computes AABBs of bodies without going over the points of their hulls each time. Parry finds the AABB of a rotated hull by
//! rotating all of its points, and a region asks for AABBs of bodies near its borders many times per tick.

use parry3d::bounding_volume::BoundingSphere;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::convert;
use crate::space::Bounds;

/// The cached bounds of hulls, from which the AABB of a body is computed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Outline {
    /// The bounds of hulls, by index of the collider on its body; empty if no collider is a hull.
    hulls: Box<[Option<Hull>]>,
}

/// A box and a ball that each hold a hull, in the hull's own space. A rotated box is too large around a round
/// hull, a ball around a long one.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Hull {
    around: Aabb,
    centre: Vector,
    radius: f32,
}

impl Outline {
    /// Caches the bounds of a body's hulls. Must be called anew when a collider gets another shape.
    pub(super) fn of(body: &RigidBody, colliders: &ColliderSet) -> Self {
        let shapes = || body.colliders().iter().map(|&handle| colliders[handle].shape());
        if !shapes().any(is_hull) {
            return Self::default();
        }
        Self { hulls: shapes().map(|shape| is_hull(shape).then(|| Hull::of(shape))).collect() }
    }

    /// Returns the AABB of the body's colliders where the body is now, in world space: the smallest one except for hulls.
    pub(super) fn bounds(&self, body: &RigidBody, colliders: &ColliderSet, anchor: [f64; 3]) -> Bounds {
        let here = convert::world_point(anchor, body.translation());
        let aabbs = body.colliders().iter().enumerate().map(|(place, &handle)| {
            let collider = &colliders[handle];
            // The collider's own pose is that of the last step.
            let pose =
                collider.position_wrt_parent().map_or(*body.position(), |local| *body.position() * *local);
            match self.hulls.get(place).copied().flatten() {
                Some(hull) => hull.at(&pose),
                None => smallest_box(collider.shape(), &pose),
            }
        });
        aabbs.fold(Bounds::new(here, here), |bounds, aabb| {
            bounds.union(&Bounds {
                min: convert::world_point(anchor, aabb.mins),
                max: convert::world_point(anchor, aabb.maxs),
            })
        })
    }
}

impl Hull {
    fn of(shape: &dyn Shape) -> Self {
        let BoundingSphere { center, radius } = shape.compute_local_bounding_sphere();
        Self { around: smallest_box(shape, &Pose::IDENTITY), centre: center, radius }
    }

    fn at(&self, pose: &Pose) -> Aabb {
        let (turned, centre) = (self.around.transform_by(pose), *pose * self.centre);
        let radius = Vector::splat(self.radius);
        Aabb::new(turned.mins.max(centre - radius), turned.maxs.min(centre + radius))
    }
}

/// Returns Parry's own AABB of a shape.
fn smallest_box(shape: &dyn Shape, pose: &Pose) -> Aabb {
    #[cfg(test)]
    if is_hull(shape) {
        tests::WALKS.set(tests::WALKS.get() + 1);
    }
    shape.compute_aabb(pose)
}

/// Returns whether Parry goes over all points of the shape to find its AABB. For meshes, compounds and the like it rotates the
/// local box.
fn is_hull(shape: &dyn Shape) -> bool {
    matches!(shape.shape_type(), ShapeType::ConvexPolyhedron | ShapeType::RoundConvexPolyhedron)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::collections::BTreeSet;

    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::protocol::WorldPose;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::scene::{Scene, SceneJoint};
    use crate::space::Axis;

    thread_local! {
        /// How many times the points of a hull have been gone over.
        pub(super) static WALKS: Cell<usize> = const { Cell::new(0) };
    }

    /// Returns a hull of so many points on an ellipsoid, in a spiral.
    fn ellipsoid(half: [f32; 3], points: u32) -> SharedShape {
        let point = |i: u32| {
            let y = 1.0 - 2.0 * (i as f32 + 0.5) / points as f32;
            let (radius, turn) = ((1.0 - y * y).sqrt(), i as f32 * 2.399_963);
            Vector::new(half[0] * radius * turn.cos(), half[1] * y, half[2] * radius * turn.sin())
        };
        SharedShape::convex_hull(&(0..points).map(point).collect::<Vec<_>>()).unwrap()
    }

    /// Robots of 34 hulls each, tied by 33 joints: a spine along x, with legs. They fall on a floor as they go along x.
    fn robots(count: usize, points: u32) -> Scene {
        let mut scene = Scene::empty("robots");
        scene.push_fixed_box([0.0, -0.5, 0.0], [30.0, 0.5, 30.0], &ColliderBuilder::ball(1.0).friction(0.1));
        let (trunk, limb) = (ellipsoid([0.14, 0.1, 0.1], points), ellipsoid([0.05, 0.13, 0.05], points));
        for robot in 0..count {
            let mut part = |at: [f64; 3], shape: &SharedShape| {
                let at = [at[0] - 1.4, at[1] + 0.8, at[2] + 0.9 * robot as f64];
                let body = RigidBodyBuilder::dynamic().linvel(Vector::X * 6.0);
                scene.push(WorldPose::at(at), body, ColliderBuilder::new(shape.clone()).density(500.0))
            };
            let mut ties = Vec::new();
            let mut before: Option<usize> = None;
            for vertebra in 0..10 {
                let x = 0.25 * f64::from(vertebra);
                let own = part([x, 0.0, 0.0], &trunk);
                ties.extend(before.replace(own).map(|before| (before, own, Vector::X * 0.125)));
                for side in [-1.0f32, 1.0].into_iter().filter(|_| vertebra % 3 == 0) {
                    let mut above = (own, Vector::new(0.0, 0.0, side * 0.15));
                    for joint in 0..3 {
                        let y = -0.13 - 0.26 * f64::from(joint);
                        let leg = part([x, y, f64::from(side) * 0.15], &limb);
                        ties.push((above.0, leg, above.1));
                        above = (leg, Vector::Y * -0.13);
                    }
                }
            }
            let place = |scene: &Scene, body: usize| scene.bodies[body].pose.translation.map(|v| v as f32);
            for (a, b, on_a) in ties {
                let off = Vector::from(place(&scene, a)) + on_a - Vector::from(place(&scene, b));
                let joint = SphericalJointBuilder::new()
                    .local_anchor1(on_a)
                    .local_anchor2(off)
                    .contacts_enabled(false);
                let axes = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ];
                let joint =
                    axes.into_iter().fold(joint, |joint, axis| joint.limits(axis, [-0.7, 0.7])).into();
                scene.joints.push(SceneJoint { a, b, joint, multibody: None });
            }
        }
        scene.bounds = Bounds::new([-4.0, -1.0, -4.0], [4.0, 3.0, 4.0]);
        scene
    }

    #[test]
    fn a_box_holds_all_points_of_a_turned_hull_and_is_hardly_larger_than_the_smallest() {
        let mut dice = ChaCha8Rng::seed_from_u64(7);
        let mut any = |most: f32| {
            Vector::from_array(std::array::from_fn(|_| {
                most * (dice.next_u32() as f32 / u32::MAX as f32 - 0.5)
            }))
        };
        for (half, most) in [([0.3, 0.3, 0.3], 1.05), ([0.05, 0.4, 0.05], 1.75), ([0.5, 0.1, 0.3], 1.75)] {
            let mut world = PhysicsWorld::new();
            let (local, round) = (Rotation::from_scaled_axis(any(3.0)), half[1] > 0.35);
            let shape = ellipsoid(half, 300);
            let shape = if round {
                let points = shape.as_convex_polyhedron().unwrap().points();
                SharedShape::round_convex_hull(points, 0.02).unwrap()
            } else {
                shape
            };
            let collider = ColliderBuilder::new(shape.clone())
                .position(Pose::from_parts(Vector::new(0.2, -0.1, 0.3), local));
            let (body, _) = world.insert(RigidBodyBuilder::dynamic(), collider);
            let outline = Outline::of(&world.bodies[body], &world.colliders);
            let local = *world.colliders.iter().next().unwrap().1.position_wrt_parent().unwrap();
            for _ in 0..100 {
                let pose = Pose::from_parts(any(40.0), Rotation::from_scaled_axis(any(6.0)));
                // Colliders follow in the next step only.
                world.bodies[body].set_position(pose, false);
                let found = outline.bounds(&world.bodies[body], &world.colliders, [100.0, 0.0, 0.0]);
                let exact = shape.compute_aabb(&(pose * local));
                let point = |v| convert::world_point([100.0, 0.0, 0.0], v);
                let here = point(pose.translation);
                let exact = Bounds::new(point(exact.mins), point(exact.maxs)).union(&Bounds::new(here, here));
                assert!(found.grown(1e-5).contains(&exact), "{found:?} does not hold {exact:?}");
                for axis in 0..3 {
                    let wider = found.size()[axis] / exact.size()[axis];
                    assert!(wider <= most, "{half:?}: {wider} times as wide");
                }
            }
        }
    }

    #[test]
    fn the_points_of_a_hull_are_gone_over_once_wherever_its_body_arrives() {
        for cuts in [vec![(Axis::X, 0.0)], vec![(Axis::X, 0.3), (Axis::X, -0.7), (Axis::Z, 0.4)]] {
            let scene = robots(2, 60);
            let config = WorldConfig {
                partitioning: Partitioning::Cuts(cuts),
                threads: 1,
                ..WorldConfig::for_scene(&scene)
            };
            let mut world = LocalWorld::from_scene(&scene, config).unwrap();
            let regions = world.regions().len();
            let held = |world: &LocalWorld| -> BTreeSet<_> {
                let of = |place: usize| {
                    let region = &world.regions().nth(place).unwrap();
                    let hulls = region.bodies().filter(|(_, _, _, body)| body.is_dynamic());
                    hulls
                        .map(move |(id, _, handle, _)| (place, id, handle.into_raw_parts()))
                        .collect::<Vec<_>>()
                };
                (0..world.regions().len()).flat_map(of).collect()
            };
            let (mut before, mut arrivals, mut moved) = (held(&world), 0, 0);
            let start = WALKS.get();
            for _ in 0..150 {
                world.step().unwrap();
                let now = held(&world);
                arrivals += now.difference(&before).count();
                moved += now.len();
                before = now;
            }
            let walks = WALKS.get() - start;
            assert!(world.stats().transfers >= 34, "{regions} regions: {:?}", world.stats());
            assert!(
                walks <= arrivals,
                "{regions} regions: {walks} for {arrivals} arrivals of {moved} bodies"
            );
        }
    }
}
