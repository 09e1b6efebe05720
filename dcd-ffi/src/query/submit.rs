//! Submits queries whose answers come later. In a served world the nodes that own the bodies give them.

use dcd::physics::ShapeLibrary;
use dcd::protocol::{
    CastQuery, Check, MAX_COST, MAX_FOUND, MAX_OPEN_COST, MAX_OPEN_QUERIES, MAX_QUERY_BYTES, MAX_TURN,
    MAX_TURNING_M, OVERLAPS_COST, OverlapQuery, Place, Query, QueryParts, QueryResult, SHAPE_COST,
};

use super::cast::{self, shape_hit, solid};
use super::overlap::{self, Somewhere};
use super::ray::{self, ray_hit};
use super::{
    Batch, DCD_QUERY_LEAVE, DcdBoxQuery, DcdFilter, DcdOverlap, DcdPointQuery, DcdRay, DcdRayHit,
    DcdShapeCast, DcdShapeHit, DcdShapeQuery,
};
use crate::guard::guard;
use crate::handle::stale;
use crate::ids::{DcdQueryId, DcdWorld};
use crate::pointer::{self, Out, Room};
use crate::query::open::{Answer, Kind, Submitted};
use crate::registry::{World, with};
use crate::status::{DCD_ERR_BUSY, DCD_ERR_LIMIT, DcdStatus, Failure};

/// Largest cost of one submission, and largest number of bodies of its filter. A ray costs 1, a shape that is cast or overlaps
/// DCD_SHAPE_COST, a point or a box 1. Overlaps that are submitted together cost DCD_OVERLAPS_COST at least.
pub const DCD_MAX_SUBMITTED_COST: usize = 1024;
/// Cost of a submitted shape.
pub const DCD_SHAPE_COST: usize = 8;
/// Least cost of overlaps that are submitted together.
pub const DCD_OVERLAPS_COST: usize = 64;
/// Largest number of queries that a world may have open: submitted, and neither fetched nor cancelled.
pub const DCD_MAX_OPEN_QUERIES: usize = 64;
/// Largest cost of all open queries of a world together.
pub const DCD_MAX_OPEN_COST: usize = 4096;
/// Largest number of bodies that the overlaps of one submission may find.
pub const DCD_MAX_SUBMITTED_OVERLAPS: usize = 4096;
/// Longest turn of a submitted cast, radians.
pub const DCD_MAX_SUBMITTED_TURN: f32 = 64.0;

/// Largest size of a shape that a submitted cast turns, and of the distance of its farthest point from its origin, metres.
pub const DCD_MAX_TURNING_SIZE: f32 = 100.0;

const _: () = assert!(
    DCD_MAX_SUBMITTED_COST == MAX_COST
        && DCD_SHAPE_COST == SHAPE_COST
        && DCD_OVERLAPS_COST == OVERLAPS_COST
        && DCD_MAX_OPEN_QUERIES == MAX_OPEN_QUERIES
        && DCD_MAX_OPEN_COST == MAX_OPEN_COST
        && DCD_MAX_SUBMITTED_OVERLAPS == MAX_FOUND
        && DCD_MAX_SUBMITTED_TURN == MAX_TURN
        && DCD_MAX_TURNING_SIZE == MAX_TURNING_M
);

/// Submits `count` rays, to find what each meets first; dcd_query_poll fetches the answer. It is as dcd_cast_rays, and works in a
/// served world too.
///
/// - Served world. A client, a participant or the server's program asks the nodes. Each node answers for the bodies that it owns,
///   as they are after one and the same step, and the nearest counts. That takes some steps, and longer while nodes join or leave.
/// - Unknown bodies. The nodes may find what this process does not know: bodies that a client with an area of interest was not told
///   of (dcd_interest_set), and bodies that come or go meanwhile. Such a hit has an id that is not valid (dcd_body_is_valid), and 0
///   as user_data and material.
/// - Local world. The answer is there at once.
/// - Server. What its program did since its last dcd_step is there for the query, which is then sent with the next dcd_step.
///
/// `rays` and `filter` are read during the call. `out` receives the id of the query, which is open until it is fetched or
/// cancelled.
/// Errors:
/// - As dcd_cast_rays.
/// - DCD_ERR_ARGUMENT also: more than DCD_MAX_SUBMITTED_COST, or more than 64 KiB on its way, shapes and filter included, as so
///   many rays take with as many bodies in the filter.
/// - DCD_ERR_BUSY: DCD_MAX_OPEN_QUERIES or DCD_MAX_OPEN_COST are open.
/// - DCD_ERR_NETWORK: the link is gone.
/// - DCD_ERR_UNSUPPORTED: a node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_rays_submit(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> DcdStatus {
    guard("dcd_cast_rays_submit", || {
        // SAFETY: the caller vouches for `count` rays, the filter and `out`.
        let (batch, out) = unsafe { (Batch::new(rays, count, "rays", filter)?, Out::new(out, "out")?) };
        submit(world, &batch, Kind::Rays, out, |world, _| {
            Ok(QueryParts::Rays(batch.numbered(|ray| ray::question(world, batch.mask(), ray))?))
        })
    })
}

