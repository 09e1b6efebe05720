//! What the bodies of one host answer to a client's question.

use rapier3d::prelude::*;

use crate::physics::{BodyFilter, QueryError, RayHit, RegionHost, WorldRay};
use crate::protocol::{Answer, Question, RayAnswer, RayQuestion};
use crate::space::{BodyId, ClientId};

/// What each ray meets first of the bodies that are owned here. A ray that cannot be asked meets nothing.
pub(super) fn answer(host: &RegionHost, client: ClientId, question: &Question) -> Answer {
    let hits = question.rays.iter().map(|ray| cast(host, question, ray).ok().flatten().map(|hit| told(&hit)));
    Answer { client, number: question.number, hits: hits.collect() }
}

fn cast(host: &RegionHost, question: &Question, ray: &RayQuestion) -> Result<Option<RayHit>, QueryError> {
    let (groups, mask) = (Group::from_bits_retain(question.groups), Group::from_bits_retain(ray.mask));
    let lets = |id: BodyId, collider: &Collider| {
        let of = collider.collision_groups();
        of.memberships.intersects(mask)
            && (groups.is_empty() || of.filter.intersects(groups))
            && ray.exclude != Some(id)
            && question.exclude.binary_search(&id).is_err()
    };
    let flags = QueryFilterFlags::from_bits_truncate(question.flags);
    let filter = BodyFilter { flags, predicate: Some(&lets), ..BodyFilter::default() };
    let straight = WorldRay { solid: ray.solid, ..WorldRay::new(ray.origin, ray.direction).up_to(ray.max_m) };
    host.queries().cast_ray(&straight, &filter)
}

fn told(hit: &RayHit) -> RayAnswer {
    RayAnswer {
        body: hit.body,
        collider: hit.collider as u32,
        point: hit.point,
        normal: hit.normal,
        distance_m: hit.distance_m,
        subshape: hit.subshape,
    }
}
