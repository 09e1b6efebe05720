//! Defines spatial queries (rays, shape casts, overlaps) that clients send, and the answers of the processes
//! that own the bodies.

use bincode::{Decode, Encode};

use crate::protocol::{ShapeHash, ShapeRecord, WorldPose, encoded_len, link};
use crate::space::{BodyId, Bounds, ClientId};

/// The most that one query may cost (see [`Query::cost`]), and the most bodies that it may exclude.
pub const MAX_COST: usize = 1_024;
/// The most that all unanswered queries of one client may cost together.
pub const MAX_OPEN_COST: usize = 4 * MAX_COST;
/// The most unanswered queries of one client.
pub const MAX_OPEN_QUERIES: usize = 64;
/// The cost of a shape that moves or overlaps. A ray, a point or a box costs 1.
pub const SHAPE_COST: usize = 8;
/// The least cost of a query for overlaps, since its answer may be long.
pub const OVERLAPS_COST: usize = 64;
/// The most colliders that one query for overlaps may find.
pub const MAX_FOUND: usize = 4_096;
/// The longest query in bytes: with its envelope it fits a client's frame.
pub const MAX_QUERY_BYTES: usize = link::CLIENT_FRAME_BYTES - 64;
/// The largest shape that may turn during a cast, metres: the farther out a shape reaches, the finer the
/// steps in which it is looked at.
pub const MAX_TURNING_M: f32 = 100.0;
/// The largest turn of a shape during a cast, radians, since a turn is looked at in many steps.
pub const MAX_TURN: f32 = 64.0;

/// A spatial query: rays, casts or overlaps, with one filter for all of them.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Query {
    /// The number of the query, different from those of the sender's other queries. `World::submit` sets it.
    pub number: u64,
    /// The filter of all parts.
    pub filter: FilterRecord,
    /// The shapes that the parts name, parts of compounds before the compounds. Each
    /// [suits clients](ShapeRecord::suits_clients): it is no mesh, terrain, voxels or half-space.
    pub shapes: Vec<ShapeRecord>,
    /// The rays, casts or overlaps.
    pub parts: QueryParts,
}

/// The filter of a whole query: the bodies and colliders that it ignores.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct FilterRecord {
    /// The kinds of bodies and colliders that are left out, as bits of Rapier's `QueryFilterFlags`.
    pub flags: u32,
    /// The groups to which the query belongs: colliders that meet none of them are left out. 0 filters
    /// nothing.
    pub groups: u32,
    /// Bodies that are left out, in id order; at most [`MAX_COST`] (1,024).
    pub exclude: Vec<BodyId>,
}

/// The parts of a query. All are answered for the world after the same tick.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum QueryParts {
    /// Rays: the first hit of each.
    Rays(Vec<RayQuery>),
    /// Moving shapes: the first hit of each.
    Casts(Vec<CastQuery>),
    /// Places: all colliders at each.
    Overlaps(Vec<OverlapQuery>),
}

/// A ray of a query.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayQuery {
    /// The start of the ray, in world space, metres.
    pub origin: [f64; 3],
    /// The direction, of any length above 0.
    pub direction: [f32; 3],
    /// The length of the ray, metres; may be infinite.
    pub max_m: f64,
    /// Says whether the ray hits a body that it starts in at once.
    pub solid: bool,
    /// The groups that the ray may find, and one body that it ignores.
    pub filter: PartFilter,
}

/// A shape cast: one shape that moves straight, and may turn on the way.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct CastQuery {
    /// The shape, one of the query's shapes.
    pub shape: ShapeHash,
    /// The pose of the shape at the start, in world space.
    pub pose: WorldPose,
    /// The way of the shape's origin, metres.
    pub motion: [f32; 3],
    /// The turn on the way: an axis of world space, whose length is the angle in radians, at most
    /// [`MAX_TURN`] (64).
    pub turn: [f32; 3],
    /// The distance from a body, metres, at which the shape counts as there; 0 if it turns.
    pub margin_m: f32,
    /// Says whether a body that the shape overlaps at the start stops it only if it moves farther in. Not possible
    /// for a shape that turns, where the search may not end.
    pub leaves: bool,
    /// The groups that the shape may find, and one body that it ignores.
    pub filter: PartFilter,
}

