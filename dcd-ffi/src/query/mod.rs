//! Answers queries of the state as it is now, many per call: ray casts, shape casts, overlaps, nearest points.

use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Room, Sized32, check_bits};
use crate::registry::{self, World};
use crate::status::Failure;
use dcd::physics::{Queries, QueryError};
use dcd::protocol::{FilterRecord, PartFilter};
use dcd::space::BodyId;
use rapier3d::prelude::QueryFilterFlags;

/// In DcdFilter.flags: the queries overlook fixed bodies.
pub const DCD_FILTER_NO_FIXED: u32 = 1;
/// In DcdFilter.flags: the queries overlook kinematic bodies.
pub const DCD_FILTER_NO_KINEMATIC: u32 = 2;
/// In DcdFilter.flags: the queries overlook dynamic bodies.
pub const DCD_FILTER_NO_DYNAMIC: u32 = 4;
/// In DcdFilter.flags: the queries overlook sensors.
pub const DCD_FILTER_NO_SENSORS: u32 = 8;
/// In DcdFilter.flags: the queries overlook all but sensors.
pub const DCD_FILTER_NO_SOLIDS: u32 = 16;

/// Filter: what all queries of a call overlook. Start from DCD_FILTER_INIT, which overlooks nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdFilter {
    /// Size of this struct: sizeof(DcdFilter).
    pub struct_size: u32,
    /// DCD_FILTER_… bits.
    pub flags: u32,
    /// Groups that the queries belong to, as bits. Colliders whose mask meets none of them are overlooked. 0 asks no collider's
    /// mask.
    pub groups: u32,
    /// Groups that the queries meet, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Ids of the bodies that are overlooked; null when there are none.
    pub exclude: *const DcdBodyId,
    /// Number of entries in `exclude`.
    pub exclude_count: usize,
}

// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdFilter {
    const NAME: &'static str = "DcdFilter";
}

/// In the flags of DcdRay and DcdPointQuery: bodies are hollow. A ray that starts inside a body meets its surface from within. The
/// place nearest to a point inside a body is on its surface.
pub const DCD_QUERY_HOLLOW: u32 = 1;
/// In DcdShapeCast.flags: what the shape overlaps at the start stops it only if it moves farther in.
pub const DCD_QUERY_LEAVE: u32 = 2;

/// In the flags of DcdShapeHit and DcdPointHit: the hit began there. The shape overlaps the body at the start, or the point lies
/// inside the body.
pub const DCD_HIT_INSIDE: u32 = 1;

mod ray;
pub use ray::*;

mod cast;
pub use cast::*;

mod point;
pub use point::*;

mod overlap;
pub use overlap::*;

mod visit;
pub use visit::*;

pub(crate) mod open;

mod submit;
pub use submit::*;

const NOBODY: DcdBodyId = DcdBodyId { v: 0 };

/// Checked inputs that all queries have.
struct Batch<'a, Q> {
    queries: &'a [Q],
    name: &'static str,
    filter: Option<DcdFilter>,
    exclude: &'a [DcdBodyId],
}

/// World to ask, and what all queries of a call overlook.
struct Asked<'a> {
    world: &'a World,
    queries: Queries<'a>,
    filter: FilterRecord,
    mask: u32,
}

impl<'a, Q> Batch<'a, Q> {
    /// # Safety
    /// `queries` has `count` entries; `filter` is null, or it and what it points to are there during the call.
    unsafe fn new(
        queries: *const Q,
        count: usize,
        name: &'static str,
        filter: *const DcdFilter,
    ) -> Result<Self, Failure> {
        // SAFETY: the caller upholds the same contract.
        unsafe {
            let queries = pointer::slice(queries, count, name)?;
            if filter.is_null() {
                return Ok(Self { queries, name, filter: None, exclude: &[] });
            }
            let filter = pointer::read_sized(filter, "filter")?;
            let exclude = pointer::slice(filter.exclude, filter.exclude_count, "filter->exclude")?;
            Ok(Self { queries, name, filter: Some(filter), exclude })
        }
    }

