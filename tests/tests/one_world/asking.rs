//! Puts one query to both worlds, and checks that the answers are the same.

use dcd::physics::{BodyFilter, ColliderId, WorldMotion, WorldRay};
use dcd::protocol::WorldPose;
use dcd::runtime::LocalWorld;
use dcd::space::{BodyId, Bounds};
use proptest::prelude::*;
use rapier3d::parry::bounding_volume::BoundingVolume;
use rapier3d::parry::query::{NonlinearRigidMotion, ShapeCastOptions};
use rapier3d::prelude::*;

use super::scenery::{Bare, HALF_M, place, velocity};

/// How far two answers may differ, metres: both worlds compute in the same f32, but an iteration may come to
/// another end.
const CLOSE_M: f64 = 1e-3;

/// A query in numbers that proptest can shrink.
#[derive(Clone, Debug)]
pub(crate) struct Query {
    what: u8,
    at: [f32; 3],
    towards: [f32; 3],
    size: f32,
    max: f32,
    solid: bool,
    flags: u32,
    groups: Option<(u32, u32, bool)>,
    exclude: Option<u32>,
    only_even: bool,
}

pub(crate) fn questions() -> impl Strategy<Value = Vec<Query>> {
    prop::collection::vec(question(), 1..24)
}

pub(crate) fn question() -> impl Strategy<Value = Query> {
    let flags = prop_oneof![3 => Just(0u32), 2 => 0u32..32];
    let groups = prop::option::weighted(0.4, (0u32..8, 0u32..8, any::<bool>()));
    let filter = (flags, groups, prop::option::of(0u32..24), prop::bool::weighted(0.2));
    (0u8..8, place(), place(), 0.1f32..3.0, 0.0f32..60.0, any::<bool>(), filter).prop_map(
        |(what, at, towards, size, max, solid, (flags, groups, exclude, only_even))| Query {
            what,
            at,
            towards,
            size,
            max,
            solid,
            flags,
            groups,
            exclude,
            only_even,
        },
    )
}

/// The nearest hit: the collider and its distance. Equally near colliders are interchangeable.
type Nearest = Option<(ColliderId, f64)>;

fn same_nearest(what: &str, ours: Nearest, bare: Nearest) -> Result<(), TestCaseError> {
    match (ours, bare) {
        (None, None) => Ok(()),
        (Some((_, a)), Some((_, b))) if (a - b).abs() < CLOSE_M * (1.0 + b) => Ok(()),
        _ => Err(TestCaseError::fail(format!("{what}: {ours:?}, in one world {bare:?}"))),
    }
}

fn same_set(what: &str, ours: &[ColliderId], mut bare: Vec<ColliderId>) -> Result<(), TestCaseError> {
    bare.sort_unstable();
    prop_assert_eq!(ours, &bare[..], "{}", what);
    Ok(())
}

impl Query {
    pub(crate) fn check(&self, world: &LocalWorld, bare: &Bare) -> Result<(), TestCaseError> {
        let groups = self.groups.map(|(memberships, filter, or)| {
            let mode = if or { InteractionTestMode::Or } else { InteractionTestMode::And };
            InteractionGroups::new(
                Group::from_bits_retain(memberships),
                Group::from_bits_retain(filter),
                mode,
            )
        });
        let excluded: Vec<_> = self.exclude.map(BodyId::persistent).into_iter().collect();
        let even =
            |id: BodyId| !self.only_even || (0..48).step_by(2).any(|even| id == BodyId::persistent(even));
        let lets = |id: BodyId, _: &Collider| even(id);
        let flags = QueryFilterFlags::from_bits_truncate(self.flags);
        let ours = BodyFilter {
            flags,
            groups,
            exclude_bodies: &excluded,
            exclude_colliders: &[],
            predicate: Some(&lets),
        };
        let lets_bare = |_: ColliderHandle, collider: &Collider| {
            let body = bare.body(collider);
            even(body) && !excluded.contains(&body)
        };
        let theirs = QueryFilter { flags, groups, predicate: Some(&lets_bare), ..QueryFilter::default() };
        let pipeline = bare.world.query_pipeline_with_filter(theirs);
        self.ask(world, &ours, bare, &pipeline)
    }