/// An overlap query: one place.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct OverlapQuery {
    /// The place.
    pub place: Place,
    /// The groups that may be found, and one body that is ignored.
    pub filter: PartFilter,
}

/// The place of an overlap query.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub enum Place {
    /// The colliders that overlap a shape at a pose.
    Shape(ShapeHash, WorldPose),
    /// The colliders that contain a point in world space, metres.
    Point([f64; 3]),
    /// The colliders whose own box touches this box, which may be infinite.
    Box(Bounds),
}

/// The filter of a single ray, cast or overlap; the default lets everything be found.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct PartFilter {
    /// The groups: only colliders that are members of one of them are found.
    pub mask: u32,
    /// A body that is left out, for example the one on whose behalf the query is made.
    pub exclude: Option<BodyId>,
}

impl PartFilter {
    /// Makes a filter that leaves out one body.
    #[must_use]
    pub fn excluding(body: BodyId) -> Self {
        Self { exclude: Some(body), ..Self::default() }
    }
}

impl Default for PartFilter {
    fn default() -> Self {
        Self { mask: u32::MAX, exclude: None }
    }
}

impl Query {
    /// Makes a query without a filter.
    fn of(parts: QueryParts) -> Self {
        Self { number: 0, filter: FilterRecord::default(), shapes: Vec::new(), parts }
    }

    /// Makes a query for the first hit of each ray.
    #[must_use]
    pub fn rays(rays: impl IntoIterator<Item = RayQuery>) -> Self {
        Self::of(QueryParts::Rays(rays.into_iter().collect()))
    }

    /// Makes a query for the colliders at each place. A [`Place::Shape`] names one of `shapes`, which the
    /// caller fills in; [`Query::intersect_shape`] makes a query about one shape.
    #[must_use]
    pub fn overlaps(places: impl IntoIterator<Item = Place>) -> Self {
        let overlap = |place| OverlapQuery { place, filter: PartFilter::default() };
        Self::of(QueryParts::Overlaps(places.into_iter().map(overlap).collect()))
    }

    /// Returns the cost of answering the query, in rays.
    #[doc(hidden)]
    pub fn cost(&self) -> usize {
        let of = |place: &Place| if matches!(place, Place::Shape(..)) { SHAPE_COST } else { 1 };
        match &self.parts {
            QueryParts::Rays(rays) => rays.len(),
            QueryParts::Casts(casts) => SHAPE_COST * casts.len(),
            QueryParts::Overlaps(overlaps) => {
                overlaps.iter().map(|overlap| of(&overlap.place)).sum::<usize>().max(OVERLAPS_COST)
            }
        }
    }

    /// Returns whether the query is short enough to be sent.
    #[doc(hidden)]
    pub fn fits(&self) -> bool {
        encoded_len(self) <= MAX_QUERY_BYTES
    }
}

impl RayQuery {
    /// Makes a ray of infinite length that is solid and finds everything.
    #[must_use]
    pub fn new(origin: [f64; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, max_m: f64::INFINITY, solid: true, filter: PartFilter::default() }
    }

    /// Returns the same ray with this length, metres.
    #[must_use]
    pub fn up_to(self, max_m: f64) -> Self {
        Self { max_m, ..self }
    }

    /// Returns the same ray that leaves out one body, for example the one on whose behalf the query is made.
    #[must_use]
    pub fn excluding(self, body: BodyId) -> Self {
        Self { filter: PartFilter { exclude: Some(body), ..self.filter }, ..self }
    }
}

impl QueryParts {
    /// Returns the answer of a world without bodies.
    #[doc(hidden)]
    pub fn nothing(&self) -> QueryResult {
        match self {
            Self::Rays(rays) => QueryResult::Rays(vec![None; rays.len()]),
            Self::Casts(casts) => QueryResult::Casts(vec![None; casts.len()]),
            Self::Overlaps(overlaps) => QueryResult::Overlaps(vec![Vec::new(); overlaps.len()]),
        }
    }
}

