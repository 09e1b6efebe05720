//! Reads the entries of a recording one after the other.

use std::io::Read;
use std::time::Duration;

use bincode::Decode;

use super::entry::{Beginning, Digests, Entry, Subject, take};
use super::{Cut, Maker, Reader, RecordingError};
use crate::space::{RegionId, Tick};

/// The entries of a recording after its beginning.
pub(super) struct Entries {
    reader: Reader<Box<dyn Read + Send>>,
    maker: Maker,
    chunk: Vec<u8>,
    read: usize,
    now: Duration,
    regions: Vec<RegionId>,
}

impl Entries {
    /// Opens a recording, and reads its beginning.
    pub(super) fn open(from: Box<dyn Read + Send>) -> Result<(Self, Subject), RecordingError> {
        let mut reader = Reader::new(from)?;
        let chunk = reader.next_chunk()?.ok_or(RecordingError::Empty)?;
        let mut rest = &chunk[..];
        let Beginning { maker, subject } = take(&mut rest)?;
        let read = chunk.len() - rest.len();
        Ok((Self { reader, maker, chunk, read, now: Duration::ZERO, regions: Vec::new() }, subject))
    }

    /// Returns the next entry; `None` at the end.
    pub(super) fn next<W: Decode<()>>(&mut self) -> Result<Option<W>, RecordingError> {
        while self.read == self.chunk.len() {
            match self.reader.next_chunk()? {
                Some(chunk) => (self.chunk, self.read) = (chunk, 0),
                None => return Ok(None),
            }
        }
        let mut rest = &self.chunk[self.read..];
        let Entry { after_ns, what } = take(&mut rest)?;
        self.read = self.chunk.len() - rest.len();
        self.now += Duration::from_nanos(after_ns);
        Ok(Some(what))
    }

    /// Returns recorded digests with their regions.
    pub(super) fn digests(&mut self, digests: Digests) -> (Tick, Vec<(RegionId, u64)>) {
        if let Some(regions) = digests.regions {
            self.regions = regions;
        }
        let values = digests.digests.into_iter().map(u64::from_le_bytes);
        (digests.tick, self.regions.iter().copied().zip(values).collect())
    }

    /// Returns the time of the last entry that was read, since the recording began.
    pub(super) fn now(&self) -> Duration {
        self.now
    }

    pub(super) fn maker(&self) -> &Maker {
        &self.maker
    }

    pub(super) fn cut(&self) -> Option<Cut> {
        self.reader.cut()
    }

    pub(super) fn hash(&self) -> [u8; 8] {
        self.reader.hash()
    }
}