    fn ask(
        &self,
        world: &LocalWorld,
        filter: &BodyFilter<'_>,
        bare: &Bare,
        pipeline: &QueryPipeline<'_>,
    ) -> Result<(), TestCaseError> {
        let queries = world.queries();
        let at64 = self.at.map(f64::from);
        let at = Vector::from(self.at);
        let turn = Rotation::from_scaled_axis(Vector::from(self.towards)).normalize();
        let pose = WorldPose { translation: at64, rotation: turn.to_array() };
        let local = Pose::from_parts(at, turn);
        let shape = SharedShape::capsule_x(self.size, self.size * 0.5);
        // The direction to the last bit as the query has it: Parry may round a ray that differs by an ulp to
        // another edge.
        let length = self.towards.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        prop_assume!(length > 0.0);
        let direction = Vector::from(self.towards.map(|v| (f64::from(v) / length) as f32));
        let ray =
            WorldRay { max_m: f64::from(self.max), solid: self.solid, ..WorldRay::new(at64, self.towards) };
        let bare_ray = Ray::new(at, direction);
        match self.what {
            0 => {
                let hit = queries.cast_ray(&ray, filter).unwrap();
                let ours =
                    hit.map(|hit| (ColliderId { body: hit.body, index: hit.collider }, hit.distance_m));
                let theirs = pipeline.cast_ray_and_get_normal(&bare_ray, self.max, self.solid);
                let theirs = theirs.map(|(handle, hit)| (bare.name(handle), f64::from(hit.time_of_impact)));
                same_nearest("cast_ray", ours, theirs)
            }
            1 => {
                let hits = queries.intersect_ray(&ray, filter).unwrap();
                prop_assert!(hits.is_sorted_by(|a, b| a.distance_m <= b.distance_m));
                let mut ids: Vec<_> =
                    hits.iter().map(|hit| ColliderId { body: hit.body, index: hit.collider }).collect();
                ids.sort_unstable();
                let theirs: Vec<_> = pipeline.intersect_ray(bare_ray, self.max, self.solid).collect();
                for hit in &hits {
                    let id = ColliderId { body: hit.body, index: hit.collider };
                    let Some((.., other)) = theirs.iter().find(|(handle, ..)| bare.name(*handle) == id)
                    else {
                        continue;
                    };
                    let other_m = f64::from(other.time_of_impact);
                    same_nearest("intersect_ray", Some((id, hit.distance_m)), Some((id, other_m)))?;
                    prop_assert!((Vector::from(hit.normal) - other.normal).length() < 1e-3);
                }
                same_set(
                    "intersect_ray",
                    &ids,
                    theirs.iter().map(|(handle, ..)| bare.name(*handle)).collect(),
                )
            }
            2 => {
                let hit = queries.project_point(at64, f64::from(self.max), self.solid, filter).unwrap();
                let ours =
                    hit.map(|hit| (ColliderId { body: hit.body, index: hit.collider }, hit.distance_m));
                let theirs = pipeline.project_point(at, self.max, self.solid);
                let theirs =
                    theirs.map(|(handle, found)| (bare.name(handle), f64::from((found.point - at).length())));
                same_nearest("project_point", ours, theirs)
            }
            3 => {
                let ours = queries.intersect_point(at64, filter).unwrap();
                let theirs = pipeline.intersect_point(at).map(|(handle, _)| bare.name(handle));
                same_set("intersect_point", &ours, theirs.collect())
            }
            4 => {
                let ours = queries.intersect_shape(&*shape, &pose, filter).unwrap();
                let theirs = pipeline.intersect_shape(local, &*shape).map(|(handle, _)| bare.name(handle));
                same_set("intersect_shape", &ours, theirs.collect())
            }
            5 => {
                let half = f64::from(self.size * 2.0);
                let ours =
                    queries.intersect_aabb_conservative(&Bounds::around(at64, [half; 3]), filter).unwrap();
                let aabb =
                    Aabb::new(at - Vector::splat(self.size * 2.0), at + Vector::splat(self.size * 2.0));
                let theirs = pipeline
                    .intersect_aabb_conservative(aabb)
                    .filter(|(_, collider)| collider.compute_aabb().intersects(&aabb))
                    .map(|(handle, _)| bare.name(handle));
                same_set("intersect_aabb_conservative", &ours, theirs.collect())
            }
            6 => {
                let options = ShapeCastOptions {
                    max_time_of_impact: self.max * 0.1,
                    stop_at_penetration: self.solid,
                    ..ShapeCastOptions::default()
                };
                let hit = queries.cast_shape(&*shape, &pose, self.towards, options, filter).unwrap();
                let ours = hit.map(|hit| {
                    (ColliderId { body: hit.body, index: hit.collider }, f64::from(hit.time_of_impact))
                });
                let theirs = pipeline.cast_shape(&local, Vector::from(self.towards), &*shape, options);
                let theirs = theirs.map(|(handle, hit)| (bare.name(handle), f64::from(hit.time_of_impact)));
                same_nearest("cast_shape", ours, theirs)
            }
            _ => {
                let motion = WorldMotion {
                    start: pose,
                    local_centre: [0.0; 3],
                    velocity: velocity(self.towards, self.at.map(|v| v / HALF_M)),
                };
                let bare_motion = NonlinearRigidMotion {
                    start: local,
                    local_center: Vector::ZERO,
                    linvel: Vector::from(self.towards),
                    angvel: at / HALF_M,
                };
                let end = self.max * 0.05;
                let hit =
                    queries.cast_shape_nonlinear(&*shape, &motion, 0.0..end, self.solid, filter).unwrap();
                let ours = hit.map(|hit| {
                    (ColliderId { body: hit.body, index: hit.collider }, f64::from(hit.time_of_impact))
                });
                // The colliders one by one, since Rapier's tree misses some grazing hits.
                let one = |(handle, collider): (ColliderHandle, &Collider)| {
                    let still = NonlinearRigidMotion::identity().prepend(*collider.position());
                    let other = collider.shape();
                    let hit = pipeline.dispatcher.cast_shapes_nonlinear(
                        &still,
                        other,
                        &bare_motion,
                        &*shape,
                        0.0,
                        end,
                        self.solid,
                    );
                    let lets =
                        collider.is_enabled() && pipeline.filter.test(pipeline.bodies, handle, collider);
                    hit.ok()
                        .flatten()
                        .filter(|_| lets)
                        .map(|hit| (bare.name(handle), hit.time_of_impact.into()))
                };
                let all = pipeline.colliders.iter().filter_map(one);
                let theirs = all.min_by(|a: &(_, f64), b| a.1.total_cmp(&b.1));
                // Parry cannot cast a turning shape against terrain.
                if pipeline.colliders.iter().any(|(_, other)| other.shape().as_heightfield().is_some()) {
                    return Ok(());
                }
                // Nor against a half-space, which counts where it is met first.
                let is_half_space = |id: ColliderId| {
                    let all = pipeline.colliders.iter();
                    let mut planes = all.filter(|(_, other)| other.shape().as_halfspace().is_some());
                    planes.any(|(handle, _)| bare.name(handle) == id)
                };
                if let Some((_, time)) = ours.filter(|(id, _)| is_half_space(*id)) {
                    let is_first = theirs.is_none_or(|(_, other)| time < other + CLOSE_M * (1.0 + other));
                    prop_assert!(is_first, "cast_shape_nonlinear: {:?}, in one world {:?}", ours, theirs);
                    return Ok(());
                }
                same_nearest("cast_shape_nonlinear", ours, theirs)
            }
        }
    }
}