/// Submits `count` shape casts, to find what each meets first; dcd_query_poll_casts fetches the answer. It is as dcd_cast_shapes,
/// where and when dcd_cast_rays_submit answers. The shapes travel along, and may be destroyed after the call.
///
/// Errors:
/// - As dcd_cast_rays_submit, DCD_ERR_STALE_ID also for a shape.
/// - DCD_ERR_ARGUMENT also: a mesh or terrain, a turn longer than DCD_MAX_SUBMITTED_TURN, a turn of a shape larger than
///   DCD_MAX_TURNING_SIZE, or a turn with DCD_QUERY_LEAVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_shapes_submit(
    world: DcdWorld,
    casts: *const DcdShapeCast,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> DcdStatus {
    guard("dcd_cast_shapes_submit", || {
        // SAFETY: the caller vouches for `count` casts, the filter and `out`.
        let (batch, out) = unsafe { (Batch::new(casts, count, "casts", filter)?, Out::new(out, "out")?) };
        submit(world, &batch, Kind::Casts, out, |world, shapes| {
            let named = |cast: &DcdShapeCast| {
                let shape = shapes.intern(solid(world, cast.shape)?)?;
                Ok(CastQuery { shape, ..submitted_cast(world, batch.mask(), cast)? })
            };
            Ok(QueryParts::Casts(batch.numbered(named)?))
        })
    })
}

fn submitted_cast(world: &World, mask: u32, cast: &DcdShapeCast) -> Result<CastQuery, Failure> {
    let [x, y, z] = cast.turn;
    if x * x + y * y + z * z > MAX_TURN * MAX_TURN {
        return Err(Failure::argument("turn is longer than DCD_MAX_SUBMITTED_TURN; submit it in parts"));
    }
    if cast.turn != [0.0; 3] && cast.flags & DCD_QUERY_LEAVE != 0 {
        return Err(Failure::argument("flags has DCD_QUERY_LEAVE; what is submitted turns without it"));
    }
    cast::question(world, mask, cast)
}

/// Submits `count` shapes, to find every body that each overlaps; dcd_query_poll_overlaps fetches the answer. It is as
/// dcd_overlap_shapes, where and when dcd_cast_rays_submit answers. The shapes travel along, and may be destroyed after the call.
///
/// Errors: as dcd_cast_rays_submit, DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_shapes_submit(
    world: DcdWorld,
    shapes: *const DcdShapeQuery,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> DcdStatus {
    // SAFETY: the caller vouches for `count` shapes, the filter and `out`.
    guard("dcd_overlap_shapes_submit", || unsafe { submit_overlaps(world, shapes, count, filter, out) })
}

/// Submits `count` points, to find every body that each lies in; dcd_query_poll_overlaps fetches the answer. It is as
/// dcd_overlap_points, where and when dcd_cast_rays_submit answers.
///
/// Errors: as dcd_cast_rays_submit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_points_submit(
    world: DcdWorld,
    points: *const DcdPointQuery,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> DcdStatus {
    // SAFETY: the caller vouches for `count` points, the filter and `out`.
    guard("dcd_overlap_points_submit", || unsafe { submit_overlaps(world, points, count, filter, out) })
}

/// Submits `count` boxes, to find every body whose AABB touches each; dcd_query_poll_overlaps fetches the answer. It is as
/// dcd_overlap_boxes, where and when dcd_cast_rays_submit answers.
///
/// Errors: as dcd_cast_rays_submit, DCD_ERR_ARGUMENT also for a box whose min is above its max.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_boxes_submit(
    world: DcdWorld,
    boxes: *const DcdBoxQuery,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> DcdStatus {
    // SAFETY: the caller vouches for `count` boxes, the filter and `out`.
    guard("dcd_overlap_boxes_submit", || unsafe { submit_overlaps(world, boxes, count, filter, out) })
}

