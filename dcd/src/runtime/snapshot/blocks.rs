//! Writes and reads bytes in blocks, each with a hash chained to the block before. So a flipped bit, a
//! missing block or a swapped one is found before any of the block is used, and neither side needs the whole
//! snapshot in memory.
//!
//! A block consists of its length (u32, little endian), its bytes, and the BLAKE3 hash of the hash before,
//! the length and the bytes. An empty block ends the snapshot.

use std::io::{self, Read, Write};

use super::SnapshotError;

pub(super) type Hash = [u8; 32];

/// The size of every block but the last two, in bytes.
const BLOCK: usize = 1 << 20;

/// A writer that packs bytes into blocks. It is one type for all destinations, so that the code that encodes
/// a world is compiled once.
pub(super) struct BlockWriter<'a> {
    to: &'a mut dyn Write,
    before: Hash,
    block: Vec<u8>,
}

impl<'a> BlockWriter<'a> {
    pub(super) fn new(to: &'a mut dyn Write, header: Hash) -> Self {
        Self { to, before: header, block: Vec::with_capacity(BLOCK) }
    }

    /// Writes the last bytes, and the empty block that ends the snapshot.
    pub(super) fn finish(mut self) -> io::Result<()> {
        if !self.block.is_empty() {
            self.close_block()?;
        }
        self.close_block()?;
        self.to.flush()
    }

    fn close_block(&mut self) -> io::Result<()> {
        self.before = chained(&self.before, &self.block);
        self.to.write_all(&(self.block.len() as u32).to_le_bytes())?;
        self.to.write_all(&self.block)?;
        self.to.write_all(&self.before)?;
        self.block.clear();
        Ok(())
    }
}

impl Write for BlockWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.block.len() == BLOCK {
            self.close_block()?;
        }
        let count = bytes.len().min(BLOCK - self.block.len());
        self.block.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A reader that checks blocks and yields their bytes.
pub(super) struct BlockReader<'a> {
    from: &'a mut dyn Read,
    before: Hash,
    block: Vec<u8>,
    /// The number of bytes of the block that were yielded.
    given: usize,
    /// The number of bytes of the file that were read, for messages.
    taken: u64,
    ended: bool,
    failure: Option<SnapshotError>,
}

impl<'a> BlockReader<'a> {
    /// Makes a reader of what follows a header of this hash and length.
    pub(super) fn new(from: &'a mut dyn Read, (header, taken): (Hash, u64)) -> Self {
        Self { from, before: header, block: Vec::new(), given: 0, taken, ended: false, failure: None }
    }

    /// Takes the reason of a failed read, if the file is the reason.
    pub(super) fn failure(&mut self) -> Option<SnapshotError> {
        self.failure.take()
    }

    /// Checks that nothing but the end follows, once all that was saved has been read.
    pub(super) fn finish(mut self) -> Result<(), SnapshotError> {
        let at = self.taken;
        if self.given < self.block.len() || !self.ended && self.open_block()? {
            return Err(SnapshotError::Damaged(at));
        }
        match read_all(self.from, &mut [0])? {
            0 => Ok(()),
            _ => Err(SnapshotError::Damaged(self.taken)),
        }
    }

    /// Reads and checks the next block. Returns whether there is one.
    fn open_block(&mut self) -> Result<bool, SnapshotError> {
        let begin = self.taken;
        let mut length = [0; 4];
        self.take(&mut length)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > BLOCK {
            return Err(SnapshotError::Damaged(begin));
        }
        let mut block = std::mem::take(&mut self.block);
        block.resize(length, 0);
        self.take(&mut block)?;
        let mut hash = Hash::default();
        self.take(&mut hash)?;
        if hash != chained(&self.before, &block) {
            return Err(SnapshotError::Damaged(begin));
        }
        (self.block, self.given, self.before) = (block, 0, hash);
        self.ended = length == 0;
        Ok(!self.ended)
    }

    fn take(&mut self, into: &mut [u8]) -> Result<(), SnapshotError> {
        let read = read_all(self.from, into)?;
        self.taken += read as u64;
        if read == into.len() { Ok(()) } else { Err(SnapshotError::Truncated(self.taken)) }
    }
}

impl Read for BlockReader<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.given == self.block.len() && !into.is_empty() {
            if self.ended {
                return Ok(0);
            }
            if let Err(error) = self.open_block() {
                self.failure = Some(error);
                return Err(io::Error::other("the snapshot is damaged"));
            }
        }
        let count = into.len().min(self.block.len() - self.given);
        into[..count].copy_from_slice(&self.block[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

/// Fills `into` as far as there are bytes, and returns how many there were.
pub(super) fn read_all(from: &mut dyn Read, into: &mut [u8]) -> io::Result<usize> {
    let mut read = 0;
    while read < into.len() {
        match from.read(&mut into[read..]) {
            Ok(0) => break,
            Ok(count) => read += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(read)
}

fn chained(before: &Hash, block: &[u8]) -> Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(before).update(&(block.len() as u32).to_le_bytes()).update(block);
    *hasher.finalize().as_bytes()
}
