//! Defines scene queries (rays, shape casts, overlaps) that clients send about the bodies of the world, and their owners' answers.

use bincode::{Decode, Encode};

use crate::protocol::{ShapeHash, ShapeRecord, WorldPose, encoded_len, link};
use crate::space::{BodyId, Bounds, ClientId};

/// The most that one question may cost, see [`Query::cost`], and the most bodies that it may exclude.
pub const MAX_COST: usize = 1_024;
/// The most that all unanswered questions of one client may cost.
pub const MAX_OPEN_COST: usize = 4 * MAX_COST;
/// The most unanswered questions of one client.
pub const MAX_OPEN_QUERIES: usize = 64;
/// Cost of a shape that moves or overlaps; a ray, a point or a box costs 1.
pub const SHAPE_COST: usize = 8;
/// The least cost of a question for overlaps: its answer may be long.
pub const OVERLAPS_COST: usize = 64;
/// The most colliders that one question for overlaps may find.
pub const MAX_FOUND: usize = 4_096;
/// The longest question: with its envelope it fits a client's frame.
pub const MAX_QUERY_BYTES: usize = link::CLIENT_FRAME_BYTES - 64;
/// The largest shape that may turn during a cast, metres: the farther out, the finer the steps in which it is looked at.
pub const MAX_TURNING_M: f32 = 100.0;
/// The largest turn of a shape during a cast, radians: each turn is looked at in many steps.
pub const MAX_TURN: f32 = 64.0;

/// A scene query: rays, casts or overlaps, with one filter for all of them.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Query {
    /// The client's own, unlike those of its other questions.
    pub number: u64,
    /// The filter of all of its parts.
    pub filter: FilterRecord,
    /// The shapes that it names, parts before the compounds made of them. Each [suits clients](ShapeRecord::suits_clients).
    pub shapes: Vec<ShapeRecord>,
    /// The rays, casts or overlaps.
    pub parts: QueryParts,
}

/// The filter of a whole query: bodies and colliders that it ignores.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct FilterRecord {
    /// Kinds, as bits of Rapier's `QueryFilterFlags`.
    pub flags: u32,
    /// Groups that the questions belong to: colliders that meet none of them are left out. 0 filters nothing.
    pub groups: u32,
    /// Bodies in id order; at most [`MAX_COST`].
    pub exclude: Vec<BodyId>,
}

/// The parts of a query, all of them about the world after the same tick.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum QueryParts {
    /// The first hit of each ray.
    Rays(Vec<RayQuery>),
    /// The first hit of each moving shape.
    Casts(Vec<CastQuery>),
    /// All colliders at each place.
    Overlaps(Vec<OverlapQuery>),
}

/// A ray of a query.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayQuery {
    /// Where it starts, in world space, metres.
    pub origin: [f64; 3],
    /// Where it goes; of any length above 0.
    pub direction: [f32; 3],
    /// How far, metres; may be infinite.
    pub max_m: f64,
    /// Whether a body that it starts in is met there at once.
    pub solid: bool,
    /// Groups that it may find, and one body that it ignores.
    pub filter: PartFilter,
}

/// A shape cast: one shape that moves straight, and may turn on the way.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct CastQuery {
    /// Which.
    pub shape: ShapeHash,
    /// Where it starts.
    pub pose: WorldPose,
    /// How far its origin moves, metres.
    pub motion: [f32; 3],
    /// By how much it turns on the way: about this axis of the world, by its length in radians, at most [`MAX_TURN`].
    pub turn: [f32; 3],
    /// Metres from a body at which it counts as there; 0 if it turns.
    pub margin_m: f32,
    /// Whether what it overlaps at the start stops it only if it moves farther in; not if it turns, which may take for ever.
    pub leaves: bool,
    /// Groups that it may find, and one body that it ignores.
    pub filter: PartFilter,
}

/// An overlap query: one place.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct OverlapQuery {
    /// Where.
    pub place: Place,
    /// Groups that it may find, and one body that it ignores.
    pub filter: PartFilter,
}