/// # Safety
/// As [`Batch::new`] and [`Out::new`].
unsafe fn submit_overlaps<Q: Somewhere>(
    world: DcdWorld,
    queries: *const Q,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> Result<(), Failure> {
    // SAFETY: the caller upholds the same contract.
    let (batch, out) = unsafe { (Batch::new(queries, count, Q::NAME, filter)?, Out::new(out, "out")?) };
    submit(world, &batch, Kind::Overlaps, out, |world, shapes| {
        let named = |query: &Q| {
            let OverlapQuery { place, filter } = overlap::question(world, batch.mask(), query)?;
            let place = match (place, query.shape(world)?) {
                (Place::Shape(_, pose), Some(shape)) => Place::Shape(shapes.intern(shape)?, pose),
                (place, _) => place,
            };
            Ok(OverlapQuery { place, filter })
        };
        Ok(QueryParts::Overlaps(batch.numbered(named)?))
    })
}

/// Fetches the answer to submitted rays, without waiting: hits[i] belongs to rays[i], null where the ray met nothing, and `count`
/// receives their number. `hits` has `cap` entries. With `cap` 0, `hits` may be null, to ask for the number, and the query stays
/// open unless that is 0. Once the answer is fetched, the query is closed and its id is stale.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world or query).
/// - DCD_ERR_ARGUMENT: a query that is not of rays.
/// - DCD_ERR_BUSY: the answer is not there yet. Nothing is written, and the query stays open.
/// - DCD_ERR_SMALL_BUFFER: `count` is written all the same, and the query stays open.
/// - DCD_ERR_NETWORK: the link is gone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_query_poll(
    world: DcdWorld,
    query: DcdQueryId,
    hits: *mut DcdRayHit,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_query_poll", || {
        // SAFETY: the caller vouches for `cap` hits and for `count`.
        let room = unsafe { Room::new(hits, cap, count, ["hits", "count"])? };
        fetch(world, query, Kind::Rays, |world, found| match found {
            QueryResult::Rays(hits) => room.give(hits.iter().map(|&hit| ray_hit(world, hit))),
            _ => Err(too_much()),
        })
    })
}

/// Fetches the answer to submitted casts: hits[i] belongs to casts[i]. All else is as in dcd_query_poll.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_query_poll_casts(
    world: DcdWorld,
    query: DcdQueryId,
    hits: *mut DcdShapeHit,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_query_poll_casts", || {
        // SAFETY: the caller vouches for `cap` hits and for `count`.
        let room = unsafe { Room::new(hits, cap, count, ["hits", "count"])? };
        fetch(world, query, Kind::Casts, |world, found| match found {
            QueryResult::Casts(hits) => room.give(hits.iter().map(|&hit| shape_hit(world, hit))),
            _ => Err(too_much()),
        })
    })
}

/// Fetches the answer to submitted overlaps. The outputs are as of dcd_overlap_shapes, and `ends` has an entry for each query that
/// was submitted. All else is as in dcd_query_poll, with `found` for `hits` and `total` for `count`.
///
/// Errors: as dcd_query_poll, and DCD_ERR_LIMIT (more than DCD_MAX_SUBMITTED_OVERLAPS were found; then the query is closed).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_query_poll_overlaps(
    world: DcdWorld,
    query: DcdQueryId,
    found: *mut DcdOverlap,
    cap: usize,
    ends: *mut usize,
    total: *mut usize,
) -> DcdStatus {
    guard("dcd_query_poll_overlaps", || {
        // SAFETY: the caller vouches for `cap` overlaps and for `total`.
        let room = unsafe { Room::new(found, cap, total, ["found", "total"])? };
        fetch(world, query, Kind::Overlaps, |world, found| {
            let QueryResult::Overlaps(lists) = found else { return Err(too_much()) };
            if !lists.is_empty() {
                pointer::check(ends, "ends")?;
            }
            let told = lists.iter().flatten().map(|found| overlap::overlap(world, found));
            let given = room.give(told.collect::<Vec<_>>().into_iter())?;
            if given {
                // SAFETY: checked above; the caller vouches for as many entries as were submitted.
                unsafe { super::write_ends(lists.iter().map(Vec::len), ends) };
            }
            Ok(given)
        })
    })
}

/// Closes a query whose answer is not wanted any more.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or query).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_query_cancel(world: DcdWorld, query: DcdQueryId) -> DcdStatus {
    guard("dcd_query_cancel", || {
        with(world, |world| {
            let slot = slot(world, query)?;
            if let Some(Answer::Awaited(number)) = close(world, slot) {
                world.dcd.forget(number);
            }
            Ok(())
        })
    })
}

