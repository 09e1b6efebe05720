//! Casts moving shapes through all regions: finds what they hit first, and when.

use std::collections::BTreeSet;

use parry3d::bounding_volume::BoundingVolume;
use parry3d::query::{NonlinearRigidMotion, ShapeCastHit, ShapeCastOptions, ShapeCastStatus};
use rapier3d::prelude::*;

use super::half_space::onto_half_space;
use super::{Answerer, BodyFilter, Queries, QueryError, check};
use crate::physics::convert;
use crate::protocol::{Velocity, WorldPose};
use crate::space::BodyId;

/// The hit of a moving shape on a collider.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShapeHit {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, from 0 in order of insertion.
    pub collider: usize,
    /// The time of the hit, in the unit of time of the shape's velocity.
    pub time_of_impact: f32,
    /// The point of the hit on the collider, in world space, metres.
    pub point: [f64; 3],
    /// The outward unit normal of the collider there.
    pub normal: [f32; 3],
    /// The point of the hit on the moving shape, in the shape's own space, metres.
    pub point_on_shape: [f32; 3],
    /// The outward unit normal of the moving shape there, in the shape's own space.
    pub normal_on_shape: [f32; 3],
    /// Says whether the two met on the way, or overlapped from the start. Then points and normals may be zero, see
    /// [`ShapeCastOptions::compute_impact_geometry_on_penetration`].
    pub status: ShapeCastStatus,
    /// The part of a compound collider, or the triangle of a mesh.
    pub subshape: u32,
}

/// The motion of a shape that moves and rotates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldMotion {
    /// The pose of the shape at the start, in world space.
    pub start: WorldPose,
    /// The point of the shape that moves straight, in the shape's own space, metres.
    pub local_centre: [f32; 3],
    /// The linear velocity, and the angular velocity about that point, per second.
    pub velocity: Velocity,
}