/// The place of an overlap query.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub enum Place {
    /// In a shape.
    Shape(ShapeHash, WorldPose),
    /// Around a point of world space, metres.
    Point([f64; 3]),
    /// With its own box at this one, which may be infinite.
    Box(Bounds),
}

/// The filter of a single ray, cast or overlap; the default lets everything be found.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct PartFilter {
    /// Finds only colliders that are members of one of these groups.
    pub mask: u32,
    /// A body that it ignores, for example the one that asks.
    pub exclude: Option<BodyId>,
}

impl PartFilter {
    /// Ignores one body.
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

    /// Asks for the first hit of each ray.
    #[must_use]
    pub fn rays(rays: impl IntoIterator<Item = RayQuery>) -> Self {
        Self::of(QueryParts::Rays(rays.into_iter().collect()))
    }

    /// Asks for the colliders at each place. A [`Place::Shape`] is one of `shapes`, which is filled in by the caller;
    /// [`Query::intersect_shape`] asks about one shape.
    #[must_use]
    pub fn overlaps(places: impl IntoIterator<Item = Place>) -> Self {
        let overlap = |place| OverlapQuery { place, filter: PartFilter::default() };
        Self::of(QueryParts::Overlaps(places.into_iter().map(overlap).collect()))
    }

    /// Returns the cost of answering it, in rays.
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

    /// Returns whether it is short enough to be sent.
    #[doc(hidden)]
    pub fn fits(&self) -> bool {
        encoded_len(self) <= MAX_QUERY_BYTES
    }
}

impl RayQuery {
    /// Makes a ray without end that is solid and finds everything.
    #[must_use]
    pub fn new(origin: [f64; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, max_m: f64::INFINITY, solid: true, filter: PartFilter::default() }
    }

    /// Ends the ray after so many metres.
    #[must_use]
    pub fn up_to(self, max_m: f64) -> Self {
        Self { max_m, ..self }
    }

    /// Ignores one body, for example the one that asks.
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

/// The hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayAnswer {
    /// Which body.
    pub body: BodyId,
    /// Which of its colliders.
    pub collider: u32,
    /// Where, in world space, metres.
    pub point: [f64; 3],
    /// Outward unit normal there; zero where the ray starts inside.
    pub normal: [f32; 3],
    /// From the origin, metres.
    pub distance_m: f64,
    /// Part of a compound, triangle of a mesh.
    pub subshape: u32,
}

/// The hit of a moving shape.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct CastAnswer {
    /// Which body.
    pub body: BodyId,
    /// Which of its colliders.
    pub collider: u32,
    /// How much of its way the shape came, 0 to 1.
    pub fraction: f32,
    /// Where on the body, in world space, metres.
    pub point: [f64; 3],
    /// Outward unit normal of the body there.
    pub normal: [f32; 3],
    /// Where on the shape, in its own space, metres.
    pub point_on_shape: [f32; 3],
    /// Outward unit normal of the shape there, in its own space.
    pub normal_on_shape: [f32; 3],
    /// Part of a compound, triangle of a mesh.
    pub subshape: u32,
    /// Whether it overlapped the body at the start.
    pub inside: bool,
}

/// A collider at the place of an overlap query.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub struct Overlap {
    /// Which body.
    pub body: BodyId,
    /// Which of its colliders.
    pub collider: u32,
}

/// The result of a query, in the order of its parts.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum QueryResult {
    /// None where the ray met nothing.
    Rays(Vec<Option<RayAnswer>>),
    /// None where the shape met nothing.
    Casts(Vec<Option<CastAnswer>>),
    /// By body and collider; at most [`MAX_FOUND`] in all.
    Overlaps(Vec<Vec<Overlap>>),
    /// More overlaps than [`MAX_FOUND`].
    TooMuch,
}

impl QueryResult {
    /// Merges what others found for the same question: the nearest hit counts, and of equally near ones that of the lowest id.
    /// Returns whether both answer the same question.
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
                    // Several members hold the ground.
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

/// The answer of one member's own bodies, after the tick that the question came with.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Answer {
    /// Whose question.
    pub client: ClientId,
    /// Which.
    pub number: u64,
    /// What it found.
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
        // Those with most to overlook are too long for one.
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