/// Opens a query, and asks or answers it.
fn submit<Q>(
    world: DcdWorld,
    batch: &Batch<'_, Q>,
    kind: Kind,
    out: Out<DcdQueryId>,
    ask: impl FnOnce(&World, &mut ShapeLibrary) -> Result<QueryParts, Failure>,
) -> Result<(), Failure> {
    let (items, bodies) = (batch.queries.len(), batch.exclude.len());
    if items.max(bodies) > DCD_MAX_SUBMITTED_COST {
        return Err(too_dear(&format!("{items} {}, or {bodies} bodies to overlook,", batch.name)));
    }
    with(world, |world| {
        world.dcd.sees("ask by rays, shapes and points")?;
        let mut shapes = ShapeLibrary::default();
        let (filter, asked) = (batch.filter(world)?, ask(world, &mut shapes)?);
        // The client gives the query its number.
        let question = Query { number: 0, filter, shapes: shapes.records(), parts: asked };
        check(&question)?;
        let (cost, open) = (question.cost(), &world.queries);
        if open.count >= DCD_MAX_OPEN_QUERIES || open.cost + cost > DCD_MAX_OPEN_COST {
            let why = format!(
                "{} queries that cost {} are open; fetch or cancel some first",
                open.count, open.cost
            );
            return Err(Failure::new(DCD_ERR_BUSY, why));
        }
        let answer = Answer::Awaited(world.dcd.submit(question)?);
        let open = &mut world.queries;
        (open.count, open.cost) = (open.count + 1, open.cost + cost);
        let slot = open.slots.insert(Submitted { kind, cost, answer });
        out.write(world.mark.query(slot));
        Ok(())
    })
}

fn check(question: &Query) -> Result<(), Failure> {
    let cost = question.cost();
    if cost > DCD_MAX_SUBMITTED_COST {
        return Err(too_dear(&format!("a cost of {cost}")));
    }
    if !question.fits() {
        return Err(Failure::argument(format!(
            "what is submitted is longer than {MAX_QUERY_BYTES} bytes on its way; submit it in parts, or \
             simpler shapes"
        )));
    }
    question.check().map_err(|error| Failure::argument(format!("{error}; submit something else")))
}

fn too_dear(what: &str) -> Failure {
    Failure::argument(format!(
        "{what} is more than DCD_MAX_SUBMITTED_COST ({DCD_MAX_SUBMITTED_COST}); submit it in parts"
    ))
}

fn too_much() -> Failure {
    Failure::new(
        DCD_ERR_LIMIT,
        format!(
            "more than DCD_MAX_SUBMITTED_OVERLAPS ({DCD_MAX_SUBMITTED_OVERLAPS}) were found; submit less at a \
             time, or smaller places"
        ),
    )
}

/// Gives the answer to the caller, and closes the query once all of it is given.
fn fetch(
    world: DcdWorld,
    query: DcdQueryId,
    kind: Kind,
    give: impl FnOnce(&World, &QueryResult) -> Result<bool, Failure>,
) -> Result<(), Failure> {
    with(world, |world| {
        let slot = slot(world, query)?;
        let here = world.queries.slots.get(slot).expect("looked at above");
        if here.kind != kind {
            return Err(Failure::argument(format!("the query is not of these; {}", here.kind.remedy())));
        }
        if let Answer::Awaited(number) = here.answer {
            let Some(found) = world.dcd.answer(number)? else {
                let why = "the answer is not there yet; go on stepping, and poll again";
                return Err(Failure::new(DCD_ERR_BUSY, why));
            };
            let here = world.queries.slots.get_mut(slot).expect("looked at above");
            here.answer = Answer::Here(found);
        }
        let here = world.queries.slots.get(slot).expect("looked at above");
        let Answer::Here(found) = &here.answer else { unreachable!("it is here by now") };
        let (is_lost, given) = (*found == QueryResult::TooMuch, give(world, found));
        if is_lost || matches!(given, Ok(true)) {
            close(world, slot);
        }
        given.map(drop)
    })
}

impl Kind {
    fn remedy(self) -> &'static str {
        match self {
            Self::Rays => "fetch it by dcd_query_poll",
            Self::Casts => "fetch it by dcd_query_poll_casts",
            Self::Overlaps => "fetch it by dcd_query_poll_overlaps",
        }
    }
}

/// Returns the place of an open query.
fn slot(world: &World, query: DcdQueryId) -> Result<u64, Failure> {
    let slot = world.mark.query_slot(query)?;
    world.queries.slots.get(slot).map(|_| slot).ok_or_else(|| stale("query", query.v))
}

fn close(world: &mut World, slot: u64) -> Option<Answer> {
    let open = &mut world.queries;
    let Submitted { cost, answer, .. } = open.slots.remove(slot)?;
    (open.count, open.cost) = (open.count - 1, open.cost - cost);
    Some(answer)
}
