//! Keeps the last seconds of a recording in memory, in segments that each begin with a snapshot.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::time::Duration;

use super::file;

/// The chunks of the last seconds.
pub(super) struct Ring {
    time: Duration,
    /// The first chunk of the file.
    beginning: Vec<u8>,
    segments: VecDeque<Segment>,
}

struct Segment {
    from: Duration,
    chunks: Vec<Vec<u8>>,
}

impl Ring {
    /// Creates a ring that keeps at least so much time, and at most twice as much.
    pub(super) fn new(time: Duration) -> Self {
        Self { time, beginning: Vec::new(), segments: VecDeque::new() }
    }

    pub(super) fn wants_segment(&self, now: Duration) -> bool {
        self.segments.back().is_some_and(|segment| segment.from.saturating_add(self.time) <= now)
    }

    /// Begins a segment, and forgets those that are too old.
    pub(super) fn begin_segment(&mut self, now: Duration) {
        self.segments.push_back(Segment { from: now, chunks: Vec::new() });
        while self.segments.get(1).is_some_and(|second| second.from.saturating_add(self.time) <= now) {
            self.segments.pop_front();
        }
    }

    pub(super) fn put(&mut self, chunk: Vec<u8>) {
        match self.segments.back_mut() {
            Some(segment) => segment.chunks.push(chunk),
            None => self.beginning = chunk,
        }
    }

    /// Writes the kept chunks as a whole file.
    pub(super) fn write(&self, to: &mut impl Write) -> io::Result<()> {
        file::begin(to)?;
        let chunks = self.segments.iter().flat_map(|segment| &segment.chunks);
        let mut before = [0; 8];
        for chunk in std::iter::once(&self.beginning).chain(chunks) {
            before = file::write_chunk(to, before, chunk)?;
        }
        file::write_chunk(to, before, &[])?;
        to.flush()
    }
}