    fn ask<'w>(&self, world: &'w World) -> Result<Asked<'w>, Failure> {
        let queries = world.dcd.queries()?;
        Ok(Asked { world, queries, filter: self.filter(world)?, mask: self.mask() })
    }

    /// Returns what all queries overlook.
    fn filter(&self, world: &World) -> Result<FilterRecord, Failure> {
        let (flags, groups) = self.filter.map_or((0, 0), |filter| (filter.flags, filter.groups));
        check_bits(flags, QueryFilterFlags::all().bits(), "filter->flags")?;
        Ok(FilterRecord { flags, groups, exclude: self.excluded(world)? })
    }

    /// Returns the groups that all queries meet.
    fn mask(&self) -> u32 {
        self.filter.map_or(u32::MAX, |filter| filter.mask)
    }

    /// Returns the bodies that all queries overlook, in order.
    fn excluded(&self, world: &World) -> Result<Vec<BodyId>, Failure> {
        let found = self.exclude.iter().map(|&body| registry::find(world, body));
        let mut exclude = found.collect::<Result<Vec<_>, _>>()?;
        exclude.sort_unstable();
        exclude.dedup();
        Ok(exclude)
    }

    /// Calls `look` with every query. An error says which query is wrong.
    fn numbered<R>(&self, look: impl FnMut(&Q) -> Result<R, Failure>) -> Result<Vec<R>, Failure> {
        self.first_wrong(self.queries.iter().map(look))
    }

    fn first_wrong<R>(
        &self,
        looked: impl IntoIterator<Item = Result<R, Failure>>,
    ) -> Result<Vec<R>, Failure> {
        let name = self.name;
        let wrong =
            |i, failure: Failure| Failure::new(failure.status, format!("{name}[{i}]: {}", failure.message));
        let numbered = looked.into_iter().enumerate();
        numbered.map(|(i, looked)| looked.map_err(|failure| wrong(i, failure))).collect()
    }

    /// Answers every query, many of them on the world's threads. An error says which query is wrong.
    fn answers<R: Send>(
        &self,
        world: &World,
        answer: impl Fn(&Asked<'_>, &Q) -> Result<R, Failure> + Sync,
    ) -> Result<Vec<R>, Failure>
    where
        Q: Sync,
    {
        let asked = self.ask(world)?;
        self.first_wrong(asked.queries.ask_about(self.queries, |query| answer(&asked, query)))
    }

    /// Writes one answer per query to `hits`.
    ///
    /// # Safety
    /// `hits` has an entry for each query.
    unsafe fn each<R: Send>(
        &self,
        world: DcdWorld,
        hits: *mut R,
        answer: impl Fn(&Asked<'_>, &Q) -> Result<R, Failure> + Sync,
    ) -> Result<(), Failure>
    where
        Q: Sync,
    {
        if !self.queries.is_empty() {
            pointer::check(hits, "hits")?;
        }
        registry::ask(world, |world| {
            let answers = self.answers(world, answer)?;
            for (i, hit) in answers.into_iter().enumerate() {
                // SAFETY: not null, aligned, and the caller vouches for the entries.
                unsafe { hits.add(i).write(hit) };
            }
            Ok(())
        })
    }

    /// Writes a list of answers per query: all lists to `room`, and where each ends to `ends`.
    ///
    /// # Safety
    /// `ends` has an entry for each query.
    unsafe fn lists<R: Send>(
        &self,
        world: DcdWorld,
        room: Room<R>,
        ends: *mut usize,
        answer: impl Fn(&Asked<'_>, &Q) -> Result<Vec<R>, Failure> + Sync,
    ) -> Result<(), Failure>
    where
        Q: Sync,
    {
        if !self.queries.is_empty() {
            pointer::check(ends, "ends")?;
        }
        registry::ask(world, |world| {
            let answers = self.answers(world, answer)?;
            let lengths: Vec<usize> = answers.iter().map(Vec::len).collect();
            if room.give(answers.into_iter().flatten().collect::<Vec<_>>().into_iter())? {
                // SAFETY: not null, aligned, and the caller vouches for the entries.
                unsafe { write_ends(lengths.into_iter(), ends) };
            }
            Ok(())
        })
    }
}

/// Writes where each of several lists of these lengths ends, if they lie one behind the other.
///
/// # Safety
/// `ends` is valid for writing an entry for each list.
unsafe fn write_ends(lengths: impl Iterator<Item = usize>, ends: *mut usize) {
    let mut end = 0;
    for (i, length) in lengths.enumerate() {
        end += length;
        // SAFETY: the caller vouches for the entries.
        unsafe { ends.add(i).write(end) };
    }
}

/// Returns the filter of a single ray, cast or overlap.
fn part_filter(world: &World, all: u32, mask: u32, exclude: DcdBodyId) -> Result<PartFilter, Failure> {
    let exclude = if exclude.v == 0 { None } else { Some(registry::find(world, exclude)?) };
    Ok(PartFilter { mask: all & mask, exclude })
}

fn refused(error: QueryError) -> Failure {
    Failure::argument(error.to_string())
}

fn user_data(world: &World, id: BodyId) -> u64 {
    world.dcd.user_data(id).unwrap_or(0) as u64
}