impl Queries<'_> {
    /// Returns the first hit of a shape that moves straight and does not rotate; of simultaneous hits, that
    /// on the lowest id. `velocity` is in metres per unit of time. Times of `options` are in that unit, and
    /// may be infinite.
    ///
    /// ```
    /// # use dcd::physics::BodyFilter;
    /// # use dcd::protocol::WorldPose;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::prelude::*;
    /// # use parry3d::query::ShapeCastOptions;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// let wall = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(1.0, 9.0, 9.0))?;
    /// let (from, options) = (WorldPose::at([-6.0, 0.0, 0.0]), ShapeCastOptions::with_max_time_of_impact(10.0));
    /// let filter = BodyFilter::default();
    /// let hit = world.queries().cast_shape(&Ball::new(1.0), &from, [2.0, 0.0, 0.0], options, &filter)?.unwrap();
    /// assert_eq!((hit.body, hit.time_of_impact.round()), (wall, 2.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn cast_shape(
        &self,
        shape: &dyn Shape,
        pose: &WorldPose,
        velocity: [f32; 3],
        options: ShapeCastOptions,
        filter: &BodyFilter<'_>,
    ) -> Result<Option<ShapeHit>, QueryError> {
        check::pose(pose, "shape's pose")?;
        check::vector(velocity, "shape's velocity")?;
        check::limit(f64::from(options.max_time_of_impact), "max_time_of_impact")?;
        check::limit(f64::from(options.target_distance), "target_distance")?;
        let velocity = convert::vector(velocity);
        let mut best = None;
        self.ask(filter, None, |answerer| {
            let pose = convert::region_from_world(answerer.region.anchor(), pose);
            let latest = best.map_or(options.max_time_of_impact, |hit: ShapeHit| hit.time_of_impact);
            let options = ShapeCastOptions { max_time_of_impact: latest.min(f32::MAX), ..options };
            let Some((handle, hit)) = answerer.pipeline.cast_shape(&pose, velocity, shape, options) else {
                return;
            };
            let there = Pose::from_translation(velocity * hit.time_of_impact) * pose;
            let near = shape.compute_aabb(&there).loosened(options.target_distance.min(f32::MAX) + 0.1);
            keep_earlier(&mut best, shape_hit(answerer, handle, &hit, near));
        });
        Ok(best)
    }

    /// Calls `meet` with one hit on every collider that a shape meets which moves straight and does not
    /// rotate, in no particular order. `meet` returns the time until which the shape moves from then on, in
    /// the unit of time of its velocity: the time of the hit leaves only what is met earlier, infinity leaves
    /// everything, and 0 ends the query. The latest time of `options` must be finite.
    ///
    /// ```
    /// # use dcd::physics::BodyFilter;
    /// # use dcd::protocol::WorldPose;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::prelude::*;
    /// # use parry3d::query::ShapeCastOptions;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// # for x in [3.0, 6.0, 9.0] {
    /// #     world.insert(RigidBodyBuilder::fixed().translation(Vector::new(x, 0.0, 0.0)), ColliderBuilder::ball(1.0))?;
    /// # }
    /// let mut met = 0;
    /// let (from, options) = (WorldPose::at([0.0; 3]), ShapeCastOptions::with_max_time_of_impact(10.0));
    /// world.queries().visit_cast_shape(&Ball::new(0.5), &from, [1.0, 0.0, 0.0], options, &BodyFilter::default(), |_| {
    ///     met += 1;
    ///     if met < 2 { f32::INFINITY } else { 0.0 }
    /// })?;
    /// assert_eq!(met, 2, "of the three it has seen enough");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn visit_cast_shape(
        &self,
        shape: &dyn Shape,
        pose: &WorldPose,
        velocity: [f32; 3],
        options: ShapeCastOptions,
        filter: &BodyFilter<'_>,
        mut meet: impl FnMut(&ShapeHit) -> f32,
    ) -> Result<(), QueryError> {
        check::pose(pose, "shape's pose")?;
        check::vector(velocity, "shape's velocity")?;
        check::vector([options.max_time_of_impact, 0.0, 0.0], "max_time_of_impact")?;
        check::limit(f64::from(options.max_time_of_impact), "max_time_of_impact")?;
        check::limit(f64::from(options.target_distance), "target_distance")?;
        let velocity = convert::vector(velocity);
        let mut latest = options.max_time_of_impact;
        // Several regions may name the same immovable body.
        let mut met = self.are_several().then(BTreeSet::new);
        self.ask(filter, None, |answerer| {
            if latest == 0.0 {
                return;
            }
            let pose = convert::region_from_world(answerer.region.anchor(), pose);
            let at = |time: f32| Pose::from_translation(velocity * time) * pose;
            let margin = options.target_distance.min(f32::MAX) + 0.1;
            let swept = shape.compute_swept_aabb(&pose, &at(latest)).loosened(margin);
            for (handle, collider) in answerer.pipeline.intersect_aabb_conservative(swept) {
                let options = ShapeCastOptions { max_time_of_impact: latest, ..options };
                let place = collider.position();
                let (onto, along) = (place.inv_mul(&pose), place.rotation.inverse() * velocity);
                let hit =
                    answerer.pipeline.dispatcher.cast_shapes(&onto, along, collider.shape(), shape, options);
                let Some(hit) = hit.ok().flatten().map(|hit| hit.transform1_by(place)) else { continue };
                let near = shape.compute_aabb(&at(hit.time_of_impact)).loosened(margin);
                let Some(hit) = shape_hit(answerer, handle, &hit, near) else { continue };
                if hit.time_of_impact <= latest
                    && met.as_mut().is_none_or(|met| met.insert((hit.body, hit.collider)))
                {
                    // NaN ends the query too.
                    latest = meet(&hit).clamp(0.0, latest).max(0.0);
                    if latest == 0.0 {
                        return;
                    }
                }
            }
        });
        Ok(())
    }

    /// Returns the first hit of a shape that moves and rotates, between two times in seconds. A shape that
    /// overlaps something at the start stops there at once or, without `stop_at_penetration`, only if it
    /// moves further in.
    ///
    /// # Errors
    /// [`QueryError::CannotTurn`] for a half-space or terrain; [`Queries::cast_shape`] takes both.
    pub fn cast_shape_nonlinear(
        &self,
        shape: &dyn Shape,
        motion: &WorldMotion,
        times: std::ops::Range<f32>,
        stop_at_penetration: bool,
        filter: &BodyFilter<'_>,
    ) -> Result<Option<ShapeHit>, QueryError> {
        check::pose(&motion.start, "shape's pose")?;
        check::vector(motion.local_centre, "shape's local centre")?;
        check::vector(motion.velocity.linear, "shape's velocity")?;
        check::vector(motion.velocity.angular, "shape's angular velocity")?;
        check::vector([times.start, times.end, 0.0], "start and end of the time")?;
        check::limit(f64::from(times.end - times.start), "time from start to end")?;
        check::turns(shape)?;
        let mut best: Option<ShapeHit> = None;
        self.ask(filter, None, |answerer| {
            let motion = NonlinearRigidMotion {
                start: convert::region_from_world(answerer.region.anchor(), &motion.start),
                local_center: convert::vector(motion.local_centre),
                linvel: convert::vector(motion.velocity.linear),
                angvel: convert::vector(motion.velocity.angular),
            };
            let pipeline = &answerer.pipeline;
            // Parry's own traversal of a BVH may miss a grazing hit, depending on which boxes lie together.
            for (handle, collider) in pipeline.intersect_aabb_conservative(swept(shape, &motion, &times)) {
                let at = NonlinearRigidMotion::identity().prepend(*collider.position());
                let (start, end) = (times.start, times.end);
                let cast = |onto: &dyn Shape| {
                    let hit = pipeline.dispatcher.cast_shapes_nonlinear(
                        &at,
                        onto,
                        &motion,
                        shape,
                        start,
                        end,
                        stop_at_penetration,
                    );
                    hit.ok().flatten()
                };
                let onto = collider.shape();
                let hit = if let Some(field) = onto.as_heightfield() {
                    let swept = swept(shape, &motion, &times);
                    onto_terrain(field, &swept.transform_by(&collider.position().inverse()), cast)
                } else if let Some(half_space) = onto.as_halfspace() {
                    let place = collider.position();
                    onto_half_space(half_space, place, shape, &motion, &times, stop_at_penetration)
                } else {
                    cast(onto)
                };
                let Some(hit) = hit.map(|hit| hit.transform1_by(collider.position())) else { continue };
                let near = shape.compute_aabb(&motion.position_at_time(hit.time_of_impact)).loosened(0.1);
                keep_earlier(&mut best, shape_hit(answerer, handle, &hit, near));
            }
        });
        Ok(best)
    }
}

