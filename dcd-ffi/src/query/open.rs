//! Keeps the queries that are submitted and not fetched yet.

use dcd::protocol::QueryResult;

use crate::handle::Slots;

/// Open queries of a world.
pub(crate) struct OpenQueries {
    pub slots: Slots<Submitted>,
    pub count: usize,
    pub cost: usize,
}

impl OpenQueries {
    pub(crate) const fn new() -> Self {
        Self { slots: Slots::new(), count: 0, cost: 0 }
    }
}

/// Queries that were submitted together.
pub(crate) struct Submitted {
    pub kind: Kind,
    pub cost: usize,
    pub answer: Answer,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Rays,
    Casts,
    Overlaps,
}

/// The answer to submitted queries, or how to ask for it.
pub(crate) enum Answer {
    /// The processes that compute the world answer under this number.
    Awaited(u64),
    Here(QueryResult),
}