/// The hit of a ray of a query.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayAnswer {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, from 0 in order of insertion.
    pub collider: u32,
    /// The point of the hit in world space, metres.
    pub point: [f64; 3],
    /// The outward unit normal there; zero where the ray starts inside.
    pub normal: [f32; 3],
    /// The distance from the origin of the ray, metres.
    pub distance_m: f64,
    /// The part of a compound, or the triangle of a mesh.
    pub subshape: u32,
}

/// The hit of a moving shape of a query.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct CastAnswer {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, from 0 in order of insertion.
    pub collider: u32,
    /// The part of its way that the shape had gone, 0 to 1.
    pub fraction: f32,
    /// The point of the hit on the body, in world space, metres.
    pub point: [f64; 3],
    /// The outward unit normal of the body there.
    pub normal: [f32; 3],
    /// The point of the hit on the shape, in the shape's own space, metres.
    pub point_on_shape: [f32; 3],
    /// The outward unit normal of the shape there, in the shape's own space.
    pub normal_on_shape: [f32; 3],
    /// The part of a compound, or the triangle of a mesh.
    pub subshape: u32,
    /// Says whether the shape overlapped the body at the start.
    pub inside: bool,
}

/// A collider at the place of an overlap query.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub struct Overlap {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, from 0 in order of insertion.
    pub collider: u32,
}

/// The result of a query, in the order of its parts.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum QueryResult {
    /// The first hit of each ray; `None` where the ray met nothing.
    Rays(Vec<Option<RayAnswer>>),
    /// The first hit of each shape; `None` where the shape met nothing.
    Casts(Vec<Option<CastAnswer>>),
    /// The colliders at each place, by body and collider; at most [`MAX_FOUND`] (4,096) in all.
    Overlaps(Vec<Vec<Overlap>>),
    /// There were more overlaps than [`MAX_FOUND`].
    TooMuch,
}

impl QueryResult {
    /// Merges what others found for the same query. The nearest hit counts; of equally near ones, that of the
    /// lowest id. Returns whether both answer the same query.
    #[doc(hidden)]
    pub fn join(&mut self, other: Self) -> bool {
        match (&mut *self, other) {
            (Self::Rays(ours), Self::Rays(theirs)) if ours.len() == theirs.len() => {
                keep_first(ours, theirs, |hit| (hit.distance_m, hit.body, hit.collider));
            }
            (Self::Casts(ours), Self::Casts(theirs)) if ours.len() == theirs.len() => {
                keep_first(ours, theirs, |hit| (f64::from(hit.fraction), hit.body, hit.collider));
            }
            (Self::Overlaps(ours), Self::Overlaps(theirs)) if ours.len() == theirs.len() => {
                for (ours, theirs) in ours.iter_mut().zip(theirs) {
                    ours.extend(theirs);
                    // Several members hold the ground, and so find it.
                    ours.sort_unstable();
                    ours.dedup();
                }
                if ours.iter().map(Vec::len).sum::<usize>() > MAX_FOUND {
                    *self = Self::TooMuch;
                }
            }
            (Self::Overlaps(_), Self::TooMuch) => *self = Self::TooMuch,
            (Self::TooMuch, Self::Overlaps(_) | Self::TooMuch) => {}
            _ => return false,
        }
        true
    }
}

fn keep_first<T>(ours: &mut [Option<T>], theirs: Vec<Option<T>>, when: impl Fn(&T) -> (f64, BodyId, u32)) {
    let is_before = |a: &T, b: &T| {
        let (a, b) = (when(a), when(b));
        a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))).is_lt()
    };
    for (ours, theirs) in ours.iter_mut().zip(theirs) {
        if let Some(theirs) = theirs
            && ours.as_ref().is_none_or(|ours| is_before(&theirs, ours))
        {
            *ours = Some(theirs);
        }
    }
}

