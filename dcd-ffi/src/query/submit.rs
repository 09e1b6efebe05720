//! Rays whose answers come later: in a served world they are with the nodes that own the bodies.

use dcd::protocol::{MAX_OPEN_QUESTIONS, MAX_OPEN_RAYS, MAX_RAYS, Question, RayAnswer, RayQuestion};
use rapier3d::prelude::{Group, QueryFilterFlags};

use super::ray::{NO_RAY_HIT, cast, straight};
use super::{Batch, DcdFilter, DcdRay, DcdRayHit, user_data};
use crate::backend::Backend;
use crate::body::{self, check_bits};
use crate::guard::guard;
use crate::handle::{Slots, stale};
use crate::pointer::{Out, Room};
use crate::status::{DCD_ERR_BUSY, DcdStatus, Failure};
use crate::world::{DcdWorld, World, with};

/// Rays that were submitted and whose answer was not fetched yet. 0 is null; an id is never given again.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdQueryId {
    /// Opaque.
    pub v: u64,
}

/// The most rays that dcd_rays_submit takes, and the most bodies of its filter.
pub const DCD_MAX_SUBMITTED_RAYS: usize = 1024;
/// The most queries that a world may have open: submitted, and neither fetched nor cancelled.
pub const DCD_MAX_OPEN_QUERIES: usize = 64;
/// The most rays of all of them.
pub const DCD_MAX_OPEN_RAYS: usize = 4096;

const _: () = assert!(
    DCD_MAX_SUBMITTED_RAYS == MAX_RAYS
        && DCD_MAX_OPEN_QUERIES == MAX_OPEN_QUESTIONS
        && DCD_MAX_OPEN_RAYS == MAX_OPEN_RAYS
);

/// The open queries of a world.
pub(crate) struct OpenQueries {
    /// With how many rays each has.
    slots: Slots<(usize, Submitted)>,
    count: usize,
    rays: usize,
}

impl OpenQueries {
    pub(crate) const fn new() -> Self {
        Self { slots: Slots::new(), count: 0, rays: 0 }
    }
}

enum Submitted {
    /// By those who compute the world, under this number.
    Asked(u64),
    Answered(Vec<DcdRayHit>),
}

/// Asks what each of `count` rays meets first; dcd_query_poll fetches the answer. As dcd_cast_rays, and in a served world too: a
/// client or participant asks the nodes, each answers for the bodies that it owns, as they are after one and the same step, and
/// the nearest counts. That takes some steps, longer while nodes join or leave. In a local world the answer is there at once.
///
/// `rays` and `filter` are read during the call. `out` receives the id of the query, which is open until it is fetched or cancelled.
/// Errors: as dcd_cast_rays; DCD_ERR_ARGUMENT also for more than DCD_MAX_SUBMITTED_RAYS, DCD_ERR_BUSY with
/// DCD_MAX_OPEN_QUERIES or DCD_MAX_OPEN_RAYS open, DCD_ERR_NETWORK when the link is gone, DCD_ERR_UNSUPPORTED for a server or a node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_rays_submit(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    filter: *const DcdFilter,
    out: *mut DcdQueryId,
) -> DcdStatus {
    guard("dcd_rays_submit", || {
        // SAFETY: the caller vouches for `count` rays, the filter and `out`.
        let (batch, out) = unsafe { (Batch::new(rays, count, "rays", filter)?, Out::new(out, "out")?) };
        if count.max(batch.exclude.len()) > DCD_MAX_SUBMITTED_RAYS {
            return Err(Failure::argument(format!(
                "{count} rays, or the filter's {} bodies, are more than DCD_MAX_SUBMITTED_RAYS \
                 ({DCD_MAX_SUBMITTED_RAYS}); submit them in parts",
                batch.exclude.len()
            )));
        }
        with(world, |world| {
            let open = &world.queries;
            if open.count >= DCD_MAX_OPEN_QUERIES || open.rays + count > DCD_MAX_OPEN_RAYS {
                let why = format!(
                    "{} queries with {} rays are open; fetch or cancel some first",
                    open.count, open.rays
                );
                return Err(Failure::new(DCD_ERR_BUSY, why));
            }
            let submitted = match &world.backend {
                Backend::Served(_) => {
                    let question = batch.question(world)?;
                    Submitted::Asked(world.backend.submit(question)?)
                }
                _ => Submitted::Answered(batch.answers(&batch.ask(world)?, cast)?),
            };
            let open = &mut world.queries;
            (open.count, open.rays) = (open.count + 1, open.rays + count);
            let slot = open.slots.insert((count, submitted));
            out.write(world.mark.query(slot));
            Ok(())
        })
    })
}