/// Returns the swept AABB of a moving shape.
fn swept(shape: &dyn Shape, motion: &NonlinearRigidMotion, times: &std::ops::Range<f32>) -> Aabb {
    let ball = shape.compute_local_bounding_sphere();
    let reach = (ball.center - motion.local_center).length() + ball.radius + 0.01;
    let at = |time: f32| motion.position_at_time(time) * motion.local_center;
    let (start, end) = (at(times.start), at(times.end));
    Aabb::new(start.min(end), start.max(end)).loosened(reach)
}

fn keep_earlier(best: &mut Option<ShapeHit>, hit: Option<ShapeHit>) {
    let Some(hit) = hit else { return };
    let earlier = |best: &ShapeHit| {
        let ids = (hit.body, hit.collider).cmp(&(best.body, best.collider));
        hit.time_of_impact.total_cmp(&best.time_of_impact).then(ids).is_lt()
    };
    if best.as_ref().is_none_or(earlier) {
        *best = Some(hit);
    }
}

fn shape_hit(
    answerer: &Answerer<'_>,
    handle: ColliderHandle,
    hit: &ShapeCastHit,
    near: Aabb,
) -> Option<ShapeHit> {
    let id = answerer.name(handle, near)?;
    let collider = &answerer.pipeline.colliders[handle];
    let terrain = collider.shape().as_heightfield();
    let on_terrain = |field| triangle_at(field, collider.position().inverse_transform_point(hit.witness1));
    Some(ShapeHit {
        body: id.body,
        collider: id.index,
        time_of_impact: hit.time_of_impact,
        point: convert::world_point(answerer.region.anchor(), hit.witness1),
        normal: hit.normal1.to_array(),
        point_on_shape: hit.witness2.to_array(),
        normal_on_shape: hit.normal2.to_array(),
        status: hit.status,
        subshape: terrain.and_then(on_terrain).unwrap_or(hit.subshape1),
    })
}

/// Returns the first hit on the triangles of terrain in a box, which is in the terrain's space. Parry 0.31
/// casts no rotating shape onto terrain.
fn onto_terrain(
    field: &HeightField,
    near: &Aabb,
    cast: impl Fn(&dyn Shape) -> Option<ShapeCastHit>,
) -> Option<ShapeCastHit> {
    let mut first: Option<ShapeCastHit> = None;
    field.map_elements_in_local_aabb(near, &mut |_, triangle| {
        let Some(hit) = cast(triangle) else { return };
        if first.is_none_or(|first| hit.time_of_impact < first.time_of_impact) {
            first = Some(hit);
        }
    });
    first
}

/// Returns the triangle of terrain on which a point lies, by the number that rays give it. Parry 0.31 reports
/// which part a shape hit for meshes and compounds only.
fn triangle_at(field: &HeightField, point: Vector) -> Option<u32> {
    let mut nearest: Option<(f32, u32)> = None;
    field.map_elements_in_local_aabb(&Aabb::new(point, point).loosened(0.01), &mut |id, triangle| {
        let away = triangle.distance_to_local_point(point, true);
        if nearest.is_none_or(|(least, _)| away < least) {
            nearest = Some((away, id));
        }
    });
    nearest.map(|(_, id)| id)
}