/// The answer to a query from one member's own bodies, after the tick with which the query came.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Answer {
    /// The client that asked.
    pub client: ClientId,
    /// The number of the query.
    pub number: u64,
    /// The result.
    pub found: QueryResult,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Check, FromClient, Message, encode};

    const RAY: RayQuery = RayQuery {
        origin: [1.0, 2.0, 3.0],
        direction: [0.0, -1.0, 0.0],
        max_m: f64::INFINITY,
        solid: true,
        filter: PartFilter { mask: u32::MAX, exclude: None },
    };

    fn question(asked: QueryParts) -> Query {
        Query { number: 1, ..Query::of(asked) }
    }

    fn is_right(question: Query) -> bool {
        FromClient::Ask(question).check().is_ok()
    }

    fn cast() -> CastQuery {
        CastQuery {
            shape: ShapeRecord::Ball(0.5).hash(),
            pose: WorldPose::default(),
            motion: [1.0, 0.0, 0.0],
            turn: [0.0; 3],
            margin_m: 0.1,
            leaves: true,
            filter: PartFilter::default(),
        }
    }

    #[test]
    fn rays_are_finite_and_go_somewhere() {
        let right = |ray: RayQuery| is_right(question(QueryParts::Rays(vec![ray])));
        assert!(right(RAY));
        for wrong in [
            RayQuery { origin: [f64::NAN; 3], ..RAY },
            RayQuery { direction: [0.0; 3], ..RAY },
            RayQuery { direction: [f32::INFINITY; 3], ..RAY },
            RayQuery { max_m: f64::NAN, ..RAY },
            RayQuery { max_m: -1.0, ..RAY },
        ] {
            assert!(!right(wrong), "{wrong:?}");
        }
    }

    #[test]
    fn shapes_that_move_are_whole_and_do_not_turn_for_ever() {
        let right = |cast: CastQuery| is_right(question(QueryParts::Casts(vec![cast])));
        let turns = CastQuery { turn: [0.0, 60.0, 0.0], margin_m: 0.0, leaves: false, ..cast() };
        assert!(right(cast()) && right(turns));
        for wrong in [
            CastQuery { pose: WorldPose::at([f64::NAN; 3]), ..cast() },
            CastQuery { motion: [f32::INFINITY; 3], ..cast() },
            CastQuery { margin_m: -0.1, ..cast() },
            CastQuery { turn: [60.0; 3], ..turns },
            CastQuery { turn: [f32::NAN; 3], ..turns },
            CastQuery { margin_m: 0.1, ..turns },
            CastQuery { leaves: true, ..turns },
        ] {
            assert!(!right(wrong), "{wrong:?}");
        }
    }

    #[test]
    fn what_is_asked_with_has_an_inside() {
        let with = |shapes| is_right(Query { shapes, ..question(QueryParts::Casts(vec![cast()])) });
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        assert!(with(vec![
            ShapeRecord::Ball(0.5),
            ShapeRecord::ConvexPolyhedron(corners.clone(), faces.clone())
        ]));
        assert!(!with(vec![ShapeRecord::Ball(f32::NAN)]));
        assert!(!with(vec![ShapeRecord::TriMesh(corners, faces, 0)]));
    }

    #[test]
    fn places_are_finite_and_boxes_have_their_corners_in_order() {
        let right = |place| {
            is_right(question(QueryParts::Overlaps(vec![OverlapQuery {
                place,
                filter: PartFilter::default(),
            }])))
        };
        let corner = |min, max| Place::Box(Bounds { min: [min; 3], max: [max; 3] });
        assert!(right(Place::Point([1.0; 3])) && right(corner(f64::NEG_INFINITY, f64::INFINITY)));
        assert!(!right(Place::Point([f64::INFINITY; 3])));
        assert!(!right(corner(1.0, 0.0)) && !right(corner(f64::NAN, 0.0)));
        let shape = ShapeRecord::Ball(0.5).hash();
        assert!(right(Place::Shape(shape, WorldPose::default())));
        assert!(!right(Place::Shape(shape, WorldPose::at([f64::INFINITY; 3]))));
    }

    #[test]
    fn a_question_costs_so_much_at_most_and_fits_a_frame_of_a_client() {
        let place = |place| OverlapQuery { place, filter: PartFilter::default() };
        let shape = Place::Shape(cast().shape, WorldPose::default());
        let cost = |asked| question(asked).cost();
        assert_eq!(cost(QueryParts::Casts(vec![cast(); 3])), 3 * SHAPE_COST);
        assert_eq!(cost(QueryParts::Overlaps(vec![place(Place::Point([0.0; 3]))])), OVERLAPS_COST);
        assert_eq!(cost(QueryParts::Overlaps(vec![place(shape); 100])), 100 * SHAPE_COST);
        let rays = |count| question(QueryParts::Rays(vec![RAY; count]));
        assert!(is_right(rays(MAX_COST)) && !is_right(rays(MAX_COST + 1)));
        let overlooking = |count: usize| {
            let exclude = (0..count as u32).map(BodyId::persistent).collect();
            Query { filter: FilterRecord { exclude, ..FilterRecord::default() }, ..rays(1) }
        };
        assert!(is_right(overlooking(MAX_COST)) && !is_right(overlooking(MAX_COST + 1)));
        // Queries with the most to exclude are too long for a frame.
        let body = |index| BodyId::avatar(ClientId(u32::MAX), index);
        let ray = RayQuery { filter: PartFilter { exclude: Some(body(0)), ..RAY.filter }, ..RAY };
        let long = |count: usize| {
            let exclude = (0..count as u32).map(body).collect();
            let asked = QueryParts::Rays(vec![ray; MAX_COST]);
            Query { filter: FilterRecord { exclude, ..FilterRecord::default() }, ..question(asked) }
        };
        let most = (0..=MAX_COST).rev().find(|&count| long(count).fits()).unwrap();
        assert!(most > 300 && most < MAX_COST && is_right(long(most)) && !is_right(long(most + 1)));
        let message = Message::FromClient(ClientId(u32::MAX), FromClient::Ask(long(most)));
        assert!(encode(&message).len() <= link::CLIENT_FRAME_BYTES);
    }

    #[test]
    fn what_several_found_is_joined() {
        let hit = |body: u32, fraction| {
            let body = BodyId::persistent(body);
            let [normal, point_on_shape, normal_on_shape] = [[0.0; 3]; 3];
            let (collider, point, subshape, inside) = (0, [0.0; 3], 0, false);
            Some(CastAnswer {
                body,
                collider,
                fraction,
                point,
                normal,
                point_on_shape,
                normal_on_shape,
                subshape,
                inside,
            })
        };
        let mut found = QueryResult::Casts(vec![hit(1, 0.5), hit(2, 0.25), None, hit(4, 0.5)]);
        assert!(
            !found.join(QueryResult::Casts(vec![None; 3])) && !found.join(QueryResult::Rays(vec![None; 4]))
        );
        assert!(found.join(QueryResult::Casts(vec![hit(9, 0.25), hit(9, 0.5), hit(9, 1.0), hit(3, 0.5)])));
        assert_eq!(found, QueryResult::Casts(vec![hit(9, 0.25), hit(2, 0.25), hit(9, 1.0), hit(3, 0.5)]));

        let some = |bodies: std::ops::Range<u32>| {
            bodies.map(|i| Overlap { body: BodyId::persistent(i), collider: 0 }).collect::<Vec<_>>()
        };
        let mut found = QueryResult::Overlaps(vec![some(3..6), some(0..0)]);
        assert!(found.join(QueryResult::Overlaps(vec![some(0..4), some(7..8)])));
        assert_eq!(found, QueryResult::Overlaps(vec![some(0..6), some(7..8)]));
        assert!(
            !found.join(QueryResult::Overlaps(vec![some(0..4)]))
                && !found.join(QueryResult::Casts(vec![None; 2]))
        );
        let many = MAX_FOUND as u32;
        assert!(found.join(QueryResult::Overlaps(vec![some(0..many - 1), some(7..8)])));
        assert!(matches!(found, QueryResult::Overlaps(_)));
        assert!(found.join(QueryResult::Overlaps(vec![some(0..0), some(0..1)])));
        assert_eq!(found, QueryResult::TooMuch);
        assert!(
            found.join(QueryResult::Overlaps(vec![some(0..4)])) && !found.join(QueryResult::Rays(vec![]))
        );
        assert_eq!(found, QueryResult::TooMuch);
    }
}