/// Fetches the answer to submitted rays, without waiting: hits[i] belongs to rays[i], null where the ray met nothing, and
/// `count` receives their number. `hits` has `cap` entries; with `cap` 0 it may be null, to ask for the number. Once it is
/// fetched the query is closed and its id stale.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or query), DCD_ERR_BUSY while the answer is not there: nothing is written,
/// and the query stays open; DCD_ERR_SMALL_BUFFER (then `count` is written all the same, and the query stays open),
/// DCD_ERR_NETWORK when the link is gone.
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
        with(world, |world| {
            let slot = slot(world, query)?;
            if let Some(&(rays, Submitted::Asked(number))) = world.queries.slots.get(slot) {
                let Some(answers) = world.backend.answer(number)? else {
                    let why = "the answer is not there yet; go on stepping, and poll again";
                    return Err(Failure::new(DCD_ERR_BUSY, why));
                };
                let hits = answers.into_iter().map(|hit| hit.map_or(NO_RAY_HIT, |hit| told(world, &hit)));
                let hits = Submitted::Answered(hits.collect());
                *world.queries.slots.get_mut(slot).expect("looked at above") = (rays, hits);
            }
            if let Some((_, Submitted::Answered(hits))) = world.queries.slots.get(slot) {
                room.fill(hits.iter().copied())?;
            }
            close(world, slot);
            Ok(())
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
            if let Some(Submitted::Asked(number)) = close(world, slot) {
                world.backend.forget(number);
            }
            Ok(())
        })
    })
}

/// The place of an open query.
fn slot(world: &World, query: DcdQueryId) -> Result<u64, Failure> {
    let slot = world.mark.query_slot(query)?;
    world.queries.slots.get(slot).map(|_| slot).ok_or_else(|| stale("query", query.v))
}

fn close(world: &mut World, slot: u64) -> Option<Submitted> {
    let open = &mut world.queries;
    let (rays, submitted) = open.slots.remove(slot)?;
    (open.count, open.rays) = (open.count - 1, open.rays - rays);
    Some(submitted)
}

impl Batch<'_, DcdRay> {
    /// The rays as others are asked, and what all of them overlook.
    fn question(&self, world: &World) -> Result<Question, Failure> {
        let (flags, groups, mask) =
            self.filter.map_or((0, 0, u32::MAX), |filter| (filter.flags, filter.groups, filter.mask));
        check_bits(flags, QueryFilterFlags::all().bits(), "filter->flags")?;
        let exclude = self.excluded(world)?;
        let ray = |ray: &DcdRay| {
            let line = straight(ray)?;
            let own = if ray.exclude.v == 0 { None } else { Some(body::find(world, ray.exclude)?) };
            Ok(RayQuestion {
                origin: line.origin,
                direction: line.direction,
                max_m: line.max_m,
                solid: line.solid,
                mask: (Group::from_bits_retain(mask) & Group::from_bits_retain(ray.mask)).bits(),
                exclude: own,
            })
        };
        // Its number is the client's to give.
        Ok(Question { number: 0, flags, groups, exclude, rays: self.numbered(ray)? })
    }
}

fn told(world: &World, hit: &RayAnswer) -> DcdRayHit {
    DcdRayHit {
        body: world.mark.body(hit.body),
        user_data: user_data(world, hit.body),
        point: hit.point,
        normal: hit.normal,
        distance: hit.distance_m as f32,
        part: hit.collider,
        subshape: hit.subshape,
    }
}
